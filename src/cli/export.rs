//! `neubrdf export`.

use std::ffi::OsStr;
use std::fs::create_dir_all;
use std::path::{Path, PathBuf, is_separator};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use neubrdf::converge::export_mitsuba;
use neubrdf::export::{Exported, Language, Place, Prefix, export};
use neubrdf::image::write_file;
use neubrdf::render::Settings;
use neubrdf::scene::Scene;
use neubrdf::scene::brdf::{NeuBrdf, NeuBrdfPack};

use super::job::{check_ending, check_outputs};

/// Write NeuBRDFs as a shader module and its data, or a scene for another renderer. What that renderer defines otherwise is an error.
#[derive(clap::Args)]
pub struct Arguments {
    /// .neubrdf files for --shader, which share a module, packs with all their materials; a scene file (.toml) or a bare .obj for --mitsuba
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Write a module with the functions neubrdf_eval, neubrdf_pdf and neubrdf_sample: glsl, wgsl, hlsl or msl
    #[arg(long, value_name = "LANGUAGE", required_unless_present = "mitsuba")]
    shader: Option<Language>,
    /// The module to write (.glsl, .wgsl, .hlsl or .metal), or a directory for it (made, if its name ends in a slash); its data and their
    /// description go beside it, .bin and .json behind the module's name
    #[arg(
        short,
        long,
        value_name = "PATH",
        requires = "shader",
        conflicts_with = "mitsuba",
        required_unless_present = "mitsuba"
    )]
    output: Option<PathBuf>,
    /// Descriptor set, bind group or register space of the data
    #[arg(long, default_value_t = 0, requires = "shader", conflicts_with = "mitsuba")]
    group: u32,
    /// Their binding, register or buffer index
    #[arg(long, default_value_t = 0, requires = "shader", conflicts_with = "mitsuba")]
    binding: u32,
    /// What all names of the module begin with, before an underscore: modules of different prefixes stand in one shader
    #[arg(long, value_name = "NAME", default_value_t, requires = "shader", conflicts_with = "mitsuba")]
    prefix: Prefix,
    /// Directory for Mitsuba 3's scene.xml and its meshes
    #[arg(long, value_name = "DIRECTORY", conflicts_with = "shader")]
    mitsuba: Option<PathBuf>,
    /// Path segments, as of `render`
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=i64::from(Settings::DEEPEST)), requires = "mitsuba")]
    max_depth: u32,
}

/// Loads and writes.
pub fn run(arguments: Arguments) -> Result<ExitCode> {
    match (&arguments.mitsuba, arguments.shader, &arguments.output) {
        (Some(directory), ..) => write_scene(&arguments, directory)?,
        (None, Some(language), Some(output)) => write_shader(&arguments, language, output)?,
        _ => bail!("nothing to write: say --shader LANGUAGE and -o PATH, or --mitsuba DIRECTORY"),
    }
    Ok(ExitCode::SUCCESS)
}

fn write_scene(arguments: &Arguments, directory: &Path) -> Result<()> {
    let [scene] = &arguments.inputs[..] else { bail!("--mitsuba writes one scene, not {}", arguments.inputs.len()) };
    let (scene, warnings) = Scene::load(scene)?;
    for warning in &warnings {
        note!("warning: {warning}");
    }
    tell!("{}", export_mitsuba(&scene, arguments.max_depth, directory)?.display())?;
    Ok(())
}

fn write_shader(arguments: &Arguments, language: Language, output: &Path) -> Result<()> {
    let mut models = Vec::new();
    for path in &arguments.inputs {
        let file = stem(path)?;
        let named = |(name, brdf): (String, NeuBrdf)| (if name.is_empty() { file.clone() } else { name }, brdf);
        models.extend(NeuBrdfPack::load(path)?.materials.into_iter().map(named));
    }
    let place = Place { group: arguments.group, binding: arguments.binding };
    let exported = export(&models, language, place, &arguments.prefix)?;

    let module = module_path(&arguments.inputs, language, output)?;
    check_ending(&module, &[language.extension()])?;
    // Behind the whole name: X.bin would be that of X in each language, and X.json is the report of a training.
    let [data, description] = ["bin", "json"].map(|ending| {
        let mut path = module.clone().into_os_string();
        path.push(format!(".{ending}"));
        PathBuf::from(path)
    });
    check_outputs([&module, &data, &description].map(PathBuf::as_path), arguments.inputs.iter().map(PathBuf::as_path))?;
    let description_text =
        format!("{:#}\n", describe(&exported, language, place, &arguments.prefix, [&module, &data])?);
    for (path, bytes) in [
        (&data, exported.bytes()),
        (&description, description_text.into_bytes()),
        (&module, exported.shader.into_bytes()),
    ] {
        write_file(path, bytes)?;
        tell!("{}", path.display())?;
    }
    Ok(())
}

/// The file of the module: `output`, or in that directory one that is named as the first input. A name that ends in a slash can only be a
/// directory's: it is made.
fn module_path(inputs: &[PathBuf], language: Language, output: &Path) -> Result<PathBuf> {
    if output.to_string_lossy().ends_with(is_separator) {
        create_dir_all(output).with_context(|| format!("{}: the directory cannot be made", output.display()))?;
    }
    Ok(match inputs {
        [first, ..] if output.is_dir() => output.join(format!("{}.{}", stem(first)?, language.extension())),
        _ => output.to_owned(),
    })
}

fn stem(path: &Path) -> Result<String> {
    let stem = path.file_stem().with_context(|| format!("{} names no file", path.display()))?;
    Ok(stem.to_string_lossy().into_owned())
}

/// What stands in the .json.
fn describe(
    exported: &Exported,
    language: Language,
    place: Place,
    prefix: &Prefix,
    [module, data]: [&Path; 2],
) -> Result<serde_json::Value> {
    let name = |path: &Path| path.file_name().map(OsStr::to_string_lossy).unwrap_or_default().into_owned();
    Ok(serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"),
        "language": language,
        "module": name(module),
        "data": name(data),
        "bytes": 4 * exported.data.len(),
        "layout": "32-bit words, little-endian, in one read-only storage buffer",
        "group": place.group,
        "binding": place.binding,
        "prefix": prefix,
        "precision": exported.precision,
        "models": exported.models,
    }))
}
