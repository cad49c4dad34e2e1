//! `make study`: what sizes of a NeuBRDF are worth their time on the device.
//!
//! A few materials are fitted with models around the default, one size at a time and some together. Each fit leaves a JSON file and a
//! `.neubrdf` in the folder, and is not done again; the device's kernel is timed each time. Prints a table in Markdown, in which ★ marks
//! the Pareto front of (evaluations a second, error), and draws it.

#[path = "../benches/render/evaluations.rs"]
mod evaluations;
mod study;

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use clap::Parser;
use evaluations::Evaluations;
use neubrdf::converge::study::plot::{Plot, Point, Series};
use neubrdf::gpu::{Device, DeviceChoice, Instance, Validation};
use neubrdf::image::write_file;
use neubrdf::scene::brdf::{CornerWeights, NeuBrdf, Precision};
use neubrdf::train::{Evaluator, Model, Plan, Quality, Recipe};
use serde::{Deserialize, Serialize};
use study::{Errors, Trained, Truth, bar, errors, kept, key, ours, published, train};

/// Fit models of several sizes and print which are worth their time.
#[derive(Parser)]
struct Arguments {
    /// Names of materials of `make study-fit`
    #[arg(default_values = ["chrome-steel", "gold-0.1x0.4", "layered-gold-0.1"])]
    materials: Vec<String>,
    #[arg(long, value_enum, default_value = "draft")]
    quality: Quality,
    /// Which sizes to vary: default, n-side, codes, features, hidden, weights, together, resolutions or blind; all without
    #[arg(long, value_delimiter = ',')]
    axis: Vec<String>,
    /// Where results and the plot are kept
    #[arg(long, default_value = "target/study")]
    folder: PathBuf,
    /// Fit nothing: time, print and draw the models that were fitted to all materials
    #[arg(long)]
    print: bool,
    /// Fit, and leave the rest to another machine
    #[arg(long, conflicts_with = "print")]
    fit: bool,
    /// What is timed: part of a device's name, or its place in the list of `neubrdf info`
    #[arg(long)]
    device: Option<String>,
}

/// What is varied, each with the plot's words for it.
const AXES: [(&str, &str); 9] = [
    ("default", "the defaults"),
    ("n-side", "N_side, each point its own code"),
    ("codes", "2ᵇ codes a hemisphere"),
    ("features", "features a resolution"),
    ("hidden", "hidden neurons"),
    ("weights", "¼ a corner"),
    ("together", "several at once"),
    ("resolutions", "other resolutions"),
    ("blind", "without the half vector"),
];

/// The sizes of a model.
#[derive(Clone, Copy)]
struct Sizes {
    n_side: u32,
    resolutions: usize,
    /// b: a hemisphere has 2ᵇ codes; without, each point has its own.
    code_bits: Option<u32>,
    /// F, on each grid.
    features: usize,
    sees_half_vector: bool,
    hidden: usize,
    corner_weights: CornerWeights,
}

/// That of anisotropic materials; isotropic ones have one resolution of 8 features.
const DEFAULT: Sizes = Sizes {
    n_side: 16,
    resolutions: 3,
    code_bits: None,
    features: 4,
    sees_half_vector: true,
    hidden: 32,
    corner_weights: CornerWeights::Bilinear,
};

/// All models, with the place of their axis in [`AXES`].
fn models() -> Vec<(usize, Sizes)> {
    let single = Sizes { resolutions: 1, features: 8, ..DEFAULT };
    let mut models = vec![(0, DEFAULT), (0, single)];
    models.extend([8, 32, 64].map(|n_side| (1, Sizes { n_side, ..DEFAULT })));
    let codes = [(16, 4), (16, 6), (16, 8), (16, 10), (64, 4), (64, 6), (64, 8), (64, 10)];
    models.extend(codes.map(|(n_side, bits)| (2, Sizes { n_side, code_bits: Some(bits), ..DEFAULT })));
    models.extend([2, 3, 6, 8].map(|features| (3, Sizes { features, ..DEFAULT })));
    models.extend([16, 24, 48, 64, 96, 128].map(|hidden| (4, Sizes { hidden, ..DEFAULT })));
    let uniform = Sizes { corner_weights: CornerWeights::Uniform, ..DEFAULT };
    models.extend([16, 64].map(|n_side| (5, Sizes { n_side, ..uniform })));
    let papers = Sizes { n_side: 64, code_bits: Some(8), features: 16, ..single };
    models.push((5, Sizes { corner_weights: CornerWeights::Uniform, ..papers }));
    for (features, hidden) in [(2, 16), (3, 16), (3, 24), (6, 24), (3, 48), (6, 48), (6, 64)] {
        models.push((6, Sizes { features, hidden, ..DEFAULT }));
    }
    let pyramids = [
        (16, 1, 4),
        (16, 1, 6),
        (16, 1, 12),
        (16, 1, 16),
        (16, 2, 4),
        (16, 2, 6),
        (16, 2, 8),
        (16, 4, 3),
        (16, 4, 4),
        (32, 1, 12),
        (32, 2, 6),
        (32, 4, 3),
        (64, 4, 3),
    ];
    models.extend(
        pyramids.map(|(n_side, resolutions, features)| (7, Sizes { n_side, resolutions, features, ..DEFAULT })),
    );
    // The paper's N_side and codes, in one resolution and, with as many features, in four.
    models.extend([papers, Sizes { resolutions: 4, features: 4, ..papers }].map(|sizes| (7, sizes)));
    models.extend([16, 32, 64, 128].map(|hidden| (8, Sizes { sees_half_vector: false, hidden, ..DEFAULT })));
    models
}

