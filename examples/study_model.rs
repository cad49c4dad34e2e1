//! `make study`: what sizes of a NeuBRDF are worth their time on the device.
//!
//! A few materials are fitted with models around the default, one size at a time and some together. Each fit leaves a JSON file in the
//! folder, as does each timing of the device's kernel; what is there is not done again. Prints a table in Markdown, in which ★ marks
//! the Pareto front of (evaluations a second, error), and draws it.

#[path = "../benches/render/evaluations.rs"]
mod evaluations;
mod study;

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Result, bail};
use clap::Parser;
use evaluations::{Evaluations, rate_by_own_time};
use neubrdf::converge::study::plot::{Plot, Point, Series};
use neubrdf::gpu::{Device, DeviceChoice, Instance, Validation};
use neubrdf::image::atomic_write;
use neubrdf::scene::brdf::{CornerWeights, NeuBrdf, Precision};
use neubrdf::train::{Evaluator, Model, Plan, Quality, Recipe};
use serde::{Deserialize, Serialize};
use study::{Errors, Truth, bar, errors, kept, key, ours, published, train};

/// Fit models of several sizes and print which are worth their time.
#[derive(Parser)]
struct Arguments {
    /// Names of materials of `make study-fit`
    #[arg(default_values = ["chrome-steel", "gold-0.1x0.4", "layered-gold-0.1"])]
    materials: Vec<String>,
    #[arg(long, value_enum, default_value = "draft")]
    quality: Quality,
    /// Which sizes to vary: default, n-side, codes, features, hidden, weights, together or resolutions; all without
    #[arg(long, value_delimiter = ',')]
    axis: Vec<String>,
    /// Where results and the plot are kept
    #[arg(long, default_value = "target/study")]
    folder: PathBuf,
    /// Fit nothing: print and draw the models that were fitted to all materials
    #[arg(long)]
    print: bool,
}

/// What is varied, each with the plot's words for it.
const AXES: [(&str, &str); 8] = [
    ("default", "the default"),
    ("n-side", "N_side, each point its own code"),
    ("codes", "2ᵇ codes a hemisphere"),
    ("features", "features F"),
    ("hidden", "hidden neurons"),
    ("weights", "¼ a corner"),
    ("together", "several at once"),
    ("resolutions", "several resolutions"),
];

/// The sizes of a model.
#[derive(Clone, Copy, Serialize)]
struct Sizes {
    n_side: u32,
    resolutions: usize,
    /// b: a hemisphere has 2ᵇ codes; without, each point has its own.
    code_bits: Option<u32>,
    /// F, on each grid; without, the recipe's, which depends on whether the material is isotropic.
    features: Option<usize>,
    hidden: usize,
    corner_weights: CornerWeights,
}

const DEFAULT: Sizes = Sizes {
    n_side: 16,
    resolutions: 1,
    code_bits: None,
    features: None,
    hidden: 64,
    corner_weights: CornerWeights::Bilinear,
};

/// All models, with the place of their axis in [`AXES`].
fn models() -> Vec<(usize, Sizes)> {
    let mut models = vec![(0, DEFAULT)];
    models.extend([8, 32, 64].map(|n_side| (1, Sizes { n_side, ..DEFAULT })));
    // At N_side 128 there are more points than an index can name.
    let codes = [(16, 4), (16, 6), (16, 8), (16, 10), (64, 4), (64, 6), (64, 8), (64, 10), (128, 10)];
    models.extend(codes.map(|(n_side, bits)| (2, Sizes { n_side, code_bits: Some(bits), ..DEFAULT })));
    models.extend([4, 8, 16, 24, 32].map(|features| (3, Sizes { features: Some(features), ..DEFAULT })));
    models.extend([16, 32, 48, 96, 128].map(|hidden| (4, Sizes { hidden, ..DEFAULT })));
    let uniform = Sizes { corner_weights: CornerWeights::Uniform, ..DEFAULT };
    models.extend([16, 64].map(|n_side| (5, Sizes { n_side, ..uniform })));
    models.push((5, Sizes { n_side: 64, code_bits: Some(8), features: Some(16), ..uniform }));
    for (features, hidden) in [(4, 16), (8, 16), (8, 32), (16, 32), (8, 48), (16, 48), (16, 128)] {
        models.push((6, Sizes { features: Some(features), hidden, ..DEFAULT }));
    }
    models.push((6, Sizes { n_side: 32, features: Some(8), hidden: 32, ..DEFAULT }));
    let pyramids = [(16, 2, 4), (16, 2, 8), (16, 3, 4), (32, 2, 4), (32, 2, 8), (32, 3, 4), (64, 3, 4), (64, 4, 4)];
    models.extend(pyramids.map(|(n_side, resolutions, features)| {
        (7, Sizes { n_side, resolutions, features: Some(features), ..DEFAULT })
    }));
    // The paper's: N_side 64 and 2⁸ codes, in as many features.
    models.push((7, Sizes { n_side: 64, resolutions: 4, features: Some(4), code_bits: Some(8), ..DEFAULT }));
    models
}

