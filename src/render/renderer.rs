//! The wavefront path tracer: records its passes, keeps the film, hands out pictures and checkpoints.

use std::sync::Arc;

use super::checkpoint::{Checkpoint, Identity};
use super::device_scene::DeviceScene;
use super::error::Error;
use super::film;
use super::kernels::{Features, Kernels, shade_kernel};
use super::layout::{CameraRecord, ErrorPass, FeaturePixel, FilmPixel, FilmTable, Pass};
use super::material_record::Family;
use super::pool::{Pool, Queue};
use super::settings::{Settings, Traversal};
use crate::gpu::{Buffer, Commands, Device, Memory};
use crate::image::{Crop, Metadata, Picture};
use crate::scene::{Camera, LightTable, Scene};

/// What a user may choose that does not change the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// How rays find triangles; `None` takes what suits the device.
    pub traversal: Option<Traversal>,
    /// Paths in flight, ≥ 1; `None` takes what suits the device.
    pub pool_paths: Option<u32>,
}

/// Workgroups, and so partial sums, of the error estimate.
const ERROR_WORKGROUPS: u32 = 64;
/// Dispatches of one submission, about: a few thousand keep the device busy and a command buffer small.
const SUBMISSION_DISPATCHES: u32 = 4096;

/// A progressive render of one scene on one device.
pub struct Renderer {
    device: Arc<Device>,
    scene: DeviceScene,
    kernels: Kernels,
    features: Features,
    settings: Settings,
    traversal: Traversal,
    crop: Crop,
    camera: Camera,
    pool: Pool,
    film_table: Buffer,
    pixels: Buffer,
    feature_pixels: Option<Buffer>,
    rejected: Buffer,
    partial_errors: Buffer,
    // Held for the film table's pointer.
    _camera_record: Buffer,
    identity: Identity,
    samples: u32,
    seconds: f64,
}

impl Renderer {
    /// Uploads the scene, builds its acceleration structures, the kernels that it needs and a black film.
    ///
    /// # Errors
    /// Settings out of range, a traversal that the device lacks, out of memory.
    pub fn new(device: &Arc<Device>, scene: &Scene, settings: &Settings, options: &Options) -> Result<Renderer, Error> {
        let crop = crop_of(scene, settings)?;
        if settings.max_depth == 0 {
            return Err(Error::Setting { name: "max depth", found: "0".into(), expected: "at least 1" });
        }
        let traversal = traversal_for(device, options.traversal)?;
        let original = scene;
        let scene = &*original.recentred();
        let lights = LightTable::new(scene);
        let features = Features::of(scene, &lights);
        if features.sun && !settings.light_sampling {
            return Err(Error::Setting {
                name: "light sampling",
                found: "off".into(),
                expected: "on in a scene with a sun, which no path runs into",
            });
        }
        if features.has(Family::NeuBrdf) && !device.profile().compiles_neubrdf {
            return Err(Error::NeuBrdf { device: device.name().to_owned() });
        }
        let workgroup_size = device.profile().workgroup_size;
        let device_scene =
            DeviceScene::upload(device, scene, &lights, &features, traversal, settings.neubrdf_precision)?;
        let kernels = Kernels::build(device, &features, traversal, settings, &device_scene.specialization())?;

        let pixel_count = u64::from(crop.width) * u64::from(crop.height);
        let paths = options.pool_paths.unwrap_or(device.profile().pool_paths).max(1);
        let most_useful = pixel_count.saturating_mul(u64::from(super::session::LONGEST_PASS));
        let paths = u64::from(paths).min(most_useful) as u32;
        let pool = Pool::new(device, paths, settings, &features, workgroup_size)?;

        let pixels = zeroed(device, "film", pixel_count * size_of::<FilmPixel>() as u64)?;
        let feature_pixels = match settings.features {
            true => Some(zeroed(device, "feature film", pixel_count * size_of::<FeaturePixel>() as u64)?),
            false => None,
        };
        let rejected = zeroed(device, "rejected samples", 4)?;
        let camera_record = Buffer::with_data(device, "camera", &[CameraRecord::new(scene)])?;
        let [first_albedo, first_normal] = pool.first_features();
        let film_table = Buffer::with_data(
            device,
            "film table",
            &[FilmTable {
                camera: camera_record.address(),
                pixels: pixels.address(),
                features: feature_pixels.as_ref().map_or(0, Buffer::address),
                rejected: rejected.address(),
                crop_origin: [crop.x, crop.y],
                crop_size: [crop.width, crop.height],
                first_albedo,
                first_normal,
                seed: settings.seed,
                padding: 0,
            }],
        )?;
        let identity = Identity::new(
            &original.hash(),
            [scene.film.width, scene.film.height],
            [crop.x, crop.y, crop.width, crop.height],
            settings,
            &format!("{} ({})", device.name(), device.driver()),
        );
        let mut renderer = Renderer {
            device: device.clone(),
            scene: device_scene,
            kernels,
            features,
            settings: *settings,
            traversal,
            crop,
            camera: original.camera.clone(),
            pool,
            film_table,
            pixels,
            feature_pixels,
            rejected,
            partial_errors: Buffer::new(device, "partial errors", u64::from(ERROR_WORKGROUPS) * 4, Memory::Readback)?,
            _camera_record: camera_record,
            identity,
            samples: 0,
            seconds: 0.0,
        };
        if settings.features {
            renderer.probe()?;
        }
        Ok(renderer)
    }

