//! The path tracer in a host that owns instance, device, queue, command buffers and targets: nothing but recordings, the same
//! bits as `render::Renderer`, and nothing that synchronization validation has a word to say about.
#![allow(unsafe_code)] // the host here speaks Vulkan itself

mod changes;
#[path = "../common/mod.rs"]
mod common;
#[path = "../common/frames.rs"]
mod frames;
#[path = "../common/host.rs"]
mod host;
mod lifetimes;
mod mistakes;
mod targets;

use changes::orbit;
use frames::{alone, bits, expected, frame, options_of, picture_of, renderer, scene, submit, wait};
use glam::{Affine3A, Vec3};
use host::{Recording, in_every_host, in_lavapipe_hosts};
use neubrdf::gpu::{self, Commands, HostBuffer};
use neubrdf::plugin::{Change, Error, Frame, PixelFormat, Renderer, Target};
use neubrdf::render;
use neubrdf::scene::{Film, Scene};

#[test]
fn a_renderer_may_be_sent_to_another_thread() {
    fn sends<T: Send>() {}
    sends::<Renderer>();
    sends::<Error>();
}

#[test]
fn frames_are_the_bits_of_the_path_tracer_on_its_own() {
    in_every_host(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let mut alone = alone(host, &scene());
        // Any number of samples: the mean is rounded once.
        let mut total = 0;
        for samples in [1, 2, 1, 7] {
            total += samples;
            let (picture, status) = frame(host, &device, &mut renderer, samples);
            alone.render_pass(samples).unwrap();
            assert!(picture.iter().any(|pixel| pixel[0] != 0), "black");
            assert!(picture == picture_of(&alone), "{total} samples");
            assert_eq!((status.samples, status.rejected), (total, 0));
            assert_eq!(status.error, (total >= 4).then(|| alone.estimate_error().unwrap()));
        }
        // No more samples: the same picture again.
        let (picture, status) = frame(host, &device, &mut renderer, 0);
        assert!(picture == picture_of(&alone) && status.samples == total);
    });
}

/// Groups of pixels that share paths stay whole, whatever the film's size and however few paths there are.
#[test]
fn frames_that_share_paths_are_those_of_the_path_tracer_on_its_own() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut options = options_of(host);
        options.settings.path_reuse = true;
        let mut renderer = Renderer::new(&device, scene(), &options).unwrap();
        for [width, height] in [[40, 30], [17, 11], [90, 20]] {
            renderer.resize(width, height).unwrap();
            let scene = Scene { film: Film { width, height }, ..scene() };
            let alone = render::Options { traversal: options.traversal, pool_paths: None };
            let mut alone = render::Renderer::new(&host.lend_with_queue(), &scene, &options.settings, &alone).unwrap();
            alone.render_pass(5).unwrap();
            assert!(frame(host, &device, &mut renderer, 5).0 == picture_of(&alone), "{width}x{height}");
        }
    });
}

#[test]
fn two_renderers_share_a_command_buffer() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let scenes = [scene(), common::still_life(common::diffuse(0.7))];
        let mut renderers = scenes.clone().map(|scene| renderer(host, &device, scene));
        let buffers = scenes.each_ref().map(|scene| host.buffer(u64::from(scene.film.width * scene.film.height) * 16));
        let recording = host.begin();
        let mut commands = host.wrap(&device, &recording);
        for (renderer, buffer) in renderers.iter_mut().zip(&buffers) {
            let targets = [Target::buffer(buffer.target(), PixelFormat::Rgba32Float)];
            renderer.record(&mut commands, &Frame { samples: 2, targets: &targets, estimates_error: false }).unwrap();
        }
        commands.finish().unwrap();
        host.to_host(&recording);
        host.submit(&recording);
        host.wait(recording);
        for ((scene, buffer), renderer) in scenes.iter().zip(buffers).zip(&mut renderers) {
            assert!(bits(&buffer.read()) == expected(host, scene, 2));
            assert_eq!(renderer.complete(1).unwrap().error, None, "nobody asked");
            host.free_buffer(buffer);
        }
    });
}

