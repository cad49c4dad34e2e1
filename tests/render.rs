//! The wavefront path tracer: the same bits whatever the path to them, only the kernels that a scene needs, and radiance
//! that is known in closed form.

mod common;

use std::ops::ControlFlow;
use std::sync::Arc;

use common::*;
use glam::{DVec2, DVec3, Vec2, Vec3};
use neubrdf::converge::Metrics;
use neubrdf::gpu::{Device, DeviceReport, Instance};
use neubrdf::image::{Crop, Picture, plane};
use neubrdf::render::{
    Checkpoint, Features, Limits, NeuBrdfShape, Options, Renderer, Sampler, Settings, Stopped, Traversal, pack_neubrdf,
    run,
};
use neubrdf::scene::brdf::{
    Codebook, CornerWeights, Dense, Encoding, Footprint, NeuBrdf, Precision, Provenance, SphereGrid, SphereTable,
    SurfaceFrame, SurfaceFrames, SurfaceGrid, SurfaceTable,
};
use neubrdf::scene::{Brdf, Environment, LightTable, Material, Patches, SamplingLobe, Scene, Sun, Surface, Texture};

fn settings() -> Settings {
    Settings { max_depth: 6, seed: 7, ..Settings::default() }
}

fn bvh() -> Options {
    Options { traversal: Some(Traversal::Bvh), pool_paths: None }
}

#[test]
fn the_pool_size_does_not_change_a_bit() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = still_life(conductor(0.9, 0.2));
    let with_pool =
        |paths| render(&driver.device, &scene, &settings(), &Options { pool_paths: Some(paths), ..bvh() }, 5);
    let whole = with_pool(1 << 20);
    for paths in [64, 999, 5000] {
        assert!(with_pool(paths) == whole, "a pool of {paths} paths");
    }
    driver.finish();
}

#[test]
fn a_pool_of_one_path_renders() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let mut scene = still_life(diffuse(0.5));
    scene.film = neubrdf::scene::Film { width: 3, height: 2 };
    let one = render(&driver.device, &scene, &settings(), &Options { pool_paths: Some(1), ..bvh() }, 3);
    assert!(one == render(&driver.device, &scene, &settings(), &bvh(), 3));
    driver.finish();
}

/// Lavapipe under two disguises; `None` where there is none.
fn disguised(disguises: [fn(&mut DeviceReport); 2]) -> Option<(Arc<Instance>, [Arc<Device>; 2])> {
    let open = || -> Result<_, neubrdf::gpu::Error> {
        let instance = validated()?;
        let [first, second] = disguises.map(|disguise| instance.open_as(&opened_as(LAVAPIPE), disguise));
        Ok((instance, [first?, second?]))
    };
    open().inspect_err(|error| skip(error)).ok()
}

/// Times are then missing, and nothing else.
#[test]
fn a_queue_without_timestamps_renders_the_same_bits() {
    let Some((instance, [with, without])) =
        disguised([|report| report.limits.timestamp_valid_bits = 64, |report| report.limits.timestamp_valid_bits = 0])
    else {
        return;
    };
    let scene = still_life(diffuse(0.5));
    let timed = |device: &Arc<Device>| {
        let mut renderer = Renderer::new(device, &scene, &settings(), &bvh()).unwrap();
        (renderer.time_pass(2).unwrap(), bits(&renderer.picture().unwrap().0))
    };
    let ((some, expected), (none, found)) = (timed(&with), timed(&without));
    assert!(!some.is_empty() && none.is_empty(), "{some:?} {none:?}");
    assert_eq!(found, expected);
    drop((with, without));
    assert_eq!(instance.validation_messages(), Vec::<String>::new());
}

/// Lavapipe under the name of a GPU: rays walk alone, workgroups reserve places in queues as one and are larger. At an edge the first triangle
/// that was tried stays, and they try them in orders of their own: hence a few pixels.
#[test]
fn what_gpus_run_gives_the_picture_that_cpu_drivers_give() {
    let Some((instance, [cpu, gpu])) = disguised([|report| report.kind = "CPU", |report| report.kind = "discrete GPU"])
    else {
        return;
    };
    assert!(cpu.profile().is_cpu && !gpu.profile().is_cpu);
    for name in ["cornell", "preview", "sky"] {
        let (mut scene, _) = Scene::load(format!("{}/scenes/{name}/scene.toml", env!("CARGO_MANIFEST_DIR"))).unwrap();
        scene.film = neubrdf::scene::Film { width: 40, height: 30 };
        let [expected, found] = [&cpu, &gpu].map(|device| bits(&render(device, &scene, &settings(), &bvh(), 4)));
        let differ = expected.iter().zip(&found).filter(|(expected, found)| expected != found).count();
        assert!(differ <= expected.len() / 50, "{name}: {differ} of {} pixels differ", expected.len());
    }
    drop((cpu, gpu));
    assert_eq!(instance.validation_messages(), Vec::<String>::new());
}

