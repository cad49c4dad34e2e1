// The point of a surface that a ray hit: position, frame, texture coordinates, material.
//
// t, u and v are computed here again from the triangle, so that every traversal that finds the same triangle gives the same bits.
#ifndef LIB_SURFACE
#define LIB_SURFACE

#include "layout/scene.glsl"
#include "lib/frame.glsl"
#include "lib/half_angle.glsl"
#include "lib/offset.glsl"
#include "lib/patches.glsl"
#include "lib/texture.glsl"
#include "lib/triangle.glsl"

// Some material has a map of normals.
layout(constant_id = 16) const bool HAS_NORMAL_MAPS = false;

// Some material has a map of the direction of its anisotropy.
layout(constant_id = 37) const bool HAS_ANISOTROPY_DIRECTION_MAPS = false;

struct Surface {
    vec3 position;            // world space
    vec3 position_error;      // bounds of its rounding error
    vec3 front;               // unit normal of the triangle's front
    Frame frame;              // turned towards the ray where the surface is opaque
    vec2 uv;
    vec2 uv_corner;           // of the triangle's first corner, and from there to the others; 0 where there is no uv
    vec2 uv_edge_1;
    vec2 uv_edge_2;
    float uv_density;         // area in uv of a unit of area in world space; enormous where there is no uv
    float distance_squared;   // from the ray's origin
    uint material;
};

// The rows of an affine transform's linear part, transposed: what turns normals.
vec3 transform_normal(mat4x3 world_to_object, vec3 normal) {
    return vec3(dot(world_to_object[0], normal), dot(world_to_object[1], normal), dot(world_to_object[2], normal));
}

vec3 absolute_transform(mat4x3 m, vec3 p) {
    return abs(m[0]) * p.x + abs(m[1]) * p.y + abs(m[2]) * p.z;
}

// Along dp/du and, on the side of dp/dv, at right angles to it about a normal. False, and nothing is told, without a dp/du.
bool along_uv(vec3 normal, vec3 dpdu, vec3 dpdv, out vec3 along_u, out vec3 along_v) {
    vec3 across = dpdu - normal * dot(normal, dpdu);
    along_u = normalize(across);
    along_v = cross(normal, along_u);
    along_v = dot(along_v, dpdv) < 0.0 ? -along_v : along_v;
    return dot(across, across) > 1e-10 * dot(dpdu, dpdu);
}

// What dp/du turns into by a map of directions: `turned_dpdu` of src/material/frame.rs.
vec3 turned_dpdu(vec2 doubled, vec3 normal, vec3 dpdu, vec3 dpdv) {
    vec3 along_u, along_v;
    vec2 turn = half_angle(doubled);
    return along_uv(normal, dpdu, dpdv, along_u, along_v) ? turn.x * along_u + turn.y * along_v : dpdu;
}

// What a normal map says of a shading normal: `mapped_normal` of src/material/frame.rs.
vec3 mapped_normal(vec3 texel, vec3 normal, vec3 dpdu, vec3 dpdv) {
    vec3 along_u, along_v;
    if (!along_uv(normal, dpdu, dpdv, along_u, along_v)) {
        return normal;
    }
    vec3 local = 2.0 * texel - 1.0;
    // What a map has below the surface leans as far as can be.
    local.z = max(local.z, 0.05);
    return normalize(local.x * along_u + local.y * along_v + local.z * normal);
}

