//! `.neubrdf` files: one material, or a pack of several that share codebooks.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `NEUBRDF` and a zero |
//! | 4 | version, 2 |
//! | 4 | length of the header |
//! | that | the header, JSON: everything but the numbers below, and how many of each there are |
//! | rest | codebooks; networks, each layer's weights before its biases; for each material those of ωi, then ωo, then the coarser ones likewise: merged pixels, indices; then, of one that varies, indices of texels, and what there is of their normals and directions |
//! | 32 | BLAKE3 of all before |
//!
//! All is little-endian. Materials name their codebooks and their network by number; each stands there once, however many materials
//! name it. Codes, weights and biases are `f16` or `f32`, as `precision` says. Indices take as many bits each as the greatest
//! index of the codebook, one for each grid point that is the corner of a pixel, lowest bit first; merged pixels are one bit for
//! each block that [`SphereGrid::merge_where`](super::SphereGrid::merge_where) asks for, where `is_merged`. Both are filled up to
//! whole bytes. Normals and directions ([`super::SurfaceFrames`]) are two numbers of 16 bits a texel each. Version 1, of one material, is `neubrdf_file_1.rs`.

use std::path::Path;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::neubrdf_payload::{Reader, Writer};
use super::{
    Codebook, CornerWeights, Dense, Encoding, Flaw, NeuBrdf, Precision, Provenance, SamplingLobe, SphereTable,
    SurfaceTable, neubrdf_file_1, picked,
};
use crate::scene::error::{Error, Place, read_bytes};

const MAGIC: [u8; 8] = *b"NEUBRDF\0";
const VERSION: u32 = 2;
const HASH_BYTES: usize = 32;
/// Magic, version, length of the header.
const PREAMBLE_BYTES: usize = 16;
/// Longest file, bytes.
const LONGEST_FILE: u64 = 256 << 20;