#[test]
fn both_traversals_give_the_same_bits() {
    let Some(driver) = driver(LAVAPIPE).filter(|driver| driver.has(Traversal::RayQuery)) else { return };
    let scene = still_life(Surface::Dielectric { ior: 1.5, alpha: 0.0 });
    let by = |traversal| {
        render(&driver.device, &scene, &settings(), &Options { traversal: Some(traversal), pool_paths: None }, 8)
    };
    assert_eq!(bits(&by(Traversal::Bvh)), bits(&by(Traversal::RayQuery)));
    driver.finish();
}

#[test]
fn a_crop_is_a_part_of_the_picture() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = still_life(diffuse(0.5));
    let whole = bits(&render(&driver.device, &scene, &settings(), &bvh(), 4));
    let crop = Crop { x: 11, y: 5, width: 17, height: 9 };
    let part = bits(&render(&driver.device, &scene, &Settings { crop: Some(crop), ..settings() }, &bvh(), 4));
    for y in 0..crop.height {
        for x in 0..crop.width {
            let inside = whole[((y + crop.y) * scene.film.width + x + crop.x) as usize];
            assert_eq!(part[(y * crop.width + x) as usize], inside, "pixel {x}, {y}");
        }
    }
    driver.finish();
}

#[test]
fn a_resumed_render_ends_as_an_uninterrupted_one() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("state");
    let scene = still_life(conductor(0.9, 0.3));
    let whole = render(&driver.device, &scene, &settings(), &bvh(), 21);
    let limits = Limits { samples: 21, seconds: None, error: None };
    for stop_at in [1, 3, 15] {
        let mut first = Renderer::new(&driver.device, &scene, &settings(), &bvh()).unwrap();
        let stopped = run(&mut first, &limits, |_, progress| {
            if progress.samples >= stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(stopped.unwrap(), Stopped::Interrupted);
        assert!(first.samples() < 21);
        first.checkpoint().unwrap().write(&path).unwrap();

        let mut second = Renderer::new(&driver.device, &scene, &settings(), &bvh()).unwrap();
        second.restore(&Checkpoint::read(&path).unwrap()).unwrap();
        run(&mut second, &limits, |_, _| ControlFlow::Continue(())).unwrap();
        assert!(second.picture().unwrap().0 == whole, "stopped after {stop_at} samples");
    }
    driver.finish();
}

#[test]
fn a_checkpoint_of_another_render_is_refused_by_name() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = still_life(diffuse(0.5));
    let checkpoint = Renderer::new(&driver.device, &scene, &settings(), &bvh()).unwrap().checkpoint().unwrap();
    let refused = |scene: &Scene, settings: Settings| {
        let mut other = Renderer::new(&driver.device, scene, &settings, &bvh()).unwrap();
        other.restore(&checkpoint).unwrap_err().to_string()
    };
    assert!(refused(&scene, Settings { seed: 8, ..settings() }).contains("--seed 7"));
    assert!(refused(&scene, Settings { sampler: Sampler::Pcg, ..settings() }).contains("--sampler sobol"));
    assert!(refused(&still_life(diffuse(0.6)), settings()).contains("scene"));
    driver.finish();
}

#[test]
fn a_damaged_checkpoint_is_an_error() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("state");
    let scene = still_life(diffuse(0.5));
    let checkpoint = Renderer::new(&driver.device, &scene, &settings(), &bvh()).unwrap().checkpoint().unwrap();
    checkpoint.write(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for length in (0..100).chain((100..bytes.len()).step_by(997)) {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let message = Checkpoint::read(&path).unwrap_err().to_string();
        assert!(message.contains("state"), "cut to {length} bytes: {message}");
    }
    for place in (0..bytes.len()).step_by(1009) {
        let mut changed = bytes.clone();
        changed[place] ^= 0x10;
        std::fs::write(&path, changed).unwrap();
        assert!(Checkpoint::read(&path).is_err(), "byte {place} changed");
    }
    driver.finish();
}

