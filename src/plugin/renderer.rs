//! A progressive render that a host drives.

use std::any::Any;
use std::collections::VecDeque;
use std::sync::Arc;

use super::change::{Before, Change, Touched, apply};
use super::error::Error;
use super::layout::DevelopPass;
use super::mark::Mark;
use super::slots::{Slots, Status};
use super::target::{Channel, PixelFormat, Place, Target};
use crate::gpu::{self, Buffer, Commands, Device, HostMesh, Kernel, Memory, Update, Upload, spirv};
use crate::render::{self, Features, PathTracer, Settings, Traversal};
use crate::scene::{Environment, Flaw, Scene, Sun};

/// What a host may choose.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// What changes the picture. Feature channels are off unless the host wants them as targets.
    pub settings: Settings,
    /// How rays find triangles; `None` takes what suits the device.
    pub traversal: Option<Traversal>,
    /// Paths in flight, ≥ 1; `None` takes what suits the device. They bound the memory, 100 to 200 bytes each. A film with fewer than a
    /// sixteenth as many pixels has no use for them all, and has fewer until [`Renderer::resize`] makes it larger.
    pub pool_paths: Option<u32>,
    /// Recordings that may be pending at once, ≥ 1.
    pub frames_in_flight: u32,
    /// What the scene does not have but a [`Change`] may bring: kernels are built for it too.
    pub reserve: Features,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            settings: Settings { features: false, ..Settings::default() },
            traversal: None,
            pool_paths: None,
            frames_in_flight: 3,
            reserve: Features::NONE,
        }
    }
}

/// What a frame is to do.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// More samples of every pixel; 0 only writes the picture so far.
    pub samples: u32,
    /// Where the picture goes, that with these samples.
    pub targets: &'a [Target],
    /// Whether [`Status::error`] is wanted: one more pass over the film.
    pub estimates_error: bool,
}

impl<'a> Frame<'a> {
    /// So many more samples into those targets, with an estimate of the error.
    pub fn new(samples: u32, targets: &'a [Target]) -> Frame<'a> {
        Frame { samples, targets, estimates_error: true }
    }
}

/// A progressive render of one scene, of which every step is recorded into a host's commands.
///
/// What may be called when: everything at any time, from any thread, one thread at a time (`&mut`). Command buffers that it
/// recorded into are submitted once each, in the order of the recordings, on queues that keep that order (one queue, or
/// semaphores between them); they need not be done when the next one is recorded, up to [`Options::frames_in_flight`]. It is
/// dropped when all of them are done.
pub struct Renderer {
    device: Arc<Device>,
    tracer: PathTracer,
    develop: Kernel,
    scene: Scene,
    /// Meshes that only the device has.
    device_only: Vec<usize>,
    top_level: Update,
    /// Packed pixels on their way to a target.
    packed: Buffer,
    slots: Slots,
    frames_in_flight: u32,
    /// Not recorded yet, oldest first.
    pending: Vec<Upload>,
    /// Those that are not known to be done, oldest first: numbers behind `completed` up to `recorded`.
    recordings: VecDeque<Recording>,
    /// What recordings up to the number may use.
    retired: VecDeque<(u64, Box<dyn Any + Send>)>,
    recorded: u64,
    completed: u64,
    samples: u32,
    /// The next frame begins with a black film.
    begins_anew: bool,
}

/// What abandoning a recording takes.
struct Recording {
    uploads: Vec<Upload>,
    /// As they were before.
    samples: u32,
    begins_anew: bool,
}

impl Renderer {
    /// Prepares all that the CPU has to do, makes the kernels, and takes the memory. Nothing is submitted: the first recording
    /// uploads. It takes as long as the driver compiles, on all cores of rayon's pool, and may be called on any thread.
    ///
    /// # Errors
    /// A flaw of the scene, settings out of range, a traversal that the device lacks, out of memory.
    pub fn new(device: &Arc<Device>, scene: Scene, options: &Options) -> Result<Renderer, Error> {
        Renderer::with_host_meshes(device, scene, &[], options)
    }

