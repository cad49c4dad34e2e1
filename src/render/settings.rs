//! What a user may choose about a render.

use std::fmt;
use std::str::FromStr;

use crate::image::Crop;
use crate::scene::brdf::Precision;

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

/// The density that a vertex picks its next direction with; the discriminant is the shader's `BSDF_SAMPLING`. All converge to the
/// same picture. Materials with Dirac lobes keep their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BsdfSampling {
    /// The material's own lobes.
    #[default]
    Lobe = 0,
    /// cos θ / π.
    Cosine = 1,
    /// 1 / 2π.
    Uniform = 2,
}

/// What changes the picture. Pool size, tile order and device are not here: they do not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Path segments: 1 sees emission only, 2 adds direct light. ≥ 1.
    pub max_depth: u32,
    /// Bounces that no path ends at by chance; from then on Russian roulette ends dark ones.
    pub roulette_after: u32,
    /// What a path may bring of indirect light, in any channel, > 0: what is brighter is darkened to it. It ends fireflies and takes light away, unlike all
    /// else here. Light that is seen, or falls on what is seen, is left as it is.
    pub clamp_indirect: Option<f32>,
    /// Picks the random numbers.
    pub seed: u32,
    /// Their kind.
    pub sampler: Sampler,
    /// The part of the film to render; `None` is all of it.
    pub crop: Option<Crop>,
    /// Whether the feature channels (albedo, normal, depth, ids) are gathered too.
    pub features: bool,
    /// Whether lights are sampled at each vertex (next-event estimation); without, only what a path runs into shines, and
    /// there must be no sun.
    pub light_sampling: bool,
    /// How directions are picked.
    pub bsdf_sampling: BsdfSampling,
    /// Whether pixels share what falls on diffuse surfaces that they see, from diffuse surfaces: less noise of indirect light, and that of
    /// neighbours is alike. As unbiased as without. Not where materials have holes, nor with [`BsdfSampling::Uniform`].
    pub path_reuse: bool,
    /// How numbers of NeuBRDFs are held on the device; `None` is half precision where that loses nothing.
    pub neubrdf_precision: Option<Precision>,
}

impl Settings {
    /// [`Settings::roulette_after`] if nothing is said.
    pub const ROULETTE_AFTER: u32 = 3;
    /// The largest [`Settings::max_depth`].
    pub const DEEPEST: u32 = 65_535;

    /// Whether pixels have paths to share: the third segment is the first that more than one of them can use.
    pub(super) fn shares_paths(&self) -> bool {
        self.path_reuse && self.max_depth > 2
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            max_depth: 16,
            roulette_after: Settings::ROULETTE_AFTER,
            clamp_indirect: None,
            seed: 0,
            sampler: Sampler::Sobol,
            crop: None,
            features: true,
            light_sampling: true,
            bsdf_sampling: BsdfSampling::Lobe,
            path_reuse: false,
            neubrdf_precision: None,
        }
    }
}

/// A word that is none of those which an option takes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{found}' is no {what}: expected {expected}")]
pub struct UnknownChoice {
    what: &'static str,
    found: String,
    /// What the option takes.
    pub expected: &'static str,
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

impl FromStr for BsdfSampling {
    type Err = UnknownChoice;

    fn from_str(word: &str) -> Result<Self, UnknownChoice> {
        match word {
            "lobe" => Ok(BsdfSampling::Lobe),
            "cosine" => Ok(BsdfSampling::Cosine),
            "uniform" => Ok(BsdfSampling::Uniform),
            _ => Err(UnknownChoice { what: "BSDF sampling", found: word.into(), expected: "lobe, cosine or uniform" }),
        }
    }
}

impl fmt::Display for BsdfSampling {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(match self {
            BsdfSampling::Lobe => "lobe",
            BsdfSampling::Cosine => "cosine",
            BsdfSampling::Uniform => "uniform",
        })
    }
}
