//! What a fit is judged by: its ground truth, or the measurements that it was made of and those that it was not.

use neubrdf::train::Judged;
use neubrdf::train::ball::Ball;
use neubrdf::train::measure::{Comparison, EvalAt, Query, compare_at};
use rayon::prelude::*;

use super::brdf_input::BrdfInput;

/// Pixels to a side of balls.
const BALL: usize = 160;

/// How good a fit is, and the balls of it and of what it is shown beside.
pub struct Judgement {
    pub judged: Judged,
    /// `None` of a fit to measurements, if nobody looks at them.
    pub balls: Option<[Ball; 2]>,
}

/// Judges a fit to `input`. Between measurements nothing is known: what interpolates them is drawn beside the fit, but is not the truth.
pub fn judge(input: &BrdfInput, fit: EvalAt, is_shown: bool) -> Judgement {
    let at = |query: &Query| input.brdf.eval_at(query.footprint, query.wo, query.wi);
    let beside = |queries: &[Query]| queries.par_iter().map(at).collect();
    match input.residuals(fit) {
        Some(residuals) => Judgement {
            judged: Judged::Residuals(residuals),
            balls: is_shown.then(|| [Ball::render(BALL, fit), Ball::render(BALL, &beside)]),
        },
        None => {
            let Comparison { errors, fit, truth } = compare_at(BALL, input.brdf.is_isotropic(), fit, &beside);
            Judgement { judged: Judged::Errors(errors), balls: Some([fit, truth]) }
        }
    }
}
