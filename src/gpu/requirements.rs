//! What a host must enable on its device before we can work in it.

use std::ffi::{CStr, c_char, c_void};

use ash::vk;

use super::profile;

/// What a physical device is to be opened with: its own [`extensions`](Requirements::extensions) and
/// [`features`](Requirements::features) by name, or merged into a host's [`vk::DeviceCreateInfo`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Requirements {
    /// The device's name.
    pub device: String,
    /// What makes it unfit, by Vulkan's names; empty for a fit device.
    pub missing: Vec<String>,
    /// Whether ray query is asked for too: optional, and set where the device has it. A host that has no use for it puts
    /// `false`, and rays walk a BVH in a compute shader.
    pub ray_query: bool,
}

/// Room for what [`Requirements::merge`] adds to a host's create info. Kept until the device is made.
#[derive(Default)]
pub struct Additions {
    extensions: Vec<*const c_char>,
    address: vk::PhysicalDeviceBufferDeviceAddressFeatures<'static>,
    scalar: vk::PhysicalDeviceScalarBlockLayoutFeatures<'static>,
    timeline: vk::PhysicalDeviceTimelineSemaphoreFeatures<'static>,
    acceleration: vk::PhysicalDeviceAccelerationStructureFeaturesKHR<'static>,
    ray_query: vk::PhysicalDeviceRayQueryFeaturesKHR<'static>,
}

/// What a physical device lacks, and what is to be enabled on it.
///
/// # Safety
/// `physical` is of `instance`, which was made for Vulkan 1.2 or later.
pub unsafe fn requirements(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Requirements {
    let report = profile::report(instance, 0, physical, None);
    Requirements { device: report.name, missing: report.missing, ray_query: report.ray_query }
}

impl Requirements {
    /// The device extensions to enable; none without ray query.
    pub fn extensions(&self) -> &'static [&'static CStr] {
        if self.ray_query { &profile::RAY_QUERY_EXTENSIONS } else { &[] }
    }

    /// The features to enable, by Vulkan's names. The first three are of Vulkan 1.2.
    pub fn features(&self) -> &'static [&'static str] {
        const ALL: [&str; 5] =
            ["bufferDeviceAddress", "scalarBlockLayout", "timelineSemaphore", "accelerationStructure", "rayQuery"];
        if self.ray_query { &ALL } else { &ALL[..3] }
    }

    /// Adds the extensions and features to what the host enables anyway. A bit is set in the structure of the host's chain
    /// that holds it, `VkPhysicalDeviceVulkan12Features` or the feature's own, and a structure is appended only where there
    /// is neither: Vulkan forbids both in one chain.
    ///
    /// # Safety
    /// The chain and the names that `info` points to are valid, and nobody else uses the chain's structures meanwhile: they
    /// were given by `push_next`, or as pointers that may be written through.
    pub unsafe fn merge<'a>(
        &self,
        mut info: vk::DeviceCreateInfo<'a>,
        room: &'a mut Additions,
    ) -> vk::DeviceCreateInfo<'a> {
        let Additions { extensions, address, scalar, timeline, acceleration, ray_query } = room;
        let chain = info.p_next;
        // SAFETY: the chain is valid, as the caller says, for this and all look-ups below.
        unsafe {
            if let Some(features) = find::<vk::PhysicalDeviceVulkan12Features<'a>>(chain) {
                features.buffer_device_address = vk::TRUE;
                features.scalar_block_layout = vk::TRUE;
                features.timeline_semaphore = vk::TRUE;
            } else {
                info = enable(info, chain, address, |features| &mut features.buffer_device_address);
                info = enable(info, chain, scalar, |features| &mut features.scalar_block_layout);
                info = enable(info, chain, timeline, |features| &mut features.timeline_semaphore);
            }
            if self.ray_query {
                info = enable(info, chain, acceleration, |features| &mut features.acceleration_structure);
                info = enable(info, chain, ray_query, |features| &mut features.ray_query);
            }
        }
        extensions.clear();
        if info.enabled_extension_count > 0 {
            // SAFETY: the caller gave that many names.
            extensions.extend_from_slice(unsafe {
                std::slice::from_raw_parts(info.pp_enabled_extension_names, info.enabled_extension_count as usize)
            });
        }
        for name in self.extensions() {
            // SAFETY: the caller's names are C strings.
            if !extensions.iter().any(|known| unsafe { CStr::from_ptr(*known) } == *name) {
                extensions.push(name.as_ptr());
            }
        }
        info.enabled_extension_names(extensions)
    }
}

