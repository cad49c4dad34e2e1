//! A folder with a small intact scene, of which each target replaces one file.

use std::fs;
use std::sync::LazyLock;

use glam::DVec3;
use neubrdf::material::Evaluate;
use neubrdf::scene::{LightTable, Scene};

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
            assert!(table.total_power.is_finite());
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
