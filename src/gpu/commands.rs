//! Recording: dispatches, barriers, copies, and how long each pass took.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::acceleration::Tlas;
use super::buffer::Buffer;
use super::device::{Device, Retired};
use super::error::{Error, Result};
use super::host_target::{HostBuffer, HostImage};
use super::kernel::Kernel;

/// Timestamps in a query pool.
const POOL_QUERIES: u32 = 256;

/// A command buffer being recorded.
///
/// Recording never waits and never fails half way: the first mistake is kept and comes back from [`Device::submit`] (or
/// [`Commands::finish`]), and nothing is recorded after it.
pub struct Commands {
    device: Arc<Device>,
    raw: vk::CommandBuffer,
    /// Null for a host's command buffer.
    pool: vk::CommandPool,
    bound: vk::Pipeline,
    has_tlas: bool,
    /// Those whose times are taken: none in a host's command buffer.
    passes: Vec<Cow<'static, str>>,
    has_label: bool,
    times_dispatches: bool,
    queries: Vec<vk::QueryPool>,
    error: Option<Error>,
    /// What is dropped while it is open may still be used by it.
    recording: Option<u64>,
}

impl Commands {
    /// Starts recording into a command buffer of its own.
    ///
    /// # Errors
    /// Out of memory.
    pub fn begin(device: &Arc<Device>) -> Result<Commands> {
        let info = vk::CommandPoolCreateInfo::default()
            .flags(vk::CommandPoolCreateFlags::TRANSIENT)
            .queue_family_index(device.queue_family);
        // SAFETY: the device is alive, for this and all calls below.
        let pool =
            unsafe { device.raw.create_command_pool(&info, None) }.map_err(device.error("vkCreateCommandPool"))?;
        // From here on Drop gives the pool back.
        let mut commands = Commands::over(device, vk::CommandBuffer::null());
        commands.pool = pool;
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool was just made, and nobody else has it.
        let buffers = unsafe { device.raw.allocate_command_buffers(&info) };
        let buffers = buffers.map_err(device.error("vkAllocateCommandBuffers"))?;
        commands.raw = buffers.first().copied().unwrap_or_default();
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer is new.
        unsafe { device.raw.begin_command_buffer(commands.raw, &info) }
            .map_err(device.error("vkBeginCommandBuffer"))?;
        Ok(commands)
    }

    /// Records into a host's command buffer. [`Commands::finish`] ends it; the host ends and submits the command buffer.
    /// Passes get their debug labels but no times. The host must bring what the first pass reads to compute-shader
    /// reads, and its own work after it behind compute-shader (and transfer) writes.
    ///
    /// # Safety
    /// `raw` is a command buffer of this device in the recording state, outside a render pass, for queues of the family that was
    /// lent, and nobody else records into it before `finish`. It is submitted once at most. Everything recorded outlives its execution.
    /// What was bound before for compute is bound no more afterwards.
    pub unsafe fn wrap(device: &Arc<Device>, raw: vk::CommandBuffer) -> Commands {
        Commands::over(device, raw)
    }

    fn over(device: &Arc<Device>, raw: vk::CommandBuffer) -> Commands {
        Commands {
            device: device.clone(),
            raw,
            pool: vk::CommandPool::null(),
            bound: vk::Pipeline::null(),
            has_tlas: false,
            passes: Vec::new(),
            has_label: false,
            times_dispatches: false,
            queries: Vec::new(),
            error: None,
            recording: Some(device.open_recording()),
        }
    }

    /// The first mistake made while recording, which is thereby taken note of; nothing is recorded after it all the same.
    ///
    /// # Errors
    /// That mistake.
    pub fn check(&mut self) -> Result<()> {
        match self.error.take() {
            None => Ok(()),
            Some(error) => {
                self.fail(format!("a mistake was made before: {error}"));
                Err(error)
            }
        }
    }

    /// Ends the recording into a host's command buffer.
    ///
    /// # Errors
    /// The first mistake made while recording.
    pub fn finish(mut self) -> Result<()> {
        self.end_label();
        self.error.take().map_or(Ok(()), Err)
    }

    /// Gives the acceleration structure to all ray-query kernels that follow.
    pub fn bind_tlas(&mut self, tlas: &Tlas) {
        if !Arc::ptr_eq(tlas.device(), &self.device) {
            self.fail("the acceleration structure is of another device".to_string());
        }
        if self.error.is_none() {
            let (point, layout) = (vk::PipelineBindPoint::COMPUTE, self.device.pipeline_layout);
            // SAFETY: the set has the layout's one binding written. All our pipelines share the layout, so it stays bound.
            unsafe { self.device.raw.cmd_bind_descriptor_sets(self.raw, point, layout, 0, &[tlas.set], &[]) };
            self.has_tlas = true;
        }
    }

