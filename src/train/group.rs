//! Several materials that learn one codebook a hemisphere together.
//!
//! All begin with one network and one set of features, each in a copy of its own, and go their own ways for a few steps: so what is
//! alike in several materials is still near to each other when k-means over the points of all finds the codebook. From then on the
//! codes alone are common, or the network too, which then is so from the start. Gradients of what is shared are added in the order of
//! the members: the result is the same whatever the number of threads.

use std::time::Instant;

use rayon::prelude::*;

use super::network::Network;
use super::plan::{Model, Plan, Recipe};
use super::random::Random;
use super::result::sphere_tables;
use super::session::sampled;
use super::table::{Quantiser, k_means};
use super::trainer::Rates;
use super::{Error, Session};
use crate::scene::brdf::{NeuBrdf, SphereTable};

/// Share of the steps after which points are given codes. Later, when each member has found features of its own, one codebook fits
/// them worse: docs/sharing.md.
const QUANTISE_AT: f32 = 0.05;

/// Trainings that share codebooks, and all that continuing takes.
pub struct Group {
    /// One a material. What is shared is equal in all; the moments of it, the first one keeps.
    pub(super) members: Vec<Session>,
    /// Whether the network is common, too.
    pub(super) shares_network: bool,
}

impl Group {
    /// Of trainings that have not begun, with plans that differ in N_side at most, and in whether albedos are held below 1.
    ///
    /// # Errors
    /// There is none, they are of a kind that has no codebook, or they differ in more.
    pub fn new(members: Vec<Session>, shares_network: bool) -> Result<Group, Error> {
        let first = members.first().ok_or(Error::Empty)?.plan.clone();
        let refuse = |name, found: String, expected| Err(Error::Plan { name, found, expected });
        if first.model != Model::NeuBrdf || first.recipe == Recipe::Unquantised {
            return refuse("--share", format!("{:?}, {:?}", first.model, first.recipe), "NeuBRDFs with codebooks");
        }
        if first.surface.is_some() {
            return refuse("--share", "a material that varies".to_owned(), "materials that do not vary over a texture");
        }
        // What an albedo counts is added to a member's own gradient.
        let is_alike = |plan: &Plan| Plan { n_side: first.n_side, energy: first.energy, ..plan.clone() } == first;
        if let Some(other) = members.iter().find(|member| !is_alike(&member.plan)) {
            return refuse("--share", format!("{:?}", other.plan), "equal plans but for N_side and energy");
        }
        let mut group = Group { members, shares_network };
        if group.is_quantised() {
            group.share_codes();
        }
        Ok(group)
    }

    /// The members, in the order in which they were given.
    pub fn members(&self) -> &[Session] {
        &self.members
    }

    /// Whether the network is common, too.
    pub fn shares_network(&self) -> bool {
        self.shares_network
    }

    /// Whether all steps are done.
    pub fn is_done(&self) -> bool {
        self.members[0].is_done()
    }

    /// Steps done, by each member.
    pub fn steps(&self) -> u32 {
        self.members[0].steps()
    }

    /// Seconds that they took, those before a checkpoint included.
    pub fn seconds(&self) -> f64 {
        self.members[0].seconds()
    }

    /// The loss of the last steps, averaged, over all members.
    pub fn loss(&self) -> f64 {
        self.members.iter().map(Session::loss).sum::<f64>() / self.members.len() as f64
    }

    /// Each member takes so many steps, or all that are left: [`Session::run`].
    pub fn run(&mut self, steps: u32) {
        let (end, started) = (self.steps().saturating_add(steps), Instant::now());
        // On one of the threads that share the work of each step: handing it over costs more than some of what it does.
        rayon::scope(|_| {
            while self.steps() < end && !self.is_done() {
                self.step();
            }
            self.members.iter_mut().for_each(Session::finish_in_time);
        });
        self.members[0].seconds += started.elapsed().as_secs_f64();
    }

    fn step(&mut self) {
        let first = &self.members[0];
        if first.steps() == first.step_at(QUANTISE_AT) {
            self.quantise();
        }
        self.members.iter_mut().for_each(Session::prune_in_time);
        let rates = self.members[0].rates();
        self.members.par_iter_mut().for_each(|member| {
            // An isotropic member's loss may be another than that of one that is not; what rates say besides is the same.
            let loss = member.trainer.find_gradients(member.plan.batch, member.rates());
            member.note_loss(loss);
        });
        if rates.tables > 0.0 {
            self.step_tables(rates);
        }
        self.step_networks(rates);
    }

