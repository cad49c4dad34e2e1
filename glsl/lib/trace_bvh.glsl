// Finds triangles by a walk through our own trees. Included behind a declaration of `scene`, a SceneTable.
//
// The walk has two forms, chosen by a specialization constant; docs/traversal.md has the figures.
//
// - On GPUs every invocation walks on its own.
// - On CPU drivers a subgroup walks as one packet: it visits what any of its rays has to visit, nearest first as one of
//   them sees it. There a load from an address of each lane's own is a gather, by far the dearest instruction of a walk;
//   a packet loads a node with one word a lane and passes the words around by shuffles. Every invocation of a subgroup
//   calls these functions together; one without a ray says t_max < 0. No votes or reductions: they are loops there.
#ifndef LIB_TRACE_BVH
#define LIB_TRACE_BVH

#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require

#include "layout/scene.glsl"
#include "lib/triangle.glsl"

layout(constant_id = 10) const bool IS_PACKET = false;
// Invocations of a subgroup, if it walks as a packet: 4 or 8. (Select operations on specialization constants, and
// arrays sized by them, are more than SwiftShader's compiler survives.)
layout(constant_id = 11) const uint LANES = 32u;
// Words of the stack: entries, or in a packet entries / LANES; entries are at most 96.
layout(constant_id = 12) const uint STACK_WORDS = 96u;

// What follows the last node: a leaf that no tree has.
const uint END = BVH_LEAF | 7u << BVH_LEAF_COUNT_SHIFT;

// The near ends of boxes are drawn in by 1 - 2γ(3), so that rounding loses no hit (after Ize, "Robust BVH Ray Traversal",
// JCGT 2013, who moves the far ends out; this way it holds against the ray's end too).
const float NEAR_SLACK = 1.0 - 3.6e-7;

// A ray's end, so that no ray reaches the boxes at +∞ of children that are not there.
const float FARTHEST = 3.4e38;

// A ray made ready for box tests. Along an axis that it is parallel to it is as wide as its origin's rounding, so that it
// meets the boxes that it touches; 1/d is large there, but finite, so that no product with it is 0·∞.
struct BoxRay {
    vec3 near_origin;
    vec3 far_origin;
    vec3 near_scale;
    vec3 far_scale;     // 1/d
    bvec3 is_negative;
    uint octant;        // of the direction, or of that of the packet's first ray
};

BoxRay box_ray(vec3 origin, vec3 direction) {
    BoxRay ray;
    bvec3 is_parallel = lessThan(abs(direction), vec3(1e-18));
    vec3 width = mix(vec3(0.0), abs(origin) * 3e-7 + 1e-18, is_parallel);
    ray.near_origin = origin + width;
    ray.far_origin = origin - width;
    ray.far_scale = mix(1.0 / direction, vec3(1e30), is_parallel);
    ray.near_scale = ray.far_scale * NEAR_SLACK;
    ray.is_negative = lessThan(ray.far_scale, vec3(0.0));
    ray.octant = uint(ray.is_negative.x) | uint(ray.is_negative.y) << 1 | uint(ray.is_negative.z) << 2;
    if (IS_PACKET) {
        ray.octant = subgroupShuffle(ray.octant, 0u);
    }
    return ray;
}

// Of a number and something that is none, these take the number if that is the second. In a box test that is t_max: a ray
// that ends before it starts meets no box, whatever its other numbers are.
float larger(float a, float b) {
    return a > b ? a : b;
}

float smaller(float a, float b) {
    return a < b ? a : b;
}

bool meets_box(BoxRay ray, vec3 lower, vec3 upper, float t_max) {
    vec3 near = (mix(lower, upper, ray.is_negative) - ray.near_origin) * ray.near_scale;
    vec3 far = (mix(upper, lower, ray.is_negative) - ray.far_origin) * ray.far_scale;
    return larger(larger(near.x, near.y), larger(near.z, 0.0)) <= smaller(smaller(far.x, far.y), smaller(far.z, t_max));
}

// Nodes yet to visit, of the tree over instances and of a mesh's. A packet's entry e lies in lane e % LANES of word e / LANES.
// They stand here and are no arguments: an array that is handed in and out is copied at each call, unless a compiler sees through it.
struct Stack {
    uint word[96];
    uint size;
};
Stack stacks[2];
const uint TOP = 0u;
const uint MESH = 1u;

void push(uint level, uint entry, bool wanted) {
    if (IS_PACKET) {
        uint place = wanted ? stacks[level].size - gl_SubgroupInvocationID : ~0u;
        [[unroll]] for (uint i = 0u; i < STACK_WORDS; ++i) {
            stacks[level].word[i] = place == i * LANES ? entry : stacks[level].word[i];
        }
        stacks[level].size += uint(wanted);
    } else if (wanted) {
        stacks[level].word[stacks[level].size++] = entry;
    }
}

