//! Bidirectional texture functions as directories of images, one for each pair of a view and a light.
//!
//! The layout is that of the UBO2003 and ATRIUM sets (Sattler et al., *Efficient and Realistic Visualization of Cloth*, 2003) and of UTIA's:
//! somewhere in an image's path, `tlT_plP_tvT_pvP` says the angles θ and φ of the light and of the view in degrees, in any order, between
//! other characters. Images are rectified, as seen along the normal with u to the right and v up, and all of a size. A file `btf.toml` in the
//! directory says how their numbers are meant; docs/training.md has its keys.

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::error::{Error, Place};
use super::table::{Source, Table, read_text};
use super::{Texture, decode};

/// A directory of images.
#[derive(Clone, Debug, PartialEq)]
pub struct Btf {
    images: Vec<BtfImage>,
    is_srgb: bool,
    has_cosine: bool,
    white: f64,
}

/// One of them.
#[derive(Clone, Debug, PartialEq)]
struct BtfImage {
    path: PathBuf,
    wo: DVec3,
    wi: DVec3,
}

/// Longest `btf.toml`, bytes.
const LONGEST_FILE: u64 = 1 << 20;
/// Directories below the given one that are searched.
const DEEPEST: usize = 3;
/// Most images.
const MOST_IMAGES: usize = 1 << 18;
/// A direction this near to the surface, degrees, sees nothing of it.
const GRAZING: f64 = 90.0;

impl Btf {
    /// Looks through a directory; images are read when they are asked for.
    ///
    /// # Errors
    /// No image, one without angles below 90° in its path, or a `btf.toml` that is not as documented.
    pub fn open(directory: &Path) -> Result<Btf, Error> {
        let description = directory.join("btf.toml");
        let text = if description.exists() { read_text(&description, LONGEST_FILE)? } else { String::new() };
        let source = Source { file: &description, text: &text };
        let entries = source.parse()?;
        let table = Table::root(source, &entries);
        table.allow(&["encoding", "cosine", "white"])?;
        let is_srgb = match table.get("encoding").map(|value| Ok((value.string()?, value))).transpose()? {
            None | Some(("srgb", _)) => true,
            Some(("linear", _)) => false,
            Some((_, value)) => return Err(value.error("\"srgb\" or \"linear\"")),
        };
        let mut images = Vec::new();
        find_images(directory, directory, DEEPEST, &mut images)?;
        if images.is_empty() {
            let found = "no image";
            return Err(Error::unexpected(
                Place::file(directory),
                found,
                "images named like tl015_pl090_tv000_pv000.png",
            ));
        }
        images.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(Btf {
            images,
            is_srgb,
            has_cosine: table.get("cosine").map_or(Ok(true), |value| value.boolean())?,
            white: f64::from(table.get("white").map_or(Ok(1.0), |value| value.number(1e-6, 1e6))?),
        })
    }

    /// How many images there are, ≥ 1.
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// False.
    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    /// ωo and ωi of an image.
    pub fn directions(&self, index: usize) -> [DVec3; 2] {
        [self.images[index].wo, self.images[index].wi]
    }

    /// Reads an image: the BRDF in sr⁻¹, without the cosine.
    ///
    /// # Errors
    /// It is no image that can be decoded.
    pub fn read(&self, index: usize) -> Result<Texture, Error> {
        let BtfImage { path, wi, .. } = &self.images[index];
        let cosine = if self.has_cosine { wi.z } else { 1.0 };
        decode::measured(path, self.is_srgb, (1.0 / (self.white * PI * cosine)) as f32)
    }
}

fn find_images(root: &Path, directory: &Path, depth: usize, images: &mut Vec<BtfImage>) -> Result<(), Error> {
    let unreadable = |source| Error::read(directory, None, source);
    for entry in fs::read_dir(directory).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.is_dir() {
            if depth > 0 {
                find_images(root, &path, depth - 1, images)?;
            }
            continue;
        }
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        if !["png", "jpg", "jpeg", "exr"].contains(&ending.as_str()) {
            continue;
        }
        if images.len() == MOST_IMAGES {
            return Err(Error::unexpected(Place::file(root), "more images", format!("at most {MOST_IMAGES}")));
        }
        // The file's own name counts before those of its directories.
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let below = path.parent().filter(|parent| *parent != root).map(name).unwrap_or_default();
        let names = [name(&path), below];
        let angle = |key: &str| names.iter().find_map(|name| angle(name, key));
        let (wo, wi) = (direction(angle("tv"), angle("pv")), direction(angle("tl"), angle("pl")));
        let (Some(wo), Some(wi)) = (wo, wi) else {
            let expected = "a name like tl015_pl090_tv000_pv000.png, angles in degrees and θ below 90";
            return Err(Error::unexpected(Place::file(&path), "another name", expected));
        };
        images.push(BtfImage { path, wo, wi });
    }
    Ok(())
}

/// The number behind a key that no letter precedes.
fn angle(name: &str, key: &str) -> Option<f64> {
    name.match_indices(key).find_map(|(at, _)| {
        let begins = !name[..at].ends_with(|c: char| c.is_ascii_alphabetic());
        let digits = &name[at + key.len()..];
        let end = digits.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(digits.len());
        begins.then(|| digits[..end].trim_end_matches('.').parse().ok())?
    })
}

fn direction(theta: Option<f64>, phi: Option<f64>) -> Option<DVec3> {
    let (theta, phi) = (theta.filter(|theta| *theta < GRAZING)?.to_radians(), phi?.to_radians());
    Some(DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()))
}

/// A stack as something to look up roughly: small pictures of its images.
#[derive(Clone, Debug, PartialEq)]
pub struct BtfPreview {
    /// ωo, ωi, and what is seen.
    pub images: Vec<([DVec3; 2], Texture)>,
}

impl BtfPreview {
    /// Texels to a side, at most.
    pub const SIDE: u32 = 32;

    /// What the small picture of an image shows: averages of as many texels as make one.
    pub fn shrink(texture: &Texture) -> Texture {
        let [width, height] = [texture.width, texture.height].map(|side| side.min(Self::SIDE));
        let mut sums = vec![(Vec3::ZERO, 0.0); (width * height) as usize];
        for (index, [red, green, blue, _]) in texture.texels.iter().enumerate() {
            let (x, y) = (index as u32 % texture.width, index as u32 / texture.width);
            let (sum, count) = &mut sums[(y * height / texture.height * width + x * width / texture.width) as usize];
            *sum += Vec3::new(red.to_f32(), green.to_f32(), blue.to_f32());
            *count += 1.0;
        }
        let texel = |(sum, count): (Vec3, f32)| (sum / count).extend(1.0).to_array().map(half::f16::from_f32);
        Texture { width, height, texels: Arc::new(sums.into_iter().map(texel).collect()), ..texture.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_found_in_names() {
        let name = "00123_tl015_pl090.5 tv000-pv345.jpg";
        assert_eq!(["tl", "pl", "tv", "pv"].map(|key| angle(name, key)), [15.0, 90.5, 0.0, 345.0].map(Some));
        assert_eq!(angle("stl015", "tl"), None);
        assert_eq!(angle("tl_1", "tl"), None);
    }
}
