//! Layered surfaces, whose values are estimates: right on average.

use std::f64::consts::FRAC_1_PI;

use glam::{DVec3, Vec3};
use neubrdf::converge::sidak;
use neubrdf::material::{Bsdf, LayeredWalk, Prepared, fresnel_dielectric};
use neubrdf::scene::{Layered, Surface};
use rayon::prelude::*;

use crate::common::on_both_drivers;
use crate::configurations::{describe, direction};
use crate::device::{Shader, case};
use crate::sampling::{SIGNIFICANCE, write_evidence};
use crate::sphere::Random;
use crate::truths::{lacquer, layered, varnish};

/// Mean and variance of the mean.
#[derive(Clone, Copy, Default)]
struct Mean {
    mean: f64,
    variance: f64,
}

impl Mean {
    fn of(values: impl Iterator<Item = f64>) -> Mean {
        let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
        for value in values {
            count += 1.0;
            let off: f64 = value - mean;
            mean += off / count;
            squares += off * (value - mean);
        }
        Mean { mean, variance: squares / (count * (count - 1.0)) }
    }

    /// The probability that two means of the same differ by more.
    fn p_value(self, other: Mean) -> f64 {
        let z = (self.mean - other.mean).abs() / (self.variance + other.variance).sqrt();
        neubrdf::converge::two_sided_p(z)
    }
}

fn walk(surface: &Surface) -> LayeredWalk {
    let Surface::Layered(layers) = surface else { panic!("{surface:?}") };
    LayeredWalk::new(layers)
}

/// ∫f cos θi dωi by sampling.
fn albedo(surface: &Surface, theta: f64, samples: u32) -> Mean {
    let prepared = Prepared::new(surface, &[]);
    let bsdf = Bsdf::new(&prepared, DVec3::ONE);
    let wo = direction(theta, 0.0);
    let mut random = Random(u64::from(samples) + theta as u64);
    Mean::of((0..samples).map(|_| bsdf.sample(wo, random.units()).map_or(0.0, |sample| sample.weight.x)))
}

/// What a smooth coat over a diffuse base reflects, exactly: at its outside, and what crosses it, meets the base, and crosses it
/// again after any number of reflections at its inside.
fn smooth_albedo(ior: f64, base: f64, absorption: f64, cosine: f64) -> f64 {
    let steps = 20_000;
    let (mut out, mut back) = (0.0, 0.0);
    for i in 0..steps {
        let mu = (f64::from(i) + 0.5) / f64::from(steps);
        let reflected = fresnel_dielectric(mu, 1.0 / ior);
        out += 2.0 * mu * (1.0 - reflected) * (-absorption / mu).exp() / f64::from(steps);
        back += 2.0 * mu * reflected * (-2.0 * absorption / mu).exp() / f64::from(steps);
    }
    let reflected = fresnel_dielectric(cosine, ior);
    let refracted = (1.0 - (1.0 - cosine * cosine) / (ior * ior)).sqrt();
    reflected + (1.0 - reflected) * (-absorption / refracted).exp() * base * out / (1.0 - base * back)
}

#[test]
fn nearly_smooth_coats_have_the_albedo_of_smooth_ones() {
    for (ior, base, absorption) in
        [(1.5, 1.0, 0.0), (1.5, 0.5, 0.0), (1.3, 0.8, 0.3), (2.2, 0.9, 0.05), (1.5, 0.0, 0.0)]
    {
        for theta in [0.0, 45.0, 70.0] {
            let surface =
                varnish(ior as f32, Layered::LEAST_ALPHA, Vec3::splat(base as f32), Vec3::splat(absorption as f32));
            let found = albedo(&surface, theta, 100_000);
            let expected = smooth_albedo(ior, base, absorption, direction(theta, 0.0).z);
            let tolerance = 4.0 * found.variance.sqrt() + 4e-3;
            let error = found.mean - expected;
            assert!(
                error.abs() < tolerance,
                "η {ior}, base {base}, absorption {absorption}, {theta}°: {}, not {expected}",
                found.mean
            );
        }
    }
}

#[test]
fn layers_make_no_energy_and_lose_what_facets_lose() {
    let white = Vec3::ONE;
    let mut text = String::new();
    let mut failed = String::new();
    for (surface, least) in [
        (varnish(1.5, 0.1, white, Vec3::ZERO), 0.9),
        (varnish(1.5, 0.5, white, Vec3::ZERO), 0.45),
        (lacquer(1.5, 0.1, white, [0.1, 0.1], Vec3::ZERO), 0.78),
        (lacquer(2.0, 0.3, white, [0.1, 0.4], Vec3::ZERO), 0.38),
    ] {
        for theta in [0.0, 45.0, 75.0] {
            let found = albedo(&surface, theta, 60_000);
            let row =
                format!("{:24} at {theta:2}°: {:.4} ± {:.4}\n", describe(&surface), found.mean, found.variance.sqrt());
            let slack = 4.0 * found.variance.sqrt() + 1e-3;
            if found.mean > 1.0 + slack || found.mean < least - slack {
                failed += &row;
            }
            text += &row;
        }
    }
    write_evidence("bsdf_layered_furnace.txt", &text);
    assert!(failed.is_empty(), "{failed}");
}

