//! A rough dielectric coat, which absorbs, over a metal or a diffuse base, by a random walk between the two.
//!
//! The walk knows no positions, only how often light crosses the coat: Guo, Hašan and Zhao, *Position-Free Monte Carlo
//! Simulation for Arbitrary Layered BSDFs*, SIGGRAPH Asia 2018; in the form of Pharr, Jakob and Humphreys, *Physically Based
//! Rendering*, 4th edition, §14.3. It starts at the viewer. Wherever it meets the base, light reaches it through the coat's upper side,
//! found in two ways that are weighted against each other: by refracting `wi` into the coat, and by reflecting off the base.

use glam::DVec3;

use super::{BsdfSample, Conductor, Dielectric, Diffuse, Evaluate, Ggx, Reflectance};
use crate::scene::{Fresnel, LayerBase, Layered};

/// Where walks end that have not yet. With a white base and the largest index, 10⁻⁴ of the light is left by then.
const MOST_BOUNCES: u32 = 64;
/// Bounces that always survive.
const ROULETTE_AFTER: u32 = 4;

/// A coat over a base, seen from the upper side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayeredWalk {
    coat: Dielectric,
    /// The square of the coat's index: how much denser radiance is within it.
    compression: f64,
    absorption: DVec3,
    base: Base,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Base {
    Diffuse(Diffuse),
    Conductor(Conductor),
}

impl LayeredWalk {
    /// The layers as data.
    pub fn new(layers: &Layered) -> LayeredWalk {
        let base = match layers.base {
            LayerBase::Diffuse { albedo } => Base::Diffuse(Diffuse { albedo: albedo.as_dvec3() }),
            LayerBase::Conductor { fresnel, alpha } => {
                let reflectance = match fresnel {
                    Fresnel::Schlick { f0 } => Reflectance::Schlick { f0: f0.value.as_dvec3() },
                    Fresnel::Complex { eta, kappa } => {
                        Reflectance::Complex { eta: eta.as_dvec3(), kappa: kappa.as_dvec3() }
                    }
                };
                Base::Conductor(Conductor { reflectance, roughness: Ggx::new(alpha) })
            }
        };
        LayeredWalk {
            coat: Dielectric::new(layers.ior, layers.alpha),
            compression: f64::from(layers.ior).powi(2),
            absorption: layers.absorption.as_dvec3(),
            base,
        }
    }

    /// An estimate of f(wo, wi) from one walk, which is right on average. The walk's random
    /// numbers are a hash of the bits of `wo`, `wi` and `salt`.
    pub fn estimate(&self, wo: DVec3, wi: DVec3, salt: u64) -> DVec3 {
        let bits = [wo.x, wo.y, wo.z, wi.x, wi.y, wi.z].map(f64::to_bits);
        let mut random = Hashed(bits.into_iter().fold(salt, |state, bits| mix(state ^ bits)));
        self.coat.eval(wo, wi) + self.walk(wo, wi, &mut random)
    }

    /// The mean of `walks` independent estimates.
    pub fn average(&self, wo: DVec3, wi: DVec3, walks: u32) -> DVec3 {
        (0..walks).map(|walk| self.estimate(wo, wi, walk.into())).sum::<DVec3>() / f64::from(walks)
    }

    /// An estimate of what comes out of the coat.
    fn walk(&self, wo: DVec3, wi: DVec3, random: &mut Hashed) -> DVec3 {
        let mut sum = DVec3::ZERO;
        let Some(entry) = self.coat.sample(wo, random.units()).filter(|entry| entry.wi.z < 0.0) else { return sum };
        let mut throughput = entry.weight;
        let mut down = entry.wi;
        for bounce in 0..MOST_BOUNCES {
            throughput *= self.transmittance(down);
            let viewer = -down;
            if let Some(exit) = self.coat.sample(wi, random.units()).filter(|exit| exit.wi.z < 0.0) {
                // The coat's f grows by the square of its index when it is seen from within, and the cosine is in the weight.
                let light = self.base.eval(viewer, -exit.wi) * exit.weight * self.compression;
                let share = exit.pdf / (exit.pdf + self.base.pdf(viewer, -exit.wi));
                sum += throughput * self.transmittance(exit.wi) * light * share;
            }
            let Some(next) = self.base.sample(viewer, random.units()) else { break };
            throughput *= next.weight * self.transmittance(next.wi);
            let share = next.pdf / (next.pdf + self.coat.pdf(wi, -next.wi));
            sum += throughput * self.coat.eval(-next.wi, wi) * share;

            let Some(back) = self.coat.sample(-next.wi, random.units()).filter(|back| back.wi.z < 0.0) else { break };
            throughput *= back.weight;
            down = back.wi;
            if bounce >= ROULETTE_AFTER {
                let survival = (throughput.max_element() * self.compression).min(1.0);
                if random.unit() >= survival {
                    break;
                }
                throughput /= survival;
            }
        }
        sum
    }

    /// What is left of light that crosses the coat along `w`.
    fn transmittance(&self, w: DVec3) -> DVec3 {
        (-self.absorption / w.z.abs()).exp()
    }
}

/// One walk an evaluation: a pure function of the directions, and right on average over directions that differ by as little as rounding.
impl Evaluate for LayeredWalk {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        self.estimate(wo, wi, 0)
    }

    fn is_isotropic(&self) -> bool {
        match &self.base {
            Base::Diffuse(_) => true,
            Base::Conductor(conductor) => conductor.roughness.is_none_or(|ggx| ggx.alpha.x == ggx.alpha.y),
        }
    }
}

impl Base {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        match self {
            Base::Diffuse(diffuse) => diffuse.eval(wo, wi),
            Base::Conductor(conductor) => conductor.eval(wo, wi),
        }
    }

    fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        match self {
            Base::Diffuse(diffuse) => diffuse.pdf(wo, wi),
            Base::Conductor(conductor) => conductor.pdf(wo, wi),
        }
    }

    fn sample(&self, wo: DVec3, u: [f64; 3]) -> Option<BsdfSample> {
        match self {
            Base::Diffuse(diffuse) => diffuse.sample(wo, u),
            Base::Conductor(conductor) => conductor.sample(wo, u),
        }
    }
}

/// Random numbers from a hash: SplitMix64 (Steele, Lea and Flood 2014).
struct Hashed(u64);

impl Hashed {
    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        (mix(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn units(&mut self) -> [f64; 3] {
        [self.unit(), self.unit(), self.unit()]
    }
}

/// Its finaliser.
fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
