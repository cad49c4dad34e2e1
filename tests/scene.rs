//! What loads to what: OBJ, MTL and scene files, and the errors and warnings of each.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{Affine3A, Mat3, Vec2, Vec3};
use half::f16;
use neubrdf::scene::{
    Camera, Color, Environment, Error, Film, Fresnel, Lens, LightTable, Material, Mesh, Opacity, Patches, Scene,
    Surface, TexturePlacement, Warning,
};

/// A folder of input files that goes away with the value.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(files: &[(&str, &str)]) -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        files.iter().for_each(|(name, text)| fs::write(folder.path(name), text).unwrap());
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn load(&self, name: &str) -> Result<(Scene, Vec<Warning>), Error> {
        Scene::load(self.path(name))
    }

    fn scene(&self, name: &str) -> Scene {
        let (scene, warnings) = self.load(name).unwrap_or_else(|error| panic!("{error}"));
        assert!(warnings.is_empty(), "{warnings:?}");
        scene
    }
}

/// Loads a lone OBJ file.
fn obj(text: &str) -> (Scene, Vec<Warning>) {
    Folder::new(&[("a.obj", text)]).load("a.obj").unwrap_or_else(|error| panic!("{error}"))
}

/// The message of the error that a scene file ends in, beside an OBJ file of one triangle with the material `m`.
fn toml_error(text: &str) -> String {
    let folder = Folder::new(&[("a.obj", TRIANGLE), ("s.toml", text)]);
    folder.load("s.toml").map(|_| ()).unwrap_err().to_string()
}

/// The scene of a scene file beside that OBJ file.
fn toml(text: &str) -> Scene {
    Folder::new(&[("a.obj", TRIANGLE), ("a.mtl", "newmtl m\nKd .2 .4 .6\n"), ("s.toml", text)]).scene("s.toml")
}

/// The material that an MTL file defines as `m`, and the warnings.
fn mtl(text: &str) -> (Material, Vec<String>) {
    let mtl = format!("newmtl m\n{text}");
    let folder = Folder::new(&[("a.obj", TRIANGLE), ("a.mtl", &mtl)]);
    let (scene, warnings) = folder.load("a.obj").unwrap_or_else(|error| panic!("{error}"));
    (scene.materials[0].clone(), warnings.iter().map(Warning::to_string).collect())
}

const TRIANGLE: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";

/// The corners of each triangle.
fn triangles(mesh: &Mesh) -> Vec<[Vec3; 3]> {
    (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle)).collect()
}

#[test]
fn polygons_become_triangles_and_indices_may_count_backwards() {
    let (scene, warnings) = obj("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 .5 0\nf 1 2 3 4 5\nf -5 -4 -3\n");
    let [a, b, c, d, e] = [[0., 0.], [1., 0.], [1., 1.], [0., 1.], [-1., 0.5]].map(|[x, y]| Vec3::new(x, y, 0.0));
    assert_eq!(triangles(&scene.meshes[0]), [[a, b, c], [a, c, d], [a, d, e], [a, b, c]]);
    assert_eq!(scene.meshes[0].positions.len(), 5);
    assert!(scene.meshes[0].normals.is_empty(), "a flat mesh needs no normals");
    assert!(warnings.is_empty());
}

#[test]
fn concave_polygons_keep_their_outline() {
    let (scene, _) = obj("v 0 0 0\nv 2 -1 0\nv .5 0 0\nv 2 1 0\nf 2 3 4 1\n");
    let areas = triangles(&scene.meshes[0]).into_iter().map(|[a, b, c]| (b - a).cross(c - a).z / 2.0);
    assert!(areas.clone().all(|area| area > 0.0));
    assert!((areas.sum::<f32>() - 0.5).abs() < 1e-6);
}

#[test]
fn a_texture_without_coordinates_warns() {
    let folder = Folder::new(&[("a.obj", TRIANGLE), ("a.mtl", "newmtl m\nmap_Kd t.png\n")]);
    image::RgbImage::new(1, 1).save(folder.path("t.png")).unwrap();
    let (_, warnings) = folder.load("a.obj").unwrap();
    assert!(warnings[0].to_string().contains("no texture coordinates, though its material `m`"), "{}", warnings[0]);
}

#[test]
fn objects_and_materials_of_a_file_become_one_mesh() {
    let folder = Folder::new(&[
        (
            "a.obj",
            "mtllib a b.mtl\nmtllib second.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\no one\nusemtl red wine\nf 1 2 3\no two\nusemtl blue\nf 1 3 2\nusemtl red wine\nf 2 1 3\n",
        ),
        ("a b.mtl", "newmtl red wine\nKd .5 0 0\n"),
        ("second.mtl", "newmtl blue\nKd 0 0 .5\nnewmtl unused\nKd 1 1 1\n"),
    ]);
    let scene = folder.scene("a.obj");
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(scene.meshes[0].materials, [0, 1, 0]);
    let names: Vec<&str> = scene.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["red wine", "blue"]);
    let albedo = |rgb: [f32; 3]| Surface::Diffuse { albedo: Color::constant(Vec3::from_array(rgb)) };
    assert_eq!(scene.materials[0].surface, albedo([0.5, 0.0, 0.0]));
    assert_eq!(scene.materials[1].surface, albedo([0.0, 0.0, 0.5]));
}

#[test]
fn continuation_lines_comments_colours_and_windows_line_ends_are_read() {
    let (scene, _) = obj(
        "# C:\\models\\\r\n# \u{fffd}\r\nv 0 0 0 1 0 0\r\nv 1 0 0 1\r\nv 0 1 0 # third\r\nf 1 2 \\\r\n3 # done\r\n",
    );
    assert_eq!(triangles(&scene.meshes[0]), [[Vec3::ZERO, Vec3::X, Vec3::Y]]);
}

#[test]
fn a_missing_mtl_is_a_warning_and_grey() {
    let folder = Folder::new(&[("a.obj", TRIANGLE)]);
    let (scene, warnings) = folder.load("a.obj").unwrap();
    let grey = Surface::Diffuse { albedo: Color::constant(Vec3::splat(0.5)) };
    assert_eq!(scene.materials[0].surface, grey);
    assert!(warnings[0].to_string().contains("a.obj:1: there is no "), "{}", warnings[0]);
    assert!(warnings[1].to_string().contains("`m` is not defined"), "{}", warnings[1]);
}

#[test]
fn degenerate_triangles_are_dropped_with_one_warning() {
    let (scene, warnings) = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\nf 1 1 2\nf 4 4 4\n");
    assert_eq!(scene.meshes[0].triangles.len(), 1);
    assert_eq!(scene.meshes[0].positions.len(), 3, "their vertices go too");
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].to_string().ends_with("a.obj: dropped 2 triangles without area"), "{}", warnings[0]);
}

