//! `cargo xtask report`: everything that was measured, on one page that needs
//! nothing else.
//!
//! A file a chapter: [`scans`] shows clouds to turn, [`records`] what the files
//! under `assets/reports` hold, [`growth`] draws errors beside their bounds,
//! [`benchmarks`] draws `assets/bench`. What is not there is said, with the
//! command that makes it.

mod benchmarks;
mod growth;
mod records;
mod scans;

use crate::render::page::{self, Chapter};
use crate::study::trade;
use anyhow::{Context, Result, ensure};
use edgepuck_program::Outcome;
use edgepuck_program::trade_record as row;
use formats::atomic;
use maud::{Markup, html};
use std::fs;
use std::path::{Path, PathBuf};
use xtask::workspace;

/// Flags of `report`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder that holds reports, bench and meshes, as this repository's assets
    #[arg(long, value_name = "DIR")]
    assets: Option<PathBuf>,

    /// Where the page goes
    #[arg(long, value_name = "HTML", default_value = "data/report.html")]
    out: PathBuf,
}

/// Writes the page.
///
/// # Errors
/// A record that is not what its name says; what the system reports.
pub fn run(args: &Args) -> Result<Outcome> {
    let assets = args.assets.clone().unwrap_or_else(|| workspace::root().join("assets"));
    ensure!(assets.is_dir(), "--assets: {} is no folder", assets.display());
    let reports = assets.join("reports");
    let mut chapters = vec![Chapter { id: "scans", title: "Scans", body: scans::body(&assets)? }];
    chapters.extend(trade_chapters(&reports.join("trade/trade.csv"))?);
    let more: [(&'static str, &'static str, Markup); 4] = [
        ("effects", "Effects", records::ablations(&reports.join("ablations"))?),
        ("extremes", "Extremes", growth::body(&reports.join("extremes"))?),
        ("paper", "The paper, run again", records::reproduction(&reports)?),
        ("benchmarks", "Benchmarks", benchmarks::body(&assets.join("bench"))?),
    ];
    chapters.extend(more.map(|(id, title, body)| Chapter { id, title, body }));
    let lead = html! {
        p { "LiDAR scans of meshes, and what classifies them: what was measured, in one file that needs "
            "no network. Touch or point at a dot for its figures; drag a cloud to turn it." }
        p { "edgepuck " (env!("CARGO_PKG_VERSION")) ", " code { "cargo xtask report" } "; each chapter "
            "names the command that measures it again." }
    };
    let page = page::of("Edgepuck: what was measured", &lead, &chapters);
    if let Some(folder) = args.out.parent() {
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    }
    atomic::write_bytes(&args.out, page.as_bytes())?;
    eprintln!("A page to look at: {}", args.out.display());
    Ok(Outcome::Success)
}

fn trade_chapters(record: &Path) -> Result<Vec<Chapter>> {
    if !record.is_file() {
        let body = missing(record, "cargo xtask trade");
        return Ok(vec![Chapter { id: "trade", title: "The trade", body }]);
    }
    trade::page::chapters(&row::read(record)?)
}

/// Says that nothing was measured, and how to.
fn missing(record: &Path, command: &str) -> Markup {
    html! { p { "There is no " (record.display()) " yet: " code { (command) } " makes it." } }
}

/// The file's text; nothing where there is no file.
///
/// # Errors
/// A file that is there and cannot be read.
fn text(path: &Path) -> Result<Option<String>> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

/// What stands in `folder`, sorted; nothing where there is no such folder.
///
/// # Errors
/// A folder that is there and cannot be read.
fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let unread = || format!("cannot read {}", folder.display());
    let entries = fs::read_dir(folder).with_context(unread)?;
    let paths: std::io::Result<Vec<PathBuf>> = entries.map(|entry| Ok(entry?.path())).collect();
    let mut paths = paths.with_context(unread)?;
    paths.sort();
    Ok(paths)
}

/// The text that a record comes with.
fn remarks(folder: &Path) -> Result<Markup> {
    let text = text(&folder.join("README.md"))?;
    Ok(
        html! { @if let Some(text) = text { details { summary { "How it was measured" } pre { (text) } } } },
    )
}
