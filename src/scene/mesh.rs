//! Triangle meshes and where they stand.

use glam::{Affine3A, BVec3, Vec2, Vec3};
use rayon::slice::ParallelSliceMut;

/// An indexed triangle mesh. Attributes share one index.
///
/// One without triangles is not seen, and may stand for one that only a device has (`plugin::Renderer`): its positions are then
/// opposite corners of a box around that, and its materials are those of the triangles there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// For messages.
    pub name: String,
    /// Object space, world units, finite.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one a position; empty where the mesh is flat (the geometric normal then serves).
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one a position, v up; empty where there are none.
    pub uvs: Vec<Vec2>,
    /// Corner indices into the above, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`super::Scene::materials`], one a triangle; or just one for the whole mesh.
    pub materials: Vec<u32>,
}

impl Mesh {
    /// The material of a triangle.
    pub fn material(&self, triangle: usize) -> u32 {
        if self.materials.len() == 1 { self.materials[0] } else { self.materials[triangle] }
    }

    /// An object-space box around it.
    pub fn bounds(&self) -> Bounds {
        self.positions.iter().fold(Bounds::EMPTY, |bounds, &position| bounds.including(position))
    }

    /// The corners of a triangle in object space.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|corner| self.positions[corner as usize])
    }

    /// Their texture coordinates; (0, 0) where the mesh has none.
    pub fn corner_uvs(&self, triangle: usize) -> [Vec2; 3] {
        self.triangles[triangle].map(|corner| self.uvs.get(corner as usize).copied().unwrap_or(Vec2::ZERO))
    }
}

/// Largest magnitude of a coordinate: the squared length of a cross product of edges still fits an `f32`.
pub(super) const LARGEST_COORDINATE: f32 = 1e8;

/// How far apart the numbers are that an `f32` can be, at a coordinate of this magnitude.
pub(super) fn spacing(coordinate: f32) -> f32 {
    coordinate.abs().next_up() - coordinate.abs()
}

impl Mesh {
    /// Removes triangles without area, and vertices that only those used. Returns how many triangles went.
    pub(super) fn drop_degenerate(&mut self) -> usize {
        let has_area = |triangle: usize| {
            let [a, b, c] = self.corners(triangle);
            (b - a).cross(c - a).length_squared() >= f32::MIN_POSITIVE
        };
        let kept: Vec<usize> = (0..self.triangles.len()).filter(|&triangle| has_area(triangle)).collect();
        let dropped = self.triangles.len() - kept.len();
        if dropped > 0 {
            if self.materials.len() > 1 {
                self.materials = kept.iter().map(|&triangle| self.materials[triangle]).collect();
            }
            self.triangles = kept.iter().map(|&triangle| self.triangles[triangle]).collect();
            self.drop_unused_vertices();
        }
        dropped
    }

    fn drop_unused_vertices(&mut self) {
        let mut used = vec![false; self.positions.len()];
        self.triangles.iter().flatten().for_each(|&vertex| used[vertex as usize] = true);
        let mut count = 0;
        let mut renumbered = Vec::with_capacity(used.len());
        for &used in &used {
            renumbered.push(count);
            count += u32::from(used);
        }
        self.triangles.iter_mut().flatten().for_each(|vertex| *vertex = renumbered[*vertex as usize]);
        retain(&mut self.positions, &used);
        retain(&mut self.normals, &used);
        retain(&mut self.uvs, &used);
    }