    /// Runs `groups` workgroups of the kernel with these push constants.
    pub fn dispatch(&mut self, kernel: &Kernel, groups: [u32; 3], push: &impl Pod) {
        self.dispatch_bytes(kernel, groups, bytemuck::bytes_of(push));
    }

    pub(super) fn dispatch_bytes(&mut self, kernel: &Kernel, groups: [u32; 3], push: &[u8]) {
        let most = self.device.limits().max_compute_work_group_count;
        if (0..3).any(|i| groups[i] > most[i]) {
            let device = self.device.name().to_string();
            return self.fail(format!("{groups:?} workgroups of {}, {device} allows {most:?}", kernel.name()));
        }
        if self.prepare(kernel, push) {
            // SAFETY: a pipeline is bound with its push constants and, if it uses one, an acceleration structure.
            unsafe { self.device.raw.cmd_dispatch(self.raw, groups[0], groups[1], groups[2]) };
        }
    }

    /// Runs as many workgroups as the three `u32` at byte `offset` of `counts` say when the pass is reached.
    pub fn dispatch_indirect(&mut self, kernel: &Kernel, counts: &Buffer, offset: u64, push: &impl Pod) {
        if !offset.is_multiple_of(4) {
            return self.fail(format!("indirect dispatch of {} from offset {offset}, no multiple of 4", kernel.name()));
        }
        if self.in_buffer(counts, offset, 12).is_some() && self.prepare(kernel, bytemuck::bytes_of(push)) {
            // SAFETY: as above, and the counts lie in the buffer.
            unsafe { self.device.raw.cmd_dispatch_indirect(self.raw, counts.raw, offset) };
        }
    }

    /// Makes everything written so far (by kernels, copies, fills) visible to everything after it (kernels, indirect
    /// counts, copies, fills).
    pub fn barrier(&mut self) {
        use vk::PipelineStageFlags as Stage;
        let (stages, reads) = (Stage::COMPUTE_SHADER | Stage::TRANSFER, Stage::DRAW_INDIRECT);
        let to = vk::AccessFlags::SHADER_READ
            | vk::AccessFlags::SHADER_WRITE
            | vk::AccessFlags::TRANSFER_READ
            | vk::AccessFlags::TRANSFER_WRITE
            | vk::AccessFlags::INDIRECT_COMMAND_READ;
        self.memory_barrier(stages, stages | reads, to);
    }

    /// Makes everything written so far visible to the host, once it knows that the commands are done.
    pub fn barrier_to_host(&mut self) {
        let from = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
        self.memory_barrier(from, vk::PipelineStageFlags::HOST, vk::AccessFlags::HOST_READ);
    }

    /// Writes bytes that travel in the command buffer itself, so that whoever recorded them needs to keep nothing. Whole
    /// words, and not many: a driver keeps them until the commands are done.
    pub fn update(&mut self, buffer: &Buffer, offset: u64, bytes: &[u8]) {
        /// `vkCmdUpdateBuffer` takes no more at once.
        const MOST: usize = 65536;
        if !offset.is_multiple_of(4) || !bytes.len().is_multiple_of(4) {
            let count = bytes.len();
            return self
                .fail(format!("update of {count} bytes at {offset} of buffer {}, not whole words", buffer.name()));
        }
        if self.in_buffer(buffer, offset, bytes.len() as u64).is_some() {
            for (index, part) in bytes.chunks(MOST).enumerate() {
                let place = offset + (index * MOST) as u64;
                // SAFETY: the range lies in the buffer and is of whole words.
                unsafe { self.device.raw.cmd_update_buffer(self.raw, buffer.raw, place, part) };
            }
        }
    }

    /// Copies bytes to a host's buffer.
    pub fn copy_to_host_buffer(&mut self, from: &Buffer, to: &HostBuffer, bytes: u64) {
        if bytes > to.size {
            let (offset, end, size) = (to.offset, to.offset.saturating_add(bytes), to.size);
            return self.keep(Error::Range { buffer: "of the host".to_string(), offset, end, size });
        }
        if self.in_buffer(from, 0, bytes).is_some() && bytes > 0 {
            let region = vk::BufferCopy::default().dst_offset(to.offset).size(bytes);
            // SAFETY: both ranges lie in their buffers, as the host vouches for its own.
            unsafe { self.device.raw.cmd_copy_buffer(self.raw, from.raw, to.raw, &[region]) };
        }
    }

