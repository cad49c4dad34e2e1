// Lights: emissive triangles, sky texels and the sun, through one alias table. Each of these kinds has the same share of the
// samples and is picked from by power. The densities have closed forms (src/scene/light.rs), so that neither a light nor a hit
// looks anything up to know them. Where more than a few triangles emit, the table has one entry for all of them, and a tree picks one.
#ifndef LIB_LIGHT
#define LIB_LIGHT

#include "layout/scene.glsl"
#include "lib/circle.glsl"
#include "lib/light_tree.glsl"
#include "lib/sampler.glsl"
#include "lib/texture.glsl"

layout(constant_id = 2) const bool HAS_EMITTERS = false;
layout(constant_id = 3) const bool HAS_ENVIRONMENT = false;
layout(constant_id = 33) const bool HAS_UNEVEN_SKY = false;      // an even one is left to the BSDF's samples
layout(constant_id = 4) const bool HAS_SUN = false;
layout(constant_id = 18) const bool HAS_EMISSION_MAPS = false;   // some emitter's emission is by a texture

const bool HAS_LIGHTS = HAS_EMITTERS || HAS_UNEVEN_SKY || HAS_SUN;

struct LightSample {
    vec3 to_light;   // from the shading point to the light, or just beyond the scene
    vec3 gap;        // from there to where a shadow ray ends: just short of an emitter, on the side that it is seen from
    vec3 radiance;   // for the sun: irradiance
    float pdf;       // per unit solid angle; for the sun: the probability of having picked it. 0: no light here
    bool is_delta;
};

// What a light sample needs to know of the scene. Read it before control flow begins: there, CPU drivers read an address that
// all lanes share once for each lane.
struct Lights {
    uvec2 alias;       // an AliasArray; structs do not hold references (layout/scene.glsl)
    uvec2 emitters;    // an EmitterArray
    uint count;
    uint emitter_entries;
    float emitter_density;
    float environment_density;
    float environment_floor;
    LightTree tree;
};

Lights lights_of(SceneTable scene) {
    return Lights(uvec2(scene.light_alias), uvec2(scene.emitters), scene.light_count, HAS_LIGHT_TREE ? min(scene.emitter_count, 1u) : scene.emitter_count,
                  scene.emitter_density, scene.environment_density, scene.environment_floor, light_tree_of(scene));
}

// To the bit what src/scene/light.rs computes, as small differences of it become densities.
float luminance(vec3 color) {
    precise float sum = (color.r * 0.2126 + color.g * 0.7152) + color.b * 0.0722;
    return sum;
}

// Power heuristic (Veach 1997), exponent 2.
float mis_weight(float pdf, float other_pdf) {
    float ratio = other_pdf / pdf;
    return 1.0 / (1.0 + ratio * ratio);
}

// Density per area with which an emitter of that mean luminance is light-sampled by power.
float emitter_density(Lights lights, float brightness, bool both_sides) {
    return lights.emitter_density * brightness * (both_sides ? 2.0 : 1.0);
}

// The same of one that a tree picks, for a receiver. Triangles of no mean luminance are not sampled.
float emitter_density(Lights lights, Hit hit, Receiver receiver) {
    uint leaf = light_tree_leaf(lights.tree, hit.instance, hit.triangle);
    if (leaf == lights.tree.leaf_count) {
        return 0.0;
    }
    EmitterLeafRecord emitter = EmitterLeafArray(lights.tree.leaves).at[leaf];
    return emitter.density * light_tree_probability(lights.tree, receiver, emitter.node);
}

float environment_pdf(Lights lights, vec3 radiance) {
    return lights.environment_density * max(luminance(radiance) - lights.environment_floor, 0.0);
}

vec3 environment_radiance(SceneTable scene, vec3 direction) {
    vec2 turn = scene.environment_rotation;
    vec3 d = vec3(turn.x * direction.x - turn.y * direction.z, direction.y, turn.y * direction.x + turn.x * direction.z);
    vec2 size = vec2(scene.environment_size);
    float u = turn_of(d.x, -d.z) + 0.5;
    float v = 2.0 * turn_of(length(d.xz), d.y);
    uvec2 texel = min(uvec2(vec2(u, v) * size), scene.environment_size - 1u);
    return scene.environment.at[texel.y * scene.environment_size.x + texel.x];
}

