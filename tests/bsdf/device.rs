//! The shaders against the CPU's definitions, on every driver.
//!
//! A value is compared with what the definition gives for the same `f32` input. Where the value itself hardly changes
//! when an input changes by an ulp, they agree to 10⁻⁴. Elsewhere (the flank of a lobe 10⁻⁴ wide moves by a percent)
//! no arithmetic in `f32` can do that; there the shader has to be exact for an input a few ulp away: it may differ by
//! [`ULPS`] times the sum of what an ulp in each input changes.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use neubrdf::gpu::{Buffer, Device, Kernel, spirv};
use neubrdf::material::{self, Bsdf, BsdfSample, Prepared};
use neubrdf::render::{Family, MaterialTable, NeuBrdfKernels, family};
use neubrdf::scene::brdf::Precision;
use neubrdf::scene::{Brdf, Material, Surface};
use rayon::prelude::*;

use crate::common::bsdf_structs::{BsdfTestCase, BsdfTestPush, BsdfTestResult};
use crate::common::{LAVAPIPE, on_both_drivers, values_of};
use crate::configurations::{self, Configuration, coated, describe, diffuse, glass, gold, schlick};
use crate::networks;
use crate::sampling::{Histogram, SAMPLES, hard_direction, judge, write_evidence};
use crate::sphere::Random;
use crate::truths;

/// How many ulp of its inputs a shader may be off.
const ULPS: f64 = 64.0;

/// How far a well-conditioned value may be off.
const RELATIVE: f64 = 1e-4;

/// Smaller numbers are as good as 0.
const TINY: f64 = 1e-30;

/// The values from which on the relative difference counts. What a network gives is e to the power of a sum, less 1: near 0 the sum's
/// terms cancel, and it is known to an ulp of the largest.
fn least_value(bsdf: &Bsdf) -> f64 {
    if matches!(bsdf, Bsdf::LobeSampled(_)) { 1e-3 } else { TINY }
}

/// The kernels of a device that were built so far, by name and constants: drivers take seconds for one.
type Kernels = HashMap<(String, Vec<(u32, u32)>), Arc<Kernel>>;

/// A family's test kernel and the surfaces that it knows.
pub struct Shader {
    device: Arc<Device>,
    kernel: Arc<Kernel>,
    materials: Buffer,
    _tables: Vec<Buffer>,
}

impl Shader {
    pub fn new(device: &Arc<Device>, surfaces: &[Surface], brdfs: &[Arc<Brdf>]) -> Shader {
        let materials: Vec<Material> = surfaces.iter().map(as_material).collect();
        Shader::with(&mut Kernels::new(), device, &materials, brdfs)
    }

    /// The same with a kernel that may have been built before.
    fn with(kernels: &mut Kernels, device: &Arc<Device>, materials: &[Material], brdfs: &[Arc<Brdf>]) -> Shader {
        let kernel_name = format!("test_bsdf_{}", family(&materials[0].surface, brdfs).name());
        let packed = MaterialTable::new(materials, brdfs, NeuBrdfKernels::one(brdfs, Precision::F32));
        let is_mapped = materials.iter().any(|material| material.roughness_map.is_some());
        let upload = |table: &Vec<u32>| Buffer::with_data(device, "material table", table).unwrap();
        let tables: Vec<Buffer> = packed.tables.iter().map(upload).collect();
        let addresses: Vec<u64> = tables.iter().map(Buffer::address).collect();
        let materials = Buffer::with_data(device, "materials", &packed.records(&addresses)).unwrap();
        let mut constants = packed.kernels.shapes()[0].on(device).specialization().to_vec();
        constants.push((17, is_mapped.into()));
        let source = spirv::load(&kernel_name).unwrap();
        let build = || Arc::new(Kernel::new(device, source, &constants).unwrap());
        let kernel = kernels.entry((kernel_name, constants.clone())).or_insert_with(build).clone();
        Shader { device: device.clone(), kernel, materials, _tables: tables }
    }

