//! Broken and hostile input: whatever the bytes, loading ends in a valid scene or in an error that names the file,
//! without a panic and without gigabytes of memory.
#![allow(unsafe_code)] // A counting allocator cannot be written without.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fs;
use std::path::{Path, PathBuf};

use common::networks;
use glam::DVec3;
use neubrdf::material::Evaluate;
use neubrdf::scene::{Color, Fresnel, LayerBase, Layered, LightTable, Scene, Surface, Woven};
use proptest::prelude::*;

/// Counts the bytes that this thread holds, and the most it ever held.
struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    // A thread that is ending has no counters any more.
    let _ = HELD.try_with(|held| {
        held.set(held.get() + bytes);
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(held.get())));
    });
}

// SAFETY: every call goes to the system's allocator unchanged; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's promises are the ones that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// More than any input of these tests may take.
const MOST_BYTES: isize = 32 << 20;

/// A folder with a scene that uses a file of every kind.
struct Folder(tempfile::TempDir);

const OBJ: &str = "mtllib a.mtl\no first\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n\
    usemtl m\nf 1/1/1 2/2/1 3/3/1\nusemtl n\nf 1 -2 -1 2\nusemtl p\nf 4/1/1 3/1/1 2/2/1\nusemtl q\nf 1 2 4\n";
const MTL: &str = "newmtl m\nKd .5 .5 .5\nmap_Kd -s 1 1 1 a.png\nmap_d a.png\nd 0.5\nnorm a.tga\nnewmtl n\nmap_Pr a.png\nKs .5 .4 .3\nNs 20\nKd 0 0 0\nillum 3\n\
    newmtl q\nnewmtl p\nKe 1 2 3\nmap_Ke a.png\nmap_Kd a.jpg\nPr 0.5\nPm 1\n";
const TOML: &str = "[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\nfov = 40\nlens_radius = 0.1\n[film]\nwidth = 8\n\
    height = 8\n[[mesh]]\nfile = \"a.obj\"\ncrease_angle = 30\ntransform = { scale = 2, rotate = [0, 10, 0] }\n\
    instances = [{}, { translate = [1, 2, 3] }]\n[material.q]\ntype = \"measured\"\nfile = \"a.safetensors\"\n\
    name = \"second\"\n[material.n]\ntype = \"coated\"\ntexture = \"a.hdr\"\nroughness_map = \"a.tga\"\nopacity = \"a.png\"\n[material.p]\n\
    type = \"conductor\"\nmetal = \"gold\"\nalpha = [0.1, 0.2]\n[environment]\nfile = \"a.exr\"\nscale = 2\n[sun]\n\
    direction = [0, 1, 0]\nirradiance = [1, 2, 3]\n";

