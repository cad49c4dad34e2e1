//! `.neubrdf` files.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `NEUBRDF` and a zero |
//! | 4 | version, 1 |
//! | 4 | length of the header |
//! | that | the header, JSON: everything but the numbers below, and how many of each there are |
//! | rest | for ωi, then ωo: merged pixels, indices, codes; then the layers, weights before biases |
//! | 32 | BLAKE3 of all before |
//!
//! All is little-endian. Codes, weights and biases are `f16` or `f32`, as `precision` says. Indices take `index_bits` each, one
//! for each grid point that is the corner of a pixel, lowest bit first; merged pixels are one bit for each block that
//! [`SphereGrid::merge_where`] asks for, where `is_merged`. Both are filled up to whole bytes.

use std::fmt;
use std::io::Read;
use std::path::Path;

use half::f16;
use serde::{Deserialize, Serialize};

use super::{
    CornerWeights, Dense, Encoding, Flaw, NO_CODE, NeuBrdf, Provenance, SamplingLobe, SphereGrid, SphereTable,
};
use crate::scene::error::{Error, Place, open};

const MAGIC: [u8; 8] = *b"NEUBRDF\0";
const VERSION: u32 = 1;
const HASH_BYTES: usize = 32;
/// Magic, version, length of the header.
const PREAMBLE_BYTES: usize = 16;
/// No valid file is larger: 65,535 codes of 64 features for each hemisphere, and as much again for the rest.
const MOST_BYTES: u64 = 64 << 20;

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

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    is_isotropic: bool,
    corner_weights: CornerWeights,
    features: u32,
    wi: TableHeader,
    wo: TableHeader,
    /// Inputs, then the outputs of each layer.
    widths: Vec<u32>,
    precision: Precision,
    encoding: Encoding,
    /// [`SamplingLobe::to_floats`].
    lobe: Vec<f32>,
    provenance: Provenance,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TableHeader {
    n_side: u32,
    codes: u32,
    index_bits: u32,
    is_merged: bool,
}

impl NeuBrdf {
    /// The bytes of a `.neubrdf` file.
    ///
    /// # Errors
    /// If it is not valid, or has numbers that are too large for `f16`.
    pub fn encode(&self, precision: Precision) -> Result<Vec<u8>, Flaw> {
        self.validate()?;
        let table_header = |table: &SphereTable| TableHeader {
            n_side: table.grid.n_side(),
            codes: table.code_count() as u32,
            index_bits: index_bits(table.code_count()),
            is_merged: !table.levels.is_empty(),
        };
        let header = Header {
            is_isotropic: self.is_isotropic,
            corner_weights: self.corner_weights,
            features: self.wi.features,
            wi: table_header(&self.wi),
            wo: table_header(&self.wo),
            widths: self.layers.iter().map(|layer| layer.inputs).chain([3]).collect(),
            precision,
            encoding: self.encoding,
            lobe: self.lobe.to_floats().to_vec(),
            provenance: self.provenance.clone(),
        };
        let header = serde_json::to_vec(&header)
            .map_err(|error| Flaw::new("provenance", error.to_string(), "what JSON can hold"))?;
        let mut bytes = Vec::new();
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((header.len() as u32).to_le_bytes());
        bytes.extend(header);
        for (name, table) in [("wi", &self.wi), ("wo", &self.wo)] {
            let mut bits = BitWriter::default();
            if !table.levels.is_empty() {
                table.grid.merge_where(|level, pixels| {
                    let is_merged = u32::from(table.levels[pixels[0] as usize]) == level;
                    bits.put(is_merged.into(), 1);
                    is_merged
                });
            }
            bytes.append(&mut bits.finish());
            let width = index_bits(table.code_count());
            table.indices.iter().filter(|index| **index != NO_CODE).for_each(|index| bits.put(*index, width));
            bytes.append(&mut bits.finish());
            put_numbers(&mut bytes, precision, &table.codes).ok_or_else(|| too_large(&format!("{name}.codes")))?;
        }
        for layer in &self.layers {
            put_numbers(&mut bytes, precision, &layer.weights).ok_or_else(|| too_large("layers.weights"))?;
            put_numbers(&mut bytes, precision, &layer.bias).ok_or_else(|| too_large("layers.bias"))?;
        }
        bytes.extend(blake3::hash(&bytes).as_bytes());
        Ok(bytes)
    }

