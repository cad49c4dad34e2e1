//! Broken and hostile files: whatever the bytes, loading ends in valid data or in an error that names the file.

use std::fs;
use std::path::Path;

use neubrdf::material::Evaluate;
use neubrdf::scene::{Brdf, Merl};

use crate::common::tables::{self, metal};
use crate::random::Random;

/// Loads, and uses what was loaded.
fn load(path: &Path) -> Result<(), String> {
    let brdf = Brdf::load(path, None).map_err(|error| error.to_string())?;
    let mut random = Random(1);
    for _ in 0..20 {
        let value = brdf.eval(random.above(1e-6), random.above(1e-6));
        assert!(value.is_finite() && value.min_element() >= 0.0 && value.max_element() < 1e30, "{value}");
    }
    Ok(())
}

/// Cuts, changes and lengthens a file.
fn mangle(name: &str, intact: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let with = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let outcome = load(&path);
        if let Err(message) = &outcome {
            assert!(message.contains(name) && message.len() < 1000, "{message}");
        }
        outcome
    };
    assert_eq!(with(intact), Ok(()));
    for length in (0..intact.len()).step_by(1 + intact.len() / 300) {
        let _ = with(&intact[..length]);
    }
    assert!(with(b"").is_err());
    let mut random = Random(intact.len() as u64);
    for at in (0..intact.len().min(600)).chain((600..intact.len()).step_by(1 + intact.len() / 100)) {
        for value in [0xff, 0, intact[at] ^ 0x10, (random.unit() * 256.0) as u8] {
            let mut broken = intact.to_vec();
            broken[at] = value;
            let _ = with(&broken);
        }
    }
    for _ in 0..50 {
        let garbage: Vec<u8> = (0..1000).map(|_| (random.unit() * 256.0) as u8).collect();
        assert!(with(&garbage).is_err());
        assert!(with(&[&intact[..16], &garbage[..]].concat()).is_err());
    }
    fs::remove_file(&path).unwrap();
    assert!(load(&path).unwrap_err().contains("cannot be read"));
    fs::create_dir(&path).unwrap();
    assert!(load(&path).unwrap_err().contains("cannot be read"));
}

#[test]
fn any_tensor_file_is_survived() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bsdf");
    let phi = (0..5).map(|i| -std::f32::consts::PI * (1.0 - i as f32 / 4.0)).collect();
    fs::write(&path, tables::rgl(&metal(0.3, 0.5), phi, 4).tables().encode()).unwrap();
    mangle("a.bsdf", &fs::read(&path).unwrap());
}

#[test]
fn any_csv_file_is_survived() {
    let text = "wi_theta,wi_phi,wo_theta,wo_phi,r,g,b\n1,2,3,4,5,6,7\n89.99,-360,0,360,1e8,0,1e-300\n";
    mangle("a.csv", text.as_bytes());
}

#[test]
fn any_merl_file_is_survived() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.binary");
    let header: Vec<u8> = [90i32, 90, 180].iter().flat_map(|side| side.to_le_bytes()).collect();
    let whole = 12 + Merl::CELLS * 24;
    let with = |bytes: &[u8], length: usize| {
        fs::write(&path, bytes).unwrap();
        fs::File::options().write(true).open(&path).unwrap().set_len(length as u64).unwrap();
        load(&path)
    };
    assert_eq!(with(&header, whole), Ok(()), "a black material");
    for number in [f64::NAN, f64::INFINITY, 1e300] {
        let message = with(&[&header[..], &number.to_le_bytes()].concat(), whole).unwrap_err();
        assert!(message.contains("a.binary: channel 0, cell 0"), "{message}");
    }
    for number in [-1.0, -f64::MAX, f64::MIN_POSITIVE, -0.0, f64::NEG_INFINITY] {
        let _ = with(&[&header[..], &number.to_le_bytes()].concat(), whole);
    }
    for length in [0, 4, 11, 12, 13, whole - 1, whole + 1] {
        let message = with(&header, length).unwrap_err();
        assert!(message.contains("a.binary"), "{message}");
    }
    for size in [[90i32, 90, 90], [0, 0, 0], [-90, -90, 180], [i32::MAX; 3], [180, 90, 90]] {
        let bytes: Vec<u8> = size.iter().flat_map(|side| side.to_le_bytes()).collect();
        let message = with(&bytes, whole).unwrap_err();
        assert!(message.contains("dimensions") && message.contains("[90, 90, 180]"), "{message}");
    }
}
