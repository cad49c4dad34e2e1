//! A Vulkan device with its queue, its memory and the timeline that orders all work on it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings};

use super::commands::{Commands, Submission};
use super::error::{Error, Result};
use super::instance::{Instance, lock};
use super::kernel::PipelineCache;
use super::memory::{Allocation, HostAllocator, Source};
use super::profile::{self, DeviceReport, Limits, PUSH_CONSTANT_BYTES, Profile};

/// An open device. Everything made from it keeps it alive; all of it may be used from several threads.
pub struct Device {
    pub(super) raw: ash::Device,
    /// The one layout of all pipelines: 128 bytes of push constants and, with ray query, set 0.
    pub(super) pipeline_layout: vk::PipelineLayout,
    /// Set 0: the acceleration structure at binding 0. Null without ray query.
    pub(super) set_layout: vk::DescriptorSetLayout,
    pub(super) acceleration: Option<khr::acceleration_structure::Device>,
    pub(super) debug: Option<ext::debug_utils::Device>,
    pub(super) pipeline_cache: PipelineCache,
    // Taken only by Drop.
    pub(super) memory: Option<Source>,
    pub(super) queue_family: u32,
    report: DeviceReport,
    profile: Profile,
    has_ray_query: bool,
    /// Reaches n when the n-th submission is done.
    timeline: vk::Semaphore,
    queue: Mutex<Queue>,
    graveyard: Mutex<Graveyard>,
    owned: bool,
    // Last: the instance outlives the device.
    instance: Arc<Instance>,
}

/// A host's device, as [`Device::from_host`] borrows it.
pub struct HostDevice {
    /// What the host loaded Vulkan with.
    pub entry: ash::Entry,
    /// The host's instance, for Vulkan 1.2 or later.
    pub instance: ash::Instance,
    /// What the device is of.
    pub physical_device: vk::PhysicalDevice,
    /// The host's device.
    pub device: ash::Device,
    /// The family of the queue that our commands will run on; it computes.
    pub queue_family: u32,
    /// Whether `VK_KHR_ray_query`, `VK_KHR_acceleration_structure` and their features are enabled: what
    /// [`Requirements::ray_query`](super::Requirements::ray_query) said when the device was made.
    pub ray_query: bool,
    /// Whether the instance has `VK_EXT_debug_utils`: our passes and objects then have names in captures.
    pub debug_utils: bool,
    /// What gives us memory, with buffer device addresses on; `None` is an allocator of our own.
    pub allocator: Option<Arc<Mutex<Allocator>>>,
    /// What gives us memory instead, of whatever kind.
    pub host_allocator: Option<Arc<dyn HostAllocator>>,
    /// What keeps our pipelines; null is a cache of our own, in memory.
    pub pipeline_cache: vk::PipelineCache,
    /// A queue of that family, if calls that submit and wait are wanted too. What only records needs none.
    pub queue: Option<vk::Queue>,
}

impl HostDevice {
    /// Of handles of ash, without anything that is optional.
    pub fn new(
        entry: ash::Entry,
        instance: ash::Instance,
        physical_device: vk::PhysicalDevice,
        device: ash::Device,
        queue_family: u32,
    ) -> HostDevice {
        HostDevice {
            entry,
            instance,
            physical_device,
            device,
            queue_family,
            ray_query: false,
            debug_utils: false,
            allocator: None,
            host_allocator: None,
            pipeline_cache: vk::PipelineCache::null(),
            queue: None,
        }
    }

    /// Of raw handles, whose functions are looked up.
    ///
    /// # Safety
    /// The handles are alive and belong together, and the function is the loader's (or the driver's) for them.
    pub unsafe fn load(
        get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
        instance: vk::Instance,
        physical_device: vk::PhysicalDevice,
        device: vk::Device,
        queue_family: u32,
    ) -> HostDevice {
        // SAFETY: as the caller says.
        unsafe {
            let functions = ash::StaticFn { get_instance_proc_addr };
            let entry = ash::Entry::from_static_fn(functions);
            let instance = ash::Instance::load(entry.static_fn(), instance);
            let device = ash::Device::load(instance.fp_v1_0(), device);
            HostDevice::new(entry, instance, physical_device, device, queue_family)
        }
    }
}

