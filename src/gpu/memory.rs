//! Where the memory of buffers comes from: from blocks of gpu-allocator's, or from whatever else a host has.

use std::ffi::c_void;
use std::sync::{Arc, Mutex};

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation as Block, AllocationCreateDesc, AllocationScheme, Allocator};

use super::buffer::Memory;
use super::instance::lock;

/// A host's allocator that is not gpu-allocator's. It is called from any thread that makes or drops what is ours, and from none in a
/// frame.
///
/// # Safety
/// What it gives is as [`HostMemory`] says, and stays so until it is given back.
pub unsafe trait HostAllocator: Send + Sync {
    /// Memory for a buffer, made for device addresses (`VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT`); `None` where none is left.
    fn allocate(&self, request: &MemoryRequest) -> Option<HostMemory>;

    /// Takes it back: no work uses it any longer, and the buffer is gone.
    fn free(&self, memory: HostMemory);
}

/// What a buffer asks of a host's allocator.
#[derive(Clone, Copy, Debug)]
pub struct MemoryRequest<'a> {
    /// The buffer's name.
    pub name: &'a str,
    /// Bytes.
    pub size: u64,
    /// The offset is a multiple of it.
    pub alignment: u64,
    /// Bit i: memory type i will do.
    pub memory_type_bits: u32,
    /// What it is for. All but [`Memory::Device`] is mapped, and coherent.
    pub memory: Memory,
}

/// A piece of a host's memory.
#[derive(Clone, Copy, Debug)]
pub struct HostMemory {
    /// What it is a piece of, of a type of the request.
    pub memory: vk::DeviceMemory,
    /// Where it begins.
    pub offset: u64,
    /// Where the CPU sees it, from its beginning on; null where it does not.
    pub mapped: *mut c_void,
    /// Of its type.
    pub properties: vk::MemoryPropertyFlags,
    /// The host's own, for [`HostAllocator::free`].
    pub handle: *mut c_void,
}

// SAFETY: the mapped memory is the buffer's alone, which guards it; the handle is only given back.
unsafe impl Send for HostMemory {}
// SAFETY: as above.
unsafe impl Sync for HostMemory {}

/// Gives memory.
#[derive(Clone)]
pub(super) enum Source {
    Blocks(Arc<Mutex<Allocator>>),
    Host(Arc<dyn HostAllocator>),
}

/// Why there is no memory.
pub(super) enum Refusal {
    /// None is left, with words of gpu-allocator's if it has any.
    NoneLeft(Option<String>),
    /// What a host's allocator gave does not do.
    Unfit(&'static str),
}

/// Memory of a buffer.
pub(super) enum Allocation {
    Block(Block),
    Host(HostMemory),
}

impl Source {
    /// Memory that meets the requirements.
    pub fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        memory: Memory,
    ) -> Result<Allocation, Refusal> {
        match self {
            Source::Blocks(allocator) => {
                let block = lock(allocator).allocate(&AllocationCreateDesc {
                    name,
                    requirements,
                    location: match memory {
                        Memory::Device => MemoryLocation::GpuOnly,
                        Memory::Upload => MemoryLocation::CpuToGpu,
                        Memory::Readback => MemoryLocation::GpuToCpu,
                    },
                    linear: true,
                    allocation_scheme: AllocationScheme::GpuAllocatorManaged,
                });
                block.map(Allocation::Block).map_err(|error| match error {
                    gpu_allocator::AllocationError::OutOfMemory => Refusal::NoneLeft(None),
                    other => Refusal::NoneLeft(Some(other.to_string())),
                })
            }
            Source::Host(allocator) => {
                let vk::MemoryRequirements { size, alignment, memory_type_bits, .. } = requirements;
                let request = MemoryRequest { name, size, alignment, memory_type_bits, memory };
                let given = allocator.allocate(&request).ok_or(Refusal::NoneLeft(None))?;
                if given.memory == vk::DeviceMemory::null() {
                    return Err(Refusal::Unfit("VkDeviceMemory is null"));
                }
                match flaw(&given, &request) {
                    None => Ok(Allocation::Host(given)),
                    Some(flaw) => {
                        allocator.free(given);
                        Err(Refusal::Unfit(flaw))
                    }
                }
            }
        }
    }

    /// Takes it back.
    pub fn free(&self, allocation: Allocation) {
        match (self, allocation) {
            (Source::Blocks(allocator), Allocation::Block(block)) => {
                // It fails only for an allocation of another allocator.
                let _ = lock(allocator).free(block);
            }
            (Source::Host(allocator), Allocation::Host(memory)) => allocator.free(memory),
            // A device's allocations are of its one source.
            _ => {}
        }
    }
}

/// What of a host's memory would go wrong far from here.
fn flaw(given: &HostMemory, request: &MemoryRequest) -> Option<&'static str> {
    use vk::MemoryPropertyFlags as Properties;
    let is_mapped =
        !given.mapped.is_null() && given.properties.contains(Properties::HOST_VISIBLE | Properties::HOST_COHERENT);
    if !given.offset.is_multiple_of(request.alignment) {
        return Some("offset is no multiple of the alignment that was asked for");
    }
    if request.memory != Memory::Device && !is_mapped {
        return Some("memory for the CPU needs `mapped`, and HOST_VISIBLE and HOST_COHERENT among `properties`");
    }
    None
}

impl Allocation {
    pub fn memory(&self) -> vk::DeviceMemory {
        match self {
            // SAFETY: it is bound to the one buffer that it was allocated for.
            Allocation::Block(block) => unsafe { block.memory() },
            Allocation::Host(host) => host.memory,
        }
    }

    pub fn offset(&self) -> u64 {
        match self {
            Allocation::Block(block) => block.offset(),
            Allocation::Host(host) => host.offset,
        }
    }

    pub fn properties(&self) -> vk::MemoryPropertyFlags {
        match self {
            Allocation::Block(block) => block.memory_properties(),
            Allocation::Host(host) => host.properties,
        }
    }

    /// Where the CPU sees it; `None` where it does not.
    pub fn mapped(&self) -> Option<*mut u8> {
        match self {
            Allocation::Block(block) => Some(block.mapped_ptr()?.as_ptr().cast()),
            Allocation::Host(host) => Some(host.mapped.cast()).filter(|pointer: &*mut u8| !pointer.is_null()),
        }
    }
}
