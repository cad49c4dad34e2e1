//! The wavefront path tracer, as far as it records: a scene, kernels, paths in flight and a film on a device. It neither submits
//! nor waits; [`super::Renderer`] and [`crate::plugin`] do with its recordings what each does.

use std::sync::Arc;

use super::device_scene::{Changed, DeviceScene, NextScene};
use super::error::Error;
use super::film::Film;
use super::kernels::{Features, Kernels, shade_kernel};
use super::layout::{CameraRecord, ErrorPass, Pass};
use super::material_record::Family;
use super::pool::{Pool, Queue};
use super::renderer::Options;
use super::settings::{BsdfSampling, Settings, Traversal};
use crate::gpu::{Commands, Device, HostMesh, Kernel, Upload};
use crate::image::Crop;
use crate::scene::{LightTable, Material, Scene};

/// Pixels of a group that shares paths, and of a square that is divided into such groups: `glsl/lib/reuse.glsl`.
const REUSE_GROUP: u32 = 8;
const REUSE_SQUARE: u32 = 64;

/// Workgroups, and so partial sums, of the error estimate.
pub const ERROR_WORKGROUPS: u32 = 64;

/// A scene and its film on a device.
pub struct PathTracer {
    device: Arc<Device>,
    scene: DeviceScene,
    kernels: Kernels,
    features: Features,
    settings: Settings,
    traversal: Traversal,
    /// Paths in flight, if the film has use for so many.
    most_paths: u32,
    pool: Pool,
    film: Film,
}

/// What [`PathTracer::new_film`] made, and then what it took the place of.
pub struct NextFilm {
    film: Film,
    /// Where the film has use for more paths.
    pool: Option<Pool>,
}

impl NextFilm {
    /// The film's pixels.
    pub fn pixel_count(&self) -> u64 {
        self.film.pixel_count()
    }
}

