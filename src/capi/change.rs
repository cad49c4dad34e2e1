//! What changes in a renderer's scene: each call a change of its own.

use std::ffi::c_char;
use std::mem::discriminant;

use super::call::{Failure, NeubrdfResult, array, call, object, path, read, text};
use super::host_mesh::{NeubrdfDeformation, update_by};
use super::renderer::NeubrdfRenderer;
use super::scene::{NeubrdfCamera, NeubrdfMaterial, environment, index_of, sun, transform};
use crate::plugin::Change;
use crate::scene::{Brdf, Instance, Material, Scene, Surface};

/// Makes changes, all or, on an error, none.
///
/// # Safety
/// The object is alive.
unsafe fn update(renderer: *mut NeubrdfRenderer, changes: &[Change]) -> Result<(), Failure> {
    // SAFETY: as the caller says.
    Ok(unsafe { object(renderer, "renderer")? }.renderer.update(changes)?)
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
    call(|| {
        // SAFETY: as the caller says.
        let (instances, rows) = unsafe {
            let rows: &[[f32; 12]] = array(object_to_world.cast(), count as usize, "object_to_world")?;
            (array(instances, count as usize, "instances")?, rows)
        };
        let moved = instances.iter().zip(rows);
        let changes: Vec<Change> = moved
            .map(|(instance, rows)| Change::Transform { instance: *instance, object_to_world: transform(rows) })
            .collect();
        // SAFETY: as the caller says.
        unsafe { update(renderer, &changes) }
    })
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
    call(|| {
        // SAFETY: as the caller says.
        let (meshes, rows) = unsafe {
            let rows: &[[f32; 12]] = array(object_to_world.cast(), count as usize, "object_to_world")?;
            (array(meshes, count as usize, "meshes")?, rows)
        };
        let placed = meshes.iter().zip(rows);
        let instances = placed.map(|(mesh, rows)| Instance { mesh: *mesh, object_to_world: transform(rows) }).collect();
        // SAFETY: as the caller says.
        unsafe { update(renderer, &[Change::Instances(instances)]) }
    })
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
    call(|| {
        // SAFETY: as the caller says.
        unsafe {
            let others = &object(renderer, "renderer")?.renderer.scene().materials;
            let material = read(material)?.material(format!("material {index}"), others)?;
            update(renderer, &[Change::Material { index, material }])
        }
    })
}

/// Another material, from the next frame on, of a file as of `neubrdf_scene_add_material_file`; it does not emit. The file's BRDF is
/// shared with the materials that have it already, or takes the place of one that no other material has: a material may become another and
/// be set back as often as one likes.
///
/// # Safety
/// `file` is a C string, `name` one or null; the renderer is alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_set_material_file(
    renderer: *mut NeubrdfRenderer,
    index: u32,
    file: *const c_char,
    name: *const c_char,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        let (renderer, file, name) =
            unsafe { (&mut object(renderer, "renderer")?.renderer, path(file)?, text(name, "name")?) };
        let (mut surface, brdfs, warnings) = Surface::load(&file, name)?;
        if let Some(warning) = warnings.first() {
            // There is nobody to warn.
            return Err(Failure::scene(warning));
        }
        let mut changes = Vec::new();
        if let Surface::Measured { brdf } = &mut surface {
            let (loaded, scene) = (&brdfs[*brdf as usize], renderer.scene());
            let known = scene.brdfs.iter().position(|other| other == loaded);
            *brdf = index_of(known.unwrap_or_else(|| place_for_brdf(scene, index, loaded)))?;
            if known.is_none() {
                changes.push(Change::Brdf { index: *brdf, brdf: loaded.clone() });
            }
        }
        let material = Material::new(file.display().to_string(), surface);
        changes.push(Change::Material { index, material });
        Ok(renderer.update(&changes)?)
    })
}

/// Where a BRDF for that material goes: in the place of one that no other material has, or after the last. Of several such places it is one of
/// the same kind, as kernels are built for so many NeuBRDFs; then its own, as what others had may come back.
fn place_for_brdf(scene: &Scene, index: u32, brdf: &Brdf) -> usize {
    let of = |material: &Material| match material.surface {
        Surface::Measured { brdf } => Some(brdf as usize),
        _ => None,
    };
    let own = scene.materials.get(index as usize).and_then(of);
    let others = (0..).zip(&scene.materials).filter(|(other, _)| *other != index);
    let taken: Vec<usize> = others.filter_map(|(_, material)| of(material)).collect();
    let free = (0..scene.brdfs.len()).filter(|place| !taken.contains(place));
    let is_of_another_kind = |place: usize| discriminant(&*scene.brdfs[place]) != discriminant(brdf);
    free.min_by_key(|place| (is_of_another_kind(*place), Some(*place) != own)).unwrap_or(scene.brdfs.len())
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::capi::scene::empty;
    use crate::scene::brdf::{Merl, Sparse};

    #[test]
    fn a_brdf_takes_a_place_that_no_other_material_needs() {
        let merl = Arc::new(Brdf::Merl(Merl::tabulate(|_| None)));
        let sparse = Arc::new(Brdf::Sparse(Sparse::new(Vec::new(), true)));
        let scene = |brdfs: &[&Arc<Brdf>], materials: &[u32]| {
            let material = |brdf: &u32| Material::new("", Surface::Measured { brdf: *brdf });
            let brdfs = brdfs.iter().map(|brdf| Arc::clone(brdf)).collect();
            Scene { brdfs, materials: materials.iter().map(material).collect(), ..empty() }
        };
        let several = scene(&[&merl, &sparse, &merl, &merl], &[2, 1, 3]);
        assert_eq!(place_for_brdf(&several, 0, &merl), 2, "its own");
        assert_eq!(place_for_brdf(&several, 1, &merl), 0, "one of the kind, rather than its own of another");
        assert_eq!(place_for_brdf(&several, 0, &sparse), 2, "its own, where none of the kind is free");
        let shared = [0, 0];
        assert_eq!(place_for_brdf(&scene(&[&merl, &sparse], &shared), 0, &merl), 1, "one that none has");
        assert_eq!(place_for_brdf(&scene(&[&merl], &shared), 0, &merl), 1, "after the last");
    }
}