    /// The same with meshes from the host's buffers: those with an index into [`Scene::meshes`] here. The first recording reads
    /// them, and copies them on the device.
    ///
    /// The scene's mesh has the materials: one, or one a triangle. Ray query needs no more of it than two positions, opposite
    /// corners of a box around the vertices. The BVH, which is built on the CPU, and triangles that emit need the scene's mesh whole, with
    /// the same vertices and triangles; then the device's copy of them is still the host's.
    ///
    /// # Errors
    /// As of [`Renderer::new`], and a host's mesh that does not go with the scene's or with the traversal.
    pub fn with_host_meshes(
        device: &Arc<Device>,
        scene: Scene,
        host_meshes: &[(u32, HostMesh)],
        options: &Options,
    ) -> Result<Renderer, Error> {
        let mut scene = scene;
        scene.check()?;
        options.reserve.check()?;
        let mut device_only = Vec::new();
        for (index, _) in host_meshes {
            let index = *index as usize;
            let expected = || format!("below {}", scene.meshes.len());
            let mesh = scene.meshes.get(index).ok_or_else(|| Flaw {
                part: "index of a host's mesh".into(),
                found: index.to_string(),
                expected: expected(),
            })?;
            if mesh.triangles.is_empty() {
                device_only.push(index);
            }
        }
        check_lamps(&scene, &device_only)?;
        // A sky of any kind is a sky.
        let environment = options.reserve.environment || options.reserve.uneven_sky;
        let reserve = Features { environment, ..options.reserve };
        complete_lights(&mut scene, &reserve);
        let Options { settings, traversal, pool_paths, .. } = *options;
        if options.frames_in_flight == 0 {
            let found = "0".to_string();
            return Err(render::Error::Setting { name: "frames in flight", found, expected: "at least 1" }.into());
        }
        let mut upload = Upload::later(device);
        let choices = render::Options { traversal, pool_paths };
        let tracer = PathTracer::new(&mut upload, &scene, host_meshes, &settings, &choices, &reserve)?;
        let source = spirv::load("develop").ok_or(render::Error::MissingKernel("develop"))?;
        Ok(Renderer {
            develop: Kernel::new(device, source, &[])?,
            packed: packed_pixels(device, tracer.film().pixel_count())?,
            slots: Slots::new(device, options.frames_in_flight)?,
            frames_in_flight: options.frames_in_flight,
            device: device.clone(),
            tracer,
            scene,
            device_only,
            top_level: Update::Rebuild,
            pending: vec![upload],
            recordings: VecDeque::new(),
            retired: VecDeque::new(),
            recorded: 0,
            completed: 0,
            samples: 0,
            begins_anew: true,
        })
    }

    /// The scene as it is now. A sky or a sun that the kernels were built for and that is gone is there as a black one.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Samples a pixel that the recordings so far take.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// How its rays find triangles.
    pub fn traversal(&self) -> Traversal {
        self.tracer.traversal()
    }

    /// What its kernels were built for.
    pub fn features(&self) -> &Features {
        self.tracer.features()
    }

    /// Pixels across and down: what a target must have room for.
    pub fn size(&self) -> [u32; 2] {
        let crop = self.tracer.film().crop();
        [crop.width, crop.height]
    }

    /// Changes the scene, all of it or, on an error, nothing. The next frame uploads what is new and begins with a black film.
    /// Little data travels in the command buffer; more takes staging memory here, none in a frame.
    ///
    /// # Errors
    /// A flaw of what is new, [`Error::NewRenderer`] for what the kernels cannot do, out of memory.
    pub fn update(&mut self, changes: &[Change]) -> Result<(), Error> {
        let mut before = Before::of(&self.scene);
        let staged = match apply(&mut self.scene, changes, &mut before) {
            Ok(touched) => {
                complete_lights(&mut self.scene, self.tracer.features());
                self.stage(&before, touched)
            }
            Err(flaw) => Err(flaw.into()),
        };
        staged.inspect_err(|_| before.restore(&mut self.scene))
    }

    /// The scene as these changes would make it: for a new renderer, where [`Renderer::update`] says that it takes one.
    ///
    /// # Errors
    /// A change that makes no sense.
    pub fn scene_with(&self, changes: &[Change]) -> Result<Scene, Error> {
        let mut scene = self.scene.clone();
        let mut before = Before::of(&scene);
        apply(&mut scene, changes, &mut before)?;
        Ok(scene)
    }