    /// Copies texels, row by row from the start of `from`, to a host's image, with the transitions of its layout.
    pub fn copy_to_host_image(
        &mut self,
        from: &Buffer,
        to: &HostImage,
        [width, height]: [u32; 2],
        bytes_per_texel: u32,
    ) {
        use vk::{AccessFlags as Access, ImageLayout as Layout, PipelineStageFlags as Stage};
        let bytes = u64::from(width) * u64::from(height) * u64::from(bytes_per_texel);
        if self.in_buffer(from, 0, bytes).is_none() || bytes == 0 {
            return;
        }
        let range =
            vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1);
        let transition = |(stage, access): (Stage, Access), (to_stage, to_access), old: Layout, new: Layout| {
            let barrier = vk::ImageMemoryBarrier::default()
                .src_access_mask(access)
                .dst_access_mask(to_access)
                .old_layout(old)
                .new_layout(new)
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .image(to.raw)
                .subresource_range(range);
            let none = vk::DependencyFlags::empty();
            // SAFETY: the host vouches for the image and for its layout.
            unsafe { self.device.raw.cmd_pipeline_barrier(self.raw, stage, to_stage, none, &[], &[], &[barrier]) };
        };
        let copies = (Stage::TRANSFER, Access::TRANSFER_WRITE);
        let writes = Access::MEMORY_WRITE;
        let all = Access::MEMORY_READ | Access::MEMORY_WRITE;
        if to.before != Layout::TRANSFER_DST_OPTIMAL {
            transition((Stage::ALL_COMMANDS, writes), copies, to.before, Layout::TRANSFER_DST_OPTIMAL);
        }
        let region = vk::BufferImageCopy::default()
            .image_subresource(
                vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1),
            )
            .image_offset(vk::Offset3D { x: to.origin[0] as i32, y: to.origin[1] as i32, z: 0 })
            .image_extent(vk::Extent3D { width, height, depth: 1 });
        // SAFETY: the host vouches for the image; as many texels lie in the buffer.
        unsafe {
            let layout = Layout::TRANSFER_DST_OPTIMAL;
            self.device.raw.cmd_copy_buffer_to_image(self.raw, from.raw, to.raw, layout, &[region]);
        }
        if to.after != Layout::TRANSFER_DST_OPTIMAL {
            transition(copies, (Stage::ALL_COMMANDS, all), Layout::TRANSFER_DST_OPTIMAL, to.after);
        }
    }

    /// Fills bytes of the buffer with a word; both ends of the range are multiples of 4.
    pub fn fill(&mut self, buffer: &Buffer, range: Range<u64>, word: u32) {
        if !range.start.is_multiple_of(4) || !range.end.is_multiple_of(4) || range.end < range.start {
            return self.fail(format!("fill of bytes {range:?} of buffer {}, not whole words", buffer.name()));
        }
        let bytes = range.end - range.start;
        if self.in_buffer(buffer, range.start, bytes).is_some() && bytes > 0 {
            // SAFETY: the range lies in the buffer and is of whole words.
            unsafe { self.device.raw.cmd_fill_buffer(self.raw, buffer.raw, range.start, bytes, word) };
        }
    }

    /// Copies bytes from one buffer to another. Within one buffer the two ranges must not overlap.
    pub fn copy(&mut self, from: &Buffer, from_offset: u64, to: &Buffer, to_offset: u64, bytes: u64) {
        if from.raw == to.raw && from_offset.abs_diff(to_offset) < bytes {
            return self.fail(format!("copy of {bytes} bytes onto itself in buffer {}", from.name()));
        }
        let there =
            self.in_buffer(from, from_offset, bytes).is_some() && self.in_buffer(to, to_offset, bytes).is_some();
        if there && bytes > 0 {
            let region = vk::BufferCopy::default().src_offset(from_offset).dst_offset(to_offset).size(bytes);
            // SAFETY: both ranges lie in their buffers and do not overlap.
            unsafe { self.device.raw.cmd_copy_buffer(self.raw, from.raw, to.raw, &[region]) };
        }
    }

    /// Starts a pass: what follows, up to the next call or the end, is timed under this label, stands under it in a
    /// capture, and is named by it if the device is lost.
    ///
    /// A pass's time runs from the end of all work before it to the end of all its own, so put a [`Commands::barrier`]
    /// between passes that should not overlap.
    pub fn timestamp(&mut self, label: impl Into<Cow<'static, str>>) {
        if self.error.is_some() {
            return;
        }
        let label = label.into();
        self.end_label();
        if let Some(debug) = &self.device.debug
            && let Ok(name) = std::ffi::CString::new(&*label)
        {
            let info = vk::DebugUtilsLabelEXT::default().label_name(&name);
            // SAFETY: the command buffer is being recorded.
            unsafe { debug.cmd_begin_debug_utils_label(self.raw, &info) };
            self.has_label = true;
        }
        if self.pool != vk::CommandPool::null() {
            self.write_timestamp();
            self.passes.push(label);
        }
    }

    /// Makes every dispatch that follows a pass of its own, by the name of its kernel. For measurements: on lavapipe a
    /// timestamp costs 25 to 30 µs.
    pub fn time_dispatches(&mut self) {
        self.times_dispatches = true;
    }

    /// The Vulkan handle, for commands of one's own. What was bound for compute before, a [`Tlas`] too, is bound no more.
    pub fn raw(&mut self) -> vk::CommandBuffer {
        self.bound = vk::Pipeline::null();
        self.has_tlas = false;
        self.raw
    }

    /// The device that it records for.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    fn prepare(&mut self, kernel: &Kernel, push: &[u8]) -> bool {
        let source = &kernel.source;
        if push.len() != source.push_constant_bytes as usize {
            let (name, wants) = (source.name, source.push_constant_bytes);
            self.fail(format!("{} bytes of push constants for kernel {name}, which has {wants}", push.len()));
        } else if source.uses_acceleration_structure && !self.has_tlas {
            self.fail(format!("kernel {} without an acceleration structure (bind_tlas)", source.name));
        } else if !Arc::ptr_eq(&kernel.device, &self.device) {
            self.fail(format!("kernel {} is of another device", source.name));
        }
        if self.times_dispatches {
            self.timestamp(source.name);
        }
        if self.error.is_some() {
            return false;
        }
        let device = &self.device;
        // SAFETY: pipeline, layout and command buffer are this device's; the bytes are those of the kernel's block.
        unsafe {
            if self.bound != kernel.pipeline {
                device.raw.cmd_bind_pipeline(self.raw, vk::PipelineBindPoint::COMPUTE, kernel.pipeline);
            }
            if !push.is_empty() {
                let stage = vk::ShaderStageFlags::COMPUTE;
                device.raw.cmd_push_constants(self.raw, device.pipeline_layout, stage, 0, push);
            }
        }
        self.bound = kernel.pipeline;
        true
    }

    fn memory_barrier(&mut self, from: vk::PipelineStageFlags, to: vk::PipelineStageFlags, access: vk::AccessFlags) {
        let written = vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE;
        self.barrier_between((from, written), (to, access));
    }

    pub(super) fn barrier_between(
        &mut self,
        (from, written): (vk::PipelineStageFlags, vk::AccessFlags),
        (to, access): (vk::PipelineStageFlags, vk::AccessFlags),
    ) {
        if self.error.is_some() {
            return;
        }
        let barrier = vk::MemoryBarrier::default().src_access_mask(written).dst_access_mask(access);
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is being recorded, outside a render pass.
        unsafe { self.device.raw.cmd_pipeline_barrier(self.raw, from, to, none, &[barrier], &[], &[]) };
    }

    /// The range, if it lies in the buffer, the buffer is of this device, and no mistake was made yet.
    fn in_buffer(&mut self, buffer: &Buffer, offset: u64, bytes: u64) -> Option<Range<u64>> {
        if !Arc::ptr_eq(&buffer.device, &self.device) {
            self.fail(format!("buffer {} is of another device", buffer.name()));
        }
        if self.error.is_some() {
            return None;
        }
        match buffer.range(offset, bytes) {
            Ok(range) => Some(range),
            Err(error) => {
                self.error = Some(error);
                None
            }
        }
    }

    /// The time at which all work so far is done, where the queue has timestamps.
    fn write_timestamp(&mut self) {
        if self.device.limits().timestamp_valid_bits == 0 {
            return;
        }
        let query = self.passes.len() as u32 % POOL_QUERIES;
        if query == 0 {
            let info =
                vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(POOL_QUERIES);
            // SAFETY: the device is alive.
            match unsafe { self.device.raw.create_query_pool(&info, None) } {
                Ok(pool) => {
                    self.queries.push(pool);
                    // SAFETY: the pool is new and kept until the work is done.
                    unsafe { self.device.raw.cmd_reset_query_pool(self.raw, pool, 0, POOL_QUERIES) };
                }
                Err(result) => self.error = Some(self.device.error("vkCreateQueryPool")(result)),
            }
        }
        if let (Some(pool), None) = (self.queries.last(), &self.error) {
            let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
            // SAFETY: the query was reset and is written once.
            unsafe { self.device.raw.cmd_write_timestamp(self.raw, stage, *pool, query) };
        }
    }

    fn end_label(&mut self) {
        if let (Some(debug), true) = (&self.device.debug, std::mem::take(&mut self.has_label)) {
            // SAFETY: a label was begun, and is ended here once.
            unsafe { debug.cmd_end_debug_utils_label(self.raw) };
        }
    }

    /// Keeps the first mistake.
    pub(super) fn fail(&mut self, reason: String) {
        self.keep(Error::Commands(reason));
    }

    pub(super) fn keep(&mut self, error: Error) {
        self.error.get_or_insert(error);
    }

    /// Records a command that binds nothing, unless a mistake was made.
    pub(super) fn record_raw(&mut self, record: impl FnOnce(vk::CommandBuffer) -> Result<()>) -> Result<()> {
        if self.error.is_some() { Ok(()) } else { record(self.raw) }
    }

    pub(super) fn last_pass(&self) -> Option<String> {
        self.passes.last().map(|label| label.to_string())
    }

    /// Ends the command buffer for submission to that device.
    pub(super) fn end(&mut self, device: &Arc<Device>) -> Result<vk::CommandBuffer> {
        if !Arc::ptr_eq(device, &self.device) {
            self.fail("they were recorded for another device".to_string());
        }
        if self.pool == vk::CommandPool::null() {
            self.fail(
                "the command buffer is a host's: end the recording with finish() and let the host submit it"
                    .to_string(),
            );
        }
        self.barrier_to_host();
        if !self.passes.is_empty() {
            self.write_timestamp();
        }
        self.end_label();
        if let Some(error) = self.error.take() {
            return Err(error);
        }
        // SAFETY: the command buffer is being recorded.
        unsafe { self.device.raw.end_command_buffer(self.raw) }.map_err(device.error("vkEndCommandBuffer"))?;
        Ok(self.raw)
    }

    /// The recording was submitted, or never will be.
    pub(super) fn close(&mut self) {
        if let Some(recording) = self.recording.take() {
            self.device.close_recording(recording);
        }
    }

    /// The passes with their times in nanoseconds; the work is done.
    fn times(&self) -> Result<Vec<(String, Option<u64>)>> {
        let raw = &self.device.raw;
        let mut ticks: Vec<u64> = Vec::new();
        for pool in &self.queries {
            let mut part = vec![0u64; (self.passes.len() + 1 - ticks.len()).min(POOL_QUERIES as usize)];
            let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
            // SAFETY: as many queries were written as are read.
            unsafe { raw.get_query_pool_results(*pool, 0, &mut part, flags) }
                .map_err(self.device.error("vkGetQueryPoolResults"))?;
            ticks.extend(part);
        }
        let limits = self.device.limits();
        // Above the valid bits there is nothing; a counter may wrap.
        let mask = u64::MAX.checked_shr(64 - limits.timestamp_valid_bits.clamp(1, 64)).unwrap_or(0);
        let span = |i: usize| {
            let elapsed = ticks.get(i + 1)?.wrapping_sub(*ticks.get(i)?) & mask;
            Some((elapsed as f64 * f64::from(limits.timestamp_period)) as u64)
        };
        Ok(self.passes.iter().enumerate().map(|(i, label)| (label.to_string(), span(i))).collect())
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        self.close();
        for pool in self.queries.drain(..) {
            self.device.retire(Retired::QueryPool(pool));
        }
        if self.pool != vk::CommandPool::null() {
            self.device.retire(Retired::CommandPool(self.pool));
        }
    }
}

/// Work that was submitted. Dropping it forgets about the times, not about the work.
pub struct Submission {
    commands: Commands,
    number: u64,
}

impl Submission {
    pub(super) fn new(commands: Commands, number: u64) -> Submission {
        Submission { commands, number }
    }

    /// Waits until the work is done. Returns the passes in order with their times in nanoseconds, none on a device
    /// without timestamps.
    ///
    /// # Errors
    /// A lost device, with the last pass submitted.
    pub fn wait(self) -> Result<Vec<(String, Option<u64>)>> {
        self.commands.device.wait_for(self.number)?;
        self.commands.times()
    }

    /// Whether the work is done.
    ///
    /// # Errors
    /// A lost device.
    pub fn is_done(&self) -> Result<bool> {
        Ok(self.commands.device.completed()? >= self.number)
    }
}
