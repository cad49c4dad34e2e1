//! What no surface does: send more light than it gets.
//!
//! A few measurements leave most directions open, and what a network says there may be anything: highlights that no measurement looked
//! at have come out three times as bright as the light. So a training of measurements is asked at other directions too, for
//! the albedo ∫ f cos θi dωi of views that are spread over the hemisphere, and what is above 1 counts: weight · max(0, ln albedo)², mean over
//! channels. Where the albedo is below 1, as with all but few fits, nothing changes.

use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI, TAU};

use glam::{DVec2, DVec3};

use super::pairs::{LOWEST, Pair, Place, direction, mirrored};
use super::random::Random;
use crate::scene::brdf::{Encoding, SurfaceGrid};

/// Directions of light that the albedo of a view is estimated with: half of them by the cosine, half mirrored about half
/// vectors that crowd at the normal.
pub const DIRECTIONS: usize = 2 * STRATA * STRATA;
const STRATA: usize = 8;

/// Views, one after the other a step.
const VIEWS: u64 = 512;

/// Pairs of directions that a fit is asked at, [`DIRECTIONS`] a view, without values.
pub struct Probes {
    /// The solid angle times the cosine that each stands for: the albedo of a view is the sum of f times these.
    pub weights: Vec<f32>,
    /// What the network's output stands for.
    pub encoding: Encoding,
    /// What an excess counts beside the mean loss of a pair.
    pub weight: f32,
}

/// Draws them, over these texels where the material varies, and says what each stands for.
pub fn draw(seed: u64, grid: Option<SurfaceGrid>) -> (Vec<Pair>, Vec<f32>) {
    let views = (0..VIEWS).flat_map(|view| {
        let mut random = Random::new(seed, Random::PROBES + view);
        // Half of the views by the cosine, half uniform in θ, of which more graze.
        let theta = match view % 2 {
            0 => random.next_f64().sqrt().asin(),
            _ => FRAC_PI_2 * random.next_f64(),
        };
        let wo = direction(theta.min(LOWEST.acos()), TAU * random.next_f64());
        let place = grid.map(|grid| {
            let place = Place::draw(&grid, &mut random);
            (place.uv.as_vec2(), place.area(&grid) as f32)
        });
        let (uv, area) = place.unwrap_or_default();
        let pair = move |(wi, weight): (DVec3, f64)| {
            (Pair { wo: wo.as_vec3(), wi: wi.as_vec3(), uv, area, ..Pair::default() }, weight as f32)
        };
        lights(wo, &mut random).into_iter().map(pair)
    });
    views.unzip()
}

/// Light for a view, and the solid angle times the cosine that each direction stands for.
fn lights(wo: DVec3, random: &mut Random) -> Vec<(DVec3, f64)> {
    let strata = (0..STRATA * STRATA).map(|i| DVec2::new((i % STRATA) as f64, (i / STRATA) as f64));
    let points: Vec<DVec2> =
        strata.map(|at| (at + DVec2::new(random.next_f64(), random.next_f64())) / STRATA as f64).collect();
    let by_cosine = points.clone().into_iter().map(|u| direction(u.x.sqrt().asin(), TAU * u.y));
    let about_halves = points.into_iter().map(|u| mirrored(wo, direction(FRAC_PI_2 * u.x * u.x, TAU * u.y)));
    let weighted = |wi: DVec3| {
        if wi.z < LOWEST {
            return (DVec3::Z, 0.0);
        }
        // Both ways of drawing could have given it (the balance heuristic).
        let density = 0.5 * (FRAC_1_PI * wi.z + mirrored_density(wo, wi));
        (wi, wi.z / (density * DIRECTIONS as f64))
    };
    by_cosine.chain(about_halves).map(weighted).collect()
}

/// The density of light that is mirrored about half vectors at θ = u² · 90°.
fn mirrored_density(wo: DVec3, wi: DVec3) -> f64 {
    let half = (wo + wi).normalize();
    let theta = half.z.min(1.0).acos().max(1e-6);
    let u = (theta / FRAC_PI_2).sqrt();
    1.0 / (PI * u) / (TAU * theta.sin()) / (4.0 * wo.dot(half).abs().max(1e-6))
}

