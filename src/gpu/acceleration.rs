//! Acceleration structures of `VK_KHR_acceleration_structure`, for kernels with ray query.

use std::sync::Arc;

use ash::{khr, vk};

use super::buffer::{Buffer, Memory};
use super::commands::Commands;
use super::device::{Device, Retired};
use super::error::{Error, Result};

/// Indexed triangles of a bottom-level structure, all opaque unless an instance says otherwise. The buffers may go once it is built.
#[derive(Clone, Copy, Debug)]
pub struct BlasGeometry {
    /// Address of the vertex positions, three `f32` each, tightly packed.
    pub positions: u64,
    /// How many there are.
    pub vertex_count: u32,
    /// Address of the vertex indices, three `u32` a triangle.
    pub indices: u64,
    /// How many triangles there are.
    pub triangle_count: u32,
}

/// How an acceleration structure, or a tree, follows what it was built over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Update {
    /// It is built anew, for how things lie now.
    #[default]
    Rebuild,
    /// Its boxes are fitted anew, and stay around what they were around. That takes less time; rays take more of it, the
    /// farther things have moved from where they were at the last rebuild.
    Refit,
}

/// A bottom-level structure: a mesh.
pub struct Blas {
    structure: Structure,
    /// How to bring it up to date.
    again: Option<Build>,
}

/// A mesh placed in the world.
#[derive(Clone)]
pub struct TlasInstance {
    /// The mesh.
    pub blas: Arc<Blas>,
    /// Object to world, the upper three rows of the matrix, row by row.
    pub transform: [f32; 12],
    /// What `rayQueryGetIntersectionInstanceCustomIndexEXT` says, below 2^24.
    pub custom_index: u32,
    /// Rays see the instance if they share a bit with it.
    pub mask: u8,
    /// Whether kernels that ask for it are told of each of its triangles before that counts as hit.
    pub has_holes: bool,
}

/// A top-level structure: a scene. Keeps its meshes.
pub struct Tlas {
    pub(super) set: vk::DescriptorSet,
    pool: vk::DescriptorPool,
    structure: Structure,
    /// How to bring it up to date, and where the instances lie then.
    again: Option<(Build, Arc<Buffer>)>,
    meshes: Vec<Arc<Blas>>,
}

impl Blas {
    /// Builds and compacts a structure over the geometries; waits until it is done.
    ///
    /// # Errors
    /// A device without ray query, out of memory, or a lost device.
    pub fn build(device: &Arc<Device>, geometries: &[BlasGeometry]) -> Result<Arc<Blas>> {
        let (structure, build) = Build::new(device, Input::ofmeshes(geometries), Flags::ALLOW_COMPACTION)?;
        build.run(device)?;
        Ok(Arc::new(Blas { structure: structure.compact()?, again: None }))
    }

    /// A structure that is built when its [`Build`] is recorded, and not compacted.
    pub(super) fn later(device: &Arc<Device>, geometries: &[BlasGeometry]) -> Result<(Arc<Blas>, Build)> {
        let (structure, build) = Build::new(device, Input::ofmeshes(geometries), Flags::empty())?;
        Ok((Arc::new(Blas { structure, again: None }), build))
    }

    /// A structure that is built when [`Commands::update_blas`] is recorded, any number of times; refitted, too, if that is
    /// how it is to follow.
    pub(super) fn following(device: &Arc<Device>, geometries: &[BlasGeometry], by: Update) -> Result<Arc<Blas>> {
        let (structure, build) = Build::new(device, Input::ofmeshes(geometries), by.flags())?;
        Ok(Arc::new(Blas { structure, again: Some(build) }))
    }

    /// Whether it can be brought up to date in that way.
    pub fn follows(&self, by: Update) -> bool {
        self.again.as_ref().is_some_and(|build| build.allows(by))
    }

    pub(super) fn again(&self) -> Option<&Build> {
        self.again.as_ref()
    }

    /// Bytes of device memory that it takes.
    pub fn size(&self) -> u64 {
        self.structure.buffer.size()
    }
}

/// `VkAccelerationStructureInstanceKHR`, word by word.
pub type TlasRecord = [u32; 16];

