//! Products of small row-major `f32` matrices, the one operation that training spends its time in.
//!
//! The three products of a dense layer (outputs, gradient of the inputs, gradient of the weights) are one function with
//! other strides. A tile of the result stays in registers while the inner dimension runs; columns are the lanes.

use pulp::{Arch, Simd, WithSimd};

/// Columns of every matrix are padded with zeros to a multiple of this: the lanes of AVX-512, a multiple of all others'.
pub const LANES: usize = 16;

/// `count` rounded up to whole [`LANES`].
pub fn padded(count: usize) -> usize {
    count.next_multiple_of(LANES)
}

/// The left factor: element (row, inner) is `data[row · row_stride + inner · inner_stride]`.
#[derive(Clone, Copy)]
pub struct Left<'a> {
    /// The elements.
    pub data: &'a [f32],
    /// From one row to the next.
    pub row_stride: usize,
    /// From one column to the next.
    pub inner_stride: usize,
}

/// `out += left · right`, with `right` inner × columns and `out` rows × columns, both dense row by row.
///
/// # Panics
/// If `columns` is no multiple of [`LANES`], or a slice is shorter than that says.
pub fn multiply_add(left: Left, inner: usize, right: &[f32], columns: usize, out: &mut [f32]) {
    assert!(columns.is_multiple_of(LANES) && out.len().is_multiple_of(columns));
    Arch::new().dispatch(Product { left, right: &right[..inner * columns], columns, out });
}

struct Product<'a> {
    left: Left<'a>,
    right: &'a [f32],
    columns: usize,
    out: &'a mut [f32],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Product { left, right, columns, out } = self;
        let width = columns / S::F32_LANES;
        let (right, _) = S::as_simd_f32s(right);
        let (out, _) = S::as_mut_simd_f32s(out);
        let mut column = 0;
        while column < width {
            // As many accumulators as the registers of AVX-512 (32) or of the others (16) hold.
            column += match width - column {
                2.. => rows::<S, 2>(simd, left, right, width, column, out),
                _ => rows::<S, 1>(simd, left, right, width, column, out),
            };
        }
    }
}

/// All rows of `V` columns of vectors; returns `V`.
#[inline(always)]
fn rows<S: Simd, const V: usize>(
    simd: S,
    left: Left,
    right: &[S::f32s],
    width: usize,
    column: usize,
    out: &mut [S::f32s],
) -> usize {
    let count = out.len() / width;
    let mut row = 0;
    while row < count {
        let rest = Left { data: &left.data[row * left.row_stride..], ..left };
        let out = &mut out[row * width..];
        row += match count - row {
            6.. => tile::<S, 6, V>(simd, rest, right, width, column, out),
            4.. => tile::<S, 4, V>(simd, rest, right, width, column, out),
            2.. => tile::<S, 2, V>(simd, rest, right, width, column, out),
            _ => tile::<S, 1, V>(simd, rest, right, width, column, out),
        };
    }
    V
}

/// `R` rows of `V` columns of vectors; returns `R`.
#[inline(always)]
fn tile<S: Simd, const R: usize, const V: usize>(
    simd: S,
    left: Left,
    right: &[S::f32s],
    width: usize,
    column: usize,
    out: &mut [S::f32s],
) -> usize {
    let mut sums = [[simd.splat_f32s(0.0); V]; R];
    for (k, right) in right.chunks_exact(width).enumerate() {
        let right = &right[column..column + V];
        for (r, sums) in sums.iter_mut().enumerate() {
            let factor = simd.splat_f32s(left.data[r * left.row_stride + k * left.inner_stride]);
            for (sum, right) in sums.iter_mut().zip(right) {
                *sum = simd.mul_add_f32s(factor, *right, *sum);
            }
        }
    }
    for (r, sums) in sums.iter().enumerate() {
        for (out, sum) in out[r * width + column..].iter_mut().zip(sums) {
            *out = simd.add_f32s(*out, *sum);
        }
    }
    R
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_the_definition_at_every_size_and_stride() {
        let number = |i: usize| ((i * 2_654_435_761) % 1000) as f32 / 500.0 - 1.0;
        for (rows, inner, columns) in [(1, 1, 16), (6, 3, 16), (7, 32, 64), (13, 21, 48), (128, 64, 80), (5, 2, 128)] {
            let left: Vec<f32> = (0..rows * inner).map(number).collect();
            let right: Vec<f32> = (0..inner * columns).map(|i| number(i + 7)).collect();
            for (row_stride, inner_stride) in [(inner, 1), (1, rows)] {
                let mut out = vec![1.0; rows * columns];
                multiply_add(Left { data: &left, row_stride, inner_stride }, inner, &right, columns, &mut out);
                for row in 0..rows {
                    for column in 0..columns {
                        let expected: f64 = (0..inner)
                            .map(|k| {
                                f64::from(left[row * row_stride + k * inner_stride])
                                    * f64::from(right[k * columns + column])
                            })
                            .sum();
                        let found = f64::from(out[row * columns + column]);
                        assert!((found - 1.0 - expected).abs() < 1e-4, "{rows}×{inner}×{columns}: {found} {expected}");
                    }
                }
            }
        }
    }
}
