//! Mitsuba 3, kept running beside us so that its renders and ours can take turns.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use anyhow::{Context, Result};
use neubrdf::gpu::Device;
use serde_json::Value;

use crate::measure::{Stopwatch, Timing};

/// How to get it.
const HOW: &str = "Mitsuba: skipped. To compare: python3 -m venv /tmp/peers && /tmp/peers/bin/pip install mitsuba numpy && \
                   apt-get install libllvm19, then set MITSUBA_PYTHON=/tmp/peers/bin/python and \
                   DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM-19.so";

/// A python that runs benches/mitsuba_scene.py.
pub struct Mitsuba {
    pub variant: &'static str,
    pub version: String,
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Mitsuba {
    /// With `cornell` or a NeuBRDF on a sphere, for which see the script, `side` pixels wide and high. `None`, with a word on how to
    /// get it, unless `MITSUBA_PYTHON` names a python that has it.
    pub fn start(variant: &'static str, scene: impl AsRef<OsStr>, side: u32) -> Result<Option<Mitsuba>> {
        let Some(python) = std::env::var_os("MITSUBA_PYTHON") else {
            println!("{HOW}\n");
            return Ok(None);
        };
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/mitsuba_scene.py");
        let mut child = Command::new(&python)
            .arg(script)
            .arg(scene)
            .arg(side.to_string())
            .env("MITSUBA_VARIANT", variant)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start MITSUBA_PYTHON={}", python.display()))?;
        let requests = child.stdin.take().context("no pipe to Mitsuba")?;
        let answers = BufReader::new(child.stdout.take().context("no pipe from Mitsuba")?);
        let mut mitsuba = Mitsuba { variant, version: String::new(), child, requests, answers };
        mitsuba.version = mitsuba.answer()?["version"].as_str().unwrap_or("?").to_owned();
        Ok(Some(mitsuba))
    }

    /// Renders; the time is that of the render alone, as Mitsuba sees it.
    pub fn render(&mut self, sampler: &str, samples: u32, seed: u32) -> Result<Timing> {
        let watch = Stopwatch::of(vec![self.child.id()]);
        let answer = self.ask(&format!("render {sampler} {samples} {seed}"))?;
        Ok(Timing { seconds: number(&answer, "seconds")?, ..watch.stop() })
    }

    /// Makes or reads the reference of [`error`](Mitsuba::error); returns the relMSE of its own noise.
    #[cfg(feature = "embree")]
    pub fn reference(&mut self, samples: u32, file: &Path) -> Result<f64> {
        number(&self.ask(&format!("reference {samples} {}", file.display()))?, "noise")
    }

    /// Seconds and relMSE of a render against the reference.
    #[cfg(feature = "embree")]
    pub fn error(&mut self, sampler: &str, samples: u32, seed: u32) -> Result<(f64, f64)> {
        let answer = self.ask(&format!("error {sampler} {samples} {seed}"))?;
        Ok((number(&answer, "seconds")?, number(&answer, "relmse")?))
    }

    /// The variant that compiles for what the device is.
    pub fn variant_for(device: &Device) -> &'static str {
        if device.profile().is_cpu { "llvm_ad_rgb" } else { "cuda_ad_rgb" }
    }

    fn ask(&mut self, request: &str) -> Result<Value> {
        writeln!(self.requests, "{request}")?;
        self.requests.flush()?;
        self.answer()
    }

    fn answer(&mut self) -> Result<Value> {
        let mut line = String::new();
        self.answers.read_line(&mut line)?;
        serde_json::from_str(&line).with_context(|| {
            format!(
                "Mitsuba ({}) answered '{}'; llvm variants need DRJIT_LIBLLVM_PATH set to LLVM 16 or later, cuda variants NVIDIA's OptiX",
                self.variant,
                line.trim()
            )
        })
    }
}

impl Drop for Mitsuba {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn number(answer: &Value, key: &str) -> Result<f64> {
    answer[key].as_f64().with_context(|| format!("Mitsuba's answer {answer} has no {key}"))
}
