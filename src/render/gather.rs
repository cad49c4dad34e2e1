//! A host's meshes, gathered on the device into buffers like those of our own: tight, with indices of 32 bits that are in range.
//!
//! A copy costs device memory, and once a few bytes for each that is read. In return no kernel knows of strides and formats,
//! meshes of either kind have the same speed and the same bits, and the host may write its buffers again as soon as they
//! were read, whatever frames are in flight.

use std::sync::{Arc, OnceLock};

use super::error::Error;
use crate::gpu::{Buffer, Device, HostArray, HostIndices, IndexFormat, Kernel, Memory, Upload, spirv};

crate::shared_structs! {
    /// The structs of `glsl/layout/gather.glsl`.
    pub const GATHER_STRUCTS;

    /// Push constants; the GLSL says what the members mean.
    #[allow(missing_docs)]
    pub struct GatherPass {
        pub source: u64,
        pub target: u64,
        pub count: u32,
        pub components: u32,
        pub stride: u32,
        pub first: u32,
        pub most: u32,
        pub padding: u32,
    }
}

/// Of a source: its words, and the threads' steps beyond them, count in 32 bits.
const MOST_BYTES: u64 = 8 << 30;

/// The kernel, built when a host's mesh first asks for it.
#[derive(Default)]
pub(super) struct Gatherer {
    kernel: OnceLock<Arc<Kernel>>,
}

impl Gatherer {
    /// A new buffer for so many elements of so many words.
    pub fn buffer(device: &Arc<Device>, name: &str, count: u32, components: u32) -> Result<Arc<Buffer>, Error> {
        let bytes = 4 * u64::from(count) * u64::from(components);
        Ok(Arc::new(Buffer::new(device, name, bytes, Memory::Device)?))
    }

    /// Gathers `components` words of each vertex.
    pub fn attribute(
        &self,
        upload: &mut Upload,
        mesh: &str,
        array: &HostArray,
        components: u32,
        target: &Arc<Buffer>,
    ) -> Result<(), Error> {
        let HostArray { address, stride, count } = *array;
        let expected = if !address.is_multiple_of(4) || !stride.is_multiple_of(4) {
            "multiples of 4"
        } else if stride < 4 * components {
            "as far apart as the attribute is long"
        } else if u64::from(stride) * u64::from(count) > MOST_BYTES {
            "no more than 8 GiB"
        } else {
            return self.dispatch(
                upload,
                target,
                GatherPass {
                    source: address,
                    target: target.address(),
                    count: count * components,
                    components,
                    stride: stride / 4,
                    first: 0,
                    most: u32::MAX,
                    padding: 0,
                },
            );
        };
        let found = format!("a vertex attribute of {count} at {address:#x}, {stride} bytes apart");
        Err(Error::HostMesh { mesh: mesh.to_owned(), found, expected: expected.to_owned() })
    }

    /// Gathers the vertices of triangles, of which there are `vertices`, not 0.
    pub fn indices(
        &self,
        upload: &mut Upload,
        mesh: &str,
        indices: &HostIndices,
        vertices: u32,
        target: &Arc<Buffer>,
    ) -> Result<(), Error> {
        let HostIndices { address, format, triangles } = *indices;
        let bytes = if format == IndexFormat::U16 { 2 } else { 4 };
        if !address.is_multiple_of(bytes) || triangles > u32::MAX / 8 {
            let found = format!("indices of {triangles} triangles at {address:#x}");
            let expected = format!("an address that is a multiple of {bytes}, and fewer than 2²⁹ triangles");
            return Err(Error::HostMesh { mesh: mesh.to_owned(), found, expected });
        }
        let pass = GatherPass {
            source: address & !3,
            target: target.address(),
            count: 3 * triangles,
            components: 1,
            stride: u32::from(format == IndexFormat::U32),
            first: (address & 3) as u32 / 2,
            most: vertices - 1,
            padding: 0,
        };
        self.dispatch(upload, target, pass)
    }

    fn dispatch(&self, upload: &mut Upload, target: &Arc<Buffer>, pass: GatherPass) -> Result<(), Error> {
        let kernel = match self.kernel.get() {
            Some(kernel) => kernel.clone(),
            None => {
                let source = spirv::load("gather").ok_or(Error::MissingKernel("gather"))?;
                let kernel = Arc::new(Kernel::new(upload.device(), source, &[])?);
                self.kernel.get_or_init(|| kernel).clone()
            }
        };
        Ok(upload.dispatch(&kernel, kernel.strided_groups_for(pass.count), &pass, target)?)
    }
}
