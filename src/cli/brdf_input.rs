//! BRDFs that a command is given: files of measured ones and networks, or a material of a scene file.

use std::path::Path;

use anyhow::{Context, Result, bail};
use glam::DVec3;
use neubrdf::material::{Bsdf, Evaluate, LayeredWalk, Prepared, TexelSamples, VaryingSurface, color};
use neubrdf::scene::brdf::{Brdf, Sparse, SurfaceGrid, SurfaceSamples, ending};
use neubrdf::scene::{Btf, Scene, Surface, SurfaceMaps};
use neubrdf::train::measure::{EvalAt, Residuals, SampleErrors, sample_errors};
use neubrdf::train::{GroundTruth, Pair, btf_pairs, hold_out, sample_pairs};

/// A BRDF, whatever defines it.
pub struct BrdfInput {
    /// For people.
    pub name: String,
    /// Its values.
    pub brdf: Box<dyn Evaluate>,
    /// What there is to learn, where it is known by measurements alone.
    samples: Option<Samples>,
    /// Texels across and down, where it varies over a texture.
    pub texels: Option<[u32; 2]>,
}

/// Measurements: two pairs of each sample, or what was drawn from a stack of images.
struct Samples {
    learned: Vec<Pair>,
    held_out: Vec<Pair>,
}

/// Texels to a side that maps and samples are learned with, at most, unless the user says otherwise.
const MOST_TEXELS: u32 = 128;
/// The same of stacks of images.
const BTF_TEXELS: u32 = 64;
/// Samples that a texel should have.
const SAMPLES_A_TEXEL: usize = 100;

/// How measurements over a texture are made pairs to learn from.
#[derive(Clone, Copy, Debug)]
pub struct Drawing {
    /// Texels across and down; what suits the measurements if `None`.
    pub texels: Option<[u32; 2]>,
    /// How many pairs are drawn from a stack of images.
    pub pairs: usize,
    /// Share of the measurements that are not learned.
    pub hold_out: f64,
    /// Picks them all.
    pub seed: u64,
}

impl BrdfInput {
    /// Loads `path`: a material or a scene (.toml), of which `name` picks a material, or any file that a scene could name as a
    /// material; `name` picks one of a collection.
    pub fn load(path: &Path, name: Option<&str>, drawing: Drawing) -> Result<BrdfInput> {
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let label = name.map_or(stem.clone(), |name| format!("{stem}: {name}"));
        let known = |brdf| Ok(BrdfInput { name: label.clone(), brdf, samples: None, texels: None });
        let samples = |mut learned: Vec<Pair>| {
            let held_out = hold_out(&mut learned, drawing.hold_out, drawing.seed);
            Some(Samples { learned, held_out })
        };
        let measured = |brdf, pairs, grid: SurfaceGrid| {
            Ok(BrdfInput { name: label.clone(), brdf, samples: samples(pairs), texels: Some(grid.size(0)) })
        };
        if path.is_dir() {
            let btf = Btf::open(path)?;
            let grid = grid(drawing.texels.unwrap_or([BTF_TEXELS; 2]))?;
            let (pairs, preview) = btf_pairs(&btf, grid, drawing.pairs, drawing.seed)?;
            return measured(Box::new(preview), pairs, grid);
        }
        let ending = ending(path);
        if ending == "csv"
            && let Some(surface) = surface_samples(path, name)?
        {
            let side = (surface.samples.len() as f64 / SAMPLES_A_TEXEL as f64).sqrt() as u32;
            let grid = grid(drawing.texels.unwrap_or([side.clamp(1, MOST_TEXELS); 2]))?;
            let pairs = sample_pairs(&surface, grid, drawing.seed);
            return measured(Box::new(TexelSamples::new(&surface, grid)), pairs, grid);
        }
        match ending.as_str() {
            "toml" => match maps(path, name)? {
                Some(maps) => {
                    let surface = VaryingSurface::new(maps);
                    let largest = surface.size().into_iter().fold(MOST_TEXELS, u32::max);
                    let texels = surface.size().map(|side| (side * MOST_TEXELS / largest).max(1));
                    Ok(BrdfInput { name: label, brdf: Box::new(surface), samples: None, texels: Some(texels) })
                }
                None => known(Box::new(scene_material(path, name)?)),
            },
            _ => match Brdf::load(path, name)? {
                Brdf::Sparse(sparse) => {
                    let samples = samples(pairs(&sparse));
                    Ok(BrdfInput { name: label, brdf: Box::new(Brdf::Sparse(sparse)), samples, texels: None })
                }
                brdf => {
                    let surface = if let Brdf::NeuBrdf(model) = &brdf { model.surface.as_ref() } else { None };
                    let texels = surface.map(|surface| surface.grid.size(0));
                    Ok(BrdfInput { name: label, brdf: Box::new(brdf), samples: None, texels })
                }
            },
        }
    }

    /// How many measurements it is known by, of a stack half of what was drawn; `None` where it is known everywhere.
    pub fn sample_count(&self) -> Option<usize> {
        self.samples.as_ref().map(|samples| (samples.learned.len() + samples.held_out.len()) / 2)
    }

