//! The path tracer in an application on wgpu: it records into wgpu's device, and its picture is a wgpu texture.
//!
//!     cargo run --example wgpu_host -- scenes/cornell/scene.toml cornell.png
//!
//! What matters is in [`open`], which makes a device that both can use, and in [`App::frame`].
#![allow(unsafe_code)] // handles go from wgpu to us

use std::future::Future;
use std::iter;
use std::path::Path;
use std::pin::pin;
use std::sync::Arc;
use std::task::{Context as TaskContext, Poll, Waker};

use anyhow::{Context, Result, anyhow, bail};
use neubrdf::gpu::{Additions, Commands, Device, HostDevice, HostImage, requirements};
use neubrdf::plugin::{Frame, Options, PixelFormat, Renderer, Status, Target};
use neubrdf::scene::Scene;
use wgpu::hal::api::Vulkan;
use wgpu::{
    CommandEncoderDescriptor, DeviceDescriptor, Extent3d, PollType, TextureDescriptor, TextureFormat, TextureUsages,
    TextureUses,
};

/// A wgpu device on which the path tracer can work too, and the same device as the path tracer borrows it.
pub struct Opened {
    /// As the path tracer has it. Dropped first: it borrows the others.
    pub lent: Arc<Device>,
    /// Of the same device.
    pub queue: wgpu::Queue,
    /// As wgpu has it.
    pub device: wgpu::Device,
}

/// Opens the first adapter whose name contains `name` and that is fit. wgpu has no way to ask for our features by name, so the
/// Vulkan device is made here, with what wgpu wants and what we want, and given to wgpu, which then owns it.
pub fn open(instance: &wgpu::Instance, name: &str) -> Result<Opened> {
    let mut unfit = Vec::new();
    for adapter in now(instance.enumerate_adapters(wgpu::Backends::VULKAN)) {
        let found = adapter.get_info().name;
        if !found.contains(name) {
            continue;
        }
        // SAFETY: the adapter is alive, and nothing of it is destroyed.
        let hal = unsafe { adapter.as_hal::<Vulkan>() }.context("the adapter is not on Vulkan")?;
        let shared = hal.shared_instance();
        let physical = hal.raw_physical_device();
        // SAFETY: the physical device is of this instance, which wgpu makes for the latest version that the loader knows.
        let wanted = unsafe { requirements(shared.raw_instance(), physical) };
        if !wanted.missing.is_empty() {
            unfit.push(format!("{found} lacks {}", wanted.missing.join(", ")));
            continue;
        }
        let descriptor = DeviceDescriptor::default();
        let features = descriptor.required_features;
        let mut extensions = hal.required_device_extensions(features);
        let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
        let mut of_wgpu = hal.physical_device_features(&extensions, features);
        let queue_family = 0; // as wgpu has it
        let queues =
            [ash::vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&[1.0])];
        let info = ash::vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&names);
        let info = of_wgpu.add_to_device_create(info);
        let mut room = Additions::default();
        // SAFETY: the chain is wgpu's, made by `push_next`. The physical device has all that is enabled. wgpu gets the device with
        // the extensions, the features and the queue that it was made with, and destroys it.
        let (device, queue) = unsafe {
            let info = wanted.merge(info, &mut room);
            let raw = shared.raw_instance().create_device(physical, &info, None)?;
            extensions.extend(wanted.extensions());
            let (limits, hints) = (&descriptor.required_limits, &descriptor.memory_hints);
            let hal_device = hal.device_from_raw(raw, None, &extensions, features, limits, hints, queue_family, 0)?;
            adapter.create_device_from_hal(hal_device, &descriptor)?
        };
        // SAFETY: the device is alive.
        let raw = unsafe { device.as_hal::<Vulkan>() }.context("the device is not on Vulkan")?.raw_device().clone();
        let host = HostDevice {
            ray_query: wanted.ray_query,
            ..HostDevice::new(shared.entry().clone(), shared.raw_instance().clone(), physical, raw, queue_family)
        };
        // SAFETY: the handles belong together; `Opened` drops what borrows them before wgpu's device.
        let lent = unsafe { Device::from_host(host) }?;
        return Ok(Opened { lent, queue, device });
    }
    match unfit.is_empty() {
        true => bail!("wgpu finds no Vulkan device named like '{name}'"),
        false => bail!("no fit device: {}", unfit.join("; ")),
    }
}

/// A scene that is rendered into two textures.
pub struct App {
    // In this order: the renderer borrows the device.
    renderer: Renderer,
    /// Linear radiance, `Rgba32Float`.
    pub linear: wgpu::Texture,
    /// To look at, `Rgba8Unorm`: sRGB-encoded.
    pub shown: wgpu::Texture,
    opened: Opened,
}

