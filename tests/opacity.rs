//! Holes: a surface is met by as many rays as its opacity says, whatever finds it, and what is behind it shows.

mod common;

use common::*;
use glam::Vec3;
use half::f16;
use neubrdf::image::{Picture, plane};
use neubrdf::render::{Options, Sampler, Settings, Traversal};
use neubrdf::scene::{Environment, Material, Mesh, Opacity, Scene, Sun, Texture};

/// A texture of one number a texel, from the upper left.
fn texture(width: u32, numbers: &[f32]) -> Texture {
    let texels = numbers.iter().map(|number| [*number, *number, *number, 1.0].map(f16::from_f32)).collect();
    Texture::new("opacity", width, texels)
}

fn with_holes(material: Material, value: f32, texture: Option<u32>) -> Material {
    Material { opacity: Opacity { value, texture }, ..material }
}

/// Black sheets one behind the other under a sky of radiance 1, as large as the picture and larger.
fn black_sheets(opacities: &[f32]) -> Scene {
    let meshes = (0..opacities.len()).map(|index| sheet(-(index as f32), 3.0, index as u32)).collect();
    let black = |opacity: &f32| with_holes(material("sheet", diffuse(0.0)), *opacity, None);
    let materials = opacities.iter().map(black).collect();
    let scene = scene(meshes, materials, Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, [48, 32]);
    Scene { environment: Some(Environment::constant(Vec3::ONE)), ..scene }
}

fn settings(samples_lights: bool) -> Settings {
    Settings {
        max_depth: 4,
        sampler: Sampler::Pcg,
        features: false,
        light_sampling: samples_lights,
        ..Settings::default()
    }
}

/// The picture by each of the driver's traversals, which are to agree to the last bit.
fn picture(driver: &Driver, scene: &Scene, samples: u32) -> Picture {
    let by = |traversal| {
        let options = Options { traversal: Some(traversal), pool_paths: None };
        render(&driver.device, scene, &settings(true), &options, samples)
    };
    let picture = by(Traversal::Bvh);
    if driver.device.has_ray_query() {
        assert_eq!(bits(&picture), bits(&by(Traversal::RayQuery)), "the traversals see other holes");
    }
    picture
}

fn mean(picture: &Picture) -> f64 {
    let pixels = picture.rgb(plane::BEAUTY).unwrap();
    pixels.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / pixels.len() as f64
}

fn on_both(check: impl Fn(&Driver)) {
    [LAVAPIPE, SWIFTSHADER].into_iter().filter_map(driver).for_each(|driver| {
        check(&driver);
        driver.finish();
    });
}

#[test]
fn a_sheet_lets_through_what_its_opacity_leaves() {
    on_both(|driver| {
        for opacities in [&[0.3][..], &[0.5, 0.2], &[0.0], &[1.0, 0.5]] {
            let expected: f64 = opacities.iter().map(|opacity| 1.0 - f64::from(*opacity)).product();
            let samples = 16;
            let found = mean(&picture(driver, &black_sheets(opacities), samples));
            // Each sample is 0 or 1.
            let deviation = (expected * (1.0 - expected) / (48.0 * 32.0 * f64::from(samples))).sqrt();
            assert!((found - expected).abs() <= 4.0 * deviation, "{opacities:?}: {found}, not {expected}");
        }
    });
}

/// Of a sheet whose left half is cut away, and the middle of whose right half is there by a quarter.
#[test]
fn a_texture_says_where_the_holes_are() {
    on_both(|driver| {
        let mut scene = black_sheets(&[1.0]);
        let row = [0.0, 0.0, 0.0, 0.0, 1.0, 0.25, 0.25, 1.0];
        scene.textures = vec![texture(8, &row)];
        scene.materials[0].opacity.texture = Some(0);
        scene.meshes[0] = sheet(0.0, 1.0, 0);
        let picture = picture(driver, &scene, 64);
        let pixels = picture.rgb(plane::BEAUTY).unwrap();
        let plane = |x: f32| 24.0 + x * 16.0 / (4.0 * 20f32.to_radians().tan());
        // Between the centres of two texels of the same number the look-up is that number.
        let over = |from: f32, to: f32| {
            let columns = (plane(from).ceil() as usize)..(plane(to).floor() as usize);
            let values: Vec<f32> =
                (12..20).flat_map(|y| columns.clone().map(move |x| 48 * y + x)).map(|i| pixels[i][1]).collect();
            assert!(values.len() >= 8);
            values
        };
        assert!(over(-0.8, -0.2).iter().all(|value| *value == 1.0));
        let quarter = over(0.4, 0.6);
        let mean = quarter.iter().sum::<f32>() / quarter.len() as f32;
        assert!((mean - 0.75).abs() < 4.0 * (0.1875 / (64.0 * quarter.len() as f32)).sqrt(), "{mean}");
    });
}

