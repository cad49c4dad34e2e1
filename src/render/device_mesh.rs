//! A mesh in device memory: its arrays, and the tree or the acceleration structure over its triangles.

use std::sync::Arc;

use bytemuck::Pod;

use super::bvh::{Bvh, MAX_PRIMITIVES};
use super::error::Error;
use super::gather::Gatherer;
use super::geometry::overwrite;
use crate::gpu::{Blas, BlasGeometry, Buffer, HostMesh, HostVertices, Update, Upload};
use crate::scene::{Bounds, Mesh};

crate::shared_structs! {
    /// The struct of `glsl/layout/geometry.glsl` that is made here.
    pub const MESH_STRUCTS;

    /// A mesh: pointers, null where it has no such thing.
    pub struct MeshRecord {
        /// Corners, object space.
        pub positions: u64,
        /// Shading normals.
        pub normals: u64,
        /// Texture coordinates.
        pub uvs: u64,
        /// Corner indices of the triangles.
        pub indices: u64,
        /// Materials, one a triangle.
        pub materials: u64,
        /// The tree over its triangles.
        pub nodes: u64,
        /// The triangles as the tree's leaves index them.
        pub leaf_triangles: u64,
        /// The material of all triangles, where `materials` is null.
        pub material: u32,
        /// Nothing.
        pub padding: u32,
    }
}

/// A change of a mesh's shape: its vertices are elsewhere, its triangles connect the same ones.
#[derive(Clone, Copy, Debug)]
pub struct Deformed {
    /// Which one.
    pub mesh: usize,
    /// Where the vertices are read; `None` for the scene's own.
    pub from: Option<HostVertices>,
    /// How the tree or structure over its triangles follows.
    pub by: Update,
}

/// What a mesh is made of, as the kernels read it.
#[derive(Clone)]
pub(super) struct MeshArrays {
    positions: Option<Arc<Buffer>>,
    normals: Option<Arc<Buffer>>,
    uvs: Option<Arc<Buffer>>,
    indices: Option<Arc<Buffer>>,
    materials: Option<Arc<Buffer>>,
    /// That of all triangles, without `materials`.
    material: u32,
    vertices: u32,
    triangles: u32,
}

/// What finds its triangles.
enum Finder {
    Tree {
        nodes: Option<Arc<Buffer>>,
        leaf_triangles: Arc<Buffer>,
        bounds: Bounds,
        /// Kept from the first refit on, for the next.
        tree: Option<Bvh>,
    },
    Structure(Arc<Blas>),
}

/// A mesh on the device.
pub(super) struct DeviceMesh {
    arrays: MeshArrays,
    finder: Finder,
    /// Around the scene's vertices, object space.
    bounds: Bounds,
    /// Of its triangles, each once.
    distinct_materials: Arc<[u32]>,
}

/// A tree over the triangles of a mesh, for a walk with such a stack if that can be.
pub(super) fn tree_over(mesh: &Mesh, stack: u32) -> Result<Bvh, Error> {
    if mesh.triangles.len() > MAX_PRIMITIVES {
        return Err(Error::MeshSize { mesh: mesh.name.clone(), triangles: mesh.triangles.len(), most: MAX_PRIMITIVES });
    }
    Ok(Bvh::over_triangles_within(mesh, stack))
}

fn uploaded<T: Pod>(upload: &mut Upload, name: &str, data: &[T]) -> Result<Option<Arc<Buffer>>, Error> {
    Ok(if data.is_empty() { None } else { Some(upload.buffer(name, data)?) })
}

fn address(buffer: &Option<Arc<Buffer>>) -> u64 {
    buffer.as_ref().map_or(0, |buffer| buffer.address())
}

impl MeshArrays {
    /// Copies of the scene's.
    pub fn uploaded(upload: &mut Upload, mesh: &Mesh) -> Result<MeshArrays, Error> {
        let name = &mesh.name;
        Ok(MeshArrays {
            positions: uploaded(upload, name, &mesh.positions)?,
            normals: uploaded(upload, name, &mesh.normals)?,
            uvs: uploaded(upload, name, &mesh.uvs)?,
            indices: uploaded(upload, name, &mesh.triangles)?,
            materials: materials(upload, mesh)?,
            material: mesh.materials.first().copied().unwrap_or(0),
            vertices: mesh.positions.len() as u32,
            triangles: mesh.triangles.len() as u32,
        })
    }

