// One vertex of each queued path: emission, a light sample, a BSDF sample, Russian roulette. Included behind a family's BSDF and
// the family's number, FAMILY.
#ifndef LIB_PASS_SHADE
#define LIB_PASS_SHADE

#include "lib/bsdf.glsl"
#include "lib/light.glsl"
#include "lib/queue.glsl"
#include "lib/sampler.glsl"
#include "lib/surface.glsl"
#include "lib/texture.glsl"

// Bounces that always survive.
const uint ROULETTE_AFTER = 3u;

// Radiance that the surface itself sends along wo, weighted against the light sample that could have found it.
vec3 emitted(Surface surface, MaterialRecord material, vec3 wo, float bsdf_pdf) {
    float cosine = dot(wo, surface.front);
    bool both_sides = (material.flags & MATERIAL_EMITS_BOTH_SIDES) != 0u;
    if ((material.flags & MATERIAL_EMITS) == 0u || (cosine <= 0.0 && !both_sides)) {
        return vec3(0.0);
    }
    if (bsdf_pdf == 0.0) {
        return material.emission;
    }
    float pdf = emitter_pdf(scene, material.emission, both_sides, surface.distance_squared, abs(cosine));
    return material.emission * mis_weight(bsdf_pdf, pdf);
}

struct ShadowRay {
    vec3 origin;
    vec3 to_light;
    vec3 contribution;   // 0: not worth tracing
};

ShadowRay light_sample(Surface surface, Bsdf bsdf, vec3 wo, vec3 throughput, SampleKey key, uint dimension) {
    uvec2 pick = sample_bits(key, dimension + DIMENSION_LIGHT_PICK);
    vec2 point = sample_2d(key, dimension + DIMENSION_LIGHT_POINT);
    LightSample light = sample_light(scene, surface.position, pick, point);
    vec3 wi = normalize(light.to_light);
    vec3 local_wi = frame_to_local(surface.frame, wi);
    ShadowRay ray = ShadowRay(vec3(0.0), vec3(0.0), vec3(0.0));
    if (light.pdf > 0.0 && frame_is_consistent(surface.frame, wi, local_wi)) {
        vec4 value = bsdf_eval_pdf(bsdf, wo, local_wi);
        float weight = light.is_delta ? 1.0 : mis_weight(light.pdf, value.a);
        ray.contribution = throughput * value.rgb * light.radiance * (abs(local_wi.z) * weight / light.pdf);
        ray.origin = leave(surface, wi);
        ray.to_light = light.to_light + (surface.position - ray.origin);
    }
    return ray;
}

void pass_shade() {
    uint place = gl_GlobalInvocationID.x;
    bool has_path = place < queue_length(bounce, QUEUE_SHADE + FAMILY);
    uint slot = 0u;
    bool goes_on = false;
    ShadowRay shadow = ShadowRay(vec3(0.0), vec3(0.0), vec3(0.0));
    if (has_path) {
        slot = queue_slot(QUEUE_SHADE + FAMILY, place);
        vec4 origin = pool.origin.at[slot];
        vec3 direction = pool.direction.at[slot].xyz;
        vec3 throughput = pool.throughput.at[slot].rgb;
        uvec2 hit = pool.hit.at[slot];
        Surface surface = surface_at(scene, Hit(hit.x, hit.y), origin.xyz, direction, FAMILY != FAMILY_DIELECTRIC);
        MaterialRecord material = scene.materials.at[surface.material];
        if (HAS_EMITTERS) {
            vec3 emission = emitted(surface, material, -direction, origin.w);
            if (emission != vec3(0.0)) {
                pool.radiance.at[slot].rgb += throughput * emission;
            }
        }
        if (bounce + 1u < max_depth) {
            SampleKey key = SampleKey(pool.key.at[slot].x, pool.key.at[slot].y);
            uint dimension = bounce * DIMENSIONS_PER_BOUNCE;
            vec3 wo = frame_to_local(surface.frame, -direction);
            Bsdf bsdf = bsdf_make(material, material_color(scene, material, surface.uv));
            bool samples_light = HAS_LIGHTS && !bsdf_is_delta(bsdf);
            if (samples_light) {
                shadow = light_sample(surface, bsdf, wo, throughput, key, dimension);
            }
            vec2 lobe_roulette = sample_2d(key, dimension + DIMENSION_LOBE_ROULETTE);
            BsdfSample next = bsdf_sample(bsdf, wo, vec3(sample_2d(key, dimension + DIMENSION_BSDF), lobe_roulette.x));
            vec3 wi = frame_to_world(surface.frame, next.wi);
            throughput *= next.weight;
            float survival = bounce < ROULETTE_AFTER ? 1.0 : min(1.0, max(throughput.r, max(throughput.g, throughput.b)));
            goes_on = next.pdf > 0.0 && lobe_roulette.y < survival && frame_is_consistent(surface.frame, wi, next.wi);
            if (goes_on) {
                pool.origin.at[slot] = vec4(leave(surface, wi), next.is_delta ? 0.0 : next.pdf);
                pool.direction.at[slot].xyz = wi;
                pool.throughput.at[slot].rgb = throughput / survival;
            }
        }
    }
    queue_push(bounce + 1u, QUEUE_TRACE, goes_on, slot);
    bool lit = shadow.contribution != vec3(0.0);
    uint shadow_place = queue_reserve(bounce, QUEUE_SHADOW, lit);
    if (lit) {
        pool.shadow_origin.at[shadow_place] = vec4(shadow.origin, shadow.contribution.r);
        pool.shadow_direction.at[shadow_place] = vec4(shadow.to_light, shadow.contribution.g);
        pool.shadow_path.at[shadow_place] = uvec2(slot, floatBitsToUint(shadow.contribution.b));
    }
}

#endif
