//! Meshes from the host's own vertex and index buffers, and meshes that change their shape: what is rendered is what a renderer
//! made for the scene as it then is renders, bit for bit, and synchronization validation is silent.
#![allow(unsafe_code)] // the host here speaks Vulkan itself

mod common;
#[path = "common/frames.rs"]
mod frames;
#[path = "common/host.rs"]
mod host;

use std::sync::Arc;

use frames::{Bits, expected, frame, options_of, renderer, scene, submit, submit_after, wait};
use glam::{Affine3A, Quat, Vec3};
use half::f16;
use host::{Host, HostMemory, in_lavapipe_hosts};
use neubrdf::gpu::Device;
use neubrdf::plugin::{Change, Error, HostArray, HostIndices, HostMesh, HostVertices, IndexFormat, Renderer, Update};
use neubrdf::scene::{Color, Mesh, Scene, Surface, Texture};

/// The sphere of [`scene`], with normals and texture coordinates.
const SPHERE: usize = 1;

/// A mesh as an engine has it on the device.
struct Buffers {
    vertices: HostMemory,
    indices: HostMemory,
    mesh: HostMesh,
}

impl Buffers {
    /// Vertices of 36 bytes, behind eight bytes of something else, and indices of 16 bits, of which the first is another's.
    fn interleaved(host: &Host, mesh: &Mesh) -> Buffers {
        let (vertices, address) = host.mesh_buffer(&interleaved(mesh));
        let shorts = mesh.triangles.iter().flatten().map(|corner| *corner as u16);
        let mut shorts: Vec<u16> = std::iter::once(999).chain(shorts).collect();
        shorts.push(0);
        let (indices, indices_address) = host.mesh_buffer(bytemuck::cast_slice(&shorts));
        let (count, triangles) = (mesh.positions.len() as u32, mesh.triangles.len() as u32);
        // SAFETY: the buffers are as the arrays say, and freed when all is done.
        let mesh = unsafe {
            let array = |offset| HostArray::new(address + 8 + offset, 36, count);
            HostMesh {
                vertices: HostVertices { positions: array(0), normals: Some(array(12)) },
                uvs: Some(array(24)),
                indices: HostIndices::new(indices_address + 2, IndexFormat::U16, triangles),
            }
        };
        Buffers { vertices, indices, mesh }
    }

    /// All positions, then all normals, then all texture coordinates, and indices of 32 bits.
    fn separate(host: &Host, mesh: &Mesh) -> Buffers {
        let bytes = [
            bytemuck::cast_slice(&mesh.positions),
            bytemuck::cast_slice(&mesh.normals),
            bytemuck::cast_slice::<_, u8>(&mesh.uvs),
        ];
        let (vertices, address) = host.mesh_buffer(&bytes.concat());
        let (indices, indices_address) = host.mesh_buffer(bytemuck::cast_slice(&mesh.triangles));
        let (count, triangles) = (mesh.positions.len() as u32, mesh.triangles.len() as u32);
        // SAFETY: as above.
        let mesh = unsafe {
            let array = |vertices: u32, stride| HostArray::new(address + u64::from(vertices * count), stride, count);
            HostMesh {
                vertices: HostVertices { positions: array(0, 12), normals: Some(array(12, 12)) },
                uvs: Some(array(24, 8)),
                indices: HostIndices::new(indices_address, IndexFormat::U32, triangles),
            }
        };
        Buffers { vertices, indices, mesh }
    }

    fn free(self, host: &Host) {
        host.free_buffer(self.vertices);
        host.free_buffer(self.indices);
    }
}

fn interleaved(mesh: &Mesh) -> Vec<u8> {
    let mut numbers = vec![f32::NAN; 2];
    for ((position, normal), uv) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.uvs) {
        numbers.extend(position.to_array().iter().chain(&normal.to_array()).chain(&uv.to_array()).chain(&[f32::NAN]));
    }
    bytemuck::cast_slice(&numbers).to_vec()
}

/// Opposite corners of the box around points.
fn corners(positions: &[Vec3]) -> Vec<Vec3> {
    let fold = |pick: fn(Vec3, Vec3) -> Vec3| positions.iter().copied().reduce(pick).unwrap();
    vec![fold(Vec3::min), fold(Vec3::max)]
}

/// The scene whose sphere only the device has.
fn without_sphere() -> Scene {
    let mut outline = scene();
    let sphere = &mut outline.meshes[SPHERE];
    *sphere = Mesh {
        name: sphere.name.clone(),
        positions: corners(&sphere.positions),
        materials: sphere.materials.clone(),
        ..Mesh::default()
    };
    outline
}

