//! NeuBRDFs: what they evaluate to, and their files.

#[path = "../common/mod.rs"]
mod common;
mod many;
mod pack;
mod version_1;

use std::fs;
use std::sync::{Arc, LazyLock};

use common::random_neubrdf::{Shape, Stream, random_neubrdf};
use glam::{DVec2, DVec3};
use neubrdf::material::turned;
use neubrdf::scene::Scene;
use neubrdf::scene::brdf::{
    Codebook, CornerWeights, Flaw, Footprint, NO_CODE, NeuBrdf, Precision, Provenance, SphereGrid, SphereTable,
    SurfaceFrame, SurfaceFrames, SurfaceGrid, SurfaceTable,
};
use proptest::prelude::*;

/// Small, and with all that a file can have.
const SMALL: Shape = Shape {
    is_isotropic: true,
    corner_weights: CornerWeights::Uniform,
    n_side: 4,
    resolutions: 1,
    features: 3,
    codes: 5,
    hidden: &[4, 5],
    is_pruned: true,
    surface: None,
    has_frames: false,
    sees_half_vector: false,
};

/// The same over a texture.
const VARYING: Shape = Shape { surface: Some(([3, 2], 5)), ..SMALL };

/// The same, and on two coarser grids.
const RESOLUTIONS: Shape = Shape { resolutions: 3, ..VARYING };

/// One whose network sees the half vector as well.
const HALF_VECTOR: Shape = Shape { sees_half_vector: true, ..RESOLUTIONS };

/// VARYING with frames.
const LEANING: Shape = Shape { has_frames: true, ..VARYING };

/// Codes that can be changed.
fn codes(table: &mut SphereTable) -> &mut Vec<f32> {
    &mut Arc::make_mut(&mut table.codebook).codes
}

fn shapes() -> Vec<Shape> {
    let full = Shape::FULL;
    vec![
        SMALL,
        VARYING,
        RESOLUTIONS,
        HALF_VECTOR,
        LEANING,
        full,
        Shape { is_isotropic: true, is_pruned: true, ..full },
        Shape { is_pruned: true, corner_weights: CornerWeights::Uniform, ..full },
        Shape { n_side: 1, codes: 1, features: 1, hidden: &[1], ..full },
        Shape { surface: Some(([16, 8], 8)), ..full },
        Shape { resolutions: 4, n_side: 32, features: 16, ..full },
        Shape { n_side: 16, codes: 1700, features: 32, hidden: &[128, 128, 128], ..full },
    ]
}

#[test]
fn files_hold_all_of_a_model() {
    for (seed, shape) in shapes().into_iter().enumerate() {
        let mut brdf = random_neubrdf(shape, seed as u64);
        brdf.validate().unwrap();
        brdf.provenance.training.insert("recipe".into(), "„default“".into());
        brdf.provenance.errors.insert("rmse".into(), 0.1 + 0.2);
        for precision in [Precision::F16, Precision::F32] {
            let bytes = brdf.encode(precision).unwrap();
            assert!(NeuBrdf::decode(&bytes).unwrap() == brdf, "{shape:?}");
        }
        // Numbers that f16 does not hold are rounded to it, once.
        brdf.layers[0].weights[0] = 0.1;
        assert!(NeuBrdf::decode(&brdf.encode(Precision::F32).unwrap()).unwrap() == brdf);
        let rounded = NeuBrdf::decode(&brdf.encode(Precision::F16).unwrap()).unwrap();
        assert_eq!(rounded.layers[0].weights[0], half::f16::from_f32(0.1).to_f32());
        assert!(NeuBrdf::decode(&rounded.encode(Precision::F16).unwrap()).unwrap() == rounded);
    }
}

/// The sizes that docs/materials.md states.
#[test]
fn files_are_small() {
    let size = |shape| random_neubrdf(shape, 1).encode(Precision::F16).unwrap().len();
    let anisotropic = size(Shape::FULL);
    assert!(anisotropic <= 96 << 10, "{anisotropic}");
    let isotropic = size(Shape { n_side: 32, is_isotropic: true, is_pruned: true, ..Shape::FULL });
    assert!(isotropic <= 48 << 10, "{isotropic}");
    eprintln!("anisotropic, N_side 64: {anisotropic} bytes; isotropic, N_side 32: {isotropic} bytes");
}