#[test]
fn layers_are_reciprocal() {
    let mut p_values = Vec::new();
    for surface in layered() {
        let walk = walk(&surface);
        let mut random = Random(3);
        for _ in 0..4 {
            let mut above = || direction(80.0 * random.unit(), 360.0 * random.unit());
            let (wo, wi) = (above(), above());
            let means =
                [(wo, wi), (wi, wo)].map(|(wo, wi)| Mean::of((0..20_000).map(|salt| walk.estimate(wo, wi, salt).y)));
            p_values.push((
                means[0].p_value(means[1]),
                format!("{}: {} and {}", describe(&surface), means[0].mean, means[1].mean),
            ));
        }
    }
    judge_all(&p_values);
}

fn judge_all(p_values: &[(f64, String)]) {
    for (p, context) in p_values {
        let corrected = sidak(*p, p_values.len());
        assert!(corrected >= SIGNIFICANCE, "p {corrected}: {context}");
    }
}

#[test]
fn an_estimate_is_a_pure_function() {
    let walk = walk(&layered()[0]);
    let (wo, wi) = (direction(30.0, 0.0), direction(50.0, 100.0));
    assert_eq!(walk.estimate(wo, wi, 1), walk.estimate(wo, wi, 1));
    assert!((0..100).any(|salt| walk.estimate(wo, wi, salt) != walk.estimate(wo, wi, 0)));
    let black = self::walk(&varnish(1.5, 0.3, Vec3::ZERO, Vec3::ZERO));
    assert!(black.average(wo, wi, 10).max_element() < FRAC_1_PI, "the coat alone");
}

/// Directions that differ by next to nothing, whose walks are independent.
fn nearby(w: DVec3, random: &mut Random) -> DVec3 {
    (w + 1e-4 * random.direction()).normalize().as_vec3().as_dvec3()
}

#[test]
fn walks_on_the_device_have_the_means_of_the_definitions() {
    const WALKS: usize = 20_000;
    let surfaces = layered();
    let mut random = Random(9);
    let mut above = || direction(80.0 * random.unit(), 360.0 * random.unit());
    let pairs: Vec<(usize, DVec3, DVec3)> =
        (0..3 * surfaces.len()).map(|i| (i % surfaces.len(), above(), above())).collect();
    let cases: Vec<_> = pairs
        .iter()
        .flat_map(|&(surface, wo, wi)| {
            let mut random = Random(surface as u64);
            let at = move |_| case(surface, nearby(wo, &mut random), nearby(wi, &mut random), random.units());
            (0..WALKS).map(at).collect::<Vec<_>>()
        })
        .collect();
    let walks: Vec<_> = surfaces.iter().map(walk).collect();
    let expected: Vec<[Mean; 3]> = pairs
        .par_iter()
        .zip(cases.par_chunks(WALKS))
        .map(|(&(surface, ..), cases)| {
            let single = |w: [f32; 3]| Vec3::from(w).as_dvec3();
            let values: Vec<DVec3> =
                cases.iter().map(|case| walks[surface].estimate(single(case.wo), single(case.wi), 7)).collect();
            [0, 1, 2].map(|channel| Mean::of(values.iter().map(|value| value[channel])))
        })
        .collect();
    on_both_drivers(|device, name| {
        let results = Shader::new(device, &surfaces, &[]).run(&cases);
        let mut p_values = Vec::new();
        for ((&(surface, wo, wi), results), expected) in pairs.iter().zip(results.chunks(WALKS)).zip(&expected) {
            assert!(results.iter().flat_map(|result| result.eval_pdf).all(|x| x.is_finite() && x >= 0.0));
            for (channel, expected) in expected.iter().enumerate() {
                let found = Mean::of(results.iter().map(|result| result.eval_pdf[channel].into()));
                let context =
                    format!("{} wo {wo} wi {wi}: {}, not {}", describe(&surfaces[surface]), found.mean, expected.mean);
                p_values.push((found.p_value(*expected), context));
            }
        }
        let rows: String = p_values.iter().map(|(p, context)| format!("p {p:.3}  {context}\n")).collect();
        write_evidence(&format!("bsdf_layered_parity_{name}.txt"), &rows);
        judge_all(&p_values);
    });
}
