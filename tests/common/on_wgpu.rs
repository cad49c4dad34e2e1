//! Runs exported WGSL on lavapipe, through wgpu.

use std::borrow::Cow;
use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use neubrdf::export::{ENTRY_POINT, Exported, ExportedAnswer, ExportedQuery, Place};
use wgpu::util::{BufferInitDescriptor, DeviceExt};

use crate::common::{LAVAPIPE, drivers_are_required};

/// Invocations of a workgroup of the exported kernel.
const GROUP: u32 = 64;

/// A device of wgpu.
pub struct OnWgpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
}

impl OnWgpu {
    /// Lavapipe. Where it is missing the test is to be skipped, unless drivers are required.
    pub fn new() -> Option<OnWgpu> {
        let found = lavapipe();
        match &found {
            None if drivers_are_required() => panic!("{LAVAPIPE} is required here"),
            None => eprintln!("skipped: wgpu finds no {LAVAPIPE}"),
            Some(_) => {}
        }
        found.map(|(device, queue)| OnWgpu { device, queue })
    }

    /// The answers of an export's kernel, in the order of the queries.
    pub fn answer(&self, exported: &Exported, place: Place, queries: &[ExportedQuery]) -> Vec<ExportedAnswer> {
        let shader = wgpu::ShaderModuleDescriptor {
            label: Some("exported"),
            source: wgpu::ShaderSource::Wgsl(Cow::Borrowed(&exported.shader)),
        };
        let module = self.device.create_shader_module(shader);
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("exported"),
            layout: None,
            module: &module,
            entry_point: Some(ENTRY_POINT),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let mut head = vec![queries.len() as u32, 0, 0, 0];
        head.extend_from_slice(bytemuck::cast_slice(queries));
        let storage = |label, contents| {
            let usage = wgpu::BufferUsages::STORAGE;
            self.device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let bytes = exported.bytes();
        let models = storage("models", &bytes);
        let input = storage("queries", bytemuck::cast_slice(&head));
        let size = size_of_val(queries) as u64 / size_of::<ExportedQuery>() as u64 * size_of::<ExportedAnswer>() as u64;
        let buffer = |label, usage| {
            let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
            self.device.create_buffer(&descriptor)
        };
        let output = buffer("answers", wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let read = buffer("answers to read", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        let entries: Vec<wgpu::BindGroupEntry> = (place.binding..)
            .zip([&models, &input, &output])
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let bind_group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("exported"),
            layout: &pipeline.get_bind_group_layout(place.group),
            entries: &entries,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(place.group, &bind_group, &[]);
            pass.dispatch_workgroups((queries.len() as u32).div_ceil(GROUP), 1, 1);
        }
        encoder.copy_buffer_to_buffer(&output, 0, &read, 0, size);
        self.queue.submit([encoder.finish()]);
        read.map_async(wgpu::MapMode::Read, .., Result::unwrap);
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        bytemuck::pod_collect_to_vec(&read.get_mapped_range(..).unwrap())
    }
}

fn lavapipe() -> Option<(wgpu::Device, wgpu::Queue)> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapters = now(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name.contains(LAVAPIPE))?;
    Some(now(adapter.request_device(&wgpu::DeviceDescriptor::default())).unwrap())
}

/// What a future of wgpu comes to: outside browsers it is there at once.
fn now<T>(future: impl Future<Output = T>) -> T {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => value,
        Poll::Pending => panic!("wgpu's futures are ready outside browsers"),
    }
}
