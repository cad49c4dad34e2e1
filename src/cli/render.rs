//! `neubrdf render`.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use neubrdf::gpu::{DeviceChoice, Instance, Validation};
use neubrdf::image::Picture;
use neubrdf::render::{
    BsdfSampling, Checkpoint, Limits, Options, Renderer, Sampler, Settings, Stopped, Traversal, run as run_passes,
};
use serde_json::json;

use super::job::Job;
use super::progress;

/// Path trace a scene on a Vulkan device.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    job: Job,
    /// Samples a pixel; 64 unless --time or --error says when to stop
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Stop after so many seconds of rendering
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    time: Option<f64>,
    /// Stop when the estimated mean relative error of the picture is below
    #[arg(long, allow_negative_numbers = true)]
    error: Option<f64>,
    /// Picks the random numbers; the same seed gives the same bits
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// ray-query or bvh; by default what suits the device
    #[arg(long)]
    traversal: Option<Traversal>,
    /// sobol or pcg
    #[arg(long, default_value_t = Sampler::Sobol)]
    sampler: Sampler,
    /// Do not sample lights: only what a path runs into shines. Slow to converge; for comparison
    #[arg(long)]
    no_light_sampling: bool,
    /// What directions are picked by: lobe (the material's), cosine or uniform. For comparison
    #[arg(long, default_value_t = BsdfSampling::Lobe)]
    bsdf_sampling: BsdfSampling,
    /// Bounces that no path ends at by chance; from then on Russian roulette ends dark ones
    #[arg(long, value_name = "BOUNCES", default_value_t = Settings::ROULETTE_AFTER)]
    roulette_after: u32,
    /// Let neighbouring pixels share paths between diffuse surfaces: less noise of indirect light
    #[arg(long)]
    path_reuse: bool,
    /// What a path may bring of indirect light: ends fireflies, and takes light away. Without it nothing does
    #[arg(long, value_name = "RADIANCE", allow_negative_numbers = true)]
    clamp_indirect: Option<f32>,
    /// A part of a device's or driver's name, or its number in `neubrdf info`
    #[arg(long)]
    device: Option<String>,
    /// Feature channels: all, none, or some of albedo,normal,depth,id
    #[arg(long, default_value = "all")]
    aov: Aovs,
    /// Paths in flight; by default what suits the device
    #[arg(long, value_name = "PATHS", value_parser = clap::value_parser!(u32).range(1..))]
    pool: Option<u32>,
    /// Save resumable state to this file about once a minute and at the end; without --resume it must not be there yet
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Seconds between two checkpoints
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, requires = "checkpoint")]
    checkpoint_interval: f64,
    /// Go on from the --checkpoint file
    #[arg(long, requires = "checkpoint")]
    resume: bool,
    /// Print statistics to standard output
    #[arg(long, value_name = "FORMAT")]
    stats: Option<StatsFormat>,
}

/// How `--stats` prints.
#[derive(Clone, Copy, clap::ValueEnum)]
enum StatsFormat {
    Json,
}

/// The feature channels that the user wants.
#[derive(Clone, Debug)]
struct Aovs(Vec<String>);

const AOVS: [&str; 4] = ["albedo", "normal", "depth", "id"];

impl std::str::FromStr for Aovs {
    type Err = String;

    fn from_str(words: &str) -> Result<Self, String> {
        match words {
            "all" => Ok(Aovs(AOVS.map(String::from).to_vec())),
            "none" => Ok(Aovs(Vec::new())),
            _ => words
                .split(',')
                .map(|word| match AOVS.contains(&word) {
                    true => Ok(word.to_owned()),
                    false => Err(format!(
                        "'{word}' is no feature channel: expected all, none, or some of {}",
                        AOVS.join(",")
                    )),
                })
                .collect::<Result<_, _>>()
                .map(Aovs),
        }
    }
}