impl Folder {
    fn new() -> Folder {
        let folder = Folder(tempfile::tempdir().unwrap());
        let image = image::RgbImage::from_fn(24, 24, |x, y| image::Rgb([x as u8 * 9, y as u8 * 9, 77]));
        image.save(folder.path("a.png")).unwrap();
        image.save(folder.path("a.jpg")).unwrap();
        image.save(folder.path("a.tga")).unwrap();
        let color = |x: usize, y: usize| (x as f32, y as f32, 0.5);
        exr::prelude::write_rgb_file(folder.path("a.exr"), 16, 8, color).unwrap();
        let hdr =
            [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n\x02\x02\0\x08", &[0x88, 9].repeat(4)[..], &[200; 32]];
        fs::write(folder.path("a.hdr"), hdr.concat()).unwrap();
        let [first, second] = [networks::made(1.0, 4.0, 0.1), networks::made(5.0, 60.0, 0.02)];
        let file = networks::safetensors(&[("first", &first), ("second", &second)]);
        fs::write(folder.path("a.safetensors"), file).unwrap();
        fs::write(folder.path("a.obj"), OBJ).unwrap();
        fs::write(folder.path("a.mtl"), MTL).unwrap();
        fs::write(folder.path("a.toml"), TOML.replace("[material.p]", "[material.p] # overrides the texture")).unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// Loads the scene file with other bytes in one of the files. Returns the error's message.
    fn load_with(&self, name: &str, bytes: &[u8]) -> Result<(), String> {
        // Renamed, not overwritten: some file systems wait for the disk when a file is cut and written again.
        fs::rename(self.path(name), self.path("intact")).unwrap();
        fs::write(self.path(name), bytes).unwrap();
        let outcome = load(&self.path("a.toml"));
        fs::remove_file(self.path(name)).unwrap();
        fs::rename(self.path("intact"), self.path(name)).unwrap();
        if let Err(message) = &outcome {
            assert!(message.contains(self.0.path().to_str().unwrap()), "{message}: names no file");
        }
        outcome
    }
}

/// Loads a scene, checks it, its memory and what else is computed from it.
fn load(path: &Path) -> Result<(), String> {
    PEAK.set(HELD.get());
    let before = HELD.get();
    let outcome = Scene::load(path);
    let taken = PEAK.get() - before;
    assert!(taken < MOST_BYTES, "{}: loading took {taken} bytes", path.display());
    let (scene, _) = outcome.map_err(|error| error.to_string())?;
    assert_valid(&scene);
    let table = LightTable::new(&scene);
    assert!(
        [table.emitter_density, table.environment_density].iter().all(|density| density.is_finite())
            && table.alias.iter().all(|(stay, _)| (0.0..=1.0).contains(stay))
    );
    Ok(())
}

/// What the module documentation of `scene` promises.
fn assert_valid(scene: &Scene) {
    assert!(!scene.instances.is_empty() && !scene.materials.is_empty());
    assert!(scene.film.width > 0 && scene.film.height > 0);
    assert!((scene.camera.target - scene.camera.eye).cross(scene.camera.up).length() > 0.0);
    for instance in &scene.instances {
        assert!((instance.mesh as usize) < scene.meshes.len());
        assert!(instance.object_to_world.is_finite() && instance.object_to_world.inverse().is_finite());
    }
    for mesh in &scene.meshes {
        let vertices = mesh.positions.len();
        assert!(!mesh.triangles.is_empty());
        assert!(mesh.triangles.iter().flatten().all(|&corner| (corner as usize) < vertices));
        assert!(mesh.positions.iter().all(|p| p.is_finite()));
        assert!(mesh.normals.is_empty() || mesh.normals.len() == vertices);
        assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4));
        assert!(mesh.uvs.is_empty() || mesh.uvs.len() == vertices);
        assert!(mesh.uvs.iter().all(|uv| uv.is_finite()));
        assert!(mesh.materials.len() == 1 || mesh.materials.len() == mesh.triangles.len());
        assert!(mesh.materials.iter().all(|&material| (material as usize) < scene.materials.len()));
    }
    let color = |color: &Color| {
        assert!(color.value.min_element() >= 0.0 && color.value.max_element() <= 1.0);
        assert!(color.texture.is_none_or(|texture| (texture as usize) < scene.textures.len()));
    };
    for material in &scene.materials {
        assert!(material.emission.min_element() >= 0.0 && material.emission.max_element() <= 1e12);
        match &material.surface {
            Surface::Diffuse { albedo } => color(albedo),
            Surface::Conductor { fresnel, alpha } => {
                assert!(alpha.min_element() >= 0.0 && alpha.max_element() <= 1.0);
                match fresnel {
                    Fresnel::Schlick { f0 } => color(f0),
                    Fresnel::Complex { eta, kappa } => assert!(eta.min_element() > 0.0 && kappa.min_element() >= 0.0),
                }
            }
            Surface::Dielectric { ior, alpha } => {
                assert!((0.1..=10.0).contains(ior) && (0.0..=1.0).contains(alpha));
            }
            Surface::Coated { albedo, ior, alpha } => {
                color(albedo);
                assert!((1.0..=10.0).contains(ior) && (0.0..=1.0).contains(alpha));
            }
            Surface::Measured { brdf } => {
                let wo = DVec3::new(0.6, 0.0, 0.8);
                let value = scene.brdfs[*brdf as usize].eval(wo, wo);
                assert!(value.is_finite() && value.min_element() >= 0.0, "{value}");
            }
            Surface::Layered(layers) => {
                let alpha = Layered::LEAST_ALPHA..=1.0;
                assert!((1.01..=2.5).contains(&layers.ior) && alpha.contains(&layers.alpha));
                assert!(layers.absorption.min_element() >= 0.0 && layers.absorption.is_finite());
                if let LayerBase::Conductor { alpha: base, .. } = layers.base {
                    assert!(alpha.contains(&base.x) && alpha.contains(&base.y));
                }
            }
            Surface::Woven(Woven { warp, weft }) => {
                assert!(warp.coverage + weft.coverage <= 1.0);
                for yarn in [warp, weft] {
                    assert!((0.02..=1.0).contains(&yarn.specular_width) && (0.02..=1.0).contains(&yarn.volume_width));
                    assert!((0.0..=1.0).contains(&yarn.gloss) && (0.0..=1.0).contains(&yarn.isotropy));
                    assert!(yarn.f0.max_element() <= 1.0 && yarn.albedo.max_element() <= 1.0);
                }
            }
        }
    }
    for texture in &scene.textures {
        assert!(texture.width > 0 && texture.texels.len() == texture.width as usize * texture.height as usize);
        assert!(texture.texels.iter().flatten().all(|channel| channel.is_finite()));
    }
    if let Some(sky) = &scene.environment {
        assert!(sky.width > 0 && sky.texels.len() == sky.width as usize * sky.height as usize);
        assert!(sky.texels.iter().all(|texel| texel.min_element() >= 0.0 && texel.max_element() <= 1e12));
    }
}