#[test]
fn obj_errors_name_file_line_and_index() {
    for (text, parts) in [
        ("v 0 0 0\nv nan 0 0\n", vec!["a.obj:2", "`v`", "`nan` in vertex 2", "a finite number"]),
        ("v 0 0 0\nv 1e39 0 0\n", vec!["a.obj:2", "`1e39` in vertex 2"]),
        ("v 0 0 1e9\n", vec!["a.obj:1", "1000000000 in vertex 1", "at most 1e8"]),
        ("v 0 0\n", vec!["a.obj:1", "the end of the statement in vertex 1"]),
        ("v 0 0 0\nv 1 0 0\nf 1 2 3\n", vec!["a.obj:3", "`f`", "the index 3 of a position", "1 to 2"]),
        ("v 0 0 0\nf 1 -1 -2\n", vec!["a.obj:2", "the index -2"]),
        ("v 0 0 0\nf 0 1 1\n", vec!["the index 0"]),
        ("v 0 0 0\nf 1/1 1/1 1/1\n", vec!["index 1 of a texture coordinate", "no texture coordinate precedes"]),
        ("v 0 0 0\nf 1//2 1//2 1//2\n", vec!["index 2 of a normal"]),
        ("v 0 0 0\nf a 1 1\n", vec!["`a` in the corner `a`", "whole number"]),
        ("v 0 0 0\nf 1////1 1 1\n", vec!["`1////1`"]),
        ("v 0 0 0\nf 1 1\n", vec!["a face of 2 corners"]),
        ("v 0 0 0\nff 1 1 1\n", vec!["a.obj:2", "the statement `ff`"]),
        ("v 0 0 0\n", vec!["a.obj: found no triangle"]),
        ("usemtl\n", vec!["a.obj:1", "no name"]),
    ] {
        let error = Folder::new(&[("a.obj", text)]).load("a.obj").map(|_| ()).unwrap_err().to_string();
        parts.iter().for_each(|part| assert!(error.contains(part), "{error}: lacks {part}"));
    }
}

/// A roof of two triangles that meet at an angle of 60° between their normals.
const ROOF: &str = "v 0 0 0\nv 0 0 1\nv -1 -.57735027 0\nv 1 -.57735027 0\nf 1 3 2\nf 1 2 4\n";

#[test]
fn normals_are_smoothed_up_to_the_crease_angle() {
    let with = |options: &str| {
        let file = format!("[[mesh]]\nfile = 'a.obj'\n{options}\n[environment]\nradiance = 1\n");
        Folder::new(&[("a.obj", ROOF), ("s.toml", &file)]).scene("s.toml").meshes.remove(0)
    };
    assert!(with("").normals.is_empty());
    assert!(with("normals = 'flat'").normals.is_empty());
    for options in ["crease_angle = 61", "normals = 'smooth'"] {
        let mesh = with(options);
        assert_eq!(mesh.positions.len(), 4, "no vertex is split");
        for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
            // On the ridge the mean of both sides, elsewhere the side's own.
            let expected = Vec3::new(position.x * 0.5, if position.x == 0.0 { 1.0 } else { 0.75f32.sqrt() }, 0.0);
            assert!((*normal - expected).length() < 1e-6, "{position}: {normal}");
        }
    }
}

#[test]
fn a_smooth_sphere_points_outwards_and_a_cube_stays_flat() {
    let octahedron = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n\
        f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";
    let file = "[[mesh]]\nfile = 'a.obj'\nnormals = 'smooth'\n[environment]\nradiance = 1\n";
    let mesh = Folder::new(&[("a.obj", octahedron), ("s.toml", file)]).scene("s.toml").meshes.remove(0);
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        assert!((*position - *normal).length() < 1e-6);
    }
}

#[test]
fn given_normals_are_kept_and_made_unit() {
    let (scene, warnings) = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 2\nvn 0 3 4\nvn 0 0 0\nf 1//1 2//2 3//3\n");
    assert_eq!(scene.meshes[0].normals, [Vec3::Z, Vec3::new(0.0, 0.6, 0.8), Vec3::Z]);
    assert!(warnings.is_empty());
}

#[test]
fn faces_with_and_without_coordinates_warn() {
    let (scene, warnings) = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\nf 1 3 2\n");
    assert!(scene.meshes[0].uvs.is_empty());
    assert!(warnings[0].to_string().contains("some faces have texture coordinates"), "{}", warnings[0]);
}

#[test]
fn mtl_statements_map_onto_surfaces() {
    let rgb = |r, g, b| Color::constant(Vec3::new(r, g, b));
    let grey = |value| Color::constant(Vec3::splat(value));
    let metal = |f0, alpha| Surface::Conductor { fresnel: Fresnel::Schlick { f0 }, alpha };
    for (text, surface) in [
        ("", Surface::Diffuse { albedo: grey(0.5) }),
        ("Kd .1 .2 .3\n", Surface::Diffuse { albedo: rgb(0.1, 0.2, 0.3) }),
        ("Kd .25\n", Surface::Diffuse { albedo: grey(0.25) }),
        ("Kd .5 .5 .5\nKs 1 1 1\nNs 0\nillum 1\n", Surface::Diffuse { albedo: grey(0.5) }),
        ("Kd .5 .5 .5\nKs 1 1 1\nNs 198\nillum 2\n", Surface::Coated { albedo: grey(0.5), ior: 1.5, alpha: 0.1 }),
        ("Kd .5\nKs 1\nNi 1.3\nPr .5\n", Surface::Coated { albedo: grey(0.5), ior: 1.3, alpha: 0.25 }),
        ("Kd 0\nKs .9 .8 .7\nNs 198\nillum 3\n", metal(rgb(0.9, 0.8, 0.7), Vec2::splat(0.1))),
        ("Kd 0\nKs .9\nNs 198\nillum 5\n", metal(grey(0.9), Vec2::ZERO)),
        ("Kd .9 .6 .3\nPm 1\nPr .5\n", metal(rgb(0.9, 0.6, 0.3), Vec2::splat(0.25))),
        ("Kd 1\nillum 7\nNi 1.33\n", Surface::Dielectric { ior: 1.33, alpha: 0.0 }),
        ("illum 4\nPr .2\n", Surface::Dielectric { ior: 1.5, alpha: 0.2f32 * 0.2 }),
    ] {
        let (material, warnings) = mtl(text);
        assert_eq!(material.surface, surface, "{text}");
        assert!(warnings.is_empty(), "{text}: {warnings:?}");
    }
    let (stretched, _) = mtl("Kd 1\nPm 1\nPr .5\naniso 1\n");
    let Surface::Conductor { alpha, .. } = stretched.surface else { panic!("{stretched:?}") };
    assert!((alpha.x / alpha.y - 10.0).abs() < 1e-3);
    assert_eq!(mtl("Ke 1 2 3\n").0.emission, Vec3::new(1.0, 2.0, 3.0));
}

