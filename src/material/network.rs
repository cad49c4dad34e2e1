//! Small networks at many inputs at once, in `f64`: each layer is a product of matrices, with an input's numbers in a column.
//!
//! A value is the same to the bit whatever it is computed together with; from one computed alone it differs by the order in which products are
//! summed.

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use crate::scene::brdf::Dense;

/// Inputs that go through the layers together, few enough for all their numbers to stay in a core's own cache.
const TOGETHER: usize = 64;
/// Vectors of a row that stay in registers.
const VECTORS: usize = 2;
/// Columns are padded to a multiple of this, as many as the registers hold: AVX-512 has 8 lanes, which is a multiple of all others'.
const PADDING: usize = 8 * VECTORS;

/// The three outputs of a network at each of some inputs: ReLU after each layer but the last.
pub fn outputs(layers: &[Dense], inputs: &[Vec<f64>]) -> Vec<DVec3> {
    let layers: Vec<Layer> = layers.iter().map(Layer::new).collect();
    let mut outputs = Vec::with_capacity(inputs.len());
    for inputs in inputs.chunks(TOGETHER) {
        let columns = inputs.len().next_multiple_of(PADDING);
        let mut x = vec![0.0; inputs[0].len() * columns];
        for (column, input) in inputs.iter().enumerate() {
            x.iter_mut().skip(column).step_by(columns).zip(input).for_each(|(x, number)| *x = *number);
        }
        for (index, layer) in layers.iter().enumerate() {
            x = layer.at(&x, columns);
            if index + 1 < layers.len() {
                x.iter_mut().for_each(|x| *x = x.max(0.0));
            }
        }
        outputs.extend((0..inputs.len()).map(|column| DVec3::from([0, 1, 2].map(|row| x[row * columns + column]))));
    }
    outputs
}

/// A [`Dense`] layer, y = W x + b, in `f64`.
struct Layer {
    /// W, outputs × inputs: a row an output.
    weights: Vec<f64>,
    /// b.
    bias: Vec<f64>,
}

impl Layer {
    fn new(dense: &Dense) -> Layer {
        let wide = |numbers: &[f32]| numbers.iter().map(|number| f64::from(*number)).collect();
        Layer { weights: wide(&dense.weights), bias: wide(&dense.bias) }
    }

    /// y for the columns of `x`.
    fn at(&self, x: &[f64], columns: usize) -> Vec<f64> {
        let mut y = vec![0.0; self.bias.len() * columns];
        Arch::new().dispatch(Product { layer: self, x, columns, y: &mut y });
        y
    }
}

struct Product<'a> {
    layer: &'a Layer,
    x: &'a [f64],
    columns: usize,
    y: &'a mut [f64],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Product { layer: Layer { weights, bias }, x, columns, y } = self;
        let inputs = x.len() / columns;
        let width = columns / S::F64_LANES;
        let (x, _) = S::as_simd_f64s(x);
        let (y, _) = S::as_mut_simd_f64s(y);
        for column in (0..width).step_by(VECTORS) {
            let mut row = 0;
            while row < bias.len() {
                let (weights, bias, y) = (&weights[row * inputs..], &bias[row..], &mut y[row * width + column..]);
                // As many sums as additions are under way at a time.
                row += match bias.len() {
                    4.. => tile::<S, 4>(simd, weights, bias, &x[column..], width, y),
                    _ => tile::<S, 1>(simd, weights, bias, &x[column..], width, y),
                };
            }
        }
    }
}

/// `R` rows of some vectors of y; returns `R`.
#[inline(always)]
fn tile<S: Simd, const R: usize>(
    simd: S,
    weights: &[f64],
    bias: &[f64],
    x: &[S::f64s],
    width: usize,
    y: &mut [S::f64s],
) -> usize {
    let inputs = x.len().div_ceil(width);
    let rows: [&[f64]; R] = std::array::from_fn(|row| &weights[row * inputs..][..inputs]);
    let mut sums: [[S::f64s; VECTORS]; R] = std::array::from_fn(|row| [simd.splat_f64s(bias[row]); VECTORS]);
    for (input, x) in x.chunks(width).enumerate() {
        let x = &x[..VECTORS];
        for (sums, weights) in sums.iter_mut().zip(rows) {
            let weight = simd.splat_f64s(weights[input]);
            for (sum, x) in sums.iter_mut().zip(x) {
                *sum = simd.mul_add_e_f64s(weight, *x, *sum);
            }
        }
    }
    for (row, sums) in sums.iter().enumerate() {
        y[row * width..][..VECTORS].copy_from_slice(sums);
    }
    R
}
