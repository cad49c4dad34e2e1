//! Samples of a BRDF by hand or by goniometer: CSV files of a few hundred rows.
//!
//! The first row is the header `wi_theta,wi_phi,wo_theta,wo_phi,r,g,b`; each further one a sample: four angles in degrees, the θ
//! in [0, 90), and the BRDF in sr⁻¹ without the cosine. Empty lines, and lines that start with `#`, are skipped.
//! A file in which every `wi_phi` is 0 describes an isotropic material: the difference of the azimuths counts, and not its sign.
//!
//! Samples of a material that varies have two more columns before these, `u,v`, and may be many: [`SurfaceSamples`].

use std::f64::consts::FRAC_2_PI;
use std::path::Path;

use glam::{DVec2, DVec3, DVec4, Vec2, Vec3};

use super::HalfDifference;
use crate::scene::error::{BYTE_ORDER_MARK, Error, Place, quote, read_bytes};
use crate::scene::hash::put;

const HEADER: [&str; 7] = ["wi_theta", "wi_phi", "wo_theta", "wo_phi", "r", "g", "b"];
const SURFACE_HEADER: [&str; 9] = ["u", "v", "wi_theta", "wi_phi", "wo_theta", "wo_phi", "r", "g", "b"];
/// Longest file, bytes.
const LONGEST: u64 = 4 << 20;
/// The same of samples of a material that varies.
const LONGEST_OF_SURFACE: u64 = 1 << 30;
/// Brightest value, sr⁻¹.
const BRIGHTEST: f64 = 1e8;
/// A direction this near to the surface, degrees, sees nothing of it.
const GRAZING: f64 = 90.0;

/// A BRDF that is known for some pairs of directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Sparse {
    samples: Vec<SparseSample>,
    /// Where each of them is.
    coordinates: Vec<DVec4>,
    is_isotropic: bool,
}

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseSample {
    /// Towards the light, unit, local, z > 0.
    pub wi: DVec3,
    /// Towards the viewer.
    pub wo: DVec3,
    /// sr⁻¹, RGB, without the cosine, in [0, 10⁸].
    pub value: Vec3,
}

impl Sparse {
    /// Evaluation looks at all samples, so there are not many.
    pub const MOST_SAMPLES: usize = 4096;

    /// At least one sample, at most [`Sparse::MOST_SAMPLES`], and whether the azimuths count by their difference alone.
    pub fn new(samples: Vec<SparseSample>, is_isotropic: bool) -> Sparse {
        let coordinates = samples.iter().map(|sample| coordinates(sample.wo, sample.wi, is_isotropic)).collect();
        Sparse { samples, coordinates, is_isotropic }
    }

    /// What is known.
    pub fn samples(&self) -> &[SparseSample] {
        &self.samples
    }

    /// [`Sparse::coordinates_of`] each sample.
    pub fn coordinates(&self) -> &[DVec4] {
        &self.coordinates
    }

    /// Whether the azimuths count by their difference alone.
    pub fn is_isotropic(&self) -> bool {
        self.is_isotropic
    }

    /// Where a pair of directions is among the samples: numbers in which BRDFs are smooth.
    ///
    /// The first two are √(2θh/π) in the direction of φh: highlights are narrow in the half vector, and the root spreads them as in MERL
    /// tables. The other two are sin θd in the direction of 2φd, so that swapping `wo` and `wi` changes nothing. For an isotropic
    /// material φh counts as 0 and φd as |φd|.
    pub fn coordinates_of(&self, wo: DVec3, wi: DVec3) -> DVec4 {
        coordinates(wo, wi, self.is_isotropic)
    }

    /// Reads a `.csv` file: an error if it cannot be read, its header is another, or a row has another number of columns or a number out
    /// of range.
    pub(super) fn read(path: &Path, needed_by: Option<&Place>) -> Result<Sparse, Error> {
        let text = text(path, needed_by, LONGEST)?;
        let mut samples = Vec::new();
        let is_isotropic = rows(path, &text, HEADER, |line, numbers| {
            if samples.len() == Self::MOST_SAMPLES {
                let found = "one sample more";
                let expected = format!("at most {} samples", Self::MOST_SAMPLES);
                return Err(Error::unexpected(Place::line(path, line), found, expected));
            }
            samples.push(SparseSample::new(numbers));
            Ok(())
        })?;
        Ok(Sparse::new(samples, is_isotropic))
    }

    pub(super) fn put(&self, hasher: &mut blake3::Hasher) {
        put(hasher, &[u8::from(self.is_isotropic)]);
        for SparseSample { wi, wo, value } in &self.samples {
            put(hasher, &[*wi, *wo]);
            put(hasher, &[*value]);
        }
    }
}

impl SparseSample {
    /// Of the numbers of a row.
    fn new(numbers: &[f64; 7]) -> SparseSample {
        let [wi_theta, wi_phi, wo_theta, wo_phi, r, g, b] = *numbers;
        SparseSample {
            wi: direction(wi_theta, wi_phi),
            wo: direction(wo_theta, wo_phi),
            value: Vec3::new(r as f32, g as f32, b as f32),
        }
    }
}

/// Samples of a BRDF that varies over (u, v), some hundred a texel: to learn from, not to look up.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceSamples {
    /// Texture coordinates in [0, 1], and what is known there.
    pub samples: Vec<(Vec2, SparseSample)>,
    /// Whether the azimuths count by their difference alone.
    pub is_isotropic: bool,
}

