//! Materials as the device reads them: `glsl/layout/material.glsl`.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec2;

use super::brdf_table;
use super::error::Error;
use super::neubrdf_kernels::NeuBrdfKernels;
use super::neubrdf_table::{neubrdf, neubrdf_precision, neubrdfs, pack_neubrdf_models};
use crate::gpu::{Buffer, Upload};
use crate::material::{CoatAlbedo, INDEX_MATCH, Prepared, SMOOTH_ALPHA, color, is_alike};
use crate::scene::brdf::{NeuBrdf, Precision};
use crate::scene::{Brdf, Fresnel, Material, Surface};

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
    /// [`Brdf::Nbrdf`]
    Nbrdf = 4,
    /// [`Brdf::NeuBrdf`]
    NeuBrdf = 5,
    /// [`Surface::Layered`]
    Layered = 6,
    /// [`Surface::Woven`]
    Woven = 7,
    /// [`Brdf::Merl`]
    Merl = 8,
    /// [`Brdf::Rgl`]
    Rgl = 9,
    /// [`Brdf::Sparse`]
    Sparse = 10,
}

impl Family {
    /// All of them, in the order of their numbers.
    pub const ALL: [Family; 11] = [
        Family::Diffuse,
        Family::Conductor,
        Family::Dielectric,
        Family::Coated,
        Family::Nbrdf,
        Family::NeuBrdf,
        Family::Layered,
        Family::Woven,
        Family::Merl,
        Family::Rgl,
        Family::Sparse,
    ];

    /// The lower-case name, as it stands in the names of GLSL files.
    pub fn name(self) -> &'static str {
        match self {
            Family::Diffuse => "diffuse",
            Family::Conductor => "conductor",
            Family::Dielectric => "dielectric",
            Family::Coated => "coated",
            Family::Nbrdf => "nbrdf",
            Family::Layered => "layered",
            Family::Woven => "woven",
            Family::Merl => "merl",
            Family::Rgl => "rgl",
            Family::Sparse => "sparse",
            Family::NeuBrdf => "neubrdf",
        }
    }
}

/// The family of a surface of a scene with these BRDFs.
pub fn family(surface: &Surface, brdfs: &[Arc<Brdf>]) -> Family {
    match *surface {
        Surface::Diffuse { .. } => Family::Diffuse,
        Surface::Conductor { .. } => Family::Conductor,
        Surface::Dielectric { .. } => Family::Dielectric,
        Surface::Coated { .. } => Family::Coated,
        Surface::Measured { brdf } => match *brdfs[brdf as usize] {
            Brdf::Nbrdf(_) => Family::Nbrdf,
            Brdf::Merl(_) => Family::Merl,
            Brdf::Rgl(_) => Family::Rgl,
            Brdf::Sparse(_) => Family::Sparse,
            Brdf::NeuBrdf(_) => Family::NeuBrdf,
        },
        Surface::Layered(_) => Family::Layered,
        Surface::Woven(_) => Family::Woven,
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
        pub table: u64,
        pub opacity: f32,
        pub opacity_texture: u32,
        pub normal_map: u32,
        pub roughness_map: u32,
        pub emission_texture: u32,
        pub patch_map: u32,
        pub patch_material: u32,
        pub anisotropy_direction_map: u32,
    }
}

impl MaterialRecord {
    /// [`MaterialRecord::texture_index`] of a material without a texture.
    pub const NO_TEXTURE: u32 = u32::MAX;
    /// The bits of [`MaterialRecord::flags`] that hold the [`Family`].
    pub const FAMILY_MASK: u32 = 15;
    /// Flag: the emission is not black.
    pub const EMITS: u32 = 16;
    /// Flag: triangles emit from their back too.
    pub const EMITS_BOTH_SIDES: u32 = 32;
    /// Flag: a conductor by its complex index of refraction.
    pub const COMPLEX_FRESNEL: u32 = 64;

    /// From this bit on [`MaterialRecord::flags`] holds which of its family's queues takes a NeuBRDF.
    pub const PART_SHIFT: u32 = 8;

