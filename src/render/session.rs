//! A progressive render: passes over the whole film until a limit is reached.

use std::ops::ControlFlow;
use std::time::Instant;

use super::error::Error;
use super::renderer::Renderer;

/// When to stop. Whatever comes first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Samples a pixel.
    pub samples: u32,
    /// Seconds of rendering, those before a resume counted in; scene loading and shader compilation are not.
    pub seconds: Option<f64>,
    /// Estimated relative error of the picture ([`Renderer::estimate_error`]).
    pub error: Option<f64>,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stopped {
    /// All samples are taken.
    Samples,
    /// The time is up.
    Time,
    /// The error is low enough.
    Error,
    /// The observer said so.
    Interrupted,
}

/// Where a render stands after a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Samples a pixel so far.
    pub samples: u32,
    /// Seconds of rendering so far.
    pub seconds: f64,
    /// Camera samples a second, of the last pass.
    pub samples_per_second: f64,
    /// Estimated relative error, from the fourth sample on.
    pub error: Option<f64>,
}

/// Samples a pixel of the longest pass: what a Ctrl-C waits for, and what neighbouring lanes share a pixel for.
pub(super) const LONGEST_PASS: u32 = 16;

/// Fewer samples than this tell nothing about their spread.
pub const FEWEST_SAMPLES_FOR_ERROR: u32 = 4;

/// Renders until a limit is reached or `observe`, called after each pass, breaks.
///
/// Passes begin at one sample a pixel, for an early picture, and double up to 16. Their lengths do not change the picture.
pub fn run(
    renderer: &mut Renderer,
    limits: &Limits,
    mut observe: impl FnMut(&Renderer, &Progress) -> ControlFlow<()>,
) -> Result<Stopped, Error> {
    let mut pass = 1;
    loop {
        let remaining = limits.samples.saturating_sub(renderer.samples());
        if remaining == 0 {
            return Ok(Stopped::Samples);
        }
        let started = Instant::now();
        let samples = pass.min(remaining);
        renderer.render_pass(samples)?;
        let seconds = started.elapsed().as_secs_f64();
        renderer.add_seconds(seconds);
        let error =
            if renderer.samples() >= FEWEST_SAMPLES_FOR_ERROR { Some(renderer.estimate_error()?) } else { None };
        let progress = Progress {
            samples: renderer.samples(),
            seconds: renderer.seconds(),
            samples_per_second: f64::from(samples) * renderer.pixel_count() as f64 / seconds.max(1e-9),
            error,
        };
        if observe(renderer, &progress).is_break() {
            return Ok(Stopped::Interrupted);
        }
        if limits.seconds.is_some_and(|limit| progress.seconds >= limit) {
            return Ok(Stopped::Time);
        }
        if limits.error.zip(error).is_some_and(|(limit, error)| error <= limit) {
            return Ok(Stopped::Error);
        }
        pass = (pass * 2).min(LONGEST_PASS);
    }
}
