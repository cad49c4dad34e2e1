//! Products of small row-major `f32` matrices, the one operation that training spends its time in.
//!
//! The three products of a dense layer (outputs, gradient of the inputs, gradient of the weights) are one function with
//! other strides. A tile of the result stays in registers while the inner dimension runs; columns are the lanes.

use std::array::from_fn;

use pulp::{Arch, Simd, WithSimd};

/// Columns of every matrix are padded with zeros to a multiple of this: the lanes of AVX-512, a multiple of all others'.
pub const LANES: usize = 16;

/// `count` rounded up to whole [`LANES`].
pub fn padded(count: usize) -> usize {
    count.next_multiple_of(LANES)
}

/// The left factor.
#[derive(Clone, Copy)]
pub enum Left<'a> {
    /// Rows one after another, so many numbers apart.
    Rows(&'a [f32], usize),
    /// Columns one after another, so many numbers apart: the transpose of what is stored.
    Columns(&'a [f32], usize),
}

impl Left<'_> {
    /// Packs `R` rows from `row` on, `panel.len()` columns from `inner` on, one column after another.
    #[inline(always)]
    fn pack<const R: usize>(self, row: usize, inner: usize, panel: &mut [[f32; R]]) {
        match self {
            Left::Rows(data, stride) => {
                let rows: [&[f32]; R] = from_fn(|r| &data[(row + r) * stride + inner..][..panel.len()]);
                panel.iter_mut().enumerate().for_each(|(k, packed)| *packed = from_fn(|r| rows[r][k]));
            }
            Left::Columns(data, stride) => {
                for (k, packed) in panel.iter_mut().enumerate() {
                    packed.copy_from_slice(&data[(inner + k) * stride + row..][..R]);
                }
            }
        }
    }
}

/// What becomes of a product: of each sum of it and the number in its place.
#[derive(Clone, Copy)]
pub enum Then<'a> {
    /// out + sum.
    Add,
    /// sum + offset, a row of offsets for all rows: a dense layer.
    Offset(&'a [f32]),
    /// The same where it is above 0, else 0: a dense layer with a ReLU.
    Relu(&'a [f32]),
    /// The sum.
    Set,
    /// The sum where these values, rows × columns, are above 0, else 0: back through the ReLU that they came out of.
    SetWhereAbove0(&'a [f32]),
}

/// `left · right`, with `right` inner × columns and `out` rows × columns, both dense row by row.
///
/// # Panics
/// If `columns` is no multiple of [`LANES`], a slice is shorter than that says, or the inner dimension is above [`DEPTH`] and sums are not
/// [added](Then::Add).
pub fn multiply(left: Left, inner: usize, right: &[f32], columns: usize, then: Then, out: &mut [f32]) {
    assert!(columns.is_multiple_of(LANES) && out.len().is_multiple_of(columns));
    assert!(inner <= DEPTH || matches!(then, Then::Add));
    Arch::new().dispatch(Product { left, right: &right[..inner * columns], columns, then, out });
}

struct Product<'a> {
    left: Left<'a>,
    right: &'a [f32],
    columns: usize,
    then: Then<'a>,
    out: &'a mut [f32],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Product { left, right, columns, then, out } = self;
        let width = columns / S::F32_LANES;
        let (right, _) = S::as_simd_f32s(right);
        let (out, _) = S::as_mut_simd_f32s(out);
        let mut panel = [0.0; ROWS * DEPTH];
        for (block, right) in right.chunks(DEPTH * width).enumerate() {
            let mut factors = Factors { left, row: 0, inner: block * DEPTH, right, width, then };
            let mut rest = &mut *out;
            while !rest.is_empty() {
                let rows = match rest.len() / width {
                    ROWS.. => factors.row_block::<ROWS>(simd, &mut panel, rest),
                    4.. => factors.row_block::<4>(simd, &mut panel, rest),
                    2.. => factors.row_block::<2>(simd, &mut panel, rest),
                    _ => factors.row_block::<1>(simd, &mut panel, rest),
                };
                factors.row += rows;
                rest = &mut rest[rows * width..];
            }
        }
    }
}

/// Rows of a tile. Two vectors of each are as many accumulators as the 16 registers of AVX2 hold beside the factors.
const ROWS: usize = 6;

/// Inner dimension of the packed rows: longer products are summed in parts.
pub const DEPTH: usize = 256;

/// What a part of a product is made of.
struct Factors<'a, S: Simd> {
    left: Left<'a>,
    /// Where in `left` it begins.
    row: usize,
    inner: usize,
    right: &'a [S::f32s],
    /// Vectors of a row.
    width: usize,
    then: Then<'a>,
}

