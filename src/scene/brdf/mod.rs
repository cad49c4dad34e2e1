//! BRDFs that a file gives and no closed form does: plain data, validated when it is loaded. What they mean is `crate::material`.

mod half_difference;
mod merl;
mod nbrdf;
mod neubrdf;
mod neubrdf_check;
mod neubrdf_file;
mod neubrdf_file_1;
mod neubrdf_payload;
mod npy;
mod rgl;
mod safetensors;
mod sampling_lobe;
mod sparse;
mod sphere_grid;
mod surface_frames;
mod surface_table;
mod tensor_file;

use std::path::Path;

use super::error::{Error, Place, nearest, open, quote};
use super::hash::put;

pub use half_difference::HalfDifference;
pub use merl::Merl;
pub use nbrdf::Nbrdf;
pub use neubrdf::{Codebook, CornerWeights, Dense, Encoding, Gathered, NO_CODE, NeuBrdf, Provenance, SphereTable};
pub use neubrdf_check::Flaw;
pub use neubrdf_file::NeuBrdfPack;
pub use neubrdf_payload::Precision;
pub use rgl::{Rgl, RglTable, RglTables, RglWarp};
pub use sampling_lobe::SamplingLobe;
pub use sparse::{Sparse, SparseSample, SurfaceSamples};
pub use sphere_grid::{Located, POLE, SphereGrid, SpherePlace};
#[cfg(test)]
pub(crate) use surface_frames::leaning_frame;
pub use surface_frames::{SurfaceFrame, SurfaceFrames};
pub use surface_table::{Footprint, GatheredTexels, SurfaceGrid, SurfaceTable};

/// A BRDF that a file gives.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // A scene has each once, behind an `Arc`.
pub enum Brdf {
    /// A small network (Sztrajman et al. 2021).
    Nbrdf(Nbrdf),
    /// A table by half and difference angle (Matusik et al. 2003).
    Merl(Merl),
    /// Tables over adapted coordinates (Dupuy and Jakob 2018).
    Rgl(Rgl),
    /// A network over features on spheres.
    NeuBrdf(Box<NeuBrdf>),
    /// Samples, few and anywhere.
    Sparse(Sparse),
}

/// The endings of file names that [`Brdf::load`] knows.
const ENDINGS: [&str; 6] = ["neubrdf", "safetensors", "npy", "binary", "bsdf", "csv"];

impl Brdf {
    /// Reads a file of the kind that its name's ending tells: `.neubrdf` ([`NeuBrdf`]), `.safetensors` or
    /// `.npy` ([`Nbrdf`]), `.binary` ([`Merl`]), `.bsdf` ([`Rgl`]) or `.csv` ([`Sparse`]). `name` picks one material of a file that holds several.
    ///
    /// # Errors
    /// The file cannot be read, its ending says nothing, or it is not what the ending says: with the file, the part of it, what
    /// was found and what was expected.
    pub fn load(path: impl AsRef<Path>, name: Option<&str>) -> Result<Brdf, Error> {
        Brdf::load_for(path.as_ref(), name, None)
    }

    /// The names of the materials in a file, by which [`Brdf::load`] picks one; none of a kind of file that holds one without a name.
    ///
    /// # Errors
    /// As of [`Brdf::load`].
    pub fn names(path: impl AsRef<Path>) -> Result<Vec<String>, Error> {
        let path = path.as_ref();
        let names = match ending(path).as_str() {
            "safetensors" => Nbrdf::names(path)?,
            "neubrdf" => NeuBrdfPack::load(path)?.materials.into_iter().map(|(name, _)| name).collect(),
            _ => Vec::new(),
        };
        Ok(names.into_iter().filter(|name| !name.is_empty()).collect())
    }

    /// The same, on behalf of a key of a scene file.
    pub(super) fn load_for(path: &Path, name: Option<&str>, needed_by: Option<&Place>) -> Result<Brdf, Error> {
        let only = |brdf: Brdf| match name {
            Some(name) => {
                let found = format!("the name {}", quote(name));
                Err(Error::unexpected(Place::file(path), found, "no name: this kind of file holds one material"))
            }
            None => Ok(brdf),
        };
        match ending(path).as_str() {
            "safetensors" => Nbrdf::from_safetensors(path, name, needed_by).map(Brdf::Nbrdf),
            "neubrdf" => NeuBrdf::load_for(path, name, needed_by).map(|brdf| Brdf::NeuBrdf(Box::new(brdf))),
            "npy" => only(Brdf::Nbrdf(Nbrdf::from_npy(path, needed_by)?)),
            "binary" => only(Brdf::Merl(Merl::read(path, needed_by)?)),
            "bsdf" => only(Brdf::Rgl(Rgl::read(path, needed_by)?)),
            "csv" => only(Brdf::Sparse(Sparse::read(path, needed_by)?)),
            _ => {
                open(path, needed_by)?;
                let expected = format!("a name that ends in one of .{}", ENDINGS.join(", ."));
                Err(Error::unexpected(Place::file(path), "a BRDF of an unknown kind", expected))
            }
        }
    }

    /// Whether its values hang on texture coordinates.
    pub fn is_spatial(&self) -> bool {
        matches!(self, Brdf::NeuBrdf(neubrdf) if neubrdf.surface.is_some())
    }

    /// Adds all that its values depend on to a fingerprint.
    pub(super) fn put(&self, hasher: &mut blake3::Hasher) {
        match self {
            Brdf::Nbrdf(nbrdf) => {
                put(hasher, b"nbrdf");
                nbrdf.parts().for_each(|part| put(hasher, part));
            }
            Brdf::Merl(merl) => {
                put(hasher, b"merl");
                put(hasher, merl.values());
            }
            Brdf::Rgl(rgl) => {
                put(hasher, b"rgl");
                rgl.put(hasher);
            }
            Brdf::Sparse(sparse) => {
                put(hasher, b"sparse");
                sparse.put(hasher);
            }
            Brdf::NeuBrdf(neubrdf) => neubrdf.put(hasher),
        }
    }
}

/// Whether a file's name ends like that of a BRDF.
pub(super) fn is_of_brdf(path: &Path) -> bool {
    ENDINGS.contains(&ending(path).as_str())
}

/// What a file's name ends in, in lower case.
pub fn ending(path: &Path) -> String {
    path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// What tells all names of materials in a file.
const LISTS: &str = "`neubrdf material FILE` lists them all";

/// Which of a file's materials is meant: the one of this name, or the only one. `names` are not empty; a lone material may have none.
fn picked(path: &Path, name: Option<&str>, names: &[&str]) -> Result<usize, Error> {
    let place = match name {
        Some(name) => names.iter().position(|other| *other == name && !name.is_empty()),
        None => (names.len() == 1).then_some(0),
    };
    place.ok_or_else(|| {
        let found = name.map_or("no name of a material".to_owned(), |name| format!("the name {}", quote(name)));
        let expected = match names {
            [] | [""] => "no name: the file holds one material".to_owned(),
            [only] => format!("{}, the one material in it, or no name", quote(only)),
            names => {
                let nearest = nearest(name.unwrap_or_default(), names.iter().copied());
                let count = names.len();
                format!("the name of one of the {count} materials in it, such as {}; {LISTS}", quote(nearest))
            }
        };
        Error::unexpected(Place::file(path), found, expected)
    })
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
