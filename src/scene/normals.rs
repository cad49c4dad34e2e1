//! Shading normals for meshes that bring none.

use glam::Vec3;

use super::Mesh;
use super::mesh::CornerList;

/// The cross product of two edges of each triangle is its normal, times twice its area.
fn cross(mesh: &Mesh, triangle: u32) -> Vec3 {
    let [a, b, c] = mesh.corners(triangle as usize);
    (b - a).cross(c - a)
}

/// Gives a mesh smooth normals, whatever it had, and splits its vertices where the surface has a crease.
///
/// Triangles around a point belong together as far as one gets from one to the next over shared edges whose normals
/// differ by no more than `crease_degrees`; the normal there is the mean of theirs, weighted by the angle of their
/// corners (Thürmer & Wüthrich 1998). Vertices at the same position count as one point.
/// Precondition: no triangle is degenerate.
pub(super) fn smooth(mesh: &mut Mesh, crease_degrees: f32) {
    let least_cosine = crease_degrees.to_radians().cos();
    let points = CornerList::by_position(mesh);
    let mut out = Mesh { name: std::mem::take(&mut mesh.name), ..Mesh::default() };
    out.triangles = vec![[0; 3]; mesh.triangles.len()];

    // Of the corners around one point: (point at the other end of an edge, corner), the group of each, their order.
    let mut edges: Vec<(u32, u32)> = Vec::new();
    let mut group: Vec<u32> = Vec::new();
    let mut order: Vec<u32> = Vec::new();
    for corners in points.groups() {
        edges.clear();
        group.clear();
        group.extend(0..corners.len() as u32);
        for (i, &[triangle, k]) in corners.iter().enumerate() {
            for other in [1, 2] {
                let neighbour = mesh.triangles[triangle as usize][(k as usize + other) % 3];
                edges.push((points.point(neighbour), i as u32));
            }
        }
        edges.sort_unstable();
        for pair in edges.windows(2) {
            let [(end, a), (other_end, b)] = [pair[0], pair[1]];
            if end == other_end {
                let [m, n] = [a, b].map(|i| cross(mesh, corners[i as usize][0]));
                if m.normalize_or_zero().dot(n.normalize_or_zero()) >= least_cosine {
                    let [a, b] = [find(&mut group, a), find(&mut group, b)];
                    group[a.max(b) as usize] = a.min(b);
                }
            }
        }

        order.clear();
        order.extend(0..corners.len() as u32);
        let vertex = |i: u32| {
            let [triangle, k] = corners[i as usize];
            mesh.triangles[triangle as usize][k as usize]
        };
        for i in 0..group.len() as u32 {
            group[i as usize] = find(&mut group, i);
        }
        order.sort_unstable_by_key(|&i| (group[i as usize], vertex(i), i));
        for members in order.chunk_by(|&a, &b| group[a as usize] == group[b as usize]) {
            let mut sum = Vec3::ZERO;
            for &i in members {
                let [triangle, k] = corners[i as usize];
                let [a, b, c] = [0, 1, 2]
                    .map(|step| mesh.positions[mesh.triangles[triangle as usize][(k as usize + step) % 3] as usize]);
                sum += cross(mesh, triangle).normalize_or_zero() * (b - a).angle_between(c - a);
            }
            // A sum that cancels (a double-sided sheet) leaves no better choice than the first triangle's own normal.
            let own = cross(mesh, corners[members[0] as usize][0]).normalize_or_zero();
            let normal = sum.try_normalize().unwrap_or(own);
            for twins in members.chunk_by(|&a, &b| vertex(a) == vertex(b)) {
                let old = vertex(twins[0]) as usize;
                let new = out.positions.len() as u32;
                out.positions.push(mesh.positions[old]);
                out.normals.push(normal);
                if let Some(&uv) = mesh.uvs.get(old) {
                    out.uvs.push(uv);
                }
                for &i in twins {
                    let [triangle, k] = corners[i as usize];
                    out.triangles[triangle as usize][k as usize] = new;
                }
            }
        }
    }
    out.materials = std::mem::take(&mut mesh.materials);
    *mesh = out;
}

/// The root of an element of a union-find forest, halving paths on the way.
fn find(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

/// Whether every shading normal is its triangle's own, so that the mesh needs none.
pub(super) fn are_flat(mesh: &Mesh) -> bool {
    (0..mesh.triangles.len()).all(|triangle| {
        let own = cross(mesh, triangle as u32).normalize_or_zero();
        mesh.triangles[triangle].iter().all(|&vertex| mesh.normals[vertex as usize].dot(own) > 1.0 - 1e-6)
    })
}

/// Makes given normals unit vectors; one without a direction gives way to the normal of a triangle that uses it.
/// Precondition: there is one normal a position.
pub(super) fn normalize(mesh: &mut Mesh) {
    for normal in &mut mesh.normals {
        *normal = normal.as_dvec3().normalize_or_zero().as_vec3();
    }
    for triangle in 0..mesh.triangles.len() {
        for vertex in mesh.triangles[triangle] {
            if mesh.normals[vertex as usize] == Vec3::ZERO {
                mesh.normals[vertex as usize] = cross(mesh, triangle as u32).normalize_or_zero();
            }
        }
    }
}
