//! What a training came to, as JSON and as one page that needs nothing beside it.

use std::fmt::{self, Display, Formatter, Write};
use std::path::Path;

use serde::Serialize;
use serde_json::json;

use super::ball::Ball;
use super::measure::{AlbedoError, Eval, FitErrors, PairErrors, Residuals, SampleErrors};
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
    /// How far the file's model is from what it was learned from.
    #[serde(flatten)]
    pub judged: Judged,
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
    /// How far its file's model is from what it was learned from.
    #[serde(flatten)]
    pub judged: Judged,
}

/// What a fit is judged by.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Judged {
    /// The ground truth, which is known everywhere.
    Errors(FitErrors),
    /// Measurements.
    Residuals(Residuals),
}

/// One of the figures that tell how good a fit is.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What it is, as in a file's provenance.
    pub name: &'static str,
    /// The number.
    pub value: f64,
    /// Digits behind the point that are shown of it.
    digits: usize,
}

impl Judged {
    /// The figures that tell how good a fit is.
    pub fn figures(&self) -> Vec<Figure> {
        let figure = |name, value, digits| Figure { name, value, digits };
        match self {
            Judged::Errors(FitErrors { pairs, ball, worst_albedo, .. }) => vec![
                figure("ball SSIM", ball.ssim, 4),
                figure("ball FLIP", ball.flip, 4),
                figure("mean |Δ ln(1+f)|", pairs.log, 5),
                figure("relative RMSE of f cos", pairs.relative_rmse, 4),
                figure("worst relative albedo error", *worst_albedo, 4),
            ],
            Judged::Residuals(Residuals { learned, held_out }) => {
                let held = held_out.as_ref();
                let mut figures = vec![
                    figure("learned measurements", learned.measurements as f64, 0),
                    figure("mean |Δ ln(1+f)| at learned measurements", learned.errors.log, 5),
                    figure("relative RMSE of f cos at learned measurements", learned.errors.relative_rmse, 4),
                    figure("held-out measurements", held.map_or(0.0, |held| held.measurements as f64), 0),
                ];
                if let Some(SampleErrors { errors, .. }) = held {
                    figures.extend([
                        figure("mean |Δ ln(1+f)| at held-out measurements", errors.log, 5),
                        figure("relative RMSE of f cos at held-out measurements", errors.relative_rmse, 4),
                    ]);
                }
                figures
            }
        }
    }

    /// In a line.
    pub fn summary(&self) -> String {
        match self {
            Judged::Errors(FitErrors { pairs, ball, worst_albedo, .. }) => format!(
                "ball SSIM {:.4}, FLIP {:.4}; mean |Δ ln(1+f)| {:.5}, worst albedo {:.2} %",
                ball.ssim,
                ball.flip,
                pairs.log,
                100.0 * worst_albedo
            ),
            Judged::Residuals(Residuals { learned, held_out }) => {
                let at = |SampleErrors { measurements, errors }: &SampleErrors, what| {
                    format!("{:.5} at {measurements} {what}", errors.log)
                };
                let held_out = held_out.as_ref().map(|errors| at(errors, "measurements that were held out"));
                format!(
                    "mean |Δ ln(1+f)| {}, {}",
                    held_out.unwrap_or_else(|| "unknown between measurements, as none was held out".to_owned()),
                    at(learned, "that were learned")
                )
            }
        }
    }

    /// What a fit is shown beside.
    fn beside(&self) -> &'static str {
        match self {
            Judged::Errors(_) => "ground truth",
            Judged::Residuals(_) => "interpolated measurements",
        }
    }
}

impl Report {
    /// Writes the JSON.
    pub fn write_json(&self, path: &Path) -> Result<(), Error> {
        Ok(write_file(path, format!("{:#}\n", json!(self)))?)
    }

