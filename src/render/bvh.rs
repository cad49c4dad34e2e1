//! The bounding volume hierarchy that the compute kernels walk: four-wide nodes over triangles or over instances.
//!
//! `shape` says which primitives stay together; here are the boxes, the layout and the walk.
//! Every inner node holds the boxes of its children, so that one step of a walk reads one node and tests four boxes.
//! The device's form of the walk is `glsl/lib/trace_bvh.glsl`; [`Bvh::closest`] is the same arithmetic in plain Rust,
//! slow, for tests.

mod shape;

use glam::Vec3;
use rayon::prelude::*;

use self::shape::Shape;
use crate::scene::{Bounds, Mesh};

/// Children of a node.
const WIDTH: usize = 4;

/// The child slot that holds nothing. On the device the same word says that a walk has ended.
pub const NO_CHILD: u32 = 0xf000_0000;

/// Set in a child that is a leaf.
pub const LEAF: u32 = 1 << 31;

/// A leaf keeps its primitive count − 1 above this bit and its first primitive below it.
pub const LEAF_COUNT_SHIFT: u32 = 28;

/// Primitives that a leaf holds at most; [`NO_CHILD`] looks like a leaf of eight.
const MAX_LEAF: u32 = 4;

/// Primitives that one tree can index.
pub const MAX_PRIMITIVES: usize = 1 << LEAF_COUNT_SHIFT;

/// Entries of the walk's stack. A tree that could need more is built again, balanced, which never does.
pub const MAX_STACK: u32 = 96;

/// The near ends of boxes are drawn in by 1 − 2γ(3), so that rounding loses no hit (after Ize, "Robust BVH Ray Traversal",
/// JCGT 2013, who moves the far ends out; this way it holds against the ray's end too).
const NEAR_SLACK: f32 = 1.0 - 3.6e-7;

/// A ray's end, so that no ray reaches the boxes at +∞ of children that are not there.
const FARTHEST: f32 = 3.4e38;

crate::shared_structs! {
    /// The structs of `glsl/layout/geometry.glsl` that trees are made of.
    pub const BVH_STRUCTS;

    /// One step of the walk: four boxes, each bound of the four beside one another.
    #[derive(PartialEq)]
    pub struct BvhNode {
        /// Lower x of the children's boxes. A child that is not there has a box that no ray reaches: a point at +∞.
        pub lower_x: [f32; WIDTH],
        /// Upper x.
        pub upper_x: [f32; WIDTH],
        /// Lower y.
        pub lower_y: [f32; WIDTH],
        /// Upper y.
        pub upper_y: [f32; WIDTH],
        /// Lower z.
        pub lower_z: [f32; WIDTH],
        /// Upper z.
        pub upper_z: [f32; WIDTH],
        /// An inner node's index, or [`LEAF`] | (count − 1) << [`LEAF_COUNT_SHIFT`] | first primitive, or [`NO_CHILD`].
        pub child: [u32; WIDTH],
        /// For each octant of ray directions one byte: the children from near to far, two bits each. Octant bits 0, 1, 2
        /// say that x, y, z are negative.
        pub order: [u32; 2],
        /// Nothing; it rounds the node up to two cache lines.
        pub padding: [u32; 2],
    }

    /// A triangle as a leaf keeps it: with its corners, so that a walk need not follow indices.
    #[derive(PartialEq)]
    pub struct LeafTriangle {
        /// Object space.
        pub corner_0: [f32; 3],
        /// Object space.
        pub corner_1: [f32; 3],
        /// Object space.
        pub corner_2: [f32; 3],
        /// Index into [`Mesh::triangles`].
        pub triangle: u32,
    }
}

/// A tree of nodes. Node 0 is the root and always an inner node, with as little as one child.
#[derive(Clone, Debug)]
pub struct Bvh {
    /// Inner nodes, a parent always before its children.
    pub nodes: Vec<BvhNode>,
    /// What leaves index: the primitive that stands at each place.
    pub order: Vec<u32>,
    /// The box around everything.
    pub bounds: Bounds,
    /// Entries that a walk's stack needs at most, ≤ [`MAX_STACK`].
    pub stack: u32,
}

/// A primitive that a ray hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// The primitive's index, as it was given to [`Bvh::build`].
    pub primitive: u32,
    /// Ray parameter: the hit is at o + t·d.
    pub t: f32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

