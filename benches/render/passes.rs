//! Where the time of a pass goes, kernel by kernel.

use std::time::Instant;

use anyhow::Result;
use neubrdf::gpu::{DeviceChoice, Instance, Validation};
use neubrdf::render::{Options, Renderer, Settings};

use crate::ball;
use crate::cornell::MAX_DEPTH;
use crate::measure::{Spread, bar, warm_up};

/// The scene of the bench `sphere`.
const BALL: &str = "ball of NeuBRDF";

const SAMPLES: u32 = 16;
const ROUNDS: usize = 5;

pub fn run() -> Result<()> {
    let device = Instance::new(Validation::Off)?.open(&DeviceChoice::Auto)?;
    for (name, path_reuse) in
        [("cornell", false), ("cornell", true), ("preview", false), ("neural", false), (BALL, false)]
    {
        let mut scene = if name == BALL { ball::scene(ball::network()) } else { crate::load(name)? };
        scene.film = crate::film(&device);
        let settings = Settings { max_depth: MAX_DEPTH, path_reuse, features: false, ..Settings::default() };
        let mut renderer = Renderer::new(&device, &scene, &settings, &Options::default())?;
        let bar = bar(ROUNDS);
        let (mut plain, mut timed, mut kernels) = (Vec::new(), Vec::new(), Vec::<(String, Vec<f64>)>::new());
        renderer.render_pass(SAMPLES)?;
        warm_up(device.profile(), || renderer.render_pass(SAMPLES).map(drop))?;
        for _ in 0..ROUNDS {
            let started = Instant::now();
            renderer.render_pass(SAMPLES)?;
            plain.push(started.elapsed().as_secs_f64() * 1e3);
            let started = Instant::now();
            let times = renderer.time_pass(SAMPLES)?;
            timed.push(started.elapsed().as_secs_f64() * 1e3);
            for (kernel, nanoseconds) in times {
                let milliseconds = nanoseconds as f64 * 1e-6;
                match kernels.iter_mut().find(|(known, _)| *known == kernel) {
                    Some((_, list)) => list.push(milliseconds),
                    None => kernels.push((kernel, vec![milliseconds])),
                }
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        let all: f64 = kernels.iter().map(|(_, list)| Spread::of(list.iter().copied()).median).sum();
        println!(
            "{name}{}, {}, {}, {}×{}, {SAMPLES} spp, depth {MAX_DEPTH}; median (min–max) of {ROUNDS}\n",
            if path_reuse { ", paths reused" } else { "" },
            device.driver(),
            renderer.traversal(),
            scene.film.width,
            scene.film.height
        );
        println!("| kernel | ms | share |\n|---|---|---|");
        for (kernel, list) in kernels {
            let spread = Spread::of(list);
            println!("| {kernel} | {spread:.1} | {:.1} % |", spread.median / all * 100.0);
        }
        println!("| all kernels | {all:.1} | 100 % |");
        println!("| wall clock, with timestamps | {:.1} | |", Spread::of(timed));
        println!("| wall clock, without | {:.1} | |\n", Spread::of(plain));
    }
    Ok(())
}
