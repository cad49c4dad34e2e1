//! `neubrdf reference`.

use std::process::ExitCode;

use anyhow::Result;
use neubrdf::reference::{Reference, ReferenceOptions};

use super::job::Job;
use super::progress;

/// Path trace a scene on the CPU with Embree.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    job: Job,
    /// Samples a pixel
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
    /// Another seed gives independent noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Loads, renders, writes.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    let scene = arguments.job.load(None)?;
    let options = ReferenceOptions {
        spp: arguments.spp,
        seed: arguments.seed,
        max_depth: arguments.job.max_depth,
        crop: arguments.job.crop,
    };
    let reference = Reference::new(&scene)?;
    let interrupted = progress::interrupt_flag()?;
    let bar = progress::bar(progress::STEPS, arguments.job.quiet);
    let (picture, statistics) =
        reference.render(&options, |part| bar.set_position((part * progress::STEPS as f64) as u64), &interrupted)?;
    bar.finish();
    let mut metadata = reference.metadata(&options, &statistics);
    metadata.scene_hash = scene.hash();
    arguments.job.write(&picture, &metadata)?;
    if !arguments.job.quiet {
        let interrupted = if statistics.least_spp < arguments.spp { "interrupted: " } else { "" };
        note!(
            "{interrupted}{} spp in {:.1} s, {:.2} Msamples/s",
            statistics.least_spp,
            statistics.seconds,
            statistics.samples as f64 * 1e-6 / statistics.seconds.max(1e-9)
        );
    }
    Ok(ExitCode::SUCCESS)
}
