//! Wavefront MTL files, through `tobj`, and what their statements amount to here.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::error::{Error, Place, Warning, open, quote};
use super::light::BRIGHTEST;
use super::named_file::{beside, there, uncommented};
use super::statements::{Fault, Statements, number};
use super::{Brdf, Color, Fresnel, Material, Opacity, Patches, Surface, TexturePlacement};

/// The materials and texture files of a scene, gathered from its OBJ and MTL files.
#[derive(Default)]
pub(super) struct Library {
    pub materials: Vec<Material>,
    /// Texture files; [`Color::texture`] and [`Opacity::texture`] index these until they are decoded.
    pub textures: Vec<TextureFile>,
    /// BRDFs; [`Surface::Measured`] indexes these.
    pub brdfs: Vec<Arc<Brdf>>,
    /// The file and the name that each of them was read by.
    brdf_files: Vec<(PathBuf, Option<String>)>,
    pub warnings: Vec<Warning>,
    /// Every file that was read or will be: of the scene's meshes, materials, textures, BRDFs and its sky.
    pub files: BTreeSet<PathBuf>,
    /// Materials that an OBJ file names and no MTL file defines: index, and the OBJ file.
    pub undefined: Vec<(u32, PathBuf)>,
    /// Materials of faces without texture coordinates: index, and the OBJ file.
    pub without_uvs: BTreeSet<(u32, PathBuf)>,
    /// What the MTL files of the OBJ file at hand define.
    definitions: HashMap<String, Definition>,
}

/// A file that materials name as a texture.
pub(super) struct TextureFile {
    pub path: PathBuf,
    pub holds: Holds,
    pub placement: TexturePlacement,
    /// What names it first.
    pub named_by: Place,
}

/// What the numbers of a texture are.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Holds {
    Colors,
    Opacities,
    Normals,
    Roughnesses,
    Directions,
    Metalness,
    /// Normals, as most that is called a bump map; or heights, and how far white is above black, in texels.
    Bumps(Height),
}

/// A number that is not NaN, so that it can be told from others.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Height(pub f32);

impl Eq for Height {}

/// A material of an MTL file.
#[derive(Clone)]
struct Definition {
    place: Place,
    material: tobj::Material,
}

/// A material for faces that name none or an undefined one.
fn default_material(name: &str) -> Material {
    Material::new(name, Surface::Diffuse { albedo: Color::constant(Vec3::splat(0.5)) })
}

impl Library {
    pub fn warn(&mut self, place: Place, message: impl Into<String>) {
        self.warnings.push(Warning { place, message: message.into() });
    }

    /// Reads the MTL files that an OBJ file names, on the given lines. They define what [`Library::material`] returns
    /// until the next call.
    pub fn read_material_files(&mut self, obj: &Path, names: &[(usize, String)]) -> Result<(), Error> {
        self.definitions.clear();
        // Some programs repeat them for each object.
        let mut known = HashSet::new();
        for (line, names) in names.iter().filter(|(_, names)| known.insert(names)) {
            let place = Place::line(obj, *line);
            // A statement may name several files, or one file with spaces in its name.
            let files = match there(&place, names, &mut self.warnings) {
                Some(whole) => vec![whole],
                None => {
                    let names = uncommented(names).split_whitespace();
                    names.map(|name| beside(&place, name, &mut self.warnings)).collect()
                }
            };
            for file in files {
                self.read_material_file(&file, &place)?;
            }
        }
        Ok(())
    }

