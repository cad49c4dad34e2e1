//! `make gallery`: the materials that are shipped on the preview scene's ball, each as it is simulated, and below it as its NeuBRDF says.
//!
//! Pairs go by name from the left to the right, five to a row of pairs. Writes target/gallery/materials.png and prints how far the
//! two pictures of each pair are from one another.

mod study;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result};
use clap::Parser;
use neubrdf::gpu::{Device, DeviceChoice, Instance, Validation};
use neubrdf::image::{Picture, plane, tone_map, write_rgb8};
use neubrdf::render::{Options, Renderer, Settings};
use neubrdf::scene::{Film, Scene, Surface};

/// Render the gallery of materials.
#[derive(Parser)]
struct Arguments {
    /// Pixels to a side of each picture
    #[arg(long, default_value_t = 192)]
    side: u32,
    #[arg(long, default_value_t = 512)]
    spp: u32,
    #[arg(short, long, default_value = "target/gallery/materials.png")]
    output: PathBuf,
}

/// Pairs of a row.
const COLUMNS: usize = 5;

/// Samples a pixel between two moves of the bar.
const PASS: u32 = 32;

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut scene = Scene::load(scenes.join("preview/neural.toml"))?.0;
    scene.film = Film { width: arguments.side, height: arguments.side };
    let mut models = Vec::new();
    for entry in std::fs::read_dir(scenes.join("materials"))? {
        let path = entry?.path();
        models.extend(path.extension().is_some_and(|ending| ending == "neubrdf").then_some(path));
    }
    models.sort();
    let device = Instance::new(Validation::Off)?.open(&DeviceChoice::Auto)?;
    let bar = study::bar(models.len() * 2 * arguments.spp.div_ceil(PASS) as usize)?;
    let mut rows = vec![Vec::new(); models.len().div_ceil(COLUMNS) * 2];
    println!("| material | mean difference | root mean square |\n|---|---|---|");
    for (place, model) in models.iter().enumerate() {
        let mut pictures = Vec::new();
        for (row, file) in [model.with_extension("toml"), model.clone()].into_iter().enumerate() {
            bar.set_message(file.file_name().unwrap_or_default().to_string_lossy().into_owned());
            let picture = render(&device, &with_ball(&scene, &file)?, arguments.spp, &bar)?;
            rows[place / COLUMNS * 2 + row].push(beauty(&picture)?);
            pictures.push(beauty(&picture)?);
        }
        let name = model.file_stem().unwrap_or_default().to_string_lossy();
        let [mean, square] = differences(&pictures[0], &pictures[1]);
        bar.suspend(|| println!("| {name} | {:+.2} % | {:.2} % |", 100.0 * mean, 100.0 * square));
    }
    bar.finish_and_clear();
    let pixels = tone_map::to_srgb8(&tiled(&rows, arguments.side as usize), 0.0);
    let (columns, side) = (models.len().min(COLUMNS) as u32, arguments.side);
    arguments.output.parent().map_or(Ok(()), std::fs::create_dir_all)?;
    write_rgb8(&arguments.output, columns * side, rows.len() as u32 * side, &pixels)?;
    eprintln!("{}", arguments.output.display());
    Ok(())
}

/// The scene with the material of a file on its ball.
fn with_ball(scene: &Scene, file: &Path) -> Result<Scene> {
    let mut scene = scene.clone();
    let (mut surface, brdfs, _) = Surface::load(file, None)?;
    if let Surface::Measured { brdf } = &mut surface {
        *brdf += scene.brdfs.len() as u32;
    }
    scene.brdfs.extend(brdfs);
    let ball = scene.materials.iter_mut().find(|material| material.name == "ball").context("the scene has no ball")?;
    ball.surface = surface;
    Ok(scene)
}

fn render(device: &Arc<Device>, scene: &Scene, spp: u32, bar: &indicatif::ProgressBar) -> Result<Picture> {
    let settings = Settings { max_depth: 8, features: false, ..Settings::default() };
    let mut renderer = Renderer::new(device, scene, &settings, &Options::default())?;
    while renderer.samples() < spp {
        renderer.render_pass(PASS.min(spp - renderer.samples()))?;
        bar.inc(1);
    }
    Ok(renderer.picture()?.0)
}

fn beauty(picture: &Picture) -> Result<Vec<[f32; 3]>> {
    picture.rgb(plane::BEAUTY).context("a picture without beauty")
}

/// Of `b` from `a`, in parts of the mean of `a`: mean, and root mean square.
fn differences(a: &[[f32; 3]], b: &[[f32; 3]]) -> [f64; 2] {
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| of(f64::from(*a), f64::from(*b))).sum()
    };
    let (count, total) = (3.0 * a.len() as f64, sum(&|a, _| a));
    [sum(&|a, b| b - a) / total, (sum(&|a, b| (b - a).powi(2)) * count).sqrt() / total]
}

/// Rows of square pictures as one; where a row is shorter than the first it is black.
fn tiled(rows: &[Vec<Vec<[f32; 3]>>], side: usize) -> Vec<[f32; 3]> {
    let columns = rows.first().map_or(0, Vec::len);
    let mut pixels = Vec::new();
    for pictures in rows {
        for y in 0..side {
            for column in 0..columns {
                match pictures.get(column) {
                    Some(picture) => pixels.extend_from_slice(&picture[y * side..][..side]),
                    None => pixels.extend(std::iter::repeat_n([0.0; 3], side)),
                }
            }
        }
    }
    pixels
}
