//! The path tracer in a host that owns instance, device, queue, command buffers and targets: nothing but recordings, the same
//! bits as `render::Renderer`, and nothing that synchronization validation has a word to say about.
#![allow(unsafe_code)] // the host here speaks Vulkan itself

mod common;
#[path = "common/frames.rs"]
mod frames;
#[path = "common/host.rs"]
mod host;

use std::sync::Arc;

use ash::vk;
use common::random_neubrdf::{Shape, random_neubrdf};
use frames::{Bits, alone, bits, expected, frame, options, options_of, picture_of, renderer, scene, submit, wait};
use glam::{Affine3A, Quat, Vec3};
use host::{HostMemory, Recording, in_every_host, in_lavapipe_hosts};
use neubrdf::gpu::{self, Commands, HostBuffer, HostImage};
use neubrdf::image::{Samples, plane, tone_map};
use neubrdf::plugin::{Change, Channel, Error, Frame, Options, PixelFormat, Renderer, Target, Update};
use neubrdf::render::bvh::Bvh;
use neubrdf::render::{self, Features, Sampler, Settings};
use neubrdf::scene::{Brdf, Camera, Environment, Film, Instance, Lens, Material, Mesh, Scene, Sun, Surface};

/// The view from another side.
fn orbit(scene: &Scene, degrees: f32) -> Change {
    let camera = scene.camera.clone();
    let turn = Quat::from_rotation_y(degrees.to_radians());
    Change::Camera(Camera { eye: camera.target + turn * (camera.eye - camera.target), ..camera })
}

#[test]
fn a_renderer_may_be_sent_to_another_thread() {
    fn sends<T: Send>() {}
    sends::<Renderer>();
    sends::<Error>();
}

#[test]
fn frames_are_the_bits_of_the_path_tracer_on_its_own() {
    in_every_host(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let mut alone = alone(host, &scene());
        // Any number of samples: the mean is rounded once.
        let mut total = 0;
        for samples in [1, 2, 1, 7] {
            total += samples;
            let (picture, status) = frame(host, &device, &mut renderer, samples);
            alone.render_pass(samples).unwrap();
            assert!(picture.iter().any(|pixel| pixel[0] != 0), "black");
            assert!(picture == picture_of(&alone), "{total} samples");
            assert_eq!((status.samples, status.rejected), (total, 0));
            assert_eq!(status.error, (total >= 4).then(|| alone.estimate_error().unwrap()));
        }
        // No more samples: the same picture again.
        let (picture, status) = frame(host, &device, &mut renderer, 0);
        assert!(picture == picture_of(&alone) && status.samples == total);
    });
}

#[test]
fn two_renderers_share_a_command_buffer() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let scenes = [scene(), common::still_life(common::diffuse(0.7))];
        let mut renderers = scenes.clone().map(|scene| renderer(host, &device, scene));
        let buffers = scenes.each_ref().map(|scene| host.buffer(u64::from(scene.film.width * scene.film.height) * 16));
        let recording = host.begin();
        let mut commands = host.wrap(&device, &recording);
        for (renderer, buffer) in renderers.iter_mut().zip(&buffers) {
            let targets = [Target::buffer(buffer.target(), PixelFormat::Rgba32Float)];
            renderer.record(&mut commands, &Frame { samples: 2, targets: &targets, estimates_error: false }).unwrap();
        }
        commands.finish().unwrap();
        host.to_host(&recording);
        host.submit(&recording);
        host.wait(recording);
        for ((scene, buffer), renderer) in scenes.iter().zip(buffers).zip(&mut renderers) {
            assert!(bits(&buffer.read()) == expected(host, scene, 2));
            assert_eq!(renderer.complete(1).unwrap().error, None, "nobody asked");
            host.free_buffer(buffer);
        }
    });
}

