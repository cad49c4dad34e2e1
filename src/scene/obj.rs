//! Wavefront OBJ files, through `tobj`.

use std::collections::HashMap;
use std::io::BufReader;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use super::error::{Error, Place, open, quote};
use super::mesh::{LARGEST_COORDINATE, spacing};
use super::polygon::{MOST_EARS, triangulate};
use super::statements::{Fault, Statements, number};
use super::{Bounds, Mesh, mtl, normals};

/// Where the shading normals of a mesh come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Normals {
    /// The file's, and generated ones for objects without.
    Auto {
        /// An edge whose triangles' normals differ by more is a crease.
        crease_degrees: f32,
    },
    /// None: the facets show.
    Flat,
    /// Generated ones, whatever the file has.
    Smooth {
        /// As above.
        crease_degrees: f32,
    },
}

/// Crease angle unless the scene says otherwise, degrees.
pub(super) const CREASE_DEGREES: f32 = 40.0;

/// A mesh whose coordinates `f32` would round by more than this share of its size is read about its own middle. A building on the
/// grid of its country is, and a whole town; nothing within some hundreds of its sizes of the origin.
const COARSEST: f32 = 2e-5;

/// Statements of the OBJ specification (Wavefront, version 3.0) that say nothing to a renderer of triangles.
const IGNORED: &str = "o g s mg lod vp cstype deg bmat step parm trim hole scrv sp end con bevel \
    c_interp d_interp maplib usemap shadow_obj trace_obj ctech stech res";

/// Those whose absence from the picture deserves a warning.
const DRAWABLE: [&str; 9] = ["p", "l", "curv", "curv2", "surf", "bsp", "bzp", "cdc", "cdp"];

/// How many of a face's corners have an attribute.
#[derive(Clone, Copy, PartialEq)]
enum Share {
    None,
    Some,
    All,
}

impl Share {
    fn of(count: usize, corners: usize) -> Share {
        match count {
            0 => Share::None,
            _ if count < corners => Share::Some,
            _ => Share::All,
        }
    }
}

/// What the check of the statements gathers on the way.
#[derive(Default)]
struct Census {
    /// What is subtracted from positions.
    origin: DVec3,
    positions: usize,
    uvs: usize,
    normals: usize,
    /// Names in `mtllib` statements and their lines.
    libraries: Vec<(usize, String)>,
    /// Names in `usemtl` statements, in the order of their first appearance.
    materials: Vec<String>,
    material_numbers: HashMap<String, usize>,
    /// Which attributes the corners of the last face have.
    attributes: Option<[Share; 2]>,
    /// What was left out, and the line of its first appearance.
    warnings: Vec<(usize, String)>,
}

impl Census {
    fn warn_once(&mut self, line: usize, message: String) {
        if !self.warnings.iter().any(|(_, known)| *known == message) {
            self.warnings.push((line, message));
        }
    }

