//! Compute kernels, and the cache that makes the second start of a program quick.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ash::vk;
use rayon::prelude::*;

use super::device::{Device, Retired};
use super::error::{Error, Result};
use super::profile::PUSH_CONSTANT_BYTES;

/// A compute kernel's module and what of it a pipeline must know. [`super::spirv::load`] finds it by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelSource {
    /// The kernel's name.
    pub name: &'static str,
    /// The module, with one entry point `main`.
    pub spirv: &'static [u8],
    /// It reads the acceleration structure of set 0, binding 0.
    pub uses_acceleration_structure: bool,
    /// Bytes of its push constant block.
    pub push_constant_bytes: u32,
    /// Its workgroup's size, where that is fixed.
    pub local_size: [u32; 3],
    /// Specialization constant 0 gives the workgroup's size (`local_size_x_id = 0`).
    pub local_size_is_open: bool,
}

/// A compute kernel, ready to dispatch.
pub struct Kernel {
    pub(super) pipeline: vk::Pipeline,
    pub(super) source: KernelSource,
    pub(super) device: Arc<Device>,
    local_size: [u32; 3],
}

impl Kernel {
    /// Builds a kernel with values for some of its specialization constants, as `(id, value)`; a float goes by its bits,
    /// a bool as 0 or 1. Constant 0, where it is the workgroup's size and not given, is the device's
    /// [`Profile::workgroup_size`](super::Profile::workgroup_size).
    ///
    /// # Errors
    /// The device cannot run it, or the driver refuses it.
    pub fn new(device: &Arc<Device>, source: KernelSource, specialization: &[(u32, u32)]) -> Result<Kernel> {
        let fail = |reason: String| Error::Kernel { kernel: source.name.to_string(), reason };
        if source.uses_acceleration_structure && !device.has_ray_query() {
            return Err(Error::NoRayQuery { device: device.name().to_string() });
        }
        if source.push_constant_bytes > PUSH_CONSTANT_BYTES {
            let bytes = source.push_constant_bytes;
            return Err(fail(format!("{bytes} bytes of push constants, {PUSH_CONSTANT_BYTES} at most")));
        }
        let mut constants = specialization.to_vec();
        if source.local_size_is_open && constants.iter().all(|(id, _)| *id != 0) {
            constants.push((0, device.profile().workgroup_size));
        }
        let mut local_size = source.local_size;
        if let Some((_, x)) = constants.iter().find(|(id, _)| *id == 0 && source.local_size_is_open) {
            local_size[0] = *x;
        }
        let invocations = local_size.iter().fold(1, |product: u32, size| product.saturating_mul(*size));
        let most = device.limits().max_compute_work_group_invocations;
        if invocations == 0 || invocations > most {
            return Err(fail(format!(
                "a workgroup of {local_size:?} invocations; {} allows 1 to {most}",
                device.name()
            )));
        }

        let words = ash::util::read_spv(&mut std::io::Cursor::new(source.spirv))
            .map_err(|e| fail(format!("its module is no SPIR-V: {e}")))?;
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: the module is one that glslang made, or that the caller vouches for.
        let module =
            unsafe { device.raw.create_shader_module(&info, None) }.map_err(device.error("vkCreateShaderModule"))?;
        let entries: Vec<vk::SpecializationMapEntry> = (0..)
            .zip(&constants)
            .map(|(i, (id, _))| vk::SpecializationMapEntry::default().constant_id(*id).offset(4 * i).size(4))
            .collect();
        let values: Vec<u32> = constants.iter().map(|(_, value)| *value).collect();
        let specialization =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(&values));
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main")
            .specialization_info(&specialization);
        let info = vk::ComputePipelineCreateInfo::default().stage(stage).layout(device.pipeline_layout);
        // SAFETY: all that `info` points to lives until the call returns; the module is not needed after it.
        let made = unsafe {
            let made = device.raw.create_compute_pipelines(device.pipeline_cache.raw, &[info], None);
            device.raw.destroy_shader_module(module, None);
            made
        };
        device.pipeline_cache.changed.store(true, Ordering::Relaxed);
        let pipeline = match made {
            Ok(pipelines) => pipelines.first().copied().unwrap_or_default(),
            Err((_, result)) => match device.error("vkCreateComputePipelines")(result) {
                Error::Call { result, .. } => return Err(fail(format!("the driver refuses it: {result}"))),
                other => return Err(other),
            },
        };
        device.set_name(pipeline, source.name);
        Ok(Kernel { pipeline, source, device: device.clone(), local_size })
    }

    /// Builds several kernels, on all cores, and saves the pipeline cache.
    ///
    /// # Errors
    /// Those of [`Kernel::new`].
    pub fn build_all(device: &Arc<Device>, sources: &[(KernelSource, &[(u32, u32)])]) -> Result<Vec<Kernel>> {
        let kernels = sources
            .par_iter()
            .map(|(source, constants)| Kernel::new(device, *source, constants))
            .collect::<Result<_>>()?;
        device.pipeline_cache.save(&device.raw);
        Ok(kernels)
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        self.source.name
    }

    /// Invocations in a workgroup, a direction.
    pub fn local_size(&self) -> [u32; 3] {
        self.local_size
    }

    /// The workgroups that run at least `invocations` invocations in a row.
    pub fn groups_for(&self, invocations: u32) -> [u32; 3] {
        [invocations.div_ceil(self.local_size[0]), 1, 1]
    }

    /// The same where each invocation goes on by as many steps as there are invocations: no more than every device allows, which fill
    /// every one.
    pub fn strided_groups_for(&self, invocations: u32) -> [u32; 3] {
        self.groups_for(invocations).map(|groups| groups.min(1 << 15))
    }
}

