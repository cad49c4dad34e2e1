//! Paths that neighbouring pixels share: nothing is biased by it, bits do not hang on batches, and indirect light has less noise.

mod common;

use common::*;
use glam::Vec3;
use neubrdf::converge::ZTest;
use neubrdf::image::{Metadata, Picture, plane, read_exr, write_exr};
use neubrdf::render::{BsdfSampling, Features, Options, Renderer, Sampler, Settings, Traversal};
use neubrdf::scene::{Film, LightTable, Material, Opacity, Scene, Surface};

fn settings() -> Settings {
    Settings { max_depth: 6, seed: 3, features: false, path_reuse: true, ..Settings::default() }
}

fn by(traversal: Traversal) -> Options {
    Options { traversal: Some(traversal), pool_paths: None }
}

fn cornell(side: u32) -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell/scene.toml");
    Scene { film: Film { width: side, height: side }, ..Scene::load(path).unwrap().0 }
}

/// Everything at once: smooth normals, instances that move and a sky, a surface that paths are not shared at, and a film that no square fits.
fn mixed(surface: Surface) -> Scene {
    let mut scene = still_life(diffuse(0.8));
    scene.meshes.push(sphere(Vec3::ZERO, 0.5, 12, 3));
    scene.materials.push(material("other", surface));
    let other = scene.meshes.len() as u32 - 1;
    for x in [-1.3, 1.3] {
        let place = glam::Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 0.8, 1.2),
            glam::Quat::from_rotation_y(x),
            Vec3::new(x, 0.45, 0.4),
        );
        scene.instances.push(neubrdf::scene::Instance { mesh: other, object_to_world: place });
    }
    // A second ball that shares paths, near the first: much of what one receives the other sends.
    scene.meshes.push(sphere(Vec3::new(-0.5, 0.3, 0.9), 0.3, 10, 1));
    let ball = scene.meshes.len() as u32 - 1;
    scene.instances.push(neubrdf::scene::Instance { mesh: ball, object_to_world: glam::Affine3A::IDENTITY });
    scene
}

/// Of each 8 × 8 square of pixels and channel, how far the mean over many seeds is from Embree's picture, in standard errors: those of
/// the squares' sums over the seeds, which hold however pixels err alike.
#[cfg(feature = "embree")]
fn far_from_embree(driver: &Driver, scene: &Scene, settings: &Settings, options: &Options) -> f64 {
    use neubrdf::reference::{Reference, ReferenceOptions};
    const SEEDS: u32 = 48;
    const SAMPLES: u32 = 8;
    let squares = |picture: &Picture, plane: [&str; 3]| {
        let columns = picture.width.div_ceil(8);
        let mut sums = vec![0.0; (columns * picture.height.div_ceil(8) * 3) as usize];
        for (pixel, value) in (0..).zip(picture.rgb(plane).unwrap()) {
            let square = pixel / picture.width / 8 * columns + pixel % picture.width / 8;
            for channel in 0..3 {
                sums[square as usize * 3 + channel] += f64::from(value[channel]);
            }
        }
        sums
    };
    let of_reference = ReferenceOptions { spp: 1024, seed: 1, max_depth: settings.max_depth, crop: None };
    let never = std::sync::atomic::AtomicBool::new(false);
    let reference = Reference::new(scene).unwrap().render(&of_reference, |_| {}, &never).unwrap().0;
    let [expected, variance] = [plane::BEAUTY, plane::VARIANCE].map(|plane| squares(&reference, plane));

    let mut renderer = Renderer::new(&driver.device, scene, settings, options).unwrap();
    let (mut sum, mut square) = (vec![0.0; expected.len()], vec![0.0; expected.len()]);
    for seed in 0..SEEDS {
        renderer.restart(seed).unwrap();
        renderer.render_pass(SAMPLES).unwrap();
        let found = squares(&renderer.picture().unwrap().0, plane::BEAUTY);
        for (i, value) in found.into_iter().enumerate() {
            // About the expectation, so that nothing cancels.
            sum[i] += value - expected[i];
            square[i] += (value - expected[i]).powi(2);
        }
    }
    let count = f64::from(SEEDS);
    let z = (0..expected.len()).map(|i| {
        let mean = sum[i] / count;
        let spread = (square[i] / count - mean * mean) / (count - 1.0);
        let rounding = 1e-5 * expected[i];
        mean / (spread.max(0.0) + variance[i] + rounding * rounding + 1e-30).sqrt()
    });
    z.fold(0.0, |worst, z| if z.abs() > f64::abs(worst) || z.is_nan() { z } else { worst })
}

/// What comes of shared paths is what Embree, which shares none, makes of the scene: with every kind of surface beside diffuse ones, and whatever
/// picks directions and ends paths.
#[cfg(feature = "embree")]
#[test]
fn shared_paths_have_the_expectation_of_others() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scenes = [
        ("cornell", cornell(24)),
        ("glass", mixed(Surface::Dielectric { ior: 1.5, alpha: 0.0 })),
        ("metal", mixed(conductor(0.9, 0.1))),
    ];
    let variants = [
        ("", settings()),
        (", cosine, early roulette", Settings { bsdf_sampling: BsdfSampling::Cosine, roulette_after: 0, ..settings() }),
        (", independent", Settings { sampler: Sampler::Pcg, ..settings() }),
    ];
    for (title, scene) in &scenes {
        for (variant, settings) in &variants {
            let traversals = [Traversal::Bvh, Traversal::RayQuery];
            for traversal in traversals.into_iter().filter(|traversal| driver.has(*traversal)) {
                let z = far_from_embree(&driver, scene, settings, &by(traversal));
                println!("{title}{variant}, {traversal}: worst z {z:+.2}");
                // Of some sixty squares' three channels, and 47 degrees of freedom: a chance of 10⁻³ in each of these pictures.
                assert!(z.abs() < 5.0, "{title}{variant}, {traversal}: {z:+.2} standard errors off");
            }
        }
    }
    driver.finish();
}

