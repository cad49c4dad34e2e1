//! The film on the host: from sums to a picture.

use super::layout::{FeaturePixel, FilmPixel};
use crate::image::{Picture, Samples, plane};

impl FilmPixel {
    /// The pixel's value, and the variance of that value, from `samples` samples (≥ 1).
    pub fn mean_and_variance(&self, samples: u32) -> ([f32; 3], [f32; 3]) {
        let count = f64::from(samples);
        let mut mean = [0.0; 3];
        let mut variance = [0.0; 3];
        for channel in 0..3 {
            let average = (f64::from(self.sum[channel]) + f64::from(self.sum_error[channel])) / count;
            let square = (f64::from(self.square[channel]) + f64::from(self.square_error[channel])) / count;
            mean[channel] = average as f32;
            variance[channel] = ((square - average * average).max(0.0) / (count - 1.0).max(1.0)) as f32;
        }
        (mean, variance)
    }
}

/// The picture of a film after `samples` samples a pixel; 0 samples are a black picture.
pub fn picture(width: u32, height: u32, samples: u32, pixels: &[FilmPixel], features: &[FeaturePixel]) -> Picture {
    let mut picture = Picture::new(width, height);
    let resolved: Vec<_> = pixels.iter().map(|pixel| pixel.mean_and_variance(samples.max(1))).collect();
    picture.set_rgb(plane::BEAUTY, &resolved.iter().map(|(mean, _)| *mean).collect::<Vec<_>>());
    picture.set_rgb(plane::VARIANCE, &resolved.iter().map(|(_, variance)| *variance).collect::<Vec<_>>());
    picture.set(plane::SAMPLES, Samples::U32(vec![samples; pixels.len()]));
    if !features.is_empty() {
        let plane_of = |value: fn(&FeaturePixel) -> u32| Samples::U32(features.iter().map(value).collect());
        picture.set_rgb(plane::ALBEDO, &features.iter().map(|pixel| pixel.albedo).collect::<Vec<_>>());
        picture.set_rgb(plane::NORMAL, &features.iter().map(|pixel| pixel.normal).collect::<Vec<_>>());
        picture.set(plane::DEPTH, Samples::F32(features.iter().map(|pixel| pixel.depth).collect()));
        picture.set(plane::INSTANCE_ID, plane_of(|pixel| pixel.instance));
        picture.set(plane::PRIMITIVE_ID, plane_of(|pixel| pixel.triangle));
        picture.set(plane::MATERIAL_ID, plane_of(|pixel| pixel.material));
    }
    picture
}
