//! Meshes from a host's own buffers, and meshes that change their shape.

use glam::Vec3;

use super::call::{Failure, NeubrdfResult, call, object, put, read, sized_structs};
use super::scene::{NeubrdfMesh, NeubrdfScene, index_of, materials, unless_null, vectors};
use super::vulkan::*;
use crate::gpu::{HostArray, HostIndices, HostMesh, HostVertices, IndexFormat, Update};
use crate::plugin::Change;
use crate::scene::Mesh;

/// Triangles that the host has on the device. Addresses are those of vkGetBufferDeviceAddress plus the offset of the first vertex or index,
/// from buffers made with VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT. The first recording of a renderer reads them, in the stage
/// COMPUTE_SHADER with SHADER_READ, and copies them on the device: what wrote them is done for that, and what writes them afterwards waits for it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfDeviceMesh {
    /// sizeof(NeubrdfDeviceMesh).
    pub size: u32,
    /// How many vertices there are.
    pub vertex_count: u32,
    /// x, y, z of each vertex, f32.
    pub positions: VkDeviceAddress,
    /// Unit normals, x, y, z of each vertex; 0 for a flat mesh.
    pub normals: VkDeviceAddress,
    /// u, v of each vertex, v up; 0 for none.
    pub uvs: VkDeviceAddress,
    /// Three vertices a triangle, counter-clockwise seen from the front. Words are read whole: of 16 bits the buffer has an even number.
    pub indices: VkDeviceAddress,
    /// Bytes from a vertex's position to the next one's; 0 is 12.
    pub position_stride: u32,
    /// The same of normals; 0 is 12.
    pub normal_stride: u32,
    /// The same of texture coordinates; 0 is 8.
    pub uv_stride: u32,
    /// VK_INDEX_TYPE_UINT16 or VK_INDEX_TYPE_UINT32.
    pub index_type: VkIndexType,
    /// How many triangles there are.
    pub triangle_count: u32,
    /// The material of all triangles, where `materials` is null.
    pub material: u32,
    /// The material of each triangle, in the CPU's memory, copied; null if `material` is that of all.
    pub materials: *const u32,
    /// Lower corner of a box around the vertices.
    pub lower: [f32; 3],
    /// Its upper corner.
    pub upper: [f32; 3],
}

/// How a structure over triangles or instances follows what moved.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeubrdfUpdate {
    /// It is built anew.
    Rebuild = 0,
    /// Its boxes are fitted anew: faster, but rays take the longer, the farther things moved since the last rebuild. The first refit is a
    /// rebuild, of something that can be refitted.
    Refit = 1,
}

/// Vertices of a mesh that lie elsewhere, on the CPU, on the device, or on both.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfDeformation {
    /// sizeof(NeubrdfDeformation).
    pub size: u32,
    /// A NeubrdfUpdate: how what finds the mesh's triangles follows.
    pub by: u32,
    /// How many vertices there are: as many as at first.
    pub vertex_count: u32,
    /// Bytes from a position on the device to the next; 0 is 12.
    pub position_stride: u32,
    /// x, y, z of each vertex, copied; null for a mesh that only the device has.
    pub positions: *const f32,
    /// Unit normals, copied; null for a flat mesh, and for one that only the device has.
    pub normals: *const f32,
    /// Where the device reads the positions, in the next frame, as of a NeubrdfDeviceMesh; 0 uploads those above.
    pub device_positions: VkDeviceAddress,
    /// Where it then reads the normals; 0 for a flat mesh.
    pub device_normals: VkDeviceAddress,
    /// Bytes from a normal on the device to the next; 0 is 12.
    pub normal_stride: u32,
    /// Lower corner of a box around the vertices of a mesh that only the device has.
    pub lower: [f32; 3],
    /// Its upper corner.
    pub upper: [f32; 3],
    /// Nothing: 0.
    pub reserved: u32,
}

sized_structs! {
    NeubrdfDeviceMesh: 96 {
        size, vertex_count, positions, normals, uvs, indices, position_stride, normal_stride, uv_stride, index_type, triangle_count,
        material, materials, lower, upper,
    }
    NeubrdfDeformation: 80 {
        size, by, vertex_count, position_stride, positions, normals, device_positions, device_normals, normal_stride, lower, upper,
        reserved,
    }
}

/// The update of that number.
pub(super) fn update_by(by: u32) -> Result<Update, Failure> {
    match by {
        0 => Ok(Update::Rebuild),
        1 => Ok(Update::Refit),
        other => Err(Failure::argument(format!("{other} is no NeubrdfUpdate"))),
    }
}

/// An attribute on the device; none at address 0.
///
/// # Safety
/// As of [`HostArray::new`].
unsafe fn attribute(address: VkDeviceAddress, stride: u32, tight: u32, count: u32) -> Option<HostArray> {
    let stride = if stride == 0 { tight } else { stride };
    // SAFETY: as the caller says.
    (address != 0).then(|| unsafe { HostArray::new(address, stride, count) })
}

