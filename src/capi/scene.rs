//! Scenes from files and from memory.

use std::ffi::{CString, c_char};

use glam::{Affine3A, Mat3, Vec2, Vec3};
use half::f16;

use super::call::{Failure, NeubrdfResult, array, call, end, hand_over, object, path, put, read, sized_structs};
use crate::gpu::HostMesh;
use crate::scene::{
    Camera, Color, Environment, Film, Fresnel, Instance, Lens, Material, Mesh, Opacity, Patches, Scene, Sun, Surface,
    Texture, TexturePlacement, Warning,
};

/// What is rendered. Renderers take a copy.
pub struct NeubrdfScene {
    pub(super) scene: Scene,
    /// Meshes from the host's buffers, by their index.
    pub(super) host_meshes: Vec<(u32, HostMesh)>,
    warnings: Vec<CString>,
}

/// A perspective camera, right-handed, y up if `up` says so.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfCamera {
    /// sizeof(NeubrdfCamera).
    pub size: u32,
    /// The whole vertical angle, degrees in (0, 180).
    pub vertical_fov_degrees: f32,
    /// Where it is.
    pub eye: [f32; 3],
    /// What it looks at.
    pub target: [f32; 3],
    /// Not along the view.
    pub up: [f32; 3],
    /// Radius of a thin lens; 0 is a pinhole.
    pub lens_radius: f32,
    /// Distance along the axis of what is sharp; only with a lens.
    pub focus_distance: f32,
}

/// Triangles in arrays that are copied.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfMesh {
    /// sizeof(NeubrdfMesh).
    pub size: u32,
    /// How many vertices there are.
    pub vertex_count: u32,
    /// x, y, z of each vertex.
    pub positions: *const f32,
    /// Unit normals, x, y, z of each vertex; null for a flat mesh.
    pub normals: *const f32,
    /// u, v of each vertex, v up; null for none.
    pub uvs: *const f32,
    /// Three vertices a triangle, counter-clockwise seen from the front.
    pub indices: *const u32,
    /// The material of each triangle; null if `material` is that of all.
    pub materials: *const u32,
    /// How many triangles there are.
    pub triangle_count: u32,
    /// The material of all triangles, where `materials` is null.
    pub material: u32,
}

/// How a surface scatters. Roughness is GGX's α.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeubrdfSurface {
    /// Lambertian, of albedo `color`.
    Diffuse = 0,
    /// A metal: by Schlick from `color` at normal incidence, or by the complex index `eta` + i `kappa` where `eta` is not 0.
    Conductor = 1,
    /// Glass of index `ior`.
    Dielectric = 2,
    /// Diffuse of albedo `color` under a coat of index `ior`.
    Coated = 3,
    /// That of the material `surface_of`, of a file for example, with the emission, the opacity, the maps and the patches that are said here.
    OfMaterial = 4,
}

/// A material of a closed form, or with the surface of another one. Those of files: `neubrdf_scene_add_material_file`.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct NeubrdfMaterial {
    /// sizeof(NeubrdfMaterial).
    pub size: u32,
    /// A NeubrdfSurface.
    pub surface: u32,
    /// Linear Rec. 709, each in [0, 1].
    pub color: [f32; 3],
    /// 1 + the index of a texture that `color` is multiplied by; 0 for none.
    pub texture: u32,
    /// Of a conductor.
    pub eta: [f32; 3],
    /// Of a conductor.
    pub kappa: [f32; 3],
    /// α along u and v, in [0, 1]; only conductors differ in them.
    pub alpha: [f32; 2],
    /// Index of refraction of a dielectric or a coat; 0 is 1.5.
    pub ior: f32,
    /// Radiance, W/(sr m²).
    pub emission: [f32; 3],
    /// Not 0 if the backs of triangles emit too.
    pub emits_both_sides: u32,
    /// The probability with which a ray goes on as if there were nothing, in [0, 1]; 0 of what emits.
    pub transparency: f32,
    /// 1 + the index of a texture that 1 - `transparency` is multiplied by, by its red; 0 for none.
    pub opacity_texture: u32,
    /// 1 + the index of a texture of shading normals: x along u, y along v, z along the triangle's own, each from -1 (0 in the texture) to 1;
    /// 0 for none.
    pub normal_map: u32,
    /// 1 + the index of a texture of roughness, along u by its red and along v by its green, of which α is the square instead of `alpha`; where
    /// there is but one α it is the mean of both; 0 for none. Not of the diffuse.
    pub roughness_map: u32,
    /// 1 + the index of a texture that `emission` is multiplied by; 0 for none.
    pub emission_texture: u32,
    /// 1 + the index of a texture; where its red is at least ½, the material `patch_material` stands instead, of which all counts but its opacity.
    /// Neither emits. 0 for none.
    pub patch_map: u32,
    /// The index of a material without such patches.
    pub patch_material: u32,
    /// The index of the material whose surface it is, where `surface` says so.
    pub surface_of: u32,
    /// 1 + the index of a texture of the direction about the normal that "along u" turns into, by the angle ψ from u towards v: cos 2ψ in red and
    /// sin 2ψ in green, of which what lies between texels can be told; 0 for none. Of conductors, and surfaces of files.
    pub anisotropy_direction_map: u32,
}