    fn read_material_file(&mut self, path: &Path, named_by: &Place) -> Result<(), Error> {
        let file = match open(path, Some(named_by)) {
            Ok(file) => file,
            Err(Error::Read { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                let message = format!("there is no {}: its materials are grey and diffuse", path.display());
                self.warn(named_by.clone(), message);
                return Ok(());
            }
            Err(error) => return Err(error),
        };
        self.files.insert(path.to_owned());
        let mut lines = HashMap::new();
        let mut named = false;
        let check = |line: usize, statement: &str, out: &mut String| {
            let name = check(statement, named, out)?;
            named |= name.is_some();
            lines.extend(name.map(|name| (name, line)));
            Ok(())
        };
        let mut statements = Statements::new(path, Some(named_by), BufReader::new(file), check);
        let materials = match tobj::load_mtl_buf(&mut statements) {
            Ok((materials, _)) => materials,
            Err(error) => return Err(statements.into_error(error)),
        };
        let mut unused: BTreeMap<String, String> = BTreeMap::new();
        for material in materials {
            for statement in unused_statements(&material) {
                unused.entry(statement.to_owned()).or_insert_with(|| material.name.clone());
            }
            let place = Place { line: lines.get(&material.name).copied(), ..Place::file(path) };
            self.definitions.insert(material.name.clone(), Definition { place, material });
        }
        for (statement, material) in unused {
            let statement = statement.replace(OPTION, " ");
            let message = format!("`{statement}` is not supported and ignored (first in the material `{material}`)");
            self.warn(Place::file(path), message);
        }
        Ok(())
    }

    /// Adds the material of a name in an OBJ file. Returns its index.
    pub fn material(&mut self, obj: &Path, name: &str) -> u32 {
        let index = self.materials.len() as u32;
        let (material, metal) = match self.definitions.get(name).cloned() {
            Some(definition) => self.interpret(&definition),
            None => {
                self.undefined.push((index, obj.to_owned()));
                (default_material(name), None)
            }
        };
        self.materials.push(material);
        if let Some((map, metal)) = metal {
            self.set_metal(index, map, metal);
        }
        index
    }

    /// Lets a metal stand where a map of a material says so.
    pub fn set_metal(&mut self, index: u32, map: u32, metal: Material) {
        let next = self.materials.len() as u32;
        let patches = &mut self.materials[index as usize].patches;
        let material = patches.map_or(next, |patches| patches.material);
        *patches = Some(Patches { map, material });
        match self.materials.get_mut(material as usize) {
            Some(before) => *before = metal,
            None => self.materials.push(metal),
        }
    }

    /// Adds the material of faces that name none. Returns its index.
    pub fn nameless_material(&mut self) -> u32 {
        self.materials.push(default_material("default"));
        self.materials.len() as u32 - 1
    }

    /// The number of a texture file that lies so.
    pub fn texture(&mut self, path: PathBuf, holds: Holds, placement: TexturePlacement, named_by: &Place) -> u32 {
        let is_it = |known: &TextureFile| known.path == path && known.holds == holds && known.placement == placement;
        let index = self.textures.iter().position(is_it);
        index.unwrap_or_else(|| {
            self.files.insert(path.clone());
            self.textures.push(TextureFile { path, holds, placement, named_by: named_by.clone() });
            self.textures.len() - 1
        }) as u32
    }

    /// The index of the BRDF in a file, which is read once.
    pub fn brdf(&mut self, path: PathBuf, name: Option<&str>, named_by: &Place) -> Result<u32, Error> {
        let key = (path, name.map(str::to_owned));
        if let Some(index) = self.brdf_files.iter().position(|known| *known == key) {
            return Ok(index as u32);
        }
        let brdf = Brdf::load_for(&key.0, name, Some(named_by)).map_err(|error| error.named_by(Some(named_by)))?;
        self.brdfs.push(Arc::new(brdf));
        self.files.insert(key.0.clone());
        self.brdf_files.push(key);
        Ok(self.brdfs.len() as u32 - 1)
    }

    /// What an MTL material amounts to; docs/scenes.md has the table. And where a map says that it is a metal, that map and the metal.
    fn interpret(&mut self, Definition { place, material }: &Definition) -> (Material, Option<(u32, Material)>) {
        let place = &Place { field: Some(format!("material `{}`", material.name)), ..place.clone() };
        let named = material;
        let material = &self.without_missing_maps(place, named);
        let specular = self.reflectance(place, "Ks", material.specular.unwrap_or_default());
        let mut albedo = Color::constant(Vec3::ONE);
        if let Some(name) = &material.diffuse_texture {
            albedo.texture = Some(self.map(place, material, "map_Kd", name, Holds::Colors));
        }
        let diffuse = material.diffuse.map(|diffuse| self.reflectance(place, "Kd", diffuse));
        albedo.value = match albedo.texture {
            Some(_) => self.factor(place, "Kd", diffuse),
            None => diffuse.unwrap_or(Vec3::splat(0.5)),
        };
        let parameter = |name: &str| material.unknown_param.get(name).and_then(|text| text.parse::<f32>().ok());
        let mut share = |name: &str| parameter(name).map(|value| self.clamped(place, name, value, [0.0, 1.0]));
        let [roughness, metallic, anisotropy] = ["Pr", "Pm", "aniso"].map(&mut share);
        // Blinn's exponent and GGX's α of lobes of the same width (Walter et al. 2007).
        let alpha_of_shininess = |shininess: f32| (2.0 / (shininess.max(0.0) + 2.0)).sqrt();
        let alpha_or = |otherwise: f32| match (roughness, material.shininess) {
            (Some(roughness), _) => roughness * roughness,
            (None, Some(shininess)) => alpha_of_shininess(shininess),
            (None, None) => otherwise,
        };
        // The anisotropy of Burley 2012: α along u over α along v is 1 / (1 − 0.9·aniso).
        let aspect = (1.0 - 0.9 * anisotropy.unwrap_or(0.0)).sqrt();
        let stretch = |alpha: f32| Vec2::new((alpha / aspect).min(1.0), alpha * aspect);

        let illumination = material.illumination_model.unwrap_or(2);
        let metalness = material.unknown_param.get("map_Pm");
        let metallic = metallic.filter(|_| metalness.is_none()).unwrap_or(0.0);
        let no_base = albedo.value == Vec3::ZERO;
        let surface = if self.is_glass(place, named, illumination) {
            let ior = self.index(place, material.optical_density.unwrap_or(1.5));
            Surface::Dielectric { ior, alpha: roughness.map_or(0.0, |roughness| roughness * roughness) }
        } else if metallic >= 0.5 {
            Surface::Conductor { fresnel: Fresnel::Schlick { f0: albedo }, alpha: stretch(alpha_or(0.0)) }
        } else if no_base && specular != Vec3::ZERO {
            let fresnel = Fresnel::Schlick { f0: Color::constant(specular) };
            let alpha = if illumination == 5 { 0.0 } else { alpha_or(0.0) };
            Surface::Conductor { fresnel, alpha: stretch(alpha) }
        } else if illumination >= 2 && specular != Vec3::ZERO {
            Surface::Coated { albedo, ior: self.index_of_coat(place, material), alpha: alpha_or(0.0) }
        } else {
            Surface::Diffuse { albedo }
        };
        if 0.0 < metallic && metallic < 1.0 {
            self.warn(place.clone(), format!("Pm {metallic} is taken as {}", metallic.round()));
        }
        let glow = material.unknown_param.get("map_Ke");
        let emission = material.emissive.map(Vec3::from_array);
        let emission = match glow {
            Some(_) => self.factor(place, "Ke", emission),
            None => emission.unwrap_or_default(),
        };
        let emission_texture = glow.map(|name| self.map(place, material, "map_Ke", name, Holds::Colors));
        let opacity = self.opacity(place, material, matches!(surface, Surface::Dielectric { .. }));
        let is_whole = opacity.is_whole() || emission == Vec3::ZERO;
        if !is_whole {
            self.warn(place.clone(), "`d` and `map_d` are ignored, as it emits");
        }
        let opacity = if is_whole { opacity } else { Opacity::WHOLE };
        let normals = material.unknown_param.get("norm").map(|name| ("norm", name, Holds::Normals));
        let height = Height(parameter(BUMP_HEIGHT).unwrap_or(1.0));
        let bumps = material.normal_texture.as_ref().map(|name| ("bump", name, Holds::Bumps(height)));
        let normal_map =
            normals.or(bumps).map(|(statement, name, holds)| self.map(place, material, statement, name, holds));
        let may_be_rough = surface.takes_roughness_map() || metalness.is_some();
        let roughnesses = material.unknown_param.get("map_Pr").filter(|_| may_be_rough);
        let any_roughness_map = roughnesses.map(|name| self.map(place, material, "map_Pr", name, Holds::Roughnesses));
        let roughness_map = any_roughness_map.filter(|_| surface.takes_roughness_map());
        let plain = Material::new(material.name.clone(), surface);
        let whole = Material { emission, emission_texture, opacity, normal_map, roughness_map, ..plain };
        let metal = metalness.and_then(|name| {
            let Some(metal) = metal_of(&whole, stretch(alpha_or(0.0)), any_roughness_map) else {
                self.warn(place.clone(), "`map_Pm` is ignored, as it emits, is glass, or is a metal all over");
                return None;
            };
            Some((self.map(place, material, "map_Pm", name, Holds::Metalness), metal))
        });
        (whole, metal)
    }

    /// A material without the maps whose files are not there, as of a model that came without them; what else it says counts.
    fn without_missing_maps(&mut self, place: &Place, material: &tobj::Material) -> tobj::Material {
        let mut material = material.clone();
        // Exporters write black where a texture stands instead of a colour.
        let is_black = material.diffuse == Some([0.0; 3]);
        let of_color = if is_black { ", and 0.5 taken for the `Kd 0` beside it" } else { ", and `Kd` counts alone" };
        let mut is_missing = |statement: &str, name: &str| {
            let file = file_of_map(place, name, &mut Vec::new());
            let is_missing = matches!(file.try_exists(), Ok(false));
            if is_missing {
                let instead = if statement == "map_Kd" { of_color } else { "" };
                self.warn(place.clone(), format!("there is no {}: `{statement}` is ignored{instead}", file.display()));
            }
            is_missing
        };
        if material.diffuse_texture.take_if(|name| is_missing("map_Kd", name)).is_some() && is_black {
            material.diffuse = None;
        }
        material.dissolve_texture.take_if(|name| is_missing("map_d", name));
        material.normal_texture.take_if(|name| is_missing("bump", name));
        for statement in ["map_Ke", "norm", "map_Pr", "map_Pm"] {
            if material.unknown_param.get(statement).is_some_and(|name| is_missing(statement, name)) {
                material.unknown_param.remove(statement);
            }
        }
        material
    }

    /// The number of the texture that a statement names, placed as its options say.
    fn map(&mut self, place: &Place, material: &tobj::Material, statement: &str, name: &str, holds: Holds) -> u32 {
        let placed = material.unknown_param.get(&placed(statement)).and_then(|text| placement_of(text));
        let path = file_of_map(place, name, &mut self.warnings);
        self.texture(path, holds, placed.unwrap_or_default(), place)
    }

    /// What `d` and `map_d` say. Of glass `d` says that one sees through, not that it is not there.
    fn opacity(&mut self, place: &Place, material: &tobj::Material, is_glass: bool) -> Opacity {
        let dissolve = material.dissolve.filter(|_| !is_glass).unwrap_or(1.0);
        let value = self.clamped(place, "d", dissolve, [0.0, 1.0]);
        if value == 0.0 {
            self.warn(place.clone(), "with `d 0` it cannot be seen");
        }
        let name = material.dissolve_texture.as_ref();
        Opacity { value, texture: name.map(|name| self.map(place, material, "map_d", name, Holds::Opacities)) }
    }

    fn reflectance(&mut self, place: &Place, statement: &str, rgb: [f32; 3]) -> Vec3 {
        let color = Vec3::from_array(rgb);
        let clamped = color.clamp(Vec3::ZERO, Vec3::ONE);
        if color != clamped {
            self.warn(place.clone(), format!("{statement} {color} reflects more than it gets: clamped to {clamped}"));
        }
        clamped
    }

    /// The colour that multiplies a texture: 1 unless given. Exporters write black where the texture stands instead of a colour.
    fn factor(&mut self, place: &Place, statement: &str, color: Option<Vec3>) -> Vec3 {
        if color == Some(Vec3::ZERO) {
            self.warn(place.clone(), format!("{statement} 0 would make `map_{statement}` black: taken as 1"));
        }
        color.filter(|color| *color != Vec3::ZERO).unwrap_or(Vec3::ONE)
    }

    /// Whether a material of that `illum` is glass. Maya writes 4 of all that is matte, Blender 6 and 9 of all that is not opaque.
    fn is_glass(&mut self, place: &Place, material: &tobj::Material, illumination: u8) -> bool {
        let reason = match (illumination, material) {
            (4 | 6 | 9, tobj::Material { diffuse_texture: Some(_), .. }) => "it has `map_Kd`",
            (4, tobj::Material { optical_density: Some(1.0), .. }) => "`Ni 1` refracts nothing",
            _ => return matches!(illumination, 4 | 6 | 7 | 9),
        };
        self.warn(place.clone(), format!("`illum {illumination}` does not make it glass, as {reason}"));
        false
    }

    fn index(&mut self, place: &Place, ior: f32) -> f32 {
        self.clamped(place, "Ni", ior, [0.1, 10.0])
    }

    fn clamped(&mut self, place: &Place, statement: &str, value: f32, [least, most]: [f32; 2]) -> f32 {
        let clamped = value.clamp(least, most);
        if value != clamped {
            let message = format!("{statement} {value} is outside of [{least}, {most}]: clamped to {clamped}");
            self.warn(place.clone(), message);
        }
        clamped
    }

    /// The index of refraction of a coat: more than 1, as it would not reflect otherwise.
    fn index_of_coat(&mut self, place: &Place, material: &tobj::Material) -> f32 {
        let ior = material.optical_density.unwrap_or(1.5);
        if ior > 1.0 {
            return self.index(place, ior);
        }
        self.warn(place.clone(), format!("a coat of Ni {ior} would reflect nothing: taken as 1.5"));
        1.5
    }
}

/// The file that a statement names, which a comment may follow.
fn file_of_map(place: &Place, name: &str, warnings: &mut Vec<Warning>) -> PathBuf {
    there(place, name, warnings).unwrap_or_else(|| beside(place, uncommented(name), warnings))
}

/// The metal of a matte or coated material's colour; none of others, and of those that emit.
pub(super) fn metal_of(material: &Material, alpha: Vec2, roughness_map: Option<u32>) -> Option<Material> {
    let (Surface::Diffuse { albedo } | Surface::Coated { albedo, .. }) = material.surface else { return None };
    let surface = Surface::Conductor { fresnel: Fresnel::Schlick { f0: albedo }, alpha };
    let name = format!("{} (metal)", material.name);
    let metal = Material { normal_map: material.normal_map, roughness_map, ..Material::new(name, surface) };
    (!material.is_emissive()).then_some(metal)
}

/// Statements of a material that have no effect here, though they might be missed.
fn unused_statements(material: &tobj::Material) -> Vec<&str> {
    let tobj::Material { specular_texture, shininess_texture, .. } = material;
    let maps = [(specular_texture, "map_Ks"), (shininess_texture, "map_Ns")];
    let maps = maps.into_iter().filter(|(texture, _)| texture.is_some()).map(|(_, statement)| statement);
    let others = material
        .unknown_param
        .keys()
        .map(String::as_str)
        .filter(|name| !["map_Ke", "Pr", "map_Pr", "Pm", "map_Pm", "aniso", "norm", BUMP_HEIGHT].contains(name))
        .filter(|name| !name.ends_with(PLACED));
    maps.chain(others).collect()
}

/// Checks an MTL statement and appends to `out` what `tobj` shall see of it. Returns the name of a new material.
fn check(statement: &str, named: bool, out: &mut String) -> Result<Option<String>, Fault> {
    let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
    let rest = rest.trim();
    if !keyword.chars().all(|c| c.is_ascii_alphanumeric() || "_-.:".contains(c)) {
        return Err(Fault::new(quote(keyword), "an MTL statement"));
    }
    if !named && keyword != "newmtl" {
        return Err(Fault::new(format!("{} before any material", quote(keyword)), "`newmtl` first"));
    }
    let mut words = rest.split_whitespace();
    match keyword {
        "newmtl" => {
            if rest.is_empty() {
                return Err(Fault::new("no name", "the name of the material"));
            }
            out.push_str(&format!("newmtl {rest}\n"));
            return Ok(Some(rest.to_owned()));
        }
        // Ambient light and transmission filters do not exist here.
        "Ka" | "Tf" | "Tr" | "sharpness" => {}
        "Kd" | "Ks" | "Ke" => {
            let red = non_negative(&mut words)?;
            let [green, blue] = match words.next() {
                None => [red, red],
                Some(green) => [non_negative(&mut [green].into_iter())?, non_negative(&mut words)?],
            };
            if red.max(green).max(blue) > BRIGHTEST {
                return Err(Fault::new(quote(rest), format!("numbers of at most {BRIGHTEST:e}")));
            }
            out.push_str(&format!("{keyword} {red} {green} {blue}\n"));
        }
        "Ns" | "Ni" | "Pr" | "Pm" | "aniso" => {
            let value = non_negative(&mut words)?;
            out.push_str(&format!("{keyword} {value}\n"));
        }
        "d" => {
            let value = number(&mut words.filter(|word| *word != "-halo"))?;
            out.push_str(&format!("d {value}\n"));
        }
        "illum" => {
            let model = words.next().and_then(|word| word.parse::<u8>().ok()).filter(|model| *model <= 10);
            let model = model.ok_or_else(|| Fault::new(quote(rest), "an illumination model from 0 to 10"))?;
            out.push_str(&format!("illum {model}\n"));
        }
        "map_Ka" => {}
        _ if keyword.starts_with("map_") || ["bump", "norm"].contains(&keyword) => {
            let (options, file) = split_options(rest);
            if file.is_empty() {
                return Err(Fault::new("no file", "the file of a texture"));
            }
            out.push_str(&format!("{keyword} {file}\n"));
            let is_bump = ["bump", "map_Bump", "map_bump"].contains(&keyword);
            let statement = if is_bump { "bump" } else { keyword };
            if !["map_Kd", "map_Ke", "map_d", "map_Pr", "map_Pm", "bump", "norm"].contains(&statement) {
                return Ok(None);
            }
            let mut placement = TexturePlacement::default();
            for (option, arguments) in options {
                let numbers = || arguments.iter().map_while(|word| word.parse::<f32>().ok());
                match option {
                    "-s" => placement.scale = pair(numbers(), 1.0)?,
                    "-o" => placement.offset = pair(numbers(), 0.0)?,
                    "-bm" if is_bump => {
                        let height = numbers().next().filter(|height| height.is_finite()).unwrap_or(1.0);
                        out.push_str(&format!("{BUMP_HEIGHT} {}\n", height.clamp(-1e3, 1e3)));
                    }
                    _ => out.push_str(&format!("{keyword}{OPTION}{option} 1\n")),
                }
            }
            let TexturePlacement { scale, offset } = placement;
            out.push_str(&format!("{} {} {} {} {}\n", placed(statement), scale.x, scale.y, offset.x, offset.y));
        }
        "v" | "vt" | "vn" | "f" | "usemtl" | "mtllib" => {
            return Err(Fault::new("a statement of an OBJ file", "an MTL statement"));
        }
        _ => out.push_str(&format!("{keyword} {rest}\n")),
    }
    Ok(None)
}

fn non_negative<'a>(words: &mut impl Iterator<Item = &'a str>) -> Result<f32, Fault> {
    let value = number(words)?;
    if value >= 0.0 { Ok(value) } else { Err(Fault::new(value.to_string(), "a number of at least 0")) }
}

