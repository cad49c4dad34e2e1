//! `neubrdf converge`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use anyhow::{Context, Result, bail};
use neubrdf::converge::stability::cases;
use neubrdf::converge::study::{
    AXES, Analysis, Axes, Clock, Event, Gate, Plan, RECORD_FILE, Record, ScenePlan, change_lines, compare, run,
    summary_text, verdict_lines, write_report,
};
use neubrdf::gpu::{DeviceChoice, Instance, Validation};
use neubrdf::image::write_file;
use neubrdf::scene::Film;

use super::job::film_size;
use super::progress;

/// Measure speed against error, method by method, and test for bias. Exit status 3 if a threshold of --assert is broken.
#[derive(clap::Args)]
pub struct Arguments {
    /// Scene files (.toml) or bare .obj files; with --study those of the study if none are given
    scenes: Vec<PathBuf>,
    /// Directory for the report: report.html, runs.csv, study.json, pictures
    #[arg(short, long, value_name = "DIRECTORY", required_unless_present = "suite")]
    output: Option<PathBuf>,
    /// Run a named suite of hard cases instead of a study: stability
    #[arg(long, value_name = "NAME", conflicts_with_all = OF_STUDIES)]
    suite: Option<Suite>,
    /// A study file (TOML), of which the other options replace what they say
    #[arg(long, value_name = "TOML")]
    study: Option<PathBuf>,

    /// Devices by a part of their name, and embree, mitsuba
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    device: Vec<String>,
    /// ray-query, bvh, auto
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    traversal: Vec<String>,
    /// sobol, pcg
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    sampler: Vec<String>,
    /// on, off: whether lights are sampled at every vertex
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    light_sampling: Vec<String>,
    /// lobe, cosine, uniform: what directions are picked by
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    bsdf_sampling: Vec<String>,
    /// f32, f16, auto: how numbers of NeuBRDFs are held on the device
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    precision: Vec<String>,
    /// Paths in flight: numbers, auto
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    pool: Vec<String>,
    /// truth, and the names of a study file's models
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    model: Vec<String>,
    /// What a path may bring of indirect light: radiances, off
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    clamp_indirect: Vec<String>,
    /// on, off: whether neighbouring pixels share paths
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Methods: all combinations of")]
    path_reuse: Vec<String>,

    /// The ladder of samples a pixel [default: 4,16,64,256]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    spp: Vec<u32>,
    /// Independent renders of each rung; from 3 on there are confidence intervals for everything [default: 4]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    repetitions: Option<u32>,
    /// Path segments [default: 16]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=65_535))]
    max_depth: Option<u32>,
    /// Size of the film instead of the scenes', as WIDTHxHEIGHT
    #[arg(long, value_name = "WxH", value_parser = film_size)]
    size: Option<Film>,
    /// Samples a pixel of the Embree reference [default: 4096]
    #[arg(long, value_parser = clap::value_parser!(u32).range(2..))]
    reference_spp: Option<u32>,
    /// A picture to compare with instead of Embree's; for one scene
    #[arg(long, value_name = "EXR")]
    reference: Option<PathBuf>,
    /// Where references are kept [default: $XDG_CACHE_HOME/neubrdf or ~/.cache/neubrdf]
    #[arg(long, value_name = "DIRECTORY")]
    cache: Option<PathBuf>,
    /// relMSE that the time is wanted to [default: 0.01,0.001]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    target: Vec<f64>,
    /// Another seed gives independent noise
    #[arg(long)]
    seed: Option<u32>,
    /// wall or cpu: which seconds count [default: wall]
    #[arg(long, value_parser = clock)]
    clock: Option<Clock>,

    /// Go on with the study in the output directory
    #[arg(long)]
    resume: bool,
    /// Hold the figures to the thresholds of a file (TOML)
    #[arg(long = "assert", value_name = "TOML")]
    gate: Option<PathBuf>,
    /// Say what is better or worse than in an older study.json
    #[arg(long, value_name = "JSON")]
    compare: Option<PathBuf>,
    /// No bar and no warnings
    #[arg(long)]
    quiet: bool,
}