    /// How the top level over all instances follows changes from now on; at first it is rebuilt each time. The first refit is a
    /// rebuild, of a top level that can be refitted. A host whose instances move far asks for a rebuild now and then.
    pub fn set_top_level(&mut self, by: Update) {
        self.top_level = by;
    }

    fn stage(&mut self, before: &Before, mut touched: Touched) -> Result<(), Error> {
        if touched.scene.lights {
            check_lamps(&self.scene, &self.device_only)?;
        }
        touched.scene.top_level = self.top_level;
        let mut upload = Upload::later(&self.device);
        if touched.camera {
            self.tracer.set_camera(&mut upload, &self.scene)?;
        }
        if touched.is_scene() {
            let next = self.tracer.changed(&mut upload, &self.scene, &before.materials(&self.scene), &touched.scene)?;
            let old = self.tracer.take(next);
            self.retire(old);
        }
        if touched.camera || touched.is_scene() {
            self.pending.push(upload);
            self.reset();
        }
        Ok(())
    }

    /// The next frame begins with a black film.
    pub fn reset(&mut self) {
        self.samples = 0;
        self.begins_anew = true;
    }

    /// Gives the film another size, as of a window, and begins anew. A larger film than there was has more paths in flight, too, where
    /// [`Options::pool_paths`] were more than the smaller ones had use for.
    ///
    /// # Errors
    /// A film without pixels, a crop beyond it, out of memory: then it is as large as before.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<(), Error> {
        if width == 0 || height == 0 {
            let expected = "at least 1x1: a window that is minimised needs no other";
            return Err(render::Error::Setting { name: "film", found: format!("{width}x{height}"), expected }.into());
        }
        let before = std::mem::replace(&mut self.scene.film, crate::scene::Film { width, height });
        let resized = self.resized();
        if resized.is_err() {
            self.scene.film = before;
        }
        resized
    }

    fn resized(&mut self) -> Result<(), Error> {
        let mut upload = Upload::later(&self.device);
        let film = self.tracer.new_film(&mut upload, &self.scene)?;
        let packed = packed_pixels(&self.device, film.pixel_count())?;
        let old = (self.tracer.take_film(film), std::mem::replace(&mut self.packed, packed));
        self.retire(old);
        self.pending.push(upload);
        self.reset();
        Ok(())
    }

    /// Records what the next frame would otherwise upload first, so that it takes place at a moment of the host's choice. The
    /// recording counts as a frame in flight. Returns its number.
    ///
    /// # Errors
    /// Too many frames in flight, commands of another device, a mistake made in the commands before.
    pub fn record_upload(&mut self, commands: &mut Commands) -> Result<u64, Error> {
        let ticket = self.begin(commands)?;
        self.record_pending(commands);
        self.slots.record_mark(commands, ticket, Mark::Done);
        commands.barrier_to_host();
        commands.check()?;
        self.finish(ticket);
        Ok(ticket)
    }

    /// Records a frame: what changed, `samples` more samples of every pixel, and the picture's way to the targets. Nothing is
    /// submitted, waited for or allocated. Returns the recording's number, for [`Renderer::complete`].
    ///
    /// On an error the command buffer is in no state to be submitted. A recording that is never submitted is to be
    /// [abandoned](Renderer::abandon).
    ///
    /// # Errors
    /// Too many frames in flight, commands of another device, a target that is too small, a mistake made in the commands before.
    pub fn record(&mut self, commands: &mut Commands, frame: &Frame) -> Result<u64, Error> {
        let (asked, taken) = (frame.samples, if self.begins_anew { 0 } else { self.samples });
        let samples = taken.checked_add(asked).ok_or(Error::Samples { asked, taken })?;
        for target in frame.targets {
            self.check_target(target)?;
        }
        let ticket = self.begin(commands)?;
        self.record_pending(commands);
        commands.timestamp("neubrdf frame");
        self.tracer.begin(commands);
        if self.begins_anew {
            self.tracer.film().record_clear(commands);
            if self.tracer.settings().features {
                self.slots.record_mark(commands, ticket, Mark::Probe);
                for batch in self.tracer.batches(0, 1) {
                    self.tracer.record_probe(commands, &batch);
                }
            }
        }
        for (index, batch) in (0..).zip(self.tracer.batches(taken, asked)) {
            self.tracer.record(commands, &batch, |commands, bounce| {
                self.slots.record_mark(commands, ticket, Mark::Bounce { batch: index, bounce });
            });
        }
        self.slots.record_mark(commands, ticket, Mark::Develop);
        self.slots.record_status(commands, ticket, &self.tracer, samples, frame.estimates_error);
        for target in frame.targets {
            self.record_target(commands, target, samples);
        }
        commands.barrier();
        self.slots.record_mark(commands, ticket, Mark::Done);
        commands.barrier_to_host();
        commands.check()?;
        self.slots.keep(ticket, self.tracer.film().pixel_count(), samples, frame.estimates_error);
        self.finish(ticket);
        self.samples = samples;
        self.begins_anew = false;
        Ok(ticket)
    }