sized_structs! {
    NeubrdfCamera: 52 { size, vertical_fov_degrees, eye, target, up, lens_radius, focus_distance }
    NeubrdfMesh: 56 { size, vertex_count, positions, normals, uvs, indices, materials, triangle_count, material }
    NeubrdfMaterial: 76 {
        size, surface, color, texture, eta, kappa, alpha, ior, emission, emits_both_sides, transparency, opacity_texture, normal_map,
        roughness_map, emission_texture, patch_map, patch_material, surface_of, anisotropy_direction_map,
    }
}

impl NeubrdfCamera {
    pub(super) fn camera(&self) -> Camera {
        let lens =
            (self.lens_radius != 0.0).then_some(Lens { radius: self.lens_radius, focus_distance: self.focus_distance });
        Camera {
            eye: self.eye.into(),
            target: self.target.into(),
            up: self.up.into(),
            vertical_fov_degrees: self.vertical_fov_degrees,
            lens,
        }
    }
}

impl NeubrdfMesh {
    /// A copy of the arrays.
    ///
    /// # Safety
    /// They have the lengths that the mesh says.
    pub(super) unsafe fn mesh(&self, index: u32) -> Result<Mesh, Failure> {
        let (vertices, triangles) = (self.vertex_count as usize, self.triangle_count as usize);
        // SAFETY: as the caller says.
        unsafe {
            let corners: &[[u32; 3]] = array(self.indices.cast(), triangles, "NeubrdfMesh.indices")?;
            Ok(Mesh {
                name: format!("mesh {index}"),
                positions: vectors(self.positions, vertices, "NeubrdfMesh.positions")?,
                normals: vectors(self.normals, unless_null(self.normals, vertices), "NeubrdfMesh.normals")?,
                uvs: array::<[f32; 2]>(self.uvs.cast(), unless_null(self.uvs, vertices), "NeubrdfMesh.uvs")?
                    .iter()
                    .copied()
                    .map(Vec2::from)
                    .collect(),
                triangles: corners.to_vec(),
                materials: materials(self.material, self.materials, triangles, "NeubrdfMesh.materials")?,
            })
        }
    }
}

/// The length of an array that may be left away.
pub(super) fn unless_null(pointer: *const f32, length: usize) -> usize {
    if pointer.is_null() { 0 } else { length }
}

/// Vectors of three floats.
///
/// # Safety
/// As of [`array`].
pub(super) unsafe fn vectors(pointer: *const f32, count: usize, name: &str) -> Result<Vec<Vec3>, Failure> {
    // SAFETY: as the caller says.
    Ok(unsafe { array::<[f32; 3]>(pointer.cast(), count, name)? }.iter().copied().map(Vec3::from).collect())
}

/// One material, or one for each triangle where there is an array of them.
///
/// # Safety
/// As of [`array`].
pub(super) unsafe fn materials(one: u32, each: *const u32, triangles: usize, name: &str) -> Result<Vec<u32>, Failure> {
    if each.is_null() {
        return Ok(vec![one]);
    }
    // SAFETY: as the caller says.
    Ok(unsafe { array(each, triangles, name)? }.to_vec())
}

