//! Lambertian reflection: f = albedo / π.

use std::f64::consts::{FRAC_1_PI, TAU};

use glam::DVec3;

use super::{BsdfSample, MIN_COSINE, both_above};

/// Lambertian reflection, of the upper side only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diffuse {
    /// Reflectance, in [0, 1].
    pub albedo: DVec3,
}

impl Diffuse {
    /// See [`super::Bsdf::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        if both_above(wo, wi) { self.albedo * FRAC_1_PI } else { DVec3::ZERO }
    }

    /// See [`super::Bsdf::pdf`].
    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if both_above(wo, wi) { wi.z * FRAC_1_PI } else { 0.0 }
    }

    /// See [`super::Bsdf::sample`].
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        let wi = sample_cosine_hemisphere([u[0], u[1]]);
        (wo.z >= MIN_COSINE && wi.z >= MIN_COSINE).then_some(BsdfSample {
            wi,
            weight: self.albedo,
            pdf: wi.z * FRAC_1_PI,
            is_delta: false,
        })
    }
}

/// A direction of the upper hemisphere with density cos θ / π: a point of the unit disk, lifted (Malley's method).
pub(super) fn sample_cosine_hemisphere(u: [f64; 2]) -> DVec3 {
    let radius = u[0].sqrt();
    let phi = TAU * u[1];
    DVec3::new(radius * phi.cos(), radius * phi.sin(), (1.0 - u[0]).max(0.0).sqrt())
}
