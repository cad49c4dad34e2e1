//! Scene files: TOML beside OBJ, as docs/scenes.md describes it, or a bare OBJ file.

use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};
use std::mem::discriminant;
use std::path::{Path, PathBuf};

use glam::{Affine3A, EulerRot, Mat3, Quat, Vec2, Vec3};

use super::error::{Error, Place, Warning, nearest, open};
use super::light::BRIGHTEST;
use super::mesh::{self, LARGEST_COORDINATE, spacing};
use super::mtl::{Holds, Library, TextureFile, metal_of};
use super::named_file::beside;
use super::obj::{self, Normals};
use super::table::{Source, Table, Value, read_text};
use super::{
    Bounds, Camera, Color, Environment, Film, Fresnel, Instance, LayerBase, Layered, Lens, Material, Mesh, Opacity,
    Patches, Scene, Sun, Surface, Texture, TexturePlacement, Woven, brdf, decode, metals,
};

/// Size of the picture unless the scene file says otherwise.
const FILM: Film = Film { width: 512, height: 512 };
/// Vertical field of view unless the scene file says otherwise, degrees.
const FOV_DEGREES: f32 = 40.0;
/// A camera whose coordinates are rounded by more than this share of the distance that it looks over deserves a warning.
const COARSEST_VIEW: f32 = 1e-3;
/// Longest scene file, bytes.
pub(super) const LONGEST_FILE: u64 = 64 << 20;

impl Scene {
    /// Loads a scene file (`.toml`) or a bare OBJ file (any other name, but those of BRDFs), which is seen from outside of its bounds
    /// under a uniform sky of radiance 1.
    ///
    /// # Errors
    /// Anything in the files that is not as docs/scenes.md says, with its place and the remedy. What was merely left
    /// out or mended comes back as warnings.
    pub fn load(path: impl AsRef<Path>) -> Result<(Scene, Vec<Warning>), Error> {
        Scene::load_with_files(path).map(|(scene, warnings, _)| (scene, warnings))
    }

    /// The same, and the files that the scene is made of beside `path`, which nothing that is made of it should replace.
    ///
    /// # Errors
    /// As of [`Scene::load`].
    pub fn load_with_files(path: impl AsRef<Path>) -> Result<(Scene, Vec<Warning>, BTreeSet<PathBuf>), Error> {
        let path = path.as_ref();
        if brdf::ending(path) == "toml" {
            load_scene_file(path)
        } else if brdf::is_of_brdf(path) {
            open(path, None)?;
            let expected = "a scene: an OBJ file, or a TOML file whose `[material.NAME]` may name this one";
            Err(Error::unexpected(Place::file(path), "the file of a material", expected))
        } else {
            load_bare_obj(path)
        }
    }
}

fn load_bare_obj(path: &Path) -> Result<(Scene, Vec<Warning>, BTreeSet<PathBuf>), Error> {
    let mut loader = Loader::default();
    let normals = Normals::Auto { crease_degrees: obj::CREASE_DEGREES };
    let (mesh, origin) = loader.mesh(path, None, normals)?;
    if origin != Vec3::ZERO {
        // No camera is written in the file's coordinates, and one of `f32` could not keep it in view there.
        let rounding = spacing(origin.abs().max_element());
        let message = format!(
            "far from the origin, where coordinates are rounded to {rounding}: its point {origin} is taken as the origin"
        );
        loader.library.warn(Place::file(path), message);
    }
    let instances = vec![Instance { mesh, object_to_world: Affine3A::IDENTITY }];
    loader.finish(path, None, FILM, instances, Some(Environment::constant(Vec3::ONE)), None)
}

fn load_scene_file(path: &Path) -> Result<(Scene, Vec<Warning>, BTreeSet<PathBuf>), Error> {
    let text = read_text(path, LONGEST_FILE)?;
    let source = Source { file: path, text: &text };
    let entries = source.parse()?;
    let root = Table::root(source, &entries);
    root.allow(&["camera", "film", "mesh", "material", "environment", "sun"])?;

    let mut loader = Loader::default();
    let camera = root.get("camera").map(|value| camera(&value.table()?)).transpose()?;
    let film = root.get("film").map(|value| film(&value.table()?)).transpose()?.unwrap_or(FILM);
    let mut instances = Vec::new();
    for entry in root.require("mesh")?.array()? {
        add_mesh(&entry.table()?, &mut loader, &mut instances)?;
    }
    if instances.is_empty() {
        return Err(root.error("no instance of a mesh", "at least one"));
    }
    if let Some(value) = root.get("material") {
        for (name, value) in value.table()?.iter() {
            override_material(name, &value, &mut loader.library)?;
        }
    }
    let environment = root.get("environment").map(|value| environment(&value.table()?, &mut loader)).transpose()?;
    let sun = root.get("sun").map(|value| sun(&value.table()?)).transpose()?;
    loader.finish(path, camera, film, instances, environment, sun)
}