    /// Writes the page. Balls are those of the fit and of what it is shown beside; `fit` and `beside` are drawn as lobes.
    pub fn write_html(&self, path: &Path, balls: &[Ball; 2], gain: f64, fit: Eval, beside: Eval) -> Result<(), Error> {
        let section = self.section(balls, gain, fit, beside)?;
        Ok(write_file(path, format!("{STYLE}<title>{0}</title><h1>{0}</h1>\n{section}", escaped(&self.source)))?)
    }

    /// What the page says below its heading.
    ///
    /// # Errors
    /// A picture cannot be encoded.
    pub fn section(&self, balls: &[Ball; 2], gain: f64, fit: Eval, beside: Eval) -> Result<String, Error> {
        let mut page = String::new();
        let plan = &self.plan;
        let _ =
            writeln!(page, "<p>{}; {} steps of {} pairs, seed {}.</p>", sizes(plan), self.steps, plan.batch, plan.seed);
        page.push_str("<table>\n");
        let figures = self.judged.figures().into_iter().map(|figure| (figure.name, figure.to_string()));
        let psnr = match &self.judged {
            Judged::Errors(errors) => Some(("ball PSNR", format!("{:.1} dB", errors.ball.psnr))),
            Judged::Residuals(_) => None,
        };
        for (name, value) in figures.chain(psnr).chain([
            ("file", format!("{} bytes", self.bytes)),
            ("training", format!("{:.1} s, loss {:.5}", self.seconds, self.loss)),
        ]) {
            let _ = writeln!(page, "<tr><th>{name}</th><td>{value}</td></tr>");
        }
        page.push_str("</table>\n");
        if !self.recipes.is_empty() {
            page.push_str(&recipe_table(&self.recipes));
        }
        let name = self.judged.beside();
        page.push_str("<h2>A ball under small lights</h2>\n<div class=row>");
        let size = balls[0].size;
        let [fit_pixels, beside_pixels] = balls.each_ref().map(Ball::srgb);
        let difference = fit_pixels.iter().zip(&beside_pixels).map(|(a, b)| a.abs_diff(*b).saturating_mul(8)).collect();
        let mut pictures = vec![(name, beside_pixels), ("fit", fit_pixels)];
        if let Judged::Errors(_) = self.judged {
            pictures.push(("difference × 8", difference));
        }
        for (name, pixels) in pictures {
            let _ = writeln!(
                page,
                "<figure><img width={0} height={0} alt=\"{name}\" src=\"{1}\"><figcaption>{name}</figcaption></figure>",
                2 * size,
                png_address(size as u32, size as u32, &pixels)?
            );
        }
        let _ = writeln!(
            page,
            "</div>\n<h2>Lobes in the plane of incidence</h2>\n<p>ln(1 + {gain:.0} f cos θo); solid: fit, dashed: {name}.</p>\n{}",
            plot::polar(gain, &[fit, beside])
        );
        match &self.judged {
            Judged::Errors(FitErrors { pairs, albedo, .. }) => {
                page.push_str(&errors_by_angle("Errors by angle", pairs));
                page.push_str(&albedo_table(albedo));
            }
            Judged::Residuals(Residuals { learned, held_out }) => {
                page.push_str(&errors_by_angle("Residuals at learned measurements, by angle", &learned.errors));
                if let Some(held_out) = held_out {
                    page.push_str(&errors_by_angle("Residuals at held-out measurements, by angle", &held_out.errors));
                }
            }
        }
        Ok(page)
    }
}

fn errors_by_angle(title: &str, errors: &PairErrors) -> String {
    let name = "mean |Δ ln(1 + f)|";
    let [half, view] = [("θh, degrees", &errors.log_by_half_angle), ("θo, degrees", &errors.log_by_view_angle)]
        .map(|(angle, errors)| plot::line(angle, name, errors));
    format!("<h2>{title}</h2>\n{half}\n{view}")
}

