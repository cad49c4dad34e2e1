//! What several tests share.
#![allow(dead_code)] // no test uses all of it

pub mod gpu_structs;

use std::sync::Arc;

use neubrdf::gpu::{Device, DeviceChoice, Instance, Validation};

/// Runs a check on every fit device, and insists that the validation layer has nothing to say about it.
///
/// Without a loader or without the validation layer there is nothing to run on: the test says so and passes.
pub fn on_every_device(check: impl Fn(&Arc<Device>)) {
    let instance = match Instance::new(Validation::Sync) {
        Ok(instance) => instance,
        Err(error) => return eprintln!("skipped: {error}"),
    };
    let reports = instance.devices().unwrap();
    if reports.is_empty() {
        eprintln!("skipped: no Vulkan device");
    }
    for report in reports {
        if !report.missing.is_empty() {
            eprintln!("skipped {}: it lacks {}", report.name, report.missing.join(", "));
            continue;
        }
        eprintln!("on {} ({})", report.name, report.driver);
        let device = instance.open(&DeviceChoice::Named(report.index.to_string())).unwrap();
        check(&device);
        assert_eq!(Arc::strong_count(&device), 1, "something of {} was not dropped", report.name);
        drop(device);
        assert_eq!(instance.validation_messages(), Vec::<String>::new(), "on {}", report.name);
    }
}
