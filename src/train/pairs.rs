//! What there is to learn: pairs of directions and the BRDF's value there.

use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, TAU};

use bytemuck::{Pod, Zeroable};
use glam::{DQuat, DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::random::Random;
use crate::material::Evaluate;
use crate::scene::brdf::{Footprint, SurfaceFrame, SurfaceFrames, SurfaceGrid};

/// What is learned.
pub enum GroundTruth<'a> {
    /// A function of (ωo, ωi) that is known everywhere: the BRDF in sr⁻¹, RGB, without the cosine.
    Function {
        /// The function.
        eval: &'a (dyn Fn(DVec3, DVec3) -> DVec3 + Sync),
        /// Whether only the difference of the azimuths matters, and not its sign.
        is_isotropic: bool,
    },
    /// A BRDF that varies over a texture and is known everywhere.
    Surface {
        /// Its values at points, and the frames that its lobes lie in.
        brdf: &'a dyn Evaluate,
    },
    /// Measurements at some pairs of directions, and of places where the material varies.
    Samples {
        /// The measurements.
        pairs: &'a [Pair],
        /// Whether only the difference of the azimuths matters, and not its sign.
        is_isotropic: bool,
    },
}

impl GroundTruth<'_> {
    /// Whether only the difference of the azimuths matters, and not its sign, about the frames where there are some.
    pub fn is_isotropic(&self) -> bool {
        match self {
            GroundTruth::Function { is_isotropic, .. } | GroundTruth::Samples { is_isotropic, .. } => *is_isotropic,
            GroundTruth::Surface { brdf } => brdf.is_isotropic_in_frames(),
        }
    }

    /// The frames of texels: those of the function, where it has some.
    pub fn frames(&self, grid: SurfaceGrid) -> SurfaceFrames {
        let GroundTruth::Surface { brdf } = self else { return SurfaceFrames::default() };
        let frames: Option<Vec<SurfaceFrame>> = grid.texels().map(|texel| brdf.frame(texel)).collect();
        frames.map_or_else(SurfaceFrames::default, |frames| SurfaceFrames::new(&frames))
    }

    /// The measurements, or values of the function at `count` pairs that are drawn to crowd where lobes are. Over these texels, where the
    /// function is one of places, the others being the same everywhere.
    pub fn pairs(&self, count: usize, seed: u64, grid: Option<SurfaceGrid>) -> Cow<'_, [Pair]> {
        let drawn = |draw: &(dyn Fn(&mut Random) -> Pair + Sync)| {
            let mut pairs = vec![Pair::default(); count];
            pairs.par_chunks_mut(DRAWN_TOGETHER).enumerate().for_each(|(chunk, pairs)| {
                let mut random = Random::new(seed, chunk as u64);
                pairs.iter_mut().for_each(|pair| *pair = draw(&mut random));
            });
            Cow::Owned(pairs)
        };
        let grazing = if self.is_isotropic() { 0.0 } else { GRAZING };
        match self {
            GroundTruth::Samples { pairs, .. } => Cow::Borrowed(pairs),
            GroundTruth::Function { eval, .. } => drawn(&|random| {
                let (wo, wi) = draw_grazing(grazing, random);
                Pair { wo: wo.as_vec3(), wi: wi.as_vec3(), value: eval(wo, wi).as_vec3(), ..Pair::default() }
            }),
            GroundTruth::Surface { brdf } => {
                let grid = grid.unwrap_or_default();
                drawn(&|random| {
                    let place = Place::draw(&grid, random);
                    let frame = brdf.frame(Footprint::point(place.uv)).unwrap_or(SurfaceFrame::OWN);
                    let (wo, wi) = draw_about(frame.normal, grazing, random);
                    let value = place.average(&grid, random, &|uv| brdf.eval_at(Footprint::point(uv), wo, wi));
                    let (uv, area) = (place.uv.as_vec2(), place.area(&grid) as f32);
                    Pair { wo: wo.as_vec3(), wi: wi.as_vec3(), value: value.as_vec3(), uv, area }
                })
            }
        }
    }
}

/// A footprint to learn.
pub(super) struct Place {
    pub uv: DVec2,
    /// Of the grid, a real number.
    pub level: f64,
}

/// Share of the pairs that see points.
const POINTS: f64 = 0.5;

/// Points that a footprint's average is taken over, at most: what is left of its noise averages out over the pairs.
const MOST_AVERAGED: f64 = 8.0;

impl Place {
    /// Anywhere, half of them points and the others of all sizes alike.
    pub fn draw(grid: &SurfaceGrid, random: &mut Random) -> Place {
        let last = f64::from(grid.level_count() - 1);
        let uv = DVec2::new(random.next_f64(), random.next_f64());
        let level = if random.next_f64() < POINTS { 0.0 } else { last * random.next_f64() };
        Place { uv, level }
    }

    /// The footprint's, in texture coordinates.
    pub fn area(&self, grid: &SurfaceGrid) -> f64 {
        let [width, height] = grid.size(0).map(f64::from);
        4f64.powf(self.level) / (width * height)
    }

    /// The sides of what the average is taken over. A bilinear look-up of level 0 has seen a texel already: of a footprint of 2^level texels to
    /// a side what is left, as variances add up, is a square of √(4^level − 1).
    pub fn extent(&self, grid: &SurfaceGrid) -> DVec2 {
        let size = DVec2::from(grid.size(0).map(f64::from));
        (DVec2::splat((4f64.powf(self.level) - 1.0).sqrt()) / size).min(DVec2::ONE)
    }

