//! Hard geometry.

use glam::{Affine3A, Vec3};

use super::build::*;
use super::{Case, Expected, Trial};
use crate::scene::{Material, Scene};

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            name: "degenerate triangles",
            why: "triangles without area have no normal, slivers lose theirs to cancellation",
            is_known_limit: false,
            trial: Trial::new(degenerate()),
        },
        Case {
            name: "shared edges head-on",
            why: "a ray through an edge or a corner of a closed surface must not slip between its triangles: the box shines, what is beyond is black",
            is_known_limit: false,
            trial: Trial::new(shining_box(at(0.0, 0.0, 0.0), at(0.0, 0.0, -1.0)))
                .depth(1)
                .samples(256)
                .expecting(Expected::Radiance(1.0, 0.0)),
        },
        Case {
            name: "into a corner",
            why: "three faces meet where every ray is aimed",
            is_known_limit: false,
            trial: Trial::new(Scene {
                camera: crate::scene::Camera {
                    vertical_fov_degrees: 0.02,
                    ..shining_box(at(0.0, 0.0, 0.0), Vec3::ONE).camera
                },
                ..shining_box(at(0.0, 0.0, 0.0), Vec3::ONE)
            })
            .depth(1)
            .samples(256)
            .expecting(Expected::Radiance(1.0, 0.0)),
        },
        Case {
            name: "inside a fine sphere",
            why: "thousands of shared edges and two fans of triangles at the poles; a leak would be black",
            is_known_limit: false,
            trial: Trial::new(Scene {
                camera: crate::scene::Camera { vertical_fov_degrees: 150.0, ..shining_sphere().camera },
                ..shining_sphere()
            })
            .depth(1)
            .samples(256)
            .expecting(Expected::Radiance(1.0, 0.0)),
        },
        Case {
            name: "rays along an axis",
            why: "direction components of 0 divide by 0 in slab tests",
            is_known_limit: false,
            trial: Trial::new(axis_aligned()),
        },
        Case {
            name: "coincident surfaces",
            why: "two floors in one plane shadow each other if rays leave by too little; white under a white sky, every pixel is 1",
            is_known_limit: false,
            trial: Trial::new(furnace(
                vec![floor(2.0, 0.0, 0), floor(2.0, 0.0, 0)],
                vec![material(diffuse(1.0))],
                at(0.0, 3.0, 3.0),
                Vec3::ZERO,
            ))
            .without_light_sampling()
            .expecting(Expected::Radiance(1.0, 1e-5)),
        },
        Case {
            name: "a scene of 10⁻⁴",
            why: "an absolute epsilon would swallow it",
            is_known_limit: false,
            trial: Trial::new(still_life(1e-4)),
        },
        Case {
            name: "a scene of 10⁵",
            why: "an absolute epsilon would be nothing",
            is_known_limit: false,
            trial: Trial::new(still_life(1e5)),
        },
        Case {
            name: "a scene of 10⁷",
            why: "ten kilometres in millimetres: the squared area of its lamp times a squared distance is no f32",
            is_known_limit: false,
            trial: Trial::new(still_life(1e7)),
        },
        Case {
            name: "10⁴ from the origin",
            why: "positions are to 10⁻³ only, a thousandth of the scene",
            is_known_limit: false,
            trial: Trial::new(moved(still_life(1.0), at(1e4, -1e4, 1e4))),
        },
        Case {
            name: "a lamp 10⁶ from the origin",
            why: "a shadow ray must end short of its lamp by the error of the lamp's place, and still point at the lamp",
            is_known_limit: false,
            trial: Trial::new(moved(floor_and_lamp(), at(1e6, 0.0, 0.0))).depth(2).samples(512),
        },
        Case {
            name: "10⁶ from the origin",
            why: "positions are to 1/16 only, so that the sphere is a heap of steps: both renderers must see the same heap",
            is_known_limit: false,
            trial: Trial::new(moved(still_life(10.0), at(1e6, 0.0, 0.0))),
        },
        Case {
            name: "grazing a coarse sphere",
            why: "rays that leave nearly along a facet hit it again if they start below it; convex and white under a white sky, every pixel is 1",
            is_known_limit: false,
            trial: Trial::new(furnace(
                vec![sphere(Vec3::ZERO, 1.0, 8, false, 0)],
                vec![material(diffuse(1.0))],
                at(0.0, 0.3, 3.0),
                Vec3::ZERO,
            ))
            .without_light_sampling()
            .expecting(Expected::Radiance(1.0, 1e-5)),
        },
        Case {
            name: "10⁻⁶ within 10³",
            why: "a sphere of 10⁻⁶ on a floor of 10⁻⁵ in a room of 10³: nine decades in one tree",
            is_known_limit: false,
            trial: Trial::new(nine_decades(1e-5)),
        },
        Case {
            name: "10⁻⁶ on 10³",
            why: "the same sphere on a floor of 10³, whose corners are known to 10⁻⁴ only",
            is_known_limit: true,
            trial: Trial::new(nine_decades(1e3)),
        },
    ]
}