    /// Begins again at a black film, with another seed: what a new renderer would do, without building anything.
    pub fn restart(&mut self, seed: u32) -> Result<(), Error> {
        (self.settings.seed, self.identity.seed) = (seed, seed);
        (self.samples, self.seconds) = (0, 0.0);
        self.film_table.write(std::mem::offset_of!(FilmTable, seed) as u64, &[seed])?;
        let mut commands = Commands::begin(&self.device)?;
        for buffer in [Some(&self.pixels), Some(&self.rejected), self.feature_pixels.as_ref()].into_iter().flatten() {
            commands.fill(buffer, 0..buffer.size(), 0);
        }
        commands.barrier();
        wait(self.device.submit(commands)?)?;
        if self.settings.features { self.probe() } else { Ok(()) }
    }

    /// Samples a pixel so far.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Pixels of the crop.
    pub fn pixel_count(&self) -> u64 {
        u64::from(self.crop.width) * u64::from(self.crop.height)
    }

    /// Bytes on the device that hold paths in flight; the size of the picture is not in it.
    pub fn pool_bytes(&self) -> u64 {
        self.pool.bytes()
    }

    /// Bytes on the device that hold the picture.
    pub fn film_bytes(&self) -> u64 {
        self.pixels.size() + self.feature_pixels.as_ref().map_or(0, Buffer::size)
    }

