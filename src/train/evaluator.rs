//! Trained models at many pairs of directions at once, in `f32`, on all lanes: what reports need.

use std::array::from_fn;

use glam::DVec3;
use rayon::prelude::*;

use super::gather::{Corners, Rows, Texels, gather_features, half_vector_in, in_frame, places};
use super::measure::Query;
use super::network::{Network, Shard};
use super::product::padded;
use super::result::network_of;
use super::session::half_difference;
use crate::scene::brdf::{
    Codebook, CornerWeights, Encoding, Footprint, NO_CODE, NeuBrdf, SphereTable, SurfaceFrames, SurfaceGrid,
};

/// A NeuBRDF or an NBRDF, ready to be evaluated.
pub struct Evaluator {
    network: Network,
    is_isotropic: bool,
    /// An NBRDF has none.
    features: Option<Features>,
}

struct Features {
    tables: Vec<SphereTable>,
    texels: Option<(SurfaceGrid, SurfaceFrames)>,
    /// F, and points × F, of each table.
    rows: Vec<(usize, Vec<f32>)>,
    corner_weights: CornerWeights,
    sees_half_vector: bool,
    encoding: Encoding,
}

/// Tables of directions that a NeuBRDF has at most.
const MOST_TABLES: usize = 2 * (NeuBrdf::MAX_COARSER + 1);

/// Rows that go through the network together.
const ROWS: usize = 256;

impl Evaluator {
    /// Of a NeuBRDF.
    pub fn neubrdf(brdf: &NeuBrdf) -> Evaluator {
        let tables: Vec<SphereTable> = brdf.hemispheres().cloned().collect();
        let rows = |codebook: &Codebook, indices: &[u16]| {
            let features = codebook.features as usize;
            let row = |index: &u16| {
                // A point that is no corner has no code, and no one asks.
                let code = if *index == NO_CODE { 0 } else { usize::from(*index) };
                &codebook.codes[code * features..][..features]
            };
            (features, indices.iter().flat_map(row).copied().collect())
        };
        let of_sphere = |table: &SphereTable| rows(&table.codebook, &table.indices);
        let of_surface = brdf.surface.iter().map(|table| rows(&table.codebook, &table.indices));
        let features = Some(Features {
            rows: tables.iter().map(of_sphere).chain(of_surface).collect(),
            tables,
            texels: brdf.surface.as_ref().map(|table| (table.grid, table.frames.clone())),
            corner_weights: brdf.corner_weights,
            sees_half_vector: brdf.sees_half_vector,
            encoding: brdf.encoding,
        });
        Evaluator { network: network_of(&brdf.layers), is_isotropic: brdf.is_isotropic, features }
    }

    /// Of the network of an NBRDF.
    pub fn nbrdf(network: Network, is_isotropic: bool) -> Evaluator {
        Evaluator { network, is_isotropic, features: None }
    }

    /// The network.
    pub(super) fn network(&self) -> &Network {
        &self.network
    }

    /// The BRDF in sr⁻¹, RGB, at each (ωo, ωi), which are above the surface; of a material that varies, its average.
    pub fn eval(&self, pairs: &[[DVec3; 2]]) -> Vec<DVec3> {
        self.values(pairs, |[wo, wi]| Query { footprint: Footprint::WHOLE, wo: *wo, wi: *wi })
    }

    /// The same as seen at places.
    pub fn eval_at(&self, queries: &[Query]) -> Vec<DVec3> {
        self.values(queries, |query| *query)
    }

    fn values<T: Sync>(&self, queries: &[T], query: impl Fn(&T) -> Query + Sync) -> Vec<DVec3> {
        let mut values = vec![DVec3::ZERO; queries.len()];
        values.par_chunks_mut(ROWS).zip(queries.par_chunks(ROWS)).for_each(|(values, queries)| {
            let (queries, received): (Vec<Query>, Vec<f64>) =
                queries.iter().map(&query).map(|query| self.turned(query)).unzip();
            let mut shard = Shard::new(&self.network, queries.len());
            let stride = padded(shard.width());
            for (row, query) in shard.inputs().chunks_exact_mut(stride).zip(&queries) {
                self.inputs(query, row);
            }
            self.network.forward(&mut shard);
            let (outputs, _) = shard.outputs();
            for ((value, output), received) in values.iter_mut().zip(outputs.chunks_exact(padded(3))).zip(received) {
                let [r, g, b] = [0, 1, 2].map(|channel| f64::from(output[channel]));
                *value = received * self.decode(DVec3::new(r, g, b));
            }
        });
        values
    }

    /// A query about the frame of its place, and what that receives of its light.
    fn turned(&self, query: Query) -> (Query, f64) {
        let texels = self.features.as_ref().and_then(|features| features.texels.as_ref());
        let frame = texels.and_then(|(grid, frames)| frames.look_up(grid, query.footprint));
        match frame.map(|frame| frame.turned(query.wo, query.wi)) {
            None => (query, 1.0),
            Some(None) => (query, 0.0),
            Some(Some(([wo, wi], received))) => (Query { wo, wi, ..query }, received),
        }
    }

    /// What the network sees of a query about the frame of its place.
    pub(super) fn inputs(&self, &Query { footprint, wo, wi }: &Query, row: &mut [f32]) {
        match &self.features {
            None => row[..6].copy_from_slice(&half_difference(wo, wi, self.is_isotropic)),
            Some(Features { tables, texels, rows, corner_weights, sees_half_vector, .. }) => {
                let frame = in_frame(wo, wi, self.is_isotropic);
                let views = from_fn(|table| match rows.get(table) {
                    Some((features, rows)) => Rows { features: *features, rows },
                    None => Rows { features: 0, rows: &[] },
                });
                let views: &[Rows; MOST_TABLES + 1] = &views;
                let mut corners = [Corners::default(); MOST_TABLES];
                let at = tables.iter().zip(places(tables, frame).into_iter().cycle());
                corners.iter_mut().zip(at).for_each(|(corners, (table, at))| {
                    *corners = Corners::of(table, at, *corner_weights);
                });
                let texels = texels.as_ref().map(|(grid, _)| Texels::of(grid, footprint));
                let half_vector = sees_half_vector.then(|| half_vector_in(frame));
                gather_features(&views[..rows.len()], &corners[..tables.len()], texels.as_ref(), half_vector, row);
            }
        }
    }

    fn decode(&self, outputs: DVec3) -> DVec3 {
        match &self.features {
            None => outputs.map(|y| y.clamp(0.0, crate::material::NBRDF_LARGEST_OUTPUT).exp_m1()),
            Some(Features { encoding, .. }) => encoding.decode(outputs),
        }
    }
}
