//! A training from its first step to its last.

use std::f32::consts::PI;
use std::time::Instant;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::albedo::Views;
use super::energy::{self, Probes};
use super::gather::{Corners, half_vector_in, in_frame, places};
use super::network::Network;
use super::pairs::{GroundTruth, Pair, about_frames};
use super::plan::{MOST_CODES, Model, Plan, Recipe};
use super::prune::prune_neurons;
use super::random::Random;
use super::result::{TrainedPoints, layers, merged_table, nbrdf, sphere_tables, surface_table, whole_table};
use super::table::{Quantiser, Table};
use super::trainer::{BLOCK, Head, Inputs, Loss, Places, Pool, Rates, Trainer, Weighs};
use super::{Error, Evaluator};
use crate::material::fit_lobe;
use crate::scene::brdf::{
    Encoding, Nbrdf, NeuBrdf, Provenance, SphereGrid, SpherePlace, SphereTable, SurfaceFrames, SurfaceGrid,
};
use crate::scene::{HalfDifference, SamplingLobe};

/// Share of the steps after which points are given codes: the features have settled, and the rest of the steps fits codes.
const QUANTISE_AT: f32 = 0.4;

/// Share of the paper's steps after which neurons are pruned and all but the network is frozen.
const PRUNE_AT: f32 = 0.75;

/// Learning rate of the pruned network at the start.
const PRUNED_RATE: f32 = 3e-3;

/// Steps over which the rates rise from 0.
const WARM_UP: f32 = 100.0;

/// Steps that threads are called together for.
const MOST_STEPS: u32 = 256;

/// Of the encoding y = ln(1 + gain · f) / scale.
const SCALE: f32 = 2.0;
/// Bounds of its gain.
const LEAST_GAIN: f32 = 100.0;
const MOST_GAIN: f32 = 1e5;

/// Pull of the weights to 0 in the paper's recipe, which gives no figure: in all, a small part of the loss.
const SPARSITY: f32 = 1e-5;

/// A model while it is trained, and all that continuing takes.
pub struct Session {
    /// What is done.
    pub plan: Plan,
    /// The model.
    pub(super) trainer: Trainer,
    is_isotropic: bool,
    /// What tells its pairs from others.
    pub(super) pairs_hash: String,
    encoding: Encoding,
    /// The grids of ωi and ωo by turns, the finest first.
    pub(super) hemispheres: Vec<Hemisphere>,
    texels: Option<SurfaceGrid>,
    /// Of the texels.
    frames: SurfaceFrames,
    pub(super) loss: f64,
    /// What its steps took; a group's are its first member's.
    pub(super) seconds: f64,
    /// Where winding down began and where it ends, in steps.
    end: Option<[u32; 2]>,
}

/// A grid of directions.
pub(super) struct Hemisphere {
    grid: SphereGrid,
    /// Pixels that pairs lie in.
    seen: Vec<bool>,
    /// Their corners: what a table has features of. An isotropic material needs a few of them alone, where its directions are turned to.
    points: Vec<u32>,
    /// Of these, which have any weight.
    pub(super) used: Vec<bool>,
}

impl Hemisphere {
    /// For each point of the grid the row that its features have in a table, if it is one of the [points](Hemisphere::points).
    fn rows(&self) -> Vec<u32> {
        let mut rows = vec![u32::MAX; self.grid.point_count()];
        for (row, point) in self.points.iter().enumerate() {
            rows[*point as usize] = row as u32;
        }
        rows
    }
}