impl<'a, S: Simd> Factors<'a, S> {
    /// `R` rows of the result; returns `R`. Their left factors are packed first, so that tiles read both factors in order.
    #[inline(always)]
    fn row_block<const R: usize>(&self, simd: S, panel: &mut [f32; ROWS * DEPTH], out: &mut [S::f32s]) -> usize {
        let (panel, _) = panel.as_chunks_mut::<R>();
        let panel = &mut panel[..self.right.len() / self.width];
        self.left.pack(self.row, self.inner, panel);
        let mut column = 0;
        while column < self.width {
            column += match self.width - column {
                2.. => self.tile::<R, 2>(simd, panel, column, out),
                _ => self.tile::<R, 1>(simd, panel, column, out),
            };
        }
        R
    }

    /// `V` columns of vectors of `R` rows; returns `V`.
    #[inline(always)]
    fn tile<const R: usize, const V: usize>(
        &self,
        simd: S,
        panel: &[[f32; R]],
        column: usize,
        out: &mut [S::f32s],
    ) -> usize {
        let mut sums = [[simd.splat_f32s(0.0); V]; R];
        for (left, right) in panel.iter().zip(self.right.chunks_exact(self.width)) {
            let Some(right) = right[column..].first_chunk::<V>() else { break };
            for (left, sums) in left.iter().zip(&mut sums) {
                let left = simd.splat_f32s(*left);
                for (sum, right) in sums.iter_mut().zip(right) {
                    *sum = simd.mul_add_f32s(left, *right, *sum);
                }
            }
        }
        let zero = simd.splat_f32s(0.0);
        for (r, (sums, out)) in sums.iter().zip(out.chunks_mut(self.width)).enumerate() {
            let row = |numbers: &'a [f32], row: usize| &S::as_simd_f32s(numbers).0[row * self.width + column..][..V];
            let out = &mut out[column..column + V];
            match self.then {
                Then::Add => each(out, sums, sums, |out, sum, _| simd.add_f32s(out, sum)),
                Then::Offset(offset) => each(out, sums, row(offset, 0), |_, sum, offset| simd.add_f32s(offset, sum)),
                Then::Relu(offset) => {
                    each(out, sums, row(offset, 0), |_, sum, offset| simd.max_f32s(simd.add_f32s(offset, sum), zero))
                }
                Then::Set => out.copy_from_slice(sums),
                Then::SetWhereAbove0(values) => each(out, sums, row(values, self.row + r), |_, sum, value| {
                    simd.select_f32s(simd.greater_than_f32s(value, zero), sum, zero)
                }),
            }
        }
        V
    }
}

/// Sets each number to what becomes of it, the sum in its place and another number there.
#[inline(always)]
fn each<V: Copy>(out: &mut [V], sums: &[V], others: &[V], then: impl Fn(V, V, V) -> V) {
    for ((out, sum), other) in out.iter_mut().zip(sums).zip(others) {
        *out = then(*out, *sum, *other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_the_definition_at_every_size_and_stride() {
        let number = |i: usize| ((i * 2_654_435_761) % 1000) as f32 / 500.0 - 1.0;
        for (rows, inner, columns) in
            [(1, 1, 16), (6, 3, 16), (7, 32, 64), (13, 21, 48), (128, 64, 80), (5, 2, 128), (9, 300, 32)]
        {
            let left: Vec<f32> = (0..rows * inner).map(number).collect();
            let right: Vec<f32> = (0..inner * columns).map(|i| number(i + 7)).collect();
            for (factor, row_stride, inner_stride) in
                [(Left::Rows(&left, inner), inner, 1), (Left::Columns(&left, rows), 1, rows)]
            {
                let mut out = vec![1.0; rows * columns];
                multiply(factor, inner, &right, columns, Then::Add, &mut out);
                if inner <= DEPTH {
                    becomes_what_it_says(factor, inner, &right, columns, &out);
                }
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

    /// `added` is the product plus 1.
    fn becomes_what_it_says(left: Left, inner: usize, right: &[f32], columns: usize, added: &[f32]) {
        let offset: Vec<f32> = (0..columns).map(|column| column as f32 - 8.0).collect();
        let values: Vec<f32> = (0..added.len()).map(|i| (i % 3) as f32 - 1.0).collect();
        type Expected<'a> = &'a dyn Fn(f32, usize) -> f32;
        let cases: [(Then, Expected); 4] = [
            (Then::Offset(&offset), &|sum, i| sum + offset[i % columns]),
            (Then::Relu(&offset), &|sum, i| (sum + offset[i % columns]).max(0.0)),
            (Then::Set, &|sum, _| sum),
            (Then::SetWhereAbove0(&values), &|sum, i| if values[i] > 0.0 { sum } else { 0.0 }),
        ];
        for (then, expected) in cases {
            let mut out = vec![f32::NAN; added.len()];
            multiply(left, inner, right, columns, then, &mut out);
            for (i, (out, added)) in out.iter().zip(added).enumerate() {
                assert!((out - expected(added - 1.0, i)).abs() < 1e-4, "{i}: {out}");
            }
        }
    }
}