/// A floor under a sheet in the sun gets what the sheet leaves, wherever the sun is.
#[test]
fn shadows_have_the_holes_of_what_casts_them() {
    on_both(|driver| {
        let roof =
            Mesh { positions: floor(20.0, 1).positions.iter().map(|p| *p + Vec3::Y).collect(), ..floor(20.0, 1) };
        let materials = vec![material("floor", diffuse(0.5)), with_holes(material("roof", diffuse(0.0)), 0.4, None)];
        let mut scene = scene(vec![floor(20.0, 0), roof], materials, Vec3::new(0.0, 0.5, 3.0), Vec3::ZERO, [32, 32]);
        scene.camera.vertical_fov_degrees = 10.0;
        scene.sun = Some(Sun { direction: Vec3::new(0.6, 0.8, 0.0), irradiance: Vec3::splat(5.0) });
        // Under a black roof there is no other light.
        let expected = 0.6 * 5.0 * 0.8 * 0.5 / std::f64::consts::PI;
        let found = mean(&picture(driver, &scene, 64));
        let deviation = expected * (0.4 / 0.6 / (32.0 * 32.0 * 64.0f64)).sqrt();
        assert!((found - expected).abs() < 4.0 * deviation, "{found}, not {expected} ± {deviation}");
    });
}

/// Cards with leaves on them that are turned every which way, over a floor, and a pane that is half there: what Embree sees, by a filter of its
/// hits with other random numbers.
#[cfg(feature = "embree")]
#[test]
fn foliage_agrees_with_embree() {
    use neubrdf::converge::prove_equal;
    use neubrdf::reference::{Reference, ReferenceOptions};
    let mut scene = foliage();
    let reference = Reference::new(&scene).unwrap();
    let options = ReferenceOptions { spp: 256, seed: 1, max_depth: 4, crop: None };
    let expected = reference.render(&options, |_| {}, &std::sync::atomic::AtomicBool::new(false)).unwrap().0;
    on_both(|driver| {
        let picture = picture(driver, &scene, 64);
        let name = format!("opacity-foliage-{}", driver.device.name());
        prove_equal(&name, &picture, &expected, 1e-3).unwrap();
    });
    // And it would be seen if the holes were not there.
    scene.materials.iter_mut().for_each(|material| material.opacity = Opacity::WHOLE);
    if let Some(driver) = driver(LAVAPIPE) {
        assert!(prove_equal("opacity-whole", &picture(&driver, &scene, 64), &expected, 1e-3).is_err());
    }
}

#[cfg(feature = "embree")]
fn foliage() -> Scene {
    use glam::{Affine3A, Quat};
    use neubrdf::scene::Instance;
    let leaf = |x: f32, y: f32| if (x * x + y * y).sqrt() < 0.8 { 1.0 } else { 0.0 };
    let center = |i: u32| (i as f32 + 0.5) / 8.0 - 1.0;
    let numbers: Vec<f32> = (0..256).map(|i| leaf(center(i % 16), center(i / 16))).collect();
    let card = Mesh { positions: sheet(0.0, 0.5, 1).positions, ..sheet(0.0, 0.5, 1) };
    let materials = vec![
        material("floor", diffuse(0.6)),
        with_holes(material("leaf", conductor(0.7, 0.3)), 0.9, Some(0)),
        with_holes(material("pane", diffuse(0.4)), 0.5, None),
    ];
    let mut scene = scene(
        vec![floor(4.0, 0), card, sheet(1.2, 0.6, 2)],
        materials,
        Vec3::new(0.0, 1.5, 5.0),
        Vec3::new(0.0, 0.6, 0.0),
        [40, 30],
    );
    let turned = |i: u32| {
        let at = Vec3::new((i % 4) as f32 - 1.5, 0.4 + 0.5 * (i / 4) as f32, -0.3 * (i % 3) as f32);
        let turn = Quat::from_axis_angle(Vec3::new(1.0, i as f32, 0.5).normalize(), 0.7 * i as f32);
        Instance { mesh: 1, object_to_world: Affine3A::from_rotation_translation(turn, at) }
    };
    scene.instances.remove(1);
    scene.instances.extend((0..12).map(turned));
    scene.textures = vec![texture(16, &numbers)];
    scene.environment = Some(Environment::constant(Vec3::new(0.4, 0.5, 0.7)));
    scene.sun = Some(Sun { direction: Vec3::new(0.5, 0.7, 0.5).normalize(), irradiance: Vec3::splat(2.0) });
    scene
}
