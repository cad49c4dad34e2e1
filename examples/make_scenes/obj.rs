//! OBJ files in the making.

use std::f32::consts::{PI, TAU};
use std::fmt::Write;

use glam::{Mat3, Vec2, Vec3, vec3};

/// An OBJ file in the making.
pub struct Obj {
    pub text: String,
    positions: usize,
    uvs: usize,
    normals: usize,
}

impl Obj {
    pub fn new(material_file: &str) -> Obj {
        let text = format!("# Made by examples/make_scenes.\nmtllib {material_file}\n");
        Obj { text, positions: 0, uvs: 0, normals: 0 }
    }

    fn line(&mut self, text: std::fmt::Arguments) {
        self.text.write_fmt(text).expect("strings take all that is written");
        self.text.push('\n');
    }

    pub fn object(&mut self, name: &str, material: &str) {
        self.line(format_args!("o {name}\nusemtl {material}"));
    }

    pub fn position(&mut self, p: Vec3) -> usize {
        self.line(format_args!("v {} {} {}", Short(p.x), Short(p.y), Short(p.z)));
        self.positions += 1;
        self.positions
    }

    pub fn uv(&mut self, uv: Vec2) -> usize {
        self.line(format_args!("vt {} {}", Short(uv.x), Short(uv.y)));
        self.uvs += 1;
        self.uvs
    }

    pub fn normal(&mut self, n: Vec3) -> usize {
        self.line(format_args!("vn {} {} {}", Short(n.x), Short(n.y), Short(n.z)));
        self.normals += 1;
        self.normals
    }

    pub fn triangle(&mut self, corners: [Vec3; 3]) {
        let [a, b, c] = corners.map(|corner| self.position(corner));
        self.line(format_args!("f {a} {b} {c}"));
    }

    pub fn quad(&mut self, corners: [Vec3; 4]) {
        let [a, b, c, d] = corners.map(|corner| self.position(corner));
        self.line(format_args!("f {a} {b} {c} {d}"));
    }

