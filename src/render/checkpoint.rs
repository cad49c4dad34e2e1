//! A render's state on disk: what was rendered, how far it is, and the film's sums, bit for bit.
//!
//! A file of [`write_sealed`]: what was rendered is the header, the film's pixels and then its feature pixels, if any, are the content.

use std::path::Path;

use bytemuck::{Pod, cast_slice};
use serde::{Deserialize, Serialize};

use super::error::Error;
use super::layout::{FeaturePixel, FilmPixel};
use super::settings::Settings;
use crate::image::{open_sealed, write_sealed};

const MAGIC: &[u8; 8] = b"NBRDFCK1";

/// Everything that changes the bits of the film.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// [`crate::scene::Scene::hash`].
    pub scene: String,
    /// Film columns.
    pub width: u32,
    /// Film rows.
    pub height: u32,
    /// Crop as x, y, width, height.
    pub crop: [u32; 4],
    /// Path segments.
    pub max_depth: u32,
    /// Bounces without Russian roulette.
    pub roulette_after: u32,
    /// The limit of indirect light, or `none`.
    pub clamp_indirect: String,
    /// Random seed.
    pub seed: u32,
    /// `sobol` or `pcg`.
    pub sampler: String,
    /// Whether the feature channels are gathered.
    pub features: bool,
    /// Whether lights are sampled.
    pub light_sampling: bool,
    /// `lobe`, `cosine` or `uniform`.
    pub bsdf_sampling: String,
    /// Whether pixels share paths.
    pub path_reuse: bool,
    /// `f16`, `f32` or `auto`.
    pub neubrdf_precision: String,
    /// The device and driver: others may round otherwise.
    pub device: String,
    /// The program's version.
    pub version: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    identity: Identity,
    samples: u32,
    seconds: f64,
    rejected: u32,
}

/// A render's resumable state.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// What it is a state of.
    pub identity: Identity,
    /// Samples a pixel so far.
    pub samples: u32,
    /// Seconds of rendering so far.
    pub seconds: f64,
    /// Samples so far that were not finite.
    pub rejected: u32,
    /// The film.
    pub pixels: Vec<FilmPixel>,
    /// The feature film; empty if there is none.
    pub features: Vec<FeaturePixel>,
}

impl Checkpoint {
    /// Writes the file whole or not at all.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let header = Header {
            identity: self.identity.clone(),
            samples: self.samples,
            seconds: self.seconds,
            rejected: self.rejected,
        };
        Ok(write_sealed(path, MAGIC, &header, &[cast_slice(&self.pixels), cast_slice(&self.features)])?)
    }

    /// Reads a file that [`Checkpoint::write`] wrote; anything else is an error.
    pub fn read(path: &Path) -> Result<Checkpoint, Error> {
        let bytes = std::fs::read(path).map_err(|source| Error::CheckpointFile { path: path.to_owned(), source })?;
        Checkpoint::parse(&bytes)
            .map_err(|reason| Error::CheckpointFormat { path: path.to_owned(), reason: reason.to_owned() })
    }

    fn parse(bytes: &[u8]) -> Result<Checkpoint, &'static str> {
        let (Header { identity, samples, seconds, rejected }, film) = open_sealed(bytes, MAGIC)?;
        let [_, _, width, height] = identity.crop;
        let count = (width as usize).checked_mul(height as usize).ok_or("its film is too large")?;
        let (pixels, film) = take::<FilmPixel>(film, count)?;
        let (features, film) = take::<FeaturePixel>(film, if identity.features { count } else { 0 })?;
        if !film.is_empty() {
            return Err("its film is larger than its header says");
        }
        Ok(Checkpoint { identity, samples, seconds, rejected, pixels, features })
    }

    /// Errors unless this is a state of the render `expected`.
    pub fn check(&self, expected: &Identity) -> Result<(), Error> {
        let found = &self.identity;
        let differs = |name, found: &dyn ToString, expected: &dyn ToString| {
            let (found, expected) = (found.to_string(), expected.to_string());
            if found == expected { Ok(()) } else { Err(Error::CheckpointMismatch { name, found, expected }) }
        };
        differs("film width", &found.width, &expected.width)?;
        differs("film height", &found.height, &expected.height)?;
        // The scene's hash covers the film's size, which has a better name.
        if found.scene != expected.scene {
            let [found, expected] = [found, expected].map(|identity| identity.scene.chars().take(8).collect());
            return Err(Error::CheckpointScene { found, expected });
        }
        differs("crop", &format!("{:?}", found.crop), &format!("{:?}", expected.crop))?;
        differs("--max-depth", &found.max_depth, &expected.max_depth)?;
        differs("--roulette-after", &found.roulette_after, &expected.roulette_after)?;
        differs("--clamp-indirect", &found.clamp_indirect, &expected.clamp_indirect)?;
        differs("--seed", &found.seed, &expected.seed)?;
        differs("--sampler", &found.sampler, &expected.sampler)?;
        differs("feature channels", &found.features, &expected.features)?;
        differs("light sampling", &found.light_sampling, &expected.light_sampling)?;
        differs("BSDF sampling", &found.bsdf_sampling, &expected.bsdf_sampling)?;
        differs("path reuse", &found.path_reuse, &expected.path_reuse)?;
        differs("precision", &found.neubrdf_precision, &expected.neubrdf_precision)?;
        differs("device", &found.device, &expected.device)?;
        differs("version", &found.version, &expected.version)
    }
}

fn take<T: Pod>(bytes: &[u8], count: usize) -> Result<(Vec<T>, &[u8]), &'static str> {
    let size = count.checked_mul(size_of::<T>()).ok_or("its film is too large")?;
    let (taken, rest) = bytes.split_at_checked(size).ok_or("its film is cut short")?;
    let mut values = vec![T::zeroed(); count];
    bytemuck::cast_slice_mut(&mut values).copy_from_slice(taken);
    Ok((values, rest))
}

impl Identity {
    /// What identifies a render of a scene with some settings on a device.
    pub fn new(scene_hash: &str, film: [u32; 2], crop: [u32; 4], settings: &Settings, device: &str) -> Identity {
        Identity {
            scene: scene_hash.to_owned(),
            width: film[0],
            height: film[1],
            crop,
            max_depth: settings.max_depth,
            roulette_after: settings.roulette_after,
            clamp_indirect: settings.clamp_indirect.map_or("none".into(), |limit| limit.to_string()),
            seed: settings.seed,
            sampler: settings.sampler.to_string(),
            features: settings.features,
            light_sampling: settings.light_sampling,
            bsdf_sampling: settings.bsdf_sampling.to_string(),
            path_reuse: settings.path_reuse,
            neubrdf_precision: settings.neubrdf_precision.map_or("auto".into(), |precision| precision.to_string()),
            device: device.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }
}
