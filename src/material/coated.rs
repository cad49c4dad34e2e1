//! A diffuse base under a dielectric coat.
//!
//! The coat reflects as [`super::Dielectric`] does on its outside; what it lets through, on the way in and on the
//! way out, reaches the base: f = f_coat + albedo·(1 − E(μi))(1 − E(μo)) / (π(1 − E_avg)). Kelemen and
//! Szirmay-Kalos, *A Microfacet Based Coupled Specular-Matte BRDF Model*, Eurographics 2001. It is reciprocal and loses
//! nothing where the albedo is 1. The base's colour enters linearly: that light bounces below the coat and so
//! saturates is not modelled.

use std::f64::consts::FRAC_1_PI;

use glam::DVec3;

use super::conductor::reflection_pdf;
use super::diffuse::sample_cosine_hemisphere;
use super::{BsdfSample, Coat, Ggx, MIN_COSINE, both_above, fresnel_dielectric, reflect};

/// A diffuse base under a dielectric coat, seen from the upper side.
#[derive(Clone, Copy, Debug)]
pub struct Coated<'a> {
    /// Reflectance of the base, in [0, 1].
    pub base: DVec3,
    /// Index of refraction of the coat, ≥ 1.
    pub ior: f64,
    /// Of the coat; `None`: a mirror.
    pub roughness: Option<Ggx>,
    /// How much the coat reflects.
    pub coat: Coat<'a>,
}

impl Coated<'_> {
    /// See [`super::Bsdf::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        if !both_above(wo, wi) {
            return DVec3::ZERO;
        }
        let through = (1.0 - self.coat.at(wo.z)) * (1.0 - self.coat.at(wi.z)) / (1.0 - self.coat.average());
        self.base * (through * FRAC_1_PI) + DVec3::splat(self.coat_eval(wo, wi))
    }

    /// See [`super::Bsdf::pdf`].
    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !both_above(wo, wi) {
            return 0.0;
        }
        let coat = self.coat_probability(wo);
        let coat_pdf = self.visible_coat().map_or(0.0, |ggx| reflection_pdf(ggx, wo, (wo + wi).normalize()));
        coat * coat_pdf + (1.0 - coat) * wi.z * FRAC_1_PI
    }

    /// See [`super::Bsdf::sample`].
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        if wo.z < MIN_COSINE {
            return None;
        }
        let coat = self.coat_probability(wo);
        let wi = if u[2] >= coat {
            sample_cosine_hemisphere([u[0], u[1]])
        } else if let Some(ggx) = self.roughness {
            reflect(wo, ggx.sample_visible_normal(wo, [u[0], u[1]]))
        } else {
            let weight = DVec3::splat(fresnel_dielectric(wo.z, self.ior) / coat);
            return Some(BsdfSample { wi: DVec3::new(-wo.x, -wo.y, wo.z), weight, pdf: coat, is_delta: true });
        };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample { wi, weight: self.eval(wo, wi) * (wi.z / pdf), pdf, is_delta: false })
    }

    /// The probability of sampling the coat: its share of the reflected light, the base's taken by its brightest channel.
    fn coat_probability(&self, wo: DVec3) -> f64 {
        let coat = self.coat.at(wo.z);
        let base = (1.0 - coat) * self.base.max_element();
        if coat > 0.0 { coat / (coat + base) } else { 0.0 }
    }

    /// The reflection by a rough coat.
    fn coat_eval(&self, wo: DVec3, wi: DVec3) -> f64 {
        let Some(ggx) = self.visible_coat() else { return 0.0 };
        let m = (wo + wi).normalize();
        let facets = ggx.distribution(m) * ggx.masking_shadowing(wo, wi) / (4.0 * wo.z * wi.z);
        fresnel_dielectric(wo.dot(m), self.ior) * facets
    }

    /// The roughness of a coat that is neither smooth nor index-matched.
    fn visible_coat(&self) -> Option<Ggx> {
        self.roughness.filter(|_| !self.coat.is_none())
    }
}
