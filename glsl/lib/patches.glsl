// Patches: where a map says so another material stands (src/scene/material.rs).
#ifndef LIB_PATCHES
#define LIB_PATCHES

#include "lib/opacity.glsl"

// Whether a ray meets a triangle in a patch. Asked once a hit and kept beside it: computed anew in another kernel it could be rounded otherwise,
// and a path be shaded by the kernel of the other material.
bool is_in_patch(SceneTable scene, Hit hit, vec3 origin, vec3 direction) {
    if (!HAS_PATCHES) {
        return false;
    }
    InstanceRecord instance = scene.instances.at[hit.instance];
    MeshRecord mesh = MeshRecord(scene.meshes.at[instance.mesh]);
    uint map = scene.materials.at[material_of(mesh, hit.triangle)].patch_map;
    if (map == NO_TEXTURE) {
        return false;
    }
    vec2 uv = has_uvs(mesh) ? uv_of_crossing(mesh, instance, hit.triangle, origin, direction) : vec2(0.0);
    return texture_color(scene.textures.at[map], uv).r >= 0.5;
}

// The material of a path's hit.
uint material_of_hit(SceneTable scene, MeshRecord mesh, uint triangle) {
    if (!HAS_PATCHES) {
        return material_of(mesh, triangle);
    }
    uint material = material_of(mesh, triangle & ~IN_PATCH);
    return (triangle & IN_PATCH) != 0u ? scene.materials.at[material].patch_material : material;
}

#endif
