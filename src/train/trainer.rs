//! One step after the other: gather, forward, loss, backward, scatter, Adam.
//!
//! A batch is cut into the same shards whatever the number of threads, and their gradients are added in order: a seed gives the
//! same bits again on the same machine.

use std::ops::Range;
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use glam::Vec2;
use rayon::prelude::*;

use super::adam::Adam;
use super::energy::{DIRECTIONS, Probes};
use super::gather::{Corners, Rows, Texels, gather_features};
use super::network::{Network, Shard};
use super::product::padded;
use super::random::Random;
use super::table::{Quantiser, Table, TableStep};
use super::team::work_together;
use super::vector::add_scaled;
use crate::scene::brdf::{Footprint, SurfaceGrid};

/// What the network sees of the pairs to learn from.
pub enum Inputs {
    /// Features gathered from tables.
    Gathered {
        /// How many tables of directions there are.
        sides: usize,
        /// Pairs × sides; their points are the tables' rows.
        corners: Vec<Corners>,
        /// Of each pair, if the network sees them; else empty.
        half_vectors: Vec<Vec2>,
    },
    /// Numbers as they are, pairs × width.
    Direct(Vec<f32>),
}

/// Where on a texture pairs are.
pub struct Places {
    /// Its texels.
    pub grid: SurfaceGrid,
    /// u, v, and the area of the footprint.
    pub at: Vec<[f32; 3]>,
}

impl Places {
    fn texels(&self, pair: usize) -> Texels {
        let [u, v, area] = self.at[pair].map(f64::from);
        Texels::of(&self.grid, Footprint { uv: [u, v].into(), area })
    }
}

/// The pairs to learn from as steps need them.
pub struct Pool {
    /// What goes in.
    pub inputs: Inputs,
    /// And of materials that vary, where.
    pub places: Option<Places>,
    /// What should come out, and the weight of the pair in the loss.
    pub targets: Vec<[f32; 4]>,
    /// Pairs behind those to learn from, that the albedo is held below 1 at.
    pub probes: Option<Probes>,
}

/// What the network's output stands for in the loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Head {
    /// The target itself.
    Encoded,
    /// ln(1 + f) of the BRDF f, while the target is ln(1 + gain · f) / scale.
    LogPlusOne {
        /// Gain of the target.
        gain: f32,
        /// Scale of the target.
        scale: f32,
    },
}

/// What an error of the encoded value counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loss {
    /// Its size.
    Absolute,
    /// Itakura and Saito's divergence of x = 1 + gain · f from its fit x̂, x / x̂ − ln(x / x̂) − 1, over scale²; linear where x is more than
    /// twice x̂. About half the square of the error, but least at the mean of f, not at that of its logarithm: lobes keep their
    /// energy where they are not fitted exactly, and what a noisy ground truth says is right on average.
    Divergence {
        /// Scale of the encoding.
        scale: f32,
        /// What pairs weigh by.
        weighs: Weighs,
    },
}

/// Whose brightness a pair's weight grows with: bright ones carry the energy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighs {
    /// The fit's. Each derivative is that of x̂ times (x̂ − x) times a function of x̂, so that the least loss is at the mean still; the
    /// weight itself is not derived.
    Fit,
    /// The ground truth's. Where values vary that the fit cannot follow, the larger ones weigh more, and the least loss is above the mean. In
    /// narrow anisotropic lobes this makes up for the divergence's being linear above twice the fit, which pulls less.
    Truth,
}

/// Learning rates and the softness of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Of the network.
    pub network: f32,
    /// Of codes and points.
    pub tables: f32,
    /// Of softmax quantisers.
    pub temperature: f32,
    /// What is made small.
    pub loss: Loss,
    /// Pull of each weight to 0, the derivative of an L1 penalty.
    pub sparsity: f32,
}

impl Rates {
    fn of_tables(&self, step: u32) -> TableStep {
        TableStep { step, rate: self.tables, temperature: self.temperature }
    }
}

/// How far above its target a fit counts in [`Loss::weight`]: the first steps are wild.
const FARTHEST: f32 = 1.0;

/// Rows of a shard; the albedo of a view is one's.
const SHARD: usize = DIRECTIONS;

/// Pairs that stay together when the pool is shuffled, for the caches' sake.
pub(super) const BLOCK: usize = 64;

