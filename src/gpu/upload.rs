//! How new buffers and acceleration structures get their contents: at once, or when a host's commands get to it.

use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::acceleration::{self, Blas, BlasGeometry, Build, Tlas, TlasInstance, Update};
use super::buffer::{Buffer, Memory};
use super::commands::Commands;
use super::device::Device;
use super::error::{Error, Result};
use super::kernel::Kernel;

/// Bytes of the first staging buffer; each is twice as large as the one before, up to the largest, or as what must fit.
const SMALLEST_STAGING: u64 = 64 << 10;
const LARGEST_STAGING: u64 = 64 << 20;

/// What at most travels in the command buffer, not through staging memory.
const LARGEST_UPDATE: usize = 64 << 10;

/// Makes buffers and acceleration structures with contents.
///
/// One that works [`now`](Upload::now) submits and waits. One for [`later`](Upload::later) only stages:
/// [`Upload::record`] records the copies and builds, and what was staged lives as long as the upload.
pub struct Upload {
    device: Arc<Device>,
    /// `None` works now.
    staged: Option<Staged>,
}

#[derive(Default)]
struct Staged {
    stagings: Vec<(Buffer, u64)>,
    copies: Vec<Copy>,
    /// Few bytes, which travel in the command buffer.
    updates: Vec<(Arc<Buffer>, Vec<u8>)>,
    fills: Vec<Arc<Buffer>>,
    dispatches: Vec<Dispatch>,
    /// Built once.
    meshes: Vec<(Arc<Blas>, Build)>,
    deformed: Vec<(Arc<Blas>, Update)>,
    scenes: Vec<(Arc<Tlas>, Update)>,
}

struct Dispatch {
    kernel: Arc<Kernel>,
    groups: [u32; 3],
    push: Vec<u8>,
    // Held until it is done.
    _writes: Arc<Buffer>,
}

struct Copy {
    staging: usize,
    from: u64,
    bytes: u64,
    to: Arc<Buffer>,
}

impl Upload {
    /// An upload whose every call submits and waits.
    pub fn now(device: &Arc<Device>) -> Upload {
        Upload { device: device.clone(), staged: None }
    }