#[test]
fn unsupported_mtl_statements_warn_once_each() {
    let (_, warnings) = mtl("map_Ks a.png\nmap_Ns b.png\nmap_Ns c.png\nKd 2\nPm .7\nnewmtl n\nmap_Ks x.png\n");
    for part in ["`map_Ks`", "`map_Ns`", "clamped", "Pm 0.7 is taken as 1"] {
        assert_eq!(warnings.iter().filter(|warning| warning.contains(part)).count(), 1, "{part}: {warnings:?}");
    }
    assert_eq!(warnings.len(), 4);
}

#[test]
fn mtl_materials_dissolve() {
    for (text, value, says) in [
        ("Kd 1\n", 1.0, None),
        ("d .25\n", 0.25, None),
        ("d -halo .25\n", 0.25, None),
        ("Tr .25\n", 1.0, None),
        ("d 1.5\n", 1.0, Some("clamped to 1")),
        ("d 0\n", 0.0, Some("cannot be seen")),
        ("d .25\nillum 7\n", 1.0, None),
        ("d .25\nKe 1\n", 1.0, Some("ignored, as it emits")),
    ] {
        let (material, warnings) = mtl(text);
        assert_eq!(material.opacity, Opacity { value, texture: None }, "{text}");
        assert_eq!(warnings.len(), usize::from(says.is_some()), "{text}: {warnings:?}");
        says.iter().for_each(|part| assert!(warnings[0].contains(part), "{warnings:?}"));
    }
}

#[test]
fn mtl_errors_name_file_and_line() {
    for (text, parts) in [
        ("Kd .5 .5\n", vec!["a.mtl:2", "`Kd`", "the end of the statement", "a number"]),
        ("Kd -1 0 0\n", vec!["`Kd`", "-1", "at least 0"]),
        ("Kd spectral x.rfl\n", vec!["`spectral`"]),
        ("Ns inf\n", vec!["`Ns`", "`inf`", "finite"]),
        ("illum 11\n", vec!["`illum`", "`11`", "0 to 10"]),
        ("map_Kd -clamp\n", vec!["`map_Kd`", "no file"]),
        ("v 0 0 0\n", vec!["a statement of an OBJ file"]),
        ("\u{1}\n", vec!["an MTL statement"]),
        ("map_Kd absent.png\n", vec!["absent.png: cannot be read", "named by", "a.mtl:1", "`m`"]),
    ] {
        let files = [("a.obj", TRIANGLE), ("a.mtl", &format!("newmtl m\n{text}"))];
        let error = Folder::new(&files).load("a.obj").map(|_| ()).unwrap_err().to_string();
        parts.iter().for_each(|part| assert!(error.contains(part), "{error}: lacks {part}"));
    }
}

const SKY: &str = "[environment]\nradiance = 1\n";

#[test]
fn a_scene_file_says_camera_film_and_lights() {
    let scene = toml(
        "[camera]\neye = [1, 2, 3]\ntarget = [0, 0, 0]\nup = [0, 0, 1]\nfov = 30\nlens_radius = 0.1\n\
         focus_distance = 2.5\n[film]\nwidth = 64\nheight = 32\n[[mesh]]\nfile = 'a.obj'\n\
         [environment]\nradiance = [1, 2, 3]\nscale = 2\nrotate = 90\n[sun]\ndirection = [0, 2, 0]\nirradiance = 5\n",
    );
    assert_eq!(
        scene.camera,
        Camera {
            eye: Vec3::new(1.0, 2.0, 3.0),
            target: Vec3::ZERO,
            up: Vec3::Z,
            vertical_fov_degrees: 30.0,
            lens: Some(Lens { radius: 0.1, focus_distance: 2.5 }),
        }
    );
    assert_eq!(scene.film, Film { width: 64, height: 32 });
    let environment = Environment { rotation_degrees: 90.0, ..Environment::constant(Vec3::new(2.0, 4.0, 6.0)) };
    assert_eq!(scene.environment, Some(environment));
    let sun = scene.sun.unwrap();
    assert_eq!((sun.direction, sun.irradiance), (Vec3::Y, Vec3::splat(5.0)));
}

#[test]
fn transforms_scale_then_turn_then_move() {
    let place = |transform: &str| {
        let scene = toml(&format!("[[mesh]]\nfile = 'a.obj'\ntransform = {{ {transform} }}\n{SKY}"));
        scene.instances[0].object_to_world
    };
    let moved = |transform: &str| place(transform).transform_point3(Vec3::new(1.0, 0.0, 0.0));
    let near = |found: Vec3, x: f32, y: f32, z: f32| {
        assert!((found - Vec3::new(x, y, z)).length() < 1e-6, "{found}");
    };
    near(moved("translate = [1, 2, 3]"), 2.0, 2.0, 3.0);
    near(moved("translate = [1, 0, 0], rotate = [0, 90, 0], scale = 2"), 1.0, 0.0, -2.0);
    near(moved("axis = [0, 0, 2], angle = 90"), 0.0, 1.0, 0.0);
    near(moved("rotate = [90, 0, 90]"), 0.0, 1.0, 0.0);
    near(moved("scale = [3, 1, -1]"), 3.0, 0.0, 0.0);
    near(moved("matrix = [[0, 0, 1, 5], [2, 0, 0, 6], [0, 1, 0, 7]]"), 5.0, 8.0, 7.0);
    assert_eq!(place("scale = 1").matrix3, Mat3::IDENTITY.into());
}

#[test]
fn instances_share_one_mesh() {
    let scene = toml(&format!(
        "[[mesh]]\nfile = 'a.obj'\ntransform = {{ scale = 2 }}\n\
         instances = [{{ }}, {{ translate = [1, 0, 0] }}]\n[[mesh]]\nfile = 'a.obj'\n{SKY}"
    ));
    assert_eq!(scene.meshes.len(), 1);
    let places: Vec<Affine3A> = scene.instances.iter().map(|instance| instance.object_to_world).collect();
    assert_eq!(places[0], Affine3A::from_scale(Vec3::splat(2.0)));
    assert_eq!(places[1], Affine3A::from_scale_rotation_translation(Vec3::splat(2.0), Default::default(), Vec3::X));
    assert_eq!(places[2], Affine3A::IDENTITY);
    assert_eq!(scene.materials.len(), 1);
}

