//! Where the features of a hemisphere of directions stand: at the corners of HEALPix pixels.
//!
//! HEALPix (Górski et al., *HEALPix: A Framework for High-Resolution Discretization and Fast Analysis of Data Distributed on
//! the Sphere*, ApJ 622, 2005) maps the sphere, area for area, onto squares. The corners of its pixels stand on rings of equal
//! latitude, and so do we number them: the pole, then ring after ring southwards, each by growing azimuth. That makes a corner
//! one point whatever face or quadrant asks for it. With σ the distance from the pole in rings over N_side,
//!
//! - polar cap, z ≥ ⅔: 3(1 − z) = σ², 4r points on ring r at the azimuths k/r quarter turns,
//! - equatorial belt, 0 ≤ z ≤ ⅔: 3z = 4 − 2σ, 4 N_side points a ring, every other ring turned by half a step.
//!
//! A quadrant of azimuths from τ = 0 to 1 quarter turns is a piece of the plane with the axes N_side·a and N_side·b; a + b = σ,
//! and lattice points are grid points. In the cap a = τσ, b = (1 − τ)σ; in the belt a = τ + (σ − 1)/2, b = 1 − τ + (σ − 1)/2.

use glam::DVec3;

/// A direction whose x and y are both smaller than this is the pole: its azimuth is 0. (Its squares are normal numbers in `f32`.)
pub const POLE: f64 = 1e-18;

/// The grid over the hemisphere z ≥ 0 of pixels that HEALPix cuts its twelve faces into, N_side × N_side each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SphereGrid {
    n_side: u32,
}

/// The grid points around a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located {
    /// The pixel, of [`SphereGrid::pixel_count`]. A merged pixel is named by the one of its smallest parts that was asked for.
    pub pixel: u32,
    /// Its corners: poleward, east, west, and the one towards the equator. Pixels that the equator halves are triangles, of which
    /// the first corner stands in for the last one.
    pub corners: [u32; 4],
    /// Place in the pixel from the first corner towards the eastern one, in [0, 1].
    pub u: f64,
    /// Place in the pixel from the first corner towards the western one, in [0, 1].
    pub v: f64,
}

impl Located {
    /// Whether only three corners count.
    pub fn is_triangle(&self) -> bool {
        self.corners[3] == self.corners[0]
    }

    /// How much each corner counts when values are interpolated, linearly in triangles.
    pub fn bilinear_weights(&self) -> [f64; 4] {
        let (u, v) = (self.u, self.v);
        if self.is_triangle() {
            [(1.0 - (u + v)).max(0.0), u, v, 0.0]
        } else {
            [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v]
        }
    }
}

/// Where a direction is on a grid, and so on all coarser ones: what takes an arc tangent is done once.
#[derive(Clone, Copy, Debug)]
pub struct SpherePlace {
    grid: SphereGrid,
    cell: Cell,
}

impl SpherePlace {
    /// The same place on a grid that is not finer.
    pub fn on(self, grid: SphereGrid) -> SpherePlace {
        let level = self.grid.max_level() - grid.max_level();
        let Cell { i, j, .. } = self.cell;
        SpherePlace {
            grid,
            cell: Cell { i: i >> level, j: j >> level, size: 1, ..self.cell.ancestor(self.grid, level) },
        }
    }

    /// As [`SphereGrid::locate`].
    pub fn located(self) -> Located {
        self.cell.located(self.grid)
    }

    /// The same where pixels were merged: `level` tells how often the one was that [`SphereGrid::locate`] finds.
    pub fn merged(self, level: impl FnOnce(u32) -> u32) -> Located {
        let located = self.located();
        match level(located.pixel).min(self.grid.max_level()) {
            0 => located,
            level => Located { pixel: located.pixel, ..self.cell.ancestor(self.grid, level).located(self.grid) },
        }
    }
}

impl SphereGrid {
    /// The finest grid.
    pub const MAX_N_SIDE: u32 = 128;

    /// A grid of pixels `n_side` to a face's side: a power of two, at most [`SphereGrid::MAX_N_SIDE`]. `None` otherwise.
    pub fn new(n_side: u32) -> Option<SphereGrid> {
        (n_side.is_power_of_two() && n_side <= SphereGrid::MAX_N_SIDE).then_some(SphereGrid { n_side })
    }

