//! Picture files keep what is written to them, and damaged ones are errors.

use std::fs;
use std::path::Path;

use neubrdf::image::{
    Error, Metadata, Picture, Samples, atomic_write, check_writable, plane, read_exr, tone_map, write_exr, write_file,
    write_png,
};
use proptest::prelude::*;

fn picture() -> Picture {
    let mut picture = Picture::new(7, 5);
    let beauty: Vec<[f32; 3]> = (0..35).map(|i| [i as f32 * 0.1, 1e-30, 1e30 / (i + 1) as f32]).collect();
    picture.set_rgb(plane::BEAUTY, &beauty);
    picture.set_rgb(plane::VARIANCE, &beauty);
    picture.set(plane::DEPTH, Samples::F32(vec![f32::INFINITY; 35]));
    picture.set(plane::PRIMITIVE_ID, Samples::U32((0..35).map(|i| plane::NO_ID - i).collect()));
    picture
}

fn metadata() -> Metadata {
    Metadata {
        scene_hash: "0123abcd".into(),
        spp: 1 << 40,
        seed: u64::MAX,
        max_depth: 16,
        clamp_indirect: 10.5,
        render_seconds: 12.5,
        device: "llvmpipe (LLVM 19.1.7, 256 bits)".into(),
        version: "0.1.0".into(),
        sampler: "sobol".into(),
        traversal: "bvh".into(),
        camera_eye: [1.0, 2.0, 3.0],
        camera_target: [0.0, 0.5, 0.1],
        camera_up: [0.0, 1.0, 0.0],
        vertical_fov_degrees: 39.3,
        film_size: [70, 50],
        crop_origin: [20, 30],
    }
}

#[test]
fn exr_keeps_every_plane_and_every_field() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("picture.exr");
    write_exr(&path, &picture(), &metadata()).unwrap();
    let (read_picture, read_metadata) = read_exr(&path).unwrap();
    assert_eq!(read_picture, picture());
    assert_eq!(read_metadata, metadata());
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1, "no temporary file is left");
}

#[test]
fn only_planes_that_are_there_are_written() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("picture.exr");
    let mut beauty_only = Picture::new(1, 1);
    beauty_only.set_rgb(plane::BEAUTY, &[[0.25, 0.5, 1.0]]);
    write_exr(&path, &beauty_only, &Metadata::default()).unwrap();
    let (read, metadata) = read_exr(&path).unwrap();
    assert_eq!(read.names().collect::<Vec<_>>(), ["B", "G", "R"]);
    assert_eq!(metadata.film_size, [1, 1]);
}

#[test]
fn a_failed_write_leaves_the_old_file() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("file");
    fs::write(&path, "old").unwrap();
    let result = atomic_write(&path, |writer| {
        use std::io::Write;
        writer.write_all(b"half of the new").unwrap();
        Err(Error::Encode { path: path.clone(), reason: "power cut".into() })
    });
    assert!(result.is_err());
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
}

#[test]
fn directories_devices_and_absent_files_are_errors() {
    let directory = tempfile::tempdir().unwrap();
    assert!(write_exr(directory.path(), &picture(), &metadata()).is_err());
    assert!(write_exr(directory.path().join("absent/picture.exr"), &picture(), &metadata()).is_err());
    assert!(write_exr("/dev/null", &picture(), &metadata()).is_err());
    assert!(read_exr(directory.path()).is_err());
    assert!(read_exr("/dev/zero").is_err());
    let error = read_exr(directory.path().join("absent.exr")).unwrap_err();
    assert!(error.to_string().contains("absent.exr"), "{error}");
}

/// By the mode alone: root may write what nobody may.
#[test]
fn a_read_only_file_is_not_replaced() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("kept.exr");
    fs::write(&path, "old").unwrap();
    let mut permissions = fs::metadata(&path).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&path, permissions).unwrap();
    for result in [write_file(&path, "new"), check_writable(&path).map(|_| ())] {
        let message = result.unwrap_err().to_string();
        assert!(message.contains("kept.exr: is read-only"), "{message}");
    }
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
}

