//! `make study-sparse`: what few measurements tell of the rest, through a NeuBRDF and without one.
//!
//! Each ground truth is seen by three kinds of measurement: at the angles of a goniometer for special-effect coatings, in 5 % of the
//! cells of a MERL table, and at a hundred pairs of directions at random, as a texel of a sparse SVBRDF. On other directions a NeuBRDF
//! of these is compared with the nearest measurement and with the mean of all by distance, which is what a scene's `.csv` renders
//! as. Each comparison leaves a JSON file in `target/study-sparse`; what is there is not done again. Words are names of materials.

mod study;

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Parser;
use glam::DVec3;
use neubrdf::material::turned;
use neubrdf::scene::brdf::{Codebook, NO_CODE, NeuBrdf, Precision, Sparse, SparseSample, SphereGrid, SphereTable};
use neubrdf::train::measure::Eval;
use neubrdf::train::{Evaluator, GroundTruth, Model, Pair, Plan, Quality, Recipe, Session};
use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use serde::{Deserialize, Serialize};
use study::{Errors, Truth, all, bar, errors_of, kept, key};

/// Fit few measurements, and print how much that says of the rest.
#[derive(Parser)]
struct Arguments {
    /// Names of materials
    materials: Vec<String>,
    #[arg(long, value_enum, default_value = "draft")]
    quality: Quality,
    /// Where results are kept
    #[arg(long, default_value = "target/study-sparse")]
    folder: PathBuf,
}

/// The materials, unless others are asked for: matte, satin, metallic paints, metal, a layered simulation.
const MATERIALS: [&str; 6] =
    ["red-fabric", "pearl-paint", "gold-metallic-paint", "irid_flake_paint2_rgb", "alum-bronze", "layered-green-0.2"];

/// Pixels to a side of the balls.
const BALL: usize = 96;

/// Measurements that the mean by distance takes: those beyond count next to nothing.
const NEIGHBOURS: usize = 64;

/// Pairs that the time of an evaluation is measured on.
const TIMED: usize = 1 << 13;

/// A kind of measurement.
struct Kind {
    name: &'static str,
    /// (ωo, ωi).
    directions: Vec<[DVec3; 2]>,
}

#[derive(Serialize, Deserialize)]
struct Outcome {
    neubrdf: Guess,
    nearest: Guess,
    mean: Guess,
    bytes: usize,
    n_side: u32,
    train_seconds: f64,
}

