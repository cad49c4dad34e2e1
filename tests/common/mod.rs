//! What tests of renderers share: the drivers that are installed, small scenes built in code, and a way to render them.
#![allow(dead_code)] // each test file uses a part of it

pub mod bsdf_structs;
pub mod gpu_structs;
pub mod networks;
pub mod neubrdf_parity;
pub mod random_neubrdf;
pub mod tables;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bytemuck::Pod;
use glam::{Affine3A, Vec2, Vec3};
use neubrdf::gpu::{Buffer, Commands, Device, DeviceChoice, Instance, Kernel, Memory, Validation};
use neubrdf::image::{Picture, plane};
use neubrdf::render::{Limits, Options, Renderer, Settings, Traversal, run};
use neubrdf::scene::{
    Camera, Color, Environment, Film, Fresnel, Instance as Placed, Material, Mesh, Scene, Sun, Surface, Texture,
};

/// The names by which the two CPU drivers are found.
pub const LAVAPIPE: &str = "llvmpipe";
pub const SWIFTSHADER: &str = "SwiftShader";

/// A driver, mostly under synchronization validation; `finish` insists that the validation layer, where it is on, said nothing.
pub struct Driver {
    pub device: Arc<Device>,
    instance: Arc<Instance>,
}

impl Driver {
    /// Whether it can find triangles that way. A GPU that takes lavapipe's place may lack ray query.
    pub fn has(&self, traversal: Traversal) -> bool {
        let is_there = traversal == Traversal::Bvh || self.device.has_ray_query();
        assert!(is_there || !drivers_are_required(), "{} has no ray query", self.device.name());
        if !is_there {
            eprintln!("skipped: {} has no ray query", self.device.name());
        }
        is_there
    }

    pub fn finish(self) {
        drop(self.device);
        assert_eq!(self.instance.validation_messages(), Vec::<String>::new());
    }
}

/// Whether a driver that is missing is a failure, not a reason to skip.
pub fn drivers_are_required() -> bool {
    std::env::var_os("NEUBRDF_REQUIRE_DRIVERS").is_some()
}

/// Says why a test looks at nothing; where drivers are required that is a failure.
pub fn skip(reason: impl std::fmt::Display) {
    assert!(!drivers_are_required(), "required here: {reason}");
    eprintln!("skipped: {reason}");
}

/// By what name a device is opened: where `NEUBRDF_TEST_DEVICE` names one, a GPU say, tests of lavapipe take it instead.
pub fn opened_as(name: &str) -> DeviceChoice {
    DeviceChoice::Named(if name == LAVAPIPE { name_of_lavapipe() } else { name.to_owned() })
}

/// A part of the name of lavapipe, or of what takes its place.
pub fn name_of_lavapipe() -> String {
    std::env::var("NEUBRDF_TEST_DEVICE").unwrap_or_else(|_| LAVAPIPE.to_owned())
}

/// Waits until no other test uses the validation layer, and keeps it from all others until this test's thread ends.
///
/// The layer (Debian 12's, 1.3.239, as all of its time) finds its instances and devices in maps without a lock: while one test makes or destroys one
/// of them, another that records a command may read what is being moved, and crash: one of 155 runs of tests/gpu.rs did.
pub fn alone_with_validation() {
    static LAYER: Mutex<()> = Mutex::new(());
    thread_local! {
        static TAKEN: MutexGuard<'static, ()> = LAYER.lock().unwrap_or_else(PoisonError::into_inner);
    }
    TAKEN.with(|_| ());
}

/// An instance under synchronization validation.
pub fn validated() -> Result<Arc<Instance>, neubrdf::gpu::Error> {
    alone_with_validation();
    Instance::new(Validation::Sync)
}

/// The driver of that name, under validation. Where it is missing the test is to be skipped, unless drivers are required.
pub fn driver(name: &str) -> Option<Driver> {
    driver_within(name, validated)
}

/// The same for a test of kernels, without the layer on SwiftShader: its compiler takes long, and nobody else could use the layer meanwhile.
/// What the layer would see there is what it sees on lavapipe.
pub fn driver_for_kernels(name: &str) -> Option<Driver> {
    driver_within(name, if name == SWIFTSHADER { || Instance::new(Validation::Off) } else { validated })
}

/// Runs a check of kernels on lavapipe and on SwiftShader, side by side.
pub fn on_both_drivers(check: impl Fn(&Arc<Device>, &str) + Sync) {
    let run = |name: &str| {
        if let Some(driver) = driver_for_kernels(name) {
            check(&driver.device, name);
            driver.finish();
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(|| run(SWIFTSHADER));
        run(LAVAPIPE);
    });
}

