//! Records of `cargo xtask bench`.

use super::{entries, missing, remarks, text};
use crate::measure::clock::Spread;
use crate::render::chart::{Axis, Dot, Series, draw};
use crate::render::page::figure;
use anyhow::{Context, Result};
use maud::{Markup, html};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use xtask::workspace::file_name;

/// What is read of `bench infer --json`.
#[derive(Deserialize)]
struct Contest {
    classifying: Vec<Measured>,
}

/// One engine on clouds of one size.
#[derive(Deserialize)]
struct Measured {
    engine: String,
    ours: bool,
    points: usize,
    /// Threads.
    setting: usize,
    wall_ns: Vec<f64>,
}

/// Every record in `bench`.
///
/// # Errors
/// A file that `bench` did not write.
pub fn body(bench: &Path) -> Result<Markup> {
    let records: Vec<_> = entries(bench)?.into_iter().filter(|path| path.is_dir()).collect();
    if records.is_empty() {
        return Ok(missing(bench, "cargo xtask bench"));
    }
    let chapters: Result<Vec<Markup>> = records.iter().map(|folder| one(folder)).collect();
    Ok(html! { @for chapter in chapters? { (chapter) } })
}

fn one(folder: &Path) -> Result<Markup> {
    let contest = folder.join("infer.json");
    let drawing = match text(&contest)? {
        Some(json) => {
            let contest: Contest = serde_json::from_str(&json)
                .with_context(|| format!("reading {}", contest.display()))?;
            Some(figure(
                &by_points(&contest)?,
                "Filled: ours. One thread, medians of one run in turns.",
            ))
        }
        None => None,
    };
    let texts =
        entries(folder)?.into_iter().filter(|path| path.extension().is_some_and(|x| x == "txt"));
    let texts: Result<Vec<(String, Option<String>)>> =
        texts.map(|path| Ok((file_name(&path), text(&path)?))).collect();
    Ok(html! {
        h3 { (file_name(folder)) }
        (remarks(folder)?)
        @if let Some(drawing) = drawing { (drawing) }
        @for (name, text) in texts? {
            details { summary { (name) } pre { (text.unwrap_or_default()) } }
        }
    })
}

/// Milliseconds by points, one thread.
fn by_points(contest: &Contest) -> Result<String> {
    let mut series: BTreeMap<&str, Vec<Dot>> = BTreeMap::new();
    for measured in contest.classifying.iter().filter(|measured| measured.setting == 1) {
        let ms = Spread::of(measured.wall_ns.iter().map(|ns| ns * 1e-6)).median;
        let tip = format!("{}, {} points\n{ms:.3} ms", measured.engine, measured.points);
        let dot = Dot { x: measured.points as f64, y: ms, tip, filled: measured.ours };
        series.entry(&measured.engine).or_default().push(dot);
    }
    let series: Vec<Series> = series
        .into_iter()
        .map(|(name, dots)| Series { name: name.to_owned(), dots, joined: true })
        .collect();
    let x = Axis { label: "points", logarithmic: true, percent: false };
    let y = Axis { label: "milliseconds", logarithmic: true, percent: false };
    draw("PointNet of one cloud, one thread", &x, &y, &series)
}
