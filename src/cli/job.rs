//! What both renderers are asked: a scene, a part of its film, and the files to write.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use neubrdf::image::{Crop, Metadata, Picture, write_exr, write_png};
use neubrdf::scene::{Film, Scene};

/// The arguments that `render` and `reference` share.
#[derive(clap::Args)]
pub struct Job {
    /// A scene file (.toml) or a bare .obj
    pub scene: PathBuf,
    /// The EXR to write: beauty, variance, sample count and feature channels
    #[arg(short, long, value_name = "EXR")]
    pub output: Option<PathBuf>,
    /// A tone-mapped PNG to write
    #[arg(long, value_name = "PNG")]
    pub png: Option<PathBuf>,
    /// Exposure of the PNG, in stops
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub exposure: f32,
    /// Size of the film instead of the scene's, as WIDTHxHEIGHT
    #[arg(long, value_name = "WxH", value_parser = film_size)]
    pub size: Option<Film>,
    /// Render a part of the film: x,y,width,height
    #[arg(long)]
    pub crop: Option<Crop>,
    /// Path segments: 1 sees emission, 2 adds direct light
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=65_535))]
    pub max_depth: u32,
    /// No bar and no warnings
    #[arg(long)]
    pub quiet: bool,
}

impl Job {
    /// Loads the scene and prints its warnings, once it is clear that there is something to write and where.
    pub fn load(&self) -> Result<Scene> {
        if self.output.is_none() && self.png.is_none() {
            bail!("nothing to write: say -o PICTURE.exr, --png PICTURE.png, or both");
        }
        for path in [&self.output, &self.png].into_iter().flatten() {
            check_writable(path)?;
        }
        let (mut scene, warnings) = Scene::load(&self.scene)?;
        if !self.quiet {
            for warning in &warnings {
                eprintln!("warning: {warning}");
            }
        }
        scene.film = self.size.unwrap_or(scene.film);
        Ok(scene)
    }

    /// Writes what was asked for.
    pub fn write(&self, picture: &Picture, metadata: &Metadata) -> Result<()> {
        if let Some(path) = &self.output {
            write_exr(path, picture, metadata)?;
        }
        if let Some(path) = &self.png {
            write_png(path, picture, self.exposure)?;
        }
        Ok(())
    }
}

/// A film from `WIDTHxHEIGHT`.
pub fn film_size(word: &str) -> Result<Film, String> {
    word.split_once('x')
        .and_then(|(width, height)| Some(Film { width: width.parse().ok()?, height: height.parse().ok()? }))
        .filter(|film| film.width > 0 && film.height > 0)
        .ok_or_else(|| format!("'{word}' is no size: expected WIDTHxHEIGHT in pixels, both at least 1"))
}

/// Errors where a file could not be written after hours of work, before them.
pub fn check_writable(path: &Path) -> Result<()> {
    let directory = path.parent().filter(|directory| !directory.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !directory.is_dir() {
        bail!("{}: cannot be written: there is no directory {}", path.display(), directory.display());
    }
    if path.is_dir() {
        bail!("{}: cannot be written: it is a directory", path.display());
    }
    Ok(())
}
