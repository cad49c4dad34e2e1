//! Networks at many directions together: what they are at one at a time.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use neubrdf::material::{Bsdf, Evaluate, Prepared, Query};
use neubrdf::scene::brdf::Footprint;
use neubrdf::scene::{Brdf, Surface};

use crate::common::networks::{made, neubrdfs};
use crate::common::neubrdf_parity::hard_directions;
use crate::common::random_neubrdf::{Shape, Stream, random_neubrdf};
use crate::{LEANING, shapes};

/// Values that are smaller count as this: what is left of a network's sum that cancels is its rounding.
const SMALL: f64 = 1e-3;

/// Poles, grid points, grazing angles, directions that are equal or opposite in azimuth, and any.
fn queries(random: &mut Stream) -> Vec<Query> {
    let hard: Vec<DVec3> = hard_directions(4).into_iter().map(|w| w.as_dvec3()).collect();
    let mut pairs: Vec<[DVec3; 2]> = hard.iter().map(|w| [*w, random.direction()]).collect();
    pairs.extend(hard.iter().map(|w| [random.direction(), *w]));
    pairs.extend(hard.iter().map(|w| [*w, *w]));
    pairs.extend(hard.iter().map(|w| [*w, DVec3::new(-w.x, -w.y, w.z)]));
    pairs.extend((0..200).map(|_| [random.direction(), random.direction()]));
    let mut query = |[wo, wi]: [DVec3; 2]| {
        let area = [0.0, 1e-4, 0.1, f64::INFINITY][random.below(4)];
        Query { footprint: Footprint { uv: DVec2::new(random.unit(), random.unit()), area }, wo, wi }
    };
    pairs.into_iter().map(&mut query).collect()
}

#[test]
fn many_are_what_each_is() {
    let leaning = [false, true].map(|is_isotropic| Shape { is_isotropic, n_side: 8, ..LEANING });
    let made = shapes().into_iter().chain(leaning).enumerate();
    let mut brdfs: Vec<(String, Arc<Brdf>)> = made
        .map(|(seed, shape)| {
            (format!("{shape:?}"), Arc::new(Brdf::NeuBrdf(Box::new(random_neubrdf(shape, seed as u64)))))
        })
        .collect();
    brdfs.extend(neubrdfs());
    let mut random = Stream(1);
    let queries = queries(&mut random);
    for (name, brdf) in &brdfs {
        let network = brdf.neubrdf().expect("a network");
        let together = network.eval_many(&queries);
        let mut worst = 0.0f64;
        for (found, Query { footprint, wo, wi }) in together.iter().zip(&queries) {
            let value = brdf.eval_at(*footprint, *wo, *wi);
            let error = ((*found - value).abs() / (value + SMALL)).max_element();
            assert!(error < 1e-12, "{name}: {found}, not {value}, at {wo} {wi} {footprint:?}");
            worst = worst.max(error);
        }
        println!("{worst:.1e} {name}");
        // To the bit the same in whatever company.
        let mut start = 0;
        for count in [0, 1, 2, 15, 16, 17, 63, 64, 65, 130] {
            let part = start..start + count;
            assert_eq!(network.eval_many(&queries[part.clone()]), together[part], "{name}, {count}");
            start += count;
        }
    }
}

/// A BSDF asks its network for what it would say itself; not below the horizon, where there is nothing, and closed forms and small networks,
/// which gain nothing, never ask.
#[test]
fn networks_are_asked_above_the_horizon_only() {
    let mut random = Stream(2);
    for (name, brdf) in neubrdfs() {
        let prepared = Prepared::new(&Surface::Measured { brdf: 0 }, &[brdf]);
        let bsdf = Bsdf::new(&prepared, DVec3::ONE);
        for _ in 0..20 {
            let (wo, wi) = (random.direction(), random.direction());
            let (asked, query) = bsdf.query(wo, wi).unwrap();
            let (found, value) = (asked.eval_many(&[query])[0], bsdf.eval(wo, wi));
            assert!(((found - value).abs() / (value + SMALL)).max_element() < 1e-12, "{name}: {found}, not {value}");
            for (wo, wi) in [(wo, -wi), (-wo, wi), (-wo, -wi), (wo, DVec3::X)] {
                assert!(bsdf.query(wo, wi).is_none() && bsdf.eval(wo, wi) == DVec3::ZERO, "{name}");
            }
        }
    }
    let nbrdf = Arc::new(Brdf::Nbrdf(made(1.0, 4.0, 0.1)));
    for prepared in [Prepared::Diffuse, Prepared::new(&Surface::Measured { brdf: 0 }, &[nbrdf])] {
        assert!(Bsdf::new(&prepared, DVec3::ONE).query(DVec3::Z, DVec3::Z).is_none());
    }
}
