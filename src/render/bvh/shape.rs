//! Which primitives stay together: the shape of a tree, without its boxes.
//!
//! `obvhs` clusters single primitives into a binary tree. [`Collapse`] makes four-wide nodes and leaves of it so that the surface area
//! heuristic, Σ area · cost over nodes and leaves, is least: dynamic programming over subtrees, after Ylitie, Karras, Laine, "Efficient
//! Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017.

use std::ops::Range;

use glam::{Vec3, Vec3A};
use obvhs::{
    aabb::Aabb,
    bvh2::{Bvh2, reinsertion::ReinsertionOptimizer},
    ploc::{PlocBuilder, PlocSearchDistance, SortPrecision},
};
use rayon::prelude::*;

use super::{LEAF, LEAF_COUNT_SHIFT, NO_CHILD, WIDTH, union};
use crate::scene::Bounds;

/// What a visit to a node costs where a test of a primitive costs 1: what packets take on lavapipe.
const NODE_COST: f32 = 2.0;

/// Passes of reinsertion.
const REINSERTIONS: usize = 3;
/// Nodes that each of them moves, within these shares of all: in small trees moving many takes no time.
const REINSERTED: f32 = 20_000.0;
const LEAST_REINSERTED: f32 = 0.05;
const MOST_REINSERTED: f32 = 0.5;

/// A tree's shape.
pub(super) struct Shape {
    /// The children of each node, as in [`super::BvhNode::child`]; a parent always before its children.
    pub nodes: Vec<[u32; WIDTH]>,
    /// The primitive that stands at each place that leaves index.
    pub order: Vec<u32>,
}

impl Shape {
    /// A good tree, with at most `max_leaf` primitives in a leaf.
    pub fn clustered(boxes: &[Bounds], max_leaf: u32) -> Shape {
        Collapse::new(&cluster(boxes), max_leaf).shape()
    }

    /// A balanced tree with single primitives in its leaves: each node's children are quarters, whatever the boxes are.
    pub fn balanced(boxes: &[Bounds]) -> Shape {
        let mut shape = Shape { nodes: vec![[NO_CHILD; WIDTH]], order: (0..boxes.len() as u32).collect() };
        let mut open = if boxes.is_empty() { vec![] } else { vec![(0, 0..boxes.len())] };
        while let Some((node, range)) = open.pop() {
            let halves: Vec<_> = shape.halves(boxes, range).collect();
            let quarters: Vec<_> = halves.into_iter().flat_map(|half| shape.halves(boxes, half)).collect();
            for (slot, part) in quarters.into_iter().enumerate() {
                shape.nodes[node][slot] = match part.len() {
                    1 => leaf(part.start, 1),
                    _ => shape.open(&mut open, part),
                };
            }
        }
        shape
    }

    /// Splits a range of places at the median along the axis in which its primitives' centres lie farthest apart; one place stays one.
    fn halves(&mut self, boxes: &[Bounds], range: Range<usize>) -> impl Iterator<Item = Range<usize>> + use<> {
        let center = |primitive: &u32| boxes[*primitive as usize].center();
        let centers = self.order[range.clone()].iter().map(center).fold(Bounds::EMPTY, Bounds::including);
        let axis = (centers.max / 2.0 - centers.min / 2.0).max_position();
        let half = range.len() / 2;
        self.order[range.clone()].select_nth_unstable_by(half, |a, b| center(a)[axis].total_cmp(&center(b)[axis]));
        let middle = range.start + half;
        [range.start..middle, middle..range.end].into_iter().filter(|part| !part.is_empty())
    }

    /// Adds a node that is to be made of `source`.
    fn open<T>(&mut self, open: &mut Vec<(usize, T)>, source: T) -> u32 {
        open.push((self.nodes.len(), source));
        self.nodes.push([NO_CHILD; WIDTH]);
        self.nodes.len() as u32 - 1
    }
}

fn leaf(first: usize, count: usize) -> u32 {
    LEAF | (count as u32 - 1) << LEAF_COUNT_SHIFT | first as u32
}

/// A node of a binary tree with one primitive in each leaf.
#[derive(Clone, Copy)]
struct BinaryNode {
    is_leaf: bool,
    /// A leaf's primitive, or the first of two neighbouring children.
    first: u32,
    half_area: f32,
}

impl BinaryNode {
    fn children(&self) -> [usize; 2] {
        [self.first as usize, self.first as usize + 1]
    }
}

