//! Cells on the sphere of directions that are fine where a lobe is narrow, and integrals over them.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use neubrdf::material::{Prepared, orthonormal_basis};
use neubrdf::scene::Surface;

use crate::configurations::Configuration;

const RINGS: usize = 40;
const SECTORS: usize = 20;

/// The hemisphere of one sign of z, in rings and sectors about the direction where a lobe is expected. The angle from it
/// goes logarithmically, from the lobe's width on.
pub struct Chart {
    upper: bool,
    axes: [DVec3; 3],
    width: f64,
}

impl Chart {
    fn new(upper: bool, center: DVec3, width: f64) -> Chart {
        let (tangent, bitangent) = orthonormal_basis(center);
        Chart { upper, axes: [tangent, bitangent, center], width }
    }

    fn log_range(&self) -> f64 {
        (PI / self.width).ln_1p()
    }

    /// The cell of a direction, counted within the chart.
    fn cell(&self, w: DVec3) -> usize {
        let [x, y, z] = self.axes.map(|axis| w.dot(axis));
        let theta = x.hypot(y).atan2(z);
        let ring = (theta / self.width).ln_1p() / self.log_range() * RINGS as f64;
        let sector = (y.atan2(x) / TAU).rem_euclid(1.0) * SECTORS as f64;
        (ring as usize).min(RINGS - 1) * SECTORS + (sector as usize).min(SECTORS - 1)
    }

    /// The direction at ring and sector coordinates in [0, 1], and the solid angle per unit square of them.
    fn direction(&self, ring: f64, sector: f64) -> (DVec3, f64) {
        let theta = self.width * (ring * self.log_range()).exp_m1();
        let (sine, cosine) = theta.sin_cos();
        let (y, x) = (sector * TAU).sin_cos();
        let [tangent, bitangent, center] = self.axes;
        let w = (tangent * x + bitangent * y) * sine + center * cosine;
        (w, TAU * sine * (theta + self.width) * self.log_range())
    }
}

/// A partition of the sphere, or of the half of it where a surface scatters to.
pub struct Cells {
    charts: Vec<Chart>,
}

impl Cells {
    /// Cells about the directions where a surface reflects and refracts `wo`.
    pub fn around_lobes(Configuration { surface, prepared, wo, .. }: &Configuration) -> Cells {
        let wo = *wo;
        let mirrored = DVec3::new(-wo.x, -wo.y, wo.z);
        let (width, refraction) = match *surface {
            Surface::Diffuse { .. } => (1.0, None),
            Surface::Conductor { alpha, .. } => (f64::from(alpha.x * alpha.y).sqrt(), None),
            Surface::Coated { alpha, .. } => (f64::from(alpha), None),
            Surface::Dielectric { ior, alpha } => {
                let eta = if wo.z > 0.0 { f64::from(ior) } else { 1.0 / f64::from(ior) };
                let across = -wo.truncate() / eta;
                let refracted = across.extend(-wo.z.signum() * (1.0 - across.length_squared()).max(0.0).sqrt());
                (f64::from(alpha), Some(refracted.normalize()))
            }
            Surface::Measured { .. } => match prepared {
                Prepared::LobeSampled { lobe, .. } => {
                    let [x, y] = lobe.alpha[0].map(f64::from);
                    ((x * y).sqrt(), None)
                }
                _ => (1.0, None),
            },
        };
        let width = width.clamp(1e-4, 1.0);
        let above = wo.z > 0.0;
        let reflection = Chart::new(above, mirrored, width);
        let refraction = refraction.map(|center| Chart::new(!above, center, width));
        Cells { charts: std::iter::once(reflection).chain(refraction).collect() }
    }

    /// How many cells there are.
    pub fn len(&self) -> usize {
        self.charts.len() * RINGS * SECTORS
    }

    /// The cell of a direction; `None` outside the half that the cells cover.
    pub fn cell(&self, w: DVec3) -> Option<usize> {
        let chart = self.charts.iter().position(|chart| chart.upper == (w.z > 0.0))?;
        Some(chart * RINGS * SECTORS + self.charts[chart].cell(w))
    }

