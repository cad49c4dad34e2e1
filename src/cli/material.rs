//! `neubrdf material`.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use glam::DVec3;
use neubrdf::image::atomic_write;
use neubrdf::scene::brdf::NeuBrdf;
use neubrdf::train::check::check;
use neubrdf::train::plot;
use rayon::prelude::*;

use super::brdf_input::BrdfInput;
use super::job::check_writable;

/// Say what a BRDF is. Exit status 3 if --check finds it wrong.
#[derive(clap::Args)]
pub struct Arguments {
    /// A .neubrdf, .binary, .bsdf, .csv, .safetensors or .npy file, or a scene (.toml)
    input: PathBuf,
    /// The material, where INPUT holds several
    #[arg(long)]
    name: Option<String>,
    /// Draw lobes in the plane of incidence
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    /// Look for negative or non-finite values and an albedo above --max-albedo, and report the reciprocity error
    #[arg(long)]
    check: bool,
    /// The largest directional albedo that --check lets pass
    #[arg(long, default_value_t = 1.01)]
    max_albedo: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The check failed.
const WRONG: u8 = 3;

/// Gain of the plot's radii: what is far below its inverse is not seen.
const PLOT_GAIN: f64 = 100.0;

/// Loads, prints, draws, checks.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    if let Some(path) = &arguments.plot {
        check_writable(path)?;
        if path.extension().and_then(|ending| ending.to_str()) != Some("svg") {
            bail!("{}: a plot is an .svg", path.display());
        }
    }
    let input = BrdfInput::load(&arguments.input, arguments.name.as_deref())?;
    let eval =
        |pairs: &[[DVec3; 2]]| -> Vec<DVec3> { pairs.par_iter().map(|[wo, wi]| input.brdf.eval(*wo, *wi)).collect() };
    let is_isotropic = input.brdf.is_isotropic();
    let mut facts = serde_json::json!({"name": input.name, "is_isotropic": is_isotropic});
    if arguments.input.extension().and_then(|ending| ending.to_str()) == Some("neubrdf") {
        facts["neubrdf"] = describe(&NeuBrdf::load(&arguments.input)?);
        facts["bytes"] = std::fs::metadata(&arguments.input)?.len().into();
    }
    let checked = arguments.check.then(|| check(is_isotropic, &eval));
    facts["check"] = serde_json::json!(checked);
    if arguments.json {
        println!("{facts:#}");
    } else {
        print_facts("", &facts);
    }
    if let Some(path) = &arguments.plot {
        let io_error = |source| neubrdf::image::Error::Io { path: path.to_owned(), source };
        let svg = plot::polar(PLOT_GAIN, &[&eval]);
        atomic_write(path, |file| file.write_all(svg.as_bytes()).map_err(io_error))?;
    }
    let is_wrong = checked.is_some_and(|check| {
        // A NaN is above every threshold.
        check.negative > 0
            || check.non_finite > 0
            || check.max_albedo > arguments.max_albedo
            || check.max_albedo.is_nan()
    });
    Ok(if is_wrong { ExitCode::from(WRONG) } else { ExitCode::SUCCESS })
}

fn describe(brdf: &NeuBrdf) -> serde_json::Value {
    let table = |table: &neubrdf::scene::brdf::SphereTable| {
        serde_json::json!({
            "n_side": table.grid.n_side(), "features": table.features, "codes": table.code_count(),
            "points": table.indices.iter().filter(|index| **index != neubrdf::scene::brdf::NO_CODE).count(),
        })
    };
    let widths: Vec<u32> = brdf.layers.iter().map(|layer| layer.inputs).chain([3]).collect();
    serde_json::json!({
        "wi": table(&brdf.wi), "wo": table(&brdf.wo), "widths": widths, "corner_weights": brdf.corner_weights,
        "encoding": brdf.encoding, "provenance": brdf.provenance,
    })
}

/// Prints leaves, a line each, under the names that lead to them.
fn print_facts(path: &str, facts: &serde_json::Value) {
    match facts {
        serde_json::Value::Object(entries) => {
            for (name, value) in entries {
                print_facts(&format!("{path}{}{name}", if path.is_empty() { "" } else { "." }), value);
            }
        }
        serde_json::Value::Null => {}
        value => println!("{path:<44} {value}"),
    }
}