    /// The host knows, from a fence or a semaphore, that the recording of that number and all before it are done: gives back
    /// what they alone used. Returns what a frame left to be read; `None` if the number is no frame's, or a later frame has
    /// taken its place. It never waits.
    pub fn complete(&mut self, ticket: u64) -> Option<Status> {
        self.completed = self.completed.max(ticket.min(self.recorded));
        while self.retired.front().is_some_and(|(number, _)| *number <= self.completed) {
            self.retired.pop_front();
        }
        // Also what others let go of while this was recorded.
        self.device.free_retired();
        let pending = (self.recorded - self.completed) as usize;
        self.recordings.drain(..self.recordings.len() - pending);
        self.slots.status(ticket)
    }

    /// The recording of that number and all after it will never be submitted, as where a window's images went out of date: the next one uploads
    /// what they were to, goes on from the samples that were taken before them, and has that number. What was changed meanwhile stays. Meshes in
    /// the host's buffers that they were to read, the next one reads.
    ///
    /// # Errors
    /// No recording of that number is in flight.
    pub fn abandon(&mut self, ticket: u64) -> Result<(), Error> {
        let in_flight = self.completed + 1..=self.recorded;
        if !in_flight.contains(&ticket) {
            return Err(Error::NotInFlight { ticket, in_flight });
        }
        let abandoned = self.recordings.split_off((ticket - self.completed - 1) as usize);
        self.slots.forget(ticket);
        self.recorded = ticket - 1;
        // One that would have begun anew leaves that to the next, as does what was changed since.
        self.begins_anew |= abandoned.iter().any(|recording| recording.begins_anew);
        let before = abandoned.front().map_or(0, |recording| recording.samples);
        self.samples = if self.begins_anew { 0 } else { before };
        let uploads = abandoned.into_iter().flat_map(|recording| recording.uploads);
        self.pending.splice(..0, uploads);
        Ok(())
    }

    /// What to say where a call of the host's returned `VK_ERROR_DEVICE_LOST`: how far the oldest recording came that is not
    /// known to be done.
    pub fn device_lost(&self) -> gpu::Error {
        let pending = self.completed + 1..=self.recorded;
        let marks = pending.map(|ticket| (ticket, self.slots.mark(ticket)));
        let last_pass = marks
            .filter(|(_, mark)| *mark != Mark::Done)
            .map(|(ticket, mark)| format!("{mark} of recording {ticket}"))
            .next();
        gpu::Error::DeviceLost { device: self.device.name().to_string(), last_pass }
    }

    /// The recording's number, if there is room for it.
    fn begin(&mut self, commands: &mut Commands) -> Result<u64, Error> {
        if !Arc::ptr_eq(commands.device(), &self.device) {
            return Err(Error::OtherDevice);
        }
        let pending = self.recorded - self.completed;
        if pending >= u64::from(self.frames_in_flight) {
            return Err(Error::FramesInFlight { pending, most: self.frames_in_flight });
        }
        commands.check()?;
        let ticket = self.recorded + 1;
        self.slots.begin(ticket);
        // What the frame before wrote and read.
        commands.barrier();
        self.slots.record_mark(commands, ticket, Mark::Upload);
        commands.barrier();
        Ok(ticket)
    }