fn with_host_sphere(host: &Host, device: &Arc<Device>, scene: Scene, mesh: &HostMesh) -> Result<Renderer, Error> {
    Renderer::with_host_meshes(device, scene, &[(SPHERE as u32, *mesh)], &options_of(host))
}

/// The scene at another moment of its life: sphere and lamp are bent.
fn bent(amount: f32) -> Scene {
    let mut scene = scene();
    for index in [SPHERE, 2] {
        let mesh = &mut scene.meshes[index];
        for position in &mut mesh.positions {
            *position += amount * Vec3::new((7.0 * position.y).sin(), 0.3 * (5.0 * position.x).cos(), 0.5 * position.x);
        }
        for normal in &mut mesh.normals {
            *normal = (*normal + 0.5 * amount * Vec3::X).normalize();
        }
    }
    scene
}

/// What makes the meshes of a renderer those of a scene.
fn deform(scene: &Scene, by: Update) -> Vec<Change> {
    let meshes = [SPHERE, 2].map(|index| (index as u32, scene.meshes[index].clone()));
    let change = |(mesh, Mesh { positions, normals, .. })| Change::Deform { mesh, positions, normals, from: None, by };
    meshes.map(change).to_vec()
}

fn assert_same(found: &Bits, expected: &Bits, what: &str) {
    let differing = found.iter().zip(expected).filter(|(a, b)| a != b).count();
    assert!(differing == 0, "{what}: {differing} of {} pixels differ", expected.len());
}

#[test]
fn meshes_of_the_host_s_buffers_are_rendered_as_our_own() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let picture = expected(host, &scene(), 2);
        for (what, make) in [("interleaved", Buffers::interleaved as fn(&_, &_) -> _), ("separate", Buffers::separate)]
        {
            let buffers = make(host, &scene().meshes[SPHERE]);
            // The BVH wants the triangles on the CPU, too.
            let scene = if host.ray_query { without_sphere() } else { scene() };
            let mut renderer = with_host_sphere(host, &device, scene, &buffers.mesh).unwrap();
            let found = frame(host, &device, &mut renderer, 2).0;
            assert_same(&found, &picture, what);
            // What the host does with its buffers afterwards is its own business.
            buffers.free(host);
            assert!(frame(host, &device, &mut renderer, 1).0 != found);
        }
    });
}

/// One triangle in two has another material.
#[test]
fn triangles_of_a_host_s_mesh_have_the_scene_s_materials() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut striped = scene();
        let triangles = striped.meshes[SPHERE].triangles.len() as u32;
        striped.meshes[SPHERE].materials = (0..triangles).map(|triangle| triangle % 2).collect();
        let mut outline = if host.ray_query { without_sphere() } else { scene() };
        outline.meshes[SPHERE].materials = striped.meshes[SPHERE].materials.clone();
        let buffers = Buffers::separate(host, &striped.meshes[SPHERE]);
        let mut renderer = with_host_sphere(host, &device, outline, &buffers.mesh).unwrap();
        assert_same(&frame(host, &device, &mut renderer, 2).0, &expected(host, &striped, 2), "striped");
        buffers.free(host);
    });
}

/// Texture coordinates of the host's are not trusted: those that are no numbers read nothing but the texture.
#[test]
fn a_texture_coordinate_that_is_no_number_reads_nothing_else() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let texture = Texture::new("grey", 4, vec![[f16::from_f32(0.5); 4]; 20]);
        let albedo = Color { value: Vec3::ONE, texture: Some(0) };
        let textured = |mut scene: Scene| {
            scene.textures = vec![texture.clone()];
            scene.materials[1].surface = Surface::Diffuse { albedo };
            scene.materials[1].opacity.texture = Some(0);
            scene
        };
        let mut wrong = scene().meshes[SPHERE].clone();
        let numbers = [f32::NAN, f32::INFINITY, -1e30, 0.5, f32::NEG_INFINITY];
        wrong.uvs.iter_mut().enumerate().for_each(|(index, uv)| uv[index % 2] = numbers[index % 5]);
        let buffers = Buffers::separate(host, &wrong);
        let outline = textured(if host.ray_query { without_sphere() } else { scene() });
        let mut renderer = with_host_sphere(host, &device, outline, &buffers.mesh).unwrap();
        let picture = frame(host, &device, &mut renderer, 2).0;
        assert!(picture.iter().flatten().all(|number| f32::from_bits(*number).is_finite()));
        buffers.free(host);

        let mut here = textured(scene());
        here.meshes[SPHERE].uvs = wrong.uvs;
        let error = here.check().unwrap_err().to_string();
        assert!(error.contains("a texture coordinate of mesh 1") && error.contains("finite"), "{error}");
    });
}

