//! Mitsuba 3 as an independent witness: the same scene, another renderer.

mod export;

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::Value;

pub use export::{ExportError, export_mitsuba};

use super::clock::{Stopwatch, Timing};
use crate::image::{Picture, Samples, plane};
use crate::scene::Scene;

/// How to get it.
const HOW: &str = "set MITSUBA_PYTHON to a python that has mitsuba 3 (python3 -m venv DIR && DIR/bin/pip install mitsuba numpy), and \
                   DRJIT_LIBLLVM_PATH to LLVM 16 or later";

/// What can go wrong with it.
#[derive(Debug, thiserror::Error)]
pub enum MitsubaError {
    /// There is none.
    #[error("there is no Mitsuba here: {HOW}")]
    Missing,
    /// It does not define the scene as we do.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// It did not answer.
    #[error("{0}; {HOW}")]
    Broken(String),
    /// The system said no.
    #[error("{0}")]
    Io(#[from] std::io::Error),
}

/// A python that holds a scene.
pub struct Mitsuba {
    version: String,
    variant: String,
    size: [u32; 2],
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    directory: Scratch,
}

/// A directory of temporary files, which goes with it.
struct Scratch(PathBuf);

impl Drop for Scratch {
    fn drop(&mut self) {
        // It may be gone.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

impl Mitsuba {
    /// Exports the scene and starts the python that MITSUBA_PYTHON names.
    pub fn start(scene: &Scene, max_depth: u32) -> Result<Mitsuba, MitsubaError> {
        use std::sync::atomic::{AtomicU32, Ordering};
        static UNIQUE: AtomicU32 = AtomicU32::new(0);
        let python = std::env::var_os("MITSUBA_PYTHON").ok_or(MitsubaError::Missing)?;
        let unique = UNIQUE.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("neubrdf-mitsuba-{}-{unique}", std::process::id()));
        let directory = Scratch(path);
        let xml = export_mitsuba(scene, max_depth, &directory.0)?;
        let script = directory.0.join("serve.py");
        std::fs::write(&script, include_str!("serve.py"))?;
        let mut child =
            Command::new(&python).arg(&script).arg(&xml).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let pipes = child.stdin.take().zip(child.stdout.take());
        let (requests, answers) = pipes.ok_or_else(|| MitsubaError::Broken("no pipes to it".into()))?;
        let size = [scene.film.width, scene.film.height];
        let mut mitsuba = Mitsuba {
            version: String::new(),
            variant: String::new(),
            size,
            child,
            requests,
            answers: BufReader::new(answers),
            directory,
        };
        let hello = mitsuba.answer()?;
        mitsuba.version = hello["version"].as_str().unwrap_or("?").to_owned();
        mitsuba.variant = hello["variant"].as_str().unwrap_or("?").to_owned();
        Ok(mitsuba)
    }

    /// Its version and variant.
    pub fn name(&self) -> String {
        format!("Mitsuba {} ({})", self.version, self.variant)
    }

    /// Renders: beauty and sample counts, no variance. The seconds are those of the render alone, as it sees them.
    pub fn render(&mut self, spp: u32, seed: u32) -> Result<(Picture, Timing), MitsubaError> {
        let file = self.directory.0.join("picture.f32");
        let watch = Stopwatch::of(vec![self.child.id()]);
        writeln!(self.requests, "{spp} {seed} {}", file.display())?;
        self.requests.flush()?;
        let answer = self.answer()?;
        let seconds =
            answer["seconds"].as_f64().ok_or_else(|| MitsubaError::Broken(format!("it answered {answer}")))?;
        let timing = Timing { seconds, ..watch.stop() };
        let bytes = std::fs::read(&file)?;
        let mut picture = Picture::new(self.size[0], self.size[1]);
        if bytes.len() != picture.pixels() * 12 {
            return Err(MitsubaError::Broken(format!("its picture has {} bytes", bytes.len())));
        }
        let number = |bytes: &[u8]| bytes.first_chunk::<4>().map_or(0.0, |bytes| f32::from_le_bytes(*bytes));
        let pixels: Vec<[f32; 3]> =
            bytes.chunks_exact(12).map(|pixel| [number(pixel), number(&pixel[4..]), number(&pixel[8..])]).collect();
        picture.set_rgb(plane::BEAUTY, &pixels);
        picture.set(plane::SAMPLES, Samples::U32(vec![spp; pixels.len()]));
        Ok((picture, timing))
    }

    fn answer(&mut self) -> Result<Value, MitsubaError> {
        let mut line = String::new();
        self.answers.read_line(&mut line)?;
        serde_json::from_str(&line).map_err(|_| MitsubaError::Broken(format!("it answered '{}'", line.trim())))
    }
}

impl Drop for Mitsuba {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
