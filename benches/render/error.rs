//! Time to an error: relMSE over a ladder of samples, ours against Embree, Mitsuba's against itself.

use std::ffi::OsStr;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};
use neubrdf::converge::Metrics;
use neubrdf::converge::study::GroundTruth;
use neubrdf::gpu::{DeviceChoice, Instance, Validation};
use neubrdf::render::{Limits, Options, Renderer, Sampler, Settings, run as run_passes};
use neubrdf::scene::Scene;

use crate::cornell::MAX_DEPTH;
use crate::measure::{Spread, bar, warm_up};
use crate::peer::Mitsuba;

const SAMPLES: [u32; 4] = [4, 16, 64, 256];
/// Its `orthogonal` sampler takes squares of primes.
const ORTHOGONAL_SAMPLES: [u32; 4] = [9, 25, 121, 289];
const AIM: f64 = 1e-3;

/// Seconds and relMSE, a value a seed, at a number of samples.
struct Rung {
    samples: u32,
    seconds: Vec<f64>,
    errors: Vec<f64>,
}

/// A sampler's way down.
struct Ladder {
    name: String,
    rungs: Vec<Rung>,
}

impl Ladder {
    fn new(name: String, samples: &[u32]) -> Ladder {
        let rung = |samples: &u32| Rung { samples: *samples, seconds: Vec::new(), errors: Vec::new() };
        Ladder { name, rungs: samples.iter().map(rung).collect() }
    }

    fn add(&mut self, rung: usize, seconds: f64, error: f64) {
        self.rungs[rung].seconds.push(seconds);
        self.rungs[rung].errors.push(error);
    }

    /// The time to the aim and the samples for it, on a line through the two nearest rungs on log-log axes; whether it had to be extended.
    fn to_aim(&self) -> (f64, f64, bool) {
        let points: Vec<[f64; 3]> = self
            .rungs
            .iter()
            .map(|rung| {
                let [seconds, error] =
                    [&rung.seconds, &rung.errors].map(|list| Spread::of(list.iter().copied()).median);
                [seconds, f64::from(rung.samples), error].map(f64::ln)
            })
            .collect();
        let aim = AIM.ln();
        let pair = points.windows(2).find(|pair| pair[1][2] <= aim).unwrap_or(&points[points.len() - 2..]);
        let part = (aim - pair[0][2]) / (pair[1][2] - pair[0][2]);
        let at = |i: usize| (pair[0][i] + part * (pair[1][i] - pair[0][i])).exp();
        (at(0), at(1), !(0.0..=1.0).contains(&part))
    }

    fn print(&self) {
        let cells: Vec<String> = self
            .rungs
            .iter()
            .map(|rung| {
                let [seconds, error] =
                    [&rung.seconds, &rung.errors].map(|list| Spread::of(list.iter().copied()).median);
                format!("{}: {error:.2e} in {seconds:.3} s", rung.samples)
            })
            .collect();
        let (seconds, samples, extended) = self.to_aim();
        let note = if extended { ", extrapolated" } else { "" };
        println!("| {} | {} | {samples:.0} spp{note} | {seconds:.3} |", self.name, cells.join(" | "));
    }
}

/// A scene and how it is rendered, and in words what is particular about that.
pub struct Ours {
    pub words: &'static str,
    pub scene: Scene,
    pub settings: Settings,
}

impl Ours {
    /// By the sampler alone.
    pub fn plain(scene: &Scene, sampler: Sampler) -> Ours {
        let settings = Settings { max_depth: MAX_DEPTH, sampler, features: false, ..Settings::default() };
        Ours { words: "", scene: scene.clone(), settings }
    }
}

pub fn run() -> Result<()> {
    let scene = crate::load("cornell")?;
    let plain = |sampler| Ours::plain(&scene, sampler);
    let mut shared = Ours { words: ", paths reused", ..plain(Sampler::Sobol) };
    shared.settings.path_reuse = true;
    climb("cornell", &[plain(Sampler::Sobol), shared, plain(Sampler::Pcg)], "cornell")
}

