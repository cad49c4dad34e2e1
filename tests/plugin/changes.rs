//! Scenes that change while they are rendered: as if by a renderer made for what they are now.

use std::sync::Arc;

use glam::{Affine3A, Quat, Vec2, Vec3};
use half::f16;
use neubrdf::plugin::{Change, Options, Renderer, Update};
use neubrdf::render::bvh::Bvh;
use neubrdf::render::{Family, Features, Sampler, Settings};
use neubrdf::scene::{
    Brdf, Camera, Color, Environment, Fresnel, Instance, Lens, Material, Mesh, Patches, Scene, Sun, Surface, Texture,
};

use crate::common;
use crate::common::random_neubrdf::{Shape, random_neubrdf};
use crate::frames::{Bits, expected, frame, options, options_of, renderer, scene};
use crate::host::in_lavapipe_hosts;

/// The view from another side.
pub fn orbit(scene: &Scene, degrees: f32) -> Change {
    let camera = scene.camera.clone();
    let turn = Quat::from_rotation_y(degrees.to_radians());
    Change::Camera(Camera { eye: camera.target + turn * (camera.eye - camera.target), ..camera })
}

/// Changes that keep the scene's features, and what the scene is afterwards.
pub fn changes() -> Vec<(&'static str, Vec<Change>)> {
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

/// A sky that is worth light samples: most of its light comes from two of its texels.
pub fn uneven_sky() -> Environment {
    let texels = (0..8).map(|index| Vec3::splat(if index % 4 == 1 { 6.0 } else { 0.1 * index as f32 })).collect();
    Environment { width: 4, height: 2, texels, rotation_degrees: 30.0 }
}

pub fn apply(scene: &mut Scene, change: &Change) {
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

/// A good tree over triangles of growing distances is deeper than one over the same in even steps, and needs more of a stack.
#[test]
fn a_mesh_alone_may_take_another_shape() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let count = 24;
        let corners = |distance: fn(i32) -> f32| {
            let corner = move |triangle| {
                let first = Vec3::new(-0.5, -0.5, -distance(triangle));
                [first, first + Vec3::X, first + Vec3::Y]
            };
            (0..count).flat_map(corner).collect::<Vec<_>>()
        };
        let mut now = scene();
        now.meshes = vec![Mesh {
            name: "triangles in a row".into(),
            positions: corners(|triangle| triangle as f32 * 0.1),
            triangles: (0..count as u32).map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner)).collect(),
            materials: vec![0],
            ..Mesh::default()
        }];
        now.instances.truncate(1);
        let stack = Bvh::over_triangles(&now.meshes[0]).stack;
        let mut renderer = renderer(host, &device, now.clone());
        now.meshes[0].positions = corners(|triangle| 1.3f32.powi(triangle) * 0.1);
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
        let reserve = Features { lens: true, sun: true, uneven_sky: true, ..Features::NONE };
        let mut renderer = Renderer::new(&device, scene(), &Options { reserve, ..options_of(host) }).unwrap();
        frame(host, &device, &mut renderer, 1);
        let camera = |lens| Change::Camera(Camera { lens, ..scene().camera });
        renderer.update(&[camera(Some(lens)), Change::Sun(Some(sun))]).unwrap();
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &with_all, 2));
        with_all.environment = Some(uneven_sky());
        renderer.update(&[Change::Environment(with_all.environment.clone())]).unwrap();
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

/// Also where nothing shines at first.
#[test]
fn an_uneven_sky_may_be_the_first_light() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut now = scene();
        now.environment = None;
        now.materials[2].emission = Vec3::ZERO;
        let reserve = Features { uneven_sky: true, ..Features::NONE };
        let mut renderer = Renderer::new(&device, now.clone(), &Options { reserve, ..options_of(host) }).unwrap();
        assert!(mean(&frame(host, &device, &mut renderer, 2).0) == 0.0);
        now.environment = Some(uneven_sky());
        renderer.update(&[Change::Environment(now.environment.clone())]).unwrap();
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &now, 2));
    });
}

