//! Hard materials.

use glam::Vec3;

use super::build::*;
use super::{Case, Expected, Trial};
use crate::scene::{Environment, Material, Scene, Surface};

pub fn cases() -> Vec<Case> {
    let box_depth = 1000;
    let box_radiance = 1e-3 * (1.0 - 0.999f64.powi(box_depth as i32)) / 0.001;
    vec![
        Case {
            name: "roughness 0 to 10⁻³",
            why: "between a mirror and a lobe of 10⁶: densities from none to 10⁶ and half vectors that cancel",
            is_known_limit: false,
            trial: Trial::new(spheres([0.0, 1e-4, 3e-4, 1e-3].map(|alpha| material(conductor(0.9, alpha))).to_vec())),
        },
        Case {
            name: "F0 = 1",
            why: "nothing is lost: a mirror cannot be seen under a white sky",
            is_known_limit: false,
            trial: Trial::new(furnace(
                vec![sphere(Vec3::ZERO, 1.0, 24, false, 0)],
                vec![material(conductor(1.0, 0.0))],
                at(0.0, 0.0, 3.0),
                Vec3::ZERO,
            ))
            .expecting(Expected::Radiance(1.0, 1e-5)),
        },
        Case {
            name: "albedo 0.999 in a closed box",
            why: "a thousand bounces, each with its chance to lose or gain energy: e (1 − ρ¹⁰⁰⁰) / (1 − ρ)",
            is_known_limit: false,
            trial: {
                let mut trial = Trial::new(closed_box()).depth(box_depth).samples(2).without_light_sampling();
                trial.settings.roulette_after = u32::MAX;
                trial.expecting(Expected::Radiance(box_radiance, 1e-4))
            },
        },
        Case {
            name: "albedo 0.999 in a closed box, with roulette",
            why: "the same, where chance ends one path in a thousand at each bounce, and a lamp is sampled at each",
            is_known_limit: false,
            trial: Trial::new(closed_box()).depth(box_depth).samples(16).expecting(Expected::Mean(box_radiance, 1e-4)),
        },
        Case {
            name: "index 1",
            why: "a boundary that is none: Snell's law divides by the difference of indices",
            is_known_limit: false,
            trial: Trial::new(spheres(
                [1.0, 1.00005, 1.001, 0.999].map(|ior| material(Surface::Dielectric { ior, alpha: 0.0 })).to_vec(),
            ))
            .depth(12),
        },
        Case {
            name: "total internal reflection",
            why: "from inside of glass most directions have no refracted one",
            is_known_limit: false,
            trial: Trial::new(inside_glass()).depth(24),
        },
        Case {
            name: "index 10 and its inverse",
            why: "radiance is scaled by 100 at each crossing",
            is_known_limit: false,
            trial: Trial::new(spheres(
                [(10.0, 0.0), (0.1, 0.0), (10.0, 0.05), (0.1, 0.05)]
                    .map(|(ior, alpha)| material(Surface::Dielectric { ior, alpha }))
                    .to_vec(),
            ))
            .depth(12),
        },
        Case {
            name: "grazing coats",
            why: "coats from smooth to rough over a floor seen at 1°: Fresnel's reflectance rises to 1 within the last degrees",
            is_known_limit: false,
            trial: Trial::new(grazing_coats()),
        },
    ]
}

/// Four spheres on a grey floor, under a sky with a lamp.
fn spheres(mut materials: Vec<Material>) -> Scene {
    let mut meshes: Vec<_> = (0..materials.len() as u32)
        .map(|index| sphere(at(index as f32 * 1.1 - 1.65, 0.5, 0.0), 0.5, 24, false, index))
        .collect();
    meshes.push(floor(4.0, 0.0, materials.len() as u32));
    materials.push(material(diffuse(0.4)));
    meshes.push(ceiling(1.0, 3.0, materials.len() as u32));
    materials.push(lamp(4.0));
    let mut scene = scene(meshes, materials, at(0.0, 1.2, 5.5), at(0.0, 0.5, 0.0));
    scene.environment = Some(Environment::constant(Vec3::splat(0.3)));
    scene
}

fn closed_box() -> Scene {
    let walls = Material { emission: Vec3::splat(1e-3), ..material(diffuse(0.999)) };
    let mut scene = scene(vec![room(1.0, 0)], vec![walls], Vec3::ZERO, at(0.3, 0.2, -1.0));
    scene.film.width = 16;
    scene.film.height = 16;
    scene
}

fn inside_glass() -> Scene {
    let glass = material(Surface::Dielectric { ior: 1.5, alpha: 0.0 });
    furnace(
        vec![sphere(Vec3::ZERO, 1.0, 12, false, 0), floor(5.0, -2.0, 1)],
        vec![glass, material(diffuse(0.5))],
        at(0.0, 0.7, 0.1),
        at(0.0, 0.0, -0.3),
    )
}

fn grazing_coats() -> Scene {
    let stripe = |index: u32| {
        let x = |edge: u32| edge as f32 - 2.0;
        quad(
            [at(x(index), 0.0, 9.0), at(x(index + 1), 0.0, 9.0), at(x(index + 1), 0.0, -9.0), at(x(index), 0.0, -9.0)],
            index,
        )
    };
    let coats = [0.0, 1e-3, 0.03, 0.3].map(|alpha| {
        let albedo = crate::scene::Color::constant(Vec3::splat(0.5));
        material(Surface::Coated { albedo, ior: 1.5, alpha })
    });
    let mut scene = scene((0..4).map(stripe).collect(), coats.to_vec(), at(0.0, 0.15, 9.0), at(0.0, 0.0, 0.0));
    let (width, height) = (8, 8);
    let texels = (0..width * height).map(|i| Vec3::splat(if i / width < 3 { 2.0 } else { 0.5 })).collect();
    scene.environment = Some(Environment { width, height, texels, rotation_degrees: 0.0 });
    scene
}
