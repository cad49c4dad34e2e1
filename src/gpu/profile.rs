//! What a device offers, what we need of it, and every choice that depends on which device it is.

use std::collections::BTreeSet;
use std::ffi::CStr;

use ash::{khr, vk};

/// Push constants of a kernel, in bytes: what SwiftShader has, and what Vulkan promises.
pub const PUSH_CONSTANT_BYTES: u32 = 128;

/// The one place for choices that depend on the driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Profile {
    /// Invocations in a workgroup, for kernels that leave it open (specialization constant 0).
    pub workgroup_size: u32,
    /// Whether a workgroup asks as one for places in a queue, where all that runs asks for them; else each subgroup does. Barriers cost
    /// CPU drivers more.
    pub reserves_by_workgroup: bool,
    /// Paths in flight, unless the user says otherwise.
    pub pool_paths: u32,
    /// Whether `VK_KHR_ray_query` is the faster traversal. On lavapipe the BVH walk is 4 to 100 times faster.
    pub traversal_prefers_ray_query: bool,
    /// The device is the CPU (lavapipe, SwiftShader).
    pub is_cpu: bool,
    /// Whether the driver's compiler survives the kernel that shades NeuBRDFs: SwiftShader's takes 15 GB and does not end.
    pub compiles_neubrdf: bool,
}

/// A device's limits, by their Vulkan names.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Limits {
    pub max_push_constants_size: u32,
    pub max_compute_work_group_invocations: u32,
    pub max_compute_work_group_size: [u32; 3],
    pub max_compute_work_group_count: [u32; 3],
    pub max_compute_shared_memory_size: u32,
    pub max_storage_buffer_range: u32,
    pub max_memory_allocation_size: u64,
    pub subgroup_size: u32,
    /// Bytes of the largest heap that is local to the device.
    pub device_memory: u64,
    /// Nanoseconds a timestamp tick; 0 where the compute queue has no timestamps.
    pub timestamp_period: f32,
    /// Bits of a timestamp that count; 0 where the compute queue has no timestamps.
    pub timestamp_valid_bits: u32,
    pub min_acceleration_structure_scratch_offset_alignment: u32,
}

/// What `neubrdf info` says about a device.
#[derive(Clone, Debug)]
pub struct DeviceReport {
    /// Its place in the loader's list; names it in [`super::DeviceChoice::Named`].
    pub index: usize,
    /// The device's name.
    pub name: String,
    /// The driver's name and version.
    pub driver: String,
    /// The Vulkan version, as in `1.3.281`.
    pub api_version: String,
    /// Discrete GPU, integrated GPU, virtual GPU, CPU or other.
    pub kind: &'static str,
    /// It has `VK_KHR_ray_query` over `VK_KHR_acceleration_structure`.
    pub ray_query: bool,
    /// What makes it unfit, by Vulkan's names; empty for a fit device.
    pub missing: Vec<String>,
    /// Its limits.
    pub limits: Limits,
    pub(super) queue_family: u32,
    /// It is Vulkan over another interface (MoltenVK), and must be asked for as such.
    pub(super) is_portability_subset: bool,
}

impl DeviceReport {
    /// The choices made for this device.
    pub fn profile(&self) -> Profile {
        let is_cpu = self.kind == "CPU";
        Profile {
            workgroup_size: if is_cpu { 64 } else { 128 },
            reserves_by_workgroup: !is_cpu,
            pool_paths: if is_cpu { 1 << 16 } else { 1 << 21 },
            traversal_prefers_ray_query: self.ray_query && !is_cpu,
            is_cpu,
            compiles_neubrdf: !self.name.contains("SwiftShader"),
        }
    }

    /// The lower, the better a choice.
    pub(super) fn rank(&self) -> (usize, bool) {
        let kinds = ["discrete GPU", "integrated GPU", "virtual GPU", "CPU"];
        (kinds.iter().position(|kind| *kind == self.kind).unwrap_or(kinds.len()), !self.ray_query)
    }

    pub(super) fn matches(&self, asked: &str) -> bool {
        let asked = asked.trim().to_lowercase();
        match asked.parse::<usize>() {
            Ok(index) => index == self.index,
            Err(_) => {
                !asked.is_empty()
                    && (self.name.to_lowercase().contains(&asked) || self.driver.to_lowercase().contains(&asked))
            }
        }
    }
}

/// `1.3.281` for a Vulkan version number.
pub(super) fn version(number: u32) -> String {
    format!("{}.{}.{}", vk::api_version_major(number), vk::api_version_minor(number), vk::api_version_patch(number))
}

fn extensions(instance: &ash::Instance, physical: vk::PhysicalDevice) -> BTreeSet<String> {
    // SAFETY: the physical device is of this instance.
    let found = unsafe { instance.enumerate_device_extension_properties(physical) }.unwrap_or_default();
    found.iter().filter_map(|e| Some(e.extension_name_as_c_str().ok()?.to_string_lossy().into_owned())).collect()
}

pub(super) const RAY_QUERY_EXTENSIONS: [&CStr; 3] =
    [khr::acceleration_structure::NAME, khr::ray_query::NAME, khr::deferred_host_operations::NAME];

