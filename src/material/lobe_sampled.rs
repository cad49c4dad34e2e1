//! BRDFs without a sampler of their own: one-sample multiple importance sampling (Veach and Guibas 1995) of an anisotropic GGX
//! lobe of visible normals and a cosine hemisphere.

use std::f64::consts::FRAC_1_PI;
use std::fmt::Debug;

use glam::{DVec2, DVec3};

use super::conductor::reflection_pdf;
use super::diffuse::sample_cosine_hemisphere;
use super::{BsdfSample, Ggx, MIN_COSINE, both_above, reflect};
use crate::scene::SamplingLobe;

/// The values of a BRDF.
pub trait Evaluate: Debug + Send + Sync {
    /// f(wo, wi) in sr⁻¹, without the cosine, finite and not negative; a pure function. Both directions are above the
    /// surface: z ≥ [`MIN_COSINE`].
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3;

    /// Whether the values stay as they are when both directions turn about the normal.
    fn is_isotropic(&self) -> bool;
}

/// A BRDF and the lobe that it is sampled by, seen from the upper side.
#[derive(Clone, Copy, Debug)]
pub struct LobeSampled<'a> {
    /// The values.
    pub brdf: &'a dyn Evaluate,
    /// Roughly their shape.
    pub lobe: &'a SamplingLobe,
}

impl LobeSampled<'_> {
    /// See [`super::Bsdf::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        if both_above(wo, wi) { self.brdf.eval(wo, wi) } else { DVec3::ZERO }
    }

    /// See [`super::Bsdf::pdf`].
    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !both_above(wo, wi) {
            return 0.0;
        }
        let weight = self.lobe.weight_at(wo.z);
        weight * reflection_pdf(self.lobe.ggx(), wo, (wo + wi).normalize()) + (1.0 - weight) * wi.z * FRAC_1_PI
    }

    /// See [`super::Bsdf::sample`].
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        if wo.z < MIN_COSINE {
            return None;
        }
        let wi = if u[2] < self.lobe.weight_at(wo.z) {
            reflect(wo, self.lobe.ggx().sample_visible_normal(wo, [u[0], u[1]]))
        } else {
            sample_cosine_hemisphere([u[0], u[1]])
        };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample { wi, weight: self.eval(wo, wi) * (wi.z / pdf), pdf, is_delta: false })
    }
}

impl SamplingLobe {
    /// The lobe itself.
    pub fn ggx(&self) -> Ggx {
        Ggx { alpha: DVec2::from_array(self.alpha.map(f64::from)) }
    }

    /// The probability of the lobe at cos θo.
    pub fn weight_at(&self, cosine: f64) -> f64 {
        let position = cosine.clamp(0.0, 1.0) * (SamplingLobe::NODES - 1) as f64;
        let cell = (position as usize).min(SamplingLobe::NODES - 2);
        let (low, high) = (f64::from(self.weight[cell]), f64::from(self.weight[cell + 1]));
        low + (high - low) * (position - cell as f64)
    }
}
