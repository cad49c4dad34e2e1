//! The Vulkan room, on every driver that is installed, under synchronization validation.

mod common;

use std::sync::Arc;
use std::time::Instant;

use common::gpu_structs::*;
use common::{on_every_device, skip, validated};
use neubrdf::gpu::{
    Blas, BlasGeometry, Buffer, Commands, Device, DeviceChoice, Error, Instance, Kernel, KernelSource, Memory, Tlas,
    TlasInstance, Validation, spirv,
};

fn kernel(device: &Arc<Device>, name: &str, specialization: &[(u32, u32)]) -> Kernel {
    Kernel::new(device, spirv::load(name).unwrap(), specialization).unwrap()
}

fn submit(device: &Arc<Device>, record: impl FnOnce(&mut Commands)) -> Vec<(String, Option<u64>)> {
    let mut commands = Commands::begin(device).unwrap();
    record(&mut commands);
    device.submit(commands).unwrap().wait().unwrap()
}

#[test]
fn what_is_written_to_a_buffer_is_read_from_it() {
    on_every_device(|device| {
        let data: Vec<u32> = (0..100_000).collect();
        let buffer = Buffer::with_data(device, "numbers", &data).unwrap();
        assert_eq!(buffer.size(), 400_000);
        assert_eq!(buffer.address() % 256, 0);
        assert!(buffer.mapped().is_none());
        assert_eq!(buffer.read::<u32>().unwrap(), data);
        assert_eq!(buffer.read_range::<u32>(10..13).unwrap(), [10, 11, 12]);
        buffer.write(8, &[7u32, 8]).unwrap();
        assert_eq!(buffer.read_range::<u32>(1..5).unwrap(), [1, 7, 8, 4]);

        let empty = Buffer::with_data::<u32>(device, "nothing", &[]).unwrap();
        assert_eq!((empty.size(), empty.read::<u32>().unwrap()), (0, vec![]));

        assert!(matches!(buffer.write(399_998, &[1u32]), Err(Error::Range { end: 400_002, .. })));
        assert!(matches!(buffer.write(u64::MAX - 1, &[1u32]), Err(Error::Range { .. })));
        assert!(matches!(buffer.read_range::<u32>(99_999..100_001), Err(Error::Range { .. })));
    });
}

#[test]
fn mapped_buffers_are_copied_to_and_from() {
    on_every_device(|device| {
        let mut upload = Buffer::new(device, "upload", 64, Memory::Upload).unwrap();
        let readback = Buffer::new(device, "read-back", 64, Memory::Readback).unwrap();
        upload.mapped_mut().unwrap().copy_from_slice(&std::array::from_fn::<u8, 64, _>(|i| i as u8));
        submit(device, |commands| {
            commands.fill(&readback, 0..64, 0xffff_ffff);
            commands.barrier();
            commands.copy(&upload, 16, &readback, 32, 16);
        });
        let bytes = readback.mapped().unwrap();
        assert!(bytes[..32].iter().chain(&bytes[48..]).all(|byte| *byte == 0xff));
        assert!(bytes[32..48].iter().copied().eq(16..32));
    });
}

#[test]
fn specialization_constants_reach_the_kernel() {
    on_every_device(|device| {
        let words = Buffer::new(device, "words", 4 * 1000, Memory::Device).unwrap();
        for (workgroup, factor, bias) in [(64, 1, 0), (1, 3, 7), (256, 0, 5)] {
            let kernel = kernel(device, "gpu_test_fill", &[(0, workgroup), (1, factor), (2, bias)]);
            assert_eq!(kernel.local_size(), [workgroup, 1, 1]);
            submit(device, |commands| {
                let push = GpuTestFillPush { words: words.address(), count: 1000, pad: 0 };
                commands.dispatch(&kernel, kernel.groups_for(1000), &push);
            });
            let expected: Vec<u32> = (0..1000).map(|i| i * factor + bias).collect();
            assert_eq!(words.read::<u32>().unwrap(), expected);
        }
        let source = spirv::load("gpu_test_fill").unwrap();
        let most = device.limits().max_compute_work_group_invocations;
        for unfit in [0, most + 1] {
            assert!(matches!(Kernel::new(device, source, &[(0, unfit)]), Err(Error::Kernel { .. })));
        }
    });
}

