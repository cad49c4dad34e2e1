//! What renders for a study: a scene and a method, ready to be asked for pictures.

use std::collections::HashMap;
use std::marker::PhantomData;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::error::Error;
use super::method::{self, Method};
use crate::converge::Mitsuba;
use crate::converge::clock::{Stopwatch, Timing, warm_up};
use crate::gpu::{Device, DeviceChoice, Instance, Profile, Validation};
use crate::image::Picture;
use crate::render::{self, Limits, Options, Renderer, Sampler, Settings};
use crate::scene::Scene;

/// Vulkan devices, each opened once.
#[derive(Default)]
pub struct Devices {
    instance: Option<Arc<Instance>>,
    open: HashMap<String, Arc<Device>>,
}

impl Devices {
    fn open(&mut self, name: &str) -> Result<Arc<Device>, Error> {
        if let Some(device) = self.open.get(name) {
            return Ok(device.clone());
        }
        let instance = match &self.instance {
            Some(instance) => instance.clone(),
            None => self.instance.insert(Instance::new(Validation::Off)?).clone(),
        };
        let choice = if name == "auto" { DeviceChoice::Auto } else { DeviceChoice::Named(name.to_owned()) };
        let device = instance.open(&choice)?;
        self.open.insert(name.to_owned(), device.clone());
        Ok(device)
    }
}

/// What came before the first picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Preparation {
    /// Upload, acceleration structures, kernels: seconds.
    pub build_seconds: f64,
    /// One sample a pixel, in which drivers finish their compilation: seconds.
    pub first_pass_seconds: f64,
    /// The device and driver.
    pub device: String,
    /// How it really finds triangles.
    pub traversal: String,
}

/// A picture and what it took.
pub struct Rendered {
    /// Beauty, variance, sample counts.
    pub picture: Picture,
    /// The render alone: no building, no reading back.
    pub timing: Timing,
    /// Samples that were not finite.
    pub rejected: u32,
}

/// A scene and a method, ready to render.
pub enum Engine<'a> {
    /// The wavefront, and what the device is.
    Vulkan(Box<Renderer>, Profile),
    /// Embree.
    #[cfg(feature = "embree")]
    Embree(Box<crate::reference::Reference<'a>>, u32),
    /// Mitsuba; the scene is nobody else's.
    Mitsuba(Box<Mitsuba>, PhantomData<&'a Scene>),
}

impl<'a> Engine<'a> {
    /// Builds whatever the method needs, and warms it up. An error says why the method is not available here.
    pub fn open(
        devices: &mut Devices,
        scene: &'a Scene,
        method: &Method,
        max_depth: u32,
    ) -> Result<(Engine<'a>, Preparation), Error> {
        let building = Stopwatch::own();
        match &method.engine {
            method::Engine::Vulkan(name) => {
                let device = devices.open(name)?;
                let settings = Settings {
                    max_depth,
                    sampler: method.sampler.unwrap_or(Sampler::Sobol),
                    features: false,
                    light_sampling: method.light_sampling,
                    bsdf_sampling: method.bsdf_sampling,
                    neubrdf_precision: method.precision,
                    clamp_indirect: method.clamp_indirect,
                    path_reuse: method.path_reuse,
                    ..Settings::default()
                };
                let options = Options { traversal: method.traversal, pool_paths: method.pool };
                let mut renderer = Renderer::new(&device, scene, &settings, &options)?;
                let build_seconds = building.stop().seconds;
                let first_pass = Stopwatch::own();
                renderer.render_pass(1)?;
                let preparation = Preparation {
                    build_seconds,
                    first_pass_seconds: first_pass.stop().seconds,
                    device: format!("{} ({})", device.name(), device.driver()),
                    traversal: renderer.traversal().to_string(),
                };
                Ok((Engine::Vulkan(Box::new(renderer), device.profile().clone()), preparation))
            }
            #[cfg(feature = "embree")]
            method::Engine::Embree => {
                let reference = crate::reference::Reference::new(scene)?;
                let options = crate::reference::ReferenceOptions { spp: 1, seed: 0, max_depth, crop: None };
                let about = reference.metadata(&options, &crate::reference::Statistics::default());
                let preparation = Preparation {
                    build_seconds: building.stop().seconds,
                    first_pass_seconds: 0.0,
                    device: about.device,
                    traversal: about.traversal,
                };
                Ok((Engine::Embree(Box::new(reference), max_depth), preparation))
            }
            #[cfg(not(feature = "embree"))]
            method::Engine::Embree => Err(Error::Setting {
                name: "device",
                found: "embree".into(),
                expected: "another: this build has no Embree (cargo feature `embree`)".into(),
            }),
            method::Engine::Mitsuba => {
                let mut mitsuba = Mitsuba::start(scene, max_depth)?;
                let build_seconds = building.stop().seconds;
                let first_pass = Stopwatch::own();
                mitsuba.render(1, u32::MAX)?;
                let preparation = Preparation {
                    build_seconds,
                    first_pass_seconds: first_pass.stop().seconds,
                    device: mitsuba.name(),
                    traversal: String::new(),
                };
                Ok((Engine::Mitsuba(Box::new(mitsuba), PhantomData), preparation))
            }
        }
    }

    /// Renders from scratch; `None` if `stop` was set meanwhile.
    pub fn render(&mut self, spp: u32, seed: u32, stop: &AtomicBool) -> Result<Option<Rendered>, Error> {
        match self {
            Engine::Vulkan(renderer, profile) => {
                warm_up(profile, || renderer.render_pass(1).map(drop))?;
                renderer.restart(seed)?;
                let watch = Stopwatch::own();
                let limits = Limits { samples: spp, seconds: None, error: None };
                render::run(renderer, &limits, |_, _| match stop.load(Ordering::SeqCst) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                })?;
                let timing = Timing { seconds: renderer.seconds(), ..watch.stop() };
                let picture = renderer.picture()?.0;
                let rejected = renderer.rejected_samples()?;
                Ok((renderer.samples() == spp).then_some(Rendered { picture, timing, rejected }))
            }
            #[cfg(feature = "embree")]
            Engine::Embree(reference, max_depth) => {
                let options = crate::reference::ReferenceOptions {
                    spp,
                    seed: u64::from(seed),
                    max_depth: *max_depth,
                    crop: None,
                };
                let watch = Stopwatch::own();
                let (picture, statistics) = reference.render(&options, |_| {}, stop)?;
                let timing = Timing { seconds: statistics.seconds, ..watch.stop() };
                let is_whole = !stop.load(Ordering::SeqCst);
                Ok(is_whole.then_some(Rendered { picture, timing, rejected: 0 }))
            }
            Engine::Mitsuba(mitsuba, _) => {
                let (picture, timing) = mitsuba.render(spp, seed)?;
                Ok(Some(Rendered { picture, timing, rejected: 0 }))
            }
        }
    }
}
