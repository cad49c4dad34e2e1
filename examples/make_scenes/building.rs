//! A building of rooms with lamps, few of which matter to any one place.

use std::fmt::Write;
use std::path::Path;

use glam::{Vec3, vec3};

use super::obj::Obj;
use super::{Outcome, Random, save};

/// Rooms along each side.
const ROOMS: u32 = 6;
/// Of a room, m.
const SIDE: f32 = 4.0;
const HEIGHT: f32 = 3.0;
/// Kinds of lamps, each half as bright again as the one before.
const KINDS: u32 = 8;

/// 36 rooms, open to one another by doors, 6 lamps of two triangles each in every one.
pub fn write(folder: &Path) -> Outcome {
    let mut random = Random(1);
    let mut obj = Obj::new("building.mtl");
    let whole = ROOMS as f32 * SIDE;
    let middle = vec3(whole / 2.0, HEIGHT / 2.0, whole / 2.0);
    obj.object("shell", "wall");
    obj.block(middle, vec3(-whole / 2.0, 0.0, 0.0), -HEIGHT / 2.0);
    for inner in 1..ROOMS {
        for room in 0..ROOMS {
            let [across, from] = [inner, room].map(|index| index as f32 * SIDE);
            for (name, turned) in [("x", false), ("z", true)] {
                obj.object(&format!("wall {name} {inner} {room}"), "wall");
                // Beside the door, on the other side, and above it.
                for [start, end, low] in [[0.0, 1.4, 0.0], [2.6, SIDE, 0.0], [1.4, 2.6, 2.1]] {
                    let corner = |along: f32, y: f32| match turned {
                        false => vec3(across, y, from + along),
                        true => vec3(from + along, y, across),
                    };
                    obj.quad([corner(start, low), corner(end, low), corner(end, HEIGHT), corner(start, HEIGHT)]);
                }
            }
        }
    }
    for (index, room) in (0..ROOMS * ROOMS).map(|index| (index, [index / ROOMS, index % ROOMS])) {
        let [x, z] = room.map(|place| place as f32 * SIDE);
        let mut place = |margin: f32| {
            let mut within = || margin + (SIDE - 2.0 * margin) * random.next();
            vec3(x + within(), 0.0, z + within())
        };
        obj.object(&format!("chest {index}"), ["brass", "lacquer"][index as usize % 2]);
        obj.block(place(0.8) + 0.45 * Vec3::Y, vec3(0.35, 0.0, 0.1), 0.45);
        for lamp in 0..6 {
            obj.object(&format!("lamp {index} {lamp}"), &format!("lamp{}", (index + lamp) % KINDS));
            let center = place(0.5) + (HEIGHT - 0.1 - 0.05 * lamp as f32) * Vec3::Y;
            let corner = |x: f32, z: f32| center + 0.1 * vec3(x, 0.0, z);
            obj.quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        }
    }
    let mut mtl = String::from(
        "\
newmtl wall
Kd 0.7 0.68 0.65
newmtl brass
Kd 0.9 0.7 0.35
Pm 1
Pr 0.4
newmtl lacquer
Kd 0.1 0.2 0.4
Ks 1 1 1
Pr 0.4
",
    );
    for kind in 0..KINDS {
        let radiance = 3.0 * 1.5f32.powi(kind as i32);
        let [green, blue] = [0.9, 0.6 + 0.05 * kind as f32].map(|share| share * radiance);
        writeln!(mtl, "newmtl lamp{kind}\nKd 0 0 0\nKe {radiance:.4} {green:.4} {blue:.4}")?;
    }
    let toml = "\
# Rooms with lamps, few of which matter to any one place. Made by examples/make_scenes.
[camera]
eye = [8.5, 1.7, 8.6]
target = [13, 1, 12.4]
fov = 75

[film]
width = 192
height = 144

[[mesh]]
file = \"building.obj\"
";
    save(folder, &[("scene.toml", toml), ("building.mtl", &mtl), ("building.obj", &obj.text)])
}
