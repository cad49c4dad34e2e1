//! Maps of the direction of anisotropy: at each point a surface scatters as if it were turned about its normal the way its map says.

mod common;

use std::f32::consts::{FRAC_PI_2, FRAC_PI_3};

use common::*;
use glam::{Vec2, Vec3};
use half::f16;
use neubrdf::converge::prove_equal;
use neubrdf::image::plane;
use neubrdf::render::{Options, Sampler, Settings, Traversal};
use neubrdf::scene::{Color, Fresnel, Material, Scene, Surface, Texture, TexturePlacement};

/// The map of directions at these angles from u towards v, as a file holds them.
fn map(width: u32, angles: &[f32]) -> Texture {
    let texel =
        |angle: &f32| (0.5 + 0.5 * Vec2::from_angle(*angle)).extend(0.0).extend(1.0).to_array().map(f16::from_f32);
    Texture::new("directions", width, angles.iter().map(texel).collect()).of_doubled_angles()
}

fn metal(alpha: Vec2) -> Surface {
    Surface::Conductor { fresnel: Fresnel::Schlick { f0: Color::constant(Vec3::splat(0.7)) }, alpha }
}

/// A metal whose α along u is a fifth of that along v, on a floor and two balls, turned by a map.
fn turned(texture: Texture) -> Scene {
    let alpha = Vec2::new(0.06, 0.3);
    let by_map = || Material { anisotropy_direction_map: Some(0), ..material("turned", metal(alpha)) };
    floor_and_balls(vec![by_map(), by_map(), by_map()], texture)
}

/// How far two pictures differ, in parts of the first: a path that takes another turn by rounding changes its pixel by a part in 64.
fn difference(driver: &Driver, [a, b]: [&Scene; 2]) -> f64 {
    let settings = Settings { max_depth: 6, features: false, ..Settings::default() };
    let options = Options { traversal: Some(Traversal::Bvh), pool_paths: None };
    let [a, b] = [a, b].map(|scene| render(&driver.device, scene, &settings, &options, 64).rgb(plane::BEAUTY).unwrap());
    let of_pixel = |(a, b): (&[f32; 3], &[f32; 3])| f64::from((a[1] - b[1]).abs()) / f64::from(a[1]);
    a.iter().zip(&b).map(of_pixel).sum::<f64>() / a.len() as f64
}

#[test]
fn a_quarter_turn_swaps_the_roughnesses() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let picture = |scene: &Scene, seed: u32| {
        let settings = Settings { max_depth: 6, sampler: Sampler::Pcg, features: false, seed, ..Settings::default() };
        let options = Options { traversal: Some(Traversal::Bvh), pool_paths: None };
        render(&driver.device, scene, &settings, &options, 256)
    };
    let mut swapped = turned(map(1, &[0.0]));
    swapped.materials.fill(material("swapped", metal(Vec2::new(0.3, 0.06))));
    let swapped = picture(&swapped, 1);
    let proved = |angle: f32| prove_equal("quarter-turn", &picture(&turned(map(1, &[angle])), 2), &swapped, 1e-3);
    proved(FRAC_PI_2).unwrap();
    assert!(proved(0.0).is_err());
    driver.finish();
}

/// Half a turn is none, and where a map lies mirrored its directions are mirrored.
#[test]
fn directions_have_no_sign_and_are_mirrored_with_their_map() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let sixth = turned(map(1, &[FRAC_PI_3]));
    let opposite = turned(map(1, &[FRAC_PI_3 - 2.0 * FRAC_PI_2]));
    let other = turned(map(1, &[-FRAC_PI_3]));
    assert!(difference(&driver, [&sixth, &opposite]) < 2e-3);
    assert!(difference(&driver, [&sixth, &other]) > 0.02);
    for (scale, expected) in
        [([-2.0, 1.0], &other), ([1.0, -1.0], &other), ([-1.0, -3.0], &sixth), ([4.0, 1.0], &sixth)]
    {
        let mut placed = sixth.clone();
        placed.textures[0].placement = TexturePlacement { scale: scale.into(), offset: Vec2::ZERO };
        let found = difference(&driver, [expected, &placed]);
        assert!(found < 2e-3, "{scale:?}: {found}");
    }
    driver.finish();
}

/// What is between a direction and its opposite is not nothing: directions that differ by half a turn from texel to texel are one.
#[test]
fn opposite_texels_are_alike() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let angles: Vec<f32> = (0..16u8).map(|i| FRAC_PI_3 + 2.0 * FRAC_PI_2 * f32::from(i % 3)).collect();
    let found = difference(&driver, [&turned(map(1, &[FRAC_PI_3])), &turned(map(4, &angles))]);
    assert!(found < 2e-3, "{found}");
    driver.finish();
}

/// A swirl over a metal with bumps, seen from either side, a cloth and a metal that is mirrored: what Embree sees.
#[cfg(feature = "embree")]
#[test]
fn a_swirl_agrees_with_embree() {
    use neubrdf::scene::{Woven, Yarn};
    let angle = |i: u8| {
        let at = Vec2::new(f32::from(i % 16), f32::from(i / 16)) - 7.5;
        at.to_angle() + 0.2 * at.length()
    };
    let angles: Vec<f32> = (0..=255).map(angle).collect();
    let swirled = |surface| Material { anisotropy_direction_map: Some(0), ..material("swirl", surface) };
    let bumpy = Material { normal_map: Some(1), ..swirled(metal(Vec2::new(0.06, 0.3))) };
    let warp = Yarn {
        coverage: 0.7,
        gloss: 0.8,
        f0: Vec3::splat(0.2),
        albedo: Vec3::new(0.2, 0.3, 0.7),
        specular_width: 0.1,
        volume_width: 0.3,
        isotropy: 0.2,
    };
    let cloth = Surface::Woven(Woven { warp, weft: Yarn { coverage: 0.3, gloss: 0.2, ..warp } });
    let mut scene = floor_and_balls(vec![bumpy, swirled(cloth), swirled(metal(Vec2::new(0.4, 0.1)))], map(16, &angles));
    let bump = |i: u8| Vec3::new(0.3 * f32::from(i % 3) - 0.3, 0.2 * f32::from(i % 2), 1.0).normalize();
    let texel = |i: u8| (0.5 + 0.5 * bump(i)).extend(1.0).to_array().map(f16::from_f32);
    scene.textures.push(Texture::new("bumps", 4, (0..16).map(texel).collect()));
    scene.instances[2].object_to_world = glam::Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let mut straight = scene.clone();
    straight.materials.iter_mut().for_each(|material| material.anisotropy_direction_map = None);
    let settings = Settings { max_depth: 6, sampler: Sampler::Pcg, features: false, ..Settings::default() };
    agrees_with_embree("direction-map", &scene, &straight, &settings, [256, 64]);
}
