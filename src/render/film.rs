//! The film on the host: from sums to a picture.

use bytemuck::{Pod, Zeroable};

use crate::image::{Picture, Samples, plane};

/// Sums over a pixel's samples, each with the rounding error that its additions have lost: the value is their sum.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct FilmPixel {
    /// Σ radiance.
    pub sum: [f32; 3],
    /// What `sum` lacks.
    pub sum_error: [f32; 3],
    /// Σ radiance².
    pub square: [f32; 3],
    /// What `square` lacks.
    pub square_error: [f32; 3],
}

/// What a pixel sees first: means over its samples, and depth and ids of one ray through its centre.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct FeaturePixel {
    /// Mean colour of the material, 0 where nothing was hit.
    pub albedo: [f32; 3],
    /// Mean shading normal, world space, facing the viewer, 0 where nothing was hit.
    pub normal: [f32; 3],
    /// Distance along the camera's axis; infinite where nothing was hit.
    pub depth: f32,
    /// [`plane::NO_ID`] where nothing was hit, here and below.
    pub instance: u32,
    /// Triangle of its mesh.
    pub triangle: u32,
    /// Index into the scene's materials.
    pub material: u32,
}

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
