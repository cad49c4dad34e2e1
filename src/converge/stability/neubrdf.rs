//! Hard neural materials: networks made by hand, so that what they should do is known.

use std::sync::Arc;

use glam::{DVec3, Quat, Vec2, Vec3};

use super::build::*;
use super::{Case, Expected, Trial};
use crate::scene::brdf::{
    Codebook, CornerWeights, Dense, Encoding, NeuBrdf, Precision, Provenance, SamplingLobe, SphereGrid, SphereTable,
};
use crate::scene::{Brdf, Environment, Instance, Mesh, Scene, Sun, Surface};

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            name: "NeuBRDF at poles, equator and borders",
            why: "directions on the lattice of the sphere grid itself, where rounding says which pixel they fall in",
            is_known_limit: false,
            trial: Trial::new(special_directions()).depth(2).samples(64),
        },
        Case {
            name: "NeuBRDF with a peak of 10⁴",
            why: "outputs of the network are exponents: an error of 10⁻³ in one is one of a percent in the peak",
            is_known_limit: false,
            trial: {
                let mut trial = Trial::new(with_neubrdf(still_life(1.0), mirror(1e4))).depth(2);
                trial.scene.environment = Some(Environment::constant(Vec3::splat(0.3)));
                trial
            },
        },
        Case {
            name: "a black NeuBRDF",
            why: "neither lobes nor lights find anything to do: 0 over no more than 0",
            is_known_limit: false,
            trial: Trial::new(white_room(constant(0.0)))
                .samples(8)
                .without_light_sampling()
                .expecting(Expected::Radiance(0.0, 0.0)),
        },
        Case {
            name: "a constant NeuBRDF",
            why: "albedo 0.8 under a white sky is 0.8 to what the network's exponential leaves of f32",
            is_known_limit: false,
            trial: Trial::new(white_room(constant(0.8)))
                .samples(8)
                .without_light_sampling()
                .expecting(Expected::Radiance(0.8, 1e-5)),
        },
        Case {
            name: "f16 overflow",
            why: "biases of −10⁷, which half precision does not hold: what they switch off stays off",
            is_known_limit: false,
            trial: {
                let mut trial = Trial::new(white_room(switched_off(0.8)))
                    .samples(8)
                    .without_light_sampling()
                    .expecting(Expected::Radiance(0.8, 1e-2));
                trial.settings.neubrdf_precision = Some(Precision::F16);
                trial
            },
        },
    ]
}

/// The scene with that material instead of its second.
fn with_neubrdf(scene: Scene, model: NeuBrdf) -> Scene {
    let mut scene = Scene { brdfs: vec![Arc::new(Brdf::NeuBrdf(Box::new(model)))], ..scene };
    scene.materials[1] = material(Surface::Measured { brdf: 0 });
    scene
}

/// A floor of it fills the picture, under a white sky; light is found by the material's samples alone.
fn white_room(model: NeuBrdf) -> Scene {
    let materials = vec![material(diffuse(1.0)); 2];
    with_neubrdf(furnace(vec![floor(2.0, 0.0, 1)], materials, at(0.0, 2.0, 0.5), Vec3::ZERO), model)
}

/// Squares under a sun, each turned so that in its own frame the sun stands in a special direction.
fn special_directions() -> Scene {
    let third = 2.0 / 3.0;
    let on_ring = |z: f32, degrees: f32| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let radius = (1.0 - z * z).sqrt();
        at(radius * cosine, radius * sine, z)
    };
    let targets = [
        Vec3::Z,
        on_ring(1e-6, 45.0),
        on_ring(1e-4, 0.0),
        on_ring(third, 0.0),
        on_ring(third, 45.0),
        on_ring(third, 90.0),
        on_ring(third, 180.0),
        on_ring(0.9, -180.0),
        on_ring(0.9, 90.0),
    ];
    let sun = at(0.3, 1.0, 0.4).normalize();
    let eye = at(0.0, 6.0, 8.0);
    let meshes = targets.iter().enumerate().map(|(index, target)| {
        let center = at((index % 3) as f32 - 1.0, 0.0, (index / 3) as f32 - 1.0) * 1.6;
        let towards_sun = Quat::from_rotation_arc(*target, sun);
        // Of all squares that have the sun there, the one that faces the camera most.
        let turned = |step: u32| Quat::from_axis_angle(sun, step as f32 * 0.1) * towards_sun;
        let faces = |rotation: &Quat| (*rotation * Vec3::Z).dot((eye - center).normalize());
        let rotation = (0..63).map(turned).max_by(|a, b| faces(a).total_cmp(&faces(b))).unwrap_or(towards_sun);
        framed_square(center, rotation)
    });
    let meshes: Vec<Mesh> = meshes.collect();
    let instances =
        (0..meshes.len() as u32).map(|mesh| Instance { mesh, object_to_world: glam::Affine3A::IDENTITY }).collect();
    let materials = vec![material(diffuse(1.0)); 2];
    let mut scene = Scene { instances, ..scene(meshes, materials, eye, Vec3::ZERO) };
    scene.camera.vertical_fov_degrees = 32.0;
    scene.sun = Some(Sun { direction: sun, irradiance: Vec3::splat(3.0) });
    scene.environment = Some(Environment::constant(Vec3::splat(0.1)));
    with_neubrdf(scene, mirror(3.0))
}

