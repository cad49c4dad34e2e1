//! Rays a second of both traversals and of Embree, on the same rays: `cargo bench --features embree --bench rays`.
//!
//! Prints a table of millions of rays a second on the Cornell box and on the meshes in `../shared/data/meshes`, if they are
//! there. All tracers take their turn in every round, and medians are over rounds: on a busy machine trust the ratios.
//! Arguments: `--scaling [P]` builds spheres of 10³ to 10^P triangles instead, P = 7 if not given; `--refit [P]` sets refits of such
//! spheres beside rebuilds, P = 5 if not given; `--device NAME` picks the device; `--rounds N`.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::{Affine3A, Mat3, Vec3};
use neubrdf::converge::warm_up;
use neubrdf::gpu::{BlasGeometry, Device, DeviceChoice, Update, Upload, Validation};
#[cfg(feature = "embree")]
use neubrdf::reference::TraceMode;
use neubrdf::render::bvh::Bvh;
use neubrdf::render::{Intersector, Query, Ray, Traversal};
use neubrdf::scene::{Camera, Color, Film, Instance, Material, Mesh, Scene, Surface};
#[cfg(feature = "embree")]
use rayon::prelude::*;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| arguments.iter().skip_while(|a| *a != name).nth(1).cloned();
    let rounds = value("--rounds").map_or(Ok(7), |rounds| rounds.parse())?;
    let choice = value("--device").map_or(DeviceChoice::Auto, DeviceChoice::Named);
    let device = neubrdf::gpu::Instance::new(Validation::Off)?.open(&choice)?;
    println!("{}, {}\n", device.name(), device.driver());
    let most = |name: &str, default| {
        let asked = arguments.iter().any(|argument| argument == name);
        asked.then(|| value(name).and_then(|most| most.parse().ok()).unwrap_or(default))
    };
    if let Some(most) = most("--scaling", 7) {
        scaling(&device, rounds, most)
    } else if let Some(most) = most("--refit", 5) {
        refit(&device, rounds, most)
    } else {
        speed(&device, rounds)
    }
}

/// Rays a second on scenes as renderers see them.
fn speed(device: &Arc<Device>, rounds: usize) -> anyhow::Result<()> {
    println!(
        "| scene | rays | Embree | Embree streams | BVH | BVH / Embree | ray query |\n|---|---|---|---|---|---|---|"
    );
    let meshes = ["spot.obj", "teapot.obj", "stanford-bunny.obj"].into_iter().filter_map(found);
    for mesh in std::iter::once(cornell_box()).chain(meshes) {
        let sets = ray_sets(&mesh, if device.profile().is_cpu { 1024 } else { 2048 });
        let name = mesh.name.clone();
        let scene = alone(mesh);
        let bvh = Intersector::new(device, &scene, Traversal::Bvh)?;
        let ray_query = device.has_ray_query().then(|| Intersector::new(device, &scene, Traversal::RayQuery));
        let ray_query = ray_query.transpose()?;
        #[cfg(feature = "embree")]
        let embree = neubrdf::reference::Accelerator::new(&scene)?;
        for (kind, query, rays) in &sets {
            let batch = bvh.upload(rays)?;
            // Ray queries of CPU drivers are slow beyond patience.
            let step = if device.profile().is_cpu { 64 } else { 1 };
            let few: Vec<Ray> = rays.chunks(64).step_by(step).flatten().copied().collect();
            let few_batch = ray_query.as_ref().map(|tracer| tracer.upload(&few)).transpose()?;
            let [mut single, mut streams, mut own, mut query_times] = [const { Vec::new() }; 4];
            #[cfg(feature = "embree")]
            let mut peer = Peer::new(&embree, rays);
            // CPUs take turns; a GPU would idle meanwhile.
            let (turns, in_a_row) = if device.profile().is_cpu { (rounds, 1) } else { (1, rounds) };
            for _ in 0..turns {
                #[cfg(feature = "embree")]
                for _ in 0..in_a_row {
                    single.push(peer.seconds(*query, TraceMode::Single));
                    // Of what any hit ends there is no stream here.
                    if matches!(query, Query::Closest) {
                        streams.push(peer.seconds(*query, TraceMode::IncoherentStream));
                    }
                }
                warm_up(device.profile(), || bvh.trace(&batch, *query))?;
                for _ in 0..in_a_row {
                    own.push(seconds(|| bvh.trace(&batch, *query))?);
                }
                if let (Some(tracer), Some(batch)) = (&ray_query, &few_batch) {
                    warm_up(device.profile(), || tracer.trace(batch, *query))?;
                    for _ in 0..in_a_row {
                        query_times.push(seconds(|| tracer.trace(batch, *query))?);
                    }
                }
            }
            let rate = |times: &mut Vec<f64>, count: usize| median(times).map(|time| count as f64 / time / 1e6);
            let text = |rate: Option<f64>| rate.map_or("–".to_string(), |rate| format!("{rate:.2}"));
            let (single, streams) = (rate(&mut single, rays.len()), rate(&mut streams, rays.len()));
            let (own, queried) = (rate(&mut own, rays.len()), rate(&mut query_times, few.len()));
            let ratio = own.zip(single).map(|(own, single)| own / single);
            let cells = [single, streams, own, ratio, queried].map(text).join(" | ");
            println!("| {name} | {kind} | {cells} |");
        }
    }
    Ok(())
}