uint pop(uint level) {
    uint entry = END;
    if (stacks[level].size != 0u) {
        stacks[level].size -= 1u;
        uint size = stacks[level].size;
        if (IS_PACKET) {
            uint word = stacks[level].word[0];
            [[unroll]] for (uint i = 1u; i < STACK_WORDS; ++i) {
                word = size / LANES == i ? stacks[level].word[i] : word;
            }
            entry = subgroupShuffle(word, size % LANES);
        } else {
            entry = stacks[level].word[size];
        }
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

// Whether nobody who walks along has a ray left.
bool is_done(float t_max) {
    return IS_PACKET ? any_lane(uint(t_max >= 0.0)) == 0u : t_max < 0.0;
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
        push(level, child, (hits >> slot & 1u) != 0u);
    }
    return pop(level);
}

uint visit_alone(BvhNodeArray nodes, BoxRay ray, float t_max, uint level, uint current) {
    BvhNode node = nodes.at[current];
    uint order = (ray.octant < 4u ? node.order.x : node.order.y) >> 8u * (ray.octant % 4u);
    uint hits = 0u;
    [[unroll]] for (uint slot = 0u; slot < 4u; ++slot) {
        vec3 lower = vec3(node.lower_x[slot], node.lower_y[slot], node.lower_z[slot]);
        vec3 upper = vec3(node.upper_x[slot], node.upper_y[slot], node.upper_z[slot]);
        hits |= meets_box(ray, lower, upper, t_max) ? 1u << slot : 0u;
    }
    uint nearest = END;
    [[unroll]] for (int place = 3; place >= 0; --place) {
        uint slot = order >> 2 * place & 3u;
        if ((hits >> slot & 1u) != 0u) {
            push(level, nearest, nearest != END);
            nearest = slot < 2u ? (slot == 0u ? node.child.x : node.child.y)
                                : (slot == 2u ? node.child.z : node.child.w);
        }
    }
    if (nearest == END) {
        nearest = pop(level);
    }
    return nearest;
}

// Walks from an inner node to the next leaf, or to END.
uint next_leaf(BvhNodeArray nodes, BoxRay ray, float t_max, uint level, uint current) {
    do {
        if (IS_PACKET) {
            current = visit_packet(nodes, ray, t_max, level, current);
        } else {
            current = visit_alone(nodes, ray, t_max, level, current);
        }
    } while ((current & BVH_LEAF) == 0u);
    return current;
}

uint leaf_first(uint leaf) {
    return leaf & (1u << BVH_LEAF_COUNT_SHIFT) - 1u;
}

uint leaf_count(uint leaf) {
    return (leaf >> BVH_LEAF_COUNT_SHIFT & 7u) + 1u;
}

LeafTriangle leaf_triangle(LeafTriangleArray triangles, uint place) {
    if (!IS_PACKET) {
        return triangles.at[place];
    }
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

// The end of a ray that meets something: -1 where its numbers are not, or so large that boxes cannot be tested.
float usable_end(vec3 origin, vec3 direction, float t_max) {
    float size = dot(abs(origin) + abs(direction), vec3(1.0));
    return size < 1e37 ? smaller(t_max, FARTHEST) : -1.0;
}

// Shortens the ray to its nearest triangle of the mesh, or, where `any`, to t_max < 0 if it has one.
// Returns that triangle, or NO_HIT.
uint trace_mesh(MeshRecord mesh, vec3 origin, vec3 direction, bool any, inout float t_max) {
    BvhNodeArray nodes = mesh.nodes;
    LeafTriangleArray triangles = mesh.leaf_triangles;
    BoxRay box = box_ray(origin, direction);
    TriangleRay ray = triangle_ray(origin, direction);
    uint nearest = NO_HIT;
    stacks[MESH].size = 0u;
    uint current = 0u;
    do {
        current = next_leaf(nodes, box, t_max, MESH, current);
        uint place = leaf_first(current);
        uint left = leaf_count(current);
        // On from leaf to leaf, as long as they come. Once too often at the end: a test there would cost more.
        do {
            LeafTriangle candidate = leaf_triangle(triangles, place);
            float t, u, v;
            if (intersect_triangle(ray, 0.0, t_max, candidate.corner_0, candidate.corner_1, candidate.corner_2, t, u, v)) {
                nearest = candidate.triangle;
                t_max = any ? -1.0 : t;
            }
            place += 1u;
            left -= 1u;
            if (left == 0u) {
                current = any && is_done(t_max) ? END : pop(MESH);
                place = leaf_first(current);
                left = leaf_count(current);
            }
        } while ((current & BVH_LEAF) != 0u && current != END);
    } while (current != END);
    return nearest;
}

Hit trace(vec3 origin, vec3 direction, bool any, float t_max) {
    Hit hit = Hit(NO_HIT, 0u);
    t_max = usable_end(origin, direction, t_max);
    if (!INSTANCED) {
        MeshRecord mesh = MeshRecord(scene.meshes.at[scene.instances.at[0].mesh]);
        hit.triangle = trace_mesh(mesh, origin, direction, any, t_max);
        hit.instance = hit.triangle == NO_HIT ? NO_HIT : 0u;
        return hit;
    }
    BvhNodeArray nodes = scene.nodes;
    BoxRay box = box_ray(origin, direction);
    stacks[TOP].size = 0u;
    uint current = 0u;
    do {
        current = next_leaf(nodes, box, t_max, TOP, current);
        while ((current & BVH_LEAF) != 0u && current != END) {
            uint index = leaf_first(current);
            mat4x3 to_object = scene.instances.at[index].world_to_object;
            vec3 object_origin = to_object * vec4(origin, 1.0);
            vec3 object_direction = mat3(to_object) * direction;
            float end = usable_end(object_origin, object_direction, t_max);
            MeshRecord mesh = MeshRecord(scene.meshes.at[scene.instances.at[index].mesh]);
            uint triangle = trace_mesh(mesh, object_origin, object_direction, any, end);
            if (triangle != NO_HIT) {
                hit = Hit(index, triangle);
                t_max = end;
            }
            current = any && is_done(t_max) ? END : pop(TOP);
        }
    } while (current != END);
    return hit;
}

// The nearest triangle with 0 < t < t_max.
Hit trace_closest(vec3 origin, vec3 direction, float t_max) {
    return trace(origin, direction, false, t_max);
}

// Whether any triangle has 0 < t < t_max.
bool trace_any(vec3 origin, vec3 direction, float t_max) {
    return trace(origin, direction, true, t_max).instance != NO_HIT;
}

#endif