/// A binary tree, the root first, if there is one: parallel locally-ordered clustering, then reinsertion.
fn cluster(boxes: &[Bounds]) -> Vec<BinaryNode> {
    // Areas must neither overflow nor vanish: the tree's shape is found in a box of the size of one.
    let all = boxes.iter().copied().fold(Bounds::EMPTY, union);
    let scale = 1.0 / f64::from((all.max.as_dvec3() - all.min.as_dvec3()).max_element() as f32).clamp(1e-37, 1e38);
    let normalise = |point: Vec3| Vec3A::from(((point.as_dvec3() - all.min.as_dvec3()) * scale).as_vec3());
    let normal: Vec<Aabb> =
        boxes.par_iter().map(|bounds| Aabb::new(normalise(bounds.min), normalise(bounds.max))).collect();
    let mut tree: Bvh2 = PlocBuilder::with_capacity(normal.len()).build(
        PlocSearchDistance::Medium,
        &normal,
        (0..normal.len() as u32).collect(),
        SortPrecision::U64,
        3,
    );
    let share = (REINSERTED / boxes.len() as f32).clamp(LEAST_REINSERTED, MOST_REINSERTED);
    let mut reinsertion = ReinsertionOptimizer::default();
    for _ in 0..REINSERTIONS {
        reinsertion.run(&mut tree, share, None);
    }
    let node = |node: &obvhs::bvh2::node::Bvh2Node| BinaryNode {
        is_leaf: node.prim_count != 0,
        first: if node.prim_count != 0 { tree.primitive_indices[node.first_index as usize] } else { node.first_index },
        half_area: node.aabb().half_area(),
    };
    tree.nodes.par_iter().map(node).collect()
}

/// How a subtree is best made a part of a wider tree.
#[derive(Clone, Copy)]
struct Best {
    /// What it costs as at most 1, 2 or 3 children of a node above.
    cost: [f32; WIDTH - 1],
    /// How many of those 2 or 3 the left half gives; 0: the subtree is one child all the same.
    left: [u8; WIDTH - 2],
    /// As one child it is a node, and so many of its four children are the left half's; 0: it is a leaf.
    below_left: u8,
    /// Primitives, or 255 of more.
    primitives: u8,
}

/// The cheapest four-wide tree of a binary one.
struct Collapse<'a> {
    nodes: &'a [BinaryNode],
    best: Vec<Best>,
}

