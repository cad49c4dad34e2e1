//! The path tracer in wgpu's device: the bits of the path tracer on its own, and nothing that the validation layer has a word to
//! say about. wgpu turns synchronization validation on with the layer, and logs what it says.

mod common;
#[path = "../examples/wgpu_host.rs"]
mod wgpu_host;

use std::sync::Mutex;

use common::{LAVAPIPE, driver, drivers_are_required};
use neubrdf::image::tone_map;
use neubrdf::plugin::Options;
use neubrdf::render::Settings;
use wgpu_host::{App, open};

/// Warnings and errors that were logged.
static LOGGED: Mutex<Vec<String>> = Mutex::new(Vec::new());

struct Logger;

impl log::Log for Logger {
    fn enabled(&self, metadata: &log::Metadata) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record) {
        if self.enabled(record.metadata()) {
            LOGGED.lock().unwrap().push(format!("{}: {}", record.target(), record.args()));
        }
    }

    fn flush(&self) {}
}

#[test]
fn a_wgpu_texture_shows_the_bits_of_the_path_tracer_on_its_own() {
    let Some(driver) = driver(LAVAPIPE) else { return };
    log::set_logger(&Logger).unwrap();
    log::set_max_level(log::LevelFilter::Warn);
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.flags |= wgpu::InstanceFlags::VALIDATION | wgpu::InstanceFlags::DEBUG;
    let instance = wgpu::Instance::new(descriptor);
    let opened = match open(&instance, LAVAPIPE) {
        Ok(opened) => opened,
        Err(error) if drivers_are_required() => panic!("{error}"),
        Err(error) => return eprintln!("skipped: {error}"),
    };
    // A width whose rows wgpu pads.
    let mut scene = common::still_life(common::conductor(0.8, 0.3));
    scene.film.width = 37;
    let settings = Settings { max_depth: 4, seed: 7, features: false, ..Settings::default() };
    let options = Options { settings, pool_paths: Some(2000), ..Options::default() };
    let mut app = App::new(opened, scene.clone(), &options).unwrap();
    // Two frames in flight, then a wait, then one more.
    app.frame(1).unwrap();
    let second = app.frame(2).unwrap();
    assert_eq!(app.wait(second).unwrap().samples, 3);
    let third = app.frame(5).unwrap();
    let linear = app.read(&app.linear).unwrap();
    let shown = app.read(&app.shown).unwrap();
    assert_eq!(app.wait(third).unwrap().samples, 8);
    drop(app);
    drop(instance);

    let choices = neubrdf::render::Options { traversal: None, pool_paths: Some(2000) };
    let picture = common::render(&driver.device, &scene, &settings, &choices, 8);
    driver.finish();
    let one = 1f32.to_bits();
    let expected: Vec<[u32; 4]> = common::bits(&picture).into_iter().map(|[r, g, b]| [r, g, b, one]).collect();
    let found: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&linear);
    assert!(found.iter().any(|pixel| pixel[0] != 0), "black");
    assert!(found == expected, "the texture has other bits");
    let rgb: Vec<[f32; 3]> = expected.iter().map(|[r, g, b, _]| [*r, *g, *b].map(f32::from_bits)).collect();
    let displayed = tone_map::to_srgb8(&rgb, 0.0);
    for (pixel, exact) in shown.chunks(4).zip(displayed.chunks(3)) {
        assert!(
            pixel.iter().zip(exact).all(|(a, b)| a.abs_diff(*b) <= 1) && pixel[3] == 255,
            "{pixel:?}, not {exact:?}"
        );
    }
    assert_eq!(*LOGGED.lock().unwrap(), Vec::<String>::new());
}
