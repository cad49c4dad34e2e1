//! The camera and the film.

use glam::Vec3;

/// A perspective camera given by look-at, with an optional thin lens.
///
/// Pixel (0, 0) is the upper left one; the film's x runs along `forward × up`.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Centre of projection (centre of the lens), world units.
    pub eye: Vec3,
    /// A point on the optical axis, ≠ `eye`.
    pub target: Vec3,
    /// A vector that points up in the picture, not parallel to `target − eye`.
    pub up: Vec3,
    /// Full vertical field of view, degrees in (0, 180).
    pub vertical_fov_degrees: f32,
    /// `None` is a pinhole.
    pub lens: Option<Lens>,
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the aperture, world units, > 0.
    pub radius: f32,
    /// Distance along the optical axis of the plane in focus, world units, > 0.
    pub focus_distance: f32,
}

/// The picture's size. The pixel filter is a box of one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Film {
    /// Pixels across, 1 to [`Film::LONGEST_SIDE`].
    pub width: u32,
    /// Pixels down, 1 to [`Film::LONGEST_SIDE`].
    pub height: u32,
}

impl Film {
    /// Most pixels across or down.
    pub const LONGEST_SIDE: u32 = 1 << 16;
}