impl NeubrdfMaterial {
    /// The material; `others` are those that are there already.
    pub(super) fn material(&self, name: String, others: &[Material]) -> Result<Material, Failure> {
        let color = Color { value: self.color.into(), texture: self.texture.checked_sub(1) };
        let ior = if self.ior == 0.0 { 1.5 } else { self.ior };
        let surface = match self.surface {
            0 => Surface::Diffuse { albedo: color },
            1 => Surface::Conductor {
                fresnel: match self.eta == [0.0; 3] {
                    true => Fresnel::Schlick { f0: color },
                    false => Fresnel::Complex { eta: self.eta.into(), kappa: self.kappa.into() },
                },
                alpha: self.alpha.into(),
            },
            2 => Surface::Dielectric { ior, alpha: self.alpha[0] },
            3 => Surface::Coated { albedo: color, ior, alpha: self.alpha[0] },
            4 => match others.get(self.surface_of as usize) {
                Some(other) => other.surface.clone(),
                None => {
                    let (index, count) = (self.surface_of, others.len());
                    return Err(Failure::argument(format!(
                        "NeubrdfMaterial.surface_of is {index}, of {count} materials"
                    )));
                }
            },
            other => return Err(Failure::argument(format!("NeubrdfMaterial.surface is {other}: no NeubrdfSurface"))),
        };
        let opacity = Opacity { value: 1.0 - self.transparency, texture: self.opacity_texture.checked_sub(1) };
        Ok(Material {
            name,
            surface,
            emission: self.emission.into(),
            emission_texture: self.emission_texture.checked_sub(1),
            emits_both_sides: self.emits_both_sides != 0,
            opacity,
            normal_map: self.normal_map.checked_sub(1),
            roughness_map: self.roughness_map.checked_sub(1),
            anisotropy_direction_map: self.anisotropy_direction_map.checked_sub(1),
            patches: self.patch_map.checked_sub(1).map(|map| Patches { map, material: self.patch_material }),
        })
    }
}

/// A transform from the upper three rows of its matrix, row by row, as Vulkan has them.
pub(super) fn transform(rows: &[f32; 12]) -> Affine3A {
    let row = |i: usize| Vec3::new(rows[4 * i], rows[4 * i + 1], rows[4 * i + 2]);
    let matrix = Mat3::from_cols(row(0), row(1), row(2)).transpose();
    Affine3A::from_mat3_translation(matrix, Vec3::new(rows[3], rows[7], rows[11]))
}

/// What `neubrdf_scene_create` begins with.
pub(super) fn empty() -> Scene {
    Scene {
        camera: Camera { eye: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, vertical_fov_degrees: 40.0, lens: None },
        film: Film { width: 512, height: 512 },
        meshes: Vec::new(),
        instances: Vec::new(),
        materials: Vec::new(),
        textures: Vec::new(),
        brdfs: Vec::new(),
        environment: None,
        sun: None,
    }
}

impl NeubrdfScene {
    /// A scene, and those of its meshes that are in the host's buffers.
    pub(super) fn new(scene: Scene, host_meshes: Vec<(u32, HostMesh)>) -> NeubrdfScene {
        NeubrdfScene { scene, host_meshes, warnings: Vec::new() }
    }

    /// Keeps warnings for the host to ask for.
    pub(super) fn warn(&mut self, warnings: &[Warning]) {
        self.warnings.extend(warnings.iter().map(|warning| CString::new(warning.to_string()).unwrap_or_default()));
    }
}

/// An index that is the length of a list before something was added.
pub(super) fn index_of(length: usize) -> Result<u32, Failure> {
    u32::try_from(length).map_err(|_| Failure::argument("more than 2³² of a kind"))
}

/// Loads a scene file (.toml) or an OBJ file (UTF-8 path).
///
/// # Safety
/// `file` is a C string; `scene` points to room for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_load(file: *const c_char, scene: *mut *mut NeubrdfScene) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (loaded, warnings) = Scene::load(unsafe { path(file)? })?;
        let mut made = NeubrdfScene::new(loaded, Vec::new());
        made.warn(&warnings);
        // SAFETY: as the caller says.
        unsafe { hand_over(scene, made) }
    })
}

/// An empty scene, seen from (0, 0, 1) towards the origin, of 512 × 512 pixels, without light. It needs a material, a mesh and an instance
/// before it can be rendered.
///
/// # Safety
/// `scene` points to room for a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_create(scene: *mut *mut NeubrdfScene) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe { hand_over(scene, NeubrdfScene::new(empty(), Vec::new())) }
    })
}