struct Queue {
    /// None where a host submits by itself.
    raw: Option<vk::Queue>,
    submitted: u64,
    last_pass: Option<String>,
}

/// Vulkan objects whose owners are gone, kept until no work can use them any longer: neither work that was submitted
/// by then, nor work that was being recorded then and is submitted later.
#[derive(Default)]
struct Graveyard {
    recordings: u64,
    /// Recordings begun and neither submitted nor given up, oldest first.
    open: Vec<u64>,
    /// Objects that recordings below the number may use.
    recorded: VecDeque<(u64, Retired)>,
    /// Objects that submissions up to the number may use.
    submitted: VecDeque<(u64, Retired)>,
}

/// A Vulkan object whose owner is gone.
pub(super) enum Retired {
    Buffer(vk::Buffer, Allocation),
    Pipeline(vk::Pipeline),
    CommandPool(vk::CommandPool),
    QueryPool(vk::QueryPool),
    AccelerationStructure(vk::AccelerationStructureKHR),
    DescriptorPool(vk::DescriptorPool),
}

impl Device {
    pub(super) fn open(
        instance: &Arc<Instance>,
        physical: vk::PhysicalDevice,
        report: &DeviceReport,
    ) -> Result<Arc<Device>> {
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(report.queue_family)
            .queue_priorities(&priorities)];
        let mut features12 = vk::PhysicalDeviceVulkan12Features::default()
            .buffer_device_address(true)
            .scalar_block_layout(true)
            .timeline_semaphore(true);
        let mut acceleration =
            vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
        let mut ray_query = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
        let mut extensions = Vec::new();
        let mut info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut features12);
        if report.is_portability_subset {
            extensions.push(khr::portability_subset::NAME.as_ptr());
        }
        if report.ray_query {
            extensions.extend(profile::RAY_QUERY_EXTENSIONS.map(|name| name.as_ptr()));
            info = info.push_next(&mut acceleration).push_next(&mut ray_query);
        }
        let info = info.enabled_extension_names(&extensions);
        // SAFETY: the report says that the physical device has the features and extensions that `info` enables.
        let raw = unsafe { instance.raw.create_device(physical, &info, None) }
            .map_err(|result| Error::Call { call: "vkCreateDevice", result })?;
        // SAFETY: the queue was just created with the device.
        let queue = unsafe { raw.get_device_queue(report.queue_family, 0) };
        let cache = PipelineCache::on_disk(&raw, &instance.raw, physical);
        Self::finish(instance, physical, raw, Some(queue), report.clone(), cache, None, true)
    }

    /// Borrows a device that a host made and will destroy. Of the host's handles nothing is ever destroyed; nothing is
    /// submitted but by calls that say that they submit or wait, and those need [`HostDevice::queue`].
    ///
    /// # Errors
    /// The physical device is unfit, or a driver failure.
    ///
    /// # Safety
    /// The handles belong together and outlive the result and everything made from it; the device was made with what
    /// [`requirements`](super::requirements) asks for, and has what [`HostDevice::ray_query`] and [`HostDevice::debug_utils`] say; a pipeline
    /// cache is used from several threads at once. Vulkan wants access to a queue to be synchronised: nobody else
    /// submits to the queue, if one is given, while [`Device::submit`] (or a call that says it waits) runs.
    pub unsafe fn from_host(host: HostDevice) -> Result<Arc<Device>> {
        let HostDevice { entry, instance, physical_device, device: raw, .. } = host;
        // SAFETY: the instance outlives the result, as the caller says.
        let instance = unsafe { Instance::from_raw(entry, instance, host.debug_utils) };
        let mut report = profile::report(&instance.raw, 0, physical_device, Some(host.queue_family));
        if !report.missing.is_empty() {
            return Err(Error::Unfit { device: report.name, missing: report.missing });
        }
        report.ray_query &= host.ray_query;
        let cache = match host.pipeline_cache == vk::PipelineCache::null() {
            true => PipelineCache::in_memory(&raw),
            false => PipelineCache::of_host(host.pipeline_cache),
        };
        let memory = host.host_allocator.map(Source::Host).or(host.allocator.map(Source::Blocks));
        Self::finish(&instance, physical_device, raw, host.queue, report, cache, memory, false)
    }

    #[allow(clippy::too_many_arguments)] // the two ways to a device end here, and nothing else calls it
    fn finish(
        instance: &Arc<Instance>,
        physical: vk::PhysicalDevice,
        raw: ash::Device,
        queue: Option<vk::Queue>,
        report: DeviceReport,
        pipeline_cache: PipelineCache,
        memory: Option<Source>,
        owned: bool,
    ) -> Result<Arc<Device>> {
        let has_ray_query = report.ray_query;
        // Made before anything that can fail, so that its Drop cleans up after all that does.
        let mut device = Device {
            pipeline_layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            acceleration: has_ray_query.then(|| khr::acceleration_structure::Device::new(&instance.raw, &raw)),
            debug: instance.debug_utils.then(|| ext::debug_utils::Device::new(&instance.raw, &raw)),
            pipeline_cache,
            queue_family: report.queue_family,
            memory,
            profile: report.profile(),
            has_ray_query,
            timeline: vk::Semaphore::null(),
            queue: Mutex::new(Queue { raw: queue, submitted: 0, last_pass: None }),
            graveyard: Mutex::default(),
            owned,
            instance: instance.clone(),
            report,
            raw,
        };
        if device.memory.is_none() {
            let allocator = Allocator::new(&AllocatorCreateDesc {
                instance: instance.raw.clone(),
                device: device.raw.clone(),
                physical_device: physical,
                debug_settings: AllocatorDebugSettings::default(),
                buffer_device_address: true,
                allocation_sizes: AllocationSizes::new(64 << 20, 16 << 20).with_max_device_memblock_size(256 << 20),
            });
            let allocator = allocator.map_err(|error| device.out_of_memory(&format!("the allocator ({error})"), 0))?;
            device.memory = Some(Source::Blocks(Arc::new(Mutex::new(allocator))));
        }

        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: the device is alive, for this and the calls below.
        device.timeline =
            unsafe { device.raw.create_semaphore(&info, None) }.map_err(device.error("vkCreateSemaphore"))?;

        let binding = [vk::DescriptorSetLayoutBinding::default()
            .descriptor_type(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR)
            .descriptor_count(1)
            .stage_flags(vk::ShaderStageFlags::COMPUTE)];
        let mut sets = Vec::new();
        if has_ray_query {
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&binding);
            // SAFETY: acceleration structures are enabled.
            device.set_layout = unsafe { device.raw.create_descriptor_set_layout(&info, None) }
                .map_err(device.error("vkCreateDescriptorSetLayout"))?;
            sets.push(device.set_layout);
        }
        let ranges =
            [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(PUSH_CONSTANT_BYTES)];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&ranges);
        // SAFETY: every fit device has 128 bytes of push constants.
        device.pipeline_layout = unsafe { device.raw.create_pipeline_layout(&info, None) }
            .map_err(device.error("vkCreatePipelineLayout"))?;
        Ok(Arc::new(device))
    }

    /// The device's name.
    pub fn name(&self) -> &str {
        &self.report.name
    }

    /// The driver's name and version.
    pub fn driver(&self) -> &str {
        &self.report.driver
    }

    /// Whether acceleration structures and ray-query kernels work.
    pub fn has_ray_query(&self) -> bool {
        self.has_ray_query
    }

    /// The choices that depend on the driver.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// The device's limits.
    pub fn limits(&self) -> &Limits {
        &self.report.limits
    }

    /// All that is known about the device.
    pub fn report(&self) -> &DeviceReport {
        &self.report
    }

    /// What the validation layer has said so far about this device's instance.
    pub fn validation_messages(&self) -> Vec<String> {
        self.instance.validation_messages()
    }

    /// Ends the recording and submits it. Returns at once; [`Submission::wait`] waits.
    ///
    /// # Errors
    /// The first mistake made while recording, or a failing or lost device.
    pub fn submit(self: &Arc<Device>, mut commands: Commands) -> Result<Submission> {
        let raw = commands.end(self)?;
        let buffers = [raw];
        let mut queue = lock(&self.queue);
        let Some(raw_queue) = queue.raw else {
            return Err(Error::Commands(
                "the device was borrowed without a queue, so that only its host submits".to_string(),
            ));
        };
        let (before, after) = ([queue.submitted], [queue.submitted + 1]);
        let semaphores = [self.timeline];
        // Waiting for the submission before makes what it wrote visible to this one.
        let stages = [vk::PipelineStageFlags::ALL_COMMANDS];
        let mut timeline =
            vk::TimelineSemaphoreSubmitInfo::default().wait_semaphore_values(&before).signal_semaphore_values(&after);
        let info = vk::SubmitInfo::default()
            .command_buffers(&buffers)
            .wait_semaphores(&semaphores)
            .wait_dst_stage_mask(&stages)
            .signal_semaphores(&semaphores)
            .push_next(&mut timeline);
        queue.last_pass = commands.last_pass();
        // SAFETY: the command buffer is recorded, ended and not pending; the queue is locked.
        let result = unsafe { self.raw.queue_submit(raw_queue, &[info], vk::Fence::null()) };
        if result.is_ok() {
            queue.submitted += 1;
        }
        drop(queue);
        result.map_err(self.error("vkQueueSubmit"))?;
        commands.close();
        Ok(Submission::new(commands, after[0]))
    }

    /// Waits until everything that was submitted is done.
    ///
    /// # Errors
    /// A lost device.
    pub fn wait(&self) -> Result<()> {
        let submitted = lock(&self.queue).submitted;
        self.wait_for(submitted)
    }

    /// Waits for the submission of that number.
    pub(super) fn wait_for(&self, number: u64) -> Result<()> {
        let (semaphores, values) = ([self.timeline], [number]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is this device's.
        unsafe { self.raw.wait_semaphores(&info, u64::MAX) }.map_err(self.error("vkWaitSemaphores"))?;
        self.free_retired();
        Ok(())
    }

    /// The number of the last submission that is done.
    pub(super) fn completed(&self) -> Result<u64> {
        // SAFETY: the semaphore is this device's.
        unsafe { self.raw.get_semaphore_counter_value(self.timeline) }.map_err(self.error("vkGetSemaphoreCounterValue"))
    }

    /// Takes note of a recording: what is dropped from now on may still be used by it.
    pub(super) fn open_recording(&self) -> u64 {
        let mut graveyard = lock(&self.graveyard);
        graveyard.recordings += 1;
        let recording = graveyard.recordings;
        graveyard.open.push(recording);
        recording
    }

    /// The recording was submitted, or never will be. Frees nothing: this may be in a host's frame.
    pub(super) fn close_recording(&self, recording: u64) {
        lock(&self.graveyard).open.retain(|open| *open != recording);
    }

    /// Destroys the object as soon as no work can use it any longer.
    pub(super) fn retire(&self, object: Retired) {
        let mut graveyard = lock(&self.graveyard);
        let next = graveyard.recordings + 1;
        graveyard.recorded.push_back((next, object));
        drop(graveyard);
        self.free_retired();
    }

    /// Destroys the retired objects that no work can use any longer.
    pub(crate) fn free_retired(&self) {
        let Ok(completed) = self.completed() else { return };
        let mut graveyard = lock(&self.graveyard);
        // Read after the lock: whatever closed a recording has counted its submission by then.
        let submitted = lock(&self.queue).submitted;
        let oldest = graveyard.open.first().copied().unwrap_or(u64::MAX);
        while let Some((_, object)) = pop_front_if(&mut graveyard.recorded, |next| next <= oldest) {
            graveyard.submitted.push_back((submitted, object));
        }
        let mut done = Vec::new();
        while let Some((_, object)) = pop_front_if(&mut graveyard.submitted, |number| number <= completed) {
            done.push(object);
        }
        // A host's allocator may hold a lock of its own that another thread holds while it calls us.
        drop(graveyard);
        done.into_iter().for_each(|object| self.destroy(object));
    }

    fn destroy(&self, object: Retired) {
        // SAFETY: the object's owner is gone and so is the work that used it; nothing else destroys it.
        unsafe {
            match object {
                Retired::Buffer(buffer, allocation) => {
                    self.raw.destroy_buffer(buffer, None);
                    if let Some(source) = &self.memory {
                        source.free(allocation);
                    }
                }
                Retired::Pipeline(pipeline) => self.raw.destroy_pipeline(pipeline, None),
                Retired::CommandPool(pool) => self.raw.destroy_command_pool(pool, None),
                Retired::QueryPool(pool) => self.raw.destroy_query_pool(pool, None),
                Retired::DescriptorPool(pool) => self.raw.destroy_descriptor_pool(pool, None),
                Retired::AccelerationStructure(structure) => {
                    if let Some(acceleration) = &self.acceleration {
                        acceleration.destroy_acceleration_structure(structure, None);
                    }
                }
            }
        }
    }

    /// Turns a call's failure into an error that says what it means.
    pub(super) fn error(&self, call: &'static str) -> impl FnOnce(vk::Result) -> Error {
        move |result| match result {
            vk::Result::ERROR_DEVICE_LOST => {
                Error::DeviceLost { device: self.name().to_string(), last_pass: lock(&self.queue).last_pass.clone() }
            }
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
                self.out_of_memory(call, 0)
            }
            result => Error::Call { call, result },
        }
    }

    pub(super) fn out_of_memory(&self, what: &str, bytes: u64) -> Error {
        Error::OutOfMemory { what: what.to_string(), bytes, device: self.name().to_string() }
    }

    /// Gives an object its name in validation messages and captures.
    pub(super) fn set_name(&self, object: impl vk::Handle, name: &str) {
        if let (Some(debug), Ok(name)) = (&self.debug, std::ffi::CString::new(name)) {
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
            // SAFETY: the object is this device's. A name that is not taken harms nobody.
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // A lost device has nothing left to wait for.
        if self.timeline != vk::Semaphore::null() {
            let _ = self.wait();
        }
        let retired = std::mem::take(&mut *lock(&self.graveyard));
        retired.submitted.into_iter().chain(retired.recorded).for_each(|(_, object)| self.destroy(object));
        self.pipeline_cache.save(&self.raw);
        self.memory.take();
        // SAFETY: all work is done and everything made from the device is gone, as it would have kept the device.
        unsafe {
            self.pipeline_cache.destroy(&self.raw);
            self.raw.destroy_pipeline_layout(self.pipeline_layout, None);
            self.raw.destroy_descriptor_set_layout(self.set_layout, None);
            self.raw.destroy_semaphore(self.timeline, None);
            if self.owned {
                self.raw.destroy_device(None);
            }
        }
    }
}

fn pop_front_if<T>(queue: &mut VecDeque<(u64, T)>, wanted: impl Fn(u64) -> bool) -> Option<(u64, T)> {
    match queue.front() {
        Some((number, _)) if wanted(*number) => queue.pop_front(),
        _ => None,
    }
}
