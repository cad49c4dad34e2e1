//! The path tracer on its own: submits its recordings, waits for them, hands out pictures and checkpoints.

use std::sync::Arc;

use super::checkpoint::{Checkpoint, Identity};
use super::error::Error;
use super::film;
use super::kernels::Features;
use super::path_tracer::{Batch, ERROR_WORKGROUPS, PathTracer, paths_shared_by};
use super::settings::{Settings, Traversal};
use crate::gpu::{Buffer, Commands, Device, Memory, Upload};
use crate::image::{Metadata, Picture};
use crate::scene::{Camera, Scene};

/// What a user may choose that does not change the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// How rays find triangles; `None` takes what suits the device.
    pub traversal: Option<Traversal>,
    /// Paths in flight, ≥ 1; `None` takes what suits the device.
    pub pool_paths: Option<u32>,
}

/// Dispatches of one submission, about: a few thousand keep the device busy and a command buffer small.
const SUBMISSION_DISPATCHES: u32 = 4096;

/// Paths of one submission, about: systems end a device's work that takes more than two seconds.
const SUBMISSION_PATHS: u64 = 1 << 22;

/// A progressive render of one scene on one device.
pub struct Renderer {
    tracer: PathTracer,
    camera: Camera,
    partial_errors: Buffer,
    identity: Identity,
    samples: u32,
    seconds: f64,
}

impl Renderer {
    /// Uploads the scene, builds its acceleration structures, the kernels that it needs and a black film.
    ///
    /// # Errors
    /// A flaw of the scene, settings out of range, a traversal that the device lacks, out of memory.
    pub fn new(device: &Arc<Device>, scene: &Scene, settings: &Settings, options: &Options) -> Result<Renderer, Error> {
        scene.check()?;
        let upload = &mut Upload::now(device);
        let tracer = PathTracer::new(upload, &scene.recentred(), &[], settings, options, &Features::NONE)?;
        let crop = tracer.film().crop();
        let identity = Identity::new(
            &scene.hash(),
            [scene.film.width, scene.film.height],
            [crop.x, crop.y, crop.width, crop.height],
            settings,
            &format!("{} ({})", device.name(), device.driver()),
        );
        let mut renderer = Renderer {
            tracer,
            camera: scene.camera.clone(),
            partial_errors: Buffer::new(device, "partial errors", u64::from(ERROR_WORKGROUPS) * 4, Memory::Readback)?,
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
        self.identity.seed = seed;
        (self.samples, self.seconds) = (0, 0.0);
        self.tracer.set_seed(seed)?;
        let mut commands = Commands::begin(self.device())?;
        self.tracer.film().record_clear(&mut commands);
        wait(self.device().submit(commands)?)?;
        if self.tracer.settings().features { self.probe() } else { Ok(()) }
    }

    fn device(&self) -> &Arc<Device> {
        self.tracer.device()
    }

    /// Samples a pixel so far.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Pixels of the crop.
    pub fn pixel_count(&self) -> u64 {
        self.tracer.film().pixel_count()
    }

    /// Bytes on the device that hold paths in flight; the size of the picture is not in it.
    pub fn pool_bytes(&self) -> u64 {
        self.tracer.pool_bytes()
    }

    /// Bytes on the device that hold the picture.
    pub fn film_bytes(&self) -> u64 {
        self.tracer.film().bytes()
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
        self.tracer.traversal()
    }

    /// The names of the kernels that were built for this scene.
    pub fn kernel_names(&self) -> Vec<&'static str> {
        self.tracer.kernels().names()
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
        let batches: Vec<Batch> = self.tracer.batches(self.samples, samples).collect();
        let times = self.submit(&batches, timed, |commands, batch| self.tracer.record(commands, batch, |_, _| ()))?;
        self.samples += samples;
        Ok(times)
    }

    /// Depth and ids of the ray through each pixel's centre.
    fn probe(&mut self) -> Result<(), Error> {
        let batches: Vec<Batch> = self.tracer.batches(0, 1).collect();
        self.submit(&batches, false, |commands, batch| self.tracer.record_probe(commands, batch))?;
        Ok(())
    }

