//! Features over a texture: a pyramid of texels that name codes of a codebook, and may have frames, looked up with a filter.

use std::sync::Arc;

use glam::{DVec2, IVec2};

use super::{Codebook, SurfaceFrame, SurfaceFrames};

/// What is looked at of a surface that varies: a place, and how much about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Texture coordinates, v up; they repeat.
    pub uv: DVec2,
    /// Area in the units of `uv`, ≥ 0. The texture as a whole has 1.
    pub area: f64,
}

impl Footprint {
    /// All of the texture, however large.
    pub const WHOLE: Footprint = Footprint { uv: DVec2::ZERO, area: f64::INFINITY };

    /// A point.
    pub fn point(uv: DVec2) -> Footprint {
        Footprint { uv, area: 0.0 }
    }
}

/// Texels of a texture and of its coarser levels: each level has half as many texels to a side as the one before, rounded down, but at least
/// one; the last has one. Texel (0, 0) of a level is its upper left one, and its points are numbered row by row, level after level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceGrid {
    width: u32,
    height: u32,
}

impl Default for SurfaceGrid {
    /// One texel.
    fn default() -> SurfaceGrid {
        SurfaceGrid { width: 1, height: 1 }
    }
}

/// The texels that a place's features are the weighted sum of: four of a level, four of the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GatheredTexels {
    /// Points; one may come several times.
    pub points: [u32; 8],
    /// Their weights, ≥ 0, with the sum 1.
    pub weights: [f64; 8],
}

impl SurfaceGrid {
    /// The most texels to a side.
    pub const MAX_SIDE: u32 = 1024;

    /// Of so many texels across and down at level 0; `None` unless both are in [1, [`SurfaceGrid::MAX_SIDE`]].
    pub fn new(width: u32, height: u32) -> Option<SurfaceGrid> {
        let fits = |side: u32| (1..=Self::MAX_SIDE).contains(&side);
        (fits(width) && fits(height)).then_some(SurfaceGrid { width, height })
    }

    /// Texels across and down of a level.
    pub fn size(&self, level: u32) -> [u32; 2] {
        [self.width, self.height].map(|side| (side >> level).max(1))
    }

    /// How many levels there are.
    pub fn level_count(&self) -> u32 {
        self.width.max(self.height).ilog2() + 1
    }

    /// The first point of a level.
    pub fn first_point(&self, level: u32) -> u32 {
        (0..level).map(|level| self.size(level).iter().product::<u32>()).sum()
    }

    /// Texels of all levels together.
    pub fn point_count(&self) -> usize {
        self.first_point(self.level_count()) as usize
    }

    /// What each point covers.
    pub fn texels(&self) -> impl Iterator<Item = Footprint> {
        let of_level = |level: u32| {
            let [width, height] = self.size(level);
            let area = 1.0 / (f64::from(width) * f64::from(height));
            let center = move |row: u32, column: u32| {
                DVec2::new(f64::from(column) + 0.5, f64::from(height - row) - 0.5)
                    / DVec2::new(width.into(), height.into())
            };
            (0..height).flat_map(move |row| (0..width).map(move |column| Footprint { uv: center(row, column), area }))
        };
        (0..self.level_count()).flat_map(of_level)
    }

    /// The level whose texels are as large as a footprint, a real number from 0 to the last.
    pub fn level(&self, area: f64) -> f64 {
        let texels = area * f64::from(self.width) * f64::from(self.height);
        (0.5 * texels.max(1.0).log2()).min(f64::from(self.level_count() - 1))
    }

    /// What the features of a footprint are made of: bilinear between the centres of the texels of a level, and linear between two levels.
    pub fn gather(&self, footprint: Footprint) -> GatheredTexels {
        let level = self.level(footprint.area);
        let fine = (level as u32).min(self.level_count() - 1);
        let coarse = (fine + 1).min(self.level_count() - 1);
        let blend = level - f64::from(fine);
        let mut gathered = GatheredTexels::default();
        for (part, (level, share)) in [(fine, 1.0 - blend), (coarse, blend)].into_iter().enumerate() {
            let (points, weights) = self.bilinear(footprint.uv, level);
            gathered.points[4 * part..][..4].copy_from_slice(&points);
            gathered.weights[4 * part..][..4].copy_from_slice(&weights.map(|weight| share * weight));
        }
        gathered
    }