/// A model while it is trained.
pub struct Trainer {
    /// The dense layers.
    pub network: Network,
    /// Their moments.
    pub adam: Adam,
    /// Features of ωi and of ωo, by turns, on all grids, and of the place where there is one; empty for a network on direct inputs.
    pub tables: Vec<Table>,
    /// What outputs stand for.
    pub head: Head,
    /// Steps done.
    pub step: u32,
    /// Steps since the moments were last reset.
    pub adam_step: u32,
    seed: u64,
    pool: Pool,
    order: Vec<u32>,
    epoch: u64,
    transposed: Vec<f32>,
    shards: Vec<Shard>,
    scatters: Vec<Scatter>,
    sum: Vec<f32>,
}

/// What a step does.
struct Step {
    rates: Rates,
    /// What a channel of a pair counts in the mean loss.
    scale: f32,
    /// Counts from 1 since the moments were last reset.
    adam_step: u32,
    /// Its pairs.
    blocks: Vec<u32>,
}

/// What is learned, as a step finds it.
struct Model<'a> {
    tables: Vec<Rows<'a>>,
    network: &'a Network,
    /// Of the network.
    transposed: &'a [f32],
    head: Head,
}

/// Gradient of a table's rows.
struct Scatter {
    gradient: Vec<f32>,
    is_touched: Vec<bool>,
    touched: Vec<u32>,
}

impl Trainer {
    /// A model before its first step.
    pub fn new(network: Network, tables: Vec<Table>, head: Head, pool: Pool, seed: u64) -> Trainer {
        let scatters = tables
            .iter()
            .map(|table| Scatter {
                gradient: vec![0.0; table.rows.len()],
                is_touched: vec![false; table.point_count()],
                touched: Vec::new(),
            })
            .collect();
        Trainer {
            adam: Adam::new(network.parameters.len()),
            tables,
            head,
            step: 0,
            adam_step: 0,
            seed,
            pool,
            order: Vec::new(),
            epoch: u64::MAX,
            transposed: Vec::new(),
            shards: Vec::new(),
            scatters,
            sum: Vec::new(),
            network,
        }
    }

    /// A step over `batch` pairs (a multiple of 256) by each of these rates. Returns their mean losses.
    pub fn train(&mut self, batch: usize, rates: &[Rates]) -> Vec<f64> {
        let steps: Vec<Step> = rates.iter().map(|rates| self.next_step(batch, *rates)).collect();
        self.fit_shards(batch);
        let columns = self.columns();
        let Trainer { network, adam, tables, head, pool, shards, scatters, .. } = self;
        let threads = rayon::current_num_threads().min(shards.len());
        let mut losses = Vec::new();
        let network = RwLock::new((network, adam, &mut losses));
        let tables: Vec<_> = tables.iter_mut().zip(scatters).map(RwLock::new).collect();
        let shards: Vec<_> = shards.iter_mut().map(RwLock::new).collect();
        work_together(threads, |member| {
            let (mut transposed, mut sum) = (Vec::new(), Vec::new());
            for step in &steps {
                {
                    let network = &read(&network).0;
                    let tables: Vec<_> = tables.iter().map(read).collect();
                    let rows = tables.iter().map(|table| Rows::of(table.0)).collect();
                    network.transpose(&mut transposed);
                    let model = Model { tables: rows, network, transposed: &transposed, head: *head };
                    for (index, shard) in member.own(&shards) {
                        step.run(index, pool, &model, &mut write(shard));
                    }
                }
                member.wait();
                {
                    let shards: Vec<_> = shards.iter().map(read).collect();
                    let shards: Vec<&Shard> = shards.iter().map(|shard| &***shard).collect();
                    for (side, table) in member.own(&tables).filter(|_| step.moves_tables()) {
                        let (table, scatter) = &mut *write(table);
                        scatter.collect(side, columns[side].clone(), pool, &step.blocks, &shards);
                        table.step(&scatter.gradient, &scatter.touched, step.rates.of_tables(step.adam_step));
                    }
                    if member.owns(tables.len()) {
                        let (network, adam, losses) = &mut *write(&network);
                        add_up(network, step.rates, &shards, &mut sum);
                        adam.step(0, &mut network.parameters, &sum, step.rates.network, step.adam_step);
                        losses.push(mean_loss(&shards, batch));
                    }
                }
                member.wait();
            }
        });
        losses
    }