/// A renderer that begins again gives what a new one gives, with the old seed and with another.
#[test]
fn a_restarted_renderer_is_a_new_one() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = still_life(conductor(0.8, 0.1));
    let limits = Limits { samples: 3, seconds: None, error: None };
    let picture = |renderer: &mut Renderer| {
        run(renderer, &limits, |_, _| std::ops::ControlFlow::Continue(())).unwrap();
        renderer.picture().unwrap().0
    };
    let mut renderer = Renderer::new(&driver.device, &scene, &settings(), &bvh()).unwrap();
    let first = picture(&mut renderer);
    renderer.restart(8).unwrap();
    let second = picture(&mut renderer);
    renderer.restart(settings().seed).unwrap();
    assert_eq!(picture(&mut renderer), first);
    let fresh = render(&driver.device, &scene, &Settings { seed: 8, ..settings() }, &bvh(), 3);
    assert_eq!(second, fresh);
    assert_ne!(bits(&first), bits(&second));
    driver.finish();
}

#[test]
fn paths_of_no_or_too_many_segments_are_refused() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    for max_depth in [0, u32::MAX] {
        let settings = Settings { max_depth, ..settings() };
        let error = Renderer::new(&driver.device, &still_life(diffuse(0.5)), &settings, &bvh()).err().unwrap();
        assert!(error.to_string().contains("max depth"), "{error}");
    }
    driver.finish();
}

/// Without light samples there is no kernel that traces shadows; a sun would never be found.
#[test]
fn light_sampling_can_be_left_out_but_not_with_a_sun() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let mut scene = still_life(diffuse(0.5));
    let blind = Settings { light_sampling: false, ..settings() };
    let renderer = Renderer::new(&driver.device, &scene, &blind, &bvh()).unwrap();
    assert!(!renderer.kernel_names().contains(&"trace_shadow_bvh"));
    drop(renderer);
    scene.sun = Some(Sun { direction: Vec3::Y, irradiance: Vec3::ONE });
    let error = Renderer::new(&driver.device, &scene, &blind, &bvh()).err().unwrap().to_string();
    assert!(error.contains("light sampling is off") && error.contains("sun"), "{error}");
    driver.finish();
}

/// A limit on indirect light leaves what is seen and what falls on it as they are, and of the rest each light that a path finds is within it.
#[test]
fn indirect_light_may_be_limited_and_nothing_else_is() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = still_life(conductor(0.9, 0.05));
    let picture = |clamp_indirect: Option<f32>, max_depth: u32| {
        let settings = Settings { clamp_indirect, max_depth, ..settings() };
        render(&driver.device, &scene, &settings, &bvh(), 1).rgb(plane::BEAUTY).unwrap()
    };
    let [direct, all] = [2, 6].map(|max_depth| picture(None, max_depth));
    assert_eq!(picture(Some(1e-6), 2), direct);
    assert_eq!(picture(Some(1e6), 6), all);
    let limit = 0.05;
    let limited = picture(Some(limit), 6);
    let mut darkened = 0;
    // A path of six segments finds four lights of its vertices', and runs into four itself, behind the first two.
    for ((direct, all), limited) in direct.iter().zip(&all).zip(&limited) {
        for channel in 0..3 {
            let [direct, all, limited] = [direct, all, limited].map(|pixel| pixel[channel]);
            let rounding = 1e-5 * all;
            assert!(limited >= direct - rounding && limited <= all + rounding, "{direct} {limited} {all}");
            assert!(limited - direct <= 8.0 * limit + rounding, "{direct} {limited} {all}");
            darkened += usize::from(limited < all - rounding);
        }
    }
    assert!(darkened > limited.len() / 10, "{darkened} of {} numbers", 3 * limited.len());

    for limit in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let settings = Settings { clamp_indirect: Some(limit), ..settings() };
        let error = Renderer::new(&driver.device, &scene, &settings, &bvh()).err().unwrap().to_string();
        assert!(error.contains("limit of indirect light"), "{error}");
    }
    driver.finish();
}

