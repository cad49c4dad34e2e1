//! Shading frames over a texture: what directions are turned into before their features are looked up, so that a network learns a
//! material about its mapped normal, and not the turning. How they turn is `crate::material`'s.
//!
//! A frame is a normal n and the direction of anisotropy at an angle ψ about it, counter-clockwise from u as projected along n. A direction
//! that is turned by half a turn is the same: (cos 2ψ, sin 2ψ) is what is kept and blended.

use glam::{DVec2, DVec3};

use super::{Footprint, GatheredTexels, SurfaceGrid};

/// A frame about a normal, in the surface's own: z along its normal, x along u.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceFrame {
    /// Unit, z > 0.
    pub normal: DVec3,
    /// (cos 2ψ, sin 2ψ).
    pub doubled: DVec2,
}

impl SurfaceFrame {
    /// The surface's own.
    pub const OWN: SurfaceFrame = SurfaceFrame { normal: DVec3::Z, doubled: DVec2::X };

    /// Directions that cancel to less than this have no direction left: then it is u's.
    pub(crate) const LEAST_DIRECTION: f64 = 1e-3;

    /// The average of frames by their weights, > 0 in sum.
    pub fn average(frames: impl Iterator<Item = (f64, SurfaceFrame)>) -> SurfaceFrame {
        let start = (DVec3::ZERO, DVec2::ZERO);
        let (normal, doubled) = frames.fold(start, |(normal, doubled), (weight, frame)| {
            (normal + weight * frame.normal, doubled + weight * frame.doubled)
        });
        let length = doubled.length();
        let doubled = if length < Self::LEAST_DIRECTION { DVec2::X } else { doubled / length };
        SurfaceFrame { normal: normal.normalize(), doubled }
    }
}

/// The frames of texels, point by point of a [`SurfaceGrid`], as signed fractions of [`SurfaceFrames::ONE`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceFrames {
    /// x and y of the normals, whose z is at least [`SurfaceFrames::LEAST_Z`]; empty where all are the surface's own.
    pub normals: Vec<[i16; 2]>,
    /// cos 2ψ and sin 2ψ; empty where ψ is 0 everywhere.
    pub directions: Vec<[i16; 2]>,
}

impl SurfaceFrames {
    /// What stands for 1.
    pub const ONE: i16 = i16::MAX;
    /// How far normals lean at most.
    pub const LEAST_Z: f64 = 1.0 / 32.0;

    /// Rounded. Normals that lean too far lean as far as they may.
    pub fn new(frames: &[SurfaceFrame]) -> SurfaceFrames {
        // Below what rounding can add.
        let most = (1.0 - Self::LEAST_Z * Self::LEAST_Z).sqrt() - 1.0 / f64::from(Self::ONE);
        let rounded = |x: DVec2| x.to_array().map(|x| (x * f64::from(Self::ONE)).round() as i16);
        let all = |part: &dyn Fn(&SurfaceFrame) -> DVec2, none: [i16; 2]| {
            let parts: Vec<[i16; 2]> = frames.iter().map(|frame| rounded(part(frame))).collect();
            if parts.iter().all(|part| *part == none) { Vec::new() } else { parts }
        };
        SurfaceFrames {
            normals: all(&|frame| frame.normal.truncate().clamp_length_max(most), [0; 2]),
            directions: all(&|frame| frame.doubled, [Self::ONE, 0]),
        }
    }

    /// Whether all are the surface's own.
    pub fn is_empty(&self) -> bool {
        self.normals.is_empty() && self.directions.is_empty()
    }

    /// Whether x and y are those of a normal.
    pub(super) fn is_normal(xy: [i16; 2]) -> bool {
        fraction(xy).length_squared() <= 1.0 - Self::LEAST_Z * Self::LEAST_Z
    }

    /// Whether these are a cosine and a sine, roughly.
    pub(super) fn is_direction(doubled: [i16; 2]) -> bool {
        doubled.iter().all(|x| *x >= -Self::ONE) && (0.9..=1.1).contains(&fraction(doubled).length())
    }

    /// The frame of a point.
    fn at(&self, point: usize) -> SurfaceFrame {
        let xy = self.normals.get(point).map_or(DVec2::ZERO, |xy| fraction(*xy));
        let doubled = self.directions.get(point).map_or(DVec2::X, |doubled| fraction(*doubled));
        SurfaceFrame { normal: xy.extend((1.0 - xy.length_squared()).sqrt()), doubled }
    }

    /// The frame of a footprint, blended as features are; `None` where all are the surface's own.
    pub fn look_up(&self, grid: &SurfaceGrid, footprint: Footprint) -> Option<SurfaceFrame> {
        let blended = |GatheredTexels { points, weights }: GatheredTexels| {
            let texels = points.into_iter().zip(weights);
            SurfaceFrame::average(texels.map(|(point, weight)| (weight, self.at(point as usize))))
        };
        (!self.is_empty()).then(|| blended(grid.gather(footprint)))
    }
}

fn fraction(numbers: [i16; 2]) -> DVec2 {
    DVec2::from(numbers.map(f64::from)) / f64::from(SurfaceFrames::ONE)
}

/// A frame whose normal leans by so much towards an azimuth, with ψ.
#[cfg(test)]
pub(crate) fn leaning_frame(lean: f64, towards: f64, psi: f64) -> SurfaceFrame {
    let normal = DVec3::new(lean.sin() * towards.cos(), lean.sin() * towards.sin(), lean.cos());
    SurfaceFrame { normal, doubled: DVec2::from_angle(2.0 * psi) }
}

#[cfg(test)]
mod tests {
    use super::leaning_frame as frame;
    use super::*;

    #[test]
    fn directions_that_differ_by_half_a_turn_are_one() {
        let half = |psi: f64| (0.5, frame(0.0, 0.0, psi));
        let average = SurfaceFrame::average([half(1.5), half(1.7 - std::f64::consts::PI)].into_iter());
        assert!(average.doubled.distance(DVec2::from_angle(3.2)) < 1e-12);
        // What cancels has none.
        let none = SurfaceFrame::average([half(0.2), half(0.2 + std::f64::consts::FRAC_PI_2)].into_iter());
        assert_eq!(none.doubled, DVec2::X);
    }

    #[test]
    fn rounding_keeps_frames() {
        let frames: Vec<SurfaceFrame> =
            (0..100).map(|i| frame(0.015 * f64::from(i), f64::from(i), f64::from(i))).collect();
        let rounded = SurfaceFrames::new(&frames);
        for (point, frame) in frames.iter().enumerate() {
            assert!(
                SurfaceFrames::is_normal(rounded.normals[point])
                    && SurfaceFrames::is_direction(rounded.directions[point])
            );
            let found = rounded.at(point);
            assert!(found.normal.distance(frame.normal) < 2e-3 && found.doubled.distance(frame.doubled) < 1e-4);
        }
        assert!(SurfaceFrames::new(&[SurfaceFrame::OWN; 5]).is_empty());
    }
}