    /// N_side.
    pub fn n_side(self) -> u32 {
        self.n_side
    }

    /// How often four pixels can become one.
    pub fn max_level(self) -> u32 {
        self.n_side.trailing_zeros()
    }

    /// The corners with z ≥ 0, those on the equator included.
    pub fn point_count(self) -> usize {
        let n = self.n_side as usize;
        6 * n * n + 2 * n + 1
    }

    /// The pixels that reach into z > 0, the 4 N_side that the equator halves included. Every point but the pole is the
    /// western corner of exactly one of them: pixel p's is point p + 1.
    pub fn pixel_count(self) -> usize {
        self.point_count() - 1
    }

    /// The pixel of a direction, its corners, and the direction's place in it. Interpolating with bilinear weights is continuous
    /// over the whole hemisphere.
    ///
    /// Any vector is fine: what is below the equator counts as on it, what has no direction as the pole. On a border any pixel
    /// that it belongs to may be returned; azimuths in [0, π] give pixels that reach into them.
    pub fn locate(self, w: DVec3) -> Located {
        self.place(w).located()
    }

    /// Where a direction is, to be looked up on this grid and on coarser ones.
    pub fn place(self, w: DVec3) -> SpherePlace {
        SpherePlace { grid: self, cell: Cell::containing(self, w) }
    }

    /// The direction of a grid point, which is below [`SphereGrid::point_count`].
    pub fn point(self, index: usize) -> DVec3 {
        let (ring, place) = self.ring_of(index as u32);
        let n = self.n_side;
        let sigma = f64::from(ring) / f64::from(n);
        let (z, rho, quarters) = if ring < n {
            let z = 1.0 - sigma * sigma / 3.0;
            (z, sigma * ((1.0 + z) / 3.0).sqrt(), f64::from(place) / f64::from(ring.max(1)))
        } else {
            let z = (2.0 - sigma) / 1.5;
            (z, (1.0 - z * z).sqrt(), (f64::from(place) - 0.5 * f64::from((ring - n) & 1)) / f64::from(n))
        };
        let (sin, cos) = ((quarters - quarters.floor()) * std::f64::consts::FRAC_PI_2).sin_cos();
        let [x, y] = match quarters.floor() as i32 & 3 {
            0 => [cos, sin],
            1 => [-sin, cos],
            2 => [-cos, -sin],
            _ => [sin, -cos],
        };
        DVec3::new(rho * x, rho * y, z)
    }

    /// The point at (i, j) from the pole in a quadrant, which is on ring i + j.
    fn index(self, quadrant: u32, i: u32, j: u32) -> u32 {
        let n = self.n_side;
        let ring = i + j;
        if ring == 0 {
            0
        } else if ring < n {
            let place = quadrant * ring + i;
            1 + 2 * ring * (ring - 1) + if place == 4 * ring { 0 } else { place }
        } else {
            let place = (quadrant * n + i).wrapping_sub((ring - n) >> 1) & (4 * n - 1);
            1 + 2 * n * (n - 1) + 4 * n * (ring - n) + place
        }
    }

    /// The ring of a point and its place on it.
    fn ring_of(self, index: u32) -> (u32, u32) {
        let n = self.n_side;
        let belt = 1 + 2 * n * (n - 1);
        if index == 0 {
            (0, 0)
        } else if index >= belt {
            (n + (index - belt) / (4 * n), (index - belt) % (4 * n))
        } else {
            // The last ring with 1 + 2r(r − 1) ≤ index.
            let ring = (2 * index - 1).isqrt().div_ceil(2);
            (ring, index - (1 + 2 * ring * (ring - 1)))
        }
    }

    /// Every pixel with its corners.
    pub fn pixels(self) -> impl Iterator<Item = (u32, [u32; 4])> {
        self.cells().map(move |cell| cell.located(self)).map(|located| (located.pixel, located.corners))
    }