#[test]
fn renderers_on_several_threads_share_a_device() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let scenes = [scene(), common::still_life(common::diffuse(0.3))];
        // A command pool is for one thread at a time: each has its own.
        let places = [0; 2].map(|_| (host.pool(), host.buffer(40 * 30 * 16)));
        let recordings = places.each_ref().map(|(pool, _)| host.begin_in(*pool));
        let renderers: Vec<Renderer> = std::thread::scope(|threads| {
            let record = |(scene, (recording, target)): (&Scene, (&Recording, HostBuffer))| {
                let (scene, commands, device) = (scene.clone(), recording.commands, &device);
                threads.spawn(move || {
                    let mut renderer = renderer(host, device, scene);
                    // SAFETY: the command buffer is being recorded, by this thread alone.
                    let mut commands = unsafe { Commands::wrap(device, commands) };
                    let targets = [Target::buffer(target, PixelFormat::Rgba32Float)];
                    renderer.record(&mut commands, &Frame::new(2, &targets)).unwrap();
                    commands.finish().unwrap();
                    renderer
                })
            };
            let targets = places.iter().map(|(_, buffer)| buffer.target());
            let threads: Vec<_> = scenes.iter().zip(recordings.iter().zip(targets)).map(record).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        for recording in &recordings {
            host.to_host(recording);
            host.submit(recording);
        }
        recordings.into_iter().for_each(|recording| host.wait(recording));
        drop(renderers);
        for (scene, (pool, buffer)) in scenes.iter().zip(places) {
            assert!(bits(&buffer.read()) == expected(host, scene, 2));
            host.free_buffer(buffer);
            host.free_pool(pool);
        }
    });
}

#[test]
fn frames_in_flight_see_the_camera_and_the_scene_they_were_recorded_with() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let changes = |renderer: &Renderer, index: u32| {
            let place = Affine3A::from_translation(Vec3::new(0.2 * index as f32, 0.0, 0.0));
            let mut material = renderer.scene().materials[0].clone();
            material.surface = common::diffuse(0.2 * index as f32);
            [
                orbit(renderer.scene(), 20.0),
                Change::Transform { instance: 1, object_to_world: place },
                Change::Material { index: 0, material },
            ]
        };
        let mut waiting = renderer(host, &device, scene());
        let mut flying = renderer(host, &device, scene());
        let mut in_flight = Vec::new();
        let mut pictures = Vec::new();
        for index in 0..3 {
            waiting.update(&changes(&waiting, index)).unwrap();
            flying.update(&changes(&flying, index)).unwrap();
            pictures.push(frame(host, &device, &mut waiting, 2).0);
            in_flight.push(submit(host, &device, &mut flying, 2));
        }
        assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2]);
        for (picture, frame) in pictures.into_iter().zip(in_flight) {
            assert!(wait(host, &mut flying, frame).0 == picture);
        }
    });
}

/// What was to be uploaded, of the scene and of what changed before and after, the next recording uploads.
#[test]
fn what_is_abandoned_the_next_recording_does() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let record_in_vain = |renderer: &mut Renderer| {
            let recording = host.begin();
            let mut commands = host.wrap(&device, &recording);
            let frame = Frame { samples: 2, targets: &[], estimates_error: false };
            let ticket = renderer.record(&mut commands, &frame).unwrap();
            commands.finish().unwrap();
            // SAFETY: it is not submitted.
            unsafe { host.forget(recording) };
            ticket
        };
        let mut now = scene();
        let mut renderer = renderer(host, &device, scene());
        assert_eq!([(); 2].map(|()| record_in_vain(&mut renderer)), [1, 2]);
        renderer.abandon(1).unwrap();
        assert!(renderer.samples() == 0 && renderer.complete(2).is_none());
        let (picture, _) = frame(host, &device, &mut renderer, 3);
        assert!(picture == expected(host, &now, 3), "the scene itself");

        // Behind a frame that is in flight, which stays.
        let flying = submit(host, &device, &mut renderer, 1);
        let ticket = record_in_vain(&mut renderer);
        assert_eq!(renderer.samples(), 6);
        renderer.abandon(ticket).unwrap();
        assert_eq!(renderer.samples(), 4);
        assert_eq!(wait(host, &mut renderer, flying).1.samples, 4);
        let continued = submit(host, &device, &mut renderer, 1);
        assert_eq!(continued.ticket, ticket);
        assert!(wait(host, &mut renderer, continued).0 == expected(host, &now, 5), "no sample twice, none left out");

        // A change before each recording, and one after.
        let [first, second, third] = ["moved lamp", "roughness", "one sphere more"].map(|name| {
            let (_, changes) = changes::changes().into_iter().find(|(what, _)| *what == name).unwrap();
            changes[0].clone()
        });
        let mut tickets = Vec::new();
        for change in [&first, &second] {
            renderer.update(std::slice::from_ref(change)).unwrap();
            tickets.push(record_in_vain(&mut renderer));
        }
        renderer.update(std::slice::from_ref(&third)).unwrap();
        renderer.abandon(tickets[0]).unwrap();
        for change in [&first, &second, &third] {
            changes::apply(&mut now, change);
        }
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &now, 2), "three changes");

        // A reset that the abandoned recording was to see.
        renderer.reset();
        let ticket = record_in_vain(&mut renderer);
        renderer.abandon(ticket).unwrap();
        assert!(frame(host, &device, &mut renderer, 1).0 == expected(host, &now, 1), "a black film");

        for wrong in [ticket, ticket + 1, 0] {
            let error = renderer.abandon(wrong).unwrap_err().to_string();
            assert_eq!(error, format!("recording {wrong} is not in flight: none is"));
        }
    });
}

