//! The report: a self-contained page with a chapter for each experiment.

use super::plan::Plan;
use super::section::{COLOURS, Cell, Cloud, Section, Table};
use crate::measure::machine::field;
use crate::render::page::{self, Chapter};
use crate::render::table;
use maud::{Markup, PreEscaped, html};
use xtask::workspace::command_line;

const TITLE: &str = "The paper's experiments, repeated";

/// All sections as a page.
pub fn of(sections: &[Section], plan: &Plan) -> anyhow::Result<String> {
    let plan_text = toml::to_string(plan)?;
    let lead = html! {
        p {
            "Meyer and Reitmann 2026, arXiv 2608.07106, by edgepuck "
            (env!("CARGO_PKG_VERSION")) "; " (machine()) "."
        }
        p { strong { (plan.about) } }
        pre { (command_line()) }
        details { summary { "The plan" } pre { (plan_text) } }
    };
    let chapters: Vec<Chapter> = (1..).zip(sections).map(|(i, s)| chapter(i, s)).collect();
    Ok(page::of(TITLE, &lead, &chapters))
}

/// What this ran on.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let cpu = field("/proc/cpuinfo", "model name");
    format!("{cores} cores of {}", cpu.as_deref().unwrap_or(std::env::consts::ARCH))
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
    let caption = html! {
        (cloud.caption) ". Drag to rotate. "
        span style={ "color:" (COLOURS[1]) } { "critical points" } ", "
        span style={ "color:" (COLOURS[2]) } { "LIME's strongest" } ", "
        span style={ "color:" (COLOURS[3]) } { "both" }
    };
    let (points, palette) = (joined(&cloud.points), COLOURS.join(" "));
    page::Cloud { points: &points, colours: &colours, palette: &palette, ..page::Cloud::EMPTY }
        .figure(&caption)
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
    fn a_page_shows_tables_and_clouds_and_escapes_names() {
        let mut table = Table::new("id", "a < b", "rows", ["x"]);
        table.push("row", [Cell::Share(1, 2)]);
        let cloud = Cloud { points: vec![[1, 2, 3]], colours: vec![2], ..Cloud::default() };
        let section = Section { tables: vec![table], clouds: vec![cloud], ..Section::default() };
        let plan = crate::study::plan::read(None, true).unwrap();
        let page = of(&[section], &plan).unwrap();
        assert!(page.contains("a &lt; b") && page.contains("50.0 %"));
        assert!(page.contains(r#"data-points="1 2 3""#) && page.contains(r#"data-colours="2""#));
        for outside in ["http://", "https://", "src="] {
            assert!(!page.contains(outside), "{outside}");
        }
    }
}