    fn cells(self) -> impl Iterator<Item = Cell> {
        let n = self.n_side;
        let places = (0..2 * n).flat_map(move |i| (0..n.min(2 * n - i)).map(move |j| (i, j)));
        places.flat_map(|(i, j)| (0..4).map(move |quadrant| Cell { quadrant, i, j, size: 1, u: 0.0, v: 0.0 }))
    }

    /// How often each pixel is merged when pixels without data become their parents: four that share a parent, all of them
    /// `is_empty`, become that parent, recursively.
    pub fn merge(self, is_empty: impl Fn(u32) -> bool) -> Vec<u8> {
        self.merge_where(|_, pixels| pixels.iter().all(|pixel| is_empty(*pixel)))
    }

    /// How often each pixel is merged when blocks of 4^level pixels are one pixel where `is_merged(level, pixels)` says so. It
    /// is asked from the faces of HEALPix, which nothing is merged across, down to blocks of four, unless a larger block is
    /// merged. Blocks that the equator cuts have fewer pixels.
    pub fn merge_where(self, mut is_merged: impl FnMut(u32, &[u32]) -> bool) -> Vec<u8> {
        let n = self.n_side;
        let mut levels = vec![0; self.pixel_count()];
        let faces = (0..4).flat_map(|quadrant| [(quadrant, 0, 0), (quadrant, n, 0)]);
        let mut open: Vec<(u32, u32, u32, u32)> =
            faces.map(|(quadrant, i, j)| (self.max_level(), quadrant, i, j)).collect();
        while let Some((level, quadrant, i, j)) = open.pop() {
            let size = 1 << level;
            let places = (i..i + size).flat_map(|i| (j..j + size).map(move |j| (i, j))).filter(|(i, j)| i + j < 2 * n);
            let pixels: Vec<u32> = places.map(|(i, j)| self.index(quadrant, i, j + 1) - 1).collect();
            if level == 0 || pixels.is_empty() {
                continue;
            }
            if is_merged(level, &pixels) {
                pixels.iter().for_each(|pixel| levels[*pixel as usize] = level as u8);
            } else {
                let half = size / 2;
                open.extend(
                    [(0, 0), (half, 0), (0, half), (half, half)].map(|(x, y)| (level - 1, quadrant, i + x, j + y)),
                );
            }
        }
        levels
    }

    /// Which points are corners of pixels that are merged so; of all pixels where `levels` is empty.
    pub fn corners_of(self, levels: &[u8]) -> Vec<bool> {
        let mut is_corner = vec![false; self.point_count()];
        for cell in self.cells() {
            let level = levels.get(cell.located(self).pixel as usize).map_or(0, |level| u32::from(*level));
            for corner in cell.ancestor(self, level).located(self).corners {
                is_corner[corner as usize] = true;
            }
        }
        is_corner
    }
}

/// A square of the lattice and a place in it.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Quarter turns before it.
    quadrant: u32,
    /// Steps of its poleward corner from the pole, eastwards.
    i: u32,
    /// Steps of its poleward corner from the pole, westwards.
    j: u32,
    /// Steps to a side.
    size: u32,
    u: f64,
    v: f64,
}

impl Cell {
    fn containing(grid: SphereGrid, w: DVec3) -> Cell {
        let n = grid.n_side;
        let (quadrant, along, across) = quarter(w);
        // 3(1 − z) = 3(1 − z²)/(1 + z), without the cancellation.
        let z = w.z.max(0.0);
        let polar = (along * along + across * across).sqrt() * (3.0 / (1.0 + z)).sqrt();
        let tau = (across.atan2(along) * std::f64::consts::FRAC_2_PI).min(1.0);
        let [a, b] = if polar < 1.0 {
            [tau * polar, (1.0 - tau) * polar]
        } else {
            let shift = 0.5 - 0.75 * z.min(2.0 / 3.0);
            [tau + shift, 1.0 - tau + shift]
        };
        let [x, y] = [a, b].map(|s| s * f64::from(n));
        // A point of the equator belongs to pixels to the north of it.
        let i = (x as u32).min(2 * n - 1);
        let j = (y as u32).min(2 * n - 1 - i);
        let inside = |x: f64, i: u32| (x - f64::from(i)).clamp(0.0, 1.0);
        Cell { quadrant, i, j, size: 1, u: inside(x, i), v: inside(y, j) }
    }

