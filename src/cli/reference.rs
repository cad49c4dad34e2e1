//! `neubrdf reference`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use neubrdf::image::{Crop, write_exr, write_png};
use neubrdf::reference::{Reference, ReferenceOptions};
use neubrdf::scene::{Film, Scene};

use super::progress;

/// Path trace a scene on the CPU with Embree.
#[derive(clap::Args)]
pub struct Arguments {
    /// A scene file (.toml) or a bare .obj
    scene: PathBuf,
    /// The EXR to write
    #[arg(short, long, value_name = "EXR")]
    output: Option<PathBuf>,
    /// A tone-mapped PNG to write
    #[arg(long, value_name = "PNG")]
    png: Option<PathBuf>,
    /// Exposure of the PNG, in stops
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    exposure: f32,
    /// Samples a pixel
    #[arg(long, default_value_t = 64)]
    spp: u32,
    /// Size of the film instead of the scene's, as WIDTHxHEIGHT
    #[arg(long, value_name = "WxH", value_parser = super::film_size)]
    size: Option<Film>,
    /// Render a part of the film: x,y,width,height
    #[arg(long)]
    crop: Option<Crop>,
    /// Another seed gives independent noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Path segments: 1 sees emission, 2 adds direct light
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=65_535))]
    max_depth: u32,
    /// No bar and no warnings
    #[arg(long)]
    quiet: bool,
}

/// Loads, renders, writes.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    if arguments.output.is_none() && arguments.png.is_none() {
        bail!("nothing to write: say -o PICTURE.exr, --png PICTURE.png, or both");
    }
    for path in [&arguments.output, &arguments.png].into_iter().flatten() {
        super::check_writable(path)?;
    }
    let scene: Scene = super::load(&arguments.scene, arguments.size, arguments.quiet)?;
    let options = ReferenceOptions {
        spp: arguments.spp,
        seed: arguments.seed,
        max_depth: arguments.max_depth,
        crop: arguments.crop,
    };
    let reference = Reference::new(&scene)?;
    let interrupted = progress::interrupt_flag()?;
    let bar = progress::bar(progress::STEPS, arguments.quiet);
    let (picture, statistics) =
        reference.render(&options, |part| bar.set_position((part * progress::STEPS as f64) as u64), &interrupted)?;
    bar.finish();
    let mut metadata = reference.metadata(&options, &statistics);
    metadata.scene_hash = scene.hash();
    if let Some(path) = &arguments.output {
        write_exr(path, &picture, &metadata)?;
    }
    if let Some(path) = &arguments.png {
        write_png(path, &picture, arguments.exposure)?;
    }
    if !arguments.quiet {
        eprintln!(
            "{} spp in {:.1} s, {:.2} Msamples/s",
            statistics.least_spp,
            statistics.seconds,
            statistics.samples as f64 * 1e-6 / statistics.seconds.max(1e-9)
        );
    }
    Ok(ExitCode::SUCCESS)
}
