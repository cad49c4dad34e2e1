//! Samples a second on the Cornell box, ours and Mitsuba's in turns.

use anyhow::Result;
use neubrdf::gpu::{Device, DeviceChoice, Instance, Validation};
use neubrdf::render::{Limits, Options, Renderer, Sampler, Settings, Traversal, run as run_passes};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use crate::measure::{Spread, Stopwatch, Timing, bar, cores, warm_up};
use crate::peer::Mitsuba;

pub const SAMPLES: u32 = 64;
pub const MAX_DEPTH: u32 = 6;
/// Renders of each.
const ROUNDS: usize = 3;
/// Whom a render takes longer than this renders fewer samples.
const LONGEST_SECONDS: f64 = 20.0;
const FEW_SAMPLES: u32 = 8;

enum Who {
    Ours(Box<Renderer>, Arc<Device>),
    Mitsuba(Mitsuba),
}

struct Contender {
    name: String,
    who: Who,
    /// Building the renderer; Mitsuba does that within its first render.
    prepare: Option<f64>,
    /// The first sample of each pixel: what is compiled late is compiled here.
    first: f64,
    pixels: f64,
    samples: u32,
    timings: Vec<Timing>,
}

impl Contender {
    fn new(name: String, mut who: Who, prepare: Option<f64>, pixels: f64) -> Result<Contender> {
        let first = who.render(1, 0)?.seconds;
        let one = who.render(1, 1)?.seconds;
        let samples = if one * f64::from(SAMPLES) > LONGEST_SECONDS { FEW_SAMPLES } else { SAMPLES };
        Ok(Contender { name, who, prepare, first, pixels, samples, timings: Vec::new() })
    }

    fn print(&self) {
        let rate = |seconds: f64| f64::from(self.samples) * self.pixels * 1e-6 / seconds;
        let wall = Spread::of(self.timings.iter().map(|timing| rate(timing.seconds)));
        let cpu = Spread::of(self.timings.iter().map(|timing| rate(timing.cpu_seconds / cores() as f64)));
        let others = Spread::of(self.timings.iter().map(|timing| timing.others));
        let prepare = self.prepare.map_or("in first".to_owned(), |seconds| format!("{seconds:.2}"));
        println!(
            "| {} | {prepare} | {:.2} | {wall:.3} | {:.3} | {others:.1} | {} × {} |",
            self.name,
            self.first,
            cpu.median,
            self.timings.len(),
            self.samples
        );
    }
}

impl Who {
    fn render(&mut self, samples: u32, round: u32) -> Result<Timing> {
        match self {
            Who::Mitsuba(mitsuba) => mitsuba.render("independent", samples, round),
            Who::Ours(renderer, device) => {
                // It goes on where it was: the samples are others, the work is the same.
                let mut more = |samples| {
                    let limits = Limits { samples: renderer.samples() + samples, seconds: None, error: None };
                    run_passes(renderer, &limits, |_, _| ControlFlow::Continue(()))
                };
                warm_up(device.profile(), || more(samples).map(drop))?;
                let watch = Stopwatch::own();
                more(samples)?;
                Ok(watch.stop())
            }
        }
    }
}

pub fn run() -> Result<()> {
    let mut scene = crate::load("cornell")?;
    let instance = Instance::new(Validation::Off)?;
    let mut contenders = Vec::new();
    let mut peers = BTreeMap::from([("llvm_ad_rgb", 256), ("scalar_rgb", 256)]);
    for report in instance.devices()?.iter().filter(|report| report.missing.is_empty()) {
        let device = instance.open(&DeviceChoice::Named(report.index.to_string()))?;
        scene.film = crate::film(&device);
        peers.insert(Mitsuba::variant_for(&device), scene.film.width);
        for traversal in [Traversal::Bvh, Traversal::RayQuery] {
            if traversal == Traversal::RayQuery && !device.has_ray_query() {
                continue;
            }
            for sampler in [Sampler::Sobol, Sampler::Pcg] {
                let settings = Settings { max_depth: MAX_DEPTH, sampler, features: false, ..Settings::default() };
                let options = Options { traversal: Some(traversal), pool_paths: None };
                let watch = Stopwatch::own();
                let renderer = Renderer::new(&device, &scene, &settings, &options)?;
                let prepare = watch.stop().seconds;
                let name = format!("{}, {traversal}, {sampler}", report.driver.split(' ').next().unwrap_or("?"));
                let pixels = f64::from(scene.film.width * scene.film.height);
                contenders.push(Contender::new(
                    name,
                    Who::Ours(Box::new(renderer), device.clone()),
                    Some(prepare),
                    pixels,
                )?);
            }
        }
    }
    for (variant, side) in peers {
        match Mitsuba::start(variant, "cornell", side) {
            Ok(Some(mitsuba)) => {
                let name = format!("Mitsuba {} {variant}, independent", mitsuba.version);
                contenders.push(Contender::new(name, Who::Mitsuba(mitsuba), None, f64::from(side * side))?);
            }
            Ok(None) => break,
            Err(error) => println!("{error}: skipped\n"),
        }
    }
    let bar = bar(ROUNDS * contenders.len());
    for round in 0..ROUNDS {
        for contender in &mut contenders {
            bar.set_message(contender.name.clone());
            contender.timings.push(contender.who.render(contender.samples, 2 + round as u32)?);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    println!(
        "256×256 (on a GPU 1024×1024), depth {MAX_DEPTH}; rates in Msamples/s, median (min–max) of renders in turns\n"
    );
    println!("| renderer | prepare s | first spp s | rate | rate by own CPU time | others' cores | renders × spp |");
    println!("|---|---|---|---|---|---|---|");
    contenders.iter().for_each(Contender::print);
    Ok(())
}
