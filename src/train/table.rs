//! Features over a hemisphere while they are learned, and the ways in which grid points come by them.

use super::adam::Adam;
use super::random::Random;
use super::vector::{dot, highest, nearest};

/// How a grid point comes by its features.
#[derive(Clone, Debug, PartialEq)]
pub enum Quantiser {
    /// Each point has features of its own: the upper bound of what a codebook can do.
    Free,
    /// Each point has free features z; forward it takes the nearest code. The gradient goes to the code and, straight through,
    /// to z, which besides is pulled to its code (van den Oord et al., *Neural Discrete Representation Learning*, 2017).
    Nearest {
        /// z, points × F.
        free: Vec<f32>,
        /// Moments of z.
        adam: Adam,
    },
    /// Each point has a score for every code; forward it takes the code of the highest, backward softmax(scores / τ) · codes
    /// (Takikawa et al., *Variable Bitrate Neural Fields*, 2022; the paper, supplemental 1).
    Softmax {
        /// C, points × codes.
        scores: Vec<f32>,
        /// Moments of the scores.
        adam: Adam,
    },
}

/// The features of grid points: of a hemisphere those that a training needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// F.
    pub features: usize,
    /// Codes × F; of [`Quantiser::Free`] a code a point.
    pub codes: Vec<f32>,
    /// Moments of the codes.
    pub adam: Adam,
    /// The code of each point.
    pub indices: Vec<u32>,
    /// How points come by their codes.
    pub quantiser: Quantiser,
    /// The features of each point: `codes[indices]`.
    pub rows: Vec<f32>,
}

/// What a step does to a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableStep {
    /// Counts from 1.
    pub step: u32,
    /// Learning rate.
    pub rate: f32,
    /// Temperature of [`Quantiser::Softmax`].
    pub temperature: f32,
}

/// Pull of z to its code, as a share of the loss's own scale (van den Oord et al. 2017 take 0.25 of a squared error).
const COMMITMENT: f32 = 0.05;

impl Table {
    /// A table in which each point has its own, small features.
    pub fn free(points: usize, features: usize, random: &mut Random) -> Table {
        let codes = small(points * features, random);
        Table {
            features,
            adam: Adam::new(codes.len()),
            indices: (0..points as u32).collect(),
            quantiser: Quantiser::Free,
            rows: codes.clone(),
            codes,
        }
    }

    /// A table with a codebook and a score for each pair of point and code (the paper's).
    pub fn softmax(points: usize, features: usize, codes: usize, random: &mut Random) -> Table {
        let scores = small(points * codes, random);
        let mut table = Table {
            features,
            codes: small(codes * features, random),
            adam: Adam::new(codes * features),
            indices: vec![0; points],
            quantiser: Quantiser::Softmax { adam: Adam::new(scores.len()), scores },
            rows: vec![0.0; points * features],
        };
        table.assign();
        table
    }

    /// A table that has not moved yet, with these of its points alone. So what they start from does not hang on what other points are needed.
    pub fn of_points(mut self, points: &[u32]) -> Table {
        let kept = |numbers: &[f32], width: usize| -> Vec<f32> {
            points.iter().flat_map(|point| &numbers[*point as usize * width..][..width]).copied().collect()
        };
        self.rows = kept(&self.rows, self.features);
        match &mut self.quantiser {
            Quantiser::Free => {
                self.indices = (0..points.len() as u32).collect();
                self.codes = self.rows.clone();
                self.adam = Adam::new(self.codes.len());
            }
            Quantiser::Nearest { free: learned, adam } | Quantiser::Softmax { scores: learned, adam } => {
                *learned = kept(learned, learned.len() / self.indices.len());
                *adam = Adam::new(learned.len());
                self.indices = points.iter().map(|point| self.indices[*point as usize]).collect();
            }
        }
        self
    }

    /// How many points there are.
    pub fn point_count(&self) -> usize {
        self.indices.len()
    }

