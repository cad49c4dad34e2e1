//! A host's meshes in device memory, as far as we read them.

/// Numbers of a host's vertices: some `f32` of each, in a buffer of their own or between others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostArray {
    pub(crate) address: u64,
    pub(crate) stride: u32,
    pub(crate) count: u32,
}

/// Three vertices for each triangle, counter-clockwise seen from the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostIndices {
    pub(crate) address: u64,
    pub(crate) format: IndexFormat,
    pub(crate) triangles: u32,
}

/// How wide an index is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IndexFormat {
    /// `VK_INDEX_TYPE_UINT32`
    U32,
    /// `VK_INDEX_TYPE_UINT16`
    U16,
}

/// What of a host's vertices moves when a mesh changes its shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostVertices {
    /// x, y, z of each, object space.
    pub positions: HostArray,
    /// Unit shading normals; `None` for a flat mesh.
    pub normals: Option<HostArray>,
}

/// A mesh that a host has on the device. It is read by the commands of one recording, as a compute shader reads: what wrote it
/// is done by then for the stage [`COMPUTE_SHADER`](ash::vk::PipelineStageFlags::COMPUTE_SHADER) and
/// [`SHADER_READ`](ash::vk::AccessFlags::SHADER_READ), and what writes it afterwards waits for that stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostMesh {
    /// Its vertices.
    pub vertices: HostVertices,
    /// Texture coordinates, v up; `None` for none.
    pub uvs: Option<HostArray>,
    /// Its triangles. A vertex that is not there is taken for the last.
    pub indices: HostIndices,
}

impl HostArray {
    /// `count` vertices whose numbers begin `stride` bytes apart, from a buffer's device address plus the attribute's offset on.
    ///
    /// # Safety
    /// The buffer is of the device that reads it, was made with `SHADER_DEVICE_ADDRESS`, belongs to the queue's family or is
    /// shared, and lives until the commands that read it are done. Each vertex has the attribute's numbers there, finite.
    pub unsafe fn new(address: u64, stride: u32, count: u32) -> HostArray {
        HostArray { address, stride, count }
    }
}

impl HostIndices {
    /// `triangles` triangles from a buffer's device address plus the offset of the first index on.
    ///
    /// # Safety
    /// As of [`HostArray::new`]. Words are read whole: of `u16` the buffer has an even number.
    pub unsafe fn new(address: u64, format: IndexFormat, triangles: u32) -> HostIndices {
        HostIndices { address, format, triangles }
    }
}
