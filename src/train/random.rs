//! Random numbers for training: reproducible from a seed, split without overlap in practice.

/// SplitMix64 (Steele, Lea and Flood, *Fast Splittable Pseudorandom Number Generators*, OOPSLA 2014).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Random(u64);

/// The streams of a seed. Pairs are drawn from those from 0 on, some thousands a stream.
impl Random {
    /// What a training begins with.
    pub const START: u64 = 1 << 40;
    /// What codes begin with.
    pub const QUANTISE: u64 = 2 << 40;
    /// Views that are asked for their albedos, and those after it.
    pub const PROBES: u64 = 3 << 40;
    /// The order of pairs in the first epoch; the next are those after it.
    pub const EPOCHS: u64 = 4 << 40;
    /// Pairs that materials are compared at; the next is that of groups that nothing but chance makes.
    pub const CLUSTERS: u64 = 5 << 40;
    /// Which measurements are not learned.
    pub const HELD_OUT: u64 = 7 << 40;
    /// The order of measurements.
    pub const ROUNDS: u64 = 6 << 40;
}

impl Random {
    /// The sequence of number `stream` of a seed.
    pub fn new(seed: u64, stream: u64) -> Random {
        let mut random = Random(seed);
        let start = random.next_u64() ^ stream.wrapping_mul(0xd134_2543_de82_ef95);
        let mut random = Random(start);
        Random(random.next_u64())
    }

    /// 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    /// Uniform in [0, 1).
    pub fn next_f64(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (0.5f64).powi(53)
    }

    /// Uniform in [0, 1).
    pub fn next_f32(&mut self) -> f32 {
        (self.next_u64() >> 40) as f32 * (0.5f32).powi(24)
    }

    /// Uniform among `0..count`.
    pub fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.next_u64()) * count as u128) >> 64) as usize
    }

    /// Any order of `0..count`, each equally likely (Fisher and Yates).
    pub fn permutation(&mut self, count: usize) -> Vec<u32> {
        let mut order: Vec<u32> = (0..count as u32).collect();
        for last in (1..count).rev() {
            order.swap(last, self.below(last + 1));
        }
        order
    }
}
