//! The report: one HTML file that needs nothing else.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::plan::Plan;
use super::section::{COLOURS, Cell, Section, Table};

const STYLE: &str = include_str!("../../../../../assets/page/page.css");
const SCRIPT: &str = include_str!("../../../../../assets/page/cloud.js");

/// All sections as a page.
///
/// # Errors
/// A plan that TOML cannot say.
pub fn of(sections: &[Section], plan: &Plan, command: &str) -> anyhow::Result<String> {
    let plan_text = toml::to_string(plan)?;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "The paper's experiments, run again" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "The paper's experiments, run again" }
                p {
                    "Meyer and Reitmann 2026, arXiv 2608.07106, by edgepuck "
                    (env!("CARGO_PKG_VERSION")) "; " (machine()) "."
                }
                p { strong { (plan.about) } }
                pre { (command) }
                details { summary { "The plan" } pre { (plan_text) } }
                nav { ol { @for (i, section) in sections.iter().enumerate() {
                    li { a href={ "#s" (i + 1) } { (section.title) } }
                } } }
                @for (i, section) in sections.iter().enumerate() { (chapter(i + 1, section)) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    Ok(page.into_string())
}

/// What this ran on.
fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = cpu.lines().find_map(|line| line.strip_prefix("model name")?.split(": ").nth(1));
    format!("{cores} cores of {}", name.unwrap_or(std::env::consts::ARCH))
}

fn chapter(number: usize, section: &Section) -> Markup {
    html! {
        section id={ "s" (number) } {
            h2 { (number) ". " (section.title) }
            @for paragraph in &section.about { p { (paragraph) } }
            @for table in &section.tables { (numbers(table)) }
            @for drawing in &section.drawings { figure { (PreEscaped(drawing)) } }
            @for cloud in &section.clouds {
                figure {
                    canvas class="cloud" width="480" height="360" data-points=(joined(&cloud.points))
                        data-colours=(cloud.colours.iter().map(|c| char::from(b'0' + c)).collect::<String>())
                        data-palette=(COLOURS.join(" ")) {}
                    figcaption {
                        (cloud.caption) ". Drag to turn. "
                        span style={ "color:" (COLOURS[1]) } { "critical points" } ", "
                        span style={ "color:" (COLOURS[2]) } { "LIME's strongest" } ", "
                        span style={ "color:" (COLOURS[3]) } { "both" }
                    }
                }
            }
        }
    }
}

fn joined(points: &[[i16; 3]]) -> String {
    let words: Vec<String> = points.as_flattened().iter().map(ToString::to_string).collect();
    words.join(" ")
}

fn numbers(table: &Table) -> Markup {
    html! {
        div class="scroll" {
            table {
                caption { (table.caption) }
                thead { tr {
                    th scope="col" { (table.rows_are) }
                    @for column in &table.columns { th scope="col" { (column) } }
                } }
                tbody { @for (row, cells) in &table.rows {
                    tr { th scope="row" { (row) } @for cell in cells { (one(cell)) } }
                } }
            }
        }
    }
}

/// A cell; shares are shaded by their size.
fn one(cell: &Cell) -> Markup {
    let (value, interval) = cell.words();
    let share = matches!(cell, Cell::Share(..) | Cell::Mean(..)).then(|| cell.numbers().0);
    let shade =
        share.flatten().map(|share| format!("background:rgba(23,99,199,{:.2})", 0.45 * share));
    html! {
        td style=[shade] { (value) @if !interval.is_empty() { small { (interval) } } }
    }
}

#[cfg(test)]
mod tests {
    use super::super::section::Cloud;
    use super::*;

    #[test]
    fn a_page_needs_nothing_else_and_escapes_names() {
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
