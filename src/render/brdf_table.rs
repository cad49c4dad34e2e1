//! BRDFs without a sampler of their own, as the device reads them: words behind [`MaterialRecord::table`](super::MaterialRecord).
//!
//! First the sampling lobes (`glsl/lib/lobe.glsl`), then, from byte [`LOBE_BYTES`] on, what `glsl/lib/bsdf_X.glsl` of the
//! BRDF's family evaluates it from.

use std::array;
use std::f32::consts::FRAC_1_PI;

use bytemuck::NoUninit;
use glam::{Vec2, Vec3};

use super::neubrdf_table::{NeuBrdfShape, pack_neubrdf};
use crate::scene::{
    Brdf, Fresnel, LayerBase, Layered, Nbrdf, Rgl, RglTable, RglTables, RglWarp, SamplingLobe, Sparse, Woven, Yarn,
};

crate::shared_structs! {
    /// The structs of `glsl/lib/bsdf_layered.glsl`, `bsdf_woven.glsl`, `bsdf_rgl.glsl` and `bsdf_sparse.glsl`, which say what the members
    /// mean.
    pub const BRDF_STRUCTS;

    struct LayeredRecord {
        ior: f32,
        alpha: f32,
        base_alpha: [f32; 2],
        absorption: [f32; 3],
        base: u32,
        color: [f32; 3],
        eta: [f32; 3],
        kappa: [f32; 3],
    }

    struct YarnRecord {
        f0: [f32; 3],
        gloss: f32,
        albedo: [f32; 3],
        isotropy: f32,
        specular_width: f32,
        volume_width: f32,
    }

    struct RglRecord {
        phis: u32,
        thetas: u32,
        reduction: u32,
        flags: u32,
        ndf_size: [u32; 2],
        sigma_size: [u32; 2],
        vndf_size: [u32; 2],
        rgb_size: [u32; 2],
        phi: u32,
        theta: u32,
        ndf: u32,
        sigma: u32,
        density: u32,
        conditional: u32,
        marginal: u32,
        rgb: u32,
    }

    struct SparseRecord {
        count: u32,
        is_isotropic: u32,
        pad: [u32; 2],
        pad_2: [u32; 4],
    }

    struct SparseSampleRecord {
        at: [f32; 4],
        value: [f32; 3],
        pad: u32,
    }
}

/// What precedes a BRDF's own words; `LOBE_BYTES` of `glsl/lib/lobe.glsl`. A multiple of 16.
const LOBE_BYTES: usize = 4 * SamplingLobe::FLOATS;

/// All that the device needs of a BRDF: how it is sampled, and its own words.
pub fn pack(lobe: &SamplingLobe, brdf: &[u32]) -> Vec<u32> {
    let mut words = lobe.to_floats().map(f32::to_bits).to_vec();
    debug_assert_eq!(4 * words.len(), LOBE_BYTES);
    words.extend(brdf);
    words
}

/// The words of a BRDF that a file gives, where kernels are built for NeuBRDFs of this shape.
pub fn brdf(brdf: &Brdf, shape: &NeuBrdfShape) -> Vec<u32> {
    let bits = |numbers: &[f32]| numbers.iter().map(|number| number.to_bits()).collect();
    match brdf {
        Brdf::Nbrdf(nbrdf) => bits(&pack_nbrdf(nbrdf)),
        Brdf::NeuBrdf(neubrdf) => pack_neubrdf(neubrdf, shape),
        Brdf::Merl(merl) => bits(merl.values().as_flattened()),
        Brdf::Rgl(rgl) => pack_rgl(rgl),
        Brdf::Sparse(sparse) => pack_sparse(sparse),
    }
}

/// `LayeredTable` of `glsl/lib/bsdf_layered.glsl`.
pub fn layered(layers: &Layered) -> Vec<u32> {
    let Layered { ior, alpha, absorption, base } = *layers;
    let (base, base_alpha, color, eta, kappa) = match base {
        LayerBase::Diffuse { albedo } => (0, Vec2::ONE, albedo, Vec3::ONE, Vec3::ZERO),
        LayerBase::Conductor { fresnel: Fresnel::Schlick { f0 }, alpha } => (1, alpha, f0.value, Vec3::ONE, Vec3::ZERO),
        LayerBase::Conductor { fresnel: Fresnel::Complex { eta, kappa }, alpha } => (2, alpha, Vec3::ONE, eta, kappa),
    };
    let record = LayeredRecord {
        ior,
        alpha,
        base_alpha: base_alpha.into(),
        absorption: absorption.into(),
        base,
        color: color.into(),
        eta: eta.into(),
        kappa: kappa.into(),
    };
    words_of(&[record])
}