#[test]
fn a_file_that_is_cut_off_is_an_error() {
    let bytes = random_neubrdf(SMALL, 1).encode(Precision::F16).unwrap();
    for length in 0..bytes.len() {
        NeuBrdf::decode(&bytes[..length]).unwrap_err();
        if length > 48 && length != bytes.len() - 32 {
            // With a checksum that fits it.
            NeuBrdf::decode(&signed(&bytes[..length])).unwrap_err();
        }
    }
    let longer = signed(&[&bytes[..bytes.len() - 32], &[0]].concat());
    assert_eq!(NeuBrdf::decode(&longer).unwrap_err().field, "file");
}

#[test]
fn a_file_that_was_changed_is_an_error() {
    let bytes = random_neubrdf(SMALL, 1).encode(Precision::F16).unwrap();
    for at in 0..bytes.len() {
        let mut changed = bytes.clone();
        changed[at] ^= 1 << (at % 8);
        NeuBrdf::decode(&changed).unwrap_err();
    }
}

/// Bytes with their checksum behind them.
fn signed(content: &[u8]) -> Vec<u8> {
    [content, blake3::hash(content).as_bytes()].concat()
}

/// A file with another header.
fn with_header(brdf: &NeuBrdf, change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let bytes = brdf.encode(Precision::F16).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut header = serde_json::from_slice(&bytes[16..16 + length]).unwrap();
    change(&mut header);
    let header = serde_json::to_vec(&header).unwrap();
    let length = (header.len() as u32).to_le_bytes();
    let payload = &bytes[16 + u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize..bytes.len() - 32];
    signed(&[&bytes[..12], &length, &header, payload].concat())
}

#[test]
fn hostile_headers_are_errors() {
    let brdf = random_neubrdf(SMALL, 1);
    assert!(NeuBrdf::decode(&with_header(&brdf, |_| ())).unwrap() == brdf);
    let huge = [0u64, 1, 2, 6, 255, 256, 65_534, 65_535, u64::from(u32::MAX)];
    let numbers = [
        "/codebooks/0/features",
        "/codebooks/1/features",
        "/codebooks/0/codes",
        "/codebooks/1/codes",
        "/networks/0/widths/0",
        "/networks/0/widths/1",
        "/networks/0/widths/3",
        "/materials/0/network",
        "/materials/0/wi/n_side",
        "/materials/0/wo/n_side",
    ];
    let of_surface =
        ["/materials/0/surface/texels/0", "/materials/0/surface/texels/1", "/materials/0/surface/codebook"];
    let of_coarser = ["/materials/0/coarser", "/materials/0/coarser/0/0/n_side", "/materials/0/coarser/1/1/n_side"];
    let (varying, coarser) = (random_neubrdf(LEANING, 1), random_neubrdf(RESOLUTIONS, 1));
    let all = numbers.map(|pointer| (&brdf, pointer)).into_iter();
    let all = all.chain(of_surface.map(|pointer| (&varying, pointer)));
    let all = all.chain(of_coarser.map(|pointer| (&coarser, pointer)));
    for (brdf, pointer) in all {
        for value in huge.map(serde_json::Value::from).into_iter().chain([(-1).into(), 4.5.into(), "4".into()]) {
            let original = with_header(brdf, |_| ());
            let file = with_header(brdf, |header| *header.pointer_mut(pointer).unwrap() = value.clone());
            assert!(file == original || NeuBrdf::decode(&file).is_err(), "{pointer} = {value}");
        }
    }
    for (pointer, values) in [
        ("/materials/0/encoding/gain", vec![0.0, -1.0, 1e39, 1e38]),
        ("/materials/0/encoding/scale", vec![0.0, -1.0, 1e39, 1e7]),
        ("/materials/0/encoding/max", vec![0.0, -1.0, 1e39]),
    ] {
        for value in values {
            let file = with_header(&brdf, |header| *header.pointer_mut(pointer).unwrap() = value.into());
            assert!(NeuBrdf::decode(&file).is_err(), "{pointer} = {value}");
        }
    }
    // Frames that are there and not announced, or the other way round.
    for (shape, part) in [(VARYING, true), (LEANING, false)] {
        for name in ["has_normals", "has_directions"] {
            let brdf = random_neubrdf(shape, 1);
            let file = with_header(&brdf, |header| header["materials"][0]["surface"][name] = part.into());
            assert!(NeuBrdf::decode(&file).is_err(), "{name} = {part}");
        }
    }
    let more = with_header(&brdf, |header| header["surprise"] = 1.into());
    assert_eq!(NeuBrdf::decode(&more).unwrap_err().field, "header");
}