#[test]
fn material_overrides_replace_or_amend() {
    let with = |text: &str| toml(&format!("[[mesh]]\nfile = 'a.obj'\n{SKY}[material.m]\n{text}")).materials.remove(0);
    let kd = Color::constant(Vec3::new(0.2, 0.4, 0.6));
    let light = with("emission = 3\nemits_both_sides = true\n");
    assert_eq!((light.emission, light.emits_both_sides), (Vec3::splat(3.0), true));
    assert_eq!(light.surface, Surface::Diffuse { albedo: kd }, "the MTL's surface stays");
    assert_eq!(with("albedo = 1").surface, Surface::Diffuse { albedo: Color::constant(Vec3::ONE) });
    assert_eq!(
        with("type = 'coated'\nior = 1.4\nroughness = 0.5").surface,
        Surface::Coated { albedo: kd, ior: 1.4, alpha: 0.25 }
    );
    assert_eq!(with("type = 'dielectric'\nalpha = 0.3").surface, Surface::Dielectric { ior: 1.5, alpha: 0.3 });
    assert_eq!(
        with("type = 'mirror'").surface,
        Surface::Conductor { fresnel: Fresnel::Schlick { f0: Color::constant(Vec3::ONE) }, alpha: Vec2::ZERO }
    );
    assert_eq!(
        with("type = 'conductor'\neta = [1, 2, 3]\nk = 4\nroughness = [0.5, 1]").surface,
        Surface::Conductor {
            fresnel: Fresnel::Complex { eta: Vec3::new(1.0, 2.0, 3.0), kappa: Vec3::splat(4.0) },
            alpha: Vec2::new(0.25, 1.0)
        }
    );
    assert_eq!(with("opacity = 0.25\nalbedo = 1").opacity, Opacity { value: 0.25, texture: None });
    let Surface::Conductor { fresnel: Fresnel::Complex { eta, kappa }, .. } =
        with("type = 'conductor'\nmetal = 'gold'").surface
    else {
        panic!("gold has a complex index")
    };
    let f0 = ((eta - 1.0) * (eta - 1.0) + kappa * kappa) / ((eta + 1.0) * (eta + 1.0) + kappa * kappa);
    assert!((f0 - Vec3::new(0.94, 0.85, 0.39)).length() < 0.01, "{f0}");
}

#[test]
fn scene_file_errors_name_line_field_and_remedy() {
    let mesh = "[[mesh]]\nfile = 'a.obj'\n";
    for (text, parts) in [
        ("[cammera]\n", vec!["s.toml:1", "unknown key `cammera`", "`camera`"]),
        ("[camera]\n\neyes = [0,0,0]\n", vec!["s.toml:3", "camera", "`eyes`", "`eye`"]),
        ("[camera]\neye = [0,0,0]\n", vec!["s.toml:1", "nothing", "the key `target`"]),
        ("[camera]\neye = [0,0]\ntarget=[0,0,0]\n", vec!["s.toml:2", "camera.eye", "`[0,0]`", "3 numbers"]),
        ("[camera]\neye = [0,nan,0]\ntarget=[0,0,0]\n", vec!["camera.eye[1]", "`nan`"]),
        ("[camera]\neye = [0,0,0]\ntarget=[0,0,0]\n", vec!["camera.target", "other than the eye"]),
        ("[camera]\neye = [0,0,0]\ntarget=[0,1,0]\n", vec!["along target"]),
        ("[camera]\neye = [0,0,0]\ntarget=[1,0,0]\nfov = 180\n", vec!["s.toml:4", "camera.fov", "`180`", "179"]),
        ("[film]\nwidth = 0\nheight = 1\n", vec!["film.width", "`0`", "from 1 to 65536"]),
        ("[film]\nwidth = 100000\nheight = 1\n", vec!["film.width", "`100000`"]),
        ("", vec!["s.toml:1", "nothing", "the key `mesh`"]),
        ("mesh = 3\n", vec!["mesh", "`3`", "an array"]),
        ("mesh = [\n", vec!["s.toml", "broken TOML"]),
        ("[[mesh]]\nfile = 'b.obj'\n", vec!["b.obj: cannot be read"]),
        ("[[mesh]]\nfile = 'a.obj'\nnormals = 'soft'\n", vec!["s.toml:3", "mesh[0].normals", "`'soft'`", "\"smooth\""]),
        ("[[mesh]]\nfile = 'a.obj'\ntransform = { scale = 0 }\n", vec!["mesh[0].transform", "determinant 0"]),
        ("[[mesh]]\nfile = 'a.obj'\ntransform = { scale = 1, matrix = [] }\n", vec!["no other key"]),
        ("[[mesh]]\nfile = 'a.obj'\ntransform = { axis = [0,1,0] }\n", vec!["a mixture of rotations"]),
        ("[[mesh]]\nfile = 'a.obj'\ninstances = []\n", vec!["no instance"]),
        (
            "[[mesh]]\nfile = 'a.obj'\ntransform = { scale = 1e3, translate = [1e8, 0, 0] }\n",
            vec!["s.toml", "at most 1e8"],
        ),
    ] {
        let error = toml_error(text);
        parts.iter().for_each(|part| assert!(error.contains(part), "{error}: lacks {part}"));
    }
    for (text, parts) in [
        ("[material.n]\n", vec!["s.toml:3", "`n`, which no mesh uses", "`m`"]),
        ("[material.m]\ntype = 'glass'\n", vec!["s.toml:4", "material.m.type", "`'glass'`", "\"dielectric\""]),
        ("[material.m]\nroughnes = 1\ntype='coated'\n", vec!["s.toml:4", "`roughnes`", "`roughness`"]),
        ("[material.m]\ntype='coated'\nalpha = [1, .5]\n", vec!["broken TOML"]),
        ("[material.m]\ntype='coated'\nalpha = [1, 0.5]\n", vec!["anisotropic", "one number"]),
        ("[material.m]\ntype='coated'\nalpha = 1\nroughness = 1\n", vec!["both", "one of them"]),
        ("[material.m]\ntype='conductor'\n", vec!["no reflectance", "`metal`"]),
        ("[material.m]\ntype='conductor'\nmetal='brass'\n", vec!["material.m.metal", "`'brass'`", "gold"]),
        ("[material.m]\nalbedo = 1.5\n", vec!["material.m.albedo", "`1.5`", "from 0 to 1"]),
        ("[material.m]\nemission = -1\n", vec!["material.m.emission", "from 0 to 1e12"]),
        ("[material.m]\nopacity = 1.5\n", vec!["material.m.opacity", "`1.5`", "from 0 to 1"]),
        ("[material.m]\nopacity = 'none.png'\n", vec!["none.png: cannot be read", "s.toml:4", "material.m.opacity"]),
        ("[material.m]\nopacity = 0.5\nemission = 1\n", vec!["material.m.opacity", "`opacity = 1`"]),
        ("[environment]\n", vec!["`file` and `radiance`"]),
        ("[environment]\nfile = 'a.obj'\n", vec!["a.obj", "an OpenEXR image"]),
        ("[environment]\nfile = 'none.exr'\n", vec!["none.exr: cannot be read", "s.toml:4", "environment.file"]),
        ("[sun]\ndirection = [0,0,0]\nirradiance = 1\n", vec!["sun.direction", "towards the sun"]),
        ("[sun]\ndirection = [0,1,0]\n", vec!["sun", "the key `irradiance`"]),
    ] {
        let error = toml_error(&format!("{mesh}{text}"));
        parts.iter().for_each(|part| assert!(error.contains(part), "{error}: lacks {part}"));
    }
}

