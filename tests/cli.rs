//! The command line, as a user meets it.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use common::{LAVAPIPE, driver};
use neubrdf::image::{plane, read_exr};
use tempfile::TempDir;

fn neubrdf(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_neubrdf")).args(arguments).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs, insists on success, gives standard output.
fn succeed(arguments: &[&str]) -> String {
    let output = neubrdf(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// Runs, insists on failure by a message, gives that.
fn fail(arguments: &[&str]) -> String {
    let output = neubrdf(arguments);
    let message = stderr(&output);
    assert!(!output.status.success() && !message.contains("panicked"), "{arguments:?}: {message}");
    message
}

/// A directory with a bare OBJ in it: a tetrahedron.
fn bare_obj() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("tetrahedron.obj");
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n").unwrap();
    (directory, path)
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// `neubrdf material X | head`.
#[test]
fn a_reader_that_leaves_early_is_no_error() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/materials/gold_satin.neubrdf");
    let mut command = Command::new(env!("CARGO_BIN_EXE_neubrdf"));
    command.args(["material", file]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", stderr(&output));
}

#[test]
fn info_lists_the_devices() {
    if driver(LAVAPIPE).is_none() {
        return;
    }
    let listing = succeed(&["info"]);
    assert!(listing.contains("llvmpipe") && listing.contains("traversal"), "{listing}");
}

#[test]
fn no_device_is_an_error_with_a_remedy() {
    if driver(LAVAPIPE).is_none() {
        return;
    }
    let (directory, obj) = bare_obj();
    let png = directory.path().join("out.png");
    let message = fail(&["render", text(&obj), "--png", text(&png), "--device", "voodoo"]);
    assert!(message.contains("voodoo"), "{message}");
    let output = Command::new(env!("CARGO_BIN_EXE_neubrdf"))
        .args(["render", text(&obj), "--png", text(&png)])
        .env("VK_DRIVER_FILES", "/nonexistent.json")
        .env_remove("VK_ADD_DRIVER_FILES")
        .output()
        .unwrap();
    let message = stderr(&output);
    assert!(!output.status.success() && message.contains("mesa-vulkan-drivers"), "{message}");
    assert!(!png.exists());
}

#[test]
fn a_bare_obj_renders() {
    if driver(LAVAPIPE).is_none() {
        return;
    }
    let (directory, obj) = bare_obj();
    let (exr, png) = (directory.path().join("out.exr"), directory.path().join("out.png"));
    let statistics = succeed(&[
        "render",
        text(&obj),
        "-o",
        text(&exr),
        "--png",
        text(&png),
        "--spp",
        "4",
        "--size",
        "32x24",
        "--quiet",
        "--stats",
        "json",
    ]);
    let statistics: serde_json::Value = serde_json::from_str(&statistics).unwrap();
    assert_eq!(statistics["spp"], 4);
    assert_eq!(statistics["stopped"], "samples");
    let (picture, metadata) = read_exr(&exr).unwrap();
    assert_eq!((picture.width, picture.height, metadata.spp), (32, 24, 4));
    for name in
        plane::BEAUTY.iter().chain(&plane::VARIANCE).chain(&plane::ALBEDO).chain(&plane::NORMAL).chain([&plane::DEPTH])
    {
        assert!(picture.f32(name).is_some(), "{name}");
    }
    for name in [plane::PRIMITIVE_ID, plane::MATERIAL_ID, plane::SAMPLES] {
        assert!(picture.u32(name).is_some(), "{name}");
    }
    // The camera is framed on the bounds: the body is in the picture, and so is the sky around it.
    let seen = picture.u32(plane::PRIMITIVE_ID).unwrap().iter().filter(|id| **id != plane::NO_ID).count();
    assert!((50..700).contains(&seen), "{seen} of 768 pixels see the body");
    assert_eq!(image::open(&png).unwrap().width(), 32);
}

#[test]
fn an_interrupted_render_resumes_to_the_same_file() {
    if driver(LAVAPIPE).is_none() {
        return;
    }
    let (directory, obj) = bare_obj();
    let path = |name: &str| directory.path().join(name);
    let render = |spp: &str, out: &Path, more: &[&str]| {
        let mut arguments =
            vec!["render", text(&obj), "--size", "24x24", "--quiet", "--seed", "5", "--spp", spp, "-o", text(out)];
        arguments.extend(more);
        succeed(&arguments);
        let (picture, mut metadata) = read_exr(out).unwrap();
        // How long it took is the one thing that may differ.
        metadata.render_seconds = 0.0;
        (picture, metadata)
    };
    let whole = render("12", &path("whole.exr"), &[]);
    let state = path("state");
    render("5", &path("part.exr"), &["--checkpoint", text(&state)]);
    let resumed = render("12", &path("resumed.exr"), &["--checkpoint", text(&state), "--resume"]);
    assert!(whole == resumed);
    // What it would replace is told; nothing is.
    let again = |state: &Path| fail(&["render", text(&obj), "-o", text(&path("x.exr")), "--checkpoint", text(state)]);
    let same = std::fs::read(&state).unwrap();
    let message = again(&state);
    assert!(message.contains("holds a render of 12 samples a pixel; say --resume"), "{message}");
    let message = again(&path("whole.exr"));
    assert!(message.contains("whole.exr: is no checkpoint"), "{message}");
    assert!(std::fs::read(&state).unwrap() == same && !path("x.exr").exists());
    let message = fail(&[
        "render",
        text(&obj),
        "--size",
        "25x24",
        "--checkpoint",
        text(&state),
        "--resume",
        "-o",
        text(&path("x.exr")),
    ]);
    assert!(message.contains("film width 24"), "{message}");
    std::fs::write(&obj, std::fs::read_to_string(&obj).unwrap().replace("v 1 0 0", "v 2 0 0")).unwrap();
    let out = path("x.exr");
    let changed = ["render", text(&obj), "--size", "24x24", "--seed", "5", "--spp", "12", "-o", text(&out)];
    let message = fail(&[&changed[..], &["--checkpoint", text(&state), "--resume"]].concat());
    assert!(message.contains("the scene, or a file that it names, has changed"), "{message}");
}

#[test]
fn a_users_mistake_names_the_thing() {
    let (directory, obj) = bare_obj();
    let out = directory.path().join("out.exr");
    assert!(fail(&["render", "/nonexistent.obj", "-o", text(&out)]).contains("/nonexistent.obj"));
    assert!(fail(&["render", text(&obj)]).contains("-o"));
    assert!(fail(&["render", text(&obj), "-o", text(&out), "--size", "0x7"]).contains("0x7"));
    let message = fail(&["render", text(&obj), "-o", text(&out), "--size", "70000x1"]);
    assert!(message.contains("'70000x1' is no size") && message.contains("from 1 to 65536"), "{message}");
    assert!(fail(&["render", text(&obj), "-o", text(&out), "--aov", "smell"]).contains("albedo"));
    assert!(fail(&["render", text(&obj), "-o", text(&out), "--traversal", "magic"]).contains("ray-query or bvh"));
    assert!(fail(&["compare", text(&obj), text(&obj)]).contains("tetrahedron.obj"));
    assert!(!out.exists());
}

#[test]
fn a_target_that_cannot_be_written_is_an_error_before_the_work() {
    let (_directory, obj) = bare_obj();
    let message = fail(&["render", text(&obj), "-o", "/nonexistent/out.exr", "--spp", "1000000"]);
    assert!(message.contains("there is no directory /nonexistent"), "{message}");
    if cfg!(target_os = "linux") {
        let message = fail(&["render", text(&obj), "-o", "/proc/out.exr"]);
        assert!(message.contains("no file can be made in /proc"), "{message}");
    }
    for (output, told) in [("/nonexistent/difference.png", "/nonexistent"), ("difference.gif", ".exr or .png")] {
        let message = fail(&["compare", text(&obj), text(&obj), "-o", output]);
        assert!(message.contains(told) && !message.contains("tetrahedron"), "{message}");
    }
}

#[test]
fn a_threshold_that_decides_nothing_and_an_option_that_does_nothing_are_refused() {
    for threshold in ["--max-mse=nan", "--max-rel-mse=inf", "--max-flip=-1", "--min-p=some"] {
        assert!(fail(&["compare", "a.exr", "b.exr", threshold]).contains("a number of at least 0"), "{threshold}");
    }
    for exposure in ["--exposure=nan", "--exposure=inf", "--exposure=-31"] {
        for command in [&["compare", "a.exr", "b.exr"][..], &["render", "a.obj", "--png", "a.png"]] {
            let message = fail(&[command, &[exposure]].concat());
            assert!(message.contains("stops from -30 to 30"), "{command:?} {exposure}: {message}");
        }
    }
    let message = fail(&["converge", "a.toml", "-o", "/nonexistent/report", "--spp", "0,4"]);
    assert!(message.contains("from 1 on, ascending"), "{message}");
    for option in [
        "a.toml",
        "--study=a.toml",
        "--traversal=bvh",
        "--sampler=pcg",
        "--light-sampling=off",
        "--bsdf-sampling=lobe",
        "--precision=f32",
        "--pool=7",
        "--model=truth",
        "--clamp-indirect=off",
        "--path-reuse=on",
        "--spp=4",
        "--repetitions=4",
        "--max-depth=4",
        "--size=4x4",
        "--reference-spp=4",
        "--reference=a.exr",
        "--cache=a",
        "--target=1",
        "--seed=1",
        "--clock=cpu",
        "--resume",
        "--assert=a.toml",
        "--compare=a.json",
    ] {
        assert!(fail(&["converge", "--suite=stability", option]).contains("cannot be used with"), "{option}");
    }
}

/// Nothing that is read, and nothing that was just written, is replaced.
#[test]
fn what_would_be_lost_is_refused() {
    let (directory, obj) = bare_obj();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let (obj, exr, here) = (text(&obj), path("a.exr"), path("./a.exr"));
    assert!(fail(&["render", obj, "-o", obj]).contains("must end in .exr"));
    assert!(fail(&["render", obj, "-o", &exr, "--png", &exr]).contains("must end in .png"));
    assert!(fail(&["render", obj, "-o", &exr, "--checkpoint", &here]).contains("written twice"));
    assert!(fail(&["render", obj, "-o", &exr, "--exposure", "1"]).contains("--png"));
    assert!(fail(&["render", obj, "-o", &exr, "--spp", "0"]).contains("--spp"));
    assert!(!Path::new(&exr).exists());
    let (csv, model) = (matte_samples(directory.path()), path("a.neubrdf"));
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/materials/denim.neubrdf");
    std::fs::copy(file, &model).unwrap();
    let same = std::fs::read(&model).unwrap();
    assert!(fail(&["train", &model, "-o", &model]).contains("another name"));
    assert!(fail(&["train", text(&csv), "-o", &model, "--checkpoint", &model]).contains("written twice"));
    for output in [&model, &path("new"), &path("a.wgsl")] {
        assert!(fail(&["export", &model, "--shader", "glsl", "-o", output]).contains("must end in .glsl"));
    }
    assert!(std::fs::read(&model).unwrap() == same);
}

/// A copy of a shipped scene's folder, and what a command line says of a file in it.
fn copied(name: &str) -> (TempDir, impl Fn(&str) -> String) {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let directory = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        std::fs::copy(entry.path(), directory.path().join(entry.file_name())).unwrap();
    }
    let folder = directory.path().to_owned();
    (directory, move |name: &str| folder.join(name).to_str().unwrap().to_owned())
}

/// What a scene loads is as much an input as the scene itself.
#[test]
fn no_file_that_a_scene_names_is_replaced() {
    let refuses = |file: &str, arguments: &[&str]| {
        let same = std::fs::read(file).unwrap();
        let message = fail(arguments);
        assert!(message.contains(file) && message.contains("would replace what is read"), "{message}");
        assert!(std::fs::read(file).unwrap() == same, "{file}");
    };
    let (_sky, at) = copied("sky");
    let (scene, texture, environment, elsewhere) = (at("scene.toml"), at("tiles.png"), at("sky.exr"), at("new.exr"));
    refuses(&texture, &["render", &scene, "--png", &texture]);
    refuses(&environment, &["render", &scene, "-o", &environment]);
    #[cfg(unix)]
    {
        let link = at("link.exr");
        std::os::unix::fs::symlink("sky.exr", &link).unwrap();
        refuses(&link, &["render", &scene, "-o", &link]);
    }
    let (_mosaic, at) = copied("mosaic");
    let (truth, color, recipe) = (at("truth.toml"), at("color.png"), at("glaze.toml"));
    if cfg!(feature = "embree") {
        refuses(&color, &["reference", &truth, "--png", &color]);
        refuses(&color, &["reference", &truth, "-o", &elsewhere, "--png", &color]);
    }
    let network = at("glaze.neubrdf");
    refuses(&network, &["train", &at("scene.toml"), "--name", "glaze", "-o", &network]);
    // The recipe has learned it, and does not name it; a material's file may name one, too.
    std::fs::write(&recipe, "type = 'measured'\nfile = 'glaze.neubrdf'\n").unwrap();
    refuses(&network, &["train", &recipe, "-o", &network]);
}

#[test]
fn what_another_renderer_cannot_show_leaves_no_directory() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path().join("mitsuba");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/sky/scene.toml");
    assert!(fail(&["export", scene, "--mitsuba", text(&folder)]).contains("a sky of many texels"));
    assert!(!folder.exists());
}

/// A kernel that promises any memory would take us at our word.
#[test]
#[cfg(feature = "embree")]
fn a_picture_that_no_memory_holds_is_an_error() {
    let promises = std::fs::read_to_string("/proc/sys/vm/overcommit_memory").unwrap_or_default();
    if promises.trim() == "1" {
        return;
    }
    let (directory, obj) = bare_obj();
    let exr = directory.path().join("out.exr");
    let message = fail(&["reference", text(&obj), "-o", text(&exr), "--size", "65535x65535", "--spp", "1"]);
    assert!(message.contains("65535×65535") && message.contains("use a smaller picture"), "{message}");
}

/// A batch system or a closed terminal ends a render as Ctrl-C does, but for what `nohup` started.
#[test]
fn a_render_that_is_told_to_end_loses_nothing() {
    if driver(LAVAPIPE).is_none() {
        return;
    }
    let (directory, obj) = bare_obj();
    let [exr, state] = ["out.exr", "state"].map(|name| directory.path().join(name));
    let mut command = Command::new("nohup");
    command.args([env!("CARGO_BIN_EXE_neubrdf"), "render", text(&obj), "-o", text(&exr), "--size", "16x16"]);
    command.args(["--time", "600", "--checkpoint", text(&state), "--checkpoint-interval", "0"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let signal = |name: &str, id: u32| Command::new("kill").args([name, &id.to_string()]).status().unwrap();
    for checkpoint in 0..5 {
        while !state.exists() {
            assert!(child.try_wait().unwrap().is_none(), "it ended after {checkpoint} checkpoints");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        std::fs::remove_file(&state).unwrap();
        assert!(signal("-HUP", child.id()).success());
    }
    assert!(signal("-TERM", child.id()).success());
    let output = child.wait_with_output().unwrap();
    let said = stderr(&output);
    assert!(output.status.code() == Some(130) && said.contains("interrupted: "), "{said}");
    assert!(read_exr(&exr).unwrap().1.spp > 0);
}

/// What is ended early looks like what is done, but for a word and the exit status.
#[test]
fn what_is_interrupted_says_so() {
    let (directory, obj) = bare_obj();
    let (csv, path) = (matte_samples(directory.path()), |name: &str| directory.path().join(name));
    let (model, exr) = (path("matte.neubrdf"), path("out.exr"));
    let told_to_end = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_neubrdf"));
        let mut child = command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // Not before it listens.
        let listens = |status: String| {
            let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).map(str::trim);
            u64::from_str_radix(caught.unwrap_or("0"), 16).unwrap() >> 14 & 1 == 1
        };
        while !listens(std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap()) {
            assert!(child.try_wait().unwrap().is_none(), "{arguments:?} ended by itself");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
        stderr(&output) + &String::from_utf8(output.stdout).unwrap()
    };
    let train = ["train", text(&csv), "-o", text(&model), "--quality", "draft", "--steps", "5000", "--hidden", "16"];
    let share = [&train[..], &["--share"]].concat();
    for arguments in [&train[..], &share] {
        let said = told_to_end(arguments);
        assert!(said.contains(&format!("interrupted: {}: ", model.display())), "{said}");
    }
    let (few, groups) = (samples(&path("few.csv"), 100, 23), path("group.neubrdf"));
    let grouped = ["train", text(&csv), text(&few), "-o", text(&groups), "--share", "--groups", "2", "--steps", "5000"];
    let said = told_to_end(&[&grouped[..], &["--quality", "draft", "--hidden", "16"]].concat());
    assert!(said.contains("group-2.neubrdf and later ones were not begun"), "{said}");
    if cfg!(feature = "embree") {
        let said = told_to_end(&["reference", text(&obj), "-o", text(&exr), "--size", "512x512", "--spp", "1000000"]);
        assert!(said.contains("interrupted: ") && exr.exists(), "{said}");
    }
}

#[test]
fn compare_exits_by_its_thresholds() {
    if driver(LAVAPIPE).is_none() {
        return;
    }
    let (directory, obj) = bare_obj();
    let path = |name: &str| directory.path().join(name);
    for (name, seed) in [("a.exr", "1"), ("b.exr", "2")] {
        succeed(&[
            "render",
            text(&obj),
            "-o",
            text(&path(name)),
            "--spp",
            "8",
            "--size",
            "32x24",
            "--quiet",
            "--seed",
            seed,
            "--sampler",
            "pcg",
        ]);
    }
    let (a, b, difference) = (path("a.exr"), path("b.exr"), path("difference.png"));
    succeed(&["compare", text(&a), text(&b), "-o", text(&difference), "--min-p", "1e-4"]);
    assert!(difference.exists());
    assert!(fail(&["compare", text(&a), text(&b), "--max-mse", "1e-12"]).contains("MSE"));
    let single = path("single.exr");
    succeed(&["render", text(&obj), "-o", text(&single), "--spp", "1", "--size", "32x24", "--quiet"]);
    assert!(succeed(&["compare", text(&single), text(&single), "--max-mse", "0"]).contains("z-test            none"));
    assert!(fail(&["compare", text(&single), text(&single), "--min-p", "1e-4"]).contains("two samples a pixel"));
    let [left, right] = ["0,0,8,8", "8,0,8,8"].map(|crop| {
        let part = path(&format!("{crop}.exr"));
        let job = ["render", text(&obj), "-o", text(&part), "--spp", "1", "--size", "32x24", "--quiet", "--crop", crop];
        succeed(&job);
        part
    });
    let message = fail(&["compare", text(&left), text(&right)]);
    assert!(message.contains("begins at pixel (0, 0) of its film, the reference at (8, 0)"), "{message}");
    let json: serde_json::Value = serde_json::from_str(&succeed(&["compare", text(&a), text(&a), "--json"])).unwrap();
    assert_eq!(json["metrics"]["mse"], 0.0);
}

/// Samples of a matte material, as a CSV.
fn matte_samples(directory: &Path) -> PathBuf {
    samples(&directory.join("matte.csv"), 150, 0)
}

/// So many of them, of azimuths of ωi so far apart: 0 is what makes it isotropic.
fn samples(path: &Path, count: usize, turn: usize) -> PathBuf {
    let mut rows = String::from("wi_theta,wi_phi,wo_theta,wo_phi,r,g,b\n");
    for i in 0..count {
        rows += &format!("{},{},{},{},0.2,0.1,0.05\n", i * 7 % 80, i * turn % 360, i * 11 % 80, i * 37 % 360);
    }
    std::fs::write(path, rows).unwrap();
    path.to_owned()
}

#[test]
fn a_material_is_trained_described_drawn_and_checked() {
    let directory = tempfile::tempdir().unwrap();
    let (csv, file) = (matte_samples(directory.path()), directory.path().join("matte.neubrdf"));
    let train = |more: &[&str]| {
        let mut arguments = vec!["train", text(&csv), "-o", text(&file), "--quality", "draft", "--steps", "200"];
        arguments.extend(["--hidden", "16"]);
        arguments.extend(more);
        succeed(&arguments)
    };
    let said = train(&[]);
    assert!(said.contains("measurements that were held out") && !said.contains("SSIM"), "{said}");
    let first = std::fs::read(&file).unwrap();
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(directory.path().join("matte.json")).unwrap()).unwrap();
    assert_eq!(report["steps"], 200);
    assert_eq!(report["bytes"], first.len());
    let page = std::fs::read_to_string(directory.path().join("matte.html")).unwrap();
    // Between measurements there is no truth to be away from.
    assert_eq!(page.matches("data:image/png;base64,").count(), 2);
    assert!(page.contains("interpolated measurements") && !page.contains("ground truth"));
    let [learned, held_out] =
        ["learned", "held_out"].map(|which| report["residuals"][which]["measurements"].as_u64().unwrap());
    assert!((1..40).contains(&held_out) && learned + held_out == 150, "{learned} and {held_out}");
    assert!(report["errors"].is_null());
    assert!(page.contains("<svg") && !page.contains("http://localhost") && !page.contains("src=\"/"));

    assert_eq!(train(&["--no-report", "--quiet"]), "");
    assert!(std::fs::read(&file).unwrap() == first, "the same seed gives another file");

    let plot = directory.path().join("lobes.svg");
    let facts = succeed(&["material", text(&file), "--json", "--plot", text(&plot), "--check", "--max-albedo", "1e9"]);
    let facts: serde_json::Value = serde_json::from_str(&facts).unwrap();
    assert_eq!(facts["is_isotropic"], true);
    assert_eq!(facts["neubrdf"]["provenance"]["errors"]["held-out measurements"], held_out as f64);
    assert_eq!(facts["check"]["negative"], 0);
    assert!(std::fs::read_to_string(&plot).unwrap().contains("polyline"));
    let output = neubrdf(&["material", text(&file), "--check", "--max-albedo", "1e-9"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("above 0.000000001 (--max-albedo)"), "{}", stderr(&output));
    for most in ["nan", "inf", "-1"] {
        let option = format!("--max-albedo={most}");
        assert!(fail(&["material", text(&file), "--check", &option]).contains("a number of at least 0"), "{option}");
    }
}

/// A material is no way from itself, and some way from another and from measurements.
#[test]
fn a_material_is_compared_with_another() {
    let directory = tempfile::tempdir().unwrap();
    let material = |name: &str| format!("{}/scenes/materials/{name}", env!("CARGO_MANIFEST_DIR"));
    let (gold, red, fit) = (material("gold_satin.toml"), material("plastic_red.toml"), material("gold_satin.neubrdf"));
    let against = |a: &str, b: &str| {
        let facts = succeed(&["material", a, "--against", b, "--json"]);
        serde_json::from_str::<serde_json::Value>(&facts).unwrap()["against"].clone()
    };
    let ssim = |facts: serde_json::Value| facts["ball"]["ssim"].as_f64().unwrap();
    assert!(ssim(against(&gold, &gold)) > 1.0 - 1e-9 && ssim(against(&fit, &gold)) > 0.99);
    assert!(ssim(against(&red, &gold)) < 0.9);
    let samples = against(&gold, text(&matte_samples(directory.path())));
    assert!(samples["measurements"] == 150 && samples["log"].as_f64().unwrap() > 0.01, "{samples}");
}

/// What a file is hangs on its ending, and not on how that is written.
#[test]
fn endings_may_be_in_capitals() {
    let directory = tempfile::tempdir().unwrap();
    let samples = std::fs::rename(matte_samples(directory.path()), directory.path().join("M.CSV"));
    let gold = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/materials/gold_satin.toml");
    let copied = std::fs::copy(gold, directory.path().join("G.TOML"));
    assert!(samples.is_ok() && copied.is_ok());
    std::fs::write(directory.path().join("U.CSV"), "u,v,wi_theta,wi_phi,wo_theta,wo_phi,r,g,b\n0,0,0,0,0,0,1,1,1\n")
        .unwrap();
    for name in ["M.CSV", "U.CSV", "G.TOML"] {
        succeed(&["material", text(&directory.path().join(name))]);
    }
}

/// Groups of what is alike, a pack each; members are listed, and picked by name.
#[test]
fn materials_are_grouped_and_trained_together() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let csv = std::fs::read_to_string(matte_samples(directory.path())).unwrap();
    for (name, values) in [("red", "0.2,0.1,0.05"), ("pink", "0.21,0.1,0.06"), ("black", "0.001,0.001,0.001")] {
        std::fs::write(at(name).with_extension("csv"), csv.replace("0.2,0.1,0.05", values)).unwrap();
    }
    let inputs = ["red.csv", "black.csv", "pink.csv"].map(|name| at(name).to_str().unwrap().to_owned());
    let inputs: Vec<&str> = inputs.iter().map(String::as_str).collect();
    let train = |output: &str, more: &[&str]| {
        let common = ["--share", "--quality", "draft", "--steps", "60", "--hidden", "16"];
        succeed(&[&["train"], &inputs[..], &["-o", text(&at(output))], &common, more].concat())
    };
    let said = train("group.neubrdf", &["--groups", "2"]);
    assert!(said.contains("group-1.neubrdf: red pink\n") && said.contains("group-2.neubrdf: black\n"), "{said}");
    let pack = at("group-1.neubrdf");
    let facts: serde_json::Value = serde_json::from_str(&succeed(&["material", text(&pack), "--json"])).unwrap();
    assert_eq!(facts["count"], 2);
    assert!(facts["materials"]["red"]["wi"]["codes"].is_u64());
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(at("group-1.json")).unwrap()).unwrap();
    assert_eq!(report["bytes"], std::fs::metadata(&pack).unwrap().len());
    assert_eq!(report["members"][1]["source"], "pink");
    assert!(std::fs::read_to_string(at("group-1.html")).unwrap().contains("<details>"));
    for name in ["red", "pink"] {
        succeed(&["material", text(&pack), "--name", name, "--check", "--max-albedo", "1e9"]);
    }
    assert!(fail(&["material", text(&pack), "--check"]).contains("one of the 2 materials"));
    assert!(fail(&["material", text(&pack), "--name", "rod"]).contains("`red`"));
    // So are those of a scene.
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/neural/scene.toml");
    let facts: serde_json::Value = serde_json::from_str(&succeed(&["material", text(&scene), "--json"])).unwrap();
    assert!(facts["count"].as_u64() > Some(10) && facts["names"].to_string().contains("gold_satin"), "{facts}");

    // Interrupted before the second group began.
    let state = at("state");
    let whole = ["group-1.neubrdf", "group-2.neubrdf"].map(|name| std::fs::read(at(name)).unwrap());
    let checkpoint = ["--groups", "2", "--checkpoint", text(&state)];
    train("group.neubrdf", &checkpoint);
    let output = at("group.neubrdf");
    let again = [&["train"], &inputs[..], &["-o", text(&output), "--share"], &checkpoint].concat();
    assert!(fail(&again).contains("state-1: holds a training of 60 steps; say --resume"));
    std::fs::remove_file(at("state-2")).unwrap();
    train("group.neubrdf", &[&checkpoint[..], &["--resume"]].concat());
    assert!(whole == ["group-1.neubrdf", "group-2.neubrdf"].map(|name| std::fs::read(at(name)).unwrap()));

    assert_eq!(train("all.neubrdf", &["--share-network", "--quiet", "--no-report"]), "");
    assert!(!at("all.json").exists());
    let out = at("out.neubrdf");
    let error = |more: &[&str]| fail(&[&["train"], &inputs[..], &["-o", text(&out)], more].concat());
    assert!(error(&[]).contains("--share"));
    assert!(error(&["--share-network"]).contains("--share"));
    assert!(error(&["--share", "--name", "red"]).contains("several"));
    assert!(error(&["--share", "--recipe", "unquantised"]).contains("codebooks"));
    assert!(error(&["--share", "--texels", "8", "--texel-codes", "9"]).contains("--texels, --texel-codes: "));
    for option in ["--groups", "--group-size"] {
        assert!(error(&["--share", option, "0"]).contains("1.."), "{option} 0");
    }
    assert!(fail(&["train", inputs[0], inputs[0], "-o", text(&out), "--share"]).contains("`red`"));
}

/// Functions and measurements, isotropic or not, many or few, are learned on grids of their own and still share codebooks.
#[test]
fn what_is_known_everywhere_shares_with_what_is_not() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let function = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/materials/gold_satin.toml");
    let (matte, few, many) =
        (matte_samples(directory.path()), samples(&at("few.csv"), 100, 23), samples(&at("many.csv"), 400, 23));
    let pack = at("group.neubrdf");
    let inputs = [function, text(&matte), text(&few), text(&many)];
    let how = ["--share", "-o", text(&pack), "--quality", "draft", "--steps", "40", "--hidden", "16", "--no-report"];
    succeed(&[&["train"], &inputs[..], &how].concat());
    let facts: serde_json::Value = serde_json::from_str(&succeed(&["material", text(&pack), "--json"])).unwrap();
    let n_side = |name: &str| facts["materials"][name]["wo"]["n_side"].as_u64();
    assert_eq!(["gold_satin", "matte", "few", "many"].map(n_side), [16, 1, 1, 2].map(Some));
}

