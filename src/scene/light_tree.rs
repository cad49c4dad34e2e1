//! A tree over the emissive triangles of a scene, by which a light sample finds one that matters where it is taken.
//!
//! Each node knows a sphere around its triangles, a cone around the directions they face, and their power; from these follows about how much light
//! they send to a place ([`LightNode::importance`]). A sample goes down from the root, at each pair of nodes to one of them
//! with a probability proportional to its importance (Conty Estevez and Kulla, *Importance Sampling of Many Lights with Adaptive Tree Splitting*,
//! HPG 2018, without the splitting). A path that hits a triangle goes up from its leaf and finds the same probability.

use glam::Vec3;

use super::light::EmissiveTriangle;

/// Intervals along each axis between which a node may be split.
const BINS: usize = 12;

/// Below so many levels a node is halved, wherever its triangles are.
const DEEP: u32 = 64;

/// What a point needs to know of the triangles below a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightNode {
    /// Where their power is on average; of a sphere around them.
    pub center: Vec3,
    /// Of that sphere.
    pub radius: f32,
    /// Root mean square distance from the center, weighted by power.
    pub deviation: f32,
    /// Unit, the direction that they face on average by power.
    pub axis: Vec3,
    /// Cosine of the greatest angle between the axis and one of these; −1 if some triangle emits on both sides.
    pub cos_spread: f32,
    /// Of all triangles together, as a part of the tree's.
    pub power: f32,
    /// The first of two nodes that stand side by side; with [`LightNode::LEAF`] the index of a triangle.
    pub child: u32,
}

/// Where light may arrive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// World space.
    pub point: Vec3,
    /// Unit, of the side that light counts on; none if it counts on both.
    pub normal: Option<Vec3>,
}

/// The tree.
#[derive(Clone, Debug, PartialEq)]
pub struct LightTree {
    /// Pairs of siblings. The root is not among them; its children are the first.
    pub nodes: Vec<LightNode>,
    /// Of each pair of nodes, the node above. The first pair has none.
    pub parents: Vec<u32>,
    /// Of each triangle, its leaf.
    pub leaves: Vec<u32>,
}

impl LightNode {
    /// Set in [`LightNode::child`] of leaves.
    pub const LEAF: u32 = 1 << 31;

    /// About how much light a receiver gets, if nothing is in between: Φ · cos θ · cos θ′ / (d² + σ²/4), θ the least angle between what a triangle may face
    /// and the way to the point, θ′ that between the normal and the way to a triangle, σ the [`deviation`](LightNode::deviation), which
    /// keeps it finite. `light_importance` of glsl/lib/light_tree.glsl.
    pub fn importance(&self, receiver: Receiver) -> f32 {
        let way = receiver.point - self.center;
        let distance_squared = way.length_squared();
        let radius_squared = self.radius * self.radius;
        let mut cosine = 1.0;
        if distance_squared > radius_squared {
            let sphere = with_sine((1.0 - radius_squared / distance_squared).sqrt());
            let angle_to = |v: Vec3| with_sine((v.dot(way) / distance_squared.sqrt()).clamp(-1.0, 1.0));
            let [facing, _] = less_angle(less_angle(angle_to(self.axis), with_sine(self.cos_spread)), sphere);
            cosine = facing.max(0.0);
            if let Some(normal) = receiver.normal {
                cosine *= less_angle(angle_to(-normal), sphere)[0].max(0.0);
            }
        }
        self.power * cosine / (distance_squared + NEAR * self.deviation * self.deviation).max(1e-30)
    }
}

/// Of a deviation's square, what is added to a distance's. Found on scenes of 300 and 432 lamps (docs/design.md).
const NEAR: f32 = 0.25;

fn with_sine(cosine: f32) -> [f32; 2] {
    [cosine, (1.0 - cosine * cosine).max(0.0).sqrt()]
}

/// Cosine and sine of max(0, a − b), of angles from 0 to π by their cosines and sines.
fn less_angle([cos_a, sin_a]: [f32; 2], [cos_b, sin_b]: [f32; 2]) -> [f32; 2] {
    if cos_a >= cos_b { [1.0, 0.0] } else { [cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b] }
}

