//! What a render costs: `cargo bench --features embree --bench render -- [SECTION]...`
//!
//! Sections: `cornell`, `passes`, `cold`, `memory` (these four without an argument), `neubrdf`, and `error` and `sphere`, which render references
//! of thousands of samples a pixel (kept in target/bench; REFERENCE_SPP says how many, 4096 otherwise; SEEDS how many renders, 3 otherwise). Tables go to standard output, in Markdown; docs/performance.md explains them.

mod ball;
mod cold;
mod cornell;
#[cfg(feature = "embree")]
mod error;
mod evaluations;
mod measure;
mod memory;
mod neubrdf;
mod passes;
mod peer;
#[path = "../../tests/common/random_neubrdf.rs"]
mod random_neubrdf;
#[cfg(feature = "embree")]
mod sphere;

use std::path::{Path, PathBuf};

use ::neubrdf::gpu::{Device, Instance, Validation};
use ::neubrdf::scene::{Film, Scene};
use anyhow::{Result, bail};

/// What runs when nothing is asked for.
const QUICK: [&str; 4] = ["cornell", "passes", "cold", "memory"];

fn main() -> Result<()> {
    // Cargo itself passes `--bench`.
    let asked: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let sections = match asked.is_empty() {
        true => QUICK.map(String::from).to_vec(),
        false => asked,
    };
    print_machine()?;
    for section in &sections {
        println!("\n## {section}\n");
        match section.as_str() {
            "cornell" => cornell::run()?,
            "passes" => passes::run()?,
            "cold" => cold::run()?,
            "memory" => memory::run()?,
            "neubrdf" => neubrdf::run()?,
            #[cfg(feature = "embree")]
            "error" => error::run()?,
            #[cfg(feature = "embree")]
            "sphere" => sphere::run()?,
            #[cfg(not(feature = "embree"))]
            "error" | "sphere" => bail!("section {section} needs the Embree reference: cargo bench --features embree"),
            _ => {
                bail!("no section '{section}': expected some of cornell, error, passes, cold, memory, neubrdf, sphere")
            }
        }
    }
    Ok(())
}

/// A scene that we ship.
fn shipped(name: &str) -> PathBuf {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let named_alike = directory.join(format!("{name}.toml"));
    if named_alike.exists() { named_alike } else { directory.join("scene.toml") }
}

fn load(name: &str) -> Result<Scene> {
    Ok(Scene::load(shipped(name))?.0)
}

/// What is rendered to take times: more on a GPU, so that it does not just wait for its host.
fn film(device: &Device) -> Film {
    let size = if device.profile().is_cpu { 256 } else { 1024 };
    Film { width: size, height: size }
}

fn print_machine() -> Result<()> {
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let cpu =
        cpu.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": ")).map_or("?", |(_, name)| name);
    println!("{cpu}, {} threads; load average at the start {}", measure::cores(), measure::load_average());
    for report in Instance::new(Validation::Off)?.devices()? {
        println!("- device {}: {}, {}", report.index, report.name, report.driver);
    }
    Ok(())
}