impl SurfaceSamples {
    /// Reads a `.csv` file; `None` if its header has no `u`.
    ///
    /// # Errors
    /// It cannot be read, or is not as docs/materials.md says: with the line and the column.
    pub fn load(path: &Path) -> Result<Option<SurfaceSamples>, Error> {
        let text = text(path, None, LONGEST_OF_SURFACE)?;
        let is_comment = |row: &&str| row.is_empty() || row.starts_with('#');
        let header = text.lines().map(str::trim).find(|row| !is_comment(row)).unwrap_or_default();
        if header.split(',').next().map(str::trim) != Some(SURFACE_HEADER[0]) {
            return Ok(None);
        }
        let mut samples = Vec::new();
        let is_isotropic = rows(path, &text, SURFACE_HEADER, |_, numbers: &[f64; 9]| {
            let [u, v, rest @ ..] = numbers;
            samples.push((Vec2::new(*u as f32, *v as f32), SparseSample::new(rest)));
            Ok(())
        })?;
        Ok(Some(SurfaceSamples { samples, is_isotropic }))
    }
}

fn text(path: &Path, needed_by: Option<&Place>, longest: u64) -> Result<String, Error> {
    let mut bytes = read_bytes(path, needed_by, longest)?;
    if bytes.starts_with(BYTE_ORDER_MARK) {
        bytes.drain(..BYTE_ORDER_MARK.len());
    }
    String::from_utf8(bytes).map_err(|_| {
        Error::unexpected(Place::file(path), "bytes that are not UTF-8", "a text of comma-separated values")
    })
}

/// Hands on the line and the numbers of each row below the header, of which there must be one. Returns whether all `wi_phi` are 0.
fn rows<const N: usize>(
    path: &Path,
    text: &str,
    header: [&str; N],
    mut each: impl FnMut(usize, &[f64; N]) -> Result<(), Error>,
) -> Result<bool, Error> {
    let mut rows = text
        .lines()
        .enumerate()
        .map(|(index, row)| (index + 1, row.trim()))
        .filter(|(_, row)| !row.is_empty() && !row.starts_with('#'));
    match rows.next() {
        Some((_, row)) if row.split(',').map(str::trim).eq(header) => {}
        other => {
            let (line, found) = other.map_or((1, "nothing".to_owned()), |(line, row)| (line, quote(row)));
            let expected = format!("the header `{}`", header.join(","));
            return Err(Error::unexpected(Place::line(path, line), found, expected));
        }
    }
    let (mut count, mut is_isotropic) = (0, true);
    for (line, row) in rows {
        let numbers = numbers(path, line, row, &header)?;
        is_isotropic &= header.iter().zip(&numbers).all(|(name, number)| *name != "wi_phi" || *number == 0.0);
        each(line, &numbers)?;
        count += 1;
    }
    if count == 0 {
        return Err(Error::unexpected(Place::file(path), "no sample", "at least one"));
    }
    Ok(is_isotropic)
}

/// The columns of a row, each in its range.
fn numbers<const N: usize>(path: &Path, line: usize, row: &str, header: &[&str; N]) -> Result<[f64; N], Error> {
    let columns = row.split(',').count();
    if columns != N {
        return Err(Error::unexpected(Place::line(path, line), format!("{columns} columns"), format!("{N}")));
    }
    let mut numbers = [0.0; N];
    for ((number, name), text) in numbers.iter_mut().zip(header).zip(row.split(',')) {
        let ([least, most], end) = match *name {
            "u" | "v" => ([0.0, 1.0], "1"),
            "wi_theta" | "wo_theta" => ([0.0, GRAZING.next_down()], "below 90"),
            "wi_phi" | "wo_phi" => ([-360.0, 360.0], "360"),
            _ => ([0.0, BRIGHTEST], "1e8"),
        };
        *number = text.trim().parse().ok().filter(|number| (least..=most).contains(number)).ok_or_else(|| {
            let place = Place { field: Some((*name).to_owned()), ..Place::line(path, line) };
            Error::unexpected(place, quote(text.trim()), format!("a number from {least} to {end}"))
        })?;
    }
    Ok(numbers)
}

/// The unit vector at these angles, degrees.
fn direction(theta: f64, phi: f64) -> DVec3 {
    let ((sine, cosine), phi) = (theta.to_radians().sin_cos(), phi.to_radians());
    DVec3::new(sine * phi.cos(), sine * phi.sin(), cosine)
}

fn coordinates(wo: DVec3, wi: DVec3, is_isotropic: bool) -> DVec4 {
    let pair = HalfDifference::new(wo, wi);
    let half = (pair.theta_half() * FRAC_2_PI).sqrt();
    // The square of a complex number, over its length, has twice its azimuth.
    let DVec2 { x, y } = pair.across;
    let doubled = DVec2::new(x * x - y * y, 2.0 * x * y) / pair.across.length().max(f64::MIN_POSITIVE);
    if is_isotropic {
        DVec4::new(half, 0.0, doubled.x, doubled.y.abs())
    } else {
        let direction = pair.half.truncate().try_normalize().unwrap_or(DVec2::X) * half;
        DVec4::new(direction.x, direction.y, doubled.x, doubled.y)
    }
}