/// Ends the scene; renderers made from it stay alive.
///
/// # Safety
/// The object is alive, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_destroy(scene: *mut NeubrdfScene) {
    // SAFETY: as the caller says.
    unsafe { end(scene) }
}

/// What was left out or mended while loading: the words of the warning of that index, valid as long as the scene; null beyond the last.
///
/// # Safety
/// The object is alive, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_warning(scene: *const NeubrdfScene, index: u32) -> *const c_char {
    // SAFETY: as the caller says.
    let warning = unsafe { scene.as_ref() }.and_then(|scene| scene.warnings.get(index as usize));
    warning.map_or(std::ptr::null(), |text| text.as_ptr())
}

/// Sets the camera.
///
/// # Safety
/// Both objects are alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_set_camera(
    scene: *mut NeubrdfScene,
    camera: *const NeubrdfCamera,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (scene, camera) = unsafe { (object(scene, "scene")?, read(camera)?.camera()) };
        camera.check()?;
        scene.scene.camera = camera;
        Ok(())
    })
}

/// Sets the size of the picture in pixels.
///
/// # Safety
/// The object is alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_set_film(scene: *mut NeubrdfScene, width: u32, height: u32) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let scene = unsafe { object(scene, "scene")? };
        if width == 0 || height == 0 {
            return Err(Failure::argument(format!("a film of {width}x{height} pixels")));
        }
        scene.scene.film = Film { width, height };
        Ok(())
    })
}

/// Adds a texture of width × height linear RGB texels, row by row from the top. `index`, if not null, is told its index.
///
/// # Safety
/// `texels` points to 3 · width · height floats; `index` is null or points to room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_add_texture(
    scene: *mut NeubrdfScene,
    width: u32,
    height: u32,
    texels: *const f32,
    index: *mut u32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (scene, colors) = unsafe { (object(scene, "scene")?, colors(width, height, texels)?) };
        if let Some(texel) = colors.iter().flatten().find(|number| !f16::from_f32(**number).is_finite()) {
            return Err(Failure::argument(format!("a texel of {texel}: texels are finite, and at most 65504")));
        }
        let added = index_of(scene.scene.textures.len())?;
        let half = |[r, g, b]: &[f32; 3]| [*r, *g, *b, 1.0].map(f16::from_f32);
        let texels = colors.iter().map(half).collect();
        scene.scene.textures.push(Texture::new(format!("texture {added}"), width, texels));
        // SAFETY: as the caller says.
        unsafe { put(index, added) };
        Ok(())
    })
}

/// Says where a texture lies: at texture coordinates (u, v) it is looked up at `offset` + `scale` · (u, v). A texture that nobody places has a scale
/// of 1 and an offset of 0.
///
/// # Safety
/// `scale` and `offset` point to two floats each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_place_texture(
    scene: *mut NeubrdfScene,
    index: u32,
    scale: *const f32,
    offset: *const f32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (scene, scale, offset) =
            unsafe { (object(scene, "scene")?, array(scale, 2, "scale")?, array(offset, 2, "offset")?) };
        let textures = scene.scene.textures.len();
        let texture = scene.scene.textures.get_mut(index as usize);
        let texture = texture.ok_or_else(|| Failure::argument(format!("texture {index} of {textures}")))?;
        texture.placement = TexturePlacement { scale: Vec2::from_slice(scale), offset: Vec2::from_slice(offset) };
        Ok(())
    })
}

/// The colours of an image.
///
/// # Safety
/// The pointer is null or points to as many floats as that are.
unsafe fn colors<'a>(width: u32, height: u32, texels: *const f32) -> Result<&'a [[f32; 3]], Failure> {
    let count = width as usize * height as usize;
    if count == 0 {
        return Err(Failure::argument(format!("an image of {width}x{height} texels")));
    }
    // SAFETY: as the caller says.
    unsafe { array(texels.cast(), count, "texels") }
}

