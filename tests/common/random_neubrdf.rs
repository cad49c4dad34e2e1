//! NeuBRDFs of any shape, made up: what they look like does not matter.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use neubrdf::scene::brdf::{
    Codebook, CornerWeights, Dense, Encoding, NeuBrdf, NeuBrdfPack, Provenance, SamplingLobe, SphereGrid, SphereTable,
    SurfaceFrame, SurfaceFrames, SurfaceGrid, SurfaceTable,
};

/// A stream of uniform numbers.
pub struct Stream(pub u64);

impl Stream {
    /// In [0, 1), exact in `f32`.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1u64 << 24) as f64
    }

    #[allow(dead_code)] // not every user picks
    pub fn below(&mut self, count: usize) -> usize {
        (self.unit() * count as f64) as usize
    }

    /// In [−1, 1).
    fn signed(&mut self) -> f32 {
        (2.0 * self.unit() - 1.0) as f32
    }

    /// A direction above the surface.
    pub fn direction(&mut self) -> DVec3 {
        let (z, azimuth) = (self.unit(), std::f64::consts::TAU * self.unit());
        let rho = (1.0 - z * z).sqrt();
        DVec3::new(rho * azimuth.cos(), rho * azimuth.sin(), z)
    }
}

/// The shape of a model.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    pub is_isotropic: bool,
    pub corner_weights: CornerWeights,
    pub n_side: u32,
    /// Grids of a hemisphere, each half as fine as the one before.
    pub resolutions: u32,
    pub features: u32,
    pub codes: usize,
    /// Outputs of the layers before the last.
    pub hidden: &'static [u32],
    /// Merge what lies beyond the directions that isotropic materials ask for, or a random half.
    pub is_pruned: bool,
    /// Texels across and down, and their features.
    pub surface: Option<([u32; 2], u32)>,
    /// Whether texels have frames.
    pub has_frames: bool,
    pub sees_half_vector: bool,
}

impl Shape {
    /// The paper's model.
    pub const FULL: Shape = Shape {
        is_isotropic: false,
        corner_weights: CornerWeights::Bilinear,
        n_side: 64,
        resolutions: 1,
        features: 16,
        codes: 256,
        hidden: &[64, 64, 64],
        is_pruned: false,
        surface: None,
        has_frames: false,
        sees_half_vector: false,
    };
}

