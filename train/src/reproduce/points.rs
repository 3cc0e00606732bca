//! Table 1: accuracy by the number of points.

use formats::split::Split;
use infer_cpu::sampler::SamplerKind;
use train::recipe::{Recipe, Sampling};

use super::chart::{Line, lines};
use super::plan::Plan;
use super::section::{Cell, Section, Table};
use super::workshop::{Workshop, sampler, test};

/// The network's name at `n` points drawn at random.
pub fn name(n: usize) -> String {
    format!("random-{n}")
}

/// How it is trained.
pub fn recipe(plan: &Plan, n: usize) -> Recipe {
    Recipe { sampling: Sampling::Random, ..plan.at(n) }
}

pub fn run(shop: &Workshop) -> anyhow::Result<Section> {
    let (train, held) = (shop.clouds(Split::Train)?, shop.clouds(Split::Test)?);
    let mut trained = Table {
        id: "1 trained at N".to_owned(),
        caption: "Networks trained and tested at N points, drawn at random".to_owned(),
        rows_are: "points".to_owned(),
        columns: ["instance accuracy", "class accuracy", "paper"].map(str::to_owned).into(),
        rows: Vec::new(),
    };
    for &n in &shop.plan.points {
        let model = shop.network(&name(n), recipe(&shop.plan, n), &train)?;
        let found = test(&model, &held, None)?;
        let cells = vec![Cell::instance(&found), Cell::class(&found), paper(n)];
        trained.rows.push((n.to_string(), cells));
    }
    let most = shop.plan.points.iter().copied().max().unwrap_or(1);
    let model = shop.network(&name(most), recipe(&shop.plan, most), &train)?;
    let mut tested = Table {
        id: "1 tested at N".to_owned(),
        caption: format!("The network of {most} points, tested at others"),
        columns: ["random points", "farthest points"].map(str::to_owned).into(),
        rows_are: "points".to_owned(),
        rows: Vec::new(),
    };
    for &n in &shop.plan.tested_points {
        let at = |kind| -> anyhow::Result<Cell> {
            if n > held.set.n_points {
                return Ok(Cell::Text(format!("clouds have {} points", held.set.n_points)));
            }
            Ok(Cell::instance(&test(&model, &held, Some(sampler(kind, n)))?))
        };
        tested.rows.push((n.to_string(), vec![at(SamplerKind::Random)?, at(SamplerKind::Fps)?]));
    }
    let chart = lines(
        "instance accuracy by points",
        "points",
        &[
            Line::of("trained at N", &trained, 0),
            Line::of(&format!("trained at {most}, random"), &tested, 0),
            Line::of(&format!("trained at {most}, farthest"), &tested, 1),
        ],
    )?;
    Ok(Section {
        title: "Accuracy by the number of points (table 1)".to_owned(),
        about: vec![
            format!("Data: {}.", shop.clouds_are),
            "The first table has a network for each count; the second one network for all."
                .to_owned(),
        ],
        tables: vec![trained, tested],
        drawings: vec![chart],
        clouds: Vec::new(),
    })
}

/// The figures of the paper that are at hand.
fn paper(n: usize) -> Cell {
    match n {
        64 => Cell::Text("89.01 % (random), 88.36 % (CPL)".to_owned()),
        _ => Cell::None,
    }
}
