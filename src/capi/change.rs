//! What changes in a renderer's scene, or in one that is not rendered yet: each call a change of its own, all or, on an error, nothing.

use super::call::{Failure, NeubrdfResult, array, call, object, read};
use super::host_mesh::{NeubrdfDeformation, follow, update_by};
use super::renderer::NeubrdfRenderer;
use super::scene::{NeubrdfCamera, NeubrdfMaterial, NeubrdfScene, environment, sun, transform};
use crate::plugin::{self, Change};
use crate::scene::{Instance, Scene};

/// What can be changed.
pub(super) trait Changeable {
    /// What the calls name it.
    const NAME: &'static str;

    /// As it is now.
    fn scene(&self) -> &Scene;

    /// Makes changes, all or, on an error, none.
    fn change(&mut self, changes: &[Change]) -> Result<(), Failure>;
}

impl Changeable for NeubrdfRenderer {
    const NAME: &'static str = "renderer";

    fn scene(&self) -> &Scene {
        self.renderer.scene()
    }

    fn change(&mut self, changes: &[Change]) -> Result<(), Failure> {
        self.renderer.update(changes)?;
        follow(&mut self.host_meshes, changes);
        Ok(())
    }
}

impl Changeable for NeubrdfScene {
    const NAME: &'static str = "scene";

    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn change(&mut self, changes: &[Change]) -> Result<(), Failure> {
        plugin::change(&mut self.scene, changes)?;
        follow(&mut self.host_meshes, changes);
        Ok(())
    }
}

/// Makes changes, all or, on an error, none.
///
/// # Safety
/// The object is alive.
unsafe fn update<T: Changeable>(of: *mut T, changes: &[Change]) -> Result<(), Failure> {
    // SAFETY: as the caller says.
    unsafe { object(of, T::NAME)? }.change(changes)
}

/// Another view, from the next frame on.
///
/// # Safety
/// Both are alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_set_camera(
    renderer: *mut NeubrdfRenderer,
    camera: *const NeubrdfCamera,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { update(renderer, &[Change::Camera(read(camera)?.camera())]) })
}

/// How the top level over all instances follows changes from now on: a NeubrdfUpdate; at first it is rebuilt each time.
///
/// # Safety
/// The object is alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_set_top_level(renderer: *mut NeubrdfRenderer, by: u32) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe { object(renderer, "renderer")? }.renderer.set_top_level(update_by(by)?);
        Ok(())
    })
}

/// Instances that stand elsewhere.
///
/// # Safety
/// As of [`neubrdf_renderer_set_transforms`].
unsafe fn moved(instances: *const u32, object_to_world: *const f32, count: u32) -> Result<Vec<Change>, Failure> {
    // SAFETY: as the caller says.
    let (instances, rows) = unsafe {
        let rows: &[[f32; 12]] = array(object_to_world.cast(), count as usize, "object_to_world")?;
        (array(instances, count as usize, "instances")?, rows)
    };
    let moved = instances.iter().zip(rows);
    Ok(moved
        .map(|(instance, rows)| Change::Transform { instance: *instance, object_to_world: transform(rows) })
        .collect())
}

/// Moves `count` instances, from the next frame on: the indices, and twelve floats for each, the upper three rows of its matrix. The top level
/// over all instances follows, once.
///
/// # Safety
/// The arrays have these lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_set_transforms(
    renderer: *mut NeubrdfRenderer,
    instances: *const u32,
    object_to_world: *const f32,
    count: u32,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { update(renderer, &moved(instances, object_to_world, count)?) })
}

/// Moves instances of a scene: as of `neubrdf_renderer_set_transforms`.
///
/// # Safety
/// The arrays have these lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_set_transforms(
    scene: *mut NeubrdfScene,
    instances: *const u32,
    object_to_world: *const f32,
    count: u32,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { update(scene, &moved(instances, object_to_world, count)?) })
}