impl TlasInstance {
    /// What the instance buffer of a [`Tlas`] holds of it.
    pub fn record(&self) -> TlasRecord {
        let mut words = [0; 16];
        words[..12].copy_from_slice(&self.transform.map(f32::to_bits));
        words[12] = self.custom_index | u32::from(self.mask) << 24;
        let mut flags = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE;
        if self.has_holes {
            flags |= vk::GeometryInstanceFlagsKHR::FORCE_NO_OPAQUE;
        }
        words[13] = flags.as_raw() << 24;
        let address = self.blas.structure.address;
        (words[14], words[15]) = (address as u32, (address >> 32) as u32);
        words
    }
}

impl Tlas {
    /// Builds a structure over the instances; waits until it is done.
    ///
    /// # Errors
    /// A device without ray query, a custom index of more than 24 bits, out of memory, or a lost device.
    pub fn build(device: &Arc<Device>, instances: &[TlasInstance]) -> Result<Tlas> {
        let records = records(instances)?;
        let buffer = Buffer::with_data(device, "instances", &records)?;
        let (structure, build) = Build::new(device, Input::of_instances(&buffer, instances.len()), Flags::empty())?;
        build.run(device)?;
        Tlas::around(structure, instances, None)
    }

    /// A structure that is built when [`Commands::update_tlas`] is recorded, over what its instance buffer then holds: any
    /// number of times. It can be refitted, too, if that is how it is to follow.
    pub(super) fn later(
        device: &Arc<Device>,
        buffer: Arc<Buffer>,
        instances: &[TlasInstance],
        by: Update,
    ) -> Result<Tlas> {
        let (structure, build) = Build::new(device, Input::of_instances(&buffer, instances.len()), by.flags())?;
        Tlas::around(structure, instances, Some((build, buffer)))
    }

    fn around(structure: Structure, instances: &[TlasInstance], again: Option<(Build, Arc<Buffer>)>) -> Result<Tlas> {
        let device = structure.buffer.device.clone();
        let sizes =
            [vk::DescriptorPoolSize::default().ty(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR).descriptor_count(1)];
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: acceleration structures are enabled, or `structure` would not be there.
        let pool = unsafe { device.raw.create_descriptor_pool(&info, None) }
            .map_err(device.error("vkCreateDescriptorPool"))?;
        // From here on Drop gives the pool back.
        let meshes = instances.iter().map(|instance| instance.blas.clone()).collect();
        let mut tlas = Tlas { set: vk::DescriptorSet::null(), pool, structure, again, meshes };
        let layouts = [device.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool is new and has room for the set.
        let sets = unsafe { device.raw.allocate_descriptor_sets(&info) };
        let sets = sets.map_err(device.error("vkAllocateDescriptorSets"))?;
        tlas.set = sets.first().copied().unwrap_or_default();
        let structures = [tlas.structure.raw];
        let mut structures =
            vk::WriteDescriptorSetAccelerationStructureKHR::default().acceleration_structures(&structures);
        let write = vk::WriteDescriptorSet::default()
            .dst_set(tlas.set)
            .descriptor_type(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR)
            .descriptor_count(1)
            .push_next(&mut structures);
        // SAFETY: the set is new; the structure lives as long as it.
        unsafe { device.raw.update_descriptor_sets(&[write], &[]) };
        Ok(tlas)
    }

    /// Bytes of device memory that it takes, without its meshes.
    pub fn size(&self) -> u64 {
        self.structure.buffer.size()
    }

    /// The [`TlasRecord`]s that [`Commands::update_tlas`] builds it from; none of one that is built for good.
    pub fn instances(&self) -> Option<&Arc<Buffer>> {
        self.again.as_ref().map(|(_, instances)| instances)
    }

    /// Whether it can be brought up to date in that way, over instances of the same meshes in the same order.
    pub fn follows(&self, instances: &[TlasInstance], by: Update) -> bool {
        let meshes = self.meshes.iter().zip(instances).all(|(mesh, instance)| Arc::ptr_eq(mesh, &instance.blas));
        meshes && self.meshes.len() == instances.len() && self.again.as_ref().is_some_and(|(build, _)| build.allows(by))
    }

    pub(super) fn again(&self) -> Option<&Build> {
        self.again.as_ref().map(|(build, _)| build)
    }

    pub(super) fn device(&self) -> &Arc<Device> {
        &self.structure.buffer.device
    }
}

/// The instances as Vulkan has them.
///
/// # Errors
/// A custom index of more than 24 bits, or more instances than those count.
pub(super) fn records(instances: &[TlasInstance]) -> Result<Vec<TlasRecord>> {
    let most = (1 << 24) - 1;
    if let Some(instance) = instances.iter().find(|instance| instance.custom_index > most) {
        let index = instance.custom_index;
        return Err(Error::AccelerationStructure(format!("custom index {index} is above {most}")));
    }
    if instances.len() > most as usize {
        return Err(Error::AccelerationStructure(format!("{} instances, {most} at most", instances.len())));
    }
    Ok(instances.iter().map(TlasInstance::record).collect())
}

impl Drop for Tlas {
    fn drop(&mut self) {
        self.device().retire(Retired::DescriptorPool(self.pool));
    }
}

/// A structure of either level with the buffer that it lies in.
struct Structure {
    raw: vk::AccelerationStructureKHR,
    kind: vk::AccelerationStructureTypeKHR,
    address: u64,
    buffer: Buffer,
}

type Flags = vk::BuildAccelerationStructureFlagsKHR;

impl Update {
    fn flags(self) -> Flags {
        if self == Update::Refit { Flags::ALLOW_UPDATE } else { Flags::empty() }
    }
}

/// What a structure is built over.
struct Input {
    kind: vk::AccelerationStructureTypeKHR,
    geometries: Vec<vk::AccelerationStructureGeometryKHR<'static>>,
    /// Triangles, or instances, of each geometry.
    counts: Vec<u32>,
}

impl Input {
    fn ofmeshes(geometries: &[BlasGeometry]) -> Input {
        let described = geometries.iter().map(|geometry| {
            let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                .vertex_format(vk::Format::R32G32B32_SFLOAT)
                .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: geometry.positions })
                .vertex_stride(12)
                .max_vertex(geometry.vertex_count.saturating_sub(1))
                .index_type(vk::IndexType::UINT32)
                .index_data(vk::DeviceOrHostAddressConstKHR { device_address: geometry.indices });
            vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
                .flags(vk::GeometryFlagsKHR::OPAQUE)
        });
        Input {
            kind: vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL,
            geometries: described.collect(),
            counts: geometries.iter().map(|geometry| geometry.triangle_count).collect(),
        }
    }

    /// Over the [`TlasRecord`]s in a buffer.
    fn of_instances(buffer: &Buffer, count: usize) -> Input {
        let data = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: buffer.address() });
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances: data });
        Input {
            kind: vk::AccelerationStructureTypeKHR::TOP_LEVEL,
            geometries: vec![geometry],
            counts: vec![count as u32],
        }
    }
}

