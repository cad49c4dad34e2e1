//! `neubrdf train --share`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail};
use glam::DVec3;
use neubrdf::image::write_file;
use neubrdf::scene::brdf::{Brdf, NeuBrdf, NeuBrdfPack, Precision};
use neubrdf::train::{Evaluator, Group, GroupReport, Model, Plan, Recipe, Report, Session, cluster};

use super::brdf_input::BrdfInput;
use super::judge::{Judgement, judge};
use super::progress;
use super::train::{Arguments, check_outputs, drawing, plan, provenance, texel_options, truth};
use super::train_loop::train;

/// A material to learn, and its name in the pack.
struct Member {
    name: String,
    input: BrdfInput,
}

/// Loads, groups, trains, measures, writes.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    if arguments.model == Model::Nbrdf || arguments.compare_recipes {
        bail!("--share: it goes with neither --model nbrdf nor --compare-recipes");
    }
    if let Some(options) = texel_options(arguments) {
        bail!("{options}: --share is for materials that are the same everywhere, which have no texels");
    }
    let members = members(arguments)?;
    let groups = groups(arguments, &members);
    let paths: Vec<PathBuf> = (0..groups.len()).map(|index| numbered(&arguments.output, index, groups.len())).collect();
    let checkpoints: Vec<Option<PathBuf>> = (0..groups.len())
        .map(|index| arguments.checkpoint.as_ref().map(|path| numbered(path, index, groups.len())))
        .collect();
    for (path, checkpoint) in paths.iter().zip(&checkpoints) {
        check_outputs(arguments, path, checkpoint.as_deref())?;
    }
    if arguments.resume && !checkpoints.iter().flatten().any(|path| path.is_file()) {
        bail!(
            "{}: there is no such checkpoint to go on from",
            checkpoints.iter().flatten().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
        );
    }
    if !arguments.quiet && groups.len() > 1 {
        for (group, path) in groups.iter().zip(&paths) {
            let names: Vec<&str> = group.iter().map(|member| members[*member].name.as_str()).collect();
            tell!("{}: {}", path.display(), names.join(" "))?;
        }
    }
    let interrupted = progress::interrupt_flag()?;
    for (index, (group, path)) in groups.iter().zip(&paths).enumerate() {
        let group: Vec<&Member> = group.iter().map(|member| &members[*member]).collect();
        train_group(arguments, &group, path, checkpoints[index].as_deref(), &interrupted)?;
        if interrupted.load(Ordering::SeqCst) && index + 1 < groups.len() {
            note!("interrupted: {} and later ones were not begun", paths[index + 1].display());
            break;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What is to be learned: each input, or the materials of these names of one, or all that it holds.
fn members(arguments: &Arguments) -> Result<Vec<Member>> {
    let mut members = Vec::new();
    for path in &arguments.inputs {
        let names = match arguments.name.as_slice() {
            [] => Brdf::names(path)?,
            _ if arguments.inputs.len() > 1 => bail!("--name: it picks materials of one input, and there are several"),
            names => names.to_vec(),
        };
        let stem = path.file_stem().with_context(|| format!("{} names no file", path.display()))?.to_string_lossy();
        if names.is_empty() {
            members.push(Member { name: stem.into_owned(), input: BrdfInput::load(path, None, drawing(arguments))? });
        }
        for name in names {
            let input = BrdfInput::load(path, Some(&name), drawing(arguments))?;
            members.push(Member { name, input });
        }
    }
    if let Some(varying) = members.iter().find(|member| member.input.texels.is_some()) {
        bail!("{}: it varies over a texture; --share is for materials that are the same everywhere", varying.name);
    }
    let mut names = BTreeSet::new();
    if let Some(twice) = members.iter().find(|member| !names.insert(member.name.as_str())) {
        bail!("two materials are called `{}`: the members of a pack need names of their own", twice.name);
    }
    let most = NeuBrdfPack::MAX_MATERIALS;
    if members.len() > most {
        bail!("{} materials: a pack holds at most {most}", members.len());
    }
    Ok(members)
}

/// Members of each group.
fn groups(arguments: &Arguments, members: &[Member]) -> Vec<Vec<usize>> {
    let count = members.len();
    let (groups, most) = match (arguments.groups, arguments.group_size) {
        (Some(groups), _) => (groups as usize, count),
        (_, Some(most)) => (count.div_ceil(most as usize), most as usize),
        _ => return vec![(0..count).collect()],
    };
    let eval = |member: &Member| cluster::features(&|wo, wi| member.input.brdf.eval(wo, wi));
    cluster::groups(&members.iter().map(eval).collect::<Vec<_>>(), groups, most)
}

/// `path` with the number of a group, from 1, behind its stem, unless there is but one.
fn numbered(path: &Path, index: usize, count: usize) -> PathBuf {
    if count == 1 {
        return path.to_owned();
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().map(|ending| format!(".{}", ending.to_string_lossy())).unwrap_or_default();
    path.with_file_name(format!("{stem}-{}{ending}", index + 1))
}

/// Plans of all members, which have one recipe, but the grid that suits their measurements, and as many resolutions as the coarsest grid has
/// room for. Codes are shared better on several (docs/sharing.md); few measurements may have no room for them.
fn plans(arguments: &Arguments, members: &[&Member]) -> Vec<Plan> {
    let Arguments { recipe, resolutions, features, codes, hidden, share_network, .. } = *arguments;
    let is_isotropic = members.iter().all(|member| member.input.brdf.is_isotropic());
    let are_functions = members.iter().all(|member| member.input.sample_count().is_none());
    let is_free = recipe == Recipe::Default && resolutions.is_none() && features.is_none();
    let of = |member: &&Member| {
        let plan = plan(arguments, &member.input, is_isotropic);
        let plan = if is_free && are_functions { plan.of_several_resolutions() } else { plan };
        let plan = if share_network && hidden.is_none() { plan.wide() } else { plan };
        plan.for_group(members.len(), codes)
    };
    let plans: Vec<Plan> = members.iter().map(of).collect();
    let resolutions = plans.iter().map(|plan| plan.resolutions).min().unwrap_or(1);
    let fewest = |plan: Plan| match features {
        Some(_) => Plan { resolutions, ..plan },
        None => plan.with_resolutions_up_to(resolutions),
    };
    plans.into_iter().map(fewest).collect()
}

fn train_group(
    arguments: &Arguments,
    members: &[&Member],
    output: &Path,
    checkpoint: Option<&Path>,
    interrupted: &AtomicBool,
) -> Result<()> {
    let sessions = plans(arguments, members).into_iter().zip(members).map(|(plan, Member { input, .. })| {
        let eval = |wo: DVec3, wi: DVec3| input.brdf.eval(wo, wi);
        Ok(Session::new(plan, &input.ground_truth(&eval))?)
    });
    let mut group = Group::new(sessions.collect::<Result<_>>()?, arguments.share_network)?;
    // A group that was not begun has none.
    if let Some(path) = checkpoint.filter(|path| arguments.resume && path.is_file()) {
        group.restore(path)?;
    }
    train(&mut group, checkpoint, interrupted, arguments.quiet)?;
    let seconds = group.seconds();

    // What is measured is what the file says, rounded numbers and all.
    let precision = if arguments.f32 { Precision::F32 } else { Precision::F16 };
    let named = |(member, brdf): (&&Member, NeuBrdf)| (member.name.clone(), brdf);
    let pack = NeuBrdfPack { materials: members.iter().zip(group.neubrdfs()).map(named).collect() };
    let mut pack = NeuBrdfPack::decode(&pack.encode(precision)?)?;
    let evaluators: Vec<Evaluator> = pack.materials.iter().map(|(_, brdf)| Evaluator::neubrdf(brdf)).collect();
    let judge = |(member, fit): (&&Member, &Evaluator)| {
        judge(&member.input, &|queries| fit.eval_at(queries), !arguments.no_report)
    };
    let judged: Vec<Judgement> = members.iter().zip(&evaluators).map(judge).collect();
    for (((_, brdf), session), (member, judgement)) in
        pack.materials.iter_mut().zip(group.members()).zip(members.iter().zip(&judged))
    {
        brdf.provenance = provenance(&member.input, session, &judgement.judged);
        brdf.provenance.training.insert("materials that share a codebook".into(), members.len().to_string());
    }
    let bytes = pack.encode(precision)?;
    write_file(output, &bytes)?;
    let report = |(session, (member, judgement)): (&Session, (&&Member, &Judgement))| Report {
        source: member.input.name.clone(),
        plan: session.plan.clone(),
        steps: session.steps(),
        loss: session.loss(),
        seconds,
        bytes: bytes.len().div_ceil(members.len()),
        judged: judgement.judged.clone(),
        recipes: Vec::new(),
    };
    let report = GroupReport {
        shares_network: group.shares_network(),
        seconds,
        bytes: bytes.len(),
        members: group.members().iter().zip(members.iter().zip(&judged)).map(report).collect(),
    };
    if !arguments.no_report {
        report.write_json(&output.with_extension("json"))?;
        let section = |index: usize| {
            let fit = |pairs: &[[DVec3; 2]]| evaluators[index].eval(pairs);
            let gain = group.members()[index].gain();
            let truth = |pairs: &[[DVec3; 2]]| truth(&members[index].input, pairs);
            let balls = judged[index].balls.as_ref().context("a report shows balls")?;
            Ok(report.members[index].section(balls, gain, &fit, &truth)?)
        };
        report.write_html(
            &output.with_extension("html"),
            &(0..members.len()).map(section).collect::<Result<Vec<_>>>()?,
        )?;
    }
    if !arguments.quiet {
        let means: Vec<String> = report.means().iter().map(|figure| format!("{} {figure}", figure.name)).collect();
        let interrupted = if group.steps() < group.members()[0].plan.steps { "interrupted: " } else { "" };
        tell!(
            "{interrupted}{}: {} materials, {} bytes, {} steps in {seconds:.1} s; on average {}",
            output.display(),
            members.len(),
            bytes.len(),
            group.steps(),
            means.join(", "),
        )?;
    }
    Ok(())
}