    /// The gradients of a step over `batch` pairs, which counts as done. Returns the mean loss.
    pub fn find_gradients(&mut self, batch: usize, rates: Rates) -> f64 {
        let step = self.next_step(batch, rates);
        self.fit_shards(batch);
        let columns = self.columns();
        let Trainer { network, tables, head, pool, shards, scatters, transposed, sum, .. } = self;
        network.transpose(transposed);
        let model = Model { tables: tables.iter().map(Rows::of).collect(), network, transposed, head: *head };
        shards.par_iter_mut().enumerate().for_each(|(index, shard)| step.run(index, pool, &model, shard));
        let shards: Vec<&Shard> = shards.iter().collect();
        let of_tables = || {
            let each = scatters.par_iter_mut().zip(columns).enumerate().filter(|_| step.moves_tables());
            each.for_each(|(side, (scatter, columns))| scatter.collect(side, columns, pool, &step.blocks, &shards));
        };
        rayon::join(|| add_up(network, rates, &shards, sum), of_tables);
        mean_loss(&shards, batch)
    }

    /// What the next step does, which from now on counts as done.
    fn next_step(&mut self, batch: usize, rates: Rates) -> Step {
        let mut blocks = self.blocks(batch / BLOCK);
        blocks.extend(self.probe_blocks());
        self.step += 1;
        self.adam_step += 1;
        Step { rates, scale: 1.0 / (3 * batch) as f32, adam_step: self.adam_step, blocks }
    }

    /// Room for such a batch and this network.
    fn fit_shards(&mut self, batch: usize) {
        let count = batch / SHARD + usize::from(self.pool.probes.is_some());
        if self.shards.len() != count || self.shards[0].gradient.len() != self.network.parameters.len() {
            self.shards = vec![Shard::new(&self.network, SHARD); count];
        }
    }

    /// Where each table's features are among a network's inputs.
    fn columns(&self) -> Vec<Range<usize>> {
        let ranges = self.tables.iter().scan(0, |end, table| {
            *end += table.features;
            Some(*end - table.features..*end)
        });
        ranges.collect()
    }

    /// What the last gradients do to tables.
    pub fn table_step(&self, rates: Rates) -> TableStep {
        rates.of_tables(self.adam_step)
    }

    /// Moves the network's parameters against a gradient.
    pub fn step_network(&mut self, gradient: &[f32], rates: Rates) {
        self.adam.step(0, &mut self.network.parameters, gradient, rates.network, self.adam_step);
    }

    /// The last gradient of the network's parameters.
    pub fn network_gradient(&self) -> &[f32] {
        &self.sum
    }

    /// The tables, each with the last gradient of its rows and the points that it touched.
    pub fn tables_and_gradients(&mut self) -> impl Iterator<Item = (&mut Table, &[f32], &[u32])> {
        let both = self.tables.iter_mut().zip(&self.scatters);
        both.map(|(table, scatter)| (table, &scatter.gradient[..], &scatter.touched[..]))
    }

    /// Goes on with another network, of whose parameters nothing is known yet.
    pub fn replace_network(&mut self, network: Network) {
        self.adam = Adam::new(network.parameters.len());
        self.network = network;
        self.adam_step = 0;
    }

    /// All that changes from step to step, in one order.
    pub fn state(&mut self) -> (Vec<&mut Vec<f32>>, Vec<&mut Vec<u32>>) {
        let mut floats = vec![&mut self.network.parameters, &mut self.adam.first, &mut self.adam.second];
        let mut indices = Vec::new();
        for table in &mut self.tables {
            floats.extend([&mut table.codes, &mut table.adam.first, &mut table.adam.second]);
            match &mut table.quantiser {
                Quantiser::Free => {}
                Quantiser::Nearest { free: learned, adam } | Quantiser::Softmax { scores: learned, adam } => {
                    floats.extend([learned, &mut adam.first, &mut adam.second]);
                }
            }
            indices.push(&mut table.indices);
        }
        (floats, indices)
    }

    /// Gives points their features again after [`Trainer::state`] was written to; false if that named codes that are not there.
    pub fn look_up(&mut self) -> bool {
        self.tables.iter_mut().all(Table::look_up)
    }

    /// The blocks of the view whose albedo is looked at in the next step, if one is.
    fn probe_blocks(&self) -> Range<u32> {
        let Some(probes) = &self.pool.probes else { return 0..0 };
        let view = self.step as usize % (probes.weights.len() / SHARD);
        let start = self.pool.targets.len() + view * SHARD;
        (start / BLOCK) as u32..((start + SHARD) / BLOCK) as u32
    }