const FILES: [&str; 9] = ["a.obj", "a.mtl", "a.toml", "a.png", "a.jpg", "a.tga", "a.exr", "a.hdr", "a.safetensors"];

/// Unlike the override of the seed, this one keeps both textures in use.
fn folder_with_textures() -> Folder {
    let folder = Folder::new();
    let toml = TOML.split("[material.p]").next().unwrap().to_owned() + "[environment]\nfile = \"a.exr\"\n";
    fs::write(folder.path("a.toml"), toml).unwrap();
    folder
}

#[test]
fn the_intact_scene_loads() {
    assert_eq!(load(&Folder::new().path("a.toml")), Ok(()));
    assert_eq!(load(&folder_with_textures().path("a.toml")), Ok(()));
}

#[test]
fn every_file_may_end_anywhere() {
    let folder = folder_with_textures();
    for name in FILES {
        let bytes = folder.read(name);
        let step = (bytes.len() / 400).max(1);
        for length in (0..bytes.len()).step_by(step) {
            let outcome = folder.load_with(name, &bytes[..length]);
            if length == 0 && name != "a.mtl" {
                assert!(outcome.unwrap_err().contains(name), "an empty {name} is an error");
            }
        }
    }
}

#[test]
fn truncated_images_and_networks_are_errors() {
    let folder = folder_with_textures();
    for name in ["a.png", "a.exr", "a.hdr", "a.safetensors"] {
        let bytes = folder.read(name);
        for part in [0.1, 0.5, 0.9] {
            let message = folder.load_with(name, &bytes[..(bytes.len() as f64 * part) as usize]).unwrap_err();
            assert!(message.contains(name), "{message}");
        }
    }
}

