//! What the plugin asks of a host's device, seen by a layer of the test's own between both: in a frame nothing but recording; and
//! where a call fails, all is as it was and goes on.
#![allow(unsafe_code)] // the host here speaks Vulkan itself

mod common;
#[path = "common/frames.rs"]
mod frames;
#[path = "common/host.rs"]
mod host;
#[path = "common/layer.rs"]
mod layer;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use ash::vk;
use frames::{expected, frame, options_of, scene};
use glam::{Affine3A, Vec3};
use host::{Host, in_lavapipe_hosts};
use neubrdf::gpu::{self, Device, HostAllocator, HostMemory, Memory, MemoryRequest};
use neubrdf::plugin::{Change, Error, Frame, Options, PixelFormat, Renderer, Target, Update};
use neubrdf::scene::{Environment, Instance, Scene};

/// The system's allocator, with a count of what each thread asks it for, and of its bytes.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static BYTES: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: all is the system allocator's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        BYTES.with(|count| count.set(count.get() + layout.size()));
        // SAFETY: as the caller says.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller says.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// The device by its raw handles, through the layer.
fn lend(host: &Host, allocator: Option<Arc<dyn HostAllocator>>) -> gpu::Result<Arc<Device>> {
    let mut lent = host.host_device_through(layer::over_loader);
    lent.host_allocator = allocator;
    // SAFETY: the handles belong together; tests drop what they made before the host.
    unsafe { Device::from_host(lent) }
}

/// Changes of every kind, each with all its consequences: a mesh and the lamp are bent, instances come and a sky.
fn changes(amount: f32) -> Vec<Change> {
    let now = scene();
    let deform = |mesh: u32| {
        let shape = &now.meshes[mesh as usize];
        let positions = shape.positions.iter().map(|p| *p + amount * Vec3::new((5.0 * p.y).sin(), 0.0, 0.2 * p.x));
        Change::Deform {
            mesh,
            positions: positions.collect(),
            normals: shape.normals.clone(),
            from: None,
            by: Update::Refit,
        }
    };
    let place = |index: u32| Instance {
        mesh: if index == 0 { 2 } else { index % 2 },
        object_to_world: Affine3A::from_translation(Vec3::new(0.1 * index as f32, -0.1 * index as f32, amount)),
    };
    let mut camera = now.camera.clone();
    camera.eye.x += amount;
    let mut ball = now.materials[1].clone();
    ball.surface = common::conductor(0.5, 0.1 + 0.1 * amount);
    let texels = (0..20_000).map(|index| Vec3::splat(amount * (index % 7) as f32)).collect();
    vec![
        deform(1),
        deform(2),
        Change::Instances((0..200).map(place).collect()),
        Change::Camera(camera),
        Change::Material { index: 1, material: ball },
        Change::Environment(Some(Environment { width: 200, height: 100, texels, rotation_degrees: 10.0 })),
    ]
}

/// The scene after those.
fn changed(amount: f32) -> Scene {
    let mut now = scene();
    for change in changes(amount) {
        match change {
            Change::Deform { mesh, positions, .. } => now.meshes[mesh as usize].positions = positions,
            Change::Instances(instances) => now.instances = instances,
            Change::Camera(camera) => now.camera = camera,
            Change::Material { index, material } => now.materials[index as usize] = material,
            Change::Environment(sky) => now.environment = sky,
            other => panic!("{other:?}"),
        }
    }
    now
}

/// Between frames a host may do what takes time and memory. A frame makes no object of Vulkan's, takes no memory of the device's,
/// submits nothing and waits for nothing, whatever it has to upload first; and where nothing changed it takes none of the heap's.
#[test]
fn a_frame_only_records() {
    in_lavapipe_hosts(|host| {
        let _turn = layer::begin();
        let device = lend(host, None).unwrap();
        let mut renderer = Renderer::new(&device, scene(), &options_of(host)).unwrap();
        renderer.set_top_level(Update::Refit);
        let mut heap = Vec::new();
        for round in 0..8 {
            match round {
                3 => renderer.update(&changes(0.1)).unwrap(),
                4 => renderer.update(&changes(0.2)).unwrap(),
                5 => renderer.resize(50, 40).unwrap(),
                _ => {}
            }
            let [width, height] = renderer.size();
            let buffer = host.buffer(u64::from(width * height) * 16);
            let targets = [Target::buffer(buffer.target(), PixelFormat::Rgba32Float)];
            let recording = host.begin();
            let made = layer::made();
            let before = ALLOCATIONS.get();
            let mut commands = host.wrap(&device, &recording);
            let ticket = renderer.record(&mut commands, &Frame::new(2, &targets)).unwrap();
            commands.finish().unwrap();
            let recorded = ALLOCATIONS.get() - before;
            assert_eq!(layer::made() - made, 0, "round {round}");
            host.submit(&recording);
            host.wait(recording);
            let before = ALLOCATIONS.get();
            assert!(renderer.complete(ticket).is_some());
            heap.push(recorded + ALLOCATIONS.get() - before);
            assert_eq!(layer::made() - made, 0, "round {round}");
            host.free_buffer(buffer);
        }
        eprintln!("allocations from the heap, frame by frame: {heap:?}");
        assert_eq!(layer::waited(), 0, "nothing is ever submitted or waited for");
        assert!(layer::made() > 20);
        assert_eq!([heap[1], heap[2], heap[6], heap[7]], [0; 4], "{heap:?}");
    });
}