impl Bvh {
    /// A tree over the triangles of a mesh.
    pub fn over_triangles(mesh: &Mesh) -> Bvh {
        Bvh::over_triangles_within(mesh, MAX_STACK)
    }

    /// The same for a walk with such a stack, if that can be.
    pub fn over_triangles_within(mesh: &Mesh, stack: u32) -> Bvh {
        Bvh::within(&Bvh::boxes(mesh), MAX_LEAF, stack)
    }

    /// The boxes around the triangles of a mesh.
    pub fn boxes(mesh: &Mesh) -> Vec<Bounds> {
        let around = |triangle| mesh.corners(triangle).into_iter().fold(Bounds::EMPTY, Bounds::including);
        (0..mesh.triangles.len()).into_par_iter().map(around).collect()
    }

    /// The same tree over as many boxes that lie elsewhere.
    pub fn refitted(&self, boxes: &[Bounds]) -> Bvh {
        let mut bvh = self.clone();
        bvh.fit(boxes);
        bvh
    }

    /// A tree over boxes, at most `max_leaf` ≤ 4 of them in a leaf. No box, a box that is a point, identical and
    /// overlapping boxes are all fine.
    pub fn build(boxes: &[Bounds], max_leaf: u32) -> Bvh {
        Bvh::within(boxes, max_leaf, MAX_STACK)
    }

    /// A good tree if a walk through it needs no larger stack, else a balanced one.
    fn within(boxes: &[Bounds], max_leaf: u32, stack: u32) -> Bvh {
        let bvh = Bvh::of_shape(Shape::clustered(boxes, max_leaf), boxes);
        if bvh.stack <= stack { bvh } else { Bvh::of_shape(Shape::balanced(boxes), boxes) }
    }

    /// A stack that is enough for a balanced tree over so many single boxes, wherever they lie: each level quarters them, and
    /// leaves three nodes to visit later.
    pub fn balanced_stack(boxes: usize) -> u32 {
        let levels = (boxes.max(1) as u64).next_power_of_two().ilog2().div_ceil(2);
        3 * levels + 1
    }

    /// A tree over boxes whose leaves hold the index of one box each, so that [`Bvh::order`] says nothing. Its stack is at
    /// most `stack` if that is at least [`Bvh::balanced_stack`].
    pub fn over_single_boxes(boxes: &[Bounds], stack: u32) -> Bvh {
        let mut bvh = Bvh::within(boxes, 1, stack);
        for child in bvh.nodes.iter_mut().flat_map(|node| &mut node.child) {
            if *child != NO_CHILD && *child & LEAF != 0 {
                *child = LEAF | bvh.order[leaf_range(*child).start];
            }
        }
        bvh.order = (0..boxes.len() as u32).collect();
        bvh
    }

    fn of_shape(shape: Shape, boxes: &[Bounds]) -> Bvh {
        let nodes = shape.nodes.into_iter().map(|child| BvhNode { child, ..BvhNode::EMPTY }).collect();
        let mut bvh = Bvh { nodes, order: shape.order, bounds: Bounds::EMPTY, stack: 0 };
        bvh.fit(boxes);
        bvh
    }

    /// Computes boxes, orders and the stack's depth, from the last node, whose children are leaves, to the root.
    fn fit(&mut self, boxes: &[Bounds]) {
        let mut around = vec![Bounds::EMPTY; self.nodes.len()];
        let mut stack = vec![0; self.nodes.len()];
        for index in (0..self.nodes.len()).rev() {
            let node = &mut self.nodes[index];
            let (mut boxes_of, mut below, mut count) = ([Bounds::EMPTY; WIDTH], 0, 0);
            for (slot, bounds) in boxes_of.iter_mut().enumerate() {
                *bounds = match node.child[slot] {
                    NO_CHILD => continue,
                    leaf if leaf & LEAF != 0 => {
                        leaf_range(leaf).map(|place| boxes[self.order[place] as usize]).fold(Bounds::EMPTY, union)
                    }
                    inner => {
                        below = below.max(stack[inner as usize]);
                        around[inner as usize]
                    }
                };
                count += 1;
                node.set_bounds(slot, *bounds);
                around[index] = union(around[index], *bounds);
            }
            node.set_order(&boxes_of);
            stack[index] = below + u32::saturating_sub(count, 1);
        }
        self.bounds = around[0];
        // A walk pushes all children that it meets before it pops the nearest.
        self.stack = stack[0] + 1;
    }