#[test]
fn garbage_is_an_error() {
    let folder = folder_with_textures();
    let mut state = 1u64;
    let mut byte = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    for name in FILES {
        for length in [1, 10, 1000, 100_000] {
            let garbage: Vec<u8> = (0..length).map(|_| byte()).collect();
            let message = folder.load_with(name, &garbage).expect_err(name);
            assert!(message.contains(name), "{message}");
            assert!(message.len() < 1000, "{message}");
        }
        // The right first bytes, then garbage.
        let start = folder.read(name)[..16].to_vec();
        for _ in 0..20 {
            let garbage: Vec<u8> = start.iter().copied().chain((0..500).map(|_| byte())).collect();
            let message = folder.load_with(name, &garbage).expect_err(name);
            assert!(message.contains(name), "{message}");
        }
    }
}

#[test]
fn any_byte_may_be_any_other() {
    let folder = folder_with_textures();
    for name in FILES {
        let bytes = folder.read(name);
        let step = (bytes.len() / 150).max(1);
        for at in (0..bytes.len()).step_by(step) {
            for value in [0xff, bytes[at] ^ 0x10, b'9'] {
                let mut broken = bytes.clone();
                broken[at] = value;
                let _ = folder.load_with(name, &broken);
            }
        }
    }
}

#[test]
fn a_statement_without_end_is_an_error() {
    let folder = folder_with_textures();
    let long = vec![b'1'; 33 << 20];
    fs::write(folder.path("long.obj"), &long).unwrap();
    let error = Scene::load(folder.path("long.obj")).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("long.obj") && error.contains("longer than 32 MiB"), "{error}");
    fs::write(folder.path("long.toml"), vec![b' '; 65 << 20]).unwrap();
    let error = Scene::load(folder.path("long.toml")).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("long.toml") && error.contains("more than 64 MiB"), "{error}");
}

#[test]
fn deep_nesting_is_an_error() {
    let folder = folder_with_textures();
    for (open, close) in [("[", "]"), ("{a=", "}")] {
        let text = format!("mesh = {}1{}", open.repeat(100_000), close.repeat(100_000));
        assert!(folder.load_with("a.toml", text.as_bytes()).unwrap_err().contains("a.toml"));
    }
    let dotted = format!("{}a = 1", "a.".repeat(100_000));
    assert!(folder.load_with("a.toml", dotted.as_bytes()).unwrap_err().contains("a.toml"));
}

/// A PNG file without pixels, of any size on paper.
fn png_header(width: u32, height: u32) -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([8, 2, 0, 0, 0]);
    let mut crc = u32::MAX;
    for byte in &header {
        crc ^= u32::from(*byte);
        (0..8).for_each(|_| crc = (crc >> 1) ^ (0xedb8_8320 * (crc & 1)));
    }
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    file.extend(13u32.to_be_bytes());
    file.extend(header);
    file.extend((!crc).to_be_bytes());
    file.extend(b"\0\0\0\x01IDATx\0\0\0\0");
    file
}

/// The JPEG file with another size in its frame header.
fn jpeg_of_size(intact: &[u8], width: u16, height: u16) -> Vec<u8> {
    let frame = intact.windows(2).position(|marker| marker[0] == 0xff && (0xc0..=0xc2).contains(&marker[1])).unwrap();
    let mut bytes = intact.to_vec();
    bytes[frame + 5..frame + 7].copy_from_slice(&height.to_be_bytes());
    bytes[frame + 7..frame + 9].copy_from_slice(&width.to_be_bytes());
    bytes
}

/// The EXR file with another size in its windows.
fn exr_of_size(intact: &[u8], width: i32, height: i32) -> Vec<u8> {
    let mut bytes = intact.to_vec();
    for attribute in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = bytes.windows(attribute.len()).position(|window| window == attribute).unwrap() + attribute.len() + 4;
        bytes[at + 8..at + 12].copy_from_slice(&(width - 1).to_le_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&(height - 1).to_le_bytes());
    }
    bytes
}

