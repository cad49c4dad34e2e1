//! Textures that emit: what is seen of them is their texels, and what they light agrees with Embree, however it is found.

mod common;

use common::*;
use glam::{Affine3A, Vec2, Vec3};
use half::f16;
use neubrdf::image::plane;
use neubrdf::render::{Options, Sampler, Settings, Traversal};
use neubrdf::scene::{Color, Environment, Instance, LightTable, Material, Scene, Surface, Texture};

fn texture(width: u32, colors: &[Vec3]) -> Texture {
    let texel = |color: &Vec3| color.extend(1.0).to_array().map(f16::from_f32);
    Texture::new("glow", width, colors.iter().map(texel).collect())
}

fn glowing(radiance: f32, texture: Option<u32>) -> Material {
    let emission = Vec3::splat(radiance);
    Material { emission, emission_texture: texture, ..material("glowing", diffuse(0.3)) }
}

const BVH: Options = Options { traversal: Some(Traversal::Bvh), pool_paths: None };

#[test]
fn a_screen_shows_its_texels() {
    let colors: Vec<Vec3> = (0..16).map(|i| Vec3::new(i as f32 / 15.0, (i % 4) as f32 / 3.0, 0.25)).collect();
    let view = (Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO);
    let mut screen = scene(vec![sheet(0.0, 1.0, 0)], vec![glowing(5.0, Some(0))], view.0, view.1, [16, 16]);
    screen.textures = vec![texture(4, &colors)];
    // The same as a colour, which a feature channel shows without any light.
    let mut painting = screen.clone();
    let albedo = Color { value: Vec3::ONE, texture: Some(0) };
    let painted = material("painted", Surface::Diffuse { albedo });
    painting.materials = vec![painted];
    for name in [LAVAPIPE, SWIFTSHADER] {
        let Some(driver) = driver(name) else { continue };
        let settings = Settings { max_depth: 1, sampler: Sampler::Pcg, ..Settings::default() };
        let shown = render(&driver.device, &screen, &settings, &BVH, 16).rgb(plane::BEAUTY).unwrap();
        let colors = render(&driver.device, &painting, &settings, &BVH, 16).rgb(plane::ALBEDO).unwrap();
        for (pixel, (shown, color)) in shown.iter().zip(&colors).enumerate() {
            let close = (0..3).all(|i| (shown[i] - 5.0 * color[i]).abs() < 1e-4);
            assert!(close, "{name}, pixel {pixel}: {shown:?}, not 5 × {color:?}");
        }
        driver.finish();
    }
}

/// A screen that is mirrored, and a ball that is dark but for a few spots, above a floor.
fn screen_and_spots() -> Scene {
    let meshes = vec![sheet(0.0, 3.0, 0), sheet(2.0, 0.7, 1), sphere(Vec3::new(-0.9, 0.0, 0.8), 0.5, 24, 2)];
    let both = Material { emits_both_sides: true, ..glowing(8.0, Some(0)) };
    let materials = vec![material("floor", diffuse(0.7)), both, glowing(30.0, Some(1))];
    let mut scene = scene(meshes, materials, Vec3::new(0.0, -4.0, 4.0), Vec3::new(0.0, 0.0, 0.6), [40, 30]);
    let mirrored = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    scene.instances[1] = Instance { mesh: 1, object_to_world: mirrored };
    let stripes: Vec<Vec3> = (0..8).map(|i| Vec3::new((i % 2) as f32, 0.5, i as f32 / 7.0)).collect();
    let spots: Vec<Vec3> = (0..256).map(|i| Vec3::splat(f32::from(i % 37 == 0))).collect();
    scene.textures = vec![texture(8, &stripes), texture(16, &spots)];
    scene.environment = Some(Environment::constant(Vec3::splat(0.05)));
    scene
}

#[test]
fn dark_triangles_are_not_sampled() {
    let scene = screen_and_spots();
    let lit = LightTable::new(&scene).triangles.iter().filter(|[instance, _]| *instance == 2).count();
    let all = scene.meshes[2].triangles.len();
    assert!(0 < lit && lit < all / 3, "{lit} of {all}");
    let mean = scene.mean_emission(&scene.meshes[1], 0);
    assert!((mean.y - 4.0).abs() < 1e-3, "{mean}");
    let mut without_uvs = scene.clone();
    without_uvs.meshes[1].uvs = Vec::<Vec2>::new();
    let expected = 8.0 * scene.textures[0].sample(Vec2::ZERO);
    assert!((without_uvs.mean_emission(&without_uvs.meshes[1], 0) - expected).length() < 1e-5);
}

/// One texel of a screen shines, where none of the places is by which its triangles are sampled; or none at all.
#[test]
fn what_is_not_worth_sampling_is_found() {
    let mut screen =
        scene(vec![sheet(0.0, 1.0, 0)], vec![glowing(5.0, Some(0))], Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, [16, 16]);
    for name in [LAVAPIPE, SWIFTSHADER] {
        let Some(driver) = driver(name) else { continue };
        for (bright, depth) in [(Some(17), 1), (Some(17), 3), (None, 3)] {
            screen.textures =
                vec![texture(16, &(0..256).map(|i| Vec3::splat(f32::from(Some(i) == bright))).collect::<Vec<_>>())];
            assert!(LightTable::new(&screen).triangles.is_empty());
            let settings = Settings { max_depth: depth, sampler: Sampler::Pcg, ..Settings::default() };
            let shown = render(&driver.device, &screen, &settings, &BVH, 512).rgb(plane::BEAUTY).unwrap();
            // A bilinear texel of radiance 5 is as much as one whole texel.
            let mean = shown.iter().map(|pixel| pixel[1]).sum::<f32>() / 256.0;
            let share = (1.0 / (4.0 * 20f32.to_radians().tan())).powi(2);
            let expected = if bright.is_some() { 5.0 / 256.0 * share } else { 0.0 };
            assert!((mean - expected).abs() <= 0.15 * expected, "{name}, depth {depth}: {mean}, not {expected}");
        }
        driver.finish();
    }
}

/// By light samples and BSDF samples together, and by the latter alone.
#[cfg(feature = "embree")]
#[test]
fn what_a_texture_lights_agrees_with_embree() {
    let scene = screen_and_spots();
    let mut even = scene.clone();
    even.materials[1].emission_texture = None;
    let settings = Settings { max_depth: 4, sampler: Sampler::Pcg, features: false, ..Settings::default() };
    agrees_with_embree("emission-texture", &scene, &even, &settings, [512, 128]);
    let by_bsdf = Settings { light_sampling: false, ..settings };
    agrees_with_embree("emission-texture-by-bsdf", &scene, &even, &by_bsdf, [512, 128]);
}
