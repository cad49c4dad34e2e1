//! A layer between a host's device and who uses it by its raw handles: it counts the calls that make something and those that
//! submit or wait, refuses one of the former when told to, and stops the device in the middle of a recording.

use std::ffi::{CStr, c_char, c_void};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;

static TURN: Mutex<()> = Mutex::new(());
static MADE: AtomicU64 = AtomicU64::new(0);
static WAITED: AtomicU64 = AtomicU64::new(0);
/// Calls that make something and are still granted.
static GRANTED: AtomicU64 = AtomicU64::new(u64::MAX);
/// Indirect dispatches before the one that waits for [`EVENT`].
static UNTIL_EVENT: AtomicU64 = AtomicU64::new(u64::MAX);
static EVENT: AtomicU64 = AtomicU64::new(0);

/// The layer is one for all devices: a test has it to itself.
pub fn begin() -> MutexGuard<'static, ()> {
    let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    for count in [&MADE, &WAITED] {
        count.store(0, Ordering::SeqCst);
    }
    turn
}

/// Calls so far that make something: objects, pools, memory.
pub fn made() -> u64 {
    MADE.load(Ordering::SeqCst)
}

/// Calls so far that submit or wait.
pub fn waited() -> u64 {
    WAITED.load(Ordering::SeqCst)
}

/// Grants so many more calls that make something, and refuses the next one, for want of memory. Says whether it came to that.
pub fn with_a_refusal_after<T>(granted: u64, body: impl FnOnce() -> T) -> (T, bool) {
    GRANTED.store(granted, Ordering::SeqCst);
    let result = body();
    (result, GRANTED.swap(u64::MAX, Ordering::SeqCst) > granted)
}

/// Whether that which is asked for is refused: the count goes below zero once, and on from there.
pub fn refuses() -> bool {
    MADE.fetch_add(1, Ordering::SeqCst);
    GRANTED.load(Ordering::SeqCst) != u64::MAX && GRANTED.fetch_sub(1, Ordering::SeqCst) == 0
}

/// The recording waits for the event before so many indirect dispatches more.
pub fn wait_for_event_before(dispatch: u64, event: vk::Event) {
    EVENT.store(vk::Handle::as_raw(event), Ordering::SeqCst);
    UNTIL_EVENT.store(dispatch, Ordering::SeqCst);
}

type Function = unsafe extern "system" fn();

/// Names of functions that return a result, and whether they make something.
macro_rules! layer {
    ($($makes:literal $name:literal $function:ident($($parameter:ident: $kind:ty),*);)*) => {
        $(mod $function {
            use super::*;

            pub static NEXT: AtomicPtr<c_void> = AtomicPtr::new(null_mut());

            pub unsafe extern "system" fn call($($parameter: $kind),*) -> vk::Result {
                if !$makes {
                    WAITED.fetch_add(1, Ordering::SeqCst);
                } else if refuses() {
                    return vk::Result::ERROR_OUT_OF_DEVICE_MEMORY;
                }
                let next = NEXT.load(Ordering::SeqCst);
                // SAFETY: it is the function of that name, called as we were.
                unsafe {
                    let next: unsafe extern "system" fn($($kind),*) -> vk::Result = std::mem::transmute(next);
                    next($($parameter),*)
                }
            }
        })*

        /// Our function of that name, which calls the other.
        fn over(name: &CStr, next: Function) -> Function {
            let slot: (&AtomicPtr<c_void>, *const ()) = match name.to_bytes() {
                $($name => (&$function::NEXT, $function::call as *const ()),)*
                b"vkCmdDispatchIndirect" => (&NEXT_DISPATCH, dispatch_indirect as *const ()),
                b"vkCmdWaitEvents" => {
                    NEXT_WAIT.store(next as *mut c_void, Ordering::SeqCst);
                    return next;
                }
                _ => return next,
            };
            slot.0.store(next as *mut c_void, Ordering::SeqCst);
            // SAFETY: only called as the function of that name.
            unsafe { std::mem::transmute::<*const (), Function>(slot.1) }
        }
    };
}

type Callbacks = *const c_void;