    /// All of a material but the address of its table.
    fn new(material: &Material, prepared: &Prepared, brdfs: &[Arc<Brdf>], kernels: &NeuBrdfKernels) -> MaterialRecord {
        let Material {
            surface,
            emission,
            emission_texture,
            opacity,
            normal_map,
            roughness_map,
            anisotropy_direction_map,
            patches,
            ..
        } = material;
        let color = color(surface);
        let mut flags = family(surface, brdfs) as u32;
        if let Surface::Measured { brdf } = *surface {
            flags |= kernels.queue(brdf) << MaterialRecord::PART_SHIFT;
        }
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
            Surface::Measured { .. } | Surface::Layered(_) | Surface::Woven(_) => (1.0, Vec2::ZERO),
        };
        let has_boundary = matches!(surface, Surface::Conductor { .. }) || (ior - 1.0).abs() >= INDEX_MATCH;
        let is_rough = has_boundary && alpha.max_element() >= SMOOTH_ALPHA;
        let alpha = if is_rough { alpha.max(Vec2::splat(SMOOTH_ALPHA)) } else { Vec2::ZERO };
        let average_coat = if let Prepared::Coated { coats, .. } = prepared { coats[0].average() } else { 0.0 };
        MaterialRecord {
            color: color.value.into(),
            texture_index: color.texture.unwrap_or(Self::NO_TEXTURE),
            eta: eta.into(),
            flags,
            kappa: kappa.into(),
            ior: if has_boundary { ior } else { 1.0 },
            emission: (*emission).into(),
            base_scale: (1.0 / (1.0 - average_coat)) as f32,
            alpha: alpha.into(),
            table: 0,
            opacity: opacity.value,
            opacity_texture: opacity.texture.unwrap_or(Self::NO_TEXTURE),
            normal_map: normal_map.unwrap_or(Self::NO_TEXTURE),
            roughness_map: roughness_map.filter(|_| has_boundary).unwrap_or(Self::NO_TEXTURE),
            emission_texture: emission_texture.unwrap_or(Self::NO_TEXTURE),
            patch_map: patches.map_or(Self::NO_TEXTURE, |patches| patches.map),
            patch_material: patches.map_or(0, |patches| patches.material),
            anisotropy_direction_map: anisotropy_direction_map.unwrap_or(Self::NO_TEXTURE),
        }
    }
}

/// The materials of a scene, ready for upload.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialTable {
    /// What materials have in memory of their own: the table of a rough coat, or a sampling lobe and what its BRDF is evaluated
    /// from. Each once, however many materials share it. All NeuBRDFs are one table, so that they can share codebooks.
    pub tables: Vec<Vec<u32>>,
    /// The kernels that evaluate its NeuBRDFs.
    pub kernels: NeuBrdfKernels,
    /// The records, in the order of the scene's materials, without the addresses of their tables.
    records: Vec<MaterialRecord>,
    /// Which of the tables belongs to each record, and the byte of it at which what the record needs begins, a multiple of 16.
    table_of: Vec<Option<TablePlace>>,
}

/// The materials of a scene on the device, of which one may be replaced.
#[derive(Clone)]
pub struct DeviceMaterials {
    /// The records.
    pub buffer: Arc<Buffer>,
    /// The kernels that evaluate NeuBRDFs.
    pub kernels: NeuBrdfKernels,
    records: Vec<MaterialRecord>,
    /// As [`MaterialTable::table_of`].
    tables: Vec<Option<(Arc<Buffer>, u64)>>,
    prepared: Vec<Arc<Prepared>>,
}

