//! `neubrdf material`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use glam::DVec3;
use neubrdf::image::write_file;
use neubrdf::scene::brdf::{Footprint, NeuBrdf, NeuBrdfPack, SurfaceFrame};
use neubrdf::train::check::{Check, check};
use neubrdf::train::measure::{self, Query};
use neubrdf::train::{Evaluator, Judged, plot};
use rayon::prelude::*;

use super::brdf_input::{BrdfInput, Drawing, names};
use super::job::{check_ending, check_outputs, threshold};
use super::judge::judge;
use super::progress;

/// Say what a BRDF is. Exit status 3 if --check finds it wrong.
#[derive(clap::Args)]
pub struct Arguments {
    /// What `train` takes: .neubrdf, .binary, .bsdf, .csv, .safetensors or .npy, a material or a scene (.toml), or a directory of images (BTF)
    input: PathBuf,
    /// The material, where INPUT holds several, which are listed without
    #[arg(long)]
    name: Option<String>,
    /// Draw lobes in the plane of incidence
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    /// Say how far it is from another, which may be anything that INPUT may: the errors of a training's report
    #[arg(long, value_name = "TRUTH")]
    against: Option<PathBuf>,
    /// The material, where TRUTH holds several
    #[arg(long, value_name = "NAME", requires = "against")]
    against_name: Option<String>,
    /// Look for negative or non-finite values and an albedo above --max-albedo, and report the reciprocity error
    #[arg(long)]
    check: bool,
    /// The largest directional albedo that --check lets pass
    #[arg(long, default_value_t = 1.01, requires = "check", value_parser = threshold)]
    max_albedo: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Of measurements over a texture nothing is learned here.
const DRAWING: Drawing = Drawing { texels: None, pairs: 1, hold_out: 0.0, seed: 0 };

/// The check failed.
const WRONG: u8 = 3;

/// Points of a texture that are checked, besides its average.
const CHECKED_PLACES: usize = 8;

/// Gain of the plot's radii: what is far below its inverse is not seen.
const PLOT_GAIN: f64 = 100.0;

/// Loads, prints, draws, checks.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    if let Some(path) = &arguments.plot {
        check_ending(path, &["svg"])?;
        check_outputs([path.as_path()], [arguments.input.as_path()])?;
    }
    let is_pack = arguments.input.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("neubrdf"));
    let pack = is_pack.then(|| NeuBrdfPack::load(&arguments.input)).transpose()?;
    let Arguments { name, plot, against, .. } = &arguments;
    let asks_for_one = name.is_some() || arguments.check || plot.is_some() || against.is_some();
    if let Some(pack) = pack.as_ref().filter(|pack| pack.materials.len() > 1 && !asks_for_one) {
        print(&arguments, &describe_pack(pack, &arguments.input)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let may_be_many = pack.is_none() && !asks_for_one;
    let names = if may_be_many { names(&arguments.input)? } else { Vec::new() };
    if names.len() > 1 {
        print(&arguments, &serde_json::json!({"count": names.len(), "names": names}))?;
        return Ok(ExitCode::SUCCESS);
    }
    let input = BrdfInput::load(&arguments.input, arguments.name.as_deref(), DRAWING)?;
    let model = pack.map(|_| NeuBrdf::load(&arguments.input, arguments.name.as_deref())).transpose()?;
    // What is asked a million times is evaluated on all lanes, where that is possible.
    let fast = model.as_ref().map(Evaluator::neubrdf);
    let eval_at = |queries: &[Query]| -> Vec<DVec3> {
        let value = |Query { footprint, wo, wi }: &Query| input.brdf.eval_at(*footprint, *wo, *wi);
        fast.as_ref().map_or_else(|| queries.par_iter().map(value).collect(), |fast| fast.eval_at(queries))
    };
    let eval = |footprint: Footprint, pairs: &[[DVec3; 2]]| {
        eval_at(&pairs.iter().map(|[wo, wi]| Query { footprint, wo: *wo, wi: *wi }).collect::<Vec<_>>())
    };
    let is_isotropic = input.brdf.is_isotropic();
    let mut facts = serde_json::json!({"name": input.name, "is_isotropic": is_isotropic});
    if let Some(model) = &model {
        facts["neubrdf"] = describe(model);
        facts["bytes"] = std::fs::metadata(&arguments.input)?.len().into();
    }
    let checked = arguments.check.then(|| {
        let places = if input.brdf.is_spatial() { CHECKED_PLACES } else { 0 };
        let bar = progress::bar(1 + places as u64, false).with_message("checking");
        let check_at = |footprint: Footprint| {
            let frame = input.brdf.frame(footprint).unwrap_or(SurfaceFrame::OWN);
            let check = check(is_isotropic, frame, &|pairs| eval(footprint, pairs));
            bar.inc(1);
            check
        };
        let check = (0..places).map(measure::place).map(check_at).fold(check_at(Footprint::WHOLE), Check::merge);
        bar.finish_and_clear();
        check
    });
    if let Some(path) = &arguments.against {
        let truth = BrdfInput::load(path, arguments.against_name.as_deref(), DRAWING)?;
        facts["against"] = match judge(&truth, &eval_at, false).judged {
            Judged::Errors(errors) => serde_json::json!(errors),
            // All of them, as nobody knows which of them it was made of.
            Judged::Residuals(residuals) => serde_json::json!(residuals.learned),
        };
    }
    facts["check"] = serde_json::json!(checked);
    print(&arguments, &facts)?;
    if let Some(path) = &arguments.plot {
        write_file(path, plot::polar(PLOT_GAIN, &[&|pairs| eval(Footprint::WHOLE, pairs)]))?;
    }
    let is_right = checked.is_none_or(|check| passes(&check, arguments.max_albedo));
    Ok(if is_right { ExitCode::SUCCESS } else { ExitCode::from(WRONG) })
}

/// Says what is wrong; whether nothing is.
fn passes(check: &Check, max_albedo: f64) -> bool {
    let Check { pairs, negative, non_finite, .. } = *check;
    for (count, what) in [(negative, "negative"), (non_finite, "not finite")] {
        if count > 0 {
            note!("{count} of {pairs} values are {what}");
        }
    }
    // A NaN is above every threshold.
    let sends_too_much = check.max_albedo > max_albedo || check.max_albedo.is_nan();
    if sends_too_much {
        let [theta, phi] = check.max_albedo_at;
        note!(
            "the albedo at θ = {theta:.1}°, φ = {phi:.1}° is {:.6}, above {max_albedo} (--max-albedo)",
            check.max_albedo
        );
    }
    negative == 0 && non_finite == 0 && !sends_too_much
}

/// The members of a pack, and what they share.
fn describe_pack(pack: &NeuBrdfPack, path: &Path) -> Result<serde_json::Value> {
    let mut materials = serde_json::Map::new();
    for (name, brdf) in &pack.materials {
        materials.insert(name.clone(), describe(brdf));
    }
    let bytes = std::fs::metadata(path)?.len();
    let count = pack.materials.len();
    Ok(
        serde_json::json!({"materials": materials, "count": count, "bytes": bytes, "bytes_a_material": bytes / count as u64}),
    )
}

fn print(arguments: &Arguments, facts: &serde_json::Value) -> Result<()> {
    if arguments.json { tell!("{facts:#}") } else { print_facts("", facts) }
}

fn describe(brdf: &NeuBrdf) -> serde_json::Value {
    let table = |table: &neubrdf::scene::brdf::SphereTable| {
        serde_json::json!({
            "n_side": table.grid.n_side(), "features": table.codebook.features,
            "codes": table.codebook.code_count(),
            "points": table.indices.iter().filter(|index| **index != neubrdf::scene::brdf::NO_CODE).count(),
        })
    };
    let coarser: Vec<_> =
        brdf.coarser.iter().map(|[wi, wo]| serde_json::json!({ "wi": table(wi), "wo": table(wo) })).collect();
    let widths: Vec<u32> = brdf.layers.iter().map(|layer| layer.inputs).chain([3]).collect();
    let surface = brdf.surface.as_ref().map(|surface| {
        serde_json::json!({
            "texels": surface.grid.size(0), "levels": surface.grid.level_count(), "features": surface.codebook.features,
            "codes": surface.codebook.code_count(), "points": surface.indices.len(),
            "has_normals": !surface.frames.normals.is_empty(), "has_directions": !surface.frames.directions.is_empty(),
        })
    });
    serde_json::json!({
        "wi": table(&brdf.wi), "wo": table(&brdf.wo), "coarser": coarser, "surface": surface, "sees_half_vector": brdf.sees_half_vector,
        "widths": widths, "corner_weights": brdf.corner_weights,
        "encoding": brdf.encoding, "provenance": brdf.provenance,
    })
}

/// Prints leaves, a line each, under the names that lead to them.
fn print_facts(path: &str, facts: &serde_json::Value) -> Result<()> {
    match facts {
        serde_json::Value::Object(entries) => {
            for (name, value) in entries {
                print_facts(&format!("{path}{}{name}", if path.is_empty() { "" } else { "." }), value)?;
            }
            Ok(())
        }
        serde_json::Value::Null => Ok(()),
        // Curves and tables.
        serde_json::Value::Array(_) if path.starts_with("against.") => Ok(()),
        value => tell!("{path:<44} {value}"),
    }
}