#[test]
fn a_scene_builds_only_the_kernels_that_it_needs() {
    let kernels = |scene: &Scene, settings: &Settings| {
        let features = Features::of(scene, &LightTable::new(scene));
        let plans = features.kernels(Traversal::Bvh, settings, 64);
        plans.iter().map(|plan| plan.name).collect::<Vec<_>>()
    };
    let beauty = Settings { features: false, ..settings() };

    let mut lamp_only = still_life(diffuse(0.5));
    lamp_only.environment = None;
    assert_eq!(
        kernels(&lamp_only, &beauty),
        ["generate", "trace_closest_bvh", "shade_diffuse", "trace_shadow_bvh", "resolve", "estimate_error"]
    );
    let sky_and_glass = still_life(Surface::Dielectric { ior: 1.5, alpha: 0.1 });
    assert_eq!(
        kernels(&sky_and_glass, &settings()),
        [
            "generate",
            "trace_closest_bvh",
            "first_hit",
            "shade_miss",
            "shade_diffuse",
            "shade_dielectric",
            "trace_shadow_bvh",
            "resolve",
            "estimate_error"
        ]
    );
    let mut sky_only = still_life(diffuse(0.5));
    sky_only.materials[2].emission = Vec3::ZERO;
    let even = ["generate", "trace_closest_bvh", "shade_miss", "shade_diffuse", "resolve", "estimate_error"];
    assert_eq!(kernels(&sky_only, &beauty), even, "paths find an even sky by themselves");
    let bright_spot = [Vec3::ONE, Vec3::ONE, Vec3::ONE, Vec3::splat(50.0)].repeat(2);
    sky_only.environment = Some(Environment { width: 4, height: 2, texels: bright_spot, rotation_degrees: 0.0 });
    assert!(kernels(&sky_only, &beauty).contains(&"trace_shadow_bvh"));
    let mut measured = still_life(Surface::Measured { brdf: 0 });
    measured.brdfs = vec![Arc::new(Brdf::Nbrdf(networks::made(3.0, 20.0, 0.05)))];
    let names = kernels(&measured, &beauty);
    assert!(names.contains(&"shade_nbrdf") && names.contains(&"shade_diffuse"), "{names:?}");
    let mut unused = lamp_only.clone();
    unused.brdfs = measured.brdfs;
    unused.materials.push(material("nowhere", Surface::Measured { brdf: 0 }));
    assert_eq!(kernels(&unused, &beauty), kernels(&lamp_only, &beauty), "no mesh has the measured material");
    let mut dark = lamp_only.clone();
    dark.materials[2].emission = Vec3::ZERO;
    assert_eq!(
        kernels(&dark, &beauty),
        ["generate", "trace_closest_bvh", "shade_diffuse", "resolve", "estimate_error"]
    );
}

#[test]
fn what_a_renderer_builds_is_what_its_plan_says() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = still_life(conductor(0.8, 0.1));
    let renderer = Renderer::new(&driver.device, &scene, &settings(), &bvh()).unwrap();
    let plans = Features::of(&scene, &LightTable::new(&scene)).kernels(Traversal::Bvh, &settings(), 64);
    assert_eq!(renderer.kernel_names(), plans.iter().map(|plan| plan.name).collect::<Vec<_>>());
    driver.finish();
}

/// Every pixel within `tolerance` of `expected`, relative.
fn assert_radiance(picture: &Picture, expected: f32, tolerance: f32, what: &str) {
    for (index, pixel) in picture.rgb(plane::BEAUTY).unwrap().iter().enumerate() {
        for value in pixel {
            assert!(
                (value - expected).abs() <= tolerance * expected,
                "{what}: pixel {index} is {value}, not {expected}"
            );
        }
    }
}

/// In a furnace of radiance 1 a lossless body cannot be seen.
#[test]
fn lossless_materials_vanish_in_the_white_furnace() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    for (name, surface) in [
        ("diffuse", diffuse(1.0)),
        ("mirror", conductor(1.0, 0.0)),
        ("smooth glass", Surface::Dielectric { ior: 1.5, alpha: 0.0 }),
        ("no glass", Surface::Dielectric { ior: 1.0, alpha: 0.0 }),
    ] {
        let mut scene = scene(
            vec![sphere(Vec3::ZERO, 1.0, 48, 0)],
            vec![material(name, surface)],
            Vec3::new(0.0, 0.0, 4.0),
            Vec3::ZERO,
            [24, 24],
        );
        // Flat shading: interpolated normals lose the light that they turn below the surface.
        scene.meshes[0].normals.clear();
        scene.environment = Some(Environment::constant(Vec3::ONE));
        let settings = Settings { max_depth: 500, ..settings() };
        let picture = render(&driver.device, &scene, &settings, &bvh(), 256);
        let average = mean(&picture);
        assert!((average - 1.0).abs() < 1e-3, "{name}: the mean is {average}");
        let variances = picture.rgb(plane::VARIANCE).unwrap();
        for (pixel, variance) in picture.rgb(plane::BEAUTY).unwrap().iter().zip(&variances) {
            assert!(
                (pixel[0] - 1.0).abs() < 1e-3 + 6.0 * variance[0].sqrt(),
                "{name}: {pixel:?}, variance {variance:?}"
            );
        }
    }
    driver.finish();
}

