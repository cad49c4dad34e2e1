//! Makes the scenes that are shipped in `scenes/`, from formulas and published measurements.
//!
//!     cargo run --example make_scenes                             # writes scenes/
//!     cargo run --example make_scenes -- DIR many_lights 10000    # the room with another number of lights
//!     cargo run --example make_scenes -- DIR building             # many rooms with lamps; not shipped
//!
//! The files are the same on every run; a test compares them with those checked in.

use std::error::Error;
use std::f32::consts::{PI, TAU};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};
use glam::{Vec2, Vec3, vec3};
use half::f16;

pub mod building;
mod foliage;
mod obj;

use obj::Obj;

type Outcome = Result<(), Box<dyn Error>>;

#[allow(dead_code)] // The test that includes this file has no use for it.
fn main() -> Outcome {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or("scenes".into()));
    match (arguments.next().as_deref(), arguments.next()) {
        (None, _) => write_all(&folder),
        (Some("many_lights"), Some(count)) => many_lights(&folder, count.parse()?),
        (Some("building"), None) => building::write(&folder),
        _ => Err("usage: make_scenes [DIR [many_lights COUNT | building]]".into()),
    }
}

/// Writes every shipped scene into a folder of its own in `folder`.
pub fn write_all(folder: &Path) -> Outcome {
    cornell(&folder.join("cornell"))?;
    preview(&folder.join("preview"))?;
    neural(&folder.join("neural"))?;
    many_lights(&folder.join("many_lights"), 300)?;
    furnace(&folder.join("furnace"))?;
    sky(&folder.join("sky"))?;
    still_life(&folder.join("still_life"))?;
    mosaic(&folder.join("mosaic"))?;
    foliage::write(&folder.join("foliage"))
}

// ---------------------------------------------------------------------------------------------------------- scenes

/// The Cornell box, scaled to [−1, 1]³ as in Mitsuba 3's `mi.cornell_box()`, so that pictures compare pixel by pixel.
///
/// The reflectances are the spectra measured at Cornell (graphics.cornell.edu/online/box/data.html) times the CIE 1931
/// colour matching functions under an equal-energy illuminant, as linear Rec. 709 without chromatic adaptation: that is
/// why a grey of 0.74 has more red than blue. The light's radiance is the RGB value that Mitsuba gives to it.
fn cornell(folder: &Path) -> Outcome {
    let mut obj = Obj::new("cornell.mtl");
    let square = |x: Vec3, y: Vec3, center: Vec3| [center - x - y, center + x - y, center + x + y, center - x + y];
    obj.object("room", "white");
    obj.quad(square(Vec3::X, -Vec3::Z, -Vec3::Y));
    obj.quad(square(Vec3::X, Vec3::Z, Vec3::Y));
    obj.quad(square(Vec3::X, Vec3::Y, -Vec3::Z));
    obj.object("green wall", "green");
    obj.quad(square(Vec3::Z, Vec3::Y, Vec3::X));
    obj.object("red wall", "red");
    obj.quad(square(-Vec3::Z, Vec3::Y, -Vec3::X));
    // Each block: half its width along x and z, its height's half, where its middle stands.
    obj.object("small block", "white");
    obj.block(vec3(0.335, -0.7, 0.38), vec3(0.286_891, 0.0, 0.087_711_5), 0.3);
    obj.object("large block", "white");
    obj.block(vec3(-0.33, -0.4, -0.28), vec3(0.284_91, 0.0, -0.093_949_1), 0.61);
    obj.object("light", "light");
    obj.quad(square(vec3(0.23, 0.0, 0.0), vec3(0.0, 0.0, 0.19), vec3(0.0, 0.99, 0.01)));
    let mtl = "\
newmtl white
Kd 0.885809 0.698859 0.666422
newmtl green
Kd 0.105421 0.37798 0.076425
newmtl red
Kd 0.570068 0.0430135 0.0443706
newmtl light
Kd 0.885809 0.698859 0.666422
Ke 18.387 13.9873 6.75357
";
    let toml = "\
# The Cornell box (Goral et al. 1984), from its published measurements. Made by examples/make_scenes.
[camera]
eye = [0, 0, 3.9]
target = [0, 0, 0]
fov = 39.3077

[film]
width = 256
height = 256

[[mesh]]
file = \"cornell.obj\"
";
    save(folder, &[("scene.toml", toml), ("cornell.mtl", mtl), ("cornell.obj", &obj.text)])
}

