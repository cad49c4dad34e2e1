//! `sample` follows `pdf`.

use std::fmt::Write;

use glam::DVec3;
use neubrdf::converge::{ChiSquare, chi_square_test, sidak};
use neubrdf::material::{Bsdf, BsdfSample};
use rayon::prelude::*;

use crate::configurations::{self, Configuration};
use crate::networks;
use crate::sphere::{Cells, Random};

/// The probability that any of a set of tests fails though all is well.
pub const SIGNIFICANCE: f64 = 0.01;

pub const SAMPLES: usize = 1_000_000;

/// Where samples of one surface and direction went.
pub struct Histogram {
    cells: Cells,
    counts: Vec<u64>,
    delta_counts: [u64; 2],
    delta_probabilities: [f64; 2],
    absorbed: u64,
    total: u64,
}

impl Histogram {
    pub fn new(configuration: &Configuration) -> Histogram {
        let cells = Cells::around_lobes(configuration);
        let counts = vec![0; cells.len()];
        Histogram { cells, counts, delta_counts: [0; 2], delta_probabilities: [0.0; 2], absorbed: 0, total: 0 }
    }

    pub fn add(&mut self, sample: Option<(DVec3, f64, bool)>) {
        self.total += 1;
        match sample {
            None => self.absorbed += 1,
            Some((wi, probability, true)) => {
                let lobe = usize::from(wi.z > 0.0);
                self.delta_counts[lobe] += 1;
                self.delta_probabilities[lobe] = probability;
            }
            Some((wi, _, false)) => match self.cells.cell(wi) {
                Some(cell) => self.counts[cell] += 1,
                None => panic!("{wi} is on a side to which the surface does not scatter"),
            },
        }
    }

    /// Tests the counts against a density, and gives the density's integral too.
    pub fn test(&self, pdf: impl Fn(DVec3) -> f64) -> (ChiSquare, f64) {
        let mut probabilities = self.cells.integrals(pdf, 1e-7);
        let integral: f64 = probabilities.iter().sum();
        let mut counts = self.counts.clone();
        probabilities.extend(self.delta_probabilities);
        counts.extend(self.delta_counts);
        probabilities.push((1.0 - probabilities.iter().sum::<f64>()).max(0.0));
        counts.push(self.absorbed);
        let expected: Vec<f64> = probabilities.iter().map(|p| p * self.total as f64).collect();
        (chi_square_test(&counts, &expected), integral)
    }

    /// The share of samples that were drawn from the density, and not from Dirac lobes or absorbed.
    pub fn share(&self) -> f64 {
        self.counts.iter().sum::<u64>() as f64 / self.total as f64
    }

    /// A table row of what was found.
    pub fn report(&self, name: &str, test: &ChiSquare, integral: f64) -> String {
        let ChiSquare { statistic, degrees_of_freedom, p_value } = test;
        format!(
            "{name:44} χ² {statistic:8.1} of {degrees_of_freedom:4}  p {p_value:.3e}  ∫pdf {integral:.6}  sampled {:.6}",
            self.share()
        )
    }
}

/// Writes what a test found to `target/evidence`.
pub fn write_evidence(name: &str, text: &str) {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("target/evidence");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join(name), text).unwrap();
}

/// Keeps the rows, and fails if one of them does.
pub fn judge(evidence: &str, results: &[(String, f64, bool)]) {
    let tests = results.len();
    let mut text = format!("{tests} tests; fails: p below {SIGNIFICANCE} when corrected for all of them (Šidák)\n");
    let mut failed = String::new();
    for (row, p_value, other_checks) in results {
        let corrected = sidak(*p_value, tests);
        let passes = corrected >= SIGNIFICANCE && *other_checks;
        let row = format!("{row}  corrected p {corrected:.3e}  {}", if passes { "passes" } else { "FAILS" });
        writeln!(text, "{row}").unwrap();
        if !passes {
            writeln!(failed, "{row}").unwrap();
        }
    }
    write_evidence(evidence, &text);
    assert!(failed.is_empty(), "p too small, or ∫pdf off:\n{failed}");
}

#[test]
fn samples_follow_the_density() {
    check_samples("bsdf_chi_square_cpu.txt", &configurations::all());
}

#[test]
fn samples_of_networks_follow_the_density() {
    check_samples("bsdf_chi_square_networks_cpu.txt", &networks::configurations());
}

fn check_samples(evidence: &str, configurations: &[Configuration]) {
    let results: Vec<_> = configurations
        .par_iter()
        .enumerate()
        .map(|(index, configuration)| {
            let bsdf = configuration.bsdf();
            let mut random = Random(index as u64);
            let mut histogram = Histogram::new(configuration);
            for _ in 0..SAMPLES {
                let sample = bsdf.sample(configuration.wo, random.units());
                histogram.add(sample.map(|BsdfSample { wi, pdf, is_delta, .. }| (wi, pdf, is_delta)));
            }
            let (test, integral) = histogram.test(|wi| bsdf.pdf(configuration.wo, wi));
            let share = histogram.share();
            // Five standard deviations of the share, and the quadrature's error.
            let tolerance = 5.0 * (share * (1.0 - share) / SAMPLES as f64).sqrt() + 1e-5;
            let holds = integral <= 1.0 + 1e-5 && (integral - share).abs() <= tolerance;
            (histogram.report(&configuration.name, &test, integral), test.p_value, holds)
        })
        .collect();
    judge(evidence, &results);
}

