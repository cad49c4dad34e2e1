//! What can go wrong in a host.

use std::ops::RangeInclusive;

use crate::scene::Flaw;
use crate::{gpu, render};

/// A plugin's error. Whatever it says, the renderer is as it was before the call.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Vulkan refused: out of memory, a lost device, a mistake of the host's.
    #[error(transparent)]
    Gpu(gpu::Error),
    /// The settings are out of range, or the device lacks what they need.
    #[error(transparent)]
    Render(render::Error),
    /// The scene, or a change of it, makes no sense.
    #[error(transparent)]
    Scene(#[from] Flaw),
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
    /// The change needs kernels that were not built.
    #[error("the kernels were not built for {what}: make a new renderer, or name it in Options::reserve beforehand")]
    NewRenderer {
        /// What they lack.
        what: String,
    },
    /// As many frames as the renderer was made for are recorded and not known to be done.
    #[error("{pending} frames are not known to be done, and the renderer was made for {most}: call Renderer::complete")]
    FramesInFlight {
        /// Recordings that are not done.
        pending: u64,
        /// [`Options::frames_in_flight`](super::Options::frames_in_flight)
        most: u32,
    },
    /// A recording that is done, or was never made.
    #[error("recording {ticket} is not in flight{}", told(.in_flight))]
    NotInFlight {
        /// Its number.
        ticket: u64,
        /// Those that are.
        in_flight: RangeInclusive<u64>,
    },
    /// The commands are for another device.
    #[error("the commands are recorded for another device than the renderer was made on")]
    OtherDevice,
    /// A frame has more samples than a pixel can have.
    #[error("{asked} more samples after {taken}: a pixel holds {} in all", u32::MAX)]
    Samples {
        /// Those asked for.
        asked: u32,
        /// Those taken.
        taken: u32,
    },
    /// A target has no room for the film.
    #[error("a target of {found}: the film needs {needed}")]
    TargetSize {
        /// Its room.
        found: String,
        /// What is written.
        needed: String,
    },
    /// A channel that is not gathered.
    #[error("channel {channel} is not gathered: set Settings::features")]
    NoFeatures {
        /// Its name.
        channel: &'static str,
    },
    /// An exposure that is no number of stops.
    #[error("exposure {found}: expected a finite number of stops")]
    Exposure {
        /// What was given.
        found: f32,
    },
    /// A channel that no 8-bit picture shows.
    #[error("channel {channel} in an 8-bit format: ask for a floating-point format")]
    Format {
        /// Its name.
        channel: &'static str,
    },
}

fn told(in_flight: &RangeInclusive<u64>) -> String {
    if in_flight.is_empty() {
        ": none is".into()
    } else {
        format!(": {} to {} are", in_flight.start(), in_flight.end())
    }
}

impl From<gpu::Error> for Error {
    fn from(error: gpu::Error) -> Error {
        Error::Gpu(error)
    }
}

impl From<render::Error> for Error {
    fn from(error: render::Error) -> Error {
        match error {
            render::Error::Gpu(error) => Error::Gpu(error),
            render::Error::Scene(flaw) => Error::Scene(flaw),
            render::Error::Fixed { what } => Error::NewRenderer { what },
            render::Error::HostMesh { mesh, found, expected } => Error::HostMesh { mesh, found, expected },
            error => Error::Render(error),
        }
    }
}
