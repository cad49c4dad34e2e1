//! Packs: several materials in a file, which share codebooks, and networks too if they are equal.

use std::fs;
use std::sync::{Arc, LazyLock};

use neubrdf::material::Evaluate;
use neubrdf::render::{MaterialTable, NeuBrdfKernels, NeuBrdfShape, pack_neubrdf_models};
use neubrdf::scene::brdf::{NeuBrdf, NeuBrdfPack, Precision};
use neubrdf::scene::{Brdf, Material, Surface};
use proptest::prelude::*;
use serde_json::json;

use crate::common::random_neubrdf::{Shape, Stream, random_neubrdf, random_pack};
use crate::{SMALL, signed};

fn encoded(pack: &NeuBrdfPack) -> Vec<u8> {
    pack.encode(Precision::F16).unwrap()
}

/// A file with another header.
fn with_header(bytes: &[u8], change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut header = serde_json::from_slice(&bytes[16..16 + length]).unwrap();
    change(&mut header);
    let header = serde_json::to_vec(&header).unwrap();
    signed(
        &[&bytes[..12], &(header.len() as u32).to_le_bytes(), &header, &bytes[16 + length..bytes.len() - 32]].concat(),
    )
}

#[test]
fn packs_hold_all_of_their_members_and_codebooks_once() {
    for shares_network in [false, true] {
        let pack = random_pack(SMALL, 5, shares_network);
        let read = NeuBrdfPack::decode(&encoded(&pack)).unwrap();
        assert!(read == pack);
        let first = &read.materials[0].1;
        for (_, member) in &read.materials {
            assert!(Arc::ptr_eq(&member.wi.codebook, &first.wi.codebook), "one codebook in memory");
            assert!(!Arc::ptr_eq(&member.wi.codebook, &member.wo.codebook), "a hemisphere each");
        }
    }
}

/// What a member more adds: its indices and its network, or the indices alone, and the header's words about it.
#[test]
fn a_member_costs_its_indices_and_its_network() {
    let shape = Shape { n_side: 16, ..Shape::FULL };
    let size = |count, shares_network| {
        let bytes = encoded(&random_pack(shape, count, shares_network));
        bytes.len() - 16 - u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize
    };
    let codebooks = 2 * 256 * 16 * 2;
    let indices = 2 * (6 * 16 * 16 + 2 * 16 + 1);
    let network = 2 * (33 * 64 + 2 * 65 * 64 + 65 * 3);
    assert_eq!(size(8, false), codebooks + 8 * (indices + network) + 32);
    assert_eq!(size(8, true), codebooks + 8 * indices + network + 32);
}

/// On the device a member more costs no more than its header, lobes, indices and network: a codebook is there once a hemisphere.
#[test]
fn a_scene_holds_a_codebook_once() {
    let shape = Shape { n_side: 16, ..Shape::FULL };
    let pack = random_pack(shape, 8, false);
    let members: Vec<&NeuBrdf> = pack.materials.iter().map(|(_, member)| member).collect();
    let alone: Vec<NeuBrdf> = (0..8).map(|seed| random_neubrdf(shape, seed)).collect();
    let bytes = |models: &[&NeuBrdf]| {
        let kernel = NeuBrdfShape::of(models.iter().copied(), Precision::F16);
        4 * pack_neubrdf_models(models.iter().map(|model| (*model, &kernel))).0.len()
    };
    let codebooks = 2 * 256 * 16 * 2;
    let (shared, own) = (bytes(&members), bytes(&alone.iter().collect::<Vec<_>>()));
    eprintln!("8 models: {shared} bytes with shared codebooks, {own} without");
    // Behind either shared codebook stand 32 bytes that subgroups may read.
    assert_eq!(shared, own - 7 * codebooks + 2 * 32);
    assert_eq!(bytes(&members[..1]), bytes(&[&alone[0]]));

    // A scene of them is one table.
    let brdfs: Vec<Arc<Brdf>> = members.iter().map(|m| Arc::new(Brdf::NeuBrdf(Box::new((*m).clone())))).collect();
    let material = |brdf| Material::new("", Surface::Measured { brdf });
    let materials: Vec<Material> = (0..8).map(material).collect();
    let table = MaterialTable::new(&materials, &brdfs, NeuBrdfKernels::of(&brdfs, Precision::F16, false));
    assert_eq!(table.tables.iter().map(|table| 4 * table.len()).collect::<Vec<_>>(), [shared]);
}