#[test]
fn a_wrong_density_is_found() {
    let configuration = Configuration::new(configurations::glass(1.5, 0.3), 45.0, 0.0);
    let bsdf = configuration.bsdf();
    let almost = Configuration::new(configurations::glass(1.5, 0.305), 45.0, 0.0);
    let mut random = Random(7);
    let mut histogram = Histogram::new(&configuration);
    for _ in 0..SAMPLES {
        let sample = bsdf.sample(configuration.wo, random.units());
        histogram.add(sample.map(|sample| (sample.wi, sample.pdf, false)));
    }
    let (test, _) = histogram.test(|wi| almost.bsdf().pdf(configuration.wo, wi));
    assert!(test.p_value < 1e-4, "α 0.305 passes for 0.3: {test:?}");
}

#[test]
fn weight_is_value_times_cosine_over_density() {
    for (index, configuration) in configurations::all().iter().enumerate() {
        let bsdf = configuration.bsdf();
        let mut random = Random(1000 + index as u64);
        for _ in 0..10_000 {
            let Some(sample) = bsdf.sample(configuration.wo, random.units()) else { continue };
            assert!((sample.wi.length() - 1.0).abs() < 1e-12);
            if sample.is_delta {
                let base = if matches!(bsdf, Bsdf::Coated(_)) { 1.0 } else { 0.0 };
                assert!(bsdf.pdf(configuration.wo, sample.wi) <= base, "Dirac lobes have no density");
                continue;
            }
            let pdf = bsdf.pdf(configuration.wo, sample.wi);
            let weight = bsdf.eval(configuration.wo, sample.wi) * sample.wi.z.abs() / pdf;
            // The half vector of a lobe α wide is known to 10⁻¹⁶ / α, of a nearly index-matched boundary to less.
            let close = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(b.abs());
            assert!(
                close(pdf, sample.pdf) && (0..3).all(|i| close(weight[i], sample.weight[i])),
                "{}: {sample:?}, but the density is {pdf} and the weight {weight}",
                configuration.name
            );
        }
    }
}

#[test]
fn nothing_is_ever_nan_infinite_or_negative() {
    use configurations::{coated, diffuse, glass, gold, schlick};
    use glam::Vec3;
    let alphas = [0.0, 9e-5, 1e-4, 1.1e-4, 1e-3, 0.1, 1.0];
    let iors = [0.1, 0.5, 0.9998, 0.99991, 1.0, 1.00009, 1.0002, 1.001, 1.5, 10.0];
    let mut surfaces = vec![diffuse(), gold(1e-4, 1.0), schlick(Vec3::ONE, 0.0, 0.5)];
    for alpha in alphas {
        surfaces.extend([gold(alpha, alpha), schlick(Vec3::ZERO, alpha, alpha)]);
        surfaces.extend(iors.map(|ior| glass(ior, alpha)));
        surfaces.extend(iors.iter().filter(|&&ior| ior >= 1.0).map(|&ior| coated(Vec3::ONE, ior, alpha)));
    }
    surfaces.par_iter().enumerate().for_each(|(index, surface)| {
        let configuration = Configuration::new(surface.clone(), 0.0, 0.0);
        let bsdf = configuration.bsdf();
        let mut random = Random(index as u64);
        for i in 0..20_000u64 {
            let wo = hard_direction(&mut random, i);
            let wi = match i % 3 {
                0 => DVec3::new(-wo.x, -wo.y, wo.z),
                1 => -wo,
                _ => hard_direction(&mut random, i / 7),
            };
            let (value, pdf) = (bsdf.eval(wo, wi), bsdf.pdf(wo, wi));
            let context = || format!("{} wo {wo} wi {wi}", configuration.name);
            assert!(value.is_finite() && value.min_element() >= 0.0, "f is {value}: {}", context());
            assert!(pdf.is_finite() && pdf >= 0.0, "pdf is {pdf}: {}", context());
            let u = random.units().map(|u| {
                if u < 0.05 {
                    0.0
                } else if u > 0.95 {
                    1.0 - 0.5f64.powi(24)
                } else {
                    u
                }
            });
            let Some(sample) = bsdf.sample(wo, u) else { continue };
            assert!(
                sample.pdf.is_finite() && sample.pdf > 0.0 && sample.wi.is_normalized(),
                "{sample:?}: {} u {u:?}",
                context()
            );
            assert!(sample.weight.is_finite() && sample.weight.min_element() >= 0.0, "{sample:?}: {}", context());
        }
    });
}

/// Unit vectors of which many are along, or within rounding of, an axis or the surface.
pub fn hard_direction(random: &mut Random, kind: u64) -> DVec3 {
    let w = random.direction();
    let tiny = 10f64.powf(-20.0 * random.unit());
    let w = match kind % 5 {
        0 => DVec3::new(w.x, w.y, tiny * w.z.signum()),
        1 => DVec3::new(w.x * tiny, w.y * tiny, w.z),
        2 => DVec3::new(w.x, tiny, w.z),
        _ => w,
    };
    w.try_normalize().unwrap_or(DVec3::Z)
}
