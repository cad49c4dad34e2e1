//! A scene's meshes and instances in device memory, with what a traversal needs to find them.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{Affine3A, DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::bvh::{Bvh, BvhNode, MAX_STACK};
use super::device_mesh::{Deformed, DeviceMesh, MeshArrays, MeshRecord, tree_over};
use super::error::Error;
use super::gather::Gatherer;
use super::settings::Traversal;
use crate::gpu::{Buffer, Device, HostMesh, Tlas, TlasInstance, Update, Upload};
use crate::scene::{Bounds, Instance, Scene};

crate::shared_structs! {
    /// The structs of `glsl/layout/geometry.glsl` that are made here.
    pub const INSTANCE_STRUCTS;

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

/// Instances that there is always room for where they may change. The walk's stack has 16 entries then, as meshes of a thousand
/// triangles need anyway: two words of a packet of eight on CPU drivers.
const ROOM: usize = 1024;

/// The uploaded geometry.
pub struct Geometry {
    meshes: Vec<Arc<DeviceMesh>>,
    /// The mesh records, and their addresses.
    records: Arc<Buffer>,
    addresses: Arc<Buffer>,
    placement: Placement,
    gatherer: Gatherer,
    /// Entries that a walk's stack needs at most.
    stack: u32,
    is_cpu: bool,
    subgroup_size: u32,
}

/// Where the meshes stand: what is made anew when one moves.
#[derive(Clone)]
pub struct Placement {
    instances: Arc<Buffer>,
    top: Top,
    bounds: Bounds,
}

/// The top level over all instances.
#[derive(Clone)]
enum Top {
    Tree { tree: Arc<Bvh>, nodes: Arc<Buffer> },
    Structure(Arc<Tlas>),
}

/// What [`Geometry::changed`] made, and then what it took the place of.
pub struct NextGeometry {
    /// Where some mesh has another shape.
    meshes: Option<Vec<Arc<DeviceMesh>>>,
    placement: Placement,
}

impl Geometry {
    /// Uploads what the scene has, and what the traversal needs: trees of our own, or acceleration structures.
    ///
    /// # Errors
    /// [`Traversal::RayQuery`] on a device without it, a mesh with too many triangles, out of memory.
    pub fn upload(device: &Arc<Device>, scene: &Scene, traversal: Traversal) -> Result<Geometry, Error> {
        Geometry::new(&mut Upload::now(device), (scene, &[]), traversal, false)
    }

    /// The same by way of `upload`. One that comes later leaves room for what changes bring: meshes of another shape and, where
    /// `instances_change`, other instances. The meshes of those indices come from a host's buffers.
    ///
    /// # Errors
    /// As of [`Geometry::upload`], and a host's mesh that does not go with the scene's or with the traversal.
    pub fn new(
        upload: &mut Upload,
        (scene, host_meshes): (&Scene, &[(u32, HostMesh)]),
        traversal: Traversal,
        instances_change: bool,
    ) -> Result<Geometry, Error> {
        let device = upload.device().clone();
        let gatherer = Gatherer::default();
        let hosts: HashMap<usize, &HostMesh> =
            host_meshes.iter().map(|(index, mesh)| (*index as usize, mesh)).collect();
        let trees: Vec<Option<Bvh>> = match traversal {
            Traversal::Bvh => {
                let trees = scene.meshes.par_iter().map(|mesh| Ok(Some(tree_over(mesh, MAX_STACK)?)));
                trees.collect::<Result<_, Error>>()?
            }
            Traversal::RayQuery => vec![None; scene.meshes.len()],
        };
        let mut stack = 0;
        let mut meshes = Vec::with_capacity(scene.meshes.len());
        for (index, (mesh, tree)) in scene.meshes.iter().zip(trees).enumerate() {
            stack = stack.max(tree.as_ref().map_or(0, |tree| tree.stack));
            let arrays = match hosts.get(&index) {
                Some(host) => MeshArrays::gathered(upload, &gatherer, mesh, host)?,
                None => MeshArrays::uploaded(upload, mesh)?,
            };
            meshes.push(Arc::new(DeviceMesh::new(upload, mesh, arrays, tree)?));
        }
        let records: Vec<MeshRecord> = meshes.iter().map(|mesh| mesh.record()).collect();
        let records = upload.buffer("mesh records", &records)?;
        let addresses: Vec<u64> =
            (0..meshes.len()).map(|index| records.address() + (index * size_of::<MeshRecord>()) as u64).collect();
        let addresses = upload.buffer("meshes", &addresses)?;
        let instances = upload.buffer("instances", &instance_records(scene))?;
        let top = match traversal {
            Traversal::Bvh => {
                let tree = Bvh::over_single_boxes(&world_boxes(scene, &meshes), MAX_STACK);
                stack = stack.max(tree.stack);
                if upload.is_later() {
                    stack = stack.max(stack_of_changes(scene, instances_change));
                }
                let nodes = upload.buffer::<BvhNode>("tree over instances", &tree.nodes)?;
                Top::Tree { tree: Arc::new(tree), nodes }
            }
            Traversal::RayQuery => Top::Structure(upload.tlas(&tlas_instances(scene, &meshes), Update::Rebuild)?),
        };
        let bounds = scene_bounds(scene, &meshes);
        Ok(Geometry {
            meshes,
            records,
            addresses,
            placement: Placement { instances, top, bounds },
            gatherer,
            stack,
            is_cpu: device.profile().is_cpu,
            subgroup_size: device.limits().subgroup_size,
        })
    }

    /// The scene's instances as they are now, over its meshes, of which some have been deformed. The top level follows as told: a
    /// tree here, an acceleration structure where the upload is recorded. Nothing changes until [`Geometry::take`].
    ///
    /// # Errors
    /// Out of memory, a host's vertices that are not those of the mesh, or a tree that the kernels' stack is too small for.
    pub fn changed(
        &self,
        upload: &mut Upload,
        scene: &Scene,
        deformed: &[Deformed],
        top_level: Update,
    ) -> Result<NextGeometry, Error> {
        let mut meshes = self.meshes.clone();
        for change in deformed {
            let (now, mesh) = (&self.meshes[change.mesh], &scene.meshes[change.mesh]);
            meshes[change.mesh] = Arc::new(now.deformed(upload, &self.gatherer, mesh, change, self.stack)?);
        }
        if !deformed.is_empty() {
            let records: Vec<MeshRecord> = meshes.iter().map(|mesh| mesh.record()).collect();
            upload.write(&self.records, &records)?;
        }
        let now = &self.placement;
        let instances = overwrite(upload, Some(&now.instances), "instances", &instance_records(scene))?;
        let top = match &now.top {
            Top::Tree { tree, nodes } => {
                let boxes = world_boxes(scene, &meshes);
                let tree = match top_level == Update::Refit && tree.order.len() == boxes.len() {
                    true => tree.refitted(&boxes),
                    false => Bvh::over_single_boxes(&boxes, self.stack),
                };
                if tree.stack > self.stack {
                    return Err(Error::Fixed { what: format!("a tree over {} instances", scene.instances.len()) });
                }
                let nodes = overwrite(upload, Some(nodes), "tree over instances", &tree.nodes)?;
                Top::Tree { tree: Arc::new(tree), nodes }
            }
            Top::Structure(tlas) => {
                let instances = tlas_instances(scene, &meshes);
                Top::Structure(match tlas.follows(&instances, top_level) {
                    true => {
                        upload.update_tlas(tlas, &instances, top_level)?;
                        tlas.clone()
                    }
                    false => upload.tlas(&instances, top_level)?,
                })
            }
        };
        let placement = Placement { instances, top, bounds: scene_bounds(scene, &meshes) };
        Ok(NextGeometry { meshes: (!deformed.is_empty()).then_some(meshes), placement })
    }

    /// Takes what [`Geometry::changed`] made; returns what was there, for as long as work may use it.
    pub fn take(&mut self, next: NextGeometry) -> NextGeometry {
        NextGeometry {
            meshes: next.meshes.map(|meshes| std::mem::replace(&mut self.meshes, meshes)),
            placement: std::mem::replace(&mut self.placement, next.placement),
        }
    }

    /// Where the meshes stand.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// The materials of a mesh's triangles, each once.
    pub fn materials_of(&self, mesh: usize) -> &[u32] {
        self.meshes[mesh].distinct_materials()
    }

    /// Where the kernels find the meshes.
    pub fn meshes_address(&self) -> u64 {
        self.addresses.address()
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
        let Placement { instances, top, .. } = &self.placement;
        let nodes = if let Top::Tree { nodes, .. } = top { nodes.size() } else { 0 };
        let meshes: u64 = self.meshes.iter().map(|mesh| mesh.bytes()).sum();
        meshes + self.records.size() + self.addresses.size() + instances.size() + nodes
    }
}

impl NextGeometry {
    /// Where the meshes stand.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }
}

impl Placement {
    /// A length that no chord of the scene has.
    pub fn reach(&self) -> f32 {
        2.5 * self.bounds.radius() + 1e-30
    }

    /// Where the kernels find the instances.
    pub fn instances_address(&self) -> u64 {
        self.instances.address()
    }

    /// Where the kernels find the tree over instances; 0 for ray query.
    pub fn nodes_address(&self) -> u64 {
        if let Top::Tree { nodes, .. } = &self.top { nodes.address() } else { 0 }
    }

    /// The top-level acceleration structure, for ray query.
    pub fn tlas(&self) -> Option<&Tlas> {
        if let Top::Structure(tlas) = &self.top { Some(tlas) } else { None }
    }
}

/// What a walk's stack must hold so that whatever is deformed finds room, and four times the instances, or [`ROOM`] of them.
fn stack_of_changes(scene: &Scene, instances_change: bool) -> u32 {
    let triangles = scene.meshes.iter().map(|mesh| mesh.triangles.len()).max().unwrap_or(0);
    let instances = if instances_change { (4 * scene.instances.len()).max(ROOM) } else { 0 };
    Bvh::balanced_stack(triangles.max(instances))
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

fn instance_records(scene: &Scene) -> Vec<InstanceRecord> {
    let record = |instance: &Instance| InstanceRecord {
        object_to_world: instance.object_to_world.to_cols_array(),
        world_to_object: inverse(&instance.object_to_world),
        mesh: instance.mesh,
    };
    scene.instances.iter().map(record).collect()
}

/// Boxes around the instances in the world.
fn world_boxes(scene: &Scene, meshes: &[Arc<DeviceMesh>]) -> Vec<Bounds> {
    let around = |instance: &Instance| {
        let mesh = &meshes[instance.mesh as usize];
        world_box(&mesh.tree_bounds(), &instance.object_to_world)
    };
    scene.instances.iter().map(around).collect()
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

/// [`Scene::bounds`], without another look at the vertices.
fn scene_bounds(scene: &Scene, meshes: &[Arc<DeviceMesh>]) -> Bounds {
    Bounds::around(&scene.instances, &meshes.iter().map(|mesh| mesh.bounds()).collect::<Vec<_>>())
}

/// Which meshes have a material that lets rays through.
fn meshes_with_holes(scene: &Scene, meshes: &[Arc<DeviceMesh>]) -> Vec<bool> {
    let has_holes = |material: &u32| !scene.materials[*material as usize].opacity.is_whole();
    meshes.iter().map(|mesh| mesh.distinct_materials().iter().any(has_holes)).collect()
}

fn tlas_instances(scene: &Scene, meshes: &[Arc<DeviceMesh>]) -> Vec<TlasInstance> {
    let with_holes = meshes_with_holes(scene, meshes);
    let placed = |(index, instance): (u32, &Instance)| {
        let columns = instance.object_to_world.to_cols_array();
        Some(TlasInstance {
            blas: meshes[instance.mesh as usize].structure()?.clone(),
            transform: std::array::from_fn(|i| columns[i % 4 * 3 + i / 4]),
            custom_index: index,
            mask: 0xff,
            has_holes: with_holes[instance.mesh as usize],
        })
    };
    (0..).zip(&scene.instances).filter_map(placed).collect()
}