impl LightTree {
    /// The tree of triangles and their powers, in time N log N. Two nodes at least, those without a triangle dark.
    pub fn new(emitters: &[EmissiveTriangle], powers: &[f64]) -> LightTree {
        let total: f64 = powers.iter().sum();
        let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
        let lamp = |(index, (emitter, power)): (usize, (&EmissiveTriangle, &f64))| Lamp {
            corners: emitter.corners,
            normal: if emitter.material.emits_both_sides { Vec3::ZERO } else { emitter.normal() },
            power: (power * scale) as f32,
            index: index as u32,
        };
        let mut lamps: Vec<Lamp> = emitters.iter().zip(powers).enumerate().map(lamp).collect();
        let dark = LightNode {
            center: Vec3::ZERO,
            radius: 0.0,
            deviation: 0.0,
            axis: Vec3::Y,
            cos_spread: 1.0,
            power: 0.0,
            child: LightNode::LEAF,
        };
        let mut tree = LightTree { nodes: vec![dark; 2], parents: vec![0], leaves: vec![0; lamps.len()] };
        match &mut lamps[..] {
            [] => {}
            one @ [_] => tree.set(0, 0, one),
            lamps => tree.set_pair(0, 0, lamps),
        }
        tree
    }

    /// Makes the two nodes of two or more triangles, and all below them.
    fn set_pair(&mut self, first: usize, depth: u32, lamps: &mut [Lamp]) {
        let (left, right) = if depth < DEEP { split(lamps) } else { lamps.split_at_mut(lamps.len() / 2) };
        self.set(first, depth, left);
        self.set(first + 1, depth, right);
    }

    /// Makes a node of some triangles, and all below it.
    fn set(&mut self, node: usize, depth: u32, lamps: &mut [Lamp]) {
        let whole = lamps.iter().fold(Sum::NONE, Sum::and);
        let center = if whole.power > 0.0 { whole.moment / whole.power } else { (whole.lower + whole.upper) / 2.0 };
        let axis = whole.facing.try_normalize().unwrap_or(Vec3::Y);
        let (mut farthest, mut spread, mut cos_spread) = (0.0f32, 0.0, 1.0f32);
        for lamp in lamps.iter() {
            let squares = lamp.corners.map(|corner| corner.distance_squared(center));
            farthest = squares.into_iter().fold(farthest, f32::max);
            spread += lamp.power * squares.iter().sum::<f32>() / 3.0;
            cos_spread = cos_spread.min(if lamp.normal == Vec3::ZERO { -1.0 } else { axis.dot(lamp.normal) });
        }
        let deviation = if whole.power > 0.0 { (spread / whole.power).min(farthest).sqrt() } else { 0.0 };
        let (radius, power) = (farthest.sqrt(), whole.power);
        let child = if let [lamp] = lamps { lamp.index | LightNode::LEAF } else { self.nodes.len() as u32 };
        self.nodes[node] = LightNode { center, radius, deviation, axis, cos_spread, power, child };
        if let [lamp] = lamps {
            self.leaves[lamp.index as usize] = node as u32;
        } else {
            self.nodes.extend_from_within(..2);
            self.parents.push(node as u32);
            self.set_pair(child as usize, depth + 1, lamps);
        }
    }

    /// The triangle that u in [0, 1) picks for a receiver, and its probability; `None` where none sends light, and now and then where the way
    /// down ends at triangles that face away.
    pub fn pick(&self, receiver: Receiver, mut u: f32) -> Option<(u32, f32)> {
        let mut first = 0;
        let mut probability = 1.0;
        loop {
            let [left, right] = [first, first + 1].map(|node| self.nodes[node].importance(receiver));
            let sum = left + right;
            if sum <= 0.0 {
                return None;
            }
            let of_left = left / sum;
            let goes_left = u < of_left;
            let taken = if goes_left { of_left } else { right / sum };
            u = ((if goes_left { u } else { u - of_left }) / taken).min(1.0 - f32::EPSILON / 2.0);
            probability *= taken;
            let child = self.nodes[first + usize::from(!goes_left)].child;
            if child & LightNode::LEAF != 0 {
                return Some((child & !LightNode::LEAF, probability));
            }
            first = child as usize;
        }
    }