    pub fn run(&self, cases: &[BsdfTestCase]) -> Vec<BsdfTestResult> {
        let push = |cases_at, results| BsdfTestPush {
            materials: self.materials.address(),
            cases: cases_at,
            results,
            count: cases.len() as u32,
            pad: 0,
        };
        values_of(&self.device, &self.kernel, cases, push)
    }
}

pub fn as_material(surface: &Surface) -> Material {
    Material::new(describe(surface), surface.clone())
}

pub fn case(material: usize, wo: DVec3, wi: DVec3, u: [f64; 3]) -> BsdfTestCase {
    BsdfTestCase {
        wo: wo.as_vec3().into(),
        material: material as u32,
        wi: wi.as_vec3().into(),
        pad: 0,
        u: u.map(|u| u as f32),
        pad_2: 0,
    }
}

/// The surfaces of a family, from harmless to hard.
fn surfaces(family: Family, brdfs: &[Arc<Brdf>]) -> Vec<Surface> {
    let white = Vec3::ONE;
    let tint = Vec3::new(0.9, 0.5, 0.1);
    let alphas = [1e-4, 1e-3, 0.01, 0.05, 0.2, 0.5, 1.0, 0.0];
    match family {
        Family::Diffuse => vec![diffuse()],
        Family::Conductor => {
            let mut surfaces = vec![schlick(tint, 0.02, 0.6), schlick(white, 1e-4, 1.0), gold(0.3, 0.05)];
            surfaces.extend(alphas.map(|alpha| gold(alpha, alpha)));
            surfaces
        }
        Family::Dielectric => {
            let iors = [1.5, 2.4, 0.7, 10.0, 1.01, 1.0005];
            alphas.iter().flat_map(|&alpha| iors.map(|ior| glass(ior, alpha))).chain([glass(1.0, 0.3)]).collect()
        }
        Family::Coated => {
            let iors = [1.5, 1.1, 3.0];
            let rough = alphas.iter().flat_map(|&alpha| iors.map(|ior| coated(tint, ior, alpha)));
            rough.chain([coated(white, 1.0, 0.1), coated(Vec3::ZERO, 1.5, 0.1)]).collect()
        }
        Family::Layered => truths::layered(),
        Family::Woven => truths::woven(),
        Family::Nbrdf | Family::NeuBrdf | Family::Merl | Family::Rgl | Family::Sparse => {
            let measured = (0..brdfs.len() as u32).map(|brdf| Surface::Measured { brdf });
            measured.filter(|surface| neubrdf::render::family(surface, brdfs) == family).collect()
        }
    }
}

/// Directions and random numbers for each surface in turn: uniform ones, pairs that a lobe joins, and hard ones.
pub fn cases(surfaces: &[Surface], prepared: &[Arc<Prepared>], count: usize) -> Vec<BsdfTestCase> {
    let mut random = Random(surfaces.len() as u64);
    let single = |w: DVec3| w.as_vec3().as_dvec3();
    (0..count)
        .map(|i| {
            let material = i % surfaces.len();
            let surface = &surfaces[material];
            let kind = (i / surfaces.len()) as u64;
            let is_hard = kind % 4 == 3;
            let mut wo = if is_hard { hard_direction(&mut random, kind / 4) } else { random.direction() };
            if !matches!(surface, Surface::Dielectric { .. }) && !kind.is_multiple_of(16) {
                wo.z = wo.z.abs();
            }
            let wo = single(wo);
            let u = random.units();
            let bsdf = Bsdf::new(&prepared[material], material::color(surface).value.as_dvec3());
            let wi = match kind % 3 {
                0 => bsdf.sample(wo, random.units()).map(|sample| sample.wi),
                _ if is_hard => Some(hard_direction(&mut random, kind / 7)),
                _ => None,
            };
            case(material, wo, wi.unwrap_or_else(|| random.direction()), u)
        })
        .collect()
}

/// What a comparison found.
#[derive(Default)]
struct Deviation {
    /// Largest relative difference of well-conditioned values, and where.
    worst: (f64, String),
    /// Largest difference of the others, as a share of what is allowed, and where.
    worst_ill: (f64, String),
    compared: usize,
    ill_conditioned: usize,
}

