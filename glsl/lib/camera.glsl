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

// From the film's camera through a place on the film, in pixels.
CameraRay camera_ray(vec2 film_position, vec2 u_lens) {
    vec3 direction = film.camera.corner + film_position.x * film.camera.right + film_position.y * film.camera.down;
    if (!HAS_LENS) {
        return CameraRay(film.camera.eye, normalize(direction));
    }
    vec2 lens = concentric_disk(u_lens);
    vec3 offset = lens.x * film.camera.lens_right + lens.y * film.camera.lens_up;
    return CameraRay(film.camera.eye + offset, normalize(direction * film.camera.focus_distance - offset));
}

#endif