/// A ball on a stand before a backdrop, under three area lights: a place to look at a material.
fn preview(folder: &Path) -> Outcome {
    let mut obj = Obj::new("preview.mtl");
    obj.object("ball", "ball");
    obj.sphere(vec3(0.0, 1.15, 0.0), 1.0, 32, 64);
    obj.object("ring", "ring");
    let ring = |t: f32| Vec2::new(0.62 + 0.1 * (t * TAU).cos(), 0.28 + 0.1 * (t * TAU).sin());
    obj.lathe(Vec3::ZERO, 24, 64, ring);
    obj.object("stand", "stand");
    let stand = [[0.0, 0.2], [0.7, 0.2], [0.8, 0.1], [0.9, 0.0]].map(Vec2::from_array);
    for [upper, lower] in stand.windows(2).map(|pair| [pair[0], pair[1]]) {
        obj.lathe(Vec3::ZERO, 1, 64, |t| lower.lerp(upper, t));
    }
    obj.object("backdrop", "backdrop");
    // A floor that bends up into a wall through a quarter circle of radius 2.
    let profile = |t: f32| match t {
        ..0.25 => vec3(0.0, 0.0, 5.0 - 28.0 * t),
        0.25..0.75 => {
            let angle = (t - 0.25) * PI;
            vec3(0.0, 2.0 - 2.0 * angle.cos(), -2.0 - 2.0 * angle.sin())
        }
        _ => vec3(0.0, 2.0 + 20.0 * (t - 0.75), -4.0),
    };
    obj.sheet(1, 24, 1.0, |u, v| profile(v) + vec3(14.0 * (u - 0.5), 0.0, 0.0), true);
    let light = |center, size| square_facing(vec3(0.0, 1.0, 0.0), center, size);
    obj.object("key light", "key");
    obj.quad(light(vec3(-3.5, 4.0, 3.0), 1.2));
    obj.object("fill light", "fill");
    obj.quad(light(vec3(4.5, 2.5, 2.5), 0.8));
    obj.object("rim light", "rim");
    obj.quad(light(vec3(1.5, 4.5, -2.5), 0.6));
    let mtl = "\
newmtl ball
Kd 0.55 0.08 0.06
Ks 1 1 1
Ni 1.5
Pr 0.25
illum 2
newmtl ring
Kd 1 0.78 0.34
Pm 1
Pr 0.3
newmtl stand
Kd 0.18 0.18 0.18
newmtl backdrop
Kd 0.5 0.5 0.5
newmtl key
Ke 14 13 12
newmtl fill
Ke 5 6.5 9
newmtl rim
Ke 20 20 20
";
    let toml = "\
# A material-preview ball on its stand. Made by examples/make_scenes.
# To look at another material, change [material.ball].
[camera]
eye = [0, 1.9, 6.2]
target = [0, 1.02, 0]
fov = 28

[film]
width = 192
height = 192

[[mesh]]
file = \"preview.obj\"

[material.ball]
type = \"coated\"
albedo = [0.55, 0.08, 0.06]
ior = 1.5
roughness = 0.3

[material.ring]
type = \"conductor\"
metal = \"gold\"
roughness = 0.35
";
    let (view, _) = toml.split_once("\n[material.ball]").ok_or("no ball")?;
    let viewed = |what: &str, materials: [String; 3]| {
        let told = view.replace("# To look at another material, change [material.ball].", what);
        ["ball", "ring", "stand"]
            .iter()
            .zip(materials)
            .fold(told, |toml, (part, material)| toml + "\n[material." + part + "]\n" + &material)
    };
    let trained = |name: &str| format!("type = \"measured\"\nfile = \"../materials/{name}.neubrdf\"\n");
    let neural = viewed(
        "# The same in neural materials. To look at another one, change [material.ball].",
        ["paint_blue", "gold_satin", "lacquer_black"].map(trained),
    );
    let simulated = [
        include_str!("../../scenes/materials/paint_blue.toml"),
        include_str!("../../scenes/materials/varnish_amber.toml"),
        include_str!("../../scenes/materials/lacquer_black.toml"),
    ];
    let layered = viewed(
        "# Layers that light walks through at random: what the networks of layered_neural.toml learned.",
        simulated.map(str::to_owned),
    );
    let layered_neural = viewed(
        "# Networks that learned what layered.toml simulates.",
        ["paint_blue", "varnish_amber", "lacquer_black"].map(trained),
    );
    let study = study(
        "How much faster networks are than the walks that they learned: `make study-layered`.",
        [128, 128],
        &[4, 16, 64, 256],
        ["layered.toml", "layered_neural.toml"],
    );
    save(
        folder,
        &[
            ("scene.toml", toml),
            ("neural.toml", &neural),
            ("layered.toml", &layered),
            ("layered_neural.toml", &layered_neural),
            ("layered_study.toml", &study),
            ("preview.mtl", mtl),
            ("preview.obj", &obj.text),
        ],
    )
}