impl Sizes {
    fn plan(&self, quality: Quality, is_isotropic: bool) -> Plan {
        let plan = Plan::new(Model::NeuBrdf, Recipe::Default, quality, is_isotropic);
        Plan {
            n_side: [self.n_side; 2],
            resolutions: self.resolutions,
            codes: self.code_bits.map_or(plan.codes, |bits| [1 << bits; 2]),
            features: self.features.unwrap_or(plan.features),
            hidden: self.hidden,
            pruned: self.hidden,
            corner_weights: self.corner_weights,
            ..plan
        }
    }

    fn name(&self) -> String {
        let codes = self.code_bits.map_or("own".to_owned(), |bits| format!("2^{bits}"));
        let features = match (self.resolutions, self.features) {
            (_, None) => "12/11".to_owned(),
            (1, Some(features)) => features.to_string(),
            (resolutions, Some(features)) => format!("{resolutions} × {features}"),
        };
        let weights = match self.corner_weights {
            CornerWeights::Uniform => "¼",
            CornerWeights::Bilinear => "bilinear",
        };
        format!("{} | {codes} | {features} | {} | {weights}", self.n_side, self.hidden)
    }
}

const PRECISIONS: [Precision; 2] = [Precision::F16, Precision::F32];

/// A fit of one material, stored in each of [`PRECISIONS`].
#[derive(Clone, Serialize, Deserialize)]
struct Outcome {
    errors: [Errors; 2],
    bytes: [usize; 2],
    /// Of training.
    cpu_seconds: f64,
    /// Million evaluations a second of the device.
    rates: [f64; 2],
}

/// A model, fitted to each material.
struct Fitted {
    axis: usize,
    sizes: Sizes,
    outcomes: Vec<Outcome>,
}

/// Timings of which the median counts.
const ROUNDS: usize = 5;

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.folder)?;
    if let Some(axis) = arguments.axis.iter().find(|axis| AXES.iter().all(|(name, _)| name != axis)) {
        bail!("--axis: found {axis}, expected one of {}", AXES.map(|(name, _)| name).join(", "));
    }
    let truths = truths(&arguments.materials)?;
    let models: Vec<(usize, Sizes)> = models()
        .into_iter()
        .filter(|(axis, _)| arguments.axis.is_empty() || arguments.axis.iter().any(|name| name == AXES[*axis].0))
        .collect();
    let device = Instance::new(Validation::Off)?.open(&DeviceChoice::Auto)?;
    let bar = bar(models.len() * truths.len())?;
    let mut fitted = Vec::new();
    for (axis, sizes) in models {
        let mut outcomes = Vec::new();
        for truth in &truths {
            bar.set_message(format!("{}: {}", sizes.name().replace(" |", ","), truth.name));
            outcomes.extend(outcome(&arguments, &device, truth, sizes)?);
            bar.inc(1);
        }
        if outcomes.len() == truths.len() {
            fitted.push(Fitted { axis, sizes, outcomes });
        }
    }
    bar.finish_and_clear();
    let [half, full] = [0, 1].map(|precision| points(&fitted, precision));
    print_table(&truths, &fitted, &half, &full);
    let plot = arguments.folder.join("study.svg");
    let io_error = |source| neubrdf::image::Error::Io { path: plot.clone(), source };
    let svg = plot_of(&truths, &half, device.driver()).document();
    atomic_write(&plot, |file| file.write_all(svg.as_bytes()).map_err(io_error))?;
    eprintln!("{}", plot.display());
    Ok(())
}

fn truths(names: &[String]) -> Result<Vec<Truth>> {
    let mut all = published()?;
    all.extend(ours());
    let mut wanted = Vec::new();
    for name in names {
        match all.iter().position(|truth| truth.name == *name) {
            Some(place) => wanted.push(all.swap_remove(place)),
            None => eprintln!("{name} is left out: it is neither ours nor in ../shared/data/nbrdf"),
        }
    }
    if wanted.is_empty() {
        bail!("no material of these names: {}", names.join(", "));
    }
    Ok(wanted)
}

/// What is known of a fit, or is found out now, unless only what is known is wanted.
fn outcome(arguments: &Arguments, device: &Arc<Device>, truth: &Truth, sizes: Sizes) -> Result<Option<Outcome>> {
    let plan = sizes.plan(arguments.quality, truth.is_isotropic);
    let path = arguments.folder.join(format!("{}-{}.json", truth.name, key(&plan)?));
    if arguments.print && !path.exists() {
        return Ok(None);
    }
    let find_out = || -> Result<Outcome> {
        let (session, cost) = train(truth, plan)?;
        let Some(brdf) = session.neubrdf() else { bail!("{}: trained to something else", truth.name) };
        let mut files = Vec::new();
        for precision in PRECISIONS {
            files.push(brdf.encode(precision)?);
        }
        let of_file = |place: usize| -> Result<(Errors, f64)> {
            // What is measured is what the file says, rounded numbers and all.
            let brdf = NeuBrdf::decode(&files[place])?;
            let evaluations = Evaluations::new(device, &brdf, PRECISIONS[place])?;
            let mut rates = Vec::new();
            for _ in 0..ROUNDS {
                rates.push(rate_by_own_time(&evaluations.run()?));
            }
            rates.sort_by(f64::total_cmp);
            Ok((errors(truth, &Evaluator::neubrdf(&brdf)), rates[ROUNDS / 2]))
        };
        let [(half, half_rate), (full, full_rate)] = [of_file(0)?, of_file(1)?];
        Ok(Outcome {
            errors: [half, full],
            bytes: [files[0].len(), files[1].len()],
            cpu_seconds: cost.cpu_seconds,
            rates: [half_rate, full_rate],
        })
    };
    kept(&path, find_out).map(Some)
}

