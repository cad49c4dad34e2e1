//! Do two noisy pictures have the same expectation?
//!
//! **Blocks.** Path-traced radiance has a heavy right tail: at low sample counts the mean of one pixel is not normal,
//! and its variance is underestimated just when the mean is (a rare bright path is missing from both). So pixels are
//! summed over small blocks, whose sums are much closer to normal, and each block and channel is one test:
//! z = Σ(a − b) / √V. The p-values are corrected for their number by Šidák's formula.
//!
//! **Variance.** V is the larger of two estimates. Welch's, Σ(v_a + v_b), trusts either picture's own variance. The pooled
//! one, Σ s²·(1/n_a + 1/n_b) with s² the variance of a sample over both pictures, is right where both renderers have the
//! same noise; it saves the picture with fewer samples from being blamed for a rare bright path that only the longer render
//! could find. Taking the larger errs towards acceptance, as does stratified sampling, which is better than its
//! sample variance tells.
//!
//! **Shared paths.** Where pixels of a picture share paths ([`Picture::paths_shared_by`]), the variance of a sum of pixels is up to so many
//! times the sum of their variances; that much is taken.
//!
//! **Rounding.** Pixels without variance (a furnace, a lamp seen directly) must agree as floats do: V has a floor of
//! (tolerance · (block's level + picture's level))².
//!
//! **Mean.** One more test, of the sums over the whole picture, finds a small bias spread everywhere.

use serde::Serialize;

use super::metrics::{beauties, missing};
use super::{Error, sidak, two_sided_p};
use crate::image::{Picture, Samples, plane};

/// How to test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZTestOptions {
    /// Side of a block, pixels, ≥ 1. Larger is more sensitive to small bias, smaller shows better where it is.
    pub block: u32,
    /// Relative error that rounding may cause.
    pub tolerance: f64,
}

/// A block whose sum has this relative variance, that of 50 equal contributions, is near enough to normal.
const LARGEST_RELATIVE_VARIANCE: f64 = 0.02;

impl ZTestOptions {
    /// The smallest blocks of 4, 8, 16, … pixels whose sums are near enough to normal: where contributions are rare and large, as without
    /// light sampling, many pixels are needed. A block's variance is predicted from its level in the reference and the variance per
    /// level of the whole picture: its own would be too small just where contributions are missing.
    pub fn for_noise(image: &Picture, reference: &Picture) -> Result<ZTestOptions, Error> {
        let mut options = ZTestOptions::default();
        let [image_mean, reference_mean] = beauties(image, reference)?;
        let a = Estimate::new(image, image_mean, "picture")?;
        let b = Estimate::new(reference, reference_mean, "reference")?;
        let total = |plane: &[[f32; 3]]| plane.as_flattened().iter().map(|value| f64::from(*value)).sum::<f64>();
        let level = total(&b.mean);
        let per_level = (a.shared_by * total(&a.variance) + b.shared_by * total(&b.variance)) / level;
        let longest = image.width.max(image.height);
        while options.block < longest {
            let side = options.block;
            let columns = image.width.div_ceil(side) as usize;
            let mut levels = vec![0.0; columns * image.height.div_ceil(side) as usize];
            for (pixel, value) in b.mean.iter().enumerate() {
                let (x, y) = (pixel % image.width as usize, pixel / image.width as usize);
                levels[y / side as usize * columns + x / side as usize] += total(&[*value]);
            }
            let average = level / levels.len() as f64;
            // A hundredth of the average keeps black blocks, which say nothing, out of the mean.
            let relative: f64 = levels.iter().map(|level| per_level / (level + 0.01 * average)).sum();
            // Three channels are one block here, and three tests there.
            if relative.is_nan() || 3.0 * relative / levels.len() as f64 <= LARGEST_RELATIVE_VARIANCE {
                break;
            }
            options.block *= 2;
        }
        Ok(options)
    }
}

impl Default for ZTestOptions {
    fn default() -> ZTestOptions {
        ZTestOptions { block: 4, tolerance: 1e-5 }
    }
}

