//! The hard cases: small scenes, each made to break a path tracer in one way, with what must come out.
//!
//! A case holds if all samples are finite, the render ends, and the picture is what is expected: another renderer's, a closed form, or the same
//! bits. What the driver's validation layer says is for the caller to look at.

mod build;
mod driver;
mod estimator;
mod geometry;
mod light;
mod materials;
mod neubrdf;

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::gpu::Device;
use crate::image::{Picture, plane};
use crate::render::{self, Limits, Options, Renderer, Sampler, Settings, Stopped};
use crate::scene::Scene;

/// A hard case.
pub struct Case {
    /// Its name: what it is about.
    pub name: &'static str,
    /// Why it is hard.
    pub why: &'static str,
    /// What is rendered, and what must come out.
    pub trial: Trial,
    /// It is known not to hold, and docs/convergence.md says why.
    pub is_known_limit: bool,
}

/// What is rendered, and what must come out.
pub struct Trial {
    /// What.
    pub scene: Scene,
    /// How.
    pub settings: Settings,
    /// With how many paths in flight, by which traversal.
    pub options: Options,
    /// Samples a pixel.
    pub samples: u32,
    /// What must come out.
    pub expected: Expected,
}

/// What must come out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expected {
    /// Embree's picture at this many samples a pixel, but for noise (z-test).
    Embree(u32),
    /// This radiance in every pixel and channel, to this relative error (absolute where it is 0).
    Radiance(f64, f64),
    /// This mean radiance to four standard errors of it, and this relative error.
    Mean(f64, f64),
    /// The bits that other options give.
    SameBits(Options),
}

/// What came out.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Whether the case holds.
    pub holds: bool,
    /// The figure that says so.
    pub message: String,
}

/// A case that is not done by then hangs.
const LONGEST_SECONDS: f64 = 120.0;

/// All cases.
pub fn cases() -> Vec<Case> {
    [geometry::cases(), light::cases(), materials::cases(), neubrdf::cases(), estimator::cases(), driver::cases()]
        .into_iter()
        .flatten()
        .collect()
}

impl Trial {
    /// A scene as most cases want it: independent numbers, so that the z-test has true variances, depth 6, 192 samples, against 384 of
    /// Embree.
    fn new(scene: Scene) -> Trial {
        let settings =
            Settings { max_depth: 6, seed: 2, sampler: Sampler::Pcg, features: false, ..Settings::default() };
        Trial { scene, settings, options: Options::default(), samples: 192, expected: Expected::Embree(384) }
    }

    /// A case of that name.
    fn case(self, name: &'static str, why: &'static str) -> Case {
        Case { name, why, trial: self, is_known_limit: false }
    }

    /// Without light samples: a path's weights then are all 1, so that in a white furnace no sample has any noise.
    fn without_light_sampling(mut self) -> Trial {
        self.settings.light_sampling = false;
        self
    }

    fn expecting(self, expected: Expected) -> Trial {
        Trial { expected, ..self }
    }

    fn depth(mut self, max_depth: u32) -> Trial {
        self.settings.max_depth = max_depth;
        self
    }

    fn samples(self, samples: u32) -> Trial {
        Trial { samples, ..self }
    }
}

impl Case {
    /// Renders and judges. `significance` of a z-test is corrected for the number of cases.
    pub fn run(&self, device: &Arc<Device>) -> Outcome {
        match self.try_run(device) {
            Ok(outcome) => outcome,
            Err(error) => Outcome { holds: false, message: error },
        }
    }