/// Indices of the host's are not trusted: one beyond the last vertex is the last.
#[test]
fn an_index_that_is_out_of_range_reads_nothing_else() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut wrong = scene().meshes[SPHERE].clone();
        let last = wrong.positions.len() as u32 - 1;
        let mut clamped = scene();
        for (index, beyond) in [(40, u32::MAX), (100, last + 1)] {
            wrong.triangles[index][1] = beyond;
            clamped.meshes[SPHERE].triangles[index][1] = last;
        }
        let buffers = Buffers::separate(host, &wrong);
        let outline = if host.ray_query { without_sphere() } else { clamped.clone() };
        let mut renderer = with_host_sphere(host, &device, outline, &buffers.mesh).unwrap();
        assert_same(&frame(host, &device, &mut renderer, 1).0, &expected(host, &clamped, 1), "clamped");
        buffers.free(host);
    });
}

#[test]
fn a_deformed_mesh_is_rendered_as_by_a_renderer_made_for_it() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        for (moment, by) in [Update::Refit, Update::Refit, Update::Rebuild].into_iter().enumerate() {
            // The first comes before anything was uploaded.
            let scene = bent(0.1 * (moment + 1) as f32);
            renderer.update(&deform(&scene, by)).unwrap();
            let found = frame(host, &device, &mut renderer, 2).0;
            assert_same(&found, &expected(host, &scene, 2), &format!("moment {moment}, {by:?}"));
        }
        assert_eq!(*renderer.scene(), bent(0.1 * 3.0));
    });
}

/// The device writes the vertices itself, before the frame in the same command buffer, as skinning does.
#[test]
fn vertices_that_the_device_moved_need_no_copy_on_the_cpu() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let buffers = Buffers::interleaved(host, &scene().meshes[SPHERE]);
        let start = if host.ray_query { without_sphere() } else { scene() };
        let mut renderer = with_host_sphere(host, &device, start, &buffers.mesh).unwrap();
        frame(host, &device, &mut renderer, 1);
        for (amount, by) in [(0.1, Update::Rebuild), (0.2, Update::Refit), (0.3, Update::Refit)] {
            let mut now = scene();
            now.meshes[SPHERE] = bent(amount).meshes[SPHERE].clone();
            let Mesh { positions, normals, .. } = now.meshes[SPHERE].clone();
            let (positions, normals) =
                if host.ray_query { (corners(&positions), Vec::new()) } else { (positions, normals) };
            let from = Some(buffers.mesh.vertices);
            renderer.update(&[Change::Deform { mesh: SPHERE as u32, positions, normals, from, by }]).unwrap();
            let submitted = submit_after(host, &device, &mut renderer, 2, |recording| {
                host.write_vertices(recording, &buffers.vertices, &interleaved(&now.meshes[SPHERE]));
            });
            let found = wait(host, &mut renderer, submitted).0;
            assert_same(&found, &expected(host, &now, 2), &format!("{amount}, {by:?}"));
        }
        buffers.free(host);
    });
}

#[test]
fn a_refitted_top_level_finds_the_instances_where_they_are() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        let mut now = scene();
        renderer.set_top_level(Update::Refit);
        for step in 0..3 {
            if step == 2 {
                renderer.set_top_level(Update::Rebuild);
            }
            for instance in [1, 2] {
                let turn = Quat::from_rotation_z(0.3 * step as f32);
                let place = Affine3A::from_rotation_translation(turn, Vec3::new(-0.3 * step as f32, 0.1, 0.2));
                now.instances[instance as usize].object_to_world = place;
                renderer.update(&[Change::Transform { instance, object_to_world: place }]).unwrap();
            }
            let found = frame(host, &device, &mut renderer, 2).0;
            assert_same(&found, &expected(host, &now, 2), &format!("step {step}"));
        }
    });
}

#[test]
fn frames_in_flight_see_the_shapes_they_were_recorded_with() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let mut renderer = renderer(host, &device, scene());
        renderer.set_top_level(Update::Refit);
        let mut in_flight = Vec::new();
        for moment in 0..3 {
            renderer.update(&deform(&bent(0.2 * moment as f32), Update::Refit)).unwrap();
            in_flight.push(submit(host, &device, &mut renderer, 1));
        }
        for (moment, submitted) in in_flight.into_iter().enumerate() {
            let found = wait(host, &mut renderer, submitted).0;
            assert_same(&found, &expected(host, &bent(0.2 * moment as f32), 1), &format!("moment {moment}"));
        }
    });
}