/// A square whose tangent, bitangent and normal are the turned axes.
fn framed_square(center: Vec3, rotation: Quat) -> Mesh {
    let [x, y] = [rotation * Vec3::X, rotation * Vec3::Y].map(|axis| axis * 0.7);
    let mut mesh = quad([center - x - y, center + x - y, center + x + y, center - x + y], 1);
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    mesh
}

const GAIN: f32 = 100.0;
const SCALE: f32 = 2.0;

/// What the network must say for a value of the BRDF.
fn encoded(value: f32) -> f32 {
    (GAIN * value).ln_1p() / SCALE
}

/// The same value for all directions.
fn constant(albedo: f32) -> NeuBrdf {
    let value = encoded(albedo / std::f32::consts::PI);
    model(
        vec![
            Dense { inputs: 4, outputs: 4, weights: vec![0.0; 16], bias: vec![0.0; 4] },
            Dense { inputs: 4, outputs: 3, weights: vec![0.0; 12], bias: vec![value; 3] },
        ],
        SamplingLobe::COSINE,
    )
}

/// [`constant`], beside neurons that biases of −10⁷ hold below zero.
fn switched_off(albedo: f32) -> NeuBrdf {
    let mut model = constant(albedo);
    model.layers[0].weights = vec![1e4; 16];
    model.layers[0].bias = vec![-1e7; 4];
    model.layers[1].weights = vec![1.0; 12];
    model
}

/// A peak about the mirror's direction that falls off exponentially: with d = |ωi.x + ωo.x| + |ωi.y + ωo.y|,
/// f = peak · exp(−r d), cut off where it meets 1 / gain. ∫ f cos θi dωi = 4 peak / r², here 0.9.
fn mirror(peak: f32) -> NeuBrdf {
    let height = encoded(peak);
    let fall_off = (4.0 * peak / 0.9).sqrt() / (SCALE * height);
    let difference = Dense {
        inputs: 4,
        outputs: 4,
        // Of ωi.x, ωi.y, ωo.x, ωo.y.
        weights: [[1.0, 0.0, 1.0, 0.0], [-1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 1.0], [0.0, -1.0, 0.0, -1.0]].concat(),
        bias: vec![0.0; 4],
    };
    let part = Dense { inputs: 4, outputs: 1, weights: vec![-fall_off; 4], bias: vec![1.0] };
    let color = Dense { inputs: 1, outputs: 3, weights: vec![height; 3], bias: vec![0.0; 3] };
    let alpha = (0.5 / (fall_off * SCALE * height)).clamp(SamplingLobe::LEAST_ALPHA, 1.0);
    let lobe =
        SamplingLobe { alpha: [[alpha; 2], [(4.0 * alpha).min(1.0); 2]], weight: [[0.5, 0.4]; SamplingLobe::NODES] };
    model(vec![difference, part, color], lobe)
}

/// A network over x and y of each direction, exact at the grid's points.
fn model(layers: Vec<Dense>, lobe: SamplingLobe) -> NeuBrdf {
    let grid = SphereGrid::new(16).expect("a power of two");
    let table = || {
        let coordinates = |point: usize| -> [f32; 2] {
            let DVec3 { x, y, .. } = grid.point(point);
            [x as f32, y as f32]
        };
        SphereTable {
            grid,
            codebook: Arc::new(Codebook {
                features: 2,
                codes: (0..grid.point_count()).flat_map(coordinates).collect(),
            }),
            indices: (0..grid.point_count() as u16).collect(),
            levels: Vec::new(),
        }
    };
    NeuBrdf {
        is_isotropic: false,
        corner_weights: CornerWeights::Bilinear,
        wi: table(),
        wo: table(),
        coarser: Vec::new(),
        surface: None,
        sees_half_vector: false,
        layers,
        encoding: Encoding { gain: GAIN, scale: SCALE, max: 1e5 },
        lobe,
        provenance: Provenance::default(),
    }
}
