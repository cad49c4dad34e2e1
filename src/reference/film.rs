//! What is summed over a pixel's samples, and the picture made of it.

use std::collections::TryReserveError;

use glam::DVec3;

use crate::image::{Picture, Samples, plane};

/// Rays traced.
#[derive(Clone, Copy, Debug, Default)]
pub struct RayCount {
    /// For a closest hit.
    pub closest: u64,
    /// For visibility.
    pub shadow: u64,
}

/// One sample of a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    /// Radiance.
    pub radiance: DVec3,
    /// Colour of what is seen first; 0 for nothing.
    pub albedo: DVec3,
    /// Shading normal of what is seen first; 0 for nothing.
    pub normal: DVec3,
    /// What it took.
    pub rays: RayCount,
}

/// A pixel's running mean and sum of squared deviations (Welford 1962): exact for constant radiance.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSums {
    /// Number of samples.
    pub count: u32,
    mean: DVec3,
    deviation: DVec3,
    albedo: DVec3,
    normal: DVec3,
}

impl PixelSums {
    /// Takes a sample in.
    pub fn add(&mut self, sample: &Sample) {
        self.count += 1;
        let before = sample.radiance - self.mean;
        self.mean += before / f64::from(self.count);
        self.deviation += before * (sample.radiance - self.mean);
        self.albedo += sample.albedo;
        self.normal += sample.normal;
    }

    /// Of the mean; 0 where one sample does not tell.
    fn variance(&self) -> DVec3 {
        let count = f64::from(self.count);
        if self.count < 2 { DVec3::ZERO } else { self.deviation / (count - 1.0) / count }
    }
}

/// What a pixel takes: its sums, and about as much of the picture that is made of them.
pub const BYTES_A_PIXEL: u64 = 2 * size_of::<PixelSums>() as u64;

/// Sums of so many pixels, none of which has a sample.
///
/// # Errors
/// There is no memory for them and the picture.
pub fn sums(pixels: usize) -> Result<Vec<PixelSums>, TryReserveError> {
    let mut sums = Vec::new();
    // Room for the picture is asked for here and given back: when it is made would be late.
    sums.try_reserve_exact(2 * pixels)?;
    sums.resize(pixels, PixelSums::default());
    sums.shrink_to_fit();
    Ok(sums)
}

/// Beauty, variance, sample counts, albedo and normals.
pub fn picture(width: u32, height: u32, sums: &[PixelSums]) -> Picture {
    let mut picture = Picture::new(width, height);
    let mut set = |names, value: &dyn Fn(&PixelSums) -> DVec3| {
        let pixels: Vec<[f32; 3]> = sums.iter().map(|pixel| value(pixel).as_vec3().to_array()).collect();
        picture.set_rgb(names, &pixels);
    };
    let count = |pixel: &PixelSums| f64::from(pixel.count.max(1));
    set(plane::BEAUTY, &|pixel| pixel.mean);
    set(plane::VARIANCE, &PixelSums::variance);
    set(plane::ALBEDO, &|pixel| pixel.albedo / count(pixel));
    set(plane::NORMAL, &|pixel| pixel.normal / count(pixel));
    picture.set(plane::SAMPLES, Samples::U32(sums.iter().map(|pixel| pixel.count).collect()));
    picture
}