impl DeviceMaterials {
    /// Uploads the materials of a scene with these BRDFs, the numbers of NeuBRDFs in that precision, or in half where it loses
    /// nothing.
    pub fn new(
        upload: &mut Upload,
        materials: &[Material],
        brdfs: &[Arc<Brdf>],
        precision: Option<Precision>,
    ) -> Result<DeviceMaterials, Error> {
        let prepared = Prepared::all(materials, brdfs);
        let lossless = || neubrdf_precision(neubrdfs(brdfs));
        let precision = precision.unwrap_or_else(lossless);
        let kernels = NeuBrdfKernels::of(brdfs, precision, upload.is_later()).on(upload.device());
        let packed = MaterialTable::of(materials, &prepared, brdfs, kernels);
        let tables = packed.tables.iter().map(|table| Ok(upload.buffer("material table", table)?));
        let tables = tables.collect::<Result<Vec<_>, Error>>()?;
        let addresses: Vec<u64> = tables.iter().map(|table| table.address()).collect();
        let records = packed.records(&addresses);
        Ok(DeviceMaterials {
            buffer: upload.buffer("materials", &records)?,
            records,
            tables: packed.table_of.iter().map(|at| at.map(|(index, byte)| (tables[index].clone(), byte))).collect(),
            prepared,
            kernels: packed.kernels,
        })
    }

    /// With the materials of those indices replaced by what the scene has there; `before` are those that were packed. BRDFs of which
    /// indices are others than they were, too, for which `kernels` have made place.
    pub fn replaced(
        &self,
        upload: &mut Upload,
        (before, now): (&[&Material], &[Material]),
        (changed, changed_brdfs): (&[usize], &[usize]),
        brdfs: &[Arc<Brdf>],
        kernels: NeuBrdfKernels,
    ) -> Result<DeviceMaterials, Error> {
        let mut next = DeviceMaterials { kernels, ..self.clone() };
        for (place, &index) in changed.iter().enumerate() {
            let material = &now[index];
            let surface = &material.surface;
            let is_new = matches!(surface, Surface::Measured { brdf } if changed_brdfs.contains(&(*brdf as usize)));
            // What costs time is shared with whichever material had it before, or has it already.
            let alike = |other: &Material| is_alike(other, material);
            let had = || before.iter().position(|other| alike(other)).filter(|_| !is_new);
            let has = changed[..place].iter().find(|other| alike(&now[**other]));
            (next.prepared[index], next.tables[index]) = match (has, had()) {
                (Some(twin), _) => (next.prepared[*twin].clone(), next.tables[*twin].clone()),
                (None, Some(twin)) => (self.prepared[twin].clone(), self.tables[twin].clone()),
                (None, None) => {
                    let prepared = Arc::new(Prepared::of(material, brdfs));
                    let table = table(surface, &prepared, brdfs, &next.kernels);
                    let table = table.map(|words| upload.buffer("material table", &words)).transpose()?;
                    (prepared, table.map(|table| (table, 0)))
                }
            };
            let address = next.tables[index].as_ref().map_or(0, |(table, byte)| table.address() + byte);
            let record = MaterialRecord::new(&now[index], &next.prepared[index], brdfs, &next.kernels);
            next.records[index] = MaterialRecord { table: address, ..record };
        }
        upload.write(&next.buffer, &next.records)?;
        Ok(next)
    }
}

/// Which of the tables, and from which byte on.
type TablePlace = (usize, u64);

impl MaterialTable {
    /// Packs the materials of a scene with these BRDFs, for kernels of theirs.
    pub fn new(materials: &[Material], brdfs: &[Arc<Brdf>], kernels: NeuBrdfKernels) -> MaterialTable {
        MaterialTable::of(materials, &Prepared::all(materials, brdfs), brdfs, kernels)
    }