    /// A block on a square base: its middle, half its first horizontal axis (the other is at right angles), and half
    /// its height. Negative halves turn it inside out.
    pub fn block(&mut self, center: Vec3, x: Vec3, half_height: f32) {
        let axes = Mat3::from_cols(x, vec3(0.0, half_height, 0.0), vec3(-x.z, 0.0, x.x));
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let [n, u, v] = [0, 1, 2].map(|step| axes.col((axis + step) % 3));
                let n = n * side;
                let u = u * side;
                self.quad([n - u - v, n + u - v, n + u + v, n - u + v].map(|corner| center + corner));
            }
        }
    }

    /// A sheet of `columns` × `rows` quads over (u, v) in [0, 1]², seen from the side where u runs to the right and v
    /// upwards, with texture coordinates that run to `repeat` and perhaps smooth normals.
    pub fn sheet(&mut self, columns: usize, rows: usize, repeat: f32, point: impl Fn(f32, f32) -> Vec3, smooth: bool) {
        let first = self.positions;
        for row in 0..=rows {
            for column in 0..=columns {
                let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
                self.position(point(u, v));
                self.uv(repeat * Vec2::new(u, v));
                if smooth {
                    let step = 1e-2;
                    let du = point(u + step, v) - point(u - step, v);
                    let dv = point(u, v + step) - point(u, v - step);
                    self.normal(du.cross(dv).normalize());
                }
            }
        }
        let [uv, normal] =
            [self.uvs, self.normals].map(|count| count - (columns + 1) * (rows + 1) * usize::from(count > 0));
        for row in 0..rows {
            for column in 0..columns {
                let corner = |x: usize, y: usize| {
                    let index = (row + y) * (columns + 1) + column + x + 1;
                    if smooth {
                        format!("{}/{}/{}", first + index, uv + index, normal + index)
                    } else {
                        format!("{}/{}", first + index, uv + index)
                    }
                };
                let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                self.line(format_args!("f {a} {b} {c} {d}"));
            }
        }
    }

    /// A surface of revolution about a vertical axis: the profile runs upwards on the outside, (distance from the
    /// axis, height) over t in [0, 1]. u runs around, v along the profile.
    pub fn lathe(&mut self, center: Vec3, rows: usize, segments: usize, profile: impl Fn(f32) -> Vec2) {
        self.lathe_tiled(center, rows, segments, Vec2::ONE, profile);
    }

    /// The same with texture coordinates that run to `repeat`.
    pub fn lathe_tiled(
        &mut self,
        center: Vec3,
        rows: usize,
        segments: usize,
        repeat: Vec2,
        profile: impl Fn(f32) -> Vec2,
    ) {
        let [position, uv, normal] = [self.positions, self.uvs, self.normals];
        let point = |t: f32, angle: f32| {
            let Vec2 { x: radius, y: height } = profile(t);
            vec3(radius * angle.sin(), height, radius * angle.cos())
        };
        for row in 0..=rows {
            let t = row as f32 / rows as f32;
            for segment in 0..segments {
                let angle = TAU * segment as f32 / segments as f32;
                self.position(center + point(t, angle));
                let step = 1e-3;
                let along = profile((t + step).min(1.0)) - profile((t - step).max(0.0));
                let outwards = Vec2::new(along.y, -along.x).normalize();
                self.normal(vec3(outwards.x * angle.sin(), outwards.y, outwards.x * angle.cos()));
            }
            for segment in 0..=segments {
                self.uv(repeat * Vec2::new(segment as f32 / segments as f32, t));
            }
        }
        for row in 0..rows {
            for segment in 0..segments {
                let corner = |x: usize, y: usize| {
                    let vertex = (row + y) * segments + (segment + x) % segments + 1;
                    let coordinate = (row + y) * (segments + 1) + segment + x + 1;
                    format!("{}/{}/{}", position + vertex, uv + coordinate, normal + vertex)
                };
                let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                let at_axis = |row: usize| profile(row as f32 / rows as f32).x.abs() < 1e-4;
                match (at_axis(row), at_axis(row + 1)) {
                    (true, _) => self.line(format_args!("f {a} {c} {d}")),
                    (_, true) => self.line(format_args!("f {a} {b} {c}")),
                    _ => self.line(format_args!("f {a} {b} {c} {d}")),
                }
            }
        }
    }

    pub fn sphere(&mut self, center: Vec3, radius: f32, rows: usize, segments: usize) {
        self.lathe(center, rows, segments, |t| radius * Vec2::new((PI * t).sin(), -(PI * t).cos()));
    }

    /// An octahedron whose triangles are split in four `levels` times and pushed out to the sphere, without normals.
    pub fn facetted_sphere(&mut self, center: Vec3, radius: f32, levels: u32) {
        fn split(corners: [Vec3; 3], levels: u32, emit: &mut impl FnMut([Vec3; 3])) {
            if levels == 0 {
                return emit(corners);
            }
            let [a, b, c] = corners;
            let [ab, bc, ca] = [(a + b).normalize(), (b + c).normalize(), (c + a).normalize()];
            for corners in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                split(corners, levels - 1, emit);
            }
        }
        for octant in 0..8 {
            let [x, y, z] = [1, 2, 4].map(|bit| if octant & bit == 0 { 1.0 } else { -1.0 });
            let mut corners = [Vec3::X * x, Vec3::Y * y, Vec3::Z * z];
            if x * y * z < 0.0 {
                corners.swap(1, 2);
            }
            split(corners, levels, &mut |corners| self.triangle(corners.map(|corner| center + radius * corner)));
        }
    }
}

/// A number with five decimals at most, and no sign before zero.
struct Short(f32);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = format!("{:.5}", self.0);
        let text = text.trim_end_matches('0').trim_end_matches('.');
        f.write_str(if text == "-0" { "0" } else { text })
    }
}
