// Meshes, their instances, and the trees over both. Pointers are null where there is no such thing.
#ifndef LAYOUT_GEOMETRY
#define LAYOUT_GEOMETRY

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require

// More than one instance, or one that is not where its mesh is.
layout(constant_id = 7) const bool INSTANCED = true;

const uint NO_HIT = 0xffffffffu;
const float INFINITY = 1.0 / 0.0;

layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Vec3Array { vec3 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Vec2Array { vec2 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer UVec3Array { uvec3 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer WordArray { uint at[]; };

// One step of a walk through a tree: the boxes of four children, each bound of the four beside one another.
struct BvhNode {
    vec4 lower_x;
    vec4 upper_x;
    vec4 lower_y;
    vec4 upper_y;
    vec4 lower_z;
    vec4 upper_z;
    uvec4 child;    // an inner node's index, or LEAF | (count - 1) << LEAF_COUNT_SHIFT | first primitive
    uvec2 order;    // a byte for each octant of directions: the children from near to far, two bits each
    uvec2 padding;
};
const uint BVH_NODE_WORDS = 32u;
const uint BVH_LEAF = 1u << 31;
const uint BVH_LEAF_COUNT_SHIFT = 28u;
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer BvhNodeArray { BvhNode at[]; };

// A triangle as the leaves of its mesh's tree keep it.
struct LeafTriangle {
    vec3 corner_0;
    vec3 corner_1;
    vec3 corner_2;
    uint triangle;
};
const uint LEAF_TRIANGLE_WORDS = 10u;
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer LeafTriangleArray { LeafTriangle at[]; };

// A reference, not a struct: SwiftShader's compiler dies of copies of structs that hold references.
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer MeshRecord {
    Vec3Array positions;
    Vec3Array normals;
    Vec2Array uvs;
    UVec3Array indices;
    WordArray materials;                // one a triangle; null where `material` is that of all
    BvhNodeArray nodes;                 // these two are null where ray query traces
    LeafTriangleArray leaf_triangles;
    uint material;
    uint padding;
};
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer MeshArray {
    uvec2 at[];    // each a MeshRecord: an unsized array of references makes glslang ask for descriptor arrays
};

struct InstanceRecord {
    mat4x3 object_to_world;
    mat4x3 world_to_object;
    uint mesh;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer InstanceArray { InstanceRecord at[]; };

// What a ray hit; t, u and v are computed anew by lib/triangle.glsl, to the same bits whatever found it.
struct Hit {
    uint instance;    // NO_HIT where there is nothing
    uint triangle;
};

// Beside the triangle that a path has hit: it is met in a patch of another material. Triangles are fewer (src/render/bvh.rs).
const uint IN_PATCH = 1u << 31;

bool has_normals(MeshRecord mesh) {
    return uvec2(mesh.normals) != uvec2(0);
}

bool has_uvs(MeshRecord mesh) {
    return uvec2(mesh.uvs) != uvec2(0);
}

uint material_of(MeshRecord mesh, uint triangle) {
    return uvec2(mesh.materials) != uvec2(0) ? mesh.materials.at[triangle] : mesh.material;
}

#endif
