//! Textures and skies: how they are read, and where materials have them.

use super::*;

/// Writes an EXR whose texel (x, y) is `color(x, y)`.
fn write_exr(path: &Path, width: usize, height: usize, color: impl Fn(usize, usize) -> (f32, f32, f32) + Sync) {
    exr::prelude::write_rgb_file(path, width, height, color).unwrap();
}

/// An OBJ file of a.mtl's materials, a triangle with texture coordinates each.
fn triangles_of(materials: &[&str]) -> String {
    let triangles = materials.iter().map(|material| format!("usemtl {material}\nf 1/1 2/1 3/1\n"));
    format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n{}", triangles.collect::<String>())
}

#[test]
fn textures_decode_to_linear_and_load_once() {
    let mtl = "newmtl a\nmap_Kd -clamp on t.png\nnewmtl b\nKd .5 .5 .5\nmap_Kd t.png\nnewmtl c\nmap_Kd t.exr\nnewmtl d\nmap_Kd unused.png\n";
    let obj = triangles_of(&["a", "b", "c", "d"]);
    let toml = format!("[[mesh]]\nfile = 'a.obj'\n[material.d]\nalbedo = 0.5\n[material.a]\n{SKY}");
    let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", mtl), ("s.toml", &toml)]);
    let image = image::RgbImage::from_fn(2, 1, |x, _| image::Rgb([x as u8 * 255, 128, 0]));
    image.save(folder.path("t.png")).unwrap();
    write_exr(&folder.path("t.exr"), 1, 2, |_, y| (y as f32, 0.25, 2.0));

    let (scene, warnings) = folder.load("s.toml").unwrap();
    assert_eq!(scene.textures.len(), 2, "an overridden texture is not even looked for");
    let half = |rgb: [f32; 3]| [rgb[0], rgb[1], rgb[2], 1.0].map(f16::from_f32);
    assert_eq!(*scene.textures[0].texels, [half([0.0, 0.2158605, 0.0]), half([1.0, 0.2158605, 0.0])]);
    assert_eq!(*scene.textures[1].texels, [half([0.0, 0.25, 1.0]), half([1.0, 0.25, 1.0])]);
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
    assert!(warnings.iter().any(|warning| warning.contains("`map_Kd -clamp` is not supported")), "{warnings:?}");
    assert!(warnings.iter().any(|warning| warning.contains("2 texels lie outside of [0, 1]")), "{warnings:?}");
}

/// Names of other systems: quotes, backslashes, drives, other cases. A file that is not there stays an error.
#[test]
fn files_are_found_by_the_names_of_other_systems() {
    let names = [
        "wood.png",
        "./wood.png",
        "\"wood.png\"",
        "tex\\wood.png",
        "Tex\\WOOD.png",
        "C:\\art\\wood.png",
        "/art/Wood.PNG",
    ];
    let materials: Vec<String> = (0..names.len()).map(|index| format!("m{index}")).collect();
    let obj = triangles_of(&materials.iter().map(String::as_str).collect::<Vec<_>>()).replace("a.mtl", "\"A.mtl\"");
    let texture = |(material, name)| format!("newmtl {material}\nmap_Kd {name}\n");
    let mtl: String = materials.iter().zip(names).map(texture).collect();
    let toml = format!("[[mesh]]\nfile = 'A.obj'\n[material.m0]\nnormal_map = '..\\WOOD.png'\n{SKY}");
    let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", &mtl), ("s.toml", &toml)]);
    fs::create_dir(folder.path("tex")).unwrap();
    for name in ["wood.png", "tex/wood.png"] {
        image::RgbImage::new(1, 1).save(folder.path(name)).unwrap();
    }
    let (scene, warnings) = folder.load("s.toml").unwrap();
    let texture = |material: &Material| material.surface.texture().unwrap();
    assert_eq!(scene.materials.iter().map(texture).collect::<Vec<_>>(), [0, 0, 0, 2, 2, 0, 0]);
    let warnings: Vec<String> = warnings.iter().map(Warning::to_string).collect();
    for (part, found) in [
        ("s.toml:2: mesh[0].file: there is no `A.obj`", "a.obj"),
        ("a.obj:1: there is no `\"A.mtl\"`", "a.mtl"),
        ("material `m4`: there is no `Tex\\WOOD.png`", "tex/wood.png"),
        ("material `m5`: there is no `C:\\art\\wood.png`", "wood.png"),
        ("material `m6`: there is no `/art/Wood.PNG`", "wood.png"),
        ("s.toml:4: material.m0.normal_map: there is no `..\\WOOD.png`", "wood.png"),
    ] {
        let taken = format!("{} is taken", folder.path(found).display());
        assert!(
            warnings.iter().any(|warning| warning.contains(part) && warning.ends_with(&taken)),
            "{part}: {warnings:?}"
        );
    }
    assert_eq!(warnings.len(), 6, "{warnings:?}");
    fs::write(folder.path("a.mtl"), mtl.replace("C:\\art\\wood", "C:\\art\\steel")).unwrap();
    let (_, warnings) = folder.load("s.toml").unwrap();
    let missing: Vec<String> = warnings.iter().map(Warning::to_string).filter(|said| said.contains("steel")).collect();
    assert!(missing.len() == 1 && missing[0].contains("material `m5`: there is no "), "{missing:?}");
}

