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
        tell!("{}: {} ({}, Vulkan {})", device.index, device.name, device.kind, device.api_version)?;
        tell!("   driver     {}", device.driver)?;
        if device.missing.is_empty() {
            let profile = device.profile();
            let traversal = match (device.ray_query, profile.traversal_prefers_ray_query) {
                (true, true) => "ray query (bvh on request)",
                (true, false) => "bvh (ray-query on request)",
                (false, _) => "bvh (the device has no VK_KHR_ray_query)",
            };
            tell!("   traversal  {traversal}")?;
            tell!("   precision  f32; numbers of NeuBRDFs are held in f16 where that loses nothing")?;
            tell!("   pool       {} paths in workgroups of {}", profile.pool_paths, profile.workgroup_size)?;
            tell!("   subgroups  {} lanes", device.limits.subgroup_size)?;
            tell!("   memory     {} MiB", device.limits.device_memory >> 20)?;
        } else {
            tell!("   unfit      it lacks {}", device.missing.join(", "))?;
        }
    }
    let fit = devices.iter().filter(|device| device.missing.is_empty()).count();
    tell!("{fit} of {} devices can be used", devices.len())?;
    Ok(if fit > 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
