// Holes: whether a ray that comes to a triangle goes through.
//
// Where a surface is there by a probability (src/scene/material.rs), the number to compare with is a hash of ray and triangle: whatever finds the
// triangle, whenever and how often it asks, the answer is the same.
#ifndef LIB_OPACITY
#define LIB_OPACITY

#include "layout/scene.glsl"
#include "lib/pcg.glsl"
#include "lib/texture.glsl"
#include "lib/triangle.glsl"

// Some material lets rays through.
layout(constant_id = 15) const bool HAS_HOLES = false;

// In [0, 1), by ray (world space) and triangle.
float hash_of_crossing(Hit hit, vec3 origin, vec3 direction) {
    uvec3 hash = pcg3d(floatBitsToUint(origin));
    hash = pcg3d(hash ^ floatBitsToUint(direction));
    hash = pcg3d(hash ^ uvec3(hit.instance, hit.triangle, 0u));
    return float(hash.x >> 8) * (1.0 / 16777216.0);
}

// Texture coordinates where the ray comes to the triangle, as surface_at has them.
vec2 uv_of_crossing(MeshRecord mesh, InstanceRecord instance, uint triangle, vec3 origin, vec3 direction) {
    if (INSTANCED) {
        origin = instance.world_to_object * vec4(origin, 1.0);
        direction = mat3(instance.world_to_object) * direction;
    }
    uvec3 corners = mesh.indices.at[triangle];
    float t, u, v;
    intersect_triangle(origin, direction, 0.0, INFINITY, mesh.positions.at[corners.x], mesh.positions.at[corners.y],
                       mesh.positions.at[corners.z], t, u, v);
    vec2 uv = mesh.uvs.at[corners.x];
    return uv + u * (mesh.uvs.at[corners.y] - uv) + v * (mesh.uvs.at[corners.z] - uv);
}

bool goes_through(SceneTable scene, Hit hit, vec3 origin, vec3 direction) {
    if (!HAS_HOLES) {
        return false;
    }
    InstanceRecord instance = scene.instances.at[hit.instance];
    MeshRecord mesh = MeshRecord(scene.meshes.at[instance.mesh]);
    uint material = material_of(mesh, hit.triangle);
    float opacity = scene.materials.at[material].opacity;
    uint image = scene.materials.at[material].opacity_texture;
    if (HAS_TEXTURES && image != NO_TEXTURE) {
        vec2 uv = has_uvs(mesh) ? uv_of_crossing(mesh, instance, hit.triangle, origin, direction) : vec2(0.0);
        opacity *= texture_color(scene.textures.at[image], uv).r;
    }
    // Of a mesh with holes most is whole.
    return opacity < 1.0 && hash_of_crossing(hit, origin, direction) >= opacity;
}

#endif
