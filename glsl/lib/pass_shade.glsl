// One vertex of each queued path: emission, a light sample, a BSDF sample, Russian roulette. Included behind a family's BSDF and
// the family's number, FAMILY.
#ifndef LIB_PASS_SHADE
#define LIB_PASS_SHADE

#include "lib/bsdf.glsl"
#include "lib/clamp.glsl"
#include "lib/footprint.glsl"
#include "lib/light.glsl"
#include "lib/queue.glsl"
#include "lib/reuse.glsl"
#include "lib/sampler.glsl"
#include "lib/strategy.glsl"
#include "lib/surface.glsl"
#include "lib/texture.glsl"

// Bounces that always survive.
layout(constant_id = 27) const uint ROULETTE_AFTER = 3u;

// Radiance that the surface itself sends along wo to a receiver, weighted against the light sample that could have found it from there.
vec3 emitted(Lights lights, Surface surface, Hit hit, MaterialRecord material, vec3 wo, Receiver receiver, float bsdf_pdf) {
    float cosine = dot(wo, surface.front);
    bool both_sides = (material.flags & MATERIAL_EMITS_BOTH_SIDES) != 0u;
    if ((material.flags & MATERIAL_EMITS) == 0u || (cosine <= 0.0 && !both_sides)) {
        return vec3(0.0);
    }
    vec3 emission = material.emission;
    bool by_texture = HAS_EMISSION_MAPS && material.emission_texture != NO_TEXTURE;
    if (by_texture) {
        emission *= texture_color(scene.textures.at[material.emission_texture], surface.uv);
    }
    if (bsdf_pdf == 0.0) {
        return emission;
    }
    float density;
    if (HAS_LIGHT_TREE) {
        density = emitter_density(lights, hit, receiver);
    } else {
        vec3 mean = material.emission;
        if (by_texture) {
            vec2 uv = surface.uv_corner;
            mean *= texture_mean(scene.textures.at[material.emission_texture], uv, uv + surface.uv_edge_1, uv + surface.uv_edge_2);
        }
        density = emitter_density(lights, luminance(mean), both_sides);
    }
    return emission * mis_weight(bsdf_pdf, density * surface.distance_squared / abs(cosine));
}

struct ShadowRay {
    vec3 origin;
    vec3 to_light;
    vec3 contribution;   // 0: not worth tracing
};

// A light that has been picked, seen from the surface.
struct Lit {
    LightSample light;
    vec3 wi;         // world space
    vec3 local_wi;
    bool counts;
};

Lit light_sample(Lights lights, Surface surface, uint packed_normal, SampleKey key, uint dimension) {
    Receiver receiver = receiver_at(surface.position, packed_normal);
    LightSample light = sample_light(scene, lights, receiver, sample_bits(key, dimension + DIMENSION_LIGHT));
    vec3 wi = normalize(light.to_light);
    vec3 local_wi = frame_to_local(surface.frame, wi);
    return Lit(light, wi, local_wi, light.pdf > 0.0 && frame_is_consistent(surface.frame, wi, local_wi));
}

// The ray to a light that counts, where f and pdf of the BSDF are `value`.
ShadowRay shadow_ray(Surface surface, Lit lit, vec4 value, vec3 throughput) {
    float weight = lit.light.is_delta ? 1.0 : mis_weight(lit.light.pdf, value.a);
    ShadowRay ray;
    vec3 contribution = throughput * value.rgb * lit.light.radiance * (abs(lit.local_wi.z) * weight / lit.light.pdf);
    ray.contribution = clamp_indirect(contribution, bounce + 2u);
    ray.origin = leave(surface, lit.wi);
    ray.to_light = lit.light.to_light + lit.light.gap + (surface.position - ray.origin);
    return ray;
}

// Rough glass scatters to both sides of its surface.
const bool BOTH_SIDES = FAMILY == FAMILY_DIELECTRIC;