    /// Checks a statement and appends to `out` what `tobj` shall see of it.
    fn check(&mut self, line: usize, statement: &str, out: &mut String) -> Result<(), Fault> {
        let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
        let rest = rest.trim();
        let numbers = rest.split('#').next().unwrap_or_default();
        let uncommented = numbers.len() == rest.len();
        let mut words = numbers.split_whitespace();
        match keyword {
            "v" => {
                // Colours and the weights of rational curves may follow the three coordinates.
                for _ in 0..3 {
                    coordinate(&mut words).map_err(|fault| fault.of(format!("vertex {}", self.positions + 1)))?;
                }
                self.positions += 1;
                if self.origin != DVec3::ZERO {
                    out.push('v');
                    for (word, origin) in numbers.split_whitespace().zip(self.origin.to_array()) {
                        let coordinate: f64 = word.parse().map_err(|_| Fault::new(quote(word), "a finite number"))?;
                        out.push_str(&format!(" {}", (coordinate - origin) as f32));
                    }
                    out.push('\n');
                } else if words.next().is_none() && uncommented {
                    push_line(out, statement);
                } else {
                    push_words(out, "v", numbers, 3);
                }
            }
            "vt" => {
                coordinate(&mut words).map_err(|fault| fault.of(format!("texture coordinate {}", self.uvs + 1)))?;
                let second = words.next().unwrap_or("0");
                coordinate(&mut [second].into_iter())
                    .map_err(|fault| fault.of(format!("texture coordinate {}", self.uvs + 1)))?;
                self.uvs += 1;
                push_words(out, "vt", &[numbers, " ", second].concat(), 2);
            }
            "vn" => {
                for _ in 0..3 {
                    number(&mut words).map_err(|fault| fault.of(format!("normal {}", self.normals + 1)))?;
                }
                self.normals += 1;
                push_words(out, "vn", numbers, 3);
            }
            "f" => {
                let [mut corners, mut uvs, mut normals] = [0; 3];
                for corner in words {
                    let [has_uv, has_normal] = self.check_corner(corner)?;
                    corners += 1;
                    uvs += usize::from(has_uv);
                    normals += usize::from(has_normal);
                }
                if corners < 3 {
                    self.warn_once(
                        line,
                        format!("a face of {corners} corners has no area: it and its like are left out"),
                    );
                    return Ok(());
                }
                // All faces of a group must have what one of them has.
                let attributes = Some([uvs, normals].map(|count| Share::of(count, corners)));
                if self.attributes.is_some() && self.attributes != attributes {
                    out.push_str("g\n");
                }
                self.attributes = attributes;
                if uncommented {
                    push_line(out, statement);
                } else {
                    push_words(out, "f", numbers, usize::MAX);
                }
            }
            "mtllib" if rest.is_empty() => return Err(Fault::new("no name", "the name of an MTL file")),
            "mtllib" => self.libraries.push((line, rest.to_owned())),
            "usemtl" => {
                if rest.is_empty() {
                    return Err(Fault::new("no name", "the name of a material"));
                }
                // tobj numbers materials as libraries define them; one library a name numbers them as we do.
                if !self.material_numbers.contains_key(rest) {
                    self.material_numbers.insert(rest.to_owned(), self.materials.len());
                    out.push_str(&format!("mtllib {}\n", self.materials.len()));
                    self.materials.push(rest.to_owned());
                }
                out.push_str(&format!("usemtl {}\n", self.material_numbers[rest]));
            }
            _ if DRAWABLE.contains(&keyword) => {
                let message =
                    format!("`{keyword}` (points, lines, curves and their surfaces) is not rendered: export faces");
                self.warn_once(line, message);
            }
            "call" => {
                let message = format!("the file of {} is not read: put its statements here", quote(statement));
                self.warn_once(line, message);
            }
            "csh" => {
                let message =
                    format!("the command of {} is not run: put the statements that it prints here", quote(statement));
                self.warn_once(line, message);
            }
            _ if IGNORED.split_whitespace().any(|ignored| ignored == keyword) => {}
            _ if keyword.starts_with('#') => {}
            _ if keyword.contains(|c: char| c.is_control() || c == char::REPLACEMENT_CHARACTER) => {
                return Err(Fault::new("bytes that are no text", "an OBJ file"));
            }
            _ => {
                return Err(Fault::new(
                    format!("the statement {}", quote(keyword)),
                    "an OBJ statement, such as `v`, `vt`, `vn`, `f`, `usemtl` or `mtllib`",
                ));
            }
        }
        Ok(())
    }

