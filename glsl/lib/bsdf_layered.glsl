// A rough dielectric coat, which absorbs, over a metal or a diffuse base, by a random walk between the two: src/material/layered.rs.
#ifndef LIB_BSDF_LAYERED_GLSL
#define LIB_BSDF_LAYERED_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "lib/conductor.glsl"
#include "lib/dielectric.glsl"
#include "lib/lobe_table.glsl"
#include "lib/pcg.glsl"

const uint LAYERED_DIFFUSE = 0u;
const uint LAYERED_SCHLICK = 1u;
const uint LAYERED_COMPLEX = 2u;

const uint LAYERED_MOST_BOUNCES = 64u;
const uint LAYERED_ROULETTE_AFTER = 4u;

// Written by src/render/brdf_table.rs.
struct LayeredRecord {
    float ior;         // of the coat
    float alpha;
    vec2 base_alpha;
    vec3 absorption;
    uint base;         // LAYERED_DIFFUSE, …
    vec3 color;        // albedo, or reflectance at normal incidence
    vec3 eta;
    vec3 kappa;
};

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer LayeredTable {
    LayeredRecord at[];
};

#define Brdf LayeredRecord

Brdf brdf_make(MaterialRecord material) {
    return LayeredTable(lobe_brdf_data(material)).at[0];
}

// Random numbers from a hash of what they are for.
struct Hashed {
    uvec3 key;
    uint count;
};

vec3 next_units(inout Hashed random) {
    random.count += 1u;
    uvec3 bits = pcg3d(random.key + random.count * uvec3(0x9e3779b9u, 0x85ebca6bu, 0xc2b2ae35u));
    return vec3(bits >> 8u) * (1.0 / 16777216.0);
}

Conductor layered_metal(Brdf b) {
    return Conductor(b.color, b.eta, b.kappa, b.base == LAYERED_COMPLEX, b.base_alpha);
}

vec4 base_eval_pdf(Brdf b, vec3 wo, vec3 wi) {
    if (b.base != LAYERED_DIFFUSE) return conductor_eval_pdf(layered_metal(b), wo, wi);
    return min(wo.z, wi.z) < MIN_COSINE ? vec4(0.0) : INV_PI * vec4(b.color, wi.z);
}

BsdfSample base_sample(Brdf b, vec3 wo, vec3 u) {
    if (b.base != LAYERED_DIFFUSE) return conductor_sample(layered_metal(b), wo, u);
    vec3 wi = sample_cosine_hemisphere(u.xy);
    if (min(wo.z, wi.z) < MIN_COSINE) return bsdf_no_sample();
    return BsdfSample(wi, wi.z * INV_PI, b.color, false);
}

// What is left of light that crosses the coat along w.
vec3 transmittance(Brdf b, vec3 w) {
    return exp(-b.absorption / abs(w.z));
}

bool goes_down(BsdfSample sampled) {
    return sampled.pdf > 0.0 && sampled.wi.z < 0.0;
}

vec3 layered_eval(Brdf b, vec3 wo, vec3 wi) {
    vec3 sum = dielectric_eval_pdf(b.ior, b.alpha, wo, wi).rgb;
    Hashed random = Hashed(pcg3d(pcg3d(floatBitsToUint(wo)) ^ floatBitsToUint(wi)), 0u);
    float compression = b.ior * b.ior;
    BsdfSample entry = dielectric_sample(b.ior, b.alpha, wo, next_units(random));
    if (!goes_down(entry)) return sum;
    vec3 throughput = entry.weight;
    vec3 down = entry.wi;
    [[dont_unroll]] for (uint bounce = 0u; bounce < LAYERED_MOST_BOUNCES; ++bounce) {
        throughput *= transmittance(b, down);
        BsdfSample exit = dielectric_sample(b.ior, b.alpha, wi, next_units(random));
        if (goes_down(exit)) {
            vec4 base = base_eval_pdf(b, -down, -exit.wi);
            float share = exit.pdf / (exit.pdf + base.a);
            sum += throughput * transmittance(b, exit.wi) * base.rgb * exit.weight * (compression * share);
        }
        BsdfSample next = base_sample(b, -down, next_units(random));
        if (!(next.pdf > 0.0)) break;
        throughput *= next.weight * transmittance(b, next.wi);
        float exit_pdf = dielectric_eval_pdf(b.ior, b.alpha, wi, -next.wi).a;
        vec3 leaves = dielectric_eval_pdf(b.ior, b.alpha, -next.wi, wi).rgb;
        sum += throughput * leaves * (next.pdf / (next.pdf + exit_pdf));

        BsdfSample back = dielectric_sample(b.ior, b.alpha, -next.wi, next_units(random));
        if (!goes_down(back)) break;
        throughput *= back.weight;
        down = back.wi;
        if (bounce >= LAYERED_ROULETTE_AFTER) {
            float survival = min(compression * max(throughput.r, max(throughput.g, throughput.b)), 1.0);
            if (next_units(random).x >= survival) break;
            throughput /= survival;
        }
    }
    return sum;
}

// One after the other: a walk is too much code to have twice.
void brdf_eval_pair(Brdf b, vec3 wo, vec3 wi_1, vec3 wi_2, out vec3 f_1, out vec3 f_2) {
    f_1 = f_2 = vec3(0.0);
    [[dont_unroll]] for (uint i = 0u; i < 2u; ++i) {
        f_1 = f_2;
        f_2 = layered_eval(b, wo, i == 0u ? wi_1 : wi_2);
    }
}

#include "lib/lobe.glsl"

#endif