    /// As `Texture::sample` does it.
    fn bilinear(&self, uv: DVec2, level: u32) -> ([u32; 4], [f64; 4]) {
        let size = self.size(level);
        let extent = IVec2::from(size.map(|side| side as i32));
        let wrapped = uv - uv.floor();
        let position = DVec2::new(wrapped.x, 1.0 - wrapped.y) * extent.as_dvec2() - 0.5;
        let corner = position.floor();
        let DVec2 { x, y } = position - corner;
        let point = |dx: i32, dy: i32| {
            let place = (corner.as_ivec2() + IVec2::new(dx, dy)).rem_euclid(extent);
            self.first_point(level) + place.y as u32 * size[0] + place.x as u32
        };
        let points = [point(0, 0), point(1, 0), point(0, 1), point(1, 1)];
        (points, [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y])
    }
}

/// Features over a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceTable {
    /// Where its points are.
    pub grid: SurfaceGrid,
    /// The codes.
    pub codebook: Arc<Codebook>,
    /// The code of each point.
    pub indices: Vec<u16>,
    /// What directions are turned into, point by point.
    pub frames: SurfaceFrames,
}

impl SurfaceTable {
    /// The frame of a footprint; `None` where all are the surface's own.
    pub fn frame(&self, footprint: Footprint) -> Option<SurfaceFrame> {
        self.frames.look_up(&self.grid, footprint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pyramid_ends_in_one_texel() {
        for (width, height, sizes) in
            [(1, 1, vec![[1, 1]]), (8, 8, vec![[8, 8], [4, 4], [2, 2], [1, 1]]), (5, 2, vec![[5, 2], [2, 1], [1, 1]])]
        {
            let grid = SurfaceGrid::new(width, height).unwrap();
            let found: Vec<_> = (0..grid.level_count()).map(|level| grid.size(level)).collect();
            assert_eq!(found, sizes);
            assert_eq!(grid.point_count() as u32, sizes.iter().map(|[w, h]| w * h).sum::<u32>());
        }
        assert!(SurfaceGrid::new(0, 4).is_none() && SurfaceGrid::new(4, SurfaceGrid::MAX_SIDE + 1).is_none());
    }

    #[test]
    fn a_look_up_of_a_texel_is_that_texel() {
        let grid = SurfaceGrid::new(8, 8).unwrap();
        assert_eq!(grid.texels().count(), grid.point_count());
        for (point, texel) in grid.texels().enumerate() {
            let GatheredTexels { points, weights } = grid.gather(texel);
            let own = points.iter().zip(weights).filter(|(at, _)| **at == point as u32);
            assert!((own.map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-12, "{texel:?}");
        }
    }

    #[test]
    fn look_ups_are_those_of_a_texture() {
        let grid = SurfaceGrid::new(4, 2).unwrap();
        // The centre of the upper left texel of level 0: u = 1/8, v = 3/4.
        let at = grid.gather(Footprint::point(DVec2::new(0.125, 0.75)));
        assert!(at.points[0] == 0 && (at.weights[0] - 1.0).abs() < 1e-12, "{at:?}");
        // Half-way between the last texel of a row and the first one, as it repeats; so do other periods.
        for u in [0.0, 1.0, -3.0] {
            let at = grid.gather(Footprint::point(DVec2::new(u, 0.25)));
            assert_eq!((at.points[0], at.points[1], at.weights[0], at.weights[1]), (7, 4, 0.5, 0.5), "{at:?}");
        }
        // Footprints of half the width lie one level lower.
        let level = |texels: f64| grid.level(texels * texels / 8.0);
        assert_eq!([level(0.5), level(1.0), level(2.0), level(f64::INFINITY)], [0.0, 0.0, 1.0, 2.0]);
        assert!((level(2f64.sqrt()) - 0.5).abs() < 1e-12);
        let whole = grid.gather(Footprint::WHOLE);
        assert_eq!(whole.points, [10; 8]);
        assert!((whole.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
