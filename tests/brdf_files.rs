//! Files that hold BRDFs: what they load to, and what is said of broken ones.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::networks::{made, safetensors, tensors};
use neubrdf::scene::{Brdf, Nbrdf, Scene, Surface};

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }
}

/// The message of the error that loading ends in; it names the file.
fn error(path: &Path, name: Option<&str>) -> String {
    let message = Brdf::load(path, name).unwrap_err().to_string();
    assert!(message.contains(path.file_name().unwrap().to_str().unwrap()), "{message}");
    message
}

fn network() -> Nbrdf {
    made(3.0, 20.0, 0.05)
}

/// An array as NumPy saves it.
fn npy(shape: &[usize], numbers: &[f32]) -> Vec<u8> {
    let shape = shape.iter().map(|length| format!("{length}, ")).collect::<String>();
    let shape = if shape.matches(',').count() == 1 { shape.trim_end() } else { shape.trim_end_matches(", ") };
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
    header += &" ".repeat((64 - (10 + header.len() + 1) % 64) % 64);
    header.push('\n');
    let data: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    [b"\x93NUMPY\x01\x00", (header.len() as u16).to_le_bytes().as_slice(), header.as_bytes(), &data].concat()
}

/// Writes a network as its authors do. Returns the path of the first file.
fn write_npy_set(folder: &Folder, network: &Nbrdf) -> PathBuf {
    for (tensor, shape, numbers) in tensors(network) {
        let part = tensor.replace("kernel", "fc").replace("bias", "b");
        folder.write(&format!("metal_{part}.npy"), npy(&shape, &numbers));
    }
    folder.0.path().join("metal_fc1.npy")
}

#[test]
fn networks_load_from_safetensors_and_npy_alike() {
    let folder = Folder::new();
    let other = made(1.0, 4.0, 0.1);
    let many = folder.write("many.safetensors", safetensors(&[("a/b", &other), ("metal", &network())]));
    let expected = Brdf::Nbrdf(network());
    assert_eq!(Brdf::load(&many, Some("metal")).unwrap(), expected);
    assert_eq!(Brdf::load(&many, Some("a/b")).unwrap(), Brdf::Nbrdf(other));
    let one = folder.write("one.SafeTensors", safetensors(&[("metal", &network())]));
    assert_eq!(Brdf::load(&one, None).unwrap(), expected, "a lone material needs no name");
    let npy = write_npy_set(&folder, &network());
    assert_eq!(Brdf::load(&npy, None).unwrap(), expected);
    assert_eq!(Brdf::load(npy.with_file_name("metal_b2.npy"), None).unwrap(), expected, "any of the six will do");
}

#[test]
fn a_scene_file_names_a_network() {
    let folder = Folder::new();
    folder.write("n.safetensors", safetensors(&[("steel", &network()), ("felt", &made(0.2, 0.3, 0.2))]));
    folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\nusemtl o\nf 1 2 3\n");
    let load = |text: &str| {
        let toml = format!("[environment]\nradiance = 1\n[[mesh]]\nfile = \"a.obj\"\n{text}");
        Scene::load(folder.write("s.toml", toml)).map(|(scene, _)| scene).map_err(|error| error.to_string())
    };
    let named = |material: &str, name: &str| {
        format!("[material.{material}]\ntype = \"measured\"\nfile = \"n.safetensors\"\nname = \"{name}\"\n")
    };
    let scene = load(&[named("m", "steel"), named("n", "felt"), named("o", "steel")].concat()).unwrap();
    let surfaces: Vec<_> = scene.materials.iter().map(|material| material.surface.clone()).collect();
    assert_eq!(surfaces, [0, 1, 0].map(|brdf| Surface::Measured { brdf }), "a network is loaded once");
    assert_eq!(*scene.brdfs[0], Brdf::Nbrdf(network()));

    let other = load(&[named("m", "steel"), named("n", "steel"), named("o", "steel")].concat()).unwrap();
    assert_eq!(other.brdfs.len(), 1);
    assert_ne!(scene.hash(), other.hash());
    let mut changed = other.clone();
    let mut network = network();
    network.bias_3[1] += 1e-3;
    changed.brdfs[0] = std::sync::Arc::new(Brdf::Nbrdf(network));
    assert_ne!(other.hash(), changed.hash(), "a weight enters the scene's hash");

    let message = load(&named("m", "stel")).unwrap_err();
    assert!(
        message.contains("`stel`") && message.contains("`steel`") && message.contains("n.safetensors"),
        "{message}"
    );
    let message = load("[material.m]\ntype = \"measured\"\nfile = \"none.safetensors\"\n").unwrap_err();
    assert!(message.contains("none.safetensors") && message.contains("s.toml:7: material.m.file"), "{message}");
    let message = load("[material.m]\ntype = \"measured\"\n").unwrap_err();
    assert!(message.contains("the key `file`"), "{message}");
    let message = load("[material.m]\ntype = \"measured\"\nfile = \"n.safetensors\"\nnames = \"x\"\n").unwrap_err();
    assert!(message.contains("unknown key `names`") && message.contains("`name`"), "{message}");
}