    fn record_pending(&self, commands: &mut Commands) {
        self.pending.iter().for_each(|upload| upload.record(commands));
    }

    fn finish(&mut self, ticket: u64) {
        self.recorded = ticket;
        let uploads = std::mem::take(&mut self.pending);
        self.recordings.push_back(Recording { uploads, samples: self.samples, begins_anew: self.begins_anew });
    }

    /// Keeps what recordings so far may use.
    fn retire(&mut self, object: impl Any + Send) {
        self.retired.push_back((self.recorded, Box::new(object)));
    }

    fn check_target(&self, target: &Target) -> Result<(), Error> {
        let Target { channel, format, exposure, .. } = *target;
        if !exposure.is_finite() {
            return Err(Error::Exposure { found: exposure });
        }
        if channel != Channel::Beauty {
            if !self.tracer.settings().features {
                return Err(Error::NoFeatures { channel: channel.name() });
            }
            if matches!(format, PixelFormat::Rgba8 | PixelFormat::Bgra8) {
                return Err(Error::Format { channel: channel.name() });
            }
        }
        let [width, height] = self.size();
        match &target.place {
            Place::Image(image) => match image.room() {
                [across, down] if across < width || down < height => Err(Error::TargetSize {
                    found: format!("{across}x{down} texels"),
                    needed: format!("{width}x{height}"),
                }),
                _ => Ok(()),
            },
            Place::Buffer(buffer) => {
                let needed = self.tracer.film().pixel_count() * u64::from(format.bytes());
                match buffer.size() < needed {
                    true => {
                        Err(Error::TargetSize { found: format!("{} bytes", buffer.size()), needed: needed.to_string() })
                    }
                    false => Ok(()),
                }
            }
        }
    }

    fn record_target(&self, commands: &mut Commands, target: &Target, samples: u32) {
        let film = self.tracer.film();
        let pixel_count = film.pixel_count() as u32;
        let push = DevelopPass {
            pixels: film.pixels().address(),
            features: film.feature_pixels().map_or(0, Buffer::address),
            packed_pixels: self.packed.address(),
            pixel_count,
            sample_count: samples,
            channel: target.channel as u32,
            format: target.format as u32,
            exposure: target.exposure,
            padding: 0,
        };
        // The target before has been copied.
        commands.barrier();
        commands.dispatch(&self.develop, self.develop.strided_groups_for(pixel_count), &push);
        commands.barrier();
        let bytes = target.format.bytes();
        match &target.place {
            Place::Image(image) => commands.copy_to_host_image(&self.packed, image, self.size(), bytes),
            Place::Buffer(buffer) => {
                commands.copy_to_host_buffer(&self.packed, buffer, film.pixel_count() * u64::from(bytes));
            }
        }
    }
}

fn packed_pixels(device: &Arc<Device>, count: u64) -> gpu::Result<Buffer> {
    Buffer::new(device, "packed pixels", count * u64::from(PixelFormat::Rgba32Float.bytes()), Memory::Device)
}

/// Lamps are sampled by a table that the CPU makes of their triangles.
fn check_lamps(scene: &Scene, device_only: &[usize]) -> Result<(), Error> {
    for mesh in device_only.iter().map(|index| &scene.meshes[*index]) {
        let materials = mesh.materials.iter().map(|index| &scene.materials[*index as usize]);
        if let Some(lamp) = materials.into_iter().find(|material| material.is_emissive()) {
            let found = format!("on the device alone, and its material '{}' emits", lamp.name);
            let expected = "in the scene too, with the same triangles, to be a lamp".to_string();
            return Err(Error::HostMesh { mesh: mesh.name.clone(), found, expected });
        }
    }
    Ok(())
}

/// Kernels that were built for a sky or a sun find one: a black one where there is none.
fn complete_lights(scene: &mut Scene, features: &Features) {
    if features.environment && scene.environment.is_none() {
        scene.environment = Some(Environment::constant(glam::Vec3::ZERO));
    }
    if features.sun && scene.sun.is_none() {
        scene.sun = Some(Sun { direction: glam::Vec3::Y, irradiance: glam::Vec3::ZERO });
    }
}
