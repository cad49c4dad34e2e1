//! Sparse samples, evaluated: a mean of all samples, weighted by their distance d to the power −8 (Shepard, *A Two-Dimensional
//! Interpolation Function for Irregularly-Spaced Data*, 1968).
//!
//! The distance is the Euclidean one of four numbers. The first two are √(2θh/π) in the direction of φh: highlights are narrow
//! in the half vector, and the root spreads them as in MERL tables. The other two are sin θd in the direction of 2φd, so that
//! swapping `wo` and `wi` changes nothing. For an isotropic material φh counts as 0 and φd as |φd|. The mean passes through
//! the samples, is smooth elsewhere, reciprocal, and never beyond the darkest and the brightest sample; the exponent is
//! twice the number of dimensions, so that the near ones outweigh the far ones, of which there are many more.

use std::f64::consts::FRAC_2_PI;

use glam::{DVec2, DVec3, DVec4};

use super::HalfDifference;
use crate::scene::Sparse;

/// Added to all squared distances: samples nearer than 10⁻⁴ are as good as met.
const SOFTENING: f64 = 1e-8;

impl Sparse {
    /// f(wo, wi), see [`super::Evaluate::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let coordinates = |wo, wi| sparse_coordinates(wo, wi, self.is_isotropic);
        let here = coordinates(wo, wi);
        let distance = |at: DVec4| at.distance_squared(here) + SOFTENING;
        let squared: Vec<f64> = self.samples.iter().map(|sample| distance(coordinates(sample.wo, sample.wi))).collect();
        let nearest = squared.iter().copied().fold(f64::INFINITY, f64::min);
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for (sample, squared) in self.samples.iter().zip(squared) {
            let weight = (nearest / squared).powi(4);
            sum += weight * sample.value.as_dvec3();
            weights += weight;
        }
        sum / weights
    }
}

/// Where a pair of directions is among the samples: the four numbers that distances are measured in.
pub fn sparse_coordinates(wo: DVec3, wi: DVec3, is_isotropic: bool) -> DVec4 {
    let pair = HalfDifference::new(wo, wi);
    let half = (pair.theta_half() * FRAC_2_PI).sqrt();
    // The square of a complex number, over its length, has twice its azimuth.
    let DVec2 { x, y } = pair.across;
    let doubled = DVec2::new(x * x - y * y, 2.0 * x * y) / pair.across.length().max(f64::MIN_POSITIVE);
    if is_isotropic {
        DVec4::new(half, 0.0, doubled.x, doubled.y.abs())
    } else {
        let direction = pair.half.truncate().try_normalize().unwrap_or(DVec2::X) * half;
        DVec4::new(direction.x, direction.y, doubled.x, doubled.y)
    }
}