/// What a million triangles cost.
fn scaling(device: &Arc<Device>, rounds: usize, most: i32) -> anyhow::Result<()> {
    println!(
        "| triangles | build and upload, s | bytes a triangle | camera, Mray/s | diffuse, Mray/s |\n|---|---|---|---|---|"
    );
    for power in 3..=most {
        let mesh = bumpy_sphere(((10f64.powi(power) / 4.0).sqrt()) as u32);
        let count = mesh.triangles.len();
        let sets = ray_sets(&mesh, 512);
        let scene = alone(mesh);
        let start = Instant::now();
        let bvh = Intersector::new(device, &scene, Traversal::Bvh)?;
        let build = start.elapsed().as_secs_f64();
        let mut rates = Vec::new();
        for (_, query, rays) in &sets[..2] {
            let batch = bvh.upload(rays)?;
            warm_up(device.profile(), || bvh.trace(&batch, *query))?;
            let mut times =
                (0..rounds).map(|_| seconds(|| bvh.trace(&batch, *query))).collect::<Result<Vec<_>, _>>()?;
            rates.push(rays.len() as f64 / median(&mut times).unwrap_or(f64::NAN) / 1e6);
        }
        let bytes = bvh.bytes() as f64 / count as f64;
        println!("| {count} | {build:.2} | {bytes:.0} | {:.2} | {:.2} |", rates[0], rates[1]);
    }
    Ok(())
}

/// What a mesh costs that changes its shape: rebuild against refit, of our tree and of the driver's structure.
fn refit(device: &Arc<Device>, rounds: usize, most: i32) -> anyhow::Result<()> {
    println!(
        "| triangles | tree: rebuild, ms | refit, ms | ratio | structure: rebuild, ms | refit, ms | ratio |\n|---|---|---|---|---|---|---|"
    );
    for power in 3..=most {
        let mesh = bumpy_sphere(((10f64.powi(power) / 4.0).sqrt()) as u32);
        let tree = Bvh::over_triangles(&mesh);
        let mut upload = Upload::now(device);
        let positions = upload.buffer("positions", &mesh.positions)?;
        let indices = upload.buffer("indices", &mesh.triangles)?;
        let geometry = BlasGeometry {
            positions: positions.address(),
            vertex_count: mesh.positions.len() as u32,
            indices: indices.address(),
            triangle_count: mesh.triangles.len() as u32,
        };
        let structure =
            device.has_ray_query().then(|| upload.deformable_blas(&[geometry], Update::Refit)).transpose()?;
        let mut times = [const { Vec::new() }; 4];
        for _ in 0..rounds {
            times[0].push(seconds(|| built(Bvh::over_triangles(&mesh)))?);
            times[1].push(seconds(|| built(tree.refitted(&Bvh::boxes(&mesh))))?);
            if let Some(structure) = &structure {
                times[2].push(seconds(|| upload.update_blas(structure, Update::Rebuild))?);
                times[3].push(seconds(|| upload.update_blas(structure, Update::Refit))?);
            }
        }
        let [rebuilt, refitted, built, updated] = times.each_mut().map(|times| median(times).map(|time| 1e3 * time));
        let ratio = |slow: Option<f64>, fast: Option<f64>| slow.zip(fast).map(|(slow, fast)| slow / fast);
        let cells = [rebuilt, refitted, ratio(rebuilt, refitted), built, updated, ratio(built, updated)];
        let text = |number: Option<f64>| number.map_or("–".to_string(), |number| format!("{number:.2}"));
        println!("| {} | {} |", mesh.triangles.len(), cells.map(text).join(" | "));
    }
    Ok(())
}

