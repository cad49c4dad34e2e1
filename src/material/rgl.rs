//! The RGL's adaptively parameterised BRDFs, evaluated. Dupuy and Jakob, *An Adaptive Parameterization for Efficient Material
//! Acquisition and Rendering*, SIGGRAPH Asia 2018, §5.
//!
//! f(wo, wi)·cos θi = rgb(s)·D(m) / 4σ(wo), where m is the half vector and s the two numbers for which importance sampling of the normals
//! that `wo` sees would have picked m. As in the paper it is the viewer's side that the tables are adapted to; reciprocity is that
//! of the measurement.

use std::f64::consts::{FRAC_2_PI, PI, TAU};

use glam::{DVec2, DVec3};

use crate::scene::{Rgl, RglTable, RglTables, RglWarp};

/// σ counts as at least this, lest a table with zeros in it divide by them.
const LEAST_SIGMA: f64 = 1e-5;

impl Rgl {
    /// f(wo, wi), see [`super::Evaluate::eval`].
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let (rgl, warp) = (self.tables(), self.warp());
        let flip = symmetry(rgl.reduction(), wo);
        let (wo, half) = (wo * flip, (wo + wi).normalize() * flip);
        let phi = wo.y.atan2(wo.x);
        let normal_phi = half.y.atan2(half.x) - if rgl.is_isotropic() { phi } else { 0.0 };
        let viewer = DVec2::new(across(wo), (phi + PI) / TAU);
        let normal = DVec2::new(across(half), ((normal_phi + PI) / TAU).rem_euclid(1.0));
        let slices = slices(rgl, phi, angle_to_normal(wo));
        let sample = invert(rgl, warp, &slices, normal);

        let channel = |channel: usize| {
            let each = |&(slice, weight): &(usize, f64)| weight * interpolate(&rgl.rgb, 3 * slice + channel, sample);
            slices.iter().map(each).sum::<f64>().max(0.0)
        };
        let rgb = DVec3::new(channel(0), channel(1), channel(2));
        let facets = if rgl.has_jacobian {
            interpolate(&rgl.ndf, 0, normal) / (4.0 * interpolate(&rgl.sigma, 0, viewer).max(LEAST_SIGMA))
        } else {
            1.0
        };
        rgb * (facets / wi.z)
    }
}

/// The signs that bring the viewer to the azimuths that are tabulated.
fn symmetry(reduction: u32, wo: DVec3) -> DVec3 {
    let towards_negative = |x: f64| if x > 0.0 { -1.0 } else { 1.0 };
    match reduction {
        2 => DVec3::new(towards_negative(wo.y), towards_negative(wo.y), 1.0),
        4 => DVec3::new(towards_negative(wo.x), towards_negative(wo.y), 1.0),
        _ => DVec3::ONE,
    }
}

fn angle_to_normal(w: DVec3) -> f64 {
    w.truncate().length().atan2(w.z)
}

/// √(2θ/π).
fn across(w: DVec3) -> f64 {
    (angle_to_normal(w) * FRAC_2_PI).sqrt()
}

/// The tables to interpolate between for a viewer, with their weights.
fn slices(rgl: &RglTables, phi: f64, theta: f64) -> [(usize, f64); 4] {
    let [(phi_0, weight_0), (phi_1, weight_1)] =
        if rgl.is_isotropic() { [(0, 1.0), (0, 0.0)] } else { bracket(&rgl.phi, phi) };
    let [(theta_0, weight_2), (theta_1, weight_3)] = bracket(&rgl.theta, theta);
    let thetas = rgl.theta.len();
    [
        (phi_0 * thetas + theta_0, weight_0 * weight_2),
        (phi_0 * thetas + theta_1, weight_0 * weight_3),
        (phi_1 * thetas + theta_0, weight_1 * weight_2),
        (phi_1 * thetas + theta_1, weight_1 * weight_3),
    ]
}

/// The two entries of an ascending axis about a number, with their weights.
fn bracket(axis: &[f32], at: f64) -> [(usize, f64); 2] {
    if axis.len() == 1 {
        return [(0, 1.0), (0, 0.0)];
    }
    let upper = axis.partition_point(|entry| f64::from(*entry) <= at).clamp(1, axis.len() - 1);
    let (low, high) = (f64::from(axis[upper - 1]), f64::from(axis[upper]));
    let fraction = ((at - low) / (high - low)).clamp(0.0, 1.0);
    [(upper - 1, 1.0 - fraction), (upper, fraction)]
}

/// The cell of a table that a position in [0, 1]² is in, and where in it.
fn cell(table: &RglTable, at: DVec2) -> ([usize; 2], DVec2) {
    let position = at.clamp(DVec2::ZERO, DVec2::ONE) * DVec2::new((table.width - 1) as f64, (table.height - 1) as f64);
    let column = (position.x as usize).min(table.width - 2);
    let row = (position.y as usize).min(table.height - 2);
    ([column, row], position - DVec2::new(column as f64, row as f64))
}

/// One of the tables at a position in [0, 1]².
fn interpolate(table: &RglTable, index: usize, at: DVec2) -> f64 {
    let ([column, row], within) = cell(table, at);
    let entry =
        |dx: usize, dy: usize| f64::from(table.values[(index * table.height + row + dy) * table.width + column + dx]);
    lerp(lerp(entry(0, 0), entry(1, 0), within.x), lerp(entry(0, 1), entry(1, 1), within.x), within.y)
}

/// The two numbers for which sampling picks `normal`: first its row by the marginal, then its place in the row.
fn invert(rgl: &RglTables, warp: &RglWarp, slices: &[(usize, f64); 4], normal: DVec2) -> DVec2 {
    let RglTable { width, height, .. } = rgl.vndf;
    let ([column, row], within) = cell(&rgl.vndf, normal);
    let blend = |numbers: &[f32], index: &dyn Fn(usize) -> usize| -> f64 {
        slices.iter().map(|&(slice, weight)| weight * f64::from(numbers[index(slice)])).sum()
    };
    let entry = |numbers: &[f32], x: usize, y: usize| blend(numbers, &|slice| (slice * height + y) * width + x);
    let rows = [row, row + 1].map(|y| entry(&warp.conditional, width - 1, y));
    let before = [row, row + 1].map(|y| entry(&warp.conditional, column, y));
    let [left, right] =
        [column, column + 1].map(|x| lerp(entry(&warp.density, x, row), entry(&warp.density, x, row + 1), within.y));
    let row_total = lerp(rows[0], rows[1], within.y);
    let along = lerp(before[0], before[1], within.y) + part(left, right, within.x);
    let down = blend(&warp.marginal, &|slice| slice * height + row) + part(rows[0], rows[1], within.y);
    DVec2::new(if row_total > 0.0 { along / row_total } else { 0.0 }, down)
}

/// ∫ from 0 to `end` of what is linear between `a` at 0 and `b` at 1.
fn part(a: f64, b: f64, end: f64) -> f64 {
    end * (a + end * (b - a) / 2.0)
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}
