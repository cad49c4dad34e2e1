//! Patches of another material: they are where their map says, whatever families both are of, and agree with Embree.

mod common;
#[allow(dead_code)] // Its tiles.
#[path = "common/maps.rs"]
mod maps;

use common::*;
use glam::{Vec2, Vec3};
use maps::texture;
use neubrdf::image::{Picture, plane};
use neubrdf::render::{Family, Features, Options, Settings, Traversal};
use neubrdf::scene::{Color, LightTable, Material, Patches, Scene, Surface};

/// Materials on which the last two stand where the texture is bright.
fn with_patches(map: u32, materials: Vec<Material>, others: [Material; 2]) -> Vec<Material> {
    let first = materials.len() as u32;
    let patched = materials.into_iter().enumerate().map(|(index, material)| Material {
        patches: Some(Patches { map, material: first + index as u32 % 2 }),
        ..material
    });
    patched.chain(others).collect()
}

/// A floor and two balls, each of two families.
fn patched() -> Scene {
    let coat = Surface::Coated { albedo: Color::constant(Vec3::new(0.7, 0.3, 0.1)), ior: 1.5, alpha: 0.1 };
    let materials =
        vec![material("floor", diffuse(0.6)), material("coat", coat), material("metal", conductor(0.9, 0.2))];
    let chalk = Material { normal_map: Some(1), ..material("chalk", diffuse(0.2)) };
    let materials = with_patches(0, materials, [material("gold", conductor(0.7, 0.3)), chalk]);
    let mut scene = floor_and_balls(materials, texture(8, |at| Vec3::splat((at.x * 13.0 + at.y * 7.0).fract())));
    scene.textures.push(texture(8, |at| 0.5 * Vec2::new(0.5, at.y - 0.5).extend(1.0).normalize() + 0.5));
    scene
}

fn ids(picture: &Picture) -> &[u32] {
    picture.u32(plane::MATERIAL_ID).unwrap()
}

#[test]
fn patches_are_where_their_map_says() {
    let materials = with_patches(
        0,
        vec![material("matte", diffuse(0.6))],
        [material("metal", conductor(0.5, 0.0)), material("none", diffuse(0.0))],
    );
    let mut scene = scene(vec![sheet(0.0, 2.0, 0)], materials, Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, [16, 16]);
    scene.textures = vec![texture(4, |at| Vec3::splat(f32::from(at.x > 0.5)))];
    let features = Features::of(&scene, &LightTable::new(&scene));
    assert!(features.patches && features.has(Family::Conductor) && features.has(Family::Diffuse));
    let settings = Settings { max_depth: 2, ..Settings::default() };
    for name in [LAVAPIPE, SWIFTSHADER] {
        let Some(driver) = driver(name) else { continue };
        let picture = render(&driver.device, &scene, &settings, &Options::default(), 1);
        let expected: Vec<u32> = (0..256).map(|pixel| u32::from(pixel % 16 >= 8)).collect();
        assert_eq!(ids(&picture), expected, "{name}");
        let triangles = picture.u32(plane::PRIMITIVE_ID).unwrap();
        assert!(triangles.iter().all(|triangle| *triangle < 2), "{name}: {triangles:?}");
        driver.finish();
    }
}

#[test]
fn both_traversals_find_the_same_patches() {
    let Some(driver) = driver(LAVAPIPE).filter(|driver| driver.has(Traversal::RayQuery)) else { return };
    let scene = patched();
    let settings = Settings { max_depth: 4, ..Settings::default() };
    let pictures = [Traversal::Bvh, Traversal::RayQuery].map(|traversal| {
        let options = Options { traversal: Some(traversal), pool_paths: None };
        render(&driver.device, &scene, &settings, &options, 4)
    });
    assert_eq!(ids(&pictures[0]), ids(&pictures[1]));
    let differ = bits(&pictures[0]).iter().zip(&bits(&pictures[1])).filter(|(a, b)| a != b).count();
    assert!(differ <= 12, "{differ} of 1200 pixels: only where a ray passes by an edge");
    driver.finish();
}

#[cfg(feature = "embree")]
#[test]
fn patches_agree_with_embree() {
    let scene = patched();
    let mut whole = scene.clone();
    whole.materials.iter_mut().for_each(|material| material.patches = None);
    let settings = Settings { max_depth: 4, features: false, ..Settings::default() };
    agrees_with_embree("patches", &scene, &whole, &settings, [512, 128]);
}
