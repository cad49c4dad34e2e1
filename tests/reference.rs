//! The reference against radiance that is known exactly.
#![cfg(feature = "embree")]

mod common;

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{Affine3A, DVec3, Quat, Vec2, Vec3};
use neubrdf::converge::prove_equal;
use neubrdf::image::{Crop, Picture, plane};
use neubrdf::material::{Conductor, Ggx, Reflectance};
use neubrdf::reference::{Ray, Reference, ReferenceOptions, TraceMode};
use neubrdf::scene::{
    Brdf, Camera, Color, Environment, Film, Fresnel, Instance, Lens, Material, Mesh, Scene, Sun, Surface, Texture,
};

const GREY: Vec3 = Vec3::new(0.8, 0.5, 0.2);

fn diffuse(albedo: Vec3) -> Material {
    let surface = Surface::Diffuse { albedo: Color::constant(albedo) };
    Material::new("diffuse", surface)
}

fn light(emission: f32) -> Material {
    Material { emission: Vec3::splat(emission), ..diffuse(Vec3::ZERO) }
}

fn surface(surface: Surface) -> Material {
    Material { surface, ..diffuse(Vec3::ZERO) }
}

/// A mesh of one material, from its corners and triangles.
fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, material: u32) -> Mesh {
    Mesh { name: "mesh".into(), positions, triangles, materials: vec![material], ..Mesh::default() }
}

/// The parallelogram about `centre` with half-axes a and b; its front is along a × b.
fn quad(centre: Vec3, a: Vec3, b: Vec3, material: u32) -> Mesh {
    let corners = vec![centre - a - b, centre + a - b, centre + a + b, centre - a + b];
    mesh(corners, vec![[0, 1, 2], [0, 2, 3]], material)
}

/// A floor at y = 0 that faces up, `half` across.
fn floor(half: f32, material: u32) -> Mesh {
    quad(Vec3::ZERO, Vec3::Z * half, Vec3::X * half, material)
}

/// The cube [−1, 1]³, its faces to the inside or the outside.
fn cube(inside: bool, material: u32) -> Mesh {
    let mut all = mesh(Vec::new(), Vec::new(), material);
    for (normal, a) in [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)] {
        for sign in [-1.0, 1.0] {
            let flip = if inside { -sign } else { sign };
            let face = quad(normal * sign, a, normal.cross(a) * flip, material);
            let first = all.positions.len() as u32;
            all.positions.extend(face.positions);
            all.triangles.extend(face.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
        }
    }
    all
}