#[test]
fn renderers_on_several_threads_share_a_device() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let scenes = [scene(), common::still_life(common::diffuse(0.3))];
        // A command pool is for one thread at a time: each has its own.
        let places = [0; 2].map(|_| (host.pool(), host.buffer(40 * 30 * 16)));
        let recordings = places.each_ref().map(|(pool, _)| host.begin_in(*pool));
        let renderers: Vec<Renderer> = std::thread::scope(|threads| {
            let record = |(scene, (recording, target)): (&Scene, (&Recording, HostBuffer))| {
                let (scene, commands, device) = (scene.clone(), recording.commands, &device);
                threads.spawn(move || {
                    let mut renderer = renderer(host, device, scene);
                    // SAFETY: the command buffer is being recorded, by this thread alone.
                    let mut commands = unsafe { Commands::wrap(device, commands) };
                    let targets = [Target::buffer(target, PixelFormat::Rgba32Float)];
                    renderer.record(&mut commands, &Frame::new(2, &targets)).unwrap();
                    commands.finish().unwrap();
                    renderer
                })
            };
            let targets = places.iter().map(|(_, buffer)| buffer.target());
            let threads: Vec<_> = scenes.iter().zip(recordings.iter().zip(targets)).map(record).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        for recording in &recordings {
            host.to_host(recording);
            host.submit(recording);
        }
        recordings.into_iter().for_each(|recording| host.wait(recording));
        drop(renderers);
        for (scene, (pool, buffer)) in scenes.iter().zip(places) {
            assert!(bits(&buffer.read()) == expected(host, scene, 2));
            host.free_buffer(buffer);
            host.free_pool(pool);
        }
    });
}

#[test]
fn frames_in_flight_see_the_camera_and_the_scene_they_were_recorded_with() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let changes = |renderer: &Renderer, index: u32| {
            let place = Affine3A::from_translation(Vec3::new(0.2 * index as f32, 0.0, 0.0));
            let mut material = renderer.scene().materials[0].clone();
            material.surface = common::diffuse(0.2 * index as f32);
            [
                orbit(renderer.scene(), 20.0),
                Change::Transform { instance: 1, object_to_world: place },
                Change::Material { index: 0, material },
            ]
        };
        let mut waiting = renderer(host, &device, scene());
        let mut flying = renderer(host, &device, scene());
        let mut in_flight = Vec::new();
        let mut pictures = Vec::new();
        for index in 0..3 {
            waiting.update(&changes(&waiting, index)).unwrap();
            flying.update(&changes(&flying, index)).unwrap();
            pictures.push(frame(host, &device, &mut waiting, 2).0);
            in_flight.push(submit(host, &device, &mut flying, 2));
        }
        assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2]);
        for (picture, frame) in pictures.into_iter().zip(in_flight) {
            assert!(wait(host, &mut flying, frame).0 == picture);
        }
    });
}

/// Changes that keep the scene's features, and what the scene is afterwards.
fn changes() -> Vec<(&'static str, Vec<Change>)> {
    let scene = scene();
    let place = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.0, 0.7, 1.3),
        Quat::from_rotation_z(0.4),
        Vec3::new(-0.5, 0.2, 0.3),
    );
    let transform = |instance| Change::Transform { instance, object_to_world: place };
    let material = |index: u32, change: &dyn Fn(&mut Material)| {
        let mut material = scene.materials[index as usize].clone();
        change(&mut material);
        Change::Material { index, material }
    };
    let twice = vec![
        scene.instances[0],
        scene.instances[1],
        scene.instances[2],
        Instance { mesh: 1, object_to_world: Affine3A::from_translation(Vec3::new(1.5, 0.0, -0.5)) },
    ];
    let sky = Environment {
        width: 4,
        height: 2,
        texels: (0..8).map(|index| Vec3::splat(0.1 * index as f32)).collect(),
        rotation_degrees: 30.0,
    };
    vec![
        ("camera", vec![orbit(&scene, 35.0)]),
        ("moved sphere", vec![transform(1)]),
        ("moved lamp", vec![transform(2)]),
        ("one sphere more", vec![Change::Instances(twice)]),
        ("colour", vec![material(0, &|material| material.surface = common::diffuse(0.9))]),
        ("roughness", vec![material(1, &|material| material.surface = common::conductor(0.5, 0.05))]),
        ("emission", vec![material(2, &|material| material.emission = Vec3::new(1.0, 5.0, 20.0))]),
        ("both sides", vec![material(2, &|material| material.emits_both_sides = true)]),
        ("sky", vec![Change::Environment(Some(sky))]),
        ("all at once", vec![orbit(&scene, -20.0), transform(2), material(2, &|m| m.emission = Vec3::splat(3.0))]),
    ]
}

