//! Surfaces keep the energy and the symmetry that physics demands.

use std::fmt::Write;

use glam::{DVec3, Vec2, Vec3};
use neubrdf::material::{
    Bsdf, CoatAlbedo, Frame, Prepared, SMOOTH_ALPHA, fresnel_complex, fresnel_dielectric, fresnel_dielectric_average,
    orthonormal_basis,
};
use neubrdf::scene::{Material, Surface};
use rayon::prelude::*;

use crate::configurations::{Configuration, coated, describe, diffuse, direction, glass, gold, schlick};
use crate::sampling::write_evidence;
use crate::sphere::{Cells, Random};

/// ∫f |cos θi| dωi by quadrature, first channel, Dirac lobes aside.
fn albedo_by_quadrature(configuration: &Configuration) -> f64 {
    let bsdf = configuration.bsdf();
    let cells = Cells::around_lobes(configuration);
    cells.integrals(|wi| bsdf.eval(configuration.wo, wi).x * wi.z.abs(), 1e-7).iter().sum()
}

/// What sampling gives, first channel, with `scale` applied to each sample: mean and its standard error.
fn albedo_by_sampling(configuration: &Configuration, samples: u32, scale: impl Fn(DVec3) -> f64) -> (f64, f64) {
    let bsdf = configuration.bsdf();
    let mut random = Random(samples.into());
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..samples {
        if let Some(sample) = bsdf.sample(configuration.wo, random.units()) {
            let weight = sample.weight.x * scale(sample.wi);
            sum += weight;
            squares += weight * weight;
        }
    }
    let count = f64::from(samples);
    let mean = sum / count;
    (mean, ((squares / count - mean * mean).max(0.0) / count).sqrt())
}

const THETAS: [f64; 7] = [0.0, 30.0, 60.0, 75.0, 85.0, 89.0, 89.9];

#[test]
fn smooth_lossless_surfaces_close_the_furnace() {
    let mirror = schlick(Vec3::ONE, 0.0, 0.0);
    for (surface, from_inside) in
        [(mirror, false), (glass(1.5, 0.0), false), (glass(1.5, 0.0), true), (glass(1.0, 0.5), true)]
    {
        for theta in THETAS {
            let theta = if from_inside { 180.0 - theta } else { theta };
            let configuration = Configuration::new(surface.clone(), theta, 20.0);
            // Radiance is compressed by 1/η² on refraction; power is not.
            let eta = match surface {
                Surface::Dielectric { ior, .. } => f64::from(ior).powf(configuration.wo.z.signum()),
                _ => 1.0,
            };
            let power = |wi: DVec3| if wi.z * configuration.wo.z < 0.0 { eta * eta } else { 1.0 };
            let (albedo, _) = albedo_by_sampling(&configuration, 1000, power);
            assert!((albedo - 1.0).abs() < 1e-12, "{}: {albedo}", configuration.name);
        }
    }
}

#[test]
fn white_base_under_any_coat_closes_the_furnace() {
    let mut coats = Vec::new();
    for alpha in [0.0, 1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.6, 1.0] {
        coats.extend([1.00005, 1.01, 1.5, 10.0].map(|ior| coated(Vec3::ONE, ior, alpha)));
    }
    let furnace_errors = |surface: &Surface| {
        let mut configuration = Configuration::new(surface.clone(), 0.0, 0.0);
        [0.0, 60.0, 85.0, 89.0, 89.99].map(|theta| {
            configuration.wo = direction(theta, 0.0);
            let mirrored = match &configuration.prepared {
                Prepared::Coated { coats, .. } if matches!(coats[0], CoatAlbedo::Smooth { .. }) => {
                    coats[0].at(configuration.wo.z)
                }
                _ => 0.0,
            };
            let error = albedo_by_quadrature(&configuration) + mirrored - 1.0;
            (error.abs(), format!("{:28} at {theta:5}°  {error:+.2e}", describe(surface)))
        })
    };
    let mut rows: Vec<(f64, String)> = coats.par_iter().flat_map_iter(furnace_errors).collect();
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut text = String::from("furnace error of a white base under a coat, worst first\n");
    rows.iter().for_each(|(_, row)| writeln!(text, "{row}").unwrap());
    write_evidence("bsdf_coat_furnace.txt", &text);
    assert!(rows[0].0 < 1e-3, "{}", rows[0].1);
}

