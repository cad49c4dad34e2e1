//! A folder with a small intact scene, of which each target replaces one file.

use std::fs::{self, File};
use std::sync::LazyLock;

use glam::DVec3;
use neubrdf::material::Evaluate;
use neubrdf::scene::{Brdf, LightTable, Merl, Scene};

const FILES: [(&str, &[u8]); 13] = [
    ("scene.toml", include_bytes!("scene/scene.toml")),
    ("a.obj", include_bytes!("scene/a.obj")),
    ("a.mtl", include_bytes!("scene/a.mtl")),
    ("a.png", include_bytes!("scene/a.png")),
    ("a.jpg", include_bytes!("scene/a.jpg")),
    ("a.exr", include_bytes!("scene/a.exr")),
    ("a.safetensors", include_bytes!("scene/a.safetensors")),
    ("a_fc1.npy", include_bytes!("scene/a_fc1.npy")),
    ("a_b1.npy", include_bytes!("scene/a_b1.npy")),
    ("a_fc2.npy", include_bytes!("scene/a_fc2.npy")),
    ("a_b2.npy", include_bytes!("scene/a_b2.npy")),
    ("a_fc3.npy", include_bytes!("scene/a_fc3.npy")),
    ("a_b3.npy", include_bytes!("scene/a_b3.npy")),
];

static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    for (name, bytes) in FILES {
        fs::write(folder.path().join(name), bytes).expect("room for temporary files");
    }
    folder
});

/// Loads the scene with other bytes in one of its files, and uses what comes out.
pub fn load_with(name: &str, bytes: &[u8]) {
    fs::write(FOLDER.path().join(name), bytes).expect("room for temporary files");
    match Scene::load(FOLDER.path().join("scene.toml")) {
        Ok((scene, _)) => {
            let table = LightTable::new(&scene);
            assert!([table.emitter_density, table.environment_density].iter().all(|density| density.is_finite()));
            assert_eq!(scene.hash().len(), 64);
            for brdf in &scene.brdfs {
                let value = brdf.eval(DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.48, 0.6, 0.64));
                assert!(value.is_finite() && value.min_element() >= 0.0, "{value}");
            }
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.contains(FOLDER.path().to_str().expect("an ASCII path")), "{message}: names no file");
        }
    }
}

/// Loads a BRDF from these bytes, in a file whose ending says what they are, and evaluates it. MERL tables are filled up with zeros to the
/// length that they must have.
pub fn load_brdf(name: &str, bytes: &[u8]) {
    let path = FOLDER.path().join(name);
    fs::write(&path, bytes).expect("room for temporary files");
    if name.ends_with(".binary") && bytes.len() >= 12 {
        let file = File::options().write(true).open(&path).expect("the file that was just written");
        file.set_len((12 + Merl::CELLS * 24) as u64).expect("room for temporary files");
    }
    match Brdf::load(&path, None) {
        Ok(brdf) => {
            for (x, z) in [(0.0, 1.0), (0.6, 0.8), (0.999_999, 1e-3)] {
                let wo = DVec3::new(x, 0.0, z).normalize();
                let wi = DVec3::new(-0.28, -0.96 * x, 0.3).normalize();
                let value = brdf.eval(wo, wi);
                assert!(value.is_finite() && value.min_element() >= 0.0, "{value}");
            }
        }
        Err(error) => assert!(error.to_string().contains(name), "{error}: names no file"),
    }
}
