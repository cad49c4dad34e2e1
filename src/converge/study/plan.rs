//! What a study is to do, and the TOML file that says so.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::error::Error;
use super::method::{AXES, Axes, Method};
use crate::image::tone_map::MOST_EXPOSURE;
use crate::scene::table::{Source, Table, Value, read_text};
use crate::scene::{Film, Place};

/// Longest study or assertion file, bytes.
pub(super) const LONGEST_FILE: u64 = 1 << 20;

/// Which seconds count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// Those on the wall.
    #[default]
    Wall,
    /// Those that processors were busy for the render, all threads together: for CPU devices on a busy machine.
    Cpu,
}

/// A scene of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScenePlan {
    /// Its name in the report and in file names.
    pub name: String,
    /// The scene file: the truth.
    pub file: PathBuf,
    /// A picture of the truth to use instead of Embree's.
    pub reference: Option<PathBuf>,
    /// Scene files of the same scene with other models of its materials, by name.
    pub models: Vec<(String, PathBuf)>,
    /// The study file that names them, unless the user did.
    #[serde(skip)]
    pub named_by: Option<Place>,
}

/// What a study is to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// What to render.
    pub scenes: Vec<ScenePlan>,
    /// How.
    pub methods: Vec<Method>,
    /// Path segments.
    pub max_depth: u32,
    /// Size of the film instead of the scenes'.
    pub size: Option<[u32; 2]>,
    /// Samples a pixel, ascending.
    pub ladder: Vec<u32>,
    /// Independent renders of each method and rung of the ladder.
    pub repetitions: u32,
    /// Samples a pixel of the reference.
    pub reference_spp: u32,
    /// Another seed gives independent noise.
    pub seed: u32,
    /// relMSE for which the time is wanted.
    pub targets: Vec<f64>,
    /// Exposure that FLIP and thumbnails see pictures at, stops.
    pub exposure: f32,
    /// Which seconds count.
    pub clock: Clock,
}

impl Default for Plan {
    fn default() -> Plan {
        Plan {
            scenes: Vec::new(),
            methods: Vec::new(),
            max_depth: 16,
            size: None,
            ladder: vec![4, 16, 64, 256],
            repetitions: 4,
            reference_spp: 4096,
            seed: 0,
            targets: vec![1e-2, 1e-3],
            exposure: 0.0,
            clock: Clock::Wall,
        }
    }
}

impl ScenePlan {
    /// A scene file, named after its directory if the file's own name says nothing.
    pub fn new(file: impl Into<PathBuf>) -> ScenePlan {
        let file = file.into();
        let word = |part: Option<&std::ffi::OsStr>| part.map(|part| part.to_string_lossy().into_owned());
        let name = match word(file.file_stem()) {
            Some(stem) if stem != "scene" => stem,
            stem => word(file.parent().and_then(Path::file_name)).or(stem).unwrap_or_else(|| "scene".into()),
        };
        ScenePlan { name, file, reference: None, models: Vec::new(), named_by: None }
    }
}

impl Plan {
    /// Reads a study file; paths in it are relative to it.
    pub fn read(path: &Path) -> Result<Plan, Error> {
        let text = read_text(path, LONGEST_FILE)?;
        let source = Source { file: path, text: &text };
        let entries = source.parse()?;
        let root = Table::root(source, &entries);
        root.allow(&[
            "scene",
            "methods",
            "depth",
            "size",
            "spp",
            "repetitions",
            "reference_spp",
            "seed",
            "targets",
            "exposure",
            "clock",
        ])?;
        let mut plan = Plan::default();
        for value in root.get("scene").map_or(Ok(Vec::new()), |value| value.array())? {
            plan.scenes.push(scene(&value.table()?, path)?);
        }
        for value in root.get("methods").map_or(Ok(Vec::new()), |value| value.array())? {
            for method in methods(&value.table()?)? {
                if !plan.methods.contains(&method) {
                    plan.methods.push(method);
                }
            }
        }
        read_integer(&root, "depth", 1, 65_535, &mut plan.max_depth)?;
        read_integer(&root, "repetitions", 1, 10_000, &mut plan.repetitions)?;
        read_integer(&root, "reference_spp", 2, u32::MAX, &mut plan.reference_spp)?;
        read_integer(&root, "seed", 0, u32::MAX, &mut plan.seed)?;
        if let Some(value) = root.get("size") {
            let size =
                value.array()?.iter().map(|side| side.integer(1, Film::LONGEST_SIDE)).collect::<Result<Vec<_>, _>>()?;
            plan.size = Some(size.try_into().map_err(|_| value.error("an array of a width and a height"))?);
        }
        if let Some(value) = root.get("spp") {
            plan.ladder = value.array()?.iter().map(|spp| spp.integer(1, u32::MAX)).collect::<Result<_, _>>()?;
        }
        if let Some(value) = root.get("targets") {
            let target = |value: &Value| Ok::<_, Error>(shortest(value.number(f32::MIN_POSITIVE, 1e6)?));
            plan.targets = value.array()?.iter().map(target).collect::<Result<_, _>>()?;
        }
        if let Some(value) = root.get("exposure") {
            plan.exposure = value.number(-MOST_EXPOSURE, MOST_EXPOSURE)?;
        }
        if let Some(value) = root.get("clock") {
            plan.clock = match value.string()? {
                "wall" => Clock::Wall,
                "cpu" => Clock::Cpu,
                _ => return Err(value.error("\"wall\" or \"cpu\"").into()),
            };
        }
        Ok(plan)
    }