/// A diffuse plane under a uniform sky shows its albedo.
#[test]
fn a_plane_under_the_sky_shows_its_albedo() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let mut scene = scene(
        vec![floor(1e4, 0)],
        vec![material("plane", diffuse(0.3))],
        Vec3::new(0.0, 10.0, 0.0),
        Vec3::ZERO,
        [16, 16],
    );
    scene.environment = Some(Environment::constant(Vec3::splat(2.0)));
    let picture = render(&driver.device, &scene, &settings(), &bvh(), 256);
    let mean = mean(&picture);
    assert!((mean - 0.6).abs() < 1e-3, "{mean}");
    driver.finish();
}

/// Irradiance of a sphere light of radius r at distance d straight above a plane: π·L·(r/d)².
#[test]
fn a_sphere_light_over_a_plane_gives_its_closed_form() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let (radius, distance, radiance, albedo) = (0.5f32, 2.0f32, 5.0f32, 0.7f32);
    let mut scene = scene(
        vec![floor(10.0, 0), sphere(Vec3::new(0.0, distance, 0.0), radius, 128, 1)],
        vec![material("plane", diffuse(albedo)), lamp(radiance)],
        Vec3::new(3.0, 1.0, 0.0),
        Vec3::ZERO,
        [8, 8],
    );
    scene.camera.vertical_fov_degrees = 0.05;
    let picture = render(&driver.device, &scene, &Settings { max_depth: 2, ..settings() }, &bvh(), 1024);
    let expected = albedo * radiance * (radius / distance).powi(2);
    let mean = mean(&picture);
    assert!((mean / expected - 1.0).abs() < 3e-3, "{mean} against {expected}");
    driver.finish();
}

/// The sun's irradiance falls with the cosine.
#[test]
fn the_sun_shines_with_the_cosine() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let mut scene =
        scene(vec![floor(1.0, 0)], vec![material("plane", diffuse(0.5))], Vec3::new(0.0, 1.0, 0.5), Vec3::ZERO, [8, 8]);
    scene.camera.vertical_fov_degrees = 1.0;
    let direction = Vec3::new(1.0, 1.0, 0.0).normalize();
    scene.sun = Some(Sun { direction, irradiance: Vec3::splat(3.0) });
    let picture = render(&driver.device, &scene, &settings(), &bvh(), 1);
    assert_radiance(&picture, 0.5 / std::f32::consts::PI * 3.0 * direction.y, 1e-5, "sunlit plane");
    driver.finish();
}

/// 10⁸ samples of 0.5 average to exactly 0.5, and one more batch still counts.
#[test]
fn a_long_accumulation_loses_nothing() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let mut scene = scene(
        vec![floor(1.0, 0)],
        vec![material("unseen", diffuse(0.5))],
        Vec3::new(0.0, 1.0, 0.0),
        Vec3::new(0.0, 2.0, 0.0),
        [4, 4],
    );
    scene.environment = Some(Environment::constant(Vec3::splat(0.5)));
    let mut renderer = Renderer::new(&driver.device, &scene, &settings(), &bvh()).unwrap();
    let mut checkpoint = renderer.checkpoint().unwrap();
    checkpoint.samples = 100_000_000;
    for pixel in &mut checkpoint.pixels {
        pixel.sum = [5e7; 3];
        pixel.square = [2.5e7; 3];
    }
    renderer.restore(&checkpoint).unwrap();
    for _ in 0..100 {
        renderer.render_pass(7).unwrap();
    }
    let (picture, metadata) = renderer.picture().unwrap();
    assert_eq!(metadata.spp, 100_000_700);
    assert!(picture.rgb(plane::BEAUTY).unwrap().iter().all(|pixel| *pixel == [0.5; 3]));
    assert!(picture.rgb(plane::VARIANCE).unwrap().iter().flatten().all(|variance| *variance < 1e-15));
    driver.finish();
}