bool has_dirac_lobe(Bsdf bsdf, MaterialRecord material) {
    return bsdf_is_delta(bsdf) || (FAMILY == FAMILY_COATED && material.alpha.x == 0.0);
}

// What a path's throughput is to be multiplied by to tell how much may still come of it. Inside glass radiance is ior² times as large as
// outside, and throughput is as much smaller: a path that goes in carries no less for that.
float importance(BsdfSample next, MaterialRecord material) {
    return BOTH_SIDES && next.wi.z < 0.0 ? material.ior * material.ior : 1.0;
}

void push_shadow_ray(bool wanted, ShadowRay ray, uint slot) {
    uint place = queue_reserve(bounce, wanted ? QUEUE_SHADOW : NOWHERE, 1u << QUEUE_SHADOW);
    if (wanted) {
        pool.shadow_origin.at[place] = vec4(ray.origin, ray.contribution.r);
        pool.shadow_direction.at[place] = vec4(ray.to_light, ray.contribution.g);
        pool.shadow_path.at[place] = uvec2(slot, floatBitsToUint(ray.contribution.b));
    }
}

void pass_shade() {
    // All invocations shade, those beyond the queue's end its last path once more, and only what they store depends on it:
    // so most loads come before control flow begins.
    uint queue = queue_of_family(FAMILY, variant);
    Queued queued = queue_of(bounce, queue);
    bool has_path = gl_GlobalInvocationID.x < queued.count;
    uint slot = queue_slot(queue, queued, min(gl_GlobalInvocationID.x, queued.count - 1u));
    Lights lights = lights_of(scene);
    vec4 origin = pool.origin.at[slot];
    Receiver left = receiver_at(origin.xyz, HAS_LIGHT_TREE ? UVec4Array(uvec2(pool.radiance)).at[slot].w : NO_NORMAL);
    vec4 direction_spread = pool.direction.at[slot];
    vec3 direction = direction_spread.xyz;
    vec4 throughput_width = pool.throughput.at[slot];
    vec3 throughput = throughput_width.rgb;
    uvec4 hit_key = pool.hit_key.at[slot];
    Hit hit = Hit(hit_key.x, hit_key.y);
    Surface surface = surface_at(scene, hit, origin.xyz, direction, FAMILY != FAMILY_DIELECTRIC);
    MaterialRecord material = scene.materials.at[surface.material];
    if (HAS_EMITTERS) {
        vec3 emission = emitted(lights, surface, hit, material, -direction, left, origin.w);
        if (has_path && emission != vec3(0.0)) {
            pool.radiance.at[slot].rgb += clamp_indirect(throughput * emission, bounce + 1u);
        }
    }
    if (bounce + 1u >= max_depth) {
        return;
    }
    SampleKey key = SampleKey(hit_key.z, hit_key.w);
    uint dimension = bounce * DIMENSIONS_PER_BOUNCE;
    vec3 wo = frame_to_local(surface.frame, -direction);
    uint packed_normal = HAS_LIGHT_TREE ? pack_normal(surface.frame.normal, BOTH_SIDES) : NO_NORMAL;
    material.alpha = material_alpha(scene, material, surface.uv);
    Bsdf bsdf = bsdf_make(material, material_color(scene, material, surface.uv));
#ifdef BSDF_IS_LAMBERTIAN
    if (REUSES_PATHS && has_path && bounce == 0u && wo.z >= MIN_COSINE) {
        reuse_receiver(slot, surface, bsdf.albedo);
    }
    if (REUSES_PATHS && has_path && bounce == 1u && wo.z >= MIN_COSINE && surface.frame.follows_mesh && reuse_is_receiver(slot)) {
        reuse_sender(slot, surface);
        throughput = vec3(1.0);
    }
#endif
    Cone cone = Cone(0.0, 0.0);
    if (HAS_FOOTPRINTS) {
        cone = bounce == 0u ? camera_cone(direction) : Cone(throughput_width.w, direction_spread.w);
        cone = cone_at(cone, surface);
#ifdef BSDF_HAS_PLACE
        bsdf_look_at(bsdf, surface.uv, cone_area(cone, surface, direction));
#endif
    }
    bool takes_hemisphere = strategy_takes_hemisphere(has_dirac_lobe(bsdf, material));
    ShadowRay shadow = ShadowRay(vec3(0.0), vec3(0.0), vec3(0.0));
    vec2 lobe_roulette = sample_2d(key, dimension + DIMENSION_LOBE_ROULETTE);
    vec3 u = vec3(sample_2d(key, dimension + DIMENSION_BSDF), lobe_roulette.x);
#ifdef BSDF_PICKS_FIRST
    Lit lit;
    lit.local_wi = vec3(0.0);
    lit.counts = false;
    if (SAMPLES_LIGHTS) {
        lit = light_sample(lights, surface, packed_normal, key, dimension);
    }
    vec4 picked = takes_hemisphere ? strategy_pick(u, BOTH_SIDES) : bsdf_pick(bsdf, wo, u);
    vec4 value;
    vec3 f_picked;
    bsdf_eval_pair(bsdf, wo, lit.local_wi, picked.xyz, value, f_picked);
    if (lit.counts) {
        value.a = takes_hemisphere ? strategy_pdf(lit.local_wi, BOTH_SIDES) : value.a;
        shadow = shadow_ray(surface, lit, value, throughput);
    }
    BsdfSample next = bsdf_picked(picked, f_picked);
#else
    if (SAMPLES_LIGHTS && !bsdf_is_delta(bsdf)) {
        Lit lit = light_sample(lights, surface, packed_normal, key, dimension);
        if (lit.counts) {
            vec4 value = bsdf_eval_pdf(bsdf, wo, lit.local_wi);
            value.a = takes_hemisphere ? strategy_pdf(lit.local_wi, BOTH_SIDES) : value.a;
            shadow = shadow_ray(surface, lit, value, throughput);
        }
    }
    BsdfSample next;
    if (takes_hemisphere) {
        vec4 picked = strategy_pick(u, BOTH_SIDES);
        vec3 f = bsdf_eval_pdf(bsdf, wo, picked.xyz).rgb;
        next = BsdfSample(picked.xyz, picked.w, f * (abs(picked.z) / max(picked.w, 1e-30)), false);
    } else {
        next = bsdf_sample(bsdf, wo, u);
    }
#endif
    if (SAMPLES_LIGHTS) {
        push_shadow_ray(has_path && shadow.contribution != vec3(0.0), shadow, slot);
    }
    vec3 wi = frame_to_world(surface.frame, next.wi);
    throughput *= next.weight;
    float survival = bounce < ROULETTE_AFTER ? 1.0 : min(1.0, importance(next, material) * max(throughput.r, max(throughput.g, throughput.b)));
    bool goes_on = has_path && next.pdf > 0.0 && lobe_roulette.y < survival
        && frame_is_consistent(surface.frame, wi, next.wi);
    if (goes_on) {
        pool.origin.at[slot] = vec4(leave(surface, wi), next.is_delta || !SAMPLES_LIGHTS ? 0.0 : next.pdf);
        Cone next_cone = HAS_FOOTPRINTS ? cone_scattered(cone, next.pdf, next.is_delta) : cone;
        pool.direction.at[slot] = vec4(wi, next_cone.spread);
        pool.throughput.at[slot] = vec4(throughput / survival, next_cone.width);
        if (HAS_LIGHT_TREE) {
            UVec4Array(uvec2(pool.radiance)).at[slot].w = packed_normal;
        }
    }
    queue_push(bounce + 1u, goes_on ? QUEUE_TRACE : NOWHERE, 1u << QUEUE_TRACE, slot);
}

#endif
