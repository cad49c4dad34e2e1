//! BRDFs that a file gives, as the device reads them: words behind [`MaterialRecord::table`](super::MaterialRecord).
//!
//! First the sampling lobes (`glsl/lib/lobe.glsl`), then, from byte [`LOBE_BYTES`] on, what `glsl/lib/bsdf_X.glsl` of the
//! BRDF's family evaluates it from.

use std::array;

use crate::scene::{Brdf, Nbrdf, SamplingLobe};

/// What precedes a BRDF's own words; `LOBE_BYTES` of `glsl/lib/lobe.glsl`. A multiple of 16.
const LOBE_BYTES: usize = 4 * SamplingLobe::FLOATS;

/// All that the device needs of a BRDF.
pub fn pack(lobe: &SamplingLobe, brdf: &Brdf) -> Vec<u32> {
    let mut words: Vec<u32> = lobe.to_floats().iter().map(|number| number.to_bits()).collect();
    debug_assert_eq!(4 * words.len(), LOBE_BYTES);
    match brdf {
        Brdf::Nbrdf(nbrdf) => words.extend(pack_nbrdf(nbrdf).iter().map(|number| number.to_bits())),
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
