//! Training several materials with one codebook a hemisphere.

use std::sync::Arc;

use glam::DVec3;
use neubrdf::scene::brdf::{NeuBrdfPack, Precision};
use neubrdf::train::measure::pair_errors;
use neubrdf::train::{Evaluator, Group, Plan, Recipe, Session};

use crate::{isotropic, metal, satin, small};

type Eval = Box<dyn Fn(DVec3, DVec3) -> DVec3 + Sync>;

/// Three materials that have little in common.
fn truths() -> [Eval; 3] {
    let rough = metal(0.6, 0.6);
    [Box::new(satin), Box::new(move |wo, wi| rough.eval(wo, wi)), Box::new(|_, _| DVec3::new(0.05, 0.1, 0.2))]
}

fn group(plan: &Plan, shares_network: bool) -> Group {
    let session = |eval: &Eval| Session::new(plan.clone(), &isotropic(&**eval)).unwrap();
    Group::new(truths().iter().map(session).collect(), shares_network).unwrap()
}

fn finish(group: &mut Group) -> Vec<u8> {
    group.run(u32::MAX);
    let named = |(index, brdf)| (format!("m{index}"), brdf);
    NeuBrdfPack { materials: group.neubrdfs().into_iter().enumerate().map(named).collect() }
        .encode(Precision::F32)
        .unwrap()
}

/// Codes given soon, and those of the paper's from the start.
fn small_plans() -> [Plan; 2] {
    [
        Plan { codes: [24; 2], steps: 400, ..small(Recipe::Default) },
        Plan { codes: [16; 2], pruned: 16, n_side: [4; 2], ..Plan { recipe: Recipe::Paper, ..small(Recipe::Default) } },
    ]
}

#[test]
fn a_group_shares_what_it_is_to_share() {
    for plan in small_plans() {
        for shares_network in [false, true] {
            let pack = NeuBrdfPack::decode(&finish(&mut group(&plan, shares_network))).unwrap();
            let members: Vec<_> = pack.materials.iter().map(|(_, member)| member).collect();
            for member in &members {
                assert!(Arc::ptr_eq(&member.wi.codebook, &members[0].wi.codebook));
                assert!(Arc::ptr_eq(&member.wo.codebook, &members[0].wo.codebook));
                assert!(member.wo.codebook.code_count() <= plan.codes[1]);
            }
            assert_eq!(members[1].layers == members[0].layers, shares_network);
            assert_ne!(members[1].wo.indices, members[0].wo.indices);
        }
    }
}

/// Common codes are learned of all resolutions: none stays as k-means found it.
#[test]
fn codes_of_all_resolutions_are_learned() {
    let plan = Plan { resolutions: 2, features: 3, codes: [24; 2], ..small(Recipe::Default) };
    let mut group = group(&plan, false);
    let codebooks = |group: &Group| -> Vec<Vec<Vec<f32>>> {
        let first = group.neubrdfs().swap_remove(0);
        first.hemispheres().map(|table| table.codebook.codes.chunks(3).map(<[f32]>::to_vec).collect()).collect()
    };
    while group.steps() <= plan.steps / 20 {
        group.run(1);
    }
    let found = codebooks(&group);
    finish(&mut group);
    for (side, (found, learned)) in found.iter().zip(codebooks(&group)).enumerate() {
        assert!(!learned.is_empty() && learned.iter().all(|code| !found.contains(code)), "table {side}");
    }
}

#[test]
fn each_member_is_close() {
    let plan = Plan { n_side: [8; 2], steps: 1200, pairs: 1 << 15, codes: [256; 2], ..small(Recipe::Default) };
    let pack = NeuBrdfPack::decode(&finish(&mut group(&plan, false))).unwrap();
    for ((name, brdf), truth) in pack.materials.iter().zip(truths()) {
        let evaluator = Evaluator::neubrdf(brdf);
        let truth = |pairs: &[[DVec3; 2]]| -> Vec<DVec3> { pairs.iter().map(|[wo, wi]| truth(*wo, *wi)).collect() };
        let error = pair_errors(1 << 12, 1, &|pairs| evaluator.eval(pairs), &truth).log;
        eprintln!("{name}: {error:.4}");
        assert!(error < 0.03, "{name}: mean |Δ ln(1 + f)| {error}");
    }
}

#[test]
fn a_seed_gives_the_same_pack_whatever_the_threads_and_after_a_stop() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("state");
    for plan in small_plans() {
        for shares_network in [false, true] {
            let fit = |threads: usize, stop: Option<u32>| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let mut whole = group(&plan, shares_network);
                    let Some(stop) = stop else { return finish(&mut whole) };
                    whole.run(stop);
                    whole.save(&path).unwrap();
                    let mut resumed = group(&plan, shares_network);
                    resumed.restore(&path).unwrap();
                    finish(&mut resumed)
                })
            };
            let first = fit(1, None);
            // Before and after codes are given and neurons pruned.
            for (threads, stop) in [(3, None), (2, Some(2)), (2, Some(50))] {
                assert!(first == fit(threads, stop), "{:?}, {threads} threads, {stop:?}", plan.recipe);
            }
            assert!(group(&plan, !shares_network).restore(&path).unwrap_err().to_string().contains("what is shared"));
        }
    }
}

#[test]
fn winding_down_gives_a_pack_at_any_time() {
    let mut group = group(&Plan { codes: [24; 2], steps: 400, ..small(Recipe::Default) }, false);
    group.run(5);
    group.wind_down();
    NeuBrdfPack::decode(&finish(&mut group)).unwrap();
    assert!(group.steps() < 100);
}

#[test]
fn what_cannot_share_is_refused() {
    let session = |plan: Plan| Session::new(plan, &isotropic(&satin)).unwrap();
    let error = |plans: Vec<Plan>| Group::new(plans.into_iter().map(session).collect(), false).map(|_| ()).unwrap_err();
    let plan = small(Recipe::Default);
    assert!(error(vec![]).to_string().contains("nothing"));
    assert!(error(vec![plan.clone(), Plan { features: 6, ..plan.clone() }]).to_string().contains("equal plans"));
    assert!(error(vec![plan.clone().over([4, 4])]).to_string().contains("varies"));
    assert!(error(vec![Plan { recipe: Recipe::Unquantised, ..plan }]).to_string().contains("codebooks"));
}
