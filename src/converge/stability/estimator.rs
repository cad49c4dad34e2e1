//! Hard estimates.

use glam::Vec3;

use super::build::*;
use super::geometry::{degenerate, moved};
use super::{Case, Expected, Trial};
use crate::render::BsdfSampling;
use crate::scene::{Film, Scene, Surface};

pub fn cases() -> Vec<Case> {
    vec![
        Case {
            name: "densities that vanish where f does not",
            why: "cosine-sampled directions at grazing, where a metal shines most: f/pdf grows without bound",
            is_known_limit: false,
            trial: strategy(BsdfSampling::Cosine),
        },
        Case {
            name: "uniform directions",
            why: "densities that know nothing of the material, weighed against light samples",
            is_known_limit: false,
            trial: strategy(BsdfSampling::Uniform),
        },
        Case {
            name: "no light samples",
            why: "weights must be 1 wherever nothing competes",
            is_known_limit: false,
            trial: {
                let mut trial = Trial::new(still_life(1.0)).samples(256).without_light_sampling();
                trial.scene.environment = Some(crate::scene::Environment::constant(Vec3::splat(0.3)));
                trial
            },
        },
        Case {
            name: "a firefly trap",
            why: "a small lamp seen by the floor through rough glass: rare paths carry nearly all of the light",
            is_known_limit: false,
            trial: Trial::new(firefly_trap()).depth(8).samples(128),
        },
        shared(
            "shared paths in a scene of 10⁻⁴",
            "what pixels take from one another goes by 1/r², here 10⁸ and more",
            still_life(1e-4),
        ),
        shared("shared paths in a scene of 10⁷", "and here 10⁻¹⁴", still_life(1e7)),
        shared(
            "shared paths 10⁴ from the origin",
            "rays between two surfaces start and end off both by what rounding may have done to either",
            moved(still_life(1.0), at(1e4, -1e4, 1e4)),
        ),
        shared("shared paths at degenerate triangles", "slivers and what has no normal send and receive", degenerate()),
        sized(24, 24, 1).case("1 spp", "nothing is known of a spread"),
        sized(1, 1, 16).case("1 × 1 pixels", "less than a workgroup"),
        sized(16_384, 1, 5).case("16384 × 1 pixels", "more than a pool, in one row"),
        sized(37, 29, 3).case("37 × 29 pixels", "no multiple of any workgroup"),
    ]
}

/// All diffuse, under a sky: so little noise that the test is of small blocks.
fn shared(name: &'static str, why: &'static str, mut scene: Scene) -> Case {
    scene.materials[1] = material(diffuse(0.7));
    scene.environment = Some(crate::scene::Environment::constant(Vec3::splat(0.3)));
    let mut trial = Trial::new(scene).samples(512);
    trial.settings.path_reuse = true;
    trial.case(name, why)
}

fn strategy(bsdf_sampling: BsdfSampling) -> Trial {
    let mut scene = still_life(1.0);
    scene.materials[1] = material(conductor(0.9, 0.4));
    scene.environment = Some(crate::scene::Environment::constant(Vec3::splat(0.3)));
    let mut trial = Trial::new(scene).samples(128);
    trial.settings.bsdf_sampling = bsdf_sampling;
    trial
}

fn firefly_trap() -> Scene {
    let mut scene = still_life(1.0);
    scene.materials[1] = material(Surface::Dielectric { ior: 1.5, alpha: 0.2 });
    scene.meshes[2] = ceiling(0.2, 2.5, 2);
    scene.materials[2] = lamp(60.0);
    scene
}

/// A white floor under a white sky fills the picture: every pixel is 1 at any number of samples.
fn sized(width: u32, height: u32, samples: u32) -> Trial {
    let mut scene = furnace(vec![floor(1.0, 0.0, 0)], vec![material(diffuse(1.0))], at(0.0, 2.0, 0.5), Vec3::ZERO);
    scene.film = Film { width, height };
    Trial::new(scene).samples(samples).without_light_sampling().expecting(Expected::Radiance(1.0, 1e-5))
}