    /// From features of their own to a codebook of `codes` codes, found by k-means over the points that `is_used` tells.
    pub fn quantise(&mut self, codes: usize, is_used: &[bool], random: &mut Random) {
        let points = self.used_rows(is_used);
        if points.len() / self.features > codes {
            self.quantise_to(k_means(&points, self.features, codes, random));
        }
    }

    /// The features of these points, one after another.
    pub fn used_rows(&self, is_used: &[bool]) -> Vec<f32> {
        let used = self.rows.chunks_exact(self.features).zip(is_used).filter(|(_, is_used)| **is_used);
        used.flat_map(|(row, _)| row).copied().collect()
    }

    /// From features of their own to this codebook.
    pub fn quantise_to(&mut self, codes: Vec<f32>) {
        self.start_nearest(codes.len() / self.features);
        self.codes = codes;
        self.assign();
    }

    /// Turns features of points' own into those that [`Quantiser::Nearest`] starts from, with a codebook of zeros.
    pub fn start_nearest(&mut self, codes: usize) {
        let free = self.rows.clone();
        self.quantiser = Quantiser::Nearest { adam: Adam::new(free.len()), free };
        self.adam = Adam::new(codes * self.features);
        self.codes = vec![0.0; codes * self.features];
    }

    /// Codes of [`Quantiser::Nearest`].
    pub fn nearest_codes(&self) -> Option<usize> {
        matches!(self.quantiser, Quantiser::Nearest { .. }).then(|| self.codes.len() / self.features)
    }

    /// Gives each point its code again, and its features.
    pub fn assign(&mut self) {
        match &self.quantiser {
            Quantiser::Free => {
                self.rows.copy_from_slice(&self.codes);
                return;
            }
            Quantiser::Nearest { free, .. } => {
                self.indices = nearest(&self.codes, self.features, free);
            }
            Quantiser::Softmax { scores, .. } => {
                let codes = self.codes.len() / self.features;
                for (index, scores) in self.indices.iter_mut().zip(scores.chunks_exact(codes)) {
                    *index = highest(scores) as u32;
                }
            }
        }
        self.look_up();
    }

    /// Gives points the features of their codes; false if there is no such code.
    pub fn look_up(&mut self) -> bool {
        let codes = self.codes.len() / self.features;
        let is_valid = self.indices.iter().all(|index| (*index as usize) < codes);
        if is_valid {
            for (row, index) in self.rows.chunks_exact_mut(self.features).zip(&self.indices) {
                row.copy_from_slice(&self.codes[*index as usize * self.features..][..self.features]);
            }
        }
        is_valid
    }

    /// Moves what is learned against `gradient`, the loss's derivatives by [`Table::rows`]; `touched` are the points
    /// whose rows a batch used.
    pub fn step(&mut self, gradient: &[f32], touched: &[u32], at: TableStep) {
        let to_codes = self.step_points(gradient, touched, at);
        self.step_codes(&to_codes, at);
        self.settle(at);
    }