/// The outcome: probabilities of a difference at least as large, if both pictures had the same expectation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ZTest {
    /// Of the whole: [`sidak`] of the two below.
    pub p: f64,
    /// Of the most different block and channel, corrected for their number.
    pub p_blocks: f64,
    /// Of the picture's mean in the most different channel, corrected for three.
    pub p_mean: f64,
    /// z of the picture's mean, each channel.
    pub z_mean: [f64; 3],
    /// z of the most different block.
    pub worst_z: f64,
    /// Its upper left pixel.
    pub worst_pixel: [u32; 2],
    /// Its channel.
    pub worst_channel: usize,
    /// Root mean square of all z: 1 where the variances are honest, below where they are overestimated.
    pub z_rms: f64,
    /// Number of blocks times channels.
    pub tests: usize,
    /// Side of a block, pixels.
    pub block: u32,
    /// Pixels left out since one of the pictures has no sample there.
    pub skipped_pixels: usize,
    /// z of every block, row by row, ⌈width/block⌉ a row.
    #[serde(skip)]
    pub z: Vec<[f64; 3]>,
}

/// Sums over some pixels.
#[derive(Clone, Copy, Default)]
struct Sums {
    pixels: f64,
    difference: [f64; 3],
    level: [f64; 3],
    welch: [f64; 3],
    pooled: [f64; 3],
}

impl Sums {
    fn add(&mut self, other: &Sums) {
        self.pixels += other.pixels;
        for channel in 0..3 {
            self.difference[channel] += other.difference[channel];
            self.level[channel] += other.level[channel];
            self.welch[channel] += other.welch[channel];
            self.pooled[channel] += other.pooled[channel];
        }
    }

    /// `level` is the whole picture's, a pixel.
    fn z(&self, level: [f64; 3], tolerance: f64) -> [f64; 3] {
        std::array::from_fn(|channel| {
            let difference = self.difference[channel];
            let rounding = tolerance * (self.level[channel] + level[channel] * self.pixels);
            let variance = self.welch[channel].max(self.pooled[channel]) + rounding.powi(2);
            if difference == 0.0 { 0.0 } else { difference / variance.sqrt() }
        })
    }
}

/// The planes that a test needs of one picture.
struct Estimate<'a> {
    mean: Vec<[f32; 3]>,
    variance: Vec<[f32; 3]>,
    samples: &'a [u32],
    shared_by: f64,
}

impl ZTest {
    /// [`ZTest::of`] by the blocks of [`ZTestOptions::for_noise`].
    pub fn for_noise(image: &Picture, reference: &Picture) -> Result<ZTest, Error> {
        ZTest::of(image, reference, ZTestOptions::for_noise(image, reference)?)
    }

    /// Tests two pictures of one size, both with beauty, variance and sample counts.
    pub fn of(image: &Picture, reference: &Picture, options: ZTestOptions) -> Result<ZTest, Error> {
        let [image_mean, reference_mean] = beauties(image, reference)?;
        let a = Estimate::new(image, image_mean, "picture")?;
        let b = Estimate::new(reference, reference_mean, "reference")?;

        let side = options.block.max(1);
        let (columns, rows) = (image.width.div_ceil(side), image.height.div_ceil(side));
        let mut blocks = vec![Sums::default(); columns as usize * rows as usize];
        let mut skipped_pixels = 0;
        for y in 0..image.height {
            for x in 0..image.width {
                let pixel = y as usize * image.width as usize + x as usize;
                if a.samples[pixel] == 0 || b.samples[pixel] == 0 {
                    skipped_pixels += 1;
                    continue;
                }
                let sums = pixel_sums(&a, &b, pixel).ok_or(Error::TooFewSamples { pixel: [x, y] })?;
                blocks[(y / side) as usize * columns as usize + (x / side) as usize].add(&sums);
            }
        }
        let mut whole = Sums::default();
        blocks.iter().for_each(|block| whole.add(block));
        let level = whole.level.map(|level| level / whole.pixels.max(1.0));

        let z: Vec<[f64; 3]> = blocks.iter().map(|block| block.z(level, options.tolerance)).collect();
        // The whole's own level is already in `rounding`.
        let z_mean = whole.z([0.0; 3], options.tolerance);

        let tests = z.len() * 3;
        let severity = |z: f64| if z.is_nan() { f64::INFINITY } else { z.abs() };
        let (worst, worst_z) =
            z.iter().flatten().copied().enumerate().fold((0, 0.0), |worst: (usize, f64), (i, z)| {
                if severity(z) > severity(worst.1) { (i, z) } else { worst }
            });
        let worst_block = (worst / 3) as u32;
        let p_blocks = sidak(two_sided_p(worst_z), tests);
        let p_mean = sidak(z_mean.map(two_sided_p).into_iter().fold(1.0, f64::min), 3);
        Ok(ZTest {
            p: sidak(p_blocks.min(p_mean), 2),
            p_blocks,
            p_mean,
            z_mean,
            worst_z,
            worst_pixel: [worst_block % columns * side, worst_block / columns * side],
            worst_channel: worst % 3,
            z_rms: (z.iter().flatten().map(|z| z * z).sum::<f64>() / tests as f64).sqrt(),
            tests,
            block: side,
            skipped_pixels,
            z,
        })
    }

