//! Surfaces whose parameters textures give: what a NeuBRDF that varies is trained on, and scenes do not render as they are.

use std::path::Path;

use super::error::{Error, Warning};
use super::file::{MAPS, OF_A_SCENE, surface};
use super::mtl::Library;
use super::named_file::beside;
use super::surface_file::{LONGEST_FILE, grey};
use super::table::{Source, Table, Value, read_text};
use super::{Surface, Texture, decode};

/// A diffuse, metallic or coated surface and maps of it, at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMaps {
    /// What the maps do not say.
    pub surface: Surface,
    /// Multiplies its colour.
    pub color: Option<Texture>,
    /// The roughness along u (red) and v (green), instead of the surface's; α is its square.
    pub roughness: Option<Texture>,
    /// Its normal n, z up, x along u and y along v, as (n + 1) / 2.
    pub normal: Option<Texture>,
    /// The direction d about the normal that the first roughness is along, x along u and y along v, as (d + 1) / 2. −d is the same.
    pub direction: Option<Texture>,
}

impl SurfaceMaps {
    /// Loads a TOML file of one material that names maps, see docs/training.md; `None` if it names none.
    ///
    /// # Errors
    /// Anything that is not as it should be, with its place and the remedy.
    pub fn load(path: impl AsRef<Path>) -> Result<Option<(SurfaceMaps, Vec<Warning>)>, Error> {
        let path = path.as_ref();
        let text = read_text(path, LONGEST_FILE)?;
        let source = Source { file: path, text: &text };
        let entries = source.parse()?;
        let table = Table::root(source, &entries);
        let [color, roughness, normal, direction] = ["texture", MAPS[0], MAPS[1], MAPS[2]].map(|key| table.get(key));
        if [&color, &roughness, &normal, &direction].into_iter().all(Option::is_none) {
            return Ok(None);
        }
        for key in OF_A_SCENE {
            if let Some(value) = table.get(key) {
                return Err(value.error("no such key in a file of one material"));
            }
        }
        let kind = table.require("type")?;
        let surface = surface(&table, &grey(), &mut Library::default())?;
        let is_rough = match surface {
            Surface::Diffuse { .. } => false,
            Surface::Conductor { .. } | Surface::Coated { .. } => true,
            _ => return Err(kind.error("\"diffuse\", \"conductor\" or \"coated\", which maps can vary")),
        };
        if let Some(value) = roughness.as_ref().filter(|_| !is_rough || table.has("alpha") || table.has("roughness")) {
            return Err(value.error("no map of roughness on a diffuse surface, or beside `alpha` or `roughness`"));
        }
        if let Some(value) = direction.as_ref().filter(|_| !matches!(surface, Surface::Conductor { .. })) {
            return Err(value.error("no map of anisotropy but on a conductor"));
        }
        let mut warnings = Vec::new();
        let mut read = |value: Option<Value>, is_color: bool| {
            let read = |value: Value| {
                let place = value.place();
                let file = beside(&place, value.string()?, &mut warnings);
                let texture = match is_color {
                    true => decode::texture(&file, &place, &mut warnings).map(|(texture, _)| texture),
                    false => decode::numbers(&file, &place, &mut warnings),
                };
                texture.map_err(|error| error.named_by(Some(&place)))
            };
            value.map(read).transpose()
        };
        let maps = SurfaceMaps {
            surface: without_texture(surface),
            color: read(color, true)?,
            roughness: read(roughness, false)?,
            normal: read(normal, false)?,
            direction: read(direction, false)?,
        };
        Ok(Some((maps, warnings)))
    }

    /// Its maps.
    pub fn textures(&self) -> impl Iterator<Item = &Texture> {
        [&self.color, &self.roughness].into_iter().flatten().chain(self.frames())
    }

    /// Those of them that say how the surface lies.
    pub fn frames(&self) -> impl Iterator<Item = &Texture> {
        [&self.normal, &self.direction].into_iter().flatten()
    }
}

/// A surface in its colour alone: there is no scene whose textures it could index.
fn without_texture(mut surface: Surface) -> Surface {
    if let Some(color) = surface.color_mut() {
        color.texture = None;
    }
    surface
}
