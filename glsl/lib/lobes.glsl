// What samples a BRDF without a sampler of its own: one of two anisotropic GGX lobes of visible normals, or a cosine hemisphere.
// Definition: src/material/lobe_sampled.rs.
#ifndef LIB_LOBES_GLSL
#define LIB_LOBES_GLSL

#include "lib/ggx.glsl"
#include "lib/hemisphere.glsl"

// A BRDF's lobes in memory are pairs of numbers: GGX α of the first lobe along tangent and bitangent, of the second one; then the
// probability of each at cos θo = i / (LOBE_NODES - 1).
const uint LOBE_NODES = 16u;
const uint LOBE_BYTES = 16u + 8u * LOBE_NODES;

// As seen from one direction.
struct Lobes {
    vec4 alpha;
    vec2 weights;    // the probabilities; the rest is the hemisphere's
};

// Between which two pairs the probabilities at a cosine lie: the first one, and how far to the second.
struct LobePlace {
    uint pair;
    float fraction;
};

LobePlace lobe_place(float cosine) {
    float position = clamp(cosine, 0.0, 1.0) * float(LOBE_NODES - 1u);
    uint cell = min(uint(position), LOBE_NODES - 2u);
    return LobePlace(2u + cell, position - float(cell));
}

// The density of a direction, of which h is the half vector, of any length.
float lobes_pdf(Lobes lobes, vec3 wo, vec3 wi, vec3 h) {
    vec2 distribution = vec2(ggx_distribution(h, lobes.alpha.xy), ggx_distribution(h, lobes.alpha.zw));
    vec2 stretch = vec2(ggx_stretch(wo, lobes.alpha.xy), ggx_stretch(wo, lobes.alpha.zw));
    float of_lobes = dot(lobes.weights, 0.5 * distribution / (wo.z + stretch));
    return both_above(wo, wi) ? of_lobes + (1.0 - lobes.weights.x - lobes.weights.y) * wi.z * INV_PI : 0.0;
}

// A direction and its density, 0 where there is none.
vec4 lobes_sample(Lobes lobes, vec3 wo, vec3 u) {
    vec3 wi, h;
    if (u.z < lobes.weights.x + lobes.weights.y) {
        // wo + wi would no longer tell where in a narrow lobe the facet is.
        vec2 alpha = u.z < lobes.weights.x ? lobes.alpha.xy : lobes.alpha.zw;
        h = ggx_sample(vec3(wo.xy, max(wo.z, MIN_COSINE)), alpha, u.xy);
        wi = normalize(2.0 * dot(wo, h) * h - wo);
    } else {
        wi = sample_cosine_hemisphere(u.xy);
        h = wo + wi;
    }
    return vec4(wi, lobes_pdf(lobes, wo, wi, h));
}

#endif
