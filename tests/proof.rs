//! The proof: what Vulkan renders is what Embree renders, but for noise, on every shipped scene.
#![cfg(feature = "embree")]

mod common;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use common::*;
use neubrdf::converge::prove_equal;
use neubrdf::image::Picture;
use neubrdf::reference::{Reference, ReferenceOptions};
use neubrdf::render::{Options, Sampler, Settings, Traversal};
use neubrdf::scene::{Film, Scene};

/// A correct renderer fails one comparison in a thousand; the seeds are fixed, so it fails always or never.
const SIGNIFICANCE: f64 = 1e-3;
const MAX_DEPTH: u32 = 8;
const SAMPLES: u32 = 64;
const REFERENCE_SAMPLES: u32 = 256;

/// A scene small enough for a test.
fn small(path: &Path) -> Scene {
    let mut scene = Scene::load(path).unwrap().0;
    scene.film = Film { width: 48, height: 48 * scene.film.height / scene.film.width };
    scene
}

fn reference(scene: &Scene) -> Picture {
    let options = ReferenceOptions { spp: REFERENCE_SAMPLES, seed: 1, max_depth: MAX_DEPTH, crop: None };
    Reference::new(scene).unwrap().render(&options, |_| {}, &AtomicBool::new(false)).unwrap().0
}

/// Independent numbers, so that the spread of a pixel's samples is the variance of its mean.
fn settings() -> Settings {
    Settings { max_depth: MAX_DEPTH, seed: 2, sampler: Sampler::Pcg, features: false, ..Settings::default() }
}

fn prove(driver_name: &str, traversals: &[Traversal], scenes: &[PathBuf]) {
    let Some(driver) = driver(driver_name) else { return };
    let mut failures = Vec::new();
    for path in scenes {
        let scene = small(path);
        let reference = reference(&scene);
        for traversal in traversals {
            let options = Options { traversal: Some(*traversal), pool_paths: None };
            let picture = render(&driver.device, &scene, &settings(), &options, SAMPLES);
            let title = path.parent().and_then(Path::file_name).unwrap().to_string_lossy().into_owned();
            let name = format!("proof-{driver_name}-{traversal}-{title}");
            match prove_equal(&name, &picture, &reference, SIGNIFICANCE) {
                Ok(comparison) => {
                    let test = comparison.z_test.unwrap();
                    println!("{name}: p = {:.3}, bias {:+.2e}", test.p, comparison.metrics.relative_bias);
                }
                Err(error) => failures.push(error.to_string()),
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
    driver.finish();
}

#[test]
fn every_shipped_scene_agrees_with_embree_by_the_bvh() {
    prove(LAVAPIPE, &[Traversal::Bvh], &shipped_scenes());
}

#[test]
fn every_shipped_scene_agrees_with_embree_by_ray_query() {
    prove(LAVAPIPE, &[Traversal::RayQuery], &shipped_scenes());
}

#[test]
fn the_second_driver_agrees_with_embree() {
    let scenes: Vec<_> = shipped_scenes()
        .into_iter()
        .filter(|path| path.ends_with("cornell/scene.toml") || path.ends_with("still_life/scene.toml"))
        .collect();
    assert_eq!(scenes.len(), 2);
    prove(SWIFTSHADER, &[Traversal::Bvh], &scenes);
}