/// Under a sky of 1.5 MB, a change that is none of the sky asks the heap for little, and the device for nothing: what is new travels in the
/// command buffer.
#[test]
fn what_stays_as_it_is_costs_nothing() {
    in_lavapipe_hosts(|host| {
        let _turn = layer::begin();
        let device = lend(host, None).unwrap();
        let elsewhere = |instance| {
            let object_to_world = Affine3A::from_translation(Vec3::new(0.3, 0.1, -0.2));
            Change::Transform { instance, object_to_world }
        };
        let mut floor = scene().materials[0].clone();
        floor.surface = common::diffuse(0.2);
        let mut camera = scene().camera;
        camera.eye.x += 0.4;
        let changes = [
            Change::Camera(camera.clone()),
            elsewhere(1),
            Change::Material { index: 0, material: floor.clone() },
            elsewhere(2),
        ];
        // Of a sky that is bright in places the light table has all texels, beside the lamps: there no lamp is moved.
        for (brightest, changes) in [(0.3, &changes[..]), (300.0, &changes[..3])] {
            let mut now = scene();
            let mut texels = vec![Vec3::splat(0.3); 512 * 256];
            texels[20_000] = Vec3::splat(brightest);
            now.environment = Some(Environment { width: 512, height: 256, texels, rotation_degrees: 0.0 });
            let mut renderer = Renderer::new(&device, now.clone(), &options_of(host)).unwrap();
            assert_eq!(renderer.features().uneven_sky, brightest > 1.0);
            frame(host, &device, &mut renderer, 1);
            for change in changes {
                let (made, bytes) = (layer::made(), BYTES.get());
                renderer.update(std::slice::from_ref(change)).unwrap();
                assert_eq!(layer::made() - made, 0, "{change:?}");
                let bytes = BYTES.get() - bytes;
                assert!(bytes < 50_000, "{bytes} bytes for {change:?}");
                match change.clone() {
                    Change::Camera(camera) => now.camera = camera,
                    Change::Transform { instance, object_to_world } => {
                        now.instances[instance as usize].object_to_world = object_to_world;
                    }
                    Change::Material { index, material } => now.materials[index as usize] = material,
                    other => panic!("{other:?}"),
                }
                assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &now, 2), "{change:?}");
            }
        }
    });
}

/// Memory of the host's, each piece by itself, as far as the layer grants it.
struct Pieces {
    device: ash::Device,
    types: vk::PhysicalDeviceMemoryProperties,
    alive: AtomicU64,
}

impl Pieces {
    fn of(host: &Host) -> Arc<Pieces> {
        Arc::new(Pieces { device: host.device.clone(), types: host.memory, alive: AtomicU64::new(0) })
    }
}

// SAFETY: each piece is an allocation of its own, of a type of the request, mapped where that is asked for.
unsafe impl HostAllocator for Pieces {
    fn allocate(&self, request: &MemoryRequest) -> Option<HostMemory> {
        use vk::MemoryPropertyFlags as Properties;
        if layer::refuses() {
            return None;
        }
        let properties = match request.memory {
            Memory::Device => Properties::DEVICE_LOCAL,
            _ => Properties::HOST_VISIBLE | Properties::HOST_COHERENT,
        };
        let fits = |(index, kind): (usize, &vk::MemoryType)| {
            request.memory_type_bits >> index & 1 == 1 && kind.property_flags.contains(properties)
        };
        let index = self.types.memory_types_as_slice().iter().enumerate().position(fits)? as u32;
        let mut flags = vk::MemoryAllocateFlagsInfo::default().flags(vk::MemoryAllocateFlags::DEVICE_ADDRESS);
        let info = vk::MemoryAllocateInfo::default().allocation_size(request.size).memory_type_index(index);
        // SAFETY: the type is one of the request's; what is mapped stays so until it is freed.
        unsafe {
            let memory = self.device.allocate_memory(&info.push_next(&mut flags), None).ok()?;
            let map = || self.device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty());
            let mapped = if request.memory == Memory::Device { std::ptr::null_mut() } else { map().ok()? };
            self.alive.fetch_add(1, Ordering::SeqCst);
            Some(HostMemory { memory, offset: 0, mapped, properties, handle: std::ptr::null_mut() })
        }
    }

    fn free(&self, memory: HostMemory) {
        // SAFETY: it was given by `allocate`, and comes back once.
        unsafe { self.device.free_memory(memory.memory, None) };
        self.alive.fetch_sub(1, Ordering::SeqCst);
    }
}