/// A file is one texture as a colour and another as an opacity: its alpha, or where it has none its brightness, as it is written.
#[test]
fn opacities_are_alphas_or_brightnesses() {
    let mtl = "newmtl a\nmap_Kd t.png\nmap_d t.png\nnewmtl b\nmap_d -clamp on grey.png\nd .5\nnewmtl c\nnewmtl d\nmap_d whole.png\n";
    let obj = triangles_of(&["a", "b", "c", "d"]);
    let toml = format!("[[mesh]]\nfile = 'a.obj'\n[material.c]\nopacity = 't.exr'\n{SKY}");
    let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", mtl), ("s.toml", &toml)]);
    let pixel = |x| image::Rgba([255, 0, 0, x as u8 * 51]);
    image::RgbaImage::from_fn(2, 1, |x, _| pixel(x)).save(folder.path("t.png")).unwrap();
    image::GrayImage::from_fn(2, 1, |x, _| image::Luma([51 + x as u8])).save(folder.path("grey.png")).unwrap();
    image::RgbaImage::from_fn(1, 1, |_, _| image::Rgba([51, 51, 51, 255])).save(folder.path("whole.png")).unwrap();
    write_exr(&folder.path("t.exr"), 1, 1, |_, _| (0.25, 0.25, 0.25));

    let (scene, warnings) = folder.load("s.toml").unwrap();
    let warnings: Vec<String> = warnings.iter().map(Warning::to_string).collect();
    assert!(warnings.len() == 1 && warnings[0].contains("`map_d -clamp` is not supported"), "{warnings:?}");
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

/// The alpha of a file that another material names as its opacity, too.
#[test]
fn a_material_whose_texture_makes_no_holes_is_told() {
    let mtl = "newmtl a\nmap_Kd t.png\nnewmtl b\nmap_Kd t.png\nmap_d t.png\nmap_Pm t.png\n";
    let folder = Folder::new(&[("a.obj", &triangles_of(&["a", "b"])), ("a.mtl", mtl)]);
    image::RgbaImage::new(1, 1).save(folder.path("t.png")).unwrap();
    let warnings = folder.load("a.obj").unwrap().1;
    assert!(warnings.len() == 1, "{warnings:?}");
    assert!(warnings[0].to_string().contains("its alpha makes no holes in the material `a`"), "{}", warnings[0]);
    fs::write(folder.path("a.mtl"), mtl.replace("map_Kd t.png\nnewmtl", "newmtl")).unwrap();
    folder.scene("a.obj");
}

/// A file that is no image, or is one of a kind that is not read: the error says which kinds are, and what names it.
#[test]
fn an_unreadable_texture_is_told_with_what_names_it() {
    let folder = Folder::new(&[("a.obj", &triangles_of(&["m"])), ("x.gif", "GIF89a..."), ("cut.png", "\u{89}PNG")]);
    image::RgbImage::new(9, 9).save(folder.path("whole.png")).unwrap();
    let whole = fs::read(folder.path("whole.png")).unwrap();
    fs::write(folder.path("cut.png"), &whole[..whole.len() / 2]).unwrap();
    for (name, what) in
        [("x.gif", "x.gif: found a file of another kind ("), ("cut.png", "cut.png: found a broken image (")]
    {
        fs::write(folder.path("a.mtl"), format!("newmtl m\nmap_Kd {name}\n")).unwrap();
        let error = folder.load("a.obj").map(|_| ()).unwrap_err().to_string();
        for part in [what, "expected a PNG, JPEG", "(named by ", "a.mtl:1: material `m`)"] {
            assert!(error.contains(part), "{error}: lacks {part}");
        }
    }
}

#[test]
fn a_comment_may_follow_a_files_name() {
    let folder = Folder::new(&[("a.obj", &triangles_of(&["m"]).replace("a.mtl", "a.mtl # materials"))]);
    for (named, file) in [("t.png # red", "t.png"), ("t#1.png\t# red", "t#1.png"), ("t #2.png", "t #2.png")] {
        image::RgbImage::new(1, 1).save(folder.path(file)).unwrap();
        fs::write(folder.path("a.mtl"), format!("newmtl m\nmap_Kd {named}\n")).unwrap();
        assert_eq!(folder.scene("a.obj").textures[0].name, file);
    }
}

/// What is called a bump map holds normals, or heights; one that cannot be read is left out with a warning.
#[test]
fn bump_maps_may_hold_normals_or_heights() {
    let obj = triangles_of(&["a", "b", "c", "d"]);
    let mtl = "newmtl a\nmap_Bump -bm 1.0 normals.png\nnewmtl b\nbump -bm 2 heights.png\nnewmtl c\nnorm normals.tga\nnewmtl d\nmap_bump none.tif\n";
    let toml = format!("[[mesh]]\nfile = 'a.obj'\n[material.b]\n{SKY}");
    let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", mtl), ("s.toml", &toml), ("none.tif", "II*")]);
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
    let obj = triangles_of(&["metal", "paint", "chalk"]);
    let mtl = "newmtl metal\nPm 1\nPr 0.3\nmap_Pr -clamp on rough.png\nnewmtl paint\nKs 1 1 1\nmap_Pr rough.png\nnewmtl chalk\nmap_Pr rough.png\n";
    let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", mtl)]);
    image::GrayImage::from_fn(2, 1, |x, _| image::Luma([90 * x as u8])).save(folder.path("rough.png")).unwrap();
    let load = |of_scene: &str| {
        fs::write(folder.path("s.toml"), format!("[[mesh]]\nfile = 'a.obj'\n{of_scene}\n{SKY}")).unwrap();
        folder.load("s.toml")
    };
    let maps = |of_scene: &str| load(of_scene).unwrap().0.materials.iter().map(|m| m.roughness_map).collect::<Vec<_>>();

    let (scene, warnings) = load("").unwrap();
    assert_eq!(maps(""), [Some(0), Some(0), None], "chalk is diffuse");
    assert_eq!(scene.textures[0].texels[1][0], f16::from_f32(90.0 / 255.0), "as it is written");
    assert!(warnings.len() == 1 && warnings[0].to_string().contains("map_Pr -clamp"), "{warnings:?}");
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

/// A map of anisotropy is kept as the cosine and sine of twice its angles, and stands where there is something to turn.
#[test]
fn maps_of_anisotropy_load() {
    let folder = Folder::new(&[("a.obj", &triangles_of(&["a", "b"])), ("a.mtl", "newmtl a\nnewmtl b\n")]);
    // Along u, v, and half-way; the last one points nowhere.
    let texels = [[255, 128], [128, 255], [218, 218], [128, 128]];
    let image = image::RgbImage::from_fn(4, 1, |x, _| {
        let [red, green] = texels[x as usize];
        image::Rgb([red, green, 0])
    });
    image.save(folder.path("turn.png")).unwrap();
    let load = |of_scene: &str| {
        fs::write(folder.path("s.toml"), format!("[[mesh]]\nfile = 'a.obj'\n{of_scene}\n{SKY}")).unwrap();
        folder.load("s.toml")
    };
    let map = "anisotropy_direction_map = 'turn.png'";
    let (scene, warnings) =
        load(&format!("[material.a]\ntype = 'conductor'\nmetal = 'gold'\nalpha = [0.1, 0.4]\n{map}")).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!([0, 1].map(|i| scene.materials[i].anisotropy_direction_map), [Some(0), None]);
    let doubled: Vec<[f32; 2]> =
        scene.textures[0].texels.iter().map(|texel| [texel[0].to_f32(), texel[1].to_f32()]).collect();
    for (found, expected) in doubled.iter().zip([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.02), "{doubled:?}");
    }
    let plain = load("[material.a]\ntype = 'conductor'\nmetal = 'gold'\nalpha = [0.1, 0.4]").unwrap().0;
    assert_ne!(plain.hash(), scene.hash());
    for of_scene in ["type = 'coated'", "type = 'dielectric'", "albedo = 0.5"] {
        let error = load(&format!("[material.a]\n{of_scene}\n{map}")).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("conductor, measured, layered or woven"), "{error}");
    }
    let mut coated = scene.clone();
    coated.materials[0].surface = Surface::Coated { albedo: Color::constant(Vec3::ONE), ior: 1.5, alpha: 0.1 };
    assert!(coated.check().unwrap_err().to_string().contains("anisotropy"));
}

