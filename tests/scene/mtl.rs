//! MTL files.

use super::*;

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

/// Numbers that exporters write of opaque, textured and coated materials, though they say otherwise.
#[test]
fn what_exporters_write_is_taken_as_meant() {
    let textured = Color { value: Vec3::ONE, texture: Some(0) };
    let grey = Color::constant(Vec3::splat(0.5));
    let coated = |albedo| Surface::Coated { albedo, ior: 1.5, alpha: 0.0 };
    for (text, surface, says) in [
        (
            "illum 4\nKd 0 0 0\nTf 1 1 1\nmap_Kd t.png\nNi 1.00\n",
            Surface::Diffuse { albedo: textured },
            vec!["Kd 0 would make `map_Kd` black", "`illum 4` does not make it glass, as it has `map_Kd`"],
        ),
        ("illum 4\nmap_Kd t.png\nNi 1.5\n", Surface::Diffuse { albedo: textured }, vec!["as it has `map_Kd`"]),
        ("illum 9\nd .5\nmap_Kd t.png\n", Surface::Diffuse { albedo: textured }, vec!["as it has `map_Kd`"]),
        ("illum 4\nKd .5 .5 .5\nNi 1\n", Surface::Diffuse { albedo: grey }, vec!["`Ni 1` refracts nothing"]),
        ("Kd 0\nKs .5\nmap_Kd t.png\n", coated(textured), vec!["Kd 0 would make `map_Kd` black"]),
        ("Kd .5\nKs .5\nNi 1\n", coated(grey), vec!["a coat of Ni 1 would reflect nothing: taken as 1.5"]),
        ("Kd .5\nKs .5\nNi 0\n", coated(grey), vec!["a coat of Ni 0 would reflect nothing: taken as 1.5"]),
        ("illum 4\nNi 1.2\n", Surface::Dielectric { ior: 1.2, alpha: 0.0 }, vec![]),
    ] {
        let obj = TRIANGLE.replace("usemtl", "vt 0 0\nusemtl").replace("1 2 3", "1/1 2/1 3/1");
        let folder = Folder::new(&[("a.obj", &obj), ("a.mtl", &format!("newmtl m\n{text}"))]);
        image::RgbImage::new(1, 1).save(folder.path("t.png")).unwrap();
        let (scene, warnings) = folder.load("a.obj").unwrap();
        assert_eq!(scene.materials[0].surface, surface, "{text}");
        assert_eq!(warnings.len(), says.len(), "{text}: {warnings:?}");
        for (warning, part) in warnings.iter().map(Warning::to_string).zip(says) {
            assert!(warning.contains(part) && warning.contains("a.mtl:1: material `m`"), "{warning}: lacks {part}");
        }
    }
}

/// Models come without their textures; what else their materials say is there to be seen.
#[test]
fn a_missing_texture_of_an_mtl_is_a_warning() {
    let grey = |value| Surface::Diffuse { albedo: Color::constant(Vec3::splat(value)) };
    for (text, surface, says) in [
        ("Kd .25\nmap_Kd none.png\n", grey(0.25), "none.png: `map_Kd` is ignored, and `Kd` counts alone"),
        ("map_Kd -s 2 2 none.png # red\n", grey(0.5), "none.png: `map_Kd` is ignored"),
        ("Kd 0\nmap_Kd none.png\n", grey(0.5), "and 0.5 taken for the `Kd 0`"),
        ("map_d none.png\n", grey(0.5), "`map_d` is ignored"),
        ("Ke 0\nmap_Ke none.png\n", grey(0.5), "`map_Ke` is ignored"),
        ("bump none.png\n", grey(0.5), "`bump` is ignored"),
        ("norm none.png\n", grey(0.5), "`norm` is ignored"),
        ("map_Pm none.png\n", grey(0.5), "`map_Pm` is ignored"),
    ] {
        let (material, warnings) = mtl(text);
        assert_eq!(material, Material::new("m", surface), "{text}");
        assert!(warnings.len() == 1 && warnings[0].contains(says), "{text}: {warnings:?}");
        assert!(warnings[0].contains("a.mtl:1: material `m`: there is no "), "{text}: {warnings:?}");
    }
    // Leaves do not become glass for want of their texture.
    let (material, _) = mtl("illum 9\nmap_Kd none.png\n");
    assert_eq!(material.surface, grey(0.5));
    // Whoever wrote the scene file has the files that it names.
    let error = toml_error("[[mesh]]\nfile = 'a.obj'\n[material.m]\ntexture = 'none.png'\n");
    assert!(error.contains("none.png: cannot be read"), "{error}");
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
fn what_lies_out_of_range_is_clamped_with_a_warning() {
    for (text, inside) in [("Pr 1.5", "Pr 1"), ("Pm 5", "Pm 1"), ("aniso 2", "aniso 1"), ("Ni 20", "Ni 10")] {
        let coated = "Kd .5\nKs 1\nillum 2\n";
        let (material, warnings) = mtl(&format!("{coated}{text}\n"));
        assert!(warnings.len() == 1 && warnings[0].contains(&format!("{text} is outside of")), "{warnings:?}");
        let (expected, warnings) = mtl(&format!("{coated}{inside}\n"));
        assert!(warnings.is_empty() && material == expected, "{inside}: {warnings:?}");
    }
}

#[test]
fn mtl_materials_dissolve() {
    for (text, value, says) in [
        ("Kd 1\n", 1.0, None),
        ("d .25\n", 0.25, None),
        ("d -halo .25\n", 0.25, None),
        ("Tr .25\n", 1.0, None),
        ("d 1.5\n", 1.0, Some("d 1.5 is outside of [0, 1]: clamped to 1")),
        ("d 0\n", 0.0, Some("cannot be seen")),
        ("d .25\nillum 7\n", 1.0, None),
        ("d .25\nKe 1\n", 1.0, Some("ignored, as it emits")),
    ] {
        let (material, warnings) = mtl(text);
        assert_eq!(material.opacity, Opacity { value, texture: None }, "{text}");
        assert_eq!(warnings.len(), usize::from(says.is_some()), "{text}: {warnings:?}");
        says.iter().for_each(|part| assert!(warnings[0].contains(part), "{warnings:?}"));
    }
    // What a scene file makes glass is all there, as what an MTL file does.
    for (says, value) in [
        ("type = 'dielectric'", 1.0),
        ("type = 'dielectric'\nopacity = 0.5", 0.5),
        ("type = 'coated'", 0.25),
        ("albedo = 1", 0.25),
    ] {
        let toml = format!("[[mesh]]\nfile = 'a.obj'\n[material.m]\n{says}\n{SKY}");
        let files = [("a.obj", TRIANGLE), ("a.mtl", "newmtl m\nd .25\n"), ("s.toml", &toml)];
        assert_eq!(Folder::new(&files).scene("s.toml").materials[0].opacity.value, value, "{says}");
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
    ] {
        let files = [("a.obj", TRIANGLE), ("a.mtl", &format!("newmtl m\n{text}"))];
        let error = Folder::new(&files).load("a.obj").map(|_| ()).unwrap_err().to_string();
        parts.iter().for_each(|part| assert!(error.contains(part), "{error}: lacks {part}"));
    }
}
