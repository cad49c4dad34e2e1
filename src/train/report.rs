//! What a training came to, as JSON and as one page that needs nothing beside it.

use std::fmt::Write;
use std::path::Path;

use serde::Serialize;
use serde_json::json;

use super::measure::{Comparison, Eval, FitErrors};
use super::plot;
use super::{Error, Model, Plan, Recipe};
use crate::image::{escaped, png_address, write_file};

/// What a training came to.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// What was learned.
    pub source: String,
    /// How.
    pub plan: Plan,
    /// Steps that were done.
    pub steps: u32,
    /// The loss at the end.
    pub loss: f64,
    /// Seconds that training took, on the clock.
    pub seconds: f64,
    /// Size of the file.
    pub bytes: usize,
    /// How far the file's model is from the ground truth.
    pub errors: FitErrors,
    /// What each recipe came to, the file's first; empty if they were not compared.
    pub recipes: Vec<RecipeResult>,
}

/// What a recipe came to.
#[derive(Clone, Debug, Serialize)]
pub struct RecipeResult {
    /// Which.
    pub recipe: Recipe,
    /// Size of its file.
    pub bytes: usize,
    /// Seconds that training took, on the clock.
    pub seconds: f64,
    /// How far its file's model is from the ground truth.
    pub errors: FitErrors,
}

impl Report {
    /// Writes the JSON.
    pub fn write_json(&self, path: &Path) -> Result<(), Error> {
        Ok(write_file(path, format!("{:#}\n", json!(self)))?)
    }

    /// Writes the page. `fit` and `truth` are drawn as lobes.
    pub fn write_html(
        &self,
        path: &Path,
        comparison: &Comparison,
        gain: f64,
        fit: Eval,
        truth: Eval,
    ) -> Result<(), Error> {
        let section = self.section(comparison, gain, fit, truth)?;
        Ok(write_file(path, format!("{STYLE}<title>{0}</title><h1>{0}</h1>\n{section}", escaped(&self.source)))?)
    }

    /// What the page says below its heading.
    ///
    /// # Errors
    /// A picture cannot be encoded.
    pub fn section(&self, comparison: &Comparison, gain: f64, fit: Eval, truth: Eval) -> Result<String, Error> {
        let FitErrors { pairs, ball, albedo, worst_albedo } = &self.errors;
        let mut page = String::new();
        let plan = &self.plan;
        let _ =
            writeln!(page, "<p>{}; {} steps of {} pairs, seed {}.</p>", sizes(plan), self.steps, plan.batch, plan.seed);
        page.push_str("<table>\n");
        for (name, value) in [
            ("SSIM of the ball", format!("{:.4}", ball.ssim)),
            ("ꟻLIP of the ball", format!("{:.4}", ball.flip)),
            ("PSNR of the ball", format!("{:.1} dB", ball.psnr)),
            ("mean |Δ ln(1 + f)|", format!("{:.5}", pairs.log)),
            ("relative RMSE of f cos θ", format!("{:.4}", pairs.relative_rmse)),
            ("worst directional albedo", format!("{:.2} %", 100.0 * worst_albedo)),
            ("file", format!("{} bytes", self.bytes)),
            ("training", format!("{:.1} s, loss {:.5}", self.seconds, self.loss)),
        ] {
            let _ = writeln!(page, "<tr><th>{name}</th><td>{value}</td></tr>");
        }
        page.push_str("</table>\n");
        if !self.recipes.is_empty() {
            page.push_str(&recipe_table(&self.recipes));
        }
        page.push_str("<h2>A ball under small lights</h2>\n<div class=row>");
        let [truth_ball, fit_ball] = [&comparison.truth, &comparison.fit];
        let size = fit_ball.size;
        let (a, b) = (fit_ball.srgb(), truth_ball.srgb());
        let difference: Vec<u8> = a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b).saturating_mul(8)).collect();
        for (name, pixels) in [("ground truth", b), ("fit", a), ("difference × 8", difference)] {
            let _ = writeln!(
                page,
                "<figure><img width={0} height={0} alt=\"{name}\" src=\"{1}\"><figcaption>{name}</figcaption></figure>",
                2 * size,
                png_address(size as u32, size as u32, &pixels)?
            );
        }
        let _ = writeln!(
            page,
            "</div>\n<h2>Lobes in the plane of incidence</h2>\n<p>ln(1 + {gain:.0} f cos θo); solid: fit, dashed: ground truth.</p>\n{}",
            plot::polar(gain, &[fit, truth])
        );
        let name = "mean |Δ ln(1 + f)|";
        let _ =
            writeln!(page, "<h2>Errors by angle</h2>\n{}", plot::line("θh, degrees", name, &pairs.log_by_half_angle));
        page.push_str(&plot::line("θo, degrees", name, &pairs.log_by_view_angle));
        page.push_str("<h2>Directional albedo</h2>\n<table><tr><th>θo</th><th>φo</th><th>ground truth</th><th>fit</th><th>error</th></tr>\n");
        for at in albedo {
            let _ = writeln!(
                page,
                "<tr><td>{:.0}°</td><td>{:.0}°</td><td>{:.4}</td><td>{:.4}</td><td>{:+.2} %</td></tr>",
                at.theta,
                at.phi,
                at.truth,
                at.fit,
                100.0 * at.relative()
            );
        }
        Ok(page + "</table>\n")
    }
}