fn apply(scene: &mut Scene, change: &Change) {
    match change.clone() {
        Change::Camera(camera) => scene.camera = camera,
        Change::Transform { instance, object_to_world } => {
            scene.instances[instance as usize].object_to_world = object_to_world;
        }
        Change::Instances(instances) => scene.instances = instances,
        Change::Material { index, material } => scene.materials[index as usize] = material,
        change @ (Change::Brdf { .. } | Change::Deform { .. }) => panic!("{change:?}"),
        Change::Environment(environment) => scene.environment = environment,
        Change::Sun(sun) => scene.sun = sun,
    }
}

#[test]
fn a_changed_scene_is_rendered_as_by_a_renderer_made_for_it() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        // One renderer sees all changes, one after the other: what an earlier one left would show.
        let mut changed = renderer(host, &device, scene());
        let mut now = scene();
        frame(host, &device, &mut changed, 1);
        for (what, changes) in changes() {
            changes.iter().for_each(|change| apply(&mut now, change));
            changed.update(&changes).unwrap();
            assert_eq!(changed.samples(), 0);
            let (picture, status) = frame(host, &device, &mut changed, 2);
            assert_eq!(status.samples, 2);
            assert!(picture == expected(host, &now, 2), "{what}");
        }
    });
}

/// The tree that the BVH walks, and the stack of its walk, have room for more than the few instances that were there at first, and
/// for a mesh that is another.
#[test]
fn a_scene_of_two_instances_may_grow() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut now = scene();
        now.meshes.remove(1);
        now.instances = [0, 1].map(|mesh| Instance { mesh, object_to_world: Affine3A::IDENTITY }).to_vec();
        let mut renderer = renderer(host, &device, now.clone());
        for count in [3, 1024] {
            // One after the other in a line, so that good trees are deep.
            let place =
                |index: i32| Affine3A::from_translation(Vec3::new(0.0, -0.5 * index as f32, -1.2f32.powi(index % 64)));
            now.instances = (0..count).map(|index| Instance { mesh: 0, object_to_world: place(index) }).collect();
            now.instances[1] = Instance { mesh: 1, object_to_world: Affine3A::IDENTITY };
            renderer.update(&[Change::Instances(now.instances.clone())]).unwrap();
            assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &now, 2), "{count} instances");
        }
    });
}

/// A tree over the triangles of a cube needs more of a stack than a good one over those of the same cube, stretched.
#[test]
fn a_mesh_alone_may_take_another_shape() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let corners = |stretch: f32| {
            (0..8u8).map(move |corner| {
                let bit = |axis: u8| f32::from(corner >> axis & 1);
                Vec3::new(bit(0) + stretch * f32::from(corner.pow(2)), bit(1), bit(2))
            })
        };
        let sides = [[0, 1, 3, 2], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3], [4, 6, 7, 5]];
        let mut now = scene();
        now.meshes = vec![Mesh {
            name: "cube".into(),
            positions: corners(0.1).collect(),
            triangles: sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect(),
            materials: vec![0],
            ..Mesh::default()
        }];
        now.instances.truncate(1);
        let stack = Bvh::over_triangles(&now.meshes[0]).stack;
        let mut renderer = renderer(host, &device, now.clone());
        now.meshes[0].positions = corners(0.0).collect();
        assert!(Bvh::over_triangles_within(&now.meshes[0], stack).stack > stack);
        let positions = now.meshes[0].positions.clone();
        let deform = Change::Deform { mesh: 0, positions, normals: vec![], from: None, by: Update::Rebuild };
        renderer.update(&[deform]).unwrap();
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &now, 2));
    });
}

