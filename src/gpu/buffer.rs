//! Buffers: memory that kernels reach by its device address.

use std::ops::Range;
use std::sync::Arc;

use ash::vk;
use bytemuck::Pod;

use super::commands::Commands;
use super::device::{Device, Retired};
use super::error::{Error, Result};
use super::memory::{Allocation, Refusal};

/// Acceleration structures and their scratch memory want it (the specification's 256, and no device more for scratch).
const ALIGNMENT: u64 = 256;
/// What is copied at once through a staging buffer.
const STAGING_BYTES: u64 = 64 << 20;
/// On CPU drivers no buffer is larger, and none crosses a multiple of twice that: the walk of `glsl/lib/walk_packet.glsl` adds to the lower half
/// of an address alone.
const CPU_BYTES: u64 = 2 << 30;

/// Where a buffer's memory lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Memory {
    /// Where the device reads fastest.
    Device,
    /// Written by the host, read by the device.
    Upload,
    /// Written by the device, read by the host.
    Readback,
}

/// A buffer. Its contents are undefined until something writes it.
pub struct Buffer {
    pub(super) raw: vk::Buffer,
    pub(super) device: Arc<Device>,
    name: String,
    address: u64,
    size: u64,
    memory: Memory,
    // Taken only by Drop.
    allocation: Option<Allocation>,
}

impl Buffer {
    /// Makes a buffer of `bytes` bytes, for every use: storage, copies, indirect dispatch, acceleration structure input.
    /// `name` appears in errors, validation messages and captures. Its address is a multiple of 256, and on CPU drivers the same in its
    /// upper 32 bits from the first byte to the last.
    ///
    /// # Errors
    /// Out of memory, or more than the device allows in one buffer.
    pub fn new(device: &Arc<Device>, name: &str, bytes: u64, memory: Memory) -> Result<Buffer> {
        // What crosses such a line stays there until there is one that does not.
        let mut crossing = vec![];
        loop {
            let buffer = Buffer::somewhere(device, name, bytes, memory)?;
            if !device.profile().is_cpu || !crosses(buffer.address, bytes) {
                return Ok(buffer);
            }
            crossing.push(buffer);
        }
    }