    /// Reads what [`NeuBrdf::encode`] wrote. What it returns is valid ([`NeuBrdf::validate`]).
    ///
    /// # Errors
    /// For anything else, naming the part that is wrong. Allocates no more than a few times the length of `bytes`.
    pub fn decode(bytes: &[u8]) -> Result<NeuBrdf, Flaw> {
        let is_cut = || Flaw::new("file", format!("{} bytes", bytes.len()), "more: it is cut off");
        let (content, hash) = bytes.split_last_chunk::<HASH_BYTES>().ok_or_else(is_cut)?;
        let (preamble, content_rest) = content.split_first_chunk::<PREAMBLE_BYTES>().ok_or_else(is_cut)?;
        let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| preamble[at + i]));
        if preamble[..8] != MAGIC {
            return Err(Flaw::new("magic", format!("{:02x?}", &preamble[..8]), "a .neubrdf file"));
        }
        if word(8) != VERSION {
            return Err(Flaw::new("version", word(8).to_string(), VERSION.to_string()));
        }
        if blake3::hash(content) != *hash {
            return Err(Flaw::new(
                "checksum",
                "another one than its content has",
                "a file that is whole and unchanged",
            ));
        }
        let (header, payload) = content_rest.split_at_checked(word(12) as usize).ok_or_else(is_cut)?;
        let header: Header = serde_json::from_slice(header)
            .map_err(|error| Flaw::new("header", format!("what is no header ({error})"), "JSON as documented"))?;
        let mut payload = Reader { rest: payload, precision: header.precision };
        let (wi, wo) =
            (payload.table("wi", &header.wi, header.features)?, payload.table("wo", &header.wo, header.features)?);
        let layers =
            header.widths.windows(2).map(|widths| payload.layer(widths[0], widths[1])).collect::<Result<_, _>>()?;
        if !payload.rest.is_empty() {
            return Err(Flaw::new(
                "file",
                format!("{} bytes too many", payload.rest.len()),
                "what the header announces",
            ));
        }
        let Header { is_isotropic, corner_weights, encoding, provenance, .. } = header;
        let lobe = header.lobe.as_slice().try_into().ok().and_then(SamplingLobe::from_floats);
        let lobe =
            lobe.ok_or_else(|| Flaw::new("lobe", format!("{:?}", header.lobe), "α and probabilities, in range"))?;
        let brdf = NeuBrdf { is_isotropic, corner_weights, wi, wo, layers, encoding, lobe, provenance };
        brdf.validate()?;
        Ok(brdf)
    }

    /// Reads a `.neubrdf` file.
    ///
    /// # Errors
    /// It cannot be read, or is not valid.
    pub fn load(path: &Path) -> Result<NeuBrdf, Error> {
        NeuBrdf::load_for(path, None)
    }

    /// The same, on behalf of a key of a scene file.
    pub(super) fn load_for(path: &Path, needed_by: Option<&Place>) -> Result<NeuBrdf, Error> {
        let mut bytes = Vec::new();
        let file = open(path, needed_by)?;
        file.take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(|source| Error::read(path, needed_by, source))?;
        let read = if bytes.len() as u64 > MOST_BYTES {
            Err(Flaw::new("file", "more bytes", format!("at most {MOST_BYTES}")))
        } else {
            NeuBrdf::decode(&bytes)
        };
        read.map_err(|Flaw { field, found, expected }| {
            Error::unexpected(Place { file: path.to_owned(), line: None, field: Some(field) }, found, expected)
        })
    }
}

fn too_large(field: &str) -> Flaw {
    Flaw::new(field, "a number that f16 cannot hold", "numbers of at most 65504, or f32")
}

/// Bits of an index into so many codes.
fn index_bits(codes: usize) -> u32 {
    usize::BITS - (codes - 1).leading_zeros()
}

/// `None` where a number becomes infinite.
fn put_numbers(bytes: &mut Vec<u8>, precision: Precision, numbers: &[f32]) -> Option<()> {
    for number in numbers {
        match precision {
            Precision::F16 => {
                let half = f16::from_f32(*number);
                half.is_finite().then_some(())?;
                bytes.extend(half.to_le_bytes());
            }
            Precision::F32 => bytes.extend(number.to_le_bytes()),
        }
    }
    Some(())
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

/// What is left of the payload.
struct Reader<'a> {
    rest: &'a [u8],
    precision: Precision,
}

impl<'a> Reader<'a> {
    fn take(&mut self, field: &str, bytes: u64) -> Result<&'a [u8], Flaw> {
        let length = usize::try_from(bytes).unwrap_or(usize::MAX);
        let Some((taken, rest)) = self.rest.split_at_checked(length) else {
            return Err(Flaw::new(field, format!("{} bytes", self.rest.len()), format!("{bytes} by the header")));
        };
        self.rest = rest;
        Ok(taken)
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

    fn table(&mut self, name: &str, header: &TableHeader, features: u32) -> Result<SphereTable, Flaw> {
        let field = |part: &str| format!("{name}.{part}");
        let grid = SphereGrid::new(header.n_side).ok_or_else(|| {
            let expected = format!("a power of two, at most {}", SphereGrid::MAX_N_SIDE);
            Flaw::new(field("n_side"), header.n_side.to_string(), expected)
        })?;
        let codes = header.codes as usize;
        if codes == 0 || codes >= usize::from(NO_CODE) || header.index_bits != index_bits(codes) {
            let found = format!("{codes} codes and {} index_bits", header.index_bits);
            return Err(Flaw::new(field("codes"), found, "1 to 65534, and as many bits as indices of them take"));
        }
        let levels = if header.is_merged { self.levels(&field("levels"), grid)? } else { Vec::new() };
        let is_corner = grid.corners_of(&levels);
        let count = is_corner.iter().filter(|is_corner| **is_corner).count() as u64;
        let packed = self.take(&field("indices"), (count * u64::from(header.index_bits)).div_ceil(8))?;
        let mut bits = Bits { bytes: packed, next: 0 };
        let index = |is_corner| if is_corner { bits.take(header.index_bits) } else { NO_CODE };
        let indices = is_corner.into_iter().map(index).collect();
        let codes = self.numbers(&field("codes"), u64::from(header.codes) * u64::from(features))?;
        Ok(SphereTable { grid, features, codes, indices, levels })
    }

    fn levels(&mut self, field: &str, grid: SphereGrid) -> Result<Vec<u8>, Flaw> {
        let mut bits = Bits { bytes: self.rest, next: 0 };
        let levels = grid.merge_where(|_, _| bits.take(1) == 1);
        self.take(field, bits.next.div_ceil(8) as u64)?;
        Ok(levels)
    }

    fn layer(&mut self, inputs: u32, outputs: u32) -> Result<Dense, Flaw> {
        let weights = self.numbers("layers.weights", u64::from(inputs) * u64::from(outputs))?;
        let bias = self.numbers("layers.bias", outputs.into())?;
        Ok(Dense { inputs, outputs, weights, bias })
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