/// A tree that the compiler may not leave away.
fn built(tree: Bvh) -> anyhow::Result<()> {
    std::hint::black_box(tree);
    Ok(())
}

fn seconds<E>(work: impl FnOnce() -> Result<(), E>) -> Result<f64, E> {
    let start = Instant::now();
    work()?;
    Ok(start.elapsed().as_secs_f64())
}

/// Embree, and what it is given and gives back: memory that is there before it is timed, as a batch's is.
#[cfg(feature = "embree")]
struct Peer<'a> {
    embree: &'a neubrdf::reference::Accelerator,
    rays: Vec<neubrdf::reference::Ray>,
    hits: Vec<Option<neubrdf::reference::Hit>>,
}

#[cfg(feature = "embree")]
impl Peer<'_> {
    fn new<'a>(embree: &'a neubrdf::reference::Accelerator, rays: &[Ray]) -> Peer<'a> {
        let convert = |ray: &Ray| neubrdf::reference::Ray {
            origin: ray.origin.into(),
            direction: ray.direction.into(),
            t_min: 0.0,
            t_max: ray.t_max,
        };
        Peer { embree, rays: rays.iter().map(convert).collect(), hits: vec![None; rays.len()] }
    }

    fn seconds(&mut self, query: Query, mode: neubrdf::reference::TraceMode) -> f64 {
        let start = Instant::now();
        match query {
            Query::Any => {
                let blocked =
                    |rays: &[neubrdf::reference::Ray]| rays.iter().filter(|r| self.embree.occluded(r)).count();
                std::hint::black_box(self.rays.par_chunks(1024).map(blocked).sum::<usize>());
            }
            Query::Closest => self.embree.trace_rays(&self.rays, mode, &mut self.hits),
        }
        start.elapsed().as_secs_f64()
    }
}

fn median(times: &mut [f64]) -> Option<f64> {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied()
}