/// Adds a material.
///
/// # Safety
/// `index` is null or points to room for a number; the others are alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_add_material(
    scene: *mut NeubrdfScene,
    material: *const NeubrdfMaterial,
    index: *mut u32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (scene, material) = unsafe { (object(scene, "scene")?, read(material)?) };
        let added = index_of(scene.scene.materials.len())?;
        let material = material.material(format!("material {added}"), &scene.scene.materials)?;
        scene.scene.materials.push(material);
        // SAFETY: as the caller says.
        unsafe { put(index, added) };
        Ok(())
    })
}

/// Adds a mesh. It is seen where instances of it stand.
///
/// # Safety
/// The arrays have the lengths that the mesh says; `index` is null or points to room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_add_mesh(
    scene: *mut NeubrdfScene,
    mesh: *const NeubrdfMesh,
    index: *mut u32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (scene, mesh) = unsafe { (object(scene, "scene")?, read(mesh)?) };
        let added = index_of(scene.scene.meshes.len())?;
        // SAFETY: as the caller says.
        let mesh = unsafe { mesh.mesh(added)? };
        scene.scene.meshes.push(mesh);
        // SAFETY: as the caller says.
        unsafe { put(index, added) };
        Ok(())
    })
}

/// Places a mesh in the world, by the upper three rows of a matrix, row by row; null is where it is.
///
/// # Safety
/// `object_to_world` is null or points to twelve floats; `index` is null or points to room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_add_instance(
    scene: *mut NeubrdfScene,
    mesh: u32,
    object_to_world: *const f32,
    index: *mut u32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (scene, rows) = unsafe { (object(scene, "scene")?, object_to_world.cast::<[f32; 12]>().as_ref()) };
        let added = index_of(scene.scene.instances.len())?;
        let instance = Instance { mesh, object_to_world: rows.map_or(Affine3A::IDENTITY, transform) };
        scene.scene.check_instance(added, &instance)?;
        scene.scene.instances.push(instance);
        // SAFETY: as the caller says.
        unsafe { put(index, added) };
        Ok(())
    })
}

/// The sky of these arguments.
///
/// # Safety
/// As of [`neubrdf_scene_set_environment`].
pub(super) unsafe fn environment(
    width: u32,
    height: u32,
    texels: *const f32,
    rotation_degrees: f32,
) -> Result<Option<Environment>, Failure> {
    if texels.is_null() {
        return Ok(None);
    }
    // SAFETY: as the caller says.
    let texels = unsafe { colors(width, height, texels)? }.iter().copied().map(Vec3::from).collect();
    let environment = Environment { width, height, texels, rotation_degrees };
    environment.check()?;
    Ok(Some(environment))
}

/// Sets the sky: width × height radiances, row by row from the zenith (y up), of which each fills its part of the sphere; a sky of one
/// texel is the same all around. Null is no sky.
///
/// # Safety
/// `texels` is null or points to 3 · width · height floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_set_environment(
    scene: *mut NeubrdfScene,
    width: u32,
    height: u32,
    texels: *const f32,
    rotation_degrees: f32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (scene, sky) = unsafe { (object(scene, "scene")?, environment(width, height, texels, rotation_degrees)?) };
        scene.scene.environment = sky;
        Ok(())
    })
}

/// The sun of these arguments.
///
/// # Safety
/// As of [`neubrdf_scene_set_sun`].
pub(super) unsafe fn sun(direction: *const f32, irradiance: *const f32) -> Result<Option<Sun>, Failure> {
    // SAFETY: as the caller says.
    let vectors = unsafe { (direction.cast::<[f32; 3]>().as_ref(), irradiance.cast::<[f32; 3]>().as_ref()) };
    let (Some(direction), Some(irradiance)) = vectors else { return Ok(None) };
    let direction = Vec3::from(*direction)
        .try_normalize()
        .ok_or_else(|| Failure::argument(format!("the direction of the sun is {direction:?}")))?;
    let sun = Sun { direction, irradiance: Vec3::from(*irradiance) };
    sun.check()?;
    Ok(Some(sun))
}

/// Sets the sun: a vector towards it, and the irradiance on a surface that faces it, W/m². Null is no sun.
///
/// # Safety
/// Each is null or points to three floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_set_sun(
    scene: *mut NeubrdfScene,
    direction: *const f32,
    irradiance: *const f32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (scene, sun) = unsafe { (object(scene, "scene")?, sun(direction, irradiance)?) };
        scene.scene.sun = sun;
        Ok(())
    })
}
