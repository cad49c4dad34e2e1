//! The path tracer in a host that owns instance, device, queue, command buffers and targets: nothing but recordings, the same
//! bits as `render::Renderer`, and nothing that synchronization validation has a word to say about.
#![allow(unsafe_code)] // the host here speaks Vulkan itself

mod common;
#[path = "common/host.rs"]
mod host;

use std::sync::Arc;

use ash::vk;
use glam::{Affine3A, Vec3};
use host::{Host, in_every_host};
use neubrdf::gpu::Device;
use neubrdf::plugin::{Change, Error, Frame, Options, PixelFormat, Renderer, Status, Target};
use neubrdf::render::{self, Settings, Traversal};
use neubrdf::scene::Scene;

/// Four bytes of a float a channel, RGBA.
type Bits = Vec<[u32; 4]>;

fn options() -> Options {
    let settings = Settings { max_depth: 4, seed: 7, features: false, ..Settings::default() };
    Options { settings, pool_paths: Some(2000), ..Options::default() }
}

/// Ray query where the host has it: the plugin's own choice is the BVH on CPU drivers.
fn options_of(host: &Host) -> Options {
    let traversal = if host.ray_query { Traversal::RayQuery } else { Traversal::Bvh };
    Options { traversal: Some(traversal), ..options() }
}

fn scene() -> Scene {
    common::still_life(common::conductor(0.8, 0.3))
}

fn renderer(host: &Host, device: &Arc<Device>, scene: Scene) -> Renderer {
    Renderer::new(device, scene, &options_of(host)).unwrap()
}

fn bits(bytes: &[u8]) -> Bits {
    let words: Vec<u32> = bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
    words.as_chunks().0.to_vec()
}

/// One frame with these samples, submitted and waited for: its picture in linear floats, and its status.
fn frame(host: &Host, device: &Arc<Device>, renderer: &mut Renderer, samples: u32) -> (Bits, Status) {
    let [width, height] = renderer.size();
    let buffer = host.buffer(u64::from(width) * u64::from(height) * 16);
    let recording = host.begin();
    let mut commands = host.wrap(device, &recording);
    let targets = [Target::buffer(buffer.target(), PixelFormat::Rgba32Float)];
    let ticket = renderer.record(&mut commands, &Frame { samples, targets: &targets, estimates_error: true }).unwrap();
    commands.finish().unwrap();
    host.to_host(&recording);
    host.submit(&recording);
    host.wait(recording);
    let status = renderer.complete(ticket).unwrap();
    let picture = bits(&buffer.read());
    host.free_buffer(buffer);
    (picture, status)
}

/// What `render::Renderer` makes of the scene on the same device, in as many passes.
fn alone(host: &Host, scene: &Scene, passes: &[u32]) -> (Bits, f64) {
    let Options { settings, traversal, pool_paths, .. } = options_of(host);
    let device = host.lend_with_queue();
    let choices = render::Options { traversal, pool_paths };
    let mut renderer = render::Renderer::new(&device, scene, &settings, &choices).unwrap();
    passes.iter().for_each(|samples| renderer.render_pass(*samples).unwrap());
    let one = 1f32.to_bits();
    let picture = common::bits(&renderer.picture().unwrap().0).into_iter().map(|[r, g, b]| [r, g, b, one]).collect();
    (picture, renderer.estimate_error().unwrap())
}

#[test]
fn frames_are_the_bits_of_the_path_tracer_on_its_own() {
    in_every_host(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        // Any number of samples: the mean is rounded once.
        for (total, passes) in [(1, &[1][..]), (3, &[1, 2]), (4, &[1, 2, 1]), (11, &[1, 2, 1, 7])] {
            let (picture, status) = frame(host, &device, &mut renderer, *passes.last().unwrap());
            let (expected, error) = alone(host, &scene(), passes);
            assert!(picture.iter().any(|pixel| pixel[0] != 0), "black");
            assert!(picture == expected, "{total} samples");
            assert_eq!((status.samples, status.rejected), (total, 0));
            assert_eq!(status.error, (total >= 4).then_some(error));
        }
    });
}