    /// Ends soon: [`Session::wind_down`].
    pub fn wind_down(&mut self) {
        if !self.members[0].ends_soon() {
            self.quantise();
        }
        self.members.iter_mut().for_each(Session::wind_down);
    }

    /// The NeuBRDFs as they are now, which name one codebook a hemisphere once points have been given codes.
    pub fn neubrdfs(&self) -> Vec<NeuBrdf> {
        if !self.is_quantised() {
            return self.members.par_iter().filter_map(Session::neubrdf).collect();
        }
        let mut tables: Vec<Vec<SphereTable>> = self.members.iter().map(|_| Vec::new()).collect();
        for side in 0..self.members[0].hemispheres.len() {
            let trained: Vec<_> = self.members.iter().filter_map(|member| member.trained_points(side)).collect();
            tables.iter_mut().zip(sphere_tables(&trained)).for_each(|(tables, table)| tables.push(table));
        }
        let members = self.members.par_iter().zip(tables);
        members.filter_map(|(member, tables)| member.with_tables(tables).map(sampled)).collect()
    }

    /// Whether points have been given codes.
    fn is_quantised(&self) -> bool {
        self.members[0].trainer.tables.iter().all(|table| table.quantiser != Quantiser::Free)
    }

    /// Gives points codes, unless they have them: those that k-means finds over the points of all members.
    fn quantise(&mut self) {
        if self.is_quantised() {
            return;
        }
        let plan = self.members[0].plan.clone();
        let Plan { seed, features, .. } = plan;
        let mut random = Random::new(seed, Random::QUANTISE);
        let sides = self.members[0].hemispheres.len();
        for (side, codes) in plan.table_codes().take(sides).enumerate() {
            let used = |member: &Session| member.trainer.tables[side].used_rows(&member.hemispheres[side].used);
            let points: Vec<f32> = self.members.iter().flat_map(used).collect();
            let found = k_means(&points, features, codes, &mut random);
            let members = self.members.par_iter_mut();
            members.for_each(|member| member.trainer.tables[side].quantise_to(found.clone()));
        }
    }

    fn step_tables(&mut self, rates: Rates) {
        let is_quantised = self.is_quantised();
        let to_codes: Vec<Vec<Vec<f32>>> = self
            .members
            .par_iter_mut()
            .map(|member| {
                let at = member.trainer.table_step(rates);
                let tables = member.trainer.tables_and_gradients();
                tables.map(|(table, gradient, touched)| table.step_points(gradient, touched, at)).collect()
            })
            .collect();
        if is_quantised {
            let at = self.members[0].trainer.table_step(rates);
            for side in 0..self.members[0].hemispheres.len() {
                let sum = sum(to_codes.iter().map(|gradients| gradients[side].as_slice()));
                self.members[0].trainer.tables[side].step_codes(&sum, at);
            }
            self.share_codes();
        }
        self.members.par_iter_mut().zip(to_codes).for_each(|(member, to_codes)| {
            let at = member.trainer.table_step(rates);
            for (table, to_codes) in member.trainer.tables.iter_mut().zip(&to_codes) {
                if !is_quantised {
                    table.step_codes(to_codes, at);
                }
                table.settle(at);
            }
        });
    }

    /// Hands the first member's codes to the others.
    fn share_codes(&mut self) {
        let Some((first, others)) = self.members.split_first_mut() else { return };
        others.par_iter_mut().for_each(|member| {
            for (table, shared) in member.trainer.tables.iter_mut().zip(&first.trainer.tables) {
                table.codes.copy_from_slice(&shared.codes);
            }
        });
    }

    fn step_networks(&mut self, rates: Rates) {
        if self.shares_network {
            let sum = sum(self.members.iter().map(|member| member.trainer.network_gradient()));
            self.members[0].trainer.step_network(&sum, rates);
            let Some((first, others)) = self.members.split_first_mut() else { return };
            let Network { parameters, .. } = &first.trainer.network;
            others.iter_mut().for_each(|member| member.trainer.network.parameters.copy_from_slice(parameters));
        } else {
            self.members.par_iter_mut().for_each(|member| {
                let own = member.trainer.network_gradient().to_vec();
                member.trainer.step_network(&own, rates);
            });
        }
    }
}

/// The sum of gradients, in their order.
fn sum<'a>(gradients: impl Iterator<Item = &'a [f32]>) -> Vec<f32> {
    gradients.fold(Vec::new(), |mut sum, gradient| {
        sum.resize(gradient.len(), 0.0);
        sum.iter_mut().zip(gradient).for_each(|(sum, value)| *sum += value);
        sum
    })
}
