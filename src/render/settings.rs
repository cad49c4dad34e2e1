//! What a user may choose about a render.

use std::fmt;
use std::str::FromStr;

use crate::image::Crop;

/// How rays find triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Traversal {
    /// `VK_KHR_ray_query`.
    RayQuery,
    /// A compute walk of an `obvhs` BVH.
    Bvh,
}

/// Where random numbers come from; the discriminant is the shader's `SAMPLER`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Sampler {
    /// Owen-scrambled Sobol': less noise for the same samples.
    #[default]
    Sobol = 0,
    /// Independent numbers, whose sample variance is the true one: for statistics.
    Pcg = 1,
}

/// What changes the picture. Pool size, tile order and device are not here: they do not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Path segments: 1 sees emission only, 2 adds direct light. ≥ 1.
    pub max_depth: u32,
    /// Picks the random numbers.
    pub seed: u32,
    /// Their kind.
    pub sampler: Sampler,
    /// The part of the film to render; `None` is all of it.
    pub crop: Option<Crop>,
    /// Whether the feature channels (albedo, normal, depth, ids) are gathered too.
    pub features: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { max_depth: 16, seed: 0, sampler: Sampler::Sobol, crop: None, features: true }
    }
}

/// A word that is none of those which an option takes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{found}' is no {what}: expected {expected}")]
pub struct UnknownChoice {
    what: &'static str,
    found: String,
    expected: &'static str,
}

impl FromStr for Traversal {
    type Err = UnknownChoice;

    fn from_str(word: &str) -> Result<Self, UnknownChoice> {
        match word {
            "ray-query" => Ok(Traversal::RayQuery),
            "bvh" => Ok(Traversal::Bvh),
            _ => Err(UnknownChoice { what: "traversal", found: word.into(), expected: "ray-query or bvh" }),
        }
    }
}

impl fmt::Display for Traversal {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(match self {
            Traversal::RayQuery => "ray-query",
            Traversal::Bvh => "bvh",
        })
    }
}

impl FromStr for Sampler {
    type Err = UnknownChoice;

    fn from_str(word: &str) -> Result<Self, UnknownChoice> {
        match word {
            "sobol" => Ok(Sampler::Sobol),
            "pcg" => Ok(Sampler::Pcg),
            _ => Err(UnknownChoice { what: "sampler", found: word.into(), expected: "sobol or pcg" }),
        }
    }
}

impl fmt::Display for Sampler {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(match self {
            Sampler::Sobol => "sobol",
            Sampler::Pcg => "pcg",
        })
    }
}