Surface surface_at(SceneTable scene, Hit hit, vec3 origin, vec3 direction, bool opaque) {
    const float gamma_3 = 3.0 * 5.97e-8;
    const float gamma_7 = 7.0 * 5.97e-8;
    InstanceRecord instance = scene.instances.at[hit.instance];
    MeshRecord mesh = MeshRecord(scene.meshes.at[instance.mesh]);
    uvec3 corners = mesh.indices.at[HAS_PATCHES ? hit.triangle & ~IN_PATCH : hit.triangle];
    vec3 v0 = mesh.positions.at[corners.x];
    vec3 v1 = mesh.positions.at[corners.y];
    vec3 v2 = mesh.positions.at[corners.z];

    vec3 object_origin = origin;
    vec3 object_direction = direction;
    if (INSTANCED) {
        object_origin = instance.world_to_object * vec4(origin, 1.0);
        object_direction = mat3(instance.world_to_object) * direction;
    }
    float t, u, v;
    intersect_triangle(object_origin, object_direction, 0.0, INFINITY, v0, v1, v2, t, u, v);
    // A triangle seen edge on that a traversal hits may be missed here, where numbers are rounded otherwise: the point stays on it, and is one.
    u = u >= 0.0 ? min(u, 1.0) : 0.0;
    v = v >= 0.0 ? min(v, 1.0 - u) : 0.0;
    float w = 1.0 - u - v;

    Surface surface;
    surface.position = w * v0 + u * v1 + v * v2;
    surface.position_error = gamma_7 * (abs(w * v0) + abs(u * v1) + abs(v * v2));
    vec3 geometric = cross(v1 - v0, v2 - v0);
    vec3 shading = vec3(0.0);
    vec3 dpdu = vec3(0.0);
    vec3 dpdv = vec3(0.0);
    surface.uv = vec2(0.0);
    surface.uv_corner = vec2(0.0);
    surface.uv_edge_1 = vec2(0.0);
    surface.uv_edge_2 = vec2(0.0);
    float uv_area = 0.0;
    if (has_normals(mesh)) {
        shading = w * mesh.normals.at[corners.x] + u * mesh.normals.at[corners.y] + v * mesh.normals.at[corners.z];
    }
    if (has_uvs(mesh)) {
        vec2 uv0 = mesh.uvs.at[corners.x];
        vec2 edge_1 = mesh.uvs.at[corners.y] - uv0;
        vec2 edge_2 = mesh.uvs.at[corners.z] - uv0;
        surface.uv = uv0 + u * edge_1 + v * edge_2;
        surface.uv_corner = uv0;
        surface.uv_edge_1 = edge_1;
        surface.uv_edge_2 = edge_2;
        // dp/du and dp/dv times the determinant of the texture mapping, which counts for its sign alone.
        float determinant = edge_1.x * edge_2.y - edge_1.y * edge_2.x;
        float sign_of_map = determinant < 0.0 ? -1.0 : 1.0;
        uv_area = abs(determinant);
        dpdu = sign_of_map * (edge_2.y * (v1 - v0) - edge_1.y * (v2 - v0));
        dpdv = sign_of_map * (edge_1.x * (v2 - v0) - edge_2.x * (v1 - v0));
    }
    if (INSTANCED) {
        vec3 error = surface.position_error;
        vec3 object_position = surface.position;
        surface.position = instance.object_to_world * vec4(object_position, 1.0);
        surface.position_error = absolute_transform(instance.object_to_world, error)
            + gamma_3 * (absolute_transform(instance.object_to_world, abs(object_position)) + abs(instance.object_to_world[3]));
        geometric = transform_normal(instance.world_to_object, geometric);
        shading = transform_normal(instance.world_to_object, shading);
        dpdu = mat3(instance.object_to_world) * dpdu;
        dpdv = mat3(instance.object_to_world) * dpdv;
    }
    vec3 edge_1 = v1 - v0;
    vec3 edge_2 = v2 - v0;
    if (INSTANCED) {
        edge_1 = mat3(instance.object_to_world) * edge_1;
        edge_2 = mat3(instance.object_to_world) * edge_2;
    }
    surface.uv_density = has_uvs(mesh) ? uv_area / length(cross(edge_1, edge_2)) : 1e12;
    surface.front = normalize_or(geometric, vec3(0.0, 1.0, 0.0));
    surface.material = material_of_hit(scene, mesh, hit.triangle);
    if (HAS_NORMAL_MAPS) {
        uint map = scene.materials.at[surface.material].normal_map;
        if (map != NO_TEXTURE) {
            shading = mapped_normal(texture_normal(scene.textures.at[map], surface.uv), normalize_or(shading, surface.front), dpdu, dpdv);
        }
    }
    if (HAS_ANISOTROPY_DIRECTION_MAPS) {
        uint map = scene.materials.at[surface.material].anisotropy_direction_map;
        if (map != NO_TEXTURE) {
            dpdu = turned_dpdu(texture_doubled_angle(scene.textures.at[map], surface.uv), normalize_or(shading, surface.front), dpdu, dpdv);
        }
    }
    surface.frame = frame_make(-direction, geometric, shading, dpdu, opaque);
    vec3 travelled = surface.position - origin;
    surface.distance_squared = dot(travelled, travelled);
    return surface;
}

// Where a ray that leaves the surface towards wi starts.
vec3 leave(Surface surface, vec3 wi) {
    return offset_origin(surface.position, surface.position_error, surface.front, wi);
}

#endif
