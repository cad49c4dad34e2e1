//! The device's NeuBRDF against its definition, on every driver.
//!
//! What a network computes is x = ln(1 + gain · f). Values agree when it does to 10⁻⁴: f to a relative 10⁻⁴ where it is not
//! small, and to 10⁻⁴ / gain where it is. Quarters of corners, and pixels of different size beside one another, make steps; next to
//! one the device may be on its other side: there the value has to agree with that of a direction 10⁻⁶ away. Everywhere else
//! the device is not excused from anything.

mod common;

use std::fmt::Write;
use std::sync::Arc;

use common::random_neubrdf::{Shape, Stream, random_neubrdf};
use common::{LAVAPIPE, SWIFTSHADER, driver};
use glam::{DVec3, Vec3};
use neubrdf::gpu::{Buffer, Commands, Device, Kernel, Memory, spirv};
use neubrdf::material::turned;
use neubrdf::render::{NeuBrdfPush, NeuBrdfQuery, NeuBrdfShape, NeuBrdfValues, pack_neubrdf};
use neubrdf::scene::brdf::{CornerWeights, NeuBrdf, Precision, SphereGrid};
use rayon::prelude::*;

/// How far x may be off.
const TOLERANCE: f64 = 1e-4;

/// How far from a step a direction may be taken to be on its other side.
const REACH: f64 = 1e-6;

fn evaluate(
    device: &Arc<Device>,
    brdf: &NeuBrdf,
    shape: &NeuBrdfShape,
    queries: &[NeuBrdfQuery],
) -> Vec<NeuBrdfValues> {
    let kernel = Kernel::new(device, spirv::load("eval_neubrdf").unwrap(), &shape.specialization()).unwrap();
    let table = Buffer::with_data(device, "table", &pack_neubrdf(brdf, shape)).unwrap();
    let input = Buffer::with_data(device, "queries", queries).unwrap();
    let bytes = size_of::<NeuBrdfValues>() * queries.len();
    let output = Buffer::new(device, "values", bytes as u64, Memory::Device).unwrap();
    let mut commands = Commands::begin(device).unwrap();
    let push = NeuBrdfPush {
        table: table.address(),
        queries: input.address(),
        results: output.address(),
        count: queries.len() as u32,
        padding: 0,
    };
    commands.dispatch(&kernel, kernel.groups_for(push.count), &push);
    device.submit(commands).unwrap().wait().unwrap();
    output.read().unwrap()
}

/// Directions at which something special happens.
fn hard_directions(n_side: u32) -> Vec<Vec3> {
    let mut found = vec![Vec3::Z];
    let grid = SphereGrid::new(n_side).unwrap();
    let lowest = |w: DVec3| DVec3::new(w.x, w.y, w.z.max(1e-6)).as_vec3();
    // Grid points: pole, borders and corners of faces, equator.
    let step = grid.point_count().div_ceil(300);
    found.extend((0..grid.point_count()).step_by(step).map(|point| lowest(grid.point(point))));
    found.extend((grid.point_count() - 8..grid.point_count()).map(|point| lowest(grid.point(point))));
    for azimuth in 0..16 {
        let (sin, cos) = (f64::from(azimuth) * std::f64::consts::PI / 8.0).sin_cos();
        for z in [1e-6, 1e-3, 0.3, 2.0 / 3.0, 0.9, 1.0 - 1e-6, 1.0 - 1e-12] {
            let rho = f64::sqrt(1.0 - z * z);
            found.push(DVec3::new(rho * cos, rho * sin, z).as_vec3());
        }
    }
    // φ = ±π to the bit, axes, denormals.
    for zero in [0.0, -0.0, 1e-40, -1e-40, 1e-30, -1e-20, 1e-18] {
        let signs = [(-0.6, zero), (0.6, zero), (zero, 0.6), (zero, -0.6)];
        found.extend(signs.map(|(x, y)| Vec3::new(x, y, 0.8)));
        found.push(Vec3::new(zero, zero, 1.0));
        found.push(Vec3::new(zero, -0.5 * zero, 1.0));
    }
    // Not unit vectors, by an ulp.
    let longer: Vec<Vec3> = found.iter().map(|w| w * (1.0 + f32::EPSILON)).collect();
    let shorter: Vec<Vec3> = found.iter().map(|w| w * (1.0 - f32::EPSILON / 2.0)).collect();
    [found, longer, shorter].concat().into_iter().filter(|w| w.z >= 1e-6).collect()
}

