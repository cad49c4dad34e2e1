//! A scene's meshes and instances in device memory, with what a traversal needs to find them.

use std::sync::Arc;

use bytemuck::Zeroable;
use glam::{Affine3A, DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::bvh::{Bvh, BvhNode, LeafTriangle, MAX_PRIMITIVES};
use super::error::Error;
use super::settings::Traversal;
use crate::gpu::{Blas, BlasGeometry, Buffer, Device, Tlas, TlasInstance};
use crate::scene::{Bounds, Mesh, Scene};

crate::shared_structs! {
    /// The structs of `glsl/layout/geometry.glsl` that are made here.
    pub const GEOMETRY_STRUCTS;

    /// A mesh: pointers, null where it has no such thing.
    pub struct MeshRecord {
        /// Corners, object space.
        pub positions: u64,
        /// Shading normals.
        pub normals: u64,
        /// Texture coordinates.
        pub uvs: u64,
        /// Corner indices of the triangles.
        pub indices: u64,
        /// Materials, one a triangle.
        pub materials: u64,
        /// The tree over its triangles.
        pub nodes: u64,
        /// The triangles as the tree's leaves index them.
        pub leaf_triangles: u64,
        /// The material of all triangles, where `materials` is null.
        pub material: u32,
        /// Nothing.
        pub padding: u32,
    }

    /// A mesh that stands in the world. Matrices are column by column.
    pub struct InstanceRecord {
        /// Object to world.
        pub object_to_world: [f32; 12],
        /// World to object.
        pub world_to_object: [f32; 12],
        /// Index of the mesh.
        pub mesh: u32,
    }
}

/// The uploaded geometry.
pub struct Geometry {
    instances: Buffer,
    /// Addresses of the mesh records.
    meshes: Buffer,
    /// The tree over instances.
    nodes: Option<Buffer>,
    tlas: Option<Tlas>,
    /// Entries that a walk's stack needs at most.
    stack: u32,
    is_cpu: bool,
    subgroup_size: u32,
    // Held for the mesh records' pointers.
    buffers: Vec<Buffer>,
}

impl Geometry {
    /// Uploads what the scene has, and what the traversal needs: trees of our own, or acceleration structures.
    ///
    /// # Errors
    /// [`Traversal::RayQuery`] on a device without it, a mesh with too many triangles, out of memory.
    pub fn upload(device: &Arc<Device>, scene: &Scene, traversal: Traversal) -> Result<Geometry, Error> {
        let mut uploader = Uploader { device, buffers: Vec::new() };
        let mut records = Vec::with_capacity(scene.meshes.len());
        for mesh in &scene.meshes {
            records.push(uploader.mesh(mesh)?);
        }
        let mut stack = 0;
        let mut nodes = None;
        let mut tlas = None;
        match traversal {
            Traversal::Bvh => {
                let trees: Vec<Bvh> = scene.meshes.par_iter().map(build).collect::<Result<_, _>>()?;
                for ((mesh, record), tree) in scene.meshes.iter().zip(&mut records).zip(&trees) {
                    stack = stack.max(tree.stack);
                    record.nodes = uploader.upload(&mesh.name, &tree.nodes)?;
                    let mut triangles = tree.leaf_triangles(mesh);
                    // A packet's lanes read whole words of the last triangle, and beyond it.
                    triangles.extend([LeafTriangle::zeroed(); 4]);
                    record.leaf_triangles = uploader.upload::<LeafTriangle>(&mesh.name, &triangles)?;
                }
                let top = over_instances(scene, &trees);
                stack = stack.max(top.stack);
                nodes = Some(Buffer::with_data::<BvhNode>(device, "tree over instances", &top.nodes)?);
            }
            Traversal::RayQuery => {
                tlas = Some(acceleration_structure(device, scene, &records)?);
            }
        }
        let instances: Vec<_> = scene
            .instances
            .iter()
            .map(|instance| InstanceRecord {
                object_to_world: instance.object_to_world.to_cols_array(),
                world_to_object: inverse(&instance.object_to_world),
                mesh: instance.mesh,
            })
            .collect();
        let first = uploader.upload("mesh records", &records)?;
        let meshes: Vec<u64> =
            (0..records.len()).map(|index| first + (index * size_of::<MeshRecord>()) as u64).collect();
        Ok(Geometry {
            instances: Buffer::with_data(device, "instances", &instances)?,
            meshes: Buffer::with_data(device, "meshes", &meshes)?,
            nodes,
            tlas,
            stack,
            is_cpu: device.profile().is_cpu,
            subgroup_size: device.limits().subgroup_size,
            buffers: uploader.buffers,
        })
    }

    /// Where the kernels find the instances.
    pub fn instances_address(&self) -> u64 {
        self.instances.address()
    }

    /// Where the kernels find the meshes.
    pub fn meshes_address(&self) -> u64 {
        self.meshes.address()
    }

    /// Where the kernels find the tree over instances; 0 for ray query.
    pub fn nodes_address(&self) -> u64 {
        self.nodes.as_ref().map_or(0, Buffer::address)
    }

    /// The top-level acceleration structure, for ray query.
    pub fn tlas(&self) -> Option<&Tlas> {
        self.tlas.as_ref()
    }

    /// What a kernel that includes `lib/trace_bvh.glsl` is to be specialized with, as (id, value): whether subgroups walk as
    /// packets, of how many lanes, and how deep the stack is. They do so on CPU drivers, but
    /// not where lavapipe has 16 lanes, whose shuffles are loops.
    pub fn specialization(&self) -> [(u32, u32); 3] {
        if self.is_cpu && [4, 8].contains(&self.subgroup_size) {
            [(10, 1), (11, self.subgroup_size), (12, self.stack.div_ceil(self.subgroup_size))]
        } else {
            self.specialization_alone()
        }
    }

    /// The same for invocations that walk on their own, on whatever device.
    pub fn specialization_alone(&self) -> [(u32, u32); 3] {
        [(10, 0), (11, 32), (12, self.stack)]
    }

    /// Bytes of device memory, acceleration structures of the driver's excepted.
    pub fn bytes(&self) -> u64 {
        let nodes = self.nodes.as_ref().map_or(0, Buffer::size);
        self.instances.size() + self.meshes.size() + nodes + self.buffers.iter().map(Buffer::size).sum::<u64>()
    }
}

struct Uploader<'a> {
    device: &'a Arc<Device>,
    buffers: Vec<Buffer>,
}