#[test]
fn kernels_built_together_are_those_built_alone() {
    on_every_device(|device| {
        let source = spirv::load("gpu_test_fill").unwrap();
        let kernels = Kernel::build_all(device, &[(source, &[(2, 1)]), (source, &[(2, 2)]), (source, &[(2, 3)])]);
        let words = Buffer::new(device, "words", 12, Memory::Device).unwrap();
        submit(device, |commands| {
            for (i, kernel) in (0..).zip(&kernels.unwrap()) {
                let push = GpuTestFillPush { words: words.address() + 4 * i, count: 1, pad: 0 };
                commands.dispatch(kernel, [1, 1, 1], &push);
            }
        });
        assert_eq!(words.read::<u32>().unwrap(), [1, 2, 3]);
    });
}

#[test]
fn a_kernel_follows_device_addresses_from_buffer_to_buffer() {
    on_every_device(|device| {
        let nodes: Vec<Buffer> =
            (0..20).map(|i| Buffer::new(device, &format!("node {i}"), 16, Memory::Device).unwrap()).collect();
        for (i, node) in (0..).zip(&nodes) {
            let next = nodes.get(i as usize + 1).map_or(0, Buffer::address);
            node.write(0, &[GpuTestNode { next, value: 1 << i, is_last: u32::from(next == 0) }]).unwrap();
        }
        let sum = Buffer::new(device, "sum", 4, Memory::Device).unwrap();
        let kernel = kernel(device, "gpu_test_chase", &[]);
        submit(device, |commands| {
            commands.dispatch(&kernel, [1, 1, 1], &GpuTestChasePush { first: nodes[0].address(), sum: sum.address() });
        });
        assert_eq!(sum.read::<u32>().unwrap(), [(1 << 20) - 1]);
    });
}

#[test]
fn buffers_of_cpu_drivers_keep_the_upper_half_of_their_addresses() {
    on_every_device(|device| {
        if !device.profile().is_cpu {
            return;
        }
        // Side by side they are more than 4 GiB, of which nothing is touched.
        let bytes = 512 << 20;
        let buffers: Result<Vec<Buffer>, _> =
            (0..9).map(|i| Buffer::new(device, &format!("half a gibibyte {i}"), bytes, Memory::Device)).collect();
        match buffers {
            Ok(buffers) => {
                for buffer in buffers {
                    assert_eq!(buffer.address() >> 32, (buffer.address() + bytes - 1) >> 32, "{:x}", buffer.address());
                }
            }
            Err(error) => println!("skipped on {}: {error}", device.name()),
        }
        let too_large = Buffer::new(device, "too large", (2 << 30) + 4, Memory::Device);
        assert!(matches!(too_large, Err(Error::BufferTooLarge { .. })));
    });
}

#[test]
fn a_pass_decides_how_large_the_next_one_is() {
    on_every_device(|device| {
        let counters = Buffer::new(device, "counters", 16, Memory::Device).unwrap();
        let kernel = kernel(device, "gpu_test_count", &[(0, 8)]);
        let push = |next_groups| GpuTestCountPush { counters: counters.address(), next_groups, pad: 0 };
        let passes = submit(device, |commands| {
            commands.fill(&counters, 0..16, 0);
            commands.barrier();
            commands.timestamp("direct");
            commands.dispatch(&kernel, [1, 1, 1], &push(5));
            commands.barrier();
            commands.timestamp("indirect");
            commands.dispatch_indirect(&kernel, &counters, 4, &push(0));
            commands.barrier();
            commands.timestamp("nothing");
            commands.dispatch_indirect(&kernel, &counters, 4, &push(0));
        });
        assert_eq!(counters.read::<u32>().unwrap(), [8 + 5 * 8, 0, 1, 1]);
        assert!(passes.iter().map(|(label, _)| label.as_str()).eq(["direct", "indirect", "nothing"]));
        let has_times = device.limits().timestamp_valid_bits > 0;
        assert!(passes.iter().all(|(_, time)| time.is_some() == has_times));
        assert!(!has_times || passes.iter().all(|(_, time)| time.unwrap() < 10_000_000_000), "{passes:?}");
    });
}