impl Drop for Kernel {
    fn drop(&mut self) {
        self.device.retire(Retired::Pipeline(self.pipeline));
    }
}

/// Compiled pipelines: a host's, in memory, and for our own devices in a file of the user's cache directory.
///
/// Drivers trust what is in such a file, so it starts with a hash of the rest: one that is cut short or damaged is
/// ignored, and written anew.
pub(super) struct PipelineCache {
    raw: vk::PipelineCache,
    changed: AtomicBool,
    path: Option<PathBuf>,
    owned: bool,
}

impl PipelineCache {
    pub(super) fn in_memory(device: &ash::Device) -> PipelineCache {
        Self::new(device, &[], None)
    }

    pub(super) fn of_host(raw: vk::PipelineCache) -> PipelineCache {
        PipelineCache { raw, changed: AtomicBool::new(false), path: None, owned: false }
    }

    pub(super) fn on_disk(
        device: &ash::Device,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
    ) -> PipelineCache {
        // SAFETY: the physical device is of this instance.
        let properties = unsafe { instance.get_physical_device_properties(physical) };
        let key = properties.pipeline_cache_uuid.map(|byte| format!("{byte:02x}")).concat();
        let name = format!(
            "{:08x}-{:08x}-{:08x}-{key}.pipelines",
            properties.vendor_id, properties.device_id, properties.driver_version
        );
        let path = cache_directory().map(|directory| directory.join(name));
        let data = path.as_deref().and_then(load_checked).unwrap_or_default();
        Self::new(device, &data, path)
    }

    fn new(device: &ash::Device, data: &[u8], path: Option<PathBuf>) -> PipelineCache {
        let info = vk::PipelineCacheCreateInfo::default().initial_data(data);
        // SAFETY: the data is empty or what this driver once gave out, as its hash says. Without a cache all still works.
        let raw = unsafe { device.create_pipeline_cache(&info, None) }.unwrap_or_default();
        PipelineCache { raw, changed: AtomicBool::new(false), path, owned: true }
    }

    /// Writes the file if pipelines were added. A cache that cannot be written is no error.
    pub(super) fn save(&self, device: &ash::Device) {
        let Some(path) = &self.path else { return };
        if self.raw == vk::PipelineCache::null() || !self.changed.swap(false, Ordering::Relaxed) {
            return;
        }
        // SAFETY: the cache is this device's.
        if let Ok(data) = unsafe { device.get_pipeline_cache_data(self.raw) } {
            let _ = store_checked(path, &data);
        }
    }

    pub(super) fn destroy(&self, device: &ash::Device) {
        if self.owned {
            // SAFETY: called once, by the device's Drop.
            unsafe { device.destroy_pipeline_cache(self.raw, None) };
        }
    }
}

/// `$XDG_CACHE_HOME/neubrdf`, or `~/.cache/neubrdf`, or none for a user without a home.
fn cache_directory() -> Option<PathBuf> {
    let absolute = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let caches = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")))?;
    Some(caches.join("neubrdf"))
}

fn load_checked(path: &Path) -> Option<Vec<u8>> {
    let bytes = fs::read(path).ok()?;
    let (hash, data) = bytes.split_at_checked(blake3::OUT_LEN)?;
    (blake3::hash(data).as_bytes() == hash).then(|| data.to_vec())
}

/// Written beside its place and renamed: two programs that end at once leave one whole file.
fn store_checked(path: &Path, data: &[u8]) -> std::io::Result<()> {
    if load_checked(path).is_some_and(|old| old == data) {
        return Ok(());
    }
    if let Some(directory) = path.parent() {
        fs::create_dir_all(directory)?;
    }
    let unfinished = path.with_extension(format!("{}.tmp", std::process::id()));
    let written = fs::File::create(&unfinished)
        .and_then(|mut file| file.write_all(blake3::hash(data).as_bytes()).and_then(|()| file.write_all(data)))
        .and_then(|()| fs::rename(&unfinished, path));
    if written.is_err() {
        let _ = fs::remove_file(&unfinished);
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_cache_file_is_ignored() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("below/cache.pipelines");
        assert_eq!(load_checked(&path), None);
        store_checked(&path, b"pipelines").unwrap();
        assert_eq!(load_checked(&path).as_deref(), Some(&b"pipelines"[..]));
        let whole = fs::read(&path).unwrap();
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            assert_eq!(load_checked(&path), None, "cut at {length}");
        }
        let mut damaged = whole.clone();
        *damaged.last_mut().unwrap() ^= 1;
        fs::write(&path, damaged).unwrap();
        assert_eq!(load_checked(&path), None);
    }
}