impl Session {
    /// Asks the ground truth for its pairs and makes a model that knows nothing yet.
    ///
    /// # Errors
    /// The plan is beyond what is possible, there is nothing to learn from, or values that no BRDF has.
    pub fn new(plan: Plan, truth: &GroundTruth) -> Result<Session, Error> {
        plan.validate()?;
        let (grids, texels) = (plan.grids()?, plan.surface_grid()?);
        let frames = texels.map_or_else(SurfaceFrames::default, |grid| truth.frames(grid));
        let pairs = truth.pairs(plan.pairs, plan.seed, texels);
        check_pairs(&pairs)?;
        let pairs = about_frames(pairs, &texels.unwrap_or_default(), &frames);
        let is_isotropic = truth.is_isotropic();
        let encoding = encoding(&pairs).ok_or(Error::Empty)?;
        let pairs = match truth {
            GroundTruth::Samples { .. } => rounds(&pairs, plan.seed),
            // Shards take whole blocks.
            _ => {
                let mut pairs = pairs.into_owned();
                let drawn = pairs.len();
                let count = drawn.max(plan.batch).next_multiple_of(plan.batch);
                (drawn..count).for_each(|place| pairs.push(pairs[place - drawn]));
                pairs
            }
        };
        let pairs_hash = pairs_hash(&pairs, is_isotropic);

        let empty = |grid: SphereGrid| Hemisphere {
            grid,
            seen: vec![false; grid.pixel_count()],
            points: Vec::new(),
            used: Vec::new(),
        };
        let mut hemispheres: Vec<Hemisphere> = grids.into_iter().map(empty).collect();
        let mut inputs = match plan.model {
            Model::Nbrdf => direct_inputs(&pairs, is_isotropic),
            Model::NeuBrdf => corner_inputs(&plan, is_isotropic, &pairs, &mut hemispheres),
        };
        check_names(&plan, &hemispheres)?;
        let targets = pairs.iter().map(|pair| target(pair, encoding, plan.recipe)).collect();
        let place = |pair: &Pair| [pair.uv.x, pair.uv.y, pair.area];
        let mut places = texels.map(|grid| Places { grid, at: pairs.iter().map(place).collect() });
        let probes = (plan.energy > 0.0).then(|| {
            let (probes, weights) = energy::draw(plan.seed, texels);
            add_probes(&mut inputs, &probes, &plan, is_isotropic, &hemispheres);
            places.iter_mut().for_each(|places| places.at.extend(probes.iter().map(place)));
            Probes { weights, encoding, weight: plan.energy }
        });
        let pool = Pool { targets, inputs, places, probes };
        let (network, tables, head) = start(&plan, &hemispheres, texels, encoding);
        let trainer = Trainer::new(network, tables, head, pool, plan.seed);
        let (loss, seconds) = (f64::NAN, 0.0);
        Ok(Session {
            plan,
            trainer,
            is_isotropic,
            pairs_hash,
            encoding,
            hemispheres,
            texels,
            frames,
            loss,
            seconds,
            end: None,
        })
    }

    /// Whether all steps are done.
    pub fn is_done(&self) -> bool {
        self.trainer.step >= self.last_step()
    }

    fn last_step(&self) -> u32 {
        self.end.map_or(self.plan.steps, |[_, end]| end)
    }

    /// Steps done.
    pub fn steps(&self) -> u32 {
        self.trainer.step
    }

    /// Seconds that they took, those before a checkpoint included.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Gain of the encoding that the loss is taken in.
    pub fn gain(&self) -> f64 {
        self.encoding.gain.into()
    }

    /// The loss of the last steps, averaged.
    pub fn loss(&self) -> f64 {
        self.loss
    }

    /// Takes so many steps, or all that are left.
    pub fn run(&mut self, steps: u32) {
        let (end, started) = (self.steps().saturating_add(steps), Instant::now());
        while self.steps() < end && !self.is_done() {
            if self.steps() == self.step_at(QUANTISE_AT) {
                self.quantise();
            }
            self.prune_in_time();
            let rates: Vec<Rates> = (self.steps()..self.next_stop(end)).map(|step| self.rates_at(step)).collect();
            for loss in self.trainer.train(self.plan.batch, &rates) {
                self.note_loss(loss);
            }
            self.finish_in_time();
        }
        self.seconds += started.elapsed().as_secs_f64();
    }