/// Gathers what the files of a scene hold.
#[derive(Default)]
struct Loader {
    library: Library,
    meshes: Vec<Mesh>,
    /// Which mesh a file with these normals became, and where the file has its origin.
    known: HashMap<(PathBuf, String), (u32, Vec3)>,
}

impl Loader {
    /// The index of the mesh in a file, which is loaded once, and where the file has the origin of the mesh.
    fn mesh(&mut self, path: &Path, named_by: Option<&Place>, normals: Normals) -> Result<(u32, Vec3), Error> {
        let key = (path.to_owned(), format!("{normals:?}"));
        if let Some(&known) = self.known.get(&key) {
            return Ok(known);
        }
        let loaded = obj::load(path, named_by, normals, &mut self.library);
        let (mesh, origin) = loaded.map_err(|error| error.named_by(named_by))?;
        self.library.files.insert(path.to_owned());
        let known = (self.meshes.len() as u32, origin);
        self.meshes.push(mesh);
        self.known.insert(key, known);
        Ok(known)
    }

    fn finish(
        self,
        path: &Path,
        camera: Option<Camera>,
        film: Film,
        instances: Vec<Instance>,
        environment: Option<Environment>,
        sun: Option<Sun>,
    ) -> Result<(Scene, Vec<Warning>, BTreeSet<PathBuf>), Error> {
        let Library { materials, textures, brdfs, mut warnings, files, undefined, without_uvs, .. } = self.library;
        warnings.extend(undefined.into_iter().map(|(index, file)| Warning {
            place: Place::file(file),
            message: format!("the material `{}` is not defined: grey and diffuse", materials[index as usize].name),
        }));
        let bounds = mesh::bounds(&self.meshes, &instances);
        if bounds.min.abs().max(bounds.max.abs()).max_element() > LARGEST_COORDINATE {
            let found = format!("geometry from {} to {}", bounds.min, bounds.max);
            let expected = format!("coordinates of magnitude at most {LARGEST_COORDINATE:e}");
            return Err(Error::unexpected(Place::file(path), found, expected));
        }
        let camera = camera.unwrap_or_else(|| framing(&bounds, film));
        warnings.extend(warning_of_rounding(path, &camera));
        let mut scene = Scene {
            camera,
            film,
            meshes: self.meshes,
            instances,
            materials,
            textures: Vec::new(),
            brdfs,
            environment,
            sun,
        };
        decode_textures(&mut scene, &textures, &mut warnings)?;
        warn_of_missing_coordinates(&scene, without_uvs, &mut warnings);
        let shines = |radiance: &Vec3| *radiance != Vec3::ZERO;
        if !(scene.materials.iter().any(Material::is_emissive)
            || scene.environment.iter().flat_map(|environment| &environment.texels).any(shines)
            || scene.sun.iter().any(|sun| shines(&sun.irradiance)))
        {
            let message = "nothing emits light: the picture will be black".to_owned();
            warnings.push(Warning { place: Place::file(path), message });
        }
        Ok((scene, warnings, files))
    }
}

/// A camera that sees all of a box, from the front and a little above.
fn framing(bounds: &Bounds, film: Film) -> Camera {
    let half_height = (FOV_DEGREES.to_radians() / 2.0).tan();
    let half_extent = half_height * (film.width as f32 / film.height as f32).min(1.0);
    let distance = 1.02 * bounds.radius() / half_extent.atan().sin();
    let target = bounds.center();
    let eye = target + Vec3::new(0.4, 0.3, 1.0).normalize() * distance;
    Camera { eye, target, up: Vec3::Y, vertical_fov_degrees: FOV_DEGREES, lens: None }
}

/// Far from the origin a camera cannot stand where it should.
fn warning_of_rounding(path: &Path, camera: &Camera) -> Option<Warning> {
    let farthest = camera.eye.abs().max(camera.target.abs()).max_element();
    let distance = camera.eye.distance(camera.target);
    let message = format!(
        "the camera looks over {distance}, but coordinates near {farthest} are rounded to {}: bring the meshes to the origin, by a \
         `translate` in their `transform`, and the camera with them",
        spacing(farthest)
    );
    (spacing(farthest) > COARSEST_VIEW * distance).then(|| Warning { place: Place::file(path), message })
}