/// What goes while a frame is recorded is freed when a frame is known to be done, not by what records.
#[test]
fn a_frame_frees_nothing() {
    in_lavapipe_hosts(|host| {
        let _turn = layer::begin();
        let pieces = Pieces::of(host);
        let alive = || pieces.alive.load(Ordering::SeqCst);
        let device = lend(host, Some(pieces.clone())).unwrap();
        let mut renderer = Renderer::new(&device, scene(), &options_of(host)).unwrap();
        let one = alive();
        let other = Renderer::new(&device, scene(), &options_of(host)).unwrap();
        let recording = host.begin();
        let mut commands = host.wrap(&device, &recording);
        drop(other);
        let both = alive();
        assert!(both > one);
        let ticket = renderer.record(&mut commands, &Frame::new(1, &[])).unwrap();
        commands.finish().unwrap();
        assert_eq!(alive(), both);
        host.submit(&recording);
        host.wait(recording);
        assert!(renderer.complete(ticket).is_some());
        assert!(alive() <= one, "and what the first one had uploaded from");
    });
}

/// Memory that an allocator should not have given is an error that says so, and is given back.
#[test]
fn memory_that_does_not_do_is_refused() {
    type Spoil = fn(&mut HostMemory);
    struct Spoilt(Arc<Pieces>, Memory, Spoil);
    // SAFETY: what is wrong with it is what must be found.
    unsafe impl HostAllocator for Spoilt {
        fn allocate(&self, request: &MemoryRequest) -> Option<HostMemory> {
            let mut memory = self.0.allocate(request)?;
            if request.memory == self.1 {
                self.2(&mut memory);
            }
            Some(memory)
        }

        fn free(&self, memory: HostMemory) {
            self.0.free(memory);
        }
    }
    in_lavapipe_hosts(|host| {
        let _turn = layer::begin();
        let cases: [(Memory, Spoil, &str); 4] = [
            (Memory::Device, |memory| memory.offset = 4, "alignment"),
            (Memory::Upload, |memory| memory.mapped = std::ptr::null_mut(), "`mapped`"),
            (Memory::Readback, |memory| memory.mapped = std::ptr::null_mut(), "`mapped`"),
            (Memory::Readback, |memory| memory.properties = vk::MemoryPropertyFlags::empty(), "HOST_COHERENT"),
        ];
        for (memory, spoil, words) in cases {
            let pieces = Pieces::of(host);
            let made = lend(host, Some(Arc::new(Spoilt(pieces.clone(), memory, spoil))))
                .map_err(Error::from)
                .and_then(|device| Renderer::new(&device, scene(), &options_of(host)));
            let error = made.map(drop).unwrap_err();
            assert!(matches!(error, Error::Gpu(gpu::Error::HostAllocator { .. })), "{error}");
            assert!(error.to_string().contains(words), "{error}");
            assert_eq!(pieces.alive.load(Ordering::SeqCst), 0);
        }
    });
}

fn assert_out_of_memory(error: &Error) {
    assert!(matches!(error, Error::Gpu(gpu::Error::OutOfMemory { .. })), "{error}");
}