/// A sphere of 8·4ⁿ triangles, corners on the sphere, front outside.
fn sphere(centre: Vec3, radius: f32, subdivisions: u32, material: u32) -> Mesh {
    let axes = [Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y];
    let mut faces: Vec<[Vec3; 3]> = (0..4)
        .flat_map(|i| [[axes[i], axes[(i + 1) % 4], Vec3::Z], [axes[(i + 1) % 4], axes[i], Vec3::NEG_Z]])
        .collect();
    for _ in 0..subdivisions {
        faces = faces
            .into_iter()
            .flat_map(|[a, b, c]| {
                let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let triangles = (0..faces.len() as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
    mesh(faces.concat().into_iter().map(|point| centre + radius * point).collect(), triangles, material)
}

fn camera(eye: Vec3, target: Vec3, vertical_fov_degrees: f32) -> Camera {
    let up = if (target - eye).normalize().y.abs() > 0.9 { Vec3::X } else { Vec3::Y };
    Camera { eye, target, up, vertical_fov_degrees, lens: None }
}

/// Every mesh once, where it is; a film of 4 × 4 pixels.
fn scene(camera: Camera, meshes: Vec<Mesh>, materials: Vec<Material>) -> Scene {
    let instances =
        (0..meshes.len() as u32).map(|mesh| Instance { mesh, object_to_world: Affine3A::IDENTITY }).collect();
    Scene {
        camera,
        film: Film { width: 4, height: 4 },
        meshes,
        instances,
        materials,
        textures: Vec::new(),
        brdfs: Vec::new(),
        environment: None,
        sun: None,
    }
}

fn with_sky(scene: Scene, radiance: f32) -> Scene {
    Scene { environment: Some(Environment::constant(Vec3::splat(radiance))), ..scene }
}

fn render(scene: &Scene, spp: u32, max_depth: u32, seed: u64) -> Picture {
    let options = ReferenceOptions { spp, seed, max_depth, crop: None };
    let picture = Reference::new(scene).unwrap().render(&options, |_| (), &AtomicBool::new(false)).unwrap().0;
    let beauty = picture.rgb(plane::BEAUTY).unwrap();
    assert!(beauty.iter().flatten().all(|value| value.is_finite() && *value >= 0.0), "no NaN, nothing negative");
    picture
}

/// Asserts that the mean of all pixels is `expected` within `tolerance` (relative) and five standard errors.
fn assert_mean(picture: &Picture, expected: DVec3, tolerance: f64) {
    let count = picture.pixels() as f64;
    let sum = |names| picture.rgb(names).unwrap().into_iter().map(|pixel| Vec3::from(pixel).as_dvec3()).sum::<DVec3>();
    let mean = sum(plane::BEAUTY) / count;
    let error = sum(plane::VARIANCE) / count / count;
    for channel in 0..3 {
        let (found, wanted, error) = (mean[channel], expected[channel], error[channel].sqrt());
        println!("{found:.6} ± {error:.6}, expected {wanted:.6}");
        assert!(error <= 0.02 * wanted + 1e-9, "noise {error} hides {wanted}");
        assert!((found - wanted).abs() <= 5.0 * error + tolerance * wanted, "{found} ± {error}, expected {wanted}");
    }
}

const ROUNDING: f64 = 1e-5;

#[test]
fn a_diffuse_plane_under_a_uniform_sky_shows_its_albedo() {
    let scene = with_sky(scene(camera(Vec3::Y, Vec3::ZERO, 30.0), vec![floor(10.0, 0)], vec![diffuse(GREY)]), 2.0);
    assert_mean(&render(&scene, 1024, 16, 1), 2.0 * GREY.as_dvec3(), ROUNDING);
}

#[test]
fn the_sky_alone_is_seen_without_noise() {
    let scene = with_sky(scene(camera(Vec3::Y, Vec3::Y * 2.0, 30.0), vec![floor(1.0, 0)], vec![diffuse(GREY)]), 0.3);
    let picture = render(&scene, 8, 1, 1);
    assert_mean(&picture, DVec3::splat(0.3), 1e-7);
    assert!(picture.rgb(plane::VARIANCE).unwrap().iter().flatten().all(|variance| *variance == 0.0));
    assert!(picture.f32(plane::DEPTH).unwrap().iter().all(|depth| depth.is_infinite()));
    assert!(picture.u32(plane::MATERIAL_ID).unwrap().iter().all(|id| *id == plane::NO_ID));
}

/// Whatever does not absorb is invisible in a uniform sky: diffuse white, a mirror, glass, each on a closed solid.
#[test]
fn lossless_solids_vanish_in_a_white_furnace() {
    let mirror = Surface::Conductor { fresnel: Fresnel::Schlick { f0: Color::constant(Vec3::ONE) }, alpha: Vec2::ZERO };
    for (name, material) in [
        ("diffuse", diffuse(Vec3::ONE)),
        ("mirror", surface(mirror)),
        ("glass", surface(Surface::Dielectric { ior: 1.5, alpha: 0.0 })),
        ("denser outside", surface(Surface::Dielectric { ior: 0.7, alpha: 0.0 })),
    ] {
        println!("{name}");
        for solid in [cube(false, 0), sphere(Vec3::ZERO, 1.0, 3, 0)] {
            let view = camera(Vec3::new(2.0, 3.0, 4.0), Vec3::ZERO, 30.0);
            let scene = with_sky(scene(view, vec![solid], vec![material.clone()]), 1.0);
            // Deep, since a path through glass may be reflected inside for long.
            assert_mean(&render(&scene, 4096, 1000, 1), DVec3::ONE, 0.0);
        }
    }
}

/// Inside a closed box of emission e and reflectance ρ, n segments see e·(1 − ρⁿ)/(1 − ρ): emission, depth, light sampling,
/// its weights and the roulette in one.
#[test]
fn a_glowing_box_sums_its_geometric_series() {
    let glow = Material { emission: Vec3::splat(0.7), ..diffuse(GREY) };
    let scene =
        scene(camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.0, -0.5, 0.2), 60.0), vec![cube(true, 0)], vec![glow]);
    for depth in [1, 2, 3, 5, 12, 64] {
        let series = |albedo: f64| 0.7 * (1.0 - albedo.powi(depth)) / (1.0 - albedo);
        println!("depth {depth}");
        assert_mean(&render(&scene, 1024, depth as u32, 1), GREY.as_dvec3().map(series), ROUNDING);
    }
}

/// The irradiance under the middle of a sphere of radius R at distance d is πL(R/d)².
#[test]
fn a_sphere_light_over_a_plane_gives_its_irradiance() {
    let lamp = sphere(Vec3::Y * 3.0, 1.0, 6, 1);
    let view = camera(Vec3::new(1.0, 0.5, 0.0), Vec3::ZERO, 0.05);
    let scene = scene(view, vec![floor(5.0, 0), lamp], vec![diffuse(GREY), light(10.0)]);
    // The corners lie on the sphere: the triangles between are a little inside.
    assert_mean(&render(&scene, 4096, 2, 1), GREY.as_dvec3() * 10.0 / 9.0, 1e-3);
}

/// The form factor from a point to a parallel square of half-width a at distance 1, centred above it (Howell, B-3, four
/// quarters).
fn square_form_factor(a: f64) -> f64 {
    let root = (1.0 + a * a).sqrt();
    4.0 / (2.0 * PI) * 2.0 * (a / root) * (a / root).atan()
}

#[test]
fn a_square_light_over_a_floor_gives_its_form_factor() {
    for (half, both_sides) in [(0.05, false), (0.5, true), (2.0, false)] {
        let lamp = quad(Vec3::Y, Vec3::X * half, Vec3::Z * half, 1);
        let glow = Material { emits_both_sides: both_sides, ..light(5.0) };
        let view = camera(Vec3::new(half + 1.0, 0.5, 0.0), Vec3::ZERO, 0.02);
        let scene = scene(view, vec![floor(10.0, 0), lamp], vec![diffuse(GREY), glow]);
        let expected = GREY.as_dvec3() * 5.0 * square_form_factor(half.into());
        // The lamp is black: more depth adds nothing.
        assert_mean(&render(&scene, 4096, 2, 1), expected, 1e-4);
        assert_mean(&render(&scene, 4096, 8, 2), expected, 1e-4);
    }
}

#[test]
fn a_light_shines_from_its_front_only() {
    let lamp = quad(Vec3::Y, Vec3::Z, Vec3::X, 1);
    let view = camera(Vec3::new(2.0, 0.5, 0.0), Vec3::ZERO, 0.02);
    let scene = scene(view, vec![floor(10.0, 0), lamp], vec![diffuse(GREY), light(5.0)]);
    assert_mean(&render(&scene, 64, 8, 1), DVec3::ZERO, 0.0);
}

#[test]
fn the_sun_gives_its_irradiance_times_the_cosine() {
    let direction = Vec3::new(1.0, 2.0, -0.5).normalize();
    let scene = Scene {
        sun: Some(Sun { direction, irradiance: Vec3::new(3.0, 2.0, 1.0) }),
        ..scene(camera(Vec3::Y, Vec3::ZERO, 30.0), vec![floor(10.0, 0)], vec![diffuse(GREY)])
    };
    let expected = GREY.as_dvec3() / PI * DVec3::new(3.0, 2.0, 1.0) * f64::from(direction.y);
    assert_mean(&render(&scene, 4, 16, 1), expected, ROUNDING);
}

/// A sky of one bright texel among dim ones, turned: the floor's irradiance is Σ L·∫cos, by quadrature over each texel.
#[test]
fn a_contrasty_sky_gives_its_irradiance() {
    let (width, height) = (16, 8);
    let mut texels: Vec<Vec3> = (0..width * height).map(|i| Vec3::splat(0.01 * (i % 5) as f32)).collect();
    texels[(2 * width + 5) as usize] = Vec3::new(1000.0, 500.0, 100.0);
    let sky = Environment { width, height, texels, rotation_degrees: 77.0 };
    let mut irradiance = DVec3::ZERO;
    for row in 0..height / 2 {
        let edge = |row: u32| (PI * f64::from(row) / f64::from(height)).sin();
        // ∫ cos θ dω over a texel = Δφ/2 · (sin²θ₁ − sin²θ₀).
        let projected = PI / f64::from(width) * (edge(row + 1).powi(2) - edge(row).powi(2));
        for column in 0..width {
            irradiance += projected * sky.texels[(row * width + column) as usize].as_dvec3();
        }
    }
    let scene = Scene {
        environment: Some(sky),
        ..scene(camera(Vec3::Y, Vec3::ZERO, 30.0), vec![floor(10.0, 0)], vec![diffuse(GREY)])
    };
    assert_mean(&render(&scene, 1024, 4, 1), GREY.as_dvec3() / PI * irradiance, ROUNDING);
}

/// A rough metal under a square light, both strategies of which matter, against quadrature over the light.
#[test]
fn a_rough_metal_reflects_a_square_light() {
    let (eye, half) = (DVec3::new(-0.8, 1.0, 0.1), 0.4);
    let lamp_centre = DVec3::new(0.6, 1.0, 0.0);
    for alpha in [Vec2::splat(0.05), Vec2::splat(0.3), Vec2::new(0.1, 0.6)] {
        let metal = surface(Surface::Conductor { fresnel: Fresnel::Schlick { f0: Color::constant(GREY) }, alpha });
        // With texture coordinates, so that the anisotropy has a direction: u along x.
        let corners = [Vec2::new(0.0, 1.0), Vec2::ZERO, Vec2::new(1.0, 0.0), Vec2::ONE];
        let ground = Mesh { uvs: corners.to_vec(), ..floor(10.0, 0) };
        let lamp = quad(lamp_centre.as_vec3(), Vec3::X * half as f32, Vec3::Z * half as f32, 1);
        let scene = scene(camera(eye.as_vec3(), Vec3::ZERO, 0.01), vec![ground, lamp], vec![metal, light(5.0)]);

        let bsdf = Conductor { reflectance: Reflectance::Schlick { f0: GREY.as_dvec3() }, roughness: Ggx::new(alpha) };
        // World (x, y, z) is local (x, −z, y) there: tangent x, normal y, bitangent y × x = −z.
        let local = |world: DVec3| DVec3::new(world.x, -world.z, world.y).normalize();
        let (steps, mut radiance) = (400, DVec3::ZERO);
        for i in 0..steps {
            for j in 0..steps {
                let across = |index: i32| ((f64::from(index) + 0.5) / f64::from(steps) * 2.0 - 1.0) * half;
                let to_light = lamp_centre + DVec3::new(across(i), 0.0, across(j));
                let wi = local(to_light);
                let area = (2.0 * half / f64::from(steps)).powi(2);
                let solid_angle = area * wi.z / to_light.length_squared();
                radiance += 5.0 * bsdf.eval(local(eye), wi) * wi.z * solid_angle;
            }
        }
        println!("alpha {alpha}");
        assert_mean(&render(&scene, 8192, 2, 1), radiance, 1e-3);
    }
}

/// A coat over a white base loses nothing either, smooth or rough: what the base cannot send out comes back.
#[test]
fn a_coated_plane_closes_the_furnace() {
    for alpha in [0.0, 0.3] {
        let coat = surface(Surface::Coated { albedo: Color::constant(Vec3::ONE), ior: 1.5, alpha });
        let view = camera(Vec3::new(1.0, 1.0, 0.0), Vec3::ZERO, 1.0);
        let scene = with_sky(scene(view, vec![floor(10.0, 0)], vec![coat]), 1.0);
        println!("alpha {alpha}");
        assert_mean(&render(&scene, 8192, 4, 1), DVec3::ONE, 2e-3);
    }
}

/// A wall, left half black and right half shining, is sharp where the lens is in focus and blurred elsewhere.
#[test]
fn a_lens_is_sharp_at_its_focus_only() {
    let half = |x: f32, material| quad(Vec3::new(x, 0.0, 0.0), Vec3::X, Vec3::Y * 2.0, material);
    let view = camera(Vec3::Z * 2.0, Vec3::ZERO, 30.0);
    for (focus_distance, is_sharp) in [(2.0, true), (1.0, false)] {
        let lens = Some(Lens { radius: 0.5, focus_distance });
        let halves = vec![half(-1.0, 0), half(1.0, 1)];
        let scene = scene(Camera { lens, ..view.clone() }, halves, vec![diffuse(Vec3::ZERO), light(1.0)]);
        let beauty = render(&scene, 256, 1, 1).rgb(plane::BEAUTY).unwrap();
        let edge = [beauty[4 + 1][0], beauty[4 + 2][0]];
        assert_eq!(edge == [0.0, 1.0], is_sharp, "{edge:?}");
        // The blur is symmetric.
        assert!((edge[0] + edge[1] - 1.0).abs() < 0.2, "{edge:?}");
    }
}

#[test]
fn a_texture_multiplies_the_colour() {
    let texels = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [1.0; 4]];
    let texels = texels.map(|texel: [f32; 4]| texel.map(half::f16::from_f32)).to_vec();
    let texture = Texture::new("four", 2, texels);
    let albedo = Color { value: Vec3::splat(0.5), texture: Some(0) };
    // The middle of the upper right texel, all over.
    let ground = Mesh { uvs: vec![Vec2::new(0.75, 0.75); 4], ..floor(10.0, 0) };
    let view = camera(Vec3::Y, Vec3::ZERO, 30.0);
    let scene =
        Scene { textures: vec![texture], ..scene(view, vec![ground], vec![surface(Surface::Diffuse { albedo })]) };
    let picture = render(&with_sky(scene, 1.0), 1024, 4, 1);
    assert_mean(&picture, DVec3::new(0.0, 0.5, 0.0), ROUNDING);
    assert_eq!(picture.rgb(plane::ALBEDO).unwrap()[0], [0.0, 0.5, 0.0]);
}

/// A slab of glass seen head-on, sky above only: all that comes back is 2R/(1 + R), R = ((n−1)/(n+1))².
#[test]
fn a_slab_of_glass_reflects_what_fresnel_says() {
    let slab = Mesh {
        positions: cube(false, 0).positions.iter().map(|p| *p * Vec3::new(1e3, 1.0, 1e3)).collect(),
        ..cube(false, 0)
    };
    let glass = surface(Surface::Dielectric { ior: 1.5, alpha: 0.0 });
    let sky = Environment { width: 1, height: 2, texels: vec![Vec3::ONE, Vec3::ZERO], rotation_degrees: 0.0 };
    let scene =
        Scene { environment: Some(sky), ..scene(camera(Vec3::Y * 4.0, Vec3::ZERO, 0.1), vec![slab], vec![glass]) };
    let reflectance = 0.2_f64.powi(2);
    let expected = 2.0 * reflectance / (1.0 + reflectance);
    assert_mean(&render(&scene, 65536, 64, 1), DVec3::splat(expected), 1e-4);
}

/// A small room with a lamp, a block and a mirror ball.
fn room() -> Scene {
    let mirror = Surface::Conductor {
        fresnel: Fresnel::Schlick { f0: Color::constant(Vec3::splat(0.9)) },
        alpha: Vec2::splat(0.1),
    };
    let mut block = cube(false, 2);
    block.positions.iter_mut().for_each(|p| *p = *p * 0.3 + Vec3::new(-0.4, -0.7, -0.2));
    let room = scene(
        camera(Vec3::new(0.0, 0.0, 0.95), Vec3::NEG_Z, 80.0),
        vec![
            cube(true, 0),
            quad(Vec3::Y * 0.99, Vec3::X * 0.3, Vec3::Z * 0.3, 1),
            block,
            sphere(Vec3::new(0.5, -0.6, 0.0), 0.4, 4, 3),
        ],
        vec![diffuse(Vec3::new(0.6, 0.7, 0.8)), light(8.0), diffuse(GREY), surface(mirror)],
    );
    Scene { film: Film { width: 32, height: 24 }, ..room }
}

/// The same with networks on the walls, the block and the sphere.
fn neural_room() -> Scene {
    let neubrdfs = common::networks::neubrdfs();
    let brdfs = vec![
        neubrdfs[2].1.clone(),
        Arc::new(Brdf::Nbrdf(common::networks::made(0.2, 0.3, 0.2))),
        neubrdfs[0].1.clone(),
    ];
    let mut room = Scene { brdfs, ..room() };
    for (brdf, material) in [0, 2, 3].into_iter().enumerate() {
        room.materials[material] = surface(Surface::Measured { brdf: brdf as u32 });
    }
    room
}

/// Nor do the paths that share an evaluation of a network: they are others by other threads and crops.
#[test]
fn the_seed_decides_not_the_threads_nor_the_crop() {
    let mut porous_room = room();
    porous_room.materials.iter_mut().for_each(|material| material.opacity.value = 0.5);
    for scene in [room(), neural_room(), porous_room] {
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let single = pool(1).install(|| render(&scene, 8, 8, 7));
        assert_eq!(single, pool(3).install(|| render(&scene, 8, 8, 7)));
        assert_ne!(single, render(&scene, 8, 8, 8));

        let crop = Crop { x: 5, y: 7, width: 11, height: 3 };
        let options = ReferenceOptions { spp: 8, seed: 7, max_depth: 8, crop: Some(crop) };
        let reference = Reference::new(&scene).unwrap();
        let (part, statistics) = reference.render(&options, |_| (), &AtomicBool::new(false)).unwrap();
        assert_eq!((statistics.samples, statistics.least_spp), (8 * 33, 8));
        for row in 0..3 {
            let [of_part, of_whole] = [row * 11..(row + 1) * 11, (row + 7) * 32 + 5..(row + 7) * 32 + 16];
            assert_eq!(
                part.rgb(plane::BEAUTY).unwrap()[of_part.clone()],
                single.rgb(plane::BEAUTY).unwrap()[of_whole.clone()]
            );
            assert_eq!(
                part.f32(plane::DEPTH).unwrap()[of_part.clone()],
                single.f32(plane::DEPTH).unwrap()[of_whole.clone()]
            );
            for ids in [plane::INSTANCE_ID, plane::PRIMITIVE_ID, plane::MATERIAL_ID] {
                assert_eq!(part.u32(ids).unwrap()[of_part.clone()], single.u32(ids).unwrap()[of_whole.clone()]);
            }
        }
        let outside = ReferenceOptions { crop: Some(Crop { x: 30, ..crop }), ..options };
        assert!(reference.render(&outside, |_| (), &AtomicBool::new(false)).is_err());
    }
}

#[test]
fn seeds_agree_and_their_variance_is_honest() {
    let scene = room();
    let comparison =
        prove_equal("reference-seeds", &render(&scene, 64, 8, 1), &render(&scene, 64, 8, 2), 1e-3).unwrap();
    println!("{comparison}");
    let rms = comparison.z_test.unwrap().z_rms;
    assert!((0.8..1.1).contains(&rms), "{rms}");
}

/// Shrunk, turned, mirrored and placed by a transform, or by its corners: the same picture.
#[test]
fn a_transform_is_as_good_as_moved_corners() {
    let transform = Affine3A::from_scale_rotation_translation(
        Vec3::new(-0.5, 0.8, 0.6),
        Quat::from_rotation_y(0.7),
        Vec3::new(0.1, -0.3, -0.2),
    );
    let mut placed = room();
    placed.meshes[3] = Mesh { name: "ball".into(), ..sphere(Vec3::ZERO, 0.8, 4, 3) };
    placed.instances[3].object_to_world = transform;
    let mut moved = placed.clone();
    moved.instances[3].object_to_world = Affine3A::IDENTITY;
    for position in &mut moved.meshes[3].positions {
        *position = transform.transform_point3(*position);
    }
    // The mirroring turns the triangles about; opaque surfaces do not mind.
    prove_equal("reference-transform", &render(&placed, 64, 8, 1), &render(&moved, 64, 8, 2), 1e-3).unwrap();

    // An emitter does: its front stays its front.
    placed.materials[3] = light(1.0);
    moved.materials[3] = light(1.0);
    moved.meshes[3].triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    prove_equal("reference-emitter", &render(&placed, 64, 8, 1), &render(&moved, 64, 8, 2), 1e-3).unwrap();
}

#[test]
fn what_is_seen_first_is_in_its_planes() {
    let scene = room();
    let picture = render(&scene, 4, 2, 1);
    // In the upper middle, beyond the lamp, is the ceiling; at the ball, the ball.
    let ball = 19 * 32 + 22;
    assert_eq!(picture.u32(plane::MATERIAL_ID).unwrap()[ball], 3);
    assert_eq!(picture.u32(plane::INSTANCE_ID).unwrap()[ball], 3);
    assert!(picture.u32(plane::PRIMITIVE_ID).unwrap()[ball] < 8 * 256);
    assert!((0.5..1.0).contains(&picture.f32(plane::DEPTH).unwrap()[ball]));
    assert!((picture.rgb(plane::ALBEDO).unwrap()[ball][0] - 0.9).abs() < 1e-6);
    let normal = Vec3::from(picture.rgb(plane::NORMAL).unwrap()[ball]);
    assert!(normal.z > 0.5 && normal.length() <= 1.0 + 1e-6, "{normal}");
    assert!(picture.u32(plane::SAMPLES).unwrap().iter().all(|samples| *samples == 4));
}

#[test]
fn a_stop_keeps_what_there_is() {
    let scene = room();
    let reference = Reference::new(&scene).unwrap();
    let stop = AtomicBool::new(false);
    let options = ReferenceOptions { spp: 1 << 20, ..ReferenceOptions::default() };
    let progress = |part: f64| stop.store(part > 3e-6, std::sync::atomic::Ordering::Relaxed);
    let (picture, statistics) = reference.render(&options, progress, &stop).unwrap();
    assert!((1..100).contains(&statistics.least_spp), "{statistics:?}");
    assert_eq!(picture.u32(plane::SAMPLES).unwrap().iter().min(), Some(&statistics.least_spp));
    assert_eq!(reference.metadata(&options, &statistics).spp, u64::from(statistics.least_spp));
}

#[test]
fn empty_and_degenerate_scenes_render() {
    let flat = mesh(vec![Vec3::ZERO; 3], vec![[0, 1, 2]], 0);
    let empty = mesh(Vec::new(), Vec::new(), 0);
    let scene = with_sky(scene(camera(Vec3::Z, Vec3::ZERO, 30.0), vec![flat, empty], vec![light(1.0)]), 0.5);
    assert_mean(&render(&scene, 4, 8, 1), DVec3::splat(0.5), 1e-6);
}

#[test]
fn single_rays_and_streams_meet_the_same_triangles() {
    let scene = room();
    let reference = Reference::new(&scene).unwrap();
    let rays: Vec<Ray> = (0..5000)
        .map(|i| {
            let (a, b) = (i as f32 * 2.399, 1.0 - 2.0 * (i as f32 + 0.5) / 5000.0);
            let direction = Vec3::new((1.0 - b * b).sqrt() * a.cos(), b, (1.0 - b * b).sqrt() * a.sin());
            Ray { origin: Vec3::ZERO, direction, t_min: 0.0, t_max: f32::INFINITY }
        })
        .collect();
    let trace = |mode| {
        let mut hits = vec![None; rays.len()];
        reference.accelerator().trace_rays(&rays, mode, &mut hits);
        hits
    };
    let single = trace(TraceMode::Single);
    assert!(single.iter().all(|hit| hit.is_some()), "the room is closed");
    for mode in [TraceMode::CoherentStream, TraceMode::IncoherentStream] {
        let stream = trace(mode);
        let differing = single.iter().zip(&stream).filter(|(a, b)| {
            let (Some(a), Some(b)) = (a, b) else { return true };
            (a.t - b.t).abs() > 1e-5 * a.t
        });
        assert_eq!(differing.count(), 0, "{mode:?}");
    }
}

/// Every scene that ships: finite, and of the same radiance by two seeds.
#[test]
fn shipped_scenes_render() {
    for path in common::shipped_scenes() {
        let name = path.parent().and_then(Path::file_name).unwrap().to_string_lossy();
        let (mut scene, _) = Scene::load(&path).unwrap();
        scene.film = Film { width: 40, height: 40 };
        let [first, second] = [1, 2].map(|seed| render(&scene, 32, 8, seed));
        let comparison = prove_equal(&format!("reference-{name}"), &first, &second, 1e-4).unwrap();
        println!("{name}\n{comparison}");
    }
}