#[test]
fn thousands_of_dispatches_are_recorded_and_all_run() {
    on_every_device(|device| {
        let counters = Buffer::with_data(device, "counters", &[0u32, 1, 1, 1]).unwrap();
        let kernel = kernel(device, "gpu_test_count", &[(0, 1)]);
        let start = Instant::now();
        let mut commands = Commands::begin(device).unwrap();
        for i in 0..3000 {
            if i % 10 == 0 {
                commands.timestamp("ten dispatches");
            }
            let push = GpuTestCountPush { counters: counters.address(), next_groups: 1, pad: 0 };
            commands.dispatch_indirect(&kernel, &counters, 4, &push);
            commands.barrier();
        }
        let recorded = start.elapsed();
        let passes = device.submit(commands).unwrap().wait().unwrap();
        eprintln!("  recorded in {recorded:?}, done after {:?}", start.elapsed());
        assert_eq!(counters.read::<u32>().unwrap(), [3000, 1, 1, 1]);
        assert_eq!(passes.len(), 300);
        let has_times = device.limits().timestamp_valid_bits > 0;
        assert!(passes.iter().all(|(_, time)| time.is_some() == has_times));
    });
}

#[test]
fn submissions_see_what_those_before_them_wrote() {
    on_every_device(|device| {
        let words: Vec<Buffer> = (0..8).map(|_| Buffer::new(device, "words", 4, Memory::Device).unwrap()).collect();
        words[0].write(0, &[17u32]).unwrap();
        // None waits, and what they use is dropped before they are done.
        for pair in words.windows(2) {
            let between = Buffer::new(device, "between", 4, Memory::Device).unwrap();
            let mut commands = Commands::begin(device).unwrap();
            commands.copy(&pair[0], 0, &between, 0, 4);
            commands.barrier();
            commands.copy(&between, 0, &pair[1], 0, 4);
            device.submit(commands).unwrap();
        }
        let last = device.submit(Commands::begin(device).unwrap()).unwrap();
        device.wait().unwrap();
        assert!(last.is_done().unwrap());
        assert_eq!(words[7].read::<u32>().unwrap(), [17]);
    });
}

#[test]
fn what_a_recording_uses_may_be_dropped_before_it_is_submitted() {
    on_every_device(|device| {
        let result = Buffer::new(device, "result", 4000, Memory::Device).unwrap();
        let mut commands = Commands::begin(device).unwrap();
        {
            let between = Buffer::new(device, "between", 4000, Memory::Device).unwrap();
            let kernel = kernel(device, "gpu_test_fill", &[]);
            let push = GpuTestFillPush { words: between.address(), count: 1000, pad: 0 };
            commands.dispatch(&kernel, kernel.groups_for(1000), &push);
            commands.barrier();
            commands.copy(&between, 0, &result, 0, 4000);
        }
        // It would land where the dropped buffer was.
        let other = Buffer::with_data(device, "other", &[7u32; 1000]).unwrap();
        device.submit(commands).unwrap().wait().unwrap();
        assert!(result.read::<u32>().unwrap().into_iter().eq(0..1000));
        assert_eq!(other.read::<u32>().unwrap(), [7; 1000]);
    });
}

#[test]
fn synchronization_validation_finds_a_missing_barrier() {
    let instance = match validated() {
        Ok(instance) => instance,
        Err(error) => return skip(error),
    };
    let Ok(device) = instance.open(&DeviceChoice::Auto) else { return skip("no device") };
    let buffer = Buffer::new(&device, "written twice", 64, Memory::Device).unwrap();
    submit(&device, |commands| (0..2).for_each(|word| commands.fill(&buffer, 0..64, word)));
    let messages = device.validation_messages();
    assert!(messages.iter().any(|message| message.contains("SYNC-HAZARD-WRITE-AFTER-WRITE")), "{messages:?}");
}

