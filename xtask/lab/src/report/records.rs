//! Records that are tables: the ablations, and the paper's experiments.

use super::{entries, lines, missing, remarks, text};
use crate::render::page;
use crate::render::table::Table;
use anyhow::Result;
use maud::{Markup, html};
use serde::Deserialize;
use std::path::Path;
use xtask::workspace::file_name;

/// The records on real objects and sensors in `folder`, each a Markdown file.
pub fn reality(folder: &Path) -> Result<Markup> {
    const MAIN: &str = "README.md";
    let Some(main) = text(&folder.join(MAIN))? else {
        return Ok(missing(&folder.join(MAIN), "cargo xtask bench frames --report"));
    };
    let mut others = entries(folder)?;
    others.retain(|path| path.extension().is_some_and(|end| end == "md") && !path.ends_with(MAIN));
    Ok(html! {
        (page::markdown(&main))
        @for path in &others { @if let Some(text) = text(path)? {
            details { summary { (title(&text)) } (page::markdown(&text)) }
        } }
    })
}

fn title(text: &str) -> &str {
    text.lines().next().unwrap_or_default().trim_start_matches('#').trim()
}

/// How much each effect matters, of the record in `folder`.
pub fn ablations(folder: &Path) -> Result<Markup> {
    let path = folder.join("ablations.csv");
    let (Some(main), Some(csv)) = (text(&folder.join("README.md"))?, text(&path)?) else {
        return Ok(missing(&path, "cargo xtask ablate"));
    };
    let every_row = Table::from_csv("", csv.as_bytes())?;
    Ok(html! {
        (page::markdown(&main))
        details { summary { "All " (every_row.rows.len()) " rows" } (every_row.html()) }
    })
}

/// A cell of `cargo xtask reproduce`'s CSV.
#[derive(Deserialize)]
struct Cell {
    table: String,
    row: String,
    column: String,
    value: Option<f64>,
    low: Option<f64>,
    high: Option<f64>,
    text: String,
}

/// The paper's experiments, of the newest record in `reports`.
pub fn reproduction(reports: &Path) -> Result<Markup> {
    let records = entries(reports)?;
    let Some(folder) = records.iter().rev().find(|path| path.join("report.csv").is_file()) else {
        return Ok(missing(&reports.join("DATE/report.csv"), "cargo xtask reproduce"));
    };
    let cells: Vec<Cell> = lines(&folder.join("report.csv"))?.unwrap_or_default();
    let names = distinct(cells.iter().map(|cell| &cell.table));
    Ok(html! {
        p { "Meyer and Reitmann 2026, by " code { "cargo xtask reproduce" } "; the record "
            (file_name(folder)) " has the same with drawings and clouds. The number before a table's name is "
            "the experiment's." }
        (remarks(folder)?)
        @for name in names { (one_table(name, &cells)) }
    })
}

/// Each once, in the order in which it comes first.
fn distinct<'a>(words: impl Iterator<Item = &'a String>) -> Vec<&'a str> {
    let mut found: Vec<&str> = Vec::new();
    for word in words {
        if !found.contains(&word.as_str()) {
            found.push(word);
        }
    }
    found
}

fn one_table(name: &str, cells: &[Cell]) -> Markup {
    let cells: Vec<&Cell> = cells.iter().filter(|cell| cell.table == name).collect();
    let rows = distinct(cells.iter().map(|cell| &cell.row));
    let columns = distinct(cells.iter().map(|cell| &cell.column));
    let heading: Vec<&str> = std::iter::once("").chain(columns.iter().copied()).collect();
    let mut table = Table::new("", &heading);
    for row in rows {
        let of = |column: &&str| {
            let cell = cells.iter().find(|cell| cell.row == *row && cell.column == **column);
            cell.map(|cell| cell.words()).unwrap_or_default()
        };
        let first = std::iter::once(row.to_owned());
        table.push(first.chain(columns.iter().map(of)).collect());
    }
    html! {
        details open[cells.len() <= 60] { summary { (name) } (table.html()) }
    }
}

impl Cell {
    fn words(&self) -> String {
        let number = |x: f64| match x.fract() == 0.0 && x.abs() > 1.0 {
            true => format!("{x:.0}"),
            false => format!("{x:.3}"),
        };
        match (self.value, self.low, self.high) {
            (None, ..) => self.text.clone(),
            (Some(value), Some(low), Some(high)) => {
                format!("{} ({} to {})", number(value), number(low), number(high))
            }
            (Some(value), ..) => number(value),
        }
    }
}
