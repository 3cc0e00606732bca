//! What an answer rests on: LIME-3D's strongest points, critical points, and
//! random subsets, by Chamfer distance.

use super::context::{ExperimentContext, sampler};
use super::page::{Cloud, Section};
use super::samplers::{cpl_name, wide};
use crate::render::table::{Cell, Table};
use formats::split::Split;
use infer_cpu::sampler::SamplerKind;
use infer_cpu::{Classifier, Normalization, Options};
use train::explanation_drawing;
use train::lime::{Explanation, Lime, explain};
use train::random_baseline::RandomBaseline;

const SHOWN: usize = 3;

struct Explained {
    name: String,
    points: Vec<[f32; 3]>,
    critical: Vec<usize>,
    strongest: Vec<usize>,
    found: Explanation,
    beside: RandomBaseline,
}

pub fn run(context: &ExperimentContext) -> anyhow::Result<Section> {
    let held = context.clouds(Split::Test)?;
    let (front, keep) = (&context.plan.fronts[0], context.plan.kept[0]);
    let model = context.model(&cpl_name(front, keep));
    let load = |kind, points| {
        // A part of a cloud is not normalised anew.
        let normalization = Some(Normalization::None);
        let sampler = Some(sampler(kind, points));
        Classifier::load(&model, &Options { sampler, normalization, ..Options::default() })
    };
    let mut by_cpl = load(SamplerKind::Cpl, keep)?;
    let mut whole = load(SamplerKind::All, 1)?;
    let lime = Lime { samples: context.plan.lime_samples, ..Lime::default() };
    let n = context.plan.explained.min(held.len());
    let mut all = Vec::new();
    for cloud in (0..n).map(|i| i * held.len() / n) {
        let points = held.set.cloud(cloud).to_vec();
        let critical: Vec<usize> =
            by_cpl.sample(&wide(&points))?.iter().map(|&i| i as usize).collect();
        let found = explain(&mut whole, &points, &lime)?;
        let class = &held.classes[held.set.labels[cloud]];
        let answer = &held.classes[found.class];
        let name = format!("cloud {cloud}, a {class} taken for a {answer}");
        let strongest = found.strongest(critical.len());
        let beside = RandomBaseline::new(&points, (&critical, &strongest), context.plan.draws, 0);
        all.push(Explained { name, points, critical, strongest, found, beside });
    }
    let shown = &all[..SHOWN.min(all.len())];
    let about = [
        format!(
            "Data: {}. LIME-3D: {} parts, {} clouds with parts removed, ridge regression.",
            context.clouds_are, lime.clusters, lime.samples
        ),
        format!(
            "Critical points of {}, whose network is explained as it answers to all points. \
             Chamfer distances are the sum of both directions' means; \
             squared as PyTorch3D has it, plain as some papers. Always as many points on one \
             side as on the other, since the distance shrinks with the count.",
            cpl_name(front, keep)
        ),
    ];
    let draw = |one: &Explained| explanation_drawing::draw(&one.points, &one.found, &one.critical);
    Ok(Section {
        drawings: shown.iter().map(draw).collect(),
        clouds: shown.iter().map(coloured).collect(),
        ..Section::new(
            "LIME-3D and critical points",
            about,
            vec![("5 chamfer", table(&all, context.plan.draws)?)],
        )
    })
}

fn table(all: &[Explained], draws: u32) -> anyhow::Result<Table> {
    let mut table = Table::new(
        format!(
            "Chamfer distance to the points that LIME-3D finds strongest, of critical points and \
             of {draws} random subsets"
        ),
        &[
            "cloud",
            "critical points, squared",
            "random, squared, median",
            "2.5 %",
            "97.5 %",
            "critical points, plain",
            "random, plain, median",
            "random draws that are nearer",
            "R² of LIME",
        ],
    );
    for one in all {
        let RandomBaseline { ours, random } = &one.beside;
        let last = random.len().saturating_sub(1);
        let at = |share: f64| random.get((share * last as f64) as usize);
        let squared = |share| at(share).map_or(f64::NAN, |found| found.squared);
        let cells = [
            Cell::number(ours.squared, 4),
            Cell::number(squared(0.5), 4),
            Cell::number(squared(0.025), 4),
            Cell::number(squared(0.975), 4),
            Cell::number(ours.plain, 4),
            Cell::number(at(0.5).map_or(f64::NAN, |found| found.plain), 4),
            Cell::Text(format!("{} of {}", one.beside.nearer(), random.len())),
            Cell::number(one.found.r_squared, 2),
        ];
        table.measure(&one.name, cells.map(Ok))?;
    }
    Ok(table)
}

fn coloured(one: &Explained) -> Cloud {
    let mut colours = vec![0u8; one.points.len()];
    one.critical.iter().for_each(|&i| colours[i] += 1);
    one.strongest.iter().for_each(|&i| colours[i] += 2);
    let thousandths = |x: f32| (1000.0 * x).round() as i16;
    Cloud {
        caption: one.name.clone(),
        points: one.points.iter().map(|point| point.map(thousandths)).collect(),
        colours,
    }
}
