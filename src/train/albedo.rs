//! The end of a training: directional albedos as the ground truth has them.
//!
//! Nothing in the loss asks for ∫ f cos θi dωi, and the least loss leaves it off by a percent here and there, by chance from one grid point
//! of ωo to the next. So the fit's albedo is compared with the ground truth's at many ωo, views, and the codes of ωo are
//! moved until they agree: of all moves δ that close the gaps r, to first order J δ = r, by the one that the loss minds least,
//!
//! δ = H⁻¹ Jᵀ (J H⁻¹ Jᵀ + μ)⁻¹ r.
//!
//! J has a row for each view and channel, as r in parts of the albedo; H is the loss's curvature as of Gauss and Newton, code by code. With its
//! Cholesky factors, H = L Lᵀ, J is kept as W = J L⁻ᵀ, so that δ = L⁻ᵀ Wᵀ (W Wᵀ + μ)⁻¹ r.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::evaluator::Evaluator;
use super::gather::in_frame;
use super::measure::{BLACK, Eval, GOLDEN, Query, albedo_points};
use super::network::Shard;
use super::product::padded;
use crate::scene::brdf::{Encoding, Footprint, Gathered, NO_CODE, NeuBrdf};

/// Views of an isotropic material, even in θ, before those below [`LOWEST_VIEW`] are left out.
const RINGS: usize = 96;

/// The least cosine of a view.
const LOWEST_VIEW: f64 = 0.05;

/// Directions of light that a view's albedo is taken with, of an isotropic material and of another, which has more views.
const LIGHTS: [usize; 2] = [4096, 1024];

/// Views that are asked for between two words about how far it is.
const TOGETHER: usize = 8;

/// μ, over the mean of the diagonal of W Wᵀ, at first: how far gaps are closed at a time, and what the fit pays for it.
const SOFTNESS: f64 = 1.0;

/// What μ is multiplied by after a step to smaller gaps, and after one to larger gaps, which is taken back (Levenberg and Marquardt).
const SOFTENING: [f64; 2] = [1.0 / 3.0, 10.0];

/// What is added to the diagonal of a code's curvature, over its mean and over that of all codes: what the loss hardly minds is not free to go
/// anywhere.
const DAMPING: [f64; 2] = [1e-2, 1e-3];

/// Gaps of which the root mean square and the largest are less are as good as closed: a fit of `gold 0.2` paid for less with 5 % more error
/// elsewhere.
const CLOSED: [f64; 2] = [2e-3, 5e-3];

/// Directions of ωo, and the ground truth's albedos there.
pub struct Views(Vec<View>);

struct View {
    wo: DVec3,
    lights: Vec<DVec3>,
    /// The solid angle times the cosine that each stands for.
    weights: Vec<f64>,
    albedo: DVec3,
}

impl Views {
    /// Asks a ground truth, for a NeuBRDF that is the same everywhere: in rings, or at the grid points of ωo. `tell` hears how many views are
    /// asked for, and of how many.
    pub fn ask(brdf: &NeuBrdf, truth: Eval, mut tell: impl FnMut(usize, usize)) -> Views {
        let NeuBrdf { wo: table, is_isotropic, .. } = brdf;
        let mut all: Vec<DVec3> = if *is_isotropic {
            let ring = |i: usize| FRAC_PI_2 * (i as f64 + 0.5) / RINGS as f64;
            (0..RINGS).map(ring).map(|theta| DVec3::new(theta.sin(), 0.0, theta.cos())).collect()
        } else {
            let points = (0..table.grid.point_count()).filter(|point| table.indices[*point] != NO_CODE);
            points.map(|point| table.grid.point(point)).collect()
        };
        all.retain(|wo| wo.z > LOWEST_VIEW);
        let view = |(index, wo): (usize, &DVec3)| {
            let (lights, weights) = albedo_points(*wo, LIGHTS[usize::from(!is_isotropic)], GOLDEN * index as f64);
            let mut view = View { wo: *wo, lights, weights, albedo: DVec3::ZERO };
            view.albedo = view.albedo_of(truth);
            view
        };
        let mut views = Vec::new();
        while views.len() < all.len() {
            tell(views.len(), all.len());
            views.par_extend(all.par_iter().enumerate().skip(views.len()).take(TOGETHER).map(view));
        }
        Views(views)
    }

