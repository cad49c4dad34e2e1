//! A BRDF as a small network over features that stand on two hemispheres, one of ωi and one of ωo: *Real-Time Neural BRDF with
//! Spherically Distributed Primitives*. What it computes is `crate::material`'s; here is what it consists of.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{Located, SamplingLobe, SphereGrid, SpherePlace, SurfaceTable};
use crate::scene::hash::put;

/// [`SphereTable::indices`] of a point that is a corner of no pixel, since merging made its pixels one.
pub const NO_CODE: u16 = u16::MAX;

/// How much each corner of a pixel counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CornerWeights {
    /// A quarter each, the paper's choice. In merged pixels, which are large, by the inverse of the distance.
    Uniform,
    /// Bilinear within the pixel, of whatever size: continuous over pixels of one size.
    Bilinear,
}

/// Features that grid points name by number, and tables of several materials can share.
#[derive(Clone, Debug, PartialEq)]
pub struct Codebook {
    /// Features of a code, F.
    pub features: u32,
    /// Codes × F.
    pub codes: Vec<f32>,
}

impl Codebook {
    /// How many codes there are.
    pub fn code_count(&self) -> usize {
        self.codes.len() / self.features.max(1) as usize
    }
}

/// Features over a hemisphere: grid points name codes of a codebook.
#[derive(Clone, Debug, PartialEq)]
pub struct SphereTable {
    /// Where its points are.
    pub grid: SphereGrid,
    /// The codes.
    pub codebook: Arc<Codebook>,
    /// The code of each grid point, or [`NO_CODE`].
    pub indices: Vec<u16>,
    /// How often each pixel was merged with its siblings ([`SphereGrid::merge`]); empty where none was.
    pub levels: Vec<u8>,
}

/// The grid points that a direction's features are the weighted sum of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gathered {
    /// Points; one may come twice.
    pub points: [u32; 4],
    /// Their weights, ≥ 0, with the sum 1.
    pub weights: [f64; 4],
}

impl SphereTable {
    /// What the features at a place of this grid or a finer one are made of.
    pub fn gather(&self, at: SpherePlace, corner_weights: CornerWeights) -> Gathered {
        let mut level = 0;
        let located = at.on(self.grid).merged(|pixel| {
            level = self.levels.get(pixel as usize).map_or(0, |level| u32::from(*level));
            level
        });
        let weights = match corner_weights {
            CornerWeights::Bilinear => located.bilinear_weights(),
            CornerWeights::Uniform if level == 0 => [0.25; 4],
            CornerWeights::Uniform => inverse_distances(&located),
        };
        Gathered { points: located.corners, weights }
    }

    /// Merges pixels without data ([`SphereGrid::merge`]) and drops the points that are no corner any more. Corners that no
    /// pixel with data touches take over the code of the nearest point that one does; unless none does, when all stays as it is.
    pub fn prune(&mut self, has_data: impl Fn(u32) -> bool) {
        let known = self.known_points(&has_data);
        if known.is_empty() {
            return;
        }
        let levels = self.grid.merge(|pixel| !has_data(pixel));
        let is_corner = self.grid.corners_of(&levels);
        let directions: Vec<DVec3> = known.iter().map(|point| self.grid.point(*point as usize)).collect();
        let old = self.indices.clone();
        for (point, index) in self.indices.iter_mut().enumerate() {
            if !is_corner[point] {
                *index = NO_CODE;
            } else if known.binary_search(&(point as u32)).is_err() {
                let here = self.grid.point(point);
                let distance = |k: &usize| directions[*k].distance_squared(here);
                let nearest = (0..known.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
                *index = nearest.map_or(*index, |k| old[known[k] as usize]);
            }
        }
        self.levels = if levels.iter().all(|level| *level == 0) { Vec::new() } else { levels };
    }

    /// The points that data was seen next to, in order: corners of pixels with data.
    pub(crate) fn known_points(&self, has_data: impl Fn(u32) -> bool) -> Vec<u32> {
        let with_data = self.grid.pixels().filter(|(pixel, _)| has_data(*pixel));
        let points: BTreeSet<u32> = with_data.flat_map(|(_, corners)| corners).collect();
        points.into_iter().collect()
    }
}

/// Weights by the inverse of the Euclidean distance in the pixel's plane, where areas are those on the sphere.
fn inverse_distances(located: &Located) -> [f64; 4] {
    // A corner closer than this is all that counts; beyond, division is safe.
    const NEAREST: f64 = 1e-2;
    let &Located { u, v, .. } = located;
    let mut weights =
        [(u, v), (1.0 - u, v), (u, 1.0 - v), (1.0 - u, 1.0 - v)].map(|(x, y)| 1.0 / x.hypot(y).max(NEAREST));
    if located.is_triangle() {
        weights[3] = 0.0;
    }
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// A fully connected layer, y = W x + b.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    /// Length of x.
    pub inputs: u32,
    /// Length of y.
    pub outputs: u32,
    /// W, outputs × inputs: a row an output.
    pub weights: Vec<f32>,
    /// b.
    pub bias: Vec<f32>,
}

/// What the network's output y stands for: the BRDF is (exp(scale · y) − 1) / gain, clamped to [0, max]. The inverse of
/// y = ln(1 + gain · f) / scale, in which the loss is taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Encoding {
    /// > 0; what is much smaller than its inverse counts little.
    pub gain: f32,
    /// > 0.
    pub scale: f32,
    /// The greatest value, in sr⁻¹.
    pub max: f32,
}

