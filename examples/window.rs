//! The path tracer in a window: an engine that rasterises nothing, and shows the picture as it gets better.
//!
//!     cargo run --release --example window -- scenes/still_life/scene.toml
//!     cargo run --release --example window -- scenes/cornell/scene.toml --frames 16 --screenshot cornell.png
//!
//! Drag with the left button to orbit, with the right one to move, and turn the wheel to come nearer. The corner says samples a
//! pixel, seconds since the last change, and the estimated error, and so does the title. `--frames N` ends after N frames, and `--screenshot FILE` then
//! writes what was presented last.
#![allow(unsafe_code)] // the engine speaks Vulkan itself

#[path = "window/caption.rs"]
mod caption;
#[path = "window/engine.rs"]
mod engine;
#[path = "window/mapped.rs"]
mod mapped;

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use engine::{Engine, IN_FLIGHT, Shown};
use glam::{Quat, Vec3};
use neubrdf::plugin::{Change, Frame, Options, Renderer, Status, Target};
use neubrdf::scene::{Camera, Scene};
use winit::application::ApplicationHandler;
use winit::dpi::{PhysicalPosition, PhysicalSize};
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::{Window, WindowId};

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let mut app = App::new(std::env::args().skip(1))?;
    let events = EventLoop::new()?;
    events.set_control_flow(ControlFlow::Poll);
    events.run_app(&mut app)?;
    app.failure.map_or(Ok(()), Err)
}

struct App {
    scene: Scene,
    /// Frames to show; `None` goes on until the window is closed.
    frames: Option<u32>,
    screenshot: Option<PathBuf>,
    view: Option<View>,
    failure: Option<Box<dyn Error>>,
}

/// What there is while the window is open. The renderer goes before the engine whose device it borrows.
struct View {
    renderer: Renderer,
    engine: Engine,
    window: Window,
    tickets: [u64; IN_FLIGHT],
    /// How the picture stands, in lines.
    words: String,
    shown: u32,
    since: Instant,
    held: Option<MouseButton>,
    pointer: PhysicalPosition<f64>,
}

impl App {
    fn new(mut arguments: impl Iterator<Item = String>) -> Outcome<App> {
        const USAGE: &str = "usage: window SCENE [--frames N] [--screenshot FILE]";
        let (mut file, mut frames, mut screenshot) = (None, None, None);
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                "--frames" => frames = Some(arguments.next().ok_or(USAGE)?.parse()?),
                "--screenshot" => screenshot = Some(PathBuf::from(arguments.next().ok_or(USAGE)?)),
                _ => file = Some(argument),
            }
        }
        let (scene, warnings) = Scene::load(file.ok_or(USAGE)?)?;
        warnings.iter().for_each(|warning| eprintln!("{warning}"));
        Ok(App { scene, frames, screenshot, view: None, failure: None })
    }

    /// Ends the program if something went wrong.
    fn check<T>(&mut self, events: &ActiveEventLoop, outcome: Outcome<T>) -> Option<T> {
        match outcome {
            Ok(value) => Some(value),
            Err(error) => {
                self.failure = Some(error);
                self.close(events);
                None
            }
        }
    }

    fn close(&mut self, events: &ActiveEventLoop) {
        if let Some(view) = self.view.take() {
            view.close();
        }
        events.exit();
    }
}

impl ApplicationHandler for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.view.is_none() {
            let view = View::new(events, self.scene.clone());
            self.view = self.check(events, view);
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(view) = &mut self.view else { return };
        let outcome = match event {
            WindowEvent::CloseRequested => return self.close(events),
            WindowEvent::RedrawRequested => {
                let last = self.frames.is_some_and(|frames| view.shown + 1 >= frames);
                let shown = view.show(self.screenshot.as_deref().filter(|_| last));
                if last && matches!(shown, Ok(true)) {
                    return self.close(events);
                }
                shown.map(drop)
            }
            WindowEvent::MouseInput { state, button, .. } => {
                view.held = (state == ElementState::Pressed).then_some(button);
                Ok(())
            }
            WindowEvent::CursorMoved { position, .. } => view.drag(position),
            WindowEvent::MouseWheel { delta, .. } => view.zoom(delta),
            _ => Ok(()),
        };
        self.check(events, outcome);
    }

    fn about_to_wait(&mut self, _: &ActiveEventLoop) {
        if let Some(view) = &self.view {
            view.window.request_redraw();
        }
    }
}

impl View {
    fn new(events: &ActiveEventLoop, mut scene: Scene) -> Outcome<View> {
        let size = PhysicalSize::new(scene.film.width, scene.film.height);
        let window = events.create_window(Window::default_attributes().with_title("neubrdf").with_inner_size(size))?;
        let mut engine = Engine::new(&window, window.inner_size().into())?;
        [scene.film.width, scene.film.height] = engine.size();
        let options = Options { frames_in_flight: IN_FLIGHT as u32, ..Options::default() };
        let renderer = Renderer::new(&engine.lend()?, scene, &options)?;
        Ok(View {
            renderer,
            engine,
            window,
            tickets: [0; IN_FLIGHT],
            words: String::new(),
            shown: 0,
            since: Instant::now(),
            held: None,
            pointer: PhysicalPosition::default(),
        })
    }

