//! Tables and samples of surfaces that are known, as the files of measured BRDFs hold them.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec2, DVec3, Vec2};
use neubrdf::material::{Conductor, Ggx, Reflectance};
use neubrdf::scene::{HalfDifference, Merl, Rgl, RglTable, RglTables, RglWarp, Sparse, SparseSample};

/// A tinted rough metal.
pub fn metal(alpha_x: f32, alpha_y: f32) -> Conductor {
    Conductor {
        reflectance: Reflectance::Schlick { f0: DVec3::new(0.9, 0.6, 0.3) },
        roughness: Ggx::new(Vec2::new(alpha_x, alpha_y)),
    }
}

/// A MERL table of a metal; directions below the surface are not measured.
pub fn merl(metal: &Conductor) -> Merl {
    Merl::tabulate(|angles| {
        let (wo, wi) = HalfDifference::directions(angles);
        (wo.z.min(wi.z) > 0.0).then(|| metal.eval(wo, wi).as_vec3())
    })
}

/// Samples of a metal for pairs of directions.
pub fn sparse(metal: &Conductor, is_isotropic: bool, pairs: impl Iterator<Item = (DVec3, DVec3)>) -> Sparse {
    let sample = |(wo, wi)| SparseSample { wi, wo, value: metal.eval(wo, wi).as_vec3() };
    Sparse::new(pairs.map(sample).collect(), is_isotropic)
}

/// The direction at a place of the tables.
fn direction(u: DVec2) -> DVec3 {
    let ((sine, cosine), phi) = ((u.x * u.x * FRAC_PI_2).sin_cos(), (2.0 * u.y - 1.0) * PI);
    DVec3::new(sine * phi.cos(), sine * phi.sin(), cosine)
}

fn grid(width: usize, height: usize) -> impl Iterator<Item = DVec2> {
    let place =
        move |i: usize| DVec2::new((i % width) as f64 / (width - 1) as f64, (i / width) as f64 / (height - 1) as f64);
    (0..width * height).map(place)
}

fn table(width: usize, height: usize, value: impl Fn(DVec2) -> f64) -> RglTable {
    RglTable { width, height, values: grid(width, height).map(|u| value(u) as f32).collect() }
}

/// Tables of a metal, for the azimuths `phi` of the viewer.
pub fn rgl(metal: &Conductor, phi: Vec<f32>, size: usize) -> Rgl {
    let ggx = metal.roughness.unwrap();
    let theta: Vec<f32> = (0..12).map(|i| ((i as f32 / 11.0).powf(0.7)) * 1.5607).collect();
    let is_isotropic = phi.len() <= 2;
    let mut rgl = RglTables {
        description: "a metal".into(),
        phi,
        theta,
        ndf: table(2 * size, 2 * size, |u| ggx.distribution(direction(u))),
        sigma: table(2 * size, 2 * size, |u| projected_area(ggx, direction(u))),
        vndf: RglTable { width: size, height: size, values: Vec::new() },
        rgb: RglTable { width: size, height: size, values: Vec::new() },
        has_jacobian: true,
    };
    let viewers: Vec<DVec3> = rgl
        .phi
        .iter()
        .flat_map(|phi| rgl.theta.iter().map(|theta| viewer(f64::from(*phi), f64::from(*theta))))
        .collect();
    // Normals of isotropic materials are told by their azimuth from the viewer's.
    let normal = |viewer: DVec3, u: DVec2| {
        let turn = if is_isotropic { viewer.y.atan2(viewer.x) } else { 0.0 };
        glam::DMat3::from_rotation_z(turn) * direction(u)
    };
    for wo in &viewers {
        let density = |u: DVec2| {
            let m = normal(*wo, u);
            ggx.distribution(m) * wo.dot(m).max(0.0) * (u.x * u.x * FRAC_PI_2).sin() * u.x
        };
        rgl.vndf.values.extend(table(size, size, density).values);
    }
    let warp = RglWarp::new(&rgl.vndf);
    for (slice, wo) in viewers.iter().enumerate() {
        let values: Vec<DVec3> = grid(size, size)
            .map(|s| {
                let m = normal(*wo, sample(&rgl.vndf, &warp, slice, s));
                let wi = 2.0 * wo.dot(m) * m - *wo;
                let visible =
                    ggx.masking_shadowing(*wo, DVec3::new(wi.x, wi.y, wi.z.max(1e-3)).normalize()) / ggx.masking(*wo);
                metal.reflectance.at(wo.dot(m).max(0.0)) * visible
            })
            .collect();
        (0..3).for_each(|channel| rgl.rgb.values.extend(values.iter().map(|value| value[channel] as f32)));
    }
    Rgl::new(rgl)
}

fn viewer(phi: f64, theta: f64) -> DVec3 {
    DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
}

/// The area of facets seen from `w` over that of the surface: cos θ / G1.
fn projected_area(ggx: Ggx, w: DVec3) -> f64 {
    let w = w.with_z(w.z.max(1e-9));
    w.z / ggx.masking(w)
}

/// The place that sampling a density in a table picks for two numbers: what evaluation inverts.
fn sample(table: &RglTable, warp: &RglWarp, slice: usize, s: DVec2) -> DVec2 {
    let (width, height) = (table.width, table.height);
    let at = |numbers: &[f32], x: usize, y: usize| f64::from(numbers[(slice * height + y) * width + x]);
    let marginal: Vec<f64> = (0..height).map(|y| f64::from(warp.marginal[slice * height + y])).collect();
    let (row, y) = solve(&marginal, |y| at(&warp.conditional, width - 1, y), s.y);
    let lerp = |a: f64, b: f64| a + (b - a) * y;
    let conditional: Vec<f64> =
        (0..width).map(|x| lerp(at(&warp.conditional, x, row), at(&warp.conditional, x, row + 1))).collect();
    let density = |x: usize| lerp(at(&warp.density, x, row), at(&warp.density, x, row + 1));
    let (column, x) = solve(&conditional, density, s.x * conditional[width - 1]);
    DVec2::new((column as f64 + x) / (width - 1) as f64, (row as f64 + y) / (height - 1) as f64)
}

/// The cell, and the place in it, up to which a piecewise linear density integrates to `target`.
fn solve(integral: &[f64], density: impl Fn(usize) -> f64, target: f64) -> (usize, f64) {
    let cell = integral.partition_point(|before| *before <= target).clamp(1, integral.len() - 1) - 1;
    let (a, b, rest) = (density(cell), density(cell + 1), target - integral[cell]);
    // a t + (b − a) t²/2 = rest
    let root = (a * a + 2.0 * (b - a) * rest).max(0.0).sqrt();
    (cell, (2.0 * rest / (a + root).max(1e-300)).clamp(0.0, 1.0))
}