#[test]
fn what_was_reserved_may_come_and_go() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let lens = Lens { radius: 0.1, focus_distance: 4.0 };
        let sun = Sun { direction: Vec3::new(0.6, 0.8, 0.0), irradiance: Vec3::splat(2.0) };
        let mut with_all = scene();
        with_all.camera.lens = Some(lens);
        with_all.sun = Some(sun);
        let reserve = Features { lens: true, sun: true, ..Features::NONE };
        let mut renderer = Renderer::new(&device, scene(), &Options { reserve, ..options_of(host) }).unwrap();
        frame(host, &device, &mut renderer, 1);
        let camera = |lens| Change::Camera(Camera { lens, ..scene().camera });
        renderer.update(&[camera(Some(lens)), Change::Sun(Some(sun))]).unwrap();
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &with_all, 2));

        // All lights off, one by one: the sun, the sky, the lamp. What is left is black.
        let mut dark = scene().materials[2].clone();
        dark.emission = Vec3::ZERO;
        renderer.update(&[camera(None), Change::Sun(None)]).unwrap();
        assert!(mean(&frame(host, &device, &mut renderer, 4).0) > 0.01);
        renderer.update(&[Change::Environment(None)]).unwrap();
        assert!(mean(&frame(host, &device, &mut renderer, 4).0) > 0.01);
        renderer.update(&[Change::Material { index: 2, material: dark }]).unwrap();
        assert!(mean(&frame(host, &device, &mut renderer, 4).0) == 0.0);
        renderer.update(&[Change::Sun(Some(sun))]).unwrap();
        assert!(mean(&frame(host, &device, &mut renderer, 4).0) > 0.01);
    });
}

/// A scene whose ball and floor have NeuBRDFs, and others to come.
#[test]
fn brdfs_of_files_may_come_while_it_renders() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let small = Shape { n_side: 4, features: 4, codes: 60, hidden: &[12, 16, 12], ..Shape::FULL };
        let model = |shape, seed| Arc::new(Brdf::NeuBrdf(Box::new(random_neubrdf(shape, seed))));
        let mut now = scene();
        now.brdfs = vec![model(small, 1), model(small, 2)];
        now.materials[0].surface = Surface::Measured { brdf: 0 };
        now.materials[1].surface = Surface::Measured { brdf: 1 };
        let reserve = Features { neubrdf_queues: 3, ..Features::NONE };
        let mut renderer = Renderer::new(&device, now.clone(), &Options { reserve, ..options_of(host) }).unwrap();
        frame(host, &device, &mut renderer, 1);

        now.brdfs[0] = model(small, 3);
        renderer.update(&[Change::Brdf { index: 0, brdf: now.brdfs[0].clone() }]).unwrap();
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &now, 2), "in the place of another");

        now.brdfs.push(model(small, 4));
        now.materials[1].surface = Surface::Measured { brdf: 2 };
        let material = now.materials[1].clone();
        let added = [Change::Brdf { index: 2, brdf: now.brdfs[2].clone() }, Change::Material { index: 1, material }];
        renderer.update(&added).unwrap();
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &now, 2), "after the last");

        let wide = Shape { hidden: &[32, 16, 12], ..small };
        for (index, brdf, says) in
            [(0, model(wide, 5), "wider"), (3, model(small, 5), "so many"), (7, model(small, 5), "at most 3")]
        {
            let error = renderer.update(&[Change::Brdf { index, brdf }]).unwrap_err();
            assert!(error.to_string().contains(says), "{says}: {error}");
        }
        assert_eq!(*renderer.scene(), now);
    });
}

fn mean(picture: &Bits) -> f64 {
    picture.iter().map(|pixel| f64::from(f32::from_bits(pixel[1]))).sum::<f64>() / picture.len() as f64
}