    /// Moves the codes of ωo of that NeuBRDF, `rounds` times or until gaps are as good as closed. `tell` is called rounds + 1 times at most.
    pub fn close_gaps(&self, brdf: &mut NeuBrdf, rounds: u32, mut tell: impl FnMut()) {
        let mut gaps = self.gaps(brdf);
        if are_closed(&gaps) {
            return;
        }
        let mut slopes = Slopes::of(brdf, &self.0);
        tell();
        for _ in 0..rounds {
            let before = brdf.wo.codebook.codes.clone();
            let codes = &mut Arc::make_mut(&mut brdf.wo.codebook).codes;
            codes.iter_mut().zip(slopes.step(&gaps)).for_each(|(code, step)| *code += step as f32);
            let after = self.gaps(brdf);
            tell();
            let is_better = dot(&after, &after) < dot(&gaps, &gaps);
            slopes.softness *= SOFTENING[usize::from(!is_better)];
            if is_better {
                gaps = after;
                if are_closed(&gaps) {
                    return;
                }
            } else {
                Arc::make_mut(&mut brdf.wo.codebook).codes = before;
            }
        }
    }

    /// What is missing of the albedos, in parts of them, by view and channel.
    fn gaps(&self, brdf: &NeuBrdf) -> Vec<f64> {
        let evaluator = Evaluator::neubrdf(brdf);
        let gap = |view: &View| (view.albedo - view.albedo_of(&|pairs| evaluator.eval(pairs))) / view.unit();
        self.0.par_iter().flat_map_iter(|view| gap(view).to_array()).collect()
    }
}

impl View {
    fn albedo_of(&self, eval: Eval) -> DVec3 {
        let pairs: Vec<[DVec3; 2]> = self.lights.iter().map(|wi| [self.wo, *wi]).collect();
        eval(&pairs).into_iter().zip(&self.weights).map(|(value, weight)| value * *weight).sum()
    }

    /// What gaps are parts of: the albedo, but of a channel that is all but black a little of the brightest.
    fn unit(&self) -> DVec3 {
        self.albedo.max(DVec3::splat(0.02 * self.albedo.max_element())).max(DVec3::splat(BLACK))
    }
}

/// How albedos change with the codes of ωo.
struct Slopes {
    features: usize,
    /// L of each code, features × features.
    factors: Vec<f64>,
    /// Of each view the codes that it sees, and W's rows for the three channels, codes × features.
    rows: Vec<(Vec<u16>, [Vec<f64>; 3])>,
    /// μ
    softness: f64,
}

