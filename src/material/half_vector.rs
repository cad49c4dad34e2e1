//! What a network may see of two directions beside features of each: where their half vector points.

use glam::{DVec2, DVec3};

use crate::scene::brdf::NeuBrdf;

/// Added to |ωo + ωi|², so that directions along the surface that oppose one another have a half vector to go by as well.
const LEAST_SQUARE: f64 = 1e-4;

/// Where [`bent`] is a half.
const BEND: f64 = 0.05;

/// x and y of the half vector (ωo + ωi) / √(|ωo + ωi|² + 10⁻⁴), which is a little shorter than a unit vector.
pub fn half_vector(wo: DVec3, wi: DVec3) -> DVec2 {
    let sum = wo + wi;
    sum.truncate() / (sum.length_squared() + LEAST_SQUARE).sqrt()
}

/// What the network sees of a half vector: x, y, |x|, |y|, b(|x|), b(|y|), b(r) and r, where r = √(x² + y²) and b(t) = t / (t + 0.05).
pub fn half_vector_inputs(half: DVec2) -> [f64; NeuBrdf::HALF_VECTOR_INPUTS as usize] {
    let (DVec2 { x, y }, flat) = (half.abs(), half.length());
    [half.x, half.y, x, y, bent(x), bent(y), bent(flat), flat]
}

/// Spreads out what is near 0, where narrow lobes have all that they have.
fn bent(t: f64) -> f64 {
    t / (t + BEND)
}
