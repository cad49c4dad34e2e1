//! The C interface: its header is what cbindgen makes of it now, and a host in C++ that builds against what is installed, by way of
//! pkg-config or of CMake, gets the bits that a host in Rust gets.

mod common;

use std::path::{Path, PathBuf};
use std::process::Command;

use common::random_neubrdf::{Shape, random_neubrdf};
use common::*;
use glam::{Affine3A, Quat, Vec2, Vec3};
use neubrdf::render::{Options, Settings};
use neubrdf::scene::brdf::Precision;
use neubrdf::scene::{Color, Environment, Film, Instance, Mesh, Scene, Sun, Surface, Texture, TexturePlacement};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn header() -> String {
    let sources = ["call", "context", "scene", "host_mesh", "renderer", "change", "material_file"]
        .map(|name| Path::new(ROOT).join(format!("src/capi/{name}.rs")));
    let mut config = cbindgen::Config {
        language: cbindgen::Language::C,
        cpp_compat: true,
        include_guard: Some("NEUBRDF_H".into()),
        no_includes: true,
        sys_includes: vec!["stdint.h".into(), "vulkan/vulkan_core.h".into()],
        header: Some(
            "/* neubrdf: path-traced neural BRDFs in your own Vulkan device. Made by cbindgen from src/capi: do not edit.\n\n   \
             Every call returns a NeubrdfResult; neubrdf_last_error says more. An object is used by one thread at a time.\n   \
             Structs begin with their size: set it, and let all that you do not know of be 0.\n   \
             docs/embedding.md is the page to begin with. */"
                .into(),
        ),
        documentation_style: cbindgen::DocumentationStyle::Doxy,
        line_length: 120,
        ..cbindgen::Config::default()
    };
    // Named in structs by their numbers alone.
    let enums = ["Surface", "Traversal", "Sampler", "Reserve", "Format", "Channel", "Update", "MemoryUse"];
    config.export.include = enums.map(|name| format!("Neubrdf{name}")).to_vec();
    config.enumeration.rename_variants = cbindgen::RenameRule::QualifiedScreamingSnakeCase;
    let builder = sources.iter().fold(cbindgen::Builder::new(), |builder, source| builder.with_src(source));
    let mut text = Vec::new();
    builder.with_config(config).generate().unwrap().write(&mut text);
    // What Rust calls safety is what C programmers expect to be told anyway.
    String::from_utf8(text).unwrap().replace(" * # Safety\n", "")
}

#[test]
fn the_header_is_that_of_the_source() {
    let path = Path::new(ROOT).join("src/capi/neubrdf.h");
    let made = header();
    if std::env::var_os("NEUBRDF_BLESS").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == made, "{} is stale: NEUBRDF_BLESS=1 cargo test --test capi", path.display());
}

/// The functions that the table of docs/embedding.md names, those that begin with `_` in full: they are of the object before them.
fn functions_of_the_page() -> Vec<String> {
    let page = std::fs::read_to_string(Path::new(ROOT).join("docs/embedding.md")).unwrap();
    let table = page.split("| Rust | C |").nth(1).and_then(|rest| rest.split("\n\n").next()).unwrap();
    let mut functions: Vec<String> = Vec::new();
    for name in table.split('`').skip(1).step_by(2).map(|name| name.trim_end_matches("()")) {
        if name.starts_with("neubrdf_") {
            functions.push(name.to_owned());
        } else if let Some(object) = functions.last().filter(|_| name.starts_with('_')) {
            let object: Vec<&str> = object.splitn(3, '_').take(2).collect();
            functions.push(object.join("_") + name);
        }
    }
    functions.sort();
    functions
}

#[test]
fn the_page_names_every_function_of_the_header() {
    let header = std::fs::read_to_string(Path::new(ROOT).join("src/capi/neubrdf.h")).unwrap();
    let code = header.lines().filter(|line| !line.starts_with(" *"));
    let called =
        code.filter_map(|line| line.split_once('(')).filter_map(|(before, _)| before.split([' ', '*']).next_back());
    let mut functions: Vec<&str> = called.filter(|name| name.starts_with("neubrdf_")).collect();
    functions.sort_unstable();
    assert!(functions.len() > 40, "{functions:?}");
    assert_eq!(functions_of_the_page(), functions);
}

/// Runs a command to its end; `None` where the program is not installed, with all that it said where it fails.
fn run(command: &mut Command) -> Option<String> {
    match command.output() {
        Ok(output) => {
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
            assert!(output.status.success(), "{command:?}:\n{}{}", text(&output.stdout), text(&output.stderr));
            Some(text(&output.stdout))
        }
        Err(error) if std::env::var_os("NEUBRDF_REQUIRE_DRIVERS").is_some() => panic!("{command:?}: {error}"),
        Err(error) => {
            eprintln!("skipped: {command:?}: {error}");
            None
        }
    }
}

