//! Maps of normals: a surface is lit as if it leaned the way its map says, whatever side and way round it is seen.

mod common;

use common::*;
use glam::{Affine3A, Mat3, Vec2, Vec3};
use half::f16;
use neubrdf::image::plane;
use neubrdf::render::{Options, Settings, Traversal};
use neubrdf::scene::{Instance, Material, Scene, Sun, Surface, Texture};

/// The map of these vectors.
fn map(width: u32, normals: &[Vec3]) -> Texture {
    let texel = |normal: &Vec3| (0.5 + 0.5 * *normal).extend(1.0).to_array().map(f16::from_f32);
    Texture::new("normals", width, normals.iter().map(texel).collect())
}

fn mapped(surface: Surface) -> Material {
    Material { normal_map: Some(0), ..material("mapped", surface) }
}

/// The green of the picture's middle, by the sun alone.
fn middle(driver: &Driver, scene: &Scene) -> f32 {
    let settings = Settings { max_depth: 2, features: false, ..Settings::default() };
    let options = Options { traversal: Some(Traversal::Bvh), pool_paths: None };
    let picture = render(&driver.device, scene, &settings, &options, 4);
    picture.rgb(plane::BEAUTY).unwrap()[8 * 16 + 8][1]
}

#[test]
fn a_surface_is_lit_as_its_map_leans() {
    let lean = Vec3::new(0.48, 0.36, 0.8);
    let sun = Sun { direction: Vec3::new(0.6, 0.0, 0.8), irradiance: Vec3::splat(3.0) };
    let expected = |normal: Vec3| 0.5 / std::f32::consts::PI * 3.0 * normal.dot(sun.direction).max(0.0);
    let placed = |matrix| Instance { mesh: 0, object_to_world: Affine3A::from_mat3(matrix) };
    let turned = Mat3::from_rotation_z(1.0);
    let mirrored = Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0));
    // As seen from behind, where the surface's other side leans the other way.
    let about = Mat3::from_rotation_y(std::f32::consts::PI);
    let swapped = |uv: &Vec2| Vec2::new(1.0 - uv.x, uv.y);
    for name in [LAVAPIPE, SWIFTSHADER] {
        let Some(driver) = driver(name) else { continue };
        for (what, matrix, flips_u, normal) in [
            ("as it is", Mat3::IDENTITY, false, lean),
            ("u the other way", Mat3::IDENTITY, true, Vec3::new(-lean.x, lean.y, lean.z)),
            ("turned", turned, false, turned * lean),
            ("mirrored", mirrored, false, mirrored * lean),
            ("seen from behind", about, false, -(about * lean)),
        ] {
            let mut scene = scene(
                vec![sheet(0.0, 1.0, 0)],
                vec![mapped(diffuse(0.5))],
                Vec3::new(0.0, 0.0, 4.0),
                Vec3::ZERO,
                [16, 16],
            );
            scene.instances = vec![placed(matrix)];
            scene.textures = vec![map(1, &[lean])];
            scene.sun = Some(sun);
            if flips_u {
                scene.meshes[0].uvs = scene.meshes[0].uvs.iter().map(swapped).collect();
            }
            let found = middle(&driver, &scene);
            assert!((found - expected(normal)).abs() < 1e-3, "{what}: {found}, not {}", expected(normal));
        }
        driver.finish();
    }
}

/// Ripples over a coated ball with normals of its own, over glass, and over a metal in the mirror: what Embree sees.
#[cfg(feature = "embree")]
#[test]
fn ripples_agree_with_embree() {
    use neubrdf::render::Sampler;
    use neubrdf::scene::Color;
    let ripple = |i: u32| {
        let (x, y) = ((i % 16) as f32, (i / 16) as f32);
        Vec3::new(0.5 * (0.8 * x).sin(), 0.4 * (0.8 * y).cos(), 1.0).normalize()
    };
    let normals: Vec<Vec3> = (0..256).map(ripple).collect();
    let coat = Surface::Coated { albedo: Color::constant(Vec3::new(0.6, 0.3, 0.2)), ior: 1.5, alpha: 0.2 };
    let glass = Surface::Dielectric { ior: 1.5, alpha: 0.2 };
    let materials = [conductor(0.7, 0.3), coat, glass].map(mapped);
    let mut scene = floor_and_balls(materials.to_vec(), map(16, &normals));
    scene.instances[0].object_to_world = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let mut flat = scene.clone();
    flat.materials.iter_mut().for_each(|material| material.normal_map = None);
    let settings = Settings { max_depth: 6, sampler: Sampler::Pcg, features: false, ..Settings::default() };
    agrees_with_embree("normal-map", &scene, &flat, &settings, [256, 64]);
}