    /// Copies of a host's, but for the materials.
    pub fn gathered(
        upload: &mut Upload,
        gatherer: &Gatherer,
        mesh: &Mesh,
        host: &HostMesh,
    ) -> Result<MeshArrays, Error> {
        let HostMesh { vertices: HostVertices { positions, normals }, uvs, indices } = host;
        let (vertices, triangles) = (positions.count, indices.triangles);
        let ensure = |holds: bool, found: String, expected: &str| match holds {
            true => Ok(()),
            false => Err(Error::HostMesh { mesh: mesh.name.clone(), found, expected: expected.to_owned() }),
        };
        let found = format!("{vertices} vertices and {triangles} triangles");
        ensure(vertices > 0 && triangles > 0, found.clone(), "some of both")?;
        let on_the_cpu = (mesh.positions.len(), mesh.triangles.len());
        let agree = mesh.triangles.is_empty() || on_the_cpu == (vertices as usize, triangles as usize);
        ensure(agree, found, &format!("{} and {}, as the scene's mesh", on_the_cpu.0, on_the_cpu.1))?;
        let agree = [normals, uvs].into_iter().flatten().all(|array| array.count == vertices);
        ensure(agree, "normals or uvs of another number of vertices".to_owned(), &format!("{vertices} of each"))?;
        let (found, triangle_count) = (mesh.materials.len(), triangles as usize);
        let expected = format!("1, or {triangles} as the triangles");
        ensure(found == 1 || found == triangle_count, format!("{found} materials"), &expected)?;

        let device = upload.device().clone();
        let mut array = |array: &_, components, vertices: u32| {
            let target = Gatherer::buffer(&device, &mesh.name, vertices, components)?;
            gatherer.attribute(upload, &mesh.name, array, components, &target)?;
            Ok::<_, Error>(target)
        };
        let positions = Some(array(positions, 3, vertices)?);
        let normals = normals.as_ref().map(|normals| array(normals, 3, vertices)).transpose()?;
        let uvs = uvs.as_ref().map(|uvs| array(uvs, 2, vertices)).transpose()?;
        let corners = Gatherer::buffer(&device, &mesh.name, triangles, 3)?;
        gatherer.indices(upload, &mesh.name, indices, vertices, &corners)?;
        let indices = Some(corners);
        let materials = materials(upload, mesh)?;
        let material = mesh.materials[0];
        Ok(MeshArrays { positions, normals, uvs, indices, materials, material, vertices, triangles })
    }

    /// Writes the vertices of a mesh that has been deformed.
    fn overwrite(
        &self,
        upload: &mut Upload,
        gatherer: &Gatherer,
        mesh: &Mesh,
        from: Option<&HostVertices>,
    ) -> Result<(), Error> {
        let Some(HostVertices { positions, normals }) = from else {
            for (buffer, data) in [(&self.positions, &mesh.positions), (&self.normals, &mesh.normals)] {
                buffer.as_ref().map_or(Ok(()), |buffer| upload.write(buffer, data))?;
            }
            return Ok(());
        };
        let given = [Some(positions), normals.as_ref()];
        let counts = given.map(|array| array.map_or(0, |array| array.count));
        let has = [&self.positions, &self.normals].map(|buffer| buffer.as_ref().map_or(0, |_| self.vertices));
        if counts != has {
            let found = format!("{} positions and {} normals", counts[0], counts[1]);
            let expected = format!("{} and {}, as it was made with", has[0], has[1]);
            return Err(Error::HostMesh { mesh: mesh.name.clone(), found, expected });
        }
        for (array, buffer) in given.into_iter().zip([&self.positions, &self.normals]) {
            if let (Some(array), Some(buffer)) = (array, buffer) {
                gatherer.attribute(upload, &mesh.name, array, 3, buffer)?;
            }
        }
        Ok(())
    }

    fn geometry(&self) -> BlasGeometry {
        BlasGeometry {
            positions: address(&self.positions),
            vertex_count: self.vertices,
            indices: address(&self.indices),
            triangle_count: self.triangles,
        }
    }
}

/// The materials, where triangles differ in them.
fn materials(upload: &mut Upload, mesh: &Mesh) -> Result<Option<Arc<Buffer>>, Error> {
    uploaded(upload, &mesh.name, if mesh.materials.len() == 1 { &[] } else { &mesh.materials })
}

