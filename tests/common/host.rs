//! An engine, as far as tests need one: its own instance, device, queue and command buffers, under synchronization
//! validation, with all that it makes in vectors that it destroys in the end.
#![allow(dead_code)] // each test file uses a part of it

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex};

use ash::{ext, vk};
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationSizes, AllocatorDebugSettings};
use neubrdf::gpu::{Additions, Commands, Device, HostBuffer, HostDevice, HostImage, requirements};

use crate::common::{alone_with_validation, name_of_lavapipe};

type Messages = Mutex<Vec<String>>;

pub struct Host {
    pub device: ash::Device,
    pub queue: vk::Queue,
    pub ray_query: bool,
    pub name: String,
    physical: vk::PhysicalDevice,
    pub memory: vk::PhysicalDeviceMemoryProperties,
    pool: vk::CommandPool,
    pipeline_cache: vk::PipelineCache,
    instance: ash::Instance,
    debug: (ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT),
    messages: Box<Messages>,
    entry: ash::Entry,
}

/// A command buffer with the fence that tells when it is done.
pub struct Recording {
    pub commands: vk::CommandBuffer,
    pool: vk::CommandPool,
    fence: vk::Fence,
}

/// A buffer that the host reads.
pub struct HostMemory {
    pub raw: vk::Buffer,
    memory: vk::DeviceMemory,
    mapped: *const u8,
    size: u64,
}

/// An image that only the device sees.
pub struct DeviceImage {
    pub raw: vk::Image,
    memory: vk::DeviceMemory,
    pub size: [u32; 2],
}

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Runs a check in a host on every device, with and without ray query where there is one, and insists that the validation
/// layer says nothing, not even when the device is destroyed.
pub fn in_every_host(check: impl Fn(&Host)) {
    in_hosts(|_| true, check);
}

/// The same on lavapipe alone, which compiles in no time, or what takes its place.
pub fn in_lavapipe_hosts(check: impl Fn(&Host)) {
    let wanted = name_of_lavapipe().to_lowercase();
    in_hosts(|name| name.to_lowercase().contains(&wanted), check);
}

/// The names of the devices, or none without a loader or without the validation layer.
fn device_names() -> Vec<String> {
    // SAFETY: the system's loader is trusted to be one; the instance is destroyed here.
    unsafe {
        let Ok(entry) = ash::Entry::load() else { return Vec::new() };
        let layers = entry.enumerate_instance_layer_properties().unwrap_or_default();
        if !layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION)) {
            return Vec::new();
        }
        let Ok(instance) = entry.create_instance(&vk::InstanceCreateInfo::default(), None) else { return Vec::new() };
        let devices = instance.enumerate_physical_devices().unwrap_or_default();
        let name = |device| instance.get_physical_device_properties(device).device_name_as_c_str().map(CStr::to_owned);
        let names = devices.into_iter().map(|device| name(device).unwrap_or_default().to_string_lossy().into_owned());
        let names = names.collect();
        instance.destroy_instance(None);
        names
    }
}

fn in_hosts(wanted: impl Fn(&str) -> bool, check: impl Fn(&Host)) {
    let names = device_names();
    let indices = names.iter().enumerate().filter(|(_, name)| wanted(name)).map(|(index, _)| index);
    let mut checked = 0;
    for index in indices {
        let host = Host::new(index, true);
        let ray_query = host.ray_query;
        host.run(&check);
        if ray_query {
            Host::new(index, false).run(&check);
        }
        checked += 1;
    }
    let required = std::env::var_os("NEUBRDF_REQUIRE_DRIVERS").is_some();
    assert!(checked > 0 || !required, "a Vulkan driver and the validation layer are required here");
    if checked == 0 {
        eprintln!("skipped: no such Vulkan device, or no validation layer");
    }
}

impl Host {
    fn run(self, check: &impl Fn(&Host)) {
        eprintln!("on {}, {} ray query", self.name, if self.ray_query { "with" } else { "without" });
        check(&self);
        self.finish();
    }

