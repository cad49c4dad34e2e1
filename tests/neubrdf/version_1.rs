//! Files of version 1: one that was trained then, of satin gold, and made ones.

use neubrdf::scene::brdf::{NeuBrdf, NeuBrdfPack, Precision};
use proptest::prelude::*;
use serde_json::json;

use crate::common::random_neubrdf::{Shape, Stream, random_neubrdf};
use crate::{SMALL, signed};

const SHAPE: Shape = Shape { is_pruned: false, surface: None, ..SMALL };

/// Version 1 of what version 2 holds: `SHAPE` has no merged pixels, so that all lengths are known.
fn version_1(brdf: &NeuBrdf, change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let bytes = brdf.encode(Precision::F16).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let new: serde_json::Value = serde_json::from_slice(&bytes[16..16 + length]).unwrap();
    let material = &new["materials"][0];
    let table =
        |side: &str| json!({"n_side": material[side]["n_side"], "codes": 5, "index_bits": 3, "is_merged": false});
    let mut header = json!({
        "is_isotropic": material["is_isotropic"], "corner_weights": material["corner_weights"], "features": 3,
        "wi": table("wi"), "wo": table("wo"), "widths": new["networks"][0]["widths"], "precision": "f16",
        "encoding": material["encoding"], "lobe": material["lobe"], "provenance": material["provenance"],
    });
    change(&mut header);
    let header = serde_json::to_vec(&header).unwrap();
    let payload = &bytes[16 + length..bytes.len() - 32];
    let (codes, indices) = (2 * 5 * 3, (3 * brdf.wi.grid.point_count()).div_ceil(8));
    let (codes_wi, rest) = payload.split_at(codes);
    let (codes_wo, rest) = rest.split_at(codes);
    let (network, points) = rest.split_at(rest.len() - 2 * indices);
    let (points_wi, points_wo) = points.split_at(indices);
    let length = (header.len() as u32).to_le_bytes();
    signed(&[&bytes[..8], &[1, 0, 0, 0], &length, &header, points_wi, codes_wi, points_wo, codes_wo, network].concat())
}

#[test]
fn they_load_as_what_they_were() {
    let brdf = random_neubrdf(SHAPE, 1);
    assert!(NeuBrdf::decode(&version_1(&brdf, |_| ())).unwrap() == brdf);
    let bytes = include_bytes!("version_1.neubrdf");
    assert_eq!(bytes[8], 1, "this one is of version 1");
    let brdf = NeuBrdf::decode(bytes).unwrap();
    assert!(NeuBrdf::decode(&brdf.encode(Precision::F16).unwrap()).unwrap() == brdf);
}

#[test]
fn hostile_headers_are_errors() {
    let brdf = random_neubrdf(SHAPE, 1);
    let original = version_1(&brdf, |_| ());
    let numbers = ["/features", "/wi/n_side", "/wi/codes", "/wi/index_bits", "/wo/codes", "/widths/0", "/widths/3"];
    for pointer in numbers {
        for value in [0u64, 1, 2, 6, 255, 256, 65_534, 65_535, u64::from(u32::MAX)] {
            let file = version_1(&brdf, |header| *header.pointer_mut(pointer).unwrap() = value.into());
            assert!(file == original || NeuBrdf::decode(&file).is_err(), "{pointer} = {value}");
        }
    }
    let many = version_1(&brdf, |header| {
        header["wi"] = json!({"n_side": 4, "codes": 1u64 << 31, "index_bits": 31, "is_merged": false});
    });
    assert_eq!(NeuBrdf::decode(&many).unwrap_err().field, "wi.codes");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn any_file_is_an_error_or_a_valid_model(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let bytes = version_1(&random_neubrdf(SHAPE, 2), |_| ());
        let mut content = bytes[..bytes.len() - 32].to_vec();
        for (at, value) in changes {
            let at = at.index(content.len());
            content[at] = value;
        }
        if let Ok(pack) = NeuBrdfPack::decode(&signed(&content)) {
            let mut random = Stream(1);
            for _ in 0..20 {
                let value = pack.materials[0].1.eval(random.direction(), random.direction());
                prop_assert!(value.is_finite() && value.min_element() >= 0.0);
            }
        }
    }
}
