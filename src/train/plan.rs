//! What a training does, in numbers: one plan gives one result.

use glam::Vec2;
use serde::{Deserialize, Serialize};

use super::Error;
use super::gather::Corners;
use crate::scene::brdf::{CornerWeights, NeuBrdf, SphereGrid, SurfaceGrid};

/// What is trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// Features on two hemispheres and a network.
    #[cfg_attr(feature = "cli", value(name = "neubrdf"))]
    NeuBrdf,
    /// A network on half and difference vectors, 6 → 21 → 21 → 3 (Sztrajman et al. 2021): the baseline.
    Nbrdf,
}

/// How a NeuBRDF is trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Recipe {
    /// What gave the least error for its bytes and time.
    Default,
    /// The paper's, to the letter; the encoding of the loss, which it leaves open, is the default's.
    Paper,
    /// The paper's sizes, trained as by default, with features of its own at each grid point: what no codebook can better.
    Unquantised,
}

/// How long.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// A look at it.
    Draft,
    /// A quarter to half a minute on two cores.
    Default,
    /// A minute or two.
    Best,
}

/// What an index of 16 bits can name, besides nothing.
pub(super) const MOST_CODES: usize = (u16::MAX - 1) as usize;

/// Codes of a hemisphere that groups share, unless the user says otherwise.
const GROUP_CODES: usize = 1024;

/// Bytes that the pairs of all members of a group may take.
const GROUP_BYTES: usize = 4_000_000_000;

/// Scores of points for codes in the paper's recipe, of 12 bytes each while they are learned.
const MOST_SCORES: usize = 1 << 27;

/// What an albedo above 1 counts in a training of measurements.
const ENERGY: f32 = 1.0;

/// These bring all published materials to within 1 % (docs/fits.md).
const ALBEDO_ROUNDS: u32 = 6;

/// Codes of texels where there are more texels than an index can name.
const MANY_CODES: usize = 4096;

/// Neurons of a hidden layer of [`Plan::wide`].
const WIDE: usize = 64;

/// Features of a pair of points on all resolutions, where there are several or places vary.
const MANY_FEATURES: usize = 12;

/// Features of a texel.
const SURFACE_FEATURES: usize = 8;

/// What is learned of places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfacePlan {
    /// Texels across and down.
    pub texels: [u32; 2],
    /// Features of a texel.
    pub features: usize,
    /// Most codes of the texels' codebook; more codes than texels, those of coarser levels included, mean that each has its own.
    pub codes: usize,
}

/// All that a training depends on, besides the ground truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// What is trained.
    pub model: Model,
    /// How.
    pub recipe: Recipe,
    /// N_side of the grids of ωi and ωo.
    pub n_side: [u32; 2],
    /// Resolutions: these grids, those of half their N_side, and so on; each has features of its own.
    pub resolutions: usize,
    /// Features of a code, F.
    pub features: usize,
    /// Most codes of each hemisphere's codebook; more codes than points means that each point has its own.
    pub codes: [usize; 2],
    /// Texels, where the material varies.
    pub surface: Option<SurfacePlan>,
    /// Whether the network sees where the half vector points.
    #[serde(default)]
    pub sees_half_vector: bool,
    /// Neurons of each of the three hidden layers.
    pub hidden: usize,
    /// How many of them are left after pruning; as many as `hidden`: none is pruned.
    pub pruned: usize,
    /// How the corners of a pixel count.
    pub corner_weights: CornerWeights,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Pairs that a function is asked for.
    pub pairs: usize,
    /// Pairs a step.
    pub batch: usize,
    /// Steps, those after pruning included.
    pub steps: u32,
    /// Learning rate of the network at the start.
    pub network_rate: f32,
    /// Learning rate of codes and points at the start.
    pub table_rate: f32,
    /// What an albedo above 1 counts: the square of its logarithm times this, beside the mean loss of a pair. 0: it is not looked at.
    #[serde(default)]
    pub energy: f32,
    /// Times that gaps between directional albedos and the ground truth's are closed in the end; 0: they are left.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub albedo_rounds: u32,
}

fn is_zero(number: &u32) -> bool {
    *number == 0
}