/// Decodes the texture files that the materials still name: an image once, wherever it lies.
fn decode_textures(scene: &mut Scene, files: &[TextureFile], warnings: &mut Vec<Warning>) -> Result<(), Error> {
    // What became of a file and of its image, once that is decoded.
    let mut decoded: Vec<Option<Option<u32>>> = vec![None; files.len()];
    let mut images: HashMap<usize, Option<Texture>> = HashMap::new();
    let without_holes = without_holes(&scene.materials, files);
    for material in &mut scene.materials {
        let Material {
            surface,
            emission_texture,
            opacity,
            normal_map,
            roughness_map,
            anisotropy_direction_map,
            patches,
            ..
        } = material;
        let of_color = surface.color_mut().map(|color| &mut color.texture);
        let mut of_patches = patches.map(|patches| patches.map);
        let others = [emission_texture, &mut opacity.texture, &mut of_patches];
        let maps = [normal_map, roughness_map, anisotropy_direction_map];
        for texture in of_color.into_iter().chain(others).chain(maps) {
            let Some(index) = texture.map(|index| index as usize) else { continue };
            if decoded[index].is_none() {
                let file = &files[index];
                let image = files.iter().position(|other| other.path == file.path && other.holds == file.holds);
                let found = match images.entry(image.unwrap_or(index)) {
                    Entry::Occupied(known) => known.into_mut(),
                    Entry::Vacant(unknown) => unknown.insert(decode_texture(file, &without_holes, warnings)?),
                };
                decoded[index] = Some(found.clone().map(|texture| {
                    scene.textures.push(Texture { placement: file.placement, ..texture });
                    scene.textures.len() as u32 - 1
                }));
            }
            *texture = decoded[index].flatten();
        }
        *patches = patches.zip(of_patches).map(|(patches, map)| Patches { map, ..patches });
    }
    Ok(())
}

/// The files that materials take colours from and not their holes, each with the name of such a material. What emits cannot have holes, and
/// what stands in patches has those of the material around it.
fn without_holes(materials: &[Material], files: &[TextureFile]) -> HashMap<PathBuf, String> {
    let in_patches: BTreeSet<u32> = materials.iter().filter_map(|material| Some(material.patches?.material)).collect();
    let mut found = HashMap::new();
    for (index, material) in (0..).zip(materials) {
        let path = |texture: Option<u32>| texture.map(|texture| &files[texture as usize].path);
        let Some(colors) = path(material.surface.color().and_then(|color| color.texture)) else { continue };
        let may_have_holes = !material.is_emissive() && !in_patches.contains(&index);
        if may_have_holes && path(material.opacity.texture) != Some(colors) {
            found.entry(colors.clone()).or_insert_with(|| material.name.clone());
        }
    }
    found
}

