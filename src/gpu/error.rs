//! What can go wrong in the Vulkan room, each with what to do about it.

use ash::vk;

/// A failure of the Vulkan loader, of a driver, or of what was asked of them.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The Vulkan loader is not installed.
    #[error("no Vulkan loader: {0}; install it (Debian: apt install libvulkan1) together with a driver for your GPU")]
    NoLoader(#[source] ash::LoadingError),
    /// The Vulkan loader is too old.
    #[error("the Vulkan loader knows Vulkan {found}, but 1.2 is needed; update it (Debian: package libvulkan1)")]
    OldLoader {
        /// The version found.
        found: String,
    },
    /// Validation was asked for and its layer is not installed.
    #[error(
        "VK_LAYER_KHRONOS_validation is not installed; install it (Debian: apt install vulkan-validationlayers) or turn validation off"
    )]
    NoValidationLayer,
    /// No driver offers any device.
    #[error(
        "no Vulkan device; install a driver (Debian: mesa-vulkan-drivers, which also holds the CPU driver lavapipe) and see `neubrdf info`"
    )]
    NoDevice,
    /// There are devices, but none is fit.
    #[error(
        "no Vulkan device is fit:\n{listing}\nupdate the driver, or install lavapipe (Debian: mesa-vulkan-drivers)"
    )]
    NoFitDevice {
        /// One line a device: its name and what it lacks.
        listing: String,
    },
    /// The device that was named does not exist.
    #[error("no Vulkan device matches {asked:?}; there are:\n{known}")]
    UnknownDevice {
        /// What was asked for.
        asked: String,
        /// One line a device: its index, name and driver.
        known: String,
    },
    /// The device that was named is unfit.
    #[error("{device} is unfit, it lacks: {}; update its driver or choose another device", missing.join(", "))]
    Unfit {
        /// The device's name.
        device: String,
        /// The features, extensions and limits that it lacks, by their Vulkan names.
        missing: Vec<String>,
    },
    /// No memory is left, on the device or on the host.
    #[error(
        "out of memory: {bytes} bytes for {what} on {device}; use a smaller scene or picture (or render it in crops), fewer paths in flight, or another device"
    )]
    OutOfMemory {
        /// The buffer, kernel or call that wanted it.
        what: String,
        /// The bytes asked for, 0 where the driver did not say.
        bytes: u64,
        /// The device's name.
        device: String,
    },
    /// A buffer is larger than the device allows any to be.
    #[error(
        "buffer {buffer} of {bytes} bytes: {device} allows {most}; use a smaller scene or picture (or render it in crops), or fewer paths in flight"
    )]
    BufferTooLarge {
        /// The buffer's name.
        buffer: String,
        /// The bytes asked for.
        bytes: u64,
        /// The bytes allowed (`maxMemoryAllocationSize`).
        most: u64,
        /// The device's name.
        device: String,
    },
    /// What a host's allocator gave cannot be a buffer's memory; it was given back.
    #[error("the host's allocator, asked for buffer {buffer}: {flaw}")]
    HostAllocator {
        /// The buffer's name.
        buffer: String,
        /// What is wrong with it.
        flaw: &'static str,
    },
    /// The device stopped working: a driver fault, a hang, or a bad address in a kernel.
    #[error(
        "{device} was lost during or after pass {}; update the driver, or report this with the scene and `neubrdf info`",
        last_pass.as_deref().unwrap_or("(none)")
    )]
    DeviceLost {
        /// The device's name.
        device: String,
        /// The label of the last pass that was recorded into the submission.
        last_pass: Option<String>,
    },
    /// A kernel's module or pipeline cannot be used.
    #[error("kernel {kernel}: {reason}")]
    Kernel {
        /// The kernel's name.
        kernel: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Commands were recorded that cannot be executed.
    #[error("commands cannot be executed: {0}")]
    Commands(String),
    /// A range does not lie in a buffer.
    #[error("bytes {offset}..{end} do not lie in buffer {buffer} of {size} bytes")]
    Range {
        /// The buffer's name.
        buffer: String,
        /// The first byte asked for.
        offset: u64,
        /// One past the last byte asked for.
        end: u64,
        /// The buffer's size.
        size: u64,
    },
    /// Acceleration structures were asked of a device that has none.
    #[error("{device} has no ray query (VK_KHR_ray_query); use the BVH traversal")]
    NoRayQuery {
        /// The device's name.
        device: String,
    },
    /// An acceleration structure that Vulkan cannot hold.
    #[error("acceleration structure: {0}")]
    AccelerationStructure(String),
    /// Any other Vulkan call that failed.
    #[error("{call} failed: {result}")]
    Call {
        /// The Vulkan call.
        call: &'static str,
        /// What it returned.
        result: vk::Result,
    },
}

/// The result of everything in this room.
pub type Result<T> = std::result::Result<T, Error>;