    /// Moves what points have of their own. Returns the derivatives by the codes, which [`Table::step_codes`] moves.
    pub fn step_points(&mut self, gradient: &[f32], touched: &[u32], at: TableStep) -> Vec<f32> {
        let features = self.features;
        match &mut self.quantiser {
            Quantiser::Free => gradient.to_vec(),
            Quantiser::Nearest { free, adam } => {
                let mut to_codes = vec![0.0; self.codes.len()];
                let mut to_free = gradient.to_vec();
                for point in touched {
                    let start = *point as usize * features;
                    let code = self.indices[*point as usize] as usize * features;
                    let gradient = &gradient[start..start + features];
                    to_codes[code..code + features].iter_mut().zip(gradient).for_each(|(sum, value)| *sum += value);
                    // The pull is on the scale of the gradient, whatever that of the loss is.
                    let strength = COMMITMENT * dot(gradient, gradient).sqrt();
                    let to = &mut to_free[start..start + features];
                    add_commitment(strength, &free[start..start + features], &self.codes[code..], to);
                }
                adam.step(0, free, &to_free, at.rate, at.step);
                to_codes
            }
            Quantiser::Softmax { scores, adam } => {
                let codes = self.codes.len() / features;
                let mut to_codes = vec![0.0; self.codes.len()];
                let mut to_scores = vec![0.0; codes];
                for point in touched {
                    let gradient = &gradient[*point as usize * features..][..features];
                    let start = *point as usize * codes;
                    let row = &scores[start..start + codes];
                    softmax_backward(row, &self.codes, gradient, at.temperature, &mut to_scores, &mut to_codes);
                    adam.step(start, scores, &to_scores, at.rate, at.step);
                    self.indices[*point as usize] = highest(&scores[start..start + codes]) as u32;
                }
                to_codes
            }
        }
    }

    /// Moves the codes against their derivatives.
    pub fn step_codes(&mut self, to_codes: &[f32], at: TableStep) {
        self.adam.step(0, &mut self.codes, to_codes, at.rate, at.step);
    }

    /// Gives points the features of their codes after these moved, and every few steps some points the codes that are now the nearest.
    pub fn settle(&mut self, at: TableStep) {
        match &self.quantiser {
            Quantiser::Free => return self.assign(),
            Quantiser::Nearest { free, .. } if at.step.is_multiple_of(ASSIGN_INTERVAL) => {
                let turn = (at.step / ASSIGN_INTERVAL) as usize % self.indices.len().div_ceil(ASSIGNED_TOGETHER);
                let start = turn * ASSIGNED_TOGETHER;
                let end = self.indices.len().min(start + ASSIGNED_TOGETHER);
                let free = &free[start * self.features..end * self.features];
                self.indices[start..end].copy_from_slice(&nearest(&self.codes, self.features, free));
            }
            Quantiser::Nearest { .. } | Quantiser::Softmax { .. } => {}
        }
        self.look_up();
    }

    /// After the last step: gives all points the codes that are now the nearest, where [`Table::settle`] has them wait for their turn.
    pub fn finish(&mut self) {
        if self.nearest_codes().is_some() && self.indices.len() > ASSIGNED_TOGETHER {
            self.assign();
        }
    }
}

/// `codes` centres of `points`, of so many features each: fewer where there are fewer points.
pub fn k_means(points: &[f32], features: usize, codes: usize, random: &mut Random) -> Vec<f32> {
    let count = points.len() / features;
    let codes = codes.min(count);
    let row = |point: usize| &points[point * features..][..features];
    let chosen = random.permutation(count);
    let mut centers: Vec<f32> = chosen[..codes].iter().flat_map(|i| row(*i as usize)).copied().collect();
    for _ in 0..K_MEANS_ROUNDS {
        let mut sums = vec![0.0; codes * features];
        let mut counts = vec![0.0f32; codes];
        for (code, point) in nearest(&centers, features, points).into_iter().zip(points.chunks_exact(features)) {
            let code = code as usize;
            counts[code] += 1.0;
            sums[code * features..][..features].iter_mut().zip(point).for_each(|(sum, value)| *sum += value);
        }
        for (code, count_here) in counts.iter().enumerate() {
            let center = &mut centers[code * features..][..features];
            if *count_here > 0.0 {
                center.iter_mut().zip(&sums[code * features..]).for_each(|(center, sum)| *center = sum / count_here);
            } else {
                // A code that nothing is near to moves to some point.
                center.copy_from_slice(row(random.below(count)));
            }
        }
    }
    centers
}

const K_MEANS_ROUNDS: usize = 20;

/// Steps between two searches for the nearest codes.
const ASSIGN_INTERVAL: u32 = 10;