impl DeviceMesh {
    /// With its tree, or else with an acceleration structure.
    pub fn new(upload: &mut Upload, mesh: &Mesh, arrays: MeshArrays, tree: Option<Bvh>) -> Result<DeviceMesh, Error> {
        let finder = match tree {
            Some(_) if mesh.triangles.is_empty() && arrays.triangles > 0 => {
                return Err(Error::HostMesh {
                    mesh: mesh.name.clone(),
                    found: "on the device alone".to_owned(),
                    expected: "in the scene too for the BVH, which is built on the CPU, or rendered by ray query"
                        .to_owned(),
                });
            }
            Some(tree) => Finder::Tree {
                nodes: uploaded(upload, &mesh.name, &tree.nodes)?,
                leaf_triangles: upload.buffer(&mesh.name, &tree.leaf_triangles(mesh))?,
                bounds: tree.bounds,
                tree: None,
            },
            None => Finder::Structure(upload.blas(&[arrays.geometry()])?),
        };
        Ok(DeviceMesh { arrays, finder, bounds: mesh.bounds(), distinct_materials: distinct(&mesh.materials) })
    }

    /// The mesh in its new shape, in the same arrays.
    pub fn deformed(
        &self,
        upload: &mut Upload,
        gatherer: &Gatherer,
        mesh: &Mesh,
        change: &Deformed,
        stack: u32,
    ) -> Result<DeviceMesh, Error> {
        let arrays = self.arrays.clone();
        arrays.overwrite(upload, gatherer, mesh, change.from.as_ref())?;
        let finder = match &self.finder {
            Finder::Structure(blas) => Finder::Structure(match blas.follows(change.by) {
                true => {
                    upload.update_blas(blas, change.by)?;
                    blas.clone()
                }
                // Meshes that keep their shape pay nothing for those that do not.
                false => upload.deformable_blas(&[arrays.geometry()], change.by)?,
            }),
            Finder::Tree { nodes, leaf_triangles: corners, tree, .. } => {
                let tree = match (change.by, tree) {
                    (Update::Refit, Some(tree)) => tree.refitted(&Bvh::boxes(mesh)),
                    _ => tree_over(mesh, stack)?,
                };
                if tree.stack > stack {
                    return Err(Error::Fixed { what: format!("a tree over mesh '{}' in its new shape", mesh.name) });
                }
                Finder::Tree {
                    nodes: Some(overwrite(upload, nodes.as_ref(), &mesh.name, &tree.nodes)?),
                    leaf_triangles: overwrite(upload, Some(corners), &mesh.name, &tree.leaf_triangles(mesh))?,
                    bounds: tree.bounds,
                    tree: (change.by == Update::Refit).then_some(tree),
                }
            }
        };
        let distinct_materials = self.distinct_materials.clone();
        Ok(DeviceMesh { arrays, finder, bounds: mesh.bounds(), distinct_materials })
    }

    /// An object-space box around it.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The materials of its triangles, each once.
    pub fn distinct_materials(&self) -> &[u32] {
        &self.distinct_materials
    }

    pub fn record(&self) -> MeshRecord {
        let arrays = &self.arrays;
        let (nodes, leaf_triangles) = match &self.finder {
            Finder::Tree { nodes, leaf_triangles, .. } => (address(nodes), leaf_triangles.address()),
            Finder::Structure(_) => (0, 0),
        };
        MeshRecord {
            positions: address(&arrays.positions),
            normals: address(&arrays.normals),
            uvs: address(&arrays.uvs),
            indices: address(&arrays.indices),
            materials: address(&arrays.materials),
            nodes,
            leaf_triangles,
            material: arrays.material,
            padding: 0,
        }
    }

    /// Around its tree; empty for ray query.
    pub fn tree_bounds(&self) -> Bounds {
        if let Finder::Tree { bounds, .. } = self.finder { bounds } else { Bounds::EMPTY }
    }

    /// For ray query.
    pub fn structure(&self) -> Option<&Arc<Blas>> {
        if let Finder::Structure(blas) = &self.finder { Some(blas) } else { None }
    }

    /// Bytes of device memory, without a structure of the driver's.
    pub fn bytes(&self) -> u64 {
        let MeshArrays { positions, normals, uvs, indices, materials, .. } = &self.arrays;
        let mut buffers = vec![positions, normals, uvs, indices, materials];
        let mut bytes = 0;
        if let Finder::Tree { nodes, leaf_triangles, .. } = &self.finder {
            buffers.push(nodes);
            bytes += leaf_triangles.size();
        }
        bytes + buffers.into_iter().flatten().map(|buffer| buffer.size()).sum::<u64>()
    }
}

fn distinct(materials: &[u32]) -> Arc<[u32]> {
    let mut distinct = materials.to_vec();
    // Most stand in rows.
    distinct.dedup();
    distinct.sort_unstable();
    distinct.dedup();
    distinct.into()
}
