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
