//! Dense layers with ReLU between them: forward, backward, over shards of a batch.

use pulp::Arch;

use super::product::{LANES, Left, Then, multiply, padded};
use super::random::Random;

/// Where a layer's numbers are in [`Network::parameters`]: weights, inputs × padded outputs, then the padded bias.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Numbers that go in.
    pub inputs: usize,
    /// Numbers that come out.
    pub outputs: usize,
    start: usize,
    transposed_start: usize,
}

impl Shape {
    fn columns(&self) -> usize {
        padded(self.outputs)
    }

    fn bias_start(&self) -> usize {
        self.start + self.inputs * self.columns()
    }

    fn end(&self) -> usize {
        self.bias_start() + self.columns()
    }

    /// Where the weight from `input` to `output` is.
    pub fn weight(&self, output: usize, input: usize) -> usize {
        self.start + input * self.columns() + output
    }

    /// Where the bias of `output` is.
    pub fn bias(&self, output: usize) -> usize {
        self.bias_start() + output
    }
}

/// A multi-layer perceptron. Padding begins with zeros; what becomes of it nothing reads.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// From the first layer to the last.
    pub shapes: Vec<Shape>,
    /// All weights and biases.
    pub parameters: Vec<f32>,
}

impl Network {
    /// Layers between these widths, all zero.
    pub fn zeros(widths: &[usize]) -> Network {
        let mut shapes = Vec::new();
        let (mut start, mut transposed_start) = (0, 0);
        for width in widths.windows(2) {
            let shape = Shape { inputs: width[0], outputs: width[1], start, transposed_start };
            start = shape.end();
            transposed_start += shape.outputs * padded(shape.inputs);
            shapes.push(shape);
        }
        Network { shapes, parameters: vec![0.0; start] }
    }

    /// Layers with weights uniform in ±√(6 / inputs) (He et al. 2015, for ReLU; the last in ±√(3 / inputs)) and no bias.
    pub fn random(widths: &[usize], random: &mut Random) -> Network {
        let mut network = Network::zeros(widths);
        for (layer, shape) in network.shapes.iter().enumerate() {
            let gain = if layer + 1 == network.shapes.len() { 3.0 } else { 6.0 };
            let bound = (gain / shape.inputs as f32).sqrt();
            for output in 0..shape.outputs {
                for input in 0..shape.inputs {
                    network.parameters[shape.weight(output, input)] = bound * (2.0 * random.next_f32() - 1.0);
                }
            }
        }
        network
    }

    /// The widths that it was made of.
    pub fn widths(&self) -> Vec<usize> {
        self.shapes.iter().map(|shape| shape.inputs).chain(self.shapes.last().map(|shape| shape.outputs)).collect()
    }

    /// The weights again, each layer outputs × padded inputs: what gradients go back through.
    pub fn transpose(&self, out: &mut Vec<f32>) {
        out.clear();
        out.resize(self.shapes.iter().map(|shape| shape.outputs * padded(shape.inputs)).sum(), 0.0);
        for shape in &self.shapes {
            let stride = padded(shape.inputs);
            for input in 0..shape.inputs {
                for output in 0..shape.outputs {
                    out[shape.transposed_start + output * stride + input] =
                        self.parameters[shape.weight(output, input)];
                }
            }
        }
    }

    /// Runs `shard.inputs` through the layers.
    pub fn forward(&self, shard: &mut Shard) {
        let last = self.shapes.len() - 1;
        for (layer, shape) in self.shapes.iter().enumerate() {
            let (before, after) = shard.activations.split_at_mut(layer + 1);
            let (input, output) = (&before[layer], &mut after[0]);
            let (weights, bias) = self.parameters[shape.start..shape.end()].split_at(shape.inputs * shape.columns());
            let then = if layer < last { Then::Relu(bias) } else { Then::Offset(bias) };
            let left = Left::Rows(input, padded(shape.inputs));
            multiply(left, shape.inputs, weights, shape.columns(), then, output);
        }
    }

    /// Takes `shard.output_gradient()` back to the parameters (added to `shard.gradient`) and to the inputs.
    pub fn backward(&self, transposed: &[f32], shard: &mut Shard) {
        for (layer, shape) in self.shapes.iter().enumerate().rev() {
            let (before, after) = shard.gradients.split_at_mut(layer + 1);
            let (input_gradient, output_gradient) = (&mut before[layer], &after[0]);
            let (input, columns, stride) = (&shard.activations[layer], shape.columns(), padded(shape.inputs));

            let (weights, bias) = shard.gradient[shape.start..shape.end()].split_at_mut(shape.inputs * columns);
            multiply(Left::Columns(input, stride), shard.rows, output_gradient, columns, Then::Add, weights);
            let rows = output_gradient.as_chunks::<LANES>().0;
            Arch::new().dispatch(|| {
                for (block, bias) in bias.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
                    let mut sums = [0.0; LANES];
                    for row in rows[block..].iter().step_by(columns / LANES) {
                        sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
                    }
                    bias.iter_mut().zip(sums).for_each(|(bias, sum)| *bias += sum);
                }
            });

            let weights = &transposed[shape.transposed_start..][..shape.outputs * stride];
            let left = Left::Rows(output_gradient, columns);
            let then = if layer > 0 { Then::SetWhereAbove0(input) } else { Then::Set };
            multiply(left, shape.outputs, weights, stride, then, input_gradient);
        }
    }
}