/// How far white is above black in a bump map, as `tobj` is shown it.
const BUMP_HEIGHT: &str = "bump@height";

/// What stands between a statement and an option of it that has no effect, as `tobj` is shown them.
const OPTION: &str = "@";

/// What a statement that tells where a texture lies, as `tobj` is shown it, ends with. No statement of a file has such a character.
const PLACED: &str = "@placed";

fn placed(statement: &str) -> String {
    format!("{statement}{PLACED}")
}

fn placement_of(text: &str) -> Option<TexturePlacement> {
    let numbers: Vec<f32> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let [scale_u, scale_v, offset_u, offset_v] = numbers.try_into().ok()?;
    Some(TexturePlacement { scale: Vec2::new(scale_u, scale_v), offset: Vec2::new(offset_u, offset_v) })
}

/// The first two numbers of an option of one to three; what is not there is `otherwise`.
fn pair(mut numbers: impl Iterator<Item = f32>, otherwise: f32) -> Result<Vec2, Fault> {
    let pair = Vec2::new(numbers.next().unwrap_or(otherwise), numbers.next().unwrap_or(otherwise));
    match pair.abs().max_element() <= TexturePlacement::LARGEST && !pair.is_nan() {
        true => Ok(pair),
        false => Err(Fault::new(pair.to_string(), format!("numbers of at most {:e}", TexturePlacement::LARGEST))),
    }
}

