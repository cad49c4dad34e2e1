//! A scene's meshes and instances in device memory, with what a traversal needs to find them.

use std::sync::Arc;

use bytemuck::Zeroable;
use glam::{Affine3A, DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::bvh::{Bvh, BvhNode, LeafTriangle, MAX_PRIMITIVES, MAX_STACK};
use super::error::Error;
use super::settings::Traversal;
use crate::gpu::{Blas, BlasGeometry, Buffer, Device, Tlas, TlasInstance, Upload};
use crate::scene::{Bounds, Instance, Mesh, Scene};

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
    /// Addresses of the mesh records.
    meshes: Arc<Buffer>,
    placement: Placement,
    /// Around each mesh, for the tree over instances; empty for ray query.
    bounds: Vec<Bounds>,
    /// Each mesh, for ray query.
    structures: Vec<Arc<Blas>>,
    /// Entries that a walk's stack needs at most.
    stack: u32,
    is_cpu: bool,
    subgroup_size: u32,
    // Held for the mesh records' pointers.
    buffers: Vec<Arc<Buffer>>,
}

/// Where the meshes stand: what is made anew when one moves.
#[derive(Clone)]
pub struct Placement {
    instances: Arc<Buffer>,
    /// The tree over instances.
    nodes: Option<Arc<Buffer>>,
    tlas: Option<Arc<Tlas>>,
}

impl Geometry {
    /// Uploads what the scene has, and what the traversal needs: trees of our own, or acceleration structures.
    ///
    /// # Errors
    /// [`Traversal::RayQuery`] on a device without it, a mesh with too many triangles, out of memory.
    pub fn upload(device: &Arc<Device>, scene: &Scene, traversal: Traversal) -> Result<Geometry, Error> {
        Geometry::new(&mut Upload::now(device), scene, traversal)
    }

    /// The same by way of `upload`. One that comes later leaves room for the instances to move.
    ///
    /// # Errors
    /// As of [`Geometry::upload`].
    pub fn new(upload: &mut Upload, scene: &Scene, traversal: Traversal) -> Result<Geometry, Error> {
        let device = upload.device().clone();
        let mut uploader = Uploader { upload, buffers: Vec::new() };
        let mut records = Vec::with_capacity(scene.meshes.len());
        for mesh in &scene.meshes {
            records.push(uploader.mesh(mesh)?);
        }
        let mut stack = 0;
        let mut bounds = Vec::new();
        let mut structures = Vec::new();
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
                    bounds.push(tree.bounds);
                }
            }
            Traversal::RayQuery => {
                for (mesh, record) in scene.meshes.iter().zip(&records) {
                    structures.push(uploader.upload.blas(&[BlasGeometry {
                        positions: record.positions,
                        vertex_count: mesh.positions.len() as u32,
                        indices: record.indices,
                        triangle_count: mesh.triangles.len() as u32,
                    }])?);
                }
            }
        }
        let first = uploader.upload("mesh records", &records)?;
        let Uploader { upload, buffers } = uploader;
        let meshes: Vec<u64> =
            (0..records.len()).map(|index| first + (index * size_of::<MeshRecord>()) as u64).collect();
        let meshes = upload.buffer("meshes", &meshes)?;
        let instances = upload.buffer("instances", &instance_records(scene))?;
        let mut placement = Placement { instances, nodes: None, tlas: None };
        match traversal {
            Traversal::Bvh => {
                let top = over_instances(scene, &bounds, MAX_STACK);
                stack = stack.max(top.stack);
                if upload.is_later() {
                    stack = stack.max(Bvh::balanced_stack(scene.instances.len()));
                }
                placement.nodes = Some(upload.buffer::<BvhNode>("tree over instances", &top.nodes)?);
            }
            Traversal::RayQuery => placement.tlas = Some(upload.tlas(&tlas_instances(scene, &structures))?),
        }
        Ok(Geometry {
            meshes,
            placement,
            bounds,
            structures,
            stack,
            is_cpu: device.profile().is_cpu,
            subgroup_size: device.limits().subgroup_size,
            buffers,
        })
    }

    /// The instances of a scene with the same meshes, their top level built anew: a tree here, an acceleration structure where
    /// the upload is recorded. Nothing changes until [`Geometry::place`].
    ///
    /// # Errors
    /// Out of memory, or so many more instances that the kernels' stack is too small for a tree over them.
    pub fn placed(&self, upload: &mut Upload, scene: &Scene) -> Result<Placement, Error> {
        let now = &self.placement;
        let mut next = Placement {
            instances: overwrite(upload, Some(&now.instances), "instances", &instance_records(scene))?,
            nodes: None,
            tlas: None,
        };
        if let Some(nodes) = &now.nodes {
            let top = over_instances(scene, &self.bounds, self.stack);
            if top.stack > self.stack {
                return Err(Error::Fixed { what: format!("a tree over {} instances", scene.instances.len()) });
            }
            next.nodes = Some(overwrite(upload, Some(nodes), "tree over instances", &top.nodes)?);
        }
        if let Some(tlas) = &now.tlas {
            let instances = tlas_instances(scene, &self.structures);
            next.tlas = Some(match tlas.count() == instances.len() {
                true => {
                    upload.rebuild(tlas, &instances)?;
                    tlas.clone()
                }
                false => upload.tlas(&instances)?,
            });
        }
        Ok(next)
    }

    /// Takes what [`Geometry::placed`] made; returns what was there, for as long as work may use it.
    pub fn place(&mut self, placement: Placement) -> Placement {
        std::mem::replace(&mut self.placement, placement)
    }

    /// What [`Geometry::place`] took last.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// Where the kernels find the meshes.
    pub fn meshes_address(&self) -> u64 {
        self.meshes.address()
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
        let Placement { instances, nodes, .. } = &self.placement;
        let buffers = self.buffers.iter().chain([&self.meshes, instances]).chain(nodes);
        buffers.map(|buffer| buffer.size()).sum()
    }
}

