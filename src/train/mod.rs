//! Fits neural BRDFs to a ground truth, on the CPU, with all cores and their vector units.
//!
//! A [`Plan`] says what is done, a [`Session`] does it step by step and gives the model at any time. How good that is, [`measure`]
//! and [`ball`] tell. A plan and a ground truth give the same bits again on the same machine, whatever its load, and whether or
//! not the session was stopped and resumed in between.

mod adam;
mod albedo;
pub mod ball;
pub mod check;
mod checkpoint;
pub mod cluster;
mod energy;
mod evaluator;
mod gather;
mod group;
mod group_report;
mod held_out;
pub mod measure;
mod measured;
mod network;
mod pairs;
mod plan;
pub mod plot;
mod product;
mod prune;
mod random;
mod report;
mod result;
mod session;
mod table;
mod team;
mod trainer;
mod vector;

use std::path::PathBuf;

use glam::Vec3;

pub use albedo::Views;
pub use checkpoint::saved_steps;
pub use evaluator::Evaluator;
pub use group::Group;
pub use group_report::GroupReport;
pub use held_out::hold_out;
pub use measured::{btf_pairs, sample_pairs};
pub use pairs::{GroundTruth, Pair};
pub use plan::{Model, Plan, Quality, Recipe, SurfacePlan};
pub use report::{Figure, Judged, RecipeResult, Report};
pub use session::Session;

/// Why a training cannot be done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number of the plan is out of range.
    #[error("{name}: found {found}, expected {expected}")]
    Plan {
        /// The option that sets it.
        name: &'static str,
        /// What it is.
        found: String,
        /// What it may be.
        expected: &'static str,
    },
    /// There are no pairs.
    #[error("there is nothing to learn from: no samples")]
    Empty,
    /// The ground truth is no BRDF somewhere.
    #[error("the BRDF to learn: found {value} for ωo {wo} and ωi {wi}, expected finite numbers, none negative")]
    Value {
        /// Towards the viewer.
        wo: Vec3,
        /// Towards the light.
        wi: Vec3,
        /// sr⁻¹, RGB.
        value: Vec3,
    },
    /// A direction of a measurement that is none, or is below the surface.
    #[error("the BRDF to learn: found ωo {wo} and ωi {wi}, expected unit vectors with z ≥ 0")]
    Direction {
        /// Towards the viewer.
        wo: Vec3,
        /// Towards the light.
        wi: Vec3,
    },
    /// The system refused a checkpoint.
    #[error("{}: {source}", path.display())]
    CheckpointFile {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is no checkpoint.
    #[error("{}: is no checkpoint of a training: {reason}; name another file, or delete it to start again", path.display())]
    CheckpointFormat {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: &'static str,
    },
    /// The checkpoint is that of another training.
    #[error("{}: the checkpoint is of another training: {what} differs", path.display())]
    CheckpointMismatch {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: &'static str,
    },
    /// A file could not be written.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
}