/// What measurements say of the rest, in one way.
#[derive(Serialize, Deserialize)]
struct Guess {
    errors: Errors,
    /// On one thread.
    evaluations_a_second: f64,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    std::fs::create_dir_all(&arguments.folder)?;
    let mut truths = all()?;
    match arguments.materials.as_slice() {
        [] => truths.retain(|truth| MATERIALS.contains(&truth.name.as_str())),
        names => truths.retain(|truth| names.contains(&truth.name)),
    }
    let kinds = [
        Kind { name: "coating", directions: coating() },
        Kind { name: "5 % of MERL's grid", directions: merl_cells(0.05) },
        Kind { name: "a texel", directions: texel(100) },
    ];
    let bar = bar(kinds.len() * truths.len())?;
    let mut rows = Vec::new();
    for kind in &kinds {
        for truth in &truths {
            bar.set_message(format!("{}, {}", truth.name, kind.name));
            let path = arguments.folder.join(format!("{}.json", key(&(kind.name, &truth.name, arguments.quality))?));
            rows.push((kind, truth, kept(&path, || compared(&arguments, truth, kind))?));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    print_errors(&rows);
    print_points(&kinds)
}

fn compared(arguments: &Arguments, truth: &Truth, kind: &Kind) -> Result<Outcome> {
    let values = truth.measure(&kind.directions);
    let samples: Vec<SparseSample> = kind
        .directions
        .iter()
        .zip(&values)
        .map(|([wo, wi], value)| SparseSample { wi: *wi, wo: *wo, value: value.as_vec3() })
        .collect();
    let pair = |sample: &SparseSample| Pair {
        wo: sample.wo.as_vec3(),
        wi: sample.wi.as_vec3(),
        value: sample.value,
        ..Pair::default()
    };
    let pairs: Vec<Pair> = samples.iter().map(pair).flat_map(|pair| [pair, pair.reciprocal()]).collect();
    let plan = Plan::new(Model::NeuBrdf, Recipe::Default, arguments.quality, truth.is_isotropic);
    let plan = plan.for_samples(samples.len());
    let n_side = plan.n_side[0];
    let mut session = Session::new(plan, &GroundTruth::Samples { pairs: &pairs, is_isotropic: truth.is_isotropic })?;
    let started = Instant::now();
    session.run(u32::MAX);
    let train_seconds = started.elapsed().as_secs_f64();
    let file = session.neubrdf().context("a NeuBRDF was trained")?.encode(Precision::F16)?;
    let fit = Evaluator::neubrdf(&NeuBrdf::decode(&file)?);
    let sparse = Sparse::new(samples, truth.is_isotropic);
    let table = Table::new(&sparse);
    Ok(Outcome {
        neubrdf: guess(truth, &|pairs| fit.eval(pairs))?,
        nearest: guess(truth, &|pairs| table.all(pairs, Table::nearest))?,
        mean: guess(truth, &|pairs| table.all(pairs, Table::mean))?,
        bytes: file.len(),
        n_side,
        train_seconds,
    })
}

fn guess(truth: &Truth, eval: Eval) -> Result<Guess> {
    let errors = errors_of(truth, BALL, eval);
    let pairs = texel(TIMED);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let started = Instant::now();
    alone.install(|| eval(&pairs));
    Ok(Guess { errors, evaluations_a_second: TIMED as f64 / started.elapsed().as_secs_f64() })
}

/// Measurements, found by their coordinates.
struct Table<'a> {
    sparse: &'a Sparse,
    tree: RTree<GeomWithData<[f64; 4], usize>>,
}

impl Table<'_> {
    fn new(sparse: &Sparse) -> Table<'_> {
        let points = sparse.coordinates().iter().enumerate();
        let points = points.map(|(index, at)| GeomWithData::new(at.to_array(), index)).collect();
        Table { sparse, tree: RTree::bulk_load(points) }
    }

    fn all(&self, pairs: &[[DVec3; 2]], eval: fn(&Self, DVec3, DVec3) -> DVec3) -> Vec<DVec3> {
        pairs.par_iter().map(|[wo, wi]| eval(self, *wo, *wi)).collect()
    }

    fn value(&self, point: &GeomWithData<[f64; 4], usize>) -> DVec3 {
        self.sparse.samples()[point.data].value.as_dvec3()
    }

    /// The nearest one.
    fn nearest(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let here = self.sparse.coordinates_of(wo, wi).to_array();
        self.tree.nearest_neighbor(&here).map_or(DVec3::ZERO, |point| self.value(point))
    }

    /// The mean by the distance to the power −8, as `src/material/sparse.rs` has it.
    fn mean(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        let here = self.sparse.coordinates_of(wo, wi).to_array();
        let near: Vec<_> = self.tree.nearest_neighbor_iter_with_distance_2(&here).take(NEIGHBOURS).collect();
        let nearest = near.first().map_or(0.0, |(_, squared)| *squared) + 1e-8;
        let (sum, weights) = near.iter().fold((DVec3::ZERO, 0.0), |(sum, weights), (point, squared)| {
            let weight = (nearest / (squared + 1e-8)).powi(4);
            (sum + weight * self.value(point), weights + weight)
        });
        sum / weights
    }
}

/// The angles at which a goniometer looks at special-effect coatings: light from six θ; detectors every 10°, in and out of the plane.
fn coating() -> Vec<[DVec3; 2]> {
    let lights = [0.0, 15.0, 30.0, 45.0, 60.0, 70.0];
    let detectors = (0..8).flat_map(|theta| (0..7).map(move |phi| (10.0 * f64::from(theta), 30.0 * f64::from(phi))));
    let pairs = lights.into_iter().flat_map(|light| detectors.clone().map(move |detector| (light, detector)));
    pairs.map(|(light, (theta, phi))| [direction(theta, phi), direction(light, 0.0)]).collect()
}

/// A share of the cells of a MERL table, at random, as far as both directions are above the surface.
fn merl_cells(share: f64) -> Vec<[DVec3; 2]> {
    let mut random = uniform("cells");
    let cells = (0..90).flat_map(|half| (0..90).flat_map(move |across| (0..180).map(move |phi| (half, across, phi))));
    cells
        .filter(|_| random() < share)
        .map(|(half, across, phi)| {
            let theta_half = FRAC_PI_2 * ((f64::from(half) + 0.5) / 90.0).powi(2);
            let (across, phi) = ((f64::from(across) + 0.5).to_radians(), PI * (f64::from(phi) + 0.5) / 180.0);
            let (sin, cos) = theta_half.sin_cos();
            let half = DVec3::new(sin, 0.0, cos);
            let side = DVec3::new(cos, 0.0, -sin);
            let wi = across.sin() * (phi.cos() * side + phi.sin() * DVec3::Y) + across.cos() * half;
            [2.0 * wi.dot(half) * half - wi, wi]
        })
        .filter(|[wo, wi]| wo.z > 0.01 && wi.z > 0.01)
        .collect()
}

