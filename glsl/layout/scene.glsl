// What a scene is on the device: one table of pointers, null where the scene has no such thing.
#ifndef LAYOUT_SCENE
#define LAYOUT_SCENE

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

#include "layout/geometry.glsl"
#include "layout/material.glsl"

// A triangle that emits, in world space: corner + u·edge_u + v·edge_v; its front is along edge_u × edge_v.
struct EmitterRecord {
    vec3 corner;
    vec3 edge_u;
    vec3 edge_v;
    vec3 emission;
    uint emits_both_sides;
    uint emission_texture;   // index of a texture that multiplies `emission`, at uv + u·uv_u + v·uv_v, or NO_TEXTURE;
    float brightness;        // then the luminance that the triangle is sampled by
    vec2 uv;
    vec2 uv_u;
    vec2 uv_v;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer EmitterArray {
    EmitterRecord at[];
};

// A node of the tree that picks an emitter; pairs of siblings stand side by side, the root's children first.
struct LightNodeRecord {
    vec3 center;             // where their power is on average; of a sphere around them
    float radius;
    uint axis;               // octahedral, snorm 2 x 16: the direction that they face on average by power
    uint spread_deviation;   // snorm 2 x 16: cosine of the greatest angle between the axis and one of these; root mean square distance
                             // from the center by power, as a part of the radius
    float power;
    uint child;              // the first of a pair, or LIGHT_LEAF | index of an emitter
};
const uint LIGHT_LEAF = 1u << 31;
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer LightNodeArray {
    LightNodeRecord at[];
};

// Where the tree has an emitter, of each in ascending order of (instance, triangle).
struct EmitterLeafRecord {
    uint instance;
    uint triangle;
    uint node;
    float density;   // per area, of a point on the triangle once the tree has picked it; times the share of the samples that emitters get
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer EmitterLeafArray {
    EmitterLeafRecord at[];
};

// Walker's alias method: an entry keeps with probability `keep`, otherwise gives way to entry `alias`.
struct AliasRecord {
    float keep;
    uint alias;
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer AliasArray {
    AliasRecord at[];
};

// Linear RGB texels; half precision, two a word, with a fourth number that is not used.
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer TexelArray {
    uvec2 at[];
};
struct TextureRecord {
    uvec2 texels;   // a TexelArray; SwiftShader's compiler dies of copies of structs that hold references
    uint width;
    uint height;
    vec2 scale;     // at uv it is looked up at offset + scale * uv
    vec2 offset;
};
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer TextureArray {
    TextureRecord at[];
};

// Radiances of a lat-long sky, row by row from the zenith.
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer RadianceArray {
    vec3 at[];
};

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer MaterialArray {
    MaterialRecord at[];
};

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer SceneTable {
    InstanceArray instances;
    MeshArray meshes;
    BvhNodeArray nodes;          // the tree over instances
    MaterialArray materials;
    TextureArray textures;
    AliasArray light_alias;      // of emitters (of those that a tree picks, one entry for all), and behind it of sky texels
    EmitterArray emitters;
    RadianceArray environment;
    LightNodeArray light_nodes;
    WordArray light_parents;     // of each pair of nodes, the node above
    EmitterLeafArray emitter_leaves;
    uint emitter_count;
    uvec2 environment_size;      // texels around, texels from zenith to nadir
    vec2 environment_rotation;   // cos and sin of the sky's turn about +y
    float emitter_density;       // times Y(emission) and sides: density per area of a point on an emitter
    float environment_density;   // times what Y(radiance) has above the floor: density per solid angle of a direction to the sky
    float environment_floor;
    float sun_probability;
    vec3 sun_direction;
    vec3 sun_irradiance;
    float reach;                 // longer than any chord of the scene
};

#endif