#[test]
fn mistakes_in_training_name_the_thing() {
    let directory = tempfile::tempdir().unwrap();
    let csv = matte_samples(directory.path());
    let (good, out) = (text(&csv), directory.path().join("out.neubrdf"));
    let out = text(&out);
    assert!(fail(&["train", "/nonexistent.binary", "-o", out]).contains("/nonexistent.binary"));
    assert!(fail(&["train", good, "-o", "out.obj"]).contains(".neubrdf"));
    assert!(fail(&["train", good, "-o", out, "--model", "nbrdf"]).contains(".safetensors"));
    assert!(fail(&["train", good, "-o", "/nonexistent/out.neubrdf"]).contains("/nonexistent"));
    assert!(fail(&["train", good, "-o", out, "--n-side", "12"]).contains("--n-side"));
    assert!(fail(&["train", good, "-o", out, "--features", "0"]).contains("--features"));
    assert!(fail(&["train", good, "-o", out, "--codes", "0"]).contains("--codes: found 0, expected 2 to 65534"));
    let nbrdf =
        ["train", good, "-o", "nbrdf.safetensors", "--model", "nbrdf", "--n-side", "8", "--hidden", "32", "--f32"];
    assert!(fail(&nbrdf).contains("--n-side, --hidden, --f32: an NBRDF"));
    // What is told is what was said.
    let maps = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/mosaic/glaze.toml");
    assert!(fail(&["train", maps, "-o", out, "--texel-codes", "70000"]).contains("--texel-codes: found 70000"));
    let metal = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/materials/copper_turned.toml");
    succeed(&[
        "train",
        metal,
        "-o",
        out,
        "--n-side",
        "2",
        "--steps",
        "1",
        "--quality",
        "draft",
        "--no-report",
        "--quiet",
    ]);
    std::fs::remove_file(out).unwrap();
    assert!(fail(&["train", good, "-o", out, "--resume"]).contains("--checkpoint"));
    let other = directory.path().join("other");
    std::fs::copy(good, &other).unwrap();
    let checkpoint = ["--resume", "--checkpoint", text(&other), "--quality", "draft"];
    for checkpoint in [&checkpoint[..], &checkpoint[1..]] {
        assert!(fail(&[&["train", good, "-o", out][..], checkpoint].concat()).contains("other: is no checkpoint"));
    }
    assert!(std::fs::read(&other).unwrap() == std::fs::read(good).unwrap());
    assert!(!Path::new(out).exists());
    for input in ["/nonexistent.neubrdf", good] {
        assert!(!neubrdf(&["material", input, "--plot", "lobes.png"]).status.success());
    }
}