fn vulkan_headers_are_there() -> bool {
    Path::new("/usr/include/vulkan/vulkan_core.h").exists() || std::env::var_os("NEUBRDF_REQUIRE_DRIVERS").is_some()
}

const WARNINGS: [&str; 5] = ["-Wall", "-Wextra", "-Werror", "-Wno-missing-field-initializers", "-O1"];

/// This build, installed as `make install` does, but for the static library: that is an empty one.
struct Installed {
    prefix: tempfile::TempDir,
}

impl Installed {
    fn new() -> Installed {
        let (prefix, built) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        // Where cargo puts the shared library of this build.
        let test = std::env::current_exe().unwrap();
        let link = |name: &str, file: &Path| std::os::unix::fs::symlink(file, built.path().join(name)).unwrap();
        link("libneubrdf.so", &test.parent().unwrap().join("libneubrdf.so"));
        link("neubrdf", Path::new(env!("CARGO_BIN_EXE_neubrdf")));
        std::fs::write(built.path().join("libneubrdf.a"), "!<arch>\n").unwrap();
        let mut install = Command::new(Path::new(ROOT).join("scripts/install.sh"));
        run(install.arg(prefix.path()).arg(built.path()).env_remove("DESTDIR"));
        Installed { prefix }
    }

    fn at(&self, place: &str) -> PathBuf {
        self.prefix.path().join(place)
    }

    /// A program of one file, built by way of pkg-config.
    fn compile(&self, compiler: &str, flags: &[&str], source: &str) -> Option<PathBuf> {
        let mut ask = Command::new("pkg-config");
        let said = run(ask.args(["--cflags", "--libs", "neubrdf"]).env("PKG_CONFIG_PATH", self.at("lib/pkgconfig")))?;
        let program = self.at(source).with_extension("");
        let mut command = Command::new(compiler);
        command.args(WARNINGS).args(flags).arg(Path::new(ROOT).join("tests/capi").join(source));
        run(command.args(said.split_whitespace()).args(["-lvulkan", "-o"]).arg(&program))?;
        Some(program)
    }

    /// The host in C++, built by way of the lines for CMake that docs/embedding.md has.
    fn compile_by_cmake(&self) -> Option<PathBuf> {
        let page = std::fs::read_to_string(Path::new(ROOT).join("docs/embedding.md")).unwrap();
        let lines = page.split("```cmake\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        assert!(lines.contains("/usr/local"));
        let lines = lines.replace("/usr/local", self.prefix.path().to_str().unwrap());
        let (source, folder) = (Path::new(ROOT).join("tests/capi/host.cpp"), self.at("engine"));
        std::fs::create_dir(&folder).unwrap();
        let text = format!(
            "cmake_minimum_required(VERSION 3.18)\nproject(engine LANGUAGES CXX)\nset(CMAKE_CXX_STANDARD 17)\n\
             add_executable(engine {source:?})\n{lines}\n"
        );
        std::fs::write(folder.join("CMakeLists.txt"), text).unwrap();
        let cmake = |arguments: &[&str]| run(Command::new("cmake").args(arguments).current_dir(&folder));
        cmake(&["-S", ".", "-B", "build", &format!("-DCMAKE_CXX_FLAGS={}", WARNINGS.join(" "))])?;
        cmake(&["--build", "build"])?;
        Some(folder.join("build/engine"))
    }

    /// Where programs find the library, as they do in /usr/local by themselves, after `ldconfig`.
    fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        command.env("LD_LIBRARY_PATH", self.at("lib"));
        command
    }
}

/// The scene that tests/capi/host.cpp makes, after its changes.
fn made_and_changed(file: &Path) -> Scene {
    let square = |material| Mesh {
        name: "square".into(),
        positions: [[-1, 1], [1, 1], [1, -1], [-1, -1]].map(|[x, z]| Vec3::new(x as f32, 0.0, z as f32)).to_vec(),
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material],
        ..Mesh::default()
    };
    let textured = Color { value: Vec3::splat(0.5), texture: Some(0) };
    let (surface, brdfs, _) = Surface::load(file, None).unwrap();
    let half = |texel: [f32; 4]| texel.map(half::f16::from_f32);
    let above = Affine3A::from_scale_rotation_translation(Vec3::splat(0.5), Quat::IDENTITY, Vec3::new(0.25, 0.75, 0.0));
    let place = |mesh, object_to_world| Instance { mesh, object_to_world };
    let mut bent = square(1);
    bent.positions[0].y = 0.25;
    let mut scene = scene(
        vec![square(0), bent],
        vec![material("floor", Surface::Diffuse { albedo: textured }), material("other", surface)],
        Vec3::new(1.0, 2.0, 2.0),
        Vec3::ZERO,
        [64, 48],
    );
    scene.brdfs = brdfs;
    scene.camera.vertical_fov_degrees = 45.0;
    scene.camera.up = Vec3::Y;
    scene.instances = vec![place(1, above), place(0, Affine3A::IDENTITY)];
    scene.textures = vec![Texture::new("texture", 2, vec![half([1.0, 0.5, 0.25, 1.0]), half([0.25, 0.5, 1.0, 1.0])])];
    scene.textures[0].placement = TexturePlacement { scale: Vec2::new(2.0, 1.0), offset: Vec2::new(0.25, 0.0) };
    scene.environment = Some(Environment::constant(Vec3::new(0.25, 0.5, 0.75)));
    scene.sun = Some(Sun { direction: Vec3::Y, irradiance: Vec3::new(1.0, 2.0, 1.0) });
    scene
}

