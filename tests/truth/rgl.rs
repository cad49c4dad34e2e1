//! RGL tensor files: against the function that they were made of, and against Mitsuba.

use std::f64::consts::{PI, TAU};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use glam::DVec3;
use neubrdf::material::{Conductor, Evaluate};
use neubrdf::scene::{Brdf, Rgl};

use crate::common::tables::{self, metal};
use crate::random::Random;

fn isotropic() -> (Conductor, Rgl) {
    let metal = metal(0.3, 0.3);
    let truth = tables::rgl(&metal, vec![0.0], 32);
    (metal, truth)
}

/// Of the given symmetry.
fn anisotropic(reduction: u32) -> (Conductor, Rgl) {
    let metal = metal(0.25, 0.5);
    let steps = 32 / reduction;
    let phi = (0..=steps).map(|i| (-PI + TAU * f64::from(i) / 32.0) as f32).collect();
    let truth = tables::rgl(&metal, phi, 32);
    assert_eq!(truth.tables().reduction(), reduction);
    (metal, truth)
}

fn saved(truth: &Rgl, folder: &Path) -> Brdf {
    let path = folder.join("metal.bsdf");
    std::fs::write(&path, truth.tables().encode()).unwrap();
    Brdf::load(&path, None).unwrap()
}

#[test]
fn tables_are_the_function_that_they_were_made_of() {
    let folder = tempfile::tempdir().unwrap();
    for (metal, truth) in [isotropic(), anisotropic(1), anisotropic(2), anisotropic(4)] {
        let read = saved(&truth, folder.path());
        assert_eq!(read, Brdf::Rgl(truth.clone()));
        let mut random = Random(1);
        let (mut sum, mut worst) = (0.0, 0f64);
        const COUNT: u32 = 4000;
        for _ in 0..COUNT {
            let (wo, wi) = (random.above(0.2), random.above(0.2));
            let (found, expected) = (read.eval(wo, wi), metal.eval(wo, wi));
            let error = (found - expected).abs().max_element() / expected.max_element();
            sum += error;
            worst = worst.max(error);
        }
        let mean = sum / f64::from(COUNT);
        assert!(mean < 0.03 && worst < 0.4, "{} azimuths: mean {mean}, worst {worst}", truth.tables().phi.len());
    }
}

#[test]
fn mitsuba_gives_the_same_values() {
    let Some(python) = std::env::var_os("MITSUBA_PYTHON") else {
        return eprintln!("skipped: MITSUBA_PYTHON names no Python that has Mitsuba 3");
    };
    let folder = tempfile::tempdir().unwrap();
    for (_, truth) in [isotropic(), anisotropic(1), anisotropic(2), anisotropic(4)] {
        let read = saved(&truth, folder.path());
        let mut random = Random(2);
        let pairs: Vec<_> = (0..4000).map(|_| (random.above(0.02), random.above(0.02))).collect();
        let numbers = |(wo, wi): &(DVec3, DVec3)| format!("{} {} {} {} {} {}\n", wo.x, wo.y, wo.z, wi.x, wi.y, wi.z);
        let input: String = pairs.iter().map(numbers).collect();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/truth/measured.py");
        let mut child = Command::new(&python)
            .arg(script)
            .arg(folder.path().join("metal.bsdf"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap().unwrap();
        assert!(output.status.success(), "{python:?} failed");
        let output = String::from_utf8(output.stdout).unwrap();
        let mut worst = (0.0, String::new());
        let mut count = 0;
        for ((wo, wi), line) in pairs.iter().zip(output.lines()) {
            let theirs: Vec<f64> = line.split_whitespace().map(|number| number.parse().unwrap()).collect();
            let ours = read.eval(*wo, *wi) * wi.z;
            let error = (ours - DVec3::from_slice(&theirs)).abs().max_element() / ours.max_element();
            if error > worst.0 {
                worst = (error, format!("{ours}, not {theirs:?}: wo {wo} wi {wi}"));
            }
            count += 1;
        }
        assert_eq!(count, pairs.len());
        eprintln!("{} azimuths: worst relative difference {:.1e}", truth.tables().phi.len(), worst.0);
        assert!(worst.0 < 1e-3, "{}: {}", worst.0, worst.1);
    }
}
