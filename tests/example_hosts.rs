//! The hosts in `examples` as programs, the one with a window on an X server without a screen: what they write and present is the
//! picture, and synchronization validation is silent.

#[path = "../examples/window/caption.rs"]
mod caption;
mod common;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use common::{Driver, LAVAPIPE, driver};
use neubrdf::image::{plane, tone_map};
use neubrdf::render::{Options, Renderer, Settings};
use neubrdf::scene::{Film, Scene};

/// An X server of our own.
struct Screen {
    server: Child,
    display: String,
}

impl Screen {
    /// None where there is no Xvfb, unless drivers are required.
    fn new() -> Option<Screen> {
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "800x600x24", "-nolisten", "tcp"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let mut server = match server {
            Ok(server) => server,
            Err(error) if std::env::var_os("NEUBRDF_REQUIRE_DRIVERS").is_some() => {
                panic!("Xvfb is required here: {error}")
            }
            Err(error) => {
                eprintln!("skipped: Xvfb: {error}");
                return None;
            }
        };
        // It writes the number of its display when it is ready.
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Some(Screen { server, display: format!(":{}", number.trim()) })
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// An example, which `cargo test` has built beside the tests; by itself, if only this test was asked for.
fn example(name: &str) -> PathBuf {
    let tests = std::env::current_exe().unwrap();
    let path = tests.ancestors().nth(2).unwrap().join("examples").join(name);
    if !path.exists() {
        let mut cargo = Command::new(env!("CARGO"));
        let built =
            cargo.args(["build", "--locked", "--example", name]).current_dir(env!("CARGO_MANIFEST_DIR")).status();
        assert!(built.unwrap().success());
    }
    path
}

/// The Cornell box, small.
fn scene(folder: &Path, [width, height]: [u32; 2]) -> PathBuf {
    let box_file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell/cornell.obj");
    let text = format!(
        "[camera]\neye = [0, 0, 3.9]\ntarget = [0, 0, 0]\nfov = 39.3077\n\
         [film]\nwidth = {width}\nheight = {height}\n[[mesh]]\nfile = {box_file:?}\n"
    );
    let file = folder.join("scene.toml");
    std::fs::write(&file, text).unwrap();
    file
}

/// Runs an example on lavapipe to its end, under the validation layer, which has nothing to say.
fn run(name: &str, folder: &Path, arguments: impl FnOnce(&mut Command)) {
    let log = folder.join("validation.txt");
    let settings = format!(
        "khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG\nkhronos_validation.report_flags = error,warn\n\
         khronos_validation.enables = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT\n\
         khronos_validation.log_filename = {}\n",
        log.display()
    );
    std::fs::write(folder.join("vk_layer_settings.txt"), settings).unwrap();
    let mut command = Command::new(example(name));
    arguments(&mut command);
    let output = command
        .env("VK_LOADER_DRIVERS_SELECT", "lvp*")
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_SETTINGS_PATH", folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // The layer made the file when it was loaded.
    assert_eq!(std::fs::read_to_string(&log).unwrap(), "");
}

/// What the path tracer on its own shows after so many samples, three bytes a pixel.
fn expected(driver: &Driver, scene: &Scene, samples: u32) -> Vec<u8> {
    let settings = Settings { features: false, ..Settings::default() };
    let mut renderer = Renderer::new(&driver.device, scene, &settings, &Options::default()).unwrap();
    renderer.render_pass(samples).unwrap();
    let beauty = renderer.picture().unwrap().0.rgb(plane::BEAUTY).unwrap();
    let shown = tone_map::to_srgb8(&beauty, 0.0);
    assert!(shown.iter().any(|byte| *byte > 100), "black");
    shown
}

/// Whether two pixels are the same but for the rounding of a display's.
fn is_same(found: &image::Rgb<u8>, expected: &[u8]) -> bool {
    found.0.iter().zip(expected).all(|(found, expected)| found.abs_diff(*expected) <= 1)
}

#[test]
fn the_engine_without_a_window_writes_the_picture() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (scene(folder.path(), [32, 24]), folder.path().join("out.png"));
    run("embed", folder.path(), |command| {
        command.arg(&file).arg(&out);
    });
    let found = image::open(&out).unwrap().into_rgb8();
    let (mut scene, _) = Scene::load(&file).unwrap();
    // Half way it comes nearer, and begins anew.
    scene.camera.eye += 0.1 * (scene.camera.target - scene.camera.eye);
    let expected = expected(&driver, &scene, 128);
    assert!(found.pixels().zip(expected.chunks(3)).all(|(found, expected)| is_same(found, expected)));
    driver.finish();
}

/// What stands in the corner of the screenshot, cut off where that ends.
fn words_in(shown: &image::RgbImage) -> String {
    let letter = |row: u32, column: u32| {
        let is_same = |letter: &char| {
            let drawn = caption::draw(&letter.to_string());
            (0..18u32).all(|y| {
                (0..12u32).all(|x| {
                    let pixel = shown.get_pixel_checked(12 * column + x, 18 * row + y);
                    pixel.is_some_and(|pixel| pixel.0[0] == drawn[4 * (y as usize * caption::SIZE[0] + x as usize)])
                })
            })
        };
        "0123456789.%eoprs ".chars().find(is_same).unwrap_or('?')
    };
    let columns = shown.width() / 12;
    let lines = (0..3).map(|row| (0..columns).map(|column| letter(row, column)).collect::<String>());
    lines.map(|line| line.trim_end().to_owned() + "\n").collect()
}

#[test]
fn the_window_shows_the_picture_and_how_it_stands() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (file, screenshot) = (scene(folder.path(), [160, 120]), folder.path().join("screenshot.png"));
    run("window", folder.path(), |command| {
        command.arg(&file).args(["--frames", "8", "--screenshot"]).arg(&screenshot);
        command.env("DISPLAY", &screen.display).env_remove("WAYLAND_DISPLAY");
    });

    let shown = image::open(&screenshot).unwrap().into_rgb8();
    let [width, height] = [shown.width(), shown.height()];
    let (scene, _) = Scene::load(&file).unwrap();
    let scene = Scene { film: Film { width, height }, ..scene };
    let expected = expected(&driver, &scene, 8);
    let [right, lower] = caption::SIZE.map(|pixels| pixels as u32);
    for ((x, y, found), expected) in shown.enumerate_pixels().zip(expected.chunks(3)) {
        assert!(is_same(found, expected) || x < right && y < lower, "({x}, {y}): {found:?}, not {expected:?}");
    }
    // Two frames are in flight: the corner tells of the sixth.
    let words = words_in(&shown);
    let lines: Vec<&str> = words.lines().collect();
    let number = |line: &str, before: &str, after: &str| -> f64 {
        let number = line.strip_prefix(before).and_then(|line| line.strip_suffix(after));
        number.and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("{words}"))
    };
    let [samples, seconds, error] =
        [number(lines[0], "", " spp"), number(lines[1], "", " s"), number(lines[2], "error ", " %")];
    assert!(samples == 6.0 && seconds >= 0.0 && error > 0.0, "{words}");
    driver.finish();
}