    /// The blocks of the next batch: each epoch goes through the pool in an order of its own.
    fn blocks(&mut self, count: usize) -> Vec<u32> {
        let total = self.pool.targets.len() / BLOCK;
        (0..count as u64)
            .map(|i| {
                let place = u64::from(self.step) * count as u64 + i;
                let epoch = place / total as u64;
                if epoch != self.epoch {
                    self.order = Random::new(self.seed, Random::EPOCHS + epoch).permutation(total);
                    self.epoch = epoch;
                }
                self.order[(place % total as u64) as usize]
            })
            .collect()
    }
}

impl Step {
    /// Takes the pairs of a shard through the network and back.
    fn run(&self, index: usize, pool: &Pool, model: &Model, shard: &mut Shard) {
        let Model { tables, network, transposed, head } = model;
        let blocks = &self.blocks[index * SHARD / BLOCK..][..SHARD / BLOCK];
        gather(pool, tables, blocks, shard);
        network.forward(shard);
        loss(pool, *head, self.rates.loss, self.scale, blocks, shard);
        shard.gradient.fill(0.0);
        network.backward(transposed, shard);
    }

    fn moves_tables(&self) -> bool {
        self.rates.tables != 0.0
    }
}

/// The gradient of the network's parameters.
fn add_up(network: &Network, rates: Rates, shards: &[&Shard], sum: &mut Vec<f32>) {
    sum.clear();
    sum.extend(network.parameters.iter().map(|parameter| rates.sparsity.copysign(*parameter)));
    for shard in shards {
        sum.iter_mut().zip(&shard.gradient).for_each(|(sum, value)| *sum += value);
    }
}

fn mean_loss(shards: &[&Shard], batch: usize) -> f64 {
    shards.iter().map(|shard| shard.loss).sum::<f64>() / (3 * batch) as f64
}

// A thread that panics stops all others, so that nobody sees what it left half done.
fn read<T>(of_all: &RwLock<T>) -> RwLockReadGuard<'_, T> {
    of_all.read().unwrap_or_else(PoisonError::into_inner)
}

fn write<T>(own: &RwLock<T>) -> RwLockWriteGuard<'_, T> {
    own.write().unwrap_or_else(PoisonError::into_inner)
}

fn pairs_of(blocks: &[u32]) -> impl Iterator<Item = usize> {
    blocks.iter().flat_map(|block| (0..BLOCK).map(move |i| *block as usize * BLOCK + i))
}

fn gather(pool: &Pool, tables: &[Rows], blocks: &[u32], shard: &mut Shard) {
    let width = shard.width();
    for (pair, row) in pairs_of(blocks).zip(shard.inputs().chunks_exact_mut(padded(width))) {
        match &pool.inputs {
            Inputs::Direct(numbers) => row[..width].copy_from_slice(&numbers[pair * width..][..width]),
            Inputs::Gathered { sides, corners, half_vectors } => {
                let texels = pool.places.as_ref().map(|places| places.texels(pair));
                let half_vector = half_vectors.get(pair).copied();
                gather_features(tables, &corners[pair * sides..][..*sides], texels.as_ref(), half_vector, row);
            }
        }
    }
}

fn loss(pool: &Pool, head: Head, loss: Loss, scale: f32, blocks: &[u32], shard: &mut Shard) {
    let first = blocks[0] as usize * BLOCK;
    if let (Some(probes), Some(start)) = (&pool.probes, first.checked_sub(pool.targets.len())) {
        return energy_loss(probes, head, start, shard);
    }
    let mut sum = 0.0;
    let (outputs, gradients) = shard.outputs();
    let width = padded(3);
    for ((output, gradient), pair) in
        outputs.chunks_exact(width).zip(gradients.chunks_exact_mut(width)).zip(pairs_of(blocks))
    {
        let [red, green, blue, weight] = pool.targets[pair];
        let target = [red, green, blue];
        let encoded: [(f32, f32); 3] = std::array::from_fn(|channel| head.encode(output[channel]));
        let mean = |values: [f32; 3]| values.iter().sum::<f32>() / 3.0;
        let weight = weight * loss.weight(mean(encoded.map(|(value, _)| value)), mean(target));
        for channel in 0..3 {
            let (value, slope) = encoded[channel];
            let (loss, derivative) = loss.of(value - target[channel]);
            sum += f64::from(weight * loss);
            gradient[channel] = scale * weight * derivative * slope;
        }
    }
    shard.loss = sum;
}