/// What is trained, in words.
fn sizes(plan: &Plan) -> String {
    if plan.model == Model::Nbrdf {
        return "NBRDF, 6 → 21 → 21 → 3".to_owned();
    }
    let [n_wi, n_wo] = plan.n_side;
    let grids = if plan.resolutions == 1 { "one grid".to_owned() } else { format!("{} grids", plan.resolutions) };
    let half_vector = if plan.sees_half_vector { ", sees the half vector" } else { "" };
    format!(
        "NeuBRDF, recipe {}: N_side {n_wi} (ωi) and {n_wo} (ωo), {grids} of F {} a hemisphere, {} weights, hidden {}{half_vector}",
        word(&plan.recipe),
        plan.features,
        word(&plan.corner_weights),
        plan.pruned
    )
}

/// The name by which files and the command line know a choice.
fn word(choice: &impl Serialize) -> String {
    json!(choice).as_str().unwrap_or_default().to_owned()
}

/// The recipes side by side.
fn recipe_table(recipes: &[RecipeResult]) -> String {
    let mut table = String::from(
        "<h2>Recipes</h2>\n<table><tr><th>recipe</th><th>SSIM</th><th>ꟻLIP</th><th>PSNR</th><th>mean |Δ ln(1 + f)|</th><th>relative RMSE</th>\
         <th>worst albedo</th><th>bytes</th><th>seconds</th></tr>\n",
    );
    for RecipeResult { recipe, bytes, seconds, errors } in recipes {
        let FitErrors { pairs, ball, worst_albedo, .. } = errors;
        let name = word(recipe);
        let _ = writeln!(
            table,
            "<tr><td>{name}</td><td>{:.4}</td><td>{:.4}</td><td>{:.1} dB</td><td>{:.5}</td><td>{:.4}</td><td>{:.2} %</td><td>{bytes}</td><td>{seconds:.1}</td></tr>",
            ball.ssim,
            ball.flip,
            ball.psnr,
            pairs.log,
            pairs.relative_rmse,
            100.0 * worst_albedo
        );
    }
    table + "</table>\n<p>unquantised: the paper's sizes, each grid point with features of its own.</p>\n"
}

pub(super) const STYLE: &str = "<!doctype html><meta charset=utf-8>
<style>body{font:15px/1.5 sans-serif;max-width:60em;margin:2em auto;padding:0 1em}
table{border-collapse:collapse}th,td{text-align:left;padding:.2em 1em .2em 0;border-bottom:1px solid #ddd}
.row{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0}svg{max-width:40em;display:block}</style>
";

#[cfg(test)]
mod tests {
    use super::super::measure::{BallErrors, PairErrors};
    use super::*;

    #[test]
    fn recipes_stand_side_by_side() {
        let result = |recipe, ssim| RecipeResult {
            recipe,
            bytes: 1000,
            seconds: 2.0,
            errors: FitErrors {
                pairs: PairErrors::default(),
                ball: BallErrors { ssim, ..BallErrors::default() },
                albedo: Vec::new(),
                worst_albedo: 0.012,
            },
        };
        let table = recipe_table(&[result(Recipe::Default, 0.75), result(Recipe::Paper, 0.5)]);
        assert!(table.contains("<td>default</td><td>0.7500</td>") && table.contains("<td>paper</td><td>0.5000</td>"));
        assert_eq!(table.matches("1.20 %").count(), 2);
    }
}
