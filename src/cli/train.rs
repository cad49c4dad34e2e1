//! `neubrdf train`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use glam::DVec3;
use neubrdf::image::write_file;
use neubrdf::scene::brdf::{CornerWeights, NeuBrdf, Precision};
use neubrdf::train::{
    Evaluator, Judged, Model, Plan, Quality, Recipe, RecipeResult, Report, Session, SurfacePlan, saved_steps,
};
use rayon::prelude::*;

use super::brdf_input::{BrdfInput, Drawing};
use super::job::{self, check_ending};
use super::judge::{Judgement, judge};
use super::train_loop::{finish, train};
use super::{progress, train_group};

/// Learn a BRDF.
#[derive(clap::Args)]
pub struct Arguments {
    /// What to learn: .binary (MERL), .bsdf (RGL), .csv (samples), .safetensors or .npy (NBRDF), .neubrdf, a material or a scene (.toml), or a
    /// directory of images (BTF)
    #[arg(required = true)]
    pub(super) inputs: Vec<PathBuf>,
    /// The material, where INPUT holds several; with --share it may be said several times, and means all if it is not
    #[arg(long)]
    pub(super) name: Vec<String>,
    /// Train the inputs together with one codebook a hemisphere, and write a pack of them
    #[arg(long)]
    pub(super) share: bool,
    /// Share the network, too: a material has but its indices to itself
    #[arg(long, requires = "share")]
    pub(super) share_network: bool,
    /// Put what is alike together: so many groups, each with codebooks and a pack of its own, FILE-1, FILE-2 …
    #[arg(long, value_name = "N", requires = "share", conflicts_with = "group_size", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) groups: Option<u32>,
    /// The same, of so many materials at most
    #[arg(long, value_name = "N", requires = "share", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) group_size: Option<u32>,
    /// The file to write: .neubrdf, or .safetensors with --model nbrdf. The report is written beside it, as .json and .html
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,
    /// What to train
    #[arg(long, value_enum, default_value = "neubrdf")]
    pub(super) model: Model,
    /// How to train it
    #[arg(long, value_enum, default_value = "default")]
    pub(super) recipe: Recipe,
    /// How long to train it
    #[arg(long, value_enum, default_value = "default")]
    pub(super) quality: Quality,
    /// Picks the random numbers; the same seed gives the same file
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,
    /// Share of measurements that is not learned, for the report to judge by; 0: all are learned
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, value_parser = share)]
    pub(super) hold_out: f64,
    /// Steps instead of the quality's
    #[arg(long)]
    pub(super) steps: Option<u32>,
    /// N_side of both grids: a power of two up to 128
    #[arg(long)]
    pub(super) n_side: Option<u32>,
    /// Resolutions of the grids: N_side, a half of it, a quarter …, each with features of its own; up to 4. By default 3 with --share and of
    /// anisotropic materials, else 1
    #[arg(long)]
    pub(super) resolutions: Option<usize>,
    /// Features of a code, up to 32
    #[arg(long)]
    pub(super) features: Option<usize>,
    /// Most codes of a hemisphere's codebook; by default each grid point has its own, and with --share there are 1024
    #[arg(long)]
    pub(super) codes: Option<usize>,
    /// Whether the network sees, beside features of both directions, where their half vector points; by default it does, but not by the other
    /// recipes
    #[arg(long, value_name = "true|false")]
    pub(super) half_vector: Option<bool>,
    /// Neurons of a hidden layer, up to 128
    #[arg(long)]
    pub(super) hidden: Option<usize>,
    /// Texels, of a material that varies: WxH, or as many across as down
    #[arg(long, value_parser = texels)]
    pub(super) texels: Option<[u32; 2]>,
    /// Features of a texel, up to 32
    #[arg(long)]
    pub(super) texel_features: Option<usize>,
    /// Most codes of the texels' codebook; by default each texel has its own, as long as there are not more than indices can name
    #[arg(long)]
    pub(super) texel_codes: Option<usize>,
    /// uniform or bilinear
    #[arg(long, value_parser = corner_weights)]
    pub(super) corner_weights: Option<CornerWeights>,
    /// Store 32 bits a number instead of 16
    #[arg(long)]
    pub(super) f32: bool,
    /// Save resumable state to this file about twice a minute; without --resume it must not be there yet
    #[arg(long, value_name = "FILE")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Go on from the --checkpoint file
    #[arg(long, requires = "checkpoint")]
    pub(super) resume: bool,
    /// Train by the other recipes as well, and let the report compare them
    #[arg(long, conflicts_with = "no_report")]
    pub(super) compare_recipes: bool,
    /// Write no report
    #[arg(long)]
    pub(super) no_report: bool,
    /// No bar and no summary
    #[arg(long)]
    pub(super) quiet: bool,
}

