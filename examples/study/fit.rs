//! A fit of a ground truth: what it cost and how good it is.

use std::path::Path;

use anyhow::{Context, Result};
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use neubrdf::converge::{Stopwatch, Timing};
use neubrdf::image::write_file;
use neubrdf::scene::brdf::NeuBrdf;
use neubrdf::train::measure::{Eval, FitErrors, compare};
use neubrdf::train::{Evaluator, GroundTruth, Plan, Session};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::Truth;

/// Pixels to a side of the balls.
const BALL: usize = 128;

/// What steps took.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Cost {
    /// On the clock.
    pub seconds: f64,
    /// Of all processors.
    pub cpu_seconds: f64,
}

/// How far a fit is from its ground truth.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub struct Errors {
    /// Mean of |Δ ln(1 + f)|.
    pub log: f64,
    /// Relative root mean square of f cos θi.
    pub relative_rmse: f64,
    /// Of the ball.
    pub ssim: f64,
    /// Of the ball.
    pub flip: f64,
    /// The worst directional albedo, |relative error|.
    pub albedo: f64,
}

/// A training at its end.
pub struct Trained {
    pub session: Session,
    /// `None` of an NBRDF.
    pub brdf: Option<NeuBrdf>,
    pub cost: Cost,
}

/// Trains to the end. What asking the ground truth takes is no part of the cost.
pub fn train(truth: &Truth, plan: Plan) -> Result<Trained> {
    let pairs = truth.pairs(plan.pairs, plan.seed);
    let is_isotropic = truth.is_isotropic;
    let mut session = Session::new(plan, &GroundTruth::Samples { pairs: &pairs, is_isotropic })?;
    let training = Stopwatch::own();
    session.run(u32::MAX);
    let training = training.stop();
    let views = session.views(&GroundTruth::Function { eval: &|wo, wi| truth.eval(wo, wi), is_isotropic }, |_, _| ());
    let finishing = Stopwatch::own();
    let brdf = session.finished(views.as_ref(), || ());
    let finishing = finishing.stop();
    let sum = |of: fn(&Timing) -> f64| of(&training) + of(&finishing);
    let cost = Cost { seconds: sum(|timing| timing.seconds), cpu_seconds: sum(|timing| timing.cpu_seconds) };
    Ok(Trained { session, brdf, cost })
}

/// Measures a fit.
pub fn errors(truth: &Truth, fit: &Evaluator) -> Errors {
    errors_of(truth, BALL, &|pairs| fit.eval(pairs))
}

/// Measures anything that says what the ground truth is, by a ball of so many pixels to a side.
pub fn errors_of(truth: &Truth, ball: usize, eval: Eval) -> Errors {
    let measured = |pairs: &[[DVec3; 2]]| truth.measure(pairs);
    let FitErrors { pairs, ball, worst_albedo, .. } = compare(ball, truth.is_isotropic, eval, &measured).errors;
    Errors {
        log: pairs.log,
        relative_rmse: pairs.relative_rmse,
        ssim: ball.ssim,
        flip: ball.flip,
        albedo: worst_albedo,
    }
}

/// What the file holds, or else what `make` finds out, which is then written to it.
pub fn kept<T: Serialize + DeserializeOwned>(path: &Path, make: impl FnOnce() -> Result<T>) -> Result<T> {
    if let Ok(text) = std::fs::read_to_string(path) {
        return serde_json::from_str(&text).with_context(|| format!("{}: delete it to do it again", path.display()));
    }
    let value = make()?;
    write_file(path, serde_json::to_string_pretty(&value)?)?;
    Ok(value)
}

/// A short name for anything that is made of numbers and words.
pub fn key(of: &impl Serialize) -> Result<String> {
    Ok(blake3::hash(serde_json::to_string(of)?.as_bytes()).to_hex()[..12].to_owned())
}

/// A bar over `length` fits.
pub fn bar(length: usize) -> Result<ProgressBar> {
    let bar = ProgressBar::new(length as u64);
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len}  {elapsed} + {eta}  {msg}")?);
    bar.enable_steady_tick(std::time::Duration::from_secs(1));
    Ok(bar)
}
