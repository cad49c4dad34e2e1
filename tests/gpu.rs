//! The Vulkan room, on every driver that is installed, under synchronization validation.

use std::sync::Arc;

use neubrdf::gpu::{Buffer, Commands, Device, DeviceChoice, Instance, Kernel, Memory, Validation, spirv};

/// Runs a check on every fit device, and insists that the validation layer has nothing to say about it.
fn on_every_device(check: impl Fn(&Arc<Device>)) {
    let instance = match Instance::new(Validation::Sync) {
        Ok(instance) => instance,
        Err(error) => return eprintln!("skipped: {error}"),
    };
    for report in instance.devices().unwrap() {
        if !report.missing.is_empty() {
            eprintln!("skipped {}: it lacks {}", report.name, report.missing.join(", "));
            continue;
        }
        eprintln!("on {} ({})", report.name, report.driver);
        let device = instance.open(&DeviceChoice::Named(report.index.to_string())).unwrap();
        check(&device);
        drop(device);
        assert_eq!(instance.validation_messages(), Vec::<String>::new(), "on {}", report.name);
    }
}

#[test]
fn a_kernel_writes_where_its_address_points() {
    on_every_device(|device| {
        let kernel = Kernel::new(device, spirv::load("gpu_test_fill").unwrap(), &[(1, 3), (2, 7)]).unwrap();
        let words = Buffer::new(device, "words", 4 * 1000, Memory::Device).unwrap();
        let mut commands = Commands::begin(device).unwrap();
        commands.timestamp("fill");
        commands.dispatch(&kernel, kernel.groups_for(1000), &[words.address(), 1000]);
        let passes = device.submit(commands).unwrap().wait().unwrap();
        assert_eq!(passes.len(), 1);
        eprintln!("{passes:?}");
        assert_eq!(words.read::<u32>().unwrap(), (0..1000).map(|i| 3 * i + 7).collect::<Vec<u32>>());
    });
}
