//! Traces arrays of rays on a device: what tests and benches ask the traversals by themselves.

use std::sync::Arc;

use super::error::Error;
use super::geometry::Geometry;
use super::kernels::is_instanced;
use super::layout::SceneTable;
use super::settings::Traversal;
use crate::gpu::{self, Buffer, Commands, Device, Kernel, Memory};
use crate::scene::Scene;

crate::shared_structs! {
    /// The structs of `glsl/layout/rays.glsl`.
    pub const RAY_STRUCTS;

    /// A ray o + t·d, 0 < t < t_max.
    #[derive(PartialEq)]
    pub struct Ray {
        /// o, world space.
        pub origin: [f32; 3],
        /// Its end; < 0 meets nothing.
        pub t_max: f32,
        /// d, not 0, of any length.
        pub direction: [f32; 3],
        /// Nothing.
        pub padding: f32,
    }

    /// What a ray met. Where any hit was asked for there is no telling which.
    #[derive(PartialEq)]
    pub struct RayHit {
        /// Index of the instance, or [`RayHit::NONE`].
        pub instance: u32,
        /// Triangle of its mesh.
        pub triangle: u32,
    }

    /// Push constants of the `intersect_*` kernels.
    pub struct RayPass {
        /// The scene.
        pub scene: u64,
        /// What to trace.
        pub rays: u64,
        /// Where the hits go.
        pub hits: u64,
        /// How many there are.
        pub count: u32,
        /// Nothing.
        pub padding: u32,
    }
}

impl RayHit {
    /// The `instance` of a ray that met nothing.
    pub const NONE: u32 = u32::MAX;
}

/// Which hit is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The nearest.
    Closest,
    /// Any at all.
    Any,
}

/// A scene's geometry on a device, ready to be asked.
pub struct Intersector {
    device: Arc<Device>,
    geometry: Geometry,
    table: Buffer,
    closest: Kernel,
    any: Kernel,
}

/// Rays on a device, and room for their hits.
pub struct RayBatch {
    rays: Buffer,
    hits: Buffer,
    count: u32,
}

impl Intersector {
    /// Uploads the scene's geometry and builds the kernels.
    ///
    /// # Errors
    /// A traversal that the device lacks, a mesh that is too large, out of memory.
    pub fn new(device: &Arc<Device>, scene: &Scene, traversal: Traversal) -> Result<Intersector, Error> {
        let geometry = Geometry::upload(device, scene, traversal)?;
        let specialization = geometry.specialization();
        Intersector::with(device, scene, traversal, geometry, specialization)
    }

    /// The same with the BVH, walked as GPUs do, every invocation on its own, also where packets are faster.
    ///
    /// # Errors
    /// As of [`Intersector::new`].
    pub fn alone(device: &Arc<Device>, scene: &Scene) -> Result<Intersector, Error> {
        let geometry = Geometry::upload(device, scene, Traversal::Bvh)?;
        let specialization = geometry.specialization_alone();
        Intersector::with(device, scene, Traversal::Bvh, geometry, specialization)
    }

    fn with(
        device: &Arc<Device>,
        scene: &Scene,
        traversal: Traversal,
        geometry: Geometry,
        specialization: [(u32, u32); 3],
    ) -> Result<Intersector, Error> {
        let names = match traversal {
            Traversal::Bvh => ["intersect_closest_bvh", "intersect_any_bvh"],
            Traversal::RayQuery => ["intersect_closest_ray_query", "intersect_any_ray_query"],
        };
        let mut specialization = specialization.to_vec();
        specialization.push((7, u32::from(is_instanced(scene))));
        let kernel = |name| {
            let source = gpu::spirv::load(name).ok_or(Error::MissingKernel(name))?;
            Ok::<_, Error>(Kernel::new(device, source, &specialization)?)
        };
        let table = SceneTable {
            instances: geometry.placement().instances_address(),
            meshes: geometry.meshes_address(),
            nodes: geometry.placement().nodes_address(),
            reach: geometry.placement().reach(),
            ..bytemuck::Zeroable::zeroed()
        };
        Ok(Intersector {
            device: device.clone(),
            table: Buffer::with_data(device, "scene table", &[table])?,
            closest: kernel(names[0])?,
            any: kernel(names[1])?,
            geometry,
        })
    }

    /// Bytes of device memory of the geometry: see [`Geometry::bytes`].
    pub fn bytes(&self) -> u64 {
        self.geometry.bytes()
    }

    /// Uploads rays.
    ///
    /// # Errors
    /// Out of memory.
    pub fn upload(&self, rays: &[Ray]) -> Result<RayBatch, Error> {
        let hit_bytes = (rays.len() * size_of::<RayHit>()).max(size_of::<RayHit>()) as u64;
        Ok(RayBatch {
            rays: Buffer::with_data(&self.device, "rays", rays)?,
            hits: Buffer::new(&self.device, "hits", hit_bytes, Memory::Device)?,
            count: rays.len() as u32,
        })
    }

    /// Traces the rays and waits.
    ///
    /// # Errors
    /// A lost device.
    pub fn trace(&self, batch: &RayBatch, query: Query) -> Result<(), Error> {
        let kernel = match query {
            Query::Closest => &self.closest,
            Query::Any => &self.any,
        };
        let push = RayPass {
            scene: self.table.address(),
            rays: batch.rays.address(),
            hits: batch.hits.address(),
            count: batch.count,
            padding: 0,
        };
        let mut commands = Commands::begin(&self.device)?;
        if let Some(tlas) = self.geometry.placement().tlas() {
            commands.bind_tlas(tlas);
        }
        commands.timestamp("intersect");
        commands.dispatch(kernel, kernel.groups_for(batch.count), &push);
        self.device.submit(commands)?.wait()?;
        Ok(())
    }

    /// Uploads rays, traces them and reads back what they met.
    ///
    /// # Errors
    /// Out of memory, or a lost device.
    pub fn hits(&self, rays: &[Ray], query: Query) -> Result<Vec<RayHit>, Error> {
        if rays.is_empty() {
            return Ok(Vec::new());
        }
        let batch = self.upload(rays)?;
        self.trace(&batch, query)?;
        Ok(batch.hits.read()?)
    }
}
