//! What these tests draw, and the surfaces that they tabulate.

use std::f64::consts::TAU;

use glam::{DVec3, Vec2};
use neubrdf::material::{Conductor, Ggx, Reflectance};

/// A random number generator: SplitMix64 (Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A uniform direction whose z is at least `least`.
    pub fn above(&mut self, least: f64) -> DVec3 {
        let z = least + (1.0 - least) * self.unit();
        let (y, x) = (TAU * self.unit()).sin_cos();
        let sine = (1.0 - z * z).sqrt();
        DVec3::new(sine * x, sine * y, z)
    }
}

/// A tinted rough metal.
pub fn metal(alpha_x: f32, alpha_y: f32) -> Conductor {
    Conductor {
        reflectance: Reflectance::Schlick { f0: DVec3::new(0.9, 0.6, 0.3) },
        roughness: Ggx::new(Vec2::new(alpha_x, alpha_y)),
    }
}
