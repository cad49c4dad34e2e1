//! From what was trained to what is stored.

use std::sync::Arc;

use super::network::Network;
use super::table::Table;
use crate::scene::brdf::{
    Codebook, Dense, NO_CODE, Nbrdf, SphereGrid, SphereTable, SurfaceFrames, SurfaceGrid, SurfaceTable,
};

/// The layers as files hold them.
pub fn layers(network: &Network) -> Vec<Dense> {
    let layer = |shape: &super::network::Shape| Dense {
        inputs: shape.inputs as u32,
        outputs: shape.outputs as u32,
        weights: (0..shape.outputs)
            .flat_map(|output| (0..shape.inputs).map(move |input| network.parameters[shape.weight(output, input)]))
            .collect(),
        bias: (0..shape.outputs).map(|output| network.parameters[shape.bias(output)]).collect(),
    };
    network.shapes.iter().map(layer).collect()
}

/// The opposite of [`layers`].
pub fn network_of(layers: &[Dense]) -> Network {
    let widths: Vec<usize> = layers
        .iter()
        .map(|layer| layer.inputs)
        .chain(layers.last().map(|layer| layer.outputs))
        .map(|width| width as usize)
        .collect();
    let mut network = Network::zeros(&widths);
    for (layer, shape) in layers.iter().zip(network.shapes.clone()) {
        for (output, (row, bias)) in layer.weights.chunks_exact(shape.inputs).zip(&layer.bias).enumerate() {
            network.parameters[shape.bias(output)] = *bias;
            for (input, weight) in row.iter().enumerate() {
                network.parameters[shape.weight(output, input)] = *weight;
            }
        }
    }
    network
}

/// A hemisphere's points as they were trained.
pub struct TrainedPoints<'a> {
    /// Their codes.
    pub table: &'a Table,
    /// Where they are.
    pub grid: SphereGrid,
    /// Which pixels pairs lie in.
    pub seen: &'a [bool],
    /// The corners of these pixels, which the table has codes for.
    pub points: &'a [u32],
}

/// Tables as files hold them, of trained ones with equal codes: these they share. Pixels that no pair lies in are merged, and codes
/// that no point names left out.
pub fn sphere_tables(trained: &[TrainedPoints]) -> Vec<SphereTable> {
    let Some(TrainedPoints { table: Table { features, codes: all, .. }, .. }) = trained.first() else {
        return Vec::new();
    };
    let mut number = vec![None; all.len() / features];
    let mut codes = Vec::new();
    let numbered = |TrainedPoints { table, grid, seen, points }: &TrainedPoints| {
        let mut result = whole_table(*grid);
        for (point, code) in points.iter().zip(&table.indices) {
            let code = *code as usize;
            let next = codes.len() / features;
            result.indices[*point as usize] = *number[code].get_or_insert_with(|| {
                codes.extend(&all[code * features..][..*features]);
                // Features of points' own may be more than files can number, before they are given codes.
                next.min(usize::from(NO_CODE) - 1) as u16
            });
        }
        result.prune(|pixel| seen[pixel as usize]);
        result
    };
    let tables: Vec<SphereTable> = trained.iter().map(numbered).collect();
    let codebook = Arc::new(Codebook { features: *features as u32, codes });
    tables.into_iter().map(|table| SphereTable { codebook: codebook.clone(), ..table }).collect()
}

/// A table of texels with these frames as files hold it. Codes that no texel names, of a codebook smaller than the number of texels, stay.
pub fn surface_table(table: &Table, grid: SurfaceGrid, frames: SurfaceFrames) -> SurfaceTable {
    // Features of texels' own may be more than files can number, before they are given codes.
    let codes = (table.codes.len() / table.features).min(usize::from(NO_CODE) - 1);
    SurfaceTable {
        grid,
        codebook: Arc::new(Codebook {
            features: table.features as u32,
            codes: table.codes[..codes * table.features].to_vec(),
        }),
        indices: table.indices.iter().map(|index| (*index as usize).min(codes - 1) as u16).collect(),
        frames,
    }
}

/// A grid in which each point counts, before it has codes.
pub fn whole_table(grid: SphereGrid) -> SphereTable {
    let codebook = Arc::new(Codebook { features: 1, codes: Vec::new() });
    SphereTable { grid, codebook, indices: vec![0; grid.point_count()], levels: Vec::new() }
}

/// A grid in which pixels that no pair lies in are merged, and each point names a point whose features it has, itself if it can.
pub fn merged_table(grid: SphereGrid, seen: &[bool]) -> SphereTable {
    let mut table = whole_table(grid);
    // A plan with points that cannot be named is not valid.
    table.indices = (0..grid.point_count()).map(|point| point as u16).collect();
    table.prune(|pixel| seen[pixel as usize]);
    table
}

/// The network of an NBRDF, if it is one.
pub fn nbrdf(network: &Network) -> Option<Nbrdf> {
    let [first, second, third] = network.shapes.as_slice() else { return None };
    let weights = &network.parameters;
    let is_nbrdf = network.widths() == [Nbrdf::INPUTS, Nbrdf::HIDDEN, Nbrdf::HIDDEN, 3];
    is_nbrdf.then(|| Nbrdf {
        kernel_1: std::array::from_fn(|i| std::array::from_fn(|o| weights[first.weight(o, i)])),
        bias_1: std::array::from_fn(|o| weights[first.bias(o)]),
        kernel_2: std::array::from_fn(|i| std::array::from_fn(|o| weights[second.weight(o, i)])),
        bias_2: std::array::from_fn(|o| weights[second.bias(o)]),
        kernel_3: std::array::from_fn(|i| std::array::from_fn(|o| weights[third.weight(o, i)])),
        bias_3: std::array::from_fn(|o| weights[third.bias(o)]),
    })
}
