//! What a surface does to light: the text-book definitions, in `f64`, that every faster form is tested against.
//!
//! Directions are unit vectors in the local shading frame, z along the normal, both pointing away from the surface:
//! `wi` towards the light, `wo` towards the viewer. For a [`Surface::Dielectric`](crate::scene::Surface) z points
//! out of the solid; opaque surfaces see `wo.z > 0` only (the tracer turns the frame).

use glam::DVec3;

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
