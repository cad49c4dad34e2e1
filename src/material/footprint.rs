//! How much of a surface a path sees at a vertex: a cone about each of its rays, after Akenine-Möller et al., *Texture Level of Detail Strategies
//! for Real-Time Ray Tracing*, Ray Tracing Gems, 2019, chapter 20.
//!
//! A camera ray's cone is as wide as a pixel. What a ray meets cuts an ellipse out of it, longer by 1 / cos θ; the footprint is a square of
//! its area, so that it is neither sharper nor blurrier than what the pixel sees, and the ellipse's length is left to the samples. After a
//! bounce the cone is at least as wide as a sixteenth of the solid angle 1 / pdf that the direction stands for (Bekaert et al., *Custom Ray
//! Footprints*, 2003, take such a share too): sharp for mirrors, coarse for what a diffuse surface sees. That surfaces are curved is left out.

use glam::{DVec2, DVec3};

use crate::scene::brdf::Footprint;

/// A cone about a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Diameter where the ray starts.
    pub width: f64,
    /// By which it grows with the distance.
    pub spread: f64,
}

/// Side of the share of the directions that a sample stands for: its square is 1/16.
const SHARE: f64 = 0.25;

/// Lowest |cos θ| at which an ellipse is cut out.
const LEAST_COSINE: f64 = 1e-3;

impl Cone {
    /// Where the ray has gone that far.
    pub fn at(self, distance: f64) -> Cone {
        Cone { width: self.width + self.spread * distance, ..self }
    }

    /// What it sees of a surface here. `density` is the area in texture coordinates of a unit of the surface's area, `cosine` that of the ray and
    /// the triangle's normal.
    pub fn footprint(self, uv: DVec2, density: f64, cosine: f64) -> Footprint {
        Footprint { uv, area: self.width.powi(2) / cosine.abs().max(LEAST_COSINE) * density }
    }

    /// Of the next ray, whose direction was picked with that density; `None`: by a Dirac lobe.
    pub fn scattered(self, pdf: Option<f64>) -> Cone {
        Cone { spread: pdf.map_or(self.spread, |pdf| self.spread.max(SHARE / pdf.sqrt())), ..self }
    }
}

/// The area in texture coordinates of a unit of a triangle's area, for its edges from one corner; where it has no texture coordinates so large
/// that all of a texture is seen.
pub fn uv_density(edges: [DVec3; 2], uv_edges: Option<[DVec2; 2]>) -> f64 {
    const EVERYTHING: f64 = 1e12;
    uv_edges.map_or(EVERYTHING, |[a, b]| a.perp_dot(b).abs() / edges[0].cross(edges[1]).length())
}
