//! What frames are written to.

use ash::vk;
use neubrdf::gpu::HostImage;
use neubrdf::image::{Samples, plane, tone_map};
use neubrdf::plugin::{Channel, Frame, Options, PixelFormat, Renderer, Target};
use neubrdf::render::{self};
use neubrdf::scene::glam::Vec3;
use neubrdf::scene::{Environment, Film};

use crate::common;
use crate::frames::{Bits, bits, expected, frame, options_of, renderer, scene};
use crate::host::{HostMemory, in_lavapipe_hosts};

#[test]
fn images_and_buffers_of_all_formats_hold_the_same_picture() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let size = renderer.size();
        let pixels = u64::from(size[0] * size[1]);
        let kinds = [
            (PixelFormat::Rgba32Float, vk::Format::R32G32B32A32_SFLOAT),
            (PixelFormat::Rgba16Float, vk::Format::R16G16B16A16_SFLOAT),
            (PixelFormat::Rgba8, vk::Format::R8G8B8A8_UNORM),
            (PixelFormat::Bgra8, vk::Format::B8G8R8A8_UNORM),
        ];
        let images = kinds.map(|(_, format)| host.image(size, format));
        let buffers = kinds.map(|(format, _)| host.buffer(pixels * u64::from(format.bytes())));
        let mut targets = Vec::new();
        for ((format, _), (image, buffer)) in kinds.iter().zip(images.iter().zip(&buffers)) {
            targets.push(Target { exposure: 1.0, ..Target::image(image.target(), *format) });
            targets.push(Target { exposure: 1.0, ..Target::buffer(buffer.target(), *format) });
        }
        let recording = host.begin();
        let mut commands = host.wrap(&device, &recording);
        renderer.record(&mut commands, &Frame { samples: 4, targets: &targets, estimates_error: false }).unwrap();
        commands.finish().unwrap();
        host.to_host(&recording);
        host.submit(&recording);
        host.wait(recording);
        let [linear, half, rgba, bgra] = buffers.each_ref().map(HostMemory::read);
        for (((format, _), image), bytes) in kinds.iter().zip(&images).zip([&linear, &half, &rgba, &bgra]) {
            assert!(host.read_image(image, format.bytes().into()) == *bytes, "{format:?}");
        }

        let linear: Vec<[f32; 4]> = bits(&linear).into_iter().map(|pixel| pixel.map(f32::from_bits)).collect();
        let halves: Vec<f32> = half.as_chunks().0.iter().map(|h| half::f16::from_le_bytes(*h).to_f32()).collect();
        for (exact, rounded) in linear.as_flattened().iter().zip(halves) {
            // No rule says how a driver rounds.
            assert!((exact - rounded).abs() <= exact.abs() * 2f32.powi(-10), "{exact} became {rounded}");
        }
        let rgb: Vec<[f32; 3]> = linear.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
        let shown = tone_map::to_srgb8(&rgb, 1.0);
        for ((pixel, swapped), exact) in rgba.chunks(4).zip(bgra.chunks(4)).zip(shown.chunks(3)) {
            assert_eq!([pixel[0], pixel[1], pixel[2], 255], [swapped[2], swapped[1], swapped[0], swapped[3]]);
            assert!(pixel.iter().zip(exact).all(|(a, b)| a.abs_diff(*b) <= 1), "{pixel:?}, not {exact:?}");
        }
        images.into_iter().for_each(|image| host.free_image(image));
        buffers.into_iter().for_each(|buffer| host.free_buffer(buffer));
        renderer.complete(1);
    });
}

