//! Buffers that the CPU sees.

use std::error::Error;

use neubrdf::gpu::ash::{self, vk};

/// A buffer that the CPU sees, all of it.
pub struct Mapped {
    pub buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    pub bytes: *mut u8,
    pub size: usize,
}

impl Mapped {
    pub unsafe fn new(
        (instance, physical, device): (&ash::Instance, vk::PhysicalDevice, &ash::Device),
        size: usize,
        usage: vk::BufferUsageFlags,
    ) -> Result<Mapped, Box<dyn Error>> {
        // SAFETY: the memory is as large as the buffer requires, and stays mapped until it is freed.
        unsafe {
            let info = vk::BufferCreateInfo::default().size(size as u64).usage(usage);
            let buffer = device.create_buffer(&info, None)?;
            let requirements = device.get_buffer_memory_requirements(buffer);
            let visible = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
            let types = instance.get_physical_device_memory_properties(physical);
            let fits = |index: &u32| {
                requirements.memory_type_bits >> index & 1 == 1
                    && types.memory_types[*index as usize].property_flags.contains(visible)
            };
            let index = (0..types.memory_type_count).find(fits).ok_or("no memory that the host sees")?;
            let info = vk::MemoryAllocateInfo::default().allocation_size(requirements.size).memory_type_index(index);
            let memory = device.allocate_memory(&info, None)?;
            device.bind_buffer_memory(buffer, memory, 0)?;
            let bytes = device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())?.cast();
            Ok(Mapped { buffer, memory, bytes, size })
        }
    }

    /// A picture's bytes, red first; the device is done with them.
    pub unsafe fn pixels(&self, blue_first: bool) -> Vec<u8> {
        // SAFETY: as many bytes are mapped, and nothing writes them.
        let mut pixels = unsafe { std::slice::from_raw_parts(self.bytes, self.size) }.to_vec();
        if blue_first {
            pixels.chunks_exact_mut(4).for_each(|pixel| pixel.swap(0, 2));
        }
        pixels
    }

    pub unsafe fn destroy(&self, device: &ash::Device) {
        // SAFETY: nothing uses it any longer.
        unsafe {
            device.destroy_buffer(self.buffer, None);
            device.free_memory(self.memory, None);
        }
    }
}
