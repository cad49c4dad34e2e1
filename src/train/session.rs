//! A training from its first step to its last.

use std::f32::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::network::Network;
use super::pairs::{GroundTruth, Pair};
use super::plan::{Model, Plan, Recipe};
use super::prune::prune_neurons;
use super::random::Random;
use super::table::{Quantiser, Table};
use super::trainer::{Corners, Head, Inputs, Pool, Rates, Trainer};
use super::{Error, half_difference};
use crate::material::turned;
use crate::scene::brdf::{CornerWeights, Dense, Encoding, NeuBrdf, Provenance, SphereGrid, SphereTable};

/// Share of the steps after which points are given codes: the features have settled, and the rest of the steps fits codes.
const QUANTISE_AT: f32 = 0.4;

/// Share of the paper's steps after which neurons are pruned and all but the network is frozen.
const PRUNE_AT: f32 = 0.75;

/// Learning rate of the pruned network at the start.
const PRUNED_RATE: f32 = 1e-3;

/// Steps over which the rates rise from 0.
const WARM_UP: f32 = 100.0;

/// Errors of the encoded value count square up to here, linearly beyond.
const SMOOTH: f32 = 0.1;

/// Of the encoding y = ln(1 + gain · f) / scale.
const SCALE: f32 = 2.0;

/// Random streams of a seed; pairs take those from 0, epochs their own seed.
const START: u64 = 1 << 40;
const QUANTISE: u64 = 2 << 40;

/// A model while it is trained, and all that continuing takes.
pub struct Session {
    /// What is done.
    pub plan: Plan,
    /// The model.
    pub trainer: Trainer,
    is_isotropic: bool,
    encoding: Encoding,
    grids: [SphereGrid; 2],
    /// Points of each hemisphere that the pairs need.
    used: [Vec<bool>; 2],
    /// Pixels of each hemisphere that pairs lie in.
    seen: [Vec<bool>; 2],
    loss: f64,
}

impl Session {
    /// Asks the ground truth for its pairs and makes a model that knows nothing yet.
    ///
    /// # Errors
    /// The plan is beyond what is possible, or there is nothing to learn from.
    pub fn new(plan: Plan, truth: &GroundTruth) -> Result<Session, Error> {
        plan.validate()?;
        let pairs = truth.pairs(plan.pairs, plan.seed);
        let is_isotropic = truth.is_isotropic();
        let grids = plan.n_side.map(|n_side| SphereGrid::new(n_side).ok_or(Error::Empty));
        let [wi, wo] = grids;
        let grids = [wi?, wo?];
        let encoding = encoding(&pairs).ok_or(Error::Empty)?;
        // Shards take whole blocks: few samples are taken several times over.
        let count = pairs.len().max(plan.batch).next_multiple_of(plan.batch);
        let pairs: Vec<Pair> = pairs.iter().copied().cycle().take(count).collect();

        let mut session = Session {
            trainer: Trainer::empty(),
            is_isotropic,
            encoding,
            grids,
            used: grids.map(|grid| vec![false; grid.point_count()]),
            seen: grids.map(|grid| vec![false; grid.pixel_count()]),
            loss: f64::NAN,
            plan,
        };
        let mut random = Random::new(session.plan.seed, START);
        let inputs = session.inputs(&pairs);
        let pool = Pool { targets: pairs.iter().map(|pair| target(pair, encoding)).collect(), inputs };
        let (network, tables, head) = session.start(&mut random);
        session.trainer = Trainer::new(network, tables, head, pool, session.plan.seed);
        Ok(session)
    }

    fn start(&self, random: &mut Random) -> (Network, Vec<Table>, Head) {
        let Plan { model, recipe, features, hidden, codes, .. } = self.plan;
        let Encoding { gain, scale, .. } = self.encoding;
        match model {
            Model::Nbrdf => (Network::random(&[6, 21, 21, 3], random), Vec::new(), Head::LogPlusOne { gain, scale }),
            Model::NeuBrdf => {
                let network = Network::random(&[2 * features, hidden, hidden, hidden, 3], random);
                let table = |side: usize| {
                    let points = self.grids[side].point_count();
                    match recipe {
                        Recipe::Paper => Table::softmax(points, features, codes[side], random),
                        Recipe::Default | Recipe::Free => Table::free(points, features, random),
                    }
                };
                (network, [0, 1].map(table).into(), Head::Encoded)
            }
        }
    }

