//! The report: a self-contained page with a chapter for each experiment.

use super::plan::Plan;
use super::section::{COLOURS, Cell, Cloud, Section, Table};
use crate::render::page::{self, Chapter};
use crate::render::table;
use maud::{Markup, PreEscaped, html};

const TITLE: &str = "The paper's experiments, repeated";

/// All sections as a page.
///
/// # Errors
/// A plan that cannot be written as TOML.
pub fn of(sections: &[Section], plan: &Plan, command: &str) -> anyhow::Result<String> {
    let plan_text = toml::to_string(plan)?;
    let lead = html! {
        p {
            "Meyer and Reitmann 2026, arXiv 2608.07106, by edgepuck "
            (env!("CARGO_PKG_VERSION")) "; " (machine()) "."
        }
        p { strong { (plan.about) } }
        pre { (command) }
        details { summary { "The plan" } pre { (plan_text) } }
    };
    let chapters: Vec<Chapter> = (1..).zip(sections).map(|(i, s)| chapter(i, s)).collect();
    Ok(page::of(TITLE, &lead, &chapters))
}

/// What this ran on.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = cpu.lines().find_map(|line| line.strip_prefix("model name")?.split(": ").nth(1));
    format!("{cores} cores of {}", name.unwrap_or(std::env::consts::ARCH))
}

fn chapter(number: usize, section: &Section) -> Chapter {
    let body = html! {
        @for paragraph in &section.about { p { (paragraph) } }
        @for table in &section.tables { (numbers(table).html()) }
        @for drawing in &section.drawings { (PreEscaped(drawing)) }
        @for cloud in &section.clouds { (canvas(cloud)) }
    };
    let title = format!("{number}. {}", section.title);
    Chapter::new(&format!("s{number}"), &title, &title, body)
}

fn canvas(cloud: &Cloud) -> Markup {
    let colours: String = cloud.colours.iter().map(|c| char::from(b'0' + c)).collect();
    html! {
        figure {
            canvas class="cloud" width="480" height="360" data-points=(joined(&cloud.points))
                data-colours=(colours) data-palette=(COLOURS.join(" ")) {}
            figcaption {
                (cloud.caption) ". Drag to rotate. "
                span style={ "color:" (COLOURS[1]) } { "critical points" } ", "
                span style={ "color:" (COLOURS[2]) } { "LIME's strongest" } ", "
                span style={ "color:" (COLOURS[3]) } { "both" }
            }
        }
    }
}

fn joined(points: &[[i16; 3]]) -> String {
    let words: Vec<String> = points.as_flattened().iter().map(ToString::to_string).collect();
    words.join(" ")
}

fn numbers(table: &Table) -> table::Table {
    let columns = table.columns.iter().map(String::as_str);
    let heading: Vec<&str> = std::iter::once(table.rows_are.as_str()).chain(columns).collect();
    let mut shown = table::Table::new(table.caption.clone(), &heading);
    for (row, cells) in &table.rows {
        let first = table::Cell::from(row.clone());
        shown.push(std::iter::once(first).chain(cells.iter().map(one)).collect());
    }
    shown
}

/// A cell; shares are shaded by their size.
fn one(cell: &Cell) -> table::Cell {
    let (text, note) = cell.words();
    let is_share = matches!(cell, Cell::Share(..) | Cell::Mean(..));
    table::Cell { text, note, share: cell.numbers().0.filter(|_| is_share) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_self_contained_and_escapes_names() {
        let table = Table {
            caption: "a < b".to_owned(),
            columns: vec!["x".to_owned()],
            rows: vec![("row".to_owned(), vec![Cell::Share(1, 2)])],
            ..Table::default()
        };
        let cloud = Cloud { points: vec![[1, 2, 3]], colours: vec![2], ..Cloud::default() };
        let section = Section { tables: vec![table], clouds: vec![cloud], ..Section::default() };
        let plan = crate::study::plan::read(None, true).unwrap();
        let page = of(&[section], &plan, "cargo xtask reproduce").unwrap();
        assert!(page.contains("a &lt; b") && page.contains("50.0 %"));
        assert!(page.contains(r#"data-points="1 2 3""#) && page.contains(r#"data-colours="2""#));
        for outside in ["http://", "https://", "src="] {
            let found = page.matches(outside).count();
            assert_eq!(found, 0, "{outside}");
        }
    }
}
