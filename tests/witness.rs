//! An independent witness: Mitsuba 3 renders what we render, but for noise, wherever both define the scene alike. Skipped unless
//! MITSUBA_PYTHON names a python that has it.

mod common;

use common::*;
use glam::{Affine3A, Quat, Vec2, Vec3};
use neubrdf::converge::study::average;
use neubrdf::converge::{Mitsuba, MitsubaError, ZTest, export_mitsuba};
use neubrdf::render::{Options, Sampler, Settings};
use neubrdf::scene::{Environment, Film, Fresnel, Instance, LayerBase, Layered, Lens, Scene, Sun, Surface};

const MAX_DEPTH: u32 = 6;

fn cornell() -> Scene {
    let path = shipped_scenes().into_iter().find(|path| path.ends_with("cornell/scene.toml")).unwrap();
    let mut scene = Scene::load(path).unwrap().0;
    scene.film = Film { width: 32, height: 32 };
    scene
}

/// Gold, glass, a sun, a sky, a lens, a mirrored instance: all that both define alike.
fn specular() -> Scene {
    let gold = Fresnel::Complex { eta: Vec3::new(0.16, 0.42, 1.5), kappa: Vec3::new(3.6, 2.3, 1.9) };
    let ball = |center: Vec3, index| {
        let mut mesh = sphere(center, 0.6, 16, index);
        mesh.normals.clear();
        mesh
    };
    let mut scene = still_life(diffuse(0.5));
    scene.materials[1] = material("gold", Surface::Conductor { fresnel: gold, alpha: Vec2::ZERO });
    scene.materials.push(material("glass", Surface::Dielectric { ior: 1.5, alpha: 0.0 }));
    scene.meshes[1] = ball(Vec3::new(-0.8, 0.7, 0.0), 1);
    scene.meshes.push(ball(Vec3::new(-0.8, 0.7, 0.3), 3));
    let mirrored = Affine3A::from_scale_rotation_translation(Vec3::new(-1.0, 1.0, 1.0), Quat::IDENTITY, Vec3::ZERO);
    scene.instances.push(Instance { mesh: 3, object_to_world: mirrored });
    scene.environment = Some(Environment::constant(Vec3::new(0.2, 0.3, 0.5)));
    scene.sun = Some(Sun { direction: Vec3::new(0.5, 0.8, 0.3).normalize(), irradiance: Vec3::new(1.0, 0.9, 0.8) });
    scene.camera.lens = Some(Lens { radius: 0.05, focus_distance: 5.0 });
    scene.film = Film { width: 32, height: 24 };
    scene
}

#[test]
fn mitsuba_renders_what_we_render() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    for (name, scene) in [("cornell", cornell()), ("specular", specular())] {
        let mut mitsuba = match Mitsuba::start(&scene, MAX_DEPTH) {
            Ok(mitsuba) => mitsuba,
            Err(MitsubaError::Missing) => return eprintln!("skipped: {}", MitsubaError::Missing),
            Err(error) => panic!("{error}"),
        };
        let witness: Vec<_> = (0..32).map(|seed| mitsuba.render(32, seed).unwrap().0).collect();
        let witness = average(&witness).unwrap();
        let settings =
            Settings { max_depth: MAX_DEPTH, seed: 3, sampler: Sampler::Pcg, features: false, ..Settings::default() };
        let picture = render(&driver.device, &scene, &settings, &Options::default(), 512);
        let test = ZTest::for_noise(&picture, &witness).unwrap();
        println!(
            "{name} beside {}: p = {:.3}, z of the mean {:?}, z rms {:.3}",
            mitsuba.name(),
            test.p,
            test.z_mean,
            test.z_rms
        );
        assert!(!test.rejects(1e-3), "{name}: {test:?}");
    }
    driver.finish();
}

#[test]
fn what_mitsuba_defines_otherwise_is_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let base = LayerBase::Diffuse { albedo: Vec3::ONE };
    let layered = Surface::Layered(Layered { ior: 1.5, alpha: 0.1, absorption: Vec3::ZERO, base });
    for (surface, told) in [
        (conductor(0.5, 0.0), "Schlick"),
        (conductor(1.0, 0.1), "rough metal"),
        (Surface::Dielectric { ior: 1.5, alpha: 0.1 }, "rough glass"),
        (Surface::Coated { albedo: neubrdf::scene::Color::constant(Vec3::ONE), ior: 1.5, alpha: 0.0 }, "coated"),
        (layered, "it is layered"),
    ] {
        let error = export_mitsuba(&still_life(surface), 4, directory.path()).unwrap_err().to_string();
        assert!(error.contains("'ball'") && error.contains(told), "{error}");
    }
    let path = export_mitsuba(&cornell(), 4, &directory.path().join("cornell")).unwrap();
    let xml = std::fs::read_to_string(path).unwrap();
    assert!(xml.contains("\"max_depth\" value=\"4\"") && xml.matches("<shape").count() >= 4, "{xml}");
}
