//! Many lamps, of which a tree picks the light samples.
#![cfg(feature = "embree")]

mod common;

use common::{agrees_with_embree, conductor, diffuse, lamp, material, quad, scene, sphere};
use glam::{Affine3A, Quat, Vec3};
use neubrdf::render::{Sampler, Settings};
use neubrdf::scene::{Environment, Instance, LightTable, Material, Mesh, Scene, Sun};

/// A sheet of 1 × 1 that faces down.
fn sheet(material: u32) -> Mesh {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    quad([corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)], material)
}

/// A long gallery that is open to one side, walls across it, and behind each a lamp of another kind: sheets, some of them mirrored or seen from both sides,
/// and balls that are drawn out. The sun and an uneven sky shine in.
fn gallery() -> Scene {
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let floor = quad([at(0.0, 0.0, 3.0), at(20.0, 0.0, 3.0), at(20.0, 0.0, 0.0), at(0.0, 0.0, 0.0)], 0);
    let back = quad([at(0.0, 0.0, 0.0), at(20.0, 0.0, 0.0), at(20.0, 2.5, 0.0), at(0.0, 2.5, 0.0)], 0);
    let wall = quad([at(0.0, 0.0, 0.0), at(0.0, 2.5, 0.0), at(0.0, 2.5, 1.2), at(0.0, 0.0, 1.2)], 1);
    let ball = sphere(Vec3::ZERO, 0.5, 16, 4);
    let meshes = vec![floor, back, wall, sheet(2), sheet(3), ball];
    let materials = vec![
        material("plaster", diffuse(0.6)),
        material("metal", conductor(0.7, 0.3)),
        lamp(4.0),
        Material { emits_both_sides: true, ..lamp(2.0) },
        lamp(1.5),
    ];
    let mut scene = scene(meshes, materials, at(3.0, 2.0, 8.0), at(4.5, 0.8, 0.0), [40, 24]);
    scene.instances.truncate(2);
    let mut place = |mesh: u32, object_to_world: Affine3A| scene.instances.push(Instance { mesh, object_to_world });
    for room in 0..16u8 {
        let x = 1.25 * f32::from(room);
        place(2, Affine3A::from_translation(at(x, 0.0, 0.0)));
        let size = Vec3::new(if room % 3 == 0 { -0.5 } else { 0.5 }, 0.7, 0.3) * (0.4 + 0.1 * f32::from(room % 4));
        let turn = Quat::from_rotation_x(0.3 * f32::from(room % 5) - 0.6);
        let middle = at(x + 0.6, 1.5 + 0.2 * f32::from(room % 3), 0.5);
        place(3 + u32::from(room % 3), Affine3A::from_scale_rotation_translation(size, turn, middle));
    }
    let mut sky = Environment { width: 4, height: 2, ..Environment::constant(Vec3::splat(0.05)) };
    sky.texels = (0..8).map(|texel| Vec3::splat(if texel == 1 { 1.0 } else { 0.05 })).collect();
    scene.environment = Some(sky);
    scene.sun = Some(Sun { direction: at(0.3, 0.6, 0.7).normalize(), irradiance: Vec3::splat(0.5) });
    scene
}

#[test]
fn many_lamps_agree_with_embree() {
    let scene = gallery();
    let lights = LightTable::new(&scene);
    assert!(lights.tree.is_some() && lights.triangles.len() > 500 && lights.environment_texels == 8);
    let mut another = scene.clone();
    another.materials[3].emits_both_sides = false;
    let settings = Settings { max_depth: 4, sampler: Sampler::Pcg, features: false, ..Settings::default() };
    agrees_with_embree("light-tree", &scene, &another, &settings, [512, 128]);
}
