// Finds one of many emissive triangles that matters where a light sample is taken, and the probability of having found it:
// `LightTree` of src/scene/light_tree.rs.
#ifndef LIB_LIGHT_TREE
#define LIB_LIGHT_TREE

#include "layout/scene.glsl"

// Many triangles emit, and a tree is there that picks one.
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

// Octahedral, two 16-bit numbers in [-1, 1].
vec3 unpack_axis(uint packed) {
    vec2 e = unpackSnorm2x16(packed);
    vec3 v = vec3(e, 1.0 - abs(e.x) - abs(e.y));
    float fold = max(-v.z, 0.0);
    v.xy += vec2(v.x >= 0.0 ? -fold : fold, v.y >= 0.0 ? -fold : fold);
    return normalize(v);
}

// The cosine, and its sine.
vec2 with_sine(float cosine) {
    return vec2(cosine, sqrt(max(0.0, 1.0 - cosine * cosine)));
}

// Cosine and sine of max(0, a - b), of angles from 0 to pi.
vec2 less_angle(vec2 a, vec2 b) {
    return a.x >= b.x ? vec2(1.0, 0.0) : vec2(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y);
}

// power * cos / (distance^2 + deviation^2 / 4), by the least angle between what a triangle may face and the way to the point.
float light_importance(LightNodeRecord node, vec3 point) {
    vec3 way = point - node.center;
    float distance_squared = dot(way, way);
    float away = inversesqrt(max(distance_squared, 1e-30));
    float sin_sphere = node.radius * away;
    vec2 spread_deviation = unpackSnorm2x16(node.spread_deviation);
    vec2 axis = with_sine(clamp(dot(unpack_axis(node.axis), way) * away, -1.0, 1.0));
    vec2 sphere = with_sine(sqrt(max(0.0, 1.0 - sin_sphere * sin_sphere)));
    float cosine = less_angle(less_angle(axis, with_sine(spread_deviation.x)), sphere).x;
    // Inside the sphere, a triangle may face the point from anywhere.
    cosine = sin_sphere >= 1.0 ? 1.0 : max(cosine, 0.0);
    float deviation = spread_deviation.y * node.radius;
    return node.power * cosine / max(distance_squared + 0.25 * deviation * deviation, 1e-30);
}

struct PickedEmitter {
    uint index;          // 0 where none is picked
    float probability;   // 0 where the way down ends at triangles that face away
    float rest;          // what is left of u, in [0, 1)
};

PickedEmitter light_tree_pick(LightTree tree, vec3 point, float u) {
    LightNodeArray nodes = LightNodeArray(tree.nodes);
    uint child = 0u;
    float probability = 1.0;
    while ((child & LIGHT_LEAF) == 0u) {
        LightNodeRecord left = nodes.at[child];
        LightNodeRecord right = nodes.at[child + 1u];
        vec2 importance = vec2(light_importance(left, point), light_importance(right, point));
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
float light_tree_probability(LightTree tree, vec3 point, uint node) {
    LightNodeArray nodes = LightNodeArray(tree.nodes);
    WordArray parents = WordArray(tree.parents);
    float probability = 1.0;
    while (probability > 0.0) {
        float importance = light_importance(nodes.at[node], point);
        float both = importance + light_importance(nodes.at[node ^ 1u], point);
        probability *= both > 0.0 ? importance / both : 0.0;
        if (node < 2u) {
            break;
        }
        node = parents.at[node / 2u];
    }
    return probability;
}

#endif