    /// An upload that takes place where it is recorded.
    pub fn later(device: &Arc<Device>) -> Upload {
        Upload { device: device.clone(), staged: Some(Staged::default()) }
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Whether it takes place where it is recorded.
    pub fn is_later(&self) -> bool {
        self.staged.is_some()
    }

    /// Bytes of staging memory that it holds.
    pub fn staging_bytes(&self) -> u64 {
        self.staged.iter().flat_map(|staged| &staged.stagings).map(|(staging, _)| staging.size()).sum()
    }

    /// A buffer in device memory that holds `data`.
    ///
    /// # Errors
    /// Out of memory, or a lost device.
    pub fn buffer<T: Pod>(&mut self, name: &str, data: &[T]) -> Result<Arc<Buffer>> {
        let Some(staged) = &mut self.staged else {
            return Ok(Arc::new(Buffer::with_data(&self.device, name, data)?));
        };
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = Arc::new(Buffer::new(&self.device, name, bytes.len() as u64, Memory::Device)?);
        staged.put(&self.device, bytes, &buffer)?;
        Ok(buffer)
    }

    /// Writes `data` at the start of a buffer that exists, where commands recorded before may still use it. The last write
    /// to a buffer counts. Little data needs no staging memory.
    ///
    /// # Errors
    /// It does not fit, out of memory, or a lost device.
    pub fn write<T: Pod>(&mut self, buffer: &Arc<Buffer>, data: &[T]) -> Result<()> {
        let Some(staged) = &mut self.staged else { return buffer.write(0, data) };
        let bytes: &[u8] = bytemuck::cast_slice(data);
        buffer.range(0, bytes.len() as u64)?;
        staged.updates.retain(|(known, _)| !Arc::ptr_eq(known, buffer));
        staged.copies.retain(|copy| !Arc::ptr_eq(&copy.to, buffer));
        if bytes.len() > LARGEST_UPDATE || !bytes.len().is_multiple_of(4) {
            return staged.put(&self.device, bytes, buffer);
        }
        staged.updates.push((buffer.clone(), bytes.to_vec()));
        Ok(())
    }

    /// A buffer of zeros in device memory; a multiple of four bytes.
    ///
    /// # Errors
    /// Out of memory, or a lost device.
    pub fn zeroed(&mut self, name: &str, bytes: u64) -> Result<Arc<Buffer>> {
        let buffer = Arc::new(Buffer::new(&self.device, name, bytes, Memory::Device)?);
        match &mut self.staged {
            Some(staged) => staged.fills.push(buffer.clone()),
            None => self.run(|commands| commands.fill(&buffer, 0..bytes, 0))?,
        }
        Ok(buffer)
    }

    /// A bottom-level structure; compacted if it is built now.
    ///
    /// # Errors
    /// A device without ray query, out of memory, or a lost device.
    pub fn blas(&mut self, geometries: &[BlasGeometry]) -> Result<Arc<Blas>> {
        let Some(staged) = &mut self.staged else { return Blas::build(&self.device, geometries) };
        let (blas, build) = Blas::later(&self.device, geometries)?;
        staged.meshes.push((blas.clone(), build));
        Ok(blas)
    }

    /// A bottom-level structure that can be built again; refitted, too, if that is how it is to follow.
    ///
    /// # Errors
    /// As of [`Upload::blas`].
    pub fn deformable_blas(&mut self, geometries: &[BlasGeometry], by: Update) -> Result<Arc<Blas>> {
        let blas = Blas::following(&self.device, geometries, by)?;
        self.update_blas(&blas, Update::Rebuild)?;
        Ok(blas)
    }

    /// Brings a structure up to date with the positions that its geometries then hold; their indices are the same.
    ///
    /// # Errors
    /// It was not made for that ([`Blas::follows`]), or a lost device.
    pub fn update_blas(&mut self, blas: &Arc<Blas>, by: Update) -> Result<()> {
        if !blas.follows(by) {
            return Err(Error::AccelerationStructure(format!("a mesh structure that was not made for a {by:?}")));
        }
        match &mut self.staged {
            Some(staged) => {
                staged.deformed.push((blas.clone(), by));
                Ok(())
            }
            None => self.run(|commands| commands.update_blas(blas, by)),
        }
    }

    /// A top-level structure. One that is built later can be built again; refitted, too, if that is how it is to follow.
    ///
    /// # Errors
    /// A device without ray query, a custom index of more than 24 bits, out of memory, or a lost device.
    pub fn tlas(&mut self, instances: &[TlasInstance], by: Update) -> Result<Arc<Tlas>> {
        if self.staged.is_none() {
            return Ok(Arc::new(Tlas::build(&self.device, instances)?));
        }
        let buffer = self.buffer("instances", &acceleration::records(instances)?)?;
        let tlas = Arc::new(Tlas::later(&self.device, buffer, instances, by)?);
        if let Some(staged) = &mut self.staged {
            staged.scenes.push((tlas.clone(), Update::Rebuild));
        }
        Ok(tlas)
    }

    /// Brings a structure up to date with instances of the same meshes.
    ///
    /// # Errors
    /// It was not made for that ([`Tlas::follows`]), a custom index of more than 24 bits, out of memory, or a lost device.
    pub fn update_tlas(&mut self, tlas: &Arc<Tlas>, instances: &[TlasInstance], by: Update) -> Result<()> {
        let (Some(buffer), true) = (tlas.instances(), tlas.follows(instances, by)) else {
            return Err(Error::AccelerationStructure(format!(
                "a scene structure that was not made for a {by:?} over these {} instances",
                instances.len()
            )));
        };
        self.write(buffer, &acceleration::records(instances)?)?;
        match &mut self.staged {
            Some(staged) => {
                staged.scenes.push((tlas.clone(), by));
                Ok(())
            }
            None => self.run(|commands| commands.update_tlas(tlas, by)),
        }
    }

    /// Runs a kernel once buffers have their contents, before acceleration structures are built. It writes that buffer.
    ///
    /// # Errors
    /// A mistake in the dispatch, or a lost device, where it takes place now.
    pub fn dispatch(
        &mut self,
        kernel: &Arc<Kernel>,
        groups: [u32; 3],
        push: &impl Pod,
        writes: &Arc<Buffer>,
    ) -> Result<()> {
        let push = bytemuck::bytes_of(push).to_vec();
        let dispatch = Dispatch { kernel: kernel.clone(), groups, push, _writes: writes.clone() };
        match &mut self.staged {
            Some(staged) => {
                staged.dispatches.push(dispatch);
                Ok(())
            }
            None => self.run(|commands| dispatch.record(commands)),
        }
    }

    /// Records, submits and waits.
    fn run(&self, record: impl FnOnce(&mut Commands)) -> Result<()> {
        let mut commands = Commands::begin(&self.device)?;
        record(&mut commands);
        commands.barrier();
        self.device.submit(commands)?.wait()?;
        Ok(())
    }

    /// Records all that was staged, and makes it visible to what follows. The upload must live until that is done.
    pub fn record(&self, commands: &mut Commands) {
        let Some(staged) = &self.staged else { return };
        commands.timestamp("upload");
        for Copy { staging, from, bytes, to } in &staged.copies {
            commands.copy(&staged.stagings[*staging].0, *from, to, 0, *bytes);
        }
        for (buffer, bytes) in &staged.updates {
            commands.update(buffer, 0, bytes);
        }
        for buffer in &staged.fills {
            commands.fill(buffer, 0..buffer.size(), 0);
        }
        commands.barrier();
        if !staged.dispatches.is_empty() {
            staged.dispatches.iter().for_each(|dispatch| dispatch.record(commands));
            commands.barrier();
        }
        for (_, build) in &staged.meshes {
            commands.build(build, Update::Rebuild);
        }
        for (blas, by) in &staged.deformed {
            commands.update_blas(blas, *by);
        }
        for (tlas, by) in &staged.scenes {
            commands.update_tlas(tlas, *by);
        }
        // What the next upload writes.
        commands.barrier();
    }
}

impl Dispatch {
    fn record(&self, commands: &mut Commands) {
        commands.dispatch_bytes(&self.kernel, self.groups, &self.push);
    }
}

impl Staged {
    fn put(&mut self, device: &Arc<Device>, bytes: &[u8], to: &Arc<Buffer>) -> Result<()> {
        let size = bytes.len() as u64;
        if size == 0 {
            return Ok(());
        }
        let has_room = self.stagings.last().is_some_and(|(staging, used)| used + size <= staging.size());
        if !has_room {
            let doubled = self.stagings.last().map_or(SMALLEST_STAGING, |(staging, _)| 2 * staging.size());
            let staging_bytes = doubled.min(LARGEST_STAGING).max(size);
            self.stagings.push((Buffer::new(device, "upload staging", staging_bytes, Memory::Upload)?, 0));
        }
        let staging = self.stagings.len() - 1;
        let (buffer, used) = &mut self.stagings[staging];
        let from = *used;
        let place = buffer.mapped_mut().and_then(|room| room.get_mut(from as usize..(from + size) as usize));
        place
            .ok_or_else(|| Error::Commands("the driver gave staging memory that the host cannot see".into()))?
            .copy_from_slice(bytes);
        *used = (from + size).next_multiple_of(16);
        self.copies.push(Copy { staging, from, bytes: size, to: to.clone() });
        Ok(())
    }
}

impl Commands {
    /// Brings the structure up to date with the positions that its geometries hold, and makes it visible to what follows. What was
    /// recorded before and still uses it is waited for.
    pub fn update_blas(&mut self, blas: &Blas, by: Update) {
        match blas.again() {
            Some(build) => self.build(build, by),
            None => self.fail("the acceleration structure was built for good".to_string()),
        }
    }