#[test]
fn a_scene_without_light_warns() {
    let folder = Folder::new(&[("a.obj", ROOF), ("s.toml", "[[mesh]]\nfile = 'a.obj'\n")]);
    let (_, warnings) = folder.load("s.toml").unwrap();
    assert!(warnings[0].to_string().contains("nothing emits light"), "{}", warnings[0]);
}

#[test]
fn a_bare_obj_is_framed_under_a_uniform_sky() {
    let (scene, _) = obj("v -3 0 0\nv 5 0 -1\nv 0 7 2\nf 1 2 3\n");
    assert_eq!(scene.environment, Some(Environment::constant(Vec3::ONE)));
    let Camera { eye, target, up, vertical_fov_degrees, .. } = scene.camera;
    let forward = (target - eye).normalize();
    let right = forward.cross(up).normalize();
    let half = (vertical_fov_degrees.to_radians() / 2.0).tan();
    for position in &scene.meshes[0].positions {
        let seen = *position - eye;
        let [x, y] = [right, right.cross(forward)].map(|axis| seen.dot(axis) / seen.dot(forward) / half);
        assert!(x.abs() <= 1.0 && y.abs() <= 1.0, "{position} is outside of the picture");
    }
}

/// Writes an EXR whose texel (x, y) is `color(x, y)`.
fn write_exr(path: &Path, width: usize, height: usize, color: impl Fn(usize, usize) -> (f32, f32, f32) + Sync) {
    exr::prelude::write_rgb_file(path, width, height, color).unwrap();
}

#[test]
fn textures_decode_to_linear_and_load_once() {
    let mtl = "newmtl a\nmap_Kd -clamp on t.png\nnewmtl b\nKd .5 .5 .5\nmap_Kd t.png\nnewmtl c\nmap_Kd t.exr\nnewmtl d\nmap_Kd unused.png\n";
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\nusemtl d\nf 1 2 3\n";
    let toml = format!("[[mesh]]\nfile = 'a.obj'\n[material.d]\nalbedo = 0.5\n[material.a]\n{SKY}");
    let folder = Folder::new(&[("a.obj", obj), ("a.mtl", mtl), ("s.toml", &toml)]);
    let image = image::RgbImage::from_fn(2, 1, |x, _| image::Rgb([x as u8 * 255, 128, 0]));
    image.save(folder.path("t.png")).unwrap();
    write_exr(&folder.path("t.exr"), 1, 2, |_, y| (y as f32, 0.25, 2.0));

    let (scene, warnings) = folder.load("s.toml").unwrap();
    assert_eq!(scene.textures.len(), 2, "an overridden texture is not even looked for");
    let half = |rgb: [f32; 3]| [rgb[0], rgb[1], rgb[2], 1.0].map(f16::from_f32);
    assert_eq!(scene.textures[0].texels, [half([0.0, 0.2158605, 0.0]), half([1.0, 0.2158605, 0.0])]);
    assert_eq!(scene.textures[1].texels, [half([0.0, 0.25, 1.0]), half([1.0, 0.25, 1.0])]);
    assert_eq!((scene.textures[1].width, scene.textures[1].height), (1, 2));
    let albedo = |index: usize| match scene.materials[index].surface {
        Surface::Diffuse { albedo } => albedo,
        _ => panic!("diffuse"),
    };
    assert_eq!(albedo(0), Color { value: Vec3::ONE, texture: Some(0) });
    assert_eq!(albedo(1), Color { value: Vec3::splat(0.5), texture: Some(0) });
    assert_eq!(albedo(2), Color { value: Vec3::ONE, texture: Some(1) });
    assert_eq!(albedo(3), Color::constant(Vec3::splat(0.5)));
    let warnings: Vec<String> = warnings.iter().map(Warning::to_string).collect();
    assert!(warnings.iter().any(|warning| warning.contains("`map_Kd-clamp` is not supported")), "{warnings:?}");
    assert!(warnings.iter().any(|warning| warning.contains("2 texels lie outside of [0, 1]")), "{warnings:?}");
}

/// A file is one texture as a colour and another as an opacity: its alpha, or where it has none its brightness, as it is written.
#[test]
fn opacities_are_alphas_or_brightnesses() {
    let mtl = "newmtl a\nmap_Kd t.png\nmap_d t.png\nnewmtl b\nmap_d -clamp on grey.png\nd .5\nnewmtl c\nnewmtl d\nmap_d whole.png\n";
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\nusemtl c\nf 1/1 2/1 3/1\nusemtl d\nf 1/1 2/1 3/1\n";
    let toml = format!("[[mesh]]\nfile = 'a.obj'\n[material.c]\nopacity = 't.exr'\n{SKY}");
    let folder = Folder::new(&[("a.obj", obj), ("a.mtl", mtl), ("s.toml", &toml)]);
    let pixel = |x| image::Rgba([255, 0, 0, x as u8 * 51]);
    image::RgbaImage::from_fn(2, 1, |x, _| pixel(x)).save(folder.path("t.png")).unwrap();
    image::GrayImage::from_fn(2, 1, |x, _| image::Luma([51 + x as u8])).save(folder.path("grey.png")).unwrap();
    image::RgbaImage::from_fn(1, 1, |_, _| image::Rgba([51, 51, 51, 255])).save(folder.path("whole.png")).unwrap();
    write_exr(&folder.path("t.exr"), 1, 1, |_, _| (0.25, 0.25, 0.25));

    let (scene, warnings) = folder.load("s.toml").unwrap();
    let warnings: Vec<String> = warnings.iter().map(Warning::to_string).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("`map_d-clamp` is not supported"), "{warnings:?}");
    let opacities: Vec<(f32, Vec<f32>)> = (0..4)
        .map(|index| {
            let Opacity { value, texture } = scene.materials[index].opacity;
            let texels = &scene.textures[texture.unwrap() as usize].texels;
            (value, texels.iter().map(|texel| texel[0].to_f32()).collect())
        })
        .collect();
    let code = |code: u8| f16::from_f32(f32::from(code) / 255.0).to_f32();
    let expected =
        [(1.0, vec![0.0, code(51)]), (0.5, vec![code(51), code(52)]), (1.0, vec![0.25]), (1.0, vec![code(51)])];
    assert_eq!(opacities, expected);
    let Surface::Diffuse { albedo } = scene.materials[0].surface else { panic!("diffuse") };
    let without = mtl.replace("map_d t.png", "map_d grey.png");
    fs::write(folder.path("a.mtl"), without).unwrap();
    let warnings = folder.load("s.toml").unwrap().1;
    assert!(warnings.iter().any(|warning| warning.to_string().contains("its alpha makes no holes")), "{warnings:?}");
    assert_eq!(scene.textures[albedo.texture.unwrap() as usize].texels[1][0].to_f32(), 1.0);
}