/// `WovenTable` of `glsl/lib/bsdf_woven.glsl`.
pub fn woven(cloth: &Woven) -> Vec<u32> {
    let record = |yarn: &Yarn| {
        let share = yarn.coverage * FRAC_1_PI;
        YarnRecord {
            f0: yarn.f0.into(),
            gloss: yarn.gloss * share,
            albedo: (yarn.albedo * (share * (1.0 - yarn.gloss))).into(),
            isotropy: yarn.isotropy,
            specular_width: yarn.specular_width,
            volume_width: yarn.volume_width,
        }
    };
    words_of(&[record(&cloth.warp), record(&cloth.weft)])
}

/// `RglTable` of `glsl/lib/bsdf_rgl.glsl`, and the arrays that it says the places of.
fn pack_rgl(rgl: &Rgl) -> Vec<u32> {
    let tables = rgl.tables();
    let RglTables { phi, theta, ndf, sigma, vndf, rgb, .. } = tables;
    let RglWarp { density, conditional, marginal } = rgl.warp();
    let arrays = [phi, theta, &ndf.values, &sigma.values, density, conditional, marginal, &rgb.values];
    let mut start = size_of::<RglRecord>() / size_of::<u32>();
    let starts = arrays.map(|array| {
        start += array.len();
        (start - array.len()) as u32
    });
    let size = |table: &RglTable| [table.width as u32, table.height as u32];
    let record = RglRecord {
        phis: phi.len() as u32,
        thetas: theta.len() as u32,
        reduction: tables.reduction(),
        flags: u32::from(tables.is_isotropic()) | u32::from(tables.has_jacobian) << 1,
        ndf_size: size(ndf),
        sigma_size: size(sigma),
        vndf_size: size(vndf),
        rgb_size: size(rgb),
        phi: starts[0],
        theta: starts[1],
        ndf: starts[2],
        sigma: starts[3],
        density: starts[4],
        conditional: starts[5],
        marginal: starts[6],
        rgb: starts[7],
    };
    let mut words = words_of(&[record]);
    arrays.iter().for_each(|array| words.extend(array.iter().map(|number| number.to_bits())));
    words
}

/// `SparseTable` and `SparseSamples` of `glsl/lib/bsdf_sparse.glsl`.
fn pack_sparse(sparse: &Sparse) -> Vec<u32> {
    let record = SparseRecord {
        count: sparse.samples().len() as u32,
        is_isotropic: u32::from(sparse.is_isotropic()),
        pad: [0; 2],
        pad_2: [0; 4],
    };
    let samples = sparse.samples().iter().zip(sparse.coordinates());
    let samples: Vec<_> = samples
        .map(|(sample, at)| SparseSampleRecord { at: at.as_vec4().into(), value: sample.value.into(), pad: 0 })
        .collect();
    [words_of(&[record]), words_of(&samples)].concat()
}

/// Structs without padding, as words.
fn words_of<T: NoUninit>(structs: &[T]) -> Vec<u32> {
    bytemuck::cast_slice(structs).to_vec()
}

/// `NbrdfTable` of `glsl/lib/bsdf_nbrdf.glsl`: groups of four numbers, filled up with zeros. For each neuron of the first layer what it
/// takes from the inputs (the second of which is always 0), its bias, and what it gives to each neuron of the second; then the
/// second layer's biases; then what each output takes from them; then its biases.
pub fn pack_nbrdf(nbrdf: &Nbrdf) -> Vec<f32> {
    let Nbrdf { kernel_1, bias_1, kernel_2, bias_2, kernel_3, bias_3 } = nbrdf;
    let mut numbers = Vec::new();
    let mut push = |group: &[f32]| {
        numbers.extend_from_slice(group);
        numbers.resize(numbers.len().next_multiple_of(4), 0.0);
    };
    for neuron in 0..Nbrdf::HIDDEN {
        let [sine, _, cosine, dx, dy, dz] = array::from_fn(|input: usize| kernel_1[input][neuron]);
        push(&[sine, cosine, dx, dy, dz, bias_1[neuron]]);
        push(&kernel_2[neuron]);
    }
    push(bias_2);
    for channel in 0..3 {
        push(&kernel_3.map(|weights| weights[channel]));
    }
    push(bias_3);
    numbers
}
