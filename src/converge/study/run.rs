//! Carries a study out: references, engines, renders in turn; keeps every picture and number on disk as it goes.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::engine::{Devices, Engine, Rendered};
use super::environment::Environment;
use super::error::Error;
use super::gram::Gram;
use super::ground_truth::{AboutTruth, GroundTruth, weights};
use super::method::Method;
use super::plan::{Plan, ScenePlan};
use super::record::{BiasTest, MethodRecord, Products, Question, Record, Run, SceneRecord};
use crate::converge::{Metrics, ZTest};
use crate::image::{Metadata, Picture, Samples, plane, read_exr, write_exr};
use crate::scene::{Film, Scene};

/// The record's name in a study's directory.
pub const RECORD_FILE: &str = "study.json";

/// What happens during a study.
pub enum Event<'a> {
    /// Something odd that did not stop it.
    Warning(String),
    /// A reference is being made: the scene, and the part done.
    Reference(&'a str, f64),
    /// References are there, methods are ready: renders follow.
    Begin,
    /// A render begins: what it is, and how much work of how much is done, in samples.
    Render {
        /// Scene and method.
        name: String,
        /// Samples of all renders so far.
        done: u64,
        /// Samples of all renders.
        total: u64,
    },
}

/// A scene and its models, loaded.
struct Loaded {
    plan: ScenePlan,
    scene: Scene,
    models: Vec<(String, Scene)>,
}

/// A method in a scene that can be rendered.
struct Ready<'a> {
    scene: usize,
    method: usize,
    engine: Engine<'a>,
}

/// Carries `plan` out in `directory`, or goes on with what is there, keeping references in `cache`. Once `stop` is set, what has been
/// rendered so far is the study. `observe` may be called from any thread.
///
/// # Errors
/// Mistakes in the plan or the scenes, another study in the directory, failing disks; a method that is not available is none, but
/// stands in the record with the reason. That no method at all can run is one.
pub fn run(
    plan: &Plan,
    directory: &Path,
    cache: &Path,
    resume: bool,
    observe: &(dyn Fn(Event) + Sync),
    stop: &AtomicBool,
) -> Result<Record, Error> {
    plan.check()?;
    let scenes = plan.scenes.iter().map(|scene| load(scene, plan, observe)).collect::<Result<Vec<_>, _>>()?;
    let file = directory.join(RECORD_FILE);
    let mut record = match (file.exists(), resume) {
        (true, true) => Record::read(&file)?,
        (true, false) => return Err(Error::Occupied { path: directory.to_owned() }),
        (false, _) => Record::new(Environment::here(), question(plan)),
    };
    check_question(&record, plan, &scenes, &file)?;
    record.question = question(plan);
    std::fs::create_dir_all(directory).map_err(|source| Error::Io { path: directory.to_owned(), source })?;

    let mut truths = Vec::new();
    for loaded in &scenes {
        match truths_of(loaded, plan, cache, observe, stop)? {
            Some(found) => truths.push(found),
            None => return Err(Error::Interrupted),
        }
    }
    check_references(&record, &truths, &file)?;
    if record.scenes.is_empty() {
        record.scenes = scenes.iter().zip(&truths).map(|(loaded, truths)| blank(loaded, plan, truths)).collect();
    }
    let mut devices = Devices::default();
    let mut ready = open(plan, &scenes, &mut devices, &mut record, observe);
    if ready.is_empty() {
        return Err(Error::NothingToRun(reasons(&record)));
    }
    for (loaded, truths) in scenes.iter().zip(&truths) {
        let path = truth_file(directory, &loaded.plan.name);
        let parent = path.parent().unwrap_or(directory);
        std::fs::create_dir_all(parent).map_err(|source| Error::Io { path: parent.to_owned(), source })?;
        write_exr(&path, &truths.scene.picture, &Metadata::default())?;
    }
    record.write(&file)?;
    observe(Event::Begin);
    render_all(plan, &truths, &mut ready, &mut record, directory, observe, stop)?;
    for (scene, truths) in record.scenes.iter_mut().zip(&truths) {
        for method in &mut scene.methods {
            conclude(method, &directory_of(directory, &scene.name, &method.name), truths, &plan.ladder)?;
        }
    }
    record.write(&file)?;
    Ok(record)
}

