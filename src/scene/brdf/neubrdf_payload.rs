//! The numbers of a `.neubrdf` file behind its header: arrays one after another, little-endian, each filled up to whole bytes.

use std::fmt;

use half::f16;
use serde::{Deserialize, Serialize};

use super::{
    Codebook, Dense, Flaw, NO_CODE, NeuBrdf, SphereGrid, SphereTable, SurfaceFrames, SurfaceGrid, SurfaceTable,
};

/// How numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// Two bytes, eleven significant bits.
    F16,
    /// Four bytes, as trained.
    F32,
}

impl fmt::Display for Precision {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(match self {
            Precision::F16 => "f16",
            Precision::F32 => "f32",
        })
    }
}

/// Bits of an index into so many codes, ≥ 1.
fn index_bits(codes: usize) -> u32 {
    usize::BITS - (codes - 1).leading_zeros()
}

/// The same of texels, which may be many: none is free, so that a short file does not become a large table.
fn texel_bits(codes: usize) -> u32 {
    index_bits(codes).max(1)
}

/// A payload that grows.
pub(super) struct Writer {
    pub bytes: Vec<u8>,
    pub precision: Precision,
}

impl Writer {
    /// The codes of a codebook.
    pub fn codebook(&mut self, field: &str, codebook: &Codebook) -> Result<(), Flaw> {
        self.numbers(&format!("{field}.codes"), &codebook.codes)
    }

    /// Weights before biases, layer by layer.
    pub fn network(&mut self, field: &str, layers: &[Dense]) -> Result<(), Flaw> {
        for layer in layers {
            self.numbers(&format!("{field}.weights"), &layer.weights)?;
            self.numbers(&format!("{field}.bias"), &layer.bias)?;
        }
        Ok(())
    }

    /// The merged pixels, if there are any, and the indices of a valid table.
    pub fn points(&mut self, table: &SphereTable) {
        let mut bits = BitWriter::default();
        if !table.levels.is_empty() {
            table.grid.merge_where(|level, pixels| {
                let is_merged = u32::from(table.levels[pixels[0] as usize]) == level;
                bits.put(is_merged.into(), 1);
                is_merged
            });
        }
        self.bytes.append(&mut bits.finish());
        let width = index_bits(table.codebook.code_count());
        table.indices.iter().filter(|index| **index != NO_CODE).for_each(|index| bits.put(*index, width));
        self.bytes.append(&mut bits.finish());
    }

    /// The indices and the frames of a valid table.
    pub fn texels(&mut self, table: &SurfaceTable) {
        let mut bits = BitWriter::default();
        let width = texel_bits(table.codebook.code_count());
        table.indices.iter().for_each(|index| bits.put(*index, width));
        self.bytes.append(&mut bits.finish());
        let SurfaceFrames { normals, directions } = &table.frames;
        self.bytes.extend(normals.iter().chain(directions).flatten().flat_map(|number| number.to_le_bytes()));
    }

    fn numbers(&mut self, field: &str, numbers: &[f32]) -> Result<(), Flaw> {
        for number in numbers {
            match self.precision {
                Precision::F16 => {
                    let half = f16::from_f32(*number);
                    if !half.is_finite() {
                        let expected = "numbers of at most 65504, or f32";
                        return Err(Flaw::new(field, "a number that f16 cannot hold", expected));
                    }
                    self.bytes.extend(half.to_le_bytes());
                }
                Precision::F32 => self.bytes.extend(number.to_le_bytes()),
            }
        }
        Ok(())
    }
}

/// What is left of a payload.
pub(super) struct Reader<'a> {
    pub rest: &'a [u8],
    pub precision: Precision,
}

impl<'a> Reader<'a> {
    /// Errors if something is left.
    pub fn end(&self) -> Result<(), Flaw> {
        match self.rest.len() {
            0 => Ok(()),
            more => Err(Flaw::new("file", format!("{more} bytes too many"), "what the header announces")),
        }
    }

    /// So many codes, in numbers that an index can name.
    pub fn codebook(&mut self, field: &str, features: u32, codes: u32) -> Result<Codebook, Flaw> {
        let field = format!("{field}.codes");
        if codes == 0 || codes >= u32::from(NO_CODE) {
            return Err(Flaw::new(field, format!("{codes} codes"), "1 to 65534"));
        }
        Ok(Codebook { features, codes: self.numbers(&field, u64::from(codes) * u64::from(features))? })
    }

    /// Layers of these widths.
    pub fn network(&mut self, field: &str, widths: &[u32]) -> Result<Vec<Dense>, Flaw> {
        // Several materials may get copies of it.
        let most = NeuBrdf::MAX_WIDTH;
        if widths.len() > NeuBrdf::MAX_LAYERS + 1 || widths.iter().any(|width| !(1..=most).contains(width)) {
            let found = format!("widths {:?} …", &widths[..widths.len().min(12)]);
            let expected = format!("at most {} layers of at most {most}", NeuBrdf::MAX_LAYERS);
            return Err(Flaw::new(field, found, expected));
        }
        let layer = |pair: &[u32]| {
            let (inputs, outputs) = (pair[0], pair[1]);
            let count = u64::from(inputs) * u64::from(outputs);
            let weights = self.numbers(&format!("{field}.weights"), count)?;
            let bias = self.numbers(&format!("{field}.bias"), outputs.into())?;
            Ok(Dense { inputs, outputs, weights, bias })
        };
        widths.windows(2).map(layer).collect()
    }