/// A sun that goes takes its share of the light table with it: what is left is as bright as in a scene that never had one.
#[test]
fn a_sun_that_is_gone_leaves_no_bias() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let settings = Settings { sampler: Sampler::Pcg, ..options().settings };
        let mut lit = scene();
        lit.environment = changes().into_iter().find_map(|(_, changes)| match changes.into_iter().next() {
            Some(Change::Environment(sky)) => sky,
            _ => None,
        });
        let reserve = Features { sun: true, ..Features::NONE };
        let with = Options { settings, reserve, ..options_of(host) };
        let mut sunless = Renderer::new(&device, lit.clone(), &with).unwrap();
        let never = Options { settings: Settings { seed: 99, ..settings }, ..options_of(host) };
        let mut never = Renderer::new(&device, lit, &never).unwrap();
        let [a, b] = [&mut sunless, &mut never].map(|renderer| frame(host, &device, renderer, 64).0);
        let differences: Vec<f64> =
            a.iter().zip(&b).map(|(a, b)| f64::from(f32::from_bits(a[1])) - f64::from(f32::from_bits(b[1]))).collect();
        let count = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / count;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let z = mean / (variance / count).sqrt();
        assert!(z.abs() < 4.0, "the pictures differ by {z} standard errors");
    });
}

/// The recordings' numbers are fit to be the values of a host's timelines: one that says which may begin, and one that says which
/// are done. All are submitted before the first may begin.
#[test]
fn timelines_of_the_host_s_order_frames_and_tell_which_are_done() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let [go, done] = [(); 2].map(|()| host.timeline());
        let buffer = host.buffer(40 * 30 * 16);
        let targets = [Target::buffer(buffer.target(), PixelFormat::Rgba32Float)];
        let mut recordings = Vec::new();
        for number in 1..=3 {
            let recording = host.begin();
            let mut commands = host.wrap(&device, &recording);
            assert_eq!(renderer.record(&mut commands, &Frame::new(2, &targets)).unwrap(), number);
            commands.finish().unwrap();
            host.to_host(&recording);
            host.submit_between(&recording, (go, number), (done, number));
            recordings.push(recording);
        }
        assert_eq!(host.reached(done), 0);
        for number in 1..=3 {
            host.signal(go, number);
            while host.reached(done) < number {
                std::thread::yield_now();
            }
            let status = renderer.complete(host.reached(done)).unwrap();
            assert_eq!(u64::from(status.samples), 2 * number);
        }
        recordings.into_iter().for_each(|recording| host.wait(recording));
        assert!(bits(&buffer.read()) == expected(host, &scene(), 6));
        host.free_buffer(buffer);
        [go, done].into_iter().for_each(|timeline| host.free_timeline(timeline));
    });
}

#[test]
fn a_reset_begins_with_a_black_film() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let first = frame(host, &device, &mut renderer, 2);
        let second = frame(host, &device, &mut renderer, 2);
        assert!(first.0 != second.0);
        renderer.reset();
        assert_eq!(renderer.samples(), 0);
        assert!(frame(host, &device, &mut renderer, 2).0 == first.0);
        assert!(frame(host, &device, &mut renderer, 2) == second);
    });
}

#[test]
fn a_resized_film_is_that_of_a_renderer_of_its_size() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        frame(host, &device, &mut renderer, 1);
        for [width, height] in [[64, 48], [17, 11]] {
            renderer.resize(width, height).unwrap();
            assert_eq!(renderer.size(), [width, height]);
            let resized = Scene { film: Film { width, height }, ..scene() };
            assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &resized, 2));
        }
    });
}

#[test]
fn an_upload_takes_place_where_the_host_records_it() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let upload = host.run_commands(&device, |commands| renderer.record_upload(commands).unwrap());
        assert_eq!(renderer.complete(upload), None);
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &scene(), 2));
    });
}

