//! OBJ files.

use super::*;

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
fn statements_without_effect_warn_where_something_is_missing() {
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    for (statement, says) in [
        ("call other.obj", Some("the file of `call other.obj` is not read: put its statements here")),
        ("csh cat other.obj", Some("the command of `csh cat other.obj` is not run")),
        ("surf 0 1 0 1 1 2 3", Some("`surf` (points, lines, curves and their surfaces) is not rendered")),
        ("bzp 1 2 3", Some("`bzp`")),
        ("cstype bezier", None),
        ("usemap none", None),
        ("shadow_obj other.obj", None),
        ("lod 3", None),
    ] {
        let (scene, warnings) = obj(&format!("{triangle}{statement}\n{statement}\n"));
        assert_eq!(scene.meshes[0].triangles.len(), 1);
        assert_eq!(warnings.len(), usize::from(says.is_some()), "{statement}: {warnings:?}");
        for (warning, part) in warnings.iter().map(Warning::to_string).zip(says) {
            assert!(warning.contains("a.obj:5: ") && warning.contains(part), "{warning}");
        }
    }
}

/// Steps of an `f32` are 0.5 there.
#[test]
fn far_meshes_keep_their_shape() {
    let far = "v 512345.125 5412345.25 -.25 # a corner\nv 512346.375 5412345.25 0 1 0 0\nv 512345.125 5412346.3125 0\nf 1 2 3\n";
    let edges = |scene: &Scene| {
        let [a, b, c] = triangles(&scene.meshes[0])[0];
        [b - a, c - a]
    };
    let expected = [Vec3::new(1.25, 0.0, 0.25), Vec3::new(0.0, 1.0625, 0.25)];
    let (bare, warnings) = obj(far);
    assert_eq!(edges(&bare), expected);
    assert!(bare.bounds().center().length() < 1.0);
    assert!(warnings.len() == 1 && warnings[0].to_string().contains("rounded to 0.5: its point ["), "{warnings:?}");

    let mesh = |transform: &str| format!("[[mesh]]\nfile = 'a.obj'\n{transform}\n{SKY}");
    let brought = mesh("transform = { translate = [-512345, -5412345, 0] }");
    let folder = Folder::new(&[("a.obj", far), ("there.toml", &mesh("")), ("brought.toml", &brought)]);
    let brought = folder.scene("brought.toml");
    assert_eq!(edges(&brought), expected);
    let corner = brought.instances[0].object_to_world.transform_point3(triangles(&brought.meshes[0])[0][0]);
    assert!(corner.distance(Vec3::new(0.125, 0.25, -0.25)) < 1e-6, "{corner}");
    let (there, warnings) = folder.load("there.toml").unwrap();
    assert_eq!(edges(&there), expected);
    assert!(there.bounds().center().distance(Vec3::new(512345.75, 5412345.75, -0.125)) <= 1.0);
    assert!(
        warnings.len() == 1 && warnings[0].to_string().contains("are rounded to 0.5: bring the meshes to the origin"),
        "{warnings:?}"
    );
    let hundreds_of_sizes_away = obj("v 100 0 0\nv 101 0 0\nv 100 1 0\nf 1 2 3\n");
    assert_eq!(hundreds_of_sizes_away.0.meshes[0].positions[0], Vec3::new(100.0, 0.0, 0.0));
    assert!(hundreds_of_sizes_away.1.is_empty());
}

