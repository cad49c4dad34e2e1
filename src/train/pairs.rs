//! What there is to learn: pairs of directions and the BRDF's value there.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::random::Random;

/// What is learned.
pub enum GroundTruth<'a> {
    /// A function of (ωo, ωi) that is known everywhere: the BRDF in sr⁻¹, RGB, without the cosine.
    Function {
        /// The function.
        eval: &'a (dyn Fn(DVec3, DVec3) -> DVec3 + Sync),
        /// Whether only the difference of the azimuths matters, and not its sign.
        is_isotropic: bool,
    },
    /// Measurements at some pairs of directions.
    Samples {
        /// The measurements.
        pairs: Vec<Pair>,
        /// Whether only the difference of the azimuths matters, and not its sign.
        is_isotropic: bool,
    },
}

impl GroundTruth<'_> {
    /// Whether only the difference of the azimuths matters, and not its sign.
    pub fn is_isotropic(&self) -> bool {
        match self {
            GroundTruth::Function { is_isotropic, .. } | GroundTruth::Samples { is_isotropic, .. } => *is_isotropic,
        }
    }

    /// The measurements, or values of the function at `count` pairs that are drawn to crowd where lobes are.
    pub fn pairs(&self, count: usize, seed: u64) -> Vec<Pair> {
        match self {
            GroundTruth::Samples { pairs, .. } => pairs.clone(),
            GroundTruth::Function { eval, .. } => {
                let mut pairs = vec![Pair::default(); count];
                pairs.par_chunks_mut(DRAWN_TOGETHER).enumerate().for_each(|(chunk, pairs)| {
                    let mut random = Random::new(seed, chunk as u64);
                    for pair in pairs {
                        let (wo, wi) = draw(&mut random);
                        *pair = Pair { wo: wo.as_vec3(), wi: wi.as_vec3(), value: eval(wo, wi).as_vec3() };
                    }
                });
                pairs
            }
        }
    }
}

/// Pairs that share a stream of random numbers.
const DRAWN_TOGETHER: usize = 1024;

/// A pair of directions, z along the normal, and the BRDF there, sr⁻¹, RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pair {
    /// Towards the viewer.
    pub wo: Vec3,
    /// Towards the light.
    pub wi: Vec3,
    /// The BRDF, without the cosine.
    pub value: Vec3,
}

impl Pair {
    /// What Helmholtz's reciprocity says besides: light that comes the other way.
    pub fn reciprocal(self) -> Pair {
        Pair { wo: self.wi, wi: self.wo, ..self }
    }
}

/// Draws (ωo, ωi): 30 % of ωi by the cosine, the others mirrored about half vectors that crowd at the normal, θh = u² · 90°
/// (40 %) and u⁴ · 90° (30 %), so that lobes of any width are seen. ωo is by the cosine (40 %), uniform in θ
/// (30 %) or crowded at the normal, θ = u² · 90° (30 %). The two change roles at random.
pub fn draw(random: &mut Random) -> (DVec3, DVec3) {
    loop {
        let by_cosine = |random: &mut Random| {
            let sin = random.next_f64().sqrt();
            direction(sin.asin(), TAU * random.next_f64())
        };
        let wo = match random.next_f64() {
            ..0.4 => by_cosine(random),
            ..0.7 => direction(FRAC_PI_2 * random.next_f64(), TAU * random.next_f64()),
            _ => direction(FRAC_PI_2 * random.next_f64().powi(2), TAU * random.next_f64()),
        };
        let choice = random.next_f64();
        let wi = if choice < 0.3 {
            by_cosine(random)
        } else {
            let crowding = if choice < 0.7 { 2 } else { 4 };
            let half = direction(FRAC_PI_2 * random.next_f64().powi(crowding), TAU * random.next_f64());
            2.0 * wo.dot(half) * half - wo
        };
        if wo.z > LOWEST && wi.z > LOWEST {
            return if random.next_f64() < 0.5 { (wo, wi) } else { (wi, wo) };
        }
    }
}

/// Directions closer to the surface than this are not drawn: there is no light to carry.
const LOWEST: f64 = 1e-3;

fn direction(theta: f64, phi: f64) -> DVec3 {
    DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}
