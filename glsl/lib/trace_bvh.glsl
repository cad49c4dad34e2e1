// Finds triangles by a walk through our own trees. Included behind a declaration of `scene`, a SceneTable.
//
// The walk has two forms, chosen by a specialization constant; docs/traversal.md has the figures.
//
// - On GPUs every invocation walks on its own: lib/walk_alone.glsl.
// - On CPU drivers a subgroup walks as one packet: lib/walk_packet.glsl. Every invocation of a subgroup calls these functions
//   together; one without a ray says t_max < 0.
#ifndef LIB_TRACE_BVH
#define LIB_TRACE_BVH

#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require

#include "layout/scene.glsl"
#include "lib/opacity.glsl"
#include "lib/triangle.glsl"

layout(constant_id = 10) const bool IS_PACKET = false;
// Invocations of a subgroup, if it walks as a packet: 4 or 8. (Select operations on specialization constants, and
// arrays sized by them, are more than SwiftShader's compiler survives.)
layout(constant_id = 11) const uint LANES = 32u;

// What follows the last node: a leaf that no tree has.
const uint END = BVH_LEAF | 7u << BVH_LEAF_COUNT_SHIFT;

// The near ends of boxes are drawn in by 1 - 2γ(3), so that rounding loses no hit (after Ize, "Robust BVH Ray Traversal",
// JCGT 2013, who moves the far ends out; this way it holds against the ray's end too).
const float NEAR_SLACK = 1.0 - 3.6e-7;

// And by that much of the scene's size: a triangle's t is rounded as its far corners are, and may be before its box. Whether it is found would
// else hang on what was found before.
const float TRIANGLE_SLACK = 1e-5;

// A ray's end, so that no ray reaches the boxes at +∞ of children that are not there.
const float FARTHEST = 3.4e38;

// The ray as it is in the world, and the instance that is walked through.
vec3 world_origin;
vec3 world_direction;
uint walked_instance;

// A ray made ready for box tests. Along an axis that it is parallel to it is as wide as its origin's rounding, so that it
// meets the boxes that it touches; 1/d is large there, but finite, so that no product with it is 0·∞.
struct BoxRay {
    vec3 near_origin;
    vec3 far_origin;
    vec3 near_scale;
    vec3 far_scale;     // 1/d
    bvec3 is_negative;
    // Where a node keeps the order of its children for the octant of a packet's first ray: the lane and the bit.
    uint order_lane;
    uint order_shift;
};