fn question(plan: &Plan) -> Question {
    Question {
        methods: plan.methods.iter().map(|method| (method.to_string(), method.label(&plan.methods))).collect(),
        max_depth: plan.max_depth,
        ladder: plan.ladder.clone(),
        repetitions: plan.repetitions,
        reference_spp: plan.reference_spp,
        seed: plan.seed,
        targets: plan.targets.clone(),
        exposure: plan.exposure,
        clock: plan.clock,
    }
}

/// Refuses to go on with another study. What only the report depends on may change.
fn check_question(record: &Record, plan: &Plan, scenes: &[Loaded], file: &Path) -> Result<(), Error> {
    let check = |name, found: String, expected: String| match found == expected {
        true => Ok(()),
        false => Err(Error::Mismatch { path: file.to_owned(), name, found, expected }),
    };
    let (found, expected) = (&record.question, question(plan));
    check("methods", format!("{:?}", found.methods), format!("{:?}", expected.methods))?;
    check("depth", found.max_depth.to_string(), expected.max_depth.to_string())?;
    check("spp", format!("{:?}", found.ladder), format!("{:?}", expected.ladder))?;
    check("repetitions", found.repetitions.to_string(), expected.repetitions.to_string())?;
    check("reference spp", found.reference_spp.to_string(), expected.reference_spp.to_string())?;
    check("seed", found.seed.to_string(), expected.seed.to_string())?;
    check("exposure", found.exposure.to_string(), expected.exposure.to_string())?;
    let here = Environment::here();
    check("version", record.environment.version.clone(), here.version)?;
    check("revision", record.environment.revision.clone(), here.revision)?;
    if !record.scenes.is_empty() {
        let of_record = |scene: &SceneRecord| format!("{} {} {:?}", scene.name, scene.hash, scene.models);
        let of_plan =
            |loaded: &Loaded| format!("{} {} {:?}", loaded.plan.name, loaded.scene.hash(), hashes(&loaded.models));
        check(
            "scenes",
            record.scenes.iter().map(of_record).collect::<Vec<_>>().join(", "),
            scenes.iter().map(of_plan).collect::<Vec<_>>().join(", "),
        )?;
    }
    Ok(())
}

/// Refuses to go on against another picture; where the file lies today does not matter.
fn check_references(record: &Record, truths: &[Truths], file: &Path) -> Result<(), Error> {
    for (scene, truths) in record.scenes.iter().zip(truths) {
        let (found, expected) = (&scene.truth, &truths.scene.about);
        if (AboutTruth { origin: expected.origin.clone(), ..found.clone() }) != *expected {
            let words = |truth: &AboutTruth| format!("{} (mean {}, noise {:e})", truth.origin, truth.mean, truth.mse);
            let (path, name) = (file.to_owned(), "the reference");
            return Err(Error::Mismatch { path, name, found: words(found), expected: words(expected) });
        }
    }
    Ok(())
}

fn hashes(models: &[(String, Scene)]) -> Vec<(String, String)> {
    models.iter().map(|(name, scene)| (name.clone(), scene.hash())).collect()
}

fn load(scene_plan: &ScenePlan, plan: &Plan, observe: &(dyn Fn(Event) + Sync)) -> Result<Loaded, Error> {
    let read = |file: &PathBuf| -> Result<Scene, Error> {
        let (mut scene, warnings) = Scene::load(file).map_err(|error| error.named_by(scene_plan.named_by.as_ref()))?;
        warnings.iter().for_each(|warning| observe(Event::Warning(warning.to_string())));
        if let Some([width, height]) = plan.size {
            scene.film = Film { width, height };
        }
        Ok(scene)
    };
    let scene = read(&scene_plan.file)?;
    let mut models = Vec::new();
    for (name, file) in &scene_plan.models {
        let model = read(file)?;
        if model.film != scene.film {
            return Err(Error::Setting {
                name: "the film of a model",
                found: format!("{}×{} ({name})", model.film.width, model.film.height),
                expected: format!("{}×{} as that of its scene", scene.film.width, scene.film.height),
            });
        }
        models.push((name.clone(), model));
    }
    Ok(Loaded { plan: scene_plan.clone(), scene, models })
}

/// What a scene's pictures are compared with.
struct Truths {
    /// The truth.
    scene: GroundTruth,
    /// What each model converges to.
    models: Vec<(String, GroundTruth)>,
}

impl Truths {
    /// What a method's estimator should converge to.
    fn of(&self, model: Option<&str>) -> Option<&GroundTruth> {
        match model {
            None => Some(&self.scene),
            Some(wanted) => self.models.iter().find(|(name, _)| name == wanted).map(|(_, truth)| truth),
        }
    }
}