    /// Whether the pictures differ beyond chance, where an equal pair is wrongly called different with probability
    /// `significance`.
    pub fn rejects(&self, significance: f64) -> bool {
        self.p < significance || self.p.is_nan()
    }

    /// The p-value (`p.R`, `p.G`, `p.B`, uncorrected) and z (`z.R`, …) of each block, as planes of the tested size.
    pub fn p_values(&self, width: u32, height: u32) -> Picture {
        let columns = width.div_ceil(self.block) as usize;
        let mut picture = Picture::new(width, height);
        for (channel, name) in ["R", "G", "B"].into_iter().enumerate() {
            let z: Vec<f64> = (0..picture.pixels())
                .map(|pixel| {
                    let (x, y) = (pixel as u32 % width, pixel as u32 / width);
                    self.z[(y / self.block) as usize * columns + (x / self.block) as usize][channel]
                })
                .collect();
            picture.set(format!("p.{name}"), Samples::F32(z.iter().map(|z| two_sided_p(*z) as f32).collect()));
            picture.set(format!("z.{name}"), Samples::F32(z.iter().map(|z| *z as f32).collect()));
        }
        picture
    }
}

impl<'a> Estimate<'a> {
    fn new(picture: &'a Picture, mean: Vec<[f32; 3]>, which: &'static str) -> Result<Estimate<'a>, Error> {
        let variance = picture
            .rgb(plane::VARIANCE)
            .ok_or_else(|| missing(picture, which, &format!("{}, which a z-test needs", plane::VARIANCE.join(", "))))?;
        let samples = picture
            .u32(plane::SAMPLES)
            .ok_or_else(|| missing(picture, which, &format!("{} (uint), which a z-test needs", plane::SAMPLES)))?;
        Ok(Estimate { mean, variance, samples, shared_by: picture.paths_shared_by.into() })
    }
}

/// The sums of one pixel; `None` where neither picture has a variance.
fn pixel_sums(a: &Estimate, b: &Estimate, pixel: usize) -> Option<Sums> {
    let [count_a, count_b] = [a.samples[pixel], b.samples[pixel]].map(f64::from);
    let freedom = count_a + count_b - 2.0;
    if freedom < 1.0 {
        return None;
    }
    let mut sums = Sums { pixels: 1.0, ..Sums::default() };
    for channel in 0..3 {
        let [mean_a, mean_b] = [a.mean[pixel][channel], b.mean[pixel][channel]].map(f64::from);
        let [variance_a, variance_b] = [a.variance[pixel][channel], b.variance[pixel][channel]].map(f64::from);
        sums.difference[channel] = mean_a - mean_b;
        sums.level[channel] = mean_a.abs().max(mean_b.abs());
        sums.welch[channel] = a.shared_by * variance_a + b.shared_by * variance_b;
        // Weights are degrees of freedom, so that a picture with one sample, whose variance is unknown, has none.
        let of_sample = ((count_a - 1.0) * count_a * variance_a + (count_b - 1.0) * count_b * variance_b) / freedom;
        sums.pooled[channel] = of_sample * (a.shared_by / count_a + b.shared_by / count_b);
    }
    Some(sums)
}