/// Where a texture lies: options of MTL, tables in scene files.
#[test]
fn textures_are_placed() {
    let obj = triangles_of(&["a", "b"]);
    let mtl = "newmtl a\nmap_Kd -s 4 2 1 -o 0.5 a.png\nmap_Ke -o 0 -0.25 0 a.png\nnorm -s 3 a.png\nmap_d -s 1 2 a.png\n\
               newmtl b\nPm 1\nmap_Kd a.png\nmap_Pr -s 5 5 a.png\nmap_Bump -bm 2 -s -1 1 a.png\n";
    let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", &mtl.replace("map_d -s 1 2 a.png\n", ""))]);
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
    let texels = |texture: Option<u32>| &scene.textures[texture.unwrap() as usize].texels;
    assert!(Arc::ptr_eq(texels(a.surface.texture()), texels(a.emission_texture)), "an image is there once");
    assert!(!Arc::ptr_eq(texels(a.surface.texture()), texels(a.normal_map)), "as colours and as normals");
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
    let obj = triangles_of(&["paint", "lamp"]);
    let mtl = "newmtl paint\nKs 0.5 0.5 0.5\nPm 1\nPr 0.5\nKd 0.8 0.4 0.2\nmap_Kd a.png\nmap_Pr -s 2 2 a.png\nmap_Pm -s 3 3 a.png\nnorm a.png\n\
               newmtl lamp\nKe 1 1 1\nmap_Pm a.png\n";
    let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", mtl)]);
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
    let obj = triangles_of(&["a", "b", "c", "d", "e"]);
    let mtl = "newmtl a\nKe 3 2 1\nmap_Ke glow.png\nnewmtl b\nmap_Ke glow.png\nnewmtl c\nKd 1 1 1\nnewmtl d\nKd 1 1 1\nnewmtl e\nKe 0 0 0\nmap_Ke glow.png\n";
    let toml = "[[mesh]]\nfile = 'a.obj'\n[material.c]\nemission = 7\nemission_texture = 'glow.png'\n[material.d]\nemission_texture = 'glow.png'\n";
    let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", mtl), ("s.toml", toml)]);
    image::GrayImage::from_fn(2, 1, |x, _| image::Luma([255 * x as u8])).save(folder.path("glow.png")).unwrap();
    let (scene, warnings) = folder.load("s.toml").unwrap();
    assert!(warnings.len() == 1 && warnings[0].to_string().contains("material `e`: Ke 0 would make"), "{warnings:?}");
    let emission: Vec<Vec3> = scene.materials.iter().map(|material| material.emission).collect();
    assert_eq!(emission, [Vec3::new(3.0, 2.0, 1.0), Vec3::ONE, Vec3::splat(7.0), Vec3::ONE, Vec3::ONE]);
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

/// A texel is three codes and an exponent, 128 of 2¹²⁹ being 1.
#[test]
fn radiance_files_are_skies_and_textures() {
    let toml = "[[mesh]]\nfile = 'a.obj'\n[material.default]\ntexture = 'sky.hdr'\n[environment]\nfile = 'sky.hdr'\nscale = 4\n";
    let folder = Folder::new(&[("a.obj", ROOF), ("s.toml", toml)]);
    let write = |header: &str, texels: [u8; 8]| {
        fs::write(folder.path("sky.hdr"), [header.as_bytes(), &texels].concat()).unwrap();
        folder.load("s.toml").map_err(|error| error.to_string())
    };
    let header = "#?RADIANCE\n# made\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 1 +X 2\n";
    let texels = [128, 64, 32, 129, 128, 0, 0, 131];
    for header in [header, &header.replace("RADIANCE", "RGBE")] {
        let (scene, warnings) = write(header, texels).unwrap();
        let sky = scene.environment.unwrap();
        assert_eq!((sky.width, sky.height), (2, 1));
        assert_eq!(sky.texels, [Vec3::new(4.0, 2.0, 1.0), Vec3::new(16.0, 0.0, 0.0)]);
        assert_eq!(scene.textures[0].texels[0], [1.0, 0.5, 0.25, 1.0].map(f16::from_f32));
        assert!(
            warnings.iter().any(|warning| warning.to_string().contains("1 texels lie outside of [0, 1]")),
            "{warnings:?}"
        );
    }
    for (header, exponent, part) in [
        (header.to_owned(), 255, "at most 1e12"),
        (header.replace("-Y 1", "-Y 9999999"), 129, "an image of 2 × 9999999 texels"),
        (header.replace("-Y 1", "-Y 2"), 129, "a broken image"),
        (header.replace("\n\n", "\n"), 129, "no end of the header"),
        (format!("#?RADIANCE\n{}\n{header}", "x".repeat(1 << 16)), 129, "no end of the header"),
    ] {
        let error = write(&header, [1, 1, 2, exponent, 0, 0, 0, 0]).map(|_| ()).unwrap_err();
        assert!(error.contains("sky.hdr") && error.contains(part), "{part}: {error}");
    }
}
