//! `neubrdf export`.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use neubrdf::converge::export_mitsuba;
use neubrdf::scene::Scene;

/// Write a scene for another renderer. What that renderer defines otherwise is an error.
#[derive(clap::Args)]
pub struct Arguments {
    /// A scene file (.toml) or a bare .obj
    scene: PathBuf,
    /// Directory for Mitsuba 3's scene.xml and its meshes
    #[arg(long, value_name = "DIRECTORY")]
    mitsuba: PathBuf,
    /// Path segments, as of `render`
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=65_535))]
    max_depth: u32,
}

/// Loads and writes.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    let (scene, warnings) = Scene::load(&arguments.scene)?;
    for warning in &warnings {
        eprintln!("warning: {warning}");
    }
    println!("{}", export_mitsuba(&scene, arguments.max_depth, &arguments.mitsuba)?.display());
    Ok(ExitCode::SUCCESS)
}