fn queries(n_side: u32, random_count: usize, hard_count: usize) -> Vec<NeuBrdfQuery> {
    let mut random = Stream(17);
    let hard = hard_directions(n_side);
    let above = |w: DVec3| DVec3::new(w.x, w.y, w.z.max(1e-6)).as_vec3();
    let query = |wo: Vec3, wi_1: Vec3, wi_2: Vec3| NeuBrdfQuery { wo: wo.into(), wi_1: wi_1.into(), wi_2: wi_2.into() };
    let mut found: Vec<NeuBrdfQuery> = (0..random_count)
        .map(|_| query(above(random.direction()), above(random.direction()), above(random.direction())))
        .collect();
    for index in 0..hard_count {
        let w = hard[index % hard.len()];
        let other = if index % 3 == 0 { hard[random.below(hard.len())] } else { above(random.direction()) };
        // In turn both hard, the one or the other, and ωi = ωo.
        found.push(if index % 2 == 0 { query(w, other, w) } else { query(other, w, other) });
    }
    found
}

/// Largest deviation of x, where, and how many pairs were next to a step.
#[derive(Clone, Debug, Default)]
struct Deviation {
    worst: f64,
    place: String,
    at_steps: usize,
    pairs: usize,
}

impl Deviation {
    fn merge(self, other: Deviation) -> Deviation {
        let (at_steps, pairs) = (self.at_steps + other.at_steps, self.pairs + other.pairs);
        let worse = if self.worst >= other.worst { self } else { other };
        Deviation { at_steps, pairs, ..worse }
    }
}

fn compare(brdf: &NeuBrdf, wo: [f32; 3], wi: [f32; 3], found: [f32; 3]) -> Deviation {
    let encoded = |f: DVec3| (f64::from(brdf.encoding.gain) * f).map(f64::ln_1p);
    let double = |w: [f32; 3]| Vec3::from(w).as_dvec3();
    let found = encoded(double(found));
    let difference = |wo, wi| (encoded(brdf.eval(wo, wi)) - found).abs().max_element();
    let inputs = [wo, wi].map(double);
    let mut deviation = Deviation { worst: difference(inputs[0], inputs[1]), pairs: 1, ..Deviation::default() };
    if deviation.worst > TOLERANCE {
        let places = |w: DVec3| {
            let (x, y) = w.normalize().any_orthonormal_pair();
            let shifts = [
                (0.0, 0.0),
                (1.0, 0.0),
                (-1.0, 0.0),
                (0.0, 1.0),
                (0.0, -1.0),
                (0.7, 0.7),
                (-0.7, 0.7),
                (0.7, -0.7),
                (-0.7, -0.7),
            ];
            shifts.map(|(s, t)| w + REACH * (s * x + t * y)).map(|w| DVec3::new(w.x, w.y, w.z.max(1e-6)))
        };
        // Of isotropic models, steps in what directions are turned to.
        let [wo, wi] = if brdf.is_isotropic { turned(inputs[0], inputs[1]) } else { inputs };
        let as_turned = NeuBrdf { is_isotropic: false, ..brdf.clone() };
        let difference = |wo, wi| (encoded(as_turned.eval(wo, wi)) - found).abs().max_element();
        let nearby = places(wo).into_iter().flat_map(|wo| places(wi).map(|wi| difference(wo, wi)));
        deviation.worst = nearby.fold(deviation.worst, f64::min);
        deviation.at_steps = 1;
    }
    deviation.place = format!("{wo:?} {wi:?}");
    deviation
}

