//! `make study-fit`: how well models fit ground truths, and at what cost.
//!
//! Ground truths are the published networks of `../shared/data/nbrdf` and closed, layered and woven surfaces made here; on the latter
//! NBRDF is trained on the same samples as well. Each fit leaves a JSON file in `target/study-fit`; what is there is not done again.
//! Words restrict it: names of materials, `published`, `ours`. `--quality` and `--recipe` are those of `neubrdf train`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Parser;
use glam::{DVec3, Vec2, Vec3};
use indicatif::{ProgressBar, ProgressStyle};
use neubrdf::material::{Bsdf, Evaluate, LayeredWalk, Prepared, color};
use neubrdf::scene::brdf::{Brdf, NeuBrdf, Precision};
use neubrdf::scene::{Color, Fresnel, LayerBase, Layered, Surface, Woven, Yarn};
use neubrdf::train::measure::{FitErrors, compare};
use neubrdf::train::{Evaluator, GroundTruth, Model, Plan, Quality, Recipe, Session};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Fit materials and print how good the fits are.
#[derive(Parser)]
struct Arguments {
    /// Names of materials, `published` or `ours`; all without any
    materials: Vec<String>,
    #[arg(long, value_enum, default_value = "default")]
    quality: Quality,
    #[arg(long, value_enum, default_value = "default")]
    recipe: Recipe,
    /// Steps instead of the quality's
    #[arg(long)]
    steps: Option<u32>,
    /// Where results are kept
    #[arg(long, default_value = "target/study-fit")]
    folder: PathBuf,
}

/// Where the published networks are, if they are.
const PUBLISHED: [&str; 2] =
    ["../shared/data/nbrdf/merl.safetensors", "../shared/data/nbrdf/rgl-isotropic.safetensors"];

/// Pixels to a side of the balls.
const BALL: usize = 128;

/// Walks that an evaluation of a layered surface is the mean of: for training, for measuring.
const WALKS: [u32; 2] = [32, 128];

/// Anything to be learned.
type Eval = Arc<dyn Fn(DVec3, DVec3) -> DVec3 + Send + Sync>;

struct Truth {
    name: String,
    is_isotropic: bool,
    /// Other models are trained on it as well.
    is_ours: bool,
    learned: Eval,
    measured: Eval,
}

#[derive(Clone, Serialize, Deserialize)]
struct Outcome {
    log: f64,
    relative_rmse: f64,
    ssim: f64,
    flip: f64,
    albedo: f64,
    bytes: usize,
    /// On the clock, training alone.
    seconds: f64,
    /// Of all processors, training alone.
    cpu_seconds: f64,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.folder)?;
    let mut truths = published()?;
    if truths.is_empty() {
        eprintln!("no published networks in ../shared/data/nbrdf: they are left out");
    }
    truths.extend(ours());
    let is_wanted = |truth: &Truth| {
        let words = &arguments.materials;
        words.is_empty()
            || words.iter().any(|word| *word == truth.name || *word == if truth.is_ours { "ours" } else { "published" })
    };
    truths.retain(is_wanted);
    if truths.is_empty() {
        bail!("no material of these names: {}", arguments.materials.join(", "));
    }
    let bar = ProgressBar::new(truths.len() as u64);
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len}  {elapsed} + {eta}  {msg}")?);
    let mut rows = Vec::new();
    for truth in &truths {
        bar.set_message(truth.name.clone());
        let fit = outcome(&arguments, truth, Model::NeuBrdf)?;
        let baseline = truth.is_ours.then(|| outcome(&arguments, truth, Model::Nbrdf)).transpose()?;
        rows.push((truth.name.as_str(), fit, baseline));
        bar.inc(1);
    }
    bar.finish_and_clear();
    print_table(&rows);
    Ok(())
}

/// What is known of a fit, or is found out now.
fn outcome(arguments: &Arguments, truth: &Truth, model: Model) -> Result<Outcome> {
    let Arguments { recipe, quality, .. } = *arguments;
    let mut plan = Plan::new(model, recipe, quality, truth.is_isotropic);
    plan.steps = arguments.steps.unwrap_or(plan.steps);
    let key = blake3::hash(serde_json::to_string(&plan)?.as_bytes()).to_hex();
    let path = arguments.folder.join(format!("{}-{}.json", truth.name, &key[..12]));
    if let Ok(text) = std::fs::read_to_string(&path) {
        return serde_json::from_str(&text).with_context(|| format!("{}: delete it to do it again", path.display()));
    }
    let (started, cpu_started) = (Instant::now(), cpu_seconds()?);
    let learned = |wo: DVec3, wi: DVec3| (truth.learned)(wo, wi);
    let ground_truth = GroundTruth::Function { eval: &learned, is_isotropic: truth.is_isotropic };
    let mut session = Session::new(plan, &ground_truth)?;
    while !session.is_done() {
        session.step();
    }
    let (seconds, cpu_seconds) = (started.elapsed().as_secs_f64(), cpu_seconds()? - cpu_started);
    let (bytes, evaluator) = match session.neubrdf() {
        Some(brdf) => {
            let file = brdf.encode(Precision::F16)?;
            (file.len(), Evaluator::neubrdf(&NeuBrdf::decode(&file)?))
        }
        None => (size_of::<neubrdf::scene::brdf::Nbrdf>(), session.evaluator()),
    };
    let measured =
        |pairs: &[[DVec3; 2]]| -> Vec<DVec3> { pairs.par_iter().map(|[wo, wi]| (truth.measured)(*wo, *wi)).collect() };
    let FitErrors { pairs, ball, worst_albedo, .. } =
        compare(BALL, truth.is_isotropic, &|pairs| evaluator.eval(pairs), &measured).errors;
    let outcome = Outcome {
        log: pairs.log,
        relative_rmse: pairs.relative_rmse,
        ssim: ball.ssim,
        flip: ball.flip,
        albedo: worst_albedo,
        bytes,
        seconds,
        cpu_seconds,
    };
    std::fs::write(&path, serde_json::to_string_pretty(&outcome)?)?;
    Ok(outcome)
}

