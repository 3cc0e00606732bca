//! `cargo xtask report`: every record on one self-contained page.
//!
//! Each file makes a chapter: [`scans`] shows clouds that can be rotated, [`records`] the tables
//! under `assets/reports`, [`growth`] errors beside their bounds, [`benchmarks`] the records under
//! `assets/bench`. For a missing record the page names the command that makes it.

mod benchmarks;
mod growth;
mod records;
mod scans;

use crate::render::page::{self, Chapter};
use crate::study::trade;
use anyhow::{Context, Result, ensure};
use edgepuck_program::{Outcome, trade_record};
use formats::atomic;
use maud::{Markup, html};
use serde::de::DeserializeOwned;
use std::fs;
use std::path::{Path, PathBuf};
use xtask::workspace;

#[derive(clap::Args)]
pub struct ReportArgs {
    /// Folder that holds the folders reports, bench and meshes [default: this repository's assets]
    #[arg(long, value_name = "DIR")]
    assets: Option<PathBuf>,

    /// HTML file to write
    #[arg(long, value_name = "HTML", default_value = "data/report.html")]
    out: PathBuf,
}

pub fn run(args: &ReportArgs) -> Result<Outcome> {
    let assets = args.assets.clone().unwrap_or_else(|| workspace::root().join("assets"));
    ensure!(assets.is_dir(), "--assets: expected a folder, found {}", assets.display());
    let reports = assets.join("reports");
    let scans = scans::body(&assets)?;
    let mut chapters = vec![Chapter::new("scans", "Scans", "What does a scan look like?", scans)];
    chapters.extend(trade_chapters(&reports.join("trade/trade.csv"))?);
    let reality = records::reality(&reports.join("reality"))?;
    let effects = records::ablations(&reports.join("ablations"))?;
    let errors = growth::body(&reports.join("extremes"))?;
    let paper = records::reproduction(&reports)?;
    let speed = benchmarks::body(&assets.join("bench"))?;
    for (id, tab, question, body) in [
        ("reality", "Reality", "What do networks make of real sensors' scans?", reality),
        ("effects", "Effects", "Which effects of a scan matter to a classifier?", effects),
        ("extremes", "Errors", "How large can errors get?", errors),
        ("paper", "Paper", "Do the paper's experiments hold?", paper),
        ("benchmarks", "Speed", "How fast is it beside other engines?", speed),
    ] {
        chapters.push(Chapter::new(id, tab, question, body));
    }
    let lead = html! {
        p { "LiDAR scans of meshes and the networks that classify them: every measurement of edgepuck "
            (env!("CARGO_PKG_VERSION")) " in one file that works offline. Touch or point at a dot for its "
            "figures. Each chapter names the command that measures it again." }
    };
    let page = page::of("Edgepuck: every measurement", &lead, &chapters);
    if let Some(folder) = args.out.parent() {
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    }
    atomic::write_bytes(&args.out, page.as_bytes())?;
    eprintln!("The page is in {}", args.out.display());
    Ok(Outcome::Success)
}

fn trade_chapters(record: &Path) -> Result<Vec<Chapter>> {
    if !record.is_file() {
        let body = missing(record, "cargo xtask trade");
        return Ok(vec![trade::page::classifier_chapter(body)]);
    }
    Ok(trade::page::chapters(&trade_record::read(record)?))
}

/// A remark that there is no record, with the command that makes it.
fn missing(record: &Path, command: &str) -> Markup {
    html! { p { "There is no " (record.display()) " yet: " code { (command) } " makes it." } }
}

/// The file's text; `None` if there is no file.
fn text(path: &Path) -> Result<Option<String>> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

/// The lines of a record; `None` if there is no file.
fn lines<T: DeserializeOwned>(csv: &Path) -> Result<Option<Vec<T>>> {
    let Some(text) = text(csv)? else { return Ok(None) };
    let lines: Result<Vec<T>, csv::Error> =
        csv::Reader::from_reader(text.as_bytes()).into_deserialize().collect();
    lines.map(Some).with_context(|| format!("reading {}", csv.display()))
}

/// The sorted entries of `folder`; empty if there is no such folder.
fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let paths = fs::read_dir(folder).and_then(|entries| {
        entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<PathBuf>>>()
    });
    let mut paths = paths.with_context(|| format!("cannot read {}", folder.display()))?;
    paths.sort();
    Ok(paths)
}

fn remarks(folder: &Path) -> Result<Markup> {
    let text = text(&folder.join("README.md"))?;
    Ok(
        html! { @if let Some(text) = text { details { summary { "How it was measured" } (page::markdown(&text)) } } },
    )
}