fn truths_of(
    loaded: &Loaded,
    plan: &Plan,
    cache: &Path,
    observe: &(dyn Fn(Event) + Sync),
    stop: &AtomicBool,
) -> Result<Option<Truths>, Error> {
    let embree = |name: &str, scene: &Scene| {
        let progress = |part: f64| observe(Event::Reference(name, part));
        GroundTruth::embree(scene, plan.max_depth, plan.reference_spp, cache, progress, stop)
    };
    let scene = match &loaded.plan.reference {
        Some(path) => Some(GroundTruth::read(path, &loaded.scene)?),
        None => embree(&loaded.plan.name, &loaded.scene)?,
    };
    let Some(scene) = scene else { return Ok(None) };
    if !scene.about.has_variance {
        observe(Event::Warning(format!(
            "the reference of {} has no variance: its noise is not taken off, and bias cannot be tested",
            loaded.plan.name
        )));
    }
    let mut models = Vec::new();
    for (name, model) in &loaded.models {
        match embree(&format!("{}, {name}", loaded.plan.name), model)? {
            Some(truth) => models.push((name.clone(), truth)),
            None => return Ok(None),
        }
    }
    Ok(Some(Truths { scene, models }))
}

fn blank(loaded: &Loaded, plan: &Plan, truths: &Truths) -> SceneRecord {
    let method = |method: &Method| MethodRecord {
        name: method.to_string(),
        label: method.label(&plan.methods),
        model: method.model.clone(),
        unavailable: None,
        preparation: None,
        runs: Vec::new(),
        products: Vec::new(),
        bias: None,
    };
    SceneRecord {
        name: loaded.plan.name.clone(),
        hash: loaded.scene.hash(),
        models: hashes(&loaded.models),
        size: [loaded.scene.film.width, loaded.scene.film.height],
        truth: truths.scene.about.clone(),
        methods: plan.methods.iter().map(method).collect(),
    }
}

/// Opens what can be opened; the rest gets its reason into the record.
fn open<'a>(
    plan: &Plan,
    scenes: &'a [Loaded],
    devices: &mut Devices,
    record: &mut Record,
    observe: &(dyn Fn(Event) + Sync),
) -> Vec<Ready<'a>> {
    let mut ready = Vec::new();
    for (scene, loaded) in scenes.iter().enumerate() {
        for (index, method) in plan.methods.iter().enumerate() {
            let entry = &mut record.scenes[scene].methods[index];
            let wanted = method.model.as_deref();
            let rendered = match wanted {
                None => Some(&loaded.scene),
                Some(wanted) => loaded.models.iter().find(|(name, _)| name == wanted).map(|(_, model)| model),
            };
            let opened = match rendered {
                Some(rendered) => Engine::open(devices, rendered, method, plan.max_depth),
                None => Err(Error::Setting {
                    name: "model",
                    found: wanted.unwrap_or_default().to_owned(),
                    expected: format!("one of scene {}'s models in the study file", loaded.plan.name),
                }),
            };
            match opened {
                Ok((engine, preparation)) => {
                    // A resumed study keeps the figures of the cold start.
                    entry.preparation.get_or_insert(preparation);
                    entry.unavailable = None;
                    ready.push(Ready { scene, method: index, engine });
                }
                Err(error) => {
                    entry.unavailable = Some(error.to_string());
                    observe(Event::Warning(format!("{} in {}: not available: {error}", entry.label, loaded.plan.name)));
                }
            }
        }
    }
    ready
}

