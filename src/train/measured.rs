//! Pairs to learn from measurements over a texture.

use glam::DVec2;
use rayon::prelude::*;

use super::pairs::{Pair, Place};
use super::random::Random;
use crate::scene::brdf::{SparseSample, SurfaceGrid, SurfaceSamples};
use crate::scene::{Btf, BtfPreview, Error};

/// Each sample twice: where it is, and as one of those that the average over some larger footprint about it is made of.
pub fn sample_pairs(surface: &SurfaceSamples, grid: SurfaceGrid, seed: u64) -> Vec<Pair> {
    let mut random = Random::new(seed, 0);
    let mut pairs = Vec::with_capacity(2 * surface.samples.len());
    for (uv, SparseSample { wi, wo, value }) in &surface.samples {
        let pair = |place: &Place, uv: DVec2| Pair {
            wo: wo.as_vec3(),
            wi: wi.as_vec3(),
            value: *value,
            uv: uv.as_vec2(),
            area: place.area(&grid) as f32,
        };
        let here = Place { uv: uv.as_dvec2(), level: 0.0 };
        pairs.push(pair(&here, here.uv));
        let within = Place { level: f64::from(grid.level_count() - 1) * random.next_f64(), ..here };
        let shift = DVec2::new(random.next_f64(), random.next_f64()) - 0.5;
        pairs.push(pair(&within, here.uv + shift * within.extent(&grid)));
    }
    pairs
}

/// About `count` pairs from all images of a stack, footprints drawn as for a function, and small pictures of them. Images are read one
/// after the other, a thread each.
///
/// # Errors
/// An image that cannot be read.
pub fn btf_pairs(btf: &Btf, grid: SurfaceGrid, count: usize, seed: u64) -> Result<(Vec<Pair>, BtfPreview), Error> {
    let each = count.div_ceil(btf.len());
    let read = |index: usize| -> Result<_, Error> {
        let (image, [wo, wi]) = (btf.read(index)?, btf.directions(index));
        let mut random = Random::new(seed, index as u64);
        let pairs = (0..each).map(|_| {
            let place = Place::draw(&grid, &mut random);
            let value = place.average(&grid, &mut random, &|uv| image.sample(uv.as_vec2()).as_dvec3()).as_vec3();
            Pair { wo: wo.as_vec3(), wi: wi.as_vec3(), value, uv: place.uv.as_vec2(), area: place.area(&grid) as f32 }
        });
        Ok((pairs.collect::<Vec<Pair>>(), ([wo, wi], BtfPreview::shrink(&image))))
    };
    let (pairs, images): (Vec<_>, Vec<_>) =
        (0..btf.len()).into_par_iter().map(read).collect::<Result<Vec<_>, Error>>()?.into_iter().unzip();
    Ok((pairs.concat(), BtfPreview { images }))
}
