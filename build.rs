//! Keeps `spirv/` up to date with `glsl/kernels/*.comp` and generates the table of modules that `gpu::spirv` serves. Likewise
//! `spirv/export/` with `glsl/export/*.comp`, modules for other programs, which are not in the table.
//!
//! `spirv/NAME.spv` is checked in, so that nobody needs a shader compiler. Beside it stands `spirv/NAME.hash`: a hash of
//! the kernel's source, of everything that it includes, of the compiler flags and of the compiler's version. Where the
//! sources no longer agree with it and glslangValidator is installed, the module is compiled anew. Another compiler
//! version alone compiles nothing: the module still is what its record says. (To move to a new compiler, delete
//! `spirv/*.hash` and build.)
//!
//! `tests/layout.rs` includes this file to check that no module is stale.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;
use std::{env, fs, io};

const COMPILER: &str = "glslangValidator";
// Names stay in the modules: tests/layout.rs compares them with the Rust structs.
const FLAGS: [&str; 5] = ["-V", "--target-env", "vulkan1.2", "-Iglsl", "--quiet"];
// Vulkan 1.2's SPIR-V has instructions that naga does not read.
const EXPORT_FLAGS: [&str; 5] = ["-V", "--target-env", "vulkan1.1", "-Iglsl", "--quiet"];

/// The CPU reference, and what it asks for values.
const REFERENCE_ROOMS: [&str; 3] = ["src/material", "src/reference", "src/scene"];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=glsl");
    println!("cargo:rerun-if-changed=spirv");
    tell_revision();
    if let Err(message) = tell_reference().and_then(|()| build()) {
        eprintln!("{message}");
        std::process::exit(1);
    }
}

/// The commit as NEUBRDF_REVISION, where there is a repository.
fn tell_revision() {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    if let (Some(revision), Some(log)) = (git(&["rev-parse", "HEAD"]), git(&["rev-parse", "--git-path", "logs/HEAD"])) {
        println!("cargo:rustc-env=NEUBRDF_REVISION={revision}");
        println!("cargo:rerun-if-changed={log}");
    }
}

/// [`reference_hash`] as NEUBRDF_REFERENCE.
fn tell_reference() -> Result<(), String> {
    REFERENCE_ROOMS.iter().for_each(|room| println!("cargo:rerun-if-changed={room}"));
    let hash = reference_hash(&root()?).map_err(|e| format!("{}: {e}", REFERENCE_ROOMS.join(", ")))?;
    println!("cargo:rustc-env=NEUBRDF_REFERENCE={hash}");
    Ok(())
}

/// A hash of all code that decides what the CPU reference shows of a scene, so that pictures which other code made are not taken for its.
/// Whole rooms: a file too many makes a reference anew for nothing, one too few keeps a wrong one.
pub fn reference_hash(root: &Path) -> io::Result<String> {
    let mut sources = BTreeMap::new();
    let mut open: Vec<PathBuf> = REFERENCE_ROOMS.iter().map(PathBuf::from).collect();
    while let Some(path) = open.pop() {
        let file = root.join(&path);
        if file.is_dir() {
            for entry in fs::read_dir(file)? {
                open.push(path.join(entry?.file_name()));
            }
        } else if file.is_file() && path.extension().is_some_and(|extension| extension == "rs") {
            sources.insert(path, fs::read(file)?);
        }
    }
    let mut hasher = blake3::Hasher::new();
    for (path, text) in sources {
        hasher.update(format!("{}\0{}\0", path.display(), text.len()).as_bytes()).update(&text);
    }
    Ok(hasher.finalize().to_hex()[..16].to_owned())
}

fn root() -> Result<PathBuf, String> {
    env::var("CARGO_MANIFEST_DIR").map(PathBuf::from).map_err(|e| e.to_string())
}

