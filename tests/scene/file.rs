//! Scene files, and what is made of a bare OBJ file.

use super::*;

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
        ("[[mesh]]\nfile = 'b.obj'\n", vec!["b.obj: cannot be read", "s.toml:2: mesh[0].file"]),
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
        ("[environment]\nfile = 'a.obj'\n", vec!["a.obj", "an OpenEXR or Radiance (.hdr) image"]),
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

/// What a scene is made of, wherever it is named; and what a file names, without a look into that.
#[test]
fn the_files_of_a_scene_are_known() {
    let text =
        "[[mesh]]\nfile = 'a.obj'\n[material.m]\ntexture = { file = 'T.png' }\n[environment]\nfile = 'sky.exr'\n";
    let obj = TRIANGLE.replace("usemtl", "vt 0 0\nusemtl").replace("1 2 3", "1/1 2/1 3/1");
    let mtl = "newmtl m\nmap_d holes.png\nmap_Kd t.png\nbump none.png\n";
    let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", mtl), ("s.toml", text)]);
    ["t.png", "holes.png"].iter().for_each(|name| image::RgbImage::new(1, 1).save(folder.path(name)).unwrap());
    exr::prelude::write_rgb_file(folder.path("sky.exr"), 2, 1, |_, _| (1.0f32, 1.0f32, 1.0f32)).unwrap();
    let (_, _, files) = Scene::load_with_files(folder.path("s.toml")).unwrap();
    let expected = ["a.mtl", "a.obj", "holes.png", "sky.exr", "t.png"].map(|name| folder.path(name));
    assert_eq!(files.into_iter().collect::<Vec<_>>(), expected);
    let mut named = named_files(folder.path("s.toml"));
    named.sort();
    assert_eq!(named, ["a.obj", "sky.exr", "t.png"].map(|name| folder.path(name)));
    assert!(named_files(folder.path("a.obj")).is_empty() && named_files(folder.path("none.toml")).is_empty());
}