#[test]
fn images_and_buffers_of_all_formats_hold_the_same_picture() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let size = renderer.size();
        let pixels = u64::from(size[0] * size[1]);
        let kinds = [
            (PixelFormat::Rgba32Float, vk::Format::R32G32B32A32_SFLOAT),
            (PixelFormat::Rgba16Float, vk::Format::R16G16B16A16_SFLOAT),
            (PixelFormat::Rgba8, vk::Format::R8G8B8A8_UNORM),
            (PixelFormat::Bgra8, vk::Format::B8G8R8A8_UNORM),
        ];
        let images = kinds.map(|(_, format)| host.image(size, format));
        let buffers = kinds.map(|(format, _)| host.buffer(pixels * u64::from(format.bytes())));
        let mut targets = Vec::new();
        for ((format, _), (image, buffer)) in kinds.iter().zip(images.iter().zip(&buffers)) {
            targets.push(Target { exposure: 1.0, ..Target::image(image.target(), *format) });
            targets.push(Target { exposure: 1.0, ..Target::buffer(buffer.target(), *format) });
        }
        let recording = host.begin();
        let mut commands = host.wrap(&device, &recording);
        renderer.record(&mut commands, &Frame { samples: 4, targets: &targets, estimates_error: false }).unwrap();
        commands.finish().unwrap();
        host.to_host(&recording);
        host.submit(&recording);
        host.wait(recording);
        let [linear, half, rgba, bgra] = buffers.each_ref().map(HostMemory::read);
        for (((format, _), image), bytes) in kinds.iter().zip(&images).zip([&linear, &half, &rgba, &bgra]) {
            assert!(host.read_image(image, format.bytes().into()) == *bytes, "{format:?}");
        }

        let linear: Vec<[f32; 4]> = bits(&linear).into_iter().map(|pixel| pixel.map(f32::from_bits)).collect();
        let halves: Vec<f32> = half.as_chunks().0.iter().map(|h| half::f16::from_le_bytes(*h).to_f32()).collect();
        for (exact, rounded) in linear.as_flattened().iter().zip(halves) {
            // No rule says how a driver rounds.
            assert!((exact - rounded).abs() <= exact.abs() * 2f32.powi(-10), "{exact} became {rounded}");
        }
        let rgb: Vec<[f32; 3]> = linear.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
        let shown = tone_map::to_srgb8(&rgb, 1.0);
        for ((pixel, swapped), exact) in rgba.chunks(4).zip(bgra.chunks(4)).zip(shown.chunks(3)) {
            assert_eq!([pixel[0], pixel[1], pixel[2], 255], [swapped[2], swapped[1], swapped[0], swapped[3]]);
            assert!(pixel.iter().zip(exact).all(|(a, b)| a.abs_diff(*b) <= 1), "{pixel:?}, not {exact:?}");
        }
        images.into_iter().for_each(|image| host.free_image(image));
        buffers.into_iter().for_each(|buffer| host.free_buffer(buffer));
        renderer.complete(1);
    });
}

#[test]
fn an_image_may_stay_in_the_host_s_layout() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let image = host.image([100, 60], vk::Format::R32G32B32A32_SFLOAT);
        let recording = host.begin();
        host.transition(&recording, &image, vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let mut commands = host.wrap(&device, &recording);
        // SAFETY: the image is in the layout, made for copies, and freed below.
        let place = unsafe { HostImage::new(image.raw) };
        let targets = [[0, 0], [60, 30]].map(|o| Target::image(place.with_origin(o), PixelFormat::Rgba32Float));
        renderer.record(&mut commands, &Frame { samples: 2, targets: &targets[..1], estimates_error: false }).unwrap();
        // Writes of the host's own choice of order: two copies to one image need a barrier between them, and have it.
        renderer.record(&mut commands, &Frame { samples: 0, targets: &targets[1..], estimates_error: false }).unwrap();
        commands.finish().unwrap();
        let read = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        host.transition(&recording, &image, vk::ImageLayout::TRANSFER_DST_OPTIMAL, read);
        host.submit(&recording);
        host.wait(recording);
        let texels = bits(&host.read_image(&image, 16));
        let row = |x: usize, y: usize| texels[y * 100 + x..y * 100 + x + 40].to_vec();
        let picture = expected(host, &scene(), 2);
        for (y, expected) in picture.chunks(40).enumerate() {
            assert!(row(0, y) == expected && row(60, 30 + y) == expected);
        }
        host.free_image(image);
    });
}