    /// The step before which something else is due than a step, `end` at the latest.
    fn next_stop(&self, end: u32) -> u32 {
        let changes = [self.step_at(QUANTISE_AT), self.step_at(PRUNE_AT), self.last_step()];
        let to_come = changes.into_iter().filter(|step| *step > self.steps());
        to_come.fold(end.min(self.steps() + MOST_STEPS), u32::min)
    }

    /// Prunes the network, if that is due before the next step.
    pub(super) fn prune_in_time(&mut self) {
        if self.trainer.step == self.step_at(PRUNE_AT) {
            self.prune();
        }
    }

    /// Gives points the codes that they end with, if no step is left.
    pub(super) fn finish_in_time(&mut self) {
        if self.is_done() {
            self.trainer.tables.iter_mut().for_each(Table::finish);
        }
    }

    /// Prunes the network, unless it is as narrow as is planned.
    fn prune(&mut self) {
        let Plan { model, recipe, pruned, .. } = self.plan;
        if model == Model::NeuBrdf && recipe == Recipe::Paper && self.trainer.network.shapes[0].outputs > pruned {
            self.trainer.replace_network(prune_neurons(&self.trainer.network, pruned));
        }
    }

    /// Adds the loss of a step to the average.
    pub(super) fn note_loss(&mut self, loss: f64) {
        self.loss = if self.loss.is_finite() { self.loss + 0.01 * (loss - self.loss) } else { loss };
    }

    /// Gives points codes, unless they have them or there are enough for each to have its own.
    fn quantise(&mut self) {
        if self.plan.recipe != Recipe::Default {
            return;
        }
        let mut random = Random::new(self.plan.seed, Random::QUANTISE);
        let all_texels = vec![true; self.texels.map_or(0, |grid| grid.point_count())];
        let used = self.hemispheres.iter().map(|hemisphere| &hemisphere.used).chain([&all_texels]);
        for ((table, used), codes) in self.trainer.tables.iter_mut().zip(used).zip(self.plan.table_codes()) {
            if table.quantiser == Quantiser::Free {
                table.quantise(codes, used, &mut random);
            }
        }
    }

    pub(super) fn step_at(&self, share: f32) -> u32 {
        (share * self.plan.steps as f32) as u32
    }

    /// Of the next step.
    pub(super) fn rates(&self) -> Rates {
        self.rates_at(self.steps())
    }