impl Slopes {
    fn of(brdf: &NeuBrdf, views: &[View]) -> Slopes {
        let features = brdf.wo.codebook.features as usize;
        let square = features * features;
        let evaluator = Evaluator::neubrdf(brdf);
        let mut transposed = Vec::new();
        evaluator.network().transpose(&mut transposed);
        let seen: Vec<Seen> = views.par_iter().map(|view| Seen::of(brdf, &evaluator, &transposed, view)).collect();
        let mut factors = vec![0.0; brdf.wo.codebook.codes.len() * features];
        for Seen { codes, curvature, .. } in &seen {
            for (code, curvature) in codes.iter().zip(curvature.chunks_exact(square)) {
                let sum = &mut factors[usize::from(*code) * square..][..square];
                sum.iter_mut().zip(curvature).for_each(|(sum, part)| *sum += part);
            }
        }
        let means: Vec<f64> = factors.chunks_exact(square).map(|block| mean_of_diagonal(block, features)).collect();
        let overall = means.iter().sum::<f64>() / means.iter().filter(|mean| **mean > 0.0).count().max(1) as f64;
        for (block, mean) in factors.chunks_exact_mut(square).zip(means) {
            // Codes that no view sees stay where they are.
            let damping = if mean > 0.0 { DAMPING[0] * mean + DAMPING[1] * overall } else { 1.0 };
            factorise(block, features, damping);
        }
        let mut rows: Vec<(Vec<u16>, [Vec<f64>; 3])> = seen.into_iter().map(|seen| (seen.codes, seen.slopes)).collect();
        let mut trace = 0.0;
        for (codes, channels) in &mut rows {
            for row in channels {
                for (code, row) in codes.iter().zip(row.chunks_exact_mut(features)) {
                    solve_lower(&factors[usize::from(*code) * square..][..square], row);
                }
                trace += row.iter().map(|x| x * x).sum::<f64>();
            }
        }
        let softness = SOFTNESS * trace / (3 * views.len()).max(1) as f64;
        Slopes { features, factors, rows, softness }
    }

    /// δ.
    fn step(&self, gaps: &[f64]) -> Vec<f64> {
        let mut step = self.to_codes(&self.conjugate_gradients(gaps));
        let square = self.features * self.features;
        for (step, factor) in step.chunks_exact_mut(self.features).zip(self.factors.chunks_exact(square)) {
            solve_upper(factor, step);
        }
        step
    }

    /// (W Wᵀ + μ)⁻¹ r
    fn conjugate_gradients(&self, gaps: &[f64]) -> Vec<f64> {
        let mut solution = vec![0.0; gaps.len()];
        let mut residual = gaps.to_vec();
        let mut direction = residual.clone();
        let first = dot(&residual, &residual);
        let mut square = first;
        for _ in 0..gaps.len() {
            if square <= 1e-8 * first {
                break;
            }
            let mut image = self.to_views(&self.to_codes(&direction));
            image.iter_mut().zip(&direction).for_each(|(image, x)| *image += self.softness * x);
            let length = square / dot(&direction, &image);
            solution.iter_mut().zip(&direction).for_each(|(x, d)| *x += length * d);
            residual.iter_mut().zip(&image).for_each(|(r, image)| *r -= length * image);
            let next = dot(&residual, &residual);
            direction.iter_mut().zip(&residual).for_each(|(d, r)| *d = r + next / square * *d);
            square = next;
        }
        solution
    }

    /// Wᵀ x
    fn to_codes(&self, x: &[f64]) -> Vec<f64> {
        let features = self.features;
        let mut sums = vec![0.0; self.factors.len() / features];
        for ((codes, channels), x) in self.rows.iter().zip(x.chunks_exact(3)) {
            for (row, x) in channels.iter().zip(x) {
                for (code, row) in codes.iter().zip(row.chunks_exact(features)) {
                    let sums = &mut sums[usize::from(*code) * features..][..features];
                    sums.iter_mut().zip(row).for_each(|(sum, slope)| *sum += slope * x);
                }
            }
        }
        sums
    }

    /// W x
    fn to_views(&self, x: &[f64]) -> Vec<f64> {
        let features = self.features;
        let along = |codes: &[u16], row: &[f64]| -> f64 {
            let parts = codes.iter().zip(row.chunks_exact(features));
            parts.map(|(code, row)| dot(row, &x[usize::from(*code) * features..][..features])).sum()
        };
        self.rows.iter().flat_map(|(codes, channels)| channels.each_ref().map(|row| along(codes, row))).collect()
    }
}

/// What a view says of the codes of ωo that it sees.
struct Seen {
    codes: Vec<u16>,
    /// J's rows for the three channels, codes × features.
    slopes: [Vec<f64>; 3],
    /// Its part of H, codes × features × features.
    curvature: Vec<f64>,
}

