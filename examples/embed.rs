//! The path tracer in an engine: one that has no window, so that there is little else to read.
//!
//!     cargo run --release --example embed -- scenes/cornell/scene.toml cornell.png
//!
//! The engine owns the instance, the device, the queue, the command buffers, the fences and the buffer that the picture goes
//! to; neubrdf records. Two frames are in flight: while the device works on one, the next is recorded. Half way the camera moves.
#![allow(unsafe_code)] // the engine speaks Vulkan itself

use std::error::Error;
use std::path::PathBuf;

use neubrdf::gpu::ash::{self, vk};
use neubrdf::gpu::{Additions, Commands, Device, HostBuffer, HostDevice, requirements};
use neubrdf::plugin::{Change, Frame, Options, PixelFormat, Renderer, Target};
use neubrdf::scene::Scene;

const FRAMES: usize = 64;
const IN_FLIGHT: usize = 2;
const SAMPLES_PER_FRAME: u32 = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let (Some(file), Some(out)) = (arguments.next(), arguments.next()) else {
        return Err("usage: embed scene.toml out.png".into());
    };
    let (scene, warnings) = Scene::load(&file)?;
    warnings.iter().for_each(|warning| eprintln!("{warning}"));
    let [width, height] = [scene.film.width, scene.film.height];

    // SAFETY: each handle is made from the one before, used on this thread alone, and destroyed last.
    let pixels = unsafe {
        let engine = Engine::new()?;
        let picture = engine.picture_buffer(u64::from(width) * u64::from(height) * 4)?;
        render(&engine, &picture, scene)?;
        let pixels = std::slice::from_raw_parts(picture.mapped, picture.size as usize).to_vec();
        engine.destroy(picture);
        pixels
    };
    image::save_buffer(&out, &pixels, width, height, image::ColorType::Rgba8)?;
    println!("{} ({width}x{height})", out.display());
    Ok(())
}

/// What is neubrdf's: lend the device, make a renderer, record frames, say when they are done.
unsafe fn render(engine: &Engine, picture: &Picture, scene: Scene) -> Result<(), Box<dyn Error>> {
    let mut host = HostDevice::new(
        engine.entry.clone(),
        engine.instance.clone(),
        engine.physical,
        engine.device.clone(),
        engine.queue_family,
    );
    host.ray_query = engine.ray_query;
    // SAFETY: the engine outlives the renderer, and its device was made with what `requirements` asked for.
    let lent = unsafe { Device::from_host(host) }?;
    let options = Options { frames_in_flight: IN_FLIGHT as u32, ..Options::default() };
    let mut renderer = Renderer::new(&lent, scene, &options)?;
    println!("on {}, rays by {}", lent.name(), renderer.traversal());

    // SAFETY: the buffer lives until all frames are done.
    let place = unsafe { HostBuffer::new(picture.buffer, 0, picture.size) };
    let targets = [Target::buffer(place, PixelFormat::Rgba8)];
    let mut tickets = [0; IN_FLIGHT];
    for index in 0..FRAMES + IN_FLIGHT {
        let slot = index % IN_FLIGHT;
        if index >= IN_FLIGHT {
            // SAFETY: the fence was submitted in this slot's last turn.
            unsafe { engine.device.wait_for_fences(&[engine.fences[slot]], true, u64::MAX) }?;
            if let Some(status) = renderer.complete(tickets[slot]) {
                let error = status.error.map_or("unknown".into(), |error| format!("{:.2} %", 100.0 * error));
                println!("{} samples a pixel, error {error}", status.samples);
            }
        }
        if index >= FRAMES {
            continue; // the last ones are only waited for
        }
        if index == FRAMES / 2 {
            let mut camera = renderer.scene().camera.clone();
            camera.eye += 0.1 * (camera.target - camera.eye);
            renderer.update(&[Change::Camera(camera)])?; // the film begins anew
        }
        // SAFETY: the slot's last commands are done; all that they use outlives the ones recorded here.
        unsafe {
            engine.begin(slot)?;
            let mut commands = Commands::wrap(&lent, engine.commands[slot]);
            tickets[slot] = renderer.record(&mut commands, &Frame::new(SAMPLES_PER_FRAME, &targets))?;
            commands.finish()?;
            engine.submit(slot)?;
        }
    }
    Ok(()) // the renderer is dropped: all frames are done
}

/// A minimal Vulkan program.
struct Engine {
    entry: ash::Entry,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue: vk::Queue,
    queue_family: u32,
    ray_query: bool,
    pool: vk::CommandPool,
    commands: Vec<vk::CommandBuffer>,
    fences: Vec<vk::Fence>,
}