impl Sizes {
    fn plan(&self, quality: Quality, is_isotropic: bool) -> Plan {
        let plan = Plan::new(Model::NeuBrdf, Recipe::Default, quality, is_isotropic);
        Plan {
            n_side: [self.n_side; 2],
            resolutions: self.resolutions,
            codes: self.code_bits.map_or(plan.codes, |bits| [1 << bits; 2]),
            features: self.features,
            sees_half_vector: self.sees_half_vector,
            hidden: self.hidden,
            pruned: self.hidden,
            corner_weights: self.corner_weights,
            ..plan
        }
    }

    fn name(&self) -> String {
        let codes = self.code_bits.map_or("own".to_owned(), |bits| format!("2^{bits}"));
        let features = format!("{} × {}", self.resolutions, self.features);
        let weights = match self.corner_weights {
            CornerWeights::Uniform => "¼",
            CornerWeights::Bilinear => "bilinear",
        };
        let half_vector = if self.sees_half_vector { "yes" } else { "no" };
        format!("{} | {codes} | {features} | {half_vector} | {} | {weights}", self.n_side, self.hidden)
    }
}

const PRECISIONS: [Precision; 2] = [Precision::F16, Precision::F32];

/// A fit of one material, stored in each of [`PRECISIONS`].
#[derive(Clone, Serialize, Deserialize)]
struct Outcome {
    errors: [Errors; 2],
    bytes: [usize; 2],
}

/// A model, fitted to each material.
struct Fitted {
    axis: usize,
    sizes: Sizes,
    outcomes: Vec<Outcome>,
    /// Million evaluations a second of the device in each of [`PRECISIONS`], geometric mean over materials.
    rates: [f64; 2],
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
    let mut fitted = fit(&arguments, &truths, models)?;
    if arguments.fit {
        return Ok(());
    }
    let choice = arguments.device.clone().map_or(DeviceChoice::Auto, DeviceChoice::Named);
    let device = Instance::new(Validation::Off)?.open(&choice)?;
    time(&arguments, &device, &truths, &mut fitted)?;
    let [half, full] = [0, 1].map(|precision| points(&fitted, precision));
    print_table(&truths, &fitted, &half, &full);
    let plot = arguments.folder.join("study.svg");
    println!("\nOn {}, {}.", device.name(), device.driver());
    write_file(&plot, plot_of(&half).document())?;
    eprintln!("{}", plot.display());
    Ok(())
}

/// Those that are, or can be, fitted to all materials.
fn fit(arguments: &Arguments, truths: &[Truth], models: Vec<(usize, Sizes)>) -> Result<Vec<Fitted>> {
    let bar = bar(models.len() * truths.len())?;
    let mut fitted = Vec::new();
    for (axis, sizes) in models {
        let mut outcomes = Vec::new();
        for truth in truths {
            bar.set_message(format!("{}: {}", sizes.name().replace(" |", ","), truth.name));
            outcomes.extend(outcome(arguments, truth, sizes)?);
            bar.inc(1);
        }
        if outcomes.len() == truths.len() {
            fitted.push(Fitted { axis, sizes, outcomes, rates: [0.0; 2] });
        }
    }
    bar.finish_and_clear();
    Ok(fitted)
}

