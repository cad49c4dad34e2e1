//! What a study measured: every number of it, as JSON on disk.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::engine::Preparation;
use super::environment::Environment;
use super::error::Error;
use super::gram::Gram;
use super::ground_truth::AboutTruth;
use super::plan::Clock;
use crate::converge::clock::Timing;
use crate::image::write_file;

/// The version of the record's layout.
const FORMAT: u32 = 1;

/// Everything that a report is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Version of this layout.
    pub format: u32,
    /// What it was measured with.
    pub environment: Environment,
    /// What was asked for.
    pub question: Question,
    /// What could be done of it, scene by scene.
    pub scenes: Vec<SceneRecord>,
}

/// What changes the numbers of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Question {
    /// Methods by their full names, with their labels.
    pub methods: Vec<(String, String)>,
    /// Path segments.
    pub max_depth: u32,
    /// Samples a pixel.
    pub ladder: Vec<u32>,
    /// Renders of each rung.
    pub repetitions: u32,
    /// Samples a pixel of references.
    pub reference_spp: u32,
    /// Picks the random numbers.
    pub seed: u32,
    /// relMSE that the time is wanted to.
    pub targets: Vec<f64>,
    /// Exposure of FLIP and thumbnails, stops.
    pub exposure: f32,
    /// Which seconds count.
    pub clock: Clock,
}

/// A scene of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneRecord {
    /// Its name.
    pub name: String,
    /// [`crate::scene::Scene::hash`] of it.
    pub hash: String,
    /// The hashes of its models.
    pub models: Vec<(String, String)>,
    /// Pixels across and down.
    pub size: [u32; 2],
    /// What pictures are compared with.
    pub truth: AboutTruth,
    /// Its methods, in the order of [`Question::methods`].
    pub methods: Vec<MethodRecord>,
}

/// What a method did in a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodRecord {
    /// Its full name.
    pub name: String,
    /// Its name in this study.
    pub label: String,
    /// The model that it renders; `None`: the truth.
    pub model: Option<String>,
    /// Why it could not run; else `None`.
    pub unavailable: Option<String>,
    /// What came first.
    pub preparation: Option<Preparation>,
    /// Its renders, in the order of their making.
    pub runs: Vec<Run>,
    /// Products of differences, a rung of the ladder each; made when all that will run has run.
    pub products: Vec<Products>,
    /// The test of its mean picture; `None` before, and where there is no variance, as of single samples.
    pub bias: Option<BiasTest>,
}

/// One render.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Samples a pixel.
    pub spp: u32,
    /// Which of the repetitions, from 0.
    pub repetition: u32,
    /// Its seed.
    pub seed: u32,
    /// Seconds.
    pub timing: Timing,
    /// mean((x − r)²), the reference's noise within.
    #[serde(deserialize_with = "or_nan")]
    pub mse: f64,
    /// mean((x − r)² / (r² + 0.01)), the reference's noise within.
    #[serde(deserialize_with = "or_nan")]
    pub rel_mse: f64,
    /// Mean ꟻLIP error, the reference's noise within.
    #[serde(deserialize_with = "or_nan")]
    pub flip: f64,
    /// mean(x − r) / mean(r).
    #[serde(deserialize_with = "or_nan")]
    pub relative_bias: f64,
    /// Pixels that are not finite.
    pub non_finite_pixels: usize,
    /// Samples that were not finite and count as black.
    pub rejected_samples: u32,
}

/// Products of differences at a number of samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Products {
    /// Samples a pixel.
    pub spp: u32,
    /// Of plain differences.
    pub mse: Gram,
    /// Of relative ones.
    pub rel_mse: Gram,
    /// See [`super::ground_truth::GroundTruth::uncertainty`].
    pub mse_uncertainty: f64,
    /// The same for relMSE.
    pub rel_mse_uncertainty: f64,
}

/// Is the estimator right? All its samples together against a reference of what it renders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BiasTest {
    /// Samples a pixel, of all runs that know their variance.
    pub spp: u64,
    /// Samples a pixel of the reference.
    pub reference_spp: u64,
    /// Side of the blocks, pixels.
    pub block: u32,
    /// Of the most different block, corrected for their number.
    #[serde(deserialize_with = "or_nan")]
    pub p_blocks: f64,
    /// Of the picture's mean, corrected for three channels.
    #[serde(deserialize_with = "or_nan")]
    pub p_mean: f64,
    /// Of both.
    #[serde(deserialize_with = "or_nan")]
    pub p: f64,
    /// z of the mean, each channel.
    pub z_mean: [f64; 3],
    /// z of the most different block.
    #[serde(deserialize_with = "or_nan")]
    pub worst_z: f64,
    /// Its upper left pixel.
    pub worst_pixel: [u32; 2],
    /// 1 where variances are honest, less where they are overestimated.
    #[serde(deserialize_with = "or_nan")]
    pub z_rms: f64,
    /// mean(x − r) / mean(r).
    #[serde(deserialize_with = "or_nan")]
    pub relative_bias: f64,
}

/// What JSON has no number for, it has `null` for.
fn or_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

impl Record {
    /// Of nothing yet.
    pub fn new(environment: Environment, question: Question) -> Record {
        Record { format: FORMAT, environment, question, scenes: Vec::new() }
    }

    /// Reads a record that [`Record::write`] wrote.
    pub fn read(path: &Path) -> Result<Record, Error> {
        let text = std::fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
        let wrong = |reason: String| Error::Record { path: path.to_owned(), reason };
        let record: Record = serde_json::from_slice(&text).map_err(|error| wrong(error.to_string()))?;
        match record.format {
            FORMAT => Ok(record),
            other => Err(wrong(format!("format {other}, expected {FORMAT}"))),
        }
    }

    /// Writes it whole or not at all.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let text = serde_json::to_vec_pretty(self);
        let text = text.map_err(|error| Error::Io { path: path.to_owned(), source: error.into() })?;
        Ok(write_file(path, text)?)
    }
}