/// Sets a feature's bit in the chain's structure of that type, or appends `own` with the bit set.
///
/// # Safety
/// As of [`find`].
unsafe fn enable<'a, T>(
    info: vk::DeviceCreateInfo<'a>,
    chain: *const c_void,
    own: &'a mut T,
    bit: impl Fn(&mut T) -> &mut vk::Bool32,
) -> vk::DeviceCreateInfo<'a>
where
    T: vk::TaggedStructure + vk::ExtendsDeviceCreateInfo,
{
    // SAFETY: as the caller says.
    if let Some(features) = unsafe { find::<T>(chain) } {
        *bit(features) = vk::TRUE;
        return info;
    }
    *bit(own) = vk::TRUE;
    info.push_next(own)
}

/// The structure of that type in a chain.
///
/// # Safety
/// The chain is valid, and nobody else uses its structures while the result lives.
unsafe fn find<'a, T: vk::TaggedStructure>(chain: *const c_void) -> Option<&'a mut T> {
    let mut next = chain.cast_mut().cast::<vk::BaseOutStructure<'_>>();
    // SAFETY: every structure of a chain begins as this one does, and one with its type is a `T`.
    unsafe {
        while let Some(structure) = next.as_mut() {
            if structure.s_type == T::STRUCTURE_TYPE {
                return next.cast::<T>().as_mut();
            }
            next = structure.p_next.cast();
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(info: &vk::DeviceCreateInfo<'_>) -> Vec<&'static CStr> {
        let names = info.pp_enabled_extension_names;
        (0..info.enabled_extension_count as usize)
            // SAFETY: `merge` gave that many names.
            .map(|index| unsafe { CStr::from_ptr(*names.add(index)) })
            .collect()
    }

    fn types(mut next: *const c_void) -> Vec<vk::StructureType> {
        let mut types = Vec::new();
        // SAFETY: the chain is one that `merge` made.
        while let Some(structure) = unsafe { next.cast::<vk::BaseInStructure<'_>>().as_ref() } {
            types.push(structure.s_type);
            next = structure.p_next.cast();
        }
        types
    }

    fn with_ray_query(ray_query: bool) -> Requirements {
        Requirements { device: String::new(), missing: Vec::new(), ray_query }
    }

    #[test]
    fn an_empty_chain_gets_each_feature_s_own_structure() {
        let mut room = Additions::default();
        // SAFETY: there is no chain.
        let info = unsafe { with_ray_query(true).merge(vk::DeviceCreateInfo::default(), &mut room) };
        assert_eq!(types(info.p_next).len(), 5);
        assert_eq!(names(&info), profile::RAY_QUERY_EXTENSIONS);
    }

    #[test]
    fn bits_are_set_where_the_host_s_chain_has_them() {
        let mut features = vk::PhysicalDeviceVulkan12Features::default().sampler_mirror_clamp_to_edge(true);
        let mut rays = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
        let host = [c"VK_KHR_swapchain".as_ptr(), c"VK_KHR_ray_query".as_ptr()];
        let mut room = Additions::default();
        let info = vk::DeviceCreateInfo::default()
            .enabled_extension_names(&host)
            .push_next(&mut features)
            .push_next(&mut rays);
        // SAFETY: the chain was made by `push_next`.
        let info = unsafe { with_ray_query(true).merge(info, &mut room) };
        let found = types(info.p_next);
        assert_eq!(found.len(), 3, "only the acceleration structures' own is new: {found:?}");
        assert_eq!(names(&info).len(), 4);
        assert_eq!((features.buffer_device_address, features.timeline_semaphore), (vk::TRUE, vk::TRUE));
        assert_eq!((features.scalar_block_layout, features.sampler_mirror_clamp_to_edge), (vk::TRUE, vk::TRUE));
        assert_eq!(rays.ray_query, vk::TRUE);
    }

    /// `VkPhysicalDeviceVulkan12Features` beside a structure that was promoted into it would be a mistake.
    #[test]
    fn a_promoted_structure_of_the_host_s_gets_no_rival() {
        let mut address = vk::PhysicalDeviceBufferDeviceAddressFeatures::default();
        let mut room = Additions::default();
        let info = vk::DeviceCreateInfo::default().push_next(&mut address);
        // SAFETY: the chain was made by `push_next`.
        let info = unsafe { with_ray_query(false).merge(info, &mut room) };
        let found = types(info.p_next);
        assert_eq!(found.len(), 3);
        assert!(!found.contains(&vk::StructureType::PHYSICAL_DEVICE_VULKAN_1_2_FEATURES));
        assert!(names(&info).is_empty());
        assert_eq!(address.buffer_device_address, vk::TRUE);
    }
}