/// Pairs of directions, each by the cosine, up to 88°.
fn texel(count: usize) -> Vec<[DVec3; 2]> {
    let mut random = uniform("texel");
    let mut by_cosine = || direction(random().sqrt().asin().to_degrees().min(88.0), 360.0 * random());
    (0..count).map(|_| [by_cosine(), by_cosine()]).collect()
}

/// At these angles, degrees.
fn direction(theta: f64, phi: f64) -> DVec3 {
    let ((sin, cos), (y, x)) = (theta.to_radians().sin_cos(), phi.to_radians().sin_cos());
    DVec3::new(sin * x, sin * y, cos)
}

/// Numbers in [0, 1) that look random.
fn uniform(name: &str) -> impl FnMut() -> f64 {
    let mut bits = blake3::Hasher::new().update(name.as_bytes()).finalize_xof();
    move || {
        let mut bytes = [0; 8];
        bits.fill(&mut bytes);
        (u64::from_le_bytes(bytes) >> 11) as f64 * 0.5f64.powi(53)
    }
}

fn print_errors(rows: &[(&Kind, &Truth, Outcome)]) {
    println!("| measured | material | by | mean \\|Δ ln(1+f)\\| | rel. RMSE | SSIM | ꟻLIP | albedo | evaluations/s |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for (kind, truth, outcome) in rows {
        let ways = [("NeuBRDF", &outcome.neubrdf), ("nearest", &outcome.nearest), ("mean", &outcome.mean)];
        for (place, (way, Guess { errors, evaluations_a_second })) in ways.into_iter().enumerate() {
            let (kind, name) = if place == 0 { (kind.name, truth.name.as_str()) } else { ("", "") };
            let Errors { log, relative_rmse, ssim, flip, albedo } = errors;
            println!(
                "| {kind} | {name} | {way} | {log:.4} | {relative_rmse:.3} | {ssim:.4} | {flip:.4} | {:.1} % | {:.1e} |",
                100.0 * albedo,
                evaluations_a_second
            );
        }
    }
    let least = |better: fn(&Outcome) -> bool| rows.iter().filter(|(.., outcome)| better(outcome)).count();
    let by_log = least(|o| o.neubrdf.errors.log < o.nearest.errors.log.min(o.mean.errors.log));
    let by_ssim = least(|o| o.neubrdf.errors.ssim > o.nearest.errors.ssim.max(o.mean.errors.ssim));
    println!("\nNeuBRDF is the best by mean |Δ ln(1+f)| in {by_log} and by SSIM in {by_ssim} of {}.", rows.len());
}

/// How many grid points the paper's grid keeps of isotropic materials that are measured so.
fn print_points(kinds: &[Kind]) -> Result<()> {
    let dense = Kind { name: "everywhere", directions: texel(1 << 20) };
    let grid = SphereGrid::new(64).context("64 is a power of two")?;
    println!("\n| measured | pairs | points kept of N_side 64, ωi | ωo | both |\n|---|---|---|---|---|");
    for Kind { name, directions } in kinds.iter().chain([&dense]) {
        let mut seen = [(); 2].map(|()| vec![false; grid.pixel_count()]);
        let both_ways = directions.iter().flat_map(|[wo, wi]| [turned(*wo, *wi), turned(*wi, *wo)]);
        for [wo, wi] in both_ways {
            for (seen, w) in seen.iter_mut().zip([wi, wo]) {
                seen[grid.locate(w).pixel as usize] = true;
            }
        }
        let count = grid.point_count();
        let [wi, wo] = seen.map(|seen| {
            let indices = vec![0; count];
            let codebook = Arc::new(Codebook { features: 1, codes: vec![0.0] });
            let mut table = SphereTable { grid, codebook, indices, levels: Vec::new() };
            table.prune(|pixel| seen[pixel as usize]);
            table.indices.iter().filter(|index| **index != NO_CODE).count() as f64 / count as f64
        });
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        println!(
            "| {name} | {} | {} | {} | {} |",
            directions.len(),
            percent(wi),
            percent(wo),
            percent(0.5 * (wi + wo))
        );
    }
    Ok(())
}