/// A buffer that the engine reads.
struct Picture {
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    mapped: *const u8,
    size: u64,
}

impl Engine {
    unsafe fn new() -> Result<Engine, Box<dyn Error>> {
        // SAFETY: every structure lives until the call that reads it returns.
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None)?;

            // The first device that is fit for neubrdf, with a queue family that computes.
            let devices = instance.enumerate_physical_devices()?;
            let fit = devices.into_iter().map(|device| (device, requirements(&instance, device)));
            let found = fit.filter(|(_, required)| required.missing.is_empty()).min_by_key(|(device, _)| {
                instance.get_physical_device_properties(*device).device_type == vk::PhysicalDeviceType::CPU
            });
            let (physical, required) = found.ok_or("no fit Vulkan device")?;
            let families = instance.get_physical_device_queue_family_properties(physical);
            let computes = |family: &vk::QueueFamilyProperties| family.queue_flags.contains(vk::QueueFlags::COMPUTE);
            let queue_family = families.iter().position(computes).ok_or("no queue computes")? as u32;

            // The engine enables what it needs itself; neubrdf adds what it needs.
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
            let mut own_features = vk::PhysicalDeviceVulkan12Features::default();
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut own_features);
            let mut additions = Additions::default();
            let info = required.merge(info, &mut additions);
            let device = instance.create_device(physical, &info, None)?;

            let queue = device.get_device_queue(queue_family, 0);
            let info = vk::CommandPoolCreateInfo::default()
                .queue_family_index(queue_family)
                .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
            let pool = device.create_command_pool(&info, None)?;
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(IN_FLIGHT as u32);
            let commands = device.allocate_command_buffers(&info)?;
            let fence = |_| device.create_fence(&vk::FenceCreateInfo::default(), None);
            let fences = (0..IN_FLIGHT).map(fence).collect::<Result<_, _>>()?;
            let ray_query = required.ray_query;
            Ok(Engine { entry, instance, physical, device, queue, queue_family, ray_query, pool, commands, fences })
        }
    }

    unsafe fn picture_buffer(&self, size: u64) -> Result<Picture, Box<dyn Error>> {
        // SAFETY: the memory is as large as the buffer requires, and stays mapped until it is freed.
        unsafe {
            let info = vk::BufferCreateInfo::default().size(size).usage(vk::BufferUsageFlags::TRANSFER_DST);
            let buffer = self.device.create_buffer(&info, None)?;
            let requirements = self.device.get_buffer_memory_requirements(buffer);
            let visible = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let types = self.instance.get_physical_device_memory_properties(self.physical);
            let fits = |index: &u32| {
                requirements.memory_type_bits >> index & 1 == 1
                    && types.memory_types[*index as usize].property_flags.contains(visible)
            };
            let index = (0..types.memory_type_count).find(fits).ok_or("no memory that the host sees")?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(requirements.size).memory_type_index(index);
            let memory = self.device.allocate_memory(&info, None)?;
            self.device.bind_buffer_memory(buffer, memory, 0)?;
            let mapped = self.device.map_memory(memory, 0, size, vk::MemoryMapFlags::empty())?.cast();
            Ok(Picture { buffer, memory, mapped, size })
        }
    }

    unsafe fn begin(&self, slot: usize) -> Result<(), vk::Result> {
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the slot's last commands are done.
        unsafe {
            self.device.reset_fences(&[self.fences[slot]])?;
            self.device.begin_command_buffer(self.commands[slot], &info)
        }
    }

    unsafe fn submit(&self, slot: usize) -> Result<(), vk::Result> {
        // The picture, which copies wrote, is to be read by the CPU, and to be written again by the next frame's copies.
        let barrier = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ | vk::AccessFlags::TRANSFER_WRITE);
        let (copies, host) = (vk::PipelineStageFlags::TRANSFER, vk::PipelineStageFlags::HOST);
        let none = vk::DependencyFlags::empty();
        let buffers = [self.commands[slot]];
        let info = vk::SubmitInfo::default().command_buffers(&buffers);
        // SAFETY: the commands are being recorded, and then submitted once.
        unsafe {
            self.device.cmd_pipeline_barrier(buffers[0], copies, host | copies, none, &[barrier], &[], &[]);
            self.device.end_command_buffer(buffers[0])?;
            self.device.queue_submit(self.queue, &[info], self.fences[slot])
        }
    }

    unsafe fn destroy(self, picture: Picture) {
        // SAFETY: all work is done.
        unsafe {
            self.device.destroy_buffer(picture.buffer, None);
            self.device.free_memory(picture.memory, None);
            self.fences.iter().for_each(|fence| self.device.destroy_fence(*fence, None));
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}
