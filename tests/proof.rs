//! The proof: what Vulkan renders is what Embree renders, but for noise, on every shipped scene and on a shelf of networks.
#![cfg(feature = "embree")]

mod common;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use common::*;
use glam::{Affine3A, Vec3};
use neubrdf::converge::prove_equal;
use neubrdf::image::Picture;
use neubrdf::reference::{Reference, ReferenceOptions};
use neubrdf::render::{Options, Sampler, Settings, Traversal};
use neubrdf::scene::{Brdf, Film, Instance, Scene, Surface};

/// A correct renderer fails one comparison in a thousand; the seeds are fixed, so it fails always or never.
const SIGNIFICANCE: f64 = 1e-3;
const MAX_DEPTH: u32 = 8;
const SAMPLES: u32 = 64;
const REFERENCE_SAMPLES: u32 = 256;

/// A shipped scene, small enough for a test, with its title.
fn small(path: &Path) -> (String, Scene) {
    let mut scene = Scene::load(path).unwrap().0;
    scene.film = Film { width: 48, height: 48 * scene.film.height / scene.film.width };
    (path.parent().and_then(Path::file_name).unwrap().to_string_lossy().into_owned(), scene)
}

fn all_shipped() -> Vec<(String, Scene)> {
    let truth = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/mosaic/truth.toml");
    let of_maps = ("mosaic-of-maps".to_owned(), small(&truth).1);
    shipped_scenes().iter().map(|path| small(path)).chain([of_maps]).collect()
}

/// Balls of networks from matte to mirror-like, a diffuse floor, a lamp and a sky.
fn shelf_of_networks(neubrdfs: &[(String, Arc<Brdf>)]) -> (String, Scene) {
    let mut scene = still_life(diffuse(0.5));
    let lamp = scene.meshes.pop().unwrap();
    scene.meshes.truncate(1);
    scene.meshes.push(lamp);
    scene.materials.remove(1);
    scene.meshes[1].materials = vec![1];
    let networks = networks::all();
    let others = networks[networks::neubrdfs().len()..].iter().step_by(networks.len().div_ceil(8 - neubrdfs.len()));
    for (index, (name, brdf)) in neubrdfs.iter().chain(others).enumerate() {
        let (column, row) = ((index % 4) as f32, (index / 4) as f32);
        let center = Vec3::new(1.2 * (column - 1.5), 0.6 + 1.1 * row, -row);
        scene.meshes.push(sphere(center, 0.5, 32, scene.materials.len() as u32));
        scene.materials.push(material(name, Surface::Measured { brdf: scene.brdfs.len() as u32 }));
        scene.brdfs.push(brdf.clone());
    }
    let placed = |mesh| Instance { mesh, object_to_world: Affine3A::IDENTITY };
    scene.instances = (0..scene.meshes.len() as u32).map(placed).collect();
    scene.film = Film { width: 48, height: 36 };
    ("networks".into(), scene)
}

fn reference(scene: &Scene) -> Picture {
    let options = ReferenceOptions { spp: REFERENCE_SAMPLES, seed: 1, max_depth: MAX_DEPTH, crop: None };
    Reference::new(scene).unwrap().render(&options, |_| {}, &AtomicBool::new(false)).unwrap().0
}

/// Independent numbers, so that the spread of a pixel's samples is the variance of its mean.
fn settings() -> Settings {
    Settings { max_depth: MAX_DEPTH, seed: 2, sampler: Sampler::Pcg, features: false, ..Settings::default() }
}

fn prove(driver_name: &str, traversals: &[Traversal], scenes: &[(String, Scene)]) {
    let Some(driver) = driver(driver_name) else { return };
    let mut failures = Vec::new();
    for (title, scene) in scenes {
        let reference = reference(scene);
        for traversal in traversals.iter().filter(|traversal| driver.has(**traversal)) {
            let options = Options { traversal: Some(*traversal), pool_paths: None };
            let picture = render(&driver.device, scene, &settings(), &options, SAMPLES);
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
    prove(LAVAPIPE, &[Traversal::Bvh], &all_shipped());
}

#[test]
fn every_shipped_scene_agrees_with_embree_by_ray_query() {
    prove(LAVAPIPE, &[Traversal::RayQuery], &all_shipped());
}

#[test]
fn the_second_driver_agrees_with_embree() {
    let scenes: Vec<_> = shipped_scenes()
        .into_iter()
        .filter(|path| path.ends_with("cornell/scene.toml") || path.ends_with("still_life/scene.toml"))
        .map(|path| small(&path))
        .collect();
    assert_eq!(scenes.len(), 2);
    prove(SWIFTSHADER, &[Traversal::Bvh], &scenes);
}

#[test]
fn networks_agree_with_embree() {
    prove(LAVAPIPE, &[Traversal::Bvh, Traversal::RayQuery], &[shelf_of_networks(&networks::neubrdfs())]);
    // Its compiler takes gigabytes and minutes for shade_neubrdf; tests/neubrdf_device.rs runs the evaluation alone there.
    prove(SWIFTSHADER, &[Traversal::Bvh], &[shelf_of_networks(&[])]);
}
