//! The device's NeuBRDF against its definition, on every driver.

mod common;

use std::fmt::Write;
use std::sync::Arc;

use common::neubrdf_parity::{Deviation, TOLERANCE, compare, hard_directions};
use common::random_neubrdf::{Shape, Stream, random_neubrdf, random_pack};
use common::{LAVAPIPE, SWIFTSHADER, driver_for_kernels, values_of};
use glam::{DVec3, Vec2, Vec3};
use neubrdf::gpu::{Buffer, Device, Kernel, spirv};
use neubrdf::render::{NeuBrdfPush, NeuBrdfQuery, NeuBrdfShape, NeuBrdfValues, pack_neubrdf, pack_neubrdf_models};
use neubrdf::scene::brdf::{CornerWeights, Footprint, NeuBrdf, Precision, SamplingLobe};
use rayon::prelude::*;

/// What evaluates models of one shape.
struct Evaluation<'a> {
    device: &'a Arc<Device>,
    kernel: Kernel,
}

impl<'a> Evaluation<'a> {
    fn of(device: &'a Arc<Device>, shape: &NeuBrdfShape) -> Evaluation<'a> {
        let kernel = Kernel::new(device, spirv::load("eval_neubrdf").unwrap(), &shape.specialization()).unwrap();
        Evaluation { device, kernel }
    }

    /// The values of the model that begins at word `first` of a table.
    fn values(&self, words: &[u32], first: usize, queries: &[NeuBrdfQuery]) -> Vec<NeuBrdfValues> {
        let table = Buffer::with_data(self.device, "table", words).unwrap();
        let push = |queries_at, results| NeuBrdfPush {
            table: table.address() + 4 * first as u64,
            queries: queries_at,
            results,
            count: queries.len() as u32,
            padding: 0,
        };
        values_of(self.device, &self.kernel, queries, push)
    }
}

fn queries(n_side: u32, random_count: usize, hard_count: usize) -> Vec<NeuBrdfQuery> {
    let mut random = Stream(17);
    let hard = hard_directions(n_side);
    let above = |w: DVec3| DVec3::new(w.x, w.y, w.z.max(1e-6)).as_vec3();
    let query = |wo: Vec3, wi_1: Vec3, wi_2: Vec3| NeuBrdfQuery {
        wo: wo.into(),
        wi_1: wi_1.into(),
        wi_2: wi_2.into(),
        ..Default::default()
    };
    let mut found: Vec<NeuBrdfQuery> = (0..random_count)
        .map(|_| query(above(random.direction()), above(random.direction()), above(random.direction())))
        .collect();
    for index in 0..hard_count {
        let w = hard[index % hard.len()];
        let other = if index % 3 == 0 { hard[random.below(hard.len())] } else { above(random.direction()) };
        // In turn both hard, the one or the other, and ωi = ωo.
        found.push(if index % 2 == 0 { query(w, other, w) } else { query(other, w, other) });
    }
    // Places between and on the texels of any level, repeated and not, points and the whole; models that do not vary ignore them.
    let steps = [0.0, 1.0, -1.0, 0.5, 0.125, 1.0 - f32::EPSILON, -1e-9, 7.25];
    for query in &mut found {
        let mut coordinate = || match random.below(4) {
            0 => steps[random.below(steps.len())],
            _ => 4.0 * random.unit() as f32 - 2.0,
        };
        query.uv = [coordinate(), coordinate()];
        query.area = [0.0, 1e-4, 1e30, f32::INFINITY][random.below(4)];
        if random.below(2) == 0 {
            query.area = 4f32.powf(-8.0 * random.unit() as f32);
        }
    }
    found
}

/// Numbers are such that f16 holds them: all precisions give the same bits.
fn deviation(device: &Arc<Device>, brdf: &NeuBrdf, queries: &[NeuBrdfQuery], precisions: &[Precision]) -> Deviation {
    let evaluate = |precision: &Precision| {
        let shape = NeuBrdfShape::of([brdf], *precision).on(device);
        Evaluation::of(device, &shape).values(&pack_neubrdf(brdf, &shape), 0, queries)
    };
    let values: Vec<_> = precisions.iter().map(evaluate).collect();
    for others in &values[1..] {
        let same = |(a, b): (&NeuBrdfValues, &NeuBrdfValues)| [a.f_1, a.f_2] == [b.f_1, b.f_2];
        assert!(values[0].iter().zip(others).all(same), "precisions differ");
    }
    let results = queries.par_iter().zip(&values[0]);
    results
        .map(|(query, values)| {
            let numbers = values.f_1.iter().chain(&values.f_2);
            assert!(numbers.copied().all(|f| f.is_finite() && f >= 0.0), "{query:?} {values:?}");
            let NeuBrdfQuery { wo, wi_1, wi_2, uv, area } = *query;
            let footprint = Footprint { uv: Vec2::from(uv).as_dvec2(), area: area.into() };
            let compare = |wi, found| compare(brdf, footprint, wo, wi, found);
            compare(wi_1, values.f_1).merge(compare(wi_2, values.f_2))
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
        ("varying, 16 × 8 texels", Shape { surface: Some(([16, 8], 8)), n_side: 16, ..full }, 20_000, 10_000),
        (
            "varying, isotropic, 5 × 3 texels of 3 features",
            Shape { surface: Some(([5, 3], 3)), n_side: 8, is_isotropic: true, features: 5, ..full },
            5_000,
            5_000,
        ),
        (
            "varying, 8 × 8 texels with frames",
            Shape { surface: Some(([8, 8], 4)), has_frames: true, n_side: 8, hidden: &[32, 32], ..full },
            5_000,
            5_000,
        ),
        (
            "varying, isotropic, 5 × 3 texels with frames",
            Shape {
                surface: Some(([5, 3], 3)),
                has_frames: true,
                n_side: 8,
                is_isotropic: true,
                hidden: &[20],
                ..full
            },
            3_000,
            3_000,
        ),
        ("varying, of one texel", Shape { surface: Some(([1, 1], 1)), n_side: 4, hidden: &[20], ..full }, 2_000, 2_000),
        ("4 resolutions of 6 features", Shape { resolutions: 4, features: 6, n_side: 32, ..full }, 20_000, 10_000),
        (
            "3 resolutions, isotropic, uniform, pruned, varying",
            Shape {
                resolutions: 3,
                features: 4,
                is_isotropic: true,
                is_pruned: true,
                corner_weights: uniform,
                surface: Some(([4, 4], 3)),
                ..full
            },
            5_000,
            5_000,
        ),
        (
            "half vector, anisotropic",
            Shape { sees_half_vector: true, n_side: 16, resolutions: 3, features: 4, hidden: &[32, 32, 32], ..full },
            100_000,
            30_000,
        ),
        (
            "half vector, isotropic, pruned",
            Shape { sees_half_vector: true, is_isotropic: true, is_pruned: true, n_side: 16, features: 12, ..full },
            20_000,
            20_000,
        ),
        (
            "half vector, 5 × 3 texels with frames",
            Shape {
                sees_half_vector: true,
                surface: Some(([5, 3], 3)),
                has_frames: true,
                n_side: 8,
                hidden: &[20],
                ..full
            },
            3_000,
            3_000,
        ),
        ("five layers", Shape { features: 8, hidden: &[16, 32, 16, 8], n_side: 8, ..full }, 3_000, 3_000),
    ]
}

/// `share`: one of so many pairs. `is_small`: models are made small, and read as files hold them, for a driver that compiles slowly.
fn check(driver_name: &str, share: usize, is_small: bool) {
    let precisions = if is_small { &[Precision::F16][..] } else { &[Precision::F32, Precision::F16] };
    let Some(driver) = driver_for_kernels(driver_name) else { return };
    let mut text = String::new();
    let mut holds = true;
    for (seed, (name, mut shape, random_count, hard_count)) in models().into_iter().enumerate() {
        if is_small {
            let Shape { features, resolutions, hidden, .. } = shape;
            let hidden = if hidden.len() % 2 == 0 { &[8, 8][..] } else { &[8] };
            shape = Shape { features: features.min(4), resolutions: resolutions.min(2), hidden, ..shape };
        }
        let brdf = random_neubrdf(shape, seed as u64);
        let queries = queries(shape.n_side, random_count / share, hard_count / share);
        let found = deviation(&driver.device, &brdf, &queries, precisions);
        writeln!(text, "{name}: {found:?}").unwrap();
        let has_steps = shape.is_pruned || shape.has_frames || shape.corner_weights == CornerWeights::Uniform;
        holds &= found.worst <= TOLERANCE && (has_steps || found.at_steps == 0);
    }
    driver.finish();
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("target/evidence");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join(format!("neubrdf_parity_{}.txt", driver_name.to_lowercase())), &text).unwrap();
    eprintln!("{text}");
    assert!(holds, "{text}");
}

/// Members of a pack, which find their codes behind all models, have the values to the bit that they have alone.
fn check_pack(driver_name: &str) {
    let Some(driver) = driver_for_kernels(driver_name) else { return };
    let shape = Shape { n_side: 16, features: 4, is_isotropic: true, is_pruned: true, hidden: &[8, 8], ..Shape::FULL };
    for shares_network in [false, true] {
        let pack = random_pack(shape, 4, shares_network);
        let models = || pack.materials.iter().map(|(_, member)| member);
        let kernel = NeuBrdfShape::of(models(), Precision::F16).on(&driver.device);
        let evaluation = Evaluation::of(&driver.device, &kernel);
        let (words, firsts) = pack_neubrdf_models(models().map(|model| (model, &kernel)));
        let queries = queries(16, 300, 300);
        for (member, first) in models().zip(firsts) {
            let model = first as usize + SamplingLobe::FLOATS;
            let values = evaluation.values(&words, model, &queries);
            let alone = evaluation.values(&pack_neubrdf(member, &kernel), 0, &queries);
            for (query, (values, alone)) in queries.iter().zip(values.iter().zip(&alone)) {
                assert_eq!([values.f_1, values.f_2], [alone.f_1, alone.f_2]);
                assert!(compare(member, Footprint::WHOLE, query.wo, query.wi_1, values.f_1).worst <= TOLERANCE);
            }
        }
    }
    driver.finish();
}

#[test]
fn lavapipe_agrees_with_the_definition() {
    check(LAVAPIPE, 1, false);
}

#[test]
fn lavapipe_evaluates_members_of_packs_as_if_alone() {
    check_pack(LAVAPIPE);
}

#[test]
fn swiftshader_evaluates_members_of_packs_as_if_alone() {
    check_pack(SWIFTSHADER);
}

#[test]
fn swiftshader_agrees_with_the_definition() {
    check(SWIFTSHADER, 20, true);
}