/// A model of a shape with random numbers, of the sizes that training leaves. All are `f16` numbers.
pub fn random_neubrdf(shape: Shape, seed: u64) -> NeuBrdf {
    let mut random = Stream(seed);
    let half = |x: f32| half::f16::from_f32(x).to_f32();
    let mut table = |grid: SphereGrid, is_wi: bool| {
        // Features vary smoothly over the hemisphere, as trained ones do: codes are the values at random directions.
        let waves: Vec<[f32; 4]> =
            (0..shape.features).map(|_| std::array::from_fn(|_| 3.0 * random.signed())).collect();
        let directions: Vec<DVec3> = (0..shape.codes).map(|_| random.direction()).collect();
        let code = |w: &DVec3| -> Vec<f32> {
            let w = w.as_vec3();
            waves.iter().map(|[x, y, z, phase]| half((x * w.x + y * w.y + z * w.z + phase).sin())).collect()
        };
        let codes = directions.iter().flat_map(code).collect();
        let nearest = |point: usize| {
            let w = grid.point(point);
            let distance = |k: &usize| directions[*k].distance_squared(w);
            (0..shape.codes).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap() as u16
        };
        let indices = (0..grid.point_count()).map(nearest).collect();
        let codebook = Arc::new(Codebook { features: shape.features, codes });
        let mut table = SphereTable { grid, codebook, indices, levels: Vec::new() };
        if shape.is_pruned {
            // A stream of its own: codes are the same whether or not anything is pruned.
            let mut random = Stream(seed ^ 0x5eed);
            let seen: std::collections::HashSet<u32> = (0..20_000)
                .map(|_| random.direction())
                .filter(|w| if shape.is_isotropic { w.y >= 0.0 } else { w.x * w.y > 0.1 })
                .map(|w| if shape.is_isotropic && is_wi { DVec3::new(w.truncate().length(), 0.0, w.z) } else { w })
                .map(|w| grid.locate(w).pixel)
                .collect();
            table.prune(|pixel| seen.contains(&pixel));
        }
        table
    };
    let mut pair = |coarser: u32| {
        let grid = SphereGrid::new(shape.n_side >> coarser).unwrap();
        [table(grid, true), table(grid, false)]
    };
    let [wi, wo] = pair(0);
    let coarser = (1..shape.resolutions).map(pair).collect();
    let surface = shape.surface.map(|([width, height], features)| {
        let grid = SurfaceGrid::new(width, height).unwrap();
        let codes = shape.codes.min(grid.point_count());
        let codes_of = |count: usize, random: &mut Stream| (0..count).map(|_| half(random.signed())).collect();
        SurfaceTable {
            grid,
            codebook: Arc::new(Codebook { features, codes: codes_of(codes * features as usize, &mut random) }),
            indices: (0..grid.point_count()).map(|_| random.below(codes) as u16).collect(),
            frames: if shape.has_frames { random_frames(grid, &mut random) } else { SurfaceFrames::default() },
        }
    });
    let half_vector = if shape.sees_half_vector { NeuBrdf::HALF_VECTOR_INPUTS } else { 0 };
    let surface_features = shape.surface.map_or(0, |(_, features)| features);
    let mut inputs = 2 * shape.resolutions * shape.features + surface_features + half_vector;
    let mut layers = Vec::new();
    for outputs in shape.hidden.iter().copied().chain([3]) {
        let size = (6.0 / inputs as f32).sqrt() * if outputs == 3 { 0.5 } else { 1.0 };
        let weights = (0..inputs * outputs).map(|_| half(size * random.signed())).collect();
        let bias = (0..outputs).map(|_| half(0.1 * random.signed() + if outputs == 3 { 0.8 } else { 0.0 })).collect();
        layers.push(Dense { inputs, outputs, weights, bias });
        inputs = outputs;
    }
    NeuBrdf {
        is_isotropic: shape.is_isotropic,
        corner_weights: shape.corner_weights,
        wi,
        wo,
        coarser,
        surface,
        sees_half_vector: shape.sees_half_vector,
        layers,
        encoding: Encoding { gain: 100.0, scale: 2.0, max: 1e5 },
        lobe: SamplingLobe { alpha: [[0.1, 0.2], [0.5, 0.4]], weight: [[0.3, 0.2]; SamplingLobe::NODES] },
        provenance: Provenance { source: "random numbers".into(), ..Provenance::default() },
    }
}

/// Frames that lean up to 60° and turn as they like.
fn random_frames(grid: SurfaceGrid, random: &mut Stream) -> SurfaceFrames {
    let mut frame = || {
        let (lean, towards, psi) = (1.05 * random.unit(), 7.0 * random.unit(), 7.0 * random.unit());
        let normal = DVec3::new(lean.sin() * towards.cos(), lean.sin() * towards.sin(), lean.cos());
        SurfaceFrame { normal, doubled: DVec2::from_angle(2.0 * psi) }
    };
    SurfaceFrames::new(&(0..grid.point_count()).map(|_| frame()).collect::<Vec<_>>())
}

/// Models of a shape that share their codebooks, `m0`, `m1` …, and where `shares_network` their layers as well.
#[allow(dead_code)] // not every user has packs
pub fn random_pack(shape: Shape, count: usize, shares_network: bool) -> NeuBrdfPack {
    let mut materials: Vec<NeuBrdf> = (0..count).map(|seed| random_neubrdf(shape, seed as u64)).collect();
    let NeuBrdf { wi, wo, layers, .. } = materials[0].clone();
    for member in &mut materials {
        (member.wi.codebook, member.wo.codebook) = (wi.codebook.clone(), wo.codebook.clone());
        if shares_network {
            member.layers.clone_from(&layers);
        }
    }
    let named = |(index, member)| (format!("m{index}"), member);
    NeuBrdfPack { materials: materials.into_iter().enumerate().map(named).collect() }
}