#[test]
fn absurd_image_sizes_are_errors() {
    let folder = folder_with_textures();
    let [jpeg, exr] = ["a.jpg", "a.exr"].map(|name| folder.read(name));
    for (width, height) in [(0, 0), (0, 5), (5, 0), (100_000, 100_000), (1 << 30, 1 << 30), (i32::MAX, 1)] {
        let message = folder.load_with("a.png", &png_header(width as u32, height as u32)).unwrap_err();
        assert!(message.contains("a.png"), "{message}");
        let message = folder.load_with("a.exr", &exr_of_size(&exr, width, height)).unwrap_err();
        assert!(message.contains("a.exr"), "{message}");
    }
    for (width, height) in [(0, 0), (0, 5), (65_500, 65_500)] {
        let message = folder.load_with("a.jpg", &jpeg_of_size(&jpeg, width, height)).unwrap_err();
        assert!(message.contains("a.jpg"), "{message}");
    }
    // Sizes within the limits, of which the file holds next to nothing.
    for (width, height) in [(1000, 1000), (1 << 20, 1), (1, 1 << 20), (16_000_000, 4)] {
        assert!(folder.load_with("a.png", &png_header(width, height)).unwrap_err().contains("a.png"));
        assert!(
            folder.load_with("a.exr", &exr_of_size(&exr, width as i32, height as i32)).unwrap_err().contains("a.exr")
        );
    }
}

#[test]
fn missing_files_and_folders_in_their_place_are_errors() {
    for name in FILES {
        let folder = folder_with_textures();
        fs::remove_file(folder.path(name)).unwrap();
        let outcome = load(&folder.path("a.toml"));
        if ["a.mtl", "a.jpg"].contains(&name) {
            assert_eq!(outcome, Ok(()), "a missing file that no scene file names is but a warning");
        } else {
            let message = outcome.unwrap_err();
            assert!(message.contains(name) && message.contains("cannot be read"), "{message}");
        }
        fs::create_dir(folder.path(name)).unwrap();
        let message = load(&folder.path("a.toml")).unwrap_err();
        assert!(message.contains(name) && message.contains("cannot be read"), "{message}");
    }
    for missing in ["", "/", "/dev/zero", "nowhere/to/be.obj", "nul\0.obj"] {
        assert!(load(Path::new(missing)).unwrap_err().contains("cannot be read"), "{missing}");
    }
}

#[test]
fn material_files_that_include_are_errors() {
    let folder = folder_with_textures();
    let message = folder.load_with("a.obj", format!("mtllib a.obj\n{OBJ}").as_bytes()).unwrap_err();
    assert!(message.contains("a.obj:1"), "{message}");
    let message = folder.load_with("a.mtl", format!("{MTL}mtllib a.mtl\n").as_bytes()).unwrap_err();
    assert!(message.contains("a.mtl") && message.contains("a statement of an OBJ file"), "{message}");
    let message = folder.load_with("a.obj", b"mtllib /\n").unwrap_err();
    assert!(message.contains("/: cannot be read") && message.contains("named by") && message.contains("a.obj:1"));
    let message = folder.load_with("a.obj", b"mtllib\n").unwrap_err();
    assert!(message.contains("a.obj:1"), "{message}");
    // A file may be named twice.
    assert_eq!(folder.load_with("a.obj", format!("mtllib a.mtl\n{OBJ}").as_bytes()), Ok(()));
}

#[test]
fn meshes_without_area_are_errors() {
    let folder = Folder::new();
    for text in
        ["v 0 0 0\nf 1 1 1\n", "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n", "v 1e-30 0 0\nv 0 1e-30 0\nv 0 0 0\nf 1 2 3\n"]
    {
        fs::write(folder.path("flat.obj"), text).unwrap();
        let message = load(&folder.path("flat.obj")).unwrap_err();
        assert!(message.contains("flat.obj") && message.contains("no triangle"), "{message}");
    }
}