fn albedo_table(albedo: &[AlbedoError]) -> String {
    let mut table = String::from(
        "<h2>Directional albedo</h2>\n<table><tr><th>θo</th><th>φo</th><th>ground truth</th><th>fit</th><th>error</th></tr>\n",
    );
    for at in albedo {
        let _ = writeln!(
            table,
            "<tr><td>{:.0}°</td><td>{:.0}°</td><td>{:.4}</td><td>{:.4}</td><td>{:+.2} %</td></tr>",
            at.theta,
            at.phi,
            at.truth,
            at.fit,
            100.0 * at.relative()
        );
    }
    table + "</table>\n"
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
    let row = |RecipeResult { recipe, bytes, seconds, judged }: &RecipeResult| {
        let mut figures = judged.figures();
        figures.push(Figure { name: "bytes", value: *bytes as f64, digits: 0 });
        figures.push(Figure { name: "seconds", value: *seconds, digits: 1 });
        (word(recipe), figures)
    };
    let table = table_of_figures("recipe", &recipes.iter().map(row).collect::<Vec<_>>());
    format!(
        "<h2>Recipes</h2>\n{table}<p>unquantised: the paper's sizes, each grid point with features of its own.</p>\n"
    )
}

/// A row of figures for each name, under those that any has.
pub(super) fn table_of_figures(what: &str, rows: &[(String, Vec<Figure>)]) -> String {
    let names = names(rows.iter().flat_map(|(_, figures)| figures));
    let heads: String = names.iter().map(|name| format!("<th>{name}</th>")).collect();
    let mut table = format!("<table><tr><th>{what}</th>{heads}</tr>\n");
    for (row, figures) in rows {
        let shown = |name: &&str| figures.iter().find(|figure| figure.name == *name).map(Figure::to_string);
        let cells: String = names.iter().map(|name| format!("<td>{}</td>", shown(name).unwrap_or_default())).collect();
        let _ = writeln!(table, "<tr><td>{row}</td>{cells}</tr>");
    }
    table + "</table>\n"
}

/// The names of figures, each once.
fn names<'f>(figures: impl Iterator<Item = &'f Figure>) -> Vec<&'static str> {
    let mut names = Vec::new();
    figures.for_each(|figure| {
        if !names.contains(&figure.name) {
            names.push(figure.name)
        }
    });
    names
}

/// The means of figures of one name.
pub(super) fn means(figures: &[Figure]) -> Vec<Figure> {
    let mean = |name| {
        let of_name: Vec<&Figure> = figures.iter().filter(|figure| figure.name == name).collect();
        let sum: f64 = of_name.iter().map(|figure| figure.value).sum();
        Figure { value: sum / of_name.len() as f64, ..of_name[0].clone() }
    };
    names(figures.iter()).into_iter().map(mean).collect()
}

impl Display for Figure {
    fn fmt(&self, formatter: &mut Formatter) -> fmt::Result {
        let Figure { value, digits, .. } = *self;
        write!(formatter, "{value:.digits$}")
    }
}

pub(super) const STYLE: &str = "<!doctype html><meta charset=utf-8>
<style>body{font:15px/1.5 sans-serif;max-width:60em;margin:2em auto;padding:0 1em}
table{border-collapse:collapse}th,td{text-align:left;padding:.2em 1em .2em 0;border-bottom:1px solid #ddd}
.row{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0}svg{max-width:40em;display:block}</style>
";

#[cfg(test)]
mod tests {
    use super::super::measure::BallErrors;
    use super::*;

    #[test]
    fn recipes_stand_side_by_side() {
        let result = |recipe, ssim| RecipeResult {
            recipe,
            bytes: 1000,
            seconds: 2.0,
            judged: Judged::Errors(FitErrors {
                pairs: PairErrors::default(),
                ball: BallErrors { ssim, ..BallErrors::default() },
                albedo: Vec::new(),
                worst_albedo: 0.012,
            }),
        };
        let table = recipe_table(&[result(Recipe::Default, 0.75), result(Recipe::Paper, 0.5)]);
        assert!(table.contains("<td>default</td><td>0.7500</td>") && table.contains("<td>paper</td><td>0.5000</td>"));
        assert_eq!(table.matches("<td>0.0120</td>").count(), 2);
    }
}
