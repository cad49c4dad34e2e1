//! The GGX (Trowbridge-Reitz) distribution of microfacet normals with Smith's shadowing and masking.
//!
//! Sources: Walter et al., *Microfacet Models for Refraction through Rough Surfaces*, EGSR 2007; Heitz,
//! *Understanding the Masking-Shadowing Function*, JCGT 3(2), 2014; Dupuy and Benyoub, *Sampling Visible GGX Normals
//! with Spherical Caps*, HPG 2023.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec2};

use super::SMOOTH_ALPHA;

/// A rough surface: α along the tangent and the bitangent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    /// In [[`SMOOTH_ALPHA`], 1].
    pub alpha: DVec2,
}

impl Ggx {
    /// `None` where the surface is perfectly smooth: both α below [`SMOOTH_ALPHA`].
    pub fn new(alpha: Vec2) -> Option<Ggx> {
        (alpha.max_element() >= SMOOTH_ALPHA).then(|| Ggx { alpha: alpha.max(Vec2::splat(SMOOTH_ALPHA)).as_dvec2() })
    }

    /// D(m): area of microfacets per unit solid angle around the unit vector `m` (m.z > 0), per unit area.
    /// Heitz 2014, equation 85.
    pub fn distribution(&self, m: DVec3) -> f64 {
        let stretched = DVec3::new(m.x / self.alpha.x, m.y / self.alpha.y, m.z);
        1.0 / (PI * self.alpha.x * self.alpha.y * stretched.length_squared().powi(2))
    }

    /// Λ(w), masked area over visible area. Heitz 2014, equation 72 with the α of equation 80.
    pub fn lambda(&self, w: DVec3) -> f64 {
        let squared_slope = (self.alpha * w.truncate() / w.z).length_squared();
        ((1.0 + squared_slope).sqrt() - 1.0) / 2.0
    }

    /// Smith's G1: the share of facets that is visible from `w`.
    pub fn masking(&self, w: DVec3) -> f64 {
        1.0 / (1.0 + self.lambda(w))
    }

    /// The height-correlated Smith G2: the share visible from both directions. Heitz 2014, equation 99.
    pub fn masking_shadowing(&self, wo: DVec3, wi: DVec3) -> f64 {
        1.0 / (1.0 + self.lambda(wo) + self.lambda(wi))
    }

    /// The density of the normals visible from `wo` (wo.z > 0) at `m`, per unit solid angle around `m`.
    /// Heitz 2014, equation 16.
    pub fn visible_normal_pdf(&self, wo: DVec3, m: DVec3) -> f64 {
        self.masking(wo) / wo.z * wo.dot(m).max(0.0) * self.distribution(m)
    }

    /// A normal visible from `wo` (wo.z > 0), for two numbers in [0, 1). Dupuy and Benyoub 2023, listing 3.
    pub fn sample_visible_normal(&self, wo: DVec3, u: [f64; 2]) -> DVec3 {
        let stretched = (self.alpha * wo.truncate()).extend(wo.z).normalize();
        let phi = TAU * u[1];
        let half_z = (1.0 - u[0]) * (1.0 + stretched.z);
        let cap_z = half_z - stretched.z;
        let sine = (1.0 - cap_z * cap_z).max(0.0).sqrt();
        let half = DVec2::new(sine * phi.cos(), sine * phi.sin()) + stretched.truncate();
        (self.alpha * half).extend(half_z).normalize()
    }
}
