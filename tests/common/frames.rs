//! Frames of `plugin::Renderer` in a test's host, and the pictures that they are compared with.
#![allow(dead_code)] // each test file uses a part of it

use std::sync::Arc;

use neubrdf::gpu::Device;
use neubrdf::plugin::{Frame, Options, PixelFormat, Renderer, Status, Target};
use neubrdf::render::{self, Settings, Traversal};
use neubrdf::scene::Scene;

use crate::common;
use crate::host::{Host, HostMemory, Recording};

/// Four bytes of a float a channel, RGBA.
pub type Bits = Vec<[u32; 4]>;

pub fn options() -> Options {
    let settings = Settings { max_depth: 4, seed: 7, features: false, ..Settings::default() };
    Options { settings, pool_paths: Some(2000), ..Options::default() }
}

/// Ray query where the host has it: the plugin's own choice is the BVH on CPU drivers.
pub fn options_of(host: &Host) -> Options {
    let traversal = if host.ray_query { Traversal::RayQuery } else { Traversal::Bvh };
    Options { traversal: Some(traversal), ..options() }
}

pub fn scene() -> Scene {
    common::still_life(common::conductor(0.8, 0.3))
}

pub fn renderer(host: &Host, device: &Arc<Device>, scene: Scene) -> Renderer {
    Renderer::new(device, scene, &options_of(host)).unwrap()
}

pub fn bits(bytes: &[u8]) -> Bits {
    let words: Vec<u32> = bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
    words.as_chunks().0.to_vec()
}

/// A frame that was submitted, with the buffer that it is written to in linear floats.
pub struct InFlight {
    recording: Recording,
    buffer: HostMemory,
    pub ticket: u64,
}

/// Records a frame into a command buffer of its own, and submits it.
pub fn submit(host: &Host, device: &Arc<Device>, renderer: &mut Renderer, samples: u32) -> InFlight {
    submit_after(host, device, renderer, samples, |_| ())
}

/// The same after commands of the host's own.
pub fn submit_after(
    host: &Host,
    device: &Arc<Device>,
    renderer: &mut Renderer,
    samples: u32,
    before: impl FnOnce(&Recording),
) -> InFlight {
    let [width, height] = renderer.size();
    let buffer = host.buffer(u64::from(width) * u64::from(height) * 16);
    let recording = host.begin();
    before(&recording);
    let mut commands = host.wrap(device, &recording);
    let targets = [Target::buffer(buffer.target(), PixelFormat::Rgba32Float)];
    let ticket = renderer.record(&mut commands, &Frame { samples, targets: &targets, estimates_error: true }).unwrap();
    commands.finish().unwrap();
    host.to_host(&recording);
    host.submit(&recording);
    InFlight { recording, buffer, ticket }
}

/// Waits for a frame: its picture, and what it left.
pub fn wait(host: &Host, renderer: &mut Renderer, frame: InFlight) -> (Bits, Status) {
    host.wait(frame.recording);
    let status = renderer.complete(frame.ticket).unwrap();
    let picture = bits(&frame.buffer.read());
    host.free_buffer(frame.buffer);
    (picture, status)
}

pub fn frame(host: &Host, device: &Arc<Device>, renderer: &mut Renderer, samples: u32) -> (Bits, Status) {
    let submitted = submit(host, device, renderer, samples);
    wait(host, renderer, submitted)
}

/// The path tracer on its own, on the same device.
pub fn alone(host: &Host, scene: &Scene) -> render::Renderer {
    let Options { settings, traversal, pool_paths, .. } = options_of(host);
    let choices = render::Options { traversal, pool_paths };
    render::Renderer::new(&host.lend_with_queue(), scene, &settings, &choices).unwrap()
}

pub fn picture_of(renderer: &render::Renderer) -> Bits {
    let one = 1f32.to_bits();
    common::bits(&renderer.picture().unwrap().0).into_iter().map(|[r, g, b]| [r, g, b, one]).collect()
}

/// What the path tracer on its own makes of a scene.
pub fn expected(host: &Host, scene: &Scene, samples: u32) -> Bits {
    let mut renderer = alone(host, scene);
    renderer.render_pass(samples).unwrap();
    picture_of(&renderer)
}