/// Points that one is made for. The texels of a large texture take turns: all at once would take many times as long as the steps between.
const ASSIGNED_TOGETHER: usize = 1 << 13;

fn small(count: usize, random: &mut Random) -> Vec<f32> {
    (0..count).map(|_| 0.5 * (2.0 * random.next_f32() - 1.0)).collect()
}

/// Adds the derivatives of strength · |free − code|² / 2 by `free`.
fn add_commitment(strength: f32, free: &[f32], code: &[f32], to: &mut [f32]) {
    for ((to, free), code) in to.iter_mut().zip(free).zip(code) {
        *to += strength * (free - code);
    }
}

/// Derivatives of a loss through softmax(scores / τ) · codes: by the scores (set) and by the codes (added to), given those
/// by the product.
fn softmax_backward(
    scores: &[f32],
    codes: &[f32],
    gradient: &[f32],
    temperature: f32,
    to_scores: &mut [f32],
    to_codes: &mut [f32],
) {
    let features = gradient.len();
    let most = scores.iter().copied().fold(f32::MIN, f32::max);
    let mut sum = 0.0;
    for (share, score) in to_scores.iter_mut().zip(scores) {
        *share = ((score - most) / temperature).exp();
        sum += *share;
    }
    let mut mean = 0.0;
    let products: Vec<f32> = codes.chunks_exact(features).map(|code| dot(code, gradient)).collect();
    for ((share, product), to_code) in to_scores.iter_mut().zip(&products).zip(to_codes.chunks_exact_mut(features)) {
        *share /= sum;
        mean += *share * product;
        to_code.iter_mut().zip(gradient).for_each(|(to, gradient)| *to += *share * gradient);
    }
    for (share, product) in to_scores.iter_mut().zip(&products) {
        *share *= (product - mean) / temperature;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f64 = 1e-6;

    fn numbers(count: usize, random: &mut Random) -> Vec<f32> {
        (0..count).map(|_| 2.0 * random.next_f32() - 1.0).collect()
    }

    fn wide(numbers: &[f32]) -> Vec<f64> {
        numbers.iter().map(|x| f64::from(*x)).collect()
    }

    /// Holds `found` to central differences of `loss` at `values`.
    fn check(values: &[f32], found: &[f32], loss: impl Fn(&[f64]) -> f64) {
        for (index, found) in found.iter().enumerate() {
            let at = |step: f64| {
                let mut moved = wide(values);
                moved[index] += step;
                loss(&moved)
            };
            let expected = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            assert!((f64::from(*found) - expected).abs() < 1e-5, "{index}: {found} {expected}");
        }
    }

    #[test]
    fn softmax_gradients_are_finite_differences() {
        let mut random = Random::new(1, 0);
        let (codes_count, features) = (9, 5);
        let (scores, codes) = (numbers(codes_count, &mut random), numbers(codes_count * features, &mut random));
        let gradient = numbers(features, &mut random);
        for temperature in [1.0, 0.5] {
            let loss = |scores: &[f64], codes: &[f64]| -> f64 {
                let shares: Vec<f64> = scores.iter().map(|score| (score / f64::from(temperature)).exp()).collect();
                let sum: f64 = shares.iter().sum();
                let dot = |code: &[f64]| code.iter().zip(&gradient).map(|(c, g)| c * f64::from(*g)).sum::<f64>();
                shares.iter().zip(codes.chunks_exact(features)).map(|(share, code)| share / sum * dot(code)).sum()
            };
            let (mut to_scores, mut to_codes) = (vec![0.0; codes_count], vec![0.0; codes.len()]);
            softmax_backward(&scores, &codes, &gradient, temperature, &mut to_scores, &mut to_codes);
            check(&scores, &to_scores, |scores| loss(scores, &wide(&codes)));
            check(&codes, &to_codes, |codes| loss(&wide(&scores), codes));
        }
    }

    /// What a point starts from does not hang on which others are kept.
    #[test]
    fn points_that_are_kept_start_as_they_would_among_all() {
        let random = || Random::new(6, 0);
        for all in [Table::free(30, 4, &mut random()), Table::softmax(30, 4, 9, &mut random())] {
            let kept = [0, 3, 17, 29];
            let some = all.clone().of_points(&kept);
            assert_eq!(some.point_count(), kept.len());
            for (row, point) in some.rows.chunks_exact(4).zip(kept) {
                assert_eq!(row, &all.rows[point as usize * 4..][..4]);
            }
            let mut again = some.clone();
            again.assign();
            assert_eq!(again, some);
        }
    }

    #[test]
    fn the_commitment_is_the_gradient_of_a_squared_distance() {
        let mut random = Random::new(2, 0);
        let (free, code) = (numbers(7, &mut random), numbers(7, &mut random));
        let mut to = vec![0.0; 7];
        add_commitment(0.3, &free, &code, &mut to);
        check(&free, &to, |free| {
            0.15f32 as f64 * free.iter().zip(&code).map(|(a, b)| (a - f64::from(*b)).powi(2)).sum::<f64>()
        });
    }

    /// One step against a gradient on one point: its code and its own features move, others' do not.
    #[test]
    fn a_step_moves_what_was_touched() {
        let mut random = Random::new(4, 0);
        let (points, features) = (40, 4);
        let mut table = Table::free(points, features, &mut random);
        table.quantise(8, &vec![true; points], &mut random);
        let before = table.clone();
        let mut gradient = vec![0.0; points * features];
        gradient[5 * features] = 1.0;
        table.step(&gradient, &[5], TableStep { step: 1, rate: 0.01, temperature: 1.0 });
        let code = before.indices[5] as usize;
        for (index, (a, b)) in before.codes.iter().zip(&table.codes).enumerate() {
            let expected = if index == code * features { -0.01 } else { 0.0 };
            assert!((b - a - expected).abs() < 1e-6, "code number {index}");
        }
        assert!(
            table
                .codes
                .chunks_exact(features)
                .nth(code)
                .is_some_and(|code| code == &table.rows[5 * features..][..features])
        );
    }

    /// In a few turns, or at the end, all points of a large table find the codes that have become the nearest.
    #[test]
    fn points_take_turns_until_all_have_their_nearest_codes() {
        let mut random = Random::new(7, 0);
        let points = 2 * ASSIGNED_TOGETHER + 5;
        let mut table = Table::free(points, 2, &mut random);
        table.quantise(4, &vec![true; points], &mut random);
        table.codes.iter_mut().for_each(|x| *x = -*x);
        let mut nearest = table.clone();
        nearest.assign();
        let mut finished = table.clone();
        finished.finish();
        let settle = |table: &mut Table, steps: std::ops::RangeInclusive<u32>| {
            steps.for_each(|step| table.settle(TableStep { step, rate: 0.0, temperature: 1.0 }));
        };
        settle(&mut table, 1..=2 * ASSIGN_INTERVAL);
        assert!(table != nearest && finished == nearest);
        settle(&mut table, 2 * ASSIGN_INTERVAL + 1..=3 * ASSIGN_INTERVAL);
        assert!(table == nearest);
    }

    #[test]
    fn k_means_finds_clusters_and_each_point_its_nearest_code() {
        let mut random = Random::new(5, 0);
        let features = 3;
        let mut table = Table::free(90, features, &mut random);
        for (point, row) in table.rows.chunks_exact_mut(features).enumerate() {
            row.iter_mut().for_each(|x| *x = (point % 3) as f32 * 10.0 + 0.01 * *x);
        }
        table.quantise(12, &[true; 90], &mut random);
        for (point, row) in table.rows.chunks_exact(features).enumerate() {
            assert!(row.iter().all(|x| (x - (point % 3) as f32 * 10.0).abs() < 0.02), "{point}: {row:?}");
        }
    }
}
