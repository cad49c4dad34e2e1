//! Thresholds that turn a study into a gate.
//!
//! ```toml
//! [[method]]                       # every method in every scene that `method` and `scene` name; all, if they are left out
//! scene = "cornell"
//! method = "llvmpipe, bvh, sobol"  # a label or full name, or a part of one
//! slope = [-1.5, -0.9]
//! bias_p = 0.01                    # the least p of the bias test, corrected for all tests of the study
//! rel_mse = 0.01                   # the most at the top of the ladder, the reference's noise taken off
//! floor = 1e-4                     # the most model error
//!
//! [[ratio]]                        # of efficiencies
//! method = "sobol"
//! over = "pcg"
//! least = 1.2
//! shown = true
//! ```
//!
//! A threshold is broken when the figure is on its wrong side beyond chance: with its whole confidence interval. With `shown = true`
//! it is broken unless the whole interval is on its right side.

use std::path::Path;

use super::analysis::{Analysis, MethodResult, ratio};
use super::error::Error;
use super::plan::{LONGEST_FILE, shortest};
use crate::converge::{CONFIDENCE, Estimate};
use crate::scene::table::{Source, Table, read_text};

/// The thresholds of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gate {
    methods: Vec<MethodGate>,
    ratios: Vec<RatioGate>,
}

#[derive(Clone, Debug, PartialEq)]
struct MethodGate {
    scene: Option<String>,
    method: Option<String>,
    slope: Option<[f64; 2]>,
    bias_p: Option<f64>,
    rel_mse: Option<f64>,
    floor: Option<f64>,
    shown: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct RatioGate {
    scene: Option<String>,
    method: String,
    over: String,
    least: f64,
    shown: bool,
}

/// What came of a threshold.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Whether it holds.
    pub holds: bool,
    /// The figure and the threshold, in words.
    pub message: String,
}

impl Gate {
    /// Reads a file of thresholds.
    pub fn read(path: &Path) -> Result<Gate, Error> {
        let text = read_text(path, LONGEST_FILE)?;
        let source = Source { file: path, text: &text };
        let entries = source.parse()?;
        let root = Table::root(source, &entries);
        root.allow(&["method", "ratio"])?;
        let list = |key| root.get(key).map_or(Ok(Vec::new()), |value| value.array());
        let mut gate = Gate::default();
        for value in list("method")? {
            gate.methods.push(MethodGate::read(&value.table()?)?);
        }
        for value in list("ratio")? {
            gate.ratios.push(RatioGate::read(&value.table()?)?);
        }
        if gate.methods.is_empty() && gate.ratios.is_empty() {
            return Err(root.error("no threshold", "[[method]] or [[ratio]]").into());
        }
        Ok(gate)
    }

    /// Holds a study to them. A threshold that nothing in the study answers to is broken.
    pub fn judge(&self, analysis: &Analysis) -> Vec<Verdict> {
        let mut verdicts = Vec::new();
        for gate in &self.methods {
            let before = verdicts.len();
            for (scene, method) in chosen(analysis, &gate.scene, gate.method.as_deref()) {
                gate.judge(scene, method, &mut verdicts);
            }
            if verdicts.len() == before {
                verdicts.push(Verdict { holds: false, message: gate.without_figures(analysis) });
            }
        }
        for gate in &self.ratios {
            verdicts.extend(gate.judge(analysis));
        }
        verdicts
    }
}

fn chosen<'a>(
    analysis: &'a Analysis,
    scene: &'a Option<String>,
    method: Option<&'a str>,
) -> impl Iterator<Item = (&'a str, &'a MethodResult)> {
    let fits = move |found: &MethodResult| method.is_none_or(|wanted| names(found, wanted));
    analysis.scenes.iter().filter(move |found| scene.as_ref().is_none_or(|wanted| *wanted == found.name)).flat_map(
        move |scene| scene.methods.iter().filter(move |found| fits(found)).map(|found| (scene.name.as_str(), found)),
    )
}

fn names(method: &MethodResult, wanted: &str) -> bool {
    method.label.contains(wanted) || method.name.contains(wanted)
}

/// Whether a figure is between two bounds, noise taken into account.
fn within(figure: &Estimate, [least, most]: [f64; 2], shown: bool) -> bool {
    let [low, high] = figure.interval(CONFIDENCE);
    match shown {
        true => low >= least && high <= most,
        false => high >= least && low <= most,
    }
}

fn no_scene(wanted: &str) -> String {
    format!("there is no scene '{wanted}'")
}

fn text(figure: &Estimate) -> String {
    let [low, high] = figure.interval(CONFIDENCE);
    format!("{:.4e} (95 %: {low:.4e} to {high:.4e})", figure.value)
}