impl Seen {
    fn of(brdf: &NeuBrdf, evaluator: &Evaluator, transposed: &[f32], view: &View) -> Seen {
        let network = evaluator.network();
        let mut shard = Shard::new(network, view.lights.len());
        let stride = padded(shard.width());
        for (row, wi) in shard.inputs().chunks_exact_mut(stride).zip(&view.lights) {
            evaluator.inputs(&Query { footprint: Footprint::WHOLE, wo: view.wo, wi: *wi }, row);
        }
        network.forward(&mut shard);
        let outputs: Vec<DVec3> = shard.outputs().0.chunks_exact(padded(3)).map(outputs).collect();

        let features = brdf.wo.codebook.features as usize;
        let columns = brdf.wi.codebook.features as usize..;
        let mut codes = vec![];
        let corners: Vec<Vec<(usize, f64)>> =
            view.lights.iter().map(|wi| corners(brdf, view.wo, *wi, &mut codes)).collect();
        let mut seen = Seen {
            slopes: [0, 1, 2].map(|_| vec![0.0; codes.len() * features]),
            curvature: vec![0.0; codes.len() * features * features],
            codes,
        };
        for channel in 0..3 {
            let (_, gradients) = shard.outputs();
            gradients.fill(0.0);
            gradients.chunks_exact_mut(padded(3)).for_each(|row| row[channel] = 1.0);
            network.backward(transposed, &mut shard);
            let unit = view.unit()[channel];
            for (light, row) in shard.input_gradient().chunks_exact(stride).enumerate() {
                let by_output = view.weights[light] * slope(brdf.encoding, outputs[light][channel]) / unit;
                let weight = pair_weight(outputs[light], view.lights[light]);
                seen.add(channel, &corners[light], &row[columns.clone()][..features], by_output, weight);
            }
        }
        seen
    }

    /// Adds what an output's derivatives by the features of ωo, at a pair with these corners, mean for their codes.
    fn add(&mut self, channel: usize, corners: &[(usize, f64)], by_features: &[f32], by_output: f64, pair_weight: f64) {
        let features = by_features.len();
        for (place, corner_weight) in corners {
            for (i, by_feature) in by_features.iter().map(|x| corner_weight * f64::from(*x)).enumerate() {
                self.slopes[channel][place * features + i] += by_output * by_feature;
                let row = &mut self.curvature[(place * features + i) * features..][..features];
                let factor = pair_weight * corner_weight * by_feature;
                row.iter_mut().zip(by_features).for_each(|(sum, x)| *sum += factor * f64::from(*x));
            }
        }
    }
}

fn outputs(row: &[f32]) -> DVec3 {
    DVec3::new(row[0].into(), row[1].into(), row[2].into())
}

/// Codes of ωo at a pair, by their places in `codes`, which those are added to that are not there yet, and their weights.
fn corners(brdf: &NeuBrdf, wo: DVec3, wi: DVec3, codes: &mut Vec<u16>) -> Vec<(usize, f64)> {
    let [_, wo] = in_frame(wo, wi, brdf.is_isotropic);
    let Gathered { points, weights } = brdf.wo.gather(brdf.wo.grid.place(wo), brdf.corner_weights);
    let place = |(point, weight): (u32, f64)| {
        let code = brdf.wo.indices[point as usize];
        let known = codes.iter().rposition(|known| *known == code);
        let place = known.unwrap_or_else(|| {
            codes.push(code);
            codes.len() - 1
        });
        (place, weight)
    };
    points.into_iter().zip(weights).filter(|(_, weight)| *weight > 0.0).map(place).collect()
}

/// The derivative of the decoded value.
fn slope(Encoding { gain, scale, max }: Encoding, y: f64) -> f64 {
    let (gain, scale) = (f64::from(gain), f64::from(scale));
    let brightest = (gain * f64::from(max)).ln_1p() / scale;
    if y > 0.0 { scale * (scale * y.min(brightest)).exp() / gain } else { 0.0 }
}