/// What a thread needs to run some rows of a batch through a network.
#[derive(Clone, Debug)]
pub struct Shard {
    rows: usize,
    width: usize,
    /// Rows × padded width, of the inputs and of what each layer gives.
    activations: Vec<Vec<f32>>,
    /// The same of the loss's derivatives.
    gradients: Vec<Vec<f32>>,
    /// The loss's derivatives by the network's parameters.
    pub gradient: Vec<f32>,
    /// Sum of the rows' losses.
    pub loss: f64,
}

impl Shard {
    /// Room for `rows` rows.
    pub fn new(network: &Network, rows: usize) -> Shard {
        let activations: Vec<Vec<f32>> =
            network.widths().iter().map(|width| vec![0.0; rows * padded(*width)]).collect();
        Shard {
            rows,
            width: network.widths()[0],
            gradients: activations.clone(),
            activations,
            gradient: vec![0.0; network.parameters.len()],
            loss: 0.0,
        }
    }

    /// Numbers of a row that go in.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Its inputs, rows × padded inputs.
    pub fn inputs(&mut self) -> &mut [f32] {
        &mut self.activations[0]
    }

    /// The loss's derivatives by them.
    pub fn input_gradient(&self) -> &[f32] {
        &self.gradients[0]
    }

    /// What comes out, rows × padded outputs, and room for the loss's derivatives by it.
    pub fn outputs(&mut self) -> (&[f32], &mut [f32]) {
        let last = self.activations.len() - 1;
        (&self.activations[last], &mut self.gradients[last])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, in `f64`.
    fn evaluate(network: &Network, parameters: &[f64], inputs: &[f64]) -> Vec<f64> {
        let mut x = inputs.to_vec();
        for (layer, shape) in network.shapes.iter().enumerate() {
            let sum = |output| {
                let products = x.iter().enumerate().map(|(input, x)| parameters[shape.weight(output, input)] * x);
                products.sum::<f64>() + parameters[shape.bias(output)]
            };
            let y: Vec<f64> = (0..shape.outputs).map(sum).collect();
            x = if layer + 1 < network.shapes.len() { y.into_iter().map(|y| y.max(0.0)).collect() } else { y };
        }
        x
    }

    #[test]
    fn gradients_are_finite_differences_of_the_definition() {
        let mut random = Random::new(3, 0);
        for widths in [&[6, 21, 21, 3][..], &[24, 64, 64, 64, 3], &[5, 16, 3]] {
            const ROWS: usize = 3;
            let network = Network::random(widths, &mut random);
            let mut shard = Shard::new(&network, ROWS);
            let (width, stride) = (widths[0], padded(widths[0]));
            for row in shard.inputs().chunks_exact_mut(stride) {
                row[..width].iter_mut().for_each(|x| *x = 2.0 * random.next_f32() - 1.0);
            }
            let inputs: Vec<f64> = shard.inputs().iter().map(|x| f64::from(*x)).collect();
            let parameters: Vec<f64> = network.parameters.iter().map(|x| f64::from(*x)).collect();
            network.forward(&mut shard);
            let (outputs, gradients) = shard.outputs();
            // The loss is a weighted sum of the outputs.
            let factors: Vec<f32> = (0..3 * ROWS).map(|_| random.next_f32() - 0.5).collect();
            for row in 0..ROWS {
                let expected = evaluate(&network, &parameters, &inputs[row * stride..][..width]);
                for (channel, expected) in expected.into_iter().enumerate() {
                    assert!((f64::from(outputs[row * padded(3) + channel]) - expected).abs() < 1e-5);
                    gradients[row * padded(3) + channel] = factors[3 * row + channel];
                }
            }
            let mut transposed = Vec::new();
            network.transpose(&mut transposed);
            network.backward(&transposed, &mut shard);

            let loss = |parameters: &[f64], inputs: &[f64]| -> f64 {
                let row = |row: usize| evaluate(&network, parameters, &inputs[row * stride..][..width]);
                (0..ROWS).flat_map(row).zip(&factors).map(|(y, factor)| y * f64::from(*factor)).sum()
            };
            let step = 1e-6;
            let difference = |values: &[f64], index: usize, loss: &dyn Fn(&[f64]) -> f64| {
                let at = |step: f64| {
                    let mut moved = values.to_vec();
                    moved[index] += step;
                    loss(&moved)
                };
                (at(step) - at(-step)) / (2.0 * step)
            };
            for _ in 0..200 {
                let index = random.below(parameters.len());
                let expected = difference(&parameters, index, &|moved| loss(moved, &inputs));
                // Padding has no part in the definition, and gets no gradient.
                assert!((f64::from(shard.gradient[index]) - expected).abs() < 2e-5, "{widths:?}: parameter {index}");
            }
            for index in (0..ROWS * stride).filter(|index| index % stride < width) {
                let expected = difference(&inputs, index, &|moved| loss(&parameters, moved));
                assert!(
                    (f64::from(shard.input_gradient()[index]) - expected).abs() < 2e-5,
                    "{widths:?}: input {index}"
                );
            }
        }
    }
}
