//! The path tracer inside somebody else's engine: it records into the host's command buffers, and does nothing else to the
//! host's device. `docs/embedding.md` is the page to begin with.

mod change;
mod error;
mod layout;
mod mark;
mod renderer;
mod slots;
mod target;

pub use crate::gpu::{HostArray, HostIndices, HostMesh, HostVertices, IndexFormat, Update};
pub use change::Change;
pub(crate) use change::change;
pub use error::Error;
pub use layout::{DEVELOP_STRUCTS, DevelopPass};
pub use renderer::{Frame, Options, Renderer};
pub use slots::Status;
pub use target::{Channel, PixelFormat, Place, Target};
