//! What a host must enable, and the device that it lends.

use std::ffi::{CString, c_char, c_void};
use std::sync::Arc;

use super::call::{Failure, NeubrdfResult, call, end, hand_over, object, read, sized_structs};
use super::vulkan::*;
use crate::gpu::{
    Additions, Device, HostAllocator, HostDevice, HostMemory, Memory, MemoryRequest, Requirements, requirements,
};

/// What a physical device is to be opened with.
pub struct NeubrdfRequirements {
    inner: Requirements,
    missing: CString,
    has_ray_query: bool,
    /// Of each merge, as structures of hosts point to them. (Boxed: they stay where they are.)
    #[allow(clippy::vec_box)]
    additions: Vec<Box<Additions>>,
}

/// A host's device. Nothing of it is ever destroyed, submitted to or waited for.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfHost {
    /// sizeof(NeubrdfHost).
    pub size: u32,
    /// The family of the queue that the command buffers go to; it computes.
    pub queue_family: u32,
    /// The loader's.
    pub get_instance_proc_addr: PFN_vkGetInstanceProcAddr,
    /// For Vulkan 1.2 or later.
    pub instance: VkInstance,
    /// What the device is of.
    pub physical_device: VkPhysicalDevice,
    /// Made with what the requirements say.
    pub device: VkDevice,
    /// Keeps our pipelines; VK_NULL_HANDLE is a cache of our own, in memory.
    pub pipeline_cache: VkPipelineCache,
    /// Not 0 if ray query is enabled on the device: what `neubrdf_requirements_has_ray_query` said when it was made.
    pub ray_query: u32,
    /// Not 0 if the instance has VK_EXT_debug_utils: our passes and objects then have names in captures.
    pub debug_utils: u32,
    /// Gives the memory of our buffers; null is an allocator of our own. Called from any thread that makes or ends objects, or changes a
    /// renderer's scene, and from none in a frame. Returns 0 and fills `memory`, or anything else where no memory is left.
    pub allocate: Option<
        unsafe extern "C" fn(
            user: *mut c_void,
            request: *const NeubrdfMemoryRequest,
            memory: *mut NeubrdfMemory,
        ) -> i32,
    >,
    /// Takes it back: the buffer is gone. Called from those threads too, and from one in `neubrdf_renderer_complete`, which gives back what the
    /// recordings that are done used alone.
    pub free: Option<unsafe extern "C" fn(user: *mut c_void, memory: *const NeubrdfMemory)>,
    /// The host's own, for these two.
    pub user: *mut c_void,
}

/// What memory is for.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeubrdfMemoryUse {
    /// The device reads and writes it.
    Device = 0,
    /// The CPU writes, the device reads: mapped, coherent.
    Upload = 1,
    /// The device writes, the CPU reads: mapped, coherent, better cached.
    Readback = 2,
}

/// Memory that a buffer asks for, from one VkDeviceMemory made with VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfMemoryRequest {
    /// sizeof(NeubrdfMemoryRequest), as this library has it.
    pub size: u32,
    /// A NeubrdfMemoryUse.
    pub memory_use: u32,
    /// Bytes.
    pub bytes: u64,
    /// The offset is a multiple of it.
    pub alignment: u64,
    /// Bit i: memory type i will do.
    pub memory_type_bits: u32,
    /// Nothing.
    pub reserved: u32,
    /// What the buffer is called; valid during the call.
    pub name: *const c_char,
}

/// A piece of the host's memory.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfMemory {
    /// What it is a piece of.
    pub memory: VkDeviceMemory,
    /// Where it begins.
    pub offset: u64,
    /// Where the CPU sees it, from its beginning on; null where it does not.
    pub mapped: *mut c_void,
    /// VkMemoryPropertyFlags of its type.
    pub properties: u32,
    /// Nothing.
    pub reserved: u32,
    /// The host's own.
    pub handle: *mut c_void,
}

/// A host's functions.
struct Callbacks {
    allocate: unsafe extern "C" fn(*mut c_void, *const NeubrdfMemoryRequest, *mut NeubrdfMemory) -> i32,
    free: unsafe extern "C" fn(*mut c_void, *const NeubrdfMemory),
    user: *mut c_void,
}

// SAFETY: the header says that they are called from several threads.
unsafe impl Send for Callbacks {}
// SAFETY: as above.
unsafe impl Sync for Callbacks {}

// SAFETY: the host's functions do what the header says.
unsafe impl HostAllocator for Callbacks {
    fn allocate(&self, request: &MemoryRequest) -> Option<HostMemory> {
        let name = CString::new(request.name).unwrap_or_default();
        let request = NeubrdfMemoryRequest {
            size: size_of::<NeubrdfMemoryRequest>() as u32,
            memory_use: match request.memory {
                Memory::Device => NeubrdfMemoryUse::Device,
                Memory::Upload => NeubrdfMemoryUse::Upload,
                Memory::Readback => NeubrdfMemoryUse::Readback,
            } as u32,
            bytes: request.size,
            alignment: request.alignment,
            memory_type_bits: request.memory_type_bits,
            reserved: 0,
            name: name.as_ptr(),
        };
        let mut memory = NeubrdfMemory {
            memory: VkDeviceMemory::null(),
            offset: 0,
            mapped: std::ptr::null_mut(),
            properties: 0,
            reserved: 0,
            handle: std::ptr::null_mut(),
        };
        // SAFETY: as the header says; both pointers are valid during the call.
        let result = unsafe { (self.allocate)(self.user, &raw const request, &raw mut memory) };
        let NeubrdfMemory { memory, offset, mapped, properties, handle, .. } = memory;
        let properties = VkMemoryPropertyFlags::from_raw(properties);
        (result == 0).then_some(HostMemory { memory, offset, mapped, properties, handle })
    }

