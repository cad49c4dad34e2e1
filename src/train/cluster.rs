//! Which materials are to share a codebook: those whose reflectance is alike.
//!
//! A material's features are ln(1 + gain · f), the mean of its channels, at a fixed set of pairs of directions; k-means groups them. The
//! paper clusters codes of a convolutional auto-encoder, which has to be trained first, on images of many materials, and then
//! only approximates the distance that is taken here as it is.

use glam::DVec3;
use rayon::prelude::*;

use super::pairs::draw;
use super::random::Random;

/// Pairs of directions that materials are compared at.
const PAIRS: usize = 512;
/// Of the logarithm: what is far below its inverse counts little.
const GAIN: f64 = 100.0;
/// At most; groups rarely change after ten.
const ROUNDS: usize = 50;

/// A material's features. Distances between those of two are what clustering goes by.
pub fn features(eval: &(dyn Fn(DVec3, DVec3) -> DVec3 + Sync)) -> Vec<f64> {
    let mut random = Random::new(0, Random::CLUSTERS);
    let pairs: Vec<(DVec3, DVec3)> = (0..PAIRS).map(|_| draw(&mut random)).collect();
    pairs.par_iter().map(|(wo, wi)| (GAIN * eval(*wo, *wi).element_sum() / 3.0).max(0.0).ln_1p()).collect()
}

/// Puts materials of these features into at most `count` groups of at most `most` members, count · most ≥ their number. Groups are
/// in the order of their first members; none is empty.
pub fn groups(features: &[Vec<f64>], count: usize, most: usize) -> Vec<Vec<usize>> {
    let count = count.clamp(1, features.len().max(1));
    let mut centers = first_centers(features, count);
    let mut group_of = Vec::new();
    for _ in 0..ROUNDS {
        let now = assigned(features, &centers, most);
        if now == group_of {
            break;
        }
        group_of = now;
        for (group, center) in centers.iter_mut().enumerate() {
            let members =
                || features.iter().zip(&group_of).filter(|(_, of)| **of == group).map(|(features, _)| features);
            let size = members().count() as f64;
            if size > 0.0 {
                for (index, center) in center.iter_mut().enumerate() {
                    *center = members().map(|features| features[index]).sum::<f64>() / size;
                }
            }
        }
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); count];
    group_of.iter().enumerate().for_each(|(member, group)| groups[*group].push(member));
    groups.retain(|group| !group.is_empty());
    groups.sort();
    groups
}

/// So many numbers in some order, always the same: groups that nothing but chance makes.
pub fn shuffled(count: usize) -> Vec<usize> {
    Random::new(0, Random::CLUSTERS + 1).permutation(count).into_iter().map(|index| index as usize).collect()
}

/// Materials that are far from one another: each the farthest from those before, the first one the farthest from the mean.
fn first_centers(features: &[Vec<f64>], count: usize) -> Vec<Vec<f64>> {
    let Some(width) = features.first().map(Vec::len) else { return Vec::new() };
    let mean: Vec<f64> =
        (0..width).map(|i| features.iter().map(|of| of[i]).sum::<f64>() / features.len() as f64).collect();
    let mut distances: Vec<f64> = features.iter().map(|of| distance(of, &mean)).collect();
    let mut centers = Vec::new();
    for _ in 0..count {
        let farthest = (0..features.len()).rev().max_by(|a, b| distances[*a].total_cmp(&distances[*b])).unwrap_or(0);
        let center = features[farthest].clone();
        let is_first = centers.is_empty();
        for (known, of) in distances.iter_mut().zip(features) {
            let here = distance(of, &center);
            *known = if is_first { here } else { known.min(here) };
        }
        centers.push(center);
    }
    centers
}

/// The centre of each material: the closest pairs first, as long as there is room.
fn assigned(features: &[Vec<f64>], centers: &[Vec<f64>], most: usize) -> Vec<usize> {
    let mut pairs: Vec<(f64, usize, usize)> = features
        .iter()
        .enumerate()
        .flat_map(|(member, of)| centers.iter().enumerate().map(move |(group, at)| (distance(of, at), member, group)))
        .collect();
    // Pairs of one distance stay in the order of members and groups.
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut group_of = vec![usize::MAX; features.len()];
    let mut sizes = vec![0; centers.len()];
    for (_, member, group) in pairs {
        if group_of[member] == usize::MAX && sizes[group] < most {
            group_of[member] = group;
            sizes[group] += 1;
        }
    }
    group_of
}

/// Squared Euclidean distance.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three heaps on a line: groups are the heaps, whatever the order; with little room the farthest go elsewhere.
    #[test]
    fn groups_are_those_of_what_is_alike() {
        let at = |x: f64| vec![x, 0.0];
        let features: Vec<Vec<f64>> = [0.0, 10.0, 0.1, 20.0, 10.1, 0.3, 10.2, 20.1].map(at).into();
        assert_eq!(groups(&features, 3, 8), [vec![0, 2, 5], vec![1, 4, 6], vec![3, 7]]);
        assert_eq!(groups(&features, 1, 8), [(0..8).collect::<Vec<_>>()]);
        assert_eq!(groups(&features, 99, 8).len(), 8);
        let pairs = groups(&features, 4, 2);
        assert!(pairs.len() == 4 && pairs.iter().all(|group| group.len() == 2) && pairs.contains(&vec![3, 7]));
    }

    #[test]
    fn features_of_a_colour_are_those_of_its_mean() {
        let eval = |scale: DVec3| move |wo: DVec3, _: DVec3| scale * wo.z;
        assert_eq!(features(&eval(DVec3::new(0.3, 0.6, 0.9))).len(), PAIRS);
        let [a, b, c] =
            [DVec3::new(0.2, 0.6, 1.0), DVec3::splat(0.6), DVec3::splat(0.5)].map(|scale| features(&eval(scale)));
        assert!(distance(&a, &b) < 1e-20 && distance(&a, &c) > 1.0);
    }
}