#[test]
fn feature_channels_are_those_of_the_path_tracer_on_its_own() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut options = options_of(host);
        options.settings.features = true;
        let mut renderer = Renderer::new(&device, scene(), &options).unwrap();
        let Options { settings, traversal, pool_paths, .. } = options;
        let choices = render::Options { traversal, pool_paths };
        let picture = common::render(&host.lend_with_queue(), &scene(), &settings, &choices, 3);
        let buffers = [0; 3].map(|_| host.buffer(40 * 30 * 16));
        let channels = [Channel::Albedo, Channel::Normal, Channel::Depth];
        let targets: Vec<Target> = channels
            .into_iter()
            .zip(&buffers)
            .map(|(channel, buffer)| Target { channel, ..Target::buffer(buffer.target(), PixelFormat::Rgba32Float) })
            .collect();
        // In frames of one sample: the means do not depend on it. A reset finds depth and ids again.
        renderer.reset();
        for samples in [1, 2] {
            let recording = host.begin();
            let mut commands = host.wrap(&device, &recording);
            renderer.record(&mut commands, &Frame { samples, targets: &targets, estimates_error: false }).unwrap();
            commands.finish().unwrap();
            host.to_host(&recording);
            host.submit(&recording);
            host.wait(recording);
        }
        let [albedo, normal, depth] = buffers.each_ref().map(|buffer| bits(&buffer.read()));
        let of = |plane| picture.rgb(plane).unwrap().iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
        let rgb = |bits: &Bits| bits.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect::<Vec<_>>();
        assert!(rgb(&albedo) == of(plane::ALBEDO));
        assert!(rgb(&normal) == of(plane::NORMAL));
        let depths = picture.planes().find_map(|(name, samples)| (name == plane::DEPTH).then_some(samples));
        let Some(Samples::F32(depths)) = depths else { panic!("no depth") };
        assert!(depth.iter().map(|pixel| pixel[0]).eq(depths.iter().map(|depth| depth.to_bits())));
        buffers.into_iter().for_each(|buffer| host.free_buffer(buffer));
    });
}

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
            (material(Surface::Dielectric { ior: 1.5, alpha: 0.0 }), "dielectric"),
        ] {
            let error = renderer.update(&[orbit(&scene(), 10.0), change]).unwrap_err();
            assert!(error.to_string().contains(lacks) && matches!(error, Error::NewRenderer { .. }), "{error}");
        }
        assert_eq!(*renderer.scene(), scene());
        assert_eq!(renderer.samples(), 1);

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

        // Targets that are too small, or of what is not gathered.
        let small = host.buffer(16);
        let target = Target::buffer(small.target(), PixelFormat::Rgba32Float);
        let albedo = Target { channel: Channel::Albedo, ..target };
        let error = renderer.record(&mut commands, &Frame::new(1, &[albedo])).unwrap_err();
        assert!(matches!(error, Error::NoFeatures { channel: "albedo" }), "{error}");
        let error = renderer.record(&mut commands, &Frame::new(1, &[target])).unwrap_err();
        assert!(matches!(error, Error::Gpu(gpu::Error::Range { .. })), "{error}");
        assert!(commands.finish().is_err(), "the command buffer is spoilt");
        // SAFETY: it was not submitted.
        unsafe { host.forget(recording) };
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
        let flaws: [(&str, Spoil); 6] = [
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

#[test]
fn what_a_lost_device_was_at_can_be_told() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let last_pass = |renderer: &Renderer| match renderer.device_lost() {
            gpu::Error::DeviceLost { last_pass, .. } => last_pass,
            other => panic!("{other}"),
        };
        assert_eq!(last_pass(&renderer), None);
        let recording = host.begin();
        let mut commands = host.wrap(&device, &recording);
        let frame = Frame { samples: 1, targets: &[], estimates_error: false };
        let ticket = renderer.record(&mut commands, &frame).unwrap();
        commands.finish().unwrap();
        assert_eq!(last_pass(&renderer).as_deref(), Some("nothing yet of recording 1"));
        host.submit(&recording);
        host.wait(recording);
        assert_eq!(last_pass(&renderer), None, "it came to the end");
        renderer.complete(ticket);
    });
}

/// With the host's allocator, whose book tells whether anything is left.
#[test]
fn memory_of_the_host_s_allocator_is_given_back() {
    in_lavapipe_hosts(|host| {
        let allocator = host.allocator();
        let allocated = || allocator.lock().unwrap().generate_report().total_allocated_bytes;
        let device = host.lend_with_allocator(&allocator);
        let mut renderer = renderer(host, &device, scene());
        let prepared = allocated();
        assert!(prepared > 0);
        frame(host, &device, &mut renderer, 2);
        assert!(allocated() < prepared, "the staging memory is given back once the upload is done");
        let steady = allocated();
        for round in 0..5 {
            renderer.update(&[orbit(&scene(), 10.0 * round as f32), changes()[1].1[0].clone()]).unwrap();
            frame(host, &device, &mut renderer, 1);
            assert_eq!(allocated(), steady, "a change of this size takes no memory");
        }
        drop(renderer);
        drop(device);
        assert_eq!(allocated(), 0);
        assert!(allocator.lock().unwrap().generate_report().allocations.is_empty());
    });
}

