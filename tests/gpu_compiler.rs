//! What a compiler of GPUs makes of the kernels: Mesa's for AMD (RADV), which needs no GPU for that. It has a device without hardware, which
//! compiles what it cannot run.
#![allow(unsafe_code)] // Vulkan as such: that device does not do what src/gpu asks of one

mod common;

use std::collections::BTreeMap;
use std::path::Path;

use ash::vk;
use neubrdf::gpu::{KernelSource, spirv};

/// GCN without ray query, RDNA 2 and RDNA 3.
const CHIPS: [&str; 3] = ["vega10", "navi21", "navi31"];
const MANIFESTS: [&str; 2] =
    ["/usr/share/vulkan/icd.d/radeon_icd.json", "/usr/share/vulkan/icd.d/radeon_icd.x86_64.json"];

/// Words of the walk's two stacks and of their sizes.
const WALK_WORDS: u64 = 2 * 97;
/// What alignment may add to them.
const ROUNDING_WORDS: u64 = 4;
const BYTES_PER_SUBGROUP_WORD: u64 = 4 * 64;

/// Workgroups of 128 that reserve as one, as on GPUs, and a scene with emitters, a sky, a sun and textures.
const CONSTANTS: [(u32, u32); 6] = [(0, 128), (2, 1), (3, 1), (4, 1), (6, 1), (32, 1)];
/// Numbers of networks as f32 and, as files have them, as f16.
const PRECISIONS: [(u32, u32); 2] = [(23, 0), (23, 1)];

/// Arrays that are not in registers are in memory, where each access costs hundreds of cycles, and copies of them cost as many accesses as
/// they have words. (The walk handed its stack from function to function once, and spent most of a GPU's time on that.)
#[test]
fn nothing_but_the_stack_of_a_walk_lies_in_memory() {
    let Some(manifest) = MANIFESTS.iter().find(|path| Path::new(path).exists()) else {
        return common::skip("no RADV (Debian: mesa-vulkan-drivers)");
    };
    let mut compiled = 0;
    for chip in CHIPS {
        // SAFETY: this is the only test of the process, and nothing else runs while it sets what the loader and the driver read.
        let Some(compiler) = (unsafe {
            std::env::set_var("VK_DRIVER_FILES", manifest);
            std::env::set_var("RADV_FORCE_FAMILY", chip);
            Compiler::new()
        }) else {
            eprintln!("skipped: this RADV has no {chip} without hardware");
            continue;
        };
        for name in spirv::names() {
            let source = spirv::load(name).unwrap();
            if source.uses_acceleration_structure && !compiler.has_ray_query {
                continue;
            }
            let is_neubrdf = name.contains("neubrdf");
            for precision in &PRECISIONS[..1 + usize::from(is_neubrdf)] {
                let constants = [&CONSTANTS[..], &[*precision]].concat();
                let found = compiler.statistics(&source, &constants);
                let scratch = found["Scratch size"] / BYTES_PER_SUBGROUP_WORD;
                let spilled = found["Spilled VGPRs"];
                eprintln!("{chip} {name} {precision:?}: {} registers, {scratch} words in memory", found["VGPRs"]);
                let stack = if name.ends_with("_bvh") { WALK_WORDS } else { 0 };
                assert!(scratch <= stack + spilled + ROUNDING_WORDS, "{chip}, {name}: {found:?}");
                assert!(spilled == 0 || is_neubrdf, "{chip}, {name}: {found:?}");
                compiled += 1;
            }
        }
    }
    if compiled == 0 {
        common::skip("this RADV compiles for no chip without hardware");
    }
    eprintln!("{compiled} kernels");
}

/// A device that compiles.
struct Compiler {
    device: ash::Device,
    executables: ash::khr::pipeline_executable_properties::Device,
    layout: vk::PipelineLayout,
    has_ray_query: bool,
    instance: ash::Instance,
    _entry: ash::Entry,
}

impl Compiler {
    /// # Safety
    /// No other thread reads or writes environment variables.
    unsafe fn new() -> Option<Compiler> {
        // SAFETY: each handle is made from those before; all that the structures point to lives as long as they do.
        unsafe {
            let entry = ash::Entry::load().ok()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None).ok()?;
            let physical = instance.enumerate_physical_devices().ok()?.into_iter().next()?;
            let mut executable = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
            let mut ray_query = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
            let mut features_1_3 = vk::PhysicalDeviceVulkan13Features::default();
            let mut features_1_2 = vk::PhysicalDeviceVulkan12Features::default();
            let mut features = vk::PhysicalDeviceFeatures2::default()
                .push_next(&mut executable)
                .push_next(&mut ray_query)
                .push_next(&mut features_1_3)
                .push_next(&mut features_1_2);
            instance.get_physical_device_features2(physical, &mut features);
            let offered = instance.enumerate_device_extension_properties(physical).unwrap();
            let has_ray_query = offered.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::khr::ray_query::NAME));
            let mut extensions = vec![ash::khr::pipeline_executable_properties::NAME.as_ptr()];
            if has_ray_query {
                extensions.extend([
                    ash::khr::acceleration_structure::NAME.as_ptr(),
                    ash::khr::deferred_host_operations::NAME.as_ptr(),
                    ash::khr::ray_query::NAME.as_ptr(),
                ]);
            }
            let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .push_next(&mut features);
            let device = instance.create_device(physical, &info, None).unwrap();
            let bindings = [vk::DescriptorSetLayoutBinding::default()
                .descriptor_type(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)];
            let bindings = if has_ray_query { &bindings[..] } else { &[] };
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(bindings);
            let sets = [device.create_descriptor_set_layout(&info, None).unwrap()];
            let pushed = [vk::PushConstantRange::default().stage_flags(vk::ShaderStageFlags::COMPUTE).size(128)];
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&pushed);
            let layout = device.create_pipeline_layout(&info, None).unwrap();
            device.destroy_descriptor_set_layout(sets[0], None);
            let executables = ash::khr::pipeline_executable_properties::Device::new(&instance, &device);
            Some(Compiler { device, executables, layout, has_ray_query, instance, _entry: entry })
        }
    }

    /// Compiles a kernel and says what the driver tells of it.
    fn statistics(&self, source: &KernelSource, constants: &[(u32, u32)]) -> BTreeMap<String, u64> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(source.spirv)).unwrap();
        let entries: Vec<_> = (0..)
            .zip(constants)
            .map(|(i, (id, _))| vk::SpecializationMapEntry::default().constant_id(*id).offset(4 * i).size(4))
            .collect();
        let values: Vec<u8> = constants.iter().flat_map(|(_, value)| value.to_ne_bytes()).collect();
        let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&values);
        // SAFETY: the module is glslang's, and all that the structures point to lives until the calls return.
        unsafe {
            let module =
                self.device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None).unwrap();
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main")
                .specialization_info(&specialization);
            let info = vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
                .stage(stage)
                .layout(self.layout);
            let pipeline = self.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None).unwrap()[0];
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
            let found = self.executables.get_pipeline_executable_statistics(&info).unwrap();
            self.device.destroy_pipeline(pipeline, None);
            self.device.destroy_shader_module(module, None);
            let name = |statistic: &vk::PipelineExecutableStatisticKHR| {
                statistic.name_as_c_str().unwrap().to_string_lossy().into_owned()
            };
            found.iter().map(|statistic| (name(statistic), statistic.value.u64)).collect()
        }
    }
}

impl Drop for Compiler {
    fn drop(&mut self) {
        // SAFETY: all that was made of the device but the layout is destroyed, and nothing else has it.
        unsafe {
            self.device.destroy_pipeline_layout(self.layout, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}