/// Refuses, one after the other, each thing that a change of everything asks for, and each that another size does: the scene, the
/// samples and the picture are what they were, and in the end those of a renderer made for what is then there.
#[test]
fn out_of_memory_leaves_the_renderer_as_it_was() {
    in_lavapipe_hosts(|host| {
        let _turn = layer::begin();
        let pieces = Pieces::of(host);
        let device = lend(host, Some(pieces.clone())).unwrap();
        // More paths than the film has use for at first: the larger one gets them.
        let options = Options { pool_paths: Some(30_000), ..options_of(host) };
        let mut renderer = Renderer::new(&device, scene(), &options).unwrap();
        renderer.set_top_level(Update::Refit);
        let before = frame(host, &device, &mut renderer, 2).0;
        let refused = |renderer: &mut Renderer, call: &dyn Fn(&mut Renderer) -> Result<(), Error>| {
            for granted in 0.. {
                let (result, came_to_it) = layer::with_a_refusal_after(granted, || call(renderer));
                if !came_to_it {
                    result.unwrap();
                    return granted;
                }
                assert_out_of_memory(&result.unwrap_err());
                assert_eq!((renderer.scene(), renderer.samples(), renderer.size()), (&scene(), 2, [40, 30]));
                assert!(frame(host, &device, renderer, 0).0 == before, "after {granted} were granted");
            }
            unreachable!()
        };
        let resized = refused(&mut renderer, &|renderer| renderer.resize(64, 48));
        renderer.resize(40, 30).unwrap();
        assert!(frame(host, &device, &mut renderer, 2).0 == before);
        let changed_calls = refused(&mut renderer, &|renderer| renderer.update(&changes(0.1)));
        eprintln!("{resized} and {changed_calls} calls were refused");
        assert!(resized > 30 && changed_calls > 5);
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &changed(0.1), 2));
        drop(renderer);
        drop(device);
        assert_eq!(pieces.alive.load(Ordering::SeqCst), 0);
    });
}

/// What could not be made leaves nothing behind, which the validation layer would report, and the device as it was.
#[test]
fn a_renderer_that_finds_no_memory_leaves_nothing() {
    in_lavapipe_hosts(|host| {
        let _turn = layer::begin();
        let pieces = Pieces::of(host);
        let mut granted = 0;
        // The first calls one by one, the later ones, which are like one another, ever further apart.
        let device = loop {
            let (lent, came_to_it) = layer::with_a_refusal_after(granted, || lend(host, Some(pieces.clone())));
            match lent {
                Err(error) => assert!(matches!(error, gpu::Error::OutOfMemory { .. }), "{error}"),
                Ok(device) if !came_to_it => break device,
                Ok(_) => {} // it does without a pipeline cache
            }
            granted += 1;
        };
        granted = 0;
        let mut renderer = loop {
            let make = || Renderer::new(&device, scene(), &options_of(host));
            let (made, came_to_it) = layer::with_a_refusal_after(granted, make);
            match made {
                Err(error) => assert_out_of_memory(&error),
                Ok(renderer) => {
                    assert!(!came_to_it);
                    break renderer;
                }
            }
            assert_eq!(Arc::strong_count(&device), 1);
            granted += 1 + granted / 8;
        };
        eprintln!("a renderer makes at most {granted} things");
        assert!(frame(host, &device, &mut renderer, 2).0 == expected(host, &scene(), 2));
        drop(renderer);
        drop(device);
        assert_eq!(pieces.alive.load(Ordering::SeqCst), 0);
    });
}

/// A device that gets no further in the middle of a frame: it is said where.
#[test]
fn a_device_that_hangs_is_said_to_do_so_in_its_pass() {
    in_lavapipe_hosts(|host| {
        let _turn = layer::begin();
        let device = lend(host, None).unwrap();
        let mut renderer = Renderer::new(&device, scene(), &options_of(host)).unwrap();
        frame(host, &device, &mut renderer, 1);
        let at = |renderer: &Renderer| match renderer.device_lost() {
            gpu::Error::DeviceLost { last_pass, .. } => last_pass.unwrap_or_default(),
            other => panic!("{other}"),
        };
        // SAFETY: the event is destroyed when what waits for it is done.
        let event = unsafe { host.device.create_event(&vk::EventCreateInfo::default(), None).unwrap() };
        let recording = host.begin();
        let mut commands = host.wrap(&device, &recording);
        // A bounce has the sky, the diffuse and the metal surfaces, and shadow rays; from the second on the rays are queued, too.
        layer::wait_for_event_before(4 + 5 + 1, event);
        let nothing = Frame { samples: 1, targets: &[], estimates_error: false };
        let ticket = renderer.record(&mut commands, &nothing).unwrap();
        commands.finish().unwrap();
        host.submit(&recording);
        let expected = format!("bounce 2 of batch 0 of recording {ticket}");
        let patience = std::time::Instant::now() + std::time::Duration::from_secs(20);
        while at(&renderer) != expected && std::time::Instant::now() < patience {
            std::thread::yield_now();
        }
        let found = at(&renderer);
        // SAFETY: the event is the device's.
        unsafe { host.device.set_event(event).unwrap() };
        host.wait(recording);
        assert_eq!((found, at(&renderer)), (expected, String::new()));
        // SAFETY: nothing waits for it any longer.
        unsafe { host.device.destroy_event(event, None) };
        assert!(renderer.complete(ticket).is_some());
    });
}