impl Plan {
    /// The plan of a recipe at a quality.
    pub fn new(model: Model, recipe: Recipe, quality: Quality, is_isotropic: bool) -> Plan {
        // Anisotropic materials have all of both hemispheres to learn.
        let of_kind = |[isotropic, anisotropic]: [u32; 2]| if is_isotropic { isotropic } else { anisotropic };
        let (steps, batch, pairs) = match quality {
            Quality::Draft => (of_kind([4_000, 8_000]), 512, 1 << 18),
            Quality::Default => (of_kind([48_000, 64_000]), 1024, 1 << 20),
            Quality::Best => (of_kind([80_000, 160_000]), 2048, 1 << 22),
        };
        let plan = Plan {
            model,
            recipe,
            n_side: [16; 2],
            resolutions: 1,
            features: 8,
            codes: [MOST_CODES; 2],
            surface: None,
            sees_half_vector: model == Model::NeuBrdf && recipe == Recipe::Default,
            hidden: 32,
            pruned: 32,
            corner_weights: CornerWeights::Bilinear,
            seed: 0,
            pairs,
            batch,
            steps,
            network_rate: 1e-2,
            table_rate: 3e-2,
            energy: 0.0,
            albedo_rounds: match (model, recipe) {
                (Model::NeuBrdf, Recipe::Default | Recipe::Unquantised) => ALBEDO_ROUNDS,
                _ => 0,
            },
        };
        let papers_sizes = Plan {
            n_side: [64; 2],
            features: 16,
            corner_weights: CornerWeights::Uniform,
            hidden: 64,
            pruned: 64,
            ..plan
        };
        match recipe {
            // Narrow anisotropic lobes gain much by several resolutions; isotropic ones lose a little of their albedo (docs/training.md).
            Recipe::Default if is_isotropic => plan,
            Recipe::Default => plan.of_several_resolutions(),
            Recipe::Unquantised => papers_sizes,
            Recipe::Paper => {
                Plan { codes: [256; 2], hidden: 128, steps: steps / 8, batch: 2048, table_rate: 1e-2, ..papers_sizes }
            }
        }
    }

    /// The same on three resolutions, or as many as the grids have, of 12 features in all.
    pub fn of_several_resolutions(self) -> Plan {
        let n_side = self.n_side.into_iter().min().unwrap_or(1).max(1);
        let resolutions = (n_side.ilog2() as usize + 1).min(3);
        Plan { resolutions, features: MANY_FEATURES / resolutions, ..self }
    }

    /// The same for a material that varies, over so many texels across and down.
    pub fn over(self, texels: [u32; 2]) -> Plan {
        let points = SurfaceGrid::new(texels[0], texels[1]).map_or(0, |grid| grid.point_count());
        let codes = match self.recipe {
            Recipe::Paper => self.codes[0],
            _ if points > MOST_CODES => MANY_CODES,
            _ => MOST_CODES,
        };
        let surface = SurfacePlan { texels, features: SURFACE_FEATURES, codes };
        let features = match self.recipe {
            Recipe::Default => MANY_FEATURES / self.resolutions,
            _ => self.features,
        };
        Plan { surface: Some(surface), features, albedo_rounds: 0, ..self.wide() }
    }

    /// Numbers that go into the network.
    pub(super) fn inputs(&self) -> usize {
        let half_vector = if self.sees_half_vector { NeuBrdf::HALF_VECTOR_INPUTS as usize } else { 0 };
        2 * self.resolutions * self.features + self.surface.map_or(0, |surface| surface.features) + half_vector
    }

    /// Most codes of each table.
    pub(super) fn table_codes(&self) -> impl Iterator<Item = usize> {
        self.codes.into_iter().cycle().take(2 * self.resolutions).chain(self.surface.map(|surface| surface.codes))
    }

    /// The texels.
    pub(super) fn surface_grid(&self) -> Result<Option<SurfaceGrid>, Error> {
        let Some(SurfacePlan { texels: [width, height], .. }) = self.surface else { return Ok(None) };
        let found = || format!("{width}x{height}");
        let error = || Error::Plan { name: "--texels", found: found(), expected: "1 to 1024 to a side" };
        SurfaceGrid::new(width, height).ok_or_else(error).map(Some)
    }

    /// Coarsens the grids, so that a few measurements tell something of each point: of an isotropic material 96 N² of them are ten
    /// or more a point. Where they tell nothing, the albedo is held below 1.
    pub fn for_samples(self, count: usize) -> Plan {
        let n_side = (0..=4).map(|power| 1 << power).take_while(|n| 96 * n * n <= count as u32).last().unwrap_or(1);
        let plan = self.with_resolutions_up_to(n_side.ilog2() as usize + 1);
        Plan { n_side: plan.n_side.map(|finest| finest.min(n_side)), energy: ENERGY, albedo_rounds: 0, ..plan }
    }

    /// The same with at most so many resolutions, and as many features in all.
    pub fn with_resolutions_up_to(self, most: usize) -> Plan {
        let resolutions = self.resolutions.min(most).max(1);
        Plan { resolutions, features: self.resolutions * self.features / resolutions, ..self }
    }

    /// The same for each of `members` materials that share a codebook a hemisphere: `codes` codes, or what is enough for many. Of
    /// functions not more pairs are drawn than memory has room for.
    pub fn for_group(self, members: usize, codes: Option<usize>) -> Plan {
        let codes = match self.recipe {
            Recipe::Paper => self.codes,
            _ => [GROUP_CODES; 2],
        }
        .map(|default| codes.unwrap_or(default));
        // Corners on each grid, the half vector, and the value.
        let bytes_of_pair = 2 * self.resolutions * size_of::<Corners>() + size_of::<Vec2>() + size_of::<[f32; 4]>();
        let pairs = self.pairs.min((GROUP_BYTES / (bytes_of_pair * members.max(1))).max(self.batch));
        Plan { codes, pairs, albedo_rounds: 0, ..self }
    }