    /// Checks `position`, `position/uv`, `position//normal` or `position/uv/normal`. Returns whether there are the last two.
    fn check_corner(&self, corner: &str) -> Result<[bool; 2], Fault> {
        let mut parts = corner.split('/');
        let mut has = [false; 3];
        let kinds = [("position", self.positions), ("texture coordinate", self.uvs), ("normal", self.normals)];
        for (has, (name, count)) in has.iter_mut().zip(kinds) {
            match parts.next() {
                None => break,
                Some("") if name != "position" => {}
                Some(part) => {
                    let index: isize = part.parse().map_err(|_| {
                        Fault::new(format!("{} in the corner {}", quote(part), quote(corner)), "a whole number")
                    })?;
                    if index == 0 || index.unsigned_abs() > count {
                        let found = format!("the index {index} of a {name} in the corner {}", quote(corner));
                        let expected = match count {
                            0 => format!("none, as no {name} precedes"),
                            _ => format!("1 to {count}, or -{count} to -1 to count backwards"),
                        };
                        return Err(Fault::new(found, expected));
                    }
                    *has = true;
                }
            }
        }
        match parts.next() {
            None => Ok([has[1], has[2]]),
            Some(_) => Err(Fault::new(quote(corner), "at most position/texture coordinate/normal")),
        }
    }
}

fn push_line(out: &mut String, statement: &str) {
    out.push_str(statement);
    out.push('\n');
}

/// Appends a keyword and up to `count` words as a line.
fn push_words(out: &mut String, keyword: &str, rest: &str, count: usize) {
    out.push_str(keyword);
    for word in rest.split_whitespace().take(count) {
        out.push(' ');
        out.push_str(word);
    }
    out.push('\n');
}

fn coordinate<'a>(words: &mut impl Iterator<Item = &'a str>) -> Result<(), Fault> {
    let value = number(words)?;
    if value.abs() <= LARGEST_COORDINATE {
        Ok(())
    } else {
        Err(Fault::new(value.to_string(), format!("a magnitude of at most {LARGEST_COORDINATE:e}")))
    }
}

/// Reads the statements of an OBJ file, whose positions are told about `origin`.
fn parse(path: &Path, named_by: Option<&Place>, origin: Vec3) -> Result<(Vec<tobj::Model>, Census), Error> {
    let file = open(path, named_by)?;
    let mut census = Census { origin: origin.as_dvec3(), ..Census::default() };
    let check = |line: usize, statement: &str, out: &mut String| census.check(line, statement, out);
    let mut statements = Statements::new(path, named_by, BufReader::with_capacity(1 << 16, file), check);
    let options = tobj::LoadOptions { single_index: true, ..Default::default() };
    match tobj::load_obj_buf(&mut statements, &options, numbered_library) {
        Ok((models, _)) => Ok((models, census)),
        Err(error) => Err(statements.into_error(error)),
    }
}

/// The middle of a mesh that is too far from the origin for `f32` to tell its vertices apart; else the origin.
fn middle_if_far(models: &[tobj::Model]) -> Vec3 {
    let positions = models.iter().flat_map(|model| model.mesh.positions.chunks_exact(3));
    let bounds = positions.fold(Bounds::EMPTY, |bounds, position| bounds.including(Vec3::from_slice(position)));
    let farthest = bounds.min.abs().max(bounds.max.abs()).max_element();
    let is_far = farthest.is_finite() && spacing(farthest) > COARSEST * 2.0 * bounds.radius();
    if is_far { bounds.center() } else { Vec3::ZERO }
}