/// Other instances.
///
/// # Safety
/// As of [`neubrdf_renderer_set_instances`].
unsafe fn placed(meshes: *const u32, object_to_world: *const f32, count: u32) -> Result<Change, Failure> {
    // SAFETY: as the caller says.
    let (meshes, rows) = unsafe {
        let rows: &[[f32; 12]] = array(object_to_world.cast(), count as usize, "object_to_world")?;
        (array(meshes, count as usize, "meshes")?, rows)
    };
    let placed = meshes.iter().zip(rows);
    let instance = |(mesh, rows): (&u32, _)| Instance { mesh: *mesh, object_to_world: transform(rows) };
    Ok(Change::Instances(placed.map(instance).collect()))
}

/// Other instances, `count` of them, at least one, from the next frame on: the mesh of each, and twelve floats, the upper three rows of its
/// matrix. The top level over all instances is rebuilt where they are more, fewer or of other meshes.
///
/// # Safety
/// The arrays have these lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_set_instances(
    renderer: *mut NeubrdfRenderer,
    meshes: *const u32,
    object_to_world: *const f32,
    count: u32,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { update(renderer, &[placed(meshes, object_to_world, count)?]) })
}

/// Other instances of a scene: as of `neubrdf_renderer_set_instances`.
///
/// # Safety
/// The arrays have these lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_set_instances(
    scene: *mut NeubrdfScene,
    meshes: *const u32,
    object_to_world: *const f32,
    count: u32,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { update(scene, &[placed(meshes, object_to_world, count)?]) })
}

/// Another shape of a mesh, from the next frame on: its vertices lie elsewhere, its triangles connect the same ones.
///
/// # Safety
/// The arrays have these lengths; the vertices on the device are as of `neubrdf_scene_add_device_mesh`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_deform(
    renderer: *mut NeubrdfRenderer,
    mesh: u32,
    deformation: *const NeubrdfDeformation,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { update(renderer, &[read(deformation)?.change(mesh)?]) })
}

/// Another shape of a scene's mesh: as of `neubrdf_renderer_deform`. `by` changes nothing here.
///
/// # Safety
/// The arrays have these lengths; the vertices on the device are as of `neubrdf_scene_add_device_mesh`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_deform(
    scene: *mut NeubrdfScene,
    mesh: u32,
    deformation: *const NeubrdfDeformation,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { update(scene, &[read(deformation)?.change(mesh)?]) })
}

/// # Safety
/// As of [`neubrdf_renderer_set_material`].
unsafe fn set_material<T: Changeable>(of: *mut T, index: u32, material: *const NeubrdfMaterial) -> Result<(), Failure> {
    // SAFETY: as the caller says.
    let (of, material) = unsafe { (object(of, T::NAME)?, read(material)?) };
    let material = material.material(format!("material {index}"), &of.scene().materials)?;
    of.change(&[Change::Material { index, material }])
}

/// Another material, from the next frame on.
///
/// # Safety
/// Both are alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_set_material(
    renderer: *mut NeubrdfRenderer,
    index: u32,
    material: *const NeubrdfMaterial,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { set_material(renderer, index, material) })
}

/// Another material in the place of one of a scene.
///
/// # Safety
/// Both are alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_set_material(
    scene: *mut NeubrdfScene,
    index: u32,
    material: *const NeubrdfMaterial,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { set_material(scene, index, material) })
}

/// Another sky, from the next frame on: as of `neubrdf_scene_set_environment`.
///
/// # Safety
/// `texels` is null or points to 3 · width · height floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_set_environment(
    renderer: *mut NeubrdfRenderer,
    width: u32,
    height: u32,
    texels: *const f32,
    rotation_degrees: f32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe { update(renderer, &[Change::Environment(environment(width, height, texels, rotation_degrees)?)]) }
    })
}

/// Another sun, from the next frame on: as of `neubrdf_scene_set_sun`.
///
/// # Safety
/// Each is null or points to three floats.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_set_sun(
    renderer: *mut NeubrdfRenderer,
    direction: *const f32,
    irradiance: *const f32,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe { update(renderer, &[Change::Sun(sun(direction, irradiance)?)]) })
}