/// Materials of a file. Tables whose codebooks are equal share one.
#[derive(Clone, Debug, PartialEq)]
pub struct NeuBrdfPack {
    /// Their names and what they are. Names differ, and are empty only where there is one material.
    pub materials: Vec<(String, NeuBrdf)>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    precision: Precision,
    codebooks: Vec<CodebookHeader>,
    networks: Vec<NetworkHeader>,
    materials: Vec<MaterialHeader>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CodebookHeader {
    features: u32,
    codes: u32,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct NetworkHeader {
    /// Inputs, then the outputs of each layer.
    widths: Vec<u32>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialHeader {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    name: String,
    is_isotropic: bool,
    corner_weights: CornerWeights,
    wi: TableHeader,
    wo: TableHeader,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    coarser: Vec<[TableHeader; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    surface: Option<SurfaceHeader>,
    #[serde(default, skip_serializing_if = "is_false")]
    sees_half_vector: bool,
    /// Which of the networks.
    network: usize,
    encoding: Encoding,
    /// [`SamplingLobe::to_floats`].
    lobe: Vec<f32>,
    provenance: Provenance,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TableHeader {
    /// Which of the codebooks.
    codebook: usize,
    n_side: u32,
    is_merged: bool,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SurfaceHeader {
    /// Which of the codebooks.
    codebook: usize,
    /// Texels across and down.
    texels: [u32; 2],
    #[serde(default, skip_serializing_if = "is_false")]
    has_normals: bool,
    #[serde(default, skip_serializing_if = "is_false")]
    has_directions: bool,
}

fn is_false(value: &bool) -> bool {
    !value
}

impl NeuBrdfPack {
    /// The most materials of a file. However short it is, each may take a MiB of memory.
    pub const MAX_MATERIALS: usize = 256;

    /// A file's content of one material without a name.
    pub fn of(material: NeuBrdf) -> NeuBrdfPack {
        NeuBrdfPack { materials: vec![(String::new(), material)] }
    }

    /// Whether each material is valid ([`NeuBrdf::validate`]), and names tell them apart.
    ///
    /// # Errors
    /// What is wrong.
    pub fn validate(&self) -> Result<(), Flaw> {
        let count = self.materials.len();
        let most = Self::MAX_MATERIALS;
        if !(1..=most).contains(&count) {
            return Err(Flaw::new("materials", count.to_string(), format!("1 to {most}")));
        }
        for (index, (name, material)) in self.materials.iter().enumerate() {
            let is_known = self.materials[..index].iter().any(|(other, _)| other == name);
            if is_known || name.is_empty() && count > 1 {
                return Err(Flaw::new(format!("materials[{index}].name"), format!("`{name}`"), "a name of its own"));
            }
            material.validate().map_err(|flaw| if count > 1 { flaw.of_material(index) } else { flaw })?;
        }
        Ok(())
    }

    /// The bytes of a `.neubrdf` file.
    ///
    /// # Errors
    /// If a material is not valid, or has numbers that are too large for `f16`.
    pub fn encode(&self, precision: Precision) -> Result<Vec<u8>, Flaw> {
        self.validate()?;
        let mut codebooks: Vec<&Codebook> = Vec::new();
        let mut networks: Vec<&[Dense]> = Vec::new();
        let mut materials = Vec::new();
        for (name, material) in &self.materials {
            let [wi, wo] = [&material.wi, &material.wo].map(|table| table_header(table, &mut codebooks));
            let coarser = material.coarser.iter();
            let coarser =
                coarser.map(|pair| pair.each_ref().map(|table| table_header(table, &mut codebooks))).collect();
            let surface = material.surface.as_ref().map(|surface| SurfaceHeader {
                codebook: place_of(&*surface.codebook, &mut codebooks),
                texels: surface.grid.size(0),
                has_normals: !surface.frames.normals.is_empty(),
                has_directions: !surface.frames.directions.is_empty(),
            });
            materials.push(MaterialHeader {
                name: name.clone(),
                is_isotropic: material.is_isotropic,
                corner_weights: material.corner_weights,
                wi,
                wo,
                coarser,
                surface,
                sees_half_vector: material.sees_half_vector,
                network: place_of(&material.layers[..], &mut networks),
                encoding: material.encoding,
                lobe: material.lobe.to_floats().to_vec(),
                provenance: material.provenance.clone(),
            });
        }
        let codebook =
            |codebook: &&Codebook| CodebookHeader { features: codebook.features, codes: codebook.code_count() as u32 };
        let network =
            |layers: &&[Dense]| NetworkHeader { widths: layers.iter().map(|layer| layer.inputs).chain([3]).collect() };
        let header = Header {
            precision,
            codebooks: codebooks.iter().map(codebook).collect(),
            networks: networks.iter().map(network).collect(),
            materials,
        };
        let header = serde_json::to_vec(&header)
            .map_err(|error| Flaw::new("provenance", error.to_string(), "what JSON can hold"))?;
        let length = (header.len() as u32).to_le_bytes();
        let mut writer = Writer { bytes: [&MAGIC, &VERSION.to_le_bytes()[..], &length, &header].concat(), precision };
        for (index, codebook) in codebooks.iter().enumerate() {
            writer.codebook(&format!("codebooks[{index}]"), codebook)?;
        }
        for (index, layers) in networks.iter().enumerate() {
            writer.network(&format!("networks[{index}]"), layers)?;
        }
        for (_, material) in &self.materials {
            material.hemispheres().for_each(|table| writer.points(table));
            material.surface.iter().for_each(|surface| writer.texels(surface));
        }
        let mut bytes = writer.bytes;
        bytes.extend(blake3::hash(&bytes).as_bytes());
        Ok(bytes)
    }

    /// Reads what [`NeuBrdfPack::encode`] wrote, or a file of version 1. What it returns is valid ([`NeuBrdfPack::validate`]).
    ///
    /// # Errors
    /// For anything else, naming the part that is wrong. Allocates no more than some sixteen times the length of `bytes` and a MiB for
    /// each material.
    pub fn decode(bytes: &[u8]) -> Result<NeuBrdfPack, Flaw> {
        if !bytes.starts_with(&MAGIC) && !MAGIC.starts_with(bytes) {
            let expected = "a .neubrdf file, as `neubrdf train` makes it of a material";
            return Err(Flaw::new("file", "one that does not begin as a .neubrdf file", expected));
        }
        let is_cut = || Flaw::new("file", format!("{} bytes", bytes.len()), "more: it is cut off");
        let (content, hash) = bytes.split_last_chunk::<HASH_BYTES>().ok_or_else(is_cut)?;
        let (preamble, content_rest) = content.split_first_chunk::<PREAMBLE_BYTES>().ok_or_else(is_cut)?;
        let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| preamble[at + i]));
        if !(1..=VERSION).contains(&word(8)) {
            return Err(Flaw::new("version", word(8).to_string(), format!("1 or {VERSION}")));
        }
        if blake3::hash(content) != *hash {
            return Err(Flaw::new(
                "checksum",
                "another one than its content has",
                "a file that is whole and unchanged",
            ));
        }
        let (header, payload) = content_rest.split_at_checked(word(12) as usize).ok_or_else(is_cut)?;
        let pack = match word(8) {
            1 => NeuBrdfPack::of(neubrdf_file_1::decode(header, payload)?),
            _ => decode(header, payload)?,
        };
        pack.validate()?;
        Ok(pack)
    }

    /// Reads a `.neubrdf` file.
    ///
    /// # Errors
    /// It cannot be read, or is not valid.
    pub fn load(path: &Path) -> Result<NeuBrdfPack, Error> {
        NeuBrdfPack::load_for(path, None)
    }

    /// The same, on behalf of a key of a scene file.
    fn load_for(path: &Path, needed_by: Option<&Place>) -> Result<NeuBrdfPack, Error> {
        NeuBrdfPack::decode_of(&read_bytes(path, needed_by, LONGEST_FILE)?, path)
    }

    /// The same of a file's bytes.
    fn decode_of(bytes: &[u8], file: &Path) -> Result<NeuBrdfPack, Error> {
        NeuBrdfPack::decode(bytes).map_err(|Flaw { field, found, expected }| {
            Error::unexpected(Place { file: file.to_owned(), line: None, field: Some(field) }, found, expected)
        })
    }

    /// The material of that name, or the only one.
    fn pick(mut self, name: Option<&str>, file: &Path) -> Result<NeuBrdf, Error> {
        let names: Vec<&str> = self.materials.iter().map(|(name, _)| name.as_str()).collect();
        let place = picked(file, name, &names)?;
        Ok(self.materials.swap_remove(place).1)
    }
}

impl NeuBrdf {
    /// The bytes of a `.neubrdf` file of this one material.
    ///
    /// # Errors
    /// As of [`NeuBrdfPack::encode`].
    pub fn encode(&self, precision: Precision) -> Result<Vec<u8>, Flaw> {
        NeuBrdfPack::of(self.clone()).encode(precision)
    }

    /// Reads what [`NeuBrdf::encode`] wrote.
    ///
    /// # Errors
    /// As of [`NeuBrdfPack::decode`], and for a pack of several.
    pub fn decode(bytes: &[u8]) -> Result<NeuBrdf, Flaw> {
        let mut materials = NeuBrdfPack::decode(bytes)?.materials;
        match (materials.pop(), materials.len()) {
            (Some((_, material)), 0) => Ok(material),
            (_, others) => Err(Flaw::new("materials", format!("{} of them", others + 1), "one")),
        }
    }

    /// The material of a `.neubrdf` file; of a pack the one of this name.
    ///
    /// # Errors
    /// The file cannot be read or is not valid, or does not tell which material is meant.
    pub fn load(path: &Path, name: Option<&str>) -> Result<NeuBrdf, Error> {
        NeuBrdf::load_for(path, name, None)
    }

    /// The same, on behalf of a key of a scene file.
    pub(super) fn load_for(path: &Path, name: Option<&str>, needed_by: Option<&Place>) -> Result<NeuBrdf, Error> {
        NeuBrdfPack::load_for(path, needed_by)?.pick(name, path)
    }

    /// The same of a file's bytes; `file` is what errors call them.
    pub(crate) fn decode_of(bytes: &[u8], name: Option<&str>, file: &Path) -> Result<NeuBrdf, Error> {
        NeuBrdfPack::decode_of(bytes, file)?.pick(name, file)
    }
}

/// What the header says of a table, whose codebook is added to the list unless an equal one is there.
fn table_header<'a>(table: &'a SphereTable, codebooks: &mut Vec<&'a Codebook>) -> TableHeader {
    TableHeader {
        codebook: place_of(&*table.codebook, codebooks),
        n_side: table.grid.n_side(),
        is_merged: !table.levels.is_empty(),
    }
}

/// A material of version 2. It has still to be validated.
fn decode(header: &[u8], payload: &[u8]) -> Result<NeuBrdfPack, Flaw> {
    let Header { precision, codebooks, networks, materials } = parse(header)?;
    if materials.len() > NeuBrdfPack::MAX_MATERIALS {
        let expected = format!("at most {}", NeuBrdfPack::MAX_MATERIALS);
        return Err(Flaw::new("materials", materials.len().to_string(), expected));
    }
    let mut reader = Reader { rest: payload, precision };
    let codebook = |(index, header): (usize, &CodebookHeader)| {
        let name = format!("codebooks[{index}]");
        let codebook = reader.codebook(&name, header.features, header.codes)?;
        codebook.validate(&name)?;
        Ok(Arc::new(codebook))
    };
    let codebooks = codebooks.iter().enumerate().map(codebook).collect::<Result<Vec<_>, Flaw>>()?;
    let network =
        |(index, header): (usize, &NetworkHeader)| reader.network(&format!("networks[{index}]"), &header.widths);
    let networks = networks.iter().enumerate().map(network).collect::<Result<Vec<_>, Flaw>>()?;
    let table = |reader: &mut Reader, name: &str, header: &TableHeader| {
        let codebook = named(&codebooks, header.codebook, &format!("{name}.codebook"))?.clone();
        let (grid, levels, indices) = reader.points(name, header.n_side, header.is_merged, codebook.code_count())?;
        Ok(SphereTable { grid, codebook, indices, levels })
    };
    let coarser = |reader: &mut Reader, headers: &[[TableHeader; 2]]| {
        let pair = |(index, [wi, wo]): (usize, &[TableHeader; 2])| {
            let name = |side| format!("coarser[{index}].{side}");
            Ok([table(reader, &name("wi"), wi)?, table(reader, &name("wo"), wo)?])
        };
        headers.iter().take(NeuBrdf::MAX_COARSER + 1).enumerate().map(pair).collect::<Result<Vec<_>, Flaw>>()
    };
    let surface = |reader: &mut Reader, header: &SurfaceHeader| {
        let codebook = named(&codebooks, header.codebook, "surface.codebook")?.clone();
        let (grid, indices) = reader.texels("surface", header.texels, codebook.code_count())?;
        let frames = reader.frames("surface", grid.point_count(), header.has_normals, header.has_directions)?;
        Ok(SurfaceTable { grid, codebook, indices, frames })
    };
    let mut material = |header: MaterialHeader| -> Result<(String, NeuBrdf), Flaw> {
        let brdf = NeuBrdf {
            is_isotropic: header.is_isotropic,
            corner_weights: header.corner_weights,
            wi: table(&mut reader, "wi", &header.wi)?,
            wo: table(&mut reader, "wo", &header.wo)?,
            coarser: coarser(&mut reader, &header.coarser)?,
            surface: header.surface.as_ref().map(|header| surface(&mut reader, header)).transpose()?,
            sees_half_vector: header.sees_half_vector,
            layers: named(&networks, header.network, "network")?.clone(),
            encoding: header.encoding,
            lobe: lobe(&header.lobe)?,
            provenance: header.provenance,
        };
        Ok((header.name, brdf))
    };
    let numbered = |(index, header)| material(header).map_err(|flaw| flaw.of_material(index));
    let materials = materials.into_iter().enumerate().map(numbered).collect::<Result<_, _>>()?;
    reader.end()?;
    Ok(NeuBrdfPack { materials })
}

/// What a header says.
pub(super) fn parse<T: DeserializeOwned>(header: &[u8]) -> Result<T, Flaw> {
    serde_json::from_slice(header)
        .map_err(|error| Flaw::new("header", format!("what is no header ({error})"), "JSON as documented"))
}

/// A lobe of a header.
pub(super) fn lobe(floats: &[f32]) -> Result<SamplingLobe, Flaw> {
    let lobe = floats.try_into().ok().and_then(SamplingLobe::from_floats);
    lobe.ok_or_else(|| Flaw::new("lobe", format!("{floats:?}"), "α and probabilities, in range"))
}

/// What a header means by a number.
fn named<'a, T>(list: &'a [T], index: usize, field: &str) -> Result<&'a T, Flaw> {
    list.get(index).ok_or_else(|| Flaw::new(field, index.to_string(), format!("a number below {}", list.len())))
}

/// Where an item stands in a list, to which it is added unless an equal one is there.
fn place_of<'a, T: PartialEq + ?Sized>(item: &'a T, list: &mut Vec<&'a T>) -> usize {
    let place = list.iter().position(|other| std::ptr::eq(*other, item) || *other == item);
    place.unwrap_or_else(|| {
        list.push(item);
        list.len() - 1
    })
}
