//! A study against an older one: what got better, what worse, and what cannot be told.

use super::analysis::{Analysis, MethodResult};
use super::record::{Question, Record, SceneRecord};
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

/// A study against an older one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Versus {
    /// All that both have figures of.
    pub changes: Vec<Change>,
    /// Scenes of the new study of which methods, or all, do not compare, with the reason.
    pub left_out: Vec<(String, String)>,
}

/// Methods are the same if their full names and the tops of their ladders are, in scenes of the same name and content, rendered alike, by models
/// of the same content.
/// The intervals hold all at once with [`CONFIDENCE`] (Šidák).
pub fn compare(new: &Record, old: &Record) -> Versus {
    let [results, results_before] = [new, old].map(Analysis::of);
    let mut left_out = Vec::new();
    let mut found = Vec::new();
    for (scene, result) in new.scenes.iter().zip(&results.scenes) {
        let mut of_old = old.scenes.iter().zip(&results_before.scenes);
        let mut leave_out = |reason: String| left_out.push((scene.name.clone(), reason));
        let Some((before, result_before)) = of_old.find(|(before, _)| before.name == scene.name) else {
            leave_out("the older study has no scene of that name".into());
            continue;
        };
        if let Some(reason) = what_differs((&new.question, scene), (&old.question, before)) {
            leave_out(reason);
            continue;
        }
        let mut has_common = false;
        for method in &result.methods {
            let of_name = result_before.methods.iter().find(|before| before.name == method.name);
            let spp = |method: &MethodResult| method.top().map(|rung| rung.spp);
            let Some(result_before) = of_name.filter(|before| spp(before) == spp(method)) else { continue };
            has_common = true;
            if let Some(reason) = how_models_differ(&method.name, scene, before) {
                leave_out(format!("{}: {reason}", method.label));
                continue;
            }
            for (figure, more_is_better, read) in FIGURES {
                if let (Some(new), Some(old)) = (read(method), read(result_before)) {
                    found.push((&scene.name, method, figure, more_is_better, new.minus(&old)));
                }
            }
        }
        if !has_common {
            leave_out("no method has figures at the same most samples a pixel in both studies".into());
        }
    }
    let confidence = CONFIDENCE.powf(1.0 / found.len().max(1) as f64);
    let changes = found
        .into_iter()
        .map(|(scene, method, figure, more_is_better, log)| {
            let [low, high] = log.interval(confidence);
            Change {
                scene: scene.clone(),
                method: method.label.clone(),
                figure,
                ratio: [log.value.exp(), low.exp(), high.exp()],
                more_is_better,
            }
        })
        .collect();
    Versus { changes, left_out }
}

/// Why the figures of a scene do not compare.
fn what_differs(new: (&Question, &SceneRecord), old: (&Question, &SceneRecord)) -> Option<String> {
    let words = |(question, scene): (&Question, &SceneRecord)| {
        let [width, height] = scene.size;
        [
            ("size", format!("{width}×{height}")),
            ("hash", start(&scene.hash).to_owned()),
            ("depth", question.max_depth.to_string()),
            ("clock", format!("{:?}", question.clock).to_lowercase()),
        ]
    };
    let pairs = words(new).into_iter().zip(words(old));
    pairs.into_iter().find(|(is, was)| is != was).map(|((name, is), (_, was))| format!("its {name} is {is}, was {was}"))
}

/// Why the figures of a method do not compare that renders a model of a scene.
fn how_models_differ(method: &str, new: &SceneRecord, old: &SceneRecord) -> Option<String> {
    let model = new.methods.iter().find(|other| other.name == method)?.model.as_deref()?;
    let hash = |scene: &SceneRecord| {
        let named = scene.models.iter().find(|(name, _)| name == model);
        named.map_or("absent".to_owned(), |(_, hash)| start(hash).to_owned())
    };
    let (is, was) = (hash(new), hash(old));
    (is != was).then(|| format!("its model's hash is {is}, was {was}"))
}

/// As much of a hash as tells it from others.
fn start(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
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
