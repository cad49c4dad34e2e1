//! What loads to what: OBJ, MTL and scene files, and the errors and warnings of each.

mod file;
mod mtl;
mod obj;
mod pictures;
mod shipped;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec2, Vec3};
use half::f16;
use neubrdf::scene::{
    Camera, Color, Environment, Error, Film, Fresnel, Lens, LightTable, Material, Mesh, Opacity, Patches, Receiver,
    Scene, Surface, TexturePlacement, Warning, named_files,
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

/// A roof of two triangles that meet at an angle of 60° between their normals.
const ROOF: &str = "v 0 0 0\nv 0 0 1\nv -1 -.57735027 0\nv 1 -.57735027 0\nf 1 3 2\nf 1 2 4\n";

/// The corners of each triangle.
fn triangles(mesh: &Mesh) -> Vec<[Vec3; 3]> {
    (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle)).collect()
}

const SKY: &str = "[environment]\nradiance = 1\n";