/// A build that is ready to be recorded: the structure is made, and so is the scratch memory.
pub(super) struct Build {
    input: Input,
    flags: Flags,
    /// Whoever keeps the structure outlives the build's last recording.
    raw: vk::AccelerationStructureKHR,
    scratch: Buffer,
}

// SAFETY: `input` points to nothing on the host (all its data are device addresses), and is only read after it is made.
unsafe impl Send for Build {}
// SAFETY: as above.
unsafe impl Sync for Build {}

impl Build {
    fn new(device: &Arc<Device>, input: Input, flags: Flags) -> Result<(Structure, Build)> {
        let functions = functions(device)?;
        let flags = flags | Flags::PREFER_FAST_TRACE;
        let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(input.kind)
            .flags(flags)
            .mode(vk::BuildAccelerationStructureModeKHR::BUILD)
            .geometries(&input.geometries);
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let by = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        // SAFETY: one count a geometry; the extension is enabled.
        unsafe { functions.get_acceleration_structure_build_sizes(by, &info, &input.counts, &mut sizes) };
        let name = match input.kind == vk::AccelerationStructureTypeKHR::TOP_LEVEL {
            true => "scene structure",
            false => "mesh structure",
        };
        let structure = Structure::empty(device, name, input.kind, sizes.acceleration_structure_size)?;
        let alignment = u64::from(device.limits().min_acceleration_structure_scratch_offset_alignment);
        let scratch_size = sizes.build_scratch_size.max(sizes.update_scratch_size);
        let scratch = Buffer::new(device, "build scratch", scratch_size + alignment, Memory::Device)?;
        let raw = structure.raw;
        Ok((structure, Build { input, flags, raw, scratch }))
    }

    /// Whether it was prepared for that.
    fn allows(&self, by: Update) -> bool {
        self.flags.contains(by.flags())
    }