#[test]
fn an_image_may_stay_in_the_host_s_layout() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let image = host.image([100, 60], vk::Format::R32G32B32A32_SFLOAT);
        let recording = host.begin();
        host.transition(&recording, &image, vk::ImageLayout::UNDEFINED, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
        let mut commands = host.wrap(&device, &recording);
        // SAFETY: the image is in the layout, made for copies, and freed below.
        let place = unsafe { HostImage::new(image.raw, image.size) };
        let targets = [[0, 0], [60, 30]].map(|o| Target::image(place.with_origin(o), PixelFormat::Rgba32Float));
        renderer.record(&mut commands, &Frame { samples: 2, targets: &targets[..1], estimates_error: false }).unwrap();
        // Writes of the host's own choice of order: two copies to one image need a barrier between them, and have it.
        renderer.record(&mut commands, &Frame { samples: 0, targets: &targets[1..], estimates_error: false }).unwrap();
        commands.finish().unwrap();
        let read = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        host.transition(&recording, &image, vk::ImageLayout::TRANSFER_DST_OPTIMAL, read);
        host.submit(&recording);
        host.wait(recording);
        let texels = bits(&host.read_image(&image, 16));
        let row = |x: usize, y: usize| texels[y * 100 + x..y * 100 + x + 40].to_vec();
        let picture = expected(host, &scene(), 2);
        for (y, expected) in picture.chunks(40).enumerate() {
            assert!(row(0, y) == expected && row(60, 30 + y) == expected);
        }
        host.free_image(image);
    });
}

#[test]
fn feature_channels_are_those_of_the_path_tracer_on_its_own() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut options = options_of(host);
        options.settings.features = true;
        let mut renderer = Renderer::new(&device, scene(), &options).unwrap();
        let Options { settings, traversal, pool_paths, .. } = options;
        let choices = render::Options { traversal, pool_paths };
        let picture = common::render(&host.lend_with_queue(), &scene(), &settings, &choices, 3);
        let buffers = [0; 3].map(|_| host.buffer(40 * 30 * 16));
        let channels = [Channel::Albedo, Channel::Normal, Channel::Depth];
        let targets: Vec<Target> = channels
            .into_iter()
            .zip(&buffers)
            .map(|(channel, buffer)| Target { channel, ..Target::buffer(buffer.target(), PixelFormat::Rgba32Float) })
            .collect();
        // In frames of one sample: the means do not depend on it. A reset finds depth and ids again.
        renderer.reset();
        for samples in [1, 2] {
            let recording = host.begin();
            let mut commands = host.wrap(&device, &recording);
            renderer.record(&mut commands, &Frame { samples, targets: &targets, estimates_error: false }).unwrap();
            commands.finish().unwrap();
            host.to_host(&recording);
            host.submit(&recording);
            host.wait(recording);
        }
        let [albedo, normal, depth] = buffers.each_ref().map(|buffer| bits(&buffer.read()));
        let of = |plane| picture.rgb(plane).unwrap().iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
        let rgb = |bits: &Bits| bits.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect::<Vec<_>>();
        assert!(rgb(&albedo) == of(plane::ALBEDO));
        assert!(rgb(&normal) == of(plane::NORMAL));
        let depths = picture.planes().find_map(|(name, samples)| (name == plane::DEPTH).then_some(samples));
        let Some(Samples::F32(depths)) = depths else { panic!("no depth") };
        assert!(depth.iter().map(|pixel| pixel[0]).eq(depths.iter().map(|depth| depth.to_bits())));
        buffers.into_iter().for_each(|buffer| host.free_buffer(buffer));
    });
}

/// More pixels than a dispatch of one thread each may have on many devices (65,535 workgroups).
#[test]
fn a_large_film_is_developed_to_its_last_pixel() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut options = options_of(host);
        options.settings.max_depth = 1;
        options.pool_paths = None;
        let mut scene = scene();
        scene.film = Film { width: 2200, height: 2000 };
        scene.environment = Some(Environment::constant(Vec3::ONE));
        // Nothing but sky.
        scene.camera.target = 2.0 * scene.camera.eye - scene.camera.target;
        let mut renderer = Renderer::new(&device, scene, &options).unwrap();
        let picture = frame(host, &device, &mut renderer, 1).0;
        let first = picture[0].map(f32::from_bits);
        assert_eq!(picture.len(), 2200 * 2000);
        assert!(first[0] > 0.9 && picture.iter().all(|pixel| pixel.map(f32::from_bits) == first), "{first:?}");
    });
}
