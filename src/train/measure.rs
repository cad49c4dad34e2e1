//! How far a fit is from its ground truth.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};

use serde::Serialize;

use super::ball::Ball;
use super::pairs::{Pair, direction, draw, mirrored};
use super::random::Random;
pub use crate::material::Query;
use crate::scene::brdf::Footprint;

/// A BRDF at many (ωo, ωi) at once.
pub type Eval<'a> = &'a (dyn Fn(&[[DVec3; 2]]) -> Vec<DVec3> + Sync);

/// A BRDF at many places and directions at once; one that is the same everywhere may leave the places out.
pub type EvalAt<'a> = &'a (dyn Fn(&[Query]) -> Vec<DVec3> + Sync);

/// (ωo, ωi) alone.
fn directions(queries: &[Query]) -> Vec<[DVec3; 2]> {
    queries.iter().map(|query| [query.wo, query.wi]).collect()
}

/// Point `index` of a sequence that fills the texture evenly (Roberts 2018).
pub fn place(index: usize) -> Footprint {
    let at = |step: f64| (0.5 + step * (index as f64 + 1.0)).fract();
    Footprint::point(DVec2::new(at(0.754_877_666_246_692_7), at(0.569_840_290_998_053_2)))
}

/// All that a fit is judged by.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitErrors {
    /// Over random pairs of directions.
    pub pairs: PairErrors,
    /// Of a rendered ball.
    pub ball: BallErrors,
    /// Directional albedo at some ωo.
    pub albedo: Vec<AlbedoError>,
    /// The worst of those, |relative error|.
    pub worst_albedo: f64,
}

/// A fit, its ground truth, and a ball of each.
pub struct Comparison {
    /// The figures.
    pub errors: FitErrors,
    /// The fit's ball.
    pub fit: Ball,
    /// The ground truth's ball.
    pub truth: Ball,
}

/// Errors over pairs drawn as those for training are.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PairErrors {
    /// Mean of |Δ ln(1 + f)|.
    pub log: f64,
    /// Root mean square of Δ(f cos θi) over that of f cos θi, which counts as 10⁻⁶ at least.
    pub relative_rmse: f64,
    /// [θh in degrees, mean of |Δ ln(1 + f)|].
    pub log_by_half_angle: Vec<[f64; 2]>,
    /// [θo in degrees, mean of |Δ ln(1 + f)|].
    pub log_by_view_angle: Vec<[f64; 2]>,
}

/// How far a fit is from the measurements that it was made of, and from those that it was not: what is known where no ground truth is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Residuals {
    /// At those that were learned.
    pub learned: SampleErrors,
    /// At others, of which the training knew nothing; `None` if there are none.
    pub held_out: Option<SampleErrors>,
}

/// Errors at measurements.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SampleErrors {
    /// How many these are.
    pub measurements: usize,
    /// The errors; of very many, over some evenly among them.
    #[serde(flatten)]
    pub errors: PairErrors,
}

/// Differences of two balls as they are shown, see [`Ball`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BallErrors {
    /// Structural similarity.
    pub ssim: f64,
    /// Mean ꟻLIP error.
    pub flip: f64,
    /// Peak signal-to-noise ratio, dB.
    pub psnr: f64,
}

/// The directional albedo at one ωo, mean over channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AlbedoError {
    /// θo, degrees.
    pub theta: f64,
    /// φo, degrees.
    pub phi: f64,
    /// Of the ground truth.
    pub truth: f64,
    /// Of the fit.
    pub fit: f64,
}

impl AlbedoError {
    /// (fit − truth) / truth, which counts as 10⁻⁶ at least.
    pub fn relative(&self) -> f64 {
        (self.fit - self.truth) / self.truth.max(BLACK)
    }
}

/// Albedos and f cos θ below this count as this, so that errors are no multiples of next to nothing.
pub(super) const BLACK: f64 = 1e-6;

/// Bins of errors by angle, 3° each.
const BINS: usize = 30;
/// Pairs of the comparison.
const PAIRS: usize = 1 << 16;
/// Not a seed of any training that a user is likely to ask for.
const SEED: u64 = 0x6a09_e667_f3bc_c908;
/// How many θo albedos are compared at, and the step from one to the next, degrees.
const THETAS: usize = 18;
const THETA_STEP: f64 = 5.0;
/// Of steps that fill [0, 1) evenly.
pub(super) const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Points that an albedo is integrated over.
const ALBEDO_POINTS: usize = 4096;

/// Compares a fit with its ground truth; balls are `size` pixels to a side.
pub fn compare(size: usize, is_isotropic: bool, fit: Eval, truth: Eval) -> Comparison {
    compare_at(size, is_isotropic, &|queries| fit(&directions(queries)), &|queries| truth(&directions(queries)))
}

/// The same of a material that varies: pairs and albedos are averaged over places, and balls show the texture.
pub fn compare_at(size: usize, is_isotropic: bool, fit: EvalAt, truth: EvalAt) -> Comparison {
    let phis: &[f64] = if is_isotropic { &[0.0] } else { &[0.0, 45.0, 90.0] };
    let albedo: Vec<AlbedoError> = (0..THETAS)
        .flat_map(|step| phis.iter().map(move |phi| (THETA_STEP * step as f64, *phi)))
        .map(|(theta, phi)| {
            let wo = direction(theta.to_radians(), phi.to_radians());
            let of = |eval: EvalAt| average_albedo(wo, ALBEDO_POINTS, eval).element_sum() / 3.0;
            AlbedoError { theta, phi, truth: of(truth), fit: of(fit) }
        })
        .collect();
    let [fit_ball, truth_ball] = [fit, truth].map(|eval| Ball::render(size, eval));
    let errors = FitErrors {
        pairs: pair_errors_at(PAIRS, SEED, fit, truth),
        ball: BallErrors {
            ssim: fit_ball.ssim(&truth_ball),
            flip: fit_ball.flip(&truth_ball),
            psnr: fit_ball.psnr(&truth_ball),
        },
        // A NaN is the worst of all.
        worst_albedo: albedo
            .iter()
            .map(|albedo| albedo.relative().abs())
            .fold(0.0, |worst, error| if error > worst || error.is_nan() { error } else { worst }),
        albedo,
    };
    Comparison { errors, fit: fit_ball, truth: truth_ball }
}