impl MethodGate {
    fn read(table: &Table) -> Result<MethodGate, Error> {
        table.allow(&["scene", "method", "slope", "bias_p", "rel_mse", "floor", "shown"])?;
        let word = |key| table.get(key).map(|value| value.string().map(str::to_owned)).transpose();
        let number = |key| table.get(key).map(|value| value.number(0.0, 1e12).map(shortest)).transpose();
        Ok(MethodGate {
            scene: word("scene")?,
            method: word("method")?,
            slope: table
                .get("slope")
                .map(|value| value.numbers::<2>(-100.0, 100.0).map(|bounds| bounds.map(shortest)))
                .transpose()?,
            bias_p: table.get("bias_p").map(|value| value.number(0.0, 1.0).map(shortest)).transpose()?,
            rel_mse: number("rel_mse")?,
            floor: number("floor")?,
            shown: table.get("shown").map_or(Ok(false), |value| value.boolean())?,
        })
    }

    /// What to say where nothing in the study answers to it.
    fn without_figures(&self, analysis: &Analysis) -> String {
        let method = self.method.as_ref().map_or("any method".into(), |method| format!("a method '{method}'"));
        match &self.scene {
            Some(scene) if analysis.scenes.iter().all(|found| found.name != *scene) => no_scene(scene),
            Some(scene) => format!("{scene}: there are no figures of {method}"),
            None => format!("there are no figures of {method}"),
        }
    }

    fn judge(&self, scene: &str, method: &MethodResult, verdicts: &mut Vec<Verdict>) {
        let mut judge = |name: &str, figure: Option<Estimate>, bounds: Option<[f64; 2]>| {
            let Some(bounds) = bounds else { return };
            let found = figure.map_or("nothing: there are too few renders".into(), |figure| text(&figure));
            verdicts.push(Verdict {
                holds: figure.is_some_and(|figure| within(&figure, bounds, self.shown)),
                message: format!(
                    "{scene}, {}: {name} is {found}, {} {:e} to {:e}",
                    method.label,
                    if self.shown { "to be shown within" } else { "wanted within" },
                    bounds[0],
                    bounds[1]
                ),
            });
        };
        judge("slope", method.slope, self.slope);
        judge("relMSE", method.top().map(|rung| rung.rel_mse), self.rel_mse.map(|most| [f64::NEG_INFINITY, most]));
        judge("floor", method.floor, self.floor.map(|most| [f64::NEG_INFINITY, most]));
        if let Some(least) = self.bias_p {
            verdicts.push(Verdict {
                holds: method.bias_p.is_some_and(|p| p >= least),
                message: match method.bias_p {
                    Some(p) => format!("{scene}, {}: bias p is {p:.3e}, wanted at least {least:e}", method.label),
                    None => format!(
                        "{scene}, {}: bias cannot be tested: the reference or the method's pictures have no variance",
                        method.label
                    ),
                },
            });
        }
    }
}

impl RatioGate {
    fn read(table: &Table) -> Result<RatioGate, Error> {
        table.allow(&["scene", "method", "over", "least", "shown"])?;
        Ok(RatioGate {
            scene: table.get("scene").map(|value| value.string().map(str::to_owned)).transpose()?,
            method: table.require("method")?.string()?.to_owned(),
            over: table.require("over")?.string()?.to_owned(),
            least: shortest(table.require("least")?.number(f32::MIN_POSITIVE, 1e12)?),
            shown: table.get("shown").map_or(Ok(false), |value| value.boolean())?,
        })
    }

    fn judge(&self, analysis: &Analysis) -> Vec<Verdict> {
        let fail = |message: String| Verdict { holds: false, message };
        let scenes =
            analysis.scenes.iter().filter(|found| self.scene.as_ref().is_none_or(|wanted| *wanted == found.name));
        let mut verdicts = Vec::new();
        for scene in scenes {
            let one = |wanted: &str| {
                let exact: Vec<_> = scene.methods.iter().filter(|m| m.label == wanted || m.name == wanted).collect();
                let part: Vec<_> = scene.methods.iter().filter(|method| names(method, wanted)).collect();
                let found = if exact.is_empty() { part } else { exact };
                match found.as_slice() {
                    [method] => Ok(*method),
                    [] => Err(fail(format!("{}: there are no figures of a method '{wanted}'", scene.name))),
                    _ => Err(fail(format!("{}: '{wanted}' names {} methods", scene.name, found.len()))),
                }
            };
            let (method, over) = match (one(&self.method), one(&self.over)) {
                (Ok(method), Ok(over)) => (method, over),
                (Err(verdict), _) | (_, Err(verdict)) => {
                    verdicts.push(verdict);
                    continue;
                }
            };
            verdicts.push(match (method.efficiency, over.efficiency) {
                (Some(a), Some(b)) => {
                    let log = a.minus(&b);
                    let [value, low, high] = ratio(&log);
                    Verdict {
                        holds: within(&log, [self.least.ln(), f64::INFINITY], self.shown),
                        message: format!(
                            "{}: efficiency of '{}' over '{}' is {value:.3} (95 %: {low:.3} to {high:.3}), {} {}",
                            scene.name,
                            method.label,
                            over.label,
                            if self.shown { "to be shown at least" } else { "wanted at least" },
                            self.least
                        ),
                    }
                }
                _ => fail(format!("{}: too few renders to tell efficiencies", scene.name)),
            });
        }
        if verdicts.is_empty() {
            verdicts.push(fail(no_scene(self.scene.as_deref().unwrap_or("any"))));
        }
        verdicts
    }
}
