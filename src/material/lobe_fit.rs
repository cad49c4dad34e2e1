//! Finds the lobe that samples a BRDF with the least variance.
//!
//! For an estimator of ∫f cos θi L dωi under a uniform sky, that samples with density p, the second moment is ∫F²/p, F = f cos θi
//! (summed over channels). It is integrated numerically, with F known at points that a mixture of lobes of all widths has
//! picked, for a few ωo. For each ωo the moment is convex in the lobe's probability, which is searched by sections; α is what makes
//! the mean logarithm of the moments least.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_2};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::conductor::reflection_pdf;
use super::diffuse::sample_cosine_hemisphere;
use super::{Ggx, MIN_COSINE, reflect};
use crate::scene::SamplingLobe;

/// The α, wide to narrow, of the lobes that pick the points.
const PROBES: [f64; 7] = [0.6, 0.25, 0.1, 0.04, 0.015, 0.006, 0.002];
/// Points that each of them, and the hemisphere, pick.
const POINTS: u32 = 256;
/// Views from other azimuths of a BRDF that is not isotropic, over a quarter turn.
const AZIMUTHS: usize = 4;
/// The α that are tried at first, from [`SamplingLobe::LEAST_ALPHA`] to 1.
const STEPS: usize = 25;

/// The lobe for a BRDF `eval(wo, wi)`. Deterministic; it costs some 3·10⁴ evaluations, 10⁵ where the BRDF is not isotropic.
pub fn fit_lobe(is_isotropic: bool, eval: &(dyn Fn(DVec3, DVec3) -> DVec3 + Sync)) -> SamplingLobe {
    let azimuths = if is_isotropic { 1 } else { AZIMUTHS };
    let views: Vec<View> = (0..SamplingLobe::NODES * azimuths)
        .into_par_iter()
        .map(|index| {
            let (node, azimuth) = (index / azimuths, index % azimuths);
            let phi = FRAC_PI_2 * (azimuth as f64 + 0.5) / azimuths as f64;
            View::new(node, if is_isotropic { 0.0 } else { phi }, eval)
        })
        .collect();
    let cost = |alpha: DVec2| -> f64 { views.par_iter().map(|view| view.best_weight(Ggx { alpha }).1.ln()).sum() };
    let at = |step: f64| f64::from(SamplingLobe::LEAST_ALPHA).powf(1.0 - step / (STEPS - 1) as f64);

    let isotropic = least(0.0, (1..STEPS).map(|step| step as f64), |step| cost(DVec2::splat(at(step))));
    let mut steps = [isotropic; 2];
    let mut size = if is_isotropic { 0.5 } else { 4.0 };
    while size > 0.1 {
        let [x, y] = steps;
        let moves: &[[f64; 2]] = if is_isotropic {
            &[[-1.0, -1.0], [1.0, 1.0]]
        } else {
            &[[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]]
        };
        let limit = |step: f64| step.clamp(0.0, (STEPS - 1) as f64);
        let candidates = moves.iter().map(|[dx, dy]| [limit(x + dx * size), limit(y + dy * size)]);
        steps = least(steps, candidates, |[x, y]| cost(DVec2::new(at(x), at(y))));
        if steps == [x, y] {
            size *= 0.5;
        }
    }

    let ggx = Ggx { alpha: DVec2::new(at(steps[0]), at(steps[1])) };
    let mut lobe = SamplingLobe { alpha: ggx.alpha.as_vec2().to_array(), ..SamplingLobe::COSINE };
    for (node, views) in views.chunks(azimuths).enumerate() {
        lobe.weight[node] = (views.iter().map(|view| view.best_weight(ggx).0).sum::<f64>() / azimuths as f64) as f32;
    }
    lobe
}

/// The first one, or the candidate that costs less than it and the least of all.
fn least<T: Copy>(first: T, others: impl Iterator<Item = T>, cost: impl Fn(T) -> f64) -> T {
    let mut best = (first, cost(first));
    for candidate in others {
        let cost = cost(candidate);
        if cost < best.1 {
            best = (candidate, cost);
        }
    }
    best.0
}

/// A BRDF seen from one direction.
struct View {
    wo: DVec3,
    points: Vec<Point>,
}

/// A direction that light may come from.
struct Point {
    wi: DVec3,
    /// Of `wo` and `wi`.
    half: DVec3,
    /// F² over the density of the point, over how many there are.
    moment: f64,
}

impl View {
    fn new(node: usize, phi: f64, eval: &(dyn Fn(DVec3, DVec3) -> DVec3 + Sync)) -> View {
        // The first node is the horizon, where nothing is seen; what is a little above it stands for it.
        let cosine = (node as f64).max(0.25) / (SamplingLobe::NODES - 1) as f64;
        let sine = (1.0 - cosine * cosine).sqrt();
        let wo = DVec3::new(sine * phi.cos(), sine * phi.sin(), cosine);
        let probes = PROBES.map(|alpha| Ggx { alpha: DVec2::splat(alpha) });
        let from_probes = probes
            .iter()
            .flat_map(|probe| (0..POINTS).map(move |i| reflect(wo, probe.sample_visible_normal(wo, hammersley(i)))));
        let directions = from_probes.chain((0..POINTS).map(|i| sample_cosine_hemisphere(hammersley(i))));
        let points = directions
            .filter(|wi| wi.z >= MIN_COSINE)
            .map(|wi| {
                let half = (wo + wi).normalize();
                let density =
                    probes.iter().map(|probe| reflection_pdf(*probe, wo, half)).sum::<f64>() + wi.z * FRAC_1_PI;
                let value = eval(wo, wi) * wi.z;
                Point { wi, half, moment: value.length_squared() / (density * f64::from(POINTS)) }
            })
            .collect();
        View { wo, points }
    }

    /// The best probability of a lobe from here, and the second moment that it leaves.
    fn best_weight(&self, ggx: Ggx) -> (f64, f64) {
        let densities: Vec<(f64, f64, f64)> = self
            .points
            .iter()
            .map(|point| (point.moment, reflection_pdf(ggx, self.wo, point.half), point.wi.z * FRAC_1_PI))
            .collect();
        let moment = |weight: f64| -> f64 {
            densities.iter().map(|(moment, lobe, cosine)| moment / (weight * lobe + (1.0 - weight) * cosine)).sum()
        };
        // A tenth of a percent is more than the integral is good for.
        let (mut low, mut high) = (0.0, f64::from(SamplingLobe::MOST_WEIGHT));
        while high - low > 2e-3 {
            let third = (high - low) / 3.0;
            if moment(low + third) <= moment(high - third) { high -= third } else { low += third }
        }
        let weight = 0.5 * (low + high);
        (weight, moment(weight).max(f64::MIN_POSITIVE))
    }
}

/// The points of a (0,2)-sequence, of [`POINTS`] many: Hammersley's.
fn hammersley(index: u32) -> [f64; 2] {
    [(f64::from(index) + 0.5) / f64::from(POINTS), f64::from(index.reverse_bits()) / 2f64.powi(32)]
}
