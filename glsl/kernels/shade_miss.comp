// Gathers the sky's radiance for the paths that left the scene.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "lib/clamp.glsl"
#include "lib/light.glsl"
#include "lib/queue.glsl"

void main() {
    Queued queued = queue_of(bounce, QUEUE_MISS);
    if (gl_GlobalInvocationID.x >= queued.count) {
        return;
    }
    uint slot = queue_slot(QUEUE_MISS, queued, gl_GlobalInvocationID.x);
    vec3 radiance = environment_radiance(scene, pool.direction.at[slot].xyz);
    float bsdf_pdf = pool.origin.at[slot].w;
    float weight = bsdf_pdf == 0.0 ? 1.0 : mis_weight(bsdf_pdf, environment_pdf(lights_of(scene), radiance));
    pool.radiance.at[slot].rgb += clamp_indirect(weight * pool.throughput.at[slot].rgb * radiance, bounce + 1u);
}
