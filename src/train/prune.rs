//! Structured pruning: whole neurons go, and the others stay as they are.

use super::network::Network;

/// Keeps the `kept` neurons of each hidden layer that matter most: by the product of the sizes (L1) of what comes in and of
/// what goes out, which no rescaling between the two changes (magnitude pruning, surveyed by Gholami et al. 2021).
pub fn prune_neurons(network: &Network, kept: usize) -> Network {
    let count = network.shapes.len();
    let mut survivors: Vec<Vec<usize>> = network.shapes.iter().map(|shape| (0..shape.inputs).collect()).collect();
    survivors.push((0..network.shapes[count - 1].outputs).collect());
    for layer in 0..count - 1 {
        let (before, after) = (network.shapes[layer], network.shapes[layer + 1]);
        let size = |index: usize| network.parameters[index].abs();
        let importance = |neuron: usize| {
            let incoming: f32 = (0..before.inputs).map(|input| size(before.weight(neuron, input))).sum();
            let outgoing: f32 = (0..after.outputs).map(|output| size(after.weight(output, neuron))).sum();
            (incoming + size(before.bias(neuron))) * outgoing
        };
        let neurons = &mut survivors[layer + 1];
        neurons.sort_by(|a, b| importance(*b).total_cmp(&importance(*a)));
        neurons.truncate(kept);
        neurons.sort_unstable();
    }
    let widths: Vec<usize> = survivors.iter().map(Vec::len).collect();
    let mut pruned = Network::zeros(&widths);
    for (layer, (from, to)) in network.shapes.iter().zip(pruned.shapes.clone()).enumerate() {
        for (output, old_output) in survivors[layer + 1].iter().enumerate() {
            pruned.parameters[to.bias(output)] = network.parameters[from.bias(*old_output)];
            for (input, old_input) in survivors[layer].iter().enumerate() {
                pruned.parameters[to.weight(output, input)] = network.parameters[from.weight(*old_output, *old_input)];
            }
        }
    }
    pruned
}

#[cfg(test)]
mod tests {
    use super::super::network::Shard;
    use super::super::product::padded;
    use super::super::random::Random;
    use super::*;

    /// Neurons that lead nowhere go first, and without them the function is the same.
    #[test]
    fn pruning_neurons_of_no_consequence_keeps_the_function() {
        let mut random = Random::new(6, 0);
        let mut network = Network::random(&[10, 12, 12, 3], &mut random);
        for layer in 0..2 {
            let after = network.shapes[layer + 1];
            for neuron in [1, 4, 5, 11] {
                (0..after.outputs).for_each(|output| network.parameters[after.weight(output, neuron)] = 0.0);
            }
        }
        let pruned = prune_neurons(&network, 8);
        assert_eq!(pruned.widths(), [10, 8, 8, 3]);
        let outputs = |network: &Network| {
            let mut random = Random::new(7, 0);
            let mut shard = Shard::new(network, 20);
            for row in shard.inputs().chunks_exact_mut(padded(10)) {
                row[..10].iter_mut().for_each(|x| *x = random.next_f32());
            }
            network.forward(&mut shard);
            shard.outputs().0.to_vec()
        };
        for (a, b) in outputs(&network).into_iter().zip(outputs(&pruned)) {
            assert!((a - b).abs() < 1e-5);
        }
    }
}
