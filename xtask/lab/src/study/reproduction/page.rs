//! The report: a self-contained page with a chapter for each experiment, and its numbers as CSV.

use super::context::Plan;
use crate::measure::machine::field;
use crate::render::page::{self, Chapter};
use crate::render::table::{Cell, Table};
use maud::{Markup, PreEscaped, html};
use serde::{Deserialize, Serialize};
use std::path::Path;
use xtask::workspace::command_line;

const TITLE: &str = "The paper's experiments, repeated";

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Section {
    pub title: String,
    pub about: Vec<String>,
    /// Tables and their names in the CSV file; the first cell of a row is its name.
    pub tables: Vec<(String, Table)>,
    pub drawings: Vec<String>,
    /// Clouds that can be rotated.
    pub clouds: Vec<Cloud>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cloud {
    pub caption: String,
    /// Thousandths of the unit sphere's radius.
    pub points: Vec<[i16; 3]>,
    /// An index into [`COLOURS`] for each.
    pub colours: Vec<u8>,
}

/// Colours of points: plain, critical, LIME's, and both.
const COLOURS: [&str; 4] = ["#a8a8a8", "#d33b12", "#1763c7", "#8a2fc0"];

impl Section {
    pub fn new(title: &str, about: [String; 2], tables: Vec<(&str, Table)>) -> Self {
        let tables = tables.into_iter().map(|(name, table)| (name.to_owned(), table)).collect();
        Self { title: title.to_owned(), about: about.into(), tables, ..Self::default() }
    }
}

pub fn of(sections: &[Section], plan: &Plan) -> anyhow::Result<String> {
    let plan_text = toml::to_string(plan)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let cpu = field("/proc/cpuinfo", "model name");
    let lead = html! {
        p {
            "Meyer and Reitmann 2026, arXiv 2608.07106, by edgepuck "
            (env!("CARGO_PKG_VERSION")) "; " (cores) " cores of "
            (cpu.as_deref().unwrap_or(std::env::consts::ARCH)) "."
        }
        p { strong { (plan.about) } }
        pre { (command_line()) }
        details { summary { "The plan" } pre { (plan_text) } }
    };
    let chapters: Vec<Chapter> = (1..).zip(sections).map(|(i, s)| chapter(i, s)).collect();
    Ok(page::of(TITLE, &lead, &chapters))
}

fn chapter(number: usize, section: &Section) -> Chapter {
    let body = html! {
        @for paragraph in &section.about { p { (paragraph) } }
        @for (_, table) in &section.tables { (table.html()) }
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
    let points: Vec<String> = cloud.points.as_flattened().iter().map(i16::to_string).collect();
    let (points, palette) = (points.join(" "), COLOURS.join(" "));
    page::cloud(&points, &colours, &palette, &caption)
}

pub fn write_csv(sections: &[Section], path: &Path) -> anyhow::Result<()> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(["table", "row", "column", "value", "low", "high", "text"])?;
    for (name, table) in sections.iter().flat_map(|section| &section.tables) {
        for cells in &table.rows {
            let row = cells[0].text();
            for (column, cell) in table.heading.iter().zip(cells).skip(1) {
                let (value, range) = cell.numbers();
                let text = if let Cell::Text(text) = cell { text } else { "" };
                let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x}"));
                let [low, high] = [0, 1].map(|i| number(range.map(|range| range[i])));
                csv.write_record([name, &row, column, &number(value), &low, &high, text])?;
            }
        }
    }
    Ok(formats::atomic::write_bytes(path, csv.into_inner()?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_shows_tables_and_clouds_and_escapes_names() {
        let mut table = Table::new("a < b", &["rows", "x"]);
        table.measure("row", [Ok(Cell::Share(1, 2))]).unwrap();
        let cloud = Cloud { points: vec![[1, 2, 3]], colours: vec![2], ..Cloud::default() };
        let tables = vec![("id".to_owned(), table)];
        let section = Section { tables, clouds: vec![cloud], ..Section::default() };
        let plan = crate::study::plan::read(None, true).unwrap();
        let page = of(&[section], &plan).unwrap();
        assert!(page.contains("a &lt; b") && page.contains("50.0 %"));
        assert!(page.contains(r#"data-points="1 2 3""#) && page.contains(r#"data-colours="2""#));
        for outside in ["http://", "https://", "src="] {
            assert!(!page.contains(outside), "{outside}");
        }
    }
}