fn driver_within(name: &str, instance: fn() -> Result<Arc<Instance>, neubrdf::gpu::Error>) -> Option<Driver> {
    let open = || -> Result<Driver, neubrdf::gpu::Error> {
        let instance = instance()?;
        let device = instance.open(&opened_as(name))?;
        Ok(Driver { device, instance })
    };
    match open() {
        Ok(driver) => Some(driver),
        Err(error) => {
            skip(format_args!("{name}: {error}"));
            None
        }
    }
}

/// Runs a check on every fit device, and insists that the validation layer has nothing to say about it.
///
/// Without a loader or without the validation layer there is nothing to run on: the test says so and passes.
pub fn on_every_device(check: impl Fn(&Arc<Device>)) {
    let instance = match validated() {
        Ok(instance) => instance,
        Err(error) => return skip(error),
    };
    let reports = instance.devices().unwrap();
    if !reports.iter().any(|report| report.missing.is_empty()) {
        skip("no fit Vulkan device");
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

/// Renders `samples` samples a pixel.
pub fn render(device: &Arc<Device>, scene: &Scene, settings: &Settings, options: &Options, samples: u32) -> Picture {
    let mut renderer = Renderer::new(device, scene, settings, options).unwrap();
    let limits = Limits { samples, seconds: None, error: None };
    run(&mut renderer, &limits, |_, _| std::ops::ControlFlow::Continue(())).unwrap();
    assert_eq!(renderer.rejected_samples().unwrap(), 0, "samples that are not finite");
    renderer.picture().unwrap().0
}

/// A floor and two balls, of three materials that a texture may vary, under a sky and a sun.
pub fn floor_and_balls(materials: Vec<Material>, texture: Texture) -> Scene {
    let meshes = vec![
        sheet(0.0, 3.0, 0),
        sphere(Vec3::new(-0.9, 0.0, 0.8), 0.7, 32, 1),
        sphere(Vec3::new(0.9, 0.5, 0.8), 0.5, 32, 2),
    ];
    let mut scene = scene(meshes, materials, Vec3::new(0.0, -3.0, 5.0), Vec3::new(0.0, 0.0, 0.5), [40, 30]);
    scene.textures = vec![texture];
    let mut sky = Environment { width: 4, height: 2, ..Environment::constant(Vec3::ONE) };
    sky.texels = (0..8).map(|i| Vec3::splat(0.2 + 0.3 * (i % 3) as f32)).collect();
    scene.environment = Some(sky);
    scene.sun = Some(Sun { direction: Vec3::new(0.5, 0.2, 0.8).normalize(), irradiance: Vec3::splat(1.5) });
    scene
}

/// What Embree sees of a scene is what the BVH on both drivers renders; and it would be seen if the scene were `another`.
#[cfg(feature = "embree")]
pub fn agrees_with_embree(
    title: &str,
    scene: &Scene,
    another: &Scene,
    settings: &Settings,
    [of_reference, samples]: [u32; 2],
) {
    use neubrdf::converge::prove_equal;
    use neubrdf::reference::{Reference, ReferenceOptions};
    let options = ReferenceOptions { spp: of_reference, seed: 1, max_depth: settings.max_depth, crop: None };
    let stop = std::sync::atomic::AtomicBool::new(false);
    let expected = Reference::new(scene).unwrap().render(&options, |_| {}, &stop).unwrap().0;
    let bvh = Options { traversal: Some(Traversal::Bvh), pool_paths: None };
    for name in [LAVAPIPE, SWIFTSHADER] {
        let Some(driver) = driver(name) else { continue };
        let proved = |title: &str, scene: &Scene| {
            prove_equal(title, &render(&driver.device, scene, settings, &bvh, samples), &expected, 1e-3)
        };
        proved(&format!("{title}-{name}"), scene).unwrap();
        if name == LAVAPIPE {
            assert!(proved(&format!("{title}-another"), another).is_err());
        }
        driver.finish();
    }
}

/// The beauty's bits.
pub fn bits(picture: &Picture) -> Vec<[u32; 3]> {
    picture.rgb(plane::BEAUTY).unwrap().iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

pub fn material(name: &str, surface: Surface) -> Material {
    Material::new(name, surface)
}

pub fn diffuse(albedo: f32) -> Surface {
    Surface::Diffuse { albedo: Color::constant(Vec3::splat(albedo)) }
}

pub fn conductor(f0: f32, alpha: f32) -> Surface {
    Surface::Conductor { fresnel: Fresnel::Schlick { f0: Color::constant(Vec3::splat(f0)) }, alpha: Vec2::splat(alpha) }
}

pub fn lamp(radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), ..material("lamp", diffuse(0.0)) }
}

/// A quad a, b, c, d, counter-clockwise from its front.
pub fn quad(corners: [Vec3; 4], material: u32) -> Mesh {
    Mesh {
        name: "quad".into(),
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material],
        ..Mesh::default()
    }
}

