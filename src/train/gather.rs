//! Features of directions and places: weighted sums of those at grid points.

use glam::{DVec3, Vec2};

use super::table::Table;
use super::vector::weighted_sum;
use crate::material::{half_vector, half_vector_inputs, turned};
use crate::scene::brdf::{CornerWeights, Footprint, NeuBrdf, SpherePlace, SphereTable, SurfaceGrid};

/// Grid points and their weights at a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Corners {
    /// The points.
    pub points: [u32; 4],
    /// Their weights.
    pub weights: [f32; 4],
}

impl Corners {
    /// What the features at a place are made of.
    pub fn of(table: &SphereTable, at: SpherePlace, corner_weights: CornerWeights) -> Corners {
        let gathered = table.gather(at, corner_weights);
        Corners { points: gathered.points, weights: gathered.weights.map(|weight| weight as f32) }
    }
}

/// Texels and their weights at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Texels {
    /// The points.
    pub points: [u32; 8],
    /// Their weights.
    pub weights: [f32; 8],
}

impl Texels {
    /// What the features of a footprint are made of.
    pub fn of(grid: &SurfaceGrid, footprint: Footprint) -> Texels {
        let gathered = grid.gather(footprint);
        Texels { points: gathered.points, weights: gathered.weights.map(|weight| weight as f32) }
    }
}

/// The features of all points of a hemisphere or a texture, points × F.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    /// F.
    pub features: usize,
    /// The features.
    pub rows: &'a [f32],
}

impl<'a> Rows<'a> {
    /// Those of a table.
    pub fn of(table: &'a Table) -> Rows<'a> {
        Rows { features: table.features, rows: &table.rows }
    }

    fn row(&self, point: u32) -> &'a [f32] {
        &self.rows[point as usize * self.features..][..self.features]
    }
}

/// The features of directions, by [`NeuBrdf::hemispheres`](crate::scene::brdf::NeuBrdf::hemispheres), and where there is one more table those
/// of the place, and behind them what is seen of a half vector, at the start of `out`.
pub fn gather_features(
    tables: &[Rows],
    corners: &[Corners],
    texels: Option<&Texels>,
    half_vector: Option<Vec2>,
    out: &mut [f32],
) {
    let mut rest = out;
    for (table, at) in tables.iter().zip(corners) {
        let (out, after) = rest.split_at_mut(table.features);
        rest = after;
        weighted_sum(at.points.map(|point| table.row(point)), at.weights, out);
    }
    if let (Some(table), Some(texels)) = (tables.get(corners.len()), texels) {
        let (out, after) = rest.split_at_mut(table.features);
        rest = after;
        weighted_sum(texels.points.map(|point| table.row(point)), texels.weights, out);
    }
    if let Some(half_vector) = half_vector {
        rest[..NeuBrdf::HALF_VECTOR_INPUTS as usize]
            .copy_from_slice(&half_vector_inputs(half_vector.as_dvec2()).map(|x| x as f32));
    }
}

/// Where ωi and ωo are on the finest of the tables of [`NeuBrdf::hemispheres`].
pub fn places(tables: &[SphereTable], frame: [DVec3; 2]) -> [SpherePlace; 2] {
    [0, 1].map(|side| tables[side].grid.place(frame[side]))
}

/// The half vector of ωi and ωo as a NeuBRDF sees them.
pub fn half_vector_in([wi, wo]: [DVec3; 2]) -> Vec2 {
    half_vector(wo, wi).as_vec2()
}

/// ωi and ωo as a NeuBRDF sees them.
pub fn in_frame(wo: DVec3, wi: DVec3, is_isotropic: bool) -> [DVec3; 2] {
    let [wo, wi] = if is_isotropic { turned(wo, wi) } else { [wo, wi] };
    [wi, wo]
}