    /// What the network sees of pairs; notes which points and pixels they need.
    fn inputs(&mut self, pairs: &[Pair]) -> Inputs {
        if self.plan.model == Model::Nbrdf {
            let numbers = |pair: &Pair| half_difference(pair.wo.as_dvec3(), pair.wi.as_dvec3()).map(|x| x as f32);
            return Inputs::Direct(pairs.par_iter().flat_map_iter(numbers).collect());
        }
        let (grids, is_isotropic, corner_weights) = (self.grids, self.is_isotropic, self.plan.corner_weights);
        let tables = grids.map(whole_table);
        let located: Vec<([Corners; 2], [u32; 2])> = pairs
            .par_iter()
            .map(|pair| {
                let [wi, wo] = in_frame(pair.wo.as_dvec3(), pair.wi.as_dvec3(), is_isotropic);
                let pixels = [grids[0].locate(wi).pixel, grids[1].locate(wo).pixel];
                ([corners(&tables[0], wi, corner_weights), corners(&tables[1], wo, corner_weights)], pixels)
            })
            .collect();
        for (corners, pixels) in &located {
            for side in 0..2 {
                self.seen[side][pixels[side] as usize] = true;
                for (point, weight) in corners[side].points.into_iter().zip(corners[side].weights) {
                    self.used[side][point as usize] |= weight > 0.0;
                }
            }
        }
        Inputs::Corners(located.into_iter().map(|(corners, _)| corners).collect())
    }

    /// Whether all steps are done.
    pub fn is_done(&self) -> bool {
        self.trainer.step >= self.plan.steps
    }

    /// The loss of the last steps, averaged.
    pub fn loss(&self) -> f64 {
        self.loss
    }

    /// Takes a step.
    pub fn step(&mut self) {
        self.change_phase();
        let rates = self.rates();
        let loss = self.trainer.train(self.plan.batch, rates);
        self.loss = if self.loss.is_finite() { self.loss + 0.01 * (loss - self.loss) } else { loss };
    }

    /// What happens once, between two steps.
    fn change_phase(&mut self) {
        let Plan { recipe, codes, .. } = self.plan;
        if self.plan.model == Model::Nbrdf {
            return;
        }
        match recipe {
            Recipe::Default if self.trainer.step == self.step_at(QUANTISE_AT) => {
                let mut random = Random::new(self.plan.seed, QUANTISE);
                for ((table, used), codes) in self.trainer.tables.iter_mut().zip(&self.used).zip(codes) {
                    table.quantise(codes, used, &mut random);
                }
            }
            Recipe::Paper if self.trainer.step == self.step_at(PRUNE_AT) && self.plan.pruned < self.plan.hidden => {
                self.trainer.replace_network(prune_neurons(&self.trainer.network, self.plan.pruned));
            }
            _ => {}
        }
    }

    fn step_at(&self, share: f32) -> u32 {
        (share * self.plan.steps as f32) as u32
    }

    fn rates(&self) -> Rates {
        let Plan { recipe, network_rate, table_rate, steps, .. } = self.plan;
        let at = self.trainer.step as f32 / steps as f32;
        let warm = ((self.trainer.step as f32 + 1.0) / WARM_UP).min(1.0);
        if recipe != Recipe::Paper {
            let falling = 0.5 * (1.0 + (PI * at).cos()) * warm;
            return Rates {
                network: network_rate * falling,
                tables: table_rate * falling,
                temperature: 1.0,
                smooth: SMOOTH,
                sparsity: 0.0,
            };
        }
        let multi_step = |at: f32| match at {
            ..0.5 => 1.0,
            ..0.75 => 0.33,
            ..0.9 => 0.1,
            _ => 0.03,
        };
        let joint = at / PRUNE_AT;
        if joint < 1.0 {
            let falling = multi_step(joint) * warm;
            Rates {
                network: network_rate * falling,
                tables: table_rate * falling,
                temperature: 1.0 - 0.5 * joint,
                smooth: 0.0,
                sparsity: SPARSITY,
            }
        } else {
            let falling = multi_step((at - PRUNE_AT) / (1.0 - PRUNE_AT));
            Rates { network: PRUNED_RATE * falling, tables: 0.0, temperature: 0.5, smooth: 0.0, sparsity: 0.0 }
        }
    }

    /// Skips ahead so that the rates fall to 0 within the next twentieth of the steps: an interrupted training ends as one
    /// that was planned shorter.
    pub fn wind_down(&mut self) {
        // The cosine's own time runs on from where it is; only the remaining steps are fewer.
    }

    /// The model as it is now.
    pub fn neubrdf(&self) -> NeuBrdf {
        let Trainer { network, tables, .. } = &self.trainer;
        let [wi, wo] = [0, 1].map(|side| sphere_table(&tables[side], self.grids[side], &self.seen[side]));
        NeuBrdf {
            is_isotropic: self.is_isotropic,
            corner_weights: self.plan.corner_weights,
            wi,
            wo,
            layers: layers(network),
            encoding: self.encoding,
            provenance: Provenance::default(),
        }
    }
}
