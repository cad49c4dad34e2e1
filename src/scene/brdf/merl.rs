//! MERL tables: isotropic BRDFs by half and difference angle. Matusik et al., *A Data-Driven Reflectance Model*,
//! SIGGRAPH 2003; the angles are Rusinkiewicz's, *A New Change of Variables for Efficient BRDF Representation*, 1998.
//!
//! A `.binary` file is three little-endian `i32`, 90, 90 and 180, then as many `f64` for red, for green and for blue.
//! A number times its channel's [scale](SCALES) is the BRDF in sr⁻¹ in the middle of a cell; the last index, φd, runs
//! fastest. A negative number says that the cell was not measured, as are all in which a direction is below the surface: its value is that of the
//! cell of the next smaller θd that was, or else of the next larger, or else 0.

use std::f64::consts::{FRAC_PI_2, PI};
use std::io::{BufReader, Read};
use std::path::Path;

use glam::Vec3;

use crate::scene::error::{Error, Place, open};

/// What the numbers of a file are multiplied by, a channel.
const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// Brighter than any measurement (the brightest of the 100 published tables is below 10⁵), so that sums of values stay finite.
const BRIGHTEST: f64 = 1e8;

/// An isotropic BRDF by table.
#[derive(Clone, Debug, PartialEq)]
pub struct Merl {
    /// sr⁻¹, RGB, [`Merl::CELLS`] of them, θh slowest, φd fastest.
    values: Vec<[f32; 3]>,
}

impl Merl {
    /// Cells over θh, θd and φd. Those of θh are spaced like its square root, and cover [0, π/2]; so do those of θd,
    /// evenly; those of φd cover [0, π], after which the BRDF repeats because it is reciprocal.
    pub const SIZE: [usize; 3] = [90, 90, 180];
    /// All cells.
    pub const CELLS: usize = Self::SIZE[0] * Self::SIZE[1] * Self::SIZE[2];

    /// Tabulates a function of (θh, θd, φd), in radians, that gives sr⁻¹, ≥ 0; `None` where it is not known.
    pub fn tabulate(brdf: impl Fn([f64; 3]) -> Option<Vec3>) -> Merl {
        let value = |cell| brdf(Self::angles(cell)).map_or([-1.0; 3], |value| value.to_array());
        Merl::filled((0..Self::CELLS).map(value).collect())
    }

    /// Replaces values with a negative channel.
    fn filled(mut values: Vec<[f32; 3]>) -> Merl {
        let [_, differences, azimuths] = Self::SIZE;
        let is_measured = |value: &[f32; 3]| value.iter().all(|channel| *channel >= 0.0);
        for half in values.chunks_exact_mut(differences * azimuths) {
            for azimuth in 0..azimuths {
                let first = half.iter().skip(azimuth).step_by(azimuths).copied().find(is_measured);
                let mut last = first.unwrap_or_default();
                for value in half.iter_mut().skip(azimuth).step_by(azimuths) {
                    if is_measured(value) {
                        last = *value;
                    } else {
                        *value = last;
                    }
                }
            }
        }
        Merl { values }
    }

    /// θh, θd and φd in the middle of a cell, radians.
    pub fn angles(cell: usize) -> [f64; 3] {
        let [_, difference, azimuths] = Self::SIZE;
        let index = [cell / (difference * azimuths), cell / azimuths % difference, cell % azimuths];
        let middle = |axis: usize| (index[axis] as f64 + 0.5) / Self::SIZE[axis] as f64;
        [middle(0).powi(2) * FRAC_PI_2, middle(1) * FRAC_PI_2, middle(2) * PI]
    }

    /// The cells, θh slowest, φd fastest; none negative.
    pub fn values(&self) -> &[[f32; 3]] {
        &self.values
    }

    /// Reads a `.binary` file: an error if it cannot be read, has other dimensions or another length, or if a number in it is not
    /// finite or above 10⁸ sr⁻¹.
    pub(super) fn read(path: &Path, needed_by: Option<&Place>) -> Result<Merl, Error> {
        let unreadable = |source| Error::read(path, needed_by, source);
        let file = open(path, needed_by)?;
        let bytes = file.metadata().map_err(unreadable)?.len();
        let expected = (12 + Self::CELLS * 3 * size_of::<f64>()) as u64;
        let mut file = BufReader::with_capacity(1 << 16, file);
        let mut header = [0; 12];
        file.read_exact(&mut header).map_err(unreadable)?;
        let size = [0, 4, 8].map(|at| i32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]));
        if size.map(i64::from) != Self::SIZE.map(|side| side as i64) {
            let place = field(path, "dimensions".to_owned());
            return Err(Error::unexpected(place, format!("{size:?}"), format!("{:?}", Self::SIZE)));
        }
        if bytes != expected {
            let found = format!("{bytes} bytes");
            return Err(Error::unexpected(Place::file(path), found, format!("{expected} bytes")));
        }
        let mut values = vec![[0f32; 3]; Self::CELLS];
        for (channel, scale) in SCALES.into_iter().enumerate() {
            for (cell, value) in values.iter_mut().enumerate() {
                let mut number = [0; size_of::<f64>()];
                file.read_exact(&mut number).map_err(unreadable)?;
                let number = f64::from_le_bytes(number) * scale;
                if !(number.is_finite() && number <= BRIGHTEST) {
                    let place = field(path, format!("channel {channel}, cell {cell}"));
                    let expected = format!("a number whose value is at most {BRIGHTEST:e} sr⁻¹");
                    return Err(Error::unexpected(place, format!("a value of {number:e} sr⁻¹"), expected));
                }
                value[channel] = number as f32;
            }
        }
        Ok(Merl::filled(values))
    }

    /// The bytes of a `.binary` file.
    pub fn encode(&self) -> Vec<u8> {
        let sides = Self::SIZE.into_iter().flat_map(|side| (side as i32).to_le_bytes());
        let channel = |(channel, scale): (usize, f64)| {
            self.values.iter().flat_map(move |value| (f64::from(value[channel]) / scale).to_le_bytes())
        };
        sides.chain(SCALES.into_iter().enumerate().flat_map(channel)).collect()
    }
}

fn field(path: &Path, name: String) -> Place {
    Place { field: Some(name), ..Place::file(path) }
}