#[test]
fn models_that_cannot_be_are_refused() {
    type Change = fn(&mut NeuBrdf);
    let changes: [(&str, Change); 14] = [
        ("wi.codes", |brdf| codes(&mut brdf.wi)[0] = f32::NAN),
        ("wi.codes", |brdf| codes(&mut brdf.wi).clear()),
        ("wo.codes", |brdf| codes(&mut brdf.wo).truncate(14)),
        ("wo.indices", |brdf| brdf.wo.indices[0] = 5),
        ("wo.indices", |brdf| brdf.wo.indices[0] = NO_CODE),
        ("wi.indices", |brdf| brdf.wi.indices.truncate(7)),
        ("wi.levels", |brdf| brdf.wi.levels[0] += 1),
        ("wi.features", |brdf| Arc::make_mut(&mut brdf.wi.codebook).features = 0),
        ("layers[0]", |brdf| brdf.layers[0].inputs += 1),
        ("layers[1]", |brdf| brdf.layers[1].bias[0] = f32::INFINITY),
        ("layers[1]", |brdf| brdf.layers.iter_mut().for_each(|layer| layer.weights[0] = 1e20)),
        ("layers", |brdf| brdf.layers.truncate(2)),
        ("layers", |brdf| brdf.layers.clear()),
        ("provenance.errors", |brdf| brdf.provenance.errors = [("x".to_string(), f64::NAN)].into()),
    ];
    for (field, change) in changes {
        let mut brdf = random_neubrdf(SMALL, 1);
        change(&mut brdf);
        let Flaw { field: found, .. } = brdf.validate().unwrap_err();
        assert_eq!(found, field);
        assert!(brdf.encode(Precision::F32).is_err());
    }
    type SurfaceChange = fn(&mut SurfaceTable);
    let changes: [(&str, SurfaceChange); 5] = [
        ("surface.indices", |surface| surface.indices[2] = 5),
        ("surface.indices", |surface| surface.indices.truncate(6)),
        ("surface.indices", |surface| surface.grid = SurfaceGrid::new(4, 4).unwrap()),
        ("surface.codes", |surface| Arc::make_mut(&mut surface.codebook).codes[7] = f32::INFINITY),
        ("layers[0]", |surface| *Arc::make_mut(&mut surface.codebook) = Codebook { features: 1, codes: vec![0.0; 9] }),
    ];
    for (field, change) in changes {
        let mut brdf = random_neubrdf(VARYING, 1);
        change(brdf.surface.as_mut().unwrap());
        assert_eq!(brdf.validate().unwrap_err().field, field);
    }
    let changes: [(&str, Change); 6] = [
        ("coarser[1].n_side", |brdf| brdf.coarser.swap(0, 1)),
        ("coarser[1].n_side", |brdf| brdf.coarser[1] = brdf.coarser[0].clone()),
        ("coarser[0].wo.indices", |brdf| brdf.coarser[0][1].indices[0] = 5),
        ("coarser[1].wo.features", |brdf| {
            brdf.coarser[1][1].codebook = Codebook { features: 1, codes: vec![0.0; 9] }.into()
        }),
        ("coarser", |brdf| brdf.coarser = vec![brdf.coarser[0].clone(); 4]),
        ("layers[0]", |brdf| brdf.coarser.truncate(1)),
    ];
    for (field, change) in changes {
        let mut brdf = random_neubrdf(RESOLUTIONS, 1);
        change(&mut brdf);
        assert_eq!(brdf.validate().unwrap_err().field, field);
    }
    type FrameChange = fn(&mut SurfaceFrames);
    let changes: [(&str, FrameChange); 7] = [
        ("surface.normals", |frames| frames.normals.truncate(6)),
        ("surface.normals", |frames| frames.normals[1] = [32767, 0]),
        ("surface.normals", |frames| frames.normals[2] = [i16::MIN, 0]),
        ("surface.normals", |frames| frames.normals[2] = [30000, -20000]),
        ("surface.directions", |frames| frames.directions.push([32767, 0])),
        ("surface.directions", |frames| frames.directions[3] = [0, 0]),
        ("surface.directions", |frames| frames.directions[3] = [i16::MIN, 0]),
    ];
    for (field, change) in changes {
        let mut brdf = random_neubrdf(LEANING, 1);
        change(&mut brdf.surface.as_mut().unwrap().frames);
        assert_eq!(brdf.validate().unwrap_err().field, field);
    }
    let mut brdf = random_neubrdf(SMALL, 1);
    codes(&mut brdf.wi)[0] = 1e5;
    assert_eq!(brdf.encode(Precision::F16).unwrap_err().field, "codebooks[0].codes");
}