/// Splits `-s 1 1 1 -clamp on name.png` into the options with their arguments and the file's name, which may hold spaces.
fn split_options(text: &str) -> (Vec<(&str, Vec<&str>)>, &str) {
    let mut options = Vec::new();
    let mut rest = text.trim();
    while rest.starts_with('-') {
        let (option, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        rest = after.trim_start();
        // Channels and mapping types are words.
        let takes_word = ["-imfchan", "-type"].contains(&option);
        let mut arguments = Vec::new();
        while let Some((word, after)) = rest.split_once(char::is_whitespace) {
            let is_argument = word.parse::<f32>().is_ok() || ["on", "off"].contains(&word);
            if !(is_argument || takes_word && arguments.is_empty()) {
                break;
            }
            arguments.push(word);
            rest = after.trim_start();
        }
        options.push((option, arguments));
    }
    (options, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_options_are_told_from_the_file() {
        for (text, options, file) in [
            ("my file.png", vec![], "my file.png"),
            ("-s 2 2 1 -clamp on a.png", vec![("-s", vec!["2", "2", "1"]), ("-clamp", vec!["on"])], "a.png"),
            ("-imfchan r b.png", vec![("-imfchan", vec!["r"])], "b.png"),
            ("-s", vec![("-s", vec![])], ""),
        ] {
            assert_eq!(split_options(text), (options, file));
        }
    }
}
