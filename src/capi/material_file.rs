//! Materials of files, and of files that are in memory.

use std::ffi::{c_char, c_void};
use std::mem::discriminant;
use std::path::Path;
use std::sync::Arc;

use super::call::{Failure, NeubrdfResult, array, call, object, path, put, text};
use super::change::Changeable;
use super::renderer::NeubrdfRenderer;
use super::scene::{NeubrdfScene, index_of};
use crate::plugin::Change;
use crate::scene::brdf::NeuBrdf;
use crate::scene::{Brdf, Material, Scene, Surface, Warning};

/// A material that was read.
struct Loaded {
    name: String,
    surface: Surface,
    /// What [`Surface::Measured`] indexes.
    brdfs: Vec<Arc<Brdf>>,
    warnings: Vec<Warning>,
}

impl Loaded {
    /// That of a file.
    ///
    /// # Safety
    /// `file` is a C string, `name` one or null.
    unsafe fn of_file(file: *const c_char, name: *const c_char) -> Result<Loaded, Failure> {
        // SAFETY: as the caller says.
        let (file, name) = unsafe { (path(file)?, text(name, "name")?) };
        let (surface, brdfs, warnings) = Surface::load(&file, name)?;
        Ok(Loaded { name: file.display().to_string(), surface, brdfs, warnings })
    }

    /// That of a `.neubrdf` file in memory.
    ///
    /// # Safety
    /// As of [`neubrdf_scene_add_material_memory`].
    unsafe fn of_memory(
        bytes: *const c_void,
        size: u64,
        name: *const c_char,
        label: *const c_char,
    ) -> Result<Loaded, Failure> {
        let count = usize::try_from(size).map_err(|_| Failure::argument(format!("{size} bytes")))?;
        // SAFETY: as the caller says.
        let (bytes, name, label) =
            unsafe { (array(bytes.cast::<u8>(), count, "bytes")?, text(name, "name")?, text(label, "label")?) };
        let label = label.unwrap_or("a .neubrdf file in memory");
        let brdf = NeuBrdf::decode_of(bytes, name, Path::new(label))?;
        let brdfs = vec![Arc::new(Brdf::NeuBrdf(Box::new(brdf)))];
        Ok(Loaded { name: label.to_owned(), surface: Surface::Measured { brdf: 0 }, brdfs, warnings: Vec::new() })
    }

    /// Adds it to a scene. Returns its index.
    fn add_to(self, scene: &mut NeubrdfScene) -> Result<u32, Failure> {
        let Loaded { name, mut surface, brdfs, warnings } = self;
        scene.warn(&warnings);
        let scene = &mut scene.scene;
        if let Surface::Measured { brdf } = &mut surface {
            *brdf += index_of(scene.brdfs.len())?;
        }
        let added = index_of(scene.materials.len())?;
        scene.brdfs.extend(brdfs);
        scene.materials.push(Material::new(name, surface));
        Ok(added)
    }

    /// Puts it in the place of a material.
    fn replace(self, of: &mut impl Changeable, index: u32) -> Result<(), Failure> {
        let Loaded { name, mut surface, brdfs, warnings } = self;
        if let Some(warning) = warnings.first() {
            // There is nobody to warn.
            return Err(Failure::scene(warning));
        }
        let mut changes = Vec::new();
        if let Surface::Measured { brdf } = &mut surface {
            let (loaded, scene) = (&brdfs[*brdf as usize], of.scene());
            let known = scene.brdfs.iter().position(|other| other == loaded);
            *brdf = index_of(known.unwrap_or_else(|| place_for_brdf(scene, index, loaded)))?;
            if known.is_none() {
                changes.push(Change::Brdf { index: *brdf, brdf: loaded.clone() });
            }
        }
        changes.push(Change::Material { index, material: Material::new(name, surface) });
        of.change(&changes)
    }
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

/// Adds a material of a file: .neubrdf, .toml, MERL .binary, RGL .bsdf, NBRDF .safetensors, sparse .csv. `name` picks one of a file that holds
/// several, else it is null. With maps or emission: add another one with NEUBRDF_SURFACE_OF_MATERIAL.
///
/// # Safety
/// `file` is a C string, `name` one or null; `index` is null or points to room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_add_material_file(
    scene: *mut NeubrdfScene,
    file: *const c_char,
    name: *const c_char,
    index: *mut u32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe {
            let scene = object(scene, "scene")?;
            put(index, Loaded::of_file(file, name)?.add_to(scene)?);
        }
        Ok(())
    })
}

/// Adds a material of the bytes of a .neubrdf file, which are copied. `name` picks one of a file that holds several, else it is null. `label` is
/// what errors call the bytes; null is a name of ours. Any bytes will do: what is no such file is NEUBRDF_RESULT_SCENE, and the scene is as before.
///
/// # Safety
/// `bytes` points to as many bytes as `size` says, or is null where that is 0; `name` and `label` are C strings or null; `index` is null or
/// points to room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_add_material_memory(
    scene: *mut NeubrdfScene,
    bytes: *const c_void,
    size: u64,
    name: *const c_char,
    label: *const c_char,
    index: *mut u32,
) -> NeubrdfResult {
    call(|| {
        // SAFETY: as the caller says.
        unsafe {
            let scene = object(scene, "scene")?;
            put(index, Loaded::of_memory(bytes, size, name, label)?.add_to(scene)?);
        }
        Ok(())
    })
}

/// Another material, from the next frame on, of a file as of `neubrdf_scene_add_material_file`; it does not emit. The file's BRDF is
/// shared with the materials that have it already, or takes the place of one that no other material has: a material may become another and
/// be set back as often as one likes. What would be a warning there is an error here.
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
    // SAFETY: as the caller says.
    call(|| unsafe {
        let renderer = object(renderer, "renderer")?;
        Loaded::of_file(file, name)?.replace(renderer, index)
    })
}

/// Another material in the place of one of a scene: as of `neubrdf_renderer_set_material_file`.
///
/// # Safety
/// `file` is a C string, `name` one or null; the scene is alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_set_material_file(
    scene: *mut NeubrdfScene,
    index: u32,
    file: *const c_char,
    name: *const c_char,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe {
        let scene = object(scene, "scene")?;
        Loaded::of_file(file, name)?.replace(scene, index)
    })
}

/// Another material, from the next frame on, of the bytes of a .neubrdf file: as of `neubrdf_scene_add_material_memory` and
/// `neubrdf_renderer_set_material_file`.
///
/// # Safety
/// As of `neubrdf_scene_add_material_memory`; the renderer is alive.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_renderer_set_material_memory(
    renderer: *mut NeubrdfRenderer,
    index: u32,
    bytes: *const c_void,
    size: u64,
    name: *const c_char,
    label: *const c_char,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe {
        let renderer = object(renderer, "renderer")?;
        Loaded::of_memory(bytes, size, name, label)?.replace(renderer, index)
    })
}

/// Another material in the place of one of a scene: as of `neubrdf_renderer_set_material_memory`.
///
/// # Safety
/// As of `neubrdf_scene_add_material_memory`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn neubrdf_scene_set_material_memory(
    scene: *mut NeubrdfScene,
    index: u32,
    bytes: *const c_void,
    size: u64,
    name: *const c_char,
    label: *const c_char,
) -> NeubrdfResult {
    // SAFETY: as the caller says.
    call(|| unsafe {
        let scene = object(scene, "scene")?;
        Loaded::of_memory(bytes, size, name, label)?.replace(scene, index)
    })
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