/// A horizontal square about the origin, facing up.
pub fn floor(half_side: f32, material: u32) -> Mesh {
    let corner = |x: f32, z: f32| Vec3::new(x * half_side, 0.0, z * half_side);
    quad([corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)], material)
}

/// A square that faces z, there, with texture coordinates from 0 to 1.
pub fn sheet(z: f32, half_side: f32, material: u32) -> Mesh {
    let corner = |x: f32, y: f32| Vec3::new(x * half_side, y * half_side, z);
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    Mesh { uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], ..quad(corners, material) }
}

/// A UV sphere with smooth normals.
pub fn sphere(center: Vec3, radius: f32, segments: u32, material: u32) -> Mesh {
    let rows = segments / 2;
    let mut mesh = Mesh { name: "sphere".into(), materials: vec![material], ..Mesh::default() };
    for row in 0..=rows {
        for column in 0..=segments {
            let (theta, phi) = (
                std::f32::consts::PI * row as f32 / rows as f32,
                std::f32::consts::TAU * column as f32 / segments as f32,
            );
            let normal = Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
            mesh.positions.push(center + radius * normal);
            mesh.normals.push(normal);
            mesh.uvs.push(Vec2::new(column as f32 / segments as f32, 1.0 - row as f32 / rows as f32));
        }
    }
    for row in 0..rows {
        for column in 0..segments {
            let upper = row * (segments + 1) + column;
            let lower = upper + segments + 1;
            if row > 0 {
                mesh.triangles.push([upper, lower, upper + 1]);
            }
            if row + 1 < rows {
                mesh.triangles.push([upper + 1, lower, lower + 1]);
            }
        }
    }
    mesh
}

/// Meshes where they are, seen from `eye` towards `target`.
pub fn scene(meshes: Vec<Mesh>, materials: Vec<Material>, eye: Vec3, target: Vec3, film: [u32; 2]) -> Scene {
    let instances = (0..meshes.len() as u32).map(|mesh| Placed { mesh, object_to_world: Affine3A::IDENTITY }).collect();
    let up = if (target - eye).cross(Vec3::Y).length() < 1e-3 { Vec3::Z } else { Vec3::Y };
    Scene {
        camera: Camera { eye, target, up, vertical_fov_degrees: 40.0, lens: None },
        film: Film { width: film[0], height: film[1] },
        meshes,
        instances,
        materials,
        textures: Vec::new(),
        brdfs: Vec::new(),
        environment: None,
        sun: None,
    }
}

/// A floor, a sphere and a lamp: every kind of vertex in a few triangles.
pub fn still_life(surface: Surface) -> Scene {
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let lamp_quad = quad([at(-0.5, 2.5, -0.5), at(0.5, 2.5, -0.5), at(0.5, 2.5, 0.5), at(-0.5, 2.5, 0.5)], 2);
    let mut scene = scene(
        vec![floor(3.0, 0), sphere(at(0.0, 0.8, 0.0), 0.7, 32, 1), lamp_quad],
        vec![material("floor", diffuse(0.5)), material("ball", surface), lamp(10.0)],
        at(0.0, 1.5, 5.0),
        at(0.0, 0.7, 0.0),
        [40, 30],
    );
    scene.environment = Some(Environment::constant(Vec3::new(0.2, 0.3, 0.5)));
    scene
}

/// Every `scenes/NAME/scene.toml`.
pub fn shipped_scenes() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let scenes = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path().join("scene.toml"));
    let mut scenes: Vec<PathBuf> = scenes.filter(|path| path.exists()).collect();
    scenes.sort();
    scenes
}

/// What a kernel of one invocation a query makes of queries; `push` is told where queries and results lie.
pub fn values_of<Query: Pod, Value: Pod, Push: Pod>(
    device: &Arc<Device>,
    kernel: &Kernel,
    queries: &[Query],
    push: impl FnOnce(u64, u64) -> Push,
) -> Vec<Value> {
    let input = Buffer::with_data(device, "queries", queries).unwrap();
    let output = Buffer::new(device, "values", (size_of::<Value>() * queries.len()) as u64, Memory::Device).unwrap();
    let mut commands = Commands::begin(device).unwrap();
    commands.dispatch(kernel, kernel.groups_for(queries.len() as u32), &push(input.address(), output.address()));
    device.submit(commands).unwrap().wait().unwrap();
    output.read().unwrap()
}