    /// With which [`LightTree::pick`] picks a triangle for a receiver.
    pub fn probability(&self, receiver: Receiver, triangle: u32) -> f32 {
        let mut node = self.leaves[triangle as usize] as usize;
        let mut probability = 1.0;
        loop {
            let importance = self.nodes[node].importance(receiver);
            let both = importance + self.nodes[node ^ 1].importance(receiver);
            probability *= if both > 0.0 { importance / both } else { 0.0 };
            if node < 2 {
                return probability;
            }
            node = self.parents[node / 2] as usize;
        }
    }
}

/// A triangle on its way into the tree.
#[derive(Clone, Copy, Debug)]
struct Lamp {
    corners: [Vec3; 3],
    /// Unit; 0 if it emits on both sides.
    normal: Vec3,
    power: f32,
    index: u32,
}

impl Lamp {
    fn middle(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        (a + b + c) / 3.0
    }
}

/// What several triangles amount to.
#[derive(Clone, Copy, Debug)]
struct Sum {
    lower: Vec3,
    upper: Vec3,
    power: f32,
    /// Power times place.
    moment: Vec3,
    /// Power times normal.
    facing: Vec3,
}

impl Sum {
    const NONE: Sum =
        Sum { lower: Vec3::INFINITY, upper: Vec3::NEG_INFINITY, power: 0.0, moment: Vec3::ZERO, facing: Vec3::ZERO };

    fn and(self, lamp: &Lamp) -> Sum {
        let [a, b, c] = lamp.corners;
        Sum {
            lower: self.lower.min(a.min(b).min(c)),
            upper: self.upper.max(a.max(b).max(c)),
            power: self.power + lamp.power,
            moment: self.moment + lamp.power * lamp.middle(),
            facing: self.facing + lamp.power * lamp.normal,
        }
    }

    fn and_all(self, other: &Sum) -> Sum {
        Sum {
            lower: self.lower.min(other.lower),
            upper: self.upper.max(other.upper),
            power: self.power + other.power,
            moment: self.moment + other.moment,
            facing: self.facing + other.facing,
        }
    }

    /// How unsure it is what a sample that comes here will send: by power, by extent, and by directions, four times as much if these are all over the
    /// sphere as if they are one.
    fn cost(&self) -> f32 {
        (4.0 * self.power - 3.0 * self.facing.length()) * (self.upper - self.lower).length_squared()
    }
}

