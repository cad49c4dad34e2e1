//! Hard lights.

use glam::Vec3;

use super::build::*;
use super::{Case, Expected, Trial};
use crate::scene::{Environment, Scene, Sun};

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            name: "a lamp 10⁻⁴ wide",
            why: "no path runs into it: all light comes from light samples, whose densities are 10⁸",
            is_known_limit: false,
            trial: Trial::new(with_lamp(5e-5, 4e8)),
        },
        Case {
            name: "one pixel of sky 10⁵ brighter",
            why: "a sky sampled by anything but its radiance would miss it",
            is_known_limit: false,
            trial: Trial::new(spotted_sky()),
        },
        Case {
            name: "10⁴ lamps over six decades",
            why: "one table over all of them; picking them alike would give fireflies of 10⁶",
            is_known_limit: false,
            trial: Trial::new(many_lamps()),
        },
        Case {
            name: "a lamp at grazing",
            why: "cosines on both sides go to 0 along the edge where the lamp meets the floor, and 1/distance² to infinity",
            is_known_limit: false,
            trial: Trial::new(grazing_lamp()),
        },
        Case {
            name: "black lamps",
            why: "emitters without power have no place in a table of powers",
            is_known_limit: false,
            trial: Trial::new(with_lamp(0.5, 0.0)).expecting(Expected::Radiance(0.0, 0.0)),
        },
        Case {
            name: "no light",
            why: "a table of nothing must not be read",
            is_known_limit: false,
            trial: Trial::new(scene(
                vec![floor(1.0, 0.0, 0)],
                vec![material(diffuse(0.5))],
                at(0.0, 2.0, 2.0),
                Vec3::ZERO,
            ))
            .expecting(Expected::Radiance(0.0, 0.0)),
        },
        Case {
            name: "a sun alone",
            why: "a light without area, found by light samples only, whose cosine law is exact: albedo/π · irradiance · cos 60°",
            is_known_limit: false,
            trial: Trial::new(sun_alone()).expecting(Expected::Radiance(0.5 / std::f64::consts::PI, 1e-5)),
        },
    ]
}

fn with_lamp(half_side: f32, radiance: f32) -> Scene {
    let mut scene = still_life(1.0);
    scene.meshes[2] = ceiling(half_side, 2.5, 2);
    scene.materials[2] = lamp(radiance);
    scene
}

fn spotted_sky() -> Scene {
    let mut scene = still_life(1.0);
    scene.materials[2] = lamp(0.0);
    let (width, height) = (64, 32);
    let mut texels = vec![Vec3::ONE; width * height];
    texels[6 * width + 20] = Vec3::splat(1e5);
    scene.environment = Some(Environment { width: width as u32, height: height as u32, texels, rotation_degrees: 0.0 });
    scene
}

fn many_lamps() -> Scene {
    let mut scene = still_life(1.0);
    let decades = 7;
    scene.materials.truncate(2);
    scene.materials.extend((0..decades).map(|decade| lamp(3e-3 * 10f32.powi(decade))));
    let side = 100;
    let mut lamps = triangles(&[], &[], 0);
    lamps.materials.clear();
    for index in 0..side * side {
        let place = |index: i32| (index as f32 + 0.5) / side as f32 * 6.0 - 3.0;
        let (x, z) = (place(index % side), place(index / side));
        let first = lamps.positions.len() as u32;
        lamps.positions.extend([at(x, 3.0, z), at(x + 0.02, 3.0, z), at(x, 3.0, z + 0.02)]);
        lamps.triangles.push([first, first + 1, first + 2]);
        // The brighter, the fewer: powers of decades are alike.
        let decade = (0..decades - 1).take_while(|decade| index % 3i32.pow(*decade as u32 + 1) == 0).count();
        lamps.materials.push(2 + decade as u32);
    }
    scene.meshes[2] = lamps;
    scene
}

fn grazing_lamp() -> Scene {
    let wall = [at(-1.0, 0.0, -1.0), at(1.0, 0.0, -1.0), at(1.0, 1.0, -1.0), at(-1.0, 1.0, -1.0)];
    scene(
        vec![floor(2.0, 0.0, 0), quad(wall, 1)],
        vec![material(diffuse(0.5)), lamp(1.0)],
        at(0.0, 1.0, 2.0),
        at(0.0, 0.0, -0.8),
    )
}

fn sun_alone() -> Scene {
    let mut scene = scene(vec![floor(100.0, 0.0, 0)], vec![material(diffuse(1.0))], at(0.0, 2.0, 1.0), Vec3::ZERO);
    let direction = at(0.0, 0.5, 0.75f32.sqrt()).normalize();
    scene.sun = Some(Sun { direction, irradiance: Vec3::ONE });
    scene
}
