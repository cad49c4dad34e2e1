//! A host's images and buffers, as far as we write them.

use ash::vk;

/// A part of a host's image to write: all of its first mip level and layer, or what is left of it from `origin` on.
#[derive(Clone, Copy, Debug)]
pub struct HostImage {
    pub(super) raw: vk::Image,
    size: [u32; 2],
    pub(super) origin: [u32; 2],
    pub(super) before: vk::ImageLayout,
    pub(super) after: vk::ImageLayout,
}

impl HostImage {
    /// A colour image of so many texels across and down, that is in [`TRANSFER_DST_OPTIMAL`](vk::ImageLayout::TRANSFER_DST_OPTIMAL) and
    /// stays in it. What the host did to it before must be done for [`TRANSFER`](vk::PipelineStageFlags::TRANSFER) writes; what it does to it
    /// afterwards waits for them.
    ///
    /// # Safety
    /// The image has that size and is of the device that writes it, lives until the commands that write it are done, has one sample a
    /// texel and the usage `TRANSFER_DST`, is two-dimensional, and of a colour format whose texels are as many bytes as are
    /// written for each; it belongs to the queue's family, or is shared.
    pub unsafe fn new(raw: vk::Image, size: [u32; 2]) -> HostImage {
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        HostImage { raw, size, origin: [0, 0], before: layout, after: layout }
    }

    /// Texels across and down from the origin on.
    pub fn room(&self) -> [u32; 2] {
        [0, 1].map(|side| self.size[side].saturating_sub(self.origin[side]))
    }

    /// The same in other layouts, with the transitions recorded too. `before` is
    /// [`UNDEFINED`](vk::ImageLayout::UNDEFINED) where the old texels may go. The transition from a `before` that is not
    /// `TRANSFER_DST_OPTIMAL` waits for all commands before it; that to such an `after` lets all commands after it wait.
    pub fn with_layouts(self, before: vk::ImageLayout, after: vk::ImageLayout) -> HostImage {
        HostImage { before, after, ..self }
    }

    /// The same, written from the texel (column, row) on.
    pub fn with_origin(self, origin: [u32; 2]) -> HostImage {
        HostImage { origin, ..self }
    }
}

/// A part of a host's buffer to write.
#[derive(Clone, Copy, Debug)]
pub struct HostBuffer {
    pub(super) raw: vk::Buffer,
    pub(super) offset: u64,
    pub(super) size: u64,
}

impl HostBuffer {
    /// The `size` bytes from byte `offset` on. What the host did to them before must be done for
    /// [`TRANSFER`](vk::PipelineStageFlags::TRANSFER) writes; what it does to them afterwards waits for those.
    ///
    /// # Safety
    /// The buffer is of the device that writes it, lives until the commands that write it are done, has the usage
    /// `TRANSFER_DST`, at least `offset + size` bytes, and belongs to the queue's family, or is shared.
    pub unsafe fn new(raw: vk::Buffer, offset: u64, size: u64) -> HostBuffer {
        HostBuffer { raw, offset, size }
    }

    /// Bytes from the offset on.
    pub fn size(&self) -> u64 {
        self.size
    }
}