/// Thresholds decide on the exit status; mistakes are told before anything is rendered.
#[test]
#[cfg(feature = "embree")]
fn converge_reports_judges_and_compares() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell/scene.toml");
    let (cache, good, bad, wrong) = (at("cache"), at("good.toml"), at("bad.toml"), at("wrong.toml"));
    std::fs::write(&good, "[[method]]\nslope = [-3, 0]\nbias_p = 1e-6\n").unwrap();
    std::fs::write(&bad, "[[method]]\nrel_mse = 1e-9\nshown = true\n").unwrap();
    std::fs::write(&wrong, "[[method]]\nslop = 1\n").unwrap();
    let common = |output: &str, further: &[&str]| {
        let mut arguments = vec!["converge", scene, "-o", output, "--cache", &cache, "--device", "embree", "--quiet"];
        arguments.extend([
            "--size",
            "8x8",
            "--spp",
            "2,8",
            "--repetitions",
            "3",
            "--max-depth",
            "3",
            "--reference-spp",
            "64",
        ]);
        arguments.extend(further);
        neubrdf(&arguments)
    };
    let (first, second) = (at("first"), at("second"));
    let held = common(&first, &["--assert", &good]);
    assert!(held.status.success(), "{}", stderr(&held));
    for file in ["report.html", "runs.csv", "study.json", "analysis.json"] {
        assert!(Path::new(&first).join(file).is_file(), "{file}");
    }
    let broken = common(&first, &["--resume", "--assert", &bad]);
    assert_eq!(broken.status.code(), Some(3), "{}", stderr(&broken));
    assert!(String::from_utf8_lossy(&broken.stdout).contains("✗") && stderr(&broken).contains("broken"));
    assert!(stderr(&common(&second, &["--assert", &wrong])).contains("`slope`"));
    assert!(!Path::new(&second).exists());
    let study = at("study.toml");
    std::fs::write(&study, "[[scene]]\nfile = 'none.toml'\n").unwrap();
    let message = fail(&["converge", "--study", &study, "-o", &second, "--device", "embree", "--quiet"]);
    assert!(message.contains("none.toml: cannot be read") && message.contains("(named by"), "{message}");
    assert!(message.contains("study.toml:1: scene[0])"), "{message}");
    assert!(stderr(&common(&second, &["--sampler", "halton"])).contains("sobol or pcg"));
    assert!(stderr(&common(&first, &[])).contains("--resume"));
    let compared = common(&second, &["--seed", "9", "--compare", &format!("{first}/study.json")]);
    let text = String::from_utf8_lossy(&compared.stdout).into_owned();
    assert!(compared.status.success() && text.contains("efficiency"), "{text}{}", stderr(&compared));
}