impl Deviation {
    /// Compares a value with its definition; `spread` is what an ulp in each input changes, summed. Values below `least` may be off by
    /// as much as it.
    fn compare(&mut self, found: f64, expected: f64, spread: f64, least: f64, context: impl Fn() -> String) {
        self.compared += 1;
        let difference = (found - expected).abs();
        let scale = expected.abs().max(least);
        if ULPS * spread <= RELATIVE * scale {
            if difference / scale > self.worst.0 {
                self.worst = (difference / scale, format!("{found:e}, not {expected:e}: {}", context()));
            }
        } else {
            self.ill_conditioned += 1;
            let allowed = ULPS * spread + RELATIVE * scale;
            if difference / allowed > self.worst_ill.0 {
                self.worst_ill = (difference / allowed, format!("{found:e}, not {expected:e}: {}", context()));
            }
        }
    }

    fn merge(self, other: Deviation) -> Deviation {
        let worse = |a: (f64, String), b: (f64, String)| if a.0 >= b.0 { a } else { b };
        Deviation {
            worst: worse(self.worst, other.worst),
            worst_ill: worse(self.worst_ill, other.worst_ill),
            compared: self.compared + other.compared,
            ill_conditioned: self.ill_conditioned + other.ill_conditioned,
        }
    }

    fn holds(&self) -> bool {
        self.worst.0 <= RELATIVE && self.worst_ill.0 <= 1.0
    }

    fn report(&self, what: &str) -> String {
        format!(
            "{what}: {} values, worst relative difference {:.1e} ({})\n    {:.2} % ill-conditioned, worst {:.2} of what is allowed ({})\n",
            self.compared,
            self.worst.0,
            self.worst.1,
            100.0 * self.ill_conditioned as f64 / self.compared as f64,
            self.worst_ill.0,
            self.worst_ill.1
        )
    }
}

/// The inputs with one number changed by an ulp, each in turn. From `absolute` on, by an ulp of 1.
fn neighbours(inputs: &[f64], absolute: usize) -> impl Iterator<Item = Vec<f64>> + '_ {
    (0..inputs.len()).map(move |i| {
        let mut changed = inputs.to_vec();
        changed[i] += if i < absolute { inputs[i] } else { 1.0 } * f64::from(f32::EPSILON) / 2.0;
        changed
    })
}

fn vector(numbers: &[f64]) -> DVec3 {
    DVec3::from_slice(numbers)
}

/// f and the pdf.
fn definition(bsdf: &Bsdf, inputs: &[f64]) -> ([f64; 3], f64) {
    let (wo, wi) = (vector(inputs), vector(&inputs[3..]));
    (bsdf.eval(wo, wi).into(), bsdf.pdf(wo, wi))
}

fn compare_values(bsdf: &Bsdf, case: &BsdfTestCase, result: &BsdfTestResult, name: &str) -> Deviation {
    let mut deviation = Deviation::default();
    let inputs: Vec<f64> = case.wo.iter().chain(&case.wi).map(|&x| x.into()).collect();
    let (value, pdf) = definition(bsdf, &inputs);
    let mut spread = [0.0; 4];
    for changed in neighbours(&inputs, 6) {
        let (other, other_pdf) = definition(bsdf, &changed);
        for i in 0..3 {
            spread[i] += (other[i] - value[i]).abs();
        }
        spread[3] += (other_pdf - pdf).abs();
    }
    let context = || format!("{name} wo {:?} wi {:?}", case.wo, case.wi);
    for i in 0..4 {
        let expected = if i < 3 { value[i] } else { pdf };
        let least = if i < 3 { least_value(bsdf) } else { TINY };
        deviation.compare(result.eval_pdf[i].into(), expected, spread[i], least, context);
    }
    deviation
}

