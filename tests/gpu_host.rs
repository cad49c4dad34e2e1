//! The Vulkan room inside a host's instance, device and command buffer.
#![allow(unsafe_code)] // the host here speaks Vulkan itself

mod common;

use ash::vk;
use common::gpu_structs::GpuTestFillPush;
use neubrdf::gpu::{Buffer, Commands, Device, Error, HostDevice, Kernel, Memory, spirv};

#[test]
fn a_host_keeps_its_device_and_submits_by_itself() {
    // SAFETY: the host's side: every handle is made from the one before, used on this thread only, and destroyed last.
    unsafe {
        let entry = match ash::Entry::load() {
            Ok(entry) => entry,
            Err(error) => return common::skip(error),
        };
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        let host_instance = match entry.create_instance(&info, None) {
            Ok(instance) => instance,
            Err(error) => return common::skip(error),
        };
        for physical in host_instance.enumerate_physical_devices().unwrap() {
            let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
            let mut features = vk::PhysicalDeviceVulkan12Features::default()
                .buffer_device_address(true)
                .scalar_block_layout(true)
                .timeline_semaphore(true);
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).push_next(&mut features);
            let host_device = host_instance.create_device(physical, &info, None).unwrap();
            let queue = host_device.get_device_queue(0, 0);

            let host = HostDevice::new(entry.clone(), host_instance.clone(), physical, host_device.clone(), 0);
            let device = Device::from_host(host).unwrap();
            assert!(!device.has_ray_query());
            eprintln!("on {}", device.name());
            let kernel = Kernel::new(&device, spirv::load("gpu_test_fill").unwrap(), &[]).unwrap();
            let words = Buffer::new(&device, "words", 4000, Memory::Device).unwrap();

            let pool = host_device.create_command_pool(&vk::CommandPoolCreateInfo::default(), None).unwrap();
            let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(2);
            let buffers = host_device.allocate_command_buffers(&info).unwrap();
            for buffer in &buffers {
                host_device.begin_command_buffer(*buffer, &vk::CommandBufferBeginInfo::default()).unwrap();
            }
            let mut commands = Commands::wrap(&device, buffers[0]);
            commands.timestamp("fill");
            let push = GpuTestFillPush { words: words.address(), count: 1000, pad: 0 };
            commands.dispatch(&kernel, kernel.groups_for(1000), &push);
            commands.barrier();
            commands.fill(&words, 0..4, 99);
            commands.finish().unwrap();

            let mut wrong = Commands::wrap(&device, buffers[1]);
            wrong.fill(&words, 0..8000, 0);
            assert!(matches!(wrong.finish(), Err(Error::Range { .. })));
            assert!(device.submit(Commands::wrap(&device, buffers[1])).err().unwrap().to_string().contains("finish()"));

            host_device.end_command_buffer(buffers[0]).unwrap();
            let info = vk::SubmitInfo::default().command_buffers(&buffers[..1]);
            host_device.queue_submit(queue, &[info], vk::Fence::null()).unwrap();
            host_device.queue_wait_idle(queue).unwrap();
            assert!(words.read::<u32>().unwrap().into_iter().eq(std::iter::once(99).chain(1..1000)));

            drop((kernel, words));
            assert_eq!(std::sync::Arc::strong_count(&device), 1);
            drop(device);
            host_device.destroy_command_pool(pool, None);
            host_device.destroy_device(None);
        }
        host_instance.destroy_instance(None);
    }
}