layer! {
    true b"vkAllocateMemory" allocate_memory(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkBindBufferMemory" bind_buffer_memory(device: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: u64);
    true b"vkCreateBuffer" create_buffer(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkCreateSemaphore" create_semaphore(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkCreateFence" create_fence(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkCreateShaderModule" create_shader_module(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkCreatePipelineCache" create_pipeline_cache(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkCreatePipelineLayout" create_pipeline_layout(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkCreateComputePipelines" create_compute_pipelines(
        device: vk::Device, cache: vk::PipelineCache, count: u32, info: *const c_void, callbacks: Callbacks, out: *mut c_void
    );
    true b"vkCreateDescriptorSetLayout" create_descriptor_set_layout(
        device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void
    );
    true b"vkCreateDescriptorPool" create_descriptor_pool(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkAllocateDescriptorSets" allocate_descriptor_sets(device: vk::Device, info: *const c_void, out: *mut c_void);
    true b"vkCreateCommandPool" create_command_pool(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkAllocateCommandBuffers" allocate_command_buffers(device: vk::Device, info: *const c_void, out: *mut c_void);
    true b"vkCreateQueryPool" create_query_pool(device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void);
    true b"vkCreateAccelerationStructureKHR" create_acceleration_structure(
        device: vk::Device, info: *const c_void, callbacks: Callbacks, out: *mut c_void
    );
    false b"vkQueueSubmit" queue_submit(queue: vk::Queue, count: u32, submits: *const c_void, fence: vk::Fence);
    false b"vkQueueWaitIdle" queue_wait_idle(queue: vk::Queue);
    false b"vkDeviceWaitIdle" device_wait_idle(device: vk::Device);
    false b"vkWaitForFences" wait_for_fences(device: vk::Device, count: u32, fences: *const vk::Fence, all: vk::Bool32, timeout: u64);
    false b"vkWaitSemaphores" wait_semaphores(device: vk::Device, info: *const c_void, timeout: u64);
}

static NEXT_DISPATCH: AtomicPtr<c_void> = AtomicPtr::new(null_mut());
static NEXT_WAIT: AtomicPtr<c_void> = AtomicPtr::new(null_mut());
static NEXT_INSTANCE: AtomicPtr<c_void> = AtomicPtr::new(null_mut());
static NEXT_DEVICE: AtomicPtr<c_void> = AtomicPtr::new(null_mut());

unsafe extern "system" fn dispatch_indirect(commands: vk::CommandBuffer, buffer: vk::Buffer, offset: u64) {
    // SAFETY: the functions are those of these names, called as Vulkan says; the event lives until the recording is done.
    unsafe {
        if UNTIL_EVENT.load(Ordering::SeqCst) != u64::MAX && UNTIL_EVENT.fetch_sub(1, Ordering::SeqCst) == 0 {
            let wait: vk::PFN_vkCmdWaitEvents = std::mem::transmute(NEXT_WAIT.load(Ordering::SeqCst));
            let event: vk::Event = vk::Handle::from_raw(EVENT.load(Ordering::SeqCst));
            let (host, shaders) = (vk::PipelineStageFlags::HOST, vk::PipelineStageFlags::COMPUTE_SHADER);
            let none = std::ptr::null();
            wait(commands, 1, &event, host, shaders, 0, none, 0, none.cast(), 0, none.cast());
        }
        let next: vk::PFN_vkCmdDispatchIndirect = std::mem::transmute(NEXT_DISPATCH.load(Ordering::SeqCst));
        next(commands, buffer, offset);
    }
}

unsafe extern "system" fn get_instance_proc_addr(
    instance: vk::Instance,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    // SAFETY: the loader's function, called as we were; Vulkan's names are C strings.
    unsafe {
        let next: vk::PFN_vkGetInstanceProcAddr = std::mem::transmute(NEXT_INSTANCE.load(Ordering::SeqCst));
        let found = next(instance, name)?;
        if CStr::from_ptr(name) != c"vkGetDeviceProcAddr" {
            return Some(found);
        }
        NEXT_DEVICE.store(found as *mut c_void, Ordering::SeqCst);
        Some(std::mem::transmute::<*const (), Function>(get_device_proc_addr as *const ()))
    }
}

unsafe extern "system" fn get_device_proc_addr(device: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: as above.
    unsafe {
        let next: vk::PFN_vkGetDeviceProcAddr = std::mem::transmute(NEXT_DEVICE.load(Ordering::SeqCst));
        Some(over(CStr::from_ptr(name), next(device, name)?))
    }
}

/// The layer over the loader's function.
pub fn over_loader(next: vk::PFN_vkGetInstanceProcAddr) -> vk::PFN_vkGetInstanceProcAddr {
    NEXT_INSTANCE.store(next as *mut c_void, Ordering::SeqCst);
    get_instance_proc_addr
}