impl Collapse<'_> {
    fn new(nodes: &[BinaryNode], max_leaf: u32) -> Collapse<'_> {
        let nothing = Best { cost: [0.0; 3], left: [0; 2], below_left: 0, primitives: 0 };
        let mut collapse = Collapse { nodes, best: vec![nothing; nodes.len()] };
        let mut from_root = Vec::with_capacity(nodes.len());
        let mut open = if nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(node) = open.pop() {
            from_root.push(node as u32);
            if !nodes[node].is_leaf {
                open.extend(nodes[node].children());
            }
        }
        for node in from_root.into_iter().rev() {
            collapse.best[node as usize] = collapse.best_of(&nodes[node as usize], max_leaf);
        }
        collapse
    }

    /// The same of a subtree whose halves are known.
    fn best_of(&self, node: &BinaryNode, max_leaf: u32) -> Best {
        if node.is_leaf {
            return Best { cost: [node.half_area; 3], left: [0; 2], below_left: 0, primitives: 1 };
        }
        let [left, right] = node.children().map(|child| &self.best[child]);
        let shared = |count: usize| {
            let shares =
                (1..count).map(|of_left| (left.cost[of_left - 1] + right.cost[count - of_left - 1], of_left as u8));
            shares.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f32::INFINITY, 0))
        };
        let primitives = left.primitives.saturating_add(right.primitives);
        let (below, below_left) = shared(WIDTH);
        let as_node = node.half_area * NODE_COST + below;
        let as_leaf = node.half_area * f32::from(primitives);
        let is_leaf = u32::from(primitives) <= max_leaf && as_leaf <= as_node;
        let one = if is_leaf { as_leaf } else { as_node };
        let [two, three] = [2, 3].map(shared).map(|several| if several.0 < one { several } else { (one, 0) });
        Best {
            cost: [one, two.0, three.0],
            left: [two.1, three.1],
            below_left: if is_leaf { 0 } else { below_left },
            primitives,
        }
    }

    fn shape(&self) -> Shape {
        let mut shape =
            Shape { nodes: vec![[NO_CHILD; WIDTH]], order: Vec::with_capacity(self.nodes.len().div_ceil(2)) };
        let mut open = if self.nodes.is_empty() { vec![] } else { vec![(0, 0)] };
        let mut children = Vec::with_capacity(WIDTH);
        while let Some((node, source)) = open.pop() {
            children.clear();
            match usize::from(self.best[source].below_left) {
                // The root alone.
                0 => children.push(source),
                of_left => {
                    let [left, right] = self.nodes[source].children();
                    self.children(left, of_left, &mut children);
                    self.children(right, WIDTH - of_left, &mut children);
                }
            }
            for (slot, child) in children.iter().enumerate() {
                shape.nodes[node][slot] = if self.best[*child].below_left == 0 {
                    let first = shape.order.len();
                    self.primitives(*child, &mut shape.order);
                    leaf(first, shape.order.len() - first)
                } else {
                    shape.open(&mut open, *child)
                };
            }
        }
        shape
    }

    /// The subtrees that a subtree gives as at most `count` ≤ 3 children.
    fn children(&self, node: usize, count: usize, found: &mut Vec<usize>) {
        match if count == 1 { 0 } else { usize::from(self.best[node].left[count - 2]) } {
            0 => found.push(node),
            of_left => {
                let [left, right] = self.nodes[node].children();
                self.children(left, of_left, found);
                self.children(right, count - of_left, found);
            }
        }
    }

    fn primitives(&self, node: usize, found: &mut Vec<u32>) {
        match self.nodes[node].is_leaf {
            true => found.push(self.nodes[node].first),
            false => self.nodes[node].children().into_iter().for_each(|child| self.primitives(child, found)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::leaf_range;
    use super::*;

    /// The cheapest way by trying all: a leaf, or a node over any two, three or four subtrees that together are all of this one.
    fn cheapest(nodes: &[BinaryNode], node: usize, max_leaf: u32) -> f32 {
        let primitives = leaves(nodes, node);
        let as_leaf = if primitives <= max_leaf { nodes[node].half_area * primitives as f32 } else { f32::INFINITY };
        let as_node = |roots: &Vec<usize>| {
            let below: f32 = roots.iter().map(|root| cheapest(nodes, *root, max_leaf)).sum();
            nodes[node].half_area * NODE_COST + below
        };
        cuts(nodes, node).iter().filter(|roots| (2..=WIDTH).contains(&roots.len())).map(as_node).fold(as_leaf, f32::min)
    }

    /// All sets of subtrees that are this one.
    fn cuts(nodes: &[BinaryNode], node: usize) -> Vec<Vec<usize>> {
        let mut all = vec![vec![node]];
        if !nodes[node].is_leaf {
            let [left, right] = nodes[node].children().map(|child| cuts(nodes, child));
            all.extend(left.iter().flat_map(|left| right.iter().map(|right| [&left[..], &right[..]].concat())));
        }
        all
    }

    fn leaves(nodes: &[BinaryNode], node: usize) -> u32 {
        match nodes[node].is_leaf {
            true => 1,
            false => nodes[node].children().into_iter().map(|child| leaves(nodes, child)).sum(),
        }
    }

    /// What a node of a shape costs with all below, and the box around it.
    fn cost(shape: &Shape, boxes: &[Bounds], child: u32) -> (f32, Bounds) {
        let area = |bounds: Bounds| {
            let edges = bounds.max - bounds.min;
            edges.x * edges.y + edges.y * edges.z + edges.z * edges.x
        };
        if child & LEAF != 0 {
            let places = leaf_range(child);
            let around = shape.order[places.clone()]
                .iter()
                .map(|primitive| boxes[*primitive as usize])
                .fold(Bounds::EMPTY, union);
            return (area(around) * places.len() as f32, around);
        }
        let children = shape.nodes[child as usize].iter().filter(|child| **child != NO_CHILD);
        let (below, around) = children
            .map(|child| cost(shape, boxes, *child))
            .fold((0.0, Bounds::EMPTY), |a, b| (a.0 + b.0, union(a.1, b.1)));
        (area(around) * NODE_COST + below, around)
    }

    #[test]
    fn no_other_collapse_of_a_binary_tree_costs_less() {
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        for trial in 0..300 {
            let count = 5 + trial % 6;
            let corner = Vec3::ZERO;
            let mut boxes = vec![Bounds { min: corner, max: corner }, Bounds { min: Vec3::ONE, max: Vec3::ONE }];
            boxes.resize_with(count, || {
                let min = Vec3::new(random(), random(), random()) * 0.9;
                Bounds { min, max: min + Vec3::new(random(), random(), random()) * 0.1 }
            });
            let max_leaf = 1 + trial as u32 / 6 % 4;
            let nodes = cluster(&boxes);
            let least = cheapest(&nodes, 0, max_leaf);
            let shape = Collapse::new(&nodes, max_leaf).shape();
            let (found, _) = cost(&shape, &boxes, 0);
            assert!((found - least).abs() < 1e-4 * least, "{count} boxes, {max_leaf} a leaf: {found}, not {least}");
        }
    }
}