    fn of(
        materials: &[Material],
        prepared: &[Arc<Prepared>],
        brdfs: &[Arc<Brdf>],
        kernels: NeuBrdfKernels,
    ) -> MaterialTable {
        let mut packed = MaterialTable { tables: Vec::new(), kernels, records: Vec::new(), table_of: Vec::new() };
        let neubrdf_places = packed.push_neubrdfs(materials, brdfs);
        let mut known: Vec<(Arc<Prepared>, Option<TablePlace>)> = Vec::new();
        for (material, prepared) in materials.iter().zip(prepared) {
            packed.records.push(MaterialRecord::new(material, prepared, brdfs, &packed.kernels));
            let position = known.iter().position(|(other, _)| Arc::ptr_eq(other, prepared)).unwrap_or_else(|| {
                let place = match material.surface {
                    Surface::Measured { brdf } if neubrdf_places.contains_key(&brdf) => Some(neubrdf_places[&brdf]),
                    ref surface => {
                        table(surface, prepared, brdfs, &packed.kernels).map(|table| packed.push_table(table))
                    }
                };
                known.push((prepared.clone(), place));
                known.len() - 1
            });
            packed.table_of.push(known[position].1);
        }
        packed
    }

    /// The records, for [`MaterialTable::tables`] at these device addresses, multiples of 16.
    pub fn records(&self, addresses: &[u64]) -> Vec<MaterialRecord> {
        let address = |at: &Option<TablePlace>| at.map_or(0, |(index, byte)| addresses[index] + byte);
        let with_address = |(record, at): (&MaterialRecord, _)| MaterialRecord { table: address(at), ..*record };
        self.records.iter().zip(&self.table_of).map(with_address).collect()
    }

    /// Adds the NeuBRDFs of these materials, and tells where each one is.
    fn push_neubrdfs(&mut self, materials: &[Material], brdfs: &[Arc<Brdf>]) -> BTreeMap<u32, TablePlace> {
        let model = |brdf: u32| neubrdf(&brdfs[brdf as usize]);
        let measured =
            |material: &Material| if let Surface::Measured { brdf } = material.surface { Some(brdf) } else { None };
        let models: BTreeMap<u32, &NeuBrdf> =
            materials.iter().filter_map(measured).filter_map(|brdf| Some((brdf, model(brdf)?))).collect();
        if models.is_empty() {
            return BTreeMap::new();
        }
        let with_shapes = models.iter().map(|(brdf, model)| (*model, self.kernels.shape(*brdf)));
        let (words, firsts) = pack_neubrdf_models(with_shapes);
        let (table, _) = self.push_table(words);
        models.into_keys().zip(firsts).map(|(brdf, first)| (brdf, (table, 4 * u64::from(first)))).collect()
    }

    fn push_table(&mut self, table: Vec<u32>) -> TablePlace {
        self.tables.push(table);
        (self.tables.len() - 1, 0)
    }
}

/// A `CoatTable`, of [`Prepared::Coated::coats`]; a smooth coat needs none.
fn coat_table(coats: &[CoatAlbedo]) -> Option<Vec<u32>> {
    let numbers = match coats {
        [coat] => coat.table()?.to_vec(),
        [_smooth, by_roughness @ ..] => {
            let tables: Vec<&[f32]> = by_roughness.iter().map(CoatAlbedo::table).collect::<Option<_>>()?;
            tables.concat().into_iter().chain(by_roughness.iter().map(|coat| coat.average() as f32)).collect()
        }
        [] => return None,
    };
    Some(numbers.into_iter().map(f32::to_bits).collect())
}

/// What a surface has in memory of its own.
fn table(surface: &Surface, prepared: &Prepared, brdfs: &[Arc<Brdf>], kernels: &NeuBrdfKernels) -> Option<Vec<u32>> {
    match (surface, prepared) {
        (_, Prepared::Coated { coats, .. }) => coat_table(coats),
        (Surface::Measured { brdf }, Prepared::LobeSampled { lobe, .. }) => {
            Some(brdf_table::pack(lobe, &brdf_table::brdf(&brdfs[*brdf as usize], kernels.shape(*brdf))))
        }
        (Surface::Layered(layers), Prepared::LobeSampled { lobe, .. }) => {
            Some(brdf_table::pack(lobe, &brdf_table::layered(layers)))
        }
        (Surface::Woven(cloth), Prepared::LobeSampled { lobe, .. }) => {
            Some(brdf_table::pack(lobe, &brdf_table::woven(cloth)))
        }
        _ => None,
    }
}
