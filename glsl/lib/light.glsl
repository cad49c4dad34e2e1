// Lights: emissive triangles, sky texels and the sun. Each of these kinds that there are has the same share of the samples, and its own are
// picked by power, through an alias table of their own. The densities have closed forms (src/scene/light.rs), so that neither a light nor a hit
// looks anything up to know them. Where more than a few triangles emit, their table has one entry for all of them, and a tree picks one.
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
const bool HAS_KINDS = uint(HAS_EMITTERS) + uint(HAS_UNEVEN_SKY) + uint(HAS_SUN) > 1u;

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
    uint emitter_entries;
    uint sky_entries;
    float emitter_density;
    float environment_density;
    float environment_floor;
    LightTree tree;
};

Lights lights_of(SceneTable scene) {
    return Lights(uvec2(scene.light_alias), uvec2(scene.emitters), HAS_LIGHT_TREE ? min(scene.emitter_count, 1u) : scene.emitter_count,
                  scene.environment_density > 0.0 ? scene.environment_size.x * scene.environment_size.y : 0u, scene.emitter_density, scene.environment_density,
                  scene.environment_floor, light_tree_of(scene));
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

struct PickedEntry {
    uint index;
    float rest;     // of the fraction that picked it, in [0, 1)
};

// Picks from the alias table of `count` entries that begins with the `first`. Where `count` is a power of two, a fraction of 32 bits leaves so many less
// of them to ask an entry whether it stays, which of the texels of a large sky would be a few: `finer` has what comes behind those bits.
PickedEntry pick_entry(Lights lights, uint first, uint count, uint fraction, uint finer) {
    uint index, rest, more, unused;
    umulExtended(fraction, count, index, rest);
    umulExtended(finer, count, more, unused);
    AliasRecord alias = AliasArray(lights.alias).at[first + index];
    float part = unit_interval(rest + more);
    bool stays = part < alias.keep;
    part = stays ? part / alias.keep : (part - alias.keep) / (1.0 - alias.keep);
    return PickedEntry(stays ? index : alias.alias, min(part, 1.0 - 6.0e-8));
}

// `u`: two 32-bit fractions. The first picks a kind of light by equal intervals, and what is left of it one of that kind and the place on it. So to each
// kind a well-spread sequence stays well spread, however many there are of the others.
LightSample sample_light(SceneTable scene, Lights lights, Receiver receiver, uvec2 u) {
    bool has_emitters = HAS_EMITTERS && (!HAS_KINDS || lights.emitter_density > 0.0);
    bool has_sky = HAS_UNEVEN_SKY && (!HAS_KINDS || lights.environment_density > 0.0);
    bool has_sun = HAS_SUN && scene.sun_probability > 0.0;
    uint kind = 0u;
    if (HAS_KINDS) {
        umulExtended(u.x, uint(has_emitters) + uint(has_sky) + uint(has_sun), kind, u.x);
    }
    bool takes_emitter = has_emitters && kind == 0u;
    bool takes_sky = has_sky && kind == uint(has_emitters);
    if (!takes_emitter && !takes_sky) {
        return LightSample(scene.sun_direction * scene.reach, vec3(0.0), scene.sun_irradiance, scene.sun_probability, true);
    }
    // What `unit_interval` leaves over of the second.
    uint finer = u.y << 24u;
    uint first = takes_sky ? lights.emitter_entries : 0u;
    PickedEntry picked = pick_entry(lights, first, takes_sky ? lights.sky_entries : lights.emitter_entries, u.x, finer);
    vec2 place = vec2(picked.rest, unit_interval(u.y));
    if (HAS_UNEVEN_SKY && takes_sky) {
        return sample_environment(scene, lights, picked.index, place);
    }
    return sample_emitter(scene, lights, picked.index, receiver, place);
}

#endif
