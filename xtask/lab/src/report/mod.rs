//! `cargo xtask report`: every record on one self-contained page.
//!
//! Each file makes a chapter: [`scans`] shows clouds that can be rotated, [`live`] a turn of
//! a drive whose clusters are named, [`records`] the tables under `assets/reports`, [`growth`] errors beside their bounds,
//! [`benchmarks`] the records under `assets/bench`. For a missing record the page names
//! the command that makes it.

mod benchmarks;
mod growth;
mod live;
mod records;
mod scans;

use crate::render::page::{self, Chapter};
use crate::study::trade;
use anyhow::{Context, Result, ensure};
use edgepuck_program::Outcome;
use edgepuck_program::trade_record;
use formats::atomic;
use maud::{Markup, html};
use serde::de::DeserializeOwned;
use std::fs;
use std::path::{Path, PathBuf};
use xtask::workspace;

/// Flags of `report`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder that holds the folders reports, bench and meshes [default: this repository's assets]
    #[arg(long, value_name = "DIR")]
    assets: Option<PathBuf>,

    /// HTML file to write
    #[arg(long, value_name = "HTML", default_value = "data/report.html")]
    out: PathBuf,
}

/// Writes the page.
pub fn run(args: &Args) -> Result<Outcome> {
    let assets = args.assets.clone().unwrap_or_else(|| workspace::root().join("assets"));
    ensure!(assets.is_dir(), "--assets: expected a folder, found {}", assets.display());
    let reports = assets.join("reports");
    let scans = scans::body(&assets)?;
    let mut chapters = vec![Chapter::new("scans", "Scans", "What does a scan look like?", scans)];
    let question = "What does it see in a street?";
    chapters.push(Chapter::new("live", "Live", question, live::body()?));
    chapters.extend(trade_chapters(&reports.join("trade/trade.csv"))?);
    let reality = records::reality(&reports.join("reality"))?;
    let question = "What do networks make of real sensors' scans?";
    chapters.push(Chapter::new("reality", "Reality", question, reality));
    let effects = records::ablations(&reports.join("ablations"))?;
    let question = "Which effects of a scan matter to a classifier?";
    chapters.push(Chapter::new("effects", "Effects", question, effects));
    let errors = growth::body(&reports.join("extremes"))?;
    chapters.push(Chapter::new("extremes", "Errors", "How large can errors get?", errors));
    let paper = records::reproduction(&reports)?;
    chapters.push(Chapter::new("paper", "Paper", "Do the paper's experiments hold?", paper));
    let speed = benchmarks::body(&assets.join("bench"))?;
    let question = "How fast is it beside other engines?";
    chapters.push(Chapter::new("benchmarks", "Speed", question, speed));
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

/// Says that there is no record, and which command makes it.
fn missing(record: &Path, command: &str) -> Markup {
    html! { p { "There is no " (record.display()) " yet: " code { (command) } " makes it." } }
}

/// The file's text; nothing where there is no file.
fn text(path: &Path) -> Result<Option<String>> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

/// The lines of a record; nothing where there is no file.
fn lines<T: DeserializeOwned>(csv: &Path) -> Result<Option<Vec<T>>> {
    let Some(text) = text(csv)? else { return Ok(None) };
    let lines: Result<Vec<T>, csv::Error> =
        csv::Reader::from_reader(text.as_bytes()).into_deserialize().collect();
    lines.map(Some).with_context(|| format!("reading {}", csv.display()))
}

/// What stands in `folder`, sorted; nothing where there is no such folder.
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

/// The README of a record.
fn remarks(folder: &Path) -> Result<Markup> {
    let text = text(&folder.join("README.md"))?;
    Ok(
        html! { @if let Some(text) = text { details { summary { "How it was measured" } (page::markdown(&text)) } } },
    )
}
