//! Finds the lobes that sample a BRDF with the least variance.
//!
//! Where ∫f cos θi L dωi under a uniform sky is estimated with density p, the second moment is ∫F²/p, F = f cos θi (summed over
//! channels). It is integrated numerically, with F known at points that lobes of many widths have picked, for a number of
//! ωo. For each of these the moment is convex in the probabilities of the lobes, which a fixed-point iteration finds; the α of the lobes
//! are searched on a grid for the least mean logarithm of the moments.

use std::collections::HashMap;
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
const POINTS: u32 = 192;
/// Views from other azimuths, over a quarter turn, of a BRDF that is not isotropic.
const AZIMUTHS: usize = 3;
/// The nodes of the table of weights from which the α are searched; the table is filled at all of them.
const SEARCHED: [usize; 5] = [2, 5, 8, 11, 14];
/// The grid of α, even in their logarithm from [`SamplingLobe::LEAST_ALPHA`] to 1.
const GRID: usize = 31;

/// The lobes for a BRDF `eval(wo, wi)`. Deterministic; it costs some 2·10⁴ evaluations, 7·10⁴ where the BRDF is not isotropic.
pub fn fit_lobe(is_isotropic: bool, eval: &(dyn Fn(DVec3, DVec3) -> DVec3 + Sync)) -> SamplingLobe {
    let azimuths = if is_isotropic { 1 } else { AZIMUTHS };
    let views: Vec<View> = (0..SamplingLobe::NODES * azimuths)
        .into_par_iter()
        .map(|index| View::new(index / azimuths, FRAC_PI_2 * (index % azimuths) as f64 / (AZIMUTHS - 1) as f64, eval))
        .collect();
    let searched = SEARCHED.iter().flat_map(|node| &views[node * azimuths..(node + 1) * azimuths]).collect();
    let mut search = Search { views: searched, densities: HashMap::new() };

    // Isotropic lobes first, from a coarse grid on; where the BRDF is not isotropic also from one lobe that is stretched.
    let coarse = || (2..GRID).step_by(4);
    let pairs =
        coarse().flat_map(|wide| coarse().filter(move |narrow| *narrow < wide).map(move |narrow| [narrow, wide]));
    let start = search.least(pairs.map(|[narrow, wide]| [[narrow; 2], [wide; 2]]));
    const TOGETHER: [[i32; 4]; 4] = [[1, 1, 0, 0], [-1, -1, 0, 0], [0, 0, 1, 1], [0, 0, -1, -1]];
    const STRETCHED: [[i32; 4]; 4] = [[1, 0, 1, 0], [-1, 0, -1, 0], [0, 1, 0, 1], [0, -1, 0, -1]];
    const EACH: [[i32; 4]; 8] = [
        [1, 0, 0, 0],
        [-1, 0, 0, 0],
        [0, 1, 0, 0],
        [0, -1, 0, 0],
        [0, 0, 1, 0],
        [0, 0, -1, 0],
        [0, 0, 0, 1],
        [0, 0, 0, -1],
    ];
    let mut best = search.descend(start, &TOGETHER, 2);
    if !is_isotropic {
        let single = search.least(coarse().map(|both| [[both; 2]; 2]));
        let stretched = search.descend(single, &STRETCHED, 4);
        let starts = [best, (stretched.0, stretched.1)].map(|start| search.descend(start, &EACH, 4));
        best = if starts[0].1 <= starts[1].1 { starts[0] } else { starts[1] };
    }

    let mut lobes = best.0;
    lobes.sort();
    let alpha = lobes.map(|lobe| lobe.map(alpha_at));
    let weight = |views: &[View]| {
        let sum: DVec2 = views.iter().map(|view| view.solve(&lobes.map(|lobe| view.densities(lobe)), 200).0).sum();
        (sum / azimuths as f64).as_vec2().to_array()
    };
    let weights: Vec<[f32; 2]> = views.par_chunks(azimuths).map(weight).collect();
    SamplingLobe {
        alpha: alpha.map(|alpha| alpha.map(|alpha| alpha as f32)),
        weight: std::array::from_fn(|node| weights[node]),
    }
}

/// An entry of the grid.
fn alpha_at(index: usize) -> f64 {
    f64::from(SamplingLobe::LEAST_ALPHA).powf(1.0 - index as f64 / (GRID - 1) as f64)
}

/// Two lobes by their places on the grid, along tangent and bitangent.
type Lobes = [[usize; 2]; 2];

/// The search for α.
struct Search<'a> {
    views: Vec<&'a View>,
    /// What [`View::densities`] are for each view, by lobe.
    densities: HashMap<[usize; 2], Vec<Vec<f64>>>,
}