/// What has no meaning for a suite.
const OF_STUDIES: [&str; 24] = [
    "scenes",
    "study",
    "traversal",
    "sampler",
    "light_sampling",
    "bsdf_sampling",
    "precision",
    "pool",
    "model",
    "clamp_indirect",
    "path_reuse",
    "spp",
    "repetitions",
    "max_depth",
    "size",
    "reference_spp",
    "reference",
    "cache",
    "target",
    "seed",
    "clock",
    "resume",
    "gate",
    "compare",
];

/// Suites by name.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Suite {
    Stability,
}

/// A threshold is broken, or a case of a suite.
const BROKEN: u8 = 3;

fn clock(word: &str) -> Result<Clock, String> {
    match word {
        "wall" => Ok(Clock::Wall),
        "cpu" => Ok(Clock::Cpu),
        _ => Err(format!("'{word}' is no clock: expected wall or cpu")),
    }
}

impl Arguments {
    fn plan(&self) -> Result<Plan> {
        let mut plan = match &self.study {
            Some(path) => Plan::read(path)?,
            None => Plan::default(),
        };
        if !self.scenes.is_empty() {
            plan.scenes = self.scenes.iter().map(ScenePlan::new).collect();
        }
        if let Some(reference) = &self.reference {
            match plan.scenes.as_mut_slice() {
                [scene] => scene.reference = Some(reference.clone()),
                scenes => bail!("--reference is a picture of one scene, and there are {}", scenes.len()),
            }
        }
        let lists = [
            &self.device,
            &self.traversal,
            &self.sampler,
            &self.light_sampling,
            &self.bsdf_sampling,
            &self.precision,
            &self.pool,
            &self.model,
            &self.clamp_indirect,
            &self.path_reuse,
        ];
        if plan.methods.is_empty() || lists.iter().any(|list| !list.is_empty()) {
            let mut axes = Axes::default();
            for (axis, list) in AXES.iter().zip(lists) {
                if let Some(values) = axes.axis_mut(axis) {
                    values.clone_from(list);
                }
            }
            plan.methods = axes.methods().map_err(|unknown| anyhow::anyhow!("--{unknown}"))?;
        }
        if !self.spp.is_empty() {
            plan.ladder.clone_from(&self.spp);
        }
        if !self.target.is_empty() {
            plan.targets.clone_from(&self.target);
        }
        if let Some(wrong) = plan.targets.iter().find(|target| !(target.is_finite() && **target > 0.0)) {
            bail!("--target takes numbers above 0, not {wrong}");
        }
        plan.repetitions = self.repetitions.unwrap_or(plan.repetitions);
        plan.max_depth = self.max_depth.unwrap_or(plan.max_depth);
        plan.size = self.size.map(|film| [film.width, film.height]).or(plan.size);
        plan.reference_spp = self.reference_spp.unwrap_or(plan.reference_spp);
        plan.seed = self.seed.unwrap_or(plan.seed);
        plan.clock = self.clock.unwrap_or(plan.clock);
        Ok(plan)
    }
}

