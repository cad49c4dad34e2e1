// The shading frame at a point of a triangle: src/material/frame.rs.
#ifndef LIB_FRAME_GLSL
#define LIB_FRAME_GLSL

struct Frame {
    vec3 tangent;
    vec3 bitangent;
    vec3 normal;
    vec3 geometric;
    bool follows_mesh;   // the normal is the one that the mesh says, not the triangle's in place of one that is turned away
};

vec3 normalize_or(vec3 v, vec3 fallback) {
    float squared = dot(v, v);
    return squared > 1e-36 && squared < 1e36 ? v * inversesqrt(squared) : fallback;
}

// Duff et al. 2017.
vec3 orthogonal_to(vec3 n) {
    float s = n.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (s + n.z);
    return vec3(1.0 + s * n.x * n.x * a, s * n.x * n.y * a, -s * n.x);
}

// World-space vectors of any length; the normals point to the front of the triangle. (0, 0, 0) stands for "none".
Frame frame_make(vec3 wo, vec3 geometric, vec3 interpolated, vec3 dpdu, bool opaque) {
    Frame f;
    f.geometric = normalize_or(geometric, vec3(0.0));
    f.normal = normalize_or(interpolated, f.geometric);
    f.normal = dot(f.normal, f.geometric) < 0.0 ? -f.normal : f.normal;
    float facing = dot(wo, f.geometric);
    if (opaque && facing < 0.0) {
        f.geometric = -f.geometric;
        f.normal = -f.normal;
        facing = -facing;
    }
    f.follows_mesh = dot(wo, f.normal) * facing > 0.0;
    f.normal = f.follows_mesh ? f.normal : f.geometric;
    vec3 across = dpdu - f.normal * dot(f.normal, dpdu);
    // Less than 1e-5 rad off the normal is rounding error.
    bool has_tangent = dot(across, across) > 1e-10 * dot(dpdu, dpdu);
    f.tangent = has_tangent ? normalize(across) : orthogonal_to(f.normal);
    f.bitangent = cross(f.normal, f.tangent);
    return f;
}

vec3 frame_to_local(Frame f, vec3 world) {
    return vec3(dot(world, f.tangent), dot(world, f.bitangent), dot(world, f.normal));
}

vec3 frame_to_world(Frame f, vec3 local) {
    return local.x * f.tangent + local.y * f.bitangent + local.z * f.normal;
}

// Whether wi is on the same side of the triangle as of the shading normal. If not, its light counts as 0.
bool frame_is_consistent(Frame f, vec3 wi_world, vec3 wi_local) {
    return dot(wi_world, f.geometric) * wi_local.z > 0.0;
}

#endif
