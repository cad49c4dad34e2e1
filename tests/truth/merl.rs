//! MERL tables.

use std::sync::OnceLock;

use glam::{DMat3, DVec3, Vec3};
use neubrdf::scene::{Brdf, HalfDifference, Merl};

use crate::common::tables::{self, metal};
use crate::random::Random;

/// The table of a metal, with the directions below the surface unmeasured.
pub fn table() -> &'static Merl {
    static TABLE: OnceLock<Merl> = OnceLock::new();
    TABLE.get_or_init(|| tables::merl(&metal(0.3, 0.3)))
}

#[test]
fn angles_are_those_of_the_pair() {
    let mut random = Random(1);
    for _ in 0..10_000 {
        let (wo, wi) = (random.above(0.0), random.above(0.0));
        let pair = HalfDifference::new(wo, wi);
        let angles = [pair.theta_half(), pair.theta_difference(), pair.phi_difference()];
        let (a, b) = HalfDifference::directions(angles);
        // The same pair up to a turn about the normal and to an exchange.
        let turned = |w: DVec3| DMat3::from_rotation_z(pair.half.y.atan2(pair.half.x)) * w;
        let error = (turned(a) - wo).length().min((turned(b) - wo).length());
        assert!(error < 1e-9, "{wo} {wi}: {angles:?}, off by {error}");
        let other = HalfDifference::new(wi, wo);
        assert!((other.across + pair.across).length() < 1e-15);
    }
}

#[test]
fn a_table_is_the_function_that_it_was_made_of() {
    let (table, metal) = (table(), metal(0.3, 0.3));
    let mut random = Random(2);
    for cell in (0..Merl::CELLS).step_by(997) {
        let (wo, wi) = HalfDifference::directions(Merl::angles(cell));
        if wo.z.min(wi.z) > 0.01 {
            let (found, expected) = (table.eval(wo, wi), metal.eval(wo, wi));
            assert!(
                (found - expected).abs().max_element() <= 1e-5 * expected.max_element(),
                "cell {cell}: {found}, not {expected}"
            );
        }
    }
    let mut worst: f64 = 0.0;
    for _ in 0..20_000 {
        let (wo, wi) = (random.above(0.3), random.above(0.3));
        let (found, expected) = (table.eval(wo, wi), metal.eval(wo, wi));
        worst = worst.max((found - expected).abs().max_element() / expected.max_element());
        assert!((found - table.eval(wi, wo)).abs().max_element() <= 1e-9 * found.max_element(), "reciprocity");
        let turn = DMat3::from_rotation_z(random.unit() * 6.0);
        let turned = table.eval(turn * wo, turn * wi);
        assert!((found - turned).abs().max_element() <= 1e-9 * found.max_element(), "isotropy");
    }
    assert!(worst < 0.01, "between cells: off by {worst}");
}

#[test]
fn cells_without_a_measurement_are_as_their_neighbours() {
    // Of θd only a part is measured, of φd a half: there, 2.
    let table =
        Merl::tabulate(|[_, theta, phi]| ((0.3..1.0).contains(&theta) && phi < 1.5).then_some(Vec3::splat(2.0)));
    let mut random = Random(3);
    for _ in 0..10_000 {
        let (wo, wi) = (random.above(0.0), random.above(0.0));
        let value = table.eval(wo, wi);
        let azimuth = HalfDifference::new(wo, wi).phi_difference();
        let expected = if (0.02..1.48).contains(&azimuth) {
            2.0
        } else if (1.52..3.12).contains(&azimuth) {
            0.0
        } else {
            continue;
        };
        assert!((value - expected).abs().max_element() < 1e-12, "{value} at φd {azimuth}");
    }
}

#[test]
fn files_keep_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("metal.binary");
    std::fs::write(&path, table().encode()).unwrap();
    assert_eq!(std::fs::metadata(&path).unwrap().len(), 34_992_012, "the length of the published files");
    let Brdf::Merl(read) = Brdf::load(&path, None).unwrap() else { panic!("another kind") };
    let close = |a: f32, b: f32| (a - b).abs() <= 1e-6 * a.abs();
    assert!(read.values().iter().flatten().zip(table().values().iter().flatten()).all(|(a, b)| close(*a, *b)));
}