    /// Seconds of rendering so far, those before a resume counted in.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    pub(super) fn add_seconds(&mut self, seconds: f64) {
        self.seconds += seconds;
    }

    /// How its rays find triangles.
    pub fn traversal(&self) -> Traversal {
        self.traversal
    }

    /// The names of the kernels that were built for this scene.
    pub fn kernel_names(&self) -> Vec<&'static str> {
        self.kernels.names()
    }

    /// Takes `samples` more samples of every pixel, and waits.
    pub fn render_pass(&mut self, samples: u32) -> Result<(), Error> {
        self.sample(samples, false)?;
        Ok(())
    }

    /// [`render_pass`](Renderer::render_pass), with the nanoseconds that each of its kernels took in all, in the order in
    /// which they first ran. It is slower: each dispatch is waited for and timed. Empty on a device without timestamps.
    pub fn time_pass(&mut self, samples: u32) -> Result<Vec<(String, u64)>, Error> {
        self.sample(samples, true)
    }

    fn sample(&mut self, samples: u32, timed: bool) -> Result<KernelTimes, Error> {
        let batches = batches(self.pixel_count(), self.samples, samples, self.pool.capacity());
        let times = self.submit(&batches, timed, |renderer, commands, batch| renderer.record(commands, batch))?;
        self.samples += samples;
        Ok(times)
    }

    /// Depth and ids of the ray through each pixel's centre.
    fn probe(&mut self) -> Result<(), Error> {
        let batches = batches(self.pixel_count(), 0, 1, self.pool.capacity());
        self.submit(&batches, false, |renderer, commands, batch| {
            let pass = Pass { variant: Pass::PROBE, ..renderer.pass(batch) };
            let paths = [batch.pixels, 1];
            renderer.pool.record_reset(commands);
            commands.barrier();
            renderer.dispatch(commands, "generate", paths, &pass);
            commands.barrier();
            renderer.dispatch(commands, renderer.kernels.trace_closest(), paths, &pass);
            commands.barrier();
            renderer.dispatch(commands, "first_hit", paths, &pass);
            commands.barrier();
        })?;
        Ok(())
    }

    fn submit(
        &self,
        batches: &[Batch],
        timed: bool,
        record: impl Fn(&Renderer, &mut Commands, &Batch),
    ) -> Result<KernelTimes, Error> {
        let mut times = KernelTimes::new();
        let per_submission = (SUBMISSION_DISPATCHES / self.settings.max_depth.saturating_mul(8)).max(1) as usize;
        let mut in_flight = None;
        for group in batches.chunks(per_submission) {
            let mut commands = Commands::begin(&self.device)?;
            if let Some(tlas) = self.scene.tlas() {
                commands.bind_tlas(tlas);
            }
            if timed {
                commands.time_dispatches();
            }
            for batch in group {
                record(self, &mut commands, batch);
            }
            // The host records the next submission while the device works on this one.
            let submission = self.device.submit(commands)?;
            if let Some(previous) = in_flight.replace(submission) {
                add_times(&mut times, previous.wait()?);
            }
        }
        if let Some(last) = in_flight {
            add_times(&mut times, last.wait()?);
        }
        Ok(times)
    }

    fn pass(&self, batch: &Batch) -> Pass {
        Pass {
            scene: self.scene.table_address(),
            film: self.film_table.address(),
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
    fn record(&self, commands: &mut Commands, batch: &Batch) {
        let mut pass = self.pass(batch);
        let paths = [batch.pixels, batch.samples];
        self.pool.record_reset(commands);
        commands.barrier();
        self.dispatch(commands, "generate", paths, &pass);
        for bounce in 0..self.settings.max_depth {
            pass.bounce = bounce;
            // The last segment only gathers what shines by itself.
            let scatters = bounce + 1 < self.settings.max_depth;
            if !scatters && !self.features.emitters && !self.features.environment {
                break;
            }
            commands.barrier();
            let trace = self.kernels.trace_closest();
            match bounce {
                0 => self.dispatch(commands, trace, paths, &pass),
                _ => self.dispatch_queue(commands, trace, Queue::Trace, &pass),
            }
            commands.barrier();
            if bounce == 0 && self.settings.features {
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
                        self.dispatch_queue(commands, shade_kernel(family), Queue::Shade(family, variant), &pass);
                    }
                }
            }
            if scatters && self.features.has_lights() && self.settings.light_sampling {
                commands.barrier();
                // The next bounce's rays are traced beside these: neither writes what the other reads.
                self.dispatch_queue(commands, self.kernels.trace_shadow(), Queue::Shadow, &pass);
            }
        }
        commands.barrier();
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
        let (counters, offset) = self.pool.counter(pass.bounce, queue);
        if let Some(kernel) = self.kernels.get(kernel) {
            commands.dispatch_indirect(kernel, counters, offset, pass);
        }
    }

    /// The mean over the pixels of the standard error of the luminance over (luminance + 0.01). Sobol' samples err less
    /// than this estimate, which takes them for independent.
    pub fn estimate_error(&self) -> Result<f64, Error> {
        let mut commands = Commands::begin(&self.device)?;
        let push = ErrorPass {
            pixels: self.pixels.address(),
            partial_sums: self.partial_errors.address(),
            pixel_count: self.pixel_count() as u32,
            sample_count: self.samples as f32,
        };
        if let Some(kernel) = self.kernels.get("estimate_error") {
            commands.dispatch(kernel, [ERROR_WORKGROUPS, 1, 1], &push);
        }
        commands.barrier();
        wait(self.device.submit(commands)?)?;
        let partial: Vec<f32> = self.partial_errors.read()?;
        Ok(partial.iter().map(|sum| f64::from(*sum)).sum::<f64>() / self.pixel_count() as f64)
    }

    /// Samples so far that were NaN or infinite; they count as black.
    pub fn rejected_samples(&self) -> Result<u32, Error> {
        Ok(self.rejected.read::<u32>()?.first().copied().unwrap_or(0))
    }

    /// The picture so far, and what its file should say about it.
    pub fn picture(&self) -> Result<(Picture, Metadata), Error> {
        let picture = film::picture(
            self.crop.width,
            self.crop.height,
            self.samples,
            &self.pixels.read()?,
            &self.read_features()?,
        );
        let metadata = Metadata {
            scene_hash: self.identity.scene.clone(),
            spp: u64::from(self.samples),
            seed: u64::from(self.settings.seed),
            max_depth: self.settings.max_depth,
            render_seconds: self.seconds,
            device: self.identity.device.clone(),
            version: self.identity.version.clone(),
            sampler: self.settings.sampler.to_string(),
            traversal: self.traversal.to_string(),
            camera_eye: self.camera.eye.to_array(),
            camera_target: self.camera.target.to_array(),
            camera_up: self.camera.up.to_array(),
            vertical_fov_degrees: self.camera.vertical_fov_degrees,
            film_size: [self.identity.width, self.identity.height],
            crop_origin: [self.crop.x, self.crop.y],
        };
        Ok((picture, metadata))
    }

    fn read_features(&self) -> Result<Vec<FeaturePixel>, Error> {
        self.feature_pixels.as_ref().map_or(Ok(Vec::new()), |buffer| Ok(buffer.read()?))
    }

    /// The resumable state.
    pub fn checkpoint(&self) -> Result<Checkpoint, Error> {
        Ok(Checkpoint {
            identity: self.identity.clone(),
            samples: self.samples,
            seconds: self.seconds,
            rejected: self.rejected_samples()?,
            pixels: self.pixels.read()?,
            features: self.read_features()?,
        })
    }

    /// Goes on from a checkpoint of the same render.
    ///
    /// # Errors
    /// If it is of another one, naming what differs.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), Error> {
        checkpoint.check(&self.identity)?;
        self.pixels.write(0, &checkpoint.pixels)?;
        self.rejected.write(0, &[checkpoint.rejected])?;
        if let Some(buffer) = &self.feature_pixels {
            buffer.write(0, &checkpoint.features)?;
        }
        self.samples = checkpoint.samples;
        self.seconds = checkpoint.seconds;
        Ok(())
    }
}