fn build() -> Result<(), String> {
    let root = root()?;
    let kernels = kernels(&root).map_err(|e| format!("glsl/kernels: {e}"))?;
    let exported = exported(&root).map_err(|e| format!("glsl/export: {e}"))?;
    remove_orphans(&root, "", &kernels).map_err(|e| format!("spirv: {e}"))?;
    remove_orphans(&root, "export/", &exported).map_err(|e| format!("spirv/export: {e}"))?;
    let version = compiler_version();
    let mut errors = Vec::new();
    for kernel in kernels.iter().chain(&exported) {
        if is_fresh(&root, kernel)? {
            continue;
        }
        match &version {
            Some(version) => errors.extend(compile(&root, kernel, version).err()),
            None => println!(
                "cargo:warning=spirv/{kernel}.spv is older than glsl/{}: install {COMPILER} (Debian: glslang-tools)",
                source(kernel)
            ),
        }
    }
    if !errors.is_empty() {
        return Err(errors.join("\n"));
    }
    let table = table(&root).map_err(|e| format!("spirv: {e}"))?;
    let out = Path::new(&env::var("OUT_DIR").map_err(|e| e.to_string())?).join("spirv_table.rs");
    fs::write(&out, table).map_err(|e| format!("{}: {e}", out.display()))
}

/// The names of all kernels, sorted.
pub fn kernels(root: &Path) -> io::Result<Vec<String>> {
    stems(&root.join("glsl/kernels"), "comp")
}

/// The names of all modules for other programs, sorted.
pub fn exported(root: &Path) -> io::Result<Vec<String>> {
    let stems = stems(&root.join("glsl/export"), "comp")?;
    Ok(stems.iter().map(|stem| format!("export/{stem}")).collect())
}

/// The source of a module, below `glsl/`.
fn source(module: &str) -> String {
    if module.starts_with("export/") { format!("{module}.comp") } else { format!("kernels/{module}.comp") }
}

fn flags(module: &str) -> [&'static str; 5] {
    if module.starts_with("export/") { EXPORT_FLAGS } else { FLAGS }
}

/// Whether `spirv/NAME.spv` was compiled from today's sources with today's flags.
pub fn is_fresh(root: &Path, kernel: &str) -> Result<bool, String> {
    let Ok(record) = fs::read_to_string(root.join(format!("spirv/{kernel}.hash"))) else { return Ok(false) };
    let version = record.lines().find_map(|line| line.strip_prefix("compiler: ")).unwrap_or_default();
    Ok(root.join(format!("spirv/{kernel}.spv")).is_file() && record == self::record(root, kernel, version)?)
}

/// What `spirv/NAME.hash` should hold for a module compiled from today's sources by the compiler of that version.
fn record(root: &Path, kernel: &str, version: &str) -> Result<String, String> {
    let flags = flags(kernel).join(" ");
    let mut hasher = blake3::Hasher::new();
    for (path, text) in sources(root, kernel)? {
        hasher.update(format!("{path}\0{}\0", text.len()).as_bytes()).update(text.as_bytes());
    }
    let hash = hasher.update(format!("{flags}\0{version}").as_bytes()).finalize();
    Ok(format!(
        "# What spirv/{kernel}.spv was compiled from: glsl/{} and all that it includes. Written by build.rs.\n\
         compiler: {version}\nflags: {flags}\nblake3 of sources, flags and compiler: {hash}\n",
        source(kernel)
    ))
}

/// The kernel's source and everything that it includes, by path below `glsl/`.
fn sources(root: &Path, kernel: &str) -> Result<BTreeMap<String, String>, String> {
    let glsl = root.join("glsl");
    let mut found = BTreeMap::new();
    let mut open = vec![source(kernel)];
    while let Some(path) = open.pop() {
        if found.contains_key(&path) {
            continue;
        }
        let text = fs::read_to_string(glsl.join(&path)).map_err(|e| format!("glsl/{path}: {e}"))?;
        for line in text.lines() {
            let Some(rest) = line.trim_start().strip_prefix('#') else { continue };
            let Some(rest) = rest.trim_start().strip_prefix("include") else { continue };
            let Some(name) = rest.trim().strip_prefix('"').and_then(|r| r.split('"').next()) else { continue };
            // A file that is missing is glslang's to report, with the line that asked for it.
            if glsl.join(name).is_file() {
                open.push(name.to_string());
            }
        }
        found.insert(path, text);
    }
    Ok(found)
}