/// Compares what is sampled. `None`: the shader decided otherwise in a close decision.
fn compare_samples(bsdf: &Bsdf, case: &BsdfTestCase, result: &BsdfTestResult, name: &str) -> Option<Deviation> {
    let mut deviation = Deviation::default();
    let inputs: Vec<f64> = case.wo.iter().chain(&case.u).map(|&x| x.into()).collect();
    // A direction of length 1 + 10⁻⁷ is no mirror image of itself about facets that are all but parallel to it.
    let sample = |inputs: &[f64]| bsdf.sample(vector(inputs).normalize(), [inputs[3], inputs[4], inputs[5]]);
    let numbers = |s: &BsdfSample| [s.wi.x, s.wi.y, s.wi.z, s.weight.x, s.weight.y, s.weight.z, s.pdf];
    let context = || format!("{name} wo {:?} u {:?}", case.wo, case.u);
    let Some(expected) = sample(&inputs) else {
        let is_close = result.pdf == 0.0 || result.wi[2].abs() < 1e-4;
        assert!(is_close, "{result:?}, but there is no sample: {}", context());
        return (result.pdf == 0.0).then_some(deviation);
    };
    let found = numbers(&BsdfSample {
        wi: Vec3::from(result.wi).as_dvec3(),
        weight: Vec3::from(result.weight).as_dvec3(),
        pdf: result.pdf.into(),
        is_delta: result.is_delta & 1 != 0,
    });
    // The lobe is chosen by u.z, which may be next to the threshold; then neighbours of it choose the other lobe too.
    let nearby = |shift: f64| sample(&[&inputs[..5], &[(inputs[5] + shift).clamp(0.0, 1.0)]].concat());
    let lobe = |s: &BsdfSample| (s.wi.z > 0.0, s.is_delta);
    let is_close = [-1e-5, 1e-5].iter().any(|&shift| nearby(shift).is_none_or(|near| lobe(&near) != lobe(&expected)))
        || expected.wi.z.abs() < 1e-4;
    if result.pdf == 0.0 || lobe(&expected) != (result.wi[2] > 0.0, result.is_delta & 1 != 0) {
        assert!(is_close, "{result:?}, not {expected:?}: {}", context());
        return None;
    }
    let base = numbers(&expected);
    let mut spread = [0.0; 7];
    // 1 - u is what the samplers use too.
    for changed in neighbours(&inputs, 3) {
        let other = sample(&changed).filter(|other| lobe(other) == lobe(&expected))?;
        for (spread, (other, base)) in spread.iter_mut().zip(numbers(&other).iter().zip(base)) {
            *spread += (other - base).abs();
        }
    }
    // A lobe-sampled BRDF is evaluated for a direction that is known to an ulp of 1; its density is that of the facet.
    if matches!(bsdf, Bsdf::LobeSampled(_)) {
        let wo = vector(&inputs).normalize();
        for axis in DVec3::AXES {
            let wi = expected.wi + axis * f64::from(f32::EPSILON);
            let values = (bsdf.eval(wo, wi) - bsdf.eval(wo, expected.wi)).abs() * (wi.z / expected.pdf);
            let pdf = (bsdf.pdf(wo, wi) - expected.pdf).abs();
            let weights = values + expected.weight * (pdf / expected.pdf);
            for (spread, change) in spread[3..].iter_mut().zip([weights.x, weights.y, weights.z, pdf]) {
                *spread += change;
            }
        }
    }
    for i in 0..7 {
        // Components of a unit vector are known to an ulp of 1.
        let rounding = if i < 3 { f64::from(f32::EPSILON) } else { 0.0 };
        let least = if (3..6).contains(&i) { least_value(bsdf) * (expected.wi.z / expected.pdf).abs() } else { TINY };
        deviation.compare(found[i], base[i], spread[i] + rounding, least, context);
    }
    Some(deviation)
}

/// What holds for all: finite numbers, directions of length 1.
fn check_numbers(bsdf: &Bsdf, case: &BsdfTestCase, result: &BsdfTestResult, name: &str) {
    let numbers = result.eval_pdf.iter().chain(&result.weight).chain([&result.pdf]);
    assert!(numbers.copied().all(|x| x.is_finite() && x >= 0.0), "{result:?}: {name} {case:?}");
    assert!((Vec3::from(result.wi).length() - 1.0).abs() < 1e-5, "{result:?}: {name} {case:?}");
    assert_eq!(result.is_delta & 2 != 0, bsdf.is_delta(), "{name}");
}

