//! The picture that a scene is compared with: Embree's, made once and kept, or any other.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde::{Deserialize, Serialize};

use super::error::Error;
use crate::image::{Picture, plane, read_exr};
use crate::scene::Scene;

/// A reference with its own noise.
#[derive(Clone, Debug)]
pub struct GroundTruth {
    /// Beauty; variance and sample counts, if it is to be tested against.
    pub picture: Picture,
    /// What is known of it.
    pub about: AboutTruth,
}

/// What is known of a reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AboutTruth {
    /// Where it came from, in words.
    pub origin: String,
    /// Samples a pixel.
    pub spp: u64,
    /// mean(variance): what its noise adds to every MSE; 0 where it has no variance.
    pub mse: f64,
    /// The same for relMSE.
    pub rel_mse: f64,
    /// Whether it has a variance at all.
    pub has_variance: bool,
    /// Mean radiance, to scale by.
    pub mean: f64,
}

/// What weighs squared differences: 1 for MSE, 1/(r² + 0.01) for relMSE (Rousselle et al. 2011).
pub fn weights(reference: &Picture) -> Option<[Vec<f64>; 2]> {
    let truth = reference.rgb(plane::BEAUTY)?;
    let relative: Vec<f64> = truth.as_flattened().iter().map(|r| 1.0 / (f64::from(*r).powi(2) + 0.01)).collect();
    Some([vec![1.0; relative.len()], relative])
}

impl GroundTruth {
    /// Takes a picture for the truth.
    pub fn new(picture: Picture, origin: String, spp: u64) -> Result<GroundTruth, Error> {
        let beauty = picture.rgb(plane::BEAUTY).ok_or_else(|| crate::converge::Error::MissingPlane {
            which: "reference",
            missing: plane::BEAUTY.join(", "),
            found: picture.names().collect::<Vec<_>>().join(", "),
        })?;
        let [_, relative] = weights(&picture).unwrap_or_default();
        let variance = picture.rgb(plane::VARIANCE);
        let noise = |weights: &dyn Fn(usize) -> f64| {
            variance.as_ref().map_or(0.0, |variance| {
                let terms = variance.as_flattened().iter().enumerate().map(|(i, v)| f64::from(*v) * weights(i));
                terms.sum::<f64>() / (variance.len() * 3) as f64
            })
        };
        let about = AboutTruth {
            origin,
            spp,
            mse: noise(&|_| 1.0),
            rel_mse: noise(&|i| relative[i]),
            has_variance: variance.is_some() && picture.u32(plane::SAMPLES).is_some(),
            mean: beauty.as_flattened().iter().map(|r| f64::from(*r)).sum::<f64>() / (beauty.len() * 3) as f64,
        };
        Ok(GroundTruth { picture, about })
    }

    /// Reads a picture of the scene's size.
    pub fn read(path: &Path, scene: &Scene) -> Result<GroundTruth, Error> {
        let (picture, metadata) = read_exr(path)?;
        if [picture.width, picture.height] != [scene.film.width, scene.film.height] {
            return Err(crate::converge::Error::SizeMismatch {
                image: [scene.film.width, scene.film.height],
                reference: [picture.width, picture.height],
            }
            .into());
        }
        if metadata.crop_origin != [0, 0] {
            let [image, reference] = [[0, 0], metadata.crop_origin];
            return Err(crate::converge::Error::PlaceMismatch { image, reference }.into());
        }
        GroundTruth::new(picture, path.display().to_string(), metadata.spp)
    }