/// Compiles one kernel and writes its record. The files are written whole or not at all.
fn compile(root: &Path, kernel: &str, version: &str) -> Result<(), String> {
    let io_error = |e: io::Error| format!("spirv/{kernel}.spv: {e}");
    let record = record(root, kernel, version)?;
    let module = root.join(format!("spirv/{kernel}.spv"));
    let unfinished = module.with_extension(format!("{}.unfinished", std::process::id()));
    fs::create_dir_all(module.parent().unwrap_or(root)).map_err(io_error)?;
    let output = Command::new(COMPILER)
        .current_dir(root)
        .args(flags(kernel))
        .arg("-o")
        .arg(&unfinished)
        .arg(format!("glsl/{}", source(kernel)))
        .output()
        .map_err(|e| format!("{COMPILER}: {e}"))?;
    if !output.status.success() {
        let _ = fs::remove_file(&unfinished);
        return Err(format!("glsl/{} does not compile:\n{}", source(kernel), String::from_utf8_lossy(&output.stdout)));
    }
    fs::rename(&unfinished, &module).map_err(io_error)?;
    fs::write(&unfinished, record).map_err(io_error)?;
    let hash = root.join(format!("spirv/{kernel}.hash"));
    fs::rename(&unfinished, &hash).map_err(io_error)?;
    // As old as its source: otherwise Cargo would see a change in spirv/ and run this script again the next time.
    let modified = newest(&root.join("glsl")).map_err(io_error)?;
    for path in [module, hash] {
        fs::File::options().write(true).open(path).and_then(|file| file.set_modified(modified)).map_err(io_error)?;
    }
    Ok(())
}

fn newest(directory: &Path) -> io::Result<SystemTime> {
    let mut newest = SystemTime::UNIX_EPOCH;
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        let time =
            if entry.file_type()?.is_dir() { self::newest(&entry.path())? } else { entry.metadata()?.modified()? };
        newest = newest.max(time);
    }
    Ok(newest)
}

/// A module whose source is gone goes too; `folder` is empty or ends in a slash, as the names below it begin.
fn remove_orphans(root: &Path, folder: &str, modules: &[String]) -> io::Result<()> {
    let directory = root.join("spirv").join(folder);
    let modules: BTreeSet<&String> = modules.iter().collect();
    for extension in ["spv", "hash"] {
        for stem in stems(&directory, extension)? {
            if !modules.contains(&format!("{folder}{stem}")) {
                fs::remove_file(directory.join(format!("{stem}.{extension}")))?;
            }
        }
    }
    Ok(())
}

/// The table that `src/gpu/spirv.rs` includes: `(name, bytes)`, sorted by name.
fn table(root: &Path) -> io::Result<String> {
    let directory = root.join("spirv");
    let rows: Vec<String> = stems(&directory, "spv")?
        .iter()
        .map(|name| format!("    ({name:?}, include_bytes!({:?})),\n", directory.join(format!("{name}.spv"))))
        .collect();
    Ok(format!("&[\n{}]\n", rows.concat()))
}

/// The names, without the extension, of a directory's visible files that have it; none where there is no directory.
fn stems(directory: &Path, extension: &str) -> io::Result<Vec<String>> {
    if !directory.is_dir() {
        return Ok(Vec::new());
    }
    let mut stems = Vec::new();
    for entry in fs::read_dir(directory)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if let Some(stem) = name.strip_suffix(&format!(".{extension}")).filter(|stem| !stem.starts_with('.')) {
            stems.push(stem.to_string());
        }
    }
    stems.sort();
    Ok(stems)
}

fn compiler_version() -> Option<String> {
    let output = Command::new(COMPILER).arg("--version").output().ok()?;
    String::from_utf8_lossy(&output.stdout).lines().next().map(str::to_string)
}
