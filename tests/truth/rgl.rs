//! RGL tensor files: against the function that they were made of, and against Mitsuba.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use glam::{DVec2, DVec3};
use neubrdf::material::{Conductor, Ggx, RglWarp, rgl_eval};
use neubrdf::scene::{Rgl, RglTable};

use crate::random::{Random, metal};

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
pub fn tabulate(metal: &Conductor, phi: Vec<f32>, size: usize) -> Rgl {
    let ggx = metal.roughness.unwrap();
    let theta: Vec<f32> = (0..12).map(|i| ((i as f32 / 11.0).powf(0.7)) * 1.5607).collect();
    let is_isotropic = phi.len() <= 2;
    let mut rgl = Rgl {
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
    let warp = RglWarp::new(&rgl);
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
    rgl
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

fn isotropic() -> (Conductor, Rgl) {
    let metal = metal(0.3, 0.3);
    let tables = tabulate(&metal, vec![0.0], 32);
    (metal, tables)
}

/// Of the given symmetry.
fn anisotropic(reduction: u32) -> (Conductor, Rgl) {
    let metal = metal(0.25, 0.5);
    let steps = 32 / reduction;
    let phi = (0..=steps).map(|i| (-PI + TAU * f64::from(i) / 32.0) as f32).collect();
    let tables = tabulate(&metal, phi, 32);
    assert_eq!(tables.reduction(), reduction);
    (metal, tables)
}

fn saved(tables: &Rgl, folder: &Path) -> Rgl {
    let path = folder.join("metal.bsdf");
    tables.save(&path).unwrap();
    Rgl::load(&path).unwrap()
}

#[test]
fn tables_are_the_function_that_they_were_made_of() {
    let folder = tempfile::tempdir().unwrap();
    for (metal, tables) in [isotropic(), anisotropic(1), anisotropic(2), anisotropic(4)] {
        let read = saved(&tables, folder.path());
        assert_eq!(read, tables);
        let warp = RglWarp::new(&read);
        let mut random = Random(1);
        let (mut sum, mut worst) = (0.0, 0f64);
        const COUNT: u32 = 4000;
        for _ in 0..COUNT {
            let (wo, wi) = (random.above(0.2), random.above(0.2));
            let (found, expected) = (rgl_eval(&read, &warp, wo, wi), metal.eval(wo, wi));
            let error = (found - expected).abs().max_element() / expected.max_element();
            sum += error;
            worst = worst.max(error);
        }
        let mean = sum / f64::from(COUNT);
        assert!(mean < 0.03 && worst < 0.4, "{} azimuths: mean {mean}, worst {worst}", tables.phi.len());
    }
}

#[test]
fn mitsuba_gives_the_same_values() {
    let Some(python) = std::env::var_os("MITSUBA_PYTHON") else {
        return eprintln!("skipped: MITSUBA_PYTHON names no Python that has Mitsuba 3");
    };
    let folder = tempfile::tempdir().unwrap();
    for (_, tables) in [isotropic(), anisotropic(1), anisotropic(2), anisotropic(4)] {
        let read = saved(&tables, folder.path());
        let warp = RglWarp::new(&read);
        let mut random = Random(2);
        let pairs: Vec<_> = (0..4000).map(|_| (random.above(0.02), random.above(0.02))).collect();
        let numbers = |(wo, wi): &(DVec3, DVec3)| format!("{} {} {} {} {} {}\n", wo.x, wo.y, wo.z, wi.x, wi.y, wi.z);
        let input: String = pairs.iter().map(numbers).collect();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/truth/measured.py");
        let mut child = Command::new(&python)
            .arg(script)
            .arg(folder.path().join("metal.bsdf"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap().unwrap();
        assert!(output.status.success(), "{python:?} failed");
        let output = String::from_utf8(output.stdout).unwrap();
        let mut worst = (0.0, String::new());
        let mut count = 0;
        for ((wo, wi), line) in pairs.iter().zip(output.lines()) {
            let theirs: Vec<f64> = line.split_whitespace().map(|number| number.parse().unwrap()).collect();
            let ours = rgl_eval(&read, &warp, *wo, *wi) * wi.z;
            let error = (ours - DVec3::from_slice(&theirs)).abs().max_element() / ours.max_element();
            if error > worst.0 {
                worst = (error, format!("{ours}, not {theirs:?}: wo {wo} wi {wi}"));
            }
            count += 1;
        }
        assert_eq!(count, pairs.len());
        eprintln!("{} azimuths: worst relative difference {:.1e}", tables.phi.len(), worst.0);
        assert!(worst.0 < 1e-3, "{}: {}", worst.0, worst.1);
    }
}
