//! Camera rays.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::material::Cone;
use crate::scene::{Camera, Film, Lens};

/// A camera and its film, made ready for casting rays.
pub struct View {
    eye: DVec3,
    /// Unit vector along the optical axis.
    pub forward: DVec3,
    /// Unit vectors.
    right: DVec3,
    up: DVec3,
    /// Side of a pixel on the plane at distance 1.
    pixel: f64,
    /// The film's middle, pixels.
    centre: DVec2,
    lens: Option<Lens>,
}

impl View {
    /// The view of a camera.
    pub fn new(camera: &Camera, film: Film) -> View {
        let eye = camera.eye.as_dvec3();
        let forward = (camera.target.as_dvec3() - eye).normalize();
        let right = forward.cross(camera.up.as_dvec3()).normalize();
        let half_height = (f64::from(camera.vertical_fov_degrees).to_radians() / 2.0).tan();
        View {
            eye,
            forward,
            right,
            up: right.cross(forward),
            pixel: 2.0 * half_height / f64::from(film.height),
            centre: DVec2::new(film.width.into(), film.height.into()) / 2.0,
            lens: camera.lens,
        }
    }

    /// Whether rays need a point of the lens.
    pub fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    /// The cone of a ray through a pixel.
    pub fn cone(&self, direction: DVec3) -> Cone {
        Cone { width: 0.0, spread: self.pixel * self.forward.dot(direction) }
    }

    /// Origin and unit direction of the ray through a film position (pixels, from the upper left corner) and the point of the
    /// lens that `lens` in [0, 1)² stands for; `None` is its centre.
    pub fn ray(&self, position: DVec2, lens: Option<DVec2>) -> (DVec3, DVec3) {
        let offset = (position - self.centre) * self.pixel;
        // Its component along the optical axis is 1.
        let through = self.forward + offset.x * self.right - offset.y * self.up;
        let (Some(shape), Some(lens)) = (self.lens, lens) else { return (self.eye, through.normalize()) };

        let radius = f64::from(shape.radius) * lens.x.sqrt();
        let (sine, cosine) = (TAU * lens.y).sin_cos();
        let shift = radius * (cosine * self.right + sine * self.up);
        let in_focus = through * f64::from(shape.focus_distance);
        (self.eye + shift, (in_focus - shift).normalize())
    }
}