#[test]
fn errors_name_the_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("x.neubrdf");
    fs::write(&path, b"NEUBRDF").unwrap();
    let message = NeuBrdf::load(&path, None).unwrap_err().to_string();
    assert!(message.contains("x.neubrdf: file: found 7 bytes"), "{message}");
    let brdf = random_neubrdf(SMALL, 1);
    fs::write(&path, brdf.encode(Precision::F32).unwrap()).unwrap();
    assert!(NeuBrdf::load(&path, None).unwrap() == brdf);
}

static FILES: LazyLock<[Vec<u8>; 6]> = LazyLock::new(|| {
    [(SMALL, 0), (SMALL, 1), (VARYING, 2), (VARYING, 3), (RESOLUTIONS, 4), (LEANING, 5)]
        .map(|(shape, seed)| random_neubrdf(shape, seed).encode(Precision::F16).unwrap())
});

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    /// Whatever a file says, with a checksum that fits, it is an error or a model that can be evaluated everywhere.
    #[test]
    fn any_file_is_an_error_or_a_valid_model(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        seed in 0u64..6,
    ) {
        let bytes = &FILES[seed as usize];
        let mut content = bytes[..bytes.len() - 32].to_vec();
        for (at, value) in changes {
            let at = at.index(content.len());
            content[at] = value;
        }
        if let Ok(brdf) = NeuBrdf::decode(&signed(&content)) {
            brdf.validate().unwrap();
            let mut random = Stream(seed);
            for _ in 0..20 {
                let footprint = Footprint { uv: DVec2::new(random.unit(), 3.0 * random.unit()), area: random.unit() };
                let value = brdf.eval_at(footprint, random.direction(), random.direction());
                prop_assert!(value.is_finite() && value.min_element() >= 0.0);
            }
        }
    }
}

#[test]
fn a_mesh_without_texture_coordinates_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    let scene = "[[mesh]]\nfile = \"a.obj\"\n[environment]\nradiance = 1\n[material.m]\ntype = \"measured\"\nfile = \"m.neubrdf\"\n";
    write("scene.toml", scene.as_bytes());
    let faces =
        |corner: &str| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1{corner} 2{corner} 3{corner}\n");
    for (shape, corner, warns) in [(VARYING, "", true), (VARYING, "/1", false), (SMALL, "", false)] {
        write("m.neubrdf", &random_neubrdf(shape, 1).encode(Precision::F16).unwrap());
        write("a.obj", faces(corner).as_bytes());
        let (_, warnings) = Scene::load(folder.path().join("scene.toml")).unwrap();
        let found = warnings.iter().any(|warning| warning.message.contains("without texture coordinates"));
        assert_eq!(found, warns, "{warnings:?}");
    }
}

