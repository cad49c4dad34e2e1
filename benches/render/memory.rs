//! Memory against resolution: what holds paths must not grow, what holds pixels must.

use anyhow::Result;
use neubrdf::gpu::{DeviceChoice, Instance, Validation};
use neubrdf::render::{Options, Renderer, Settings};
use neubrdf::scene::Film;

use crate::cold::render;
use crate::cornell::MAX_DEPTH;

const MIB: f64 = 1024.0 * 1024.0;

pub fn run() -> Result<()> {
    let mut scene = crate::load("cornell")?;
    let device = Instance::new(Validation::Off)?.open(&DeviceChoice::Auto)?;
    let caches = tempfile::tempdir()?;
    println!("Cornell box, {}, depth {MAX_DEPTH}, no feature channels; MiB\n", device.driver());
    println!("| film | paths in flight | film | peak resident set of `neubrdf render --spp 1` |\n|---|---|---|---|");
    for side in [256, 512, 1024, 2048, 4096] {
        scene.film = Film { width: side, height: side };
        let settings = Settings { max_depth: MAX_DEPTH, features: false, ..Settings::default() };
        let renderer = Renderer::new(&device, &scene, &settings, &Options::default())?;
        let (size, depth) = (format!("{side}x{side}"), MAX_DEPTH.to_string());
        let arguments = ["--size", &size, "--spp", "1", "--max-depth", &depth, "--aov", "none"];
        let run = render(&crate::shipped("cornell"), &arguments, &caches)?;
        println!(
            "| {side}×{side} | {:.1} | {:.1} | {:.0} |",
            renderer.pool_bytes() as f64 / MIB,
            renderer.film_bytes() as f64 / MIB,
            run.peak_bytes as f64 / MIB
        );
    }
    Ok(())
}
