//! What both renderers are asked: a scene, a part of its film, and the files to write.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use neubrdf::image::tone_map::MOST_EXPOSURE;
use neubrdf::image::{Crop, Metadata, Picture, check_writable, write_exr, write_png};
use neubrdf::render::Settings;
use neubrdf::scene::{Film, Scene, named_files};

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
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true, requires = "png", value_parser = exposure)]
    pub exposure: f32,
    /// Size of the film instead of the scene's, as WIDTHxHEIGHT
    #[arg(long, value_name = "WxH", value_parser = film_size)]
    pub size: Option<Film>,
    /// Render a part of the film: x,y,width,height
    #[arg(long)]
    pub crop: Option<Crop>,
    /// Path segments: 1 sees emission, 2 adds direct light
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=i64::from(Settings::DEEPEST)))]
    pub max_depth: u32,
    /// No bar and no warnings
    #[arg(long)]
    pub quiet: bool,
}

impl Job {
    /// Loads the scene and prints its warnings, once it is clear that there is something to write and where; `checkpoint` is written too.
    pub fn load(&self, checkpoint: Option<&Path>) -> Result<Scene> {
        let (output, png) = (self.output.as_deref(), self.png.as_deref());
        if output.is_none() && png.is_none() {
            bail!("nothing to write: say -o PICTURE.exr, --png PICTURE.png, or both");
        }
        output.map_or(Ok(()), |path| check_ending(path, &["exr"]))?;
        png.map_or(Ok(()), |path| check_ending(path, &["png"]))?;
        let outputs = || [output, png, checkpoint].into_iter().flatten();
        check_outputs(outputs(), [self.scene.as_path()])?;
        let (mut scene, warnings, files) = Scene::load_with_files(&self.scene)?;
        // Those, too, that only its meshes and their materials name.
        check_outputs(outputs(), files.iter().map(PathBuf::as_path))?;
        if !self.quiet {
            for warning in &warnings {
                note!("warning: {warning}");
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
        .filter(|film| [film.width, film.height].iter().all(|side| (1..=Film::LONGEST_SIDE).contains(side)))
        .ok_or_else(|| {
            format!("'{word}' is no size: expected WIDTHxHEIGHT in pixels, both from 1 to {}", Film::LONGEST_SIDE)
        })
}

/// Stops that leave something to be seen.
pub fn exposure(word: &str) -> Result<f32, String> {
    word.parse()
        .ok()
        .filter(|stops: &f32| stops.abs() <= MOST_EXPOSURE)
        .ok_or_else(|| format!("'{word}' is no exposure: expected stops from -{MOST_EXPOSURE} to {MOST_EXPOSURE}"))
}

/// What is neither finite nor at least 0 could never be exceeded, or always.
pub fn threshold(word: &str) -> Result<f64, String> {
    word.parse()
        .ok()
        .filter(|number: &f64| number.is_finite() && *number >= 0.0)
        .ok_or_else(|| format!("'{word}' is no threshold: expected a number of at least 0"))
}

/// A file that is to be written ends as what it will be.
pub fn check_ending(path: &Path, endings: &[&str]) -> Result<()> {
    let is_one = |ending: &str| endings.iter().any(|known| ending.eq_ignore_ascii_case(known));
    if !path.extension().and_then(|ending| ending.to_str()).is_some_and(is_one) {
        bail!("{}: the file to write must end in .{}", path.display(), endings.join(" or ."));
    }
    Ok(())
}

/// Tells before hours of work what would go wrong after them: files that cannot be written, and files that would replace one another, an
/// input, or what that names.
pub fn check_outputs<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<()> {
    let mut taken = Vec::new();
    for input in inputs {
        taken.push(place(input));
        taken.extend(named_files(input).iter().map(|file| place(file)));
    }
    for path in outputs {
        let place = place(&check_writable(path).context("cannot be written")?);
        if taken.contains(&place) {
            bail!("{}: it would replace what is read, or be written twice: give it another name", path.display());
        }
        taken.push(place);
    }
    Ok(())
}

/// One name for each file, whether it is there already or not.
fn place(path: &Path) -> PathBuf {
    let beside = || Some(path.parent()?.join(".").canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(beside).unwrap_or_else(|| path.to_owned())
}