/// Loads, renders, writes.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    for limit in [arguments.time, arguments.error].into_iter().flatten() {
        if limit.is_nan() || limit <= 0.0 {
            bail!("--time and --error take numbers above 0, not {limit}");
        }
    }
    if let Some(path) = arguments.checkpoint.as_deref().filter(|path| !arguments.resume && path.is_file()) {
        // Without a word it would be lost.
        let samples = Checkpoint::read(path)?.samples;
        bail!(
            "{}: holds a render of {samples} samples a pixel; say --resume to go on with it, or remove it",
            path.display()
        );
    }
    let loading = Instant::now();
    let scene = arguments.job.load(arguments.checkpoint.as_deref())?;
    let load_seconds = loading.elapsed().as_secs_f64();

    let preparing = Instant::now();
    let instance = Instance::new(Validation::Off)?;
    let choice = arguments.device.clone().map_or(DeviceChoice::Auto, DeviceChoice::Named);
    let device = instance.open(&choice)?;
    let settings = Settings {
        max_depth: arguments.job.max_depth,
        roulette_after: arguments.roulette_after,
        clamp_indirect: arguments.clamp_indirect,
        seed: arguments.seed,
        sampler: arguments.sampler,
        crop: arguments.job.crop,
        features: !arguments.aov.0.is_empty(),
        light_sampling: !arguments.no_light_sampling,
        bsdf_sampling: arguments.bsdf_sampling,
        path_reuse: arguments.path_reuse,
        neubrdf_precision: None,
    };
    let options = Options { traversal: arguments.traversal, pool_paths: arguments.pool };
    let mut renderer = Renderer::new(&device, &scene, &settings, &options)?;
    if let Some(path) = arguments.checkpoint.as_deref().filter(|_| arguments.resume) {
        renderer.restore(&Checkpoint::read(path)?).with_context(|| format!("cannot resume from {}", path.display()))?;
    }
    let prepare_seconds = preparing.elapsed().as_secs_f64();

    let stopped = render(&arguments, &mut renderer)?;
    if let Some(path) = &arguments.checkpoint {
        save(&renderer, path)?;
    }
    let (mut picture, metadata) = renderer.picture()?;
    drop_unwanted(&mut picture, &arguments.aov);
    arguments.job.write(&picture, &metadata)?;
    let rejected = renderer.rejected_samples()?;
    if rejected > 0 && !arguments.job.quiet {
        note!("warning: {rejected} samples were not finite and count as black; please report the scene");
    }
    let error = if renderer.samples() > 1 { Some(renderer.estimate_error()?) } else { None };
    let rate = renderer.samples() as f64 * renderer.pixel_count() as f64 / renderer.seconds().max(1e-9);
    if !arguments.job.quiet {
        let interrupted = if stopped == Stopped::Interrupted { "interrupted: " } else { "" };
        let error = error.map_or(String::new(), |error| format!(", estimated error {:.2} %", 100.0 * error));
        let (spp, seconds) = (renderer.samples(), renderer.seconds());
        note!("{interrupted}{spp} spp in {seconds:.1} s, {:.2} Msamples/s{error}", 1e-6 * rate);
    }
    if arguments.stats.is_some() {
        let statistics = json!({
            "scene": arguments.job.scene, "scene_hash": metadata.scene_hash, "device": metadata.device,
            "traversal": metadata.traversal, "width": picture.width, "height": picture.height,
            "spp": renderer.samples(), "max_depth": settings.max_depth, "seed": settings.seed,
            "load_seconds": load_seconds, "prepare_seconds": prepare_seconds, "render_seconds": renderer.seconds(),
            "samples_per_second": rate, "estimated_error": error,
            "rejected_samples": rejected, "stopped": format!("{stopped:?}").to_lowercase(),
        });
        tell!("{statistics:#}")?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Takes away the feature channels that the user does not want.
fn drop_unwanted(picture: &mut Picture, wanted: &Aovs) {
    let unwanted = |name: &str| {
        AOVS.iter().any(|feature| {
            name.strip_prefix(feature).is_some_and(|rest| rest.starts_with('.'))
                && !wanted.0.iter().any(|w| w == feature)
        })
    };
    let names: Vec<String> = picture.names().filter(|name| unwanted(name)).map(String::from).collect();
    for name in names {
        picture.remove(&name);
    }
}

/// Renders under a bar, with checkpoints, until a limit or Ctrl-C.
fn render(arguments: &Arguments, renderer: &mut Renderer) -> Result<Stopped> {
    let open_end = arguments.time.is_some() || arguments.error.is_some();
    let samples = arguments.spp.unwrap_or(if open_end { u32::MAX } else { 64 });
    let limits = Limits { samples, seconds: arguments.time, error: arguments.error };
    let interrupted = progress::interrupt_flag()?;
    let bar = progress::bar(progress::STEPS, arguments.job.quiet);
    let mut last_checkpoint = Instant::now();
    let mut failure = None;
    let stopped = run_passes(renderer, &limits, |renderer, progress| {
        bar.set_position(progress_position(&limits, progress));
        bar.set_message(format!(
            "{} spp  {:.2} Msamples/s  error {}",
            progress.samples,
            progress.samples_per_second * 1e-6,
            progress.error.map_or("–".into(), |error| format!("{:.2} %", error * 100.0)),
        ));
        if let Some(path) = &arguments.checkpoint
            && last_checkpoint.elapsed().as_secs_f64() >= arguments.checkpoint_interval
        {
            if let Err(error) = save(renderer, path) {
                failure = Some(error);
                return ControlFlow::Break(());
            }
            last_checkpoint = Instant::now();
        }
        if interrupted.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    bar.finish();
    failure.map_or(Ok(stopped), Err)
}

fn save(renderer: &Renderer, path: &Path) -> Result<()> {
    Ok(renderer.checkpoint()?.write(path)?)
}

/// How far along the nearest limit is.
fn progress_position(limits: &Limits, so_far: &neubrdf::render::Progress) -> u64 {
    let samples = f64::from(so_far.samples) / f64::from(limits.samples);
    let seconds = limits.seconds.map_or(0.0, |limit| so_far.seconds / limit);
    // The error falls about as 1/√samples, so that its square says how much of the work is done.
    let error = limits.error.zip(so_far.error).map_or(0.0, |(limit, error)| (limit / error).powi(2));
    (samples.max(seconds).max(error).min(1.0) * progress::STEPS as f64) as u64
}
