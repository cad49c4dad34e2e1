//! Cloth.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec3, Vec3};
use neubrdf::material::Evaluate;
use neubrdf::scene::{Woven, Yarn};

use crate::random::Random;

fn yarn(coverage: f32, gloss: f32, widths: [f32; 2], isotropy: f32) -> Yarn {
    let [specular_width, volume_width] = widths;
    Yarn { coverage, gloss, f0: Vec3::ONE, albedo: Vec3::new(1.0, 0.5, 0.0), specular_width, volume_width, isotropy }
}

fn cloths() -> [Woven; 4] {
    [
        Woven { warp: yarn(0.5, 0.5, [0.1, 0.3], 0.3), weft: yarn(0.5, 0.5, [0.1, 0.3], 0.3) },
        Woven { warp: yarn(1.0, 1.0, [0.02, 0.3], 0.3), weft: yarn(0.0, 1.0, [0.1, 0.3], 0.3) },
        Woven { warp: yarn(0.2, 0.0, [0.1, 0.05], 0.0), weft: yarn(0.8, 0.0, [0.1, 1.0], 0.0) },
        Woven { warp: yarn(0.5, 0.0, [0.1, 0.3], 1.0), weft: yarn(0.5, 0.0, [0.1, 0.3], 1.0) },
    ]
}

/// ∫f cos θi dωi by the midpoint rule over z and φ, first channel.
fn albedo(cloth: &Woven, wo: DVec3) -> f64 {
    const STEPS: u32 = 400;
    let cell = TAU / f64::from(STEPS * STEPS);
    let mut sum = 0.0;
    for i in 0..STEPS {
        let z = (f64::from(i) + 0.5) / f64::from(STEPS);
        let sine = (1.0 - z * z).sqrt();
        for j in 0..STEPS {
            let (y, x) = (TAU * (f64::from(j) + 0.5) / f64::from(STEPS)).sin_cos();
            sum += cloth.eval(wo, DVec3::new(sine * x, sine * y, z)).x * z * cell;
        }
    }
    sum
}

#[test]
fn cloth_is_reciprocal_and_mirror_symmetric() {
    let mut random = Random(1);
    for cloth in cloths() {
        for _ in 0..5000 {
            let (wo, wi) = (random.above(1e-6), random.above(1e-6));
            let value = cloth.eval(wo, wi);
            assert!(value.is_finite() && value.min_element() >= 0.0);
            let close = |other: DVec3| (other - value).abs().max_element() <= 1e-12 * value.max_element();
            assert!(close(cloth.eval(wi, wo)), "reciprocity: {wo} {wi}");
            for flip in [DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, -1.0, 1.0)] {
                assert!(close(cloth.eval(wo * flip, wi * flip)), "symmetry: {wo} {wi}");
            }
        }
    }
}

#[test]
fn cloth_makes_no_energy() {
    for cloth in cloths() {
        for theta in [0.0, 0.5, 1.0, 1.4, 1.55] {
            for phi in [0.0, 0.7, FRAC_PI_2] {
                let theta: f64 = theta;
                let phi: f64 = phi;
                let wo = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                let albedo = albedo(&cloth, wo);
                assert!(albedo <= 1.0 + 1e-3, "{albedo} from {wo}");
            }
        }
    }
    let white = albedo(&cloths()[3], DVec3::Z);
    assert!((white - 1.0).abs() < 1e-4, "yarns that only spread evenly are white paper: {white}");
}

#[test]
fn yarns_shine_across_themselves() {
    // Light mirrored about the warp spreads in the plane across it, not along it.
    let cloth = Woven { warp: yarn(1.0, 1.0, [0.05, 0.3], 0.3), weft: yarn(0.0, 1.0, [0.05, 0.3], 0.3) };
    let tilted = |x: f64, y: f64| DVec3::new(x, y, (1.0 - x * x - y * y).sqrt());
    let across = cloth.eval(DVec3::Z, tilted(0.0, 0.6)).x;
    let along = cloth.eval(DVec3::Z, tilted(0.6, 0.0)).x;
    assert!(across > 100.0 * along, "{across} across, {along} along");
    let other = Woven { warp: cloth.weft, weft: cloth.warp };
    assert!((other.eval(DVec3::Z, tilted(0.6, 0.0)).x - across).abs() < 1e-12, "the weft is the warp, turned");
}