    /// ∫f dω over each cell, each of the pieces that it takes to within `tolerance`.
    pub fn integrals(&self, f: impl Fn(DVec3) -> f64, tolerance: f64) -> Vec<f64> {
        let mut integrals = Vec::with_capacity(self.len());
        for chart in &self.charts {
            let integrand = |ring, sector| {
                let (w, area) = chart.direction(ring, sector);
                if chart.upper == (w.z > 0.0) { f(w) * area } else { 0.0 }
            };
            let is_above = |[ring, sector]: [f64; 2]| chart.direction(ring, sector).0.z > 0.0;
            for ring in 0..RINGS {
                for sector in 0..SECTORS {
                    let corner = [ring as f64 / RINGS as f64, sector as f64 / SECTORS as f64];
                    let size = [1.0 / RINGS as f64, 1.0 / SECTORS as f64];
                    let rectangle = Rectangle { corner, size };
                    let whole = gauss(&integrand, rectangle);
                    integrals.push(adaptive(&integrand, &is_above, rectangle, whole, tolerance, DEEPEST));
                }
            }
        }
        integrals
    }
}

/// A part of a chart.
#[derive(Clone, Copy)]
struct Rectangle {
    corner: [f64; 2],
    size: [f64; 2],
}

impl Rectangle {
    fn corners(self) -> [[f64; 2]; 4] {
        [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
            .map(|[x, y]| [self.corner[0] + x * self.size[0], self.corner[1] + y * self.size[1]])
    }

    fn quarters(self) -> [Rectangle; 4] {
        let size = self.size.map(|s| s / 2.0);
        Rectangle { corner: self.corner, size }.corners().map(|corner| Rectangle { corner, size })
    }
}

/// How often a rectangle may be quartered, and down to which level one that the horizon crosses is.
const DEEPEST: u32 = 8;
const HORIZON: u32 = 3;

/// The integral over a rectangle: it is quartered until the quarters agree with the whole.
fn adaptive(
    f: &impl Fn(f64, f64) -> f64,
    is_above: &impl Fn([f64; 2]) -> bool,
    rectangle: Rectangle,
    whole: f64,
    tolerance: f64,
    depth: u32,
) -> f64 {
    let quarters = rectangle.quarters();
    let integrals = quarters.map(|quarter| gauss(f, quarter));
    let sum = integrals.iter().sum::<f64>();
    let above = rectangle.corners().map(is_above);
    let is_crossed = depth > HORIZON && above.iter().any(|&corner| corner != above[0]);
    if depth == 0 || (!is_crossed && (sum - whole).abs() < tolerance) {
        return sum;
    }
    let part = |(&quarter, integral)| adaptive(f, is_above, quarter, integral, tolerance, depth - 1);
    quarters.iter().zip(integrals).map(part).sum()
}

/// Gauss-Legendre quadrature with four by four points.
fn gauss(f: &impl Fn(f64, f64) -> f64, Rectangle { corner, size }: Rectangle) -> f64 {
    const POINTS: [(f64, f64); 4] = [
        (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
        (0.330_009_478_207_571_87, 0.326_072_577_431_273_1),
        (0.669_990_521_792_428_1, 0.326_072_577_431_273_1),
        (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
    ];
    let mut sum = 0.0;
    for (x, weight_x) in POINTS {
        for (y, weight_y) in POINTS {
            sum += weight_x * weight_y * f(corner[0] + x * size[0], corner[1] + y * size[1]);
        }
    }
    sum * size[0] * size[1]
}

/// A random number generator for tests: SplitMix64 (Steele, Lea and Flood 2014).
pub struct Random(pub u64);

impl Random {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In [0, 1), with the 24 bits that an `f32` holds.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 40) as f64 / (1u64 << 24) as f64
    }

    /// Three of them.
    pub fn units(&mut self) -> [f64; 3] {
        [self.unit(), self.unit(), self.unit()]
    }

    /// A uniform direction.
    pub fn direction(&mut self) -> DVec3 {
        let z = 2.0 * self.unit() - 1.0 + 1.0 / (1u64 << 24) as f64;
        let (y, x) = (TAU * self.unit()).sin_cos();
        let sine = (1.0 - z * z).sqrt();
        DVec3::new(sine * x, sine * y, z)
    }
}
