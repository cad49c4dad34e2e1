//! Reflection by a metal: f = F·D·G2 / (4 |cos θo cos θi|), Cook-Torrance with the parts of [`super::Ggx`].

use glam::DVec3;

use super::{BsdfSample, Ggx, MIN_COSINE, both_above, fresnel_complex, fresnel_schlick, reflect};

/// A metal, seen from the upper side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conductor {
    /// What a facet reflects.
    pub reflectance: Reflectance,
    /// `None`: a mirror.
    pub roughness: Option<Ggx>,
}

/// The Fresnel reflectance of a metal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reflectance {
    /// Schlick's approximation.
    Schlick {
        /// Reflectance at normal incidence, in [0, 1].
        f0: DVec3,
    },
    /// The Fresnel equations.
    Complex {
        /// Real part of the index of refraction, > 0.
        eta: DVec3,
        /// Its imaginary part, ≥ 0.
        kappa: DVec3,
    },
}

impl Reflectance {
    /// At an angle of incidence.
    pub fn at(&self, cosine: f64) -> DVec3 {
        match *self {
            Reflectance::Schlick { f0 } => fresnel_schlick(cosine, f0),
            Reflectance::Complex { eta, kappa } => fresnel_complex(cosine, eta, kappa),
        }
    }
}

impl Conductor {
    /// See [`super::Bsdf::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        match self.roughness {
            Some(ggx) if both_above(wo, wi) => {
                let m = (wo + wi).normalize();
                self.reflectance.at(wo.dot(m)) * (ggx.distribution(m) * ggx.masking_shadowing(wo, wi))
                    / (4.0 * wo.z * wi.z)
            }
            _ => DVec3::ZERO,
        }
    }

    /// See [`super::Bsdf::pdf`].
    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        match self.roughness {
            Some(ggx) if both_above(wo, wi) => reflection_pdf(ggx, wo, (wo + wi).normalize()),
            _ => 0.0,
        }
    }

    /// See [`super::Bsdf::sample`].
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        if wo.z < MIN_COSINE {
            return None;
        }
        let Some(ggx) = self.roughness else {
            let wi = DVec3::new(-wo.x, -wo.y, wo.z);
            return Some(BsdfSample { wi, weight: self.reflectance.at(wo.z), pdf: 1.0, is_delta: true });
        };
        let m = ggx.sample_visible_normal(wo, [u[0], u[1]]);
        let wi = reflect(wo, m);
        (wi.z >= MIN_COSINE).then(|| BsdfSample {
            wi,
            weight: self.reflectance.at(wo.dot(m)) * (ggx.masking_shadowing(wo, wi) / ggx.masking(wo)),
            pdf: reflection_pdf(ggx, wo, m),
            is_delta: false,
        })
    }
}

/// The density of the reflected direction where the visible normal `m` is sampled, D_wo(m) / (4 wo·m): Heitz, *Sampling
/// the GGX Distribution of Visible Normals*, JCGT 7(4), 2018, equation 17. wo·m cancels.
pub(super) fn reflection_pdf(ggx: Ggx, wo: DVec3, m: DVec3) -> f64 {
    ggx.masking(wo) * ggx.distribution(m) / (4.0 * wo.z)
}