/// The network by hand: a feature a hemisphere, a layer that passes them on, and one more.
#[test]
fn values_are_those_of_the_formula() {
    let shape =
        Shape { n_side: 1, codes: 1, features: 1, hidden: &[2], is_isotropic: false, is_pruned: false, ..SMALL };
    let mut brdf = random_neubrdf(shape, 1);
    (codes(&mut brdf.wi)[0], codes(&mut brdf.wo)[0]) = (2.0, 3.0);
    brdf.layers[0].weights = vec![1.0, 1.0, 1.0, -1.0];
    brdf.layers[0].bias = vec![-3.0, 0.0];
    brdf.layers[1].weights = vec![1.0, 7.0, 1.5, 7.0, -1.5, 7.0];
    brdf.layers[1].bias = vec![0.5, 0.5, 2.0];
    let value = brdf.eval(DVec3::Z, DVec3::Z);
    let expected = [2.5f64, 3.5, -1.0].map(|y| (((2.0 * y).exp() - 1.0) / 100.0).max(0.0));
    assert!((value - DVec3::from(expected)).length() < 1e-14, "{value}");
    brdf.encoding.max = 2.0;
    assert_eq!(brdf.eval(DVec3::Z, DVec3::Z).y, 2.0);
}

/// Isotropic materials do not change when both directions are turned, or mirrored; the others do.
#[test]
fn isotropic_materials_look_the_same_from_all_sides() {
    let mut random = Stream(1);
    for is_isotropic in [true, false] {
        let brdf = random_neubrdf(Shape { is_isotropic, n_side: 16, ..Shape::FULL }, 3);
        let mut differences = 0;
        for _ in 0..200 {
            let (wo, wi) = (random.direction(), random.direction());
            let (sin, cos) = (6.0 * random.unit()).sin_cos();
            let turn = |w: DVec3| DVec3::new(cos * w.x - sin * w.y, sin * w.x + cos * w.y, w.z);
            let mirror = |w: DVec3| DVec3::new(w.x, -w.y, w.z);
            let value = brdf.eval(wo, wi);
            let close = |other: DVec3| (other - value).length() <= 1e-9 * value.length();
            differences +=
                usize::from(!close(brdf.eval(turn(wo), turn(wi))) || !close(brdf.eval(mirror(wo), mirror(wi))));
        }
        assert!(if is_isotropic { differences == 0 } else { differences > 150 }, "{differences}");
    }
}

/// A frame turns what there is: the value about the surface's normal is that about the frame's, times what that receives. Frames that are the
/// surface's own change nothing, to the bit, and are not stored.
#[test]
fn frames_turn_materials() {
    let mut random = Stream(1);
    for is_isotropic in [true, false] {
        let flat = random_neubrdf(Shape { is_isotropic, surface: Some(([1, 1], 3)), n_side: 16, ..Shape::FULL }, 3);
        let with = |frame: SurfaceFrame| {
            let mut brdf = flat.clone();
            brdf.surface.as_mut().unwrap().frames = SurfaceFrames::new(&[frame]);
            brdf
        };
        let own = with(SurfaceFrame::OWN);
        assert!(own == flat && own.encode(Precision::F16) == flat.encode(Precision::F16));
        let leaning = with(SurfaceFrame { normal: DVec3::new(0.48, 0.36, 0.8), doubled: DVec2::new(-0.6, 0.8) });
        let frame = leaning.surface.as_ref().unwrap().frame(Footprint::WHOLE).unwrap();
        assert!(frame.normal.distance(DVec3::new(0.48, 0.36, 0.8)) < 1e-4);
        let mut below = 0;
        for _ in 0..500 {
            let (wo, wi) = (random.direction(), random.direction());
            let found = leaning.eval(wo, wi);
            let [o, i] = [wo, wi].map(|w| frame.axes().transpose() * w);
            if o.z < 0.0 || i.z < 0.0 {
                below += 1;
                assert_eq!(found, DVec3::ZERO);
            } else {
                assert!((found - flat.eval(o, i) * frame.received(wi)).length() <= 1e-12 * found.length());
            }
        }
        assert!((20..250).contains(&below), "{below}");
        assert!(!leaning.is_isotropic_about_z() && flat.is_isotropic_about_z() == is_isotropic);
    }
}

