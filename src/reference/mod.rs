//! The reference: a path tracer on the CPU, in `f64`, over Embree.
//!
//! It shares the scene and the text-book BSDFs of [`material`](crate::material) with nothing on the device, and has its
//! own code for everything else: rays by Embree in robust mode, hit points recomputed in `f64`, lights picked by binary
//! search in their cumulated power, random numbers from xoshiro256++. What it renders is unbiased: path tracing with
//! next-event estimation, multiple importance sampling by the balance heuristic, and Russian roulette.
//!
//! Its pictures have the planes of [`image::plane`](crate::image::plane), variance included, and depend on the seed, not
//! on the number of threads. Values of networks are taken for many paths at a time.
#![allow(unsafe_code)]

mod camera;
mod embree;
mod film;
mod holes;
mod lights;
mod path;
mod random;
mod surface;
mod values;

use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use self::camera::View;
pub use self::embree::{Accelerator, Hit, Ray, TraceMode};
use self::film::RayCount;
use self::lights::Lights;
use self::random::Random;
use self::surface::Placement;
use self::values::Values;
use crate::image::{Crop, Metadata, Picture};
use crate::material::Prepared;
use crate::scene::{Camera, Scene};

/// Paths that are on their way together, a thread: enough for networks to be evaluated at many directions, few enough for the caches.
const PATHS: usize = 1024;

/// What can go wrong.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Embree could not start or build its trees.
    #[error("Embree: {0}")]
    Embree(String),
    /// The crop is empty or leaves the film.
    #[error(
        "the crop of {}×{} pixels at ({}, {}) is empty or leaves the film of {}×{} pixels",
        crop.width, crop.height, crop.x, crop.y, film[0], film[1]
    )]
    Crop {
        /// What was asked for.
        crop: Crop,
        /// The film's size.
        film: [u32; 2],
    },
    /// There is no memory for the picture.
    #[error(
        "out of memory: a picture of {}×{} pixels takes {} GB; use a smaller picture (or render it in crops)",
        size[0], size[1], u64::from(size[0]) * u64::from(size[1]) * film::BYTES_A_PIXEL / 1_000_000_000
    )]
    Memory {
        /// Its size in pixels.
        size: [u32; 2],
    },
}

/// What to render of a scene, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceOptions {
    /// Samples a pixel.
    pub spp: u32,
    /// Another seed gives independent noise.
    pub seed: u64,
    /// Longest path, in segments: 1 sees only lights, 2 adds direct illumination.
    pub max_depth: u32,
    /// A part of the film; the whole if `None`.
    pub crop: Option<Crop>,
}

impl Default for ReferenceOptions {
    fn default() -> ReferenceOptions {
        ReferenceOptions { spp: 64, seed: 0, max_depth: 16, crop: None }
    }
}

/// What rendering took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Wall-clock time of the samples, seconds.
    pub seconds: f64,
    /// Camera samples.
    pub samples: u64,
    /// Rays traced for a closest hit, camera rays included.
    pub closest_rays: u64,
    /// Rays traced for visibility.
    pub shadow_rays: u64,
    /// Samples of the pixel that has the fewest; less than asked for if the render was stopped.
    pub least_spp: u32,
}

/// A scene made ready for rendering: built once, rendered often.
pub struct Reference<'a> {
    /// Near the origin ([`Scene::recentred`]).
    scene: Cow<'a, Scene>,
    /// As the scene has it.
    camera: &'a Camera,
    view: View,
    accelerator: Accelerator,
    lights: Lights,
    /// One an instance.
    placements: Vec<Placement>,
    /// One a material.
    surfaces: Vec<Arc<Prepared>>,
    /// Some material lets rays through.
    has_holes: bool,
}