/// The corners of a square that faces a point: its middle, and half its side.
fn square_facing(point: Vec3, center: Vec3, size: f32) -> [Vec3; 4] {
    let normal = (point - center).normalize();
    let x = Vec3::Y.cross(normal).normalize();
    let y = normal.cross(x);
    [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[a, b]| center + size * (a * x + b * y))
}

/// What `scenes/materials` holds, each as a ground truth (`.toml`) and as the network that was trained on it (`.neubrdf`).
const NEURAL_MATERIALS: [&str; 10] = [
    "gold_satin",
    "chrome_polished",
    "aluminium_brushed",
    "copper_turned",
    "plastic_red",
    "lacquer_black",
    "paint_blue",
    "varnish_amber",
    "satin_violet",
    "denim",
];

/// Balls of the trained materials in `scenes/materials`, in two rows under two area lights.
fn neural(folder: &Path) -> Outcome {
    let mut obj = Obj::new("neural.mtl");
    let mut toml = String::from(
        "\
# Balls of neural materials. Made by examples/make_scenes.
[camera]
eye = [0, 6.2, 10.2]
target = [0, 0.6, 0]
fov = 25

[film]
width = 320
height = 160

[[mesh]]
file = \"neural.obj\"
",
    );
    let mut mtl =
        String::from("newmtl floor\nKd 0.35 0.35 0.36\nnewmtl key\nKe 22 20.5 19\nnewmtl fill\nKe 6 7.5 10\n");
    for (place, name) in NEURAL_MATERIALS.into_iter().enumerate() {
        let (column, row) = ((place % 5) as f32, (place / 5) as f32);
        obj.object(name, name);
        obj.sphere(vec3(1.9 * (column - 2.0), 0.85, 1.9 * row - 0.95), 0.85, 16, 36);
        writeln!(mtl, "newmtl {name}\nKd 0.5 0.5 0.5")?;
        writeln!(toml, "\n[material.{name}]\ntype = \"measured\"\nfile = \"../materials/{name}.neubrdf\"")?;
    }
    obj.object("floor", "floor");
    obj.sheet(1, 1, 1.0, |u, v| vec3(40.0 * (u - 0.5), 0.0, 40.0 * (0.5 - v)), false);
    let light = |center, size| square_facing(vec3(0.0, 0.8, 0.0), center, size);
    obj.object("key light", "key");
    obj.quad(light(vec3(-5.0, 7.0, 5.0), 1.3));
    obj.object("fill light", "fill");
    obj.quad(light(vec3(7.0, 5.0, 4.0), 2.0));
    toml += "\n[environment]\nradiance = [0.28, 0.3, 0.34]\n";
    save(folder, &[("scene.toml", &toml), ("neural.mtl", &mtl), ("neural.obj", &obj.text)])
}