impl Search<'_> {
    /// The sum of the logarithms of the second moments.
    fn cost(&mut self, lobes: Lobes) -> f64 {
        for lobe in lobes {
            self.densities
                .entry(lobe)
                .or_insert_with(|| self.views.par_iter().map(|view| view.densities(lobe)).collect());
        }
        let [first, second] = lobes.map(|lobe| &self.densities[&lobe]);
        let of_view =
            |(view, (first, second)): (&&View, (&Vec<f64>, &Vec<f64>))| view.solve(&[first, second], 20).1.ln();
        let costs: Vec<f64> = self.views.par_iter().zip(first.par_iter().zip(second)).map(of_view).collect();
        costs.iter().sum()
    }

    /// The cheapest of several.
    fn least(&mut self, candidates: impl Iterator<Item = Lobes>) -> (Lobes, f64) {
        candidates.fold(([[GRID - 1; 2]; 2], f64::INFINITY), |best, lobes| {
            let cost = self.cost(lobes);
            if cost < best.1 { (lobes, cost) } else { best }
        })
    }

    /// Goes downhill from a start, by steps that are halved when none of them leads down.
    fn descend(&mut self, start: (Lobes, f64), moves: &[[i32; 4]], mut size: i32) -> (Lobes, f64) {
        let mut best = start;
        while size > 0 {
            let [[a, b], [c, d]] = best.0;
            let moved = |step: &[i32; 4]| {
                let at = |index: usize, step: i32| (index as i32 + size * step).clamp(0, GRID as i32 - 1) as usize;
                [[at(a, step[0]), at(b, step[1])], [at(c, step[2]), at(d, step[3])]]
            };
            let next = self.least(moves.iter().map(moved));
            if next.1 < best.1 {
                best = next;
            } else {
                size /= 2;
            }
        }
        best
    }
}

/// A BRDF seen from one direction.
struct View {
    wo: DVec3,
    points: Vec<Point>,
}

/// A direction that light may come from.
struct Point {
    /// Of `wo` and the direction.
    half: DVec3,
    /// The density of the hemisphere.
    cosine: f64,
    /// F² over the density of the point and over how many there are.
    moment: f64,
}

impl View {
    fn new(node: usize, phi: f64, eval: &(dyn Fn(DVec3, DVec3) -> DVec3 + Sync)) -> View {
        // The first node is the horizon, where nothing is seen; what is a little above it stands for it.
        let cosine = (node as f64).max(0.25) / (SamplingLobe::NODES - 1) as f64;
        let sine = (1.0 - cosine * cosine).sqrt();
        let wo = DVec3::new(sine * phi.cos(), sine * phi.sin(), cosine);
        let probes = PROBES.map(|alpha| Ggx { alpha: DVec2::splat(alpha) });
        let picked_by =
            |probe: Ggx| (0..POINTS).map(move |i| reflect(wo, probe.sample_visible_normal(wo, hammersley(i))));
        let picked = probes.into_iter().flat_map(picked_by);
        let directions = picked.chain((0..POINTS).map(|i| sample_cosine_hemisphere(hammersley(i))));
        let points = directions
            .filter(|wi| wi.z >= MIN_COSINE)
            .map(|wi| {
                let half = (wo + wi).normalize();
                let cosine = wi.z * FRAC_1_PI;
                let density = probes.iter().map(|probe| reflection_pdf(*probe, wo, half)).sum::<f64>() + cosine;
                let moment = (eval(wo, wi) * wi.z).length_squared() / (density * f64::from(POINTS));
                debug_assert!(moment.is_finite(), "f({wo}, {wi}) is not finite");
                Point { half, cosine, moment }
            })
            .collect();
        View { wo, points }
    }

    /// The density of a lobe at each point.
    fn densities(&self, lobe: [usize; 2]) -> Vec<f64> {
        let ggx = Ggx { alpha: DVec2::from_array(lobe.map(alpha_at)) };
        self.points.iter().map(|point| reflection_pdf(ggx, self.wo, point.half)).collect()
    }

    /// The best probabilities of two lobes, and the second moment M that they leave. At the least moment ∂M/∂w is the same for
    /// each technique of probability w > 0 and is −M then: w is multiplied by √(−∂M/∂w / M) until that is 1.
    fn solve(&self, lobes: &[impl AsRef<[f64]>; 2], rounds: u32) -> (DVec2, f64) {
        let least_cosine = 1.0 - f64::from(SamplingLobe::MOST_WEIGHT);
        let [first, second] = [lobes[0].as_ref(), lobes[1].as_ref()];
        let mut weights = DVec3::splat(1.0 / 3.0);
        let mut moment = 0.0;
        for _ in 0..rounds {
            moment = 0.0;
            let mut slope = DVec3::ZERO;
            for ((point, first), second) in self.points.iter().zip(first).zip(second) {
                let densities = DVec3::new(*first, *second, point.cosine);
                let inverse = 1.0 / weights.dot(densities);
                let share = point.moment * inverse;
                moment += share;
                slope += densities * (share * inverse);
            }
            if moment <= 0.0 {
                // Black from here.
                return (DVec2::ZERO, f64::MIN_POSITIVE);
            }
            weights *= (slope / moment).map(f64::sqrt);
            weights /= weights.element_sum();
            let cosine = weights.z.max(least_cosine);
            weights = (weights.truncate() * ((1.0 - cosine) / (weights.x + weights.y).max(1e-300))).extend(cosine);
        }
        (weights.truncate(), moment)
    }
}

/// The points of a (0,2)-sequence, of [`POINTS`] many: Hammersley's.
fn hammersley(index: u32) -> [f64; 2] {
    [(f64::from(index) + 0.5) / f64::from(POINTS), f64::from(index.reverse_bits()) / 2f64.powi(32)]
}