#[test]
fn the_first_mistake_in_recording_is_what_submitting_reports() {
    on_every_device(|device| {
        let buffer = Buffer::new(device, "small", 16, Memory::Device).unwrap();
        let fill = kernel(device, "gpu_test_fill", &[]);
        let error = |record: &dyn Fn(&mut Commands)| {
            let mut commands = Commands::begin(device).unwrap();
            record(&mut commands);
            commands.fill(&buffer, 0..4000, 0);
            device.submit(commands).err().unwrap().to_string()
        };
        assert!(error(&|_| ()).contains("bytes 0..4000 do not lie in buffer small of 16 bytes"));
        assert!(error(&|c| c.dispatch(&fill, [1, 1, 1], &[0u32; 3])).contains("12 bytes of push constants"));
        assert!(error(&|c| c.dispatch(&fill, [u32::MAX, 1, 1], &[0u32; 4])).contains("workgroups of gpu_test_fill"));
        assert!(error(&|c| c.dispatch_indirect(&fill, &buffer, 8, &[0u32; 4])).contains("bytes 8..20"));
        assert!(error(&|c| c.dispatch_indirect(&fill, &buffer, 2, &[0u32; 4])).contains("offset 2"));
        assert!(error(&|c| c.fill(&buffer, 1..5, 0)).contains("whole words"));
        assert!(error(&|c| c.copy(&buffer, 0, &buffer, 4, 8)).contains("onto itself"));
    });
}

#[test]
fn more_memory_than_a_device_allows_is_an_error() {
    on_every_device(|device| {
        for bytes in [device.limits().max_memory_allocation_size.saturating_add(1), 1 << 60, u64::MAX] {
            let error = Buffer::new(device, "the library of Babel", bytes, Memory::Device).err().unwrap();
            assert!(matches!(&error, Error::BufferTooLarge { bytes: found, .. } if *found == bytes), "{error}");
        }
    });
}

#[test]
fn what_is_no_spirv_is_refused() {
    on_every_device(|device| {
        for spirv in [&b"no SPIR-V"[..], b"", b"12345678"] {
            let source: KernelSource = spirv::reflect("nonsense", spirv);
            assert!(matches!(Kernel::new(device, source, &[]), Err(Error::Kernel { .. })));
        }
    });
}

/// Two triangles that share an edge and fill the square [0, 1]² at z = 0.
fn square(device: &Arc<Device>) -> Arc<Blas> {
    let positions = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let positions = Buffer::with_data(device, "positions", &positions).unwrap();
    let indices = Buffer::with_data(device, "indices", &[[0u32, 1, 2], [0, 2, 3]]).unwrap();
    let geometry =
        BlasGeometry { positions: positions.address(), vertex_count: 4, indices: indices.address(), triangle_count: 2 };
    Blas::build(device, &[geometry]).unwrap()
}

fn at(blas: &Arc<Blas>, translation: [f32; 3], custom_index: u32) -> TlasInstance {
    let [x, y, z] = translation;
    let transform = [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z];
    TlasInstance { blas: blas.clone(), transform, custom_index, mask: 0xff, has_holes: false }
}

