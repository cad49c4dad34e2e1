//! Measurements over a texture, looked up: rough stand-ins for a ground truth that is not known, for reports to compare a fit with.

use glam::{DVec2, DVec3};

use super::Evaluate;
use crate::scene::brdf::{Footprint, SurfaceGrid, SurfaceSamples};
use crate::scene::{BtfPreview, Sparse, SparseSample};

/// Samples by texel, each texel interpolated for itself as [`Sparse`] is; one without samples is as all together.
#[derive(Debug)]
pub struct TexelSamples {
    size: [u32; 2],
    texels: Vec<Option<Sparse>>,
    all: Sparse,
}

impl TexelSamples {
    /// Sorts samples into texels.
    pub fn new(surface: &SurfaceSamples, grid: SurfaceGrid) -> TexelSamples {
        let size = grid.size(0);
        let mut texels: Vec<Vec<SparseSample>> = vec![Vec::new(); (size[0] * size[1]) as usize];
        for (uv, sample) in &surface.samples {
            texels[texel(uv.as_dvec2(), size)].push(*sample);
        }
        let sparse = |samples: Vec<SparseSample>| Sparse::new(samples, surface.is_isotropic);
        let all = evenly(&surface.samples).map(|(_, sample)| *sample).collect();
        TexelSamples {
            size,
            all: sparse(all),
            texels: texels
                .into_iter()
                .map(|samples| (!samples.is_empty()).then(|| sparse(evenly(&samples).copied().collect())))
                .collect(),
        }
    }
}

/// As many as [`Sparse`] may have.
fn evenly<T>(samples: &[T]) -> impl Iterator<Item = &T> {
    samples.iter().step_by(samples.len().div_ceil(Sparse::MOST_SAMPLES).max(1))
}

/// The texel that a place is in.
fn texel(uv: DVec2, [width, height]: [u32; 2]) -> usize {
    let wrapped = uv - uv.floor();
    let at = |share: f64, side: u32| ((share * f64::from(side)) as u32).min(side - 1);
    (at(1.0 - wrapped.y, height) * width + at(wrapped.x, width)) as usize
}

impl Evaluate for TexelSamples {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        self.all.eval(wo, wi)
    }

    fn eval_at(&self, footprint: Footprint, wo: DVec3, wi: DVec3) -> DVec3 {
        self.texels[texel(footprint.uv, self.size)].as_ref().unwrap_or(&self.all).eval(wo, wi)
    }

    fn is_spatial(&self) -> bool {
        true
    }

    fn is_isotropic(&self) -> bool {
        self.all.is_isotropic()
    }
}

/// Points that an image's average is taken over, to a side.
const AVERAGED: u32 = 4;

/// What the nearest image shows.
impl Evaluate for BtfPreview {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let points = (0..AVERAGED * AVERAGED).map(|i| DVec2::new((i % AVERAGED).into(), (i / AVERAGED).into()) + 0.5);
        let values = points.map(|point| self.eval_at(Footprint::point(point / f64::from(AVERAGED)), wo, wi));
        values.sum::<DVec3>() / f64::from(AVERAGED * AVERAGED)
    }

    fn eval_at(&self, footprint: Footprint, wo: DVec3, wi: DVec3) -> DVec3 {
        let distance = |[o, i]: &[DVec3; 2]| o.distance_squared(wo) + i.distance_squared(wi);
        let nearest = self.images.iter().min_by(|(a, _), (b, _)| distance(a).total_cmp(&distance(b)));
        nearest.map_or(DVec3::ZERO, |(_, image)| image.sample(footprint.uv.as_vec2()).as_dvec3())
    }

    fn is_spatial(&self) -> bool {
        true
    }

    fn is_isotropic(&self) -> bool {
        false
    }
}