    /// Refuses plans that make no sense.
    pub fn check(&self) -> Result<(), Error> {
        let wrong =
            |name, found: String, expected: &str| Err(Error::Setting { name, found, expected: expected.to_owned() });
        if self.scenes.is_empty() {
            return wrong("the list of scenes", "empty".into(), "one scene or more");
        }
        if self.methods.is_empty() {
            return wrong("the list of methods", "empty".into(), "one method or more");
        }
        let is_ascending = self.ladder.windows(2).all(|pair| pair[0] < pair[1]);
        if self.ladder.is_empty() || self.ladder[0] == 0 || !is_ascending {
            return wrong(
                "the ladder of spp",
                format!("{:?}", self.ladder),
                "one number or more, from 1 on, ascending",
            );
        }
        let mut names: Vec<&str> = self.scenes.iter().map(|scene| scene.name.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return wrong(
                "a scene's name",
                format!("'{}' twice", twice[0]),
                "a name of its own; set it in a study file",
            );
        }
        for name in names.iter().chain(
            self.scenes
                .iter()
                .flat_map(|scene| &scene.models)
                .map(|(name, _)| name.as_str())
                .collect::<Vec<_>>()
                .iter(),
        ) {
            if name.is_empty() || !name.chars().all(|char| char.is_alphanumeric() || "-_".contains(char)) {
                return wrong("a name", format!("'{name}'"), "letters, digits, - and _, as it names files");
            }
        }
        Ok(())
    }

    /// The seed of a repetition of a rung: all of a method are independent of each other.
    pub fn seed_of(&self, rung: usize, repetition: u32) -> u32 {
        self.seed.wrapping_add((rung as u32).wrapping_mul(self.repetitions)).wrapping_add(repetition)
    }
}

/// The number that the digits of a file's `f32` stand for.
pub(super) fn shortest(number: f32) -> f64 {
    number.to_string().parse().unwrap_or(f64::from(number))
}

fn read_integer(table: &Table, key: &str, least: u32, most: u32, target: &mut u32) -> Result<(), Error> {
    if let Some(value) = table.get(key) {
        *target = value.integer(least, most)?;
    }
    Ok(())
}

fn scene(table: &Table, study: &Path) -> Result<ScenePlan, Error> {
    table.allow(&["file", "name", "reference", "models"])?;
    let beside = |value: &Value| Ok::<_, Error>(study.parent().unwrap_or(Path::new("")).join(value.string()?));
    let file = beside(&table.require("file")?)?;
    let mut scene = ScenePlan { named_by: Some(table.place()), ..ScenePlan::new(file) };
    if let Some(name) = table.get("name") {
        scene.name = name.string()?.to_owned();
    }
    scene.reference = table.get("reference").map(|value| beside(&value)).transpose()?;
    if let Some(models) = table.get("models") {
        for (name, value) in models.table()?.iter() {
            if name == "truth" {
                return Err(value.error("another name: `truth` is the scene as it is").into());
            }
            scene.models.push((name.to_owned(), beside(&value)?));
        }
    }
    Ok(scene)
}