    /// The triangles of `mesh` as the leaves of its tree index them.
    pub fn leaf_triangles(&self, mesh: &Mesh) -> Vec<LeafTriangle> {
        self.order
            .par_iter()
            .map(|triangle| {
                let [corner_0, corner_1, corner_2] = mesh.corners(*triangle as usize).map(|corner| corner.to_array());
                LeafTriangle { corner_0, corner_1, corner_2, triangle: *triangle }
            })
            .collect()
    }

    /// The nearest triangle of `mesh`, over which the tree was built, with 0 < t < `t_max`.
    pub fn closest(&self, mesh: &Mesh, origin: Vec3, direction: Vec3, t_max: f32) -> Option<Intersection> {
        // As on the device: boxes cannot be tested against numbers that are so large, or none.
        let size = (origin.abs() + direction.abs()).element_sum();
        if self.order.is_empty() || size.is_nan() || size >= 1e37 {
            return None;
        }
        let ray = TriangleRay::new(origin, direction);
        let (mut nearest, mut t_max) = (None, t_max.min(FARTHEST));
        self.walk(&BoxRay::new(origin, direction), t_max, |primitive| {
            if let Some([t, u, v]) = ray.intersect(t_max, mesh.corners(primitive as usize)) {
                nearest = Some(Intersection { primitive, t, u, v });
                t_max = t;
            }
            t_max
        });
        nearest
    }

    /// Calls `visit` with every primitive whose leaf the ray passes; it returns the new end of the ray.
    fn walk(&self, ray: &BoxRay, mut t_max: f32, mut visit: impl FnMut(u32) -> f32) {
        let mut stack = vec![0];
        while let Some(current) = stack.pop() {
            if current & LEAF != 0 {
                for place in leaf_range(current) {
                    t_max = visit(self.order[place]);
                }
                continue;
            }
            let node = &self.nodes[current as usize];
            let order = node.order[ray.octant / 4] >> (8 * (ray.octant % 4));
            for place in (0..WIDTH).rev() {
                let slot = (order >> (2 * place) & 3) as usize;
                if node.hit(slot, ray, t_max) {
                    stack.push(node.child[slot]);
                }
            }
        }
    }
}

/// A ray made ready for box tests. Along an axis that it is parallel to it is as wide as its origin's rounding, so that it
/// meets the boxes that it touches; 1/d is large there, but finite, so that no product with it is 0·∞.
struct BoxRay {
    near_origin: Vec3,
    far_origin: Vec3,
    near_scale: Vec3,
    far_scale: Vec3,
    octant: usize,
}

impl BoxRay {
    fn new(origin: Vec3, direction: Vec3) -> BoxRay {
        let is_parallel = direction.abs().cmplt(Vec3::splat(1e-18));
        let width = Vec3::select(is_parallel, origin.abs() * 3e-7 + 1e-18, Vec3::ZERO);
        let far_scale = Vec3::select(is_parallel, Vec3::splat(1e30), 1.0 / direction);
        BoxRay {
            near_origin: origin + width,
            far_origin: origin - width,
            near_scale: far_scale * NEAR_SLACK,
            far_scale,
            octant: far_scale.cmplt(Vec3::ZERO).bitmask() as usize,
        }
    }
}

impl BvhNode {
    const EMPTY: BvhNode = BvhNode {
        lower_x: [f32::INFINITY; WIDTH],
        upper_x: [f32::INFINITY; WIDTH],
        lower_y: [f32::INFINITY; WIDTH],
        upper_y: [f32::INFINITY; WIDTH],
        lower_z: [f32::INFINITY; WIDTH],
        upper_z: [f32::INFINITY; WIDTH],
        child: [NO_CHILD; WIDTH],
        order: [0xe4e4_e4e4; 2],
        padding: [0; 2],
    };

    fn set_bounds(&mut self, slot: usize, bounds: Bounds) {
        [self.lower_x[slot], self.lower_y[slot], self.lower_z[slot]] = bounds.min.to_array();
        [self.upper_x[slot], self.upper_y[slot], self.upper_z[slot]] = bounds.max.to_array();
    }