impl PathTracer {
    /// Uploads the scene and a black film, and builds the kernels: those that the scene needs, able to do what `reserve` has, too.
    /// The meshes of those indices come from a host's buffers.
    ///
    /// # Errors
    /// Settings out of range, a traversal that the device lacks, a host's mesh that does not go with the scene's or with the
    /// traversal, out of memory.
    pub fn new(
        upload: &mut Upload,
        scene: &Scene,
        host_meshes: &[(u32, HostMesh)],
        settings: &Settings,
        options: &Options,
        reserve: &Features,
    ) -> Result<PathTracer, Error> {
        let device = upload.device().clone();
        let crop = crop_of(scene, settings)?;
        if !(1..=Settings::DEEPEST).contains(&settings.max_depth) {
            let found = settings.max_depth.to_string();
            return Err(Error::Setting { name: "max depth", found, expected: "from 1 to 65535" });
        }
        if let Some(limit) = settings.clamp_indirect
            && !(limit.is_finite() && limit > 0.0)
        {
            let found = limit.to_string();
            return Err(Error::Setting { name: "limit of indirect light", found, expected: "a number above 0" });
        }
        if settings.path_reuse && settings.bsdf_sampling == BsdfSampling::Uniform {
            let found = settings.bsdf_sampling.to_string();
            return Err(Error::Setting {
                name: "BSDF sampling",
                found,
                expected: "lobe or cosine where paths are reused",
            });
        }
        let traversal = traversal_for(&device, options.traversal)?;
        let mut lights = LightTable::new(scene);
        let features = Features::of(scene, &lights).or(reserve);
        if features.light_tree != lights.tree.is_some() {
            lights = LightTable::with_tree(scene, features.light_tree);
        }
        if features.sun && !settings.light_sampling {
            return Err(Error::Setting {
                name: "light sampling",
                found: "off".into(),
                expected: "on in a scene with a sun, which no path runs into",
            });
        }
        if features.holes && settings.path_reuse {
            return Err(Error::Setting {
                name: "path reuse",
                found: "on".into(),
                expected: "off in a scene with materials with holes, through which paths go by chance",
            });
        }
        if features.has(Family::NeuBrdf) && !device.profile().compiles_neubrdf {
            return Err(Error::NeuBrdf { device: device.name().to_owned() });
        }
        let precision = settings.neubrdf_precision;
        let device_scene = DeviceScene::new(upload, (scene, host_meshes), &lights, &features, traversal, precision)?;
        let shapes = device_scene.neubrdf_kernels().shapes();
        let constants = device_scene.specialization();
        let kernels = Kernels::build(&device, &features, traversal, settings, &constants, shapes)?;

        let groups = device.limits().max_compute_work_group_count[0];
        let dispatchable = groups.saturating_mul(device.profile().workgroup_size) / paths_shared_by(settings);
        let dispatchable = dispatchable.min(Pool::most_paths(&features));
        let most_paths = options.pool_paths.unwrap_or(device.profile().pool_paths).clamp(1, dispatchable);
        let pool = Pool::new(upload, useful_paths(most_paths, &crop, settings), settings, &features)?;
        let film = Film::new(upload, scene, crop, settings, pool.by_slot())?;
        let (scene, settings) = (device_scene, *settings);
        Ok(PathTracer { device, scene, kernels, features, settings, traversal, most_paths, pool, film })
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// What changes the picture.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// How its rays find triangles.
    pub fn traversal(&self) -> Traversal {
        self.traversal
    }

    /// What its kernels were built for.
    pub fn features(&self) -> &Features {
        &self.features
    }

    /// Its kernels.
    pub fn kernels(&self) -> &Kernels {
        &self.kernels
    }

    /// Its film.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// Bytes on the device that hold paths in flight.
    pub fn pool_bytes(&self) -> u64 {
        self.pool.bytes()
    }

    /// Another seed, from the next sample on; waits until it is there.
    pub fn set_seed(&mut self, seed: u32) -> Result<(), Error> {
        self.settings.seed = seed;
        self.film.set_seed(seed)
    }

    /// Moves the camera, where the upload is recorded.
    ///
    /// # Errors
    /// A lens that the kernels were not built for.
    pub fn set_camera(&self, upload: &mut Upload, scene: &Scene) -> Result<(), Error> {
        if scene.camera.lens.is_some() && !self.features.lens {
            return Err(Error::Fixed { what: "a lens".to_string() });
        }
        upload.write(self.film.camera(), &[CameraRecord::new(scene)])?;
        Ok(())
    }

    /// See [`DeviceScene::changed`].
    ///
    /// # Errors
    /// Features that were not built, out of memory.
    pub fn changed(
        &self,
        upload: &mut Upload,
        scene: &Scene,
        before: &[&Material],
        changed: &Changed,
    ) -> Result<NextScene, Error> {
        self.scene.changed(upload, scene, before, &self.features, changed)
    }

    /// See [`DeviceScene::take`].
    pub fn take(&mut self, next: NextScene) -> NextScene {
        self.scene.take(next)
    }

    /// Makes a black film of the scene's size, and a pool that is large enough for it where the one that is there is not.
    ///
    /// # Errors
    /// Too many pixels, out of memory.
    pub fn new_film(&self, upload: &mut Upload, scene: &Scene) -> Result<NextFilm, Error> {
        let crop = crop_of(scene, &self.settings)?;
        let paths = useful_paths(self.most_paths, &crop, &self.settings);
        let pool = match paths > self.pool.capacity() {
            true => Some(Pool::new(upload, paths, &self.settings, &self.features)?),
            false => None,
        };
        let by_slot = pool.as_ref().unwrap_or(&self.pool).by_slot();
        Ok(NextFilm { film: Film::new(upload, scene, crop, &self.settings, by_slot)?, pool })
    }

    /// Takes another film. What it returns is to be kept for as long as work may use it.
    pub fn take_film(&mut self, next: NextFilm) -> NextFilm {
        NextFilm {
            film: std::mem::replace(&mut self.film, next.film),
            pool: next.pool.map(|pool| std::mem::replace(&mut self.pool, pool)),
        }
    }

    /// `samples` more samples of all pixels after the first `done`, in batches that the pool holds.
    pub fn batches(&self, done: u32, samples: u32) -> impl Iterator<Item = Batch> + use<> {
        batches(self.film.pixel_count(), done, samples, self.pool.capacity(), together(&self.settings))
    }

    /// Begins to record: before any other recording, once for a [`Commands`] or after commands of other makers.
    pub fn begin(&self, commands: &mut Commands) {
        if let Some(tlas) = self.scene.tlas() {
            commands.bind_tlas(tlas);
        }
    }

    /// Depth and ids of the ray through the centre of each pixel of a batch.
    pub fn record_probe(&self, commands: &mut Commands, batch: &Batch) {
        let pass = Pass { variant: Pass::PROBE, ..self.pass(batch) };
        let paths = [batch.pixels, 1];
        self.pool.record_reset(commands);
        commands.barrier();
        self.dispatch(commands, "generate", paths, &pass);
        commands.barrier();
        self.dispatch(commands, self.kernels.trace_closest(), paths, &pass);
        commands.barrier();
        self.dispatch(commands, "first_hit", paths, &pass);
        commands.barrier();
    }

    /// The error estimate after `samples` samples: [`ERROR_WORKGROUPS`] partial sums, `f32` each, at that address.
    pub fn record_error(&self, commands: &mut Commands, samples: u32, partial_sums: u64) {
        let push = ErrorPass {
            pixels: self.film.pixels().address(),
            partial_sums,
            pixel_count: self.film.pixel_count() as u32,
            sample_count: samples as f32,
        };
        if let Some(kernel) = self.kernels.get("estimate_error") {
            commands.dispatch(kernel, [ERROR_WORKGROUPS, 1, 1], &push);
        }
        commands.barrier();
    }

    fn pass(&self, batch: &Batch) -> Pass {
        Pass {
            scene: self.scene.table_address(),
            film: self.film.table().address(),
            pool: self.pool.table(),
            capacity: self.pool.capacity(),
            bounce: 0,
            max_depth: self.settings.max_depth,
            first_pixel: batch.first_pixel,
            pixel_count: batch.pixels,
            first_sample: batch.first_sample,
            samples_per_pixel: batch.samples,
            variant: 0,
        }
    }

    /// Records a batch: camera rays, then a bounce after the other, then the film.
    ///
    /// ```text
    /// generate → trace_closest → shade_miss, shade_<family> → trace_shadow → … → resolve
    ///                 ↑______________________|
    /// ```
    ///
    /// Where pixels share paths, `trace_reuse` and `reuse_paths` come before `resolve`.
    ///
    /// `reach` is told of each bounce before it begins, when all that was recorded before it is behind a barrier.
    pub fn record(&self, commands: &mut Commands, batch: &Batch, mut reach: impl FnMut(&mut Commands, u32)) {
        let mut pass = self.pass(batch);
        let paths = [batch.pixels, batch.samples];
        self.pool.record_reset(commands);
        commands.barrier();
        self.dispatch(commands, "generate", paths, &pass);
        for bounce in 0..self.settings.max_depth {
            pass.bounce = bounce;
            // The last segment only gathers what shines by itself.
            let scatters = bounce + 1 < self.settings.max_depth;
            let shows_features = bounce == 0 && self.settings.features;
            if !scatters && !self.features.emitters && !self.features.environment && !shows_features {
                break;
            }
            commands.barrier();
            reach(commands, bounce);
            let trace = self.kernels.trace_closest();
            match bounce {
                0 => self.dispatch(commands, trace, paths, &pass),
                _ => self.dispatch_queue(commands, trace, Queue::Trace, &pass),
            }
            commands.barrier();
            if shows_features {
                self.dispatch(commands, "first_hit", paths, &pass);
                // It reads the rays that shading is about to replace.
                commands.barrier();
            }
            if self.features.environment {
                self.dispatch_queue(commands, "shade_miss", Queue::Miss, &pass);
            }
            if scatters || self.features.emitters {
                for family in Family::ALL.into_iter().filter(|family| self.features.has(*family)) {
                    for variant in 0..self.features.queues(family) {
                        let pass = Pass { variant, ..pass };
                        let shape = match family {
                            Family::NeuBrdf => self.scene.neubrdf_kernels().serving(variant),
                            _ => 0,
                        };
                        let kernel = self.kernels.of_shape(shade_kernel(family), shape);
                        self.dispatch_indirect(commands, kernel, Queue::Shade(family, variant), &pass);
                    }
                }
            }
            if scatters && self.features.samples_lights() && self.settings.light_sampling {
                commands.barrier();
                self.dispatch_queue(commands, self.kernels.trace_shadow(), Queue::Shadow, &pass);
            }
        }
        commands.barrier();
        if self.settings.shares_paths() {
            let pixels = batch.pixels.next_multiple_of(REUSE_SQUARE);
            self.dispatch(commands, self.kernels.trace_reuse(), [pixels * REUSE_GROUP, batch.samples], &pass);
            commands.barrier();
            self.dispatch(commands, "reuse_paths", [pixels / REUSE_GROUP, batch.samples], &pass);
            commands.barrier();
        }
        self.dispatch(commands, "resolve", [batch.pixels, 1], &pass);
        commands.barrier();
    }

    fn dispatch(&self, commands: &mut Commands, kernel: &'static str, [pixels, samples]: [u32; 2], pass: &Pass) {
        let groups = (pixels * samples).div_ceil(self.device.profile().workgroup_size);
        if let Some(kernel) = self.kernels.get(kernel) {
            commands.dispatch(kernel, [groups, 1, 1], pass);
        }
    }

    fn dispatch_queue(&self, commands: &mut Commands, kernel: &'static str, queue: Queue, pass: &Pass) {
        self.dispatch_indirect(commands, self.kernels.get(kernel), queue, pass);
    }

    fn dispatch_indirect(&self, commands: &mut Commands, kernel: Option<&Kernel>, queue: Queue, pass: &Pass) {
        let (counters, offset) = self.pool.counter(pass.bounce, queue);
        if let Some(kernel) = kernel {
            commands.dispatch_indirect(kernel, counters, offset, pass);
        }
    }
}

fn crop_of(scene: &Scene, settings: &Settings) -> Result<Crop, Error> {
    let film = scene.film;
    let whole = Crop { x: 0, y: 0, width: film.width, height: film.height };
    let crop = settings.crop.unwrap_or(whole);
    if !crop.fits(film.width, film.height) {
        let Crop { x, y, width, height } = crop;
        return Err(Error::Crop { x, y, width, height, film_width: film.width, film_height: film.height });
    }
    if u32::try_from(crop.pixel_count()).is_err() {
        let found = format!("{}x{}", crop.width, crop.height);
        return Err(Error::Setting { name: "film", found, expected: "fewer than 2³² pixels; render it in crops" });
    }
    Ok(crop)
}

/// As many paths, or fewer where a pass over so small a film has no more.
fn useful_paths(most: u32, crop: &Crop, settings: &Settings) -> u32 {
    let together = together(settings);
    let pixels = crop.pixel_count().next_multiple_of(u64::from(together));
    let longest_pass = pixels.saturating_mul(u64::from(super::session::LONGEST_PASS));
    u64::from(most.max(together)).min(longest_pass) as u32
}

/// Pixels that share each path.
pub fn paths_shared_by(settings: &Settings) -> u32 {
    if settings.shares_paths() { REUSE_GROUP } else { 1 }
}

/// Pixels that a batch has all of or none of, counted from the first.
fn together(settings: &Settings) -> u32 {
    if settings.shares_paths() { REUSE_SQUARE } else { 1 }
}

fn traversal_for(device: &Device, wanted: Option<Traversal>) -> Result<Traversal, Error> {
    let suits = match device.has_ray_query() && device.profile().traversal_prefers_ray_query {
        true => Traversal::RayQuery,
        false => Traversal::Bvh,
    };
    match wanted.unwrap_or(suits) {
        Traversal::RayQuery if !device.has_ray_query() => {
            Err(Error::Traversal { traversal: Traversal::RayQuery, device: device.name().to_owned() })
        }
        traversal => Ok(traversal),
    }
}

/// Samples [first_sample, first_sample + samples) of pixels [first_pixel, first_pixel + pixels): at most a pool full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Batch {
    first_pixel: u32,
    pixels: u32,
    first_sample: u32,
    samples: u32,
}