fn methods(table: &Table) -> Result<Vec<Method>, Error> {
    // In files as in flags, but for the dash.
    let keys = AXES.map(|axis| axis.replace('-', "_"));
    table.allow(&keys.each_ref().map(String::as_str))?;
    let mut axes = Axes::default();
    for (key, axis) in keys.iter().zip(AXES) {
        let Some(value) = table.get(key) else { continue };
        let items = if value.is_array() { value.array()? } else { vec![value] };
        for item in items {
            let word = match axis {
                "pool" if item.string().is_err() => item.integer(1, u32::MAX)?.to_string(),
                "clamp-indirect" if item.string().is_err() => item.number(f32::MIN_POSITIVE, f32::MAX)?.to_string(),
                _ => item.string()?.to_owned(),
            };
            // Each word by itself, so that the error has its line.
            let mut alone = Axes::default();
            if let (Some(one), Some(all)) = (alone.axis_mut(axis), axes.axis_mut(axis)) {
                one.push(word.clone());
                all.push(word);
            }
            alone.methods().map_err(|unknown| item.error(unknown.expected))?;
        }
    }
    axes.methods().map_err(|unknown| table.error(unknown.word, unknown.expected).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::converge::study::method::Engine;

    fn read(text: &str) -> Result<Plan, Error> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("study.toml");
        std::fs::write(&path, text).unwrap();
        Plan::read(&path)
    }

    #[test]
    fn a_study_file_says_everything() {
        let plan = read(
            r#"
            depth = 5
            size = [64, 32]
            spp = [1, 8]
            repetitions = 3
            reference_spp = 100
            targets = [0.1, 1e-3]
            clock = "cpu"
            [[scene]]
            file = "box/scene.toml"
            [scene.models]
            nbrdf = "box/nbrdf.toml"
            [[methods]]
            device = ["llvmpipe", "embree"]
            sampler = ["sobol", "pcg"]
            pool = 4096
            clamp_indirect = [0.5, "off"]
            [[methods]]
            device = "llvmpipe"
            light_sampling = "off"
            "#,
        )
        .unwrap();
        plan.check().unwrap();
        assert_eq!((plan.max_depth, plan.size, plan.ladder.as_slice()), (5, Some([64, 32]), &[1, 8][..]));
        assert_eq!(plan.targets, [0.1, 1e-3]);
        assert_eq!(plan.scenes[0].name, "box");
        assert_eq!(plan.scenes[0].models[0].0, "nbrdf");
        assert_eq!(plan.methods.len(), 6);
        assert_eq!(plan.methods[0].pool, Some(4096));
        assert_eq!([0, 1].map(|method| plan.methods[method].clamp_indirect), [Some(0.5), None]);
        assert_eq!(plan.methods[4].engine, Engine::Embree);
        assert!(!plan.methods[5].light_sampling);
    }

    #[test]
    fn a_mistake_is_told_with_its_line_and_the_remedy() {
        for (text, told) in [
            ("dept = 3", "`depth`"),
            ("[[scene]]\nfiel = \"x\"", "`file`"),
            ("[[methods]]\nsamplr = \"pcg\"", "`sampler`"),
            ("[[methods]]\nsampler = [\"pcg\", \"halton\"]", ":2:"),
            ("[[methods]]\ntraversal = \"foo\"", "found `\"foo\"`, expected ray-query, bvh or auto"),
            ("clock = \"sun\"", "\"wall\" or \"cpu\""),
            ("spp = [0]", "from 1"),
            ("[[methods]]\nclamp_indirect = [10, -1]", "above 0"),
            ("size = [3]", "width and a height"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(told), "{text}: {error}");
        }
    }

    #[test]
    fn senseless_plans_are_refused() {
        let method = Axes::default().methods().unwrap();
        let good = Plan { scenes: vec![ScenePlan::new("a/scene.toml")], methods: method, ..Plan::default() };
        good.check().unwrap();
        for ladder in [vec![], vec![4, 4], vec![0], vec![0, 4]] {
            assert!(Plan { ladder, ..good.clone() }.check().unwrap_err().to_string().contains("ascending"));
        }
        assert!(Plan { scenes: vec![], ..good.clone() }.check().is_err());
        let twice = vec![ScenePlan::new("a/scene.toml"), ScenePlan::new("a.toml")];
        assert!(Plan { scenes: twice, ..good }.check().unwrap_err().to_string().contains("'a' twice"));
    }

    #[test]
    fn seeds_of_a_study_differ() {
        let plan = Plan { repetitions: 3, seed: 9, ..Plan::default() };
        let mut seeds: Vec<u32> = (0..4)
            .flat_map(|rung| (0..3).map(move |repetition| (rung, repetition)))
            .map(|(a, b)| plan.seed_of(a, b))
            .collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 12);
    }
}