    fn submit(
        &self,
        batches: &[Batch],
        timed: bool,
        record: impl Fn(&mut Commands, &Batch),
    ) -> Result<KernelTimes, Error> {
        let mut times = KernelTimes::new();
        let most_paths = batches.iter().map(Batch::paths).max().unwrap_or(1).max(1);
        let by_dispatches = u64::from(SUBMISSION_DISPATCHES / self.tracer.settings().max_depth.saturating_mul(8));
        let per_submission = by_dispatches.min(SUBMISSION_PATHS / most_paths).max(1) as usize;
        let mut in_flight = None;
        for group in batches.chunks(per_submission) {
            let mut commands = Commands::begin(self.device())?;
            self.tracer.begin(&mut commands);
            if timed {
                commands.time_dispatches();
            }
            for batch in group {
                record(&mut commands, batch);
            }
            // The host records the next submission while the device works on this one.
            let submission = self.device().submit(commands)?;
            if let Some(previous) = in_flight.replace(submission) {
                add_times(&mut times, previous.wait()?);
            }
        }
        if let Some(last) = in_flight {
            add_times(&mut times, last.wait()?);
        }
        Ok(times)
    }

    /// The mean over the pixels of the standard error of the luminance over (luminance + 0.01). Sobol' samples err less
    /// than this estimate, which takes them for independent.
    pub fn estimate_error(&self) -> Result<f64, Error> {
        let mut commands = Commands::begin(self.device())?;
        self.tracer.record_error(&mut commands, self.samples, self.partial_errors.address());
        wait(self.device().submit(commands)?)?;
        let partial: Vec<f32> = self.partial_errors.read()?;
        Ok(partial.iter().map(|sum| f64::from(*sum)).sum::<f64>() / self.pixel_count() as f64)
    }

    /// Samples so far that were NaN or infinite; they count as black.
    pub fn rejected_samples(&self) -> Result<u32, Error> {
        Ok(self.tracer.film().rejected().read::<u32>()?.first().copied().unwrap_or(0))
    }

    /// The picture so far, and what its file should say about it.
    pub fn picture(&self) -> Result<(Picture, Metadata), Error> {
        let (film, settings) = (self.tracer.film(), self.tracer.settings());
        let crop = film.crop();
        let mut picture =
            film::picture(crop.width, crop.height, self.samples, &film.pixels().read()?, &film.read_features()?);
        picture.paths_shared_by = paths_shared_by(settings);
        let metadata = Metadata {
            scene_hash: self.identity.scene.clone(),
            spp: u64::from(self.samples),
            seed: u64::from(settings.seed),
            max_depth: settings.max_depth,
            clamp_indirect: settings.clamp_indirect.unwrap_or(0.0),
            render_seconds: self.seconds,
            device: self.identity.device.clone(),
            version: self.identity.version.clone(),
            sampler: settings.sampler.to_string(),
            traversal: self.traversal().to_string(),
            camera_eye: self.camera.eye.to_array(),
            camera_target: self.camera.target.to_array(),
            camera_up: self.camera.up.to_array(),
            vertical_fov_degrees: self.camera.vertical_fov_degrees,
            film_size: [self.identity.width, self.identity.height],
            crop_origin: [crop.x, crop.y],
        };
        Ok((picture, metadata))
    }

    /// The resumable state.
    pub fn checkpoint(&self) -> Result<Checkpoint, Error> {
        Ok(Checkpoint {
            identity: self.identity.clone(),
            samples: self.samples,
            seconds: self.seconds,
            rejected: self.rejected_samples()?,
            pixels: self.tracer.film().pixels().read()?,
            features: self.tracer.film().read_features()?,
        })
    }

    /// Goes on from a checkpoint of the same render.
    ///
    /// # Errors
    /// If it is of another one, naming what differs.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), Error> {
        checkpoint.check(&self.identity)?;
        self.tracer.film().restore(&checkpoint.pixels, &checkpoint.features, checkpoint.rejected)?;
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
