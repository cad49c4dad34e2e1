//! How far a picture is from its reference.

use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8, FlipPool};
use serde::Serialize;

use super::Error;
use crate::image::{Picture, plane, tone_map};

/// Differences between the beauty planes of a picture (x) and a reference (r), over all pixels and channels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// mean((x − r)²).
    pub mse: f64,
    /// mean((x − r)² / (r² + 0.01)).
    pub rel_mse: f64,
    /// Mean ꟻLIP error in [0, 1] (Andersson et al. 2020, LDR, 67 pixels a degree) of the two pictures after
    /// [`tone_map`] at `flip_exposure`.
    pub flip: f64,
    /// The exposure that ꟻLIP saw the pictures at, stops.
    pub flip_exposure: f32,
    /// max |x − r|.
    pub max_difference: f64,
    /// mean(|x − r|).
    pub mean_difference: f64,
    /// mean(x − r) of each channel.
    pub bias: [f64; 3],
    /// mean(x − r) / mean(r) over all channels; 0 where both are black.
    pub relative_bias: f64,
    /// Number of pixels that are NaN or infinite in either picture; the other figures are then NaN or infinite too.
    pub non_finite_pixels: usize,
}

impl Metrics {
    /// Compares two pictures of one size, with beauty planes both. `flip_exposure` in stops.
    pub fn of(image: &Picture, reference: &Picture, flip_exposure: f32) -> Result<Metrics, Error> {
        let [beauty, truth] = beauties(image, reference)?;
        let count = (beauty.len() * 3) as f64;
        let mut metrics = Metrics {
            mse: 0.0,
            rel_mse: 0.0,
            flip: flip(image.width, image.height, &beauty, &truth, flip_exposure),
            flip_exposure,
            max_difference: 0.0,
            mean_difference: 0.0,
            bias: [0.0; 3],
            relative_bias: 0.0,
            non_finite_pixels: 0,
        };
        let mut reference_sum = 0.0;
        for (pixel, truth) in beauty.iter().zip(&truth) {
            metrics.non_finite_pixels += usize::from(pixel.iter().chain(truth).any(|value| !value.is_finite()));
            for channel in 0..3 {
                let reference = f64::from(truth[channel]);
                let difference = f64::from(pixel[channel]) - reference;
                metrics.mse += difference.powi(2) / count;
                metrics.rel_mse += difference.powi(2) / (reference.powi(2) + 0.01) / count;
                metrics.mean_difference += difference.abs() / count;
                metrics.bias[channel] += difference / (count / 3.0);
                // Not `max`, which would lose a NaN.
                if difference.abs() > metrics.max_difference || difference.is_nan() {
                    metrics.max_difference = difference.abs();
                }
                reference_sum += reference;
            }
        }
        let bias: f64 = metrics.bias.iter().sum();
        metrics.relative_bias = if bias == 0.0 { 0.0 } else { bias / (reference_sum / (count / 3.0)) };
        Ok(metrics)
    }
}

/// The beauty planes of both, which must have one size and at least one pixel.
pub(super) fn beauties(image: &Picture, reference: &Picture) -> Result<[Vec<[f32; 3]>; 2], Error> {
    if (image.width, image.height) != (reference.width, reference.height) {
        return Err(Error::SizeMismatch {
            image: [image.width, image.height],
            reference: [reference.width, reference.height],
        });
    }
    if image.pixels() == 0 {
        return Err(Error::Empty);
    }
    let beauty = |picture: &Picture, which| {
        picture.rgb(plane::BEAUTY).ok_or_else(|| missing(picture, which, &plane::BEAUTY.join(", ")))
    };
    Ok([beauty(image, "picture")?, beauty(reference, "reference")?])
}

pub(super) fn missing(picture: &Picture, which: &'static str, names: &str) -> Error {
    let found = picture.names().collect::<Vec<_>>().join(", ");
    Error::MissingPlane { which, missing: names.to_owned(), found }
}

fn flip(width: u32, height: u32, beauty: &[[f32; 3]], truth: &[[f32; 3]], exposure: f32) -> f64 {
    let image = FlipImageRgb8::with_data(width, height, &tone_map::to_srgb8(beauty, exposure));
    let reference = FlipImageRgb8::with_data(width, height, &tone_map::to_srgb8(truth, exposure));
    let error = nv_flip::flip(reference, image, DEFAULT_PIXELS_PER_DEGREE);
    f64::from(FlipPool::from_image(&error).mean())
}