/// The loss of a view whose albedo is above 1, which is none of the mean over pairs that is reported.
fn energy_loss(probes: &Probes, head: Head, start: usize, shard: &mut Shard) {
    let (outputs, gradients) = shard.outputs();
    let width = padded(3);
    let rows = outputs.chunks_exact(width).map(|output| [0, 1, 2].map(|channel| head.encode(output[channel])));
    let encoded: Vec<[(f32, f32); 3]> = rows.collect();
    let values: Vec<[f32; 3]> = encoded.iter().map(|row| row.map(|(value, _)| value)).collect();
    let mut derivatives = vec![[0.0; 3]; values.len()];
    probes.loss(start, &values, &mut derivatives);
    for ((gradient, derivative), encoded) in gradients.chunks_exact_mut(width).zip(&derivatives).zip(&encoded) {
        for channel in 0..3 {
            gradient[channel] = derivative[channel] * encoded[channel].1;
        }
    }
    shard.loss = 0.0;
}

impl Loss {
    /// What a pair counts whose encoded value is fitted as `fit`.
    fn weight(self, fit: f32, target: f32) -> f32 {
        match self {
            Loss::Absolute => 1.0,
            Loss::Divergence { weighs: Weighs::Fit, .. } => (1.0 + fit.clamp(0.0, target + FARTHEST)).powi(2),
            Loss::Divergence { weighs: Weighs::Truth, .. } => (1.0 + target).powi(2),
        }
    }

    /// The loss and its derivative by the fit, for a fit that is `error` above its target.
    fn of(self, error: f32) -> (f32, f32) {
        match self {
            Loss::Absolute => (error.abs(), if error == 0.0 { 0.0 } else { error.signum() }),
            Loss::Divergence { scale, .. } => {
                let lowest = -std::f32::consts::LN_2 / scale;
                let within = error.max(lowest);
                let excess = (-scale * within).exp_m1();
                let divergence = (within + excess / scale) / scale;
                (divergence + (within - error) / scale, -excess / scale)
            }
        }
    }
}

impl Head {
    /// The target that an output stands for, and its derivative.
    pub fn encode(self, y: f32) -> (f32, f32) {
        match self {
            Head::Encoded => (y, 1.0),
            // Below 0, where the BRDF is 0, it goes on straight, so that a gradient leads back.
            Head::LogPlusOne { gain, scale } if y < 0.0 => (gain * y / scale, gain / scale),
            Head::LogPlusOne { gain, scale } => {
                let argument = 1.0 + gain * y.exp_m1();
                (argument.ln() / scale, gain * y.exp() / argument / scale)
            }
        }
    }
}

impl Scatter {
    /// The gradient of a table's rows, whose features are those columns of the inputs, from the last step's pairs.
    fn collect(&mut self, side: usize, columns: Range<usize>, pool: &Pool, blocks: &[u32], shards: &[&Shard]) {
        match (&pool.inputs, &pool.places) {
            (Inputs::Gathered { sides, .. }, Some(places)) if side == *sides => {
                self.add(columns, blocks, shards, |pair| {
                    let Texels { points, weights } = places.texels(pair);
                    (points, weights)
                });
            }
            (Inputs::Gathered { sides, corners, .. }, _) => self.add(columns, blocks, shards, |pair| {
                let Corners { points, weights } = corners[pair * sides + side];
                (points, weights)
            }),
            (Inputs::Direct(_), _) => {}
        }
    }

