//! Materials as the device reads them: `glsl/layout/material.glsl`.

use glam::Vec2;

use crate::material::{CoatAlbedo, INDEX_MATCH, SMOOTH_ALPHA, color};
use crate::scene::{Fresnel, Material, Surface};

/// Which shading kernel a material needs. The number stands in the lowest bits of [`MaterialRecord::flags`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
pub enum Family {
    /// [`Surface::Diffuse`]
    Diffuse = 0,
    /// [`Surface::Conductor`]
    Conductor = 1,
    /// [`Surface::Dielectric`]
    Dielectric = 2,
    /// [`Surface::Coated`]
    Coated = 3,
}

impl Family {
    /// All of them, in the order of their numbers.
    pub const ALL: [Family; 4] = [Family::Diffuse, Family::Conductor, Family::Dielectric, Family::Coated];

    /// The lower-case name, as it stands in the names of GLSL files.
    pub fn name(self) -> &'static str {
        match self {
            Family::Diffuse => "diffuse",
            Family::Conductor => "conductor",
            Family::Dielectric => "dielectric",
            Family::Coated => "coated",
        }
    }
}

/// The family of a surface.
pub fn family(surface: &Surface) -> Family {
    match surface {
        Surface::Diffuse { .. } => Family::Diffuse,
        Surface::Conductor { .. } => Family::Conductor,
        Surface::Dielectric { .. } => Family::Dielectric,
        Surface::Coated { .. } => Family::Coated,
    }
}

crate::shared_structs! {
    /// The structs of `glsl/layout/material.glsl`.
    pub const MATERIAL_STRUCTS;

    /// A material; the GLSL says what the members mean.
    #[derive(PartialEq)]
    #[allow(missing_docs)]
    pub struct MaterialRecord {
        pub color: [f32; 3],
        pub texture_index: u32,
        pub eta: [f32; 3],
        pub flags: u32,
        pub kappa: [f32; 3],
        pub ior: f32,
        pub emission: [f32; 3],
        pub base_scale: f32,
        pub alpha: [f32; 2],
        pub coat: u64,
    }
}

impl MaterialRecord {
    /// [`MaterialRecord::texture_index`] of a material without a texture.
    pub const NO_TEXTURE: u32 = u32::MAX;
    /// The bits of [`MaterialRecord::flags`] that hold the [`Family`].
    pub const FAMILY_MASK: u32 = 3;
    /// Flag: the emission is not black.
    pub const EMITS: u32 = 4;
    /// Flag: triangles emit from their back too.
    pub const EMITS_BOTH_SIDES: u32 = 8;
    /// Flag: a conductor by its complex index of refraction.
    pub const COMPLEX_FRESNEL: u32 = 16;

    /// All of a material but the address of its coat's table.
    fn new(material: &Material, coat: &CoatAlbedo) -> MaterialRecord {
        let Material { surface, emission, .. } = material;
        let color = color(surface);
        let mut flags = family(surface) as u32;
        let mut set = |flag, condition| flags |= if condition { flag } else { 0 };
        set(Self::EMITS, material.is_emissive());
        set(Self::EMITS_BOTH_SIDES, material.emits_both_sides);
        set(Self::COMPLEX_FRESNEL, matches!(surface, Surface::Conductor { fresnel: Fresnel::Complex { .. }, .. }));
        let (eta, kappa) = match surface {
            Surface::Conductor { fresnel: Fresnel::Complex { eta, kappa }, .. } => (*eta, *kappa),
            _ => Default::default(),
        };
        let (ior, alpha) = match *surface {
            Surface::Diffuse { .. } => (1.0, Vec2::ZERO),
            Surface::Conductor { alpha, .. } => (1.0, alpha),
            Surface::Dielectric { ior, alpha } => (ior, Vec2::splat(alpha)),
            Surface::Coated { ior, alpha, .. } => (ior, Vec2::splat(alpha)),
        };
        let has_boundary = matches!(surface, Surface::Conductor { .. }) || (ior - 1.0).abs() >= INDEX_MATCH;
        let is_rough = has_boundary && alpha.max_element() >= SMOOTH_ALPHA;
        let alpha = if is_rough { alpha.max(Vec2::splat(SMOOTH_ALPHA)) } else { Vec2::ZERO };
        MaterialRecord {
            color: color.value.into(),
            texture_index: color.texture.unwrap_or(Self::NO_TEXTURE),
            eta: eta.into(),
            flags,
            kappa: kappa.into(),
            ior: if has_boundary { ior } else { 1.0 },
            emission: (*emission).into(),
            base_scale: (1.0 / (1.0 - coat.average())) as f32,
            alpha: alpha.into(),
            coat: 0,
        }
    }
}

/// The materials of a scene, ready for upload.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialTable {
    /// The tables of all rough coats, one after another, [`CoatAlbedo::TABLE_LEN`] entries each. Empty where there is
    /// no rough coat.
    pub coat_tables: Vec<f32>,
    /// The records, in the order of the scene's materials, without the addresses of their coats' tables.
    records: Vec<MaterialRecord>,
    /// Which of the tables belongs to each record.
    coat_of: Vec<Option<usize>>,
}

impl MaterialTable {
    /// Packs materials; coats of the same index and roughness share a table.
    pub fn new(materials: &[Material]) -> MaterialTable {
        let mut table = MaterialTable { coat_tables: Vec::new(), records: Vec::new(), coat_of: Vec::new() };
        let mut known: Vec<(f32, f32, CoatAlbedo, Option<usize>)> = Vec::new();
        for material in materials {
            let &Surface::Coated { ior, alpha, .. } = &material.surface else {
                table.records.push(MaterialRecord::new(material, &CoatAlbedo::None));
                table.coat_of.push(None);
                continue;
            };
            let position = known.iter().position(|&(i, a, ..)| (i, a) == (ior, alpha)).unwrap_or_else(|| {
                let coat = CoatAlbedo::new(&material.surface);
                let index = table.push_table(&coat);
                known.push((ior, alpha, coat, index));
                known.len() - 1
            });
            let (_, _, coat, index) = &known[position];
            table.records.push(MaterialRecord::new(material, coat));
            table.coat_of.push(*index);
        }
        table
    }

    /// The records, for [`MaterialTable::coat_tables`] at device address `coat_tables`.
    pub fn records(&self, coat_tables: u64) -> Vec<MaterialRecord> {
        let table_bytes = (CoatAlbedo::TABLE_LEN * size_of::<f32>()) as u64;
        let address = |index: &Option<usize>| index.map_or(0, |index| coat_tables + index as u64 * table_bytes);
        let with_address = |(record, index): (&MaterialRecord, _)| MaterialRecord { coat: address(index), ..*record };
        self.records.iter().zip(&self.coat_of).map(with_address).collect()
    }

    /// Appends the table of a rough coat, and says which one it is.
    fn push_table(&mut self, coat: &CoatAlbedo) -> Option<usize> {
        let CoatAlbedo::Rough { table, .. } = coat else { return None };
        self.coat_tables.extend_from_slice(table);
        Some(self.coat_tables.len() / CoatAlbedo::TABLE_LEN - 1)
    }
}
