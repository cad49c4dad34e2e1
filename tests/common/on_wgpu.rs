//! Runs exported WGSL on lavapipe, through wgpu.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use bytemuck::{AnyBitPattern, NoUninit};
use neubrdf::export::{ENTRY_POINT, Exported, ExportedAnswer, ExportedQuery, Place};
use wgpu::util::{BufferInitDescriptor, DeviceExt};

use crate::common::{LAVAPIPE, alone_with_validation, drivers_are_required};

/// Invocations of a workgroup.
const WORKGROUP: u32 = 64;

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
        let mut head = vec![queries.len() as u32, 0, 0, 0];
        head.extend_from_slice(bytemuck::cast_slice(queries));
        let models = exported.bytes();
        let inputs = [(place, &models[..]), (after(place, 1), bytemuck::cast_slice(&head))];
        self.run(&exported.shader, ENTRY_POINT, &inputs, after(place, 2), queries.len())
    }

    /// What a compute shader, in workgroups of 64, writes to the buffer at `output`: `count` elements, one an invocation.
    pub fn run<T: AnyBitPattern + NoUninit>(
        &self,
        wgsl: &str,
        entry_point: &str,
        inputs: &[(Place, &[u8])],
        output: Place,
        count: usize,
    ) -> Vec<T> {
        let source = wgpu::ShaderSource::Wgsl(Cow::Borrowed(wgsl));
        let module =
            self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(entry_point), source });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry_point),
            layout: None,
            module: &module,
            entry_point: Some(entry_point),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let size = (size_of::<T>() * count) as u64;
        let buffer = |label, usage| {
            let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
            self.device.create_buffer(&descriptor)
        };
        let written = buffer("output", wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let read = buffer("output to read", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        let upload = |(place, contents): &(Place, &[u8])| {
            let usage = wgpu::BufferUsages::STORAGE;
            (*place, self.device.create_buffer_init(&BufferInitDescriptor { label: Some("input"), contents, usage }))
        };
        let bound: Vec<_> = inputs.iter().map(upload).chain([(output, written.clone())]).collect();
        let groups: BTreeSet<u32> = bound.iter().map(|(place, _)| place.group).collect();
        let bind_group = |group: u32| {
            let of_group = bound.iter().filter(|(place, _)| place.group == group);
            let entries: Vec<_> = of_group
                .map(|(Place { binding, .. }, buffer)| wgpu::BindGroupEntry {
                    binding: *binding,
                    resource: buffer.as_entire_binding(),
                })
                .collect();
            let layout = &pipeline.get_bind_group_layout(group);
            self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
        };
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            groups.into_iter().for_each(|group| pass.set_bind_group(group, &bind_group(group), &[]));
            pass.dispatch_workgroups((count as u32).div_ceil(WORKGROUP), 1, 1);
        }
        encoder.copy_buffer_to_buffer(&written, 0, &read, 0, size);
        self.queue.submit([encoder.finish()]);
        read.map_async(wgpu::MapMode::Read, .., Result::unwrap);
        self.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        bytemuck::pod_collect_to_vec(&read.get_mapped_range(..).unwrap())
    }
}

/// The place so many bindings further.
fn after(place: Place, bindings: u32) -> Place {
    Place { binding: place.binding + bindings, ..place }
}

fn lavapipe() -> Option<(wgpu::Device, wgpu::Queue)> {
    // Built for tests, wgpu asks for validation.
    alone_with_validation();
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