    /// The average of a function over the footprint.
    pub fn average(&self, grid: &SurfaceGrid, random: &mut Random, function: &dyn Fn(DVec2) -> DVec3) -> DVec3 {
        let extent = self.extent(grid);
        let count = 4f64.powf(self.level).min(MOST_AVERAGED).ceil() as u32;
        // A Kronecker sequence (Roberts 2018), shifted at random.
        let shift = DVec2::new(random.next_f64(), random.next_f64());
        let step = DVec2::new(0.754_877_666_246_692_7, 0.569_840_290_998_053_2);
        let point = |i: u32| self.uv + ((shift + f64::from(i) * step).fract() - 0.5) * extent;
        (0..count).map(|i| function(point(i))).sum::<DVec3>() / f64::from(count)
    }
}

/// Pairs as a network learns them that sees directions about the frames of texels: without what these receive of the light. Those below their
/// frames, where nothing is reflected whatever the network says, are left out.
pub(super) fn about_frames<'a>(pairs: Cow<'a, [Pair]>, grid: &SurfaceGrid, frames: &SurfaceFrames) -> Cow<'a, [Pair]> {
    if frames.is_empty() {
        return pairs;
    }
    let turned = |pair: &Pair| {
        let footprint = Footprint { uv: pair.uv.as_dvec2(), area: pair.area.into() };
        let ([wo, wi], received) = frames.look_up(grid, footprint)?.turned(pair.wo.as_dvec3(), pair.wi.as_dvec3())?;
        let is_above = wo.z > LOWEST && wi.z > LOWEST;
        let value = (pair.value.as_dvec3() / received).as_vec3();
        is_above.then(|| Pair { wo: wo.as_vec3(), wi: wi.as_vec3(), value, ..*pair })
    };
    Cow::Owned(pairs.par_iter().filter_map(turned).collect())
}

/// As [`draw_grazing`], about another normal.
fn draw_about(normal: DVec3, grazing: f64, random: &mut Random) -> (DVec3, DVec3) {
    let turn = DQuat::from_rotation_arc(DVec3::Z, normal);
    loop {
        let (wo, wi) = draw_grazing(grazing, random);
        let (wo, wi) = (turn * wo, turn * wi);
        if wo.z > LOWEST && wi.z > LOWEST {
            return (wo, wi);
        }
    }
}

/// Share of ωo that crowd at the horizon where azimuths matter. The last pixel before it is 2.4° high, and its 64 points on the horizon learn
/// from little but what is near: without this share 0.2 % of ωo are within half a degree, so few that fits sent more than they got there.
/// Isotropic materials have as many pairs for a seventieth of the pairs of points, and do without.
const GRAZING: f64 = 0.15;

/// Pairs that share a stream of random numbers.
const DRAWN_TOGETHER: usize = 1024;

/// A pair of directions, z along the normal, and the BRDF there, sr⁻¹, RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Pair {
    /// Towards the viewer.
    pub wo: Vec3,
    /// Towards the light.
    pub wi: Vec3,
    /// The BRDF, without the cosine.
    pub value: Vec3,
    /// Where, of a material that varies.
    pub uv: Vec2,
    /// The area over which the value is the average, as [`Footprint::area`](crate::scene::brdf::Footprint::area).
    pub area: f32,
}

impl Pair {
    /// What Helmholtz's reciprocity says besides: light that comes the other way.
    pub fn reciprocal(self) -> Pair {
        Pair { wo: self.wi, wi: self.wo, ..self }
    }
}

/// Draws (ωo, ωi): 30 % of ωi by the cosine, the others mirrored about half vectors that crowd at the normal, θh = u² · 90°
/// (40 %) and u⁴ · 90° (30 %), so that lobes of any width are seen. ωo is by the cosine (40 %), uniform in θ
/// (30 %) or crowded at the normal, θ = u² · 90° (30 %). The two change roles at random.
pub fn draw(random: &mut Random) -> (DVec3, DVec3) {
    draw_grazing(0.0, random)
}

/// The same, but that a share of ωo crowds at the horizon, θ = (1 − u²) · 90°, instead of being by the cosine.
fn draw_grazing(share: f64, random: &mut Random) -> (DVec3, DVec3) {
    loop {
        let by_cosine = |random: &mut Random| {
            let sin = random.next_f64().sqrt();
            direction(sin.asin(), TAU * random.next_f64())
        };
        let wo = match random.next_f64() {
            choice if choice < share => {
                direction(FRAC_PI_2 * (1.0 - random.next_f64().powi(2)), TAU * random.next_f64())
            }
            ..0.4 => by_cosine(random),
            ..0.7 => direction(FRAC_PI_2 * random.next_f64(), TAU * random.next_f64()),
            _ => direction(FRAC_PI_2 * random.next_f64().powi(2), TAU * random.next_f64()),
        };
        let choice = random.next_f64();
        let wi = if choice < 0.3 {
            by_cosine(random)
        } else {
            let crowding = if choice < 0.7 { 2 } else { 4 };
            let half = direction(FRAC_PI_2 * random.next_f64().powi(crowding), TAU * random.next_f64());
            mirrored(wo, half)
        };
        if wo.z > LOWEST && wi.z > LOWEST {
            return if random.next_f64() < 0.5 { (wo, wi) } else { (wi, wo) };
        }
    }
}

/// Directions closer to the surface than this are not drawn: there is no light to carry.
pub(super) const LOWEST: f64 = 1e-3;

/// The unit vector at these angles.
pub(super) fn direction(theta: f64, phi: f64) -> DVec3 {
    DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

/// `w` mirrored about a half vector.
pub(super) fn mirrored(w: DVec3, half: DVec3) -> DVec3 {
    2.0 * w.dot(half) * half - w
}
