//! What a surface does to light: the text-book definitions, in `f64`, that every faster form is tested against.
//!
//! Directions are unit vectors in the local shading frame, z along the normal, both pointing away from the surface:
//! `wi` towards the light, `wo` towards the viewer. For a [`Surface::Dielectric`](crate::scene::Surface) z points
//! out of the solid; opaque surfaces see `wo.z > 0` only (the tracer turns the frame). A direction whose |z| is below
//! [`MIN_COSINE`] lies in the surface: it neither sends nor receives anything.
//!
//! `docs/materials.md` has the formulas, where they come from and what they leave out.

mod coat_albedo;
mod coated;
mod conductor;
mod dielectric;
mod diffuse;
mod footprint;
mod frame;
mod fresnel;
mod ggx;
mod half_vector;
mod layered;
mod lobe_fit;
mod lobe_sampled;
mod measured_surface;
mod merl;
mod nbrdf;
mod network;
mod neubrdf;
mod prepared;
mod rgl;
mod sparse;
mod surface_frame;
mod surface_maps;
mod woven;

use glam::{DVec3, Vec2};

use crate::scene::brdf::{Footprint, NeuBrdf};
use crate::scene::{Color, Fresnel, Surface};

pub use coat_albedo::{Coat, CoatAlbedo};
pub use coated::Coated;
pub use conductor::{Conductor, Reflectance};
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use footprint::{Cone, uv_density};
pub use frame::{Frame, mapped_normal, orthonormal_basis, triangle_derivatives, turned_dpdu};
pub use fresnel::{fresnel_complex, fresnel_dielectric, fresnel_dielectric_average, fresnel_schlick};
pub use ggx::Ggx;
pub use half_vector::{half_vector, half_vector_inputs};
pub use layered::LayeredWalk;
pub use lobe_fit::fit_lobe;
pub use lobe_sampled::{Evaluate, LobeSampled, Query};
pub use measured_surface::TexelSamples;
pub use nbrdf::LARGEST_OUTPUT as NBRDF_LARGEST_OUTPUT;
pub use neubrdf::turned;
pub use prepared::{Prepared, is_alike};
pub use surface_maps::VaryingSurface;

/// GGX surfaces with α below this are perfectly smooth: their lobe is a Dirac delta.
pub const SMOOTH_ALPHA: f32 = 1e-4;

/// A boundary whose index of refraction is this close to 1 is not there: light passes straight through.
pub const INDEX_MATCH: f32 = 1e-4;

/// Directions with |cos θ| below this lie in the surface, where values may exceed what `f32` holds.
pub const MIN_COSINE: f64 = 1e-6;

/// What sampling a BSDF gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// The direction that was picked.
    pub wi: DVec3,
    /// f(wo, wi)·|cos θi| / pdf: what the path's throughput is multiplied by.
    pub weight: DVec3,
    /// Density per unit solid angle, or the probability of the lobe where `is_delta`.
    pub pdf: f64,
    /// The direction comes from a Dirac lobe: `eval` and `pdf` know nothing of it.
    pub is_delta: bool,
}