    fn somewhere(device: &Arc<Device>, name: &str, bytes: u64, memory: Memory) -> Result<Buffer> {
        use vk::BufferUsageFlags as Usage;
        let mut usage = Usage::STORAGE_BUFFER
            | Usage::TRANSFER_SRC
            | Usage::TRANSFER_DST
            | Usage::SHADER_DEVICE_ADDRESS
            | Usage::INDIRECT_BUFFER;
        if device.has_ray_query() {
            usage |=
                Usage::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR | Usage::ACCELERATION_STRUCTURE_STORAGE_KHR;
        }
        let limit = device.limits().max_memory_allocation_size;
        let most = if device.profile().is_cpu { limit.min(CPU_BYTES) } else { limit };
        if bytes > most {
            let (buffer, device) = (name.to_string(), device.name().to_string());
            return Err(Error::BufferTooLarge { buffer, bytes, most, device });
        }
        // Work that is done may still hold memory.
        device.free_retired();
        // Vulkan has no empty buffers, and fills go by words.
        let bytes_made = bytes.max(4).next_multiple_of(4);
        let info = vk::BufferCreateInfo::default().size(bytes_made).usage(usage);
        // SAFETY: the device is alive and has what the usage asks for.
        let raw = unsafe { device.raw.create_buffer(&info, None) }.map_err(|_| device.out_of_memory(name, bytes))?;
        // SAFETY: the buffer is this device's.
        let mut requirements = unsafe { device.raw.get_buffer_memory_requirements(raw) };
        requirements.alignment = requirements.alignment.max(ALIGNMENT);
        let allocation = match &device.memory {
            Some(source) => source.allocate(name, requirements, memory).map_err(|refusal| match refusal {
                Refusal::NoneLeft(Some(words)) => device.out_of_memory(&format!("{name} ({words})"), bytes),
                Refusal::NoneLeft(None) => device.out_of_memory(name, bytes),
                Refusal::Unfit(flaw) => Error::HostAllocator { buffer: name.to_string(), flaw },
            }),
            None => Err(device.out_of_memory(name, bytes)),
        };
        let allocation = match allocation {
            Ok(allocation) => allocation,
            Err(error) => {
                // SAFETY: nothing knows of the buffer yet.
                unsafe { device.raw.destroy_buffer(raw, None) };
                return Err(error);
            }
        };
        // SAFETY: the memory is as large and as aligned as the buffer requires, and nothing else is bound there.
        let bound = unsafe { device.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) };
        if let Err(result) = bound {
            device.retire(Retired::Buffer(raw, allocation));
            return Err(device.error("vkBindBufferMemory")(result));
        }
        device.set_name(raw, name);
        // SAFETY: the buffer has memory, and was made with SHADER_DEVICE_ADDRESS.
        let address =
            unsafe { device.raw.get_buffer_device_address(&vk::BufferDeviceAddressInfo::default().buffer(raw)) };
        Ok(Buffer {
            raw,
            device: device.clone(),
            name: name.to_string(),
            address,
            size: bytes,
            memory,
            allocation: Some(allocation),
        })
    }

    /// Makes a buffer in device memory that holds `data`; waits for the copy.
    ///
    /// # Errors
    /// Out of memory, or a lost device.
    pub fn with_data<T: Pod>(device: &Arc<Device>, name: &str, data: &[T]) -> Result<Buffer> {
        let buffer = Buffer::new(device, name, size_of_val(data) as u64, Memory::Device)?;
        buffer.write(0, data)?;
        Ok(buffer)
    }

    /// The address that kernels know it by.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// Its bytes, as asked for.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The Vulkan handle, for a host's own commands.
    pub fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// The bytes of an upload or read-back buffer; none of one in device memory. The device must not be writing them.
    pub fn mapped(&self) -> Option<&[u8]> {
        if self.memory == Memory::Device { None } else { self.bytes() }
    }

    /// The bytes of an upload or read-back buffer to write; none of one in device memory. The device must not be using them.
    pub fn mapped_mut(&mut self) -> Option<&mut [u8]> {
        if self.memory == Memory::Device {
            return None;
        }
        let pointer = self.allocation.as_ref()?.mapped()?;
        // SAFETY: as many bytes are mapped there, and are this buffer's alone.
        Some(unsafe { std::slice::from_raw_parts_mut(pointer, self.size as usize) })
    }

    /// Everything in it, once all submitted work is done. What does not fill a `T` at its end is left out.
    ///
    /// # Errors
    /// Out of memory, or a lost device.
    pub fn read<T: Pod>(&self) -> Result<Vec<T>> {
        self.read_range(0..self.size as usize / size_of::<T>().max(1))
    }

    /// The elements of that range, counted in `T`s from the buffer's start, once all submitted work is done.
    ///
    /// # Errors
    /// The range is not in the buffer, out of memory, or a lost device.
    pub fn read_range<T: Pod>(&self, elements: Range<usize>) -> Result<Vec<T>> {
        let size = size_of::<T>() as u64;
        let range = self.range(elements.start as u64 * size, elements.len() as u64 * size)?;
        let mut data = vec![T::zeroed(); elements.len()];
        let out: &mut [u8] = bytemuck::cast_slice_mut(&mut data);
        self.device.wait()?;
        if let Some(bytes) = self.bytes().filter(|_| self.is_cached()) {
            out.copy_from_slice(&bytes[range.start as usize..range.end as usize]);
            return Ok(data);
        }
        let staging_bytes = (range.end - range.start).min(STAGING_BYTES);
        let staging = Buffer::new(&self.device, "read-back staging", staging_bytes, Memory::Readback)?;
        for (i, part) in out.chunks_mut(STAGING_BYTES as usize).enumerate() {
            let mut commands = Commands::begin(&self.device)?;
            let from = range.start + i as u64 * STAGING_BYTES;
            commands.copy(self, from, &staging, 0, part.len() as u64);
            self.device.submit(commands)?.wait()?;
            let bytes = staging.bytes().ok_or_else(|| unmapped(&staging))?;
            part.copy_from_slice(&bytes[..part.len()]);
        }
        Ok(data)
    }

    /// Writes `data` at byte `offset`, after all submitted work, and waits until it is there.
    ///
    /// # Errors
    /// It does not fit in the buffer, out of memory, or a lost device.
    pub fn write<T: Pod>(&self, offset: u64, data: &[T]) -> Result<()> {
        let data: &[u8] = bytemuck::cast_slice(data);
        let range = self.range(offset, data.len() as u64)?;
        if data.is_empty() {
            return Ok(());
        }
        if let Some(pointer) = self.pointer() {
            self.device.wait()?;
            // SAFETY: the range lies in the mapped memory; the device is idle, and Rust holds no reference into the
            // memory but those of `mapped` (of `&self`), which the caller must not read while it writes.
            unsafe {
                std::ptr::copy_nonoverlapping(data.as_ptr(), pointer.add(range.start as usize), data.len());
            }
            return Ok(());
        }
        let staging_bytes = (data.len() as u64).min(STAGING_BYTES);
        let mut staging = Buffer::new(&self.device, "upload staging", staging_bytes, Memory::Upload)?;
        for (i, part) in data.chunks(STAGING_BYTES as usize).enumerate() {
            match staging.mapped_mut() {
                Some(bytes) => bytes[..part.len()].copy_from_slice(part),
                None => return Err(unmapped(&staging)),
            }
            let mut commands = Commands::begin(&self.device)?;
            commands.copy(&staging, 0, self, range.start + i as u64 * STAGING_BYTES, part.len() as u64);
            self.device.submit(commands)?.wait()?;
        }
        Ok(())
    }

    /// The range of `bytes` bytes from `offset`, if it lies in the buffer.
    pub(super) fn range(&self, offset: u64, bytes: u64) -> Result<Range<u64>> {
        let end = offset.saturating_add(bytes);
        match end <= self.size {
            true => Ok(offset..end),
            false => Err(Error::Range { buffer: self.name.clone(), offset, end, size: self.size }),
        }
    }

    /// The memory, where the host sees it without flushing: also device memory on CPU drivers and integrated GPUs.
    fn pointer(&self) -> Option<*mut u8> {
        let allocation = self.allocation.as_ref()?;
        let coherent = allocation.properties().contains(vk::MemoryPropertyFlags::HOST_COHERENT);
        allocation.mapped().filter(|_| coherent)
    }

    /// Whether the host reads the memory through its caches; reading the rest is slower than copying it on the device.
    fn is_cached(&self) -> bool {
        let properties = self.allocation.as_ref().map(Allocation::properties);
        properties.is_some_and(|properties| properties.contains(vk::MemoryPropertyFlags::HOST_CACHED))
    }

    fn bytes(&self) -> Option<&[u8]> {
        // SAFETY: as many bytes are mapped there, and are this buffer's alone.
        Some(unsafe { std::slice::from_raw_parts(self.pointer()?, self.size as usize) })
    }
}

/// Whether the upper half of an address changes within the buffer.
fn crosses(address: u64, bytes: u64) -> bool {
    address >> 32 != (address + bytes.max(1) - 1) >> 32
}

fn unmapped(buffer: &Buffer) -> Error {
    Error::Commands(format!("the driver gave buffer {} memory that the host cannot see", buffer.name))
}

impl Drop for Buffer {
    fn drop(&mut self) {
        if let Some(allocation) = self.allocation.take() {
            self.device.retire(Retired::Buffer(self.raw, allocation));
        }
    }
}