/// What is called a bump map holds normals, or heights; one that cannot be read is left out with a warning.
#[test]
fn bump_maps_may_hold_normals_or_heights() {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\nusemtl c\nf 1/1 2/1 3/1\nusemtl d\nf 1/1 2/1 3/1\n";
    let mtl = "newmtl a\nmap_Bump -bm 1.0 normals.png\nnewmtl b\nbump -bm 2 heights.png\nnewmtl c\nnorm normals.tga\nnewmtl d\nmap_bump none.tif\n";
    let toml = format!("[[mesh]]\nfile = 'a.obj'\n[material.b]\n{SKY}");
    let folder = Folder::new(&[("a.obj", obj), ("a.mtl", mtl), ("s.toml", &toml)]);
    let normals = image::RgbImage::from_fn(2, 1, |x, _| image::Rgb([128 + x as u8, 128, 255]));
    ["normals.png", "normals.tga"].iter().for_each(|name| normals.save(folder.path(name)).unwrap());
    let heights = image::GrayImage::from_fn(4, 4, |x, y| image::Luma([51 * (x + u32::from(y == 1)) as u8]));
    heights.save(folder.path("heights.png")).unwrap();
    let (scene, warnings) = folder.load("s.toml").unwrap();
    let map = |index: usize| scene.materials[index].normal_map;
    assert!(map(0).is_some() && map(1).is_some() && map(2).is_some() && map(3).is_none());
    let texels = |index: usize| &scene.textures[map(index).unwrap() as usize].texels;
    assert!(texels(0) == texels(2) && texels(0)[1][0] == f16::from_f32(129.0 / 255.0), "as it is written");
    // White is 2 texels above black: along u it rises by 0.4 a texel, and from the row below row 1 to that by half as much.
    let normal = |x: usize, y: usize| {
        let [x, y, z, _] = texels(1)[4 * y + x].map(f16::to_f32);
        2.0 * Vec3::new(x, y, z) - 1.0
    };
    for (x, y, slope) in [(1, 3, [0.4, 0.0]), (1, 2, [0.4, 0.2]), (2, 0, [0.4, -0.2]), (0, 3, [-0.4, 0.0])] {
        let expected = Vec3::new(-slope[0], -slope[1], 1.0).normalize();
        assert!((normal(x, y) - expected).length() < 2e-3, "({x}, {y}): {}, not {expected}", normal(x, y));
    }
    let warnings: Vec<String> = warnings.iter().map(Warning::to_string).collect();
    for part in ["heights.png: it holds heights: white is taken to be 2 texels", "none.tif: no bumps"] {
        assert_eq!(warnings.iter().filter(|warning| warning.contains(part)).count(), 1, "{part}: {warnings:?}");
    }
    assert_eq!(warnings.len(), 2, "{warnings:?}");

    let toml = format!("[[mesh]]\nfile = 'a.obj'\n[material.b]\nnormal_map = 'heights.png'\n{SKY}");
    fs::write(folder.path("t.toml"), toml).unwrap();
    let (now, _) = folder.load("t.toml").unwrap();
    assert!(now.materials[1].normal_map.is_some(), "who says that it is one knows");
    assert_ne!(now.hash(), scene.hash());
}