/// The recordings' numbers are fit to be the values of a host's timelines: one that says which may begin, and one that says which
/// are done. All are submitted before the first may begin.
#[test]
fn timelines_of_the_host_s_order_frames_and_tell_which_are_done() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let [go, done] = [(); 2].map(|()| host.timeline());
        let buffer = host.buffer(40 * 30 * 16);
        let targets = [Target::buffer(buffer.target(), PixelFormat::Rgba32Float)];
        let mut recordings = Vec::new();
        for number in 1..=3 {
            let recording = host.begin();
            let mut commands = host.wrap(&device, &recording);
            assert_eq!(renderer.record(&mut commands, &Frame::new(2, &targets)).unwrap(), number);
            commands.finish().unwrap();
            host.to_host(&recording);
            host.submit_between(&recording, (go, number), (done, number));
            recordings.push(recording);
        }
        assert_eq!(host.reached(done), 0);
        for number in 1..=3 {
            host.signal(go, number);
            while host.reached(done) < number {
                std::thread::yield_now();
            }
            let status = renderer.complete(host.reached(done)).unwrap();
            assert_eq!(u64::from(status.samples), 2 * number);
        }
        recordings.into_iter().for_each(|recording| host.wait(recording));
        assert!(bits(&buffer.read()) == expected(host, &scene(), 6));
        host.free_buffer(buffer);
        [go, done].into_iter().for_each(|timeline| host.free_timeline(timeline));
    });
}

#[test]
fn a_reset_begins_with_a_black_film() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let first = frame(host, &device, &mut renderer, 2);
        let second = frame(host, &device, &mut renderer, 2);
        assert!(first.0 != second.0);
        renderer.reset();
        assert_eq!(renderer.samples(), 0);
        assert!(frame(host, &device, &mut renderer, 2).0 == first.0);
        assert!(frame(host, &device, &mut renderer, 2) == second);
    });
}

#[test]
fn a_resized_film_is_that_of_a_renderer_of_its_size() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        frame(host, &device, &mut renderer, 1);
        for [width, height] in [[64, 48], [17, 11]] {
            renderer.resize(width, height).unwrap();
            assert_eq!(renderer.size(), [width, height]);
            let resized = Scene { film: Film { width, height }, ..scene() };
            assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &resized, 2));
        }
    });
}

#[test]
fn an_upload_takes_place_where_the_host_records_it() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let upload = host.run_commands(&device, |commands| renderer.record_upload(commands).unwrap());
        assert_eq!(renderer.complete(upload), None);
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &scene(), 2));
    });
}

#[test]
fn what_a_lost_device_was_at_can_be_told() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let last_pass = |renderer: &Renderer| match renderer.device_lost() {
            gpu::Error::DeviceLost { last_pass, .. } => last_pass,
            other => panic!("{other}"),
        };
        assert_eq!(last_pass(&renderer), None);
        let recording = host.begin();
        let mut commands = host.wrap(&device, &recording);
        let frame = Frame { samples: 1, targets: &[], estimates_error: false };
        let ticket = renderer.record(&mut commands, &frame).unwrap();
        commands.finish().unwrap();
        assert_eq!(last_pass(&renderer).as_deref(), Some("nothing yet of recording 1"));
        host.submit(&recording);
        host.wait(recording);
        assert_eq!(last_pass(&renderer), None, "it came to the end");
        renderer.complete(ticket);
    });
}