/// A room under `count` small triangles of light, their powers spread over four decades.
pub fn many_lights(folder: &Path, count: u32) -> Outcome {
    const COLORS: u32 = 24;
    let mut random = Random(1);
    let mut obj = Obj::new("many_lights.mtl");
    obj.object("room", "wall");
    obj.block(vec3(0.0, 1.5, 0.0), vec3(-3.0, 0.0, 0.0), -1.5);
    for (i, name) in ["plaster", "brass", "lacquer"].into_iter().cycle().take(9).enumerate() {
        let (x, z) = ((i % 3) as f32 * 1.6 - 1.6, (i / 3) as f32 * 1.6 - 1.6);
        obj.object(&format!("pillar {i}"), name);
        obj.block(vec3(x, 0.2 + 0.06 * i as f32, z), vec3(0.3, 0.0, 0.1), 0.2 + 0.06 * i as f32);
    }
    let mut mtl = String::from(
        "\
newmtl wall
Kd 0.6 0.58 0.55
newmtl plaster
Kd 0.7 0.7 0.7
newmtl brass
Kd 0.9 0.7 0.35
Pm 1
Pr 0.5
newmtl lacquer
Kd 0.1 0.2 0.4
Ks 1 1 1
Pr 0.4
",
    );
    // Four decades of radiance, and the same power all together whatever the number of lights.
    let side = 0.05 * (300.0 / count as f32).sqrt();
    for color in 0..COLORS {
        let hue = TAU * random.next();
        let tint = [0.0, 1.0, 2.0].map(|channel: f32| 0.8 + 0.7 * (hue + channel * TAU / 3.0).cos());
        let radiance = 0.02 * 10f32.powf(4.0 * color as f32 / (COLORS - 1) as f32);
        let [red, green, blue] = tint.map(|tint| tint * radiance);
        writeln!(mtl, "newmtl light{color}\nKd 0 0 0\nKe {red:.5} {green:.5} {blue:.5}")?;
    }
    for color in 0..COLORS {
        obj.object(&format!("lights {color}"), &format!("light{color}"));
        for _ in (color..count).step_by(COLORS as usize) {
            let center = vec3(5.6 * random.next() - 2.8, 2.3 + 0.6 * random.next(), 5.6 * random.next() - 2.8);
            let down = vec3(random.next() - 0.5, -1.0, random.next() - 0.5).normalize();
            let x = down.any_orthonormal_vector();
            let y = down.cross(x);
            let corner = |angle: f32| center + side * (x * angle.cos() + y * angle.sin());
            obj.triangle([0.0, TAU / 3.0, 2.0 * TAU / 3.0].map(corner));
        }
    }
    let toml = "\
# A room under many small lights, their radiances spread over four decades. Made by examples/make_scenes.
[camera]
eye = [0, 1.7, 2.9]
target = [0, 0.7, -0.6]
fov = 60

[film]
width = 192
height = 144

[[mesh]]
file = \"many_lights.obj\"

[material.brass]
type = \"conductor\"
metal = \"copper\"
roughness = 0.5
";
    save(folder, &[("scene.toml", toml), ("many_lights.mtl", &mtl), ("many_lights.obj", &obj.text)])
}

/// Objects that lose no light under a uniform sky of radiance 1: every pixel is 1.
fn furnace(folder: &Path) -> Outcome {
    let mut obj = Obj::new("furnace.mtl");
    for (i, name) in ["diffuse", "mirror", "glass", "coated"].into_iter().enumerate() {
        obj.object(name, name);
        obj.facetted_sphere(vec3((i % 2) as f32 * 2.4 - 1.2, 1.2 - (i / 2) as f32 * 2.4, 0.0), 1.0, 3);
    }
    let mtl = "\
newmtl diffuse
Kd 1 1 1
newmtl mirror
Kd 0 0 0
Ks 1 1 1
illum 5
newmtl glass
illum 7
Ni 1.5
newmtl coated
Kd 1 1 1
Ks 1 1 1
Ni 1.5
Pr 0
";
    let toml = "\
# A white furnace: nothing here absorbs, so every pixel is 1. Made by examples/make_scenes.
# The facets show, because interpolated normals do not conserve energy. Light goes around in the glass for long: trace
# it with a --max-depth of hundreds.
[camera]
eye = [0, 0, 9]
target = [0, 0, 0]
fov = 32

[film]
width = 128
height = 128

[[mesh]]
file = \"furnace.obj\"
normals = \"flat\"

[environment]
radiance = 1
";
    save(folder, &[("scene.toml", toml), ("furnace.mtl", mtl), ("furnace.obj", &obj.text)])
}