/// Deformations take no memory of the device's but for their way there.
#[test]
fn deformations_leave_no_memory_behind() {
    in_lavapipe_hosts(|host| {
        let allocator = host.allocator();
        let allocated = || allocator.lock().unwrap().generate_report().total_allocated_bytes;
        let device = host.lend_with_allocator(&allocator);
        let mut renderer = renderer(host, &device, scene());
        renderer.set_top_level(Update::Refit);
        let mut steady = 0;
        for moment in 0..5 {
            renderer.update(&deform(&bent(0.1 * moment as f32), Update::Refit)).unwrap();
            frame(host, &device, &mut renderer, 1);
            // The first frame uploads the scene, and makes what can be refitted.
            if moment < 2 {
                steady = allocated();
            }
            assert_eq!(allocated(), steady, "moment {moment}");
        }
        drop(renderer);
        drop(device);
        assert_eq!(allocated(), 0);
    });
}

#[test]
fn mistakes_are_errors_and_change_nothing() {
    in_lavapipe_hosts(|host| {
        let device = host.lend();
        let sphere = scene().meshes[SPHERE].clone();
        let buffers = Buffers::interleaved(host, &sphere);
        let mesh = buffers.mesh;
        let refused = |scene: Scene, meshes: &[(u32, HostMesh)], says: &str| {
            let error = Renderer::with_host_meshes(&device, scene, meshes, &options_of(host)).err().unwrap();
            assert!(error.to_string().contains(says), "{says}: {error}");
        };
        let with = |change: &dyn Fn(&mut HostMesh)| {
            let mut mesh = mesh;
            change(&mut mesh);
            [(SPHERE as u32, mesh)]
        };
        // SAFETY: never read.
        let odd = unsafe { [HostArray::new(4, 38, 561), HostArray::new(4, 8, 561), HostArray::new(4, 12, 1)] };
        refused(scene(), &[(9, mesh)], "below 3");
        refused(scene(), &with(&|mesh| mesh.vertices.positions = odd[0]), "multiples of 4");
        refused(scene(), &with(&|mesh| mesh.vertices.normals = Some(odd[1])), "as far apart");
        refused(scene(), &with(&|mesh| mesh.uvs = Some(odd[2])), "561");
        let mut another = scene();
        another.meshes[SPHERE].triangles.pop();
        refused(another, &with(&|_| ()), "as the scene's mesh");
        let mut materials = without_sphere();
        materials.meshes[SPHERE].materials = vec![1; 5];
        refused(materials, &with(&|_| ()), "5 materials");
        let mut lamp = without_sphere();
        lamp.meshes[SPHERE].materials = vec![2];
        refused(lamp, &with(&|_| ()), "emits");
        if !host.ray_query {
            refused(without_sphere(), &with(&|_| ()), "ray query");
            return buffers.free(host);
        }

        let mut renderer = with_host_sphere(host, &device, without_sphere(), &mesh).unwrap();
        frame(host, &device, &mut renderer, 1);
        let positions = vec![Vec3::splat(-1.0), Vec3::ONE];
        let change = |positions: &[Vec3], from| Change::Deform {
            mesh: SPHERE as u32,
            positions: positions.to_vec(),
            normals: Vec::new(),
            from,
            by: Update::Refit,
        };
        let flat = HostVertices { normals: None, ..mesh.vertices };
        let mut shining = scene().materials[1].clone();
        shining.emission = Vec3::ONE;
        let wrong = [
            (change(&positions, None), "buffers"),
            (change(&positions[..1], Some(mesh.vertices)), "2, as before"),
            (change(&[Vec3::NAN, Vec3::ONE], Some(mesh.vertices)), "position"),
            (change(&positions, Some(flat)), "561 positions and 0 normals"),
            (Change::Material { index: 1, material: shining }, "emits"),
            (
                Change::Deform { mesh: 7, positions: vec![], normals: vec![], from: None, by: Update::Refit },
                "index of a mesh",
            ),
        ];
        for (wrong, says) in wrong {
            // One that would do comes first, and must not be made either.
            let fine = change(&positions, Some(mesh.vertices));
            let error = renderer.update(&[fine, wrong]).unwrap_err();
            assert!(error.to_string().contains(says), "{says}: {error}");
        }
        assert_eq!(*renderer.scene(), without_sphere());
        assert_same(&frame(host, &device, &mut renderer, 1).0, &expected(host, &scene(), 2), "after all that");
        buffers.free(host);
    });
}
