//! `neubrdf train`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use glam::DVec3;
use neubrdf::image::atomic_write;
use neubrdf::scene::brdf::{CornerWeights, NeuBrdf, Precision};
use neubrdf::train::measure::{Comparison, FitErrors, compare};
use neubrdf::train::{Evaluator, Model, Plan, Quality, Recipe, RecipeResult, Report, Session};
use rayon::prelude::*;

use super::brdf_input::BrdfInput;
use super::job::check_writable;
use super::progress;

/// Learn a BRDF.
#[derive(clap::Args)]
pub struct Arguments {
    /// What to learn: .binary (MERL), .bsdf (RGL), .csv (samples), .safetensors or .npy (NBRDF), .neubrdf, or a material or a scene (.toml)
    input: PathBuf,
    /// The material, where INPUT holds several
    #[arg(long)]
    name: Option<String>,
    /// The file to write: .neubrdf, or .safetensors with --model nbrdf. The report is written beside it, as .json and .html
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// What to train
    #[arg(long, value_enum, default_value = "neubrdf")]
    model: Model,
    /// How to train it
    #[arg(long, value_enum, default_value = "default")]
    recipe: Recipe,
    /// How long to train it
    #[arg(long, value_enum, default_value = "default")]
    quality: Quality,
    /// Picks the random numbers; the same seed gives the same file
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Steps instead of the quality's
    #[arg(long)]
    steps: Option<u32>,
    /// N_side of both grids: a power of two up to 128
    #[arg(long)]
    n_side: Option<u32>,
    /// Features of a code, up to 32
    #[arg(long)]
    features: Option<usize>,
    /// Most codes of a hemisphere's codebook; by default each grid point has its own
    #[arg(long)]
    codes: Option<usize>,
    /// Neurons of a hidden layer, up to 128
    #[arg(long)]
    hidden: Option<usize>,
    /// uniform or bilinear
    #[arg(long, value_parser = corner_weights)]
    corner_weights: Option<CornerWeights>,
    /// Store 32 bits a number instead of 16
    #[arg(long)]
    f32: bool,
    /// Save resumable state to this file about twice a minute
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Go on from the --checkpoint file
    #[arg(long, requires = "checkpoint")]
    resume: bool,
    /// Train by the other recipes as well, and let the report compare them
    #[arg(long, conflicts_with = "no_report")]
    compare_recipes: bool,
    /// Write no report
    #[arg(long)]
    no_report: bool,
    /// No bar and no summary
    #[arg(long)]
    quiet: bool,
}

/// Seconds between two checkpoints.
const CHECKPOINT_INTERVAL: f64 = 30.0;

/// Pixels to a side of the report's balls.
const BALL: usize = 160;

/// Steps between two looks at the clock and the interrupt.
const STRIDE: u32 = 16;