/// A texture of those; `None` where the file turns out not to be what is needed, and a warning says so.
fn decode_texture(
    file: &TextureFile,
    without_holes: &HashMap<PathBuf, String>,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Texture>, Error> {
    let TextureFile { path, holds, named_by, .. } = file;
    let warn = |message: String| Warning { place: Place::file(path), message };
    let texture = match holds {
        Holds::Colors => decode::texture(path, named_by, warnings).map(|(texture, has_alpha)| {
            if let Some(material) = without_holes.get(path).filter(|_| has_alpha) {
                warnings.push(warn(format!(
                    "its alpha makes no holes in the material `{material}`: `map_d`, or `opacity` in a scene file, does"
                )));
            }
            Some(texture)
        }),
        Holds::Opacities => decode::opacity(path, named_by, warnings).map(Some),
        Holds::Normals | Holds::Roughnesses | Holds::Metalness => decode::numbers(path, named_by, warnings).map(Some),
        Holds::Directions => {
            decode::numbers(path, named_by, warnings).map(|directions| Some(directions.of_doubled_angles()))
        }
        Holds::Bumps(height) => match decode::numbers(path, named_by, warnings) {
            Ok(texture) if texture.holds_normals() => Ok(Some(texture)),
            Ok(texture) => {
                warnings.push(warn(format!(
                    "it holds heights: white is taken to be {} texels above black (`-bm`)",
                    height.0
                )));
                Ok(Some(texture.normals_of_heights(height.0)))
            }
            Err(error) => {
                warnings.push(warn(format!("no bumps are made of it: {error}")));
                Ok(None)
            }
        },
    };
    texture.map_err(|error| error.named_by(Some(named_by)))
}

/// A texture needs coordinates to be looked up at; those faces, by their material and file, have none.
fn warn_of_missing_coordinates(scene: &Scene, without_uvs: BTreeSet<(u32, PathBuf)>, warnings: &mut Vec<Warning>) {
    for (index, file) in without_uvs {
        let material = &scene.materials[index as usize];
        let varies = match material.surface {
            Surface::Measured { brdf } if scene.brdfs[brdf as usize].is_spatial() => true,
            _ => material.textures().next().is_some(),
        };
        if varies {
            let message =
                format!("faces without texture coordinates, though their material `{}` has a texture", material.name);
            warnings.push(Warning { place: Place::file(file), message });
        }
    }
}

fn camera(table: &Table) -> Result<Camera, Error> {
    table.allow(&["eye", "target", "up", "fov", "lens_radius", "focus_distance"])?;
    let eye = table.require("eye")?.vector(LARGEST_COORDINATE)?;
    let target = table.require("target")?.vector(LARGEST_COORDINATE)?;
    let up = table.get("up").map(|value| value.vector(LARGEST_COORDINATE)).transpose()?.unwrap_or(Vec3::Y);
    let forward = (target - eye).as_dvec3();
    if forward.length() == 0.0 {
        return Err(table.require("target")?.error("a point other than the eye"));
    }
    if forward.normalize().cross(up.as_dvec3().normalize_or_zero()).length() < 1e-4 {
        let expected = "a vector that is neither zero nor along target − eye";
        return Err(table.get("up").map_or_else(|| table.error("no `up`", expected), |value| value.error(expected)));
    }
    let vertical_fov_degrees = table.get("fov").map_or(Ok(FOV_DEGREES), |value| value.number(0.01, 179.0))?;
    let positive = |value: Value| value.number(f32::MIN_POSITIVE, f32::MAX);
    let lens = match (table.get("lens_radius"), table.get("focus_distance")) {
        (None, None) => None,
        (None, Some(_)) => return Err(table.error("`focus_distance` without `lens_radius`", "both or none")),
        (Some(radius), focus) => Some(Lens {
            radius: positive(radius)?,
            focus_distance: focus.map_or(Ok(forward.length() as f32), positive)?,
        }),
    };
    Ok(Camera { eye, target, up, vertical_fov_degrees, lens })
}

fn film(table: &Table) -> Result<Film, Error> {
    table.allow(&["width", "height"])?;
    let side = |key: &str| table.require(key)?.integer(1, Film::LONGEST_SIDE);
    Ok(Film { width: side("width")?, height: side("height")? })
}

fn add_mesh(table: &Table, loader: &mut Loader, instances: &mut Vec<Instance>) -> Result<(), Error> {
    table.allow(&["file", "normals", "crease_angle", "transform", "instances"])?;
    let named = table.require("file")?;
    let path = beside(&named.place(), named.string()?, &mut loader.library.warnings);
    let crease = table.get("crease_angle").map(|value| value.number(0.0, 180.0)).transpose()?;
    let crease_degrees = crease.unwrap_or(obj::CREASE_DEGREES);
    let normals = match table.get("normals").map(|value| Ok((value.string()?, value))).transpose()? {
        None | Some(("auto", _)) => Normals::Auto { crease_degrees },
        Some(("smooth", _)) => Normals::Smooth { crease_degrees: crease.unwrap_or(180.0) },
        Some(("flat", _)) => Normals::Flat,
        Some((_, value)) => return Err(value.error("\"auto\", \"flat\" or \"smooth\"")),
    };
    let (mesh, origin) = loader.mesh(&path, Some(&named.place()), normals)?;
    let base = table.get("transform").map_or(Ok(Affine3A::IDENTITY), |value| transform(&value.table()?))?;
    let repeats = match table.get("instances") {
        None => vec![Affine3A::IDENTITY],
        Some(value) => value.array()?.iter().map(|item| transform(&item.table()?)).collect::<Result<_, _>>()?,
    };
    instances.extend(repeats.iter().map(|repeat| Instance { mesh, object_to_world: moved(origin, *repeat * base) }));
    Ok(())
}

/// A transform of a mesh that is told about another origin. In `f64`, as what moves a mesh from far away to the origin is a small difference.
fn moved(origin: Vec3, transform: Affine3A) -> Affine3A {
    let translation = transform.matrix3.as_dmat3() * origin.as_dvec3() + transform.translation.as_dvec3();
    Affine3A { translation: translation.as_vec3().into(), ..transform }
}

/// First scales, then turns, then moves; or all of it by a matrix.
fn transform(table: &Table) -> Result<Affine3A, Error> {
    table.allow(&["translate", "rotate", "axis", "angle", "scale", "matrix"])?;
    let transform = if let Some(value) = table.get("matrix") {
        if table.iter().count() > 1 {
            return Err(value.error("no other key beside the matrix"));
        }
        let rows = value.array()?;
        if rows.len() != 3 {
            return Err(value.error("an array of 3 rows of 4 numbers"));
        }
        let mut entries = [[0.0; 4]; 3];
        for (entry, row) in entries.iter_mut().zip(&rows) {
            *entry = row.numbers(-LARGEST_COORDINATE, LARGEST_COORDINATE)?;
        }
        let [x, y, z] = [0, 1, 2].map(|column| Vec3::from_array(entries.map(|row| row[column])));
        Affine3A::from_mat3_translation(Mat3::from_cols(x, y, z), Vec3::from_array(entries.map(|row| row[3])))
    } else {
        let translation = table.get("translate").map_or(Ok(Vec3::ZERO), |value| value.vector(LARGEST_COORDINATE))?;
        let scale =
            table.get("scale").map_or(Ok(Vec3::ONE), |value| value.color(-LARGEST_COORDINATE, LARGEST_COORDINATE))?;
        let rotation = match (table.get("rotate"), table.get("axis"), table.get("angle")) {
            (None, None, None) => Quat::IDENTITY,
            (Some(degrees), None, None) => {
                let [x, y, z] = degrees.vector(1e6)?.to_array().map(f32::to_radians);
                Quat::from_euler(EulerRot::ZYX, z, y, x)
            }
            (None, Some(axis), Some(angle)) => {
                let along = axis.vector(LARGEST_COORDINATE)?.try_normalize();
                let along = along.ok_or_else(|| axis.error("a vector with a direction"))?;
                Quat::from_axis_angle(along, angle.number(-1e6, 1e6)?.to_radians())
            }
            _ => return Err(table.error("a mixture of rotations", "either `rotate`, or `axis` with `angle`")),
        };
        Affine3A::from_scale_rotation_translation(scale, rotation, translation)
    };
    let determinant = transform.matrix3.determinant();
    if determinant.is_normal() && transform.inverse().is_finite() {
        Ok(transform)
    } else {
        Err(table.error(format!("a transform of determinant {determinant}"), "one that can be undone"))
    }
}

const MATERIAL_TYPES: &str =
    "\"diffuse\", \"conductor\", \"mirror\", \"dielectric\", \"coated\", \"measured\", \"layered\" or \"woven\"";

/// Changes the materials of a name as a table of the scene file says.
fn override_material(name: &str, value: &Value, library: &mut Library) -> Result<(), Error> {
    let table = value.table()?;
    let indices: Vec<usize> =
        (0..library.materials.len()).filter(|index| library.materials[*index].name == name).collect();
    if indices.is_empty() {
        let place = value.place();
        let nearest = nearest(name, library.materials.iter().map(|material| material.name.as_str()));
        let found = format!("the material `{name}`, which no mesh uses");
        return Err(Error::unexpected(place, found, format!("a material of the meshes, such as `{nearest}`")));
    }
    for index in indices {
        let before = library.materials[index].clone();
        let color = |color: &Value| color.color(0.0, BRIGHTEST);
        let mut map = |key: &str, holds: Holds| {
            let named = table.get(key);
            named.map(|value| texture(&value, holds, library)).transpose()
        };
        let normal_map = map(MAPS[1], Holds::Normals)?.or(before.normal_map);
        let glow = map("emission_texture", Holds::Colors)?;
        // A texture without a colour is multiplied by 1.
        let glows = glow.is_some() && !before.is_emissive();
        let emission_before = if glows { Vec3::ONE } else { before.emission };
        let surface = surface(&table, &before.surface, library)?;
        let roughness_map = roughness_map(&table, &surface, &before, library)?;
        let anisotropy_direction_map = match table.get(MAPS[2]) {
            Some(value) if !surface.takes_anisotropy_direction_map() => {
                return Err(value.error("no map of anisotropy but on a conductor, measured, layered or woven surface"));
            }
            Some(value) => Some(texture(&value, Holds::Directions, library)?),
            None => None,
        };
        let is_glass = |surface: &Surface| matches!(surface, Surface::Dielectric { .. });
        // The MTL file's `d` said that one sees through what is glass now.
        let becomes_glass = is_glass(&surface) && !is_glass(&before.surface);
        let opacity_before =
            Opacity { value: if becomes_glass { 1.0 } else { before.opacity.value }, ..before.opacity };
        library.materials[index] = Material {
            surface,
            roughness_map,
            anisotropy_direction_map,
            emission: table.get("emission").map_or(Ok(emission_before), |value| color(&value))?,
            emission_texture: glow.or(before.emission_texture),
            emits_both_sides: table
                .get("emits_both_sides")
                .map_or(Ok(before.emits_both_sides), |value| value.boolean())?,
            opacity: table.get("opacity").map_or(Ok(opacity_before), |value| opacity(&value, library))?,
            normal_map,
            name: before.name.clone(),
            patches: before.patches,
        };
        metal_map(&table, index, &before, library)?;
        let material = &library.materials[index];
        let has_both = material.is_emissive() && !material.opacity.is_whole();
        let named = ["opacity", "emission", "emission_texture"].iter().find_map(|key| table.get(key));
        if let Some(value) = named.filter(|_| has_both) {
            return Err(value.error("`opacity = 1` beside an emission"));
        }
        library.undefined.retain(|(undefined, _)| *undefined as usize != index);
    }
    Ok(())
}

/// The number of the texture that a value names: a file, or a table of a file and where it lies.
fn texture(value: &Value, holds: Holds, library: &mut Library) -> Result<u32, Error> {
    if let Ok(name) = value.string() {
        let path = beside(&value.place(), name, &mut library.warnings);
        return Ok(library.texture(path, holds, TexturePlacement::default(), &value.place()));
    }
    let table =
        value.table().map_err(|_| value.error("a file, or a table like { file = \"tiles.png\", scale = [4, 4] }"))?;
    table.allow(&["file", "scale", "offset"])?;
    let most = TexturePlacement::LARGEST;
    let numbers = |key: &str| table.get(key).map(|value| value.numbers(-most, most).map(Vec2::from_array)).transpose();
    let otherwise = TexturePlacement::default();
    let scale = numbers("scale")?.unwrap_or(otherwise.scale);
    let offset = numbers("offset")?.unwrap_or(otherwise.offset);
    let name = table.require("file")?;
    let path = beside(&name.place(), name.string()?, &mut library.warnings);
    Ok(library.texture(path, holds, TexturePlacement { scale, offset }, &name.place()))
}

/// The map of roughness of a material whose surface a table has changed. A roughness of the table counts for more than a map of the MTL
/// file, and so does another kind of surface.
fn roughness_map(
    table: &Table,
    surface: &Surface,
    before: &Material,
    library: &mut Library,
) -> Result<Option<u32>, Error> {
    let is_mirror = table.get("type").map(|value| value.string()).transpose()? == Some("mirror");
    let takes_map = surface.takes_roughness_map() && !is_mirror;
    let has_roughness = table.has("roughness") || table.has("alpha");
    let Some(value) = table.get(MAPS[0]) else {
        let keeps = takes_map && !has_roughness && discriminant(surface) == discriminant(&before.surface);
        return Ok(before.roughness_map.filter(|_| keeps));
    };
    if !takes_map {
        return Err(value.error("no map of roughness but on a conductor, dielectric or coated surface"));
    }
    if has_roughness {
        return Err(value.error("either a roughness, or a map of it"));
    }
    texture(&value, Holds::Roughnesses, library).map(Some)
}

/// The metal that a material is where a map says so, of the colour and the roughness that a table leaves it with.
fn metal_map(table: &Table, index: usize, before: &Material, library: &mut Library) -> Result<(), Error> {
    let value = table.get("metal_map");
    let map = value.as_ref().map(|value| texture(value, Holds::Metalness, library)).transpose()?;
    let material = library.materials[index].clone();
    let Some(map) = map.or(material.patches.map(|patches| patches.map)) else { return Ok(()) };
    let keeps_surface = material.surface == before.surface && material.roughness_map == before.roughness_map;
    let metal_before = before.patches.filter(|_| keeps_surface);
    let metal_before = metal_before.map(|patches| library.materials[patches.material as usize].clone());
    let (alpha, roughness_map) = match (&material.surface, metal_before) {
        (_, Some(Material { surface: Surface::Conductor { alpha, .. }, roughness_map, .. })) => {
            (Some(alpha), roughness_map)
        }
        (Surface::Coated { alpha, .. }, _) => (Some(Vec2::splat(*alpha)), material.roughness_map),
        _ => (None, None),
    };
    match (alpha.and_then(|alpha| metal_of(&material, alpha, roughness_map)), value) {
        (Some(metal), _) => library.set_metal(index as u32, map, metal),
        (None, Some(value)) => return Err(value.error("no map of metal but on a coated surface that does not emit")),
        (None, None) => library.materials[index].patches = None,
    }
    Ok(())
}

/// Keys of all surfaces that stand in a scene.
pub(super) const OF_A_SCENE: [&str; 5] = ["emission", "emission_texture", "emits_both_sides", "opacity", "metal_map"];
/// Keys of maps, in scenes and in what `neubrdf train` learns: [`super::SurfaceMaps`].
pub(super) const MAPS: [&str; 3] = ["roughness_map", "normal_map", "anisotropy_direction_map"];
/// What is expected where such a key stands elsewhere.
pub(super) const MAPS_ARE_LEARNED: &str =
    "a .neubrdf that was trained on the map: `neubrdf train` makes one of a file of this material alone";

/// The surface that a material's table asks for. What it does not say stays as it was before, if that was of the same
/// type, or is the type's default.
pub(super) fn surface(table: &Table, before: &Surface, library: &mut Library) -> Result<Surface, Error> {
    let allow = |keys: &[&str]| table.allow(&[&["type"], &OF_A_SCENE[..], &MAPS, keys].concat());
    let unchanged = match before {
        Surface::Diffuse { .. } => "diffuse",
        Surface::Conductor { .. } => "conductor",
        Surface::Dielectric { .. } => "dielectric",
        Surface::Coated { .. } => "coated",
        Surface::Measured { .. } => "measured",
        Surface::Layered(_) => "layered",
        Surface::Woven(_) => "woven",
    };
    let kind = table.get("type").map_or(Ok(unchanged), |value| value.string())?;
    let smooth_or = |alpha: Option<f32>| alpha.unwrap_or(0.0);
    match kind {
        "diffuse" => {
            allow(&["albedo", "texture"])?;
            let before = match before {
                Surface::Diffuse { albedo } | Surface::Coated { albedo, .. } => Some(*albedo),
                _ => None,
            };
            Ok(Surface::Diffuse { albedo: color(table, "albedo", before, library)? })
        }
        "conductor" => {
            allow(&["metal", "f0", "eta", "k", "texture", "roughness", "alpha"])?;
            let (fresnel_before, alpha_before) = match before {
                Surface::Conductor { fresnel, alpha } => (Some(*fresnel), Some(*alpha)),
                _ => (None, None),
            };
            let alpha = alpha(table)?.or(alpha_before).unwrap_or(Vec2::ZERO);
            Ok(Surface::Conductor { fresnel: fresnel(table, fresnel_before, library)?, alpha })
        }
        "mirror" => {
            allow(&["f0"])?;
            let f0 = table.get("f0").map_or(Ok(Vec3::ONE), |value| value.color(0.0, 1.0))?;
            let fresnel = Fresnel::Schlick { f0: Color::constant(f0) };
            Ok(Surface::Conductor { fresnel, alpha: Vec2::ZERO })
        }
        "dielectric" => {
            allow(&["ior", "roughness", "alpha"])?;
            let (ior_before, alpha_before) = match before {
                Surface::Dielectric { ior, alpha } => (Some(*ior), Some(*alpha)),
                _ => (None, None),
            };
            let alpha = smooth_or(isotropic_alpha(table)?.or(alpha_before));
            Ok(Surface::Dielectric { ior: ior(table, ior_before, 0.1)?, alpha })
        }
        "coated" => {
            allow(&["albedo", "texture", "ior", "roughness", "alpha"])?;
            let (albedo_before, ior_before, alpha_before) = match before {
                Surface::Coated { albedo, ior, alpha } => (Some(*albedo), Some(*ior), Some(*alpha)),
                Surface::Diffuse { albedo } => (Some(*albedo), None, None),
                _ => (None, None, None),
            };
            let alpha = smooth_or(isotropic_alpha(table)?.or(alpha_before));
            let albedo = color(table, "albedo", albedo_before, library)?;
            Ok(Surface::Coated { albedo, ior: ior(table, ior_before, 1.0)?, alpha })
        }
        "measured" => {
            allow(&["file", "name"])?;
            let named = table.require("file")?;
            let name = table.get("name").map(|name| name.string()).transpose()?;
            let path = beside(&named.place(), named.string()?, &mut library.warnings);
            Ok(Surface::Measured { brdf: library.brdf(path, name, &named.place())? })
        }
        "layered" => {
            allow(&["ior", "roughness", "alpha", "absorption", "base"])?;
            Ok(Surface::Layered(layered(table, library)?))
        }
        "woven" => {
            allow(&["warp", "weft"])?;
            Ok(Surface::Woven(Woven::read(table)?))
        }
        _ => Err(table.require("type")?.error(MATERIAL_TYPES)),
    }
}

/// The layers of a table.
fn layered(table: &Table, library: &mut Library) -> Result<Layered, Error> {
    let base_table = table.require("base")?.table()?;
    base_table.allow(&["type", "albedo", "metal", "f0", "eta", "k", "roughness", "alpha"])?;
    let rough_enough = |table: &Table, alpha: f32| {
        let expected = format!("at least {}", Layered::LEAST_ALPHA);
        if alpha >= Layered::LEAST_ALPHA { Ok(()) } else { Err(table.error(format!("an α of {alpha}"), expected)) }
    };
    let grey = Surface::Diffuse { albedo: Color::constant(Vec3::splat(0.5)) };
    let base = match surface(&base_table, &grey, library)? {
        Surface::Diffuse { albedo } => LayerBase::Diffuse { albedo: albedo.value },
        Surface::Conductor { fresnel, alpha } => {
            rough_enough(&base_table, alpha.min_element())?;
            LayerBase::Conductor { fresnel, alpha }
        }
        _ => return Err(base_table.require("type")?.error("\"diffuse\" or \"conductor\"")),
    };
    let alpha = isotropic_alpha(table)?.unwrap_or(0.1);
    rough_enough(table, alpha)?;
    let [least, most] = Layered::IOR;
    Ok(Layered {
        ior: table.get("ior").map_or(Ok(1.5), |value| value.number(least, most))?,
        alpha,
        absorption: table.get("absorption").map_or(Ok(Vec3::ZERO), |value| value.color(0.0, 100.0))?,
        base,
    })
}

/// A number, or a texture of them.
fn opacity(value: &Value, library: &mut Library) -> Result<Opacity, Error> {
    if value.string().is_ok() || value.table().is_ok() {
        return Ok(Opacity { value: 1.0, texture: Some(texture(value, Holds::Opacities, library)?) });
    }
    Ok(Opacity { value: value.number(0.0, 1.0)?, texture: None })
}

/// A colour and the texture that multiplies it. A texture without a colour is multiplied by 1.
fn color(table: &Table, key: &str, before: Option<Color>, library: &mut Library) -> Result<Color, Error> {
    let value = table.get(key).map(|value| value.color(0.0, 1.0)).transpose()?;
    match table.get("texture") {
        Some(texture) => Ok(Color {
            value: value.unwrap_or(Vec3::ONE),
            texture: Some(self::texture(&texture, Holds::Colors, library)?),
        }),
        None => match value {
            Some(value) => Ok(Color::constant(value)),
            None => Ok(before.unwrap_or(Color::constant(Vec3::splat(0.5)))),
        },
    }
}

fn fresnel(table: &Table, before: Option<Fresnel>, library: &mut Library) -> Result<Fresnel, Error> {
    let has_f0 = table.has("f0") || table.has("texture");
    match (table.get("metal"), has_f0, table.get("eta"), table.get("k")) {
        (Some(name), false, None, None) => metals::metal(name.string()?).ok_or_else(|| {
            let names: Vec<&str> = metals::names().collect();
            name.error(format!("one of the metals {}", names.join(", ")))
        }),
        (None, true, None, None) => Ok(Fresnel::Schlick { f0: color(table, "f0", None, library)? }),
        (None, false, Some(eta), Some(k)) => {
            Ok(Fresnel::Complex { eta: eta.color(0.001, 100.0)?, kappa: k.color(0.0, 100.0)? })
        }
        (None, false, None, None) => {
            before.ok_or_else(|| table.error("no reflectance", "one of `metal`, `f0`, or `eta` with `k`"))
        }
        _ => Err(table.error("several reflectances", "one of `metal`, `f0`, or `eta` with `k`")),
    }
}

/// GGX's α along u and v, from `alpha` or as the square of `roughness`.
fn alpha(table: &Table) -> Result<Option<Vec2>, Error> {
    let pair = |value: &Value| {
        if value.is_array() {
            value.numbers(0.0, 1.0).map(Vec2::from_array)
        } else {
            value.number(0.0, 1.0).map(Vec2::splat)
        }
    };
    match (table.get("alpha"), table.get("roughness")) {
        (None, None) => Ok(None),
        (Some(alpha), None) => pair(&alpha).map(Some),
        (None, Some(roughness)) => pair(&roughness).map(|roughness| Some(roughness * roughness)),
        (Some(_), Some(_)) => Err(table.error("both `alpha` and `roughness`", "one of them")),
    }
}

fn isotropic_alpha(table: &Table) -> Result<Option<f32>, Error> {
    match alpha(table)? {
        Some(alpha) if alpha.x != alpha.y => Err(table.error("an anisotropic roughness", "one number for this type")),
        alpha => Ok(alpha.map(|alpha| alpha.x)),
    }
}

fn ior(table: &Table, before: Option<f32>, least: f32) -> Result<f32, Error> {
    table.get("ior").map_or(Ok(before.unwrap_or(1.5)), |value| value.number(least, 10.0))
}

fn environment(table: &Table, loader: &mut Loader) -> Result<Environment, Error> {
    table.allow(&["file", "radiance", "scale", "rotate"])?;
    let scale = table.get("scale").map_or(Ok(Vec3::ONE), |value| value.color(0.0, BRIGHTEST))?;
    let rotation = table.get("rotate").map_or(Ok(0.0), |value| value.number(-1e6, 1e6))?;
    let environment = match (table.get("file"), table.get("radiance")) {
        (Some(name), None) => {
            let warnings = &mut loader.library.warnings;
            let (path, place) = (beside(&name.place(), name.string()?, warnings), name.place());
            let sky = decode::environment(&path, &place, scale, warnings);
            loader.library.files.insert(path);
            sky.map_err(|error| error.named_by(Some(&place)))?
        }
        (None, Some(radiance)) => Environment::constant(radiance.color(0.0, BRIGHTEST)? * scale),
        _ => return Err(table.error("not just one of `file` and `radiance`", "exactly one of them")),
    };
    Ok(Environment { rotation_degrees: rotation, ..environment })
}

fn sun(table: &Table) -> Result<Sun, Error> {
    table.allow(&["direction", "irradiance"])?;
    let towards = table.require("direction")?;
    let direction = towards.vector(LARGEST_COORDINATE)?.as_dvec3().try_normalize();
    let direction = direction.ok_or_else(|| towards.error("a vector towards the sun"))?.as_vec3();
    Ok(Sun { direction, irradiance: table.require("irradiance")?.color(0.0, BRIGHTEST)? })
}