    /// A host on the device of that index.
    pub fn new(index: usize, wants_ray_query: bool) -> Host {
        alone_with_validation();
        // SAFETY: every handle is made from the one before, and destroyed in `finish`.
        unsafe {
            let entry = ash::Entry::load().unwrap();
            let messages = Box::new(Messages::default());
            let messenger_info = vk::DebugUtilsMessengerCreateInfoEXT::default()
                .message_severity(
                    vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
                )
                .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
                .pfn_user_callback(Some(receive))
                .user_data(std::ptr::from_ref::<Messages>(&messages).cast_mut().cast());
            let enables = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
            let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enables);
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let layers = [VALIDATION.as_ptr()];
            let extensions = [ext::debug_utils::NAME.as_ptr(), ext::validation_features::NAME.as_ptr()];
            let mut info = vk::InstanceCreateInfo::default()
                .application_info(&application)
                .enabled_extension_names(&extensions[..1]);
            // The layer keeps books of its own, which grow: long runs that look at memory do without.
            if std::env::var_os("NEUBRDF_NO_VALIDATION").is_none() {
                info = info.enabled_layer_names(&layers).enabled_extension_names(&extensions).push_next(&mut features);
            }
            let instance = entry.create_instance(&info, None).unwrap();
            let debug = ext::debug_utils::Instance::new(&entry, &instance);
            let messenger = debug.create_debug_utils_messenger(&messenger_info, None).unwrap();
            let physical = instance.enumerate_physical_devices().unwrap()[index];

            // What a host does to be fit for us: ask, and merge.
            let mut required = requirements(&instance, physical);
            assert!(required.missing.is_empty(), "{} lacks {:?}", required.device, required.missing);
            required.ray_query &= wants_ray_query;
            let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
            let mut features = vk::PhysicalDeviceVulkan12Features::default().host_query_reset(true);
            let mut additions = Additions::default();
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut features);
            let info = required.merge(info, &mut additions);
            let device = instance.create_device(physical, &info, None).unwrap();
            let queue = device.get_device_queue(0, 0);
            let info = vk::CommandPoolCreateInfo::default();
            let pool = device.create_command_pool(&info, None).unwrap();
            let info = vk::PipelineCacheCreateInfo::default();
            let pipeline_cache = device.create_pipeline_cache(&info, None).unwrap();
            let memory = instance.get_physical_device_memory_properties(physical);
            Host {
                device,
                queue,
                ray_query: required.ray_query,
                name: required.device,
                physical,
                memory,
                pool,
                pipeline_cache,
                instance,
                debug: (debug, messenger),
                messages,
                entry,
            }
        }
    }

    /// What the plugin is told of this host.
    pub fn host_device(&self) -> HostDevice {
        let (entry, instance, device) = (self.entry.clone(), self.instance.clone(), self.device.clone());
        let mut host = HostDevice::new(entry, instance, self.physical, device, 0);
        host.ray_query = self.ray_query;
        host.debug_utils = true;
        host.pipeline_cache = self.pipeline_cache;
        host
    }

    /// The same by raw handles, with functions found by way of what is made of the loader's.
    pub fn host_device_through(
        &self,
        over_loader: impl FnOnce(vk::PFN_vkGetInstanceProcAddr) -> vk::PFN_vkGetInstanceProcAddr,
    ) -> HostDevice {
        let functions = over_loader(self.entry.static_fn().get_instance_proc_addr);
        let (instance, device) = (self.instance.handle(), self.device.handle());
        // SAFETY: the handles are alive and belong together.
        let mut host = unsafe { HostDevice::load(functions, instance, self.physical, device, 0) };
        host.ray_query = self.ray_query;
        host
    }

    /// The device, lent to the plugin.
    pub fn lend(&self) -> Arc<Device> {
        // SAFETY: the handles belong together; tests drop what they made before the host.
        unsafe { Device::from_host(self.host_device()).unwrap() }
    }

    /// The device, lent together with an allocator.
    pub fn lend_with_allocator(&self, allocator: &Arc<Mutex<Allocator>>) -> Arc<Device> {
        let mut host = self.host_device();
        host.allocator = Some(allocator.clone());
        // SAFETY: as above.
        unsafe { Device::from_host(host).unwrap() }
    }

    /// An allocator as engines have them.
    pub fn allocator(&self) -> Arc<Mutex<Allocator>> {
        let info = AllocatorCreateDesc {
            instance: self.instance.clone(),
            device: self.device.clone(),
            physical_device: self.physical,
            debug_settings: AllocatorDebugSettings::default(),
            buffer_device_address: true,
            allocation_sizes: AllocationSizes::default(),
        };
        Arc::new(Mutex::new(Allocator::new(&info).unwrap()))
    }

    /// The device, lent together with the queue: for what submits and waits by itself.
    pub fn lend_with_queue(&self) -> Arc<Device> {
        let mut host = self.host_device();
        host.queue = Some(self.queue);
        // SAFETY: as above, and tests submit from one thread.
        unsafe { Device::from_host(host).unwrap() }
    }

    /// Begins a command buffer.
    pub fn begin(&self) -> Recording {
        self.begin_in(self.pool)
    }

    /// A pool for another thread's command buffers.
    pub fn pool(&self) -> vk::CommandPool {
        // SAFETY: the device is alive.
        unsafe { self.device.create_command_pool(&vk::CommandPoolCreateInfo::default(), None).unwrap() }
    }

    pub fn free_pool(&self, pool: vk::CommandPool) {
        // SAFETY: its command buffers are done.
        unsafe { self.device.destroy_command_pool(pool, None) };
    }

    /// Begins a command buffer of that pool.
    pub fn begin_in(&self, pool: vk::CommandPool) -> Recording {
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: pool and device are alive.
        unsafe {
            let commands = self.device.allocate_command_buffers(&info).unwrap()[0];
            let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            self.device.begin_command_buffer(commands, &info).unwrap();
            let fence = self.device.create_fence(&vk::FenceCreateInfo::default(), None).unwrap();
            Recording { commands, pool, fence }
        }
    }

    /// The plugin's view of a command buffer.
    pub fn wrap(&self, device: &Arc<Device>, recording: &Recording) -> Commands {
        // SAFETY: it is being recorded, by nobody else; tests wait before they drop what was recorded.
        unsafe { Commands::wrap(device, recording.commands) }
    }

    pub fn submit(&self, recording: &Recording) {
        let buffers = [recording.commands];
        let info = vk::SubmitInfo::default().command_buffers(&buffers);
        // SAFETY: the command buffer was recorded and is submitted once.
        unsafe {
            self.device.end_command_buffer(recording.commands).unwrap();
            self.device.queue_submit(self.queue, &[info], recording.fence).unwrap();
        }
    }

    /// The same behind a value of one timeline, and then raises another to one.
    pub fn submit_between(
        &self,
        recording: &Recording,
        (before, number): (vk::Semaphore, u64),
        (after, raised): (vk::Semaphore, u64),
    ) {
        let (buffers, befores, afters) = ([recording.commands], [before], [after]);
        let (numbers, raised) = ([number], [raised]);
        let mut values =
            vk::TimelineSemaphoreSubmitInfo::default().wait_semaphore_values(&numbers).signal_semaphore_values(&raised);
        let info = vk::SubmitInfo::default()
            .command_buffers(&buffers)
            .wait_semaphores(&befores)
            .wait_dst_stage_mask(&[vk::PipelineStageFlags::ALL_COMMANDS])
            .signal_semaphores(&afters)
            .push_next(&mut values);
        // SAFETY: as above, and the semaphores are timelines of the device's.
        unsafe {
            self.device.end_command_buffer(recording.commands).unwrap();
            self.device.queue_submit(self.queue, &[info], recording.fence).unwrap();
        }
    }

    /// A timeline at 0.
    pub fn timeline(&self) -> vk::Semaphore {
        let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
        // SAFETY: timelines are among what `requirements` asks for.
        unsafe { self.device.create_semaphore(&info, None).unwrap() }
    }

    pub fn free_timeline(&self, timeline: vk::Semaphore) {
        // SAFETY: what waited for it is done.
        unsafe { self.device.destroy_semaphore(timeline, None) };
    }

    /// What a timeline has come to.
    pub fn reached(&self, timeline: vk::Semaphore) -> u64 {
        // SAFETY: it is the device's.
        unsafe { self.device.get_semaphore_counter_value(timeline).unwrap() }
    }

    /// Raises a timeline.
    pub fn signal(&self, timeline: vk::Semaphore, value: u64) {
        let info = vk::SemaphoreSignalInfo::default().semaphore(timeline).value(value);
        // SAFETY: it is the device's, and the value more than it was.
        unsafe { self.device.signal_semaphore(&info).unwrap() };
    }

    pub fn wait(&self, recording: Recording) {
        // SAFETY: the fence was submitted; afterwards nothing uses fence and command buffer.
        unsafe {
            self.device.wait_for_fences(&[recording.fence], true, u64::MAX).unwrap();
            self.forget(recording);
        }
    }

    /// Gives a recording up that was not submitted, or is done.
    ///
    /// # Safety
    /// It is not pending.
    pub unsafe fn forget(&self, recording: Recording) {
        // SAFETY: as the caller says.
        unsafe {
            self.device.destroy_fence(recording.fence, None);
            self.device.free_command_buffers(recording.pool, &[recording.commands]);
        }
    }

    /// Records, submits and waits.
    pub fn run_commands<T>(&self, device: &Arc<Device>, record: impl FnOnce(&mut Commands) -> T) -> T {
        let recording = self.begin();
        let mut commands = self.wrap(device, &recording);
        let result = record(&mut commands);
        commands.finish().unwrap();
        self.submit(&recording);
        self.wait(recording);
        result
    }

    fn allocate(
        &self,
        requirements: &vk::MemoryRequirements,
        wanted: vk::MemoryPropertyFlags,
        flags: vk::MemoryAllocateFlags,
    ) -> vk::DeviceMemory {
        let types = self.memory.memory_types_as_slice().iter();
        let fits = |(index, kind): (usize, &vk::MemoryType)| {
            requirements.memory_type_bits >> index & 1 == 1 && kind.property_flags.contains(wanted)
        };
        let index = types.enumerate().position(fits).unwrap() as u32;
        let mut flags = vk::MemoryAllocateFlagsInfo::default().flags(flags);
        let info = vk::MemoryAllocateInfo::default().allocation_size(requirements.size).memory_type_index(index);
        let info = info.push_next(&mut flags);
        // SAFETY: the type is one that the requirements allow.
        unsafe { self.device.allocate_memory(&info, None).unwrap() }
    }

    /// A buffer for copies.
    pub fn buffer(&self, size: u64) -> HostMemory {
        self.buffer_for(size, vk::BufferUsageFlags::TRANSFER_DST | vk::BufferUsageFlags::TRANSFER_SRC)
    }

    /// A buffer of vertices or indices, as engines have them, and where shaders find it.
    pub fn mesh_buffer(&self, bytes: &[u8]) -> (HostMemory, u64) {
        let usage = vk::BufferUsageFlags::TRANSFER_DST | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
        let buffer = self.buffer_for(bytes.len() as u64, usage);
        let info = vk::BufferDeviceAddressInfo::default().buffer(buffer.raw);
        // SAFETY: as many bytes are mapped, the device does not use them yet, and the buffer has an address.
        unsafe {
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), buffer.mapped.cast_mut(), bytes.len());
            let address = self.device.get_buffer_device_address(&info);
            (buffer, address)
        }
    }

    fn buffer_for(&self, size: u64, usage: vk::BufferUsageFlags) -> HostMemory {
        let flags = match usage.contains(vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS) {
            true => vk::MemoryAllocateFlags::DEVICE_ADDRESS,
            false => vk::MemoryAllocateFlags::empty(),
        };
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the memory fits; it stays mapped until `free_buffer`.
        unsafe {
            let raw = self.device.create_buffer(&info, None).unwrap();
            let visible = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let memory = self.allocate(&self.device.get_buffer_memory_requirements(raw), visible, flags);
            self.device.bind_buffer_memory(raw, memory, 0).unwrap();
            let mapped = self.device.map_memory(memory, 0, size, vk::MemoryMapFlags::empty()).unwrap();
            HostMemory { raw, memory, mapped: mapped.cast(), size }
        }
    }

    /// Writes vertices on the device, between what compute shaders read of them before and what they read afterwards.
    pub fn write_vertices(&self, recording: &Recording, buffer: &HostMemory, bytes: &[u8]) {
        let (shaders, copies) = (vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::TRANSFER);
        let barrier = |from, to, written, read| {
            let barrier = vk::MemoryBarrier::default().src_access_mask(written).dst_access_mask(read);
            let none = vk::DependencyFlags::empty();
            // SAFETY: the command buffer is being recorded.
            unsafe { self.device.cmd_pipeline_barrier(recording.commands, from, to, none, &[barrier], &[], &[]) };
        };
        barrier(shaders | copies, copies, vk::AccessFlags::TRANSFER_WRITE, vk::AccessFlags::TRANSFER_WRITE);
        // SAFETY: the bytes are as many as the buffer's.
        unsafe { self.device.cmd_update_buffer(recording.commands, buffer.raw, 0, bytes) };
        barrier(copies, shaders, vk::AccessFlags::TRANSFER_WRITE, vk::AccessFlags::SHADER_READ);
    }

    pub fn image(&self, size: [u32; 2], format: vk::Format) -> DeviceImage {
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width: size[0], height: size[1], depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::TRANSFER_SRC);
        // SAFETY: the memory fits.
        unsafe {
            let raw = self.device.create_image(&info, None).unwrap();
            let requirements = self.device.get_image_memory_requirements(raw);
            let memory =
                self.allocate(&requirements, vk::MemoryPropertyFlags::empty(), vk::MemoryAllocateFlags::empty());
            self.device.bind_image_memory(raw, memory, 0).unwrap();
            DeviceImage { raw, memory, size }
        }
    }

    /// The bytes of an image that is in `TRANSFER_SRC_OPTIMAL`.
    pub fn read_image(&self, image: &DeviceImage, bytes_per_texel: u64) -> Vec<u8> {
        let [width, height] = image.size;
        let buffer = self.buffer(u64::from(width) * u64::from(height) * bytes_per_texel);
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let region = vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
            width,
            height,
            depth: 1,
        });
        let recording = self.begin();
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        // SAFETY: the buffer holds the image.
        unsafe {
            self.device.cmd_copy_image_to_buffer(recording.commands, image.raw, layout, buffer.raw, &[region]);
        }
        self.to_host(&recording);
        self.submit(&recording);
        self.wait(recording);
        let bytes = buffer.read();
        self.free_buffer(buffer);
        bytes
    }

    /// Makes what copies wrote visible to the host.
    pub fn to_host(&self, recording: &Recording) {
        let barrier = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ);
        let (from, to) = (vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is being recorded.
        unsafe { self.device.cmd_pipeline_barrier(recording.commands, from, to, none, &[barrier], &[], &[]) };
    }

    /// Takes an image from one layout to the other, behind all that copies do and before all that they will.
    pub fn transition(&self, recording: &Recording, image: &DeviceImage, old: vk::ImageLayout, new: vk::ImageLayout) {
        let copies = vk::AccessFlags::TRANSFER_READ | vk::AccessFlags::TRANSFER_WRITE;
        let range =
            vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1);
        let barrier = vk::ImageMemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(copies)
            .old_layout(old)
            .new_layout(new)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image.raw)
            .subresource_range(range);
        let stage = vk::PipelineStageFlags::TRANSFER;
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is being recorded, the image is in the old layout.
        unsafe { self.device.cmd_pipeline_barrier(recording.commands, stage, stage, none, &[], &[], &[barrier]) };
    }

    pub fn free_buffer(&self, buffer: HostMemory) {
        // SAFETY: nothing uses it any longer.
        unsafe {
            self.device.destroy_buffer(buffer.raw, None);
            self.device.free_memory(buffer.memory, None);
        }
    }

    pub fn free_image(&self, image: DeviceImage) {
        // SAFETY: nothing uses it any longer.
        unsafe {
            self.device.destroy_image(image.raw, None);
            self.device.free_memory(image.memory, None);
        }
    }

    /// What the validation layer has said so far.
    pub fn messages(&self) -> Vec<String> {
        self.messages.lock().unwrap().clone()
    }

    /// Destroys all that is the host's. What of the plugin is left then, the validation layer reports.
    pub fn finish(self) {
        // SAFETY: tests have waited for everything.
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_pipeline_cache(self.pipeline_cache, None);
            self.device.destroy_device(None);
            let messages = self.messages();
            self.debug.0.destroy_debug_utils_messenger(self.debug.1, None);
            self.instance.destroy_instance(None);
            assert_eq!(messages, Vec::<String>::new(), "on {}", self.name);
        }
    }
}

impl HostMemory {
    pub fn read(&self) -> Vec<u8> {
        // SAFETY: as many bytes are mapped, and the device is not writing them.
        unsafe { std::slice::from_raw_parts(self.mapped, self.size as usize).to_vec() }
    }

    pub fn target(&self) -> HostBuffer {
        // SAFETY: the buffer was made for copies and is freed when they are done.
        unsafe { HostBuffer::new(self.raw, 0, self.size) }
    }
}

impl DeviceImage {
    /// As a target whose texels are not needed before, and copied from afterwards.
    pub fn target(&self) -> HostImage {
        // SAFETY: the image was made for copies and is freed when they are done.
        let image = unsafe { HostImage::new(self.raw, self.size) };
        image.with_layouts(vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_SRC_OPTIMAL)
    }
}

unsafe extern "system" fn receive(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `user` is the host's mutex, which outlives the messenger; the layer passes valid data.
    unsafe {
        let messages = &*user.cast::<Messages>();
        if let Some(text) = data.as_ref().and_then(|data| data.message_as_c_str()) {
            messages.lock().unwrap().push(text.to_string_lossy().into_owned());
        }
    }
    vk::FALSE
}