    /// The same where one network has more than a material to learn: all places of one, or those that share it. In the paper's recipe nothing changes.
    pub fn wide(self) -> Plan {
        match self.recipe {
            Recipe::Default => Plan { hidden: WIDE, pruned: WIDE, ..self },
            _ => self,
        }
    }

    /// The grids of ωi and ωo by turns, the finest first.
    pub(super) fn grids(&self) -> Result<Vec<SphereGrid>, Error> {
        let error = |name, found, expected| Error::Plan { name, found, expected };
        if let Some(n_side) = self.n_side.into_iter().find(|n_side| SphereGrid::new(*n_side).is_none()) {
            return Err(error("--n-side", n_side.to_string(), "a power of two, at most 128"));
        }
        let too_many =
            || error("--resolutions", self.resolutions.to_string(), "1 to 4, the coarsest of N_side 1 or more");
        if !(1..=NeuBrdf::MAX_COARSER + 1).contains(&self.resolutions) {
            return Err(too_many());
        }
        let sizes = (0..self.resolutions).flat_map(|coarser| self.n_side.map(|n_side| n_side >> coarser));
        sizes.map(|n_side| SphereGrid::new(n_side).ok_or_else(too_many)).collect()
    }

    /// Errors if a number of the plan is beyond what the model or memory allow.
    pub fn validate(&self) -> Result<(), Error> {
        let check = |name: &'static str, is_fine: bool, found: String, expected: &'static str| match is_fine {
            true => Ok(()),
            false => Err(Error::Plan { name, found, expected }),
        };
        let finest = self.grids()?.into_iter().take(2).map(|grid| grid.point_count()).max().unwrap_or(0);
        // Where albedos are held below 1, points that no measurement is next to name others.
        let n_side = || format!("{:?}", self.n_side);
        check("--n-side", self.energy == 0.0 || finest <= MOST_CODES, n_side(), "at most 64 to learn measurements on")?;
        let texels = self.surface_grid()?.map_or(0, |grid| grid.point_count());
        check(
            "--texels",
            self.recipe != Recipe::Unquantised || texels <= MOST_CODES,
            format!("{texels}, those of coarser levels included"),
            "at most 65534 with features of their own, or a recipe with codebooks instead of --recipe unquantised",
        )?;
        let between = |count: usize, least: usize, most: usize| (least..=most).contains(&count);
        check("--features", between(self.features, 1, 32), self.features.to_string(), "1 to 32")?;
        let texel = self.surface.map_or(1, |surface| surface.features);
        check("--texel-features", between(texel, 1, 32), texel.to_string(), "1 to 32")?;
        let fits = self.surface.is_none() || self.model == Model::NeuBrdf;
        check("--model", fits, "an NBRDF".to_owned(), "neubrdf, for a material that varies over a texture")?;
        let most = NeuBrdf::MAX_WIDTH as usize;
        let inputs = || format!("{} inputs of the network", self.inputs());
        check(
            "--features",
            self.inputs() <= most,
            inputs(),
            "at most 128 of all directions, resolutions, places and the half vector",
        )?;
        check("--hidden", between(self.hidden, 4, 128), self.hidden.to_string(), "4 to 128")?;
        check("pruned width", between(self.pruned, 4, self.hidden), self.pruned.to_string(), "4 to the width before")?;
        let can_be_named = |codes: usize| between(codes, 2, MOST_CODES);
        for codes in self.codes {
            check("--codes", can_be_named(codes), codes.to_string(), "2 to 65534")?;
        }
        let codes = self.surface.map_or(2, |surface| surface.codes);
        check("--texel-codes", can_be_named(codes), codes.to_string(), "2 to 65534")?;
        // By softmax each point has a score for each code.
        let scores = 2 * self.resolutions * finest * self.codes.into_iter().max().unwrap_or(0) + texels * codes;
        check(
            "--codes",
            self.recipe != Recipe::Paper || scores <= MOST_SCORES,
            format!("{} codes and {texels} texels, which take {scores} scores", self.codes[0]),
            "at most 2^27 scores of points for codes by --recipe paper: fewer --codes, a smaller --n-side or fewer --texels",
        )?;
        let batch = self.batch;
        check(
            "--batch",
            between(batch, 256, 1 << 16) && batch.is_multiple_of(256),
            batch.to_string(),
            "a multiple of 256, at most 65536",
        )?;
        check("--steps", between(self.steps as usize, 1, 10_000_000), self.steps.to_string(), "1 to 10000000")?;
        check("--pairs", between(self.pairs, batch, 1 << 23), self.pairs.to_string(), "a batch to 8388608")?;
        for (name, rate) in [("learning rate", self.network_rate), ("learning rate", self.table_rate)] {
            check(name, rate > 0.0 && rate <= 1.0, rate.to_string(), "above 0, at most 1")?;
        }
        Ok(())
    }
}