/// Loads, trains, measures, writes.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    let expected = match arguments.model {
        Model::NeuBrdf => "neubrdf",
        Model::Nbrdf => "safetensors",
    };
    check_ending(&arguments.output, &[expected])?;
    if let Some(options) = size_options(&arguments).filter(|_| arguments.model == Model::Nbrdf) {
        bail!("{options}: an NBRDF has one size, 6 → 21 → 21 → 3, and 32 bits a number; leave this out");
    }
    if arguments.share {
        return train_group::run(&arguments);
    }
    check_outputs(&arguments, &arguments.output, arguments.checkpoint.as_deref())?;
    let ([path], [] | [_]) = (arguments.inputs.as_slice(), arguments.name.as_slice()) else {
        bail!("several materials: say --share to train them together");
    };
    let name = arguments.name.first().map(String::as_str);
    let input = BrdfInput::load(path, name, drawing(&arguments))?;
    let is_isotropic = input.brdf.is_isotropic();
    if arguments.model == Model::Nbrdf && !is_isotropic {
        bail!("{}: an NBRDF file describes isotropic materials, and this one is not", path.display());
    }
    if let Some(options) = texel_options(&arguments).filter(|_| input.texels.is_none()) {
        bail!("{options}: {} is the same everywhere, and has no texels", path.display());
    }
    if arguments.model == Model::Nbrdf && arguments.compare_recipes {
        bail!("--compare-recipes: NBRDFs are trained by one recipe");
    }
    let plan = plan(&arguments, &input, input.brdf.is_isotropic_in_frames());
    let others = Recipe::value_variants().iter().filter(|recipe| **recipe != arguments.recipe);
    let others: Vec<Plan> = others
        .filter(|_| arguments.compare_recipes)
        .map(|recipe| recipe_plan(&arguments, &input, *recipe, input.brdf.is_isotropic_in_frames()))
        .collect();
    others.iter().try_for_each(Plan::validate)?;
    let eval = |wo: DVec3, wi: DVec3| input.brdf.eval(wo, wi);
    let mut session = Session::new(plan, &input.ground_truth(&eval))?;
    if let Some(path) = arguments.checkpoint.as_deref().filter(|_| arguments.resume) {
        session.restore(path)?;
    }

    let interrupted = progress::interrupt_flag()?;
    train(&mut session, arguments.checkpoint.as_deref(), &interrupted, arguments.quiet)?;
    let seconds = session.seconds();

    let precision = if arguments.f32 { Precision::F32 } else { Precision::F16 };
    let finished = |session: &Session| finish(session, &input.ground_truth(&eval), arguments.quiet);
    let (bytes, evaluator, Judgement { judged, balls }) = match finished(&session) {
        Some(mut brdf) => {
            // What is measured is what the file says, rounded numbers and all.
            let evaluator = Evaluator::neubrdf(&NeuBrdf::decode(&brdf.encode(precision)?)?);
            let judgement = judge(&input, &|queries| evaluator.eval_at(queries), !arguments.no_report);
            brdf.provenance = provenance(&input, &session, &judgement.judged);
            (brdf.encode(precision)?, evaluator, judgement)
        }
        None => {
            let network = session.nbrdf().context("the model is of no kind that can be written")?;
            let evaluator = session.evaluator();
            let judgement = judge(&input, &|queries| evaluator.eval_at(queries), !arguments.no_report);
            (network.to_safetensors(name.unwrap_or("material")), evaluator, judgement)
        }
    };
    write_file(&arguments.output, &bytes)?;
    let mut recipes = Vec::new();
    if arguments.compare_recipes {
        let judged = judged.clone();
        recipes.push(RecipeResult { recipe: arguments.recipe, bytes: bytes.len(), seconds, judged });
        let is_interrupted = || interrupted.load(Ordering::SeqCst);
        for plan in others.into_iter().take_while(|_| !is_interrupted()) {
            let recipe = plan.recipe;
            let mut session = Session::new(plan, &input.ground_truth(&eval))?;
            train(&mut session, None, &interrupted, arguments.quiet)?;
            if is_interrupted() {
                break;
            }
            let file = finished(&session).context("a recipe trains NeuBRDFs")?.encode(precision)?;
            let evaluator = Evaluator::neubrdf(&NeuBrdf::decode(&file)?);
            let judged = judge(&input, &|queries| evaluator.eval_at(queries), false).judged;
            recipes.push(RecipeResult { recipe, bytes: file.len(), seconds: session.seconds(), judged });
        }
        if is_interrupted() {
            // What was broken off compares with nothing.
            note!("interrupted: the report compares the recipes that were trained to their ends");
        }
    }
    let report = Report {
        source: input.name.clone(),
        plan: session.plan.clone(),
        steps: session.steps(),
        loss: session.loss(),
        seconds,
        bytes: bytes.len(),
        judged,
        recipes,
    };
    if let Some(balls) = balls.filter(|_| !arguments.no_report) {
        report.write_json(&arguments.output.with_extension("json"))?;
        let fit = |pairs: &[[DVec3; 2]]| evaluator.eval(pairs);
        let page = arguments.output.with_extension("html");
        report.write_html(&page, &balls, session.gain(), &fit, &|pairs| truth(&input, pairs))?;
    }
    if !arguments.quiet {
        let interrupted = if session.steps() < session.plan.steps { "interrupted: " } else { "" };
        tell!(
            "{interrupted}{}: {} bytes, {} steps in {seconds:.1} s; {}",
            arguments.output.display(),
            report.bytes,
            report.steps,
            report.judged.summary()
        )?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Tells before the work what could not be written after it: the file and its report, if there is to be one, and the checkpoint.
pub(super) fn check_outputs(arguments: &Arguments, output: &Path, checkpoint: Option<&Path>) -> Result<()> {
    let [json, html] = ["json", "html"].map(|ending| output.with_extension(ending));
    let report = [json.as_path(), html.as_path()].into_iter().filter(|_| !arguments.no_report);
    let outputs = [output].into_iter().chain(report).chain(checkpoint);
    job::check_outputs(outputs, arguments.inputs.iter().map(PathBuf::as_path))?;
    if let Some(path) = checkpoint.filter(|path| !arguments.resume && path.is_file()) {
        // Without a word it would be lost.
        let steps = saved_steps(path)?;
        bail!("{}: holds a training of {steps} steps; say --resume to go on with it, or remove it", path.display());
    }
    Ok(())
}

/// Those of the sizes of a NeuBRDF that were given, by their names.
fn size_options(arguments: &Arguments) -> Option<String> {
    given(&[
        ("--n-side", arguments.n_side.is_some()),
        ("--resolutions", arguments.resolutions.is_some()),
        ("--features", arguments.features.is_some()),
        ("--codes", arguments.codes.is_some()),
        ("--half-vector", arguments.half_vector.is_some()),
        ("--hidden", arguments.hidden.is_some()),
        ("--corner-weights", arguments.corner_weights.is_some()),
        ("--f32", arguments.f32),
    ])
}

/// The same of texels.
pub(super) fn texel_options(arguments: &Arguments) -> Option<String> {
    given(&[
        ("--texels", arguments.texels.is_some()),
        ("--texel-features", arguments.texel_features.is_some()),
        ("--texel-codes", arguments.texel_codes.is_some()),
    ])
}

fn given(options: &[(&str, bool)]) -> Option<String> {
    let names: Vec<&str> = options.iter().filter(|(_, is_given)| *is_given).map(|(name, _)| *name).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

fn corner_weights(word: &str) -> Result<CornerWeights, String> {
    match word {
        "uniform" => Ok(CornerWeights::Uniform),
        "bilinear" => Ok(CornerWeights::Bilinear),
        _ => Err(format!("'{word}' are no weights: expected uniform or bilinear")),
    }
}

fn share(word: &str) -> Result<f64, String> {
    let share = word.parse().ok().filter(|share| (0.0..=0.5).contains(share));
    share.ok_or_else(|| format!("'{word}' is no such share: expected a number from 0 to 0.5"))
}

fn texels(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once('x').unwrap_or((text, text));
    match (width.parse(), height.parse()) {
        (Ok(width), Ok(height)) => Ok([width, height]),
        _ => Err(format!("'{text}' is no size: expected texels across and down, such as 64x32")),
    }
}

/// How measurements over a texture are made pairs.
pub(super) fn drawing(arguments: &Arguments) -> Drawing {
    let Arguments { texels, model, recipe, quality, hold_out, seed, .. } = *arguments;
    Drawing { texels, pairs: Plan::new(model, recipe, quality, false).pairs, hold_out, seed }
}

/// What a recipe does, in as many steps as are asked for, for measurements if there are but so many.
fn recipe_plan(arguments: &Arguments, input: &BrdfInput, recipe: Recipe, is_isotropic: bool) -> Plan {
    let Arguments { model, quality, seed, steps, .. } = *arguments;
    let plan = Plan::new(model, recipe, quality, is_isotropic);
    let plan = Plan { seed, steps: steps.unwrap_or(plan.steps), ..plan };
    let plan = match arguments.texels.filter(|_| input.texels.is_some()).or(input.texels) {
        Some(texels) => plan.over(texels),
        None => plan,
    };
    match input.sample_count() {
        Some(count) => plan.for_samples(count),
        None => plan,
    }
}

/// What is done: the same, of the sizes that are asked for.
pub(super) fn plan(arguments: &Arguments, input: &BrdfInput, is_isotropic: bool) -> Plan {
    let plan = recipe_plan(arguments, input, arguments.recipe, is_isotropic);
    let n_side = arguments.n_side.map_or(plan.n_side, |n_side| [n_side; 2]);
    // As many as there is room for.
    let most = n_side[0].max(1).ilog2() as usize + 1;
    let plan = match arguments.resolutions {
        Some(resolutions) => Plan { resolutions, ..plan },
        None => plan.with_resolutions_up_to(most),
    };
    let Plan { features, codes, surface, sees_half_vector, hidden, pruned, corner_weights, .. } = plan;
    let surface = surface.map(|surface| SurfacePlan {
        features: arguments.texel_features.unwrap_or(surface.features),
        codes: arguments.texel_codes.unwrap_or(surface.codes),
        ..surface
    });
    let hidden = arguments.hidden.unwrap_or(hidden);
    Plan {
        n_side,
        features: arguments.features.unwrap_or(features),
        codes: arguments.codes.map_or(codes, |codes| [codes; 2]),
        surface,
        sees_half_vector: arguments.half_vector.unwrap_or(sees_half_vector),
        hidden,
        pruned: pruned.min(hidden),
        corner_weights: arguments.corner_weights.unwrap_or(corner_weights),
        ..plan
    }
}

/// What the input is drawn as, beside a fit.
pub(super) fn truth(input: &BrdfInput, pairs: &[[DVec3; 2]]) -> Vec<DVec3> {
    pairs.par_iter().map(|[wo, wi]| input.brdf.eval(*wo, *wi)).collect()
}

pub(super) fn provenance(input: &BrdfInput, session: &Session, judged: &Judged) -> neubrdf::scene::brdf::Provenance {
    let plan = &session.plan;
    let training = [
        ("recipe", format!("{:?}", plan.recipe).to_lowercase()),
        ("steps", session.steps().to_string()),
        ("batch", plan.batch.to_string()),
        ("seed", plan.seed.to_string()),
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
    ];
    neubrdf::scene::brdf::Provenance {
        source: input.name.clone(),
        training: training.map(|(name, value)| (name.to_owned(), value)).into(),
        errors: judged.figures().into_iter().map(|figure| (figure.name.to_owned(), figure.value)).collect(),
    }
}
