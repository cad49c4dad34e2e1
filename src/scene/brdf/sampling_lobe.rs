//! The lobe by which a BRDF without a sampler of its own is sampled.

/// An anisotropic GGX lobe of visible normals, to be mixed with a cosine hemisphere: see `crate::material::LobeSampled`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplingLobe {
    /// GGX α along the tangent and the bitangent, in [[`SamplingLobe::LEAST_ALPHA`], 1].
    pub alpha: [f32; 2],
    /// The probability of the lobe at cos θo = i / ([`SamplingLobe::NODES`] − 1), linear between; each in
    /// [0, [`SamplingLobe::MOST_WEIGHT`]].
    pub weight: [f32; SamplingLobe::NODES],
}

impl SamplingLobe {
    /// Entries of the table of weights.
    pub const NODES: usize = 16;
    /// Below this a lobe is as good as a mirror's, and `f32` no longer is enough to sample it well.
    pub const LEAST_ALPHA: f32 = 1e-3;
    /// What is left to the hemisphere bounds the weight of samples that the lobe does not expect.
    pub const MOST_WEIGHT: f32 = 0.98;
    /// Numbers in [`SamplingLobe::to_floats`].
    pub const FLOATS: usize = 2 + SamplingLobe::NODES;

    /// A hemisphere alone.
    pub const COSINE: SamplingLobe = SamplingLobe { alpha: [1.0; 2], weight: [0.0; SamplingLobe::NODES] };

    /// As files keep it.
    pub fn to_floats(&self) -> [f32; SamplingLobe::FLOATS] {
        let mut floats = [0.0; SamplingLobe::FLOATS];
        floats[..2].copy_from_slice(&self.alpha);
        floats[2..].copy_from_slice(&self.weight);
        floats
    }

    /// The opposite of [`SamplingLobe::to_floats`]; `None` where a number is out of range.
    pub fn from_floats(floats: &[f32; SamplingLobe::FLOATS]) -> Option<SamplingLobe> {
        let mut lobe = SamplingLobe::COSINE;
        lobe.alpha.copy_from_slice(&floats[..2]);
        lobe.weight.copy_from_slice(&floats[2..]);
        let is_valid = lobe.alpha.iter().all(|alpha| (SamplingLobe::LEAST_ALPHA..=1.0).contains(alpha))
            && lobe.weight.iter().all(|weight| (0.0..=SamplingLobe::MOST_WEIGHT).contains(weight));
        is_valid.then_some(lobe)
    }
}
