// The walk of one invocation on its own, for GPUs. Part of lib/trace_bvh.glsl.
#ifndef LIB_WALK_ALONE
#define LIB_WALK_ALONE

// A node as rows of four, a child each: lower x, upper x, lower y, upper y, lower z, upper z, the children, their orders.
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer BvhRowArray { vec4 at[]; };
const uint BVH_NODE_ROWS = BVH_NODE_WORDS / 4u;

// A leaf's triangle is loaded by two words at a time.
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer PairArray { uvec2 at[]; };

void push_alone(uint level, uint entry, bool wanted) {
    if (wanted) {
        stacks[level].word[stacks[level].size++] = entry;
    }
}

uint pop_alone(uint level) {
    if (stacks[level].size == 0u) {
        return END;
    }
    stacks[level].size -= 1u;
    return stacks[level].word[stacks[level].size];
}

// Puts the nearer of two children first.
void order_children(inout float near_a, inout uint child_a, inout float near_b, inout uint child_b) {
    bool swaps = near_b < near_a;
    float near = near_a;
    uint child = child_a;
    near_a = swaps ? near_b : near_a;
    child_a = swaps ? child_b : child_a;
    near_b = swaps ? near : near_b;
    child_b = swaps ? child : child_b;
}

// Visits an inner node: leaves those of its children that the ray meets to the stack and returns the nearest. The sign of a
// direction picks the rows that are read, so that nothing is selected from what was. Of a ray that usable_end lets pass no number here
// is none; of one that it ends, 0 and t_max come first in `max` and `min`, which then take them, so that it meets no box.
uint visit_alone(BvhNodeArray nodes, BoxRay ray, float t_max, uint level, uint current) {
    BvhRowArray rows = BvhRowArray(uvec2(nodes));
    uint first = current * BVH_NODE_ROWS;
    uvec3 near_row = first + uvec3(0u, 2u, 4u) + uvec3(ray.is_negative);
    uvec3 far_row = first + uvec3(1u, 3u, 5u) - uvec3(ray.is_negative);
    vec4 near_x = (rows.at[near_row.x] - ray.near_origin.x) * ray.near_scale.x;
    vec4 near_y = (rows.at[near_row.y] - ray.near_origin.y) * ray.near_scale.y;
    vec4 near_z = (rows.at[near_row.z] - ray.near_origin.z) * ray.near_scale.z;
    vec4 far_x = (rows.at[far_row.x] - ray.far_origin.x) * ray.far_scale.x;
    vec4 far_y = (rows.at[far_row.y] - ray.far_origin.y) * ray.far_scale.y;
    vec4 far_z = (rows.at[far_row.z] - ray.far_origin.z) * ray.far_scale.z;
    uvec4 child = floatBitsToUint(rows.at[first + 6u]);
    vec4 near = max(max(vec4(0.0), near_z), max(near_x, near_y));
    vec4 far = min(min(vec4(t_max), far_z), min(far_x, far_y));
    near = mix(vec4(INFINITY), near, lessThanEqual(near, far));
    order_children(near.x, child.x, near.y, child.y);
    order_children(near.z, child.z, near.w, child.w);
    order_children(near.x, child.x, near.z, child.z);
    order_children(near.y, child.y, near.w, child.w);
    order_children(near.y, child.y, near.z, child.z);
    push_alone(level, child.w, near.w < INFINITY);
    push_alone(level, child.z, near.z < INFINITY);
    push_alone(level, child.y, near.y < INFINITY);
    return near.x < INFINITY ? child.x : pop_alone(level);
}

LeafTriangle leaf_triangle_alone(LeafTriangleArray triangles, uint place) {
    uvec2 pair[LEAF_TRIANGLE_WORDS / 2u];
    [[unroll]] for (uint i = 0u; i < LEAF_TRIANGLE_WORDS / 2u; ++i) {
        pair[i] = PairArray(uvec2(triangles)).at[place * (LEAF_TRIANGLE_WORDS / 2u) + i];
    }
    return LeafTriangle(uintBitsToFloat(uvec3(pair[0], pair[1].x)), uintBitsToFloat(uvec3(pair[1].y, pair[2])),
                        uintBitsToFloat(uvec3(pair[3], pair[4].x)), pair[4].y);
}

// Nodes and triangles in one loop, a step each: an invocation that has reached a leaf does not wait for its neighbours to reach theirs.
uint walk_alone(BvhNodeArray nodes, LeafTriangleArray triangles, BoxRay box, TriangleRay ray, bool any, inout float t_max) {
    uint nearest = NO_HIT;
    uint current = 0u;
    do {
        if ((current & BVH_LEAF) == 0u) {
            current = visit_alone(nodes, box, t_max, MESH, current);
        } else {
            LeafTriangle candidate = leaf_triangle_alone(triangles, leaf_first(current));
            float t, u, v;
            if (intersect_triangle(ray, 0.0, t_max, candidate.corner_0, candidate.corner_1, candidate.corner_2, t, u, v)
                && comes_first(t, candidate.triangle, t_max, nearest) && !goes_through(candidate.triangle)) {
                nearest = candidate.triangle;
                t_max = any ? -1.0 : t;
            }
            if (any && t_max < 0.0) {
                current = END;
            } else if (leaf_count(current) == 1u) {
                current = pop_alone(MESH);
            } else {
                // The leaf without that triangle.
                current += 1u - (1u << BVH_LEAF_COUNT_SHIFT);
            }
        }
    } while (current != END);
    return nearest;
}

#endif