#[test]
fn rays_hit_the_instances_where_they_stand() {
    on_every_device(|device| {
        if !device.has_ray_query() {
            return eprintln!("  skipped: no ray query");
        }
        let blas = square(device);
        let mut hidden = at(&blas, [0.0, 0.0, 1.0], 9);
        hidden.mask = 2;
        let tlas = Tlas::build(device, &[at(&blas, [0.0, 0.0, 5.0], 70), at(&blas, [2.0, 0.0, 3.0], 80), hidden]);
        let tlas = tlas.unwrap();
        drop(blas);
        eprintln!("  {} bytes of top-level structure", tlas.size());

        let ray = |x, y| GpuTestRay { origin: [x, y, 0.0], t_max: 100.0, direction: [0.0, 0.0, 1.0], mask: 1 };
        let mut rays = vec![ray(0.75, 0.25), ray(0.25, 0.75), ray(2.75, 0.25), ray(1.5, 0.5), ray(2.25, 0.75)];
        rays[4].t_max = 2.9;
        let none = GpuTestHit { custom_index: u32::MAX, geometry: 0, triangle: 0, t: 100.0 };
        let hit = |custom_index, triangle, t| GpuTestHit { custom_index, geometry: 0, triangle, t };
        let expected = [hit(70, 0, 5.0), hit(70, 1, 5.0), hit(80, 0, 3.0), none, GpuTestHit { t: 2.9, ..none }];

        let rays = Buffer::with_data(device, "rays", &rays).unwrap();
        let hits = Buffer::new(device, "hits", 5 * 16, Memory::Device).unwrap();
        let kernel = kernel(device, "gpu_test_ray_query", &[]);
        let push = GpuTestRayQueryPush { rays: rays.address(), hits: hits.address(), count: 5, pad: 0 };
        submit(device, |commands| {
            commands.bind_tlas(&tlas);
            commands.dispatch(&kernel, kernel.groups_for(5), &push);
        });
        assert_eq!(hits.read::<GpuTestHit>().unwrap(), expected);

        let mut unbound = Commands::begin(device).unwrap();
        unbound.dispatch(&kernel, [1, 1, 1], &push);
        assert!(device.submit(unbound).err().unwrap().to_string().contains("bind_tlas"));
    });
}

#[test]
fn an_empty_scene_is_missed() {
    on_every_device(|device| {
        if !device.has_ray_query() {
            return eprintln!("  skipped: no ray query");
        }
        let nothing = Blas::build(device, &[]).unwrap();
        let tlas = Tlas::build(device, &[]).unwrap();
        let of_nothing = Tlas::build(device, &[at(&nothing, [0.0; 3], 0)]).unwrap();
        let ray = GpuTestRay { origin: [0.0; 3], t_max: 1.0, direction: [0.0, 0.0, 1.0], mask: 1 };
        let rays = Buffer::with_data(device, "rays", &[ray]).unwrap();
        let hits = Buffer::new(device, "hits", 16, Memory::Device).unwrap();
        let kernel = kernel(device, "gpu_test_ray_query", &[]);
        for tlas in [tlas, of_nothing] {
            hits.write(0, &[0u32]).unwrap();
            submit(device, |commands| {
                commands.bind_tlas(&tlas);
                let push = GpuTestRayQueryPush { rays: rays.address(), hits: hits.address(), count: 1, pad: 0 };
                commands.dispatch(&kernel, [1, 1, 1], &push);
            });
            assert_eq!(hits.read::<GpuTestHit>().unwrap()[0].custom_index, u32::MAX);
        }
        assert!(matches!(
            Tlas::build(device, &[at(&square(device), [0.0; 3], 1 << 24)]),
            Err(Error::AccelerationStructure(_))
        ));
    });
}

#[test]
fn without_ray_query_acceleration_structures_are_refused() {
    on_every_device(|device| {
        if !device.has_ray_query() {
            assert!(matches!(Blas::build(device, &[]), Err(Error::NoRayQuery { .. })));
            assert!(matches!(Tlas::build(device, &[]), Err(Error::NoRayQuery { .. })));
            let source = spirv::load("gpu_test_ray_query").unwrap();
            assert!(matches!(Kernel::new(device, source, &[]), Err(Error::NoRayQuery { .. })));
        }
    });
}

#[test]
fn devices_are_found_by_index_and_by_name() {
    let instance = match Instance::new(Validation::Off) {
        Ok(instance) => instance,
        Err(error) => return skip(error),
    };
    let reports = instance.devices().unwrap();
    for report in reports.iter().filter(|report| report.missing.is_empty()) {
        eprintln!("{report:#?}");
        let name = report.name.to_uppercase();
        assert_eq!(instance.open(&DeviceChoice::Named(name)).unwrap().name(), report.name);
        let device = instance.open(&DeviceChoice::Named(report.index.to_string())).unwrap();
        assert_eq!((device.name(), device.driver()), (report.name.as_str(), report.driver.as_str()));
    }
    if !reports.is_empty() {
        let error = instance.open(&DeviceChoice::Named("Voodoo 3".to_string())).err().unwrap().to_string();
        assert!(error.contains("\"Voodoo 3\"") && error.contains(&reports[0].name), "{error}");
    }
}