/// SwiftShader, which has no ray query, renders the same picture as lavapipe but for rounding.
#[test]
fn the_second_driver_agrees() {
    let (Some(lavapipe), Some(swiftshader)) = (driver(LAVAPIPE), driver(SWIFTSHADER)) else { return };
    let scene = still_life(conductor(0.9, 0.2));
    let one = render(&lavapipe.device, &scene, &settings(), &bvh(), 4);
    let other = render(&swiftshader.device, &scene, &settings(), &bvh(), 4);
    let (one, other) = (one.rgb(plane::BEAUTY).unwrap(), other.rgb(plane::BEAUTY).unwrap());
    // The same random numbers: all but the few paths that rounding sends elsewhere are the same.
    let same = one.iter().zip(&other).filter(|(a, b)| (0..3).all(|c| (a[c] - b[c]).abs() <= 1e-3 * (a[c] + b[c])));
    let share = same.count() as f64 / one.len() as f64;
    assert!(share > 0.97, "{share} of the pixels agree");
    lavapipe.finish();
    swiftshader.finish();
}

/// At equal samples Sobol' errs clearly less than independent numbers do.
#[test]
fn sobol_errs_less_than_independent_numbers() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = still_life(diffuse(0.5));
    let by = |sampler, seed, samples| {
        let settings = Settings { sampler, seed, features: false, ..settings() };
        render(&driver.device, &scene, &settings, &bvh(), samples)
    };
    let truth = by(Sampler::Sobol, 99, 4096);
    let mse = |sampler| Metrics::of(&by(sampler, 1, 64), &truth, 0.0).unwrap().mse;
    let (sobol, independent) = (mse(Sampler::Sobol), mse(Sampler::Pcg));
    assert!(sobol < 0.7 * independent, "MSE {sobol:e} against {independent:e}");
    driver.finish();
}

/// Half of the light samples of a scene with lamps and a sky are the lamps', and as well spread as if there were no sky.
#[test]
fn a_sky_leaves_the_lamps_their_strata() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let mut lit_by_lamps = still_life(diffuse(0.5));
    lit_by_lamps.environment = None;
    let mut with_sky = lit_by_lamps.clone();
    let mut texels = vec![Vec3::splat(1e-7); 64 * 32];
    texels[700] = Vec3::splat(1e-4);
    with_sky.environment = Some(Environment { width: 64, height: 32, texels, rotation_degrees: 0.0 });
    let by = |scene: &Scene, seed, samples| {
        let settings = Settings { seed, max_depth: 2, features: false, ..settings() };
        render(&driver.device, scene, &settings, &bvh(), samples)
    };
    let mse = |scene: &Scene, samples| Metrics::of(&by(scene, 1, samples), &by(scene, 99, 4096), 0.0).unwrap().mse;
    let (alone, beside) = (mse(&lit_by_lamps, 64), mse(&with_sky, 128));
    println!("MSE {beside:e} against {alone:e}");
    assert!(beside < 1.5 * alone, "MSE {beside:e} against {alone:e}");
    driver.finish();
}

/// Of 2²³ texels a number of 32 bits leaves 9 to ask one whether it stays: of a sky whose texels are hardly above the mean, as their keeping is, that would
/// be seen.
#[test]
fn a_sky_of_very_many_texels_is_as_bright_as_another() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let height = 2048;
    let angle = |row: u32| (f64::from(row) + 0.5) / f64::from(height) * std::f64::consts::PI;
    // 1 in wide bands, and so much in a narrow one that the mean is just below.
    let sums = (0..height).map(angle).fold([0.0; 3], |[all, wide, narrow], theta| {
        let within = |low: f64, high: f64| if (low..high).contains(&theta) { theta.sin() } else { 0.0 };
        [all + theta.sin(), wide + within(0.5, 1.4), narrow + within(0.2, 0.25)]
    });
    let bright = (0.9999 * sums[0] - sums[1]) / sums[2];
    let radiance = |row: u32| match angle(row) {
        theta if (0.5..1.4).contains(&theta) => 1.0,
        theta if (0.2..0.25).contains(&theta) => bright as f32,
        _ => 0.0,
    };
    let floor = || vec![floor(1.0, 0)];
    let grey = || vec![material("floor", diffuse(0.5))];
    let mean_under = |width: u32| {
        let mut scene = scene(floor(), grey(), Vec3::new(0.0, 1.0, 0.5), Vec3::ZERO, [32, 32]);
        let texels = (0..height).flat_map(|row| std::iter::repeat_n(Vec3::splat(radiance(row)), width as usize));
        scene.environment = Some(Environment { width, height, texels: texels.collect(), rotation_degrees: 0.0 });
        let settings = Settings { sampler: Sampler::Pcg, max_depth: 2, features: false, ..settings() };
        mean(&render(&driver.device, &scene, &settings, &bvh(), 4096))
    };
    let (power_of_two, other) = (mean_under(4096), mean_under(4094));
    let difference = power_of_two / other - 1.0;
    println!("{power_of_two} and {other}: {difference:e}");
    assert!(difference.abs() < 1e-4, "{difference:e}");
    driver.finish();
}

