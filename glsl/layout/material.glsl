// What a kernel reads of a material. Mirrored by `render::MaterialRecord`.
#ifndef LAYOUT_MATERIAL_GLSL
#define LAYOUT_MATERIAL_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require

// `texture_index` of a material without a texture.
const uint NO_TEXTURE = 0xFFFFFFFFu;

// The lowest bits of `flags`. The shading kernel of a family is glsl/kernels/shade_X.comp, its BSDF glsl/lib/bsdf_X.glsl.
const uint MATERIAL_FAMILY_MASK = 15u;
const uint FAMILY_DIFFUSE = 0u;
const uint FAMILY_CONDUCTOR = 1u;
const uint FAMILY_DIELECTRIC = 2u;
const uint FAMILY_COATED = 3u;
const uint FAMILY_NBRDF = 4u;
const uint FAMILY_NEUBRDF = 5u;
const uint FAMILY_LAYERED = 6u;
const uint FAMILY_WOVEN = 7u;
const uint FAMILY_MERL = 8u;
const uint FAMILY_RGL = 9u;
const uint FAMILY_SPARSE = 10u;
// The others.
const uint MATERIAL_EMITS = 16u;            // `emission` is not black
const uint MATERIAL_EMITS_BOTH_SIDES = 32u; // from the back of its triangles too
const uint MATERIAL_COMPLEX_FRESNEL = 64u;  // a conductor by `eta` and `kappa`, not Schlick's with `color`

// From this bit on: which of the queues of its family takes a NeuBRDF.
const uint MATERIAL_PART_SHIFT = 8u;

// Some material has a map of its roughness.
layout(constant_id = 17) const bool HAS_ROUGHNESS_MAPS = false;

// Some material has patches of another one.
layout(constant_id = 19) const bool HAS_PATCHES = false;

// Rough surfaces have at least this α.
const float SMOOTH_ALPHA = 1e-4;

// How many entries a coat's table has.
const uint COAT_TABLE_LENGTH = 256u;
// For how many α, even in ⁴√α from 0 to 1, it has them where a map says how rough the coat is.
const uint COAT_TABLE_ROUGHNESSES = 65u;

// The albedo of a rough coat at cos θ = (i / (COAT_TABLE_LENGTH - 1))^4. Of all roughnesses: one after another, and then their averages.
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer CoatTable {
    float albedo[];
};

struct MaterialRecord {
    vec3 color;          // albedo, of the base if coated, or a conductor's reflectance at normal incidence
    uint texture_index;  // of the texture that multiplies `color`, or NO_TEXTURE
    vec3 eta;            // complex conductor: real part of the index of refraction
    uint flags;          // family and the bits above
    vec3 kappa;          // complex conductor: imaginary part
    float ior;           // dielectric: inside over outside; coat: its index; exactly 1 where there is no boundary
    vec3 emission;       // radiance
    float base_scale;    // coated: 1 / (1 - average albedo of the coat)
    vec2 alpha;          // GGX roughness along tangent and bitangent, 0 or >= SMOOTH_ALPHA; (0, 0) is perfectly smooth.
    uvec2 table;         // address of a CoatTable: coated with alpha > 0 or a roughness map; of a LobeTable: sampled by lib/lobe.glsl; else null
    float opacity;         // the probability with which a ray meets the surface,
    uint opacity_texture;  // times the red of that texture, or NO_TEXTURE
    uint normal_map;       // index of a texture of shading normals, or NO_TEXTURE
    uint roughness_map;    // index of a texture of the roughness that alpha is the square of, along tangent and bitangent, or NO_TEXTURE
    uint emission_texture; // index of a texture that multiplies `emission`, or NO_TEXTURE
    uint patch_map;        // index of a texture, or NO_TEXTURE: where its red is at least a half,
    uint patch_material;   // this material stands instead
    uint anisotropy_direction_map; // index of a texture of cos 2ψ and sin 2ψ, or NO_TEXTURE: the tangent turns by ψ, from u towards v
};

uint material_family(uint flags) {
    return flags & MATERIAL_FAMILY_MASK;
}

bool has_roughness_map(MaterialRecord material) {
    return HAS_ROUGHNESS_MAPS && material.roughness_map != NO_TEXTURE;
}

#endif
