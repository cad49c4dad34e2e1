//! Short vectors of `f32`.

use std::array::from_fn;

use rayon::prelude::*;

use super::product::{Left, Then, multiply, padded};

/// Σ aᵢbᵢ.
pub fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// out = Σ factorᵢ · rowᵢ, all of one length.
#[inline]
pub fn weighted_sum<const N: usize>(rows: [&[f32]; N], factors: [f32; N], out: &mut [f32]) {
    let (blocks, rest) = out.as_chunks_mut::<4>();
    for (at, block) in blocks.iter_mut().enumerate() {
        let mut sum = [0.0; 4];
        for (row, factor) in rows.iter().zip(factors) {
            sum = plus_scaled(sum, factor, &row.as_chunks().0[at]);
        }
        *block = sum;
    }
    let done = 4 * blocks.len();
    for (at, sum) in rest.iter_mut().enumerate() {
        *sum = rows.iter().zip(factors).map(|(row, factor)| factor * row[done + at]).sum();
    }
}

/// sum += factor · row.
#[inline]
pub fn add_scaled(sum: &mut [f32], factor: f32, row: &[f32]) {
    let ((sums, sum), (rows, row)) = (sum.as_chunks_mut(), row.as_chunks());
    for (sum, row) in sums.iter_mut().zip(rows) {
        *sum = plus_scaled(*sum, factor, row);
    }
    sum.iter_mut().zip(row).for_each(|(sum, x)| *sum += factor * x);
}

/// sum + factor · row: of values, so that it is one instruction each, as numbers that may lie over one another could not be.
#[inline]
fn plus_scaled(sum: [f32; 4], factor: f32, row: &[f32; 4]) -> [f32; 4] {
    from_fn(|i| sum[i] + factor * row[i])
}

/// For each of `points` (count × features) the row of `rows` that is nearest; the first of equals.
///
/// The nearest has the largest z·c − |c|²/2, and those are one matrix product.
pub fn nearest(rows: &[f32], features: usize, points: &[f32]) -> Vec<u32> {
    let count = rows.len() / features;
    let columns = padded(count);
    let mut transposed = vec![0.0; features * columns];
    let mut offsets = vec![f32::NEG_INFINITY; columns];
    for (index, row) in rows.chunks_exact(features).enumerate() {
        offsets[index] = -0.5 * dot(row, row);
        row.iter().enumerate().for_each(|(feature, x)| transposed[feature * columns + index] = *x);
    }
    let mut result = vec![0; points.len() / features];
    result.par_chunks_mut(TOGETHER).zip(points.par_chunks(TOGETHER * features)).for_each(|(result, points)| {
        let mut products = offsets.repeat(result.len());
        multiply(Left::Rows(points, features), features, &transposed, columns, Then::Add, &mut products);
        for (result, products) in result.iter_mut().zip(products.chunks_exact(columns)) {
            *result = highest(products) as u32;
        }
    });
    result
}

/// Points that go through a product together.
const TOGETHER: usize = 64;

/// The place of the largest number; the first of equals.
pub fn highest(values: &[f32]) -> usize {
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    let (blocks, rest) = values.as_chunks::<16>();
    // On all lanes first.
    let lanes =
        blocks.iter().fold([f32::NEG_INFINITY; 16], |most, block| from_fn(|lane| larger(block[lane], most[lane])));
    let most = lanes.iter().chain(rest).copied().fold(f32::NEG_INFINITY, larger);
    values.iter().position(|value| *value == most).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::super::random::Random;
    use super::*;

    #[test]
    fn the_highest_is_the_first_of_equals() {
        let mut random = Random::new(10, 0);
        for count in [1, 15, 16, 40, 129] {
            let values: Vec<f32> = (0..count).map(|_| random.below(9) as f32 - 20.0).collect();
            let place = highest(&values);
            assert!(values[..place].iter().all(|value| *value < values[place]));
            assert!(values[place..].iter().all(|value| *value <= values[place]));
        }
    }

    #[test]
    fn the_nearest_row_is_that_of_least_distance() {
        let mut random = Random::new(9, 0);
        let (features, count) = (5, 37);
        let mut numbers = |count: usize| -> Vec<f32> { (0..count).map(|_| 2.0 * random.next_f32() - 1.0).collect() };
        let (rows, points) = (numbers(count * features), numbers(150 * features));
        let distance = |index: u32, point: &[f32]| -> f32 {
            let row = &rows[index as usize * features..][..features];
            row.iter().zip(point).map(|(a, b)| (a - b) * (a - b)).sum()
        };
        for (found, point) in nearest(&rows, features, &points).into_iter().zip(points.chunks_exact(features)) {
            let least = (0..count as u32).map(|index| distance(index, point)).fold(f32::INFINITY, f32::min);
            assert!(distance(found, point) <= least + 1e-5);
        }
    }
}
