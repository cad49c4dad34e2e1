//! `make study-fit`: how well models fit ground truths, and at what cost.
//!
//! Ground truths are the published networks of `../shared/data/nbrdf` and closed, layered and woven surfaces made here; on the latter
//! NBRDF is trained on the same samples as well. Each fit leaves a JSON file in `target/study-fit`; what is there is not done again.
//! Words restrict it: names of materials, `published`, `ours`. `--quality` and `--recipe` are those of `neubrdf train`; several
//! recipes stand side by side.

mod study;

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Parser;
use neubrdf::scene::brdf::{Nbrdf, NeuBrdf, Precision};
use neubrdf::train::{Evaluator, Model, Plan, Quality, Recipe};
use serde::{Deserialize, Serialize};
use study::{Cost, Errors, Trained, Truth, all, bar, errors, kept, key, train};

/// Fit materials and print how good the fits are.
#[derive(Parser)]
struct Arguments {
    /// Names of materials, `published` or `ours`; all without any. They are fitted in this order
    materials: Vec<String>,
    #[arg(long, value_enum, default_value = "default")]
    quality: Quality,
    #[arg(long, value_enum, default_value = "default", value_delimiter = ',')]
    recipe: Vec<Recipe>,
    /// Steps instead of the quality's
    #[arg(long)]
    steps: Option<u32>,
    /// Features of each point of a grid instead of the recipe's
    #[arg(long)]
    features: Option<usize>,
    /// Resolutions instead of the recipe's
    #[arg(long)]
    resolutions: Option<usize>,
    /// Codes of each hemisphere's codebook instead of the recipe's
    #[arg(long)]
    codes: Option<usize>,
    /// Neurons of each hidden layer instead of the recipe's
    #[arg(long)]
    hidden: Option<usize>,
    /// Whether networks see the half vector, instead of the recipe's
    #[arg(long)]
    half_vector: Option<bool>,
    /// Where results are kept
    #[arg(long, default_value = "target/study-fit")]
    folder: PathBuf,
    /// Fit nothing: print what is there
    #[arg(long)]
    print: bool,
}

#[derive(Clone, Serialize, Deserialize)]
struct Outcome {
    errors: Errors,
    bytes: usize,
    cost: Cost,
}

