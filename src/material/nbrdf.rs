//! NBRDF: Sztrajman et al., *Neural BRDF Representation and Importance Sampling*, Computer Graphics Forum 40(6), 2021.
//!
//! The network sees the half vector h, turned about the normal to azimuth 0, and the difference vector d of Rusinkiewicz (*A New
//! Change of Variables for Efficient BRDF Representation*, 1998), as unit vectors:
//!
//! h = (ωi + ωo) / |ωi + ωo| at (θh, φh), d = R_y(−θh) R_z(−φh) ωi, x = (sin θh, 0, cos θh, d), f = max(exp(net(x)) − 1, 0).

use std::array;

use glam::DVec3;

use crate::scene::Nbrdf;

/// Outputs above this count as this: networks end at e²⁵ ≈ 7·10¹⁰ sr⁻¹ instead of beyond what `f32` holds.
pub const LARGEST_OUTPUT: f64 = 25.0;

impl Nbrdf {
    /// f(wo, wi), see [`super::Evaluate::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let inputs = inputs(wo, wi);
        let hidden = layer(&inputs, &self.kernel_1, &self.bias_1).map(|x| x.max(0.0));
        let hidden = layer(&hidden, &self.kernel_2, &self.bias_2).map(|x| x.max(0.0));
        let output = layer(&hidden, &self.kernel_3, &self.bias_3);
        DVec3::from_array(output.map(|y| y.clamp(0.0, LARGEST_OUTPUT).exp_m1()))
    }
}

fn inputs(wo: DVec3, wi: DVec3) -> [f64; Nbrdf::INPUTS] {
    let h = (wo + wi).normalize();
    let sine = h.x.hypot(h.y);
    let (cos_phi, sin_phi) = if sine > 0.0 { (h.x / sine, h.y / sine) } else { (1.0, 0.0) };
    let along = cos_phi * wi.x + sin_phi * wi.y;
    let across = cos_phi * wi.y - sin_phi * wi.x;
    [sine, 0.0, h.z, h.z * along - sine * wi.z, across, sine * along + h.z * wi.z]
}

fn layer<const I: usize, const O: usize>(inputs: &[f64; I], kernel: &[[f32; O]; I], bias: &[f32; O]) -> [f64; O] {
    let mut sums = bias.map(f64::from);
    for (input, weights) in inputs.iter().zip(kernel) {
        sums = array::from_fn(|i| sums[i] + input * f64::from(weights[i]));
    }
    sums
}
