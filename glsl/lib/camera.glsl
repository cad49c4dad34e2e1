// Camera rays of a pinhole or a thin lens.
#ifndef LIB_CAMERA
#define LIB_CAMERA

#include "layout/film.glsl"
#include "lib/disk.glsl"

layout(constant_id = 8) const bool HAS_LENS = false;

struct CameraRay {
    vec3 origin;
    vec3 direction;
};

CameraRay camera_ray(CameraRecord camera, vec2 film_position, vec2 u_lens) {
    vec3 direction = camera.corner + film_position.x * camera.right + film_position.y * camera.down;
    if (!HAS_LENS) {
        return CameraRay(camera.eye, normalize(direction));
    }
    vec2 lens = concentric_disk(u_lens);
    vec3 offset = lens.x * camera.lens_right + lens.y * camera.lens_up;
    return CameraRay(camera.eye + offset, normalize(direction * camera.focus_distance - offset));
}

#endif