    fn rates_at(&self, step: u32) -> Rates {
        let Plan { recipe, network_rate, table_rate, steps, .. } = self.plan;
        // Winding down, rates fall from what they were when that began.
        let (from, left) = match self.end {
            None => (step, 1.0),
            Some([start, end]) => (start, (end - step) as f32 / (end - start).max(1) as f32),
        };
        let at = from as f32 / steps as f32;
        let warm = ((step as f32 + 1.0) / WARM_UP).min(1.0);
        if recipe != Recipe::Paper {
            let falling = 0.5 * (1.0 + (PI * at).cos()) * warm * left;
            let weighs = if self.is_isotropic { Weighs::Fit } else { Weighs::Truth };
            return Rates {
                network: network_rate * falling,
                tables: table_rate * falling,
                temperature: 1.0,
                loss: Loss::Divergence { scale: self.encoding.scale, weighs },
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
        if joint < 1.0 && self.end.is_none() {
            let falling = multi_step(joint) * warm;
            Rates {
                network: network_rate * falling,
                tables: table_rate * falling,
                temperature: 1.0 - 0.5 * joint,
                loss: Loss::Absolute,
                sparsity: SPARSITY,
            }
        } else {
            let falling = multi_step((at - PRUNE_AT) / (1.0 - PRUNE_AT)) * left;
            Rates { network: PRUNED_RATE * falling, tables: 0.0, temperature: 0.5, loss: Loss::Absolute, sparsity: 0.0 }
        }
    }

    /// Ends soon: points are given codes and neurons pruned where that is still to come, and the rates fall to 0 within a twentieth of the
    /// planned steps, so that an interrupted training ends as one that was planned shorter. One that has no more to do ends as planned.
    pub fn wind_down(&mut self) {
        if self.end.is_none() && !self.ends_soon() {
            let start = self.trainer.step;
            self.quantise();
            self.prune();
            self.end = Some([start, start + self.wind_down_steps()]);
        }
    }

    fn wind_down_steps(&self) -> u32 {
        self.plan.steps.div_ceil(20)
    }

    /// Whether no more steps are left than winding down takes.
    pub(super) fn ends_soon(&self) -> bool {
        self.trainer.step + self.wind_down_steps() >= self.plan.steps
    }

    /// Gives the model the sizes that it has somewhere on the way; `None` if it never has.
    pub(super) fn shape(&mut self, widths: &[usize], codes: &[Option<usize>]) -> Option<()> {
        let Plan { pruned, .. } = self.plan;
        if widths != self.trainer.network.widths() {
            if self.plan.recipe != Recipe::Paper || widths != [self.plan.inputs(), pruned, pruned, pruned, 3] {
                return None;
            }
            self.trainer.replace_network(Network::zeros(widths));
        }
        if codes.len() != self.trainer.tables.len() {
            return None;
        }
        for ((table, codes), most) in self.trainer.tables.iter_mut().zip(codes).zip(self.plan.table_codes()) {
            if let Some(codes) = *codes {
                if self.plan.recipe != Recipe::Default || codes == 0 || codes > most {
                    return None;
                }
                table.start_nearest(codes);
            }
        }
        Some(())
    }

    /// The NeuBRDF as it is now, with the lobe that samples it; `None` if it is none.
    pub fn neubrdf(&self) -> Option<NeuBrdf> {
        self.unsampled().map(sampled)
    }

    /// What the plan wants albedos of the finished NeuBRDF compared with; `None` if nothing, or if the ground truth is not known everywhere.
    /// `tell` hears how many views are asked for, and of how many.
    pub fn views(&self, truth: &GroundTruth, tell: impl FnMut(usize, usize)) -> Option<Views> {
        let GroundTruth::Function { eval, .. } = truth else { return None };
        let brdf = self.unsampled().filter(|_| self.plan.albedo_rounds > 0)?;
        Some(Views::ask(&brdf, &|pairs| pairs.par_iter().map(|[wo, wi]| eval(*wo, *wi)).collect(), tell))
    }

    /// The NeuBRDF as it is now, with the albedos of views and the lobe that samples it; `None` if it is none. `tell` is called up to
    /// [`Plan::albedo_rounds`] + 1 times meanwhile.
    pub fn finished(&self, views: Option<&Views>, tell: impl FnMut()) -> Option<NeuBrdf> {
        let mut brdf = self.unsampled()?;
        if let Some(views) = views {
            views.close_gaps(&mut brdf, self.plan.albedo_rounds, tell);
        }
        Some(sampled(brdf))
    }

    /// The same with no lobe but the hemisphere's.
    fn unsampled(&self) -> Option<NeuBrdf> {
        let tables = (0..self.hemispheres.len()).map(|side| sphere_tables(&[self.trained_points(side)?]).pop());
        self.with_tables(tables.collect::<Option<_>>()?)
    }

    /// What a table of directions is made of; `None` if the model has none.
    pub(super) fn trained_points(&self, side: usize) -> Option<TrainedPoints<'_>> {
        let table = self.trainer.tables.get(side)?;
        let Hemisphere { grid, seen, points, .. } = &self.hemispheres[side];
        Some(TrainedPoints { table, grid: *grid, seen, points })
    }

    /// The NeuBRDF of these tables, one a hemisphere, with no lobe but the hemisphere's.
    pub(super) fn with_tables(&self, tables: Vec<SphereTable>) -> Option<NeuBrdf> {
        let places = self.trainer.tables.get(tables.len()).zip(self.texels);
        let mut tables = tables.into_iter();
        let mut pair = || Some([tables.next()?, tables.next()?]);
        let [wi, wo] = pair()?;
        Some(NeuBrdf {
            is_isotropic: self.is_isotropic,
            corner_weights: self.plan.corner_weights,
            wi,
            wo,
            coarser: std::iter::from_fn(pair).collect(),
            sees_half_vector: self.plan.sees_half_vector,
            surface: places.map(|(table, grid)| surface_table(table, grid, self.frames.clone())),
            layers: layers(&self.trainer.network),
            encoding: self.encoding,
            lobe: SamplingLobe::COSINE,
            provenance: Provenance::default(),
        })
    }

    /// The NBRDF as it is now; `None` if it is none, or not isotropic, which published ones are.
    pub fn nbrdf(&self) -> Option<Nbrdf> {
        (self.plan.model == Model::Nbrdf && self.is_isotropic).then(|| nbrdf(&self.trainer.network))?
    }

    /// The model as it is now, to be evaluated.
    pub fn evaluator(&self) -> Evaluator {
        match self.unsampled() {
            Some(brdf) => Evaluator::neubrdf(&brdf),
            None => Evaluator::nbrdf(self.trainer.network.clone(), self.is_isotropic),
        }
    }
}

/// A NeuBRDF with the lobe that samples it.
pub(super) fn sampled(mut brdf: NeuBrdf) -> NeuBrdf {
    brdf.lobe = fit_lobe(brdf.is_isotropic_about_z(), &|wo, wi| brdf.eval(wo, wi));
    brdf
}

/// A network and tables before their first step.
fn start(
    plan: &Plan,
    hemispheres: &[Hemisphere],
    texels: Option<SurfaceGrid>,
    encoding: Encoding,
) -> (Network, Vec<Table>, Head) {
    let random = &mut Random::new(plan.seed, Random::START);
    let Encoding { gain, scale, .. } = encoding;
    let Plan { features, hidden, .. } = *plan;
    if plan.model == Model::Nbrdf {
        return (Network::random(&[6, 21, 21, 3], random), Vec::new(), Head::LogPlusOne { gain, scale });
    }
    let network = Network::random(&[plan.inputs(), hidden, hidden, hidden, 3], random);
    let mut table = |points, features, codes| match plan.recipe {
        Recipe::Paper => Table::softmax(points, features, codes, random),
        Recipe::Default | Recipe::Unquantised => Table::free(points, features, random),
    };
    let directions = hemispheres.iter().zip(plan.table_codes());
    let mut tables: Vec<Table> =
        directions.map(|(at, codes)| table(at.grid.point_count(), features, codes).of_points(&at.points)).collect();
    let places = texels.zip(plan.surface);
    tables.extend(places.map(|(grid, surface)| table(grid.point_count(), surface.features, surface.codes)));
    (network, tables, Head::Encoded)
}

/// Half and difference vectors; the azimuth of the half vector is left out where nothing depends on it.
fn direct_inputs(pairs: &[Pair], is_isotropic: bool) -> Inputs {
    let numbers = |pair: &Pair| half_difference(pair.wo.as_dvec3(), pair.wi.as_dvec3(), is_isotropic);
    Inputs::Direct(pairs.par_iter().flat_map_iter(numbers).collect())
}

/// What an NBRDF sees of two directions.
pub fn half_difference(wo: DVec3, wi: DVec3, is_isotropic: bool) -> [f32; 6] {
    let HalfDifference { half, across, cosine } = HalfDifference::new(wo, wi);
    let half = if is_isotropic { DVec3::new(half.truncate().length(), 0.0, half.z) } else { half };
    [half.x, half.y, half.z, across.x, across.y, cosine].map(|x| x as f32)
}

/// Where the features of pairs come from; marks the pixels and points that they need.
fn corner_inputs(plan: &Plan, is_isotropic: bool, pairs: &[Pair], hemispheres: &mut [Hemisphere]) -> Inputs {
    let tables: Vec<SphereTable> = hemispheres.iter().map(|hemisphere| whole_table(hemisphere.grid)).collect();
    let frame = |pair: &Pair| in_frame(pair.wo.as_dvec3(), pair.wi.as_dvec3(), is_isotropic);
    let located: Vec<(Corners, u32)> = pairs
        .par_iter()
        .flat_map_iter(|pair| {
            let at = |(table, at): (&SphereTable, SpherePlace)| {
                (Corners::of(table, at, plan.corner_weights), at.on(table.grid).located().pixel)
            };
            tables.iter().zip(places(&tables, frame(pair)).into_iter().cycle()).map(at)
        })
        .collect();
    for (at, (_, pixel)) in located.iter().enumerate() {
        hemispheres[at % tables.len()].seen[*pixel as usize] = true;
    }
    for (Hemisphere { seen, points, used, .. }, table) in hemispheres.iter_mut().zip(&tables) {
        *points = table.known_points(|pixel| seen[pixel as usize]);
        *used = vec![false; points.len()];
    }
    let rows: Vec<Vec<u32>> = hemispheres.iter().map(Hemisphere::rows).collect();
    let mut corners: Vec<Corners> = located.into_iter().map(|(corners, _)| corners).collect();
    for (at, corners) in corners.iter_mut().enumerate() {
        let side = at % tables.len();
        corners.points = corners.points.map(|point| rows[side][point as usize]);
        for (row, weight) in corners.points.into_iter().zip(corners.weights) {
            hemispheres[side].used[row as usize] |= weight > 0.0;
        }
    }
    let half = |pair: &Pair| half_vector_in(frame(pair));
    Inputs::Gathered {
        sides: tables.len(),
        corners,
        half_vectors: if plan.sees_half_vector { pairs.par_iter().map(half).collect() } else { Vec::new() },
    }
}

/// Errors if points with features of their own are more than indices can name.
fn check_names(plan: &Plan, hemispheres: &[Hemisphere]) -> Result<(), Error> {
    if plan.recipe != Recipe::Unquantised {
        return Ok(());
    }
    match hemispheres.iter().map(|hemisphere| hemisphere.points.len()).find(|points| *points > MOST_CODES) {
        None => Ok(()),
        Some(points) => Err(Error::Plan {
            name: "--n-side",
            found: format!("{:?}, of which {points} points are needed", plan.n_side),
            expected: "at most 65534 points with features of their own, or a recipe with codebooks instead of --recipe unquantised",
        }),
    }
}

/// Adds what the network sees of pairs that are asked for an albedo: pixels that no pair to learn from lies in are merged.
fn add_probes(inputs: &mut Inputs, probes: &[Pair], plan: &Plan, is_isotropic: bool, hemispheres: &[Hemisphere]) {
    let directions = probes.iter().map(|pair| (pair.wo.as_dvec3(), pair.wi.as_dvec3()));
    match inputs {
        Inputs::Direct(numbers) => {
            numbers.extend(directions.flat_map(|(wo, wi)| half_difference(wo, wi, is_isotropic)));
        }
        Inputs::Gathered { corners, half_vectors, .. } => {
            let merged = |Hemisphere { grid, seen, .. }: &Hemisphere| merged_table(*grid, seen);
            let tables: Vec<SphereTable> = hemispheres.iter().map(merged).collect();
            let rows: Vec<Vec<u32>> = hemispheres.iter().map(Hemisphere::rows).collect();
            for (wo, wi) in directions {
                let frame = in_frame(wo, wi, is_isotropic);
                half_vectors.extend(plan.sees_half_vector.then(|| half_vector_in(frame)));
                let places = places(&tables, frame);
                corners.extend(tables.iter().zip(&rows).zip(places.into_iter().cycle()).map(|((table, rows), at)| {
                    let at = Corners::of(table, at, plan.corner_weights);
                    // Corners that no pair says anything of have the features of others.
                    let row = |point: u32| rows[usize::from(table.indices[point as usize])];
                    Corners { points: at.points.map(row), ..at }
                }));
            }
        }
    }
}

/// Errors if a direction is none of the hemisphere, or a value is not finite or negative.
fn check_pairs(pairs: &[Pair]) -> Result<(), Error> {
    let is_above = |w: Vec3| w.is_normalized() && w.z >= 0.0;
    for Pair { wo, wi, value, .. } in pairs.iter().copied() {
        if !(is_above(wo) && is_above(wi)) {
            return Err(Error::Direction { wo, wi });
        }
        if !(value.is_finite() && value.min_element() >= 0.0) {
            return Err(Error::Value { wo, wi, value });
        }
    }
    Ok(())
}

/// Measurements as they are gone through: in whole rounds, so that they count alike, each round in an order of its own. In a file neighbours are
/// alike, and those of a block stay together in all batches.
fn rounds(pairs: &[Pair], seed: u64) -> Vec<Pair> {
    let all = pairs.len() * FEWEST_TOGETHER.div_ceil(pairs.len());
    let mut random = Random::new(seed, Random::ROUNDS);
    let order = std::iter::repeat_with(|| random.permutation(pairs.len())).flatten();
    order.take(all.next_multiple_of(BLOCK)).map(|pair| pairs[pair as usize]).collect()
}

/// Measurements are taken several times over until they are so many: filling up the last block then makes less than a fiftieth of them count more.
const FEWEST_TOGETHER: usize = 64 * BLOCK;

/// Of all that a training sees of its pairs.
fn pairs_hash(pairs: &[Pair], is_isotropic: bool) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&[u8::from(is_isotropic)]);
    hasher.update(bytemuck::cast_slice(pairs));
    hasher.finalize().to_hex().to_string()
}

