//! Directions turned into frames that normal maps and maps of anisotropy give. The device's form is `glsl/lib/neubrdf_surface.glsl`.

use glam::{DMat3, DVec2, DVec3};

use super::MIN_COSINE;
use crate::scene::brdf::SurfaceFrame;

/// Lowest cos θi that light is divided by, unless it is as low about the frame.
const LEAST_COSINE: f64 = 0.1;

impl SurfaceFrame {
    /// Its tangent, along the direction of anisotropy with ψ in (−90°, 90°], its bitangent, and its normal.
    pub fn axes(&self) -> DMat3 {
        let across = self.normal.cross(DVec3::X).normalize();
        let along = across.cross(self.normal);
        let half = half_angle(self.doubled);
        DMat3::from_cols(half.x * along + half.y * across, half.x * across - half.y * along, self.normal)
    }

    /// What a surface about this normal receives of light from `wi` over what the surface itself does, r = cos θ′i / max(cos θi, 0.1), where
    /// the bound is cos θ′i if that is lower: its BRDF about the frame times r is that of the surface. The bound keeps grazing light from
    /// being seen infinitely bright by facets that lean towards it. As r cos θi ≤ cos θ′i, no more is reflected than about the frame.
    pub fn received(&self, wi: DVec3) -> f64 {
        let leaning = wi.dot(self.normal).max(0.0);
        leaning / wi.z.max(leaning.min(LEAST_COSINE))
    }

    /// ωo and ωi about the frame, and what it receives of ωi; `None` where either is below it, and nothing is reflected.
    pub fn turned(&self, wo: DVec3, wi: DVec3) -> Option<([DVec3; 2], f64)> {
        let to_frame = self.axes().transpose();
        let turned = [wo, wi].map(|w| to_frame * w);
        turned.iter().all(|w| w.z >= MIN_COSINE).then(|| (turned, self.received(wi)))
    }
}

/// (cos ψ, sin ψ) of (cos 2ψ, sin 2ψ) or a multiple of it, with ψ in (−90°, 90°].
pub(super) fn half_angle(doubled: DVec2) -> DVec2 {
    let DVec2 { x: cos, y: sin } = doubled / doubled.length();
    // By the one of two formulas in which nothing cancels.
    let half = if cos >= 0.0 { DVec2::new(1.0 + cos, sin) } else { DVec2::new(sin.abs(), 1.0 - cos) };
    half.normalize() * DVec2::new(1.0, if sin < 0.0 && cos < 0.0 { -1.0 } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::brdf::leaning_frame as frame;

    #[test]
    fn frames_are_right_handed_and_orthonormal() {
        for i in 0..200 {
            let step = f64::from(i);
            let axes = frame(1.5 * (0.31 * step).fract(), step, 0.7 * step).axes();
            assert!(((axes.transpose() * axes) - DMat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() < 1e-12));
            assert!((axes.determinant() - 1.0).abs() < 1e-12);
        }
        assert_eq!(SurfaceFrame::OWN.axes(), DMat3::IDENTITY);
    }

    #[test]
    fn the_tangent_lies_at_psi() {
        for degrees in -89..=90 {
            let psi = f64::from(degrees).to_radians();
            let tangent = frame(0.0, 0.0, psi).axes().x_axis;
            assert!((tangent - DVec3::new(psi.cos(), psi.sin(), 0.0)).length() < 1e-12, "{degrees}: {tangent}");
        }
        // However the normal leans, without a turn it has no part across u.
        assert!(frame(0.4, 1.0, 0.0).axes().x_axis.y.abs() > 0.0);
        assert!(frame(0.4, 1.0, 0.0).axes().y_axis.x.abs() < 1e-12);
    }

    /// A flat frame changes nothing; a leaning one receives what geometry says, but never more than there is.
    #[test]
    fn light_is_received_by_the_cosine() {
        let wi = DVec3::new(0.6, 0.0, 0.8);
        assert_eq!(SurfaceFrame::OWN.turned(wi, DVec3::Z), Some(([wi, DVec3::Z], 1.0)));
        for degrees in 0..90 {
            let theta = f64::from(degrees).to_radians();
            let wi = DVec3::new(theta.sin(), 0.0, theta.cos());
            assert_eq!(SurfaceFrame::OWN.received(wi), 1.0);
            let received = frame(0.5, 0.0, 0.0).received(wi);
            let ratio = (theta - 0.5).cos() / theta.cos();
            assert!(received * wi.z <= (theta - 0.5).cos() + 1e-12);
            assert!(theta.cos() < 0.1 || (received - ratio).abs() < 1e-12, "{degrees}");
        }
        // Below the frame there is nothing.
        let low = DVec3::new(-1.0, 0.0, 0.3).normalize();
        assert_eq!(frame(0.5, 0.0, 0.0).turned(low, DVec3::Z), None);
        assert_eq!(frame(0.5, 0.0, 0.0).turned(DVec3::Z, low), None);
    }
}
