//! What can go wrong in a study.

use std::path::PathBuf;

/// A study's error.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A scene, study or assertion file is not as it should be.
    #[error(transparent)]
    File(#[from] crate::scene::Error),
    /// Vulkan refused.
    #[error(transparent)]
    Gpu(#[from] crate::gpu::Error),
    /// A render failed.
    #[error(transparent)]
    Render(#[from] crate::render::Error),
    /// The reference failed.
    #[cfg(feature = "embree")]
    #[error(transparent)]
    Reference(#[from] crate::reference::Error),
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// Pictures could not be compared.
    #[error(transparent)]
    Compare(#[from] crate::converge::Error),
    /// The system said no.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A word that an axis of the methods does not know.
    #[error("no such method: {0}")]
    Method(String),
    /// The study asks for something that makes no sense.
    #[error("{name} is {found}, but must be {expected}")]
    Setting {
        /// Which setting.
        name: &'static str,
        /// What it is.
        found: String,
        /// What it may be.
        expected: String,
    },
    /// Mitsuba said no.
    #[error(transparent)]
    Mitsuba(#[from] crate::converge::MitsubaError),
    /// The directory already holds a study.
    #[error("{} holds a study: say --resume to go on with it, or name another directory", path.display())]
    Occupied {
        /// The directory.
        path: PathBuf,
    },
    /// The directory holds another study than the one to resume.
    #[error("{}: cannot be resumed: it was made with {name} {found}, this study has {expected}", path.display())]
    Mismatch {
        /// The study's file.
        path: PathBuf,
        /// What differs.
        name: &'static str,
        /// In the file.
        found: String,
        /// In this study.
        expected: String,
    },
    /// A record of a study is damaged, or of another version.
    #[error("{}: is no record of a study of this version: {reason}", path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// No method can run.
    #[error("no method can run:\n{0}")]
    NothingToRun(String),
    /// Ctrl-C, before there was anything to keep.
    #[error("interrupted before the first render was done")]
    Interrupted,
}
