//! The C interface: what [`crate::plugin`] does for engines in Rust, for all others. `src/capi/neubrdf.h` is made from it by
//! cbindgen and is the page that C and C++ programmers read; `docs/embedding.md` is the one to begin with.
//!
//! - Every call returns a [`NeubrdfResult`]; [`neubrdf_last_error`] says more. No panic crosses the border.
//! - Objects are opaque, made by `_create` or `_load` and ended by `_destroy`. An object is used by one thread at a time.
//! - Structs begin with their size, so that a program that was built against an older header goes on working: what it does
//!   not know of is 0, and 0 always is what one would expect.

#![allow(unsafe_code)]

mod call;
mod change;
mod context;
mod host_mesh;
mod material_file;
mod renderer;
mod scene;

pub use call::{NeubrdfResult, neubrdf_last_error, neubrdf_version};
pub use change::*;
pub use context::*;
pub use host_mesh::*;
pub use material_file::*;
pub use renderer::*;
pub use scene::*;

/// Vulkan's handles by the names that C has for them.
mod vulkan {
    use ash::vk;

    pub type VkInstance = vk::Instance;
    pub type VkPhysicalDevice = vk::PhysicalDevice;
    pub type VkDevice = vk::Device;
    pub type VkPipelineCache = vk::PipelineCache;
    pub type VkCommandBuffer = vk::CommandBuffer;
    pub type VkImage = vk::Image;
    pub type VkBuffer = vk::Buffer;
    pub type VkImageLayout = vk::ImageLayout;
    pub type VkDeviceMemory = vk::DeviceMemory;
    pub type VkMemoryPropertyFlags = vk::MemoryPropertyFlags;
    pub type VkIndexType = vk::IndexType;
    pub type VkDeviceAddress = vk::DeviceAddress;
    pub type VkDeviceCreateInfo = vk::DeviceCreateInfo<'static>;
    #[allow(non_camel_case_types)] // its name
    pub type PFN_vkGetInstanceProcAddr = Option<vk::PFN_vkGetInstanceProcAddr>;
}
