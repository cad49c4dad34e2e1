//! Rusinkiewicz's half and difference angles: *A New Change of Variables for Efficient BRDF Representation*, EGWR 1998.

use glam::{DVec2, DVec3};

/// A pair of directions, by their half vector and by where `wi` is about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfDifference {
    /// The unit vector (wo + wi) / |wo + wi|.
    pub half: DVec3,
    /// sin θd times the unit vector at azimuth φd: what is across the half vector in `wi`, turned by −φh about the normal and by −θh
    /// about y. Swapping `wo` and `wi` changes its sign.
    pub across: DVec2,
    /// cos θd.
    pub cosine: f64,
}

impl HalfDifference {
    /// Of two unit vectors above the surface.
    pub fn new(wo: DVec3, wi: DVec3) -> HalfDifference {
        let sum = wo + wi;
        let half = sum.normalize();
        let difference = (wi - wo) / 2.0;
        let azimuth = half.truncate().try_normalize().unwrap_or(DVec2::X);
        let sine = half.truncate().length();
        let outward = azimuth.dot(difference.truncate());
        let across = DVec2::new(half.z * outward - sine * difference.z, azimuth.perp_dot(difference.truncate()));
        HalfDifference { half, across, cosine: sum.length() / 2.0 }
    }

    /// θh, the half vector's angle to the normal.
    pub fn theta_half(&self) -> f64 {
        self.half.truncate().length().atan2(self.half.z)
    }

    /// θd, half the angle between the directions.
    pub fn theta_difference(&self) -> f64 {
        self.across.length().atan2(self.cosine)
    }

    /// φd in [0, π): as of `wi` and of `wo` alike.
    pub fn phi_difference(&self) -> f64 {
        self.across.to_angle().rem_euclid(std::f64::consts::PI)
    }

    /// The pair (wo, wi) of an isotropic material, whose half vector has azimuth 0, from θh, θd and φd. One of them may be below the surface.
    pub fn directions([theta_half, theta_difference, phi_difference]: [f64; 3]) -> (DVec3, DVec3) {
        let (sine, cosine) = theta_difference.sin_cos();
        let across = DVec2::from_angle(phi_difference) * sine;
        let turn = glam::DMat3::from_rotation_y(theta_half);
        (turn * (-across).extend(cosine), turn * across.extend(cosine))
    }
}