/// Camera rays, one diffuse bounce of each, and a shadow ray to an area light; pixels in the renderer's order, down bands of 8 rows.
fn ray_sets(mesh: &Mesh, size: u32) -> [(&'static str, Query, Vec<Ray>); 3] {
    let bvh = Bvh::over_triangles(mesh);
    let (center, radius) = (bvh.bounds.center(), bvh.bounds.radius());
    let is_room = mesh.name == "Cornell box";
    let eye =
        if is_room { Vec3::new(0.0, 1.0, 3.8) } else { center + Vec3::new(0.4, 0.3, 1.0).normalize() * radius * 2.0 };
    let light = if is_room { Vec3::new(0.0, 1.98, 0.0) } else { center + Vec3::new(-0.6, 1.2, 0.5) * radius * 2.0 };
    let half = if is_room { 0.36 } else { 0.45 };
    let forward = (center - eye).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let ray = |origin: Vec3, direction: Vec3, t_max: f32| Ray {
        origin: origin.into(),
        t_max,
        direction: direction.into(),
        padding: 0.0,
    };
    let (mut camera, mut diffuse, mut shadow) = (Vec::new(), Vec::new(), Vec::new());
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    for index in 0..size * size {
        let pixel = [index / 8 % size, index / (8 * size) * 8 + index % 8];
        let [x, y] = pixel.map(|i| ((i as f32 + random()) / size as f32 * 2.0 - 1.0) * half);
        let direction = (forward + right * x - up * y).normalize();
        camera.push(ray(eye, direction, f32::INFINITY));
        let Some(hit) = bvh.closest(mesh, eye, direction, f32::INFINITY) else { continue };
        let [a, b, c] = mesh.corners(hit.primitive as usize);
        let normal = (b - a).cross(c - a).normalize();
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let origin = eye + direction * hit.t + normal * radius * 1e-4;
        let (angle, z) = (random() * std::f32::consts::TAU, random() * 2.0 - 1.0);
        let around = (1.0 - z * z).sqrt();
        let bounce = normal * 1.0001 + Vec3::new(around * angle.cos(), around * angle.sin(), z);
        diffuse.push(ray(origin, bounce.normalize(), f32::INFINITY));
        let point = light + Vec3::new(random() - 0.5, 0.0, random() - 0.5) * radius * 0.3;
        shadow.push(ray(origin, point - origin, 1.0));
    }
    [("camera", Query::Closest, camera), ("diffuse", Query::Closest, diffuse), ("shadow", Query::Any, shadow)]
}

fn alone(mesh: Mesh) -> Scene {
    let surface = Surface::Diffuse { albedo: Color::constant(Vec3::splat(0.5)) };
    Scene {
        camera: Camera { eye: Vec3::Z, target: Vec3::ZERO, up: Vec3::Y, vertical_fov_degrees: 40.0, lens: None },
        film: Film { width: 1, height: 1 },
        meshes: vec![mesh],
        instances: vec![Instance { mesh: 0, object_to_world: Affine3A::IDENTITY }],
        materials: vec![Material::new("grey", surface)],
        textures: vec![],
        brdfs: vec![],
        environment: None,
        sun: None,
    }
}

fn mesh(name: &str, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
    Mesh { name: name.into(), positions, triangles, materials: vec![0], ..Mesh::default() }
}

fn cornell_box() -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut block = |low: [f32; 3], high: [f32; 3], turn: f32, at: [f32; 3], sides: &[[usize; 4]]| {
        let start = positions.len() as u32;
        for corner in 0..8 {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            let turned = Mat3::from_rotation_y(turn) * Vec3::new(pick(0), pick(1), pick(2));
            positions.push(turned + Vec3::from(at));
        }
        for side in sides {
            let [a, b, c, d] = side.map(|corner| start + corner as u32);
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    };
    let sides = [[0, 1, 3, 2], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3], [4, 6, 7, 5]];
    block([-1.0, 0.0, -1.0], [1.0, 2.0, 1.0], 0.0, [0.0; 3], &sides[..5]);
    block([-0.25, 1.99, -0.25], [0.25, 1.99, 0.25], 0.0, [0.0; 3], &sides[1..2]);
    block([-0.3, 0.0, -0.3], [0.3, 1.2, 0.3], 0.3, [-0.35, 0.0, -0.3], &sides);
    block([-0.3, 0.0, -0.3], [0.3, 0.6, 0.3], -0.3, [0.35, 0.0, 0.3], &sides);
    mesh("Cornell box", positions, triangles)
}

/// A sphere of 4·rings² triangles with bumps all over.
fn bumpy_sphere(rings: u32) -> Mesh {
    let around = 2 * rings;
    let at = |ring: u32, step: u32| ring * around + step % around;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for ring in 0..=rings {
        for step in 0..around {
            let theta = std::f32::consts::PI * ring as f32 / rings as f32;
            let phi = std::f32::consts::TAU * step as f32 / around as f32;
            let radius = 1.0 + 0.05 * (20.0 * theta).sin() * (20.0 * phi).sin();
            positions.push(Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()) * radius);
        }
    }
    for ring in 0..rings {
        for step in 0..around {
            let [a, b, c, d] = [at(ring, step), at(ring, step + 1), at(ring + 1, step), at(ring + 1, step + 1)];
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    mesh("sphere", positions, triangles)
}

fn found(name: &str) -> Option<Mesh> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/meshes").join(name);
    if !path.exists() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    let (scene, _) = Scene::load(&path).expect("a mesh that loads");
    scene.meshes.into_iter().next().map(|mesh| Mesh { materials: vec![0], ..mesh })
}