/// A textured ground with rings, knots and glass under a sky whose sun is a few thousand times as bright as the rest.
fn sky(folder: &Path) -> Outcome {
    let mut ground = Obj::new("sky.mtl");
    ground.object("ground", "ground");
    ground.sheet(1, 1, 16.0, |u, v| vec3(80.0 * (u - 0.5), 0.0, 80.0 * (0.5 - v)), false);
    let mut torus = Obj::new("sky.mtl");
    torus.object("torus", "clay");
    torus.lathe(Vec3::ZERO, 20, 40, |t| Vec2::new(0.7 + 0.25 * (t * TAU).cos(), 0.25 * (t * TAU).sin()));
    let mut glass = Obj::new("sky.mtl");
    glass.object("glass", "glass");
    glass.sphere(vec3(0.0, 0.6, 0.0), 0.6, 24, 48);
    let mtl = "\
newmtl ground
Kd 1 1 1
map_Kd tiles.png
newmtl clay
Kd 0.7 0.35 0.2
newmtl glass
illum 7
Ni 1.5
";
    let toml = "\
# Instances under a high-contrast sky. Made by examples/make_scenes.
[camera]
eye = [0, 1.9, 6]
target = [0, 0.6, 0]
fov = 42

[film]
width = 192
height = 128

[[mesh]]
file = \"ground.obj\"

[[mesh]]
file = \"torus.obj\"
instances = [
    { translate = [-1.9, 0.25, 0.4] },
    { translate = [-1.9, 0.9, -0.4], rotate = [70, 20, 0] },
    { translate = [1.8, 0.6, -0.3], axis = [1, 0, 1], angle = 65, scale = [0.7, 1.4, 0.7] },
    { matrix = [[-0.8, 0.3, 0, 0.1], [0, 0.6, 0, 0.15], [0, 0, 0.8, 2.2]] },
]

[[mesh]]
file = \"glass.obj\"
transform = { translate = [0, 0.05, 0] }

[environment]
file = \"sky.exr\"
rotate = 20
";
    let files = [
        ("scene.toml", toml),
        ("sky.mtl", mtl),
        ("ground.obj", &ground.text),
        ("torus.obj", &torus.text),
        ("glass.obj", &glass.text),
    ];
    save(folder, &files)?;
    let tile = |x: u32, y: u32| {
        let (column, row) = (x / 16, y / 16);
        let mortar = x.is_multiple_of(16) || y.is_multiple_of(16);
        let shade = Random(u64::from(row * 4 + column)).next();
        let [red, green, blue] = if (column + row) % 2 == 0 { [196.0, 186.0, 168.0] } else { [92.0, 104.0, 112.0] };
        let scale = if mortar { 0.5 } else { 0.75 + 0.25 * shade };
        image::Rgb([red * scale, green * scale, blue * scale].map(|value: f32| value as u8))
    };
    image::RgbImage::from_fn(64, 64, tile).save(folder.join("tiles.png"))?;
    save_environment(&folder.join("sky.exr"), 256, 128, |direction| {
        let sun = vec3(-0.5, 0.6, 0.4).normalize();
        let to_sun = direction.dot(sun).clamp(-1.0, 1.0).acos().to_degrees();
        let height = direction.y.max(0.0);
        let horizon = vec3(0.85, 0.8, 0.75).lerp(vec3(0.12, 0.25, 0.6), height.sqrt());
        let air = if direction.y < 0.0 { vec3(0.12, 0.1, 0.08) } else { horizon };
        let glow = vec3(2.0, 1.6, 1.0) * (-to_sun / 8.0).exp();
        let disk = if to_sun < 2.0 { vec3(1000.0, 900.0, 750.0) } else { Vec3::ZERO };
        0.6 * (air + glow) + disk
    })
}

/// What the other scenes lack: rough glass, brushed metal, a sun and a thin lens.
fn still_life(folder: &Path) -> Outcome {
    let mut obj = Obj::new("still_life.mtl");
    obj.object("table", "table");
    obj.sheet(1, 1, 1.0, |u, v| vec3(9.0 * (u - 0.5), 0.0, 9.0 * (0.5 - v)), false);
    obj.object("frosted", "frosted");
    obj.sphere(vec3(-1.1, 0.62, 0.2), 0.6, 24, 48);
    obj.object("can", "brushed");
    obj.lathe(vec3(0.35, 0.0, -0.5), 1, 64, |t| Vec2::new(0.5, 0.02 + 1.3 * t));
    obj.lathe(vec3(0.35, 0.0, -0.5), 1, 64, |t| Vec2::new(0.5 * (1.0 - t), 1.32));
    obj.object("pear", "pear");
    let pear = |t: f32| {
        let angle = PI * t;
        let narrow = 1.0 - 0.45 * (0.5 - 0.5 * angle.cos()).powi(2);
        Vec2::new(0.45 * angle.sin() * narrow, 0.47 - 0.45 * angle.cos() * (1.0 + 0.3 * t))
    };
    obj.lathe(vec3(1.35, 0.0, 0.5), 24, 48, pear);
    obj.object("mirror", "mirror");
    obj.sphere(vec3(-0.2, 0.25, 0.95), 0.25, 16, 32);
    let mtl = "\
newmtl table
Kd 0.45 0.33 0.24
newmtl frosted
illum 7
Ni 1.5
Pr 0.45
newmtl brushed
Kd 0.9 0.9 0.9
Pm 1
Pr 0.5
newmtl pear
Kd 0.6 0.65 0.1
Ks 1 1 1
Ns 120
illum 2
newmtl mirror
Kd 0 0 0
Ks 0.9 0.9 0.9
illum 5
";
    let toml = "\
# Rough glass, brushed metal, a sun and a thin lens. Made by examples/make_scenes.
[camera]
eye = [0, 1.6, 5.2]
target = [0, 0.55, 0]
fov = 32
lens_radius = 0.08
focus_distance = 4.9

[film]
width = 192
height = 128

[[mesh]]
file = \"still_life.obj\"

[material.brushed]
type = \"conductor\"
metal = \"aluminium\"
alpha = [0.4, 0.08]

[environment]
radiance = [0.35, 0.42, 0.55]

[sun]
direction = [-0.6, 0.9, 0.5]
irradiance = [2.6, 2.4, 2.1]
";
    save(folder, &[("scene.toml", toml), ("still_life.mtl", mtl), ("still_life.obj", &obj.text)])
}