#[test]
fn a_texture_without_coordinates_warns() {
    let others = format!("{TRIANGLE}vt 0 0\nusemtl n\nf 1/1 2/1 3/1\nusemtl plain\nf 1 3 2\n");
    let mtl = "newmtl m\nmap_Kd t.png\nnewmtl n\nmap_Kd t.png\nnewmtl plain\nKd 1 1 1\n";
    let folder = Folder::new(&[("a.obj", TRIANGLE), ("b.obj", &others), ("a.mtl", mtl)]);
    image::RgbImage::new(1, 1).save(folder.path("t.png")).unwrap();
    for name in ["a.obj", "b.obj"] {
        let (_, warnings) = folder.load(name).unwrap();
        let expected = format!("{name}: faces without texture coordinates, though their material `m` has a texture");
        assert!(warnings.len() == 1 && warnings[0].to_string().ends_with(&expected), "{warnings:?}");
    }
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

/// Windows programs begin texts with a mark of their encoding.
#[test]
fn byte_order_marks_are_skipped() {
    let toml = format!("\u{feff}[[mesh]]\nfile = 'a.obj'\n[material.m]\ntype = 'measured'\nfile = 'a.csv'\n{SKY}");
    let folder = Folder::new(&[
        ("a.obj", &format!("\u{feff}# C:\\models\\\n{TRIANGLE}")),
        ("a.mtl", "\u{feff}newmtl m\nKd .2 .4 .6\n"),
        ("a.csv", "\u{feff}wi_theta,wi_phi,wo_theta,wo_phi,r,g,b\n10,0,10,180,1,1,1\n"),
        ("s.toml", &toml),
    ]);
    let albedo = Color::constant(Vec3::new(0.2, 0.4, 0.6));
    assert_eq!(folder.scene("a.obj").materials[0].surface, Surface::Diffuse { albedo });
    assert_eq!(folder.scene("s.toml").brdfs.len(), 1);
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
fn an_mtl_file_that_is_named_again_is_read_once() {
    let folder = Folder::new(&[("a.obj", &format!("mtllib a.mtl\n{TRIANGLE}o two\nmtllib a.mtl\nf 1 3 2\n"))]);
    let warnings = |folder: &Folder| folder.load("a.obj").unwrap().1;
    assert_eq!(warnings(&folder).len(), 2, "there is none, and the material is not defined: {:?}", warnings(&folder));
    fs::write(folder.path("a.mtl"), "newmtl m\nmap_Ks a.png\n").unwrap();
    assert_eq!(warnings(&folder).len(), 1, "{:?}", warnings(&folder));
}

#[test]
fn an_obj_file_may_name_several_mtl_files() {
    let color = |text: &str, files: &[(&str, &str)]| {
        let folder = Folder::new(&[("a.obj", &format!("mtllib {text}\n{TRIANGLE}"))]);
        fs::create_dir(folder.path("sub")).unwrap();
        files.iter().for_each(|(name, text)| fs::write(folder.path(name), text).unwrap());
        folder.load("a.obj").unwrap().0.materials[0].surface.clone()
    };
    let white = Surface::Diffuse { albedo: Color::constant(Vec3::ONE) };
    let (mine, other) = ("newmtl m\nKd 1\n", "newmtl n\n");
    assert_eq!(color("a.mtl sub/b.mtl", &[("a.mtl", other), ("sub/b.mtl", mine), ("b.mtl", other)]), white);
    assert_eq!(color("was/a.mtl was/b.mtl", &[("a.mtl", mine), ("b.mtl", other)]), white);
    assert_eq!(color("my own.mtl", &[("my own.mtl", mine), ("own.mtl", other)]), white);
}

#[test]
fn faces_of_two_corners_are_left_out_with_one_warning() {
    let (scene, warnings) = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1 2 3\nf 2 3\n");
    assert_eq!(scene.meshes[0].triangles.len(), 1);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].to_string().contains("a.obj:4: a face of 2 corners has no area"), "{}", warnings[0]);
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
        ("v 0 0 0\nf 1 1\n", vec!["a.obj: found no triangle"]),
        ("v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r", vec!["a.obj:1", "lines that end in CR alone", "LF or CR LF"]),
        ("# Made on a Macintosh\rv 0 0 0\r", vec!["a.obj:1", "lines that end in CR alone"]),
        ("v 0 0 0\nff 1 1 1\n", vec!["a.obj:2", "the statement `ff`"]),
        ("v 0 0 0\n", vec!["a.obj: found no triangle"]),
        ("usemtl\n", vec!["a.obj:1", "no name"]),
        ("v/1\u{1}\u{2}\0\n", vec!["a.obj:1", "bytes that are no text", "an OBJ file"]),
    ] {
        let error = Folder::new(&[("a.obj", text)]).load("a.obj").map(|_| ()).unwrap_err().to_string();
        parts.iter().for_each(|part| assert!(error.contains(part), "{error}: lacks {part}"));
    }
}

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
fn faces_keep_what_their_neighbours_lack() {
    let (scene, warnings) = obj(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 1\nvn 0 1 1\no one\nf 1/1/1 2/1/1 3/1/1\no two\nf 1//1 3//1 2//1\nf 1/1 2/1 3/1\n",
    );
    let mesh = &scene.meshes[0];
    let uvs: Vec<Vec2> = (0..3).map(|triangle| mesh.corner_uvs(triangle)[0]).collect();
    assert_eq!(uvs, [Vec2::new(0.5, 1.0), Vec2::ZERO, Vec2::new(0.5, 1.0)]);
    let normals: Vec<Vec3> = mesh.triangles.iter().map(|corners| mesh.normals[corners[0] as usize]).collect();
    let given = Vec3::new(0.0, 1.0, 1.0).normalize();
    assert!(
        normals.iter().zip([given, given, Vec3::Z]).all(|(normal, expected)| normal.distance(expected) < 1e-6),
        "{normals:?}"
    );
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn corners_with_and_without_coordinates_warn() {
    let (scene, warnings) = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2 3/1\n");
    assert!(scene.meshes[0].uvs.is_empty());
    assert!(warnings[0].to_string().contains("some corners of faces have texture coordinates"), "{}", warnings[0]);
}