/// The encoding that suits these values: its gain is so high that the darker fifth of them still counts.
fn encoding(pairs: &[Pair]) -> Option<Encoding> {
    let mut values: Vec<f32> = pairs.iter().map(|pair| pair.value.element_sum() / 3.0).collect();
    let dark = values.len() / 5;
    let (_, dark, _) = (!values.is_empty()).then(|| values.select_nth_unstable_by(dark, f32::total_cmp))?;
    let gain = (1.0 / dark.max(1e-6)).clamp(LEAST_GAIN, MOST_GAIN);
    let brightest = pairs.iter().map(|pair| pair.value.max_element()).fold(0.0, f32::max);
    Some(Encoding { gain, scale: SCALE, max: (2.0 * brightest).max(1e-3) })
}

/// The encoded value of a pair, and its weight: grazing ones count less. In the paper's recipe all are equal.
fn target(pair: &Pair, encoding: Encoding, recipe: Recipe) -> [f32; 4] {
    let [r, g, b] = pair.value.to_array().map(|value| (encoding.gain * value).ln_1p() / encoding.scale);
    let weight = match recipe {
        Recipe::Default | Recipe::Unquantised => pair.wi.z.sqrt(),
        Recipe::Paper => 1.0,
    };
    [r, g, b, weight]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// Of as many measurements as there are in a file, ones that stand side by side there are not learned side by side.
    #[test]
    fn all_measurements_count_alike_whatever_their_order() {
        for count in [1, 100, 672, 3000, 20_001] {
            let pairs: Vec<Pair> = (0..count).map(|i| Pair { area: i as f32, ..Pair::default() }).collect();
            let rounds = rounds(&pairs, 3);
            let mut times = BTreeMap::<u32, usize>::new();
            rounds.iter().for_each(|pair| *times.entry(pair.area as u32).or_default() += 1);
            let least = times.values().copied().min().unwrap_or(0);
            let more: usize = times.values().map(|times| times - least).sum();
            assert_eq!((times.len(), rounds.len() % BLOCK), (count, 0));
            assert!(50 * more < rounds.len(), "{count}: {more} of {} count more", rounds.len());
            let beside = rounds.windows(2).filter(|pair| pair[1].area == pair[0].area + 1.0).count();
            assert!(count < 100 || 20 * beside < rounds.len(), "{count}: {beside} beside their neighbours");
        }
    }
}
