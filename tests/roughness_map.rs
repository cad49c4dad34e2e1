//! Maps of roughness: at each point a surface scatters as one of the roughness that its map says there.

mod common;

use common::*;
use glam::{Vec2, Vec3};
use half::f16;
use neubrdf::image::plane;
use neubrdf::render::{Options, Settings, Traversal};
use neubrdf::scene::{Color, Fresnel, Material, Surface, Texture};

/// The map of these roughnesses along u and v.
fn map(width: u32, roughnesses: &[Vec2]) -> Texture {
    let texel = |roughness: &Vec2| [roughness.x, roughness.y, 0.0, 1.0].map(f16::from_f32);
    Texture::new("roughness", width, roughnesses.iter().map(texel).collect())
}

fn mapped(surface: Surface) -> Material {
    Material { roughness_map: Some(0), ..material("mapped", surface) }
}

fn coat(albedo: Vec3, alpha: f32) -> Surface {
    Surface::Coated { albedo: Color::constant(albedo), ior: 1.5, alpha }
}

const GLASS: Surface = Surface::Dielectric { ior: 1.5, alpha: 0.0 };

/// What differs from the surface's own α by nothing but rounding (a coat: by its table) looks the same.
#[test]
fn a_map_of_one_roughness_is_that_roughness() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let settings = Settings { max_depth: 6, features: false, ..Settings::default() };
    let options = Options { traversal: Some(Traversal::Bvh), pool_paths: None };
    let alpha = Vec2::new(0.0625, 0.25);
    let fresnel = Fresnel::Schlick { f0: Color::constant(Vec3::splat(0.7)) };
    let metal = |alpha| Surface::Conductor { fresnel, alpha };
    let blue = Vec3::new(0.2, 0.3, 0.6);
    let mean = alpha.element_sum() / 2.0;
    let own =
        [metal(alpha), coat(blue, mean), Surface::Dielectric { ior: 1.5, alpha: mean }].map(|s| material("own", s));
    let by_map = [metal(Vec2::ZERO), coat(blue, 0.9), GLASS].map(mapped);
    let picture = |materials: &[Material]| {
        let scene = floor_and_balls(materials.to_vec(), map(1, &[Vec2::new(0.25, 0.5)]));
        let picture = render(&driver.device, &scene, &settings, &options, 64);
        picture.rgb(plane::BEAUTY).unwrap()
    };
    let (own, by_map) = (picture(&own), picture(&by_map));
    let difference = |[a, b]: [&[f32; 3]; 2]| f64::from((a[1] - b[1]).abs()) / f64::from(a[1]);
    let differences: Vec<f64> = own.iter().zip(&by_map).map(|(a, b)| difference([a, b])).collect();
    // A path that takes another turn by rounding changes its pixel by a part in so many samples.
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    assert!(mean < 2e-4, "{mean}");
    driver.finish();
}

/// Stripes from mirror to matte, other ones along v than along u, on metal, coat and glass: what Embree sees.
#[cfg(feature = "embree")]
#[test]
fn stripes_agree_with_embree() {
    use neubrdf::render::Sampler;
    let stripe = |i: u32| {
        let (x, y) = ((i % 8) as f32, (i / 8) as f32);
        // Some are out of range, as texels of an EXR file may be.
        Vec2::new(0.5 - 0.6 * (0.8 * x).cos(), 0.5 + 0.6 * (0.8 * y).sin())
    };
    let roughnesses: Vec<Vec2> = (0..64).map(stripe).collect();
    let materials = [conductor(0.7, 0.3), coat(Vec3::new(0.6, 0.3, 0.2), 0.2), GLASS].map(mapped);
    let scene = floor_and_balls(materials.to_vec(), map(8, &roughnesses));
    let mut even = scene.clone();
    even.textures = vec![map(1, &[Vec2::splat(0.5)])];
    let settings = Settings { max_depth: 6, sampler: Sampler::Pcg, features: false, ..Settings::default() };
    agrees_with_embree("roughness-map", &scene, &even, &settings, [256, 64]);
}
