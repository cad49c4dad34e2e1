//! A study against an older one: what got better, what worse, and what cannot be told.

use super::analysis::{Analysis, MethodResult};
use crate::converge::{CONFIDENCE, Estimate};

/// A figure of a method in both studies.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Its scene.
    pub scene: String,
    /// Its label in the new study.
    pub method: String,
    /// Which figure: `efficiency`, `seconds`, `noise`.
    pub figure: &'static str,
    /// New over old, and the confidence interval, corrected for the number of comparisons.
    pub ratio: [f64; 3],
    /// Whether more is better.
    pub more_is_better: bool,
}

impl Change {
    /// `Some(true)` if the method got better beyond chance, `Some(false)` if worse, `None` if it cannot be told.
    pub fn is_better(&self) -> Option<bool> {
        let [_, low, high] = self.ratio;
        match (low > 1.0, high < 1.0) {
            (true, _) => Some(self.more_is_better),
            (_, true) => Some(!self.more_is_better),
            _ => None,
        }
    }
}

/// All that both studies have figures of. Methods are the same if their full names and the tops of their
/// ladders are. The intervals hold all at once with
/// [`CONFIDENCE`] (Šidák).
pub fn compare(new: &Analysis, old: &Analysis) -> Vec<Change> {
    let pairs = || {
        new.scenes.iter().flat_map(|scene| {
            let before = old.scenes.iter().find(|before| before.name == scene.name);
            scene.methods.iter().filter_map(move |method| {
                let before = before?.methods.iter().find(|before| before.name == method.name)?;
                let is_alike = method.top()?.spp == before.top()?.spp;
                is_alike.then_some((scene.name.as_str(), method, before))
            })
        })
    };
    let mut found = Vec::new();
    for (scene, method, before) in pairs() {
        for (figure, more_is_better, read) in FIGURES {
            if let (Some(new), Some(old)) = (read(method), read(before)) {
                found.push((scene, method, figure, more_is_better, new.minus(&old)));
            }
        }
    }
    let confidence = CONFIDENCE.powf(1.0 / found.len().max(1) as f64);
    found
        .into_iter()
        .map(|(scene, method, figure, more_is_better, log)| {
            let [low, high] = log.interval(confidence);
            Change {
                scene: scene.to_owned(),
                method: method.label.clone(),
                figure,
                ratio: [log.value.exp(), low.exp(), high.exp()],
                more_is_better,
            }
        })
        .collect()
}

type Figure = (&'static str, bool, fn(&MethodResult) -> Option<Estimate>);

/// Logarithms, at the top of the ladder.
const FIGURES: [Figure; 3] = [
    ("efficiency", true, |method| method.efficiency),
    ("seconds", false, |method| method.top().map(|rung| logarithm(&rung.seconds))),
    ("noise", false, |method| method.top()?.noise.map(|noise| logarithm(&noise))),
];

/// To first order.
fn logarithm(figure: &Estimate) -> Estimate {
    Estimate { value: figure.value.ln(), standard_error: figure.standard_error / figure.value, ..*figure }
}