/// Renders a scene, the same in all of `ours`, and what Mitsuba makes of `for_mitsuba`, with more and more samples.
pub fn climb(name: &str, ours: &[Ours], for_mitsuba: impl AsRef<OsStr>) -> Result<()> {
    let device = Instance::new(Validation::Off)?.open(&DeviceChoice::Auto)?;
    let samples = number_from("REFERENCE_SPP", 4096)?;
    let seeds = number_from("SEEDS", 3)?.max(1);
    let scene = &ours.first().context("nothing to render")?.scene;
    let truth = embree(scene, samples)?;
    let mut mitsuba = Mitsuba::start(Mitsuba::variant_for(&device), for_mitsuba, scene.film.width)?;
    if let Some(mitsuba) = &mut mitsuba {
        eprintln!("Mitsuba's reference, {samples} spp …");
        let file =
            cache_directory()?.join(format!("mitsuba-{}-{}-{name}-{samples}.npy", mitsuba.version, mitsuba.variant));
        let noise = mitsuba.reference(samples, &file)?;
        println!("Mitsuba's reference of {samples} spp errs by relMSE {noise:.1e}, which is taken off.\n");
    }

    let driver = device.driver().split(' ').next().unwrap_or("?");
    let ladder = |ours: &Ours| Ladder::new(format!("{driver}, {}{}", ours.settings.sampler, ours.words), &SAMPLES);
    let mut ours: Vec<(&Ours, Ladder)> = ours.iter().map(|ours| (ours, ladder(ours))).collect();
    let peers = [("independent", SAMPLES), ("multijitter", SAMPLES), ("orthogonal", ORTHOGONAL_SAMPLES)];
    let mut peers = peers.map(|(sampler, samples)| (sampler, Ladder::new(format!("Mitsuba, {sampler}"), &samples)));
    let bar = bar(seeds as usize * SAMPLES.len() * (ours.len() + peers.len()));
    for seed in 0..seeds {
        for (rung, samples) in SAMPLES.into_iter().enumerate() {
            for (ours, ladder) in &mut ours {
                bar.set_message(ladder.name.clone());
                let settings = Settings { seed, ..ours.settings };
                let mut renderer = Renderer::new(&device, &ours.scene, &settings, &Options::default())?;
                // The first pass may compile; Mitsuba's first is not timed either.
                renderer.render_pass(1)?;
                warm_up(device.profile(), || renderer.render_pass(1).map(drop))?;
                renderer.restart(seed)?;
                let limits = Limits { samples, seconds: None, error: None };
                run_passes(&mut renderer, &limits, |_, _| ControlFlow::Continue(()))?;
                let metrics = Metrics::of(&renderer.picture()?.0, &truth.picture, 0.0)?;
                let error = metrics.rel_mse - truth.about.rel_mse;
                ladder.add(rung, renderer.seconds(), error);
                bar.inc(1);
            }
            for (sampler, ladder) in &mut peers {
                bar.set_message(ladder.name.clone());
                if let Some(mitsuba) = &mut mitsuba {
                    let samples = ladder.rungs[rung].samples;
                    // The first of a sampler and a number of samples compiles kernels.
                    if seed == 0 {
                        mitsuba.error(sampler, samples, 99)?;
                    }
                    let (seconds, error) = mitsuba.error(sampler, samples, seed)?;
                    ladder.add(rung, seconds, error);
                }
                bar.inc(1);
            }
        }
    }
    bar.finish_and_clear();
    println!(
        "256×256, depth {MAX_DEPTH}; relMSE = mean((x − ref)² / (ref² + 0.01)) and render seconds, medians of {seeds} seeds\n"
    );
    println!(
        "| renderer, sampler | spp: relMSE in time | | | | samples to {AIM:.0e} | seconds to {AIM:.0e} |\n|---|---|---|---|---|---|---|"
    );
    ours.iter().for_each(|(_, ladder)| ladder.print());
    if mitsuba.is_some() {
        peers.iter().for_each(|(_, ladder)| ladder.print());
    }
    Ok(())
}

/// A number from the environment.
fn number_from(variable: &str, otherwise: u32) -> Result<u32> {
    std::env::var(variable).map_or(Ok(otherwise), |word| word.parse()).context(variable.to_owned())
}

pub fn cache_directory() -> Result<PathBuf> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/bench");
    std::fs::create_dir_all(&directory)?;
    Ok(directory)
}

/// Embree's picture, kept from run to run.
fn embree(scene: &Scene, samples: u32) -> Result<GroundTruth> {
    let bar = bar(1000);
    bar.set_message("Embree's reference");
    let progress = |part| bar.set_position((part * 1000.0) as u64);
    let never = AtomicBool::new(false);
    let truth = GroundTruth::embree(scene, MAX_DEPTH, samples, &cache_directory()?, progress, &never)?;
    bar.finish_and_clear();
    let truth = truth.context("the reference was stopped")?;
    let noise = truth.about.rel_mse;
    println!("Embree's reference of {samples} spp errs by relMSE {noise:.1e}, which is taken off.");
    Ok(truth)
}