BoxRay box_ray(vec3 origin, vec3 direction) {
    BoxRay ray;
    bvec3 is_parallel = lessThan(abs(direction), vec3(1e-18));
    vec3 width = mix(vec3(0.0), abs(origin) * 3e-7 + 1e-18, is_parallel);
    vec3 slack = direction * (TRIANGLE_SLACK * scene.reach * inversesqrt(dot(world_direction, world_direction)));
    ray.near_origin = origin + mix(slack, width, is_parallel);
    ray.far_origin = origin - width;
    ray.far_scale = mix(1.0 / direction, vec3(1e30), is_parallel);
    ray.near_scale = ray.far_scale * NEAR_SLACK;
    ray.is_negative = lessThan(ray.far_scale, vec3(0.0));
    if (IS_PACKET) {
        uvec3 sign = uvec3(ray.is_negative);
        uint octant = subgroupShuffle(sign.x | sign.y << 1 | sign.z << 2, 0u);
        ray.order_lane = 28u % LANES + octant / 4u;
        ray.order_shift = 8u * (octant % 4u);
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

// The end of a ray that meets something: -1 where its numbers are not, or so large that boxes cannot be tested.
float usable_end(vec3 origin, vec3 direction, float t_max) {
    float size = dot(abs(origin) + abs(direction), vec3(1.0));
    return size < 1e37 ? smaller(t_max, FARTHEST) : -1.0;
}

// Nodes yet to visit, of the tree over instances and of a mesh's.
// They stand here and are no arguments: an array that is handed in and out is copied at each call, unless a compiler sees through it.
struct Stack {
    uint word[96];
    uint size;
};
Stack stacks[2];
const uint TOP = 0u;
const uint MESH = 1u;

// Of triangles at the same t the lowest of the lowest instance is met. Were it the first that is tried, what a ray meets would hang on the rays
// that walk along.
bool comes_first(float t, uint triangle, float t_max, uint nearest) {
    return t < t_max || triangle < nearest;
}

// The number before a positive one; of another, one that is not positive either.
float number_before(float positive) {
    return positive > 0.0 ? uintBitsToFloat(floatBitsToUint(positive) - 1u) : positive;
}

// Whether the ray goes through a triangle that it meets.
bool goes_through(uint triangle) {
    return HAS_HOLES && goes_through(scene, Hit(walked_instance, triangle), world_origin, world_direction);
}

uint leaf_first(uint leaf) {
    return leaf & (1u << BVH_LEAF_COUNT_SHIFT) - 1u;
}

uint leaf_count(uint leaf) {
    return (leaf >> BVH_LEAF_COUNT_SHIFT & 7u) + 1u;
}

#include "lib/walk_alone.glsl"
#include "lib/walk_packet.glsl"

// Visits an inner node of the tree over instances.
uint visit(BvhNodeArray nodes, BoxRay ray, float t_max, uint current) {
    if (IS_PACKET) {
        return visit_packet(nodes, ray, t_max, TOP, current);
    } else {
        return visit_alone(nodes, ray, t_max, TOP, current);
    }
}

// What to visit after an instance; nothing, where nobody who walks along wants more.
uint after_instance(bool wants_more) {
    if (IS_PACKET) {
        return nobody(wants_more) ? END : pop_packet(TOP);
    } else {
        return wants_more ? pop_alone(TOP) : END;
    }
}

// Shortens the ray to its nearest triangle of the mesh, or, where `any`, to t_max < 0 if it has one.
// Returns that triangle, or NO_HIT.
uint trace_mesh(MeshRecord mesh, vec3 origin, vec3 direction, bool any, inout float t_max) {
    BvhNodeArray nodes = mesh.nodes;
    LeafTriangleArray triangles = mesh.leaf_triangles;
    BoxRay box = box_ray(origin, direction);
    TriangleRay ray = triangle_ray(origin, direction);
    stacks[MESH].size = 0u;
    if (IS_PACKET) {
        return walk_packet(nodes, triangles, box, ray, any, t_max);
    } else {
        return walk_alone(nodes, triangles, box, ray, any, t_max);
    }
}

Hit trace(vec3 origin, vec3 direction, bool any, float t_max) {
    Hit hit = Hit(NO_HIT, 0u);
    t_max = usable_end(origin, direction, t_max);
    world_origin = origin;
    world_direction = direction;
    walked_instance = 0u;
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
        do {
            current = visit(nodes, box, t_max, current);
        } while ((current & BVH_LEAF) == 0u);
        while ((current & BVH_LEAF) != 0u && current != END) {
            uint index = leaf_first(current);
            mat4x3 to_object = scene.instances.at[index].world_to_object;
            vec3 object_origin = to_object * vec4(origin, 1.0);
            vec3 object_direction = mat3(to_object) * direction;
            float end = usable_end(object_origin, object_direction, index > hit.instance ? number_before(t_max) : t_max);
            MeshRecord mesh = MeshRecord(scene.meshes.at[scene.instances.at[index].mesh]);
            walked_instance = index;
            uint triangle = trace_mesh(mesh, object_origin, object_direction, any, end);
            if (triangle != NO_HIT) {
                hit = Hit(index, triangle);
                t_max = end;
            }
            current = after_instance(!any || t_max >= 0.0);
        }
    } while (current != END);
    return hit;
}

// The nearest triangle with 0 < t <= t_max.
Hit trace_closest(vec3 origin, vec3 direction, float t_max) {
    return trace(origin, direction, false, t_max);
}

// Whether any triangle has 0 < t <= t_max.
bool trace_any(vec3 origin, vec3 direction, float t_max) {
    return trace(origin, direction, true, t_max).instance != NO_HIT;
}

#endif
