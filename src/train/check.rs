//! Whether a BRDF is one: reciprocal, no source of light, nowhere negative or undefined.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use serde::Serialize;

use super::measure::{Eval, directional_albedo};
use super::pairs::direction;
use crate::scene::brdf::SurfaceFrame;

/// What was found over a dense grid of directions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Pairs of directions that were looked at.
    pub pairs: usize,
    /// Of those, with a NaN or an infinity in a channel.
    pub non_finite: usize,
    /// Of those, with a negative number in a channel.
    pub negative: usize,
    /// Σ |f(ωo, ωi) r(ωo) − f(ωi, ωo) r(ωi)| cos θo cos θi / Σ f r(ωo) cos θo cos θi over channels and the grid, with r of
    /// [`SurfaceFrame::received`], which is 1 where nothing leans. A leaning lobe f′ is seen as f = f′ r(ωi), which is not reciprocal even
    /// if f′ is: both of it times both r is what changing the directions should leave as it was.
    pub reciprocity_error: f64,
    /// The largest directional albedo of a channel.
    pub max_albedo: f64,
    /// θo and φo of it, degrees.
    pub max_albedo_at: [f64; 2],
}

impl Check {
    /// What was found of both, and the worse.
    pub fn merge(self, other: Check) -> Check {
        // A NaN is the largest of all.
        let other_is_worse = other.max_albedo > self.max_albedo || other.max_albedo.is_nan();
        let worse = if other_is_worse { other } else { self };
        Check {
            pairs: self.pairs + other.pairs,
            non_finite: self.non_finite + other.non_finite,
            negative: self.negative + other.negative,
            reciprocity_error: self.reciprocity_error.max(other.reciprocity_error),
            ..worse
        }
    }
}

/// θ of the grid, uniform from the normal to just above the surface.
const THETAS: usize = 46;
/// Differences of azimuth, uniform over half a turn, over a whole one where the BRDF is not isotropic, both ends included.
const PHIS: usize = 37;
/// Azimuths of ωo where the BRDF is not isotropic, over a whole turn: what leans looks different from behind.
const TURNS: usize = 12;
/// The lowest directions, degrees.
const LOWEST: f64 = 89.9;
/// Points of an albedo.
const ALBEDO_POINTS: usize = 4096;

/// Looks at a BRDF whose lobes lie in a frame.
pub fn check(is_isotropic: bool, frame: SurfaceFrame, eval: Eval) -> Check {
    let (turns, around) = if is_isotropic { (1, PI) } else { (TURNS, TAU) };
    let thetas: Vec<f64> = (0..THETAS).map(|i| (LOWEST * i as f64 / (THETAS - 1) as f64).to_radians()).collect();
    let azimuths: Vec<f64> = (0..turns).map(|turn| TAU * turn as f64 / turns as f64).collect();
    let mut pairs = Vec::new();
    for (theta_o, phi_o) in thetas.iter().flat_map(|theta| azimuths.iter().map(move |phi| (*theta, *phi))) {
        let wo = direction(theta_o, phi_o);
        for theta_i in &thetas {
            pairs.extend((0..PHIS).map(|k| [wo, direction(*theta_i, phi_o + around * k as f64 / (PHIS - 1) as f64)]));
        }
    }
    let swapped: Vec<[DVec3; 2]> = pairs.iter().map(|[wo, wi]| [*wi, *wo]).collect();
    let (mut non_finite, mut negative, mut difference, mut sum) = (0, 0, 0.0, 0.0);
    for ((value, other), [wo, wi]) in eval(&pairs).into_iter().zip(eval(&swapped)).zip(&pairs) {
        non_finite += usize::from(!value.is_finite());
        negative += usize::from(value.min_element() < 0.0);
        let cosines = wo.z * wi.z;
        let [value, other] = [value * frame.received(*wo), other * frame.received(*wi)];
        difference += (value - other).abs().element_sum() * cosines;
        sum += value.element_sum() * cosines;
    }
    let mut max = (f64::NEG_INFINITY, [0.0; 2]);
    for (theta, phi) in thetas.iter().flat_map(|theta| azimuths.iter().map(move |phi| (*theta, *phi))) {
        let theta = theta.min(FRAC_PI_2);
        let albedo = directional_albedo(direction(theta, phi), ALBEDO_POINTS, eval);
        // A NaN is the largest of all.
        let albedo = if albedo.is_nan() { f64::NAN } else { albedo.max_element() };
        if albedo > max.0 || albedo.is_nan() {
            max = (albedo, [theta.to_degrees(), phi.to_degrees()]);
        }
    }
    Check {
        pairs: pairs.len(),
        non_finite,
        negative,
        reciprocity_error: if sum > 0.0 { difference / sum } else { difference },
        max_albedo: max.0,
        max_albedo_at: max.1,
    }
}