    /// The levels of a grid's pixels and the indices of its points into `codes` codes, ≥ 1.
    pub fn points(
        &mut self,
        name: &str,
        n_side: u32,
        is_merged: bool,
        codes: usize,
    ) -> Result<(SphereGrid, Vec<u8>, Vec<u16>), Flaw> {
        let field = |part: &str| format!("{name}.{part}");
        let grid = SphereGrid::new(n_side).ok_or_else(|| {
            let expected = format!("a power of two, at most {}", SphereGrid::MAX_N_SIDE);
            Flaw::new(field("n_side"), n_side.to_string(), expected)
        })?;
        let levels = if is_merged { self.levels(&field("levels"), grid)? } else { Vec::new() };
        let is_corner = grid.corners_of(&levels);
        let count = is_corner.iter().filter(|is_corner| **is_corner).count() as u64;
        let width = index_bits(codes);
        let mut bits = Bits { bytes: self.take(&field("indices"), (count * u64::from(width)).div_ceil(8))?, next: 0 };
        let index = |is_corner| if is_corner { bits.take(width) } else { NO_CODE };
        Ok((grid, levels, is_corner.into_iter().map(index).collect()))
    }

    /// The indices of texels, so many across and down, into `codes` codes, ≥ 1.
    pub fn texels(
        &mut self,
        name: &str,
        [width, height]: [u32; 2],
        codes: usize,
    ) -> Result<(SurfaceGrid, Vec<u16>), Flaw> {
        let field = |part: &str| format!("{name}.{part}");
        let grid = SurfaceGrid::new(width, height).ok_or_else(|| {
            let expected = format!("1 to {} to a side", SurfaceGrid::MAX_SIDE);
            Flaw::new(field("texels"), format!("{width} × {height}"), expected)
        })?;
        let (count, width) = (grid.point_count(), texel_bits(codes));
        let bytes = (count as u64 * u64::from(width)).div_ceil(8);
        let mut bits = Bits { bytes: self.take(&field("indices"), bytes)?, next: 0 };
        Ok((grid, (0..count).map(|_| bits.take(width)).collect()))
    }

    /// The frames of so many texels, as far as they are there.
    pub fn frames(
        &mut self,
        name: &str,
        points: usize,
        has_normals: bool,
        has_directions: bool,
    ) -> Result<SurfaceFrames, Flaw> {
        let mut pairs = |is_there: bool, part: &str| -> Result<Vec<[i16; 2]>, Flaw> {
            let count = if is_there { points } else { 0 };
            let (pairs, _) = self.take(&format!("{name}.{part}"), 4 * count as u64)?.as_chunks();
            Ok(pairs.iter().map(|[a, b, c, d]| [[*a, *b], [*c, *d]].map(i16::from_le_bytes)).collect())
        };
        Ok(SurfaceFrames { normals: pairs(has_normals, "normals")?, directions: pairs(has_directions, "directions")? })
    }

    fn levels(&mut self, field: &str, grid: SphereGrid) -> Result<Vec<u8>, Flaw> {
        let mut bits = Bits { bytes: self.rest, next: 0 };
        let levels = grid.merge_where(|_, _| bits.take(1) == 1);
        self.take(field, bits.next.div_ceil(8) as u64)?;
        Ok(levels)
    }

    fn numbers(&mut self, field: &str, count: u64) -> Result<Vec<f32>, Flaw> {
        Ok(match self.precision {
            Precision::F16 => {
                let (halves, _) = self.take(field, count.saturating_mul(2))?.as_chunks();
                halves.iter().map(|half| f16::from_le_bytes(*half).to_f32()).collect()
            }
            Precision::F32 => {
                let (words, _) = self.take(field, count.saturating_mul(4))?.as_chunks();
                words.iter().map(|word| f32::from_le_bytes(*word)).collect()
            }
        })
    }

    fn take(&mut self, field: &str, bytes: u64) -> Result<&'a [u8], Flaw> {
        let length = usize::try_from(bytes).unwrap_or(usize::MAX);
        let Some((taken, rest)) = self.rest.split_at_checked(length) else {
            return Err(Flaw::new(field, format!("{} bytes", self.rest.len()), format!("{bytes} by the header")));
        };
        self.rest = rest;
        Ok(taken)
    }
}

/// Bits into bytes, lowest first.
#[derive(Default)]
struct BitWriter {
    bytes: Vec<u8>,
    pending: u32,
    count: u32,
}

impl BitWriter {
    fn put(&mut self, value: u16, bits: u32) {
        self.pending |= u32::from(value) << self.count;
        self.count += bits;
        while self.count >= 8 {
            self.bytes.push(self.pending as u8);
            self.pending >>= 8;
            self.count -= 8;
        }
    }

    /// The bytes so far, the last one filled up with zeros.
    fn finish(&mut self) -> Vec<u8> {
        if self.count > 0 {
            self.bytes.push(self.pending as u8);
        }
        std::mem::take(self).bytes
    }
}

/// Bytes as bits, lowest first; zeros beyond the end.
struct Bits<'a> {
    bytes: &'a [u8],
    next: usize,
}

impl Bits<'_> {
    fn take(&mut self, count: u32) -> u16 {
        let bit = |at: usize| self.bytes.get(at / 8).map_or(0, |byte| u16::from(byte >> (at % 8) & 1));
        let value = (0..count).fold(0, |value, i| value | bit(self.next + i as usize) << i);
        self.next += count as usize;
        value
    }
}