/// Loads, trains, measures, writes.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    let expected = match arguments.model {
        Model::NeuBrdf => "neubrdf",
        Model::Nbrdf => "safetensors",
    };
    if arguments.output.extension().and_then(|ending| ending.to_str()) != Some(expected) {
        bail!("{}: the file to write must end in .{expected}", arguments.output.display());
    }
    for path in [Some(&arguments.output), arguments.checkpoint.as_ref()].into_iter().flatten() {
        check_writable(path)?;
    }
    let input = BrdfInput::load(&arguments.input, arguments.name.as_deref())?;
    let is_isotropic = input.brdf.is_isotropic();
    if arguments.model == Model::Nbrdf && !is_isotropic {
        bail!("{}: an NBRDF file describes isotropic materials, and this one is not", arguments.input.display());
    }
    if arguments.model == Model::Nbrdf && arguments.compare_recipes {
        bail!("--compare-recipes: NBRDFs are trained by one recipe");
    }
    let plan = plan(&arguments, &input);
    let eval = |wo: DVec3, wi: DVec3| input.brdf.eval(wo, wi);
    let mut session = Session::new(plan, &input.ground_truth(&eval))?;
    if let Some(path) = arguments.checkpoint.as_deref().filter(|_| arguments.resume) {
        session.restore(path)?;
    }

    let started = Instant::now();
    train(&arguments, &mut session, arguments.checkpoint.as_deref())?;
    let seconds = started.elapsed().as_secs_f64();

    let precision = if arguments.f32 { Precision::F32 } else { Precision::F16 };
    let measure = |evaluator: &Evaluator, size: usize| -> Comparison {
        let fit = |pairs: &[[DVec3; 2]]| evaluator.eval(pairs);
        compare(size, is_isotropic, &fit, &|pairs| truth(&input, pairs))
    };
    let (bytes, evaluator, comparison) = match session.neubrdf() {
        Some(mut brdf) => {
            // What is measured is what the file says, rounded numbers and all.
            let evaluator = Evaluator::neubrdf(&NeuBrdf::decode(&brdf.encode(precision)?)?);
            let comparison = measure(&evaluator, BALL);
            brdf.provenance = provenance(&input, &session, &comparison.errors);
            (brdf.encode(precision)?, evaluator, comparison)
        }
        None => {
            let network = session.nbrdf().context("the model is of no kind that can be written")?;
            let evaluator = session.evaluator();
            let comparison = measure(&evaluator, BALL);
            (network.to_safetensors(arguments.name.as_deref().unwrap_or("material")), evaluator, comparison)
        }
    };
    write(&arguments.output, &bytes)?;
    let mut recipes = Vec::new();
    if arguments.compare_recipes {
        let errors = comparison.errors.clone();
        recipes.push(RecipeResult { recipe: arguments.recipe, bytes: bytes.len(), seconds, errors });
        for recipe in Recipe::value_variants().iter().filter(|recipe| **recipe != arguments.recipe) {
            let mut session = Session::new(recipe_plan(&arguments, &input, *recipe), &input.ground_truth(&eval))?;
            let started = Instant::now();
            train(&arguments, &mut session, None)?;
            let seconds = started.elapsed().as_secs_f64();
            let file = session.neubrdf().context("a recipe trains NeuBRDFs")?.encode(precision)?;
            let errors = measure(&Evaluator::neubrdf(&NeuBrdf::decode(&file)?), BALL).errors;
            recipes.push(RecipeResult { recipe: *recipe, bytes: file.len(), seconds, errors });
        }
    }
    let report = Report {
        source: input.name.clone(),
        plan: session.plan.clone(),
        steps: session.steps(),
        loss: session.loss(),
        seconds,
        bytes: bytes.len(),
        errors: comparison.errors.clone(),
        recipes,
    };
    if !arguments.no_report {
        report.write_json(&arguments.output.with_extension("json"))?;
        let fit = |pairs: &[[DVec3; 2]]| evaluator.eval(pairs);
        let page = arguments.output.with_extension("html");
        report.write_html(&page, &comparison, session.gain(), &fit, &|pairs| truth(&input, pairs))?;
    }
    if !arguments.quiet {
        let FitErrors { pairs, ball, worst_albedo, .. } = &report.errors;
        println!(
            "{}: {} bytes, {} steps in {seconds:.1} s; ball SSIM {:.4}, FLIP {:.4}; mean |Δ ln(1+f)| {:.5}, worst albedo {:.2} %",
            arguments.output.display(),
            report.bytes,
            report.steps,
            ball.ssim,
            ball.flip,
            pairs.log,
            100.0 * worst_albedo
        );
    }
    Ok(ExitCode::SUCCESS)
}

fn corner_weights(word: &str) -> Result<CornerWeights, String> {
    match word {
        "uniform" => Ok(CornerWeights::Uniform),
        "bilinear" => Ok(CornerWeights::Bilinear),
        _ => Err(format!("'{word}' are no weights: expected uniform or bilinear")),
    }
}