/// Where a map says how rough it is, the albedo of a coat is interpolated between roughnesses.
#[test]
fn white_base_under_a_coat_of_a_mapped_roughness_closes_the_furnace() {
    let roughnesses: Vec<f32> =
        [0.0, 1.0].into_iter().chain((0..20).map(|i| ((i as f32 + 0.37) / 20.0).powi(2))).collect();
    let mut rows = Vec::new();
    for ior in [1.01, 3.0] {
        let surface = coated(Vec3::ONE, ior, 0.0);
        let material = Material { roughness_map: Some(0), ..Material::new("coat", surface.clone()) };
        let prepared = Prepared::of(&material, &[]);
        let errors = |&roughness: &f32| {
            let bsdf = Bsdf::of_roughness(&prepared, DVec3::ONE, Vec2::splat(roughness));
            // For where its lobe is.
            let mut configuration = Configuration::new(coated(Vec3::ONE, ior, roughness * roughness), 0.0, 0.0);
            let is_mirror = roughness * roughness < SMOOTH_ALPHA;
            [0.0, 60.0, 85.0, 89.0].map(|theta| {
                configuration.wo = direction(theta, 0.0);
                let wo = configuration.wo;
                let mirrored = if is_mirror { fresnel_dielectric(wo.z, ior.into()) } else { 0.0 };
                let value = |wi: DVec3| bsdf.eval(wo, wi).x * wi.z.abs();
                let albedo: f64 = Cells::around_lobes(&configuration).integrals(value, 1e-7).iter().sum();
                let error = albedo + mirrored - 1.0;
                (error.abs(), format!("ior {ior} roughness {roughness} at {theta:5}°  {error:+.2e}"))
            })
        };
        rows.extend(roughnesses.par_iter().flat_map_iter(errors).collect::<Vec<_>>());
    }
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let text: Vec<String> = rows.iter().map(|(_, row)| row.clone()).collect();
    write_evidence("bsdf_mapped_coat_furnace.txt", &text.join("\n"));
    assert!(rows[0].0 < 1e-3, "{}", rows[0].1);
}

#[test]
fn rough_surfaces_lose_energy_but_never_make_any() {
    let mut surfaces = vec![diffuse(), schlick(Vec3::ONE, 0.05, 0.5), coated(Vec3::new(0.5, 0.5, 0.5), 1.5, 0.2)];
    for alpha in [1e-3, 0.1, 0.3, 0.6, 1.0] {
        surfaces.extend([schlick(Vec3::ONE, alpha, alpha), glass(1.5, alpha), glass(0.7, alpha)]);
    }
    let mut cases = Vec::new();
    for surface in surfaces {
        let through = matches!(surface, Surface::Dielectric { .. });
        for theta in [0.0, 45.0, 75.0, 89.0] {
            cases.push(Configuration::new(surface.clone(), theta, 30.0));
            if through {
                cases.push(Configuration::new(surface.clone(), 180.0 - theta, 30.0));
            }
        }
    }
    let rows: Vec<String> = cases
        .par_iter()
        .map(|configuration| {
            let quadrature = albedo_by_quadrature(configuration);
            let (sampled, error) = albedo_by_sampling(configuration, 200_000, |_| 1.0);
            let eta = match configuration.surface {
                Surface::Dielectric { ior, .. } => f64::from(ior).powf(configuration.wo.z.signum()),
                _ => 1.0,
            };
            let power = |wi: DVec3| if wi.z * configuration.wo.z < 0.0 { eta * eta } else { 1.0 };
            let (energy, energy_error) = albedo_by_sampling(configuration, 200_000, power);
            let name = &configuration.name;
            assert!(
                (quadrature - sampled).abs() < 5.0 * error + 1e-5,
                "{name}: ∫f cos {quadrature}, sampled {sampled}"
            );
            assert!(energy <= 1.0 + 1e-3 + 5.0 * energy_error, "{name} makes energy: {energy}");
            format!("{name:44} ∫f cos {quadrature:.5}  sampled {sampled:.5} ± {error:.5}  power {energy:.5}")
        })
        .collect();
    write_evidence("bsdf_albedo.txt", &(rows.join("\n") + "\n"));
}

#[test]
fn light_can_go_back_the_way_it_came() {
    let surfaces = [
        diffuse(),
        gold(0.1, 0.1),
        schlick(Vec3::new(0.9, 0.5, 0.1), 0.05, 0.4),
        glass(1.5, 0.3),
        glass(0.6, 0.05),
        coated(Vec3::new(0.8, 0.5, 0.2), 1.5, 0.1),
        coated(Vec3::new(0.8, 0.5, 0.2), 2.0, 0.0),
    ];
    for surface in surfaces {
        let configuration = Configuration::new(surface.clone(), 0.0, 0.0);
        let bsdf = configuration.bsdf();
        let mut random = Random(3);
        let mut refracted = 0;
        for _ in 0..50_000 {
            let wo = random.direction();
            let Some(sample) = bsdf.sample(wo, random.units()).filter(|sample| !sample.is_delta) else { continue };
            let wi = sample.wi;
            // f(wo → wi) / η² is symmetric, with η the index on the side of wo (Veach 1997, equation 5.14).
            let squared_index = |w: DVec3| match surface {
                Surface::Dielectric { ior, .. } if w.z < 0.0 => f64::from(ior).powi(2),
                _ => 1.0,
            };
            refracted += u32::from(wo.z * wi.z < 0.0);
            let forward = bsdf.eval(wo, wi) / squared_index(wo);
            let backward = bsdf.eval(wi, wo) / squared_index(wi);
            let difference = (forward - backward).abs().max_element();
            assert!(difference <= 1e-8 * forward.max_element(), "{}: {forward} and {backward}", configuration.name);
        }
        let is_transparent = matches!(bsdf, Bsdf::Dielectric(_));
        assert_eq!(refracted > 1000, is_transparent, "{}: {refracted} refracted", configuration.name);
    }
}

