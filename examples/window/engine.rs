//! A small Vulkan engine with a swapchain, and nothing of neubrdf's but what lends it the device.

use std::error::Error;
use std::sync::Arc;

use neubrdf::gpu::ash::{self, khr, vk};
use neubrdf::gpu::{Additions, Commands, Device, HostDevice, HostImage, requirements};
use neubrdf::plugin::PixelFormat;
use winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use winit::window::Window;

use crate::caption;
use crate::mapped::Mapped;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Frames that are recorded while the device works on those before.
pub const IN_FLIGHT: usize = 2;

/// The engine. What it made goes with it, once the device is idle.
pub struct Engine {
    entry: ash::Entry,
    instance: ash::Instance,
    surfaces: khr::surface::Instance,
    surface: vk::SurfaceKHR,
    physical: vk::PhysicalDevice,
    ray_query: bool,
    device: ash::Device,
    queue: vk::Queue,
    queue_family: u32,
    pool: vk::CommandPool,
    slots: Vec<Slot>,
    turn: usize,
    lent: Option<Arc<Device>>,
    swapchains: khr::swapchain::Device,
    swapchain: Swapchain,
}

/// What a frame in flight needs of its own.
struct Slot {
    commands: vk::CommandBuffer,
    done: vk::Fence,
    acquired: vk::Semaphore,
    /// What is written over the picture.
    caption: Mapped,
}

struct Swapchain {
    raw: vk::SwapchainKHR,
    format: vk::SurfaceFormatKHR,
    size: [u32; 2],
    images: Vec<vk::Image>,
    /// One an image: signalled when it may be presented.
    ready: Vec<vk::Semaphore>,
}

/// What became of a frame.
pub enum Shown {
    /// It is on its way to the screen.
    Presented,
    /// The same, and here are its RGBA bytes.
    Copied(Vec<u8>),
    /// The swapchain is not that of the window any longer: resize, and try again.
    Stale,
}