impl Placement {
    /// Where the kernels find the instances.
    pub fn instances_address(&self) -> u64 {
        self.instances.address()
    }

    /// Where the kernels find the tree over instances; 0 for ray query.
    pub fn nodes_address(&self) -> u64 {
        self.nodes.as_ref().map_or(0, |nodes| nodes.address())
    }

    /// The top-level acceleration structure, for ray query.
    pub fn tlas(&self) -> Option<&Tlas> {
        self.tlas.as_deref()
    }
}

/// The buffer overwritten with the data where they fit, else a new one.
pub(super) fn overwrite<T: bytemuck::Pod>(
    upload: &mut Upload,
    buffer: Option<&Arc<Buffer>>,
    name: &str,
    data: &[T],
) -> Result<Arc<Buffer>, Error> {
    match buffer.filter(|buffer| size_of_val(data) as u64 <= buffer.size()) {
        Some(buffer) => {
            upload.write(buffer, data)?;
            Ok(buffer.clone())
        }
        None => Ok(upload.buffer(name, data)?),
    }
}

struct Uploader<'a> {
    upload: &'a mut Upload,
    buffers: Vec<Arc<Buffer>>,
}

impl Uploader<'_> {
    /// The address of a copy of the data; null for none.
    fn upload<T: bytemuck::Pod>(&mut self, name: &str, data: &[T]) -> Result<u64, Error> {
        if data.is_empty() {
            return Ok(0);
        }
        let buffer = self.upload.buffer(name, data)?;
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

fn instance_records(scene: &Scene) -> Vec<InstanceRecord> {
    let record = |instance: &Instance| InstanceRecord {
        object_to_world: instance.object_to_world.to_cols_array(),
        world_to_object: inverse(&instance.object_to_world),
        mesh: instance.mesh,
    };
    scene.instances.iter().map(record).collect()
}

/// A tree over the instances' boxes in the world, for such a stack if that can be. Its leaves hold an instance's index each.
fn over_instances(scene: &Scene, bounds: &[Bounds], stack: u32) -> Bvh {
    let boxes: Vec<Bounds> = scene
        .instances
        .iter()
        .map(|instance| world_box(&bounds[instance.mesh as usize], &instance.object_to_world))
        .collect();
    Bvh::over_single_boxes(&boxes, stack)
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

fn tlas_instances(scene: &Scene, structures: &[Arc<Blas>]) -> Vec<TlasInstance> {
    (0..)
        .zip(&scene.instances)
        .map(|(index, instance)| {
            let columns = instance.object_to_world.to_cols_array();
            TlasInstance {
                blas: structures[instance.mesh as usize].clone(),
                transform: std::array::from_fn(|i| columns[i % 4 * 3 + i / 4]),
                custom_index: index,
                mask: 0xff,
            }
        })
        .collect()
}
