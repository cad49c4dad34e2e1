//! The ball of NeuBRDF that `passes` and `sphere` render.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use neubrdf::scene::brdf::{CornerWeights, NeuBrdf};
use neubrdf::scene::{Brdf, Camera, Color, Environment, Film, Instance, Material, Mesh, SamplingLobe, Scene, Surface};

use crate::random_neubrdf::{Shape, random_neubrdf};

/// The lobe is picked half of the time.
pub const ALPHA: f32 = 0.2;

/// Of the paper's size, with random weights.
pub fn network() -> NeuBrdf {
    let shape = Shape { corner_weights: CornerWeights::Uniform, ..Shape::FULL };
    let lobe = SamplingLobe { alpha: [[ALPHA; 2]; 2], weight: [[0.5, 0.0]; SamplingLobe::NODES] };
    NeuBrdf { lobe, ..random_neubrdf(shape, 1) }
}

/// A ball on a grey ground under a lamp and a sky, z up, as in benches/mitsuba_scene.py.
pub fn scene(brdf: NeuBrdf) -> Scene {
    let material = |name: &str, surface, emission| Material { emission, ..Material::new(name, surface) };
    let grey = || Surface::Diffuse { albedo: Color::constant(Vec3::splat(0.5)) };
    let square = |center: Vec3, x: Vec3, y: Vec3, material| Mesh {
        positions: vec![center - x - y, center + x - y, center + x + y, center - x + y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material],
        ..Mesh::default()
    };
    let lamp = square(Vec3::new(1.5, -1.0, 4.0), Vec3::X * 0.7, Vec3::NEG_Y * 0.7, 2);
    let meshes = vec![ball(Vec3::Z), square(Vec3::ZERO, Vec3::X * 20.0, Vec3::Y * 20.0, 1), lamp];
    let instances = (0..meshes.len() as u32).map(|mesh| Instance { mesh, object_to_world: Affine3A::IDENTITY });
    Scene {
        camera: Camera {
            eye: Vec3::new(0.0, -4.0, 1.6),
            target: Vec3::new(0.0, 0.0, 0.8),
            up: Vec3::Z,
            vertical_fov_degrees: 40.0,
            lens: None,
        },
        film: Film { width: 256, height: 256 },
        instances: instances.collect(),
        meshes,
        materials: vec![
            material("ball", Surface::Measured { brdf: 0 }, Vec3::ZERO),
            material("ground", grey(), Vec3::ZERO),
            material("lamp", grey(), Vec3::splat(12.0)),
        ],
        brdfs: vec![Arc::new(Brdf::NeuBrdf(Box::new(brdf)))],
        textures: Vec::new(),
        environment: Some(Environment::constant(Vec3::splat(0.5))),
        sun: None,
    }
}

/// A sphere of radius 1, with normals and, for the tangents, texture coordinates.
fn ball(center: Vec3) -> Mesh {
    use std::f32::consts::{PI, TAU};
    const ROWS: u32 = 64;
    const SEGMENTS: u32 = 128;
    let mut mesh = Mesh { name: "ball".into(), materials: vec![0], ..Mesh::default() };
    for row in 0..=ROWS {
        for segment in 0..=SEGMENTS {
            let (u, v) = (segment as f32 / SEGMENTS as f32, row as f32 / ROWS as f32);
            let (sine, cosine) = (PI * v).sin_cos();
            let normal = Vec3::new(sine * (TAU * u).cos(), sine * (TAU * u).sin(), cosine);
            mesh.positions.push(center + normal);
            mesh.normals.push(normal);
            mesh.uvs.push(glam::Vec2::new(u, v));
        }
    }
    let at = |row, segment| row * (SEGMENTS + 1) + segment;
    for row in 0..ROWS {
        for segment in 0..SEGMENTS {
            let [a, b] = [at(row, segment), at(row, segment + 1)];
            let [c, d] = [at(row + 1, segment), at(row + 1, segment + 1)];
            mesh.triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    mesh
}
