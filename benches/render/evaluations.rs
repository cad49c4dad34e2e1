//! A NeuBRDF or an NBRDF on the device, evaluated at many pairs of directions: what the bench and the study of models time.

use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result};
use glam::DVec3;
use neubrdf::converge::{Stopwatch, Timing, cores, warm_up};
use neubrdf::gpu::{Buffer, Commands, Device, Kernel, Memory, spirv};
use neubrdf::render::{NeuBrdfPush, NeuBrdfQuery, NeuBrdfShape, NeuBrdfValues, pack_nbrdf, pack_neubrdf};
use neubrdf::scene::brdf::{Nbrdf, NeuBrdf, Precision};

/// Pairs of evaluations of a run: on a CPU, and on a GPU.
const PAIRS: [usize; 2] = [1 << 17, 1 << 22];

pub struct Evaluations {
    device: Arc<Device>,
    kernel: Kernel,
    push: NeuBrdfPush,
    /// What the push constants point to.
    _buffers: [Buffer; 3],
    /// Seconds that building the kernel and a first run took.
    #[allow(dead_code)] // the study asks for rates alone
    pub first: f64,
}

impl Evaluations {
    pub fn new(device: &Arc<Device>, brdf: &NeuBrdf, precision: Precision) -> Result<Evaluations> {
        let shape = NeuBrdfShape::of([brdf], precision).on(device);
        Self::by(device, "eval_neubrdf", &pack_neubrdf(brdf, &shape), &shape.specialization())
    }

    #[allow(dead_code)] // the study has no NBRDF
    pub fn nbrdf(device: &Arc<Device>, nbrdf: &Nbrdf) -> Result<Evaluations> {
        Self::by(device, "eval_nbrdf", bytemuck::cast_slice(&pack_nbrdf(nbrdf)), &[])
    }

    /// By a kernel that reads a model of these words.
    fn by(device: &Arc<Device>, kernel: &str, words: &[u32], constants: &[(u32, u32)]) -> Result<Evaluations> {
        // A Kronecker sequence of the plastic number's kin, three directions a query.
        let direction = |i: usize| {
            let at = |step: f64| (0.5 + step * i as f64).fract();
            let (z, azimuth) = (at(0.754_877_666_246_693), std::f64::consts::TAU * at(0.569_840_290_998_053));
            let rho = (1.0 - z * z).sqrt();
            DVec3::new(rho * azimuth.cos(), rho * azimuth.sin(), z).as_vec3().to_array()
        };
        let query = |i: usize| NeuBrdfQuery {
            wo: direction(3 * i),
            wi_1: direction(3 * i + 1),
            wi_2: direction(3 * i + 2),
            ..Default::default()
        };
        let pairs = PAIRS[usize::from(!device.profile().is_cpu)];
        let queries: Vec<NeuBrdfQuery> = (0..pairs).map(query).collect();
        let table = Buffer::with_data(device, "table", words)?;
        let input = Buffer::with_data(device, "queries", &queries)?;
        let output = Buffer::new(device, "values", (size_of::<NeuBrdfValues>() * pairs) as u64, Memory::Device)?;
        let push = NeuBrdfPush {
            table: table.address(),
            queries: input.address(),
            results: output.address(),
            count: pairs as u32,
            padding: 0,
        };
        let started = Instant::now();
        let source = spirv::load(kernel).with_context(|| format!("no kernel {kernel}"))?;
        let kernel = Kernel::new(device, source, constants)?;
        let _buffers = [table, input, output];
        let mut evaluations = Evaluations { device: device.clone(), kernel, push, _buffers, first: 0.0 };
        evaluations.run()?;
        evaluations.first = started.elapsed().as_secs_f64();
        Ok(evaluations)
    }

    /// Times so many runs, at the pace that the device keeps.
    pub fn timings(&self, runs: usize) -> Result<Vec<Timing>> {
        warm_up(self.device.profile(), || self.run().map(drop))?;
        (0..runs).map(|_| self.run()).collect()
    }

    /// Evaluations of a run.
    fn count(&self) -> usize {
        2 * self.push.count as usize
    }

    /// Evaluates all.
    pub fn run(&self) -> Result<Timing> {
        let watch = Stopwatch::own();
        let mut commands = Commands::begin(&self.device)?;
        commands.dispatch(&self.kernel, self.kernel.groups_for(self.push.count), &self.push);
        self.device.submit(commands)?.wait()?;
        Ok(watch.stop())
    }

    /// Million evaluations a second on the clock.
    pub fn rate(&self, timing: &Timing) -> f64 {
        1e-6 * self.count() as f64 / timing.seconds
    }

    /// Million evaluations a second of the device if it had nothing else to do: where it is the CPU, by the process's own time, as if it had
    /// all cores for itself.
    pub fn own_rate(&self, timing: &Timing) -> f64 {
        match self.device.profile().is_cpu {
            true => 1e-6 * self.count() as f64 * cores() as f64 / timing.cpu_seconds,
            false => self.rate(timing),
        }
    }
}