#[test]
fn fresnel_has_the_known_values() {
    for eta in [1.5f64, 1.0 / 1.5, 2.4] {
        let normal = ((eta - 1.0) / (eta + 1.0)).powi(2);
        assert!((fresnel_dielectric(1.0, eta) - normal).abs() < 1e-15);
        // At Brewster's angle, tan θ = η, only the perpendicular component is reflected.
        let squared = 1.0 / (1.0 + eta * eta);
        let brewster = 0.5 * ((1.0 - eta * eta) / (1.0 + eta * eta)).powi(2);
        assert!((fresnel_dielectric(squared.sqrt(), eta) - brewster).abs() < 1e-12);
    }
    assert_eq!(fresnel_dielectric(0.7, 1.0 / 1.5), 1.0, "total reflection beyond 41.8°");
    assert_eq!(fresnel_dielectric(0.0, 1.5), 1.0);
    // A metal without absorption is a dielectric.
    for cosine in [0.0, 0.1, 0.6, 1.0] {
        let metal = fresnel_complex(cosine, DVec3::splat(1.5), DVec3::ZERO);
        assert!((metal.x - fresnel_dielectric(cosine, 1.5)).abs() < 1e-14);
    }
    let (eta, kappa) = (0.2f64, 3.4f64);
    let normal = ((eta - 1.0).powi(2) + kappa * kappa) / ((eta + 1.0).powi(2) + kappa * kappa);
    assert!((fresnel_complex(1.0, DVec3::splat(eta), DVec3::splat(kappa)).y - normal).abs() < 1e-14);
    // The average's closed form against quadrature, across the index where it is changed for one.
    for eta in [1.0002, 1.00099, 1.00101, 1.01, 1.5, 3.0, 10.0] {
        let steps = 200_000;
        let integrand = |i| {
            let t = (f64::from(i) + 0.5) / f64::from(steps);
            fresnel_dielectric(t.powi(4), eta) * 8.0 * t.powi(7)
        };
        let quadrature = (0..steps).map(integrand).sum::<f64>() / f64::from(steps);
        let found = fresnel_dielectric_average(eta);
        assert!((found / quadrature - 1.0).abs() < 1e-4, "η {eta}: {found}, by quadrature {quadrature}");
    }
}

#[test]
fn frames_are_orthonormal_and_face_the_viewer() {
    let mut random = Random(11);
    for i in 0..100_000 {
        let geometric = random.direction() * 10f64.powf(4.0 * random.unit() - 2.0);
        let interpolated = match i % 4 {
            0 => DVec3::ZERO,
            1 => random.direction(),
            _ => geometric.normalize() + 0.3 * random.direction(),
        };
        let dpdu = match i % 3 {
            0 => DVec3::ZERO,
            1 => geometric * 3.0,
            _ => random.direction() * 5.0,
        };
        let wo = random.direction();
        let opaque = i % 2 == 0;
        let frame = Frame::new(wo, geometric, interpolated, dpdu, opaque);
        let local = random.direction();
        assert!((frame.to_local(frame.to_world(local)) - local).length() < 1e-9);
        assert!(frame.normal.dot(frame.tangent.cross(frame.bitangent)) > 1.0 - 1e-9, "right-handed");
        // The viewer is on the same side of both normals, for opaque surfaces on the upper one.
        assert!(frame.is_consistent(wo, frame.to_local(wo)));
        assert!(!opaque || wo.dot(frame.geometric) > 0.0);
        assert!(opaque || frame.geometric.dot(geometric) > 0.0, "a solid's normal points out");
        if i % 3 == 2 {
            assert!(dpdu.dot(frame.tangent) >= 0.0 && dpdu.dot(frame.bitangent).abs() < 1e-9, "x goes along dp/du");
        }
    }
    let (tangent, bitangent) = orthonormal_basis(direction(180.0, 0.0));
    assert!(tangent.is_finite() && bitangent.is_finite());
}