/// Each model of a scene has a kernel of its own shape; where BRDFs may become others, there is one for whatever fits all of them together.
#[test]
fn a_kernel_is_no_wider_than_its_models() {
    let narrow = Shape { n_side: 4, hidden: &[16, 16, 16], ..SMALL };
    let flat = Shape { hidden: &[24, 24], is_isotropic: true, ..narrow };
    let model = |shape, seed| Arc::new(Brdf::NeuBrdf(Box::new(random_neubrdf(shape, seed))));
    let of = |brdf: &Arc<Brdf>| match &**brdf {
        Brdf::NeuBrdf(model) => NeuBrdfShape::of([&**model], Precision::F16),
        _ => panic!("another kind"),
    };
    let brdfs = [model(narrow, 1), model(flat, 2), model(narrow, 3)];
    let kernels = NeuBrdfKernels::of(&brdfs, Precision::F16, false);
    assert_eq!(kernels.shapes(), [of(&brdfs[0]), of(&brdfs[1])]);
    assert_eq!([0, 1, 2].map(|brdf| kernels.queue(brdf)), [0, 1, 2]);
    assert_eq!([0, 1, 2].map(|queue| kernels.serving(queue)), [0, 1, 0]);

    let both = model(Shape { hidden: &[24, 24, 24], is_isotropic: true, ..narrow }, 4);
    let Brdf::NeuBrdf(both_model) = &*both else { panic!("another kind") };
    assert!(!kernels.clone().replace(0, &both), "no kernel is so wide and so deep");
    let mut changing = NeuBrdfKernels::of(&brdfs, Precision::F16, true);
    assert!(changing.shapes().len() == 3 && changing.shapes()[2].holds(both_model));
    assert!(changing.replace(0, &both) && changing.serving(0) == 2);
    assert!(changing.replace(0, &brdfs[1]) && changing.serving(0) == 1, "the narrowest that holds it");
    assert!(changing.replace(3, &brdfs[0]) && changing.queue(3) == 3 && changing.serving(3) == 0);

    // More models than queues: one kernel for all.
    let many: Vec<_> = (0..17).map(|seed| model(if seed < 9 { narrow } else { flat }, seed)).collect();
    let kernels = NeuBrdfKernels::of(&many, Precision::F16, false);
    assert_eq!(kernels.shapes().len(), 1);
    assert_eq!((kernels.queue(16), kernels.serving(15)), (0, 0));
}

#[test]
fn a_name_picks_a_member() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("pack.neubrdf");
    let pack = random_pack(SMALL, 3, false);
    fs::write(&path, encoded(&pack)).unwrap();
    let Brdf::NeuBrdf(member) = Brdf::load(&path, Some("m1")).unwrap() else { panic!("another kind") };
    assert!(*member == pack.materials[1].1);
    let message = |name: Option<&str>| Brdf::load(&path, name).unwrap_err().to_string();
    assert!(message(None).contains("no name of a material"), "{}", message(None));
    assert!(message(Some("m7")).contains("`m7`") && message(Some("m7")).contains("one of the 3 materials"));
    assert_eq!(NeuBrdf::decode(&encoded(&pack)).unwrap_err().field, "materials");

    // A lone one needs no name, and has none unless it was given one.
    let lone = NeuBrdfPack { materials: vec![("satin".into(), pack.materials[0].1.clone())] };
    fs::write(&path, encoded(&lone)).unwrap();
    assert_eq!(Brdf::load(&path, None).unwrap(), Brdf::load(&path, Some("satin")).unwrap());
    assert!(message(Some("m0")).contains("`satin`"));
    fs::write(&path, lone.materials[0].1.encode(Precision::F16).unwrap()).unwrap();
    assert!(message(Some("satin")).contains("the file holds one material") && message(Some("")).contains("no name"));
}