    /// Shows the next frame; false if the window had changed its size instead.
    fn show(&mut self, screenshot: Option<&std::path::Path>) -> Outcome<bool> {
        let slot = self.engine.wait_for_slot()?;
        if let Some(status) = self.renderer.complete(self.tickets[slot]) {
            self.tell(&status);
        }
        let wanted: [u32; 2] = self.window.inner_size().into();
        if wanted.contains(&0) {
            return Ok(false); // minimised
        }
        if wanted != self.engine.size() {
            return self.resize(wanted);
        }
        let Self { renderer, engine, tickets, words, .. } = self;
        let shown = engine.show(words, screenshot.is_some(), |commands, image, format| {
            let targets = [Target::image(image, format)];
            tickets[slot] = renderer.record(commands, &Frame::new(1, &targets))?;
            Ok(())
        })?;
        match shown {
            Shown::Stale => return self.resize(wanted),
            Shown::Presented => {}
            Shown::Copied(pixels) => {
                let [width, height] = self.engine.size();
                if let Some(file) = screenshot {
                    image::save_buffer(file, &pixels, width, height, image::ColorType::Rgba8)?;
                }
            }
        }
        self.shown += 1;
        Ok(true)
    }

    fn tell(&mut self, status: &Status) {
        let seconds = self.since.elapsed().as_secs_f64();
        let error = status.error.map_or(String::new(), |error| format!("\nerror {:.2} %", 100.0 * error));
        self.words = format!("{} spp\n{seconds:.1} s{error}", status.samples);
        self.window.set_title(&format!("neubrdf: {}", self.words.replace('\n', ", ")));
    }

    fn resize(&mut self, size: [u32; 2]) -> Outcome<bool> {
        self.engine.resize(size)?;
        let [width, height] = self.engine.size();
        if [width, height] != self.renderer.size() {
            self.renderer.resize(width, height)?;
            self.since = Instant::now();
        }
        Ok(false)
    }

    fn drag(&mut self, position: PhysicalPosition<f64>) -> Outcome<()> {
        let by = [position.x - self.pointer.x, position.y - self.pointer.y].map(|pixels| pixels as f32);
        self.pointer = position;
        let camera = &self.renderer.scene().camera;
        match self.held {
            Some(MouseButton::Left) => self.look(orbit(camera, by)),
            Some(MouseButton::Right) => self.look(pan(camera, by, self.engine.size()[1])),
            _ => Ok(()),
        }
    }

    fn zoom(&mut self, delta: MouseScrollDelta) -> Outcome<()> {
        let steps = match delta {
            MouseScrollDelta::LineDelta(_, lines) => lines,
            MouseScrollDelta::PixelDelta(pixels) => pixels.y as f32 / 50.0,
        };
        let camera = self.renderer.scene().camera.clone();
        let offset = (camera.eye - camera.target) * 0.9f32.powf(steps);
        self.look(Camera { eye: camera.target + offset, ..camera })
    }

    fn look(&mut self, camera: Camera) -> Outcome<()> {
        self.renderer.update(&[Change::Camera(camera)])?;
        self.since = Instant::now();
        Ok(())
    }

    /// The renderer goes when its frames are done, and before the device.
    fn close(self) {
        let View { renderer, engine, window, .. } = self;
        engine.wait_idle();
        drop(renderer);
        drop(engine);
        drop(window);
    }
}

/// Turns about the target, by a degree for three pixels, and not over the pole.
fn orbit(camera: &Camera, [x, y]: [f32; 2]) -> Camera {
    let offset = camera.eye - camera.target;
    let up = camera.up.normalize();
    let turned = Quat::from_axis_angle(up, (-x / 3.0).to_radians()) * offset;
    let side = turned.cross(up).normalize();
    let tilted = Quat::from_axis_angle(side, (y / 3.0).to_radians()) * turned;
    let is_steep = tilted.normalize().dot(up).abs() > 0.99;
    Camera { eye: camera.target + if is_steep { turned } else { tilted }, ..camera.clone() }
}

/// Moves along the film, as far as the pointer does at the target's distance.
fn pan(camera: &Camera, [x, y]: [f32; 2], height: u32) -> Camera {
    let axis = camera.target - camera.eye;
    let right: Vec3 = axis.cross(camera.up).normalize();
    let up = right.cross(axis).normalize();
    let pixel = 2.0 * axis.length() * (camera.vertical_fov_degrees.to_radians() / 2.0).tan() / height as f32;
    let by = pixel * (y * up - x * right);
    Camera { eye: camera.eye + by, target: camera.target + by, ..camera.clone() }
}