    /// The gradient of a table's rows from that of the features of a batch, which are those columns of the inputs, pair by pair; `at` tells
    /// a pair's points and weights.
    fn add<const N: usize>(
        &mut self,
        columns: Range<usize>,
        blocks: &[u32],
        shards: &[&Shard],
        at: impl Fn(usize) -> ([u32; N], [f32; N]),
    ) {
        let features = columns.len();
        self.gradient.fill(0.0);
        self.is_touched.fill(false);
        self.touched.clear();
        for (shard, blocks) in shards.iter().zip(blocks.chunks(SHARD / BLOCK)) {
            let stride = shard.input_gradient().len() / SHARD;
            for (row, pair) in shard.input_gradient().chunks_exact(stride).zip(pairs_of(blocks)) {
                let row = &row[columns.clone()];
                let (points, weights) = at(pair);
                for (point, weight) in points.into_iter().zip(weights) {
                    // Not to branch here lets the next pairs' numbers be fetched meanwhile.
                    self.is_touched[point as usize] |= weight != 0.0;
                    let to = &mut self.gradient[point as usize * features..][..features];
                    add_scaled(to, weight, row);
                }
            }
        }
        let points = (0..).zip(&self.is_touched);
        self.touched.extend(points.filter_map(|(point, is_touched)| is_touched.then_some(point)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_and_heads_have_the_slopes_of_finite_differences() {
        let step = 1e-3f32;
        for head in [Head::Encoded, Head::LogPlusOne { gain: 100.0, scale: 2.0 }] {
            for y in [-0.3f32, 0.2, 1.5, 4.0] {
                let expected = (head.encode(y + step).0 - head.encode(y - step).0) / (2.0 * step);
                assert!((head.encode(y).1 - expected).abs() < 2e-3 * expected.abs(), "{head:?} at {y}");
            }
        }
        for loss in [Loss::Absolute, Loss::Divergence { scale: 2.0, weighs: Weighs::Fit }] {
            for error in [-0.9f32, -0.3, -0.05, 0.02, 0.3, 1.2] {
                let expected = (loss.of(error + step).0 - loss.of(error - step).0) / (2.0 * step);
                assert!((loss.of(error).1 - expected).abs() < 2e-3, "{loss:?}: {error}");
            }
            assert_eq!(loss.of(0.0), (0.0, 0.0));
        }
    }

    /// Of a value that is x or y by chance, the divergence makes the mean, weighted as it is.
    #[test]
    fn the_divergence_is_least_at_the_mean() {
        let scale = 2.0;
        let encode = |x: f32| x.ln() / scale;
        let (x, y) = (1.5f32, 2.2);
        let loss = Loss::Divergence { scale, weighs: Weighs::Fit };
        let slope = |fit: f32| -> f32 {
            let fit = encode(fit);
            let derivative = |target: f32| loss.weight(fit, target) * loss.of(fit - target).1;
            [x, y].map(|x| derivative(encode(x))).iter().sum()
        };
        assert!(slope(0.5 * (x + y)).abs() < 1e-6 && slope(1.8) < 0.0 && slope(1.9) > 0.0);
    }

    /// What scattering adds up is the transpose of what gathering does: the derivative of each feature by each row.
    #[test]
    fn scattering_is_the_gradient_of_gathering() {
        let (points, features) = (7, 3);
        let mut random = Random::new(8, 0);
        let corners: Vec<[Corners; 2]> = (0..SHARD)
            .map(|_| {
                [0, 1].map(|_| Corners {
                    points: [0; 4].map(|_| random.below(points) as u32),
                    weights: [0.0; 4].map(|_| random.next_f32()),
                })
            })
            .collect();
        let network = Network::random(&[2 * features, 8, 3], &mut random);
        let mut shard = Shard::new(&network, SHARD);
        let (_, gradients) = shard.outputs();
        gradients.chunks_exact_mut(padded(3)).for_each(|row| row[..3].iter_mut().for_each(|x| *x = random.next_f32()));
        let mut transposed = Vec::new();
        network.transpose(&mut transposed);
        network.forward(&mut shard);
        network.backward(&transposed, &mut shard);
        let row_gradient = shard.input_gradient().to_vec();
        let blocks: Vec<u32> = (0..(SHARD / BLOCK) as u32).collect();
        for side in 0..2 {
            let mut scatter = Scatter {
                gradient: vec![0.0; points * features],
                is_touched: vec![false; points],
                touched: Vec::new(),
            };
            scatter.add(side * features..(side + 1) * features, &blocks, &[&shard], |pair| {
                (corners[pair][side].points, corners[pair][side].weights)
            });
            for point in 0..points {
                for feature in 0..features {
                    let mut expected = 0.0;
                    for (row, at) in row_gradient.chunks_exact(padded(2 * features)).zip(&corners) {
                        let weights = at[side].points.iter().zip(at[side].weights);
                        let weight: f32 =
                            weights.filter(|(p, _)| **p as usize == point).map(|(_, weight)| weight).sum();
                        expected += f64::from(weight) * f64::from(row[side * features + feature]);
                    }
                    let found = f64::from(scatter.gradient[point * features + feature]);
                    assert!((found - expected).abs() < 1e-4 * (1.0 + expected.abs()));
                }
            }
        }
    }
}
