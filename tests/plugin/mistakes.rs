//! Mistakes of a host.

use std::sync::Arc;

use ash::vk;
use glam::{Affine3A, Vec3};
use neubrdf::plugin::{Change, Channel, Error, Frame, Options, PixelFormat, Renderer, Target};
use neubrdf::render::Features;
use neubrdf::scene::brdf::NeuBrdf;
use neubrdf::scene::{Brdf, Camera, Environment, Instance, Lens, Scene, Sun, Surface};

use crate::changes::{orbit, uneven_sky};
use crate::common;
use crate::common::random_neubrdf::{Shape, random_neubrdf};
use crate::frames::{expected, frame, options_of, renderer, scene, submit, wait};
use crate::host::in_lavapipe_hosts;

#[test]
fn mistakes_are_errors_and_change_nothing() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        frame(host, &device, &mut renderer, 1);

        let nowhere = Affine3A::from_translation(Vec3::splat(f32::NAN));
        let material = |surface| Change::Material { index: 1, material: common::material("new", surface) };
        let wrong = [
            Change::Transform { instance: 3, object_to_world: Affine3A::IDENTITY },
            Change::Transform { instance: 0, object_to_world: nowhere },
            Change::Transform { instance: 0, object_to_world: Affine3A::from_scale(Vec3::ZERO) },
            Change::Instances(vec![]),
            Change::Instances(vec![Instance { mesh: 3, object_to_world: Affine3A::IDENTITY }]),
            Change::Material { index: 3, material: common::lamp(1.0) },
            Change::Material { index: 2, material: common::lamp(f32::INFINITY) },
            material(common::diffuse(1.5)),
            material(Surface::Measured { brdf: 0 }),
            Change::Camera(Camera { target: scene().camera.eye, ..scene().camera }),
            Change::Environment(Some(Environment { texels: vec![], ..Environment::constant(Vec3::ONE) })),
            Change::Sun(Some(Sun { direction: Vec3::splat(2.0), irradiance: Vec3::ONE })),
        ];
        for change in wrong {
            // One that would do comes first, and must not be made either.
            let error = renderer.update(&[orbit(&scene(), 10.0), change.clone()]).unwrap_err();
            assert!(matches!(error, Error::Scene(_)), "{change:?}: {error}");
        }
        let lens = Some(Lens { radius: 0.1, focus_distance: 2.0 });
        let sun = Sun { direction: Vec3::Y, irradiance: Vec3::ONE };
        for (change, lacks) in [
            (Change::Camera(Camera { lens, ..scene().camera }), "a lens"),
            (Change::Sun(Some(sun)), "a sun"),
            (Change::Environment(Some(uneven_sky())), "a sky that is brighter here than there"),
            (material(Surface::Dielectric { ior: 1.5, alpha: 0.0 }), "dielectric"),
        ] {
            let error = renderer.update(&[orbit(&scene(), 10.0), change]).unwrap_err();
            assert!(error.to_string().contains(lacks) && matches!(error, Error::NewRenderer { .. }), "{error}");
        }
        assert_eq!(*renderer.scene(), scene());
        assert_eq!(renderer.samples(), 1);
        // The new renderer that they ask for.
        let with_lens = renderer.scene_with(&[Change::Camera(Camera { lens, ..scene().camera })]).unwrap();
        let mut other = self::renderer(host, &device, with_lens.clone());
        assert!(frame(host, &device, &mut other, 1).0 == expected(host, &with_lens, 1));
        assert!(renderer.scene_with(&[Change::Instances(vec![])]).is_err());
        for reserve in
            [Features { families: 1 << 31, ..Features::NONE }, Features { neubrdf_queues: 0, ..Features::NONE }]
        {
            let error = Renderer::new(&device, scene(), &Options { reserve, ..options_of(host) }).err().unwrap();
            assert!(error.to_string().contains("Features::"), "{error}");
        }

        // More memory than there is. A film beyond the largest buffer, and one beyond 2³² pixels.
        for [width, height] in [[60000, 60000], [u32::MAX, u32::MAX], [0, 10]] {
            let error = renderer.resize(width, height).unwrap_err();
            assert!(matches!(error, Error::Gpu(_) | Error::Render(_)), "{error}");
        }
        assert_eq!(renderer.size(), [40, 30]);

        // Frames that are not known to be done.
        let in_flight: Vec<_> = (0..3).map(|_| submit(host, &device, &mut renderer, 1)).collect();
        let recording = host.begin();
        let mut commands = host.wrap(&device, &recording);
        let nothing = Frame { samples: 1, targets: &[], estimates_error: false };
        let error = renderer.record(&mut commands, &nothing).unwrap_err();
        assert!(matches!(error, Error::FramesInFlight { pending: 3, most: 3 }), "{error}");
        for frame in in_flight {
            wait(host, &mut renderer, frame);
        }

        // Targets that are too small, of what is not gathered, or in no light that there is.
        let small = host.buffer(16);
        let target = Target::buffer(small.target(), PixelFormat::Rgba32Float);
        let albedo = Target { channel: Channel::Albedo, ..target };
        let error = renderer.record(&mut commands, &Frame::new(1, &[albedo])).unwrap_err();
        assert!(matches!(error, Error::NoFeatures { channel: "albedo" }), "{error}");
        let blinding = Target { exposure: f32::NAN, ..target };
        let error = renderer.record(&mut commands, &Frame::new(1, &[blinding])).unwrap_err();
        assert!(matches!(error, Error::Exposure { .. }), "{error}");
        let image = host.image([40, 30], vk::Format::R32G32B32A32_SFLOAT);
        let beyond = Target::image(image.target().with_origin([1, 0]), PixelFormat::Rgba32Float);
        for (target, needed) in [(target, "19200"), (beyond, "40x30")] {
            let error = renderer.record(&mut commands, &Frame::new(1, &[target])).unwrap_err();
            assert!(matches!(&error, Error::TargetSize { needed: found, .. } if found == needed), "{error}");
        }
        commands.finish().unwrap();
        // SAFETY: it was not submitted.
        unsafe { host.forget(recording) };
        host.free_image(image);
        let other = host.lend();
        let recording = host.begin();
        let error = renderer.record(&mut host.wrap(&other, &recording), &nothing).unwrap_err();
        assert!(matches!(error, Error::OtherDevice), "{error}");
        // SAFETY: as above.
        unsafe { host.forget(recording) };
        host.free_buffer(small);

        // After all that, the picture is that of the frames that were recorded.
        assert_eq!(renderer.samples(), 4);
        assert!(frame(host, &device, &mut renderer, 1).0 == expected(host, &scene(), 5));
    });
}

#[test]
fn a_scene_with_a_flaw_is_refused() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        type Spoil = fn(&mut Scene);
        let flaws: [(&str, Spoil); 7] = [
            ("of a NeuBRDF", |scene| {
                let model =
                    NeuBrdf { layers: Vec::new(), ..random_neubrdf(Shape { n_side: 1, codes: 9, ..Shape::FULL }, 1) };
                scene.brdfs.push(Arc::new(Brdf::NeuBrdf(Box::new(model))));
            }),
            ("material", |scene| scene.meshes[0].materials = vec![9]),
            ("vertex", |scene| scene.meshes[0].triangles[0][1] = 99),
            ("normals", |scene| scene.meshes[1].normals.truncate(3)),
            ("position", |scene| scene.meshes[0].positions[0].x = f32::NAN),
            ("mesh of instance", |scene| scene.instances[0].mesh = 7),
            ("film", |scene| scene.film.width = 0),
        ];
        for (part, spoil) in flaws {
            let mut flawed = scene();
            spoil(&mut flawed);
            let error = Renderer::new(&device, flawed, &options_of(host)).err().unwrap();
            assert!(matches!(error, Error::Scene(_)) && error.to_string().contains(part), "{part}: {error}");
        }
    });
}
