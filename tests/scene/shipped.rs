//! The scenes and materials that are shipped.

use super::*;

#[path = "../../examples/make_scenes/main.rs"]
mod make_scenes;

const SHIPPED: [&str; 9] =
    ["cornell", "preview", "many_lights", "furnace", "sky", "still_life", "mosaic", "foliage", "neural"];

fn shipped(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.toml");
    let (scene, warnings) = Scene::load(path).unwrap_or_else(|error| panic!("{error}"));
    assert!(warnings.is_empty(), "{warnings:?}");
    scene
}

#[test]
fn shipped_scenes_are_what_their_generator_makes() {
    let made = tempfile::tempdir().unwrap();
    make_scenes::write_all(made.path()).unwrap();
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut total = 0;
    for name in SHIPPED {
        let mut files = 0;
        for entry in fs::read_dir(made.path().join(name)).unwrap() {
            let file = entry.unwrap().file_name();
            let bytes = fs::read(made.path().join(name).join(&file)).unwrap();
            assert!(fs::read(shipped.join(name).join(&file)).unwrap() == bytes, "{name}/{file:?} differs");
            total += bytes.len();
            files += 1;
        }
        // Networks are trained, not made.
        let is_made = |path: &Path| path.extension().is_none_or(|extension| extension != "neubrdf");
        let there = fs::read_dir(shipped.join(name)).unwrap().filter(|entry| is_made(&entry.as_ref().unwrap().path()));
        assert_eq!(there.count(), files, "{name} has a file of unknown origin");
    }
    assert!(total < 3 << 20, "{total} bytes");
}

#[test]
fn shipped_scenes_cover_every_feature() {
    let scenes = SHIPPED.map(shipped);
    let any = |has: &dyn Fn(&Scene) -> bool| scenes.iter().any(has);
    let surface = |is: &dyn Fn(&Surface) -> bool| any(&|scene| scene.materials.iter().any(|m| is(&m.surface)));
    assert!(surface(&|s| matches!(s, Surface::Diffuse { albedo } if albedo.texture.is_some())));
    assert!(surface(&|s| matches!(s, Surface::Conductor { alpha, .. } if *alpha == Vec2::ZERO)));
    assert!(surface(&|s| matches!(s, Surface::Conductor { alpha, .. } if alpha.x != alpha.y)));
    assert!(surface(&|s| matches!(s, Surface::Conductor { fresnel: Fresnel::Complex { .. }, .. })));
    assert!(surface(&|s| matches!(s, Surface::Dielectric { alpha, .. } if *alpha == 0.0)));
    assert!(surface(&|s| matches!(s, Surface::Dielectric { alpha, .. } if *alpha > 0.0)));
    assert!(surface(&|s| matches!(s, Surface::Coated { alpha, .. } if *alpha == 0.0)));
    assert!(surface(&|s| matches!(s, Surface::Coated { alpha, .. } if *alpha > 0.0)));
    assert!(any(&|scene| scene.materials.iter().any(|material| material.opacity.texture.is_some())));
    assert!(any(&|scene| scene.materials.iter().any(|material| material.normal_map.is_some())));
    assert!(any(&|scene| scene.environment.as_ref().is_some_and(|sky| sky.width == 256)));
    assert!(any(&|scene| scene.sun.is_some()));
    assert!(any(&|scene| scene.camera.lens.is_some()));
    assert!(any(&|scene| scene.instances.len() > scene.meshes.len()));
    assert!(any(&|scene| scene.instances.iter().any(|at| at.object_to_world.matrix3.determinant() < 0.0)));
    for scene in &scenes {
        assert!(scene.film.width <= 512 && scene.film.height <= 512);
        for mesh in &scene.meshes {
            assert!(mesh.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5));
        }
    }
}

/// Volume that the triangles of a material enclose: positive where they face outwards.
fn volume(scene: &Scene, material: &str) -> f32 {
    let mut volume = 0.0;
    for mesh in &scene.meshes {
        for triangle in 0..mesh.triangles.len() {
            if scene.materials[mesh.material(triangle) as usize].name == material {
                let [a, b, c] = mesh.corners(triangle);
                volume += a.dot(b.cross(c)) / 6.0;
            }
        }
    }
    volume
}

#[test]
fn closed_objects_of_the_shipped_scenes_face_outwards() {
    let ball = 4.0 / 3.0 * std::f32::consts::PI;
    for (scene, material, expected) in [
        ("preview", "ball", ball),
        ("preview", "ring", 2.0 * std::f32::consts::PI.powi(2) * 0.62 * 0.01),
        ("many_lights", "wall", -6.0 * 6.0 * 3.0),
        ("furnace", "diffuse", ball),
        ("furnace", "mirror", ball),
        ("furnace", "glass", ball),
        ("furnace", "coated", ball),
        ("sky", "glass", ball * 0.216),
        ("sky", "clay", 2.0 * std::f32::consts::PI.powi(2) * 0.7 * 0.0625),
        ("still_life", "frosted", ball * 0.216),
        ("still_life", "mirror", ball * 0.015625),
    ] {
        let found = volume(&shipped(scene), material);
        assert!((found / expected - 1.0).abs() < 0.04, "{scene}, {material}: {found}, expected {expected}");
    }
    // Facets and shading normals agree in sign.
    for name in SHIPPED {
        for mesh in shipped(name).meshes {
            for (corners, triangle) in triangles(&mesh).iter().zip(&mesh.triangles) {
                let facet = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
                assert!(triangle.iter().all(|&v| mesh.normals.get(v as usize).is_none_or(|n| n.dot(facet) > 0.0)));
            }
        }
    }
}

