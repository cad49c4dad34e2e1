//! The film: sums on the device, and on the host how a picture comes of them.

use std::sync::Arc;

use super::error::Error;
use super::layout::{CameraRecord, FeaturePixel, FilmPixel, FilmTable};
use super::settings::Settings;
use crate::gpu::{Buffer, Commands, Upload};
use crate::image::{Crop, Picture, Samples, plane};
use crate::scene::Scene;

/// The film on the device, with the camera that looks through it.
pub struct Film {
    crop: Crop,
    table: Arc<Buffer>,
    camera: Arc<Buffer>,
    pixels: Arc<Buffer>,
    feature_pixels: Option<Arc<Buffer>>,
    rejected: Arc<Buffer>,
}

impl Film {
    /// A black film for a part of the scene's picture. `by_slot` is [`super::pool::Pool::by_slot`].
    pub fn new(
        upload: &mut Upload,
        scene: &Scene,
        crop: Crop,
        settings: &Settings,
        [first_albedo, first_normal, reuse]: [u64; 3],
    ) -> Result<Film, Error> {
        let bytes = |size: usize| crop.pixel_count() * size as u64;
        let pixels = upload.zeroed("film", bytes(size_of::<FilmPixel>()))?;
        let feature_pixels = match settings.features {
            true => Some(upload.zeroed("feature film", bytes(size_of::<FeaturePixel>()))?),
            false => None,
        };
        let rejected = upload.zeroed("rejected samples", 4)?;
        let camera = upload.buffer("camera", &[CameraRecord::new(scene)])?;
        let table = FilmTable {
            camera: camera.address(),
            pixels: pixels.address(),
            features: feature_pixels.as_ref().map_or(0, |buffer| buffer.address()),
            rejected: rejected.address(),
            crop_origin: [crop.x, crop.y],
            crop_size: [crop.width, crop.height],
            first_albedo,
            first_normal,
            reuse,
            seed: settings.seed,
            padding: 0,
        };
        let table = upload.buffer("film table", &[table])?;
        Ok(Film { crop, table, camera, pixels, feature_pixels, rejected })
    }

    /// The part of the scene's picture that it is.
    pub fn crop(&self) -> Crop {
        self.crop
    }

    /// Its pixels.
    pub fn pixel_count(&self) -> u64 {
        self.crop.pixel_count()
    }

    /// Bytes on the device that hold the picture.
    pub fn bytes(&self) -> u64 {
        self.pixels.size() + self.feature_pixels.as_ref().map_or(0, |buffer| buffer.size())
    }

    /// [`FilmTable`]
    pub fn table(&self) -> &Buffer {
        &self.table
    }

    /// [`CameraRecord`]
    pub fn camera(&self) -> &Arc<Buffer> {
        &self.camera
    }

    /// A [`FilmPixel`] each.
    pub fn pixels(&self) -> &Buffer {
        &self.pixels
    }

    /// A [`FeaturePixel`] each, if they are gathered.
    pub fn feature_pixels(&self) -> Option<&Buffer> {
        self.feature_pixels.as_deref()
    }

    /// One `u32`: samples that were not finite.
    pub fn rejected(&self) -> &Buffer {
        &self.rejected
    }

    /// The feature pixels on the host; none where they are not gathered.
    pub fn read_features(&self) -> Result<Vec<FeaturePixel>, Error> {
        self.feature_pixels.as_ref().map_or(Ok(Vec::new()), |buffer| Ok(buffer.read()?))
    }

    /// Another seed; waits until it is there.
    pub fn set_seed(&self, seed: u32) -> Result<(), Error> {
        Ok(self.table.write(std::mem::offset_of!(FilmTable, seed) as u64, &[seed])?)
    }

    /// Puts back what was read; waits until it is there.
    pub fn restore(&self, pixels: &[FilmPixel], features: &[FeaturePixel], rejected: u32) -> Result<(), Error> {
        self.pixels.write(0, pixels)?;
        self.rejected.write(0, &[rejected])?;
        if let Some(buffer) = &self.feature_pixels {
            buffer.write(0, features)?;
        }
        Ok(())
    }

    /// Makes it black again. What used it before must be done.
    pub fn record_clear(&self, commands: &mut Commands) {
        for buffer in [Some(&self.pixels), Some(&self.rejected), self.feature_pixels.as_ref()].into_iter().flatten() {
            commands.fill(buffer, 0..buffer.size(), 0);
        }
        commands.barrier();
    }
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