    /// The same with the records in its instance buffer ([`Tlas::instances`]), which copies may have written just before.
    pub fn update_tlas(&mut self, tlas: &Tlas, by: Update) {
        match tlas.again() {
            Some(build) => self.build(build, by),
            None => self.fail("the acceleration structure was built for good".to_string()),
        }
    }

    fn build(&mut self, build: &Build, by: Update) {
        use vk::{AccessFlags as Access, PipelineStageFlags as Stage};
        let all = Stage::ACCELERATION_STRUCTURE_BUILD_KHR | Stage::COMPUTE_SHADER;
        let written = Access::ACCELERATION_STRUCTURE_WRITE_KHR | Access::SHADER_WRITE | Access::TRANSFER_WRITE;
        let used = Access::ACCELERATION_STRUCTURE_READ_KHR | Access::ACCELERATION_STRUCTURE_WRITE_KHR;
        let device = self.device().clone();
        // Its input and its scratch memory: of copies, and of the build before.
        self.barrier_between((all | Stage::TRANSFER, written), (all, used | Access::SHADER_READ));
        if let Err(error) = self.record_raw(|raw| build.record(&device, raw, by)) {
            self.keep(error);
        }
        self.barrier_between((all, written), (all, used | Access::SHADER_READ));
    }
}
