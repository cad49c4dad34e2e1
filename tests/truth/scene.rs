//! What scene files say of these surfaces.

use std::fs;

use glam::{Vec2, Vec3};
use neubrdf::scene::{Brdf, Color, Fresnel, LayerBase, Layered, Scene, Surface};

use crate::common::tables::{self, metal};

/// The surface that a table of a scene file makes of the material `m`, and the BRDFs that the scene then has.
fn load(table: &str) -> Result<(Surface, Scene), String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n").unwrap();
    fs::write(folder.path().join("a.csv"), "wi_theta,wi_phi,wo_theta,wo_phi,r,g,b\n10,0,20,30,0.1,0.2,0.3\n").unwrap();
    fs::write(folder.path().join("a.bsdf"), tables::rgl(&metal(0.3, 0.3), vec![0.0], 4).tables().encode()).unwrap();
    fs::write(folder.path().join("a.toml"), format!("[[mesh]]\nfile = \"a.obj\"\n[material.m]\n{table}")).unwrap();
    let (scene, _) = Scene::load(folder.path().join("a.toml")).map_err(|error| error.to_string())?;
    Ok((scene.materials[0].surface.clone(), scene))
}

#[test]
fn files_are_read_by_their_ending() {
    let (surface, scene) = load("type = \"measured\"\nfile = \"a.csv\"\n").unwrap();
    assert_eq!(surface, Surface::Measured { brdf: 0 });
    assert!(matches!(*scene.brdfs[0], Brdf::Sparse(_)));
    let (_, scene) = load("type = \"measured\"\nfile = \"a.bsdf\"\n").unwrap();
    assert!(matches!(*scene.brdfs[0], Brdf::Rgl(_)));
    for (table, parts) in [
        ("type = \"measured\"\n", vec!["a.toml:3", "`file`"]),
        ("type = \"measured\"\nfile = \"a.csv\"\nname = \"x\"\n", vec!["a.csv", "`x`"]),
        ("type = \"measured\"\nfile = \"a.obj\"\n", vec!["a.obj", ".binary, .bsdf, .csv"]),
        ("type = \"measured\"\nfile = \"b.binary\"\n", vec!["b.binary: cannot be read", "material.m.file"]),
    ] {
        let error = load(table).unwrap_err();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
}

#[test]
fn layers_are_a_coat_and_a_base() {
    let table = "type = \"layered\"\nior = 1.6\nroughness = 0.5\nabsorption = [0.1, 0.2, 0.3]\n\
        base = { type = \"conductor\", f0 = [0.9, 0.8, 0.7], alpha = [0.1, 0.3] }\n";
    let fresnel = Fresnel::Schlick { f0: Color::constant(Vec3::new(0.9, 0.8, 0.7)) };
    let base = LayerBase::Conductor { fresnel, alpha: Vec2::new(0.1, 0.3) };
    let layers = Layered { ior: 1.6, alpha: 0.25, absorption: Vec3::new(0.1, 0.2, 0.3), base };
    assert_eq!(load(table).unwrap().0, Surface::Layered(layers));
    let base = LayerBase::Diffuse { albedo: Vec3::splat(0.5) };
    let plain = Layered { ior: 1.5, alpha: 0.1, absorption: Vec3::ZERO, base };
    assert_eq!(load("type = \"layered\"\nbase = {}\n").unwrap().0, Surface::Layered(plain));
    for (table, parts) in [
        ("", vec!["`base`"]),
        ("base = { type = \"dielectric\" }", vec!["base.type", "\"diffuse\" or \"conductor\""]),
        ("base = { type = \"mirror\" }", vec!["base", "at least 0.02"]),
        ("base = { type = \"conductor\", metal = \"gold\", alpha = 0.01 }", vec!["base", "0.01", "at least 0.02"]),
        ("base = { texture = \"a.png\" }", vec!["unknown key `texture`"]),
        ("base = { emission = 1 }", vec!["unknown key `emission`"]),
        ("base = {}\nalpha = 0", vec!["an α of 0", "at least 0.02"]),
        ("base = {}\nalpha = [0.1, 0.2]", vec!["anisotropic"]),
        ("base = {}\nior = 1", vec!["ior", "from 1.01 to 2.5"]),
        ("base = {}\nabsorption = -1", vec!["absorption", "from 0 to 100"]),
    ] {
        let error = load(&format!("type = \"layered\"\n{table}\n")).unwrap_err();
        assert!(error.contains("a.toml") && parts.iter().all(|part| error.contains(part)), "{error}");
    }
}

#[test]
fn cloth_is_warp_and_weft() {
    let table = "type = \"woven\"\nwarp = { coverage = 0.7, gloss = 0.1, f0 = 0.2, albedo = [0.1, 0.2, 0.3] }\n\
        weft = { coverage = 0.3, specular_width = 0.05, volume_width = 0.2, isotropy = 0 }\n";
    let Surface::Woven(cloth) = load(table).unwrap().0 else { panic!("another surface") };
    assert_eq!((cloth.warp.coverage, cloth.warp.gloss), (0.7, 0.1));
    assert_eq!((cloth.warp.f0, cloth.warp.albedo), (Vec3::splat(0.2), Vec3::new(0.1, 0.2, 0.3)));
    assert_eq!((cloth.weft.specular_width, cloth.weft.volume_width, cloth.weft.isotropy), (0.05, 0.2, 0.0));
    for (table, parts) in [
        ("warp = {}", vec!["`weft`"]),
        ("warp = { coverage = 0.7 }\nweft = {}", vec!["0.7 and 0.5", "at most 1"]),
        ("warp = { specular_width = 0.01 }\nweft = {}", vec!["warp.specular_width", "from 0.02 to 1"]),
        ("warp = {}\nweft = { color = 1 }", vec!["unknown key `color`"]),
    ] {
        let error = load(&format!("type = \"woven\"\n{table}\n")).unwrap_err();
        assert!(error.contains("a.toml") && parts.iter().all(|part| error.contains(part)), "{error}");
    }
}