    /// Records the build, or a refit of what was built before. What it reads must be there for acceleration structure
    /// builds, and it for who reads it.
    pub(super) fn record(&self, device: &Device, commands: vk::CommandBuffer, by: Update) -> Result<()> {
        let functions = functions(device)?;
        let alignment = u64::from(device.limits().min_acceleration_structure_scratch_offset_alignment);
        let address = self.scratch.address().next_multiple_of(alignment);
        let (mode, source) = match by {
            Update::Rebuild => (vk::BuildAccelerationStructureModeKHR::BUILD, vk::AccelerationStructureKHR::null()),
            Update::Refit => (vk::BuildAccelerationStructureModeKHR::UPDATE, self.raw),
        };
        let info = vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(self.input.kind)
            .flags(self.flags)
            .mode(mode)
            .geometries(&self.input.geometries)
            .src_acceleration_structure(source)
            .dst_acceleration_structure(self.raw)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: address });
        let counts = self.input.counts.iter();
        let ranges: Vec<_> =
            counts.map(|count| vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(*count)).collect();
        // SAFETY: structure and scratch are as large as the driver asked; the addresses are the caller's buffers.
        unsafe { functions.cmd_build_acceleration_structures(commands, &[info], &[&ranges]) };
        Ok(())
    }

    /// Builds, and waits until it is done.
    fn run(&self, device: &Arc<Device>) -> Result<()> {
        let mut commands = Commands::begin(device)?;
        commands.timestamp("acceleration structure");
        self.record(device, commands.raw(), Update::Rebuild)?;
        device.submit(commands)?.wait()?;
        Ok(())
    }
}

impl Structure {
    /// A structure of that size with nothing in it.
    fn empty(device: &Arc<Device>, name: &str, kind: vk::AccelerationStructureTypeKHR, size: u64) -> Result<Structure> {
        let functions = functions(device)?;
        let buffer = Buffer::new(device, name, size, Memory::Device)?;
        let info = vk::AccelerationStructureCreateInfoKHR::default().buffer(buffer.raw).size(size).ty(kind);
        // SAFETY: the buffer is as large as the structure.
        let raw = unsafe { functions.create_acceleration_structure(&info, None) }
            .map_err(device.error("vkCreateAccelerationStructureKHR"))?;
        device.set_name(raw, name);
        let info = vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(raw);
        // SAFETY: the structure was just made.
        let address = unsafe { functions.get_acceleration_structure_device_address(&info) };
        Ok(Structure { raw, kind, address, buffer })
    }

    /// Moves the structure to as little memory as it needs.
    fn compact(self) -> Result<Structure> {
        let device = &self.buffer.device;
        let functions = functions(device)?;
        let kind = vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
        let info = vk::QueryPoolCreateInfo::default().query_type(kind).query_count(1);
        // SAFETY: the extension is enabled.
        let pool = unsafe { device.raw.create_query_pool(&info, None) }.map_err(device.error("vkCreateQueryPool"))?;
        let size = (|| {
            let mut commands = Commands::begin(device)?;
            // SAFETY: the pool is new and kept until the work is done; the structure is built and allows compaction.
            unsafe {
                device.raw.cmd_reset_query_pool(commands.raw(), pool, 0, 1);
                let raw = commands.raw();
                functions.cmd_write_acceleration_structures_properties(raw, &[self.raw], kind, pool, 0);
            }
            device.submit(commands)?.wait()?;
            let mut size = [0u64];
            let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
            // SAFETY: the query was written.
            unsafe { device.raw.get_query_pool_results(pool, 0, &mut size, flags) }
                .map_err(device.error("vkGetQueryPoolResults"))?;
            Ok(size[0])
        })();
        device.retire(Retired::QueryPool(pool));
        let size = size?;
        if size == 0 || size >= self.buffer.size() {
            return Ok(self);
        }
        let small = Structure::empty(device, self.buffer.name(), self.kind, size)?;
        let info = vk::CopyAccelerationStructureInfoKHR::default()
            .src(self.raw)
            .dst(small.raw)
            .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
        let mut commands = Commands::begin(device)?;
        // SAFETY: the new structure is as large as the driver asked.
        unsafe { functions.cmd_copy_acceleration_structure(commands.raw(), &info) };
        device.submit(commands)?.wait()?;
        Ok(small)
    }
}

impl Drop for Structure {
    fn drop(&mut self) {
        // Before its buffer, which goes after this.
        self.buffer.device.retire(Retired::AccelerationStructure(self.raw));
    }
}

fn functions(device: &Device) -> Result<&khr::acceleration_structure::Device> {
    device.acceleration.as_ref().ok_or_else(|| Error::NoRayQuery { device: device.name().to_string() })
}