/// Times all, one after another.
fn time(arguments: &Arguments, device: &Arc<Device>, truths: &[Truth], fitted: &mut [Fitted]) -> Result<()> {
    let bar = bar(fitted.len())?;
    for model in fitted {
        bar.set_message(model.sizes.name().replace(" |", ","));
        for (rate, precision) in model.rates.iter_mut().zip(PRECISIONS) {
            let mut rates = Vec::new();
            for truth in truths {
                let path = fit_path(arguments, truth, model.sizes)?.with_extension("neubrdf");
                let brdf = NeuBrdf::decode(&std::fs::read(&path).with_context(|| path.display().to_string())?)?;
                let evaluations = Evaluations::new(device, &brdf, precision)?;
                let timings = evaluations.timings(ROUNDS)?;
                let mut of_rounds: Vec<f64> = timings.iter().map(|timing| evaluations.own_rate(timing)).collect();
                of_rounds.sort_by(f64::total_cmp);
                rates.push(of_rounds[ROUNDS / 2]);
            }
            *rate = geometric_mean(&rates);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(())
}

fn geometric_mean(values: &[f64]) -> f64 {
    (values.iter().map(|value| value.ln()).sum::<f64>() / values.len() as f64).exp()
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

/// Where a fit's outcome is kept.
fn fit_path(arguments: &Arguments, truth: &Truth, sizes: Sizes) -> Result<PathBuf> {
    let plan = sizes.plan(arguments.quality, truth.is_isotropic);
    Ok(arguments.folder.join(format!("{}-{}.json", truth.name, key(&plan)?)))
}

/// What is known of a fit, or is found out now, unless only what is known is wanted.
fn outcome(arguments: &Arguments, truth: &Truth, sizes: Sizes) -> Result<Option<Outcome>> {
    let path = fit_path(arguments, truth, sizes)?;
    if arguments.print && !path.exists() {
        return Ok(None);
    }
    let find_out = || -> Result<Outcome> {
        let Trained { brdf, .. } = train(truth, sizes.plan(arguments.quality, truth.is_isotropic))?;
        let Some(brdf) = brdf else { bail!("{}: trained to something else", truth.name) };
        let mut files = Vec::new();
        for precision in PRECISIONS {
            files.push(brdf.encode(precision)?);
        }
        let [half, full] = [&files[0], &files[1]];
        write_file(path.with_extension("neubrdf"), full)?;
        // What is measured is what the file says, rounded numbers and all.
        let of_file =
            |file: &[u8]| -> Result<Errors> { Ok(errors(truth, &Evaluator::neubrdf(&NeuBrdf::decode(file)?))) };
        Ok(Outcome { errors: [of_file(half)?, of_file(full)?], bytes: [half.len(), full.len()] })
    };
    kept(&path, find_out).map(Some)
}

/// A model in a precision, over all materials.
struct ModelPoint {
    axis: usize,
    /// Million evaluations a second.
    rate: f64,
    /// Mean |Δ ln(1 + f)|, geometric mean.
    error: f64,
    is_on_front: bool,
}

/// All models in one of [`PRECISIONS`].
fn points(models: &[Fitted], precision: usize) -> Vec<ModelPoint> {
    let of = |model: &Fitted| -> [f64; 2] {
        let errors: Vec<f64> = model.outcomes.iter().map(|outcome| outcome.errors[precision].log).collect();
        [model.rates[precision], geometric_mean(&errors)]
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
        "| N_side | codes | resolutions × F | half vector | hidden | weights | M/s | M/s, f32 | error | error, f32 | {} | SSIM | albedo | bytes |",
        names.join(" | ")
    );
    println!("|---|---|---|---|---|---|---|---|---|---|{}---|---|---|", "---|".repeat(truths.len()));
    for ((model, half), full) in models.iter().zip(half).zip(full) {
        let outcomes = &model.outcomes;
        let star = if half.is_on_front { " ★" } else { "" };
        let errors: Vec<String> = outcomes.iter().map(|outcome| format!("{:.4}", outcome.errors[0].log)).collect();
        let ssim = outcomes.iter().map(|outcome| outcome.errors[0].ssim).fold(f64::INFINITY, f64::min);
        let albedo = outcomes.iter().map(|outcome| outcome.errors[0].albedo).fold(0.0, f64::max);
        let bytes = outcomes.iter().map(|outcome| outcome.bytes[0]).max().unwrap_or(0);
        println!(
            "| {} | {:.2} | {:.2} | {:.5}{star} | {:.5} | {} | {ssim:.4} | {:.1} % | {bytes} |",
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

fn plot_of(models: &[ModelPoint]) -> Plot {
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
    Plot {
        title: "NeuBRDFs of several sizes, in f16, and the Pareto front".to_owned(),
        x_label: "million evaluations a second".to_owned(),
        y_label: "mean |Δ ln(1 + f)|, geometric mean".to_owned(),
        series: front.chain(of_axes).collect(),
        reference_noise: 0.0,
    }
}
