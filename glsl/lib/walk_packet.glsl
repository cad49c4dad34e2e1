// The walk of a subgroup as one packet, for CPU drivers: it visits what any of its rays has to visit, nearest first as one of
// them sees it. There a load from an address of each lane's own is a gather, by far the dearest instruction of a walk;
// a packet loads a node with one word a lane and passes the words around by shuffles. No votes or reductions: they are loops
// there. Part of lib/trace_bvh.glsl.
#ifndef LIB_WALK_PACKET
#define LIB_WALK_PACKET

// Words of the stack: entries, or in a packet entries / LANES; entries are at most 96.
layout(constant_id = 12) const uint STACK_WORDS = 96u;

// Entry e of a packet's stack lies in lane e % LANES of word e / LANES.
void push_packet(uint level, uint entry, bool wanted) {
    uint place = wanted ? stacks[level].size - gl_SubgroupInvocationID : ~0u;
    [[unroll]] for (uint i = 0u; i < STACK_WORDS; ++i) {
        stacks[level].word[i] = place == i * LANES ? entry : stacks[level].word[i];
    }
    stacks[level].size += uint(wanted);
}

// What pop_packet will return.
uint peek_packet(uint level) {
    uint size = stacks[level].size - 1u;
    uint word = stacks[level].word[0];
    [[unroll]] for (uint i = 1u; i < STACK_WORDS; ++i) {
        word = size / LANES == i ? stacks[level].word[i] : word;
    }
    uint entry = subgroupShuffle(word, size % LANES);
    return stacks[level].size != 0u ? entry : END;
}

