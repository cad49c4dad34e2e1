//! Lights and the table that picks one of them by power.
//!
//! The table's entries are, in this order, every emissive triangle of every instance, every texel of the environment,
//! and the sun. An entry is picked with probability proportional to its power, so that the densities which multiple
//! importance sampling needs have closed forms, with `P` the table's [`total_power`](LightTable::total_power) and
//! `Y` the luminance:
//!
//! - a point on an emissive triangle, per unit area: `π·Y(emission)·sides / P`;
//! - a direction to the environment, per unit solid angle: `π·R²·Y(radiance) / P`, with `R` the scene's bounding radius;
//! - the sun: the probability `π·R²·Y(irradiance) / P`.

use glam::Vec3;

/// A lat-long environment: radiance constant over each texel, so that sampling it by texel is exact.
///
/// For a unit direction d towards the sky, after turning it about +y by −`rotation_degrees`:
/// u = atan2(d.x, −d.z)/2π + ½ and v = acos(d.y)/π, texel (⌊u·width⌋, ⌊v·height⌋). A constant sky has one texel.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Texels around, ≥ 1.
    pub width: u32,
    /// Texels from zenith to nadir, ≥ 1.
    pub height: u32,
    /// `width × height` radiances, row by row from the zenith, finite and ≥ 0.
    pub texels: Vec<Vec3>,
    /// Turns the sky about +y, counter-clockwise seen from above.
    pub rotation_degrees: f32,
}

/// A directional light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit vector towards the sun.
    pub direction: Vec3,
    /// Irradiance on a surface that faces it, W·m⁻², ≥ 0.
    pub irradiance: Vec3,
}

/// An alias table over all lights of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LightTable {
    /// (instance, triangle) of each emissive triangle; these are the table's first entries.
    pub triangles: Vec<[u32; 2]>,
    /// Number of environment texels in the table; they come next. The sun is last, if there is one.
    pub environment_texels: u32,
    /// Walker's alias method: entry i stays with probability `.0`, else gives way to entry `.1`.
    pub alias: Vec<(f32, u32)>,
    /// Sum of all powers, W; 0 for a scene without light.
    pub total_power: f64,
    /// Radius R of the scene's bounding sphere that the power of distant lights is taken over.
    pub scene_radius: f32,
}

/// Rec. 709 luminance.
pub fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}