    fn try_run(&self, device: &Arc<Device>) -> Result<Outcome, String> {
        let Trial { scene, settings, options, samples, expected } = &self.trial;
        let picture = self.render(device, options)?;
        match *expected {
            Expected::Embree(spp) => against_embree(&picture, scene, settings.max_depth, spp),
            Expected::Radiance(value, tolerance) => {
                let beauty = picture.rgb(plane::BEAUTY).unwrap_or_default();
                let scale = if value == 0.0 { 1.0 } else { value };
                let off = |x: &f32| (f64::from(*x) - value).abs() / scale;
                let worst = beauty.as_flattened().iter().map(off).fold(0.0, f64::max);
                Ok(Outcome {
                    holds: worst <= tolerance,
                    message: format!("every pixel is {value} to {worst:.1e}, wanted {tolerance:.0e}"),
                })
            }
            Expected::Mean(value, tolerance) => {
                let (mean, error) = mean_and_error(&picture);
                let off = (mean - value).abs();
                Ok(Outcome {
                    holds: off <= 4.0 * error + tolerance * value,
                    message: format!("the mean is {mean:.6} ± {error:.6}, wanted {value:.6}"),
                })
            }
            Expected::SameBits(other) => {
                let again = self.render(device, &other)?;
                let is_same = picture.rgb(plane::BEAUTY) == again.rgb(plane::BEAUTY);
                Ok(Outcome {
                    holds: is_same,
                    message: format!("{samples} spp, bits {}", if is_same { "are the same" } else { "differ" }),
                })
            }
        }
    }

    fn render(&self, device: &Arc<Device>, options: &Options) -> Result<Picture, String> {
        let Trial { scene, settings, samples, .. } = &self.trial;
        let text = |error: render::Error| error.to_string();
        let mut renderer = Renderer::new(device, scene, settings, options).map_err(text)?;
        let limits = Limits { samples: *samples, seconds: Some(LONGEST_SECONDS), error: None };
        let stopped = render::run(&mut renderer, &limits, |_, _| ControlFlow::Continue(())).map_err(text)?;
        if stopped == Stopped::Time && renderer.samples() < *samples {
            return Err(format!("not done after {LONGEST_SECONDS} s: {} of {samples} spp", renderer.samples()));
        }
        let rejected = renderer.rejected_samples().map_err(text)?;
        if rejected > 0 {
            return Err(format!("{rejected} samples were NaN or infinite"));
        }
        let picture = renderer.picture().map_err(text)?.0;
        let beauty = picture.rgb(plane::BEAUTY).unwrap_or_default();
        match beauty.as_flattened().iter().all(|value| value.is_finite() && *value >= 0.0) {
            true => Ok(picture),
            false => Err("a pixel is NaN, infinite or negative".into()),
        }
    }
}

fn mean_and_error(picture: &Picture) -> (f64, f64) {
    let beauty = picture.rgb(plane::BEAUTY).unwrap_or_default();
    let variance = picture.rgb(plane::VARIANCE).unwrap_or_default();
    let count = (beauty.len() * 3) as f64;
    let sum = |plane: &[[f32; 3]]| plane.as_flattened().iter().map(|value| f64::from(*value)).sum::<f64>();
    // Channels of a path depend on each other wholly, at worst.
    (sum(&beauty) / count, (3.0 * sum(&variance)).sqrt() / count)
}

#[cfg(feature = "embree")]
fn against_embree(picture: &Picture, scene: &Scene, max_depth: u32, spp: u32) -> Result<Outcome, String> {
    use crate::converge::{Metrics, ZTest};
    use crate::reference::{Reference, ReferenceOptions};
    /// That a correct renderer fails any case by chance.
    const SIGNIFICANCE: f64 = 1e-3;
    let options = ReferenceOptions { spp, seed: 0x5354_4142, max_depth, crop: None };
    let stop = std::sync::atomic::AtomicBool::new(false);
    let reference = Reference::new(scene)
        .and_then(|reference| reference.render(&options, |_| {}, &stop))
        .map_err(|error| error.to_string())?
        .0;
    let test = ZTest::for_noise(picture, &reference).map_err(|error| error.to_string())?;
    let metrics = Metrics::of(picture, &reference, 0.0).map_err(|error| error.to_string())?;
    Ok(Outcome {
        holds: !test.rejects(SIGNIFICANCE / cases().len() as f64),
        message: format!(
            "Embree: p = {:.2e}, mean differs by {:+.1e} of {:.3e}; worst block of {} at {:?}, z {:+.1}",
            test.p,
            metrics.relative_bias,
            mean_and_error(&reference).0,
            test.block,
            test.worst_pixel,
            test.worst_z
        ),
    })
}

#[cfg(not(feature = "embree"))]
fn against_embree(_: &Picture, _: &Scene, _: u32, _: u32) -> Result<Outcome, String> {
    Ok(Outcome { holds: true, message: "finite; not compared, as this build has no Embree".into() })
}