fn words(all: &'static [&'static str], count: usize) -> impl Strategy<Value = String> {
    prop::collection::vec(prop::sample::select(all), 0..count).prop_map(|words| words.join(" "))
}

const OBJ_WORDS: &[&str] = &[
    "\nv",
    "\nv",
    "\nvt",
    "\nvn",
    "\nf",
    "\nf",
    "\nusemtl",
    "\nmtllib",
    "\no",
    "\ng",
    "\nl",
    "\n",
    "\\\n",
    "#",
    "0",
    "1",
    "2",
    "3",
    "-1",
    "-2",
    "1/1",
    "2/1/1",
    "3//1",
    "1//",
    "/",
    "//",
    "1e38",
    "-1e8",
    "nan",
    "inf",
    "1e-40",
    "a.mtl",
    "9999999999999999999",
    "-9223372036854775808",
    "9223372036854775807",
    "\u{a0}",
    "é",
    "m",
];
const MTL_WORDS: &[&str] = &[
    "\nnewmtl",
    "\nKd",
    "\nKs",
    "\nKe",
    "\nNs",
    "\nNi",
    "\nd",
    "\nillum",
    "\nmap_Kd",
    "\nmap_Ks",
    "\nbump",
    "\nPr",
    "\nPm",
    "\naniso",
    "\n",
    "m",
    "n",
    "0",
    "1",
    "0.5",
    "-1",
    "1e38",
    "nan",
    "7",
    "3",
    "5",
    "a.png",
    "-s",
    "-clamp on",
];
const TOML_WORDS: &[&str] = &[
    "\n[[mesh]]\n",
    "\n[camera]\n",
    "\n[material.m]\n",
    "\n[sun]\n",
    "\n[environment]\n",
    "file = 'a.obj'\n",
    "eye = [0, 0, 1]\n",
    "target = [0, 0, 0]\n",
    "radiance = ",
    "scale = ",
    "rotate = ",
    "transform = {",
    "}",
    "[",
    "]",
    "\"",
    "1",
    "-1e300",
    "nan",
    "[1, 2, 3]\n",
    "type = 'conductor'\n",
    "type = 'layered'\n",
    "type = 'woven'\n",
    "base = {",
    "warp = {}\n",
    "weft = {}\n",
    "absorption = ",
    "coverage = ",
    "alpha = ",
    "roughness = ",
    "metal = 'gold'\n",
    "direction = [0, 1, 0]\n",
    "irradiance = 1\n",
    "fov = ",
    "0x10",
    "1979-05-27",
    "'''",
    "\u{0}",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_words_of_an_obj_file_are_survived(text in words(OBJ_WORDS, 60)) {
        let folder = Folder::new();
        let _ = folder.load_with("a.obj", format!("{text}\n{OBJ}").as_bytes());
        let _ = folder.load_with("a.obj", format!("{OBJ}{text}\n").as_bytes());
    }

    #[test]
    fn any_words_of_an_mtl_file_are_survived(text in words(MTL_WORDS, 60)) {
        let folder = folder_with_textures();
        let _ = folder.load_with("a.mtl", format!("newmtl m {text}\n{MTL}").as_bytes());
        let _ = folder.load_with("a.mtl", format!("{MTL}{text}\n").as_bytes());
    }

    #[test]
    fn any_words_of_a_scene_file_are_survived(text in words(TOML_WORDS, 20)) {
        let _ = Folder::new().load_with("a.toml", text.as_bytes());
    }

    #[test]
    fn any_changes_to_a_file_are_survived(
        file in 0..FILES.len(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in any::<prop::sample::Index>(),
    ) {
        let folder = folder_with_textures();
        let mut bytes = folder.read(FILES[file]);
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if cut.index(3) == 0 {
            bytes.truncate(cut.index(bytes.len()));
        }
        let _ = folder.load_with(FILES[file], &bytes);
    }
}
