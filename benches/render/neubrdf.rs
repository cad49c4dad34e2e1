//! NeuBRDF evaluations a second of the device, of the default's sizes and of the paper's network (N_side 64, 16 features, 32 → 64 → 64 → 64 → 3),
//! beside an NBRDF's.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use neubrdf::gpu::{DeviceChoice, Instance, Validation};
use neubrdf::scene::brdf::{CornerWeights, Nbrdf, Precision};

use crate::evaluations::Evaluations;
use crate::measure::Spread;
use crate::random_neubrdf::{Shape, random_neubrdf};

const ROUNDS: usize = 5;

pub fn run() -> Result<()> {
    let device = Instance::new(Validation::Off)?.open(&DeviceChoice::Auto)?;
    println!("{}, {}; median (min–max) of {ROUNDS} runs\n", device.name(), device.driver());
    println!("| model | first run, s | M/s | M/s by own CPU time |\n|---|---|---|---|");
    let full = Shape::FULL;
    let default = Shape {
        n_side: 16,
        codes: 1569,
        features: 4,
        resolutions: 3,
        sees_half_vector: true,
        hidden: &[32; 3],
        ..full
    };
    let isotropic = Shape { is_isotropic: true, is_pruned: true, features: 8, resolutions: 1, ..default };
    let rows = [
        ("the default's sizes, isotropic, f16", isotropic, Precision::F16),
        ("the default's sizes, anisotropic, f16", default, Precision::F16),
        ("the default's sizes, anisotropic, f32", default, Precision::F32),
        ("one resolution of 12 features, f16", Shape { features: 12, resolutions: 1, ..default }, Precision::F16),
        ("without the half vector, f16", Shape { sees_half_vector: false, ..default }, Precision::F16),
        ("the default's sizes, anisotropic, f16, 16 wide", Shape { hidden: &[16; 3], ..default }, Precision::F16),
        ("the default's sizes, anisotropic, f16, 48 wide", Shape { hidden: &[48; 3], ..default }, Precision::F16),
        ("the default's sizes, anisotropic, f16, 64 wide", Shape { hidden: &[64; 3], ..default }, Precision::F16),
        ("anisotropic, f32", full, Precision::F32),
        ("anisotropic, f16", full, Precision::F16),
        ("isotropic, f32", Shape { is_isotropic: true, is_pruned: true, ..full }, Precision::F32),
        ("anisotropic, f32, ¼ a corner", Shape { corner_weights: CornerWeights::Uniform, ..full }, Precision::F32),
        ("anisotropic, f32, 32 wide", Shape { hidden: &[32, 32, 32], ..full }, Precision::F32),
    ];
    for (name, shape, precision) in rows {
        measure(name, &Evaluations::new(&device, &random_neubrdf(shape, 1), precision)?)?;
    }
    // Numbers do not matter to its time.
    let nbrdf = Nbrdf {
        kernel_1: [[0.1; Nbrdf::HIDDEN]; Nbrdf::INPUTS],
        bias_1: [0.1; Nbrdf::HIDDEN],
        kernel_2: [[0.1; Nbrdf::HIDDEN]; Nbrdf::HIDDEN],
        bias_2: [0.1; Nbrdf::HIDDEN],
        kernel_3: [[0.1; 3]; Nbrdf::HIDDEN],
        bias_3: [0.1; 3],
    };
    measure("NBRDF, 6 → 21 → 21 → 3, f32", &Evaluations::nbrdf(&device, &nbrdf)?)?;
    println!();
    peer()
}

fn measure(name: &str, evaluations: &Evaluations) -> Result<()> {
    let timings = evaluations.timings(ROUNDS)?;
    let wall = Spread::of(timings.iter().map(|timing| evaluations.rate(timing)));
    let own = Spread::of(timings.iter().map(|timing| evaluations.own_rate(timing)));
    let first = evaluations.first;
    println!("| {name} | {first:.2} | {wall:.2} | {own:.2} |");
    Ok(())
}

/// The same in Mitsuba, with weights as literals.
fn peer() -> Result<()> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/peers/mitsuba_neubrdf.py");
    let Some(python) = std::env::var_os("MITSUBA_PYTHON") else {
        println!("Mitsuba: skipped. To compare, set MITSUBA_PYTHON to a python that has it.");
        return Ok(());
    };
    if !script.exists() {
        println!("Mitsuba: skipped, as {} is missing.", script.display());
        return Ok(());
    }
    let status = Command::new(&python).arg(&script).args(["unroll", "micro"]).status();
    let status = status.with_context(|| format!("cannot start MITSUBA_PYTHON={}", python.display()))?;
    anyhow::ensure!(status.success(), "{} failed: {status}", script.display());
    Ok(())
}