impl Probes {
    /// The loss of a view whose directions begin at `start`, given what the network says of each, encoded; sets the derivatives by that.
    pub fn loss(&self, start: usize, encoded: &[[f32; 3]], derivatives: &mut [[f32; 3]]) -> f32 {
        let Encoding { gain, scale, max } = self.encoding;
        let brightest = (gain * max).ln_1p() / scale;
        let weights = &self.weights[start..start + encoded.len()];
        let mut loss = 0.0;
        for channel in 0..3 {
            // Of what is cut off as too bright the derivative is that at the limit, so that it comes back.
            let argument = |y: f32| (scale * y.clamp(0.0, brightest)).exp();
            let albedo: f32 = weights.iter().zip(encoded).map(|(w, y)| w * (argument(y[channel]) - 1.0) / gain).sum();
            let excess = albedo.max(1.0).ln();
            loss += self.weight * excess * excess / 3.0;
            let by_albedo = self.weight * 2.0 * excess / albedo.max(1.0) / 3.0;
            for ((derivative, y), weight) in derivatives.iter_mut().zip(encoded).zip(weights) {
                let slope = if y[channel] > 0.0 { scale * argument(y[channel]) / gain } else { 0.0 };
                derivative[channel] = by_albedo * weight * slope;
            }
        }
        loss
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a white surface the albedo is 1, seen from anywhere, and so is that of a narrow lobe about the normal.
    #[test]
    fn weights_are_those_of_the_projected_hemisphere() {
        let (pairs, weights) = draw(7, None);
        let (mut white, mut narrow) = (Vec::new(), Vec::new());
        for (pairs, weights) in pairs.chunks(DIRECTIONS).zip(weights.chunks(DIRECTIONS)) {
            white.push(weights.iter().sum::<f32>() / std::f32::consts::PI);
            // n/(2π) · cosⁿ⁻² θi, n = 200, has an albedo of 1.
            let lobe = |pair: &Pair| 200.0 / std::f32::consts::TAU * pair.wi.z.powi(198);
            if pairs[0].wo.z > 0.999 {
                narrow.push(pairs.iter().zip(weights).map(|(pair, weight)| weight * lobe(pair)).sum::<f32>());
            }
        }
        assert!(white.iter().all(|albedo| (albedo - 1.0).abs() < 0.2), "{white:?}");
        let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
        assert!((mean(&white) - 1.0).abs() < 0.01, "{}", mean(&white));
        assert!(!narrow.is_empty() && (mean(&narrow) - 1.0).abs() < 0.1, "{narrow:?}");
    }

    #[test]
    fn derivatives_are_finite_differences_and_0_below_an_albedo_of_1() {
        let probes = Probes {
            weights: (0..8).map(|i| 0.1 + 0.05 * i as f32).collect(),
            encoding: Encoding { gain: 100.0, scale: 2.0, max: 1e3 },
            weight: 0.7,
        };
        let encoded = |bright: f32| -> Vec<[f32; 3]> {
            (0..8).map(|i| [0, 1, 2].map(|c| bright + 0.1 * ((3 * i + c) % 5) as f32)).collect()
        };
        let mut derivatives = vec![[f32::NAN; 3]; 8];
        assert_eq!(probes.loss(0, &encoded(0.1), &mut derivatives), 0.0);
        assert!(derivatives.iter().flatten().all(|derivative| *derivative == 0.0));
        let bright = encoded(2.5);
        let loss = probes.loss(0, &bright, &mut derivatives);
        assert!(loss > 0.1);
        for (i, channel) in [(0, 0), (3, 1), (7, 2)] {
            let at = |step: f32| {
                let mut moved = bright.clone();
                moved[i][channel] += step;
                f64::from(probes.loss(0, &moved, &mut [[0.0; 3]; 8]))
            };
            let expected = (at(1e-2) - at(-1e-2)) / 2e-2;
            assert!((f64::from(derivatives[i][channel]) - expected).abs() < 1e-2 * expected.abs(), "{i}, {channel}");
        }
    }
}