/// A jar and a ring of glazed tiles, in a neural material that varies: `neubrdf train glaze.toml -o glaze.neubrdf` learns it from the
/// maps.
fn mosaic(folder: &Path) -> Outcome {
    let mut obj = Obj::new("mosaic.mtl");
    obj.object("jar", "glaze");
    // A profile between an ellipse's and a box's.
    let blunt = |x: f32| x.signum() * x.abs().powf(0.75);
    let jar = |t: f32| Vec2::new(0.62 * blunt((PI * t).sin()), 0.78 - 0.78 * blunt((PI * t).cos()));
    obj.lathe_tiled(vec3(-0.45, 0.0, 0.0), 28, 48, Vec2::new(5.0, 3.0), jar);
    obj.object("ring", "glaze");
    let ring = |t: f32| Vec2::new(0.42 + 0.17 * (t * TAU).cos(), 0.17 + 0.17 * (t * TAU).sin());
    obj.lathe_tiled(vec3(0.85, 0.0, 0.55), 16, 36, Vec2::new(4.0, 2.0), ring);
    obj.object("floor", "floor");
    obj.sheet(1, 1, 1.0, |u, v| vec3(30.0 * (u - 0.5), 0.0, 30.0 * (0.5 - v)), false);
    let light = |center, size| square_facing(vec3(0.0, 0.6, 0.0), center, size);
    obj.object("key light", "key");
    obj.quad(light(vec3(-3.0, 4.0, 3.0), 0.8));
    obj.object("fill light", "fill");
    obj.quad(light(vec3(4.0, 3.0, 2.5), 1.2));
    let mtl = "newmtl floor\nKd 0.4 0.39 0.37\nnewmtl glaze\nKd 0.1 0.2 0.3\nnewmtl key\nKe 24 22 20\nnewmtl fill\nKe 5 6 8\n";
    let tiles = "type = \"coated\"
ior = 1.5
texture = \"color.png\"
roughness_map = \"roughness.png\"
normal_map = \"normal.png\"
";
    let scene = |title: &str, glaze: &str| {
        format!(
            "\
# {title} Made by examples/make_scenes.
[camera]
eye = [0.3, 2.1, 5.4]
target = [0.1, 0.66, 0]
fov = 28

[film]
width = 240
height = 180

[[mesh]]
file = \"mosaic.obj\"

[material.glaze]
{glaze}
[environment]
radiance = [0.3, 0.32, 0.36]
"
        )
    };
    let neural = "type = \"measured\"\nfile = \"glaze.neubrdf\"\n";
    let neural = scene("Glazed tiles in one neural material that varies.", neural);
    let truth = scene("The glazed tiles as they are: the maps that glaze.neubrdf has learned.", tiles);
    let glaze = format!(
        "\
# Tiles under a glaze that bulges, with rough grout between them: what glaze.neubrdf has learned. Made by examples/make_scenes.
{tiles}"
    );
    let study = study(
        "How far the neural tiles are from the maps that they learned: `make study-mosaic`.",
        [120, 90],
        &[16, 64, 256],
        ["truth.toml", "scene.toml"],
    );
    let files = [
        ("scene.toml", neural.as_str()),
        ("truth.toml", &truth),
        ("study.toml", &study),
        ("mosaic.mtl", mtl),
        ("mosaic.obj", &obj.text),
        ("glaze.toml", &glaze),
    ];
    save(folder, &files)?;
    let map = |name: &str, texel: &dyn Fn(Tile) -> [f32; 3]| {
        let pixel = |x, y| image::Rgb(texel(Tile::at(x, y)).map(|value| (255.0 * value).round() as u8));
        image::RgbImage::from_fn(64, 64, pixel).save(folder.join(name))
    };
    let glazes = [[0.17, 0.45, 0.5], [0.3, 0.66, 0.68], [0.2, 0.3, 0.62], [0.85, 0.8, 0.68], [0.73, 0.43, 0.27]];
    map("color.png", &|tile| match tile.is_grout() {
        true => [0.62, 0.6, 0.57],
        false => glazes[(5.0 * tile.chance) as usize].map(|value| value * (0.9 + 0.1 * (37.0 * tile.chance).fract())),
    })?;
    map("roughness.png", &|tile| [if tile.is_grout() { 0.8 } else { 0.28 + 0.1 * (11.0 * tile.chance).fract() }; 3])?;
    map("normal.png", &|tile| {
        // Of a height that falls with the fourth power towards the edge: at most 12° at corners.
        let slope = if tile.is_grout() { Vec2::ZERO } else { 0.15 * tile.place * tile.place * tile.place };
        (0.5 + 0.5 * slope.extend(1.0).normalize()).to_array()
    })?;
    Ok(())
}

