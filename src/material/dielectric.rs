//! The boundary of a transparent solid: reflection and refraction, smooth or GGX-rough.
//!
//! Source: Walter et al., *Microfacet Models for Refraction through Rough Surfaces*, EGSR 2007, in the notation of
//! *Physically Based Rendering*, 4th edition, §9.7. Radiance is transported: refraction scales it by 1/η².

use glam::{DVec3, Vec2};

use super::conductor::reflection_pdf;
use super::{BsdfSample, Ggx, INDEX_MATCH, MIN_COSINE, fresnel_dielectric, reflect};

/// A transparent boundary; z points out of the solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Index of refraction of the inside over that of the outside; 1 where they match.
    pub ior: f64,
    /// `None`: perfectly smooth.
    pub roughness: Option<Ggx>,
}

impl Dielectric {
    /// A boundary that is not there, because the indices match, is smooth.
    pub fn new(ior: f32, alpha: f32) -> Dielectric {
        if (ior - 1.0).abs() < INDEX_MATCH {
            return Dielectric { ior: 1.0, roughness: None };
        }
        Dielectric { ior: ior.into(), roughness: Ggx::new(Vec2::splat(alpha)) }
    }

    /// See [`super::Bsdf::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let (wo, wi, eta) = self.seen_from_above(wo, wi);
        let Some((ggx, m)) = self.facet(wo, wi, eta) else { return DVec3::ZERO };
        let reflected = fresnel_dielectric(wo.dot(m), eta);
        let facets = ggx.distribution(m) * ggx.masking_shadowing(wo, wi) / (wo.z * wi.z).abs();
        let value = if wi.z > 0.0 {
            reflected * facets / 4.0
        } else {
            let jacobian = (wi.dot(m) * wo.dot(m)).abs() / (wi.dot(m) + wo.dot(m) / eta).powi(2);
            (1.0 - reflected) * facets * jacobian / (eta * eta)
        };
        DVec3::splat(value)
    }

    /// See [`super::Bsdf::pdf`].
    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        let (wo, wi, eta) = self.seen_from_above(wo, wi);
        let Some((ggx, m)) = self.facet(wo, wi, eta) else { return 0.0 };
        let reflected = fresnel_dielectric(wo.dot(m), eta);
        if wi.z > 0.0 {
            reflected * reflection_pdf(ggx, wo, m)
        } else {
            (1.0 - reflected) * refraction_pdf(ggx, wo, wi, m, eta)
        }
    }

    /// See [`super::Bsdf::sample`].
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        if wo.z.abs() < MIN_COSINE {
            return None;
        }
        let side = wo.z.signum();
        let (wo, _, eta) = self.seen_from_above(wo, wo);
        let m = self.roughness.map_or(DVec3::Z, |ggx| ggx.sample_visible_normal(wo, [u[0], u[1]]));
        let reflected = fresnel_dielectric(wo.dot(m), eta);
        let is_reflection = u[2] < reflected;
        let wi = if is_reflection { reflect(wo, m) } else { refract(wo, m, eta) };
        let expected_side = if is_reflection { 1.0 } else { -1.0 };
        if wi.z * expected_side < MIN_COSINE {
            return None;
        }
        let probability = if is_reflection { reflected } else { 1.0 - reflected };
        let compression = if is_reflection { 1.0 } else { 1.0 / (eta * eta) };
        let (unshadowed, density) = match self.roughness {
            None => (1.0, 1.0),
            Some(ggx) => (
                ggx.masking_shadowing(wo, wi) / ggx.masking(wo),
                if is_reflection { reflection_pdf(ggx, wo, m) } else { refraction_pdf(ggx, wo, wi, m, eta) },
            ),
        };
        let pdf = probability * density;
        (pdf > 0.0).then_some(BsdfSample {
            wi: DVec3::new(wi.x, wi.y, wi.z * side),
            weight: DVec3::splat(unshadowed * compression),
            pdf,
            is_delta: self.roughness.is_none(),
        })
    }

    /// The same situation with `wo` above the surface, and the index on the other side over that on the side of `wo`.
    fn seen_from_above(&self, wo: DVec3, wi: DVec3) -> (DVec3, DVec3, f64) {
        if wo.z >= 0.0 {
            (wo, wi, self.ior)
        } else {
            let flip = DVec3::new(1.0, 1.0, -1.0);
            (wo * flip, wi * flip, 1.0 / self.ior)
        }
    }

    /// The facet normal, above the surface, that takes `wi` to `wo` (wo.z ≥ 0), if a visible facet does.
    fn facet(&self, wo: DVec3, wi: DVec3, eta: f64) -> Option<(Ggx, DVec3)> {
        let ggx = self.roughness?;
        if wo.z < MIN_COSINE || wi.z.abs() < MIN_COSINE {
            return None;
        }
        let half = if wi.z > 0.0 { wo + wi } else { wo + eta * wi };
        let m = half.try_normalize()? * half.z.signum();
        // A facet shows `wo` its front and, in refraction, `wi` its back.
        let is_visible = wi.z > 0.0 || (wo.dot(m) > 0.0 && wi.dot(m) < 0.0);
        is_visible.then_some((ggx, m))
    }
}

/// `wo` refracted at the facet `m` (wo·m > 0) into a medium of relative index `eta`; where reflection is total, along
/// the facet.
fn refract(wo: DVec3, m: DVec3, eta: f64) -> DVec3 {
    let cosine = wo.dot(m);
    let cosine_t = (1.0 - (1.0 - cosine * cosine) / (eta * eta)).max(0.0).sqrt();
    (-wo / eta + (cosine / eta - cosine_t) * m).normalize()
}

/// The density of `wi` where a visible normal is sampled and `wo` refracted at it: Walter et al. 2007, equation 17.
fn refraction_pdf(ggx: Ggx, wo: DVec3, wi: DVec3, m: DVec3, eta: f64) -> f64 {
    ggx.visible_normal_pdf(wo, m) * wi.dot(m).abs() / (wi.dot(m) + wo.dot(m) / eta).powi(2)
}
