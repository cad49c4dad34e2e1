// Starts a batch of paths: one camera ray a slot.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/camera.glsl"
#include "lib/queue.glsl"
#include "lib/reuse.glsl"
#include "lib/sampler.glsl"

void main() {
    uint slot = gl_GlobalInvocationID.x;
    if (slot >= pixel_count * samples_per_pixel) {
        return;
    }
    uint place = slot / samples_per_pixel;
    uvec2 pixel = film.crop_origin + pixel_at(first_pixel + place);
    SampleKey key = sample_key(pixel, first_sample + (slot - place * samples_per_pixel), film.seed);
    vec2 u_pixel = variant == VARIANT_PROBE ? vec2(0.5) : sample_2d(key, DIMENSION_PIXEL);
    vec2 u_lens = variant == VARIANT_PROBE ? vec2(0.5) : sample_2d(key, DIMENSION_LENS);
    CameraRay ray = camera_ray(vec2(pixel) + u_pixel, u_lens);
    pool.origin.at[slot] = vec4(ray.origin, 0.0);
    pool.direction.at[slot] = vec4(ray.direction, 0.0);
    pool.throughput.at[slot] = vec4(1.0);
    pool.radiance.at[slot] = vec4(0.0);
    pool.hit_key.at[slot].zw = uvec2(key.pixel, key.index);
    if (REUSES_PATHS) {
        reuse_begin(slot);
    }
}