/// Reads an OBJ file into one mesh, and tells where its origin is, in the file's coordinates: there too, unless `f32` would round much of the
/// mesh away. Its materials and their textures go to `library`.
pub(super) fn load(
    path: &Path,
    named_by: Option<&Place>,
    normals: Normals,
    library: &mut mtl::Library,
) -> Result<(Mesh, Vec3), Error> {
    let (mut models, mut census) = parse(path, named_by, Vec3::ZERO)?;
    let origin = middle_if_far(&models);
    if origin != Vec3::ZERO {
        // Few files are far away, and those that are not shall not take the memory of `f64`.
        drop(models);
        (models, census) = parse(path, named_by, origin)?;
    }
    for (line, message) in std::mem::take(&mut census.warnings) {
        library.warn(Place::line(path, line), message);
    }

    library.read_material_files(path, &census.libraries)?;
    let mut material_indices: Vec<Option<u32>> = vec![None; census.materials.len()];
    let mut nameless = None;
    let mut given = Mesh::default();
    let mut bare = Mesh::default();
    for model in models {
        let model = model.mesh;
        if model.indices.is_empty() {
            continue;
        }
        let material = match model.material_id {
            Some(number) => {
                *material_indices[number].get_or_insert_with(|| library.material(path, &census.materials[number]))
            }
            None => *nameless.get_or_insert_with(|| library.nameless_material()),
        };
        let wanted = (given.positions.len() + bare.positions.len()) as u64 + model.positions.len() as u64 / 3;
        if wanted.max(model.indices.len() as u64) > u64::from(u32::MAX) {
            return Err(Error::unexpected(Place::file(path), "more than 2³² vertices", "a smaller mesh"));
        }
        let mesh = convert(model, material, path, library);
        if mesh.uvs.is_empty() {
            library.without_uvs.insert((material, path.to_owned()));
        }
        let keeps_normals = matches!(normals, Normals::Auto { .. }) && !mesh.normals.is_empty();
        if keeps_normals { &mut given } else { &mut bare }.append(mesh);
    }

    let mut dropped = given.drop_degenerate();
    normals::normalize(&mut given);
    bare.normals = Vec::new();
    dropped += bare.drop_degenerate();
    if let Normals::Auto { crease_degrees } | Normals::Smooth { crease_degrees } = normals {
        normals::smooth(&mut bare, crease_degrees);
    }
    let mut mesh = given;
    mesh.append(bare);
    mesh.name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    if dropped > 0 {
        library.warn(Place::file(path), format!("dropped {dropped} triangles without area"));
    }
    if mesh.triangles.is_empty() {
        return Err(Error::unexpected(Place::file(path), "no triangle", "at least one face (`f`) with area"));
    }
    if !mesh.normals.is_empty() && normals::are_flat(&mesh) {
        mesh.normals = Vec::new();
    }
    if mesh.materials.iter().all(|material| *material == mesh.materials[0]) {
        mesh.materials.truncate(1);
    }
    Ok((mesh, origin))
}

/// Stands in for a material library: defines just the material that its file name says.
fn numbered_library(name: &Path) -> tobj::MTLLoadResult {
    let name = name.to_string_lossy().into_owned();
    let material = tobj::Material { name: name.clone(), ..Default::default() };
    Ok((vec![material], [(name, 0)].into_iter().collect()))
}

fn convert(model: tobj::Mesh, material: u32, path: &Path, library: &mut mtl::Library) -> Mesh {
    let positions: Vec<Vec3> = model.positions.chunks_exact(3).map(Vec3::from_slice).collect();
    let mut uvs: Vec<Vec2> = model.texcoords.chunks_exact(2).map(Vec2::from_slice).collect();
    let mut normals: Vec<Vec3> = model.normals.chunks_exact(3).map(Vec3::from_slice).collect();
    let mut partly = |given: usize, what: &str| {
        let partly = given != 0 && given != positions.len();
        if partly {
            library.warn(Place::file(path), format!("some corners of faces have {what} and some have none: ignored"));
        }
        partly
    };
    if partly(uvs.len(), "texture coordinates") {
        uvs = Vec::new();
    }
    if partly(normals.len(), "normals") {
        normals = Vec::new();
    }
    let mut triangles = Vec::new();
    if model.face_arities.is_empty() {
        triangles = model.indices.chunks_exact(3).map(|corners| [corners[0], corners[1], corners[2]]).collect();
    } else {
        let mut rest = &model.indices[..];
        let mut approximate = 0;
        for &arity in &model.face_arities {
            let (polygon, others) = rest.split_at(arity as usize);
            rest = others;
            approximate += usize::from(!triangulate(polygon, &positions, &mut triangles));
        }
        if approximate > 0 {
            let message =
                format!("{approximate} polygons of more than {MOST_EARS} corners are cut as if they were convex");
            library.warn(Place::file(path), message);
        }
    }
    let materials = vec![material; triangles.len()];
    Mesh { name: String::new(), positions, normals, uvs, triangles, materials }
}