/// How far results are from the definitions.
#[derive(Default)]
pub struct Parity {
    values: Deviation,
    samples: Deviation,
    undecided: usize,
    count: usize,
}

impl Parity {
    /// Compares results on a device of this name, and insists on what holds for all: finite numbers, directions of length 1.
    pub fn of(
        surfaces: &[Surface],
        prepared: &[Arc<Prepared>],
        cases: &[BsdfTestCase],
        results: &[BsdfTestResult],
        device: &str,
    ) -> Parity {
        let compare = |(case, result): (&BsdfTestCase, &BsdfTestResult)| {
            let index = case.material as usize;
            let surface = &surfaces[index];
            let bsdf = Bsdf::new(&prepared[index], material::color(surface).value.as_dvec3());
            let name = format!("{} on {device}", describe(surface));
            if matches!(surface, Surface::Layered(_)) {
                // One walk is no value: `layered` compares means.
                check_numbers(&bsdf, case, result, &name);
                return Parity { count: 1, ..Parity::default() };
            }
            Parity::of_one(&bsdf, case, result, &name)
        };
        cases.par_iter().zip(results).map(compare).reduce(Parity::default, Parity::merge)
    }

    fn of_one(bsdf: &Bsdf, case: &BsdfTestCase, result: &BsdfTestResult, name: &str) -> Parity {
        check_numbers(bsdf, case, result, name);
        let values = compare_values(bsdf, case, result, name);
        match compare_samples(bsdf, case, result, name) {
            Some(samples) => Parity { values, samples, undecided: 0, count: 1 },
            None => Parity { values, samples: Deviation::default(), undecided: 1, count: 1 },
        }
    }

    fn merge(self, other: Parity) -> Parity {
        Parity {
            values: self.values.merge(other.values),
            samples: self.samples.merge(other.samples),
            undecided: self.undecided + other.undecided,
            count: self.count + other.count,
        }
    }

    pub fn holds(&self) -> bool {
        self.values.holds() && self.samples.holds() && self.undecided < self.count / 200
    }

    pub fn report(&self, name: &str) -> String {
        let Parity { values, samples, undecided, count } = self;
        format!(
            "{}{}    {undecided} of {count} samples at a close decision\n",
            values.report(&format!("{name} values")),
            samples.report(&format!("{name} samples")),
        )
    }
}

#[test]
fn shaders_agree_with_the_definitions() {
    let brdfs: Vec<_> = networks::all().into_iter().chain(truths::measured()).map(|(_, brdf)| brdf).collect();
    on_both_drivers(|device, name| {
        let mut text = String::new();
        let mut holds = true;
        // SwiftShader's compiler takes gigabytes for NeuBRDFs with their sampling; tests/neubrdf_device.rs runs their evaluation there.
        let is_fit = |family: &Family| *family != Family::NeuBrdf || name == LAVAPIPE;
        for family in Family::ALL.into_iter().filter(is_fit) {
            let is_truth =
                matches!(family, Family::Layered | Family::Woven | Family::Merl | Family::Rgl | Family::Sparse);
            let count = if is_truth { 80_000 } else { 250_000 };
            let surfaces = surfaces(family, &brdfs);
            let prepared = Prepared::all(&surfaces.iter().map(as_material).collect::<Vec<_>>(), &brdfs);
            let cases = cases(&surfaces, &prepared, count);
            let results = Shader::new(device, &surfaces, &brdfs).run(&cases);
            let parity = Parity::of(&surfaces, &prepared, &cases, &results, name);
            if family == Family::Layered {
                continue;
            }
            holds &= parity.holds();
            text += &parity.report(family.name());
        }
        write_evidence(&format!("bsdf_parity_{name}.txt"), &text);
        assert!(holds, "{name}\n{text}");
    });
}

