// The walk of a subgroup as one packet, for CPU drivers: it visits what any of its rays has to visit, nearest first as one of
// them sees it. There a load from an address of each lane's own is a gather, by far the dearest instruction of a walk;
// a packet loads a node with one word a lane and passes the words around by shuffles. No votes or reductions: they are loops
// there. Part of lib/trace_bvh.glsl.
#ifndef LIB_WALK_PACKET
#define LIB_WALK_PACKET

// Invocations of a subgroup, if it walks as a packet: 4 or 8. (Select operations on specialization constants, and
// arrays sized by them, are more than SwiftShader's compiler survives.)
layout(constant_id = 11) const uint LANES = 32u;
// Words of the stack: entries, or in a packet entries / LANES; entries are at most 96.
layout(constant_id = 12) const uint STACK_WORDS = 96u;

bool meets_box(BoxRay ray, vec3 lower, vec3 upper, float t_max) {
    vec3 near = (mix(lower, upper, ray.is_negative) - ray.near_origin) * ray.near_scale;
    vec3 far = (mix(upper, lower, ray.is_negative) - ray.far_origin) * ray.far_scale;
    return larger(larger(near.x, near.y), larger(near.z, 0.0)) <= smaller(smaller(far.x, far.y), smaller(far.z, t_max));
}

// Entry e of a packet's stack lies in lane e % LANES of word e / LANES.
void push_packet(uint level, uint entry, bool wanted) {
    uint place = wanted ? stacks[level].size - gl_SubgroupInvocationID : ~0u;
    [[unroll]] for (uint i = 0u; i < STACK_WORDS; ++i) {
        stacks[level].word[i] = place == i * LANES ? entry : stacks[level].word[i];
    }
    stacks[level].size += uint(wanted);
}

uint pop_packet(uint level) {
    uint entry = END;
    if (stacks[level].size != 0u) {
        stacks[level].size -= 1u;
        uint size = stacks[level].size;
        uint word = stacks[level].word[0];
        [[unroll]] for (uint i = 1u; i < STACK_WORDS; ++i) {
            word = size / LANES == i ? stacks[level].word[i] : word;
        }
        entry = subgroupShuffle(word, size % LANES);
    }
    return entry;
}

// SwiftShader knows no casts from reference to reference.
WordArray words(uvec2 reference) {
    return WordArray(reference);
}

// The bits that any invocation of the packet has.
uint any_lane(uint bits) {
    [[unroll]] for (uint distance = 1u; distance < LANES; distance *= 2u) {
        bits |= subgroupShuffle(bits, gl_SubgroupInvocationID ^ distance);
    }
    return bits;
}

bool nobody(bool wants) {
    return any_lane(uint(wants)) == 0u;
}

// Visits an inner node: leaves those of its children that the ray meets to the stack and returns the nearest.
uint visit_packet(BvhNodeArray nodes, BoxRay ray, float t_max, uint level, uint current) {
    const uint loads = BVH_NODE_WORDS / LANES;
    uint held[8];
    [[unroll]] for (uint i = 0u; i < loads; ++i) {
        held[i] = words(uvec2(nodes)).at[current * BVH_NODE_WORDS + i * LANES + gl_SubgroupInvocationID];
    }
    uint hits = 0u;
    [[unroll]] for (uint slot = 0u; slot < 4u; ++slot) {
        float bound[6];
        [[unroll]] for (uint i = 0u; i < 6u; ++i) {
            bound[i] = uintBitsToFloat(subgroupShuffle(held[(4u * i + slot) / LANES], (4u * i + slot) % LANES));
        }
        bool is_hit = meets_box(ray, vec3(bound[0], bound[2], bound[4]), vec3(bound[1], bound[3], bound[5]), t_max);
        hits |= is_hit ? 1u << slot : 0u;
    }
    hits = any_lane(hits);
    uint order = subgroupShuffle(held[28u / LANES], 28u % LANES + ray.octant / 4u) >> 8u * (ray.octant % 4u);
    [[unroll]] for (int place = 3; place >= 0; --place) {
        uint slot = order >> 2 * place & 3u;
        uint child = subgroupShuffle(held[24u / LANES], 24u % LANES + slot);
        push_packet(level, child, (hits >> slot & 1u) != 0u);
    }
    return pop_packet(level);
}

LeafTriangle leaf_triangle_packet(LeafTriangleArray triangles, uint place) {
    // Whole words of all lanes: the last one reads beyond its triangle, and there is room behind the last of them.
    const uint loads = (LEAF_TRIANGLE_WORDS + LANES - 1u) / LANES;
    uint held[3];
    [[unroll]] for (uint i = 0u; i < loads; ++i) {
        held[i] = words(uvec2(triangles)).at[place * LEAF_TRIANGLE_WORDS + i * LANES + gl_SubgroupInvocationID];
    }
    uint word[LEAF_TRIANGLE_WORDS];
    [[unroll]] for (uint i = 0u; i < LEAF_TRIANGLE_WORDS; ++i) {
        word[i] = subgroupShuffle(held[i / LANES], i % LANES);
    }
    return LeafTriangle(uintBitsToFloat(uvec3(word[0], word[1], word[2])),
                        uintBitsToFloat(uvec3(word[3], word[4], word[5])),
                        uintBitsToFloat(uvec3(word[6], word[7], word[8])), word[9]);
}

// From leaf to leaf: nodes while it takes nodes, then triangles while it takes triangles.
uint walk_packet(BvhNodeArray nodes, LeafTriangleArray triangles, BoxRay box, TriangleRay ray, bool any, inout float t_max) {
    uint nearest = NO_HIT;
    uint current = 0u;
    do {
        do {
            current = visit_packet(nodes, box, t_max, MESH, current);
        } while ((current & BVH_LEAF) == 0u);
        uint place = leaf_first(current);
        uint left = leaf_count(current);
        // Once too often at the end: a test there would cost more.
        do {
            LeafTriangle candidate = leaf_triangle_packet(triangles, place);
            float t, u, v;
            if (intersect_triangle(ray, 0.0, t_max, candidate.corner_0, candidate.corner_1, candidate.corner_2, t, u, v)
                && !goes_through(candidate.triangle)) {
                nearest = candidate.triangle;
                t_max = any ? -1.0 : t;
            }
            place += 1u;
            left -= 1u;
            if (left == 0u) {
                current = any && nobody(t_max >= 0.0) ? END : pop_packet(MESH);
                place = leaf_first(current);
                left = leaf_count(current);
            }
        } while ((current & BVH_LEAF) != 0u && current != END);
    } while (current != END);
    return nearest;
}

#endif