/// A column: its heading, its values, and whether they are better the greater they are.
type Column = (&'static str, fn(&Outcome) -> f64, bool);

const COLUMNS: [Column; 8] = [
    ("mean |Δ ln(1+f)|", |o| o.log, false),
    ("rel. RMSE", |o| o.relative_rmse, false),
    ("SSIM", |o| o.ssim, true),
    ("FLIP", |o| o.flip, false),
    ("albedo %", |o| 100.0 * o.albedo, false),
    ("bytes", |o| o.bytes as f64, false),
    ("s", |o| o.seconds, false),
    ("CPU s", |o| o.cpu_seconds, false),
];

fn print_table(rows: &[(&str, Outcome, Option<Outcome>)]) {
    let cells = |outcome: &Outcome| -> Vec<String> {
        COLUMNS.iter().map(|(name, value, _)| cell(name, value(outcome))).collect()
    };
    println!("| material | {} |", COLUMNS.map(|(name, ..)| name).join(" | "));
    println!("|---|{}", "---|".repeat(COLUMNS.len()));
    for (name, fit, baseline) in rows {
        println!("| {name} | {} |", cells(fit).join(" | "));
        if let Some(baseline) = baseline {
            println!("| — NBRDF | {} |", cells(baseline).join(" | "));
        }
    }
    let summary = |name: &str, of: &dyn Fn(&Column) -> f64| {
        let cells: Vec<String> = COLUMNS.iter().map(|column| cell(column.0, of(column))).collect();
        println!("| **{name}** | {} |", cells.join(" | "));
    };
    let values = |(_, value, _): &Column| -> Vec<f64> { rows.iter().map(|(_, fit, _)| value(fit)).collect() };
    summary("mean", &|column| values(column).iter().sum::<f64>() / rows.len() as f64);
    summary("worst", &|column| {
        let values = values(column).into_iter();
        if column.2 { values.fold(f64::INFINITY, f64::min) } else { values.fold(f64::NEG_INFINITY, f64::max) }
    });
    let compared: Vec<(&Outcome, &Outcome)> =
        rows.iter().filter_map(|(_, fit, baseline)| Some((fit, baseline.as_ref()?))).collect();
    if !compared.is_empty() {
        for (name, value, greater) in &COLUMNS[..5] {
            let wins = compared.iter().filter(|(a, b)| (value(a) > value(b)) == *greater).count();
            println!("better than NBRDF by {name}: {wins} of {}", compared.len());
        }
    }
}

fn cell(name: &str, value: f64) -> String {
    match name {
        "bytes" => format!("{value:.0}"),
        "s" | "CPU s" => format!("{value:.1}"),
        "albedo %" => format!("{value:.2}"),
        "mean |Δ ln(1+f)|" => format!("{value:.5}"),
        _ => format!("{value:.4}"),
    }
}

/// User and system time of this process.
fn cpu_seconds() -> Result<f64> {
    // Fields 14 and 15 of proc(5), in the hundredths of seconds that Linux shows to user space.
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |index: usize| -> Result<f64> { Ok(fields.get(index).context("/proc/self/stat is short")?.parse()?) };
    Ok((ticks(11)? + ticks(12)?) / 100.0)
}

fn published() -> Result<Vec<Truth>> {
    let mut truths = Vec::new();
    for file in PUBLISHED.map(Path::new).into_iter().filter(|file| file.exists()) {
        for name in names(&std::fs::read(file)?)? {
            let brdf = Brdf::load(file, Some(&name))?;
            let eval: Eval = Arc::new(move |wo, wi| brdf.eval(wo, wi));
            truths.push(Truth { name, is_isotropic: true, is_ours: false, learned: eval.clone(), measured: eval });
        }
    }
    Ok(truths)
}

/// The materials of a safetensors file.
fn names(bytes: &[u8]) -> Result<Vec<String>> {
    let (length, rest) = bytes.split_first_chunk::<8>().context("a safetensors file is longer than that")?;
    let header = rest.get(..u64::from_le_bytes(*length) as usize).context("the header is cut short")?;
    let header: serde_json::Map<String, serde_json::Value> = serde_json::from_slice(header)?;
    let mut names: Vec<String> =
        header.keys().filter_map(|key| Some(key.strip_suffix("/kernel1")?.to_owned())).collect();
    names.sort();
    Ok(names)
}

fn ours() -> Vec<Truth> {
    let rgb = |r: f32, g: f32, b: f32| Vec3::new(r, g, b);
    let gold = Fresnel::Complex { eta: rgb(0.168, 0.350, 1.508), kappa: rgb(3.138, 2.714, 1.879) };
    let chromium = Fresnel::Complex { eta: rgb(3.638, 3.116, 1.928), kappa: rgb(4.364, 4.423, 4.168) };
    let metal = |fresnel, x: f32, y: f32| Surface::Conductor { fresnel, alpha: Vec2::new(x, y) };
    let coated = |albedo: Vec3, alpha: f32| Surface::Coated { albedo: Color::constant(albedo), ior: 1.5, alpha };
    let layered =
        |alpha: f32, absorption: Vec3, base: LayerBase| Surface::Layered(Layered { ior: 1.5, alpha, absorption, base });
    let matte = |albedo: Vec3| LayerBase::Diffuse { albedo };
    let under = |fresnel, x: f32, y: f32| LayerBase::Conductor { fresnel, alpha: Vec2::new(x, y) };
    let yarn = |coverage: f32, gloss: f32, albedo: Vec3, specular_width: f32| Yarn {
        coverage,
        gloss,
        f0: Vec3::splat(0.06),
        albedo,
        specular_width,
        volume_width: 0.4,
        isotropy: 0.3,
    };
    let surfaces = [
        ("gold-0.05", metal(gold, 0.05, 0.05)),
        ("gold-0.2", metal(gold, 0.2, 0.2)),
        ("chromium-0.1", metal(chromium, 0.1, 0.1)),
        ("chromium-0.4", metal(chromium, 0.4, 0.4)),
        ("gold-0.05x0.3", metal(gold, 0.05, 0.3)),
        ("gold-0.1x0.4", metal(gold, 0.1, 0.4)),
        ("chromium-0.3x0.06", metal(chromium, 0.3, 0.06)),
        ("chromium-0.15x0.5", metal(chromium, 0.15, 0.5)),
        ("coated-red-0.05", coated(rgb(0.5, 0.05, 0.03), 0.05)),
        ("coated-blue-0.15", coated(rgb(0.05, 0.1, 0.4), 0.15)),
        ("coated-white-0.4", coated(rgb(0.8, 0.8, 0.75), 0.4)),
        ("layered-red-0.05", layered(0.05, rgb(0.05, 0.4, 0.6), matte(rgb(0.7, 0.5, 0.4)))),
        ("layered-green-0.2", layered(0.2, rgb(0.6, 0.1, 0.5), matte(rgb(0.6, 0.7, 0.5)))),
        ("layered-gold-0.1", layered(0.1, rgb(0.05, 0.1, 0.3), under(gold, 0.2, 0.2))),
        ("layered-brushed-0.1", layered(0.1, rgb(0.4, 0.1, 0.05), under(chromium, 0.1, 0.4))),
        (
            "woven-silk",
            Surface::Woven(Woven {
                warp: yarn(0.6, 0.6, rgb(0.5, 0.1, 0.2), 0.08),
                weft: yarn(0.4, 0.5, rgb(0.2, 0.1, 0.5), 0.15),
            }),
        ),
        (
            "woven-denim",
            Surface::Woven(Woven {
                warp: yarn(0.66, 0.15, rgb(0.06, 0.1, 0.26), 0.4),
                weft: yarn(0.34, 0.15, rgb(0.6, 0.6, 0.58), 0.4),
            }),
        ),
    ];
    surfaces.into_iter().map(|(name, surface)| closed(name, surface)).collect()
}

fn closed(name: &str, surface: Surface) -> Truth {
    let is_isotropic = match &surface {
        Surface::Conductor { alpha, .. } => alpha.x == alpha.y,
        Surface::Layered(Layered { base: LayerBase::Conductor { alpha, .. }, .. }) => alpha.x == alpha.y,
        Surface::Woven(_) => false,
        _ => true,
    };
    let [learned, measured] = WALKS.map(|walks| -> Eval {
        if let Surface::Layered(layers) = &surface {
            let walk = LayeredWalk::new(layers);
            return Arc::new(move |wo, wi| walk.average(wo, wi, walks));
        }
        let prepared = Prepared::new(&surface, &[]);
        let tint = color(&surface).value.as_dvec3();
        Arc::new(move |wo, wi| Bsdf::new(&prepared, tint).eval(wo, wi))
    });
    Truth { name: name.to_owned(), is_isotropic, is_ours: true, learned, measured }
}