/// Nanoseconds by kernel name.
type KernelTimes = Vec<(String, u64)>;

fn add_times(times: &mut KernelTimes, passes: Vec<(String, Option<u64>)>) {
    for (name, nanoseconds) in passes {
        let Some(nanoseconds) = nanoseconds else { continue };
        match times.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => *sum += nanoseconds,
            None => times.push((name, nanoseconds)),
        }
    }
}

fn wait(submission: crate::gpu::Submission) -> Result<(), Error> {
    submission.wait()?;
    Ok(())
}

fn zeroed(device: &Arc<Device>, name: &str, bytes: u64) -> Result<Buffer, Error> {
    let buffer = Buffer::new(device, name, bytes, Memory::Device)?;
    let mut commands = Commands::begin(device)?;
    commands.fill(&buffer, 0..bytes, 0);
    commands.barrier();
    wait(device.submit(commands)?)?;
    Ok(buffer)
}

fn crop_of(scene: &Scene, settings: &Settings) -> Result<Crop, Error> {
    let film = scene.film;
    let whole = Crop { x: 0, y: 0, width: film.width, height: film.height };
    let crop = settings.crop.unwrap_or(whole);
    if !crop.fits(film.width, film.height) {
        let Crop { x, y, width, height } = crop;
        return Err(Error::Crop { x, y, width, height, film_width: film.width, film_height: film.height });
    }
    if u32::try_from(u64::from(crop.width) * u64::from(crop.height)).is_err() {
        let found = format!("{}x{}", crop.width, crop.height);
        return Err(Error::Setting { name: "film", found, expected: "fewer than 2³² pixels; render it in crops" });
    }
    Ok(crop)
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
struct Batch {
    first_pixel: u32,
    pixels: u32,
    first_sample: u32,
    samples: u32,
}

/// Cuts `samples` samples of each pixel into batches of at most `capacity` paths, samples of a pixel side by side.
fn batches(pixel_count: u64, first_sample: u32, samples: u32, capacity: u32) -> Vec<Batch> {
    let mut batches = Vec::new();
    let mut done = 0;
    while done < samples {
        let chunk = (samples - done).min(capacity);
        let pixels = u64::from(capacity / chunk).min(pixel_count);
        let mut first_pixel = 0;
        while first_pixel < pixel_count {
            batches.push(Batch {
                first_pixel: first_pixel as u32,
                pixels: pixels.min(pixel_count - first_pixel) as u32,
                first_sample: first_sample + done,
                samples: chunk,
            });
            first_pixel += pixels;
        }
        done += chunk;
    }
    batches
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the pool holds, every sample of every pixel is in exactly one batch, and none overfills the pool.
    #[test]
    fn batches_cover_each_sample_once() {
        for (pixels, samples, capacity) in
            [(10, 3, 1), (10, 3, 7), (10, 16, 5), (1, 100, 64), (1000, 16, 4096), (7, 1, 7)]
        {
            let mut taken = vec![0; (pixels * u64::from(samples)) as usize];
            for batch in batches(pixels, 5, samples, capacity) {
                assert!(batch.pixels * batch.samples <= capacity);
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