    /// Embree's picture; made if `cache` does not hold it yet. `None` if `stop` was set meanwhile.
    #[cfg(feature = "embree")]
    pub fn embree(
        scene: &Scene,
        max_depth: u32,
        spp: u32,
        cache: &Path,
        progress: impl Fn(f64) + Sync,
        stop: &AtomicBool,
    ) -> Result<Option<GroundTruth>, Error> {
        use crate::reference::{Reference, ReferenceOptions};
        let file = cache_file(scene, max_depth, spp, cache);
        if !file.exists() {
            let options = ReferenceOptions { spp, seed: SEED, max_depth, crop: None };
            let reference = Reference::new(scene)?;
            let (picture, statistics) = reference.render(&options, progress, stop)?;
            if stop.load(std::sync::atomic::Ordering::SeqCst) {
                return Ok(None);
            }
            let mut metadata = reference.metadata(&options, &statistics);
            metadata.scene_hash = scene.hash();
            std::fs::create_dir_all(cache).map_err(|source| Error::Io { path: cache.to_owned(), source })?;
            crate::image::write_exr(&file, &picture, &metadata)?;
        }
        let mut truth = GroundTruth::read(&file, scene)?;
        truth.about.origin = format!("Embree, {spp} spp, depth {max_depth}");
        Ok(Some(truth))
    }

    /// Without Embree a reference has to be given.
    #[cfg(not(feature = "embree"))]
    pub fn embree(
        scene: &Scene,
        max_depth: u32,
        spp: u32,
        cache: &Path,
        _progress: impl Fn(f64) + Sync,
        _stop: &AtomicBool,
    ) -> Result<Option<GroundTruth>, Error> {
        let file = cache_file(scene, max_depth, spp, cache);
        if !file.exists() {
            return Err(Error::Setting {
                name: "the reference",
                found: "not given".into(),
                expected: "an EXR file, as this build has no Embree".into(),
            });
        }
        Ok(Some(GroundTruth::read(&file, scene)?))
    }

    /// What the uncertainty of the reference's noise, and its product with the method's own difference, add to the standard
    /// error of a mean squared difference with these weights: √Σ (Σ w √(4 d² v + 2 v²))² / N, the outer sum over pixels, which are independent
    /// and normal, the inner over the channels of one. These see the same paths: how far they go together is not known, and nothing is more than
    /// all the way. `difference` is the method's mean picture less this one.
    pub fn uncertainty(&self, weights: &[f64], difference: &[f64]) -> f64 {
        let Some(variance) = self.picture.rgb(plane::VARIANCE) else { return 0.0 };
        let channels = variance.as_flattened().iter().zip(weights).zip(difference);
        let deviations = channels.map(|((variance, weight), difference)| {
            let variance = f64::from(*variance);
            weight * (variance * (4.0 * difference * difference + 2.0 * variance)).sqrt()
        });
        let deviations: Vec<f64> = deviations.collect();
        let pixels = deviations.chunks(3).map(|pixel| pixel.iter().sum::<f64>().powi(2));
        pixels.sum::<f64>().sqrt() / weights.len() as f64
    }
}

/// Of all references; runs have small seeds and other generators.
#[cfg(feature = "embree")]
const SEED: u64 = 0x7275_7468;

/// The last word is a hash of the code that makes the picture (`build.rs`): after a change of it the picture is made anew.
fn cache_file(scene: &Scene, max_depth: u32, spp: u32, cache: &Path) -> PathBuf {
    cache.join(format!("embree-{}-{max_depth}-{spp}-{}.exr", scene.hash(), env!("NEUBRDF_REFERENCE")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey noise on a grey picture tells as much as any one of its channels, and less than three that are independent.
    #[test]
    fn channels_that_move_together_count_once() {
        let (variance, difference) = (0.3f32, 0.7);
        let of = |pixels: usize| {
            let mut picture = Picture::new(pixels as u32, 1);
            picture.set_rgb(plane::BEAUTY, &vec![[1.0; 3]; pixels]);
            picture.set_rgb(plane::VARIANCE, &vec![[variance; 3]; pixels]);
            let truth = GroundTruth::new(picture, String::new(), 1).unwrap();
            truth.uncertainty(&vec![1.0; 3 * pixels], &vec![difference; 3 * pixels])
        };
        let variance = f64::from(variance);
        let one = (variance * (4.0 * difference * difference + 2.0 * variance)).sqrt();
        assert!((of(1) - one).abs() < 1e-12 && (of(4) - one / 2.0).abs() < 1e-12);
    }
}
