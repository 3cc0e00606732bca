//! Table 1: accuracy by the number of points.

use crate::render::chart::{Axis, Chart, Dot, Series};
use formats::split::Split;
use infer_cpu::sampler::SamplerKind;
use train::recipe::{Recipe, Sampling};

use super::context::{ExperimentContext, sampler, test};
use super::plan::Plan;
use super::section::{Cell, Section, Table};

/// The network's name at `n` points drawn at random.
pub fn name(n: usize) -> String {
    format!("random-{n}")
}

/// How it is trained.
pub fn recipe(plan: &Plan, n: usize) -> Recipe {
    Recipe { sampling: Sampling::Random, ..plan.at(n) }
}

pub fn run(context: &ExperimentContext) -> anyhow::Result<Section> {
    let (train, held) = (context.clouds(Split::Train)?, context.clouds(Split::Test)?);
    let caption = "Networks trained and tested at N points, drawn at random";
    let columns = ["instance accuracy", "class accuracy", "paper"];
    let mut trained = Table::new("1 trained at N", caption, "points", columns);
    for &n in &context.plan.points {
        let model = context.network(&name(n), recipe(&context.plan, n), &train)?;
        let found = test(&model, &held, None)?;
        trained.push(n.to_string(), [Cell::instance(&found), Cell::class(&found), paper(n)]);
    }
    let most = context.plan.points.iter().copied().max().unwrap_or(1);
    let model = context.network(&name(most), recipe(&context.plan, most), &train)?;
    let caption = format!("The network of {most} points, tested at others");
    let columns = ["random points", "farthest points"];
    let mut tested = Table::new("1 tested at N", caption, "points", columns);
    for &n in &context.plan.tested_points {
        let at = |kind| {
            if n > held.set.smallest_cloud() {
                return Ok(Cell::Text(format!("clouds have {} points", held.set.smallest_cloud())));
            }
            Ok(Cell::instance(&test(&model, &held, Some(sampler(kind, n)))?))
        };
        tested.measure(n.to_string(), [SamplerKind::Random, SamplerKind::Fps].map(at))?;
    }
    let chart = Chart {
        message: "Instance accuracy by the number of points".to_owned(),
        caption: "",
        x: Axis::Logarithmic("points"),
        y: Axis::Percent("instance accuracy"),
        series: vec![
            line("trained at N", &trained, 0),
            line(&format!("trained at {most}, random"), &tested, 0),
            line(&format!("trained at {most}, farthest"), &tested, 1),
        ],
    };
    let about = [
        format!("Data: {}.", context.clouds_are),
        "The first table has a network for each count; the second one network for all.".to_owned(),
    ];
    let title = "Accuracy by the number of points (table 1)";
    Ok(Section {
        drawings: vec![chart.figure().into_string()],
        ..Section::new(title, about, vec![trained, tested])
    })
}

/// The numbers of column `column` of `table`, whose rows are counts of points.
fn line(name: &str, table: &Table, column: usize) -> Series {
    let dot = |(row, cells): &(String, Vec<Cell>)| {
        let (x, y) = (row.parse().ok()?, cells[column].numbers().0?);
        let tip = format!("{name}: {} of {row} points", cells[column].words().0);
        Some(Dot { x, y, tip, filled: true })
    };
    let dots = table.rows.iter().filter_map(dot).collect();
    Series { name: name.to_owned(), dots, joined: true }
}

/// The figures of the paper that are at hand.
fn paper(n: usize) -> Cell {
    match n {
        64 => Cell::Text("89.01 % (random), 88.36 % (CPL)".to_owned()),
        _ => Cell::None,
    }
}
