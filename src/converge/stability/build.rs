//! Scenes in code.

use glam::{Affine3A, Vec2, Vec3};

use crate::scene::{Camera, Color, Environment, Film, Fresnel, Instance, Material, Mesh, Scene, Surface};

pub fn at(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

pub fn material(surface: Surface) -> Material {
    Material::new("material", surface)
}

pub fn lamp(radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), ..material(diffuse(0.0)) }
}

pub fn diffuse(albedo: f32) -> Surface {
    Surface::Diffuse { albedo: Color::constant(Vec3::splat(albedo)) }
}

pub fn conductor(f0: f32, alpha: f32) -> Surface {
    Surface::Conductor { fresnel: Fresnel::Schlick { f0: Color::constant(Vec3::splat(f0)) }, alpha: Vec2::splat(alpha) }
}

pub fn triangles(positions: &[Vec3], triangles: &[[u32; 3]], material: u32) -> Mesh {
    Mesh {
        name: "mesh".into(),
        positions: positions.to_vec(),
        triangles: triangles.to_vec(),
        materials: vec![material],
        ..Mesh::default()
    }
}

/// A quad, counter-clockwise from its front.
pub fn quad(corners: [Vec3; 4], material: u32) -> Mesh {
    triangles(&corners, &[[0, 1, 2], [0, 2, 3]], material)
}

/// A horizontal square at a height, facing up.
pub fn floor(half_side: f32, height: f32, material: u32) -> Mesh {
    let corner = |x: f32, z: f32| at(x * half_side, height, z * half_side);
    quad([corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)], material)
}

/// A horizontal square at a height, facing down.
pub fn ceiling(half_side: f32, height: f32, material: u32) -> Mesh {
    let mut mesh = floor(half_side, height, material);
    mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    mesh
}

/// The inside of an axis-aligned cube, corners shared.
pub fn room(half_side: f32, material: u32) -> Mesh {
    let corner = |i: u32| {
        let side = |bit: u32| if i >> bit & 1 == 1 { half_side } else { -half_side };
        at(side(0), side(1), side(2))
    };
    let corners: Vec<Vec3> = (0..8).map(corner).collect();
    let sides = [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]];
    // Counter-clockwise seen from inside.
    let halves: Vec<[u32; 3]> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *c, *b], [*a, *d, *c]]).collect();
    let mut mesh = triangles(&corners, &halves, material);
    let faces_in = |mesh: &Mesh, triangle: usize| {
        let [a, b, c] = mesh.corners(triangle);
        (b - a).cross(c - a).dot(a) < 0.0
    };
    for triangle in 0..mesh.triangles.len() {
        if !faces_in(&mesh, triangle) {
            mesh.triangles[triangle].swap(1, 2);
        }
    }
    mesh
}

/// A sphere of longitudes and latitudes, corners shared; flat, or with its own normals.
pub fn sphere(center: Vec3, radius: f32, segments: u32, is_smooth: bool, material: u32) -> Mesh {
    let rows = segments / 2;
    let mut mesh = Mesh { name: "sphere".into(), materials: vec![material], ..Mesh::default() };
    for row in 0..=rows {
        for column in 0..segments {
            let theta = std::f32::consts::PI * row as f32 / rows as f32;
            let phi = std::f32::consts::TAU * column as f32 / segments as f32;
            let normal = at(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
            mesh.positions.push(center + radius * normal);
            if is_smooth {
                mesh.normals.push(normal);
            }
        }
    }
    for row in 0..rows {
        for column in 0..segments {
            let next = (column + 1) % segments;
            let [upper, upper_next] = [column, next].map(|column| row * segments + column);
            let [lower, lower_next] = [column, next].map(|column| (row + 1) * segments + column);
            if row > 0 {
                mesh.triangles.push([upper, lower, upper_next]);
            }
            if row + 1 < rows {
                mesh.triangles.push([upper_next, lower, lower_next]);
            }
        }
    }
    mesh
}

/// Meshes where they are, seen from `eye` towards `target`, 24 × 24 pixels.
pub fn scene(meshes: Vec<Mesh>, materials: Vec<Material>, eye: Vec3, target: Vec3) -> Scene {
    let instances =
        (0..meshes.len() as u32).map(|mesh| Instance { mesh, object_to_world: Affine3A::IDENTITY }).collect();
    let up = if (target - eye).normalize().cross(Vec3::Y).length() < 1e-3 { Vec3::Z } else { Vec3::Y };
    Scene {
        camera: Camera { eye, target, up, vertical_fov_degrees: 40.0, lens: None },
        film: Film { width: 24, height: 24 },
        meshes,
        instances,
        materials,
        textures: Vec::new(),
        brdfs: Vec::new(),
        environment: None,
        sun: None,
    }
}

/// The same under a sky of radiance 1.
pub fn furnace(meshes: Vec<Mesh>, materials: Vec<Material>, eye: Vec3, target: Vec3) -> Scene {
    Scene { environment: Some(Environment::constant(Vec3::ONE)), ..scene(meshes, materials, eye, target) }
}

/// A floor, a sphere and a lamp, scaled about the origin.
pub fn still_life(scale: f32) -> Scene {
    let lamp_corners = [at(-0.5, 2.5, -0.5), at(0.5, 2.5, -0.5), at(0.5, 2.5, 0.5), at(-0.5, 2.5, 0.5)];
    let meshes = vec![
        floor(3.0 * scale, 0.0, 0),
        sphere(at(0.0, 0.8, 0.0) * scale, 0.7 * scale, 24, false, 1),
        quad(lamp_corners.map(|corner| corner * scale), 2),
    ];
    let materials = vec![material(diffuse(0.5)), material(conductor(0.8, 0.2)), lamp(10.0)];
    scene(meshes, materials, at(0.0, 1.5, 5.0) * scale, at(0.0, 0.7, 0.0) * scale)
}
