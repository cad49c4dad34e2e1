//! NeuBRDF evaluations a second of the device, of the paper's network: N_side 64, 16 features, 32 → 64 → 64 → 64 → 3.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result};
use neubrdf::gpu::{Buffer, Commands, Device, DeviceChoice, Instance, Kernel, Memory, Validation, spirv};
use neubrdf::render::{NeuBrdfPush, NeuBrdfQuery, NeuBrdfShape, NeuBrdfValues, pack_neubrdf};
use neubrdf::scene::brdf::{CornerWeights, NeuBrdf, Precision};

use crate::measure::{Spread, Stopwatch, cores};
use crate::random_neubrdf::{Shape, Stream, random_neubrdf};

/// Pairs of evaluations of a run.
const PAIRS: usize = 1 << 17;
const ROUNDS: usize = 5;
/// Floating-point operations of an evaluation by Mitsuba's count: its network's multiply-adds.
const OPERATIONS: f64 = 2.0 * 10_432.0;

pub fn run() -> Result<()> {
    let device = Instance::new(Validation::Off)?.open(&DeviceChoice::Auto)?;
    println!("{}, {} evaluations; median (min–max) of {ROUNDS} runs\n", device.driver(), 2 * PAIRS);
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
    let shape = NeuBrdfShape::of([brdf], precision).on(device);
    let mut random = Stream(3);
    let mut direction = || random.direction().as_vec3().to_array();
    let queries: Vec<NeuBrdfQuery> =
        (0..PAIRS).map(|_| NeuBrdfQuery { wo: direction(), wi_1: direction(), wi_2: direction() }).collect();
    let table = Buffer::with_data(device, "table", &pack_neubrdf(brdf, &shape))?;
    let input = Buffer::with_data(device, "queries", &queries)?;
    let output = Buffer::new(device, "values", (size_of::<NeuBrdfValues>() * PAIRS) as u64, Memory::Device)?;
    let push = NeuBrdfPush {
        table: table.address(),
        queries: input.address(),
        results: output.address(),
        count: PAIRS as u32,
        padding: 0,
    };
    let started = Instant::now();
    let source = spirv::load("eval_neubrdf").context("no kernel eval_neubrdf")?;
    let kernel = Kernel::new(device, source, &shape.specialization())?;
    let run = || -> Result<()> {
        let mut commands = Commands::begin(device)?;
        commands.dispatch(&kernel, kernel.groups_for(push.count), &push);
        device.submit(commands)?.wait()?;
        Ok(())
    };
    run()?;
    let first = started.elapsed().as_secs_f64();
    let (mut wall, mut own) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let watch = Stopwatch::own();
        run()?;
        let timing = watch.stop();
        let rate = |seconds: f64| 2e-6 * PAIRS as f64 / seconds;
        wall.push(rate(timing.seconds));
        own.push(rate(timing.cpu_seconds / cores() as f64));
    }
    let own = Spread::of(own);
    println!("| {name} | {first:.2} | {:.2} | {own:.2} | {:.0} |", Spread::of(wall), own.median * OPERATIONS * 1e-3);
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
