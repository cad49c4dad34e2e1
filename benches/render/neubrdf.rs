//! NeuBRDF evaluations a second of the device, of the paper's network: N_side 64, 16 features, 32 → 64 → 64 → 64 → 3.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use anyhow::{Context, Result};
use neubrdf::gpu::{Device, DeviceChoice, Instance, Validation};
use neubrdf::scene::brdf::{CornerWeights, NeuBrdf, Precision};

use crate::evaluations::{EVALUATIONS, Evaluations, rate_by_own_time};
use crate::measure::{Spread, Timing};
use crate::random_neubrdf::{Shape, random_neubrdf};

const ROUNDS: usize = 5;
/// Floating-point operations of an evaluation by Mitsuba's count: its network's multiply-adds.
const OPERATIONS: f64 = 2.0 * 10_432.0;

pub fn run() -> Result<()> {
    let device = Instance::new(Validation::Off)?.open(&DeviceChoice::Auto)?;
    println!("{}, {} evaluations; median (min–max) of {ROUNDS} runs\n", device.driver(), EVALUATIONS);
    println!("| model | first run, s | M/s | M/s by own CPU time | GFLOP/s by it |\n|---|---|---|---|---|");
    let full = Shape::FULL;
    let rows = [
        ("anisotropic, f32", full, Precision::F32),
        ("anisotropic, f16", full, Precision::F16),
        ("isotropic, f32", Shape { is_isotropic: true, is_pruned: true, ..full }, Precision::F32),
        ("anisotropic, f32, ¼ a corner", Shape { corner_weights: CornerWeights::Uniform, ..full }, Precision::F32),
        ("anisotropic, f32, 32 wide", Shape { hidden: &[32, 32, 32], ..full }, Precision::F32),
    ];
    for (name, shape, precision) in rows {
        measure(&device, name, &random_neubrdf(shape, 1), precision)?;
    }
    println!();
    peer()
}

fn measure(device: &Arc<Device>, name: &str, brdf: &NeuBrdf, precision: Precision) -> Result<()> {
    let evaluations = Evaluations::new(device, brdf, precision)?;
    let timings: Vec<Timing> = (0..ROUNDS).map(|_| evaluations.run()).collect::<Result<_>>()?;
    let wall = Spread::of(timings.iter().map(|timing| 1e-6 * EVALUATIONS as f64 / timing.seconds));
    let own = Spread::of(timings.iter().map(rate_by_own_time));
    let first = evaluations.first;
    println!("| {name} | {first:.2} | {wall:.2} | {own:.2} | {:.0} |", own.median * OPERATIONS * 1e-3);
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