    fn free(&self, memory: HostMemory) {
        let HostMemory { memory, offset, mapped, properties, handle } = memory;
        let memory = NeubrdfMemory { memory, offset, mapped, properties: properties.as_raw(), reserved: 0, handle };
        // SAFETY: as above.
        unsafe { (self.free)(self.user, &raw const memory) };
    }
}

sized_structs! {
    NeubrdfHost: 56 {
        size, queue_family, get_instance_proc_addr, instance, physical_device, device, pipeline_cache, ray_query, debug_utils, allocate,
        free, user,
    }
}

/// A device lent to us.
pub struct NeubrdfContext {
    pub(super) device: Arc<Device>,
}

/// Asks what a physical device is to be opened with. The instance is for Vulkan 1.2 or later.
///
/// # Safety
/// The handles belong together; `requirements` points to room for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_requirements_create(
    get_instance_proc_addr: PFN_vkGetInstanceProcAddr,
    instance: VkInstance,
    physical_device: VkPhysicalDevice,
    requirements: *mut *mut NeubrdfRequirements,
) -> NeubrdfResult {
    call(|| {
        let Some(get_instance_proc_addr) = get_instance_proc_addr else {
            return Err(Failure::argument("get_instance_proc_addr is null"));
        };
        // SAFETY: as the caller says.
        let inner = unsafe {
            let entry = ash::Entry::from_static_fn(ash::StaticFn { get_instance_proc_addr });
            let instance = ash::Instance::load(entry.static_fn(), instance);
            self::requirements(&instance, physical_device)
        };
        let missing = CString::new(inner.missing.join(", ")).unwrap_or_default();
        let has_ray_query = inner.ray_query;
        // SAFETY: as the caller says.
        unsafe { hand_over(requirements, NeubrdfRequirements { inner, missing, has_ray_query, additions: Vec::new() }) }
    })
}

/// What makes the device unfit, by Vulkan's names, separated by commas; empty for a fit one. Valid as long as the requirements.
///
/// # Safety
/// The object is alive, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_requirements_missing(requirements: *const NeubrdfRequirements) -> *const c_char {
    // SAFETY: as the caller says.
    unsafe { requirements.as_ref() }.map_or(c"the requirements are null".as_ptr(), |it| it.missing.as_ptr())
}

/// Not 0 if the device has ray query, which is then asked for too, unless the last merge declined it.
///
/// # Safety
/// The object is alive, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_requirements_has_ray_query(requirements: *const NeubrdfRequirements) -> u32 {
    // SAFETY: as the caller says.
    unsafe { requirements.as_ref() }.map_or(0, |it| it.inner.ray_query.into())
}

/// Adds what is needed to what the host enables anyway: extensions to the list, features to the structures of the pNext chain that
/// hold them, and structures of our own for what no structure there holds. `wants_ray_query` of 0 declines ray query: rays then
/// walk a BVH in a compute shader. The requirements must live until vkCreateDevice returns. To ask once more, say because vkCreateDevice
/// refused, begin with an `info`, and structures of its chain, as they were before.
///
/// # Safety
/// `info`, its chain and its names are valid; the structures of the chain may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_requirements_merge(
    requirements: *mut NeubrdfRequirements,
    wants_ray_query: u32,
    info: *mut VkDeviceCreateInfo,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (requirements, info) = unsafe { (object(requirements, "requirements")?, object(info, "info")?) };
        requirements.inner.ray_query = requirements.has_ray_query && wants_ray_query != 0;
        requirements.additions.push(Box::default());
        if let Some(room) = requirements.additions.last_mut() {
            // SAFETY: the room lives as long as the requirements do, which the caller keeps until the device is made.
            *info = unsafe { requirements.inner.merge(*info, room) };
        }
        Ok(())
    })
}

/// Ends the requirements.
///
/// # Safety
/// The object is alive, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_requirements_destroy(requirements: *mut NeubrdfRequirements) {
    // SAFETY: as the caller says.
    unsafe { end(requirements) }
}

/// Borrows a host's device.
///
/// # Safety
/// The handles belong together and outlive the context and all that is made from it; the device was made with what the
/// requirements say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_context_create(
    host: *const NeubrdfHost,
    context: *mut *mut NeubrdfContext,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let host = unsafe { read(host)? };
        let Some(get_instance_proc_addr) = host.get_instance_proc_addr else {
            return Err(Failure::argument("NeubrdfHost.get_instance_proc_addr is null"));
        };
        let NeubrdfHost { instance, physical_device, device, queue_family, user, .. } = host;
        let host_allocator: Option<Arc<dyn HostAllocator>> = match (host.allocate, host.free) {
            (Some(allocate), Some(free)) => Some(Arc::new(Callbacks { allocate, free, user })),
            (None, None) => None,
            _ => return Err(Failure::argument("NeubrdfHost.allocate without .free, or .free without .allocate")),
        };
        // SAFETY: as the caller says.
        unsafe {
            let lent = HostDevice::load(get_instance_proc_addr, instance, physical_device, device, queue_family);
            let device = Device::from_host(HostDevice {
                ray_query: host.ray_query != 0,
                debug_utils: host.debug_utils != 0,
                pipeline_cache: host.pipeline_cache,
                host_allocator,
                ..lent
            })?;
            hand_over(context, NeubrdfContext { device })
        }
    })
}

/// Ends the context; renderers made from it stay alive.
///
/// # Safety
/// The object is alive, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_context_destroy(context: *mut NeubrdfContext) {
    // SAFETY: as the caller says.
    unsafe { end(context) }
}