uint pop_packet(uint level) {
    uint entry = peek_packet(level);
    stacks[level].size -= min(stacks[level].size, 1u);
    return entry;
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

// Where this lane's words begin: what follows is at a distance from there that is known when the kernel is built. No carry: on CPU drivers an
// address keeps its upper half throughout a buffer (src/gpu/buffer.rs).
WordArray own_words(uvec2 reference, uint first) {
    return WordArray(uvec2(reference.x + 4u * (first + gl_SubgroupInvocationID), reference.y));
}

// One plane of a child's box, for each lane its own choice of lower and upper. Both stand in eight lanes of one word or four of two.
float plane_packet(uint held[8], uint axis, uint slot, bool is_upper) {
    if (LANES == 8u) {
        return uintBitsToFloat(subgroupShuffle(held[axis], slot + (is_upper ? 4u : 0u)));
    } else {
        uint lower = subgroupShuffle(held[2u * axis], slot);
        uint upper = subgroupShuffle(held[2u * axis + 1u], slot);
        return uintBitsToFloat(is_upper ? upper : lower);
    }
}

// Visits an inner node: leaves those of its children that the ray meets to the stack and returns the nearest.
uint visit_packet(BvhNodeArray nodes, BoxRay ray, float t_max, uint level, uint current) {
    const uint loads = BVH_NODE_WORDS / LANES;
    uint held[8];
    WordArray node = own_words(uvec2(nodes), current * BVH_NODE_WORDS);
    [[unroll]] for (uint i = 0u; i < loads; ++i) {
        held[i] = node.at[i * LANES];
    }
    uint hits = 0u;
    [[unroll]] for (uint slot = 0u; slot < 4u; ++slot) {
        vec3 near, far;
        [[unroll]] for (uint axis = 0u; axis < 3u; ++axis) {
            near[axis] = plane_packet(held, axis, slot, ray.is_negative[axis]);
            far[axis] = plane_packet(held, axis, slot, !ray.is_negative[axis]);
        }
        near = (near - ray.near_origin) * ray.near_scale;
        far = (far - ray.far_origin) * ray.far_scale;
        bool is_hit = larger(larger(near.x, near.y), larger(near.z, 0.0)) <= smaller(smaller(far.x, far.y), smaller(far.z, t_max));
        hits |= is_hit ? 1u << slot : 0u;
    }
    hits = any_lane(hits);
    uint order = subgroupShuffle(held[28u / LANES], ray.order_lane) >> ray.order_shift;
    // The next node is known before the stack is in order again: its load need not wait for that.
    uint child[4];
    bool is_met[4];
    [[unroll]] for (uint place = 0u; place < 4u; ++place) {
        uint slot = order >> 2u * place & 3u;
        child[place] = subgroupShuffle(held[24u / LANES], 24u % LANES + slot);
        is_met[place] = (hits & 1u << slot) != 0u;
    }
    uint next = peek_packet(level);
    next = is_met[3] ? child[3] : next;
    next = is_met[2] ? child[2] : next;
    next = is_met[1] ? child[1] : next;
    next = is_met[0] ? child[0] : next;
    stacks[level].size -= hits == 0u ? min(stacks[level].size, 1u) : 0u;
    push_packet(level, child[3], is_met[3] && (is_met[0] || is_met[1] || is_met[2]));
    push_packet(level, child[2], is_met[2] && (is_met[0] || is_met[1]));
    push_packet(level, child[1], is_met[1] && is_met[0]);
    return next;
}

// What triangle_shear does to a corner, where each lane takes its coordinates in an order of its own: of a shear's nine numbers three are
// left, and 0 and 1 are what the others are. The results have the same bits.
struct PacketTriangleRay {
    uvec3 axis;     // the longest of the direction is the last one
    vec3 origin;    // in that order
    vec3 shear;
};

PacketTriangleRay packet_triangle_ray(TriangleRay ray) {
    bool is_z = ray.z.z != 0.0;
    bool is_y = ray.z.y != 0.0;
    PacketTriangleRay turned;
    turned.axis = is_z ? uvec3(0u, 1u, 2u) : is_y ? uvec3(0u, 2u, 1u) : uvec3(1u, 2u, 0u);
    turned.origin = is_z ? ray.origin : is_y ? ray.origin.xzy : ray.origin.yzx;
    turned.shear = is_z ? vec3(ray.x.z, ray.y.z, ray.z.z) : is_y ? vec3(ray.x.y, ray.y.y, ray.z.y) : vec3(ray.x.x, ray.y.x, ray.z.x);
    return turned;
}

// The words of a triangle. Eight lanes hold its words 0 to 7 and 2 to 9, four lanes a corner each, the last with the triangle's index.
struct PacketTriangle {
    uint held[3];
};

PacketTriangle triangle_packet(LeafTriangleArray triangles, uint place) {
    // place * LEAF_TRIANGLE_WORDS, which as a product takes longer, and the load waits for it.
    WordArray words = own_words(uvec2(triangles), (place << 3) + (place << 1));
    PacketTriangle triangle;
    triangle.held[0] = words.at[0];
    if (LANES == 8u) {
        triangle.held[1] = words.at[2];
    } else {
        triangle.held[1] = words.at[3];
        triangle.held[2] = words.at[6];
    }
    return triangle;
}

// A corner's coordinate; behind the last corner's three, the triangle's index.
uint word_packet(PacketTriangle triangle, uint corner, uint axis) {
    if (LANES == 8u) {
        return subgroupShuffle(triangle.held[corner / 2u], (corner == 2u ? 4u : 3u * corner) + axis);
    } else {
        return subgroupShuffle(triangle.held[corner], axis);
    }
}

vec3 sheared_corner(PacketTriangle triangle, uint corner, PacketTriangleRay ray) {
    vec3 v;
    [[unroll]] for (uint i = 0u; i < 3u; ++i) {
        v[i] = uintBitsToFloat(word_packet(triangle, corner, ray.axis[i]));
    }
    precise vec3 from_origin = v - ray.origin;
    precise vec3 sheared = vec3(from_origin.x + ray.shear.x * from_origin.z, from_origin.y + ray.shear.y * from_origin.z,
                                ray.shear.z * from_origin.z);
    return sheared;
}

// From leaf to leaf: nodes while it takes nodes, then triangles while it takes triangles.
uint walk_packet(BvhNodeArray nodes, LeafTriangleArray triangles, BoxRay box, TriangleRay ray, bool any, inout float t_max) {
    PacketTriangleRay turned = packet_triangle_ray(ray);
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
            PacketTriangle candidate = triangle_packet(triangles, place);
            uint triangle = word_packet(candidate, 2u, 3u);
            vec3 a = sheared_corner(candidate, 0u, turned);
            vec3 b = sheared_corner(candidate, 1u, turned);
            vec3 c = sheared_corner(candidate, 2u, turned);
            float t, u, v;
            if (intersect_sheared(a, b, c, 0.0, t_max, t, u, v) && comes_first(t, triangle, t_max, nearest) && !goes_through(triangle)) {
                nearest = triangle;
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