/// A map of roughness stands instead of a number, in MTL and in scene files, wherever there is roughness.
#[test]
fn maps_of_roughness_load() {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl metal\nf 1/1 2/1 3/1\nusemtl paint\nf 1/1 2/1 3/1\nusemtl chalk\nf 1/1 2/1 3/1\n";
    let mtl = "newmtl metal\nPm 1\nPr 0.3\nmap_Pr -clamp on rough.png\nnewmtl paint\nKs 1 1 1\nmap_Pr rough.png\nnewmtl chalk\nmap_Pr rough.png\n";
    let folder = Folder::new(&[("a.obj", obj), ("a.mtl", mtl)]);
    image::GrayImage::from_fn(2, 1, |x, _| image::Luma([90 * x as u8])).save(folder.path("rough.png")).unwrap();
    let load = |of_scene: &str| {
        fs::write(folder.path("s.toml"), format!("[[mesh]]\nfile = 'a.obj'\n{of_scene}\n{SKY}")).unwrap();
        folder.load("s.toml")
    };
    let maps = |of_scene: &str| load(of_scene).unwrap().0.materials.iter().map(|m| m.roughness_map).collect::<Vec<_>>();

    let (scene, warnings) = load("").unwrap();
    assert_eq!(maps(""), [Some(0), Some(0), None], "chalk is diffuse");
    assert_eq!(scene.textures[0].texels[1][0], f16::from_f32(90.0 / 255.0), "as it is written");
    assert!(warnings.len() == 1 && warnings[0].to_string().contains("map_Pr-clamp"), "{warnings:?}");
    assert_ne!(load("[material.metal]\nalpha = 0.3").unwrap().0.hash(), scene.hash());

    assert_eq!(maps("[material.metal]\nemission = 1"), [Some(0), Some(0), None]);
    assert_eq!(
        maps("[material.metal]\nroughness = 0.2"),
        [None, Some(0), None],
        "a number of the scene's counts for more"
    );
    assert_eq!(maps("[material.metal]\ntype = 'mirror'"), [None, Some(0), None]);
    assert_eq!(maps("[material.metal]\ntype = 'conductor'\nmetal = 'gold'"), [Some(0), Some(0), None]);
    assert_eq!(maps("[material.paint]\ntype = 'diffuse'"), [Some(0), None, None]);
    assert_eq!(maps("[material.chalk]\ntype = 'dielectric'\nroughness_map = 'rough.png'"), [Some(0); 3]);
    for (of_scene, part) in [
        ("[material.chalk]\nroughness_map = 'rough.png'", "conductor, dielectric or coated"),
        ("[material.metal]\ntype = 'mirror'\nroughness_map = 'rough.png'", "conductor, dielectric or coated"),
        ("[material.metal]\nalpha = 0.1\nroughness_map = 'rough.png'", "either a roughness, or a map"),
        ("[material.metal]\nroughness_map = 'none.png'", "none.png"),
    ] {
        let error = load(of_scene).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
    let mut diffuse = scene.clone();
    diffuse.materials[2].roughness_map = Some(0);
    assert!(diffuse.check().is_err());
}

/// Where a texture lies: options of MTL, tables in scene files.
#[test]
fn textures_are_placed() {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n";
    let mtl = "newmtl a\nmap_Kd -s 4 2 1 -o 0.5 a.png\nmap_Ke -o 0 -0.25 0 a.png\nnorm -s 3 a.png\nmap_d -s 1 2 a.png\n\
               newmtl b\nPm 1\nmap_Kd a.png\nmap_Pr -s 5 5 a.png\nmap_Bump -bm 2 -s -1 1 a.png\n";
    let folder = Folder::new(&[("a.obj", obj), ("a.mtl", &mtl.replace("map_d -s 1 2 a.png\n", ""))]);
    image::RgbImage::from_fn(2, 1, |x, _| image::Rgb([128 + x as u8, 128, 255])).save(folder.path("a.png")).unwrap();
    let load = |of_scene: &str| {
        fs::write(folder.path("s.toml"), format!("[[mesh]]\nfile = 'a.obj'\n{of_scene}\n{SKY}")).unwrap();
        folder.load("s.toml")
    };
    let (scene, warnings) = load("").unwrap();
    let placement = |scene: &Scene, texture: Option<u32>| {
        let TexturePlacement { scale, offset } = scene.textures[texture.unwrap() as usize].placement;
        [scale.x, scale.y, offset.x, offset.y]
    };
    let color = |scene: &Scene, index: usize| placement(scene, scene.materials[index].surface.texture());
    assert_eq!(color(&scene, 0), [4.0, 2.0, 0.5, 0.0]);
    assert_eq!(color(&scene, 1), [1.0, 1.0, 0.0, 0.0]);
    let [a, b] = [&scene.materials[0], &scene.materials[1]];
    assert_eq!(placement(&scene, a.emission_texture), [1.0, 1.0, 0.0, -0.25]);
    assert_eq!(placement(&scene, a.normal_map), [3.0, 1.0, 0.0, 0.0]);
    assert_eq!(placement(&scene, b.roughness_map), [5.0, 5.0, 0.0, 0.0]);
    assert_eq!(placement(&scene, b.normal_map), [-1.0, 1.0, 0.0, 0.0]);
    assert!(warnings.is_empty(), "{warnings:?}");
    fs::write(folder.path("a.mtl"), "newmtl a\nmap_d -s 1 2 a.png\nnewmtl b\n").unwrap();
    let (holes, _) = load("").unwrap();
    assert_eq!(placement(&holes, holes.materials[0].opacity.texture), [1.0, 2.0, 0.0, 0.0]);

    let table = "{ file = 'a.png', scale = [2, -3], offset = [0.5, 0] }";
    let (now, _) =
        load(&format!("[material.a]\ntexture = {table}\nopacity = {table}\n[material.b]\nnormal_map = {table}"))
            .unwrap();
    for texture in [now.materials[0].surface.texture(), now.materials[0].opacity.texture, now.materials[1].normal_map] {
        assert_eq!(placement(&now, texture), [2.0, -3.0, 0.5, 0.0]);
    }
    for (of_scene, part) in [
        ("[material.a]\ntexture = 4", "a file, or a table"),
        ("[material.a]\ntexture = { scale = [1, 1] }", "the key `file`"),
        ("[material.a]\ntexture = { file = 'a.png', scales = [1, 1] }", "`scale`"),
        ("[material.a]\nnormal_map = { file = 'a.png', scale = [1, inf] }", "scale[1]"),
        ("[material.a]\nopacity = { file = 'a.png', offset = 1 }", "an array of 2 numbers"),
    ] {
        let error = load(of_scene).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
    fs::write(folder.path("a.mtl"), "newmtl a\nmap_Kd -s 1 1e30 a.png\n").unwrap();
    let error = load("").map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("a.mtl:2") && error.contains("1e6"), "{error}");
}

/// Where a map says so a material is a metal of its colour and roughness.
#[test]
fn maps_of_metal_load() {
    let obj =
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl paint\nf 1/1 2/1 3/1\nusemtl lamp\nf 1/1 2/1 3/1\n";
    let mtl = "newmtl paint\nKs 0.5 0.5 0.5\nPm 1\nPr 0.5\nKd 0.8 0.4 0.2\nmap_Kd a.png\nmap_Pr -s 2 2 a.png\nmap_Pm -s 3 3 a.png\nnorm a.png\n\
               newmtl lamp\nKe 1 1 1\nmap_Pm a.png\n";
    let folder = Folder::new(&[("a.obj", obj), ("a.mtl", mtl)]);
    image::GrayImage::from_fn(2, 1, |x, _| image::Luma([255 * x as u8])).save(folder.path("a.png")).unwrap();
    let load = |of_scene: &str| {
        fs::write(folder.path("s.toml"), format!("[[mesh]]\nfile = 'a.obj'\n{of_scene}\n{SKY}")).unwrap();
        folder.load("s.toml")
    };
    let metal_of = |scene: &Scene| {
        let patches = scene.materials[0].patches?;
        assert!(scene.textures.len() > patches.map as usize);
        Some(scene.materials[patches.material as usize].clone())
    };
    let (scene, warnings) = load("").unwrap();
    let (paint, metal) = (&scene.materials[0], metal_of(&scene).unwrap());
    assert!(matches!(paint.surface, Surface::Coated { .. }), "`Pm` says nothing beside the map");
    let Surface::Conductor { fresnel: Fresnel::Schlick { f0 }, alpha } = metal.surface else { panic!("{metal:?}") };
    assert_eq!((f0.value, f0.texture, alpha), (Vec3::new(0.8, 0.4, 0.2), paint.surface.texture(), Vec2::splat(0.25)));
    assert_eq!((metal.normal_map, metal.roughness_map), (paint.normal_map, paint.roughness_map));
    assert!(metal.roughness_map.is_some() && metal.name == "paint (metal)");
    assert_eq!(scene.textures[paint.patches.unwrap().map as usize].placement.scale, Vec2::splat(3.0));
    assert!(warnings.len() == 1 && warnings[0].to_string().contains("`map_Pm` is ignored"), "{warnings:?}");

    let (now, _) = load("[material.paint]\nalbedo = 0.1\nroughness = 0.2").unwrap();
    let metal = metal_of(&now).unwrap();
    let Surface::Conductor { fresnel: Fresnel::Schlick { f0 }, alpha } = metal.surface else { panic!("{metal:?}") };
    assert!(f0.value == Vec3::splat(0.1) && (alpha - 0.04).abs().max_element() < 1e-6, "{f0:?}, {alpha}");
    assert!(metal.roughness_map.is_none() && now.hash() != scene.hash());
    let (now, _) = load("[material.'paint (metal)']\nmetal = 'gold'").unwrap();
    assert!(matches!(metal_of(&now).unwrap().surface, Surface::Conductor { fresnel: Fresnel::Complex { .. }, .. }));
    assert!(metal_of(&load("[material.paint]\ntype = 'mirror'").unwrap().0).is_none());
    assert!(metal_of(&load("[material.paint]\nemission = 1").unwrap().0).is_none());

    fs::write(folder.path("a.mtl"), "newmtl paint\nnewmtl lamp\nKe 1 1 1\n").unwrap();
    let coated = "[material.paint]\ntype = 'coated'\nalbedo = 0.3\nalpha = 0.1\nmetal_map = 'a.png'";
    let metal = metal_of(&load(coated).unwrap().0).unwrap();
    assert!(matches!(metal.surface, Surface::Conductor { alpha, .. } if alpha == Vec2::splat(0.1)));
    for (of_scene, part) in [
        ("[material.paint]\nmetal_map = 'a.png'", "no map of metal but on a coated"),
        ("[material.lamp]\ntype = 'coated'\nmetal_map = 'a.png'", "no map of metal but on a coated"),
        ("[material.paint]\ntype = 'coated'\nmetal_map = 'none.png'", "none.png"),
    ] {
        let error = load(of_scene).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
    let mut broken = scene.clone();
    broken.materials[0].patches = Some(Patches { map: 0, material: 0 });
    assert!(broken.check().is_err(), "patches of itself");
    broken.materials[0].patches = Some(Patches { map: 0, material: 99 });
    assert!(broken.check().is_err());
}

#[test]
fn textures_that_emit_load() {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\nusemtl c\nf 1/1 2/1 3/1\n";
    let mtl = "newmtl a\nKe 3 2 1\nmap_Ke glow.png\nnewmtl b\nmap_Ke glow.png\nnewmtl c\nKd 1 1 1\n";
    let toml = "[[mesh]]\nfile = 'a.obj'\n[material.c]\nemission = 7\nemission_texture = 'glow.png'\n";
    let folder = Folder::new(&[("a.obj", obj), ("a.mtl", mtl), ("s.toml", toml)]);
    image::GrayImage::from_fn(2, 1, |x, _| image::Luma([255 * x as u8])).save(folder.path("glow.png")).unwrap();
    let (scene, warnings) = folder.load("s.toml").unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    let emission: Vec<Vec3> = scene.materials.iter().map(|material| material.emission).collect();
    assert_eq!(emission, [Vec3::new(3.0, 2.0, 1.0), Vec3::ONE, Vec3::splat(7.0)]);
    assert!(scene.materials.iter().all(|material| material.emission_texture == Some(0)));
    let mut plain = scene.clone();
    plain.materials[0].emission_texture = None;
    assert_ne!(plain.hash(), scene.hash());
}

#[test]
fn environments_load_row_by_row_from_the_zenith() {
    let file = "[[mesh]]\nfile = 'a.obj'\n[environment]\nfile = 'sky.exr'\nscale = [1, 2, 4]\nrotate = 45\n";
    let folder = Folder::new(&[("a.obj", ROOF), ("s.toml", file)]);
    write_exr(&folder.path("sky.exr"), 4, 2, |x, y| (x as f32, y as f32, 100.0));
    let environment = folder.scene("s.toml").environment.unwrap();
    assert_eq!((environment.width, environment.height, environment.rotation_degrees), (4, 2, 45.0));
    assert_eq!(environment.texels[6], Vec3::new(2.0, 2.0, 400.0));

    write_exr(&folder.path("sky.exr"), 2, 2, |x, y| (1.0, if (x, y) == (1, 0) { f32::NAN } else { -1.0 }, 1.0));
    let error = folder.load("s.toml").map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("sky.exr") && error.contains("at (1, 0)"), "{error}");
    write_exr(&folder.path("sky.exr"), 2, 2, |_, _| (1.0, -1.0, 1.0));
    let (scene, warnings) = folder.load("s.toml").unwrap();
    assert_eq!(scene.environment.unwrap().texels[0], Vec3::new(1.0, 0.0, 4.0));
    assert!(warnings[0].to_string().contains("4 texels are negative"), "{}", warnings[0]);
}

#[test]
fn the_hash_follows_the_content_and_not_the_names() {
    let file = format!("[[mesh]]\nfile = 'a.obj'\n{SKY}");
    let hash = |obj: &str, obj_name: &str, toml: &str| {
        let toml = toml.replace("a.obj", obj_name);
        Folder::new(&[(obj_name, obj), ("s.toml", &toml)]).scene("s.toml").hash()
    };
    let original = hash(ROOF, "a.obj", &file);
    assert_eq!(original, hash(ROOF, "other.obj", &file));
    assert_eq!(original, hash(&format!("# the same\no x\n{ROOF}"), "a.obj", &file));
    assert_ne!(original, hash(&ROOF.replace("v 0 0 1", "v 0 0 1.0000001"), "a.obj", &file));
    for change in ["[film]\nwidth = 1\nheight = 1\n", "[sun]\ndirection = [0,1,0]\nirradiance = 1\n"] {
        assert_ne!(original, hash(ROOF, "a.obj", &format!("{file}{change}")));
    }
    assert_ne!(original, hash(ROOF, "a.obj", &file.replace("radiance = 1", "radiance = 1.5")));
    let with_holes = |opacity: f32| hash(ROOF, "a.obj", &format!("{file}[material.default]\nopacity = {opacity:?}\n"));
    assert!(with_holes(1.0) == original && with_holes(0.5) != original && with_holes(0.25) != with_holes(0.5));
}

#[path = "../examples/make_scenes/main.rs"]
mod make_scenes;

const SHIPPED: [&str; 8] = ["cornell", "preview", "many_lights", "furnace", "sky", "still_life", "mosaic", "foliage"];

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
    assert!(total < 2 << 20, "{total} bytes");
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
        assert!(scene.film.width <= 256 && scene.film.height <= 256);
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

#[test]
fn a_file_of_one_material_says_what_a_scene_says_of_it() {
    let table = "type = \"coated\"\nalbedo = [0.1, 0.2, 0.3]\nroughness = 0.5\n";
    let folder = Folder::new(&[
        ("m.toml", table),
        ("bad.toml", "type = \"coated\"\nalbdo = 1\n"),
        ("lamp.toml", "emission = 1\n"),
    ]);
    let (surface, brdfs) = Surface::load(folder.path("m.toml"), None).unwrap();
    let scene = toml(&format!("[[mesh]]\nfile = \"a.obj\"\n[material.m]\n{table}[environment]\nradiance = 1\n"));
    assert_eq!((surface, brdfs), (scene.materials[0].surface.clone(), vec![]));

    let error = |name: &str, material| Surface::load(folder.path(name), material).unwrap_err().to_string();
    assert!(
        error("bad.toml", None).ends_with("bad.toml:2: unknown key `albdo`; the nearest that is known is `albedo`")
    );
    assert!(error("lamp.toml", None).contains("lamp.toml:1: emission: found `1`, expected no such key"));
    assert!(error("m.toml", Some("x")).contains("found the name `x`, expected no name"));
    assert!(error("none.toml", None).contains("none.toml: cannot be read"));
}

#[test]
fn every_shipped_material_loads() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/materials");
    let mut kinds = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let (surface, brdfs) = Surface::load(&path, None).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(matches!(surface, Surface::Measured { .. }), brdfs.len() == 1, "{}", path.display());
        kinds.push(std::mem::discriminant(&surface));
    }
    assert!(kinds.len() >= 10);
}
