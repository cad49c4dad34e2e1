//! Files of one material: what the `[material.NAME]` table of a scene file says, alone in a TOML file, or a BRDF.

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;

use super::file::{MAPS, MAPS_ARE_LEARNED, OF_A_SCENE, surface};
use super::mtl::Library;
use super::table::{Source, Table, read_text};
use super::{Brdf, Color, Error, Surface, Warning};

/// Longest file of one material, bytes.
pub(super) const LONGEST_FILE: u64 = 1 << 20;

impl Surface {
    /// Loads a TOML file whose keys are those of a material of a scene file, or a file that [`Brdf::load`] knows, of which `name`
    /// picks one material where it holds several. The BRDFs are what [`Surface::Measured`] indexes; warnings tell of files that were found
    /// by another name.
    ///
    /// # Errors
    /// Anything that is not as docs/scenes.md says, with its place and the remedy. Textures are refused: a surface alone has
    /// no coordinates.
    #[allow(clippy::type_complexity)] // a surface, what it indexes, and what is to be told
    pub fn load(path: impl AsRef<Path>, name: Option<&str>) -> Result<(Surface, Vec<Arc<Brdf>>, Vec<Warning>), Error> {
        let path = path.as_ref();
        if !path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
            return Ok((Surface::Measured { brdf: 0 }, vec![Arc::new(Brdf::load(path, name)?)], Vec::new()));
        }
        let text = read_text(path, LONGEST_FILE)?;
        let source = Source { file: path, text: &text };
        let entries = source.parse()?;
        let table = Table::root(source, &entries);
        if let Some(name) = name {
            return Err(table.error(format!("the name `{name}`"), "no name: this kind of file holds one material"));
        }
        for key in OF_A_SCENE.into_iter().chain(["texture"]) {
            if let Some(value) = table.get(key) {
                return Err(value.error("no such key in a file of one material"));
            }
        }
        if let Some(value) = MAPS.iter().find_map(|key| table.get(key)) {
            return Err(value.error(MAPS_ARE_LEARNED));
        }
        table.require("type")?;
        let mut library = Library::default();
        let surface = surface(&table, &grey(), &mut library)?;
        Ok((surface, library.brdfs, library.warnings))
    }
}

/// What a material is before its table says anything.
pub(super) fn grey() -> Surface {
    Surface::Diffuse { albedo: Color::constant(Vec3::splat(0.5)) }
}