/// A model in a precision, over all materials.
struct ModelPoint {
    axis: usize,
    /// Million evaluations a second, geometric mean.
    rate: f64,
    /// Mean |Δ ln(1 + f)|, geometric mean.
    error: f64,
    is_on_front: bool,
}

/// All models in one of [`PRECISIONS`].
fn points(models: &[Fitted], precision: usize) -> Vec<ModelPoint> {
    let mean = |values: Vec<f64>| (values.iter().map(|value| value.ln()).sum::<f64>() / values.len() as f64).exp();
    let of = |model: &Fitted| -> [f64; 2] {
        let rate = |outcome: &Outcome| outcome.rates[precision];
        let error = |outcome: &Outcome| outcome.errors[precision].log;
        [mean(model.outcomes.iter().map(rate).collect()), mean(model.outcomes.iter().map(error).collect())]
    };
    let all: Vec<[f64; 2]> = models.iter().map(of).collect();
    let is_better = |a: &[f64; 2], b: &[f64; 2]| a[0] >= b[0] && a[1] <= b[1] && a != b;
    let point = |(model, at): (&Fitted, &[f64; 2])| ModelPoint {
        axis: model.axis,
        rate: at[0],
        error: at[1],
        is_on_front: !all.iter().any(|other| is_better(other, at)),
    };
    models.iter().zip(&all).map(point).collect()
}

fn print_table(truths: &[Truth], models: &[Fitted], half: &[ModelPoint], full: &[ModelPoint]) {
    let names: Vec<&str> = truths.iter().map(|truth| truth.name.as_str()).collect();
    println!(
        "| N_side | codes | F | hidden | weights | M/s | M/s, f32 | error | error, f32 | {} | SSIM | albedo | bytes | CPU s |",
        names.join(" | ")
    );
    println!("|---|---|---|---|---|---|---|---|---|{}---|---|---|---|", "---|".repeat(truths.len()));
    for ((model, half), full) in models.iter().zip(half).zip(full) {
        let outcomes = &model.outcomes;
        let star = if half.is_on_front { " ★" } else { "" };
        let errors: Vec<String> = outcomes.iter().map(|outcome| format!("{:.4}", outcome.errors[0].log)).collect();
        let ssim = outcomes.iter().map(|outcome| outcome.errors[0].ssim).fold(f64::INFINITY, f64::min);
        let albedo = outcomes.iter().map(|outcome| outcome.errors[0].albedo).fold(0.0, f64::max);
        let bytes = outcomes.iter().map(|outcome| outcome.bytes[0]).max().unwrap_or(0);
        let seconds: f64 = outcomes.iter().map(|outcome| outcome.cpu_seconds).sum();
        println!(
            "| {} | {:.2} | {:.2} | {:.5}{star} | {:.5} | {} | {ssim:.4} | {:.1} % | {bytes} | {seconds:.0} |",
            model.sizes.name(),
            half.rate,
            full.rate,
            half.error,
            full.error,
            errors.join(" | "),
            100.0 * albedo
        );
    }
}

fn plot_of(truths: &[Truth], models: &[ModelPoint], driver: &str) -> Plot {
    let mut front: Vec<&ModelPoint> = models.iter().filter(|point| point.is_on_front).collect();
    front.sort_by(|a, b| a.rate.total_cmp(&b.rate));
    let front = front.windows(2).map(|ends| Series {
        style: 6,
        title: "Pareto front".to_owned(),
        points: Vec::new(),
        line: Some([[ends[0].rate, ends[0].error], [ends[1].rate, ends[1].error]]),
        floor: None,
    });
    let point = |of: &ModelPoint| Point { x: of.rate, y: of.error, interval: [of.error; 2] };
    let mut of_axes: Vec<Series> = AXES
        .iter()
        .enumerate()
        .map(|(style, (_, title))| {
            let points = models.iter().filter(|of| of.axis == style).map(point).collect();
            Series { style, title: (*title).to_owned(), points, line: None, floor: None }
        })
        .collect();
    // The default is drawn over the others.
    of_axes.rotate_left(1);
    let names: Vec<&str> = truths.iter().map(|truth| truth.name.as_str()).collect();
    Plot {
        title: "NeuBRDFs of several sizes, in f16, and the Pareto front".to_owned(),
        x_label: format!("million evaluations a second, {driver}"),
        y_label: format!("mean |Δ ln(1 + f)|: {}", names.join(", ")),
        series: front.chain(of_axes).collect(),
        reference_noise: 0.0,
    }
}