/// Where a texel of 64 × 64 lies on its tile of 16 × 16.
struct Tile {
    /// In [−1, 1]², x along u and y along v, which runs upwards.
    place: Vec2,
    /// The tile's own number in [0, 1).
    chance: f32,
}

impl Tile {
    fn at(x: u32, y: u32) -> Tile {
        let along = |texel: u32| ((texel % 16) as f32 + 0.5) / 8.0 - 1.0;
        Tile { place: Vec2::new(along(x), -along(y)), chance: Random(u64::from(y / 16 * 4 + x / 16)).next() }
    }

    fn is_grout(&self) -> bool {
        self.place.abs().max_element() > 0.9
    }
}

// ----------------------------------------------------------------------------------------------------------- files

/// A study of a scene beside the same in networks that learned its materials.
fn study(title: &str, size: [u32; 2], spp: &[u32], [truth, neural]: [&str; 2]) -> String {
    format!(
        "\
# {title}
depth = 6
size = {size:?}
spp = {spp:?}
repetitions = 3
reference_spp = 1024
targets = [3e-2, 1e-2, 3e-3]
clock = \"cpu\"

[[scene]]
file = \"{truth}\"
[scene.models]
neural = \"{neural}\"

[[methods]]
traversal = [\"bvh\"]
model = [\"truth\", \"neural\"]
"
    )
}

fn save(folder: &Path, files: &[(&str, &str)]) -> Outcome {
    fs::create_dir_all(folder)?;
    files.iter().try_for_each(|(name, text)| fs::write(folder.join(name), text))?;
    Ok(())
}

/// Writes a lat-long environment as half floats; `radiance` takes the direction of a texel's middle.
fn save_environment(path: &Path, width: usize, height: usize, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> Outcome {
    let texel = |at: exr::math::Vec2<usize>| {
        let azimuth = ((at.x() as f32 + 0.5) / width as f32 - 0.5) * TAU;
        let polar = (at.y() as f32 + 0.5) / height as f32 * PI;
        let direction = vec3(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos());
        let [red, green, blue] = radiance(direction).to_array().map(f16::from_f32);
        (red, green, blue)
    };
    let attributes = LayerAttributes { layer_name: None, ..LayerAttributes::default() };
    let layer = Layer::new((width, height), attributes, Encoding::SMALL_LOSSLESS, SpecificChannels::rgb(texel));
    Ok(Image::from_layer(layer).write().non_parallel().to_file(path)?)
}

/// SplitMix64 (Steele et al. 2014), uniform in [0, 1).
struct Random(u64);

impl Random {
    /// Uniform in a cube.
    fn vector(&mut self) -> Vec3 {
        vec3(self.next(), self.next(), self.next())
    }

    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 40) as f32 / (1u64 << 24) as f32
    }
}
