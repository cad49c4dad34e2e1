//! The lobes by which a BRDF without a sampler of its own is sampled.

/// Two anisotropic GGX lobes of visible normals, a narrow one for the peak and a wide one for what surrounds it, to be mixed with a
/// cosine hemisphere: see `crate::material::LobeSampled`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplingLobe {
    /// GGX α of each lobe along the tangent and the bitangent, in [[`SamplingLobe::LEAST_ALPHA`], 1].
    pub alpha: [[f32; 2]; 2],
    /// The probability of each lobe at cos θo = i / ([`SamplingLobe::NODES`] − 1), linear between; not negative, together at most
    /// [`SamplingLobe::MOST_WEIGHT`].
    pub weight: [[f32; 2]; SamplingLobe::NODES],
}

impl SamplingLobe {
    /// Entries of the table of weights.
    pub const NODES: usize = 16;
    /// Below this a lobe is as good as a mirror's, and `f32` no longer is enough to sample it well.
    pub const LEAST_ALPHA: f32 = 1e-3;
    /// What is left to the hemisphere bounds the weight of samples that the lobes do not expect.
    pub const MOST_WEIGHT: f32 = 0.98;
    /// Numbers in [`SamplingLobe::to_floats`].
    pub const FLOATS: usize = 4 + 2 * SamplingLobe::NODES;

    /// A hemisphere alone.
    pub const COSINE: SamplingLobe = SamplingLobe { alpha: [[1.0; 2]; 2], weight: [[0.0; 2]; SamplingLobe::NODES] };

    /// As files and the device keep it: α, then weights.
    pub fn to_floats(&self) -> [f32; SamplingLobe::FLOATS] {
        let mut floats = [0.0; SamplingLobe::FLOATS];
        let (alpha, weight) = floats.split_at_mut(4);
        alpha.copy_from_slice(self.alpha.as_flattened());
        weight.copy_from_slice(self.weight.as_flattened());
        floats
    }

    /// The opposite of [`SamplingLobe::to_floats`]; `None` where a number is out of range.
    pub fn from_floats(floats: &[f32; SamplingLobe::FLOATS]) -> Option<SamplingLobe> {
        let mut lobe = SamplingLobe::COSINE;
        let (alpha, weight) = floats.split_at(4);
        lobe.alpha.as_flattened_mut().copy_from_slice(alpha);
        lobe.weight.as_flattened_mut().copy_from_slice(weight);
        let is_alpha = |alpha: &f32| (SamplingLobe::LEAST_ALPHA..=1.0).contains(alpha);
        // A sum may exceed the bound by its rounding.
        let is_pair = |[a, b]: &[f32; 2]| *a >= 0.0 && *b >= 0.0 && a + b <= SamplingLobe::MOST_WEIGHT + 1e-6;
        (alpha.iter().all(is_alpha) && lobe.weight.iter().all(is_pair)).then_some(lobe)
    }
}