/// Compares at `count` random pairs.
pub fn pair_errors(count: usize, seed: u64, fit: Eval, truth: Eval) -> PairErrors {
    pair_errors_at(count, seed, &|queries| fit(&directions(queries)), &|queries| truth(&directions(queries)))
}

/// The same, each pair at a place of its own.
pub fn pair_errors_at(count: usize, seed: u64, fit: EvalAt, truth: EvalAt) -> PairErrors {
    let mut random = Random::new(seed, 0);
    let pairs = (0..count).map(|index| (place(index), draw(&mut random)));
    let pairs: Vec<Query> = pairs.map(|(footprint, (wo, wi))| Query { footprint, wo, wi }).collect();
    errors_between(&pairs, fit(&pairs), truth(&pairs))
}

/// Compares with values that were measured.
pub fn sample_errors<'p>(samples: impl Iterator<Item = &'p Pair>, fit: EvalAt) -> PairErrors {
    let samples: Vec<&Pair> = samples.collect();
    let some = || samples.iter().step_by(samples.len().div_ceil(PAIRS).max(1));
    let query = |pair: &&Pair| Query {
        footprint: Footprint { uv: pair.uv.as_dvec2(), area: pair.area.into() },
        wo: pair.wo.as_dvec3(),
        wi: pair.wi.as_dvec3(),
    };
    let queries: Vec<Query> = some().map(query).collect();
    errors_between(&queries, fit(&queries), some().map(|pair| pair.value.as_dvec3()).collect())
}

/// Errors of values from others at the same places and directions.
fn errors_between(pairs: &[Query], fit: Vec<DVec3>, truth: Vec<DVec3>) -> PairErrors {
    let count = pairs.len();
    let (mut log, mut square, mut norm) = (0.0, 0.0, 0.0);
    let mut bins = [[[0.0; 2]; BINS]; 2];
    for ((fit, truth), Query { wo, wi, .. }) in fit.into_iter().zip(truth).zip(pairs) {
        let here = (0..3).map(|channel| (fit[channel].ln_1p() - truth[channel].ln_1p()).abs()).sum::<f64>() / 3.0;
        log += here / count as f64;
        square += ((fit - truth) * wi.z).length_squared();
        norm += (truth * wi.z).length_squared();
        for (bins, cosine) in bins.iter_mut().zip([(*wo + *wi).normalize().z, wo.z]) {
            let bin = (cosine.clamp(0.0, 1.0).acos() / FRAC_PI_2 * BINS as f64) as usize;
            let [sum, count] = &mut bins[bin.min(BINS - 1)];
            *sum += here;
            *count += 1.0;
        }
    }
    let [log_by_half_angle, log_by_view_angle] = bins.map(|bins| {
        let middle = |bin: usize| (bin as f64 + 0.5) * 90.0 / BINS as f64;
        bins.iter()
            .enumerate()
            .filter(|(_, [_, count])| *count > 0.0)
            .map(|(bin, [sum, count])| [middle(bin), sum / count])
            .collect()
    });
    let norm = norm.max(count as f64 * BLACK * BLACK);
    PairErrors { log, relative_rmse: (square / norm).sqrt(), log_by_half_angle, log_by_view_angle }
}

/// Directional albedo, ∫ f(ωo, ωi) cos θi dωi, RGB, by `count` points that crowd where lobes are. Exact enough to compare two
/// BRDFs, as both are seen at the same points.
pub fn directional_albedo(wo: DVec3, count: usize, eval: Eval) -> DVec3 {
    average_albedo(wo, count, &|queries| eval(&directions(queries)))
}

/// The same, averaged over places.
fn average_albedo(wo: DVec3, count: usize, eval: EvalAt) -> DVec3 {
    let (lights, weights) = albedo_points(wo, count, 0.0);
    let queries: Vec<Query> = (0..).zip(lights).map(|(index, wi)| Query { footprint: place(index), wo, wi }).collect();
    eval(&queries).into_iter().zip(weights).map(|(value, weight)| value * weight).sum()
}

/// Directions of light that crowd where lobes are, up to `count`, and the solid angle times the cosine that each stands for: mirrored about half
/// vectors on a spiral, whose angles are the cubes of even steps. Another `shift`, in turns, gives others.
pub(super) fn albedo_points(wo: DVec3, count: usize, shift: f64) -> (Vec<DVec3>, Vec<f64>) {
    let point = |i: usize| {
        let step = (i as f64 + 0.5) / count as f64;
        let theta = FRAC_PI_2 * step.powi(3);
        let half = direction(theta, TAU * (shift + GOLDEN * i as f64).fract());
        let wi = mirrored(wo, half);
        // dθ = 3 · π/2 · step² dstep, and dωi = 4 (ωo · h) dωh.
        let solid_angle = theta.sin() * 3.0 * FRAC_PI_2 * step.powi(2) * TAU / count as f64;
        (wi.z > 0.0).then(|| (wi, wi.z * 4.0 * wo.dot(half) * solid_angle))
    };
    (0..count).filter_map(point).unzip()
}