/// How often, unless the environment says otherwise. CI runs the short form; what the long ones gave stands in
/// docs/embedding.md, with the command.
fn rounds(variable: &str, short: u32) -> u32 {
    std::env::var(variable).ok().map_or(short, |text| text.parse().unwrap())
}

/// Bytes of this process in memory.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/statm").unwrap();
    status.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 4096
}

/// `NEUBRDF_ROUNDS=1000 cargo test --features embree --test plugin rounds -- --nocapture`
#[test]
fn rounds_of_making_and_dropping_leave_nothing() {
    in_lavapipe_hosts(|host| {
        let rounds = rounds("NEUBRDF_ROUNDS", 4);
        let warm = rounds.div_ceil(10);
        let mut before = 0;
        for round in 0..rounds {
            if round == warm {
                before = resident();
            }
            let device = host.lend();
            let mut renderer = renderer(host, &device, scene());
            let [(_, camera), (_, moved), ..] = &changes()[..] else { panic!() };
            frame(host, &device, &mut renderer, 1);
            renderer.update(&[camera[0].clone(), moved[0].clone()]).unwrap();
            // Dropped with an upload that is pending, every other time.
            if round % 2 == 0 {
                frame(host, &device, &mut renderer, 1);
            }
            drop(renderer);
            assert_eq!(Arc::strong_count(&device), 1);
        }
        let grown = resident().saturating_sub(before) / (1 << 20);
        eprintln!("{rounds} rounds, {grown} MiB more after the first {warm}");
        assert!(rounds < 100 || grown < 64, "{grown} MiB");
    });
}

/// `NEUBRDF_FRAMES=10000 cargo test --features embree --test plugin soak -- --nocapture`
#[test]
fn a_soak_of_frames_with_changes_ends_with_the_right_picture() {
    in_lavapipe_hosts(|host| {
        let frames = rounds("NEUBRDF_FRAMES", 40);
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let mut in_flight = std::collections::VecDeque::new();
        let changes: Vec<Vec<Change>> = changes().into_iter().map(|(_, changes)| changes).collect();
        let (mut now, mut taken, mut before) = (scene(), 0, 0);
        for index in 0..frames {
            // Three frames of samples, then a change; now and then another size or a reset.
            if index % 4 == 3 {
                let changes = &changes[index as usize / 4 % changes.len()];
                changes.iter().for_each(|change| apply(&mut now, change));
                renderer.update(changes).unwrap();
                taken = 0;
            }
            if index % 50 == 25 {
                let film = if now.film.width == 40 { Film { width: 33, height: 31 } } else { scene().film };
                renderer.resize(film.width, film.height).unwrap();
                (now.film, taken) = (film, 0);
            }
            if in_flight.len() == 3 {
                wait(host, &mut renderer, in_flight.pop_front().unwrap());
            }
            in_flight.push_back(submit(host, &device, &mut renderer, 1));
            taken += 1;
            if index == frames / 10 {
                before = resident();
            }
            if index % 1000 == 999 {
                eprintln!("{} frames, {} MiB", index + 1, resident() / (1 << 20));
            }
        }
        let mut last = None;
        while let Some(frame) = in_flight.pop_front() {
            last = Some(wait(host, &mut renderer, frame));
        }
        let grown = resident().saturating_sub(before) / (1 << 20);
        eprintln!("{frames} frames, {grown} MiB more after the first tenth");
        assert!(frames < 1000 || grown < 64, "{grown} MiB");
        let (picture, status) = last.unwrap();
        assert_eq!(status.samples, taken);
        assert!(picture == expected(host, &now, taken));
    });
}