/// The scattering of a surface at one point.
#[derive(Clone, Copy, Debug)]
pub enum Bsdf<'a> {
    /// Lambertian reflection.
    Diffuse(Diffuse),
    /// Reflection by a metal.
    Conductor(Conductor),
    /// Reflection and refraction at the boundary of a solid.
    Dielectric(Dielectric),
    /// A diffuse base under a dielectric coat.
    Coated(Coated<'a>),
    /// A BRDF without a sampler of its own.
    LobeSampled(LobeSampled<'a>),
}

impl<'a> Bsdf<'a> {
    /// The scattering of a surface where its [`color`], times its texture, is `color`; on average, if it varies otherwise.
    pub fn new(surface: &'a Prepared, color: DVec3) -> Bsdf<'a> {
        Bsdf::at(surface, color, Footprint::WHOLE)
    }

    /// The same as seen at a place.
    pub fn at(surface: &'a Prepared, color: DVec3, footprint: Footprint) -> Bsdf<'a> {
        match *surface {
            Prepared::Diffuse => Bsdf::Diffuse(Diffuse { albedo: color }),
            Prepared::Conductor { fresnel, roughness } => Bsdf::Conductor(Conductor {
                reflectance: match fresnel {
                    Fresnel::Schlick { .. } => Reflectance::Schlick { f0: color },
                    Fresnel::Complex { eta, kappa } => {
                        Reflectance::Complex { eta: eta.as_dvec3(), kappa: kappa.as_dvec3() }
                    }
                },
                roughness,
            }),
            Prepared::Dielectric(dielectric) => Bsdf::Dielectric(dielectric),
            Prepared::Coated { ior, roughness, ref coats } => {
                Bsdf::Coated(Coated { base: color, ior, roughness, coat: Coat::new(&coats[0]) })
            }
            Prepared::LobeSampled { ref brdf, ref lobe } => {
                Bsdf::LobeSampled(LobeSampled { brdf: brdf.as_ref(), lobe, footprint })
            }
        }
    }

    /// The scattering of a surface where a map says how rough it is, along u and v. Prepared by [`Prepared::of`].
    pub fn of_roughness(surface: &'a Prepared, color: DVec3, roughness: Vec2) -> Bsdf<'a> {
        let roughness = roughness.clamp(Vec2::ZERO, Vec2::ONE);
        let alpha = roughness * roughness;
        let mean = alpha.element_sum() / 2.0;
        let mut bsdf = Bsdf::new(surface, color);
        match &mut bsdf {
            Bsdf::Conductor(conductor) => conductor.roughness = Ggx::new(alpha),
            Bsdf::Dielectric(dielectric) if dielectric.ior != 1.0 => dielectric.roughness = Ggx::new(Vec2::splat(mean)),
            Bsdf::Coated(coated) => {
                coated.roughness = Ggx::new(Vec2::splat(mean));
                if let (Some(ggx), Prepared::Coated { coats, .. }) = (coated.roughness, surface) {
                    coated.coat = Coat::of_alpha(&coats[1..], ggx.alpha.x);
                }
            }
            Bsdf::Diffuse(_) | Bsdf::Dielectric(_) | Bsdf::LobeSampled(_) => {}
        }
        bsdf
    }

    /// f(wo, wi) in sr⁻¹, without the cosine; radiance is what is transported, so that refraction into a denser
    /// medium scales by 1/η². Dirac lobes count as 0.
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        match self {
            Bsdf::Diffuse(diffuse) => diffuse.eval(wo, wi),
            Bsdf::Conductor(conductor) => conductor.eval(wo, wi),
            Bsdf::Dielectric(dielectric) => dielectric.eval(wo, wi),
            Bsdf::Coated(coated) => coated.eval(wo, wi),
            Bsdf::LobeSampled(sampled) => sampled.eval(wo, wi),
        }
    }

    /// Whom to ask for f(wo, wi) instead, and what, to have many values at once ([`NeuBrdf::eval_many`]); `None` where that gains nothing.
    pub fn query(&self, wo: DVec3, wi: DVec3) -> Option<(&'a NeuBrdf, Query)> {
        if let Bsdf::LobeSampled(sampled) = self { sampled.query(wo, wi) } else { None }
    }

    /// The density, in sr⁻¹, with which [`Bsdf::sample`] picks `wi`, Dirac lobes aside.
    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        match self {
            Bsdf::Diffuse(diffuse) => diffuse.pdf(wo, wi),
            Bsdf::Conductor(conductor) => conductor.pdf(wo, wi),
            Bsdf::Dielectric(dielectric) => dielectric.pdf(wo, wi),
            Bsdf::Coated(coated) => coated.pdf(wo, wi),
            Bsdf::LobeSampled(sampled) => sampled.pdf(wo, wi),
        }
    }

    /// Picks `wi` for three numbers in [0, 1): two for the direction, the third for the lobe. `None` where the
    /// surface absorbs the path: the densities need not integrate to 1.
    pub fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        match self {
            Bsdf::Diffuse(diffuse) => diffuse.sample(wo, u),
            Bsdf::Conductor(conductor) => conductor.sample(wo, u),
            Bsdf::Dielectric(dielectric) => dielectric.sample(wo, u),
            Bsdf::Coated(coated) => coated.sample(wo, u),
            Bsdf::LobeSampled(sampled) => sampled.sample(wo, u),
        }
    }

    /// Whether all lobes are Dirac deltas: sampling a light is then useless.
    pub fn is_delta(&self) -> bool {
        match self {
            Bsdf::Diffuse(_) | Bsdf::Coated(_) | Bsdf::LobeSampled(_) => false,
            Bsdf::Conductor(conductor) => conductor.roughness.is_none(),
            Bsdf::Dielectric(dielectric) => dielectric.roughness.is_none(),
        }
    }
}

/// The colour of a surface that a texture may multiply; white where the model has none.
pub fn color(surface: &Surface) -> Color {
    match *surface {
        Surface::Diffuse { albedo } | Surface::Coated { albedo, .. } => albedo,
        Surface::Conductor { fresnel: Fresnel::Schlick { f0 }, .. } => f0,
        Surface::Conductor { fresnel: Fresnel::Complex { .. }, .. }
        | Surface::Dielectric { .. }
        | Surface::Measured { .. }
        | Surface::Layered(_)
        | Surface::Woven(_) => Color::constant(glam::Vec3::ONE),
    }
}

/// Whether both directions are above the surface.
fn both_above(wo: DVec3, wi: DVec3) -> bool {
    wo.z >= MIN_COSINE && wi.z >= MIN_COSINE
}

/// The mirror direction of `w` about the unit vector `m`.
fn reflect(w: DVec3, m: DVec3) -> DVec3 {
    (2.0 * w.dot(m) * m - w).normalize()
}
