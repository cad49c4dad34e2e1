//! Cloth of two crossed families of yarns, each a bundle of cylindrical fibres, after Sadeghi et al., *A Practical Microcylinder
//! Appearance Model for Cloth Rendering*, ACM TOG 32(2), 2013.
//!
//! f = Σ a (g F M cos(φd/2) N(s; γs) + (1 − g) albedo ((1 − k) M N(s; γv) + k)) / π over the families, with the yarn's direction t and
//!
//! - a coverage, g gloss, k isotropy, F Schlick's reflectance at half the angle between the directions;
//! - s = (ωo·t + ωi·t) / 2, which is 0 where a cylinder mirrors, and N(s; γ) the normal density of deviation γ;
//! - φo and φi the azimuths about t from the surface normal, φd their difference;
//! - M = (cos φo cos φi + min(cos φo, cos φi)) / 2 the shadows that the yarns of a family cast on each other: between independent and
//!   fully correlated, in equal parts.
//!
//! It is reciprocal, as all of these are symmetric. It makes no energy: with dωi = d(ωi·t) dφi and cos θi ≤ cos φi, the integral of M N cos θi is at most
//! ∫N d(ωi·t) ≤ 2 times ∫M cos φi dφi ≤ ∫cos² = π/2, so that each family returns at most a (g + (1 − g) albedo) of the light.
//! Where it departs from Sadeghi et al.: sines in place of angles, and no division by cos² θd or by cosines, for the sake of that bound; straight yarns; no
//! re-weighting by the visible length.

use std::f64::consts::{FRAC_1_PI, TAU};

use glam::{DVec2, DVec3};

use super::{Evaluate, fresnel_schlick};
use crate::scene::{Woven, Yarn};

impl Evaluate for Woven {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let cosine = (wo + wi).length() / 2.0;
        let turned = |w: DVec3| DVec3::new(w.y, -w.x, w.z);
        yarn_eval(&self.warp, wo, wi, cosine) + yarn_eval(&self.weft, turned(wo), turned(wi), cosine)
    }

    fn is_isotropic(&self) -> bool {
        false
    }
}

/// A family along x. `cosine` is that of half the angle between the directions.
fn yarn_eval(yarn: &Yarn, wo: DVec3, wi: DVec3, cosine: f64) -> DVec3 {
    let around = |w: DVec3| DVec2::new(w.y, w.z).normalize();
    let (out, inward) = (around(wo), around(wi));
    let masking = (out.y * inward.y + out.y.min(inward.y)) / 2.0;
    let sine = (wo.x + wi.x) / 2.0;
    let [coverage, gloss, isotropy, specular_width, volume_width] =
        [yarn.coverage, yarn.gloss, yarn.isotropy, yarn.specular_width, yarn.volume_width].map(f64::from);
    // |(cos, sin) φo + (cos, sin) φi| = 2 cos(φd/2)
    let mirrored = masking * (out + inward).length() / 2.0 * normal_density(sine, specular_width);
    let scattered = (1.0 - isotropy) * masking * normal_density(sine, volume_width) + isotropy;
    let specular = gloss * mirrored * fresnel_schlick(cosine, yarn.f0.as_dvec3());
    coverage * FRAC_1_PI * (specular + (1.0 - gloss) * scattered * yarn.albedo.as_dvec3())
}

fn normal_density(x: f64, deviation: f64) -> f64 {
    (-0.5 * (x / deviation).powi(2)).exp() / (TAU.sqrt() * deviation)
}
