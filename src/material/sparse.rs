//! Sparse samples, evaluated: a mean of all samples, weighted by their distance d to the power −8 (Shepard, *A Two-Dimensional
//! Interpolation Function for Irregularly-Spaced Data*, 1968).
//!
//! The distance is the Euclidean one in [`Sparse::coordinates_of`]. The mean passes through
//! the samples, is smooth elsewhere, reciprocal, and never beyond the darkest and the brightest sample; the exponent is
//! twice the number of dimensions, so that the near ones outweigh the far ones, of which there are many more.

use glam::{DVec3, DVec4};

use crate::scene::Sparse;

/// Added to all squared distances: samples nearer than 10⁻⁴ are as good as met.
const SOFTENING: f64 = 1e-8;

impl Sparse {
    /// f(wo, wi), see [`super::Evaluate::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let here = self.coordinates_of(wo, wi);
        let squared = |there: &DVec4| there.distance_squared(here) + SOFTENING;
        let nearest = self.coordinates().iter().map(squared).fold(f64::INFINITY, f64::min);
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for (sample, there) in self.samples().iter().zip(self.coordinates()) {
            let weight = (nearest / squared(there)).powi(4);
            sum += weight * sample.value.as_dvec3();
            weights += weight;
        }
        sum / weights
    }
}
