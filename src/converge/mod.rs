//! Whether two pictures show the same radiance, and how fast they come to: error metrics, statistical tests, [`study`].

pub mod stability;
pub mod study;

mod chi_square;
mod clock;
mod compare;
mod estimate;
mod line;
mod metrics;
mod mitsuba;
mod normal;
mod student;
mod z_test;

pub use chi_square::{ChiSquare, chi_square_survival, chi_square_test};
pub use clock::{Stopwatch, Timing, cores, load_average, warm_up};
pub use compare::{Comparison, difference, difference_rgb8, prove_equal, write_difference_png, write_evidence};
pub use estimate::{CONFIDENCE, Estimate};
pub use line::Line;
pub use metrics::Metrics;
pub use mitsuba::{ExportError, Mitsuba, MitsubaError, export_mitsuba};
pub use normal::{sidak, two_sided_p};
pub use student::{student_t, two_sided_t};
pub use z_test::{ZTest, ZTestOptions};

/// What can keep two pictures from being compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// They differ in size.
    #[error("the picture has {}×{} pixels, the reference {}×{}; render both at one size and crop", image[0], image[1], reference[0], reference[1])]
    SizeMismatch {
        /// Size of the picture.
        image: [u32; 2],
        /// Size of the reference.
        reference: [u32; 2],
    },
    /// They are parts of a film, and not the same.
    #[error("the picture begins at pixel ({}, {}) of its film, the reference at ({}, {}); render both with one crop", image[0], image[1], reference[0], reference[1])]
    PlaceMismatch {
        /// Upper left pixel of the picture.
        image: [u32; 2],
        /// Upper left pixel of the reference.
        reference: [u32; 2],
    },
    /// They have no pixels.
    #[error("the pictures are empty")]
    Empty,
    /// One of them lacks planes.
    #[error("the {which} has no channels {missing}; it has {found}")]
    MissingPlane {
        /// "picture" or "reference".
        which: &'static str,
        /// What is needed.
        missing: String,
        /// What is there.
        found: String,
    },
    /// One sample each tells nothing about the noise.
    #[error("pixel ({}, {}) has one sample in either picture; a z-test needs two in at least one of them", pixel[0], pixel[1])]
    TooFewSamples {
        /// The first such pixel.
        pixel: [u32; 2],
    },
    /// A report could not be written.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// The pictures differ by more than chance.
    #[error("{name}: the picture differs from its reference beyond chance:\n{comparison}\nboth are in {}", evidence.display())]
    Different {
        /// What was compared.
        name: String,
        /// The figures.
        comparison: Box<Comparison>,
        /// Where the pictures were written.
        evidence: std::path::PathBuf,
    },
}