/// Both precisions, since numbers are such that f16 holds them.
fn deviation(device: &Arc<Device>, brdf: &NeuBrdf, queries: &[NeuBrdfQuery]) -> Deviation {
    let [values, halves] = [Precision::F32, Precision::F16]
        .map(|precision| evaluate(device, brdf, &NeuBrdfShape::of([brdf], precision).on(device), queries));
    let results = queries.par_iter().zip(values.par_iter().zip(&halves));
    results
        .map(|(query, (values, halves))| {
            assert_eq!([values.f_1, values.f_2], [halves.f_1, halves.f_2]);
            let numbers = values.f_1.iter().chain(&values.f_2);
            assert!(numbers.copied().all(|f| f.is_finite() && f >= 0.0), "{query:?} {values:?}");
            compare(brdf, query.wo, query.wi_1, values.f_1).merge(compare(brdf, query.wo, query.wi_2, values.f_2))
        })
        .reduce(Deviation::default, Deviation::merge)
}

/// Models of all kinds, with the number of random pairs and of hard ones.
fn models() -> Vec<(&'static str, Shape, usize, usize)> {
    let full = Shape::FULL;
    let uniform = CornerWeights::Uniform;
    vec![
        ("anisotropic, bilinear, N_side 64", full, 500_000, 20_000),
        (
            "isotropic, bilinear, N_side 32, pruned",
            Shape { is_isotropic: true, n_side: 32, is_pruned: true, ..full },
            20_000,
            20_000,
        ),
        (
            "isotropic, uniform, N_side 128",
            Shape { is_isotropic: true, n_side: 128, corner_weights: uniform, ..full },
            5_000,
            5_000,
        ),
        (
            "anisotropic, uniform, pruned, N_side 16",
            Shape { n_side: 16, is_pruned: true, corner_weights: uniform, ..full },
            5_000,
            5_000,
        ),
        ("32 features, 128 wide", Shape { features: 32, hidden: &[128, 128, 128], n_side: 16, ..full }, 3_000, 3_000),
        (
            "3 features, layers of 5 and 6",
            Shape { features: 3, hidden: &[5, 6], n_side: 2, codes: 9, ..full },
            3_000,
            3_000,
        ),
        (
            "1 feature, one layer of 7, N_side 1",
            Shape { features: 1, hidden: &[7], n_side: 1, codes: 3, ..full },
            3_000,
            3_000,
        ),
        ("five layers", Shape { features: 8, hidden: &[16, 32, 16, 8], n_side: 8, ..full }, 3_000, 3_000),
    ]
}

fn check(driver_name: &str, share: usize) {
    let Some(driver) = driver(driver_name) else { return };
    let mut text = String::new();
    let mut holds = true;
    for (seed, (name, shape, random_count, hard_count)) in models().into_iter().enumerate() {
        let brdf = random_neubrdf(shape, seed as u64);
        let queries = queries(shape.n_side, random_count / share, hard_count / share);
        let found = deviation(&driver.device, &brdf, &queries);
        writeln!(text, "{name}: {found:?}").unwrap();
        let has_steps = shape.is_pruned || shape.corner_weights == CornerWeights::Uniform;
        holds &= found.worst <= TOLERANCE && (has_steps || found.at_steps == 0);
    }
    driver.finish();
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("target/evidence");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join(format!("neubrdf_parity_{}.txt", driver_name.to_lowercase())), &text).unwrap();
    eprintln!("{text}");
    assert!(holds, "{text}");
}

#[test]
fn lavapipe_agrees_with_the_definition() {
    check(LAVAPIPE, 1);
}

#[test]
fn swiftshader_agrees_with_the_definition() {
    check(SWIFTSHADER, 20);
}
