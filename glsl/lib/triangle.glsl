// Watertight ray-triangle test: Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2013.
//
// A shear along the ray's longest axis turns the question into whether the origin lies in a flat triangle. Two
// triangles that share an edge compute the same number, but for its sign, for that edge, and a product that rounds
// to nothing counts as inside: no ray slips between them. `precise` keeps every rounding where it stands, so that all
// kernels, whatever walked the tree, get the same t, u, v.
#ifndef LIB_TRIANGLE_GLSL
#define LIB_TRIANGLE_GLSL

// What the test needs to know about a ray: the rows x, y, z of the shear that takes the direction to (0, 0, 1).
struct TriangleRay {
    vec3 origin;
    vec3 x;
    vec3 y;
    vec3 z;
};

TriangleRay triangle_ray(vec3 o, vec3 d) {
    precise TriangleRay ray;
    ray.origin = o;
    vec3 longest = abs(d);
    if (longest.z >= longest.x && longest.z >= longest.y) {
        ray.x = vec3(1.0, 0.0, -d.x / d.z);
        ray.y = vec3(0.0, 1.0, -d.y / d.z);
        ray.z = vec3(0.0, 0.0, 1.0 / d.z);
    } else if (longest.y >= longest.x) {
        ray.x = vec3(1.0, -d.x / d.y, 0.0);
        ray.y = vec3(0.0, -d.z / d.y, 1.0);
        ray.z = vec3(0.0, 1.0 / d.y, 0.0);
    } else {
        ray.x = vec3(-d.y / d.x, 1.0, 0.0);
        ray.y = vec3(-d.z / d.x, 0.0, 1.0);
        ray.z = vec3(1.0 / d.x, 0.0, 0.0);
    }
    return ray;
}

vec3 triangle_shear(TriangleRay ray, vec3 corner) {
    precise vec3 v = corner - ray.origin;
    precise vec3 sheared = vec3((ray.x.x * v.x + ray.x.y * v.y) + ray.x.z * v.z, (ray.y.x * v.x + ray.y.y * v.y) + ray.y.z * v.z,
                   (ray.z.x * v.x + ray.z.y * v.y) + ray.z.z * v.z);
    return sheared;
}

// Whether a ray along z from the origin meets the triangle of sheared corners, from either side, with tmin < t <= tmax, and where:
// the point is o + t d = (1 - u - v) v0 + u v1 + v v2.
bool intersect_sheared(vec3 a, vec3 b, vec3 c, float tmin, float tmax, out float t, out float u, out float v) {
    precise float weight_a = c.x * b.y - c.y * b.x;
    precise float weight_b = a.x * c.y - a.y * c.x;
    precise float weight_c = b.x * a.y - b.y * a.x;
    precise float determinant = (weight_a + weight_b) + weight_c;
    precise float reciprocal = 1.0 / determinant;
    precise float distance = ((weight_a * a.z + weight_b * b.z) + weight_c * c.z) * reciprocal;
    precise float second = weight_b * reciprocal;
    precise float third = weight_c * reciprocal;
    t = distance;
    u = second;
    v = third;
    bool front = weight_a >= 0.0 && weight_b >= 0.0 && weight_c >= 0.0;
    bool back = weight_a <= 0.0 && weight_b <= 0.0 && weight_c <= 0.0;
    return (front || back) && determinant != 0.0 && t > tmin && t <= tmax;
}

// The same of a ray and a triangle as they are.
bool intersect_triangle(TriangleRay ray, float tmin, float tmax, vec3 v0, vec3 v1, vec3 v2, out float t, out float u,
                        out float v) {
    return intersect_sheared(triangle_shear(ray, v0), triangle_shear(ray, v1), triangle_shear(ray, v2), tmin, tmax, t, u, v);
}

// The same for a ray that is not tested against many triangles.
bool intersect_triangle(vec3 o, vec3 d, float tmin, float tmax, vec3 v0, vec3 v1, vec3 v2, out float t, out float u,
                        out float v) {
    return intersect_triangle(triangle_ray(o, d), tmin, tmax, v0, v1, v2, t, u, v);
}

#endif