    /// Adds the triangles of another mesh. An attribute that only one of them has is zero on the other.
    /// Precondition: both have one material a triangle.
    pub(super) fn append(&mut self, other: Mesh) {
        let first = self.positions.len() as u32;
        let vertices = self.positions.len() + other.positions.len();
        append_attribute(&mut self.normals, other.normals, first as usize, vertices);
        append_attribute(&mut self.uvs, other.uvs, first as usize, vertices);
        self.positions.extend(other.positions);
        self.triangles.extend(other.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
        self.materials.extend(other.materials);
    }
}

fn retain<T>(items: &mut Vec<T>, keep: &[bool]) {
    let mut index = 0;
    items.retain(|_| {
        index += 1;
        keep[index - 1]
    });
}

fn append_attribute<T: Clone + Default>(items: &mut Vec<T>, others: Vec<T>, first: usize, total: usize) {
    if !items.is_empty() || !others.is_empty() {
        items.resize(first, T::default());
        items.extend(others);
        items.resize(total, T::default());
    }
}

/// The corners of a mesh's triangles, grouped by the point in space that they lie at.
pub(super) struct CornerList {
    /// The point of each vertex, numbered in order of first appearance.
    points: Vec<u32>,
    /// Where the corners of each point begin in `corners`, and the end of the last.
    starts: Vec<u32>,
    /// [triangle, 0..3].
    corners: Vec<[u32; 2]>,
}

impl CornerList {
    pub fn by_position(mesh: &Mesh) -> CornerList {
        // Adding 0 makes −0 and 0 the same point.
        let key = |vertex: u32| (mesh.positions[vertex as usize] + 0.0).to_array().map(f32::to_bits);
        let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        order.par_sort_unstable_by_key(|&vertex| (key(vertex), vertex));
        let mut first: Vec<u32> = vec![0; order.len()];
        for twins in order.chunk_by(|&a, &b| key(a) == key(b)) {
            twins.iter().for_each(|&vertex| first[vertex as usize] = twins[0]);
        }
        let mut points = vec![0; first.len()];
        let mut count = 0;
        for vertex in 0..first.len() {
            if first[vertex] as usize == vertex {
                points[vertex] = count;
                count += 1;
            } else {
                points[vertex] = points[first[vertex] as usize];
            }
        }

        let mut starts = vec![0; count as usize + 1];
        mesh.triangles.iter().flatten().for_each(|&vertex| starts[points[vertex as usize] as usize + 1] += 1);
        for point in 1..starts.len() {
            starts[point] += starts[point - 1];
        }
        let mut next = starts.clone();
        let mut corners = vec![[0; 2]; mesh.triangles.len() * 3];
        for (triangle, vertices) in mesh.triangles.iter().enumerate() {
            for (k, &vertex) in vertices.iter().enumerate() {
                let slot = &mut next[points[vertex as usize] as usize];
                corners[*slot as usize] = [triangle as u32, k as u32];
                *slot += 1;
            }
        }
        CornerList { points, starts, corners }
    }

    /// The point that a vertex lies at.
    pub fn point(&self, vertex: u32) -> u32 {
        self.points[vertex as usize]
    }

    /// The corners at each point.
    pub fn groups(&self) -> impl Iterator<Item = &[[u32; 2]]> {
        self.starts.windows(2).map(|range| &self.corners[range[0] as usize..range[1] as usize])
    }
}

/// A mesh that stands in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`super::Scene::meshes`].
    pub mesh: u32,
    /// Invertible, finite. A mirroring transform keeps the front of a triangle its front: normals are transformed
    /// by the inverse transpose of the object-space normal.
    pub object_to_world: Affine3A,
}

/// An axis-aligned box; empty when `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Bounds {
    /// The box around nothing.
    pub const EMPTY: Bounds = Bounds { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around this one and a point.
    pub fn including(self, point: Vec3) -> Bounds {
        Bounds { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Half the box's diagonal, 0 for an empty box.
    pub fn radius(&self) -> f32 {
        if self.min.cmpgt(self.max).any() { 0.0 } else { (self.max - self.min).length() / 2.0 }
    }

    /// The box's middle.
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) / 2.0
    }

    /// A world-space box around instances of meshes with these boxes: around the corners of each, so that ten thousand
    /// instances of a large mesh cost no more than ten thousand boxes.
    pub fn around(instances: &[Instance], boxes: &[Bounds]) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for instance in instances {
            let Bounds { min, max } = boxes[instance.mesh as usize];
            for corner in 0..8 {
                let upper = BVec3::new(corner & 1 != 0, corner & 2 != 0, corner & 4 != 0);
                bounds = bounds.including(instance.object_to_world.transform_point3(Vec3::select(upper, max, min)));
            }
        }
        bounds
    }
}

pub(super) fn bounds(meshes: &[Mesh], instances: &[Instance]) -> Bounds {
    Bounds::around(instances, &meshes.iter().map(Mesh::bounds).collect::<Vec<_>>())
}

impl super::Scene {
    /// A world-space box around all instances, each taken as its mesh's box.
    pub fn bounds(&self) -> Bounds {
        bounds(&self.meshes, &self.instances)
    }
}
