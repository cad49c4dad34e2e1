//! What is learned: the published networks of `../shared/data/nbrdf`, and closed, layered and woven surfaces made here.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Result;
use glam::{DVec3, Vec2, Vec3};
use neubrdf::material::{Bsdf, Evaluate, LayeredWalk, Prepared, color};
use neubrdf::scene::brdf::Brdf;
use neubrdf::scene::{Color, Fresnel, LayerBase, Layered, Surface, Woven, Yarn};
use neubrdf::train::{GroundTruth, Pair};
use rayon::prelude::*;

/// Where the published networks are, if they are.
const PUBLISHED: [&str; 2] =
    ["../shared/data/nbrdf/merl.safetensors", "../shared/data/nbrdf/rgl-isotropic.safetensors"];

/// Walks that an evaluation of a layered surface is the mean of: for training, for measuring.
const WALKS: [u32; 2] = [32, 128];

/// Anything to be learned.
pub type Eval = Arc<dyn Fn(DVec3, DVec3) -> DVec3 + Send + Sync>;

/// A ground truth, which remembers what it was asked: simulated ones take longer than what learns from them.
pub struct Truth {
    pub name: String,
    pub is_isotropic: bool,
    /// Made here, not published.
    pub is_ours: bool,
    /// What training sees.
    learned: Eval,
    /// What a fit is compared with: the same, with less noise.
    measured: Eval,
    /// By count and seed.
    pairs: Mutex<HashMap<(usize, u64), Vec<Pair>>>,
    /// By the hash of the pairs of directions.
    values: Mutex<HashMap<blake3::Hash, Vec<DVec3>>>,
}

impl Truth {
    fn new(name: &str, is_isotropic: bool, is_ours: bool, [learned, measured]: [Eval; 2]) -> Truth {
        let name = name.to_owned();
        Truth { name, is_isotropic, is_ours, learned, measured, pairs: Mutex::default(), values: Mutex::default() }
    }

    /// What training sees, at one pair.
    pub fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        (self.learned)(wo, wi)
    }

    /// Pairs to learn from.
    pub fn pairs(&self, count: usize, seed: u64) -> Vec<Pair> {
        let eval = |wo: DVec3, wi: DVec3| (self.learned)(wo, wi);
        let truth = GroundTruth::Function { eval: &eval, is_isotropic: self.is_isotropic };
        let mut pairs = self.pairs.lock().unwrap_or_else(PoisonError::into_inner);
        pairs.entry((count, seed)).or_insert_with(|| truth.pairs(count, seed, None).into_owned()).clone()
    }

    /// The values that a fit is compared with, at each (ωo, ωi).
    pub fn measure(&self, pairs: &[[DVec3; 2]]) -> Vec<DVec3> {
        let mut hasher = blake3::Hasher::new();
        pairs.iter().flatten().flat_map(DVec3::to_array).for_each(|x| {
            hasher.update(&x.to_le_bytes());
        });
        let mut values = self.values.lock().unwrap_or_else(PoisonError::into_inner);
        let ask = || pairs.par_iter().map(|[wo, wi]| (self.measured)(*wo, *wi)).collect();
        values.entry(hasher.finalize()).or_insert_with(ask).clone()
    }
}

/// All of both; says so if there is nothing published.
pub fn all() -> Result<Vec<Truth>> {
    let mut truths = published()?;
    if truths.is_empty() {
        eprintln!("no published networks in ../shared/data/nbrdf: they are left out");
    }
    truths.extend(ours());
    Ok(truths)
}

/// The published networks, if they are there.
pub fn published() -> Result<Vec<Truth>> {
    let mut truths = Vec::new();
    for file in PUBLISHED.map(Path::new).into_iter().filter(|file| file.exists()) {
        for name in Brdf::names(file)? {
            let brdf = Brdf::load(file, Some(&name))?;
            let eval: Eval = Arc::new(move |wo, wi| brdf.eval(wo, wi));
            truths.push(Truth::new(&name, true, false, [eval.clone(), eval]));
        }
    }
    Ok(truths)
}