    /// The pixel `level` levels up that contains this one.
    fn ancestor(self, grid: SphereGrid, level: u32) -> Cell {
        let size = self.size << level;
        let parent = |i: u32, u: f64| {
            let first = i & !(size - 1);
            (first, (f64::from(i - first) + u) / f64::from(size))
        };
        let ((i, u), (j, v)) = (parent(self.i, self.u), parent(self.j, self.v));
        debug_assert!(i + j + size <= 2 * grid.n_side);
        Cell { size, i, j, u, v, ..self }
    }

    fn located(self, grid: SphereGrid) -> Located {
        let Cell { quadrant, i, j, size, u, v } = self;
        let (east, west) = (i + size, j + size);
        let corner = |i, j| grid.index(quadrant, i, j);
        let poleward = corner(i, j);
        let last = if east + west <= 2 * grid.n_side { corner(east, west) } else { poleward };
        Located { pixel: corner(i, west) - 1, corners: [poleward, corner(east, j), corner(i, west), last], u, v }
    }
}

/// The quadrant of the azimuth, and (x, y) turned back into the first one. Where x or y is 0 it is the one that reaches into
/// azimuths in [0, π].
fn quarter(w: DVec3) -> (u32, f64, f64) {
    let DVec3 { x, y, .. } = w;
    if x.abs().max(y.abs()) < POLE {
        return (0, 0.0, 0.0);
    }
    match (y >= 0.0, x >= 0.0) {
        (true, true) => (0, x, y),
        (true, false) => (1, y, -x),
        (false, false) => (2, -x, -y),
        (false, true) => (3, -y, x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    const SIZES: [u32; 4] = [1, 2, 16, 128];

    fn grid(n_side: u32) -> SphereGrid {
        SphereGrid::new(n_side).unwrap()
    }

    /// A stream of uniform numbers in [0, 1).
    struct Random(u64);

    impl Random {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1u64 << 53) as f64
        }

        fn direction(&mut self) -> DVec3 {
            direction(self.unit(), TAU * self.unit())
        }
    }

    fn direction(z: f64, azimuth: f64) -> DVec3 {
        let rho = (1.0 - z * z).sqrt();
        DVec3::new(rho * azimuth.cos(), rho * azimuth.sin(), z)
    }

    /// Directions where something special happens, each with its neighbourhood: poles, equator, the borders of faces, of
    /// quadrants and of the cap, φ = ±π, and grid points.
    fn special_directions(grid: SphereGrid) -> Vec<DVec3> {
        let mut found = vec![DVec3::Z];
        let azimuths = (0..=16).map(|k| f64::from(k) * PI / 8.0 - PI);
        let heights = [0.0, 1e-300, 1e-6, 2.0 / 3.0, 0.3, 0.9, 1.0 - 1e-12, 1.0];
        for azimuth in azimuths {
            for z in heights {
                for [dz, turn] in [[0.0, 0.0], [1e-9, 0.0], [-1e-9, 0.0], [0.0, 1e-9], [0.0, -1e-9]] {
                    found.push(direction(f64::clamp(z + dz, 0.0, 1.0), azimuth + turn));
                }
            }
        }
        for x in [-1.0, -0.0, 0.0, 1.0] {
            found.extend([DVec3::new(x, -0.0, 1.0), DVec3::new(x, 0.0, 0.5), DVec3::new(0.0, x, 0.1)]);
        }
        let step = grid.point_count().div_ceil(2000);
        found.extend((0..grid.point_count()).step_by(step).map(|index| grid.point(index)));
        found.iter().map(|w| if *w == DVec3::ZERO { DVec3::Z } else { w.normalize() }).collect()
    }

    #[test]
    fn points_are_where_their_neighbours_say_and_their_own() {
        for n_side in SIZES {
            let grid = grid(n_side);
            for index in 0..grid.point_count() {
                let point = grid.point(index);
                assert!((point.length() - 1.0).abs() < 1e-14 && point.z >= 0.0);
                let located = grid.locate(point);
                let interpolated: DVec3 = located
                    .corners
                    .into_iter()
                    .zip(located.bilinear_weights())
                    .map(|(corner, weight)| grid.point(corner as usize) * weight)
                    .sum();
                assert!((interpolated - point).length() < 1e-12, "{n_side} {index}: {located:?}");
            }
            assert_eq!(grid.point(0), DVec3::Z);
            let equator = grid.point_count() - 4 * n_side as usize;
            assert!((equator..grid.point_count()).all(|index| grid.point(index).z == 0.0));
            assert!(grid.point(equator - 1).z > 0.0);
        }
    }

    /// Our four corners are the vertices of the pixel in which another implementation finds the direction.
    #[test]
    fn pixels_are_those_of_cdshealpix() {
        let mut random = Random(1);
        for n_side in SIZES {
            let grid = grid(n_side);
            let other = cdshealpix::nested::get(n_side.trailing_zeros() as u8);
            let pixel_of = |w: DVec3| other.hash(w.y.atan2(w.x).rem_euclid(TAU), w.z.clamp(-1.0, 1.0).asin());
            // South, east, north, west.
            let vertices =
                |pixel| other.vertices(pixel).map(|(longitude, latitude)| direction(latitude.sin(), longitude));
            let agrees = |located: Located, pixel| {
                let [south, east, north, west] = vertices(pixel);
                let is_triangle = located.is_triangle();
                let expected = [north, east, west, if is_triangle { north } else { south }];
                let near = |(corner, expected): (u32, DVec3)| (grid.point(corner as usize) - expected).length() < 1e-7;
                located.corners.into_iter().zip(expected).all(near) && is_triangle == (south.z < -1e-9)
            };
            for _ in 0..250_000 {
                let w = random.direction();
                let located = grid.locate(w);
                assert!(agrees(located, pixel_of(w)), "{n_side} {w:?} {located:?}");
            }
            for w in special_directions(grid) {
                let located = grid.locate(w);
                // On a border, any of the pixels that share it.
                let around = [
                    [0.0, 0.0],
                    [1.0, 0.0],
                    [0.0, 1.0],
                    [1.0, 1.0],
                    [-1.0, 0.0],
                    [0.0, -1.0],
                    [1.0, -1.0],
                    [-1.0, 1.0],
                    [-1.0, -1.0],
                ];
                let (x, y) = w.any_orthonormal_pair();
                let near = around.map(|[s, t]| pixel_of((w + 1e-8 * (s * x + t * y)).normalize()));
                assert!(near.iter().any(|pixel| agrees(located, *pixel)), "{n_side} {w:?} {located:?}");
            }
        }
    }

    /// Whatever stands at the points, what is interpolated between them has no step: not within pixels, not across their
    /// borders, those of faces and quadrants, φ = ±π, or at the poles.
    #[test]
    fn interpolation_is_continuous() {
        for n_side in SIZES {
            let grid = grid(n_side);
            let mut random = Random(7);
            let values: Vec<f64> = (0..grid.point_count()).map(|_| random.unit()).collect();
            let interpolate = |w: DVec3| -> f64 {
                let located = grid.locate(w);
                located
                    .corners
                    .into_iter()
                    .zip(located.bilinear_weights())
                    .map(|(c, weight)| values[c as usize] * weight)
                    .sum()
            };
            let check = |w: DVec3, random: &mut Random| {
                let (x, y) = w.any_orthonormal_pair();
                let step = 1e-9 * (x * (random.unit() - 0.5) + y * (random.unit() - 0.5));
                let mut moved = (w + step).normalize();
                moved.z = moved.z.max(0.0);
                let change = (interpolate(w) - interpolate(moved)).abs();
                // In-pixel coordinates change by at most a few N_side a radian.
                assert!(change < 1e-8 * f64::from(n_side), "{n_side} {w:?}: {change:e}");
            };
            special_directions(grid).into_iter().for_each(|w| (0..8).for_each(|_| check(w, &mut random)));
            (0..100_000).for_each(|_| {
                let w = random.direction();
                check(w, &mut random);
            });
        }
    }

    #[test]
    fn any_vector_has_a_place() {
        let tiny = f64::from_bits(1);
        let odd = [0.0, -0.0, tiny, -tiny, 1e-40, 1e-18, 1e-6, -1e-16, 1.0 + f64::EPSILON, -1.0, 2.0, f64::MAX];
        let worse = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        for n_side in SIZES {
            let grid = grid(n_side);
            let numbers = || odd.into_iter().chain(worse);
            for w in numbers().flat_map(|x| numbers().flat_map(move |y| numbers().map(move |z| DVec3::new(x, y, z)))) {
                let located = grid.locate(w);
                assert!((located.pixel as usize) < grid.pixel_count());
                assert!(located.corners.iter().all(|corner| (*corner as usize) < grid.point_count()));
                if !w.is_nan() && w.is_finite() {
                    assert!((0.0..=1.0).contains(&located.u) && (0.0..=1.0).contains(&located.v), "{w:?} {located:?}");
                }
            }
            assert_eq!(grid.locate(DVec3::ZERO).corners[0], 0);
        }
    }

    /// What isotropic materials ask for, azimuths from 0 to π, never touches pixels that lie in the other half.
    #[test]
    fn half_the_azimuths_take_half_the_pixels() {
        let grid = grid(32);
        let center = |located: Located| -> DVec3 {
            located.corners.iter().map(|corner| grid.point(*corner as usize)).sum::<DVec3>().normalize()
        };
        let mut random = Random(3);
        for step in 0..10_000 {
            let azimuth = [0.0, PI, PI * random.unit(), FRAC_PI_2][step % 4];
            let z = random.unit();
            let w =
                DVec3::new((1.0 - z * z).sqrt() * azimuth.cos(), if step % 4 == 1 { 0.0 } else { azimuth.sin() }, z);
            assert!(center(grid.locate(w)).y > -1e-12);
        }
    }

    #[test]
    fn pixels_and_western_corners_are_one_to_one() {
        for n_side in SIZES {
            let grid = grid(n_side);
            let mut seen = vec![0; grid.pixel_count()];
            let mut random = Random(5);
            for _ in 0..40 * grid.pixel_count().min(25_000) {
                let located = grid.locate(random.direction());
                seen[located.pixel as usize] += 1;
                assert_eq!(located.corners[2], located.pixel + 1);
            }
            if n_side < 128 {
                assert!(seen.iter().all(|times| *times > 0), "{n_side}");
            }
        }
    }

    /// Merged pixels contain the directions of their parts, and their corners are those of a coarser grid.
    #[test]
    fn merged_pixels_are_those_of_a_coarser_grid() {
        let fine = grid(16);
        let mut random = Random(9);
        for level in 0..=4u32 {
            let coarse = grid(16 >> level);
            for _ in 0..20_000 {
                let w = random.direction();
                let (merged, expected) = (fine.place(w).merged(|_| level), coarse.locate(w));
                assert_eq!(merged.pixel, fine.locate(w).pixel);
                for (corner, expected) in merged.corners.into_iter().zip(expected.corners) {
                    assert!((fine.point(corner as usize) - coarse.point(expected as usize)).length() < 1e-12);
                }
                assert!((merged.u - expected.u).abs() < 1e-12 && (merged.v - expected.v).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn empty_pixels_become_their_parents() {
        let grid = grid(16);
        assert!(grid.merge(|_| true).iter().all(|level| *level == 4));
        assert!(grid.merge(|_| false).iter().all(|level| *level == 0));
        let all: usize = grid.corners_of(&grid.merge(|_| true)).iter().filter(|kept| **kept).count();
        assert_eq!(all, SphereGrid::new(1).unwrap().point_count());
        // One pixel with data keeps its three siblings apart, its parent's siblings a level up, and so on.
        let kept = grid.locate(direction(0.9, 1.0)).pixel;
        let levels = grid.merge(|pixel| pixel != kept);
        let count = |level: u8| levels.iter().filter(|l| **l == level).count();
        assert_eq!([count(0), count(1), count(2), count(3)], [4, 12, 48, 192]);
        assert_eq!(levels[kept as usize], 0);
    }
}