/// What it then makes of that for a new renderer. The bent square is still the one in the engine's buffer if that alone has it.
fn renewed(changed: &Scene, file: &Path, on_device: bool) -> Scene {
    let mut scene = changed.clone();
    let albedo = Color::constant(Vec3::splat(0.5));
    scene.materials[0].surface = Surface::Coated { albedo, ior: 1.5, alpha: 0.25 };
    scene.brdfs = Surface::load(file, None).unwrap().1;
    let above = Affine3A::from_scale_rotation_translation(Vec3::splat(0.5), Quat::IDENTITY, Vec3::new(0.0, 0.5, 0.0));
    let below = Affine3A::from_translation(Vec3::new(0.0, -0.25, 0.0));
    let place = |mesh, object_to_world| Instance { mesh, object_to_world };
    scene.instances = vec![place(0, below), place(1, above)];
    if !on_device {
        scene.meshes[1].positions = scene.meshes[0].positions.clone();
    }
    scene
}

/// Pixels as a host writes them.
fn pixels_of(file: &Path) -> Vec<[u32; 3]> {
    let bytes = std::fs::read(file).unwrap();
    let words: Vec<u32> = bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
    words.chunks_exact(4).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
}

#[test]
fn a_host_in_cpp_gets_the_bits_of_rust() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    if !vulkan_headers_are_there() {
        return eprintln!("skipped: no Vulkan headers (Debian: libvulkan-dev)");
    }
    let scratch = tempfile::tempdir().unwrap();
    let installed = Installed::new();
    let Some(program) = installed.compile("g++", &["-std=c++17"], "host.cpp") else { return };
    let Some(program_of_cmake) = installed.compile_by_cmake() else { return };
    let file = Path::new(ROOT).join("scenes/cornell/cornell.obj");
    let (mut loaded, _) = Scene::load(&file).unwrap();
    loaded.film = Film { width: 64, height: 48 };
    // Of the made one the first of four frames is that of the scene before the changes; the loaded one is reset after two.
    let small = Shape { n_side: 4, features: 4, codes: 60, hidden: &[12, 16, 12], ..Shape::FULL };
    let materials = [1, 2, 3].map(|seed| {
        let file = scratch.path().join(format!("{seed}.neubrdf"));
        std::fs::write(&file, random_neubrdf(small, seed).encode(Precision::F16).unwrap()).unwrap();
        file
    });
    let changed = made_and_changed(&materials[1]);
    let made = ["made", "made-on-device"].map(|what| (Path::new(what), changed.clone(), 6));
    for (what, scene, samples) in std::iter::once((file.as_path(), loaded, 4)).chain(made) {
        let pixels = scratch.path().join("pixels.bin");
        let own_memory = what == file.as_path();
        let program = if own_memory { &program_of_cmake } else { &program };
        let mut command = installed.command(program);
        let said = run(command.arg(what).arg(&pixels).arg(LAVAPIPE).args(&materials)).unwrap();
        println!("{said}");
        assert!(said.contains("validation messages: 0"), "{said}");
        assert!(own_memory || said.contains("pieces of the engine's memory, 0 left"), "{said}");
        let settings = Settings { max_depth: 5, seed: 3, features: false, ..Settings::default() };
        let check = |file: &Path, scene: &Scene, samples| {
            let expected = bits(&render(&driver.device, scene, &settings, &Options::default(), samples));
            let found = pixels_of(file);
            assert_eq!(found.len(), expected.len());
            let differing = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
            let name = file.file_name().unwrap().display();
            assert!(differing == 0, "{}, {name}: {differing} of {} pixels differ", what.display(), expected.len());
        };
        check(&pixels, &scene, samples);
        if !own_memory {
            let on_device = what == Path::new("made-on-device");
            check(&scratch.path().join("pixels.bin.renewed"), &renewed(&scene, &materials[2], on_device), 4);
        }
    }
    driver.finish();
}

/// The header is C, and mistakes come back as results with words.
#[test]
fn mistakes_in_c_are_results() {
    if !vulkan_headers_are_there() {
        return eprintln!("skipped: no Vulkan headers (Debian: libvulkan-dev)");
    }
    let installed = Installed::new();
    if let Some(program) = installed.compile("cc", &["-std=c11", "-pedantic"], "mistakes.c") {
        let said = run(installed.command(&program).arg(Path::new(ROOT).join("Cargo.toml"))).unwrap();
        assert!(said.contains("all is as expected"), "{said}");
    }
}