/// As a pair weighs in the loss.
fn pair_weight(outputs: DVec3, wi: DVec3) -> f64 {
    (1.0 + (outputs.element_sum() / 3.0).max(0.0)).powi(2) * wi.z.sqrt()
}

fn are_closed(gaps: &[f64]) -> bool {
    let [mean_square, largest] = [CLOSED[0] * CLOSED[0], CLOSED[1]];
    dot(gaps, gaps) <= mean_square * gaps.len() as f64 && gaps.iter().all(|gap| gap.abs() <= largest)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn mean_of_diagonal(block: &[f64], n: usize) -> f64 {
    block.iter().step_by(n + 1).sum::<f64>() / n as f64
}

/// Cholesky's factor of a block with something added to its diagonal, in the lower half.
fn factorise(block: &mut [f64], n: usize, added: f64) {
    for i in 0..n {
        block[i * n + i] += added;
        for j in 0..=i {
            let rest = block[i * n + j] - dot(&block[i * n..i * n + j], &block[j * n..j * n + j]);
            block[i * n + j] = if i == j { rest.sqrt() } else { rest / block[j * n + j] };
        }
    }
}

/// L⁻¹ x
fn solve_lower(factor: &[f64], x: &mut [f64]) {
    let n = x.len();
    for i in 0..n {
        x[i] = (x[i] - dot(&factor[i * n..i * n + i], &x[..i])) / factor[i * n + i];
    }
}

/// L⁻ᵀ x
fn solve_upper(factor: &[f64], x: &mut [f64]) {
    let n = x.len();
    for i in (0..n).rev() {
        let below: f64 = (i + 1..n).map(|k| factor[k * n + i] * x[k]).sum();
        x[i] = (x[i] - below) / factor[i * n + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::{GroundTruth, Model, Plan, Quality, Recipe, Session};

    /// A glossy lobe over a matte base, twice as wide across where it is anisotropic.
    fn truth(is_isotropic: bool) -> impl Fn(DVec3, DVec3) -> DVec3 + Sync {
        move |wo, wi| {
            let half = (wo + wi).normalize();
            let across = if is_isotropic { half.y } else { 0.5 * half.y };
            let slope = (half.x * half.x + across * across) / (half.z * half.z);
            DVec3::new(0.2, 0.1, 0.05) + DVec3::new(1.0, 0.8, 0.6) * (-20.0 * slope).exp()
        }
    }

    /// A hasty fit, and its views.
    fn fit(is_isotropic: bool, codes: usize) -> (NeuBrdf, Views) {
        let plan = Plan::new(Model::NeuBrdf, Recipe::Default, Quality::Draft, is_isotropic);
        let plan = Plan {
            n_side: [4; 2],
            codes: [codes; 2],
            hidden: 24,
            pruned: 24,
            pairs: 1 << 14,
            batch: 256,
            steps: 400,
            ..plan
        };
        let eval = truth(is_isotropic);
        let truth = GroundTruth::Function { eval: &eval, is_isotropic };
        let mut session = Session::new(plan, &truth).unwrap();
        session.run(u32::MAX);
        (session.neubrdf().unwrap(), session.views(&truth, |_, _| ()).unwrap())
    }

    /// Codes that move a little close the gaps by what the slopes say.
    #[test]
    fn slopes_are_finite_differences_of_gaps() {
        for (is_isotropic, codes) in [(true, 1000), (true, 16), (false, 1000)] {
            let (mut brdf, views) = fit(is_isotropic, codes);
            let slopes = Slopes::of(&brdf, &views.0);
            let move_by: Vec<f64> = (0..brdf.wo.codebook.codes.len()).map(|i| 1e-3 * (7.0 * i as f64).sin()).collect();
            let n = slopes.features;
            // J δ = W Lᵀ δ.
            let mut turned = move_by.clone();
            for (turned, (moved, factor)) in
                turned.chunks_exact_mut(n).zip(move_by.chunks_exact(n).zip(slopes.factors.chunks_exact(n * n)))
            {
                (0..n).for_each(|i| turned[i] = (i..n).map(|k| factor[k * n + i] * moved[k]).sum());
            }
            let expected = slopes.to_views(&turned);
            let mut gaps_at = |sign: f64| {
                let before = brdf.wo.codebook.clone();
                let codes = &mut Arc::make_mut(&mut brdf.wo.codebook).codes;
                codes.iter_mut().zip(&move_by).for_each(|(code, by)| *code += (sign * by) as f32);
                let gaps = views.gaps(&brdf);
                brdf.wo.codebook = before;
                gaps
            };
            let (forth, back) = (gaps_at(1.0), gaps_at(-1.0));
            let largest = expected.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            for ((forth, back), expected) in forth.iter().zip(back).zip(expected) {
                let closed = (back - forth) / 2.0;
                assert!((closed - expected).abs() < 0.02 * largest, "{closed} instead of {expected}");
            }
        }
    }

    /// The step solves what it says: (W Wᵀ + μ) x = r, δ = L⁻ᵀ Wᵀ x, by H = L Lᵀ.
    #[test]
    fn the_step_solves_its_equations() {
        let (brdf, views) = fit(true, 1000);
        let slopes = Slopes::of(&brdf, &views.0);
        let gaps = views.gaps(&brdf);
        let x = slopes.conjugate_gradients(&gaps);
        let image = slopes.to_views(&slopes.to_codes(&x));
        let rest: f64 =
            gaps.iter().zip(&image).zip(&x).map(|((r, image), x)| (r - image - slopes.softness * x).powi(2)).sum();
        assert!(rest < 1e-7 * dot(&gaps, &gaps));

        let block = [4.0, 1.0, 0.5, 1.0, 3.0, -0.2, 0.5, -0.2, 2.0];
        let mut factor = block;
        factorise(&mut factor, 3, 0.1);
        let mut solved = [1.0, -2.0, 0.5];
        solve_lower(&factor, &mut solved);
        solve_upper(&factor, &mut solved);
        for (row, expected) in block
            .chunks_exact(3)
            .zip([1.0, -2.0, 0.5])
            .enumerate()
            .map(|(i, (row, b))| (dot(row, &solved) + 0.1 * solved[i], b))
        {
            assert!((row - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn gaps_get_smaller_and_a_perfect_albedo_stays() {
        for is_isotropic in [true, false] {
            let (before, views) = fit(is_isotropic, 1000);
            let mut after = before.clone();
            let mut told = 0;
            views.close_gaps(&mut after, 3, || told += 1);
            let size = |brdf: &NeuBrdf| dot(&views.gaps(brdf), &views.gaps(brdf));
            assert!(size(&after) < 0.3 * size(&before), "{} after {}", size(&after), size(&before));
            assert!((2..=4).contains(&told));

            let evaluator = Evaluator::neubrdf(&before);
            let itself = Views::ask(&before, &|pairs| evaluator.eval(pairs), |_, _| ());
            let mut again = before.clone();
            itself.close_gaps(&mut again, 3, || ());
            assert_eq!(again, before);
        }
    }

    /// A channel without light asks for nothing but darkness.
    #[test]
    fn a_black_channel_is_no_reason_to_go_far() {
        let (mut brdf, _) = fit(true, 1000);
        let eval = truth(true);
        let red = |pairs: &[[DVec3; 2]]| pairs.iter().map(|[wo, wi]| eval(*wo, *wi) * DVec3::X).collect();
        let views = Views::ask(&brdf, &red, |_, _| ());
        views.close_gaps(&mut brdf, 3, || ());
        assert!(views.gaps(&brdf).iter().all(|gap| gap.is_finite()));
        assert!(brdf.wo.codebook.codes.iter().all(|code| code.abs() < 100.0));
    }
}
