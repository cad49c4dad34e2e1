//! Trees whose leaves are cut out of squares.

use std::f32::consts::{PI, TAU};
use std::path::Path;

use glam::{Mat3, Quat, Vec2, Vec3, vec3};

use super::obj::Obj;
use super::{Outcome, Random, save};

/// Squares with a sprig each.
const SPRIGS: usize = 340;
/// Texels to a side.
const SIZE: u32 = 128;

/// Three trees in the sun, instances of one.
pub fn write(folder: &Path) -> Outcome {
    let mut tree = Obj::new("foliage.mtl");
    tree.object("wood", "bark");
    let trunk = |t: f32| Vec2::new(0.1 - 0.075 * t + 0.04 * (1.0 - t).powi(8), 2.1 * t);
    tree.lathe(Vec3::ZERO, 6, 8, trunk);
    tree.object("leaves", "leaf");
    let mut random = Random(7);
    for sprig in 0..SPRIGS {
        // Golden angles down an egg, from within to its shell.
        let height = 1.0 - 2.0 * (sprig as f32 + 0.5) / SPRIGS as f32;
        let azimuth = sprig as f32 * PI * (3.0 - 5f32.sqrt());
        let around = (1.0 - height * height).sqrt();
        let outwards = vec3(around * azimuth.sin(), height, around * azimuth.cos());
        let shell = 0.2 + 0.8 * random.next().sqrt();
        let at = vec3(0.0, 1.75, 0.0) + outwards * shell * vec3(0.72, 1.0, 0.72);
        let droop = (outwards - vec3(0.0, 0.35, 0.0) + 1.2 * (random.vector() - 0.5)).normalize();
        square(&mut tree, at, droop, TAU * random.next(), 0.13 + 0.07 * random.next());
    }
    let mut ground = Obj::new("foliage.mtl");
    ground.object("ground", "ground");
    ground.sheet(1, 1, 40.0, |u, v| vec3(60.0 * (u - 0.5), 0.0, 60.0 * (0.5 - v)), false);
    let mtl = "\
newmtl ground
Kd 0.3 0.26 0.17
norm soil.png
newmtl bark
Kd 0.18 0.13 0.1
newmtl leaf
Kd 1 1 1
map_Kd sprig.png
map_d sprig.png
Ks 1 1 1
Ni 1.4
Pr 0.6
";
    let toml = "\
# Leaves that a texture's alpha cuts out of squares. Made by examples/make_scenes.
[camera]
eye = [0.4, 1.5, 7]
target = [0, 1.3, 0]
fov = 32

[film]
width = 192
height = 144

[[mesh]]
file = \"ground.obj\"

[[mesh]]
file = \"tree.obj\"
instances = [
    { translate = [-1.25, 0, 0.3] },
    { translate = [1.2, 0, -0.4], rotate = [0, 110, 0], scale = [1.1, 1, 1.1] },
    { translate = [0.2, 0, -2.6], rotate = [0, 220, 0], scale = 1.15 },
]

[environment]
radiance = [0.4, 0.55, 0.8]

[sun]
direction = [-0.55, 0.75, 0.6]
irradiance = [3.2, 2.9, 2.4]
";
    let files = [("scene.toml", toml), ("foliage.mtl", mtl), ("tree.obj", &tree.text), ("ground.obj", &ground.text)];
    save(folder, &files)?;
    image::RgbaImage::from_fn(SIZE, SIZE, texel).save(folder.join("sprig.png"))?;
    soil().save(folder.join("soil.png"))?;
    Ok(())
}

/// A square that begins at a point and runs along a direction, turned about it.
fn square(obj: &mut Obj, at: Vec3, along: Vec3, turn: f32, size: f32) {
    let frame = Mat3::from_quat(Quat::from_rotation_arc(Vec3::Y, along) * Quat::from_rotation_y(turn));
    let point = |u: f32, v: f32| at + frame * (size * vec3(2.0 * u - 1.0, 2.0 * v, 0.0));
    obj.sheet(1, 1, 1.0, point, false);
}

/// Normals over waves that run every which way and fit the texture's sides.
fn soil() -> image::RgbImage {
    let mut random = Random(11);
    let mut whole = |most: f32| (random.next() * (2.0 * most + 1.0)).floor() - most;
    let waves: Vec<Vec3> = (0..40).map(|_| vec3(whole(9.0), whole(9.0), whole(50.0))).collect();
    image::RgbImage::from_fn(64, 64, |x, y| {
        let at = Vec2::new(x as f32 + 0.5, 63.5 - y as f32) / 64.0;
        let slope: Vec2 =
            waves.iter().map(|wave| 0.012 * wave.truncate() * (TAU * wave.truncate().dot(at) + wave.z).cos()).sum();
        let normal = (-slope).extend(1.0).normalize();
        image::Rgb((255.0 * (0.5 + 0.5 * normal)).to_array().map(|code| code.round() as u8))
    })
}

/// Colour and, from 16 points, alpha.
fn texel(x: u32, y: u32) -> image::Rgba<u8> {
    let at = |i: u32, j: u32| {
        let (u, v) = (x as f32 + (i as f32 + 0.5) / 4.0, y as f32 + (j as f32 + 0.5) / 4.0);
        Vec2::new(2.0 * u / SIZE as f32 - 1.0, 1.0 - v / SIZE as f32)
    };
    let points = (0..16).map(|k| at(k % 4, k / 4));
    let covered = points.filter(|point| rib(*point).is_some()).count();
    let rib = rib(at(2, 2)).unwrap_or(0.5);
    let [red, green, blue] = [0.27 + 0.2 * rib, 0.42 + 0.14 * rib, 0.13 + 0.1 * rib].map(|code| (255.0 * code) as u8);
    image::Rgba([red, green, blue, (covered * 255 / 16) as u8])
}

/// How near to the middle of its leaf, or to the stem, a point is, from 0 to 1; none between the leaves. The sprig runs up the middle of [−1, 1] × [0, 1].
fn rib(point: Vec2) -> Option<f32> {
    let leaf = |base: Vec2, angle: f32, length: f32| {
        let along = Vec2::from_angle(angle);
        let to = point - base;
        let t = to.dot(along) / length;
        let width = 0.17 * length * (PI * t.clamp(0.0, 1.0).powf(0.75)).sin();
        let away = to.perp_dot(along).abs();
        (0.0 < t && t < 1.0 && away < width).then(|| (1.0 - 3.0 * away / width).clamp(0.0, 1.0))
    };
    let pairs = (0..3).flat_map(|pair| {
        let base = Vec2::new(0.0, 0.1 + 0.2 * pair as f32);
        [0.25, 0.75].map(|turn| (base, PI * turn, 0.6 - 0.1 * pair as f32))
    });
    let mut leaves = pairs.chain([(Vec2::new(0.0, 0.55), PI / 2.0, 0.44)]);
    let stem = (point.x.abs() < 0.02 && point.y < 0.6).then_some(1.0);
    stem.or_else(|| leaves.find_map(|(base, angle, length)| leaf(base, angle, length)))
}