#[test]
fn the_cornell_box_is_mitsubas() {
    let scene = shipped("cornell");
    let bounds = scene.bounds();
    // Its large block reaches a hundredth through the floor.
    assert_eq!((bounds.min, bounds.max), (Vec3::new(-1.0, -1.01, -1.0), Vec3::ONE));
    let light = scene.materials.iter().position(|material| material.is_emissive()).unwrap();
    assert_eq!(scene.materials[light].emission, Vec3::new(18.387, 13.9873, 6.75357));
    let mesh = &scene.meshes[0];
    let area: f32 = (0..mesh.triangles.len())
        .filter(|triangle| mesh.material(*triangle) as usize == light)
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            let cross = (b - a).cross(c - a);
            assert!(cross.y < 0.0, "the light faces down");
            cross.length() / 2.0
        })
        .sum();
    assert!((area - 0.46 * 0.38).abs() < 1e-5);
    assert_eq!(mesh.triangles.len(), 2 * (5 + 1 + 2 * 6));
}

#[test]
fn ten_thousand_lights_are_normal() {
    let folder = tempfile::tempdir().unwrap();
    make_scenes::many_lights(folder.path(), 10_000).unwrap();
    let (scene, warnings) = Scene::load(folder.path().join("scene.toml")).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(LightTable::new(&scene).triangles.len(), 10_000);
}

/// Most of its lamps matter to none of what is in view: a tree picks those that do.
#[test]
fn a_building_has_many_lamps() {
    let folder = tempfile::tempdir().unwrap();
    make_scenes::building::write(folder.path()).unwrap();
    let (scene, warnings) = Scene::load(folder.path().join("scene.toml")).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    let lights = LightTable::new(&scene);
    assert_eq!(lights.triangles.len(), 36 * 6 * 2);
    let tree = lights.tree.unwrap();
    let eye = scene.camera.eye;
    let near: f32 = (0..lights.triangles.len())
        .filter(|index| scene.emissive_triangle(lights.triangles[*index]).corners[0].distance(eye) < 4.0)
        .map(|index| tree.probability(Receiver { point: eye, normal: None }, index as u32))
        .sum();
    // By power it would be a tenth, as of the area.
    assert!(near > 0.4, "{near} for what is within 4 m");
}

#[test]
fn a_file_of_one_material_says_what_a_scene_says_of_it() {
    let table = "type = \"coated\"\nalbedo = [0.1, 0.2, 0.3]\nroughness = 0.5\n";
    let folder = Folder::new(&[
        ("m.toml", table),
        ("bad.toml", "type = \"coated\"\nalbdo = 1\n"),
        ("lamp.toml", "emission = 1\n"),
    ]);
    let (surface, brdfs, _) = Surface::load(folder.path("m.toml"), None).unwrap();
    let scene = toml(&format!("[[mesh]]\nfile = \"a.obj\"\n[material.m]\n{table}[environment]\nradiance = 1\n"));
    assert_eq!((surface, brdfs), (scene.materials[0].surface.clone(), vec![]));

    let error = |name: &str, material| Surface::load(folder.path(name), material).unwrap_err().to_string();
    assert!(
        error("bad.toml", None).ends_with("bad.toml:2: unknown key `albdo`; the nearest that is known is `albedo`")
    );
    assert!(error("lamp.toml", None).contains("lamp.toml:1: emission: found `1`, expected no such key"));
    assert!(error("m.toml", Some("x")).contains("found the name `x`, expected no name"));
    assert!(error("none.toml", None).contains("none.toml: cannot be read"));
    assert!(error("none", None).contains("none: cannot be read"));
    fs::write(folder.path("m"), table).unwrap();
    assert!(error("m", None).contains("m: found a BRDF of an unknown kind"));
}

#[test]
fn every_shipped_material_loads() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/materials");
    let mut kinds = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let (surface, brdfs, _) = Surface::load(&path, None).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(matches!(surface, Surface::Measured { .. }), brdfs.len() == 1, "{}", path.display());
        if matches!(surface, Surface::Measured { .. }) {
            let error = Scene::load(&path).map(|_| ()).unwrap_err().to_string();
            assert!(error.contains("found the file of a material, expected a scene"), "{error}");
        }
        kinds.push(std::mem::discriminant(&surface));
    }
    assert!(kinds.len() >= 10);
}
