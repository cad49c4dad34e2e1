//! BRDFs without a sampler of their own: one-sample multiple importance sampling (Veach and Guibas 1995) of two anisotropic
//! GGX lobes of visible normals and a cosine hemisphere.

use std::f64::consts::FRAC_1_PI;
use std::fmt::Debug;

use glam::{DVec3, Vec2};

use super::conductor::reflection_pdf;
use super::diffuse::sample_cosine_hemisphere;
use super::{BsdfSample, Ggx, MIN_COSINE, both_above, reflect};
use crate::scene::SamplingLobe;
use crate::scene::brdf::{Footprint, NeuBrdf, SurfaceFrame};

/// What is asked of a BRDF.
#[derive(Clone, Copy, Debug)]
pub struct Query {
    /// Where, if it varies.
    pub footprint: Footprint,
    /// Towards the viewer.
    pub wo: DVec3,
    /// Towards the light.
    pub wi: DVec3,
}

/// The values of a BRDF.
pub trait Evaluate: Debug + Send + Sync {
    /// f(wo, wi) in sr⁻¹, without the cosine, finite and not negative; a pure function. Both directions are above the
    /// surface: z ≥ [`MIN_COSINE`].
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3;

    /// The same as seen at a place of a surface that varies. Others are the same everywhere.
    fn eval_at(&self, _footprint: Footprint, wo: DVec3, wi: DVec3) -> DVec3 {
        self.eval(wo, wi)
    }

    /// The network that the values are of, which gives many together in less time than one by one: [`NeuBrdf::eval_many`].
    fn neubrdf(&self) -> Option<&NeuBrdf> {
        None
    }

    /// Whether [`Evaluate::eval_at`] hangs on the place; [`Evaluate::eval`] then is the average.
    fn is_spatial(&self) -> bool {
        false
    }

    /// The frame that the lobes of a place lie in, on average over it; `None` where all places have the surface's own.
    fn frame(&self, _footprint: Footprint) -> Option<SurfaceFrame> {
        None
    }

    /// Whether the values stay as they are when both directions turn about the normal.
    fn is_isotropic(&self) -> bool;

    /// The same, at points, of directions that turn about the normals of their frames.
    fn is_isotropic_in_frames(&self) -> bool {
        self.is_isotropic()
    }
}

/// A BRDF and the lobes that it is sampled by, seen from the upper side.
#[derive(Clone, Copy, Debug)]
pub struct LobeSampled<'a> {
    /// The values.
    pub brdf: &'a dyn Evaluate,
    /// Roughly their shape.
    pub lobe: &'a SamplingLobe,
    /// Where it is looked at.
    pub footprint: Footprint,
}

impl<'a> LobeSampled<'a> {
    /// See [`super::Bsdf::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        if both_above(wo, wi) { self.brdf.eval_at(self.footprint, wo, wi) } else { DVec3::ZERO }
    }

    /// See [`super::Bsdf::query`].
    pub fn query(&self, wo: DVec3, wi: DVec3) -> Option<(&'a NeuBrdf, Query)> {
        let neubrdf = self.brdf.neubrdf().filter(|_| both_above(wo, wi))?;
        Some((neubrdf, Query { footprint: self.footprint, wo, wi }))
    }

    /// See [`super::Bsdf::pdf`].
    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if !both_above(wo, wi) {
            return 0.0;
        }
        let half = (wo + wi).normalize();
        let weights = self.lobe.weights_at(wo.z);
        let lobes = self.lobe.ggx().into_iter().zip(weights);
        let of_lobes: f64 = lobes.map(|(ggx, weight)| weight * reflection_pdf(ggx, wo, half)).sum();
        of_lobes + (1.0 - weights[0] - weights[1]) * wi.z * FRAC_1_PI
    }

    /// See [`super::Bsdf::sample`].
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        let picked = self.pick(wo, u)?;
        Some(BsdfSample { weight: picked.weight * self.eval(wo, picked.wi), ..picked })
    }

    /// The same, with a weight that f(wo, wi) is still to be multiplied to.
    pub fn pick(&self, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        if wo.z < MIN_COSINE {
            return None;
        }
        let [first, second] = self.lobe.weights_at(wo.z);
        let [narrow, wide] = self.lobe.ggx();
        let wi = if u[2] < first {
            reflect(wo, narrow.sample_visible_normal(wo, [u[0], u[1]]))
        } else if u[2] < first + second {
            reflect(wo, wide.sample_visible_normal(wo, [u[0], u[1]]))
        } else {
            sample_cosine_hemisphere([u[0], u[1]])
        };
        let pdf = self.pdf(wo, wi);
        (pdf > 0.0).then(|| BsdfSample { wi, weight: DVec3::splat(wi.z / pdf), pdf, is_delta: false })
    }
}

impl SamplingLobe {
    /// The lobes themselves.
    pub fn ggx(&self) -> [Ggx; 2] {
        self.alpha.map(|alpha| Ggx { alpha: Vec2::from_array(alpha).as_dvec2() })
    }

    /// The probabilities of the lobes at cos θo.
    pub fn weights_at(&self, cosine: f64) -> [f64; 2] {
        let position = cosine.clamp(0.0, 1.0) * (SamplingLobe::NODES - 1) as f64;
        let cell = (position as usize).min(SamplingLobe::NODES - 2);
        let [low, high] = [self.weight[cell], self.weight[cell + 1]].map(|pair| pair.map(f64::from));
        [0, 1].map(|lobe| low[lobe] + (high[lobe] - low[lobe]) * (position - cell as f64))
    }
}