/// Divides two or more triangles into two groups that are each close together and face alike, as the surface area orientation heuristic does.
fn split(lamps: &mut [Lamp]) -> (&mut [Lamp], &mut [Lamp]) {
    let (mut lower, mut upper) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for lamp in lamps.iter() {
        (lower, upper) = (lower.min(lamp.middle()), upper.max(lamp.middle()));
    }
    let extent = upper - lower;
    let bin_of = |lamp: &Lamp, axis: usize| {
        let along = (lamp.middle()[axis] - lower[axis]) / extent[axis];
        ((along * BINS as f32) as usize).min(BINS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|axis| extent[*axis] > 0.0) {
        let mut bins = [Sum::NONE; BINS];
        for lamp in lamps.iter() {
            let bin = &mut bins[bin_of(lamp, axis)];
            *bin = bin.and(lamp);
        }
        let mut above = bins;
        for edge in (1..BINS).rev() {
            above[edge - 1] = above[edge - 1].and_all(&above[edge]);
        }
        // Thin slices cost more: they say less of where a light is.
        let thinness = extent.max_element() / extent[axis];
        let mut below = Sum::NONE;
        for edge in 1..BINS {
            below = below.and_all(&bins[edge - 1]);
            let cost = thinness * (below.cost() + above[edge].cost());
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, edge));
            }
        }
    }
    let Some((_, axis, edge)) = best else {
        return lamps.split_at_mut(lamps.len() / 2);
    };
    lamps.sort_unstable_by_key(|lamp| bin_of(lamp, axis) >= edge);
    let middle = lamps.partition_point(|lamp| bin_of(lamp, axis) < edge);
    lamps.split_at_mut(middle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Color, Material, Surface};

    /// Numbers in [0, 1) by a hash of their place in the sequence.
    fn numbers() -> impl FnMut() -> f32 {
        let mut state = 1u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        }
    }

    fn material(emits_both_sides: bool) -> Material {
        let surface = Surface::Diffuse { albedo: Color::constant(Vec3::ZERO) };
        Material { emission: Vec3::ONE, emits_both_sides, ..Material::new("lamp", surface) }
    }

    fn emitter(corners: [Vec3; 3], material: &Material) -> EmissiveTriangle<'_> {
        EmissiveTriangle { corners, uvs: [glam::Vec2::ZERO; 3], material, mean_emission: Vec3::ONE }
    }

    /// Triangles of any direction in a box of 10 × 2 × 10, with powers over six decades.
    fn lamps<'a>(count: usize, materials: &'a [Material; 2]) -> (Vec<EmissiveTriangle<'a>>, Vec<f64>) {
        let mut next = numbers();
        let mut place = move |size: Vec3| Vec3::new(next(), next(), next()) * size;
        let triangle = |index: usize| {
            let corner = place(Vec3::new(10.0, 2.0, 10.0));
            let other = [place(Vec3::splat(0.4)), place(Vec3::splat(0.4))];
            emitter([corner, corner + other[0], corner - other[1]], &materials[usize::from(index.is_multiple_of(5))])
        };
        ((0..count).map(triangle).collect(), (0..count).map(|index| 10f64.powi(index as i32 % 7 - 3)).collect())
    }

    /// Among these lamps and around them, every second one without a normal.
    fn receivers() -> impl Iterator<Item = Receiver> {
        let mut next = numbers();
        let mut place = move || Vec3::new(next(), next(), next());
        (0..200).map(move |index| Receiver {
            point: (place() - 0.25) * Vec3::new(20.0, 4.0, 20.0),
            normal: (index % 2 == 0).then_some((place() - 0.5).normalize()),
        })
    }

    fn both_sides(point: Vec3) -> Receiver {
        Receiver { point, normal: None }
    }

    #[test]
    fn samples_go_where_the_probabilities_say() {
        let materials = [material(false), material(true)];
        for count in [1, 2, 3, 100] {
            let (emitters, powers) = lamps(count, &materials);
            let tree = LightTree::new(&emitters, &powers);
            let mut found = 0.0;
            for receiver in receivers() {
                let probabilities: Vec<f32> = (0..count as u32).map(|i| tree.probability(receiver, i)).collect();
                let sum: f32 = probabilities.iter().sum();
                assert!(sum < 1.0 + 1e-5, "{count} at {receiver:?}: {sum}");
                found += sum / 200.0;
                let mut counts = vec![0u32; count];
                for u in (0..2000).map(|i| (i as f32 + 0.5) / 2000.0) {
                    if let Some((picked, probability)) = tree.pick(receiver, u) {
                        counts[picked as usize] += 1;
                        let expected = probabilities[picked as usize];
                        assert!((probability - expected).abs() <= 1e-5 * expected, "{probability}, not {expected}");
                    }
                }
                for (count, probability) in counts.iter().zip(&probabilities) {
                    assert!((*count as f32 / 2000.0 - probability).abs() < 1.5e-3, "{count}, not {probability}");
                }
            }
            // Few ways down end where all face away.
            assert!(found > 0.8 || count < 4, "{found} of {count}");
        }
    }

    /// Whatever sends light to a point may be picked there.
    #[test]
    fn nothing_that_shines_is_left_out() {
        let materials = [material(false), material(true)];
        let (emitters, powers) = lamps(300, &materials);
        let tree = LightTree::new(&emitters, &powers);
        for receiver in receivers() {
            for (index, emitter) in emitters.iter().enumerate() {
                let way = (receiver.point - emitter.corners[0]).normalize();
                let faces = emitter.normal().dot(way) > 1e-3 || emitter.material.emits_both_sides;
                let is_faced = receiver.normal.is_none_or(|normal| normal.dot(way) < -1e-3);
                if faces && is_faced {
                    assert!(tree.probability(receiver, index as u32) > 0.0, "{index} at {receiver:?}");
                }
            }
        }
    }

    /// In a row of lamps of the same power, the nearest is picked most often, and the next ones as 1/d² has it.
    #[test]
    fn what_is_near_is_picked_more_often() {
        let materials = [material(false), material(false)];
        let lamp = |x: f32| {
            emitter([Vec3::new(x, 2.0, 0.0), Vec3::new(x + 0.1, 2.0, 0.0), Vec3::new(x, 2.0, 0.1)], &materials[0])
        };
        let emitters: Vec<_> = (0..64).map(|i| lamp(i as f32 * 4.0)).collect();
        let tree = LightTree::new(&emitters, &[1.0; 64]);
        for (index, under) in (0..64u32).map(|i| (i, Vec3::new(i as f32 * 4.0, 0.0, 0.0))) {
            let [here, next] = [index, index ^ 1].map(|i| tree.probability(both_sides(under), i));
            assert!(here > 0.4, "{index}: {here}");
            let far: f32 =
                (0..64u32).filter(|i| i.abs_diff(index) > 8).map(|i| tree.probability(both_sides(under), i)).sum();
            assert!(next < 0.25 && far < 0.1, "{index}: {next} beside it, {far} far away");
        }
    }

    /// Lamps without number, without size, without power, all in one place, or beyond measure.
    #[test]
    fn hard_cases_give_probabilities() {
        let materials = [material(false), material(true)];
        let at = |place: f32, size: f32| {
            let corner = Vec3::splat(place);
            emitter([corner, corner + Vec3::X * size, corner + Vec3::Y * size], &materials[0])
        };
        let cases: [(Vec<EmissiveTriangle>, Vec<f64>); 9] = [
            (vec![], vec![]),
            (vec![at(0.0, 1.0); 3], vec![0.0; 3]),
            (vec![at(0.0, 1.0); 100], vec![1.0; 100]),
            (vec![at(1.0, 0.0); 20], vec![0.0; 20]),
            (vec![at(1.0, 1e-20); 20], vec![1e-40; 20]),
            (vec![at(1e8, 1.0), at(-1e8, 1.0), at(1e8, 1e7)], vec![1e28, 1.0, 1e-30]),
            ((0..60).map(|i| at(2f32.powi(i - 30), 2f32.powi(i - 31))).collect(), vec![1.0; 60]),
            ((0..2000).map(|i| at(0.99f32.powi(i), 1e-9)).collect(), vec![0.0; 2000]),
            ((0..1000).map(|i| at(i as f32, 0.5)).collect(), (0..1000).map(|i| f64::from(i % 2)).collect()),
        ];
        for (emitters, powers) in &cases {
            let tree = LightTree::new(emitters, powers);
            assert_eq!(tree.nodes.len(), 2 * tree.parents.len());
            let shine = powers.iter().any(|power| *power > 0.0);
            let places = [Vec3::ZERO, Vec3::ONE, Vec3::splat(1e8), Vec3::new(0.3, 0.3, 2.0), Vec3::Z * 1e-30];
            for point in places.into_iter().chain(emitters.iter().take(9).map(|emitter| emitter.corners[1])) {
                let receiver = both_sides(point);
                let sum: f32 = (0..emitters.len() as u32).map(|i| tree.probability(receiver, i)).sum();
                assert!((0.0..1.0 + 1e-4).contains(&sum), "{} lamps at {point}: {sum}", emitters.len());
                for u in [0.0, 0.5, 1.0 - f32::EPSILON / 2.0] {
                    let picked = tree.pick(receiver, u);
                    let fine = picked.is_none_or(|(i, p)| p > 0.0 && p <= 1.0 && powers[i as usize] > 0.0);
                    assert!(fine, "{} lamps at {point}: {picked:?}", emitters.len());
                }
                assert!(shine || sum == 0.0);
            }
        }
    }
}