impl Engine {
    pub fn new(window: &Window, size: [u32; 2]) -> Outcome<Engine> {
        let (display, handle) = (window.display_handle()?.as_raw(), window.window_handle()?.as_raw());
        // SAFETY: each handle is made from the one before, and destroyed in Drop; every structure lives until the call that
        // reads it returns; the window outlives the engine.
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
            let extensions = ash_window::enumerate_required_extensions(display)?;
            let info =
                vk::InstanceCreateInfo::default().application_info(&application).enabled_extension_names(extensions);
            let instance = entry.create_instance(&info, None)?;
            let surfaces = khr::surface::Instance::new(&entry, &instance);
            let surface = ash_window::create_surface(&entry, &instance, display, handle, None)?;

            // A device that is fit for neubrdf, with a queue family that computes and presents; GPUs before CPUs.
            let family = |physical| {
                let families = instance.get_physical_device_queue_family_properties(physical);
                families.iter().zip(0..).find_map(|(family, index)| {
                    let presents = surfaces.get_physical_device_surface_support(physical, index, surface);
                    let fits = family.queue_flags.contains(vk::QueueFlags::COMPUTE) && presents.unwrap_or(false);
                    fits.then_some(index)
                })
            };
            let devices = instance.enumerate_physical_devices()?.into_iter();
            let fit = devices.filter_map(|physical| {
                let required = requirements(&instance, physical);
                let family = family(physical).filter(|_| required.missing.is_empty())?;
                Some((physical, required, family))
            });
            let is_slow = |physical: vk::PhysicalDevice| {
                let properties = instance.get_physical_device_properties(physical);
                // Of the CPU drivers, that which compiles quickly.
                let name = properties.device_name_as_c_str().unwrap_or_default().to_string_lossy().into_owned();
                (properties.device_type == vk::PhysicalDeviceType::CPU, name.contains("SwiftShader"))
            };
            let found = fit.min_by_key(|(physical, ..)| is_slow(*physical));
            let (physical, required, queue_family) = found.ok_or("no fit Vulkan device presents to this window")?;

            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
            let extensions = [khr::swapchain::NAME.as_ptr()];
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
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
            let mut slots = Vec::new();
            for commands in device.allocate_command_buffers(&info)? {
                let signalled = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
                slots.push(Slot {
                    commands,
                    done: device.create_fence(&signalled, None)?,
                    acquired: device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None)?,
                    caption: Mapped::new(
                        (&instance, physical, &device),
                        4 * caption::SIZE[0] * caption::SIZE[1],
                        vk::BufferUsageFlags::TRANSFER_SRC,
                    )?,
                });
            }
            let swapchains = khr::swapchain::Device::new(&instance, &device);
            let mut engine = Engine {
                entry,
                instance,
                surfaces,
                surface,
                physical,
                ray_query: required.ray_query,
                device,
                queue,
                queue_family,
                pool,
                slots,
                turn: 0,
                lent: None,
                swapchains,
                swapchain: Swapchain {
                    raw: vk::SwapchainKHR::null(),
                    format: vk::SurfaceFormatKHR::default(),
                    size,
                    images: Vec::new(),
                    ready: Vec::new(),
                },
            };
            engine.resize(size)?;
            Ok(engine)
        }
    }

    /// The device for neubrdf.
    pub fn lend(&mut self) -> Outcome<Arc<Device>> {
        let mut host = HostDevice::new(
            self.entry.clone(),
            self.instance.clone(),
            self.physical,
            self.device.clone(),
            self.queue_family,
        );
        host.ray_query = self.ray_query;
        // SAFETY: the engine outlives what is made from the device, and made it with what `requirements` asked for.
        let lent = unsafe { Device::from_host(host) }?;
        self.lent = Some(lent.clone());
        Ok(lent)
    }

    /// Pixels across and down.
    pub fn size(&self) -> [u32; 2] {
        self.swapchain.size
    }

    /// Makes a swapchain for a window of that size.
    pub fn resize(&mut self, [width, height]: [u32; 2]) -> Outcome<()> {
        self.wait_idle();
        // SAFETY: the device is idle; the old swapchain is retired by the new one and then destroyed.
        unsafe {
            let can = self.surfaces.get_physical_device_surface_capabilities(self.physical, self.surface)?;
            let formats = self.surfaces.get_physical_device_surface_formats(self.physical, self.surface)?;
            let known = |format: &&vk::SurfaceFormatKHR| pixel_format(format.format).is_some();
            let format = *formats.iter().find(known).ok_or("the surface has no 8-bit format")?;
            let (least, most) = (can.min_image_extent, can.max_image_extent);
            let extent = vk::Extent2D {
                width: width.clamp(least.width, most.width),
                height: height.clamp(least.height, most.height),
            };
            let most_images = if can.max_image_count == 0 { u32::MAX } else { can.max_image_count };
            let info = vk::SwapchainCreateInfoKHR::default()
                .surface(self.surface)
                .min_image_count((can.min_image_count + 1).min(most_images))
                .image_format(format.format)
                .image_color_space(format.color_space)
                .image_extent(extent)
                .image_array_layers(1)
                .image_usage(vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::TRANSFER_SRC)
                .pre_transform(can.current_transform)
                .composite_alpha(vk::CompositeAlphaFlagsKHR::OPAQUE)
                .present_mode(vk::PresentModeKHR::FIFO)
                .clipped(true)
                .old_swapchain(self.swapchain.raw);
            let raw = self.swapchains.create_swapchain(&info, None)?;
            let images = self.swapchains.get_swapchain_images(raw)?;
            let semaphore = |_: &vk::Image| self.device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None);
            let ready = images.iter().map(semaphore).collect::<Result<_, _>>()?;
            let size = [extent.width, extent.height];
            let old = std::mem::replace(&mut self.swapchain, Swapchain { raw, format, size, images, ready });
            self.destroy_swapchain(&old);
        }
        Ok(())
    }

    /// Waits until the next slot's last frame is done, and returns the slot.
    pub fn wait_for_slot(&self) -> Outcome<usize> {
        // SAFETY: the fence is signalled from the beginning, or was submitted.
        unsafe { self.device.wait_for_fences(&[self.slots[self.turn].done], true, u64::MAX) }?;
        Ok(self.turn)
    }

    /// Lets neubrdf write the next image, writes words over it, and presents it. After [`Engine::wait_for_slot`].
    pub fn show(
        &mut self,
        words: &str,
        copies: bool,
        record: impl FnOnce(&mut Commands, HostImage, PixelFormat) -> Outcome<()>,
    ) -> Outcome<Shown> {
        let Slot { commands, done, acquired, .. } = self.slots[self.turn];
        let Some(lent) = &self.lent else { return Err("the device was not lent".into()) };
        let Some(format) = pixel_format(self.swapchain.format.format) else { return Err("no 8-bit format".into()) };
        // SAFETY: the slot is free; semaphores and fence are used in the order that Vulkan asks for.
        unsafe {
            let next = self.swapchains.acquire_next_image(self.swapchain.raw, u64::MAX, acquired, vk::Fence::null());
            let index = match next {
                Ok((index, _)) => index,
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => return Ok(Shown::Stale),
                Err(error) => return Err(error.into()),
            };
            let (image, ready) = (self.swapchain.images[index as usize], self.swapchain.ready[index as usize]);
            let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            self.device.begin_command_buffer(commands, &info)?;
            // The old texels may go; afterwards the words are copied over the picture.
            let [undefined, written] = [vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL];
            let target = HostImage::new(image, self.swapchain.size).with_layouts(undefined, written);
            let mut recording = Commands::wrap(lent, commands);
            record(&mut recording, target, format)?;
            recording.finish()?;
            self.write(commands, image, words);
            let copy = if copies { Some(self.copy(commands, image)?) } else { None };
            let before = if copies { vk::ImageLayout::TRANSFER_SRC_OPTIMAL } else { written };
            self.transition(commands, image, before, vk::ImageLayout::PRESENT_SRC_KHR);
            self.device.end_command_buffer(commands)?;

            self.device.reset_fences(&[done])?;
            let (buffers, waits, signals) = ([commands], [acquired], [ready]);
            // The image's transition waits for all commands, and so for the semaphore too.
            let stages = [vk::PipelineStageFlags::ALL_COMMANDS];
            let info = vk::SubmitInfo::default()
                .command_buffers(&buffers)
                .wait_semaphores(&waits)
                .wait_dst_stage_mask(&stages)
                .signal_semaphores(&signals);
            self.device.queue_submit(self.queue, &[info], done)?;
            let (swapchains, indices) = ([self.swapchain.raw], [index]);
            let info =
                vk::PresentInfoKHR::default().wait_semaphores(&signals).swapchains(&swapchains).image_indices(&indices);
            let presented = self.swapchains.queue_present(self.queue, &info);
            self.turn = (self.turn + 1) % IN_FLIGHT;
            if let Some(copy) = copy {
                self.device.wait_for_fences(&[done], true, u64::MAX)?;
                let pixels = copy.pixels(format == PixelFormat::Bgra8);
                copy.destroy(&self.device);
                return Ok(Shown::Copied(pixels));
            }
            match presented {
                Ok(_) => Ok(Shown::Presented),
                Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(Shown::Stale),
                Err(error) => Err(error.into()),
            }
        }
    }

    pub fn wait_idle(&self) {
        // SAFETY: the device is alive. One that is lost has nothing to wait for.
        let _ = unsafe { self.device.device_wait_idle() };
    }

    /// Copies words into the corner of an image in TRANSFER_DST_OPTIMAL, over what was copied there before.
    unsafe fn write(&self, commands: vk::CommandBuffer, image: vk::Image, words: &str) {
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        let caption = &self.slots[self.turn].caption;
        let pixels = caption::draw(words);
        let [width, height] = [0, 1].map(|i| self.swapchain.size[i].min(caption::SIZE[i] as u32));
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let region = vk::BufferImageCopy::default()
            .buffer_row_length(caption::SIZE[0] as u32)
            .image_subresource(layers)
            .image_extent(vk::Extent3D { width, height, depth: 1 });
        // SAFETY: the slot is free, its buffer as large as what is drawn, and the part of it that is copied lies in the image.
        unsafe {
            std::ptr::copy_nonoverlapping(pixels.as_ptr(), caption.bytes, pixels.len().min(caption.size));
            self.transition(commands, image, layout, layout);
            self.device.cmd_copy_buffer_to_image(commands, caption.buffer, image, layout, &[region]);
        }
    }

    /// Lets copies, the CPU's reads and the screen wait for copies to an image, which goes from one layout to another.
    unsafe fn transition(
        &self,
        commands: vk::CommandBuffer,
        image: vk::Image,
        old: vk::ImageLayout,
        new: vk::ImageLayout,
    ) {
        use vk::{AccessFlags as Access, PipelineStageFlags as Stage};
        let range =
            vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1);
        let of_image = vk::ImageMemoryBarrier::default()
            .src_access_mask(Access::TRANSFER_WRITE)
            .dst_access_mask(Access::TRANSFER_READ | Access::TRANSFER_WRITE)
            .old_layout(old)
            .new_layout(new)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image)
            .subresource_range(range);
        let to_cpu =
            vk::MemoryBarrier::default().src_access_mask(Access::TRANSFER_WRITE).dst_access_mask(Access::HOST_READ);
        let (from, to, none) = (Stage::TRANSFER, Stage::TRANSFER | Stage::HOST, vk::DependencyFlags::empty());
        // SAFETY: the command buffer is being recorded, the image is in the old layout.
        unsafe { self.device.cmd_pipeline_barrier(commands, from, to, none, &[to_cpu], &[], &[of_image]) };
    }

    /// Records a copy of an image in TRANSFER_DST_OPTIMAL, which is in TRANSFER_SRC_OPTIMAL afterwards.
    unsafe fn copy(&self, commands: vk::CommandBuffer, image: vk::Image) -> Outcome<Mapped> {
        let [width, height] = self.swapchain.size;
        let from = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let region = vk::BufferImageCopy::default().image_subresource(layers).image_extent(vk::Extent3D {
            width,
            height,
            depth: 1,
        });
        // SAFETY: the buffer holds the image.
        unsafe {
            let of = (&self.instance, self.physical, &self.device);
            let copy = Mapped::new(of, 4 * width as usize * height as usize, vk::BufferUsageFlags::TRANSFER_DST)?;
            self.transition(commands, image, vk::ImageLayout::TRANSFER_DST_OPTIMAL, from);
            self.device.cmd_copy_image_to_buffer(commands, image, from, copy.buffer, &[region]);
            Ok(copy)
        }
    }

    unsafe fn destroy_swapchain(&self, swapchain: &Swapchain) {
        // SAFETY: the device is idle.
        unsafe {
            swapchain.ready.iter().for_each(|semaphore| self.device.destroy_semaphore(*semaphore, None));
            self.swapchains.destroy_swapchain(swapchain.raw, None);
        }
    }
}

/// How neubrdf writes that format; bytes are sRGB-encoded either way.
fn pixel_format(format: vk::Format) -> Option<PixelFormat> {
    match format {
        vk::Format::B8G8R8A8_UNORM | vk::Format::B8G8R8A8_SRGB => Some(PixelFormat::Bgra8),
        vk::Format::R8G8B8A8_UNORM | vk::Format::R8G8B8A8_SRGB => Some(PixelFormat::Rgba8),
        _ => None,
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.wait_idle();
        self.lent = None;
        // SAFETY: the device is idle, and neubrdf has given it back.
        unsafe {
            self.destroy_swapchain(&self.swapchain);
            for slot in &self.slots {
                self.device.destroy_fence(slot.done, None);
                self.device.destroy_semaphore(slot.acquired, None);
                slot.caption.destroy(&self.device);
            }
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.surfaces.destroy_surface(self.surface, None);
            self.instance.destroy_instance(None);
        }
    }
}
