//! Sparse samples.

use std::fmt::Write;

use glam::DMat3;
use neubrdf::scene::{Brdf, Sparse};

use crate::common::tables::metal;
use crate::random::Random;

const HEADER: &str = "wi_theta, wi_phi, wo_theta, wo_phi, r, g, b\n";

/// A file with samples of a metal.
fn file(count: usize, is_isotropic: bool) -> String {
    let mut random = Random(count as u64);
    let metal = if is_isotropic { metal(0.4, 0.4) } else { metal(0.3, 0.6) };
    let mut text = String::from(HEADER) + "# degrees\n\n";
    for _ in 0..count {
        let (wo, wi) = (random.above(0.1), random.above(0.1));
        let value = metal.eval(wo, wi);
        let phi_i = wi.y.atan2(wi.x).to_degrees();
        let phi_o = wo.y.atan2(wo.x).to_degrees();
        let (phi_i, phi_o) = if is_isotropic { (0.0, (phi_o - phi_i).rem_euclid(360.0)) } else { (phi_i, phi_o) };
        let (theta_i, theta_o) = (wi.z.acos().to_degrees(), wo.z.acos().to_degrees());
        writeln!(text, "{theta_i}, {phi_i}, {theta_o}, {phi_o}, {}, {}, {}", value.x, value.y, value.z).unwrap();
    }
    text
}

pub fn load(text: &str) -> Result<Sparse, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("samples.csv");
    std::fs::write(&path, text).unwrap();
    match Brdf::load(&path, None).map_err(|error| error.to_string())? {
        Brdf::Sparse(samples) => Ok(samples),
        other => panic!("{other:?}"),
    }
}

#[test]
fn samples_are_met_and_never_exceeded() {
    for is_isotropic in [true, false] {
        let samples = load(&file(300, is_isotropic)).unwrap();
        assert_eq!((samples.samples().len(), samples.is_isotropic()), (300, is_isotropic));
        let brightest = samples.samples().iter().map(|sample| sample.value.max_element()).fold(0.0, f32::max);
        for sample in samples.samples() {
            let value = sample.value.as_dvec3();
            let found = samples.eval(sample.wo, sample.wi);
            assert!((found - value).abs().max_element() <= 1e-3 * f64::from(brightest), "{found}, not {value}");
        }
        let mut random = Random(5);
        for _ in 0..2000 {
            let (wo, wi) = (random.above(0.0), random.above(0.0));
            let found = samples.eval(wo, wi);
            assert!(found.min_element() >= 0.0 && found.max_element() <= f64::from(brightest) * (1.0 + 1e-12));
            assert!((found - samples.eval(wi, wo)).abs().max_element() <= 1e-9, "reciprocity");
            let turn = DMat3::from_rotation_z(1.0);
            let turned = samples.eval(turn * wo, turn * wi);
            assert_eq!((found - turned).abs().max_element() <= 1e-9, is_isotropic);
        }
    }
}

#[test]
fn more_samples_come_closer() {
    let metal = metal(0.4, 0.4);
    let error = |count| {
        let samples = load(&file(count, true)).unwrap();
        let mut random = Random(6);
        let pairs = (0..1000).map(|_| (random.above(0.3), random.above(0.3)));
        pairs.map(|(wo, wi)| (samples.eval(wo, wi).x - metal.eval(wo, wi).x).abs()).sum::<f64>() / 1000.0
    };
    let errors = [30, 300, 3000].map(error);
    assert!(errors[1] < 0.6 * errors[0] && errors[2] < 0.6 * errors[1], "{errors:?}");
}

#[test]
fn errors_name_the_line_and_the_column() {
    let row = "10,0,20,30,0.1,0.2,0.3\n";
    assert!(load(&format!("{HEADER}{row}")).is_ok());
    for (text, parts) in [
        (String::new(), vec!["samples.csv:1", "the header"]),
        (HEADER.to_owned(), vec!["samples.csv", "no sample"]),
        (format!("theta,phi\n{row}"), vec!["samples.csv:1", "`theta,phi`"]),
        (format!("{HEADER}{row}10,0,20,30,0.1,0.2\n"), vec!["samples.csv:3", "6 columns"]),
        (format!("{HEADER}90,0,20,30,0.1,0.2,0.3\n"), vec!["samples.csv:2: wi_theta", "`90`", "from 0 to below 90"]),
        (format!("{HEADER}10,0,-1,30,0.1,0.2,0.3\n"), vec!["samples.csv:2: wo_theta", "`-1`"]),
        (format!("{HEADER}10,0,20,30,0.1,nan,0.3\n"), vec!["samples.csv:2: g", "`nan`"]),
        (format!("{HEADER}10,0,20,30,0.1,1,-0.3\n"), vec!["samples.csv:2: b", "`-0.3`"]),
        (format!("{HEADER}10,0,20,30,1e9,1,0\n"), vec!["samples.csv:2: r", "`1e9`"]),
        (HEADER.to_owned() + &row.repeat(Sparse::MOST_SAMPLES + 1), vec!["samples.csv:4098", "at most 4096"]),
    ] {
        let error = load(&text).unwrap_err();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
}
