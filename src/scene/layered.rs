//! A rough transparent coat that absorbs, over a metal or a diffuse base.

use glam::{Vec2, Vec3};

use super::Fresnel;

/// The layers of a [`super::Surface::Layered`], from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layered {
    /// Index of refraction of the coat, in [`Layered::IOR`].
    pub ior: f32,
    /// GGX α of the coat's upper side, in [[`Layered::LEAST_ALPHA`], 1].
    pub alpha: f32,
    /// What the coat absorbs: light along its normal is left with e^−`absorption` of itself; in [0, 100].
    pub absorption: Vec3,
    /// What is below it.
    pub base: LayerBase,
}

/// What is below a coat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LayerBase {
    /// Lambertian.
    Diffuse {
        /// Reflectance, in [0, 1].
        albedo: Vec3,
    },
    /// GGX over a metal.
    Conductor {
        /// Its reflectance against the angle in the coat, without a texture. An index of refraction is relative to the coat's.
        fresnel: Fresnel,
        /// GGX α along u and v, in [[`Layered::LEAST_ALPHA`], 1].
        alpha: Vec2,
    },
}

impl Layered {
    /// Smoother layers would need samplers of their own.
    pub const LEAST_ALPHA: f32 = 0.02;
    /// Between these, the boundary is there, and light finds out of the coat again soon enough.
    pub const IOR: [f32; 2] = [1.01, 2.5];
}