/// The estimate of the error falls as the error does, and `--error` ends a render.
#[test]
fn the_error_limit_ends_a_render() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let scene = still_life(diffuse(0.5));
    let independent = Settings { sampler: Sampler::Pcg, ..settings() };
    let mut renderer = Renderer::new(&driver.device, &scene, &independent, &bvh()).unwrap();
    let limits = Limits { samples: 4096, seconds: None, error: Some(0.05) };
    let mut last = f64::INFINITY;
    let stopped = run(&mut renderer, &limits, |_, progress| {
        last = progress.error.unwrap_or(last);
        ControlFlow::Continue(())
    });
    assert_eq!(stopped.unwrap(), Stopped::Error);
    assert!(last <= 0.05);
    driver.finish();
}

fn mean(picture: &Picture) -> f32 {
    let pixels = picture.rgb(plane::BEAUTY).unwrap();
    (pixels.iter().flatten().map(|value| f64::from(*value)).sum::<f64>() / (3 * pixels.len()) as f64) as f32
}

/// Matte, of albedo 0.1 and 0.9 in turn from texel to texel, and 0.5 in coarser ones.
fn checkers(side: u32) -> NeuBrdf {
    // So little gain that the network's output, the feature itself, is the value times a constant.
    let gain = 1e-3;
    let albedos = [0.1, 0.9, 0.5].map(|albedo: f32| (gain * albedo / std::f32::consts::PI).ln_1p());
    let grid = SurfaceGrid::new(side, side).unwrap();
    let index = |point: u32| if point < side * side { (point / side + point % side) % 2 } else { 2 } as u16;
    let sphere = SphereGrid::new(1).unwrap();
    let nothing = SphereTable {
        grid: sphere,
        codebook: Arc::new(Codebook { features: 1, codes: vec![0.0] }),
        indices: vec![0; sphere.point_count()],
        levels: Vec::new(),
    };
    NeuBrdf {
        is_isotropic: true,
        corner_weights: CornerWeights::Bilinear,
        wi: nothing.clone(),
        wo: nothing,
        coarser: Vec::new(),
        surface: Some(SurfaceTable {
            grid,
            codebook: Arc::new(Codebook { features: 1, codes: albedos.into() }),
            indices: (0..grid.point_count() as u32).map(index).collect(),
            frames: SurfaceFrames::default(),
        }),
        sees_half_vector: false,
        layers: vec![
            Dense { inputs: 3, outputs: 1, weights: vec![0.0, 0.0, 1.0], bias: vec![0.0] },
            Dense { inputs: 1, outputs: 3, weights: vec![1.0; 3], bias: vec![0.0; 3] },
        ],
        encoding: Encoding { gain, scale: 1.0, max: 1.0 },
        lobe: SamplingLobe::COSINE,
        provenance: Provenance::default(),
    }
}

/// Each sample of a far pixel is the mean of what points there show; near ones show the checkers.
#[test]
fn distant_texture_does_not_alias() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let model = checkers(32);
    let points = (0..4096).map(|i| DVec2::new((f64::from(i) * 0.7549).fract(), (f64::from(i) * 0.5698).fract()));
    let albedos = points.map(|uv| model.eval_at(Footprint::point(uv), DVec3::Z, DVec3::Z).x * std::f64::consts::PI);
    let mean = albedos.sum::<f64>() / 4096.0;
    let mut ground = floor(40.0, 0);
    ground.uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|uv| 8.0 * uv).to_vec();
    let (eye, ahead) = (Vec3::new(0.3, 2.0, 40.0), Vec3::new(0.3, 2.0, 39.0));
    let surface = Surface::Measured { brdf: 0 };
    let mut scene = scene(vec![ground], vec![material("checkers", surface)], eye, ahead, [48, 36]);
    scene.camera.vertical_fov_degrees = 40.0;
    scene.brdfs = vec![Arc::new(Brdf::NeuBrdf(Box::new(model)))];
    scene.environment = Some(Environment::constant(Vec3::ONE));
    // Directions by the cosine under a sky of 1: a sample is the albedo that was looked up.
    let settings = Settings { max_depth: 2, light_sampling: false, ..settings() };
    let picture = render(&driver.device, &scene, &settings, &bvh(), 1);
    let rows = |rows: std::ops::Range<usize>| -> Vec<f64> {
        let pixels = picture.rgb(plane::BEAUTY).unwrap();
        rows.flat_map(|row| (0..48).map(move |column| row * 48 + column)).map(|at| pixels[at][0].into()).collect()
    };
    // 33 to 49 units away, where a pixel covers more than a hundred texels.
    let far = rows(20..21);
    assert!(far.iter().all(|albedo| (albedo - mean).abs() < 0.01), "{mean} {far:?}");
    let near = rows(33..36);
    let variance = near.iter().map(|albedo| (albedo - 0.5).powi(2)).sum::<f64>() / near.len() as f64;
    // Of checkers, bilinearly: 0.4² / 9.
    assert!(variance > 0.012 && near.iter().all(|albedo| (0.09..=0.91).contains(albedo)), "{variance} {near:?}");
    driver.finish();
}

