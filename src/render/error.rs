//! What can go wrong in a render.

use std::path::PathBuf;

use crate::gpu;
use crate::render::settings::Traversal;

/// A render's error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Vulkan refused.
    #[error(transparent)]
    Gpu(#[from] gpu::Error),
    /// The scene makes no sense.
    #[error(transparent)]
    Scene(#[from] crate::scene::Flaw),
    /// A file could not be written.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// The crop reaches beyond the film.
    #[error("the crop {x},{y},{width},{height} reaches beyond the film of {film_width}x{film_height} pixels")]
    Crop {
        /// Left column.
        x: u32,
        /// Top row.
        y: u32,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Film columns.
        film_width: u32,
        /// Film rows.
        film_height: u32,
    },
    /// The traversal was asked for and the device has none.
    #[error("the device {device} has no {traversal} traversal; leave --traversal away or say bvh")]
    Traversal {
        /// What was asked for.
        traversal: Traversal,
        /// The device's name.
        device: String,
    },
    /// The scene has NeuBRDFs, and the driver's compiler does not survive their kernel.
    #[error(
        "the device {device} cannot compile the kernel that shades NeuBRDFs; choose another by --device, such as llvmpipe"
    )]
    NeuBrdf {
        /// The device's name.
        device: String,
    },
    /// A mesh has more triangles than its tree can index.
    #[error("mesh '{mesh}' has {triangles} triangles, {most} at most: split it")]
    MeshSize {
        /// The mesh's name.
        mesh: String,
        /// How many it has.
        triangles: usize,
        /// How many it may have.
        most: usize,
    },
    /// A host's mesh does not go with what is to be done with it.
    #[error("mesh '{mesh}' of the host: {found}, but must be {expected}")]
    HostMesh {
        /// The mesh's name.
        mesh: String,
        /// What there is.
        found: String,
        /// What is asked for.
        expected: String,
    },
    /// The settings are out of range.
    #[error("{name} is {found}, but must be {expected}")]
    Setting {
        /// Which one.
        name: &'static str,
        /// What it is.
        found: String,
        /// What it may be.
        expected: &'static str,
    },
    /// A change that the kernels were not built for.
    #[error("the kernels were not built for {what}: make a new renderer, or say beforehand that it may come")]
    Fixed {
        /// What they lack.
        what: String,
    },
    /// A kernel's SPIR-V is not in this build.
    #[error("this build has no kernel '{0}': run cargo build where glslangValidator is installed")]
    MissingKernel(&'static str),
    /// The checkpoint file cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    CheckpointFile {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The checkpoint file is no checkpoint, or damaged.
    #[error("{path}: is no checkpoint that can be used: {reason}; name another file, or delete it to start again", path = path.display())]
    CheckpointFormat {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The checkpoint is of another scene.
    #[error(
        "the scene, or a file that it names, has changed since the checkpoint was made (hash {found}…, now {expected}…)"
    )]
    CheckpointScene {
        /// The beginning of the hash in the checkpoint.
        found: String,
        /// That of this render's scene.
        expected: String,
    },
    /// The checkpoint is of another render.
    #[error("the checkpoint was made with {name} {found}, this render has {expected}")]
    CheckpointMismatch {
        /// What differs.
        name: &'static str,
        /// In the checkpoint.
        found: String,
        /// In this render.
        expected: String,
    },
}
