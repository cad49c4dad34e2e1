//! Triangle meshes and where they stand.

use glam::{Affine3A, Vec2, Vec3};

/// An indexed triangle mesh. Attributes share one index.
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

    /// The corners of a triangle in object space.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|corner| self.positions[corner as usize])
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
}

impl super::Scene {
    /// The world-space box around all instances.
    pub fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for instance in &self.instances {
            for position in &self.meshes[instance.mesh as usize].positions {
                bounds = bounds.including(instance.object_to_world.transform_point3(*position));
            }
        }
        bounds
    }
}