impl App {
    /// Prepares the render, and makes the textures.
    pub fn new(opened: Opened, scene: Scene, options: &Options) -> Result<App> {
        let renderer = Renderer::new(&opened.lent, scene, options)?;
        let [width, height] = renderer.size();
        let size = Extent3d { width, height, depth_or_array_layers: 1 };
        let texture = |label, format: TextureFormat| {
            let texture = opened.device.create_texture(&TextureDescriptor {
                label: Some(label),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: TextureUsages::COPY_DST | TextureUsages::COPY_SRC | TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            // What wgpu has not seen written it clears before it is read: let it see that now.
            let row = width * format.block_copy_size(None).unwrap_or(16);
            let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
            opened.queue.write_texture(texture.as_image_copy(), &vec![0; (row * height) as usize], layout, size);
            texture
        };
        let (linear, shown) =
            (texture("linear", TextureFormat::Rgba32Float), texture("shown", TextureFormat::Rgba8Unorm));
        Ok(App { renderer, linear, shown, opened })
    }

    /// Takes more samples of every pixel, and brings the picture into the textures. Returns the recording's number.
    pub fn frame(&mut self, samples: u32) -> Result<u64> {
        let App { renderer, linear, shown, opened: Opened { lent, queue, device } } = self;
        // wgpu brings the textures into the layout in which we write them, and believes them to be in it afterwards, as they are.
        let mut before = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("transitions") });
        let transition = |texture| wgpu::TextureTransition { texture, selector: None, state: TextureUses::COPY_DST };
        before.transition_resources(iter::empty(), [&*linear, &*shown].into_iter().map(transition));
        let target = |texture: &wgpu::Texture, format| {
            let size = [texture.width(), texture.height()];
            // SAFETY: the texture lives as long as this app, and is of this size and format, for copies to it, in their layout.
            let raw = unsafe { texture.as_hal::<Vulkan>().map(|texture| HostImage::new(texture.raw_handle(), size)) };
            raw.map(|image| Target::image(image, format)).context("the texture is not on Vulkan")
        };
        let targets = [target(linear, PixelFormat::Rgba32Float)?, target(shown, PixelFormat::Rgba8)?];
        // An encoder of our own: wgpu records nothing else into it.
        let mut ours = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("path tracer") });
        // SAFETY: the command buffer is being recorded, on the queue of the family that we were told, and submitted once below.
        let ticket = unsafe {
            ours.as_hal_mut::<Vulkan, _, _>(|encoder| {
                let encoder = encoder.context("the encoder is not on Vulkan")?;
                let mut commands = Commands::wrap(lent, encoder.raw_handle());
                let ticket = renderer.record(&mut commands, &Frame::new(samples, &targets))?;
                commands.finish()?;
                anyhow::Ok(ticket)
            })
        }?;
        queue.submit([before.finish(), ours.finish()]);
        Ok(ticket)
    }

    /// Waits for a frame: what it left.
    pub fn wait(&mut self, ticket: u64) -> Result<Status> {
        self.opened.device.poll(PollType::wait_indefinitely())?;
        self.renderer.complete(ticket).ok_or_else(|| anyhow!("recording {ticket} left nothing"))
    }

    /// A texture's bytes, row by row, by wgpu's own copy.
    pub fn read(&self, texture: &wgpu::Texture) -> Result<Vec<u8>> {
        let Opened { queue, device, .. } = &self.opened;
        let size = texture.size();
        let row = size.width * texture.format().block_copy_size(None).context("a format of many planes")?;
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read"),
            size: u64::from(padded) * u64::from(size.height),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("read") });
        let destination = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), destination, size);
        queue.submit([encoder.finish()]);
        buffer.map_async(wgpu::MapMode::Read, .., |_| {});
        device.poll(PollType::wait_indefinitely())?;
        let bytes = buffer.get_mapped_range(..)?;
        Ok(bytes.chunks(padded as usize).flat_map(|padded| &padded[..row as usize]).copied().collect())
    }
}

/// What a future of wgpu comes to: outside browsers it is there at once.
fn now<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut TaskContext::from_waker(Waker::noop())) {
            return value;
        }
    }
}

#[allow(dead_code)] // the test has another
fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, png] = &arguments[..] else { bail!("say wgpu_host SCENE.toml PICTURE.png") };
    let (scene, _) = Scene::load(Path::new(scene))?;
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let mut app = App::new(open(&instance, "")?, scene, &Options::default())?;
    for _ in 0..16 {
        let ticket = app.frame(4)?;
        let status = app.wait(ticket)?;
        println!("{} samples, estimated error {:?}", status.samples, status.error);
    }
    let size = app.shown.size();
    let picture = image::RgbaImage::from_raw(size.width, size.height, app.read(&app.shown)?);
    picture.context("a picture of another size")?.save(png)?;
    Ok(())
}