impl Uploader<'_> {
    /// The address of a copy of the data; null for none.
    fn upload<T: bytemuck::Pod>(&mut self, name: &str, data: &[T]) -> Result<u64, Error> {
        if data.is_empty() {
            return Ok(0);
        }
        let buffer = Buffer::with_data(self.device, name, data)?;
        let address = buffer.address();
        self.buffers.push(buffer);
        Ok(address)
    }

    fn mesh(&mut self, mesh: &Mesh) -> Result<MeshRecord, Error> {
        let materials = if mesh.materials.len() == 1 { &[] } else { mesh.materials.as_slice() };
        Ok(MeshRecord {
            positions: self.upload(&mesh.name, &mesh.positions)?,
            normals: self.upload(&mesh.name, &mesh.normals)?,
            uvs: self.upload(&mesh.name, &mesh.uvs)?,
            indices: self.upload(&mesh.name, &mesh.triangles)?,
            materials: self.upload(&mesh.name, materials)?,
            nodes: 0,
            leaf_triangles: 0,
            material: mesh.materials.first().copied().unwrap_or(0),
            padding: 0,
        })
    }
}

fn build(mesh: &Mesh) -> Result<Bvh, Error> {
    if mesh.triangles.len() > MAX_PRIMITIVES {
        return Err(Error::MeshSize { mesh: mesh.name.clone(), triangles: mesh.triangles.len(), most: MAX_PRIMITIVES });
    }
    Ok(Bvh::over_triangles(mesh))
}

/// A tree over the instances' boxes in the world. Its leaves hold an instance's index each.
fn over_instances(scene: &Scene, trees: &[Bvh]) -> Bvh {
    let boxes: Vec<Bounds> = scene
        .instances
        .iter()
        .map(|instance| world_box(&trees[instance.mesh as usize].bounds, &instance.object_to_world))
        .collect();
    Bvh::over_single_boxes(&boxes)
}

/// The box in the world around a box that is moved, with room for the rounding of rays that go the other way.
fn world_box(bounds: &Bounds, to_world: &Affine3A) -> Bounds {
    if bounds.min.cmpgt(bounds.max).any() {
        return Bounds::EMPTY.including(to_world.translation.into());
    }
    let mut moved = Bounds::EMPTY;
    for corner in 0..8 {
        let pick = |axis: usize| f64::from(if corner >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] });
        let corner = wide(to_world).transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
        moved = moved.including(corner.as_vec3());
    }
    let slack = 16.0 * f32::EPSILON * (moved.min.abs().max(moved.max.abs()).max_element() + moved.radius());
    Bounds { min: moved.min - slack, max: moved.max + slack }
}

fn wide(transform: &Affine3A) -> DAffine3 {
    let matrix: DMat3 = transform.matrix3.as_dmat3();
    DAffine3 { matrix3: matrix, translation: transform.translation.as_dvec3() }
}

fn inverse(transform: &Affine3A) -> [f32; 12] {
    wide(transform).inverse().to_cols_array().map(|number| number as f32)
}

fn acceleration_structure(device: &Arc<Device>, scene: &Scene, records: &[MeshRecord]) -> Result<Tlas, Error> {
    let mut meshes = Vec::with_capacity(records.len());
    for (mesh, record) in scene.meshes.iter().zip(records) {
        let geometry = BlasGeometry {
            positions: record.positions,
            vertex_count: mesh.positions.len() as u32,
            indices: record.indices,
            triangle_count: mesh.triangles.len() as u32,
        };
        meshes.push(Blas::build(device, &[geometry])?);
    }
    let instances: Vec<_> = (0..)
        .zip(&scene.instances)
        .map(|(index, instance)| {
            let columns = instance.object_to_world.to_cols_array();
            TlasInstance {
                blas: meshes[instance.mesh as usize].clone(),
                transform: std::array::from_fn(|i| columns[i % 4 * 3 + i / 4]),
                custom_index: index,
                mask: 0xff,
            }
        })
        .collect();
    Ok(Tlas::build(device, &instances)?)
}
