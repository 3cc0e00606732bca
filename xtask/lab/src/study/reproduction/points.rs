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
    let mut trained = Table {
        id: "1 trained at N".to_owned(),
        caption: "Networks trained and tested at N points, drawn at random".to_owned(),
        rows_are: "points".to_owned(),
        columns: ["instance accuracy", "class accuracy", "paper"].map(str::to_owned).into(),
        rows: Vec::new(),
    };
    for &n in &context.plan.points {
        let model = context.network(&name(n), recipe(&context.plan, n), &train)?;
        let found = test(&model, &held, None)?;
        let cells = vec![Cell::instance(&found), Cell::class(&found), paper(n)];
        trained.rows.push((n.to_string(), cells));
    }
    let most = context.plan.points.iter().copied().max().unwrap_or(1);
    let model = context.network(&name(most), recipe(&context.plan, most), &train)?;
    let mut tested = Table {
        id: "1 tested at N".to_owned(),
        caption: format!("The network of {most} points, tested at others"),
        columns: ["random points", "farthest points"].map(str::to_owned).into(),
        rows_are: "points".to_owned(),
        rows: Vec::new(),
    };
    for &n in &context.plan.tested_points {
        let at = |kind| -> anyhow::Result<Cell> {
            if n > held.set.n_points {
                return Ok(Cell::Text(format!("clouds have {} points", held.set.n_points)));
            }
            Ok(Cell::instance(&test(&model, &held, Some(sampler(kind, n)))?))
        };
        tested.rows.push((n.to_string(), vec![at(SamplerKind::Random)?, at(SamplerKind::Fps)?]));
    }
    let chart = Chart {
        message: "Instance accuracy by the number of points".to_owned(),
        caption: "",
        x: Axis { label: "points", logarithmic: true, percent: false },
        y: Axis { label: "instance accuracy", logarithmic: false, percent: true },
        series: vec![
            line("trained at N", &trained, 0),
            line(&format!("trained at {most}, random"), &tested, 0),
            line(&format!("trained at {most}, farthest"), &tested, 1),
        ],
    };
    Ok(Section {
        title: "Accuracy by the number of points (table 1)".to_owned(),
        about: vec![
            format!("Data: {}.", context.clouds_are),
            "The first table has a network for each count; the second one network for all."
                .to_owned(),
        ],
        tables: vec![trained, tested],
        drawings: vec![chart.figure().into_string()],
        clouds: Vec::new(),
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