impl Batch {
    /// Paths that it starts.
    pub fn paths(&self) -> u64 {
        u64::from(self.pixels) * u64::from(self.samples)
    }
}

/// Cuts `samples` samples of each pixel into batches of at most `capacity` paths (≥ `together`), samples of a pixel side by side, and so
/// many pixels in one batch.
fn batches(
    pixel_count: u64,
    first_sample: u32,
    samples: u32,
    capacity: u32,
    together: u32,
) -> impl Iterator<Item = Batch> {
    let most_samples = capacity / together;
    (0..samples).step_by(most_samples as usize).flat_map(move |done| {
        let chunk = (samples - done).min(most_samples);
        let pixels = u64::from(capacity / chunk / together * together).min(pixel_count);
        (0..pixel_count).step_by(pixels as usize).map(move |first_pixel| Batch {
            first_pixel: first_pixel as u32,
            pixels: pixels.min(pixel_count - first_pixel) as u32,
            first_sample: first_sample + done,
            samples: chunk,
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the pool holds, every sample of every pixel is in exactly one batch, and none overfills the pool.
    #[test]
    fn batches_cover_each_sample_once() {
        for (pixels, samples, capacity, together) in [
            (10, 3, 1, 1),
            (10, 3, 7, 1),
            (10, 16, 5, 1),
            (1, 100, 64, 1),
            (1000, 16, 4096, 1),
            (7, 1, 7, 1),
            (7, 3, 64, 64),
            (1000, 16, 4000, 64),
        ] {
            let mut taken = vec![0; (pixels * u64::from(samples)) as usize];
            for batch in batches(pixels, 5, samples, capacity, together) {
                assert!(batch.pixels * batch.samples <= capacity);
                assert_eq!(batch.first_pixel % together, 0);
                for pixel in batch.first_pixel..batch.first_pixel + batch.pixels {
                    for sample in batch.first_sample..batch.first_sample + batch.samples {
                        taken[(pixel * samples + sample - 5) as usize] += 1;
                    }
                }
            }
            assert!(taken.iter().all(|times| *times == 1), "{pixels} pixels, {samples} samples, pool {capacity}");
        }
    }
}
