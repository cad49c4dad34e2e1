// Finds one of several emissive triangles that matters where a light sample is taken, and the probability of having found it:
// `LightTree` of src/scene/light_tree.rs.
#ifndef LIB_LIGHT_TREE
#define LIB_LIGHT_TREE

#include "layout/scene.glsl"

// More than a few triangles emit, and a tree is there that picks one.
layout(constant_id = 36) const bool HAS_LIGHT_TREE = false;

// Where the tree is; the arrays of layout/scene.glsl, as structs do not hold references.
struct LightTree {
    uvec2 nodes;
    uvec2 parents;
    uvec2 leaves;
    uint leaf_count;
};

LightTree light_tree_of(SceneTable scene) {
    return LightTree(uvec2(scene.light_nodes), uvec2(scene.light_parents), uvec2(scene.emitter_leaves), scene.emitter_count);
}

// Where light may arrive: a point, and the normal of the side that it counts on, or 0 if it counts on both.
struct Receiver {
    vec3 point;
    vec3 normal;
};

vec2 fold_over(vec2 e) {
    return (1.0 - abs(e.yx)) * vec2(e.x >= 0.0 ? 1.0 : -1.0, e.y >= 0.0 ? 1.0 : -1.0);
}

// A unit vector in an octahedron's square, two 16-bit numbers in [-1, 1] (Cigolle et al. 2014).
uint pack_axis(vec3 v) {
    vec2 e = v.xy / (abs(v.x) + abs(v.y) + abs(v.z));
    return packSnorm2x16(v.z < 0.0 ? fold_over(e) : e);
}

vec3 unpack_axis(uint packed) {
    vec2 e = unpackSnorm2x16(packed);
    float z = 1.0 - abs(e.x) - abs(e.y);
    return normalize(vec3(z < 0.0 ? fold_over(e) : e, z));
}

// Stands for no normal: the packing of none.
const uint NO_NORMAL = 0x80008000u;

uint pack_normal(vec3 normal, bool both_sides) {
    return both_sides ? NO_NORMAL : pack_axis(normal);
}

// As packed, so that a path that goes on from the point knows the same receiver.
Receiver receiver_at(vec3 point, uint packed_normal) {
    return Receiver(point, packed_normal == NO_NORMAL ? vec3(0.0) : unpack_axis(packed_normal));
}

// The cosine, and its sine.
vec2 with_sine(float cosine) {
    return vec2(cosine, sqrt(max(0.0, 1.0 - cosine * cosine)));
}

// Cosine and sine of max(0, a - b), of angles from 0 to pi.
vec2 less_angle(vec2 a, vec2 b) {
    return a.x >= b.x ? vec2(1.0, 0.0) : vec2(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y);
}

// power * cos * cos / (distance^2 + deviation^2 / 4), by the least angles between what a triangle may face and the way to the point, and
// between the normal and the way to a triangle.
float light_importance(LightNodeRecord node, Receiver receiver) {
    vec3 way = receiver.point - node.center;
    float distance_squared = dot(way, way);
    float away = inversesqrt(max(distance_squared, 1e-30));
    float sin_sphere = node.radius * away;
    vec2 sphere = with_sine(sqrt(max(0.0, 1.0 - sin_sphere * sin_sphere)));
    vec2 spread_deviation = unpackSnorm2x16(node.spread_deviation);
    vec2 axis = with_sine(clamp(dot(unpack_axis(node.axis), way) * away, -1.0, 1.0));
    float cosine = max(less_angle(less_angle(axis, with_sine(spread_deviation.x)), sphere).x, 0.0);
    vec2 normal = with_sine(clamp(-dot(receiver.normal, way) * away, -1.0, 1.0));
    cosine *= receiver.normal == vec3(0.0) ? 1.0 : max(less_angle(normal, sphere).x, 0.0);
    // Inside the sphere, a triangle may be anywhere.
    cosine = sin_sphere >= 1.0 ? 1.0 : cosine;
    float deviation = spread_deviation.y * node.radius;
    return node.power * cosine / max(distance_squared + 0.25 * deviation * deviation, 1e-30);
}

struct PickedEmitter {
    uint index;          // 0 where none is picked
    float probability;   // 0 where the way down ends at triangles that face away
    float rest;          // what is left of u, in [0, 1)
};

PickedEmitter light_tree_pick(LightTree tree, Receiver receiver, float u) {
    LightNodeArray nodes = LightNodeArray(tree.nodes);
    uint child = 0u;
    float probability = 1.0;
    while ((child & LIGHT_LEAF) == 0u) {
        LightNodeRecord left = nodes.at[child];
        LightNodeRecord right = nodes.at[child + 1u];
        vec2 importance = vec2(light_importance(left, receiver), light_importance(right, receiver));
        float sum = importance.x + importance.y;
        bool any = sum > 0.0;
        float of_left = any ? importance.x / sum : 0.0;
        bool goes_left = u < of_left;
        float taken = goes_left ? of_left : importance.y / sum;
        u = min((goes_left ? u : u - of_left) / taken, 1.0 - 6.0e-8);
        probability = any ? probability * taken : 0.0;
        child = any ? (goes_left ? left.child : right.child) : LIGHT_LEAF;
    }
    return PickedEmitter(child & ~LIGHT_LEAF, probability, u);
}

// Where a triangle stands among the leaves, which are in the order of instances and triangles; `leaf_count` if it is none.
uint light_tree_leaf(LightTree tree, uint instance, uint triangle) {
    EmitterLeafArray leaves = EmitterLeafArray(tree.leaves);
    uint first = 0u;
    uint beyond = tree.leaf_count;
    while (first < beyond) {
        uint middle = (first + beyond) / 2u;
        uvec2 key = uvec2(leaves.at[middle].instance, leaves.at[middle].triangle);
        bool is_below = key.x < instance || (key.x == instance && key.y < triangle);
        first = is_below ? middle + 1u : first;
        beyond = is_below ? beyond : middle;
    }
    bool found = first < tree.leaf_count && leaves.at[first].instance == instance && leaves.at[first].triangle == triangle;
    return found ? first : tree.leaf_count;
}

// The probability with which `light_tree_pick` finds a leaf's node.
float light_tree_probability(LightTree tree, Receiver receiver, uint node) {
    LightNodeArray nodes = LightNodeArray(tree.nodes);
    WordArray parents = WordArray(tree.parents);
    float probability = 1.0;
    while (probability > 0.0) {
        float importance = light_importance(nodes.at[node], receiver);
        float both = importance + light_importance(nodes.at[node ^ 1u], receiver);
        probability *= both > 0.0 ? importance / both : 0.0;
        if (node < 2u) {
            break;
        }
        node = parents.at[node / 2u];
    }
    return probability;
}

#endif