#[cfg(feature = "embree")]
#[test]
fn the_second_driver_shares_paths_alike() {
    let Some(driver) = driver(SWIFTSHADER) else { return };
    let z = far_from_embree(&driver, &cornell(16), &settings(), &by(Traversal::Bvh));
    assert!(z.abs() < 5.0, "{z:+.2} standard errors off");
    driver.finish();
}

#[test]
fn neither_batches_nor_passes_nor_traversals_change_a_bit() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = mixed(conductor(0.9, 0.1));
    let with_pool = |paths| {
        let options = Options { pool_paths: Some(paths), ..by(Traversal::Bvh) };
        render(&driver.device, &scene, &settings(), &options, 21)
    };
    let whole = with_pool(1 << 20);
    for paths in [1, 64, 1000, 5000] {
        assert!(with_pool(paths) == whole, "a pool of {paths} paths");
    }
    let mut in_odd_passes = Renderer::new(&driver.device, &scene, &settings(), &by(Traversal::Bvh)).unwrap();
    [5, 3, 13].into_iter().for_each(|samples| in_odd_passes.render_pass(samples).unwrap());
    assert!(in_odd_passes.picture().unwrap().0 == whole);
    drop(in_odd_passes);
    if driver.has(Traversal::RayQuery) {
        assert_eq!(bits(&render(&driver.device, &scene, &settings(), &by(Traversal::RayQuery), 21)), bits(&whole));
    }
    driver.finish();
}

/// Direct light is as it is without; of indirect light a Cornell box has a quarter of the variance at most.
#[test]
fn indirect_light_has_less_noise_and_direct_light_the_same() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = cornell(64);
    let picture = |path_reuse, max_depth| {
        let settings = Settings { path_reuse, max_depth, sampler: Sampler::Pcg, ..settings() };
        render(&driver.device, &scene, &settings, &by(Traversal::Bvh), 16)
    };
    assert_eq!(bits(&picture(true, 2)), bits(&picture(false, 2)));
    let variance = |picture: &Picture| {
        let plane = picture.rgb(plane::VARIANCE).unwrap();
        plane.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>()
    };
    // What the light that falls on surfaces directly has of it stays.
    let [direct, alone, shared] =
        [(false, 2), (false, 6), (true, 6)].map(|(reuse, depth)| variance(&picture(reuse, depth)));
    assert!(shared - direct < (alone - direct) / 4.0, "{direct:.3e} {alone:.3e} {shared:.3e}");
    driver.finish();
}

/// Pixels that share paths err alike, and a picture and its file say so: the z-test of two such pictures is not taken in.
#[test]
fn a_z_test_knows_that_pixels_err_alike() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = cornell(64);
    let picture = |seed| {
        let settings = Settings { seed, sampler: Sampler::Pcg, ..settings() };
        render(&driver.device, &scene, &settings, &by(Traversal::Bvh), 64)
    };
    let (first, second) = (picture(1), picture(2));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("shared.exr");
    write_exr(&file, &first, &Metadata::default()).unwrap();
    let first = read_exr(&file).unwrap().0;
    assert_eq!((first.paths_shared_by, second.paths_shared_by), (8, 8));
    let told = ZTest::for_noise(&first, &second).unwrap();
    assert!(told.p > 0.01 && told.z_rms < 1.1, "{told:?}");
    let untold = |mut picture: Picture| {
        picture.paths_shared_by = 1;
        picture
    };
    let untold = ZTest::for_noise(&untold(first), &untold(second)).unwrap();
    assert!(untold.z_rms > 1.4, "{untold:?}");
    driver.finish();
}

#[test]
fn what_shares_no_paths_builds_nothing_for_it() {
    let scene = cornell(8);
    let names = |path_reuse, max_depth| {
        let settings = Settings { path_reuse, max_depth, ..settings() };
        let plans = Features::of(&scene, &LightTable::new(&scene)).kernels(Traversal::Bvh, &settings, 64);
        plans.into_iter().map(|plan| plan.name).collect::<Vec<_>>()
    };
    let without = ["generate", "trace_closest_bvh", "shade_diffuse", "trace_shadow_bvh", "resolve", "estimate_error"];
    assert_eq!(names(false, 6), without);
    assert_eq!(names(true, 2), without, "nothing but direct light");
    assert_eq!(names(true, 6), [&without[..4], &["trace_reuse_bvh", "reuse_paths"], &without[4..]].concat());
}

#[test]
fn what_paths_cannot_be_shared_in_is_refused() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let refused = |scene: &Scene, settings: &Settings| {
        Renderer::new(&driver.device, scene, settings, &by(Traversal::Bvh)).err().unwrap().to_string()
    };
    let uniform = Settings { bsdf_sampling: BsdfSampling::Uniform, ..settings() };
    let message = refused(&cornell(8), &uniform);
    assert!(message.contains("BSDF sampling is uniform") && message.contains("reused"), "{message}");
    let mut holes = still_life(diffuse(0.5));
    holes.materials[1] = Material { opacity: Opacity { value: 0.5, texture: None }, ..material("veil", diffuse(0.5)) };
    let message = refused(&holes, &settings());
    assert!(message.contains("path reuse is on") && message.contains("holes"), "{message}");
    driver.finish();
}