#[test]
fn turning_keeps_the_angles() {
    let mut random = Stream(1);
    for _ in 0..1000 {
        let (wo, wi) = (random.direction(), random.direction());
        let [o, i] = turned(wo, wi);
        assert!((o.dot(i) - wo.dot(wi)).abs() < 1e-12 && (o.length() - 1.0).abs() < 1e-12);
        assert!(o.y >= 0.0 && i.y == 0.0 && i.x >= 0.0 && o.z == wo.z && i.z == wi.z);
    }
    assert_eq!(turned(DVec3::new(-0.6, 0.0, 0.8), DVec3::Z), [DVec3::new(0.6, 0.0, 0.8), DVec3::Z]);
}

/// Continuous features make a continuous material; quarters do not.
#[test]
fn bilinear_weights_are_continuous() {
    for (corner_weights, is_continuous) in [(CornerWeights::Bilinear, true), (CornerWeights::Uniform, false)] {
        let brdf = random_neubrdf(Shape { n_side: 16, corner_weights, ..Shape::FULL }, 3);
        let mut random = Stream(5);
        let mut worst = 0.0f64;
        for _ in 0..300 {
            let (wi, from, to) = (random.direction(), random.direction(), random.direction());
            let value = |t: f64| (100.0 * brdf.eval((from + t * to).normalize(), wi) + 1.0).map(f64::ln);
            // Halves an arc again and again and keeps the half in which more happens: it ends at a step if there is one.
            let (mut low, mut high) = (0.0, 0.1);
            let mut change = f64::INFINITY;
            while high - low > 1e-10 {
                let middle = 0.5 * (low + high);
                let halves = [(low, middle), (middle, high)].map(|(a, b)| (value(a).distance(value(b)), a, b));
                (change, low, high) = if halves[0].0 > halves[1].0 { halves[0] } else { halves[1] };
            }
            worst = worst.max(change);
        }
        assert_eq!(worst < 1e-5, is_continuous, "{corner_weights:?}: {worst:e}");
    }
}

/// Pruning changes nothing where there was data, keeps few points of an isotropic ωi, and leaves a model everywhere.
#[test]
fn pruning_keeps_what_was_trained() {
    let shape = Shape { is_isotropic: true, n_side: 32, ..Shape::FULL };
    let whole = random_neubrdf(shape, 9);
    let grid = SphereGrid::new(32).unwrap();
    let mut random = Stream(11);
    let pairs: Vec<[DVec3; 2]> = (0..20_000).map(|_| turned(random.direction(), random.direction())).collect();
    let mut pruned = whole.clone();
    let mut has_data = [vec![false; grid.pixel_count()], vec![false; grid.pixel_count()]];
    for [wo, wi] in &pairs {
        has_data[0][grid.locate(*wo).pixel as usize] = true;
        has_data[1][grid.locate(*wi).pixel as usize] = true;
    }
    pruned.wo.prune(|pixel| has_data[0][pixel as usize]);
    pruned.wi.prune(|pixel| has_data[1][pixel as usize]);
    pruned.validate().unwrap();
    for [wo, wi] in &pairs {
        assert_eq!(pruned.eval(*wo, *wi), whole.eval(*wo, *wi));
    }
    let kept = |indices: &[u16]| indices.iter().filter(|index| **index != NO_CODE).count();
    assert!(kept(&pruned.wi.indices) < 9 * 32, "{}", kept(&pruned.wi.indices));
    assert!(kept(&pruned.wo.indices) < grid.point_count() * 55 / 100, "{}", kept(&pruned.wo.indices));
    // Without any data there is nothing to keep, and nothing changes.
    let mut unseen = whole.clone();
    unseen.wi.prune(|_| false);
    assert!(unseen == whole);
    assert_eq!(whole.provenance, Provenance { source: "random numbers".into(), ..Provenance::default() });
}