impl NeubrdfDeviceMesh {
    /// # Safety
    /// The buffers are as the struct says.
    unsafe fn host_mesh(&self) -> Result<HostMesh, Failure> {
        let format = match self.index_type {
            VkIndexType::UINT16 => IndexFormat::U16,
            VkIndexType::UINT32 => IndexFormat::U32,
            other => return Err(Failure::argument(format!("NeubrdfDeviceMesh.index_type is {}", other.as_raw()))),
        };
        if self.indices == 0 {
            return Err(Failure::argument("NeubrdfDeviceMesh.indices is 0"));
        }
        let count = self.vertex_count;
        // SAFETY: as the caller says.
        unsafe {
            Ok(HostMesh {
                vertices: HostVertices {
                    positions: attribute(self.positions, self.position_stride, 12, count)
                        .ok_or_else(|| Failure::argument("NeubrdfDeviceMesh.positions is 0"))?,
                    normals: attribute(self.normals, self.normal_stride, 12, count),
                },
                uvs: attribute(self.uvs, self.uv_stride, 8, count),
                indices: HostIndices::new(self.indices, format, self.triangle_count),
            })
        }
    }
}

impl NeubrdfDeformation {
    /// # Safety
    /// Arrays and buffers are as the struct says.
    pub(super) unsafe fn change(&self, mesh: u32) -> Result<Change, Failure> {
        if self.reserved != 0 {
            return Err(Failure::argument(format!("NeubrdfDeformation.reserved is {}: set it to 0", self.reserved)));
        }
        let count = self.vertex_count;
        let on_the_cpu = |pointer| unless_null(pointer, count as usize);
        // SAFETY: as the caller says.
        unsafe {
            let positions = match self.positions.is_null() {
                true => vec![Vec3::from(self.lower), Vec3::from(self.upper)],
                false => vectors(self.positions, on_the_cpu(self.positions), "NeubrdfDeformation.positions")?,
            };
            let normals = vectors(self.normals, on_the_cpu(self.normals), "NeubrdfDeformation.normals")?;
            let from = attribute(self.device_positions, self.position_stride, 12, count).map(|positions| {
                HostVertices { positions, normals: attribute(self.device_normals, self.normal_stride, 12, count) }
            });
            Ok(Change::Deform { mesh, positions, normals, from, by: update_by(self.by)? })
        }
    }
}

/// What changes make of a scene's meshes from the host's buffers: their vertices are where they were read last. A mesh whose vertices came from
/// the CPU has all that it is in the scene.
pub(super) fn follow(host_meshes: &mut Vec<(u32, HostMesh)>, changes: &[Change]) {
    for change in changes {
        if let Change::Deform { mesh, from, .. } = change {
            match from {
                Some(vertices) => {
                    let same = host_meshes.iter_mut().filter(|(index, _)| index == mesh);
                    same.for_each(|(_, host_mesh)| host_mesh.vertices = *vertices);
                }
                None => host_meshes.retain(|(index, _)| index != mesh),
            }
        }
    }
}

/// Adds a mesh that the device has. `arrays`, if not null, are the same vertices and triangles on the CPU, copied: the BVH and triangles that
/// emit need them, and the materials are then theirs. Without them rays find it by ray query alone.
///
/// # Safety
/// The buffers are of the device of every context that a renderer of this scene is made on, belong to the queue's family or are shared, have as
/// many vertices and triangles, of finite numbers, and live until that renderer's first recording is done. `arrays` is null or as of
/// `neubrdf_scene_add_mesh`; `index` is null or points to room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_add_device_mesh(
    scene: *mut NeubrdfScene,
    mesh: *const NeubrdfDeviceMesh,
    arrays: *const NeubrdfMesh,
    index: *mut u32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says, for all of it.
        unsafe {
            let (scene, device_mesh) = (object(scene, "scene")?, read(mesh)?);
            let added = index_of(scene.scene.meshes.len())?;
            let host_mesh = device_mesh.host_mesh()?;
            let NeubrdfDeviceMesh { lower, upper, material, triangle_count, .. } = device_mesh;
            let mesh = match arrays.is_null() {
                true => Mesh {
                    name: format!("mesh {added}"),
                    positions: vec![lower.into(), upper.into()],
                    materials: materials(
                        material,
                        device_mesh.materials,
                        triangle_count as usize,
                        "NeubrdfDeviceMesh.materials",
                    )?,
                    ..Mesh::default()
                },
                false => read(arrays)?.mesh(added)?,
            };
            scene.scene.meshes.push(mesh);
            scene.host_meshes.push((added, host_mesh));
            put(index, added);
        }
        Ok(())
    })
}