/// A scene without a material that varies is rendered by kernels whose constants leave all of that out.
#[test]
fn only_scenes_with_materials_that_vary_keep_footprints() {
    let with = |model: NeuBrdf| {
        let mut scene = still_life(Surface::Measured { brdf: 0 });
        scene.brdfs = vec![Arc::new(Brdf::NeuBrdf(Box::new(model)))];
        Features::of(&scene, &LightTable::new(&scene))
    };
    let (varies, constant) = (with(checkers(4)), with(NeuBrdf { surface: None, ..checkers(4) }));
    assert!(varies.footprints && !constant.footprints);
    for (features, value) in [(varies, 1), (constant, 0)] {
        let plans = features.kernels(Traversal::Bvh, &settings(), 64);
        assert!(plans.iter().all(|plan| plan.specialization.contains(&(29, value))));
    }
    assert!(constant.lacks_of(&varies).is_some() && varies.lacks_of(&constant).is_none());
}

/// A scene without holes and maps of normals and roughness is rendered by kernels that do not ask for them.
#[test]
fn only_scenes_with_holes_and_maps_look_for_them() {
    let features = |change: &dyn Fn(&mut Material)| {
        let mut scene = still_life(diffuse(0.5));
        scene.textures = vec![Texture::new("grey", 1, vec![[half::f16::ONE; 4]])];
        scene.materials.iter_mut().for_each(change);
        Features::of(&scene, &LightTable::new(&scene))
    };
    let plain = features(&|_| {});
    let patches = Patches { map: 0, material: 0 };
    for (features, on) in [
        (plain, None),
        (features(&|material| material.opacity.value = 0.5), Some(15)),
        (features(&|material| material.normal_map = Some(0)), Some(16)),
        (features(&|material| material.roughness_map = Some(0)), Some(17)),
        (features(&|material| material.anisotropy_direction_map = Some(0)), Some(37)),
        (features(&|material| material.emission_texture = material.is_emissive().then_some(0)), Some(18)),
        (features(&|material| material.patches = (!material.is_emissive()).then_some(patches)), Some(19)),
    ] {
        let constants = [15, 16, 17, 18, 19, 37].map(|id| (id, u32::from(on == Some(id))));
        let plans = features.kernels(Traversal::RayQuery, &settings(), 64);
        let has = |constant: &(u32, u32)| plans.iter().all(|plan| plan.specialization.contains(constant));
        assert!(constants.iter().all(has), "{constants:?}");
        assert_eq!(plain.lacks_of(&features).is_some(), features != plain);
        assert!(features.lacks_of(&plain).is_none());
    }
}

/// Of those that vary, only scenes with frames have kernels that turn directions into them.
#[test]
fn only_scenes_with_frames_turn_directions() {
    let flat = checkers(4);
    let mut leaning = checkers(4);
    let surface = leaning.surface.as_mut().unwrap();
    let frame = SurfaceFrame { normal: Vec3::new(0.6, 0.0, 0.8).as_dvec3(), ..SurfaceFrame::OWN };
    surface.frames = SurfaceFrames::new(&vec![frame; surface.grid.point_count()]);
    let [flat_shape, leaning_shape] = [&flat, &leaning].map(|model| NeuBrdfShape::of([model], Precision::F32));
    assert!(flat_shape.specialization().contains(&(30, 0)) && leaning_shape.specialization().contains(&(30, 1)));
    assert!(leaning_shape.holds(&flat) && !flat_shape.holds(&leaning));
    // What a kernel of frames does of a model without them is what it does without.
    let words = |model: &NeuBrdf, shape: &NeuBrdfShape| pack_neubrdf(model, shape);
    assert_eq!(words(&flat, &flat_shape), words(&flat, &leaning_shape));
    assert!(words(&flat, &flat_shape).len() < words(&leaning, &leaning_shape).len());
}