// A direction to a sky texel, uniform over its solid angle: in azimuth and in the cosine of the polar angle.
LightSample sample_environment(SceneTable scene, Lights lights, uint texel, vec2 u) {
    uint row = texel / scene.environment_size.x;
    uint column = texel - row * scene.environment_size.x;
    float row_turn = 0.5 / float(scene.environment_size.y);
    float cos_theta = mix(unit_circle(float(row) * row_turn).x, unit_circle(float(row + 1u) * row_turn).x, u.y);
    float sin_theta = sqrt(max(0.0, 1.0 - cos_theta * cos_theta));
    // The azimuth starts behind, at half a turn.
    vec2 azimuth = -unit_circle((float(column) + u.x) / float(scene.environment_size.x));
    vec3 d = vec3(sin_theta * azimuth.y, cos_theta, -sin_theta * azimuth.x);
    vec2 turn = scene.environment_rotation;
    vec3 direction = vec3(turn.x * d.x + turn.y * d.z, d.y, turn.x * d.z - turn.y * d.x);
    vec3 radiance = scene.environment.at[texel];
    return LightSample(direction * scene.reach, vec3(0.0), radiance, environment_pdf(lights, radiance), false);
}

// `index`: of an emitter, or, where a tree picks it, nothing.
LightSample sample_emitter(SceneTable scene, Lights lights, uint index, Receiver receiver, vec2 u) {
    float probability = 1.0;
    if (HAS_LIGHT_TREE) {
        PickedEmitter picked = light_tree_pick(lights.tree, receiver, u.x);
        index = picked.index;
        probability = picked.probability;
        u.x = picked.rest;
    }
    EmitterRecord emitter = EmitterArray(lights.emitters).at[index];
    float root = sqrt(u.x);
    vec2 place = root * vec2(1.0 - u.y, u.y);
    vec3 point = emitter.corner + place.x * emitter.edge_u + place.y * emitter.edge_v;
    vec3 emission = emitter.emission;
    float brightness = luminance(emission);
    if (HAS_EMISSION_MAPS && emitter.emission_texture != NO_TEXTURE) {
        vec2 uv = emitter.uv + place.x * emitter.uv_u + place.y * emitter.uv_v;
        emission *= texture_color(scene.textures.at[emitter.emission_texture], uv);
        brightness = emitter.brightness;
    }
    vec3 to_light = point - receiver.point;
    vec3 normal = cross(emitter.edge_u, emitter.edge_v);
    float distance_squared = dot(to_light, to_light);
    // Each by itself: of a dome ten kilometres wide, in millimetres, the product is no f32.
    float facing = -dot(normal, to_light) / (sqrt(dot(normal, normal)) * sqrt(distance_squared));
    bool both_sides = emitter.emits_both_sides != 0u;
    float cosine = both_sides ? abs(facing) : facing;
    bool lit = cosine > 0.0 && distance_squared > 0.0;
    float density = HAS_LIGHT_TREE ? probability * EmitterLeafArray(lights.tree.leaves).at[index].density
                                   : emitter_density(lights, brightness, both_sides);
    float pdf = lit ? density * distance_squared / cosine : 0.0;
    float gap = 4.0e-6 * (abs(point.x) + abs(point.y) + abs(point.z));
    vec3 off = normal * (inversesqrt(dot(normal, normal)) * gap);
    return LightSample(to_light, facing > 0.0 ? off : -off, emission, pdf, false);
}

// `u`: two 32-bit fractions. The first picks the table's entry, and what is left of it serves again for the place on the light,
// which keeps a well-spread sequence well spread.
LightSample sample_light(SceneTable scene, Lights lights, Receiver receiver, uvec2 u) {
    uint index, rest;
    umulExtended(u.x, lights.count, index, rest);
    AliasRecord alias = AliasArray(lights.alias).at[index];
    float fraction = unit_interval(rest);
    bool keeps = fraction < alias.keep;
    index = keeps ? index : alias.alias;
    fraction = keeps ? fraction / alias.keep : (fraction - alias.keep) / (1.0 - alias.keep);
    vec2 place = vec2(min(fraction, 1.0 - 6.0e-8), unit_interval(u.y));
    if (HAS_EMITTERS && index < lights.emitter_entries) {
        return sample_emitter(scene, lights, index, receiver, place);
    }
    if (HAS_UNEVEN_SKY && !(HAS_SUN && index == lights.count - 1u)) {
        return sample_environment(scene, lights, index - lights.emitter_entries, place);
    }
    return LightSample(scene.sun_direction * scene.reach, vec3(0.0), scene.sun_irradiance, scene.sun_probability, true);
}

#endif