/// What a recipe does, in as many steps as are asked for.
fn recipe_plan(arguments: &Arguments, input: &BrdfInput, recipe: Recipe) -> Plan {
    let Arguments { model, quality, seed, steps, .. } = *arguments;
    let plan = Plan::new(model, recipe, quality, input.brdf.is_isotropic());
    let plan = Plan { seed, steps: steps.unwrap_or(plan.steps), ..plan };
    match input.sample_count() {
        Some(count) => plan.for_samples(count),
        None => plan,
    }
}

/// What is done: the same, of the sizes that are asked for.
fn plan(arguments: &Arguments, input: &BrdfInput) -> Plan {
    let plan = recipe_plan(arguments, input, arguments.recipe);
    let Plan { n_side, features, codes, hidden, pruned, corner_weights, .. } = plan;
    let hidden = arguments.hidden.unwrap_or(hidden);
    Plan {
        n_side: arguments.n_side.map_or(n_side, |n_side| [n_side; 2]),
        features: arguments.features.unwrap_or(features),
        codes: arguments.codes.map_or(codes, |codes| [codes; 2]),
        hidden,
        pruned: pruned.min(hidden),
        corner_weights: arguments.corner_weights.unwrap_or(corner_weights),
        ..plan
    }
}

fn truth(input: &BrdfInput, pairs: &[[DVec3; 2]]) -> Vec<DVec3> {
    pairs.par_iter().map(|[wo, wi]| input.brdf.eval(*wo, *wi)).collect()
}

/// Trains under a bar, with checkpoints, until the end or Ctrl-C.
fn train(arguments: &Arguments, session: &mut Session, checkpoint: Option<&Path>) -> Result<()> {
    let interrupted = progress::interrupt_flag()?;
    let bar = progress::bar(session.plan.steps.into(), arguments.quiet);
    let mut last_checkpoint = Instant::now();
    let mut is_winding_down = false;
    while !session.is_done() {
        for _ in 0..STRIDE {
            if !session.is_done() {
                session.step();
            }
        }
        bar.set_position(session.steps().into());
        bar.set_message(format!("loss {:.5}", session.loss()));
        if is_winding_down {
            continue;
        }
        let is_interrupted = interrupted.load(Ordering::SeqCst);
        if let Some(path) = checkpoint
            && (is_interrupted || last_checkpoint.elapsed().as_secs_f64() >= CHECKPOINT_INTERVAL)
        {
            session.save(path)?;
            last_checkpoint = Instant::now();
        }
        if is_interrupted {
            // The checkpoint goes on as if nothing had happened; the file gets the best that can be had soon.
            session.wind_down();
            is_winding_down = true;
        }
    }
    bar.finish();
    Ok(())
}

fn provenance(input: &BrdfInput, session: &Session, errors: &FitErrors) -> neubrdf::scene::brdf::Provenance {
    let plan = &session.plan;
    let training = [
        ("recipe", format!("{:?}", plan.recipe).to_lowercase()),
        ("steps", session.steps().to_string()),
        ("batch", plan.batch.to_string()),
        ("seed", plan.seed.to_string()),
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    let errors = [
        ("ball SSIM", errors.ball.ssim),
        ("ball FLIP", errors.ball.flip),
        ("mean |Δ ln(1+f)|", errors.pairs.log),
        ("relative RMSE of f cos", errors.pairs.relative_rmse),
        ("worst relative albedo error", errors.worst_albedo),
    ];
    neubrdf::scene::brdf::Provenance {
        source: input.name.clone(),
        training: training.map(|(name, value)| (name.to_owned(), value)).into(),
        errors: errors.map(|(name, value)| (name.to_owned(), value)).into(),
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let io_error = |source| neubrdf::image::Error::Io { path: path.to_owned(), source };
    Ok(atomic_write(path, |file| file.write_all(bytes).map_err(io_error))?)
}
