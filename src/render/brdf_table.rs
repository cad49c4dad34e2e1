//! BRDFs without a sampler of their own, as the device reads them: words behind [`MaterialRecord::table`](super::MaterialRecord).
//!
//! First the sampling lobes (`glsl/lib/lobe.glsl`), then, from byte [`LOBE_BYTES`] on, what `glsl/lib/bsdf_X.glsl` of the
//! BRDF's family evaluates it from.

use std::array;
use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::neubrdf_table::{NeuBrdfShape, pack_neubrdf};
use crate::scene::{
    Brdf, Fresnel, LayerBase, Layered, Nbrdf, Rgl, RglTables, RglWarp, SamplingLobe, Sparse, Woven, Yarn,
};

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
    let Layered { ior, alpha, absorption, base } = layers;
    let (kind, base_alpha, color, eta, kappa) = match *base {
        LayerBase::Diffuse { albedo } => (0, Vec2::ONE, albedo, Vec3::ONE, Vec3::ZERO),
        LayerBase::Conductor { fresnel: Fresnel::Schlick { f0 }, alpha } => (1, alpha, f0.value, Vec3::ONE, Vec3::ZERO),
        LayerBase::Conductor { fresnel: Fresnel::Complex { eta, kappa }, alpha } => (2, alpha, Vec3::ONE, eta, kappa),
    };
    let mut words = [*ior, *alpha, base_alpha.x, base_alpha.y].map(f32::to_bits).to_vec();
    words.extend(absorption.to_array().map(f32::to_bits));
    words.push(kind);
    words.extend([color, eta, kappa].iter().flat_map(|vector| vector.to_array().map(f32::to_bits)));
    words
}

/// `WovenTable` of `glsl/lib/bsdf_woven.glsl`.
pub fn woven(cloth: &Woven) -> Vec<u32> {
    let yarn = |yarn: &Yarn| {
        let share = yarn.coverage * FRAC_1_PI;
        let Vec3 { x, y, z } = yarn.f0;
        let albedo = yarn.albedo * (share * (1.0 - yarn.gloss));
        let widths = [yarn.specular_width, yarn.volume_width];
        [x, y, z, yarn.gloss * share, albedo.x, albedo.y, albedo.z, yarn.isotropy, widths[0], widths[1]]
            .map(f32::to_bits)
    };
    [yarn(&cloth.warp), yarn(&cloth.weft)].concat()
}

/// `RglTable` of `glsl/lib/bsdf_rgl.glsl`, and the arrays that it says the places of.
fn pack_rgl(rgl: &Rgl) -> Vec<u32> {
    let tables = rgl.tables();
    let RglTables { phi, theta, ndf, sigma, vndf, rgb, .. } = tables;
    let RglWarp { density, conditional, marginal } = rgl.warp();
    let flags = u32::from(tables.is_isotropic()) | u32::from(tables.has_jacobian) << 1;
    let mut words = vec![phi.len() as u32, theta.len() as u32, tables.reduction(), flags];
    words.extend([ndf, sigma, vndf, rgb].iter().flat_map(|table| [table.width as u32, table.height as u32]));
    let arrays = [phi, theta, &ndf.values, &sigma.values, density, conditional, marginal, &rgb.values];
    let mut start = words.len() + arrays.len();
    for array in arrays {
        words.push(start as u32);
        start += array.len();
    }
    arrays.iter().for_each(|array| words.extend(array.iter().map(|number| number.to_bits())));
    words
}

/// `SparseTable` of `glsl/lib/bsdf_sparse.glsl`.
fn pack_sparse(sparse: &Sparse) -> Vec<u32> {
    let mut words = vec![sparse.samples().len() as u32, u32::from(sparse.is_isotropic()), 0, 0];
    for (sample, at) in sparse.samples().iter().zip(sparse.coordinates()) {
        words.extend(at.as_vec4().to_array().map(f32::to_bits));
        words.extend(sample.value.extend(0.0).to_array().map(f32::to_bits));
    }
    words
}

/// `NbrdfTable` of `glsl/lib/bsdf_nbrdf.glsl`: groups of four numbers, filled up with zeros. For each neuron of the first layer what it
/// takes from the inputs (the second of which is always 0), its bias, and what it gives to each neuron of the second; then the
/// second layer's biases; then what each output takes from them; then its biases.
fn pack_nbrdf(nbrdf: &Nbrdf) -> Vec<f32> {
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
