//! What these tests draw.

use std::f64::consts::TAU;

use glam::DVec3;

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
