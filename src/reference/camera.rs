//! Camera rays.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::scene::{Camera, Film};

/// The camera's axes in world space, unit vectors: right, up, forward.
pub fn axes(camera: &Camera) -> [DVec3; 3] {
    let forward = (camera.target.as_dvec3() - camera.eye.as_dvec3()).normalize();
    let right = forward.cross(camera.up.as_dvec3()).normalize();
    [right, right.cross(forward), forward]
}

/// Origin and unit direction of the ray through a film position (pixels, from the upper left corner) and a point of the
/// lens given by `lens` in [0, 1)²; `None` goes through its centre.
pub fn ray(camera: &Camera, film: Film, position: DVec2, lens: Option<DVec2>) -> (DVec3, DVec3) {
    let [right, up, forward] = axes(camera);
    let eye = camera.eye.as_dvec3();
    let half_height = (f64::from(camera.vertical_fov_degrees).to_radians() / 2.0).tan();
    let pixel = 2.0 * half_height / f64::from(film.height);
    let x = (position.x - f64::from(film.width) / 2.0) * pixel;
    let y = (f64::from(film.height) / 2.0 - position.y) * pixel;
    // Its component along the optical axis is 1.
    let through = forward + x * right + y * up;

    match (camera.lens, lens) {
        (Some(shape), Some(lens)) => {
            let radius = f64::from(shape.radius) * lens.x.sqrt();
            let (sine, cosine) = (TAU * lens.y).sin_cos();
            let offset = radius * (cosine * right + sine * up);
            let in_focus = through * f64::from(shape.focus_distance);
            (eye + offset, (in_focus - offset).normalize())
        }
        _ => (eye, through.normalize()),
    }
}