    /// How far a fit is from the measurements, at points of a texture; `None` where it is known everywhere.
    pub fn residuals(&self, fit: EvalAt) -> Option<Residuals> {
        let Samples { learned, held_out } = self.samples.as_ref()?;
        // A footprint's value is one of those that its average is made of.
        let point = self.texels.map_or(0.0, |[width, height]| (1.0 / f64::from(width * height)) as f32);
        let at = |pairs: &[Pair]| SampleErrors {
            measurements: pairs.len() / 2,
            errors: sample_errors(pairs.iter().filter(|pair| pair.area <= point), fit),
        };
        Some(Residuals { learned: at(learned), held_out: (!held_out.is_empty()).then(|| at(held_out)) })
    }

    /// Hands it to what wants to learn it; `eval` is its values.
    pub fn ground_truth<'a>(&'a self, eval: &'a (dyn Fn(DVec3, DVec3) -> DVec3 + Sync)) -> GroundTruth<'a> {
        let is_isotropic = self.brdf.is_isotropic();
        match &self.samples {
            Some(Samples { learned, .. }) => GroundTruth::Samples { pairs: learned, is_isotropic },
            None if self.brdf.is_spatial() => GroundTruth::Surface { brdf: self.brdf.as_ref() },
            None => GroundTruth::Function { eval, is_isotropic },
        }
    }
}

/// The names of the materials that a file holds, where it holds several.
pub fn names(path: &Path) -> Result<Vec<String>> {
    if ending(path) == "toml"
        && Surface::load(path, None).is_err()
        && let Ok((scene, _)) = Scene::load(path)
    {
        return Ok(scene.materials.into_iter().map(|material| material.name).collect());
    }
    Ok(Brdf::names(path)?)
}

fn grid([width, height]: [u32; 2]) -> Result<SurfaceGrid> {
    SurfaceGrid::new(width, height).with_context(|| format!("{width}x{height} texels: expected 1 to 1024 to a side"))
}

/// The samples of a file whose material varies.
fn surface_samples(path: &Path, name: Option<&str>) -> Result<Option<SurfaceSamples>> {
    if name.is_some() { Ok(None) } else { Ok(SurfaceSamples::load(path)?) }
}

/// The maps of a material's own file, if it is one and has some.
fn maps(path: &Path, name: Option<&str>) -> Result<Option<SurfaceMaps>> {
    if name.is_some() {
        return Ok(None);
    }
    let Some((maps, warnings)) = SurfaceMaps::load(path)? else { return Ok(None) };
    warnings.iter().for_each(|warning| note!("warning: {warning}"));
    Ok(Some(maps))
}

/// The measurements, and what reciprocity makes of them: few that they are, they say twice as much.
fn pairs(sparse: &Sparse) -> Vec<Pair> {
    let pair = |sample: &neubrdf::scene::brdf::SparseSample| Pair {
        wo: sample.wo.as_vec3(),
        wi: sample.wi.as_vec3(),
        value: sample.value,
        ..Pair::default()
    };
    sparse.samples().iter().map(pair).flat_map(|pair| [pair, pair.reciprocal()]).collect()
}

/// A surface of a scene in its own colour, textures left out.
#[derive(Debug)]
struct SceneMaterial {
    prepared: Prepared,
    color: DVec3,
    is_isotropic: bool,
    /// Of a layered surface, whose values are estimates: many are averaged.
    walk: Option<LayeredWalk>,
}

/// Walks that a value of a layered surface is the mean of. A ball of them takes longest, but shows the noise of fewer: the blue paint's fit has an SSIM
/// of 0.993 with 32, 0.978 with 8 and 0.929 with 2.
const WALKS: u32 = 32;

impl Evaluate for SceneMaterial {
    fn eval(&self, wo: DVec3, wi: DVec3) -> DVec3 {
        match &self.walk {
            Some(walk) => walk.average(wo, wi, WALKS),
            None => Bsdf::new(&self.prepared, self.color).eval(wo, wi),
        }
    }

    fn is_isotropic(&self) -> bool {
        self.is_isotropic
    }
}

fn scene_material(path: &Path, name: Option<&str>) -> Result<SceneMaterial> {
    let (surface, brdfs) = match name {
        Some(name) => {
            let (scene, _) = Scene::load(path).with_context(|| format!("--name {name} picks a material of a scene"))?;
            let names = || scene.materials.iter().map(|material| material.name.as_str()).collect::<Vec<_>>().join(", ");
            let material = scene.materials.iter().find(|material| material.name == name);
            let material =
                material.with_context(|| format!("{}: no material `{name}`; it has {}", path.display(), names()))?;
            (material.surface.clone(), scene.brdfs)
        }
        None => {
            let (surface, brdfs, warnings) = Surface::load(path, None)
                .context("a file of one material was expected; of a scene, --name picks one")?;
            warnings.iter().for_each(|warning| note!("warning: {warning}"));
            (surface, brdfs)
        }
    };
    if matches!(surface, Surface::Dielectric { .. }) {
        bail!("{}: the material lets light through; a BRDF only reflects", path.display());
    }
    let prepared = Prepared::new(&surface, &brdfs);
    let color = color(&surface).value.as_dvec3();
    if Bsdf::new(&prepared, color).is_delta() {
        bail!("{}: the material is a perfect mirror, which has no values to learn", path.display());
    }
    let is_isotropic = match &prepared {
        Prepared::Conductor { roughness, .. } => roughness.is_none_or(|ggx| ggx.alpha.x == ggx.alpha.y),
        Prepared::LobeSampled { brdf, .. } => brdf.is_isotropic(),
        _ => true,
    };
    let walk = match &surface {
        Surface::Layered(layers) => Some(LayeredWalk::new(layers)),
        _ => None,
    };
    Ok(SceneMaterial { prepared, color, is_isotropic, walk })
}
