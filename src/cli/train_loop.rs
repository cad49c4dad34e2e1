//! What training commands do from the first step to the last.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::Result;
use neubrdf::scene::brdf::NeuBrdf;
use neubrdf::train::{Error, GroundTruth, Group, Session};

use super::progress;

/// Seconds between two checkpoints.
const CHECKPOINT_INTERVAL: f64 = 30.0;

/// Seconds between two looks at the clock and the interrupt, about.
const STRIDE: f64 = 0.1;

/// What can be trained.
pub trait Training {
    /// Steps to take in all.
    fn planned(&self) -> u32;
    fn steps(&self) -> u32;
    fn loss(&self) -> f64;
    fn is_done(&self) -> bool;
    fn run(&mut self, steps: u32);
    fn wind_down(&mut self);
    fn save(&mut self, path: &Path) -> Result<(), Error>;
}

/// Both name these alike.
macro_rules! training {
    ($kind:ty, $planned:expr) => {
        impl Training for $kind {
            fn planned(&self) -> u32 {
                $planned(self)
            }

            fn steps(&self) -> u32 {
                self.steps()
            }

            fn loss(&self) -> f64 {
                self.loss()
            }

            fn is_done(&self) -> bool {
                self.is_done()
            }

            fn run(&mut self, steps: u32) {
                self.run(steps);
            }

            fn wind_down(&mut self) {
                self.wind_down();
            }

            fn save(&mut self, path: &Path) -> Result<(), Error> {
                self.save(path)
            }
        }
    };
}
training!(Session, |session: &Session| session.plan.steps);
training!(Group, |group: &Group| group.members()[0].plan.steps);

/// Trains under a bar, with checkpoints, one of them at the end, until the end or Ctrl-C, which raises `interrupted`.
pub fn train(
    training: &mut dyn Training,
    checkpoint: Option<&Path>,
    interrupted: &AtomicBool,
    is_quiet: bool,
) -> Result<()> {
    let bar = progress::bar(training.planned().into(), is_quiet);
    let mut last_checkpoint = Instant::now();
    let mut is_winding_down = false;
    // How long a step takes hangs on what is trained: a texture or a group takes a hundred times as long as a material.
    let mut stride = 1;
    while !training.is_done() {
        let started = Instant::now();
        training.run(stride);
        stride = if started.elapsed().as_secs_f64() < STRIDE { 2 * stride } else { (stride / 2).max(1) };
        bar.set_position(training.steps().into());
        bar.set_message(format!("loss {:.5}", training.loss()));
        if is_winding_down {
            continue;
        }
        let is_interrupted = interrupted.load(Ordering::SeqCst);
        if let Some(path) = checkpoint
            && (is_interrupted || last_checkpoint.elapsed().as_secs_f64() >= CHECKPOINT_INTERVAL)
        {
            training.save(path)?;
            last_checkpoint = Instant::now();
        }
        if is_interrupted {
            // The checkpoint goes on as if nothing had happened; the file gets the best that can be had soon.
            training.wind_down();
            is_winding_down = true;
        }
    }
    if let Some(path) = checkpoint.filter(|_| !is_winding_down) {
        training.save(path)?;
    }
    bar.finish();
    Ok(())
}

/// The trained NeuBRDF with the albedos of the ground truth, under bars; `None` if something else was trained.
pub fn finish(session: &Session, truth: &GroundTruth, is_quiet: bool) -> Option<NeuBrdf> {
    let bar = |length: u64, message: &'static str| progress::bar(length, is_quiet).with_message(message);
    let asking = bar(1, "albedos of the ground truth");
    let views = session.views(truth, |done, count| {
        asking.set_length(count as u64);
        asking.set_position(done as u64);
    });
    asking.finish_and_clear();
    let closing = bar(u64::from(session.plan.albedo_rounds) + 1, "albedos of the fit");
    let brdf = session.finished(views.as_ref(), || closing.inc(1));
    closing.finish_and_clear();
    brdf
}
