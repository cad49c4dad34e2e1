//! Cloth: two crossed families of yarns.

use glam::Vec3;

use super::error::Error;
use super::table::{Table, Value};

/// The yarns of a [`super::Surface::Woven`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Woven {
    /// Along the tangent.
    pub warp: Yarn,
    /// Along the bitangent.
    pub weft: Yarn,
}

/// One family of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Yarn {
    /// Share of the surface, in [0, 1]; both families together cover at most all of it.
    pub coverage: f32,
    /// What part of the yarn's light is mirrored by its fibres, in [0, 1]; the rest passes through them.
    pub gloss: f32,
    /// What the fibres mirror at normal incidence, in [0, 1].
    pub f0: Vec3,
    /// Reflectance of what passes through the fibres, in [0, 1].
    pub albedo: Vec3,
    /// Width of the mirrored light along the yarn: standard deviation in the sine of the angle to the plane across it, in [0.02, 1].
    pub specular_width: f32,
    /// The same of the light that passed through the fibres.
    pub volume_width: f32,
    /// How much of the latter is spread evenly instead, in [0, 1].
    pub isotropy: f32,
}

impl Woven {
    /// What a table of a scene file says.
    pub(super) fn read(table: &Table) -> Result<Woven, Error> {
        let warp = Yarn::read(&table.require("warp")?.table()?)?;
        let weft = Yarn::read(&table.require("weft")?.table()?)?;
        if warp.coverage + weft.coverage > 1.0 {
            let found = format!("a coverage of {} and {}", warp.coverage, weft.coverage);
            return Err(table.error(found, "a sum of at most 1"));
        }
        Ok(Woven { warp, weft })
    }
}

impl Yarn {
    fn read(table: &Table) -> Result<Yarn, Error> {
        table.allow(&["coverage", "gloss", "f0", "albedo", "specular_width", "volume_width", "isotropy"])?;
        let number = |key, least, default| table.get(key).map_or(Ok(default), |value: Value| value.number(least, 1.0));
        let color =
            |key, default| table.get(key).map_or(Ok(Vec3::splat(default)), |value: Value| value.color(0.0, 1.0));
        Ok(Yarn {
            coverage: number("coverage", 0.0, 0.5)?,
            gloss: number("gloss", 0.0, 0.5)?,
            f0: color("f0", 0.5)?,
            albedo: color("albedo", 0.5)?,
            specular_width: number("specular_width", 0.02, 0.1)?,
            volume_width: number("volume_width", 0.02, 0.3)?,
            isotropy: number("isotropy", 0.0, 0.3)?,
        })
    }
}
