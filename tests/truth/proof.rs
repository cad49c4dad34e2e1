//! What Vulkan renders of these surfaces is what Embree renders, but for noise.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec2, Vec3};
use neubrdf::converge::prove_equal;
use neubrdf::reference::{Reference, ReferenceOptions};
use neubrdf::render::{Options, Sampler, Settings, Traversal};
use neubrdf::scene::{Brdf, Color, Environment, Fresnel, LayerBase, Layered, Scene, Surface, Woven, Yarn};

use crate::common::tables::{self, metal};
use crate::common::{LAVAPIPE, SWIFTSHADER, diffuse, driver, floor, lamp, material, quad, render, scene, sphere};
use crate::random::Random;

const SIGNIFICANCE: f64 = 1e-3;
const MAX_DEPTH: u32 = 5;

/// A ball of every kind on a floor, under a lamp and a sky.
fn balls() -> Scene {
    let phi = (0..9).map(|i| std::f32::consts::PI * (i as f32 / 8.0 - 1.0)).collect();
    let mut random = Random(4);
    let pairs = (0..60).map(|_| (random.above(0.05), random.above(0.05)));
    let brdfs = vec![
        Arc::new(Brdf::Merl(tables::merl(&metal(0.2, 0.2)))),
        Arc::new(Brdf::Rgl(tables::rgl(&metal(0.2, 0.4), phi, 16))),
        Arc::new(Brdf::Sparse(tables::sparse(&metal(0.5, 0.5), true, pairs))),
    ];
    let gold = Fresnel::Schlick { f0: Color::constant(Vec3::new(0.9, 0.6, 0.2)) };
    let base = LayerBase::Conductor { fresnel: gold, alpha: Vec2::splat(0.3) };
    let lacquer = Layered { ior: 1.5, alpha: 0.15, absorption: Vec3::new(0.1, 0.3, 0.6), base };
    let paint = LayerBase::Diffuse { albedo: Vec3::new(0.8, 0.3, 0.2) };
    let varnish = Layered { ior: 1.4, alpha: 0.3, absorption: Vec3::splat(0.05), base: paint };
    let yarn = |coverage, specular_width| Yarn {
        coverage,
        gloss: 0.6,
        f0: Vec3::new(0.9, 0.7, 0.5),
        albedo: Vec3::new(0.3, 0.4, 0.7),
        specular_width,
        volume_width: 0.3,
        isotropy: 0.4,
    };
    let cloth = Woven { warp: yarn(0.6, 0.08), weft: yarn(0.4, 0.2) };
    let surfaces = [
        Surface::Measured { brdf: 0 },
        Surface::Measured { brdf: 1 },
        Surface::Measured { brdf: 2 },
        Surface::Layered(lacquer),
        Surface::Layered(varnish),
        Surface::Woven(cloth),
    ];
    let mut materials = vec![material("floor", diffuse(0.5)), lamp(12.0)];
    let at = |x: f32, z: f32| Vec3::new(x, 3.0, z);
    let mut meshes = vec![floor(5.0, 0), quad([at(-0.7, -0.7), at(0.7, -0.7), at(0.7, 0.7), at(-0.7, 0.7)], 1)];
    for (index, surface) in surfaces.into_iter().enumerate() {
        let center = Vec3::new(1.3 * (index % 3) as f32 - 1.3, 0.6, 1.3 * (index / 3) as f32 - 0.6);
        meshes.push(sphere(center, 0.55, 24, materials.len() as u32));
        materials.push(material("ball", surface));
    }
    let mut scene = scene(meshes, materials, Vec3::new(0.0, 3.0, 6.0), Vec3::new(0.0, 0.4, 0.0), [40, 30]);
    scene.brdfs = brdfs;
    scene.environment = Some(Environment::constant(Vec3::new(0.3, 0.4, 0.5)));
    scene
}

#[test]
fn every_ball_agrees_with_embree() {
    let scene = balls();
    let options = ReferenceOptions { spp: 256, seed: 1, max_depth: MAX_DEPTH, crop: None };
    let reference = Reference::new(&scene).unwrap().render(&options, |_| {}, &AtomicBool::new(false)).unwrap().0;
    let settings =
        Settings { max_depth: MAX_DEPTH, seed: 2, sampler: Sampler::Pcg, features: false, ..Settings::default() };
    for (name, samples) in [(LAVAPIPE, 128), (SWIFTSHADER, 32)] {
        let Some(driver) = driver(name) else { continue };
        let options = Options { traversal: Some(Traversal::Bvh), pool_paths: None };
        let picture = render(&driver.device, &scene, &settings, &options, samples);
        let comparison = prove_equal(&format!("truths-{name}"), &picture, &reference, SIGNIFICANCE).unwrap();
        println!("{name}: p = {:.3}, bias {:+.2e}", comparison.z_test.unwrap().p, comparison.metrics.relative_bias);
        driver.finish();
    }
}

#[test]
fn what_a_surface_is_made_of_enters_the_hash() {
    let scene = balls();
    let hash = scene.hash();
    let mut hashes = vec![hash.clone()];
    let mut random = Random(5);
    let mut other = scene.clone();
    other.brdfs[0] = Arc::new(Brdf::Merl(tables::merl(&metal(0.21, 0.21))));
    hashes.push(other.hash());
    let mut other = scene.clone();
    other.brdfs[1] = Arc::new(Brdf::Rgl(tables::rgl(&metal(0.2, 0.2), vec![0.0], 16)));
    hashes.push(other.hash());
    let mut other = scene.clone();
    let pair: (DVec3, DVec3) = (random.above(0.1), random.above(0.1));
    other.brdfs[2] = Arc::new(Brdf::Sparse(tables::sparse(&metal(0.5, 0.5), true, std::iter::once(pair))));
    hashes.push(other.hash());
    let change = |change: &dyn Fn(&mut Surface)| {
        let mut other = scene.clone();
        other.materials.iter_mut().for_each(|material| change(&mut material.surface));
        other.hash()
    };
    hashes.push(change(&|surface| {
        if let Surface::Layered(layers) = surface {
            layers.absorption.x += 0.1;
        }
    }));
    hashes.push(change(&|surface| {
        if let Surface::Layered(Layered { base: LayerBase::Conductor { alpha, .. }, .. }) = surface {
            alpha.y = 0.4;
        }
    }));
    hashes.push(change(&|surface| {
        if let Surface::Woven(cloth) = surface {
            cloth.weft.isotropy = 0.1;
        }
    }));
    assert_eq!(hash, balls().hash());
    hashes.sort();
    hashes.dedup();
    assert_eq!(hashes.len(), 7);
}
