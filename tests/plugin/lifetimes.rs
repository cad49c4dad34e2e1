//! That nothing is left behind, however long it goes on.

use std::sync::Arc;

use neubrdf::plugin::{Change, Channel, Frame, PixelFormat, Renderer, Target};
use neubrdf::scene::{Film, Scene};

use crate::changes::{apply, changes, orbit};
use crate::frames::{bits, expected, frame, options_of, renderer, scene, submit, wait};
use crate::host::in_lavapipe_hosts;

/// With the host's allocator, whose book tells whether anything is left.
#[test]
fn memory_of_the_host_s_allocator_is_given_back() {
    in_lavapipe_hosts(|host| {
        let allocator = host.allocator();
        let allocated = || allocator.lock().unwrap().generate_report().total_allocated_bytes;
        let device = host.lend_with_allocator(&allocator);
        let mut renderer = renderer(host, &device, scene());
        let prepared = allocated();
        assert!(prepared > 0);
        frame(host, &device, &mut renderer, 2);
        assert!(allocated() < prepared, "the staging memory is given back once the upload is done");
        let steady = allocated();
        for round in 0..5 {
            renderer.update(&[orbit(&scene(), 10.0 * round as f32), changes()[1].1[0].clone()]).unwrap();
            frame(host, &device, &mut renderer, 1);
            assert_eq!(allocated(), steady, "a change of this size takes no memory");
        }
        drop(renderer);
        drop(device);
        assert_eq!(allocated(), 0);
        assert!(allocator.lock().unwrap().generate_report().allocations.is_empty());
    });
}

/// A window that begins as a pixel has no use for many paths. Once it is larger it has as many as one that was so from the beginning, for
/// which the memory that both take is the sign; and its frames are the same, with one of the pixel's still on its way.
#[test]
fn a_film_that_began_small_has_the_paths_of_one_that_did_not() {
    in_lavapipe_hosts(|host| {
        let mut options = options_of(host);
        options.settings.features = true;
        let grown_from = |film: Film| {
            let allocator = host.allocator();
            let device = host.lend_with_allocator(&allocator);
            let mut renderer = Renderer::new(&device, Scene { film, ..scene() }, &options).unwrap();
            let before = submit(host, &device, &mut renderer, 1);
            renderer.resize(40, 30).unwrap();
            let after = submit(host, &device, &mut renderer, 2);
            wait(host, &mut renderer, before);
            let (beauty, _) = wait(host, &mut renderer, after);
            let buffer = host.buffer(40 * 30 * 16);
            let albedo =
                Target { channel: Channel::Albedo, ..Target::buffer(buffer.target(), PixelFormat::Rgba32Float) };
            let record = |commands: &mut _| renderer.record(commands, &Frame::new(0, &[albedo])).unwrap();
            let ticket = host.run_commands(&device, record);
            renderer.complete(ticket);
            let albedo = bits(&buffer.read());
            host.free_buffer(buffer);
            (allocator.lock().unwrap().generate_report().total_allocated_bytes, beauty, albedo)
        };
        let [small, large] = [Film { width: 1, height: 1 }, scene().film].map(grown_from);
        // But for what the allocator puts between.
        assert!(small.0.abs_diff(large.0) < large.0 / 100, "{} bytes, not {}", small.0, large.0);
        assert!(small.1 == expected(host, &scene(), 2) && small.1 == large.1 && small.2 == large.2);
    });
}

/// How often, unless the environment says otherwise. CI runs the short form; what the long ones gave stands in
/// docs/embedding.md, with the command.
fn rounds(variable: &str, short: u32) -> u32 {
    std::env::var(variable).ok().map_or(short, |text| text.parse().unwrap())
}

/// Bytes of this process in memory.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/statm").unwrap();
    status.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 4096
}

/// `NEUBRDF_ROUNDS=1000 cargo test --features embree --test plugin rounds -- --nocapture`
#[test]
fn rounds_of_making_and_dropping_leave_nothing() {
    in_lavapipe_hosts(|host| {
        let rounds = rounds("NEUBRDF_ROUNDS", 4);
        let warm = rounds.div_ceil(10);
        let mut before = 0;
        for round in 0..rounds {
            if round == warm {
                before = resident();
            }
            let device = host.lend();
            let mut renderer = renderer(host, &device, scene());
            let [(_, camera), (_, moved), ..] = &changes()[..] else { panic!() };
            frame(host, &device, &mut renderer, 1);
            renderer.update(&[camera[0].clone(), moved[0].clone()]).unwrap();
            // Dropped with an upload that is pending, every other time.
            if round % 2 == 0 {
                frame(host, &device, &mut renderer, 1);
            }
            drop(renderer);
            assert_eq!(Arc::strong_count(&device), 1);
        }
        let grown = resident().saturating_sub(before) / (1 << 20);
        eprintln!("{rounds} rounds, {grown} MiB more after the first {warm}");
        assert!(rounds < 100 || grown < 64, "{grown} MiB");
    });
}

/// `NEUBRDF_FRAMES=10000 cargo test --features embree --test plugin soak -- --nocapture`
#[test]
fn a_soak_of_frames_with_changes_ends_with_the_right_picture() {
    in_lavapipe_hosts(|host| {
        let frames = rounds("NEUBRDF_FRAMES", 40);
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let mut in_flight = std::collections::VecDeque::new();
        let changes: Vec<Vec<Change>> = changes().into_iter().map(|(_, changes)| changes).collect();
        let (mut now, mut taken, mut before) = (scene(), 0, 0);
        for index in 0..frames {
            // Three frames of samples, then a change; now and then another size or a reset.
            if index % 4 == 3 {
                let changes = &changes[index as usize / 4 % changes.len()];
                changes.iter().for_each(|change| apply(&mut now, change));
                renderer.update(changes).unwrap();
                taken = 0;
            }
            if index % 50 == 25 {
                let film = if now.film.width == 40 { Film { width: 33, height: 31 } } else { scene().film };
                renderer.resize(film.width, film.height).unwrap();
                (now.film, taken) = (film, 0);
            }
            if in_flight.len() == 3 {
                wait(host, &mut renderer, in_flight.pop_front().unwrap());
            }
            in_flight.push_back(submit(host, &device, &mut renderer, 1));
            taken += 1;
            if index == frames / 10 {
                before = resident();
            }
            if index % 1000 == 999 {
                eprintln!("{} frames, {} MiB", index + 1, resident() / (1 << 20));
            }
        }
        let mut last = None;
        while let Some(frame) = in_flight.pop_front() {
            last = Some(wait(host, &mut renderer, frame));
        }
        let grown = resident().saturating_sub(before) / (1 << 20);
        eprintln!("{frames} frames, {grown} MiB more after the first tenth");
        assert!(frames < 1000 || grown < 64, "{grown} MiB");
        let (picture, status) = last.unwrap();
        assert_eq!(status.samples, taken);
        assert!(picture == expected(host, &now, taken));
    });
}
