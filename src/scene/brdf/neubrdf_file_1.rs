//! `.neubrdf` files of version 1: one material. Behind the header stand, for ωi, then ωo, merged pixels, indices and codes; then
//! the layers.

use std::sync::Arc;

use serde::Deserialize;

use super::neubrdf_payload::Reader;
use super::{CornerWeights, Encoding, Flaw, NO_CODE, NeuBrdf, Precision, Provenance, SphereTable};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    is_isotropic: bool,
    corner_weights: CornerWeights,
    features: u32,
    wi: TableHeader,
    wo: TableHeader,
    widths: Vec<u32>,
    precision: Precision,
    encoding: Encoding,
    lobe: Vec<f32>,
    provenance: Provenance,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct TableHeader {
    n_side: u32,
    codes: u32,
    /// As many as an index of so many codes takes.
    index_bits: u32,
    is_merged: bool,
}

/// The material of a file's header and payload. It has still to be validated.
pub(super) fn decode(header: &[u8], payload: &[u8]) -> Result<NeuBrdf, Flaw> {
    let Header { is_isotropic, corner_weights, features, wi, wo, widths, precision, encoding, lobe, provenance } =
        super::neubrdf_file::parse(header)?;
    let mut reader = Reader { rest: payload, precision };
    let [wi, wo] = [table(&mut reader, "wi", &wi, features)?, table(&mut reader, "wo", &wo, features)?];
    let layers = reader.network("layers", &widths)?;
    reader.end()?;
    let lobe = super::neubrdf_file::lobe(&lobe)?;
    Ok(NeuBrdf {
        is_isotropic,
        corner_weights,
        wi,
        wo,
        coarser: Vec::new(),
        surface: None,
        sees_half_vector: false,
        layers,
        encoding,
        lobe,
        provenance,
    })
}

fn table(reader: &mut Reader, name: &str, header: &TableHeader, features: u32) -> Result<SphereTable, Flaw> {
    let TableHeader { n_side, codes, index_bits, is_merged } = *header;
    if codes == 0 || codes >= NO_CODE.into() || index_bits != u32::BITS - (codes - 1).leading_zeros() {
        let found = format!("{codes} codes and {index_bits} index_bits");
        return Err(Flaw::new(format!("{name}.codes"), found, "1 to 65534, and as many bits as indices of them take"));
    }
    let (grid, levels, indices) = reader.points(name, n_side, is_merged, codes as usize)?;
    let codebook = Arc::new(reader.codebook(name, features, codes)?);
    Ok(SphereTable { grid, codebook, indices, levels })
}