/// Looks at a device; `queue_family` is a host's, `None` picks one.
pub(super) fn report(
    instance: &ash::Instance,
    index: usize,
    physical: vk::PhysicalDevice,
    queue_family: Option<u32>,
) -> DeviceReport {
    let extensions = extensions(instance, physical);
    let has_extension = |name: &CStr| extensions.contains(&*name.to_string_lossy());
    // SAFETY: the physical device is of this instance, for this and all queries below.
    let basic = unsafe { instance.get_physical_device_properties(physical) };
    let is_1_2 = basic.api_version >= vk::API_VERSION_1_2;
    let ray_extensions = RAY_QUERY_EXTENSIONS.iter().all(|name| has_extension(name));

    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
    let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
    let mut acceleration = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    let mut properties = vk::PhysicalDeviceProperties2::default();
    let mut features12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut acceleration_features = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut ray_query_features = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
    let mut features = vk::PhysicalDeviceFeatures2::default();
    if is_1_2 {
        properties = properties.push_next(&mut driver).push_next(&mut subgroup).push_next(&mut maintenance3);
        features = features.push_next(&mut features12);
    }
    if ray_extensions {
        properties = properties.push_next(&mut acceleration);
        features = features.push_next(&mut acceleration_features).push_next(&mut ray_query_features);
    }
    // SAFETY: as above; every structure in the chains is one that the device's version and extensions know.
    let (memory, families) = unsafe {
        if is_1_2 {
            instance.get_physical_device_properties2(physical, &mut properties);
            instance.get_physical_device_features2(physical, &mut features);
        }
        (
            instance.get_physical_device_memory_properties(physical),
            instance.get_physical_device_queue_family_properties(physical),
        )
    };

    let queue_family = queue_family.or_else(|| compute_family(&families));
    let family = queue_family.and_then(|family| families.get(family as usize));
    let timestamp_valid_bits = family.map_or(0, |family| family.timestamp_valid_bits);
    let limits = &basic.limits;
    let heaps = memory.memory_heaps_as_slice().iter();
    let limits = Limits {
        max_push_constants_size: limits.max_push_constants_size,
        max_compute_work_group_invocations: limits.max_compute_work_group_invocations,
        max_compute_work_group_size: limits.max_compute_work_group_size,
        max_compute_work_group_count: limits.max_compute_work_group_count,
        max_compute_shared_memory_size: limits.max_compute_shared_memory_size,
        max_storage_buffer_range: limits.max_storage_buffer_range,
        max_memory_allocation_size: maintenance3.max_memory_allocation_size,
        subgroup_size: subgroup.subgroup_size,
        device_memory: heaps
            .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
            .map(|heap| heap.size)
            .max()
            .unwrap_or(0),
        timestamp_period: if timestamp_valid_bits == 0 { 0.0 } else { limits.timestamp_period },
        timestamp_valid_bits,
        min_acceleration_structure_scratch_offset_alignment: acceleration
            .min_acceleration_structure_scratch_offset_alignment
            .max(1),
    };

    let mut missing = Vec::new();
    if !is_1_2 {
        missing.push(format!("Vulkan 1.2 (it has {})", version(basic.api_version)));
    }
    for (name, there) in [
        ("bufferDeviceAddress", features12.buffer_device_address),
        ("scalarBlockLayout", features12.scalar_block_layout),
        ("timelineSemaphore", features12.timeline_semaphore),
    ] {
        if is_1_2 && there == vk::FALSE {
            missing.push(format!("feature {name}"));
        }
    }
    if !family.is_some_and(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE)) {
        missing.push("a queue family with VK_QUEUE_COMPUTE_BIT".to_string());
    }
    if is_1_2 && !subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE) {
        missing.push("subgroup operations in compute shaders".to_string());
    }
    for (name, operations) in
        [("ballot", vk::SubgroupFeatureFlags::BALLOT), ("shuffle", vk::SubgroupFeatureFlags::SHUFFLE)]
    {
        if is_1_2 && !subgroup.supported_operations.contains(operations) {
            missing.push(format!("subgroup operations of the kind {name}"));
        }
    }
    for (name, found, needed) in [
        ("maxPushConstantsSize", limits.max_push_constants_size, PUSH_CONSTANT_BYTES),
        ("maxComputeWorkGroupInvocations", limits.max_compute_work_group_invocations, 256),
        ("maxComputeSharedMemorySize", limits.max_compute_shared_memory_size, 16384),
    ] {
        if found < needed {
            missing.push(format!("limit {name} of {needed} (it has {found})"));
        }
    }

    let driver = match driver.driver_id {
        _ if !is_1_2 => format!("driver version {}", basic.driver_version),
        // It calls itself llvmpipe, which is the name of its OpenGL sibling.
        vk::DriverId::MESA_LLVMPIPE => format!("lavapipe {}", c_string(driver.driver_info_as_c_str())),
        _ => format!("{} {}", c_string(driver.driver_name_as_c_str()), c_string(driver.driver_info_as_c_str())),
    };
    DeviceReport {
        index,
        name: c_string(basic.device_name_as_c_str()),
        driver: driver.trim().to_string(),
        api_version: version(basic.api_version),
        kind: match basic.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => "discrete GPU",
            vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated GPU",
            vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual GPU",
            vk::PhysicalDeviceType::CPU => "CPU",
            _ => "other",
        },
        ray_query: acceleration_features.acceleration_structure == vk::TRUE && ray_query_features.ray_query == vk::TRUE,
        missing,
        limits,
        queue_family: queue_family.unwrap_or(0),
        is_portability_subset: has_extension(khr::portability_subset::NAME),
    }
}

/// The family to compute on: one that also draws, as it is the one that every driver treats best, or else any.
fn compute_family(families: &[vk::QueueFamilyProperties]) -> Option<u32> {
    let find = |wanted: vk::QueueFlags| families.iter().position(|f| f.queue_flags.contains(wanted)).map(|i| i as u32);
    find(vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS).or_else(|| find(vk::QueueFlags::COMPUTE))
}

fn c_string<E>(text: Result<&CStr, E>) -> String {
    text.map(|text| text.to_string_lossy().into_owned()).unwrap_or_default()
}
