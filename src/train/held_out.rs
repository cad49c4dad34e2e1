//! Measurements that are kept from a training, to judge it by.

use glam::Vec3;

use super::pairs::Pair;
use super::random::Random;

/// Of fewer measurements none is held out: each is needed.
const FEWEST: usize = 50;

/// Takes about this share of the measurements, two pairs each, out of `pairs`, and returns their pairs. What was measured of the same two directions
/// goes together, whichever way the light went: all of an image, and both of what is reciprocal. Otherwise a fit would be judged by
/// what it has seen.
pub fn hold_out(pairs: &mut Vec<Pair>, share: f64, seed: u64) -> Vec<Pair> {
    if pairs.len() / 2 < FEWEST {
        return Vec::new();
    }
    let held_out: Vec<Pair> = pairs.extract_if(.., |pair| is_held_out(pair, share, seed)).collect();
    if !pairs.is_empty() {
        return held_out;
    }
    // All are of the same directions.
    *pairs = held_out;
    Vec::new()
}

fn is_held_out(pair: &Pair, share: f64, seed: u64) -> bool {
    // A zero may be negative.
    let number = |hash, x: f32| Random::new(hash, (x + 0.0).to_bits().into()).next_u64();
    let hash = |w: Vec3| w.to_array().into_iter().fold(Random::HELD_OUT, number);
    Random::new(seed, hash(pair.wo).wrapping_add(hash(pair.wi))).next_f64() < share
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(count: usize) -> Vec<Pair> {
        let mut random = Random::new(1, 0);
        let mut direction = || Vec3::new(random.next_f32() - 0.5, random.next_f32() - 0.5, 0.7).normalize();
        let pairs = (0..count).map(|_| Pair { wo: direction(), wi: direction(), ..Pair::default() });
        pairs.flat_map(|pair| [pair, pair.reciprocal()]).collect()
    }

    #[test]
    fn a_share_is_held_out_and_nothing_of_it_is_learned() {
        let all = measured(2000);
        let mut learned = all.clone();
        let held_out = hold_out(&mut learned, 0.1, 7);
        assert!((300..500).contains(&held_out.len()) && learned.len() + held_out.len() == all.len());
        assert!(held_out.chunks(2).all(|both| both[0] == both[1].reciprocal()));
        // Whatever the order.
        let mut turned: Vec<Pair> = all.iter().rev().copied().collect();
        assert!(hold_out(&mut turned, 0.1, 7).into_iter().rev().eq(held_out.iter().copied()));
        assert!(hold_out(&mut all.clone(), 0.1, 8) != held_out);
        assert!(hold_out(&mut all.clone(), 0.0, 7).is_empty());
    }

    #[test]
    fn what_is_needed_is_not_held_out() {
        let few = measured(FEWEST - 1);
        let one = vec![Pair { wo: Vec3::Z, wi: Vec3::Z, ..Pair::default() }; 200];
        for all in [few, one] {
            let mut learned = all.clone();
            assert!(hold_out(&mut learned, 0.9999, 7).is_empty() && learned == all);
        }
    }
}