#[test]
fn what_is_wrong_with_a_name_is_said() {
    let folder = Folder::new();
    let many = folder.write("many.safetensors", safetensors(&[("felt", &network()), ("steel", &network())]));
    assert!(error(&many, None).contains("no name of a material"));
    assert!(
        error(&many, Some("stele"))
            .contains("one of the 2 materials in it, such as `steel`; `neubrdf material FILE` lists")
    );
    let listed = Command::new(env!("CARGO_BIN_EXE_neubrdf")).arg("material").arg(&many).output().unwrap();
    let listed = String::from_utf8(listed.stdout).unwrap();
    assert!(listed.contains("felt") && listed.contains("steel"), "{listed}");
    assert!(error(&folder.write("x.brdf", ""), None).contains(".safetensors"));
    let npy = write_npy_set(&folder, &network());
    assert!(error(&npy, Some("metal")).contains("no name"));
    assert!(error(&folder.write("other.npy", ""), None).contains("NAME_fc1.npy"));
    fs::remove_file(npy.with_file_name("metal_b3.npy")).unwrap();
    let message = Brdf::load(&npy, None).unwrap_err().to_string();
    assert!(message.contains("metal_b3.npy: cannot be read"), "{message}");
}

#[test]
fn broken_safetensors_are_errors() {
    let folder = Folder::new();
    let intact = safetensors(&[("m", &network())]);
    let said = |bytes: &[u8]| error(&folder.write("m.safetensors", bytes), Some("m"));
    for length in (0..intact.len()).step_by(13) {
        said(&intact[..length]);
    }
    for length in [u64::MAX, 1 << 40, intact.len() as u64, 0] {
        let message = said(&[&length.to_le_bytes(), &intact[8..]].concat());
        assert!(message.contains("header"), "{message}");
    }
    let header_length = u64::from_le_bytes(*intact.first_chunk().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&intact[8..8 + header_length]).unwrap();
    let with = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut header = header.clone();
        change(&mut header["m/kernel2"]);
        let header = serde_json::to_vec(&header).unwrap();
        said(&[&(header.len() as u64).to_le_bytes(), header.as_slice(), &intact[8 + header_length..]].concat())
    };
    use serde_json::json;
    assert!(with(&|entry| entry["shape"] = json!([21, 20])).contains("F32 of shape [21, 21]"));
    assert!(with(&|entry| entry["shape"] = json!([1u64 << 60, 1u64 << 60])).contains("F32 of shape [21, 21]"));
    assert!(with(&|entry| entry["dtype"] = json!("F16")).contains("`F16`"));
    assert!(with(&|entry| entry["data_offsets"] = json!([u64::MAX - 3, u64::MAX])).contains("1764 bytes"));
    assert!(with(&|entry| entry["data_offsets"] = json!([1764, 0])).contains("1764 bytes"));
    assert!(with(&|entry| entry["data_offsets"] = json!([-1, 5])).contains("broken entry"));
    assert!(with(&|entry| *entry = json!(null)).contains("broken entry"));
    assert!(said(&[&5u64.to_le_bytes()[..], b"[[[[["].concat()).contains("broken header"));

    for (number, found) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (1e7, "1e7")] {
        let mut network = network();
        network.kernel_2[20][3] = number;
        let message = said(&safetensors(&[("m", &network)]));
        assert!(message.contains("m/kernel2") && message.contains(found), "{message}");
    }
}

#[test]
fn broken_npy_files_are_errors() {
    let folder = Folder::new();
    let path = write_npy_set(&folder, &network());
    let (_, shape, numbers) = tensors(&network())[0].clone();
    let intact = npy(&shape, &numbers);
    let said = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        error(&path, None)
    };
    for length in 0..intact.len() {
        said(&intact[..length]);
    }
    let replaced = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let at = intact.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        said(&[&intact[..at], to.as_bytes(), &intact[at + to.len()..]].concat())
    };
    assert!(replaced("'<f4'", "'<f8'").contains("descr"));
    assert!(replaced("False", "True ").contains("fortran_order"));
    assert!(replaced("(6, 21)", "(21, 6)").contains("(6, 21)"));
    assert!(replaced("'shape'", "'shade'").contains("nothing"));
    assert!(said(&[b"\x93NUMPY\x02\x00\xff\xff\xff\xff", &intact[10..]].concat()).contains("NumPy"));
    assert!(said(&npy(&shape, &vec![f32::NAN; numbers.len()])).contains("NaN"));
    assert!(said(&[intact.as_slice(), &[0]].concat()).contains("126 numbers"));
}
