// Textures: bilinear, repeated in both directions (src/scene/texture.rs).
#ifndef LIB_TEXTURE
#define LIB_TEXTURE

#include "layout/scene.glsl"

layout(constant_id = 6) const bool HAS_TEXTURES = false;

vec3 texel(TextureRecord image, ivec2 place) {
    ivec2 size = ivec2(image.width, image.height);
    // At most one step outside.
    place += ivec2(lessThan(place, ivec2(0))) * size;
    place -= ivec2(greaterThanEqual(place, size)) * size;
    // Coordinates that are no numbers end at some texel, too.
    place = clamp(place, ivec2(0), size - 1);
    uvec2 packed = TexelArray(image.texels).at[uint(place.y) * image.width + uint(place.x)];
    return vec3(unpackHalf2x16(packed.x), unpackHalf2x16(packed.y).x);
}

vec3 texture_color(TextureRecord image, vec2 uv) {
    uv = image.offset + image.scale * uv;
    vec2 wrapped = uv - floor(uv);
    vec2 position = vec2(wrapped.x, 1.0 - wrapped.y) * vec2(image.width, image.height) - 0.5;
    vec2 corner = floor(position);
    vec2 share = position - corner;
    ivec2 place = ivec2(corner);
    vec3 upper = mix(texel(image, place), texel(image, place + ivec2(1, 0)), share.x);
    vec3 lower = mix(texel(image, place + ivec2(0, 1)), texel(image, place + ivec2(1, 1)), share.x);
    return mix(upper, lower, share.y);
}

// The same of a map of normals: x along the surface's u, y along its v, from -1 (0 in the texture) to 1, also where it is mirrored.
vec3 texture_normal(TextureRecord image, vec2 uv) {
    vec3 color = texture_color(image, uv);
    return vec3(mix(color.xy, 1.0 - color.xy, lessThan(image.scale, vec2(0.0))), color.z);
}

// The same of directions, as cos 2ψ and sin 2ψ of their angle from the surface's u towards its v, also where it is mirrored.
vec2 texture_doubled_angle(TextureRecord image, vec2 uv) {
    vec2 doubled = texture_color(image, uv).xy;
    return image.scale.x * image.scale.y < 0.0 ? vec2(doubled.x, -doubled.y) : doubled;
}

// A material's colour, times its texture if it has one.
vec3 material_color(SceneTable scene, MaterialRecord material, vec2 uv) {
    if (!HAS_TEXTURES || material.texture_index == NO_TEXTURE) {
        return material.color;
    }
    return material.color * texture_color(scene.textures.at[material.texture_index], uv);
}

// The mean of a texture in the middle of a triangle and half-way from there to its corners: `texture_mean` of src/scene/light.rs.
vec3 texture_mean(TextureRecord image, vec2 a, vec2 b, vec2 c) {
    vec2 middle = (a + b + c) / 3.0;
    vec3 sum = texture_color(image, middle);
    sum += texture_color(image, 0.5 * (middle + a));
    sum += texture_color(image, 0.5 * (middle + b));
    sum += texture_color(image, 0.5 * (middle + c));
    return 0.25 * sum;
}

// Its roughness where a map gives it: `Bsdf::of_roughness` of src/material/mod.rs.
vec2 material_alpha(SceneTable scene, MaterialRecord material, vec2 uv) {
    if (!has_roughness_map(material)) {
        return material.alpha;
    }
    vec2 roughness = clamp(texture_color(scene.textures.at[material.roughness_map], uv).xy, 0.0, 1.0);
    vec2 alpha = roughness * roughness;
    if (material_family(material.flags) != FAMILY_CONDUCTOR) {
        alpha = vec2(0.5 * (alpha.x + alpha.y));
    }
    return max(alpha.x, alpha.y) < SMOOTH_ALPHA ? vec2(0.0) : max(alpha, SMOOTH_ALPHA);
}

#endif