/// With a tree that was reserved, as if by a renderer made for them; without one, picked by power, as bright as that.
#[test]
fn lamps_may_come_to_be_many_and_few_again() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut many = scene();
        many.materials[2].emission /= 20.0;
        let few = many.clone();
        let lamp = many.instances[2];
        many.instances.extend((0..19).map(|i| {
            let aside = 0.2 * Vec3::new((i % 5) as f32, 0.1 * (i + 1) as f32, (i / 5) as f32);
            let aside = Affine3A::from_translation(aside);
            Instance { object_to_world: aside * lamp.object_to_world, ..lamp }
        }));
        let of_many = Renderer::new(&device, many.clone(), &options_of(host)).unwrap().features().light_tree;
        let of_few = Renderer::new(&device, few.clone(), &options_of(host)).unwrap().features().light_tree;
        assert!(of_many && !of_few);
        let same = |found: &Bits, expected: &Bits| (mean(found) / mean(expected) - 1.0).abs() < 0.03;
        for light_tree in [true, false] {
            let reserve = Features { light_tree, ..Features::NONE };
            let mut renderer = Renderer::new(&device, few.clone(), &Options { reserve, ..options_of(host) }).unwrap();
            let at_first = frame(host, &device, &mut renderer, 32).0;
            assert!(same(&at_first, &expected(host, &few, 32)));
            renderer.update(&[Change::Instances(many.instances.clone())]).unwrap();
            let (picture, made_for_it) = (frame(host, &device, &mut renderer, 32).0, expected(host, &many, 32));
            assert_eq!(picture == made_for_it, light_tree);
            assert!(same(&picture, &made_for_it));
            renderer.update(&[Change::Instances(few.instances.clone())]).unwrap();
            assert!(frame(host, &device, &mut renderer, 32).0 == at_first);

            // None at all.
            let mut dark = few.materials[2].clone();
            dark.emission = Vec3::ZERO;
            renderer.update(&[Change::Environment(None), Change::Material { index: 2, material: dark }]).unwrap();
            assert!(mean(&frame(host, &device, &mut renderer, 2).0) == 0.0);
            let sky = few.environment.clone();
            renderer
                .update(&[Change::Environment(sky), Change::Material { index: 2, material: few.materials[2].clone() }])
                .unwrap();
            assert!(frame(host, &device, &mut renderer, 32).0 == at_first);
        }
    });
}

#[test]
fn holes_may_come_and_go() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut now = scene();
        let reserve = Features { holes: true, ..Features::NONE };
        let mut renderer = Renderer::new(&device, now.clone(), &Options { reserve, ..options_of(host) }).unwrap();
        let whole = frame(host, &device, &mut renderer, 2).0;
        for value in [0.5, 0.25, 1.0] {
            now.materials[1].opacity.value = value;
            let material = now.materials[1].clone();
            renderer.update(&[Change::Material { index: 1, material }]).unwrap();
            let picture = frame(host, &device, &mut renderer, 2).0;
            assert!(picture == expected(host, &now, 2), "an opacity of {value}");
            assert_eq!(picture == whole, value == 1.0);
        }
        let mut lamp = now.materials[2].clone();
        lamp.opacity.value = 0.5;
        let error = renderer.update(&[Change::Material { index: 2, material: lamp }]).unwrap_err();
        assert!(error.to_string().contains("as it emits"), "{error}");
    });
}

#[test]
fn maps_of_roughness_direction_and_emission_may_come_and_go() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut now = scene();
        let texel = |i: u8| [f32::from(i % 3) / 2.0, f32::from(i % 4) / 3.0, 0.5, 1.0].map(f16::from_f32);
        let texels = (0..16).map(texel).collect();
        now.textures = vec![Texture::new("map", 4, texels)];
        let albedo = Color::constant(Vec3::new(0.2, 0.4, 0.6));
        let coat = Surface::Coated { albedo, ior: 1.5, alpha: 0.1 };
        let families = 1 << Family::Coated as u32 | 1 << Family::Conductor as u32;
        let none = Features { families, ..Features::NONE };
        let maps = Features { roughness_maps: true, anisotropy_direction_maps: true, emission_maps: true, ..none };
        let reserve = Features { textures: true, ..maps };
        let mut renderer = Renderer::new(&device, now.clone(), &Options { reserve, ..options_of(host) }).unwrap();
        let mut unprepared = Renderer::new(&device, now.clone(), &options_of(host)).unwrap();
        let before = frame(host, &device, &mut renderer, 2).0;
        let fresnel = Fresnel::Schlick { f0: Color::constant(Vec3::splat(0.5)) };
        let metal = Surface::Conductor { fresnel, alpha: Vec2::new(0.05, 0.2) };
        for (index, surface, is_mapped) in [
            (1, coat.clone(), true),
            (1, metal.clone(), true),
            (1, coat, false),
            (2, common::diffuse(0.0), true),
            (2, common::diffuse(0.0), false),
            (1, metal, false),
        ] {
            let map = is_mapped.then_some(0);
            let material = &mut now.materials[index];
            material.roughness_map = map.filter(|_| surface.takes_roughness_map());
            material.anisotropy_direction_map = map.filter(|_| surface.takes_anisotropy_direction_map());
            material.emission_texture = map.filter(|_| material.is_emissive());
            material.surface = surface;
            let change = [Change::Material { index: index as u32, material: material.clone() }];
            renderer.update(&change).unwrap();
            let picture = frame(host, &device, &mut renderer, 2).0;
            assert!(picture == expected(host, &now, 2), "{:?}", now.materials[index]);
            assert!(picture != before);
            if is_mapped {
                assert!(unprepared.update(&change).is_err());
            }
        }
    });
}

