//! How far a fit is from its ground truth.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::pairs::draw;
use super::random::Random;

/// A BRDF at many (ωo, ωi) at once.
pub type Eval<'a> = &'a (dyn Fn(&[[DVec3; 2]]) -> Vec<DVec3> + Sync);

/// Errors over pairs drawn as those for training are.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct PairErrors {
    /// Mean of |Δ ln(1 + f)|.
    pub log: f64,
    /// Root mean square of Δ(f cos θi) over that of f cos θi.
    pub relative_rmse: f64,
}

/// Compares at `count` random pairs.
pub fn pair_errors(count: usize, seed: u64, fit: Eval, truth: Eval) -> PairErrors {
    let mut random = Random::new(seed, 0);
    let pairs: Vec<[DVec3; 2]> = (0..count).map(|_| draw(&mut random)).map(|(wo, wi)| [wo, wi]).collect();
    let (mut log, mut square, mut norm) = (0.0, 0.0, 0.0);
    for ((fit, truth), [_, wi]) in fit(&pairs).into_iter().zip(truth(&pairs)).zip(&pairs) {
        for (a, b) in fit.to_array().into_iter().zip(truth.to_array()) {
            log += (a.ln_1p() - b.ln_1p()).abs();
            square += ((a - b) * wi.z).powi(2);
            norm += (b * wi.z).powi(2);
        }
    }
    PairErrors { log: log / (3 * count) as f64, relative_rmse: (square / norm.max(1e-300)).sqrt() }
}

/// Directional albedo, ∫ f(ωo, ωi) cos θi dωi, RGB, by `count` points that crowd where lobes are. Exact enough to compare two
/// BRDFs, as both are seen at the same points.
pub fn albedo(wo: DVec3, count: usize, eval: Eval) -> DVec3 {
    let mut directions = Vec::with_capacity(count);
    let mut weights = Vec::with_capacity(count);
    for i in 0..count {
        // A Kronecker sequence of the plastic number and its kin (Roberts 2018).
        let at = |step: f64| (0.5 + step * (i as f64 + 1.0)).fract();
        let [u, v, choice] = [at(0.819_172_513_396_164_4), at(0.671_043_606_703_789_2), at(0.549_700_477_901_960_6)];
        let phi = TAU * v;
        let polar = |theta: f64| DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        let wi = match choice {
            ..0.4 => polar(u.sqrt().asin()),
            ..0.7 => mirrored(wo, polar(FRAC_PI_2 * u.powi(2))),
            _ => mirrored(wo, polar(FRAC_PI_2 * u.powi(4))),
        };
        if wi.z <= 0.0 {
            continue;
        }
        let half = (wo + wi).normalize();
        let theta = half.z.clamp(-1.0, 1.0).acos().max(1e-9);
        let crowded = |power: f64| {
            let by_theta = (theta / FRAC_PI_2).powf(1.0 / power - 1.0) / (power * FRAC_PI_2);
            by_theta / (TAU * theta.sin()) / (4.0 * wo.dot(half))
        };
        let density = 0.4 * wi.z / PI + 0.3 * crowded(2.0) + 0.3 * crowded(4.0);
        directions.push([wo, wi]);
        weights.push(wi.z / density / count as f64);
    }
    eval(&directions).into_iter().zip(weights).map(|(value, weight)| value * weight).sum()
}

fn mirrored(wo: DVec3, half: DVec3) -> DVec3 {
    2.0 * wo.dot(half) * half - wo
}
