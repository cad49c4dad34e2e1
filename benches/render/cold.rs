//! The first picture on a machine that never compiled our shaders: the program itself, from start to file.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use tempfile::TempDir;

use crate::measure::{Spread, bar};

const ROUNDS: usize = 3;

/// What a run of the program took.
pub struct Run {
    pub seconds: f64,
    /// Its greatest resident set, bytes.
    pub peak_bytes: u64,
}

/// Runs `neubrdf render` with its caches in `caches`, to a file in there.
pub fn render(scene: &Path, arguments: &[&str], caches: &TempDir) -> Result<Run> {
    let at = |name: &str| -> PathBuf { caches.path().join(name) };
    let started = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_neubrdf"))
        .arg("render")
        .arg(scene)
        .arg("-o")
        .arg(at("picture.exr"))
        .arg("--quiet")
        .args(arguments)
        .env("XDG_CACHE_HOME", at("cache"))
        .env("MESA_SHADER_CACHE_DIR", at("mesa"))
        .stdin(Stdio::null())
        .spawn()?;
    let mut peak_bytes = 0;
    let status = loop {
        // The kernel keeps the peak itself: only its last value before the end is needed.
        peak_bytes = peak_bytes.max(peak_of(child.id()));
        match child.try_wait()? {
            Some(status) => break status,
            None => std::thread::sleep(Duration::from_millis(2)),
        }
    };
    let seconds = started.elapsed().as_secs_f64();
    if !status.success() {
        bail!("neubrdf render {} {arguments:?}: {status}", scene.display());
    }
    Ok(Run { seconds, peak_bytes })
}

fn peak_of(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
    kilobytes.unwrap_or(0) * 1024
}

pub fn run() -> Result<()> {
    let cases = [("cornell", "bvh"), ("cornell", "ray-query"), ("preview", "bvh")];
    let bar = bar(ROUNDS * cases.len());
    let mut lines = Vec::new();
    for (scene, traversal) in cases {
        let (mut cold, mut warm) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let caches = tempfile::tempdir()?;
            let arguments = ["--size", "256x256", "--spp", "1", "--device", "llvmpipe", "--traversal", traversal];
            cold.push(render(&crate::shipped(scene), &arguments, &caches)?.seconds);
            warm.push(render(&crate::shipped(scene), &arguments, &caches)?.seconds);
            bar.inc(1);
        }
        lines.push(format!("| {scene}, {traversal} | {:.2} | {:.2} |", Spread::of(cold), Spread::of(warm)));
    }
    bar.finish_and_clear();
    println!(
        "256×256, 1 spp, all feature channels, lavapipe: seconds from process start to EXR, median (min–max) of {ROUNDS}\n"
    );
    println!("| scene, traversal | empty caches | filled caches |\n|---|---|---|");
    lines.iter().for_each(|line| println!("{line}"));
    Ok(())
}