/// What stands in them follows its own material, and they come and go.
#[test]
fn patches_may_come_and_go() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut now = scene();
        let texel = |i: u8| [f32::from(i % 3) / 2.0, 0.0, 0.0, 1.0].map(f16::from_f32);
        now.textures = vec![Texture::new("map", 4, (0..16).map(texel).collect())];
        let other = now.materials.len() as u32;
        now.materials.push(common::material("other", common::conductor(0.9, 0.1)));
        let families = 1 << Family::Conductor as u32 | 1 << Family::Diffuse as u32;
        let reserve = Features { families, patches: true, textures: true, ..Features::NONE };
        let mut renderer = Renderer::new(&device, now.clone(), &Options { reserve, ..options_of(host) }).unwrap();
        let mut unprepared = Renderer::new(&device, now.clone(), &options_of(host)).unwrap();
        let before = frame(host, &device, &mut renderer, 2).0;
        for (index, surface, has_patches) in [
            (0, common::diffuse(0.4), true),
            (other, common::diffuse(0.1), false),
            (1, common::conductor(0.5, 0.3), true),
            (0, common::diffuse(0.4), false),
        ] {
            let material = &mut now.materials[index as usize];
            material.patches = has_patches.then_some(Patches { map: 0, material: other });
            material.surface = surface;
            let change = [Change::Material { index, material: material.clone() }];
            renderer.update(&change).unwrap();
            let picture = frame(host, &device, &mut renderer, 2).0;
            assert!(picture == expected(host, &now, 2), "{:?}", now.materials[index as usize]);
            assert!(picture != before);
            if has_patches {
                assert!(unprepared.update(&change).is_err());
            }
        }
        // What stands in patches has none, and does not emit.
        for change in [
            Material { emission: Vec3::ONE, ..now.materials[other as usize].clone() },
            Material { patches: now.materials[1].patches, ..now.materials[other as usize].clone() },
        ] {
            let error = renderer.update(&[Change::Material { index: other, material: change }]).unwrap_err();
            assert!(error.to_string().contains("patches"), "{error}");
        }
    });
}

/// A scene whose ball and floor have NeuBRDFs of two widths, each with a kernel of its own, and others to come.
#[test]
fn brdfs_of_files_may_come_while_it_renders() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let small = Shape { n_side: 4, features: 4, codes: 60, hidden: &[12, 16, 12], ..Shape::FULL };
        let wide = Shape { hidden: &[20, 16, 24], is_isotropic: true, ..small };
        let model = |shape, seed| Arc::new(Brdf::NeuBrdf(Box::new(random_neubrdf(shape, seed))));
        let mut now = scene();
        now.brdfs = vec![model(small, 1), model(wide, 2)];
        now.materials[0].surface = Surface::Measured { brdf: 0 };
        now.materials[1].surface = Surface::Measured { brdf: 1 };
        let reserve = Features { neubrdf_queues: 3, ..Features::NONE };
        let mut renderer = Renderer::new(&device, now.clone(), &Options { reserve, ..options_of(host) }).unwrap();
        frame(host, &device, &mut renderer, 1);

        for (shape, seed, place) in [(small, 3, "one as wide"), (wide, 6, "a narrower one"), (small, 7, "a wider one")]
        {
            now.brdfs[0] = model(shape, seed);
            renderer.update(&[Change::Brdf { index: 0, brdf: now.brdfs[0].clone() }]).unwrap();
            assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &now, 2), "in the place of {place}");
        }

        now.brdfs.push(model(small, 4));
        now.materials[1].surface = Surface::Measured { brdf: 2 };
        let material = now.materials[1].clone();
        let added = [Change::Brdf { index: 2, brdf: now.brdfs[2].clone() }, Change::Material { index: 1, material }];
        renderer.update(&added).unwrap();
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &now, 2), "after the last");

        let wider = Shape { hidden: &[32, 16, 12], ..small };
        for (index, brdf, says) in
            [(0, model(wider, 5), "wider"), (3, model(small, 5), "so many"), (7, model(small, 5), "at most 3")]
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
        lit.environment = Some(uneven_sky());
        let sun = Sun { direction: Vec3::new(0.0, 0.8, 0.6), irradiance: Vec3::splat(3.0) };
        let with = Options { settings, ..options_of(host) };
        let mut sunless = Renderer::new(&device, Scene { sun: Some(sun), ..lit.clone() }, &with).unwrap();
        frame(host, &device, &mut sunless, 1);
        sunless.update(&[Change::Sun(None)]).unwrap();
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
