//! Textures that are placed: they look as they would by other texture coordinates, and agree with Embree wherever they are used.

mod common;
#[allow(dead_code)] // Its tiles.
#[path = "common/maps.rs"]
mod maps;

use std::f32::consts::TAU;

use common::*;
use glam::{Vec2, Vec3};
use maps::texture;
use neubrdf::image::plane;
use neubrdf::render::{Options, Settings, Traversal};
use neubrdf::scene::{Color, Fresnel, Material, Opacity, Scene, Surface, TexturePlacement};

/// Mirrored along u.
const PLACEMENT: TexturePlacement = TexturePlacement { scale: Vec2::new(-2.0, 3.0), offset: Vec2::new(0.3, -0.2) };

/// A floor that glows in places, a ball with bumps and colours, and one with holes and a roughness that varies.
fn mapped(placement: TexturePlacement) -> Scene {
    let textured = Color { value: Vec3::ONE, texture: Some(0) };
    let metal = Surface::Conductor { fresnel: Fresnel::Schlick { f0: textured }, alpha: Vec2::splat(0.3) };
    let materials = vec![
        Material { emission: Vec3::splat(0.5), emission_texture: Some(3), ..material("floor", diffuse(0.6)) },
        Material { normal_map: Some(1), ..material("bumps", Surface::Diffuse { albedo: textured }) },
        Material {
            roughness_map: Some(2),
            opacity: Opacity { value: 1.0, texture: Some(2) },
            ..material("holes", metal)
        },
    ];
    let colors = texture(8, |at| Vec3::new(at.x, (TAU * at.y).sin() * 0.4 + 0.5, 0.3));
    let mut scene = floor_and_balls(materials, colors);
    let slope = |at: Vec2| Vec2::new(0.6 * (TAU * at.x).cos(), 0.8 * at.y - 0.2);
    scene.textures.push(texture(8, |at| 0.5 * slope(at).extend(1.0).normalize() + 0.5));
    scene.textures.push(texture(4, |at| Vec3::splat(if at.x < 0.5 { 1.0 } else { 0.3 + 0.4 * at.y })));
    // The first one's texels once more.
    scene.textures.push(scene.textures[0].clone());
    scene.textures.iter_mut().for_each(|texture| texture.placement = placement);
    scene
}

#[test]
fn placed_textures_look_as_by_other_coordinates() {
    let placed = mapped(PLACEMENT);
    let mut moved = mapped(TexturePlacement::default());
    for uv in moved.meshes.iter_mut().flat_map(|mesh| &mut mesh.uvs) {
        *uv = PLACEMENT.offset + PLACEMENT.scale * *uv;
    }
    assert_ne!(placed.hash(), mapped(TexturePlacement::default()).hash());
    let settings = Settings { max_depth: 1, ..Settings::default() };
    let bvh = Options { traversal: Some(Traversal::Bvh), pool_paths: None };
    for name in [LAVAPIPE, SWIFTSHADER] {
        let Some(driver) = driver(name) else { continue };
        let [placed, moved] = [&placed, &moved].map(|scene| render(&driver.device, scene, &settings, &bvh, 4));
        for part in [plane::BEAUTY, plane::ALBEDO, plane::NORMAL] {
            let [placed, moved] = [&placed, &moved].map(|picture| picture.rgb(part).unwrap());
            let differs = |(a, b): &(&[f32; 3], &[f32; 3])| (0..3).any(|i| (a[i] - b[i]).abs() > 1e-3);
            let count = placed.iter().zip(&moved).filter(differs).count();
            assert!(count <= placed.len() / 100, "{name}, {part:?}: {count} of {} pixels differ", placed.len());
        }
        driver.finish();
    }
}

#[cfg(feature = "embree")]
#[test]
fn placed_textures_agree_with_embree() {
    let settings = Settings { max_depth: 4, features: false, ..Settings::default() };
    let mirrored_back = TexturePlacement { scale: PLACEMENT.scale.abs(), ..PLACEMENT };
    agrees_with_embree("texture-placement", &mapped(PLACEMENT), &mapped(mirrored_back), &settings, [512, 128]);
}
