//! BRDFs that a file gives and no closed form does: plain data, validated when it is loaded. What they mean is `crate::material`.

mod nbrdf;
mod neubrdf;
mod neubrdf_check;
mod neubrdf_file;
mod npy;
mod safetensors;
mod sampling_lobe;
mod sphere_grid;

use std::path::Path;

use super::error::{Error, Place, quote};
use super::hash::put;

pub use nbrdf::Nbrdf;
pub use neubrdf::{CornerWeights, Dense, Encoding, Gathered, NO_CODE, NeuBrdf, Provenance, SphereTable};
pub use neubrdf_check::Flaw;
pub use neubrdf_file::Precision;
pub use sampling_lobe::SamplingLobe;
pub use sphere_grid::{Located, POLE, SphereGrid};

/// A BRDF that a file gives.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // few, and shared by reference
pub enum Brdf {
    /// A small network (Sztrajman et al. 2021).
    Nbrdf(Nbrdf),
    /// A network over features on spheres.
    NeuBrdf(Box<NeuBrdf>),
}

/// The endings of file names that [`Brdf::load`] knows, for messages.
const ENDINGS: &str = "a name that ends in .neubrdf, .safetensors or .npy";

impl Brdf {
    /// Reads a file of the kind that its name's ending tells: `.neubrdf` ([`NeuBrdf`]), `.safetensors` or `.npy`
    /// ([`Nbrdf`]). `name` picks one
    /// material of a file that holds several.
    ///
    /// # Errors
    /// The file cannot be read, its ending says nothing, or it is not what the ending says: with the file, the part of it, what
    /// was found and what was expected.
    pub fn load(path: impl AsRef<Path>, name: Option<&str>) -> Result<Brdf, Error> {
        Brdf::load_for(path.as_ref(), name, None)
    }

    /// The same, on behalf of a key of a scene file.
    pub(super) fn load_for(path: &Path, name: Option<&str>, needed_by: Option<&Place>) -> Result<Brdf, Error> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        let only = |brdf: Brdf| match name {
            Some(name) => {
                let found = format!("the name {}", quote(name));
                Err(Error::unexpected(Place::file(path), found, "no name: this kind of file holds one material"))
            }
            None => Ok(brdf),
        };
        match ending.as_str() {
            "safetensors" => Nbrdf::from_safetensors(path, name, needed_by).map(Brdf::Nbrdf),
            "neubrdf" => only(Brdf::NeuBrdf(Box::new(NeuBrdf::load_for(path, needed_by)?))),
            "npy" => only(Brdf::Nbrdf(Nbrdf::from_npy(path, needed_by)?)),
            _ => Err(Error::unexpected(Place::file(path), "a BRDF of an unknown kind", ENDINGS)),
        }
    }

    /// Adds all that its values depend on to a fingerprint.
    pub(super) fn put(&self, hasher: &mut blake3::Hasher) {
        match self {
            Brdf::Nbrdf(nbrdf) => {
                put(hasher, b"nbrdf");
                nbrdf.parts().for_each(|part| put(hasher, part));
            }
            Brdf::NeuBrdf(neubrdf) => neubrdf.put(hasher),
        }
    }
}

/// Little-endian `f32` numbers, all finite.
fn finite_floats(bytes: &[u8], place: &Place) -> Result<Vec<f32>, Error> {
    let (chunks, _) = bytes.as_chunks();
    let numbers: Vec<f32> = chunks.iter().map(|chunk| f32::from_le_bytes(*chunk)).collect();
    match numbers.iter().position(|number| !number.is_finite()) {
        None => Ok(numbers),
        Some(index) => {
            let found = format!("{} as number {index} of {}", numbers[index], numbers.len());
            Err(Error::unexpected(place.clone(), found, "finite numbers"))
        }
    }
}