/// Closed, layered and woven surfaces.
pub fn ours() -> Vec<Truth> {
    let rgb = |r: f32, g: f32, b: f32| Vec3::new(r, g, b);
    let gold = Fresnel::Complex { eta: rgb(0.168, 0.350, 1.508), kappa: rgb(3.138, 2.714, 1.879) };
    let chromium = Fresnel::Complex { eta: rgb(3.638, 3.116, 1.928), kappa: rgb(4.364, 4.423, 4.168) };
    let metal = |fresnel, x: f32, y: f32| Surface::Conductor { fresnel, alpha: Vec2::new(x, y) };
    let coated = |albedo: Vec3, alpha: f32| Surface::Coated { albedo: Color::constant(albedo), ior: 1.5, alpha };
    let layered =
        |alpha: f32, absorption: Vec3, base: LayerBase| Surface::Layered(Layered { ior: 1.5, alpha, absorption, base });
    let matte = |albedo: Vec3| LayerBase::Diffuse { albedo };
    let under = |fresnel, x: f32, y: f32| LayerBase::Conductor { fresnel, alpha: Vec2::new(x, y) };
    let yarn = |coverage: f32, gloss: f32, albedo: Vec3, specular_width: f32| Yarn {
        coverage,
        gloss,
        f0: Vec3::splat(0.06),
        albedo,
        specular_width,
        volume_width: 0.4,
        isotropy: 0.3,
    };
    let surfaces = [
        ("gold-0.05", metal(gold, 0.05, 0.05)),
        ("gold-0.2", metal(gold, 0.2, 0.2)),
        ("chromium-0.1", metal(chromium, 0.1, 0.1)),
        ("chromium-0.4", metal(chromium, 0.4, 0.4)),
        ("gold-0.05x0.3", metal(gold, 0.05, 0.3)),
        ("gold-0.1x0.4", metal(gold, 0.1, 0.4)),
        ("chromium-0.3x0.06", metal(chromium, 0.3, 0.06)),
        ("chromium-0.15x0.5", metal(chromium, 0.15, 0.5)),
        ("coated-red-0.05", coated(rgb(0.5, 0.05, 0.03), 0.05)),
        ("coated-blue-0.15", coated(rgb(0.05, 0.1, 0.4), 0.15)),
        ("coated-white-0.4", coated(rgb(0.8, 0.8, 0.75), 0.4)),
        ("layered-red-0.05", layered(0.05, rgb(0.05, 0.4, 0.6), matte(rgb(0.7, 0.5, 0.4)))),
        ("layered-green-0.2", layered(0.2, rgb(0.6, 0.1, 0.5), matte(rgb(0.6, 0.7, 0.5)))),
        ("layered-gold-0.1", layered(0.1, rgb(0.05, 0.1, 0.3), under(gold, 0.2, 0.2))),
        ("layered-brushed-0.1", layered(0.1, rgb(0.4, 0.1, 0.05), under(chromium, 0.1, 0.4))),
        (
            "woven-silk",
            Surface::Woven(Woven {
                warp: yarn(0.6, 0.6, rgb(0.5, 0.1, 0.2), 0.08),
                weft: yarn(0.4, 0.5, rgb(0.2, 0.1, 0.5), 0.15),
            }),
        ),
        (
            "woven-denim",
            Surface::Woven(Woven {
                warp: yarn(0.66, 0.15, rgb(0.06, 0.1, 0.26), 0.4),
                weft: yarn(0.34, 0.15, rgb(0.6, 0.6, 0.58), 0.4),
            }),
        ),
    ];
    let wing: Eval = Arc::new(wing);
    let wing = Truth::new("butterfly-wing", false, true, [wing.clone(), wing]);
    surfaces.into_iter().map(|(name, surface)| closed(name, surface)).chain([wing]).collect()
}

/// The wing of a morpho, made up after what ridges of thin shelves do to light (Kinoshita, Yoshioka and Miyazaki, *Physics of structural colors*,
/// Reports on Progress in Physics 71, 2008): of what is mirrored along the ridges, x, the shelves reflect blue, and at a slant violet; across them
/// light spreads, in the orders of a grating. In h = ωo + ωi, hence reciprocal; high in frequency, which is what it is for.
fn wing(wo: DVec3, wi: DVec3) -> DVec3 {
    const WAVELENGTHS: [f64; 3] = [0.63, 0.53, 0.46];
    // Between ridges, and the optical path of a shelf and its gap, µm.
    const RIDGES: f64 = 1.4;
    const SHELVES: f64 = 0.47;
    let bell = |x: f64, deviation: f64| (-0.5 * (x / deviation).powi(2)).exp();
    let half = wo + wi;
    let cosine = half.length() / 2.0;
    let channels = WAVELENGTHS.map(|wavelength| {
        let order = half.y * RIDGES / wavelength;
        let grating = 0.3 + bell(order - order.round(), 0.12);
        let shelves = bell(wavelength - SHELVES * cosine, 0.05);
        0.01 + 1.8 * shelves * grating * bell(half.x, 0.08) * bell(half.y, 0.7)
    });
    DVec3::from_array(channels)
}

fn closed(name: &str, surface: Surface) -> Truth {
    let is_isotropic = match &surface {
        Surface::Conductor { alpha, .. } => alpha.x == alpha.y,
        Surface::Layered(Layered { base: LayerBase::Conductor { alpha, .. }, .. }) => alpha.x == alpha.y,
        Surface::Woven(_) => false,
        _ => true,
    };
    let evals = WALKS.map(|walks| -> Eval {
        if let Surface::Layered(layers) = &surface {
            let walk = LayeredWalk::new(layers);
            return Arc::new(move |wo, wi| walk.average(wo, wi, walks));
        }
        let prepared = Prepared::new(&surface, &[]);
        let tint = color(&surface).value.as_dvec3();
        Arc::new(move |wo, wi| Bsdf::new(&prepared, tint).eval(wo, wi))
    });
    Truth::new(name, is_isotropic, true, evals)
}