/// Relative, absolute, one to another, and to what is not there yet.
#[test]
#[cfg(unix)]
fn what_a_link_leads_to_is_written_and_the_link_stays() {
    use std::os::unix::fs::symlink;
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    fs::create_dir(at("far")).unwrap();
    fs::write(at("far/old"), "old").unwrap();
    symlink("far/old", at("relative")).unwrap();
    symlink(at("far/new"), at("absolute")).unwrap();
    symlink("../relative", at("far/twice")).unwrap();
    for (link, file) in [("relative", "far/old"), ("absolute", "far/new"), ("far/twice", "far/old")] {
        assert_eq!(check_writable(at(link)).unwrap().canonicalize().ok(), at(file).canonicalize().ok());
        write_file(at(link), link).unwrap();
        assert_eq!(fs::read_to_string(at(file)).unwrap(), link);
        assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link}");
    }
    assert_eq!(fs::read_dir(at("far")).unwrap().count(), 3, "no temporary file is left");
    symlink("round", at("round")).unwrap();
    symlink("nowhere/file", at("lost")).unwrap();
    for (link, says) in [("round", "leads to no end"), ("lost", "there is no directory")] {
        let message = write_file(at(link), "").unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    }
}

#[test]
fn png_shows_the_tone_mapped_beauty() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("picture.png");
    let mut picture = Picture::new(2, 1);
    picture.set_rgb(plane::BEAUTY, &[[0.5 + 0.04; 3], [f32::NAN, -1.0, f32::INFINITY]]);
    write_png(&path, &picture, 0.0).unwrap();
    let decoded = image::open(&path).unwrap().into_rgb8();
    // Below 0.76 the operator only takes away the 4 % that a dielectric's surface adds.
    assert_eq!(decoded.get_pixel(0, 0).0, [188; 3]);
    assert_eq!(decoded.get_pixel(1, 0).0[2], 255);
    assert!(write_png(&path, &Picture::new(2, 1), 0.0).unwrap_err().to_string().contains("R, G, B"));
}

#[test]
fn the_tone_map_rises_and_stays_below_one() {
    let values: Vec<f32> = (0..4000).map(|i| tone_map::neutral([i as f32 * 0.01; 3], 0.0)[0]).collect();
    assert!(values.windows(2).all(|pair| pair[0] <= pair[1]));
    assert!(values.iter().all(|value| (0.0..=1.0).contains(value)));
}

/// Where an EXR of a few bytes says 100 000 × 100 000, nothing of that size may be allocated.
#[test]
fn an_absurd_size_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("picture.exr");
    write_exr(&path, &picture(), &Metadata::default()).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let name = b"dataWindow\0box2i\0";
    let position = bytes.windows(name.len()).position(|window| window == name).unwrap() + name.len() + 4;
    bytes[position..position + 16].copy_from_slice(bytemuck::bytes_of(&[0_i32, 0, 99_999, 99_999]));
    fs::write(&path, &bytes).unwrap();
    assert!(matches!(read_exr(&path).unwrap_err(), Error::Implausible { width: 100_000, .. }));
}

#[test]
fn every_truncation_is_an_error() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("picture.exr");
    write_exr(&path, &picture(), &metadata()).unwrap();
    let bytes = fs::read(&path).unwrap();
    for length in (0..bytes.len()).step_by(3) {
        fs::write(&path, &bytes[..length]).unwrap();
        assert!(read_exr(&path).is_err(), "{length} of {} bytes", bytes.len());
    }
}

fn read_bytes(directory: &Path, bytes: &[u8]) {
    let path = directory.join("picture.exr");
    fs::write(&path, bytes).unwrap();
    // Either answer will do; a crash will not.
    let _ = read_exr(&path);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn damage_is_survived(damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("picture.exr");
        write_exr(&path, &picture(), &metadata()).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        for (index, value) in damage {
            let index = index.index(bytes.len());
            bytes[index] = value;
        }
        read_bytes(directory.path(), &bytes);
    }

    #[test]
    fn garbage_is_survived(garbage in prop::collection::vec(any::<u8>(), 0..600), with_magic in any::<bool>()) {
        let directory = tempfile::tempdir().unwrap();
        let mut bytes = if with_magic { vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0] } else { Vec::new() };
        bytes.extend(garbage);
        read_bytes(directory.path(), &bytes);
    }
}