pub fn degenerate() -> Scene {
    let mut scene = still_life(1.0);
    let positions = [
        at(-1.0, 0.5, 1.0),
        at(1.0, 0.5, 1.0),
        at(-1.0, 0.5, 1.0),
        at(0.0, 0.5, 1.0),
        at(0.0, 0.500_001, 1.0),
        at(0.3, 0.3, 1.2),
    ];
    // A point, a segment, a corner that comes twice, slivers of 10⁻⁶.
    let corners = [[0, 0, 0], [0, 1, 3], [0, 2, 1], [0, 1, 4], [0, 4, 1], [5, 5, 1]];
    scene.meshes[0] = {
        let mut floor = scene.meshes[0].clone();
        let first = floor.positions.len() as u32;
        floor.positions.extend(positions);
        floor.triangles.extend(corners.map(|corners| corners.map(|corner| corner + first)));
        floor
    };
    scene
}

fn shining_box(eye: Vec3, target: Vec3) -> Scene {
    scene(vec![room(1.0, 0)], vec![lamp(1.0)], eye, target)
}

fn shining_sphere() -> Scene {
    let mut mesh = sphere(Vec3::ZERO, 1.0, 64, false, 0);
    mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    scene(vec![mesh], vec![lamp(1.0)], Vec3::ZERO, Vec3::Y)
}

fn axis_aligned() -> Scene {
    // Mirrors send every ray of an axis-aligned view back along an axis.
    let mut scene = scene(
        vec![
            room(1.0, 0),
            quad([at(-0.5, 0.5, -0.9), at(-0.5, -0.5, -0.9), at(0.5, -0.5, -0.9), at(0.5, 0.5, -0.9)], 1),
            ceiling(0.5, 0.99, 2),
        ],
        vec![material(diffuse(0.6)), material(conductor(0.9, 0.0)), lamp(5.0)],
        at(0.0, 0.0, 0.9),
        Vec3::ZERO,
    );
    scene.camera.vertical_fov_degrees = 0.011;
    scene
}

fn floor_and_lamp() -> Scene {
    scene(
        vec![floor(30.0, 0.0, 0), ceiling(5.0, 25.0, 1)],
        vec![material(diffuse(0.5)), lamp(10.0)],
        at(0.0, 15.0, 50.0),
        at(0.0, 7.0, 0.0),
    )
}

pub fn moved(mut scene: Scene, by: Vec3) -> Scene {
    scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|position| *position += by);
    scene.camera.eye += by;
    scene.camera.target += by;
    scene
}

fn nine_decades(floor_half_side: f32) -> Scene {
    let radius = 1e-6;
    let mut scene = scene(
        vec![floor(floor_half_side, 0.0, 0), sphere(Vec3::ZERO, 1.0, 16, false, 1), room(1e3, 2)],
        vec![
            material(diffuse(0.5)),
            material(diffuse(0.8)),
            Material { emission: Vec3::ONE, ..material(diffuse(0.2)) },
        ],
        at(0.0, 2.0 * radius, 6.0 * radius),
        at(0.0, radius, 0.0),
    );
    // Its own size by an instance, as a scene file would do it.
    scene.instances[1].object_to_world =
        Affine3A::from_scale_rotation_translation(Vec3::splat(radius), glam::Quat::IDENTITY, at(0.0, radius, 0.0));
    scene
}