/// A material's fits, by recipe.
struct Row {
    name: String,
    fits: Vec<(Recipe, Outcome)>,
    baseline: Option<Outcome>,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.folder)?;
    let mut truths = all()?;
    let words = &arguments.materials;
    if !words.is_empty() {
        let place = |truth: &Truth| {
            let group = if truth.is_ours { "ours" } else { "published" };
            words.iter().position(|word| *word == truth.name || *word == group)
        };
        truths.retain(|truth| place(truth).is_some());
        truths.sort_by_key(|truth| place(truth));
    }
    if truths.is_empty() {
        bail!("no material of these names: {}", words.join(", "));
    }
    let bar = bar(truths.len())?;
    let mut rows = Vec::new();
    for truth in truths {
        bar.set_message(truth.name.clone());
        rows.extend(row(&arguments, &truth)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    print_table(&rows);
    Ok(())
}

/// The fits of a material; `None` if only what is there is wanted, and that is not all.
fn row(arguments: &Arguments, truth: &Truth) -> Result<Option<Row>> {
    let mut fits = Vec::new();
    for recipe in &arguments.recipe {
        let Some(outcome) = outcome(arguments, truth, Model::NeuBrdf, *recipe)? else { return Ok(None) };
        fits.push((*recipe, outcome));
    }
    let baseline = match truth.is_ours {
        true => outcome(arguments, truth, Model::Nbrdf, Recipe::Default)?,
        false => None,
    };
    if truth.is_ours && baseline.is_none() {
        return Ok(None);
    }
    Ok(Some(Row { name: truth.name.clone(), fits, baseline }))
}

/// What is known of a fit, or is found out now.
fn outcome(arguments: &Arguments, truth: &Truth, model: Model, recipe: Recipe) -> Result<Option<Outcome>> {
    let mut plan = Plan::new(model, recipe, arguments.quality, truth.is_isotropic);
    plan.steps = arguments.steps.unwrap_or(plan.steps);
    if model == Model::NeuBrdf {
        plan.features = arguments.features.unwrap_or(plan.features);
        plan.resolutions = arguments.resolutions.unwrap_or(plan.resolutions);
        plan.codes = arguments.codes.map_or(plan.codes, |codes| [codes; 2]);
        plan.hidden = arguments.hidden.unwrap_or(plan.hidden);
        plan.pruned = arguments.hidden.unwrap_or(plan.pruned);
        plan.sees_half_vector = arguments.half_vector.unwrap_or(plan.sees_half_vector);
    }
    let path = arguments.folder.join(format!("{}-{}.json", truth.name, key(&plan)?));
    if arguments.print && !path.exists() {
        eprintln!("{} is left out: there is no {}", truth.name, path.display());
        return Ok(None);
    }
    let find_out = || -> Result<Outcome> {
        let Trained { session, brdf, cost } = train(truth, plan)?;
        // What is measured is what the file says, rounded numbers and all.
        let (bytes, evaluator) = match brdf {
            Some(brdf) => {
                let file = brdf.encode(Precision::F16)?;
                (file.len(), Evaluator::neubrdf(&NeuBrdf::decode(&file)?))
            }
            None => (size_of::<Nbrdf>(), session.evaluator()),
        };
        Ok(Outcome { errors: errors(truth, &evaluator), bytes, cost })
    };
    kept(&path, find_out).map(Some)
}

/// A column: its heading, its values, and whether they are better the greater they are.
type Column = (&'static str, fn(&Outcome) -> f64, bool);

/// Prints a row of this name, given what stands in each column.
type Line<'a> = &'a dyn Fn(&str, &dyn Fn(&Column) -> f64);

const COLUMNS: [Column; 8] = [
    ("mean \\|Δ ln(1+f)\\|", |o| o.errors.log, false),
    ("rel. RMSE", |o| o.errors.relative_rmse, false),
    ("SSIM", |o| o.errors.ssim, true),
    ("ꟻLIP", |o| o.errors.flip, false),
    ("albedo", |o| o.errors.albedo, false),
    ("bytes", |o| o.bytes as f64, false),
    ("s", |o| o.cost.seconds, false),
    ("CPU s", |o| o.cost.cpu_seconds, false),
];

fn print_table(rows: &[Row]) {
    println!("| material | {} |", COLUMNS.map(|(name, ..)| name).join(" | "));
    println!("|---|{}", "---|".repeat(COLUMNS.len()));
    let line = |name: &str, of: &dyn Fn(&Column) -> f64| {
        let cells: Vec<String> = COLUMNS.iter().map(|column| cell(column.0, of(column))).collect();
        println!("| {name} | {} |", cells.join(" | "));
    };
    for Row { name, fits, baseline } in rows {
        for (place, (recipe, fit)) in fits.iter().enumerate() {
            let name = if place == 0 { name.clone() } else { format!("— {recipe:?}").to_lowercase() };
            line(&name, &|column| column.1(fit));
        }
        if let Some(baseline) = baseline {
            line("— NBRDF", &|column| column.1(baseline));
        }
    }
    let first = |row: &Row| row.fits.first().map(|(_, fit)| fit.clone());
    summary("all", &rows.iter().filter_map(first).collect::<Vec<_>>(), &line);
    for (name, is_ours) in [("published", false), ("ours", true)] {
        let of: Vec<Outcome> = rows.iter().filter(|row| row.baseline.is_some() == is_ours).filter_map(first).collect();
        summary(name, &of, &line);
    }
    let within = |outcome: &Outcome| outcome.errors.albedo <= 0.01;
    let fits: Vec<Outcome> = rows.iter().filter_map(first).collect();
    println!("\nalbedo within 1 %: {} of {}", fits.iter().filter(|fit| within(fit)).count(), fits.len());
    let compared: Vec<(Outcome, &Outcome)> =
        rows.iter().filter_map(|row| Some((first(row)?, row.baseline.as_ref()?))).collect();
    if !compared.is_empty() {
        for (name, value, greater) in &COLUMNS[..5] {
            let wins = compared.iter().filter(|(a, b)| (value(a) > value(b)) == *greater).count();
            println!("better than NBRDF by {name}: {wins} of {}", compared.len());
        }
    }
}

/// Mean and worst of some fits.
fn summary(name: &str, fits: &[Outcome], line: Line) {
    if fits.is_empty() {
        return;
    }
    let count = fits.len();
    line(&format!("**mean of {count}, {name}**"), &|column| fits.iter().map(column.1).sum::<f64>() / count as f64);
    line(&format!("**worst of {count}, {name}**"), &|column| {
        let values = fits.iter().map(column.1);
        if column.2 { values.fold(f64::INFINITY, f64::min) } else { values.fold(f64::NEG_INFINITY, f64::max) }
    });
}

fn cell(name: &str, value: f64) -> String {
    match name {
        "bytes" => format!("{value:.0}"),
        "s" | "CPU s" => format!("{value:.0}"),
        "albedo" => format!("{:.2} %", 100.0 * value),
        "rel. RMSE" => format!("{value:.3}"),
        _ => format!("{value:.4}"),
    }
}
