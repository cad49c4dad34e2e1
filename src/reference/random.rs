//! Random numbers: one stream of xoshiro256++ (Blackman & Vigna 2019) for each sample of each pixel, seeded through
//! SplitMix64 as its authors advise.

/// A stream of uniform numbers.
pub struct Random {
    state: [u64; 4],
}

impl Random {
    /// The stream of a pixel's sample; the same for the same numbers, whatever else is rendered.
    pub fn new(seed: u64, pixel: u64, sample: u64) -> Random {
        let mut counter = mix(mix(mix(seed) ^ pixel) ^ sample);
        let state = std::array::from_fn(|_| {
            counter = counter.wrapping_add(GOLDEN);
            mix(counter)
        });
        Random { state }
    }

    /// The next number, in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        let state = &mut self.state;
        let result = state[0].wrapping_add(state[3]).rotate_left(23).wrapping_add(state[0]);
        let shifted = state[1] << 17;
        state[2] ^= state[0];
        state[3] ^= state[1];
        state[1] ^= state[2];
        state[0] ^= state[3];
        state[2] ^= shifted;
        state[3] = state[3].rotate_left(45);
        (result >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// SplitMix64's output function, after one step of its counter.
fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(GOLDEN);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