#[test]
fn packs_that_cannot_be_are_refused() {
    type Change = fn(&mut NeuBrdfPack);
    let changes: [(&str, Change); 5] = [
        ("materials", |pack| pack.materials.clear()),
        ("materials", |pack| pack.materials = vec![pack.materials[0].clone(); 257]),
        ("materials[1].name", |pack| pack.materials[1].0 = "m0".into()),
        ("materials[0].name", |pack| pack.materials[0].0.clear()),
        ("materials[2].layers[1]", |pack| pack.materials[2].1.layers[1].bias[0] = f32::NAN),
    ];
    for (field, change) in changes {
        let mut pack = random_pack(SMALL, 3, false);
        change(&mut pack);
        assert_eq!(pack.encode(Precision::F16).unwrap_err().field, field);
    }
}

#[test]
fn hostile_headers_are_errors() {
    let bytes = encoded(&random_pack(SMALL, 3, false));
    assert_eq!(with_header(&bytes, |_| ()).len(), bytes.len());
    type Change = fn(&mut serde_json::Value);
    let changes: [(&str, Change); 12] = [
        ("materials[1].wi.codebook", |header| header["materials"][1]["wi"]["codebook"] = 2.into()),
        ("materials[2].network", |header| header["materials"][2]["network"] = u32::MAX.into()),
        ("header", |header| header["materials"][2]["network"] = (-1).into()),
        ("materials[1].name", |header| header["materials"][1]["name"] = "m0".into()),
        ("file", |header| header["materials"] = json!([])),
        ("materials", |header| header["materials"] = vec![header["materials"][0].clone(); 300].into()),
        ("codebooks[0].codes", |header| header["codebooks"][0]["codes"] = 0.into()),
        ("codebooks[1].codes", |header| header["codebooks"][1]["codes"] = 65_534.into()),
        ("codebooks[0].features", |header| {
            header["codebooks"] = vec![json!({"features": 0, "codes": 60_000}); 2].into()
        }),
        ("networks[1]", |header| header["networks"][1]["widths"] = vec![1; 10_000].into()),
        ("networks[0]", |header| header["networks"][0]["widths"][1] = 4_000_000_000u32.into()),
        ("header", |header| header["materials"][0]["texture"] = 1.into()),
    ];
    for (field, change) in changes {
        let flaw = NeuBrdfPack::decode(&with_header(&bytes, change)).unwrap_err();
        assert_eq!(flaw.field, field, "{flaw}");
    }
}

static FILES: LazyLock<[Vec<u8>; 2]> =
    LazyLock::new(|| [false, true].map(|shares_network| encoded(&random_pack(SMALL, 3, shares_network))));

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    /// Whatever a file says, with a checksum that fits, it is an error or a pack whose members can be evaluated everywhere.
    #[test]
    fn any_file_is_an_error_or_a_valid_pack(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        file in 0usize..2,
    ) {
        let bytes = &FILES[file];
        let mut content = bytes[..bytes.len() - 32].to_vec();
        for (at, value) in changes {
            let at = at.index(content.len());
            content[at] = value;
        }
        if let Ok(pack) = NeuBrdfPack::decode(&signed(&content)) {
            pack.validate().unwrap();
            let mut random = Stream(file as u64);
            for (_, brdf) in &pack.materials {
                for _ in 0..5 {
                    let value = Brdf::NeuBrdf(Box::new(brdf.clone())).eval(random.direction(), random.direction());
                    prop_assert!(value.is_finite() && value.min_element() >= 0.0);
                }
            }
        }
    }
}