    /// Sorts the children along the diagonal of every octant by their centres.
    fn set_order(&mut self, bounds: &[Bounds; WIDTH]) {
        self.order = [0; 2];
        for octant in 0..8 {
            let sign = |bit: usize| if octant >> bit & 1 == 1 { -0.5 } else { 0.5 };
            let diagonal = Vec3::new(sign(0), sign(1), sign(2));
            let along = |slot: usize| match self.child[slot] {
                NO_CHILD => f32::INFINITY,
                _ => diagonal.dot(bounds[slot].min) + diagonal.dot(bounds[slot].max),
            };
            let mut slots = [0, 1, 2, 3];
            slots.sort_by(|a, b| along(*a).total_cmp(&along(*b)));
            let byte = slots.iter().rev().fold(0, |byte, slot| byte << 2 | *slot as u32);
            self.order[octant / 4] |= byte << (8 * (octant % 4));
        }
    }

    /// The slab test of one child.
    fn hit(&self, slot: usize, ray: &BoxRay, t_max: f32) -> bool {
        let lower = Vec3::new(self.lower_x[slot], self.lower_y[slot], self.lower_z[slot]);
        let upper = Vec3::new(self.upper_x[slot], self.upper_y[slot], self.upper_z[slot]);
        let is_negative = ray.far_scale.cmplt(Vec3::ZERO);
        let near = (Vec3::select(is_negative, upper, lower) - ray.near_origin) * ray.near_scale;
        let far = (Vec3::select(is_negative, lower, upper) - ray.far_origin) * ray.far_scale;
        near.max_element().max(0.0) <= far.min_element().min(t_max)
    }
}

/// A ray made ready for the watertight triangle test of Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection",
/// JCGT 2013: a shear along the ray's longest axis turns the question into whether the origin lies in a flat triangle,
/// and two triangles that share an edge compute the same number, but for its sign, for that edge.
#[derive(Clone, Copy, Debug)]
pub struct TriangleRay {
    origin: Vec3,
    x: Vec3,
    y: Vec3,
    z: Vec3,
}

impl TriangleRay {
    /// From origin and direction, which need not be a unit vector but must not be 0.
    pub fn new(origin: Vec3, direction: Vec3) -> TriangleRay {
        let d = direction;
        let longest = d.abs();
        let [x, y, z] = if longest.z >= longest.x && longest.z >= longest.y {
            [Vec3::new(1.0, 0.0, -d.x / d.z), Vec3::new(0.0, 1.0, -d.y / d.z), Vec3::new(0.0, 0.0, 1.0 / d.z)]
        } else if longest.y >= longest.x {
            [Vec3::new(1.0, -d.x / d.y, 0.0), Vec3::new(0.0, -d.z / d.y, 1.0), Vec3::new(0.0, 1.0 / d.y, 0.0)]
        } else {
            [Vec3::new(-d.y / d.x, 1.0, 0.0), Vec3::new(-d.z / d.x, 0.0, 1.0), Vec3::new(1.0 / d.x, 0.0, 0.0)]
        };
        TriangleRay { origin, x, y, z }
    }

    /// (t, u, v) where the ray meets the triangle, from either side, with 0 < t < `t_max`.
    pub fn intersect(&self, t_max: f32, corners: [Vec3; 3]) -> Option<[f32; 3]> {
        let [a, b, c] = corners.map(|corner| {
            let relative = corner - self.origin;
            Vec3::new(self.x.dot(relative), self.y.dot(relative), self.z.dot(relative))
        });
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        let determinant = u + v + w;
        let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
        let reciprocal = 1.0 / determinant;
        let t = (u * a.z + v * b.z + w * c.z) * reciprocal;
        (inside && determinant != 0.0 && t > 0.0 && t < t_max).then_some([t, v * reciprocal, w * reciprocal])
    }
}

/// Places in [`Bvh::order`] that a leaf holds.
fn leaf_range(leaf: u32) -> std::ops::Range<usize> {
    let first = (leaf & (MAX_PRIMITIVES as u32 - 1)) as usize;
    first..first + ((leaf & !LEAF) >> LEAF_COUNT_SHIFT) as usize + 1
}

fn union(a: Bounds, b: Bounds) -> Bounds {
    Bounds { min: a.min.min(b.min), max: a.max.max(b.max) }
}