fn reasons(record: &Record) -> String {
    let lines = record.scenes.iter().flat_map(|scene| {
        scene.methods.iter().filter_map(move |method| {
            Some(format!("  {} in {}: {}", method.label, scene.name, method.unavailable.as_ref()?))
        })
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// All renders, repetition by repetition and methods in turn, so that whatever else the machine does hits all of them alike, and an
/// interrupted study has whole repetitions.
fn render_all(
    plan: &Plan,
    truths: &[Truths],
    ready: &mut [Ready],
    record: &mut Record,
    directory: &Path,
    observe: &(dyn Fn(Event) + Sync),
    stop: &AtomicBool,
) -> Result<(), Error> {
    let pixels = |record: &Record, scene: usize| record.scenes[scene].size.map(u64::from).iter().product::<u64>();
    let ladder: u64 = plan.ladder.iter().map(|spp| u64::from(*spp)).sum();
    let total: u64 = ready.iter().map(|ready| pixels(record, ready.scene) * ladder * u64::from(plan.repetitions)).sum();
    let mut done = 0;
    for repetition in 0..plan.repetitions {
        for (rung, spp) in plan.ladder.iter().copied().enumerate() {
            for Ready { scene, method, engine } in ready.iter_mut() {
                let truth = &truths[*scene].scene;
                let samples = pixels(record, *scene) * u64::from(spp);
                let scene_name = record.scenes[*scene].name.clone();
                let entry = &mut record.scenes[*scene].methods[*method];
                let pictures = directory_of(directory, &scene_name, &entry.name);
                let picture_file = picture_file(&pictures, spp, repetition);
                let is_done = entry.runs.iter().any(|run| (run.spp, run.repetition) == (spp, repetition));
                if !is_done || !picture_file.exists() {
                    entry.runs.retain(|run| (run.spp, run.repetition) != (spp, repetition));
                    observe(Event::Render { name: format!("{scene_name}, {}", entry.label), done, total });
                    let seed = plan.seed_of(rung, repetition);
                    let rendered = if stop.load(Ordering::SeqCst) { None } else { engine.render(spp, seed, stop)? };
                    let Some(rendered) = rendered else { return Ok(()) };
                    std::fs::create_dir_all(&pictures)
                        .map_err(|source| Error::Io { path: pictures.clone(), source })?;
                    let metadata = Metadata { spp: u64::from(spp), seed: u64::from(seed), ..Metadata::default() };
                    write_exr(&picture_file, &rendered.picture, &metadata)?;
                    entry.runs.push(measure(&rendered, truth, plan.exposure, spp, repetition, seed)?);
                    // After the picture: a run without one is rendered again.
                    record.write(&directory.join(RECORD_FILE))?;
                }
                done += samples;
            }
        }
    }
    observe(Event::Render { name: "done".into(), done, total });
    Ok(())
}

fn measure(
    rendered: &Rendered,
    truth: &GroundTruth,
    exposure: f32,
    spp: u32,
    repetition: u32,
    seed: u32,
) -> Result<Run, Error> {
    let metrics = Metrics::of(&rendered.picture, &truth.picture, exposure)?;
    Ok(Run {
        spp,
        repetition,
        seed,
        timing: rendered.timing,
        mse: metrics.mse,
        rel_mse: metrics.rel_mse,
        flip: metrics.flip,
        relative_bias: metrics.relative_bias,
        non_finite_pixels: metrics.non_finite_pixels,
        rejected_samples: rendered.rejected,
    })
}

/// Where the pictures of a method are.
pub fn directory_of(directory: &Path, scene: &str, method: &str) -> PathBuf {
    directory.join("pictures").join(scene).join(method)
}

/// The reference of a scene, as it was compared with.
pub fn truth_file(directory: &Path, scene: &str) -> PathBuf {
    directory.join("pictures").join(scene).join("reference.exr")
}

/// A run's picture.
pub fn picture_file(pictures: &Path, spp: u32, repetition: u32) -> PathBuf {
    pictures.join(format!("{spp}-{repetition}.exr"))
}

/// Pictures without variance whose spread tells it well enough for a test.
const FEWEST_FOR_SPREAD: usize = 8;

/// The products of differences of each rung, and the test of everything together.
fn conclude(entry: &mut MethodRecord, pictures: &Path, truths: &Truths, ladder: &[u32]) -> Result<(), Error> {
    entry.products.clear();
    entry.bias = None;
    let Some([plain, relative]) = weights(&truths.scene.picture) else { return Ok(()) };
    let truth = truths.scene.picture.rgb(plane::BEAUTY).unwrap_or_default();
    let mut everything = Vec::new();
    for spp in ladder.iter().copied() {
        let mut runs: Vec<&Run> =
            entry.runs.iter().filter(|run| run.spp == spp && run.non_finite_pixels == 0).collect();
        runs.sort_by_key(|run| run.repetition);
        let mut differences = Vec::new();
        for run in runs {
            let picture = read_exr(picture_file(pictures, spp, run.repetition))?.0;
            let beauty = picture.rgb(plane::BEAUTY).unwrap_or_default();
            let pairs = beauty.as_flattened().iter().zip(truth.as_flattened());
            differences.push(pairs.map(|(x, r)| f64::from(*x) - f64::from(*r)).collect::<Vec<f64>>());
            // One sample's variance is 0, which says that it is not known; a picture without the plane is judged by its spread.
            if spp > 1 || picture.rgb(plane::VARIANCE).is_none() {
                everything.push(picture);
            }
        }
        if differences.is_empty() {
            continue;
        }
        let count = differences.len() as f64;
        let mean: Vec<f64> =
            (0..plain.len()).map(|i| differences.iter().map(|list| list[i]).sum::<f64>() / count).collect();
        entry.products.push(Products {
            spp,
            mse: Gram::of(&differences, &plain),
            rel_mse: Gram::of(&differences, &relative),
            mse_uncertainty: truths.scene.uncertainty(&plain, &mean),
            rel_mse_uncertainty: truths.scene.uncertainty(&relative, &mean),
        });
    }
    if let Some(expected) = truths.of(entry.model.as_deref()).filter(|truth| truth.about.has_variance)
        && let Some(mean) = average(&everything)
        && mean.rgb(plane::VARIANCE).is_some()
        && (everything[0].rgb(plane::VARIANCE).is_some() || everything.len() >= FEWEST_FOR_SPREAD)
    {
        entry.bias = Some(test(&mean, expected)?);
    }
    Ok(())
}

/// All samples of independent pictures as one picture; `None` of none. Its variance is that of theirs, or, where they have none,
/// that of their spread about it; absent if there is a single one.
pub fn average(pictures: &[Picture]) -> Option<Picture> {
    let first = pictures.first()?;
    let count = first.pixels();
    let mut samples = vec![0u64; count];
    let mut sums = vec![[0.0f64; 3]; count];
    for picture in pictures {
        let beauty = picture.rgb(plane::BEAUTY)?;
        for (pixel, weight) in picture.u32(plane::SAMPLES)?.iter().enumerate() {
            samples[pixel] += u64::from(*weight);
            sums[pixel] = std::array::from_fn(|c| sums[pixel][c] + f64::from(*weight) * f64::from(beauty[pixel][c]));
        }
    }
    let total = |pixel: usize| samples[pixel].max(1) as f64;
    let mean: Vec<[f64; 3]> = (0..count).map(|pixel| sums[pixel].map(|sum| sum / total(pixel))).collect();

    let mut variance = vec![[0.0f64; 3]; count];
    let has_variance = pictures.iter().all(|picture| picture.rgb(plane::VARIANCE).is_some());
    for picture in pictures {
        let weights = picture.u32(plane::SAMPLES)?;
        let plane = picture.rgb(if has_variance { plane::VARIANCE } else { plane::BEAUTY })?;
        for pixel in 0..count {
            let part = f64::from(weights[pixel]) / total(pixel);
            variance[pixel] = std::array::from_fn(|c| {
                let value = f64::from(plane[pixel][c]);
                variance[pixel][c]
                    + match has_variance {
                        true => part * part * value,
                        // Σ n (x − m)² / (K − 1) is the variance of a sample.
                        false => part * (value - mean[pixel][c]).powi(2) / (pictures.len() as f64 - 1.0),
                    }
            });
        }
    }
    let mut picture = Picture::new(first.width, first.height);
    picture.paths_shared_by = pictures.iter().map(|picture| picture.paths_shared_by).max().unwrap_or(1);
    let narrow = |plane: &[[f64; 3]]| plane.iter().map(|pixel| pixel.map(|value| value as f32)).collect::<Vec<_>>();
    picture.set_rgb(plane::BEAUTY, &narrow(&mean));
    if has_variance || pictures.len() > 1 {
        picture.set_rgb(plane::VARIANCE, &narrow(&variance));
    }
    let most = u64::from(u32::MAX);
    picture.set(plane::SAMPLES, Samples::U32(samples.iter().map(|count| (*count).min(most) as u32).collect()));
    Some(picture)
}

fn test(mean: &Picture, expected: &GroundTruth) -> Result<BiasTest, Error> {
    let test = ZTest::for_noise(mean, &expected.picture)?;
    let metrics = Metrics::of(mean, &expected.picture, 0.0)?;
    Ok(BiasTest {
        spp: mean.u32(plane::SAMPLES).and_then(|samples| samples.iter().min().copied()).unwrap_or(0).into(),
        reference_spp: expected.about.spp,
        p_blocks: test.p_blocks,
        p_mean: test.p_mean,
        p: test.p,
        block: test.block,
        z_mean: test.z_mean,
        worst_z: test.worst_z,
        worst_pixel: test.worst_pixel,
        z_rms: test.z_rms,
        relative_bias: metrics.relative_bias,
    })
}