/// Where a material comes from, for people and reports. Nothing is computed from it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Provenance {
    /// What it was trained on.
    pub source: String,
    /// How: recipe, quality, steps, seed, version.
    pub training: BTreeMap<String, String>,
    /// Its errors against that, by name.
    pub errors: BTreeMap<String, f64>,
}

/// A material: value(ωo, ωi) = decode(MLP([features of ωi, features of ωo])). Behind these come, of one with several resolutions, the features
/// of ωi and ωo on the coarser grids, of one that varies over a texture those of the place, and of one that sees the half vector what
/// `crate::material::half_vector_inputs` says of it. Where the place has a frame, directions are
/// turned into it first, and what it receives of ωi multiplies the value ([`super::SurfaceFrame::turned`]).
///
/// Isotropic ones are turned about z as well, so that ωi has the azimuth 0 and ωo one in [0, π].
#[derive(Clone, Debug, PartialEq)]
pub struct NeuBrdf {
    /// Whether only the difference of the azimuths matters, and not its sign; of one with frames, about these.
    pub is_isotropic: bool,
    /// How the corners of a pixel count.
    pub corner_weights: CornerWeights,
    /// Features of ωi.
    pub wi: SphereTable,
    /// Features of ωo.
    pub wo: SphereTable,
    /// The same two on coarser and coarser grids.
    pub coarser: Vec<[SphereTable; 2]>,
    /// Features of the place, where the material varies.
    pub surface: Option<SurfaceTable>,
    /// Whether the network sees where the half vector points.
    pub sees_half_vector: bool,
    /// The network; ReLU after each but the last, which has three outputs.
    pub layers: Vec<Dense>,
    /// What the outputs stand for.
    pub encoding: Encoding,
    /// What samples it.
    pub lobe: SamplingLobe,
    /// Where it comes from.
    pub provenance: Provenance,
}

impl NeuBrdf {
    /// Numbers that the network sees of a half vector, if it does.
    pub const HALF_VECTOR_INPUTS: u32 = 8;

    /// The tables of directions in the order in which the network takes their features: ωi's and ωo's by turns.
    pub fn hemispheres(&self) -> impl Iterator<Item = &SphereTable> {
        [&self.wi, &self.wo].into_iter().chain(self.coarser.iter().flatten())
    }

    /// Adds all that its values depend on to a fingerprint.
    pub(super) fn put(&self, hasher: &mut blake3::Hasher) {
        let NeuBrdf { is_isotropic, corner_weights, surface, layers, encoding, lobe, .. } = self;
        put(hasher, b"neubrdf");
        put(hasher, &[u8::from(*is_isotropic), u8::from(*corner_weights == CornerWeights::Bilinear)]);
        for SphereTable { grid, codebook, indices, levels } in self.hemispheres() {
            put(hasher, &[grid.n_side(), codebook.features]);
            put(hasher, &codebook.codes);
            put(hasher, indices);
            put(hasher, levels);
        }
        if let Some(SurfaceTable { grid, codebook, indices, frames }) = surface {
            put(hasher, b"surface");
            put(hasher, &[grid.size(0), [codebook.features, 0]].concat());
            put(hasher, &codebook.codes);
            put(hasher, indices);
            if !frames.is_empty() {
                put(hasher, b"frames");
                put(hasher, frames.normals.as_flattened());
                put(hasher, frames.directions.as_flattened());
            }
        }
        if self.sees_half_vector {
            put(hasher, b"half vector");
        }
        for Dense { inputs: _, outputs: _, weights, bias } in layers {
            put(hasher, weights);
            put(hasher, bias);
        }
        put(hasher, &[encoding.gain, encoding.scale, encoding.max]);
        put(hasher, &lobe.to_floats());
    }
}