impl<'a> Reference<'a> {
    /// Builds Embree's trees and the tables of lights and materials.
    pub fn new(scene: &'a Scene) -> Result<Reference<'a>, Error> {
        let Scene { camera, .. } = scene;
        let scene = scene.recentred();
        let placements: Vec<Placement> = scene.instances.iter().map(Placement::new).collect();
        Ok(Reference {
            view: View::new(&scene.camera, scene.film),
            accelerator: Accelerator::new(&scene)?,
            lights: Lights::new(&scene, &placements),
            placements,
            surfaces: Prepared::all(&scene.materials, &scene.brdfs),
            has_holes: scene.has_holes(),
            scene,
            camera,
        })
    }

    /// Renders on all threads of rayon's pool. `progress` is told the part done, from any thread; after `stop` is set the
    /// samples taken so far are the picture, some pixels perhaps with fewer than others.
    pub fn render(
        &self,
        options: &ReferenceOptions,
        progress: impl Fn(f64) + Sync,
        stop: &AtomicBool,
    ) -> Result<(Picture, Statistics), Error> {
        let film = self.scene.film;
        let crop = options.crop.unwrap_or(Crop { x: 0, y: 0, width: film.width, height: film.height });
        if !crop.fits(film.width, film.height) {
            return Err(Error::Crop { crop, film: [film.width, film.height] });
        }
        let start = Instant::now();
        let [closest_rays, shadow_rays, samples_done] = [const { AtomicU64::new(0) }; 3];
        let samples_asked = u64::from(crop.width) * u64::from(crop.height) * u64::from(options.spp);
        let sums = film::sums(crop.width as usize * crop.height as usize);
        let mut sums = sums.map_err(|_| Error::Memory { size: [crop.width, crop.height] })?;

        // Passes grow, so that every pixel has a sample soon and stopping never waits long.
        let mut pass_spp = 1;
        let mut first = 0;
        while first < options.spp && !stop.load(Ordering::Relaxed) {
            let samples = first..(first + pass_spp).min(options.spp);
            sums.par_chunks_mut(crop.width as usize).enumerate().for_each(|(row, pixels)| {
                if stop.load(Ordering::Relaxed) {
                    return;
                }
                let y = crop.y + row as u32;
                let values = Values::default();
                let path = |(x, sample): (u32, u32)| {
                    let index = u64::from(y) * u64::from(film.width) + u64::from(x);
                    let random = Random::new(options.seed, index, sample.into());
                    self.path([x, y], options.max_depth, random, &values)
                };
                let mut rays = RayCount::default();
                let together = PATHS.div_ceil(samples.len());
                for (pixels, x) in pixels.chunks_mut(together).zip((crop.x..).step_by(together)) {
                    let of_pixel = |x| samples.clone().map(move |sample| (x, sample));
                    let paths = (x..).take(pixels.len()).flat_map(of_pixel).map(path);
                    for (sums, samples) in pixels.iter_mut().zip(values.all(paths).chunks(samples.len())) {
                        for sample in samples {
                            sums.add(sample);
                            rays.closest += sample.rays.closest;
                            rays.shadow += sample.rays.shadow;
                        }
                    }
                }
                closest_rays.fetch_add(rays.closest, Ordering::Relaxed);
                shadow_rays.fetch_add(rays.shadow, Ordering::Relaxed);
                let row_samples = u64::from(crop.width) * samples.len() as u64;
                let done = samples_done.fetch_add(row_samples, Ordering::Relaxed) + row_samples;
                progress(done as f64 / samples_asked as f64);
            });
            first = samples.end;
            pass_spp = (pass_spp * 2).min(32);
        }

        let seconds = start.elapsed().as_secs_f64();
        let mut picture = film::picture(crop.width, crop.height, &sums);
        self.add_centre_planes(crop, &mut picture);
        let statistics = Statistics {
            seconds,
            samples: samples_done.into_inner(),
            closest_rays: closest_rays.into_inner(),
            shadow_rays: shadow_rays.into_inner(),
            least_spp: sums.iter().map(|pixel| pixel.count).min().unwrap_or(0),
        };
        Ok((picture, statistics))
    }

    /// What to write into the file of a picture; the scene's hash is the caller's to add.
    pub fn metadata(&self, options: &ReferenceOptions, statistics: &Statistics) -> Metadata {
        let (camera, film) = (self.camera, self.scene.film);
        Metadata {
            scene_hash: String::new(),
            spp: statistics.least_spp.into(),
            seed: options.seed,
            max_depth: options.max_depth,
            clamp_indirect: 0.0,
            render_seconds: statistics.seconds,
            device: format!("CPU, {} threads", rayon::current_num_threads()),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            sampler: "xoshiro256++".to_owned(),
            traversal: format!("Embree {}", self.accelerator.version()),
            camera_eye: camera.eye.to_array(),
            camera_target: camera.target.to_array(),
            camera_up: camera.up.to_array(),
            vertical_fov_degrees: camera.vertical_fov_degrees,
            film_size: [film.width, film.height],
            crop_origin: options.crop.map_or([0, 0], |crop| [crop.x, crop.y]),
        }
    }

    /// The trees, for tracing rays alone: of the scene as [`Scene::recentred`] has it.
    pub fn accelerator(&self) -> &Accelerator {
        &self.accelerator
    }
}

/// Rec. 709 luminance.
fn luminance(color: DVec3) -> f64 {
    color.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}