/// Plans, renders, reports, judges.
pub fn run_command(arguments: Arguments) -> Result<ExitCode> {
    if let Some(Suite::Stability) = arguments.suite {
        return stability(&arguments);
    }
    let Some(output) = arguments.output.as_deref() else { bail!("say where to with -o DIRECTORY") };
    let plan = arguments.plan()?;
    plan.check()?;
    // Mistakes in these files are told before hours of work.
    let gate = arguments.gate.as_deref().map(Gate::read).transpose()?;
    let old = arguments.compare.as_deref().map(Record::read).transpose()?;
    let cache = match &arguments.cache {
        Some(cache) => cache.clone(),
        None => default_cache().context("there is neither XDG_CACHE_HOME nor HOME: say --cache DIRECTORY")?,
    };

    let interrupted = progress::interrupt_flag()?;
    let bar = progress::bar(progress::STEPS, arguments.quiet);
    let observe = |event: Event| match event {
        Event::Warning(message) if !arguments.quiet => bar.suspend(|| note!("warning: {message}")),
        Event::Warning(_) => {}
        Event::Reference(name, part) => {
            bar.set_message(format!("reference of {name}"));
            bar.set_position((part * progress::STEPS as f64) as u64);
        }
        Event::Begin => {
            bar.set_position(0);
            bar.reset_eta();
            bar.reset_elapsed();
        }
        Event::Render { name, done, total } => {
            bar.set_message(name);
            bar.set_position((done as f64 / total.max(1) as f64 * progress::STEPS as f64) as u64);
        }
    };
    let record = run(&plan, output, &cache, arguments.resume, &observe, &interrupted)?;
    bar.finish_and_clear();

    let analysis = Analysis::of(&record);
    let page = write_report(&record, &analysis, output)?;
    if !arguments.quiet {
        tell!("{}", summary_text(&record, &analysis).trim_end())?;
        tell!("report: {}", page.display())?;
    }
    if interrupted.load(Ordering::SeqCst) {
        note!("interrupted: what was rendered is in the report; --resume goes on");
    }
    if let Some(old) = old {
        let path = arguments.compare.as_deref().unwrap_or(Path::new(RECORD_FILE));
        tell!("against {} (95 % intervals, all at once):", path.display())?;
        if (&old.environment.cpu, old.environment.is_release)
            != (&record.environment.cpu, record.environment.is_release)
        {
            tell!("warning: that was another machine or build: seconds do not compare")?;
        }
        tell!("{}", change_lines(&compare(&record, &old)).trim_end())?;
    }
    let Some(gate) = gate else { return Ok(ExitCode::SUCCESS) };
    let verdicts = gate.judge(&analysis);
    tell!("{}", verdict_lines(&verdicts).trim_end())?;
    let broken = verdicts.iter().filter(|verdict| !verdict.holds).count();
    if broken > 0 {
        note!("{broken} of {} thresholds are broken", verdicts.len());
        return Ok(ExitCode::from(BROKEN));
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs the hard cases on a device and prints a table; with -o as stability.md there too.
fn stability(arguments: &Arguments) -> Result<ExitCode> {
    // The layer's messages are part of the verdict, where it is installed.
    let instance = Instance::new(Validation::Sync).or_else(|_| Instance::new(Validation::Off))?;
    let device = match arguments.device.as_slice() {
        [] => instance.open(&DeviceChoice::Auto)?,
        [name] => instance.open(&DeviceChoice::Named(name.clone()))?,
        _ => bail!("--suite takes one --device"),
    };
    let cases = cases();
    let bar = progress::bar(cases.len() as u64, arguments.quiet);
    let mut table = format!("{} ({})\n\n| case | holds | found |\n|---|---|---|\n", device.name(), device.driver());
    let mut broken = 0;
    for case in &cases {
        bar.set_message(case.name);
        let mut outcome = case.run(&device);
        let messages = instance.validation_messages();
        if let Some(first) = messages.first() {
            outcome.holds = false;
            outcome.message = format!("{}; {} validation messages: {first}", outcome.message, messages.len());
        }
        broken += usize::from(!outcome.holds && !case.is_known_limit);
        let word = match (outcome.holds, case.is_known_limit) {
            (true, _) => "yes",
            (false, true) => "no (known)",
            (false, false) => "**no**",
        };
        table += &format!("| {} | {word} | {} |\n", case.name, outcome.message);
        bar.inc(1);
    }
    bar.finish_and_clear();
    tell!("{}", table.trim_end())?;
    if let Some(directory) = &arguments.output {
        std::fs::create_dir_all(directory).with_context(|| directory.display().to_string())?;
        write_file(directory.join("stability.md"), table)?;
    }
    if broken > 0 {
        note!("{broken} of {} cases do not hold", cases.len());
        return Ok(ExitCode::from(BROKEN));
    }
    Ok(ExitCode::SUCCESS)
}

fn default_cache() -> Option<PathBuf> {
    let variable = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    Some(variable("XDG_CACHE_HOME").or_else(|| Some(variable("HOME")?.join(".cache")))?.join("neubrdf"))
}