/// Where a map says how rough it is, a coat's albedo is interpolated between roughnesses.
#[test]
fn coats_of_a_mapped_roughness_agree_with_the_definition() {
    let roughnesses = [0.0, 0.02, 0.09, 0.3, 0.71, 1.0f32];
    let tint = Vec3::new(0.9, 0.5, 0.1);
    let surfaces: Vec<Surface> = roughnesses.iter().map(|roughness| coated(tint, 1.5, roughness * roughness)).collect();
    let mapped = |surface| Material { roughness_map: Some(0), ..as_material(surface) };
    let materials: Vec<Material> = surfaces.iter().map(mapped).collect();
    let cases = cases(&surfaces, &Prepared::all(&surfaces.iter().map(as_material).collect::<Vec<_>>(), &[]), 60_000);
    let prepared = Prepared::of(&materials[0], &[]);
    on_both_drivers(|device, name| {
        let results = Shader::with(&mut Kernels::new(), device, &materials, &[]).run(&cases);
        let compare = |(case, result): (&BsdfTestCase, &BsdfTestResult)| {
            let roughness = roughnesses[case.material as usize];
            let bsdf = Bsdf::of_roughness(&prepared, tint.as_dvec3(), Vec2::splat(roughness));
            Parity::of_one(&bsdf, case, result, &format!("roughness {roughness}"))
        };
        let parity = cases.par_iter().zip(&results).map(compare).reduce(Parity::default, Parity::merge);
        assert!(parity.holds(), "{}", parity.report(name));
    });
}

#[test]
fn shaders_sample_what_the_density_says() {
    // Each family has its share of one configuration in three, and of one in six on the slower driver.
    check_samples("bsdf_chi_square", &configurations::all()[1..], [3, 6]);
}

#[test]
fn shaders_sample_networks_as_the_density_says() {
    check_samples("bsdf_chi_square_networks", &networks::configurations(), [1, 4]);
}

#[test]
fn shaders_sample_truths_as_the_density_says() {
    check_samples("bsdf_chi_square_truths", &truths::configurations(), [1, 4]);
}

/// Tests one configuration in so many on lavapipe and on SwiftShader.
fn check_samples(evidence: &str, configurations: &[Configuration], steps: [usize; 2]) {
    on_both_drivers(|device, name| {
        let step = if name == LAVAPIPE { steps[0] } else { steps[1] };
        let is_fit = |(_, configuration): &(usize, &Configuration)| {
            name == LAVAPIPE || !configuration.brdfs.iter().any(|brdf| matches!(**brdf, Brdf::NeuBrdf(_)))
        };
        let chosen: Vec<_> = configurations.iter().enumerate().step_by(step).filter(is_fit).collect();
        let mut kernels = Kernels::new();
        let histogram = |&(index, configuration): &(usize, &Configuration)| {
            let mut random = Random(5000 + index as u64);
            let material = as_material(&configuration.surface);
            let shader = Shader::with(&mut kernels, device, &[material], &configuration.brdfs);
            let wo = configuration.wo.as_vec3().as_dvec3();
            let cases: Vec<_> = (0..SAMPLES).map(|_| case(0, wo, DVec3::Z, random.units())).collect();
            let mut histogram = Histogram::new(configuration);
            for result in shader.run(&cases) {
                let wi = Vec3::from(result.wi).as_dvec3();
                let is_delta = result.is_delta & 1 != 0;
                histogram.add((result.pdf > 0.0).then_some((wi, result.pdf.into(), is_delta)));
            }
            histogram
        };
        let histograms: Vec<Histogram> = chosen.iter().map(histogram).collect();
        // The density is the definition's: that the shaders' is the same, the test of parity shows.
        let judged = |(&(_, configuration), histogram): (&(usize, &Configuration), &Histogram)| {
            let bsdf = configuration.bsdf();
            let (test, integral) = histogram.test(|wi| bsdf.pdf(configuration.wo, wi));
            (histogram.report(&configuration.name, &test, integral), test.p_value, true)
        };
        let results: Vec<_> = chosen.par_iter().zip(&histograms).map(judged).collect();
        judge(&format!("{evidence}_{name}.txt"), &results);
    });
}
