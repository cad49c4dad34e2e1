// What the camera rays of a batch saw first, for the feature channels: albedo and normal of each sample, or the probe's depth and ids.
#version 460
#extension GL_GOOGLE_include_directive : require

#include "layout/film.glsl"
#include "lib/surface.glsl"
#include "lib/texture.glsl"

layout(local_size_x_id = 0) in;

void main() {
    uint slot = gl_GlobalInvocationID.x;
    if (slot >= pixel_count * samples_per_pixel) {
        return;
    }
    Hit hit = Hit(pool.hit_key.at[slot].x, pool.hit_key.at[slot].y);
    vec3 albedo = vec3(0.0);
    vec3 normal = vec3(0.0);
    float depth = INFINITY;
    uint material_index = NO_HIT;
    if (hit.instance != NO_HIT) {
        vec3 direction = pool.direction.at[slot].xyz;
        Surface surface = surface_at(scene, hit, pool.origin.at[slot].xyz, direction, true);
        albedo = material_color(scene, scene.materials.at[surface.material], surface.uv);
        normal = surface.frame.normal;
        depth = sqrt(surface.distance_squared) * dot(direction, film.camera.axis);
        material_index = surface.material;
    }
    if (variant == VARIANT_PROBE) {
        uint index = film_index(first_pixel + slot);
        film.features.at[index].depth = depth;
        film.features.at[index].instance = hit.instance;
        film.features.at[index].triangle = hit.instance == NO_HIT ? NO_HIT : HAS_PATCHES ? hit.triangle & ~IN_PATCH : hit.triangle;
        film.features.at[index].material = material_index;
    } else {
        film.first_albedo.at[slot] = vec4(albedo, 0.0);
        film.first_normal.at[slot] = vec4(normal, 0.0);
    }
}
