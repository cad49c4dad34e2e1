//! Features over a hemisphere while they are learned, and the ways in which grid points come by them.

use super::adam::Adam;
use super::random::Random;
use super::vector::{dot, nearest};

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

/// The features of a hemisphere's grid points.
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

    /// How many points there are.
    pub fn point_count(&self) -> usize {
        self.indices.len()
    }

    /// From features of their own to a codebook of `codes` codes, found by k-means over the points that `is_used` tells.
    pub fn quantise(&mut self, codes: usize, is_used: &[bool], random: &mut Random) {
        let used: Vec<u32> = (0..self.point_count() as u32).filter(|point| is_used[*point as usize]).collect();
        if used.len() <= codes {
            return;
        }
        let features = self.features;
        let chosen = random.permutation(used.len());
        let free = self.rows.clone();
        let row = |point: u32| &free[point as usize * features..][..features];
        self.codes = chosen[..codes].iter().flat_map(|i| row(used[*i as usize]).to_vec()).collect();
        for _ in 0..K_MEANS_ROUNDS {
            let mut sums = vec![0.0; codes * features];
            let mut counts = vec![0.0f32; codes];
            for point in &used {
                let code = nearest(&self.codes, features, row(*point));
                counts[code] += 1.0;
                sums[code * features..][..features].iter_mut().zip(row(*point)).for_each(|(sum, value)| *sum += value);
            }
            for (code, count) in counts.iter().enumerate() {
                let center = &mut self.codes[code * features..][..features];
                if *count > 0.0 {
                    center.iter_mut().zip(&sums[code * features..]).for_each(|(center, sum)| *center = sum / count);
                } else {
                    // A code that nothing is near to moves to some point.
                    center.copy_from_slice(row(used[random.below(used.len())]));
                }
            }
        }
        let codes_found = std::mem::take(&mut self.codes);
        self.start_nearest(codes);
        self.codes = codes_found;
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
                for (index, free) in self.indices.iter_mut().zip(free.chunks_exact(self.features)) {
                    *index = nearest(&self.codes, self.features, free) as u32;
                }
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
        let features = self.features;
        match &mut self.quantiser {
            Quantiser::Free => {
                self.adam.step(0, &mut self.codes, gradient, at.rate, at.step);
                self.rows.copy_from_slice(&self.codes);
            }
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
                    for ((to, free), code) in
                        to_free[start..start + features].iter_mut().zip(&free[start..]).zip(&self.codes[code..])
                    {
                        *to += strength * (free - code);
                    }
                }
                self.adam.step(0, &mut self.codes, &to_codes, at.rate, at.step);
                adam.step(0, free, &to_free, at.rate, at.step);
                if at.step.is_multiple_of(ASSIGN_INTERVAL) {
                    self.assign();
                } else {
                    self.look_up();
                }
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
                self.adam.step(0, &mut self.codes, &to_codes, at.rate, at.step);
                self.look_up();
            }
        }
    }
}

const K_MEANS_ROUNDS: usize = 20;

/// Steps between two searches for the nearest codes.
const ASSIGN_INTERVAL: u32 = 10;

fn small(count: usize, random: &mut Random) -> Vec<f32> {
    (0..count).map(|_| 0.5 * (2.0 * random.next_f32() - 1.0)).collect()
}

fn highest(scores: &[f32]) -> usize {
    let mut best = 0;
    for (code, score) in scores.iter().enumerate() {
        if *score > scores[best] {
            best = code;
        }
    }
    best
}

/// Derivatives of a loss through softmax(scores / τ) · codes: by the scores (set) and by the codes (added to), given those
/// by the product.
pub fn softmax_backward(
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
    for ((share, product), to_code) in
        to_scores.iter_mut().zip(&products).zip(to_codes.chunks_exact_mut(features))
    {
        *share /= sum;
        mean += *share * product;
        to_code.iter_mut().zip(gradient).for_each(|(to, gradient)| *to += *share * gradient);
    }
    for (share, product) in to_scores.iter_mut().zip(&products) {
        *share *= (product - mean) / temperature;
    }
}
