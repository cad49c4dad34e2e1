//! `neubrdf info`.

use std::process::ExitCode;

use anyhow::Result;
use neubrdf::gpu::{Instance, Validation};

/// List the Vulkan devices, what each would be used for, and what an unfit one lacks.
#[derive(clap::Args)]
pub struct Arguments {}

/// Lists; exit status 1 if no device is fit.
pub fn run(_: Arguments) -> Result<ExitCode> {
    let devices = Instance::new(Validation::Off)?.devices()?;
    for device in &devices {
        println!("{}: {} ({}, Vulkan {})", device.index, device.name, device.kind, device.api_version);
        println!("   driver     {}", device.driver);
        if device.missing.is_empty() {
            let profile = device.profile();
            let traversal = match (device.ray_query, profile.traversal_prefers_ray_query) {
                (true, true) => "ray query (bvh on request)",
                (true, false) => "bvh (ray-query on request)",
                (false, _) => "bvh (the device has no VK_KHR_ray_query)",
            };
            println!("   traversal  {traversal}");
            println!("   precision  f32; numbers of NeuBRDFs are held in f16 where that loses nothing");
            println!("   pool       {} paths in workgroups of {}", profile.pool_paths, profile.workgroup_size);
            println!("   subgroups  {} lanes", device.limits.subgroup_size);
            println!("   memory     {} MiB", device.limits.device_memory >> 20);
        } else {
            println!("   unfit      it lacks {}", device.missing.join(", "));
        }
    }
    let fit = devices.iter().filter(|device| device.missing.is_empty()).count();
    println!("{fit} of {} devices can be used", devices.len());
    Ok(if fit > 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
