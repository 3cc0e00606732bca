//! Records of `cargo xtask bench`.

use super::{entries, missing, remarks, text};
use crate::measure::clock::Spread;
use crate::render::chart::{Axis, Chart, Dot, Series};
use crate::render::table::digits;
use anyhow::{Context, Result};
use maud::{Markup, html};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use xtask::workspace::file_name;

/// The fields of `bench infer --json` that are needed.
#[derive(Deserialize)]
struct Comparison {
    classifying: Vec<Measured>,
}

#[derive(Deserialize)]
struct Measured {
    engine: String,
    ours: bool,
    points: usize,
    /// Threads.
    setting: usize,
    wall_ns: Vec<f64>,
}

pub fn body(bench: &Path) -> Result<Markup> {
    let records: Vec<_> = entries(bench)?.into_iter().filter(|path| path.is_dir()).collect();
    if records.is_empty() {
        return Ok(missing(bench, "cargo xtask bench"));
    }
    let chapters: Result<Vec<Markup>> = records.iter().map(|folder| one(folder)).collect();
    Ok(html! { @for chapter in chapters? { (chapter) } })
}

fn one(folder: &Path) -> Result<Markup> {
    let file = folder.join("infer.json");
    let drawing = match text(&file)? {
        Some(json) => {
            let comparison: Comparison = serde_json::from_str(&json)
                .with_context(|| format!("reading {}", file.display()))?;
            Some(by_points(&comparison).figure())
        }
        None => None,
    };
    let mut texts = entries(folder)?;
    texts.retain(|path| path.extension().is_some_and(|extension| extension == "txt"));
    Ok(html! {
        h3 { (file_name(folder)) }
        (remarks(folder)?)
        @if let Some(drawing) = drawing { (drawing) }
        @for path in texts {
            details { summary { (file_name(&path)) } pre { (text(&path)?.unwrap_or_default()) } }
        }
    })
}

fn by_points(comparison: &Comparison) -> Chart<'static> {
    let mut series: BTreeMap<&str, Vec<Dot>> = BTreeMap::new();
    for measured in comparison.on_one_thread() {
        let ms = measured.ms();
        let tip = format!("{}, {} points\n{ms:.3} ms", measured.engine, measured.points);
        let dot = Dot { x: measured.points as f64, y: ms, tip, filled: measured.ours };
        let name = if measured.ours { &measured.engine } else { "other engines" };
        series.entry(name).or_default().push(dot);
    }
    Chart {
        message: comparison.message(),
        caption: "PointNet on one cloud with one thread, medians of one run in turns. Filled: Edgepuck, by precision.",
        x: Axis::Logarithmic("points"),
        y: Axis::Logarithmic("milliseconds"),
        series: Series::by_name(series, true),
    }
}

impl Measured {
    fn ms(&self) -> f64 {
        Spread::of(self.wall_ns.iter().map(|ns| ns * 1e-6)).median
    }
}

impl Comparison {
    fn on_one_thread(&self) -> impl Iterator<Item = &Measured> {
        self.classifying.iter().filter(|measured| measured.setting == 1)
    }

    /// The fastest engine of ours and of others at the baseline's number of points.
    fn message(&self) -> String {
        const POINTS: usize = 1024;
        let fastest = |ours: bool| {
            let of = self.on_one_thread().filter(|m| m.points == POINTS && m.ours == ours);
            of.min_by(|a, b| a.ms().total_cmp(&b.ms()))
        };
        match fastest(true).zip(fastest(false)) {
            Some((ours, other)) => format!(
                "With {POINTS} points {} takes {} ms; the fastest other engine, {}, takes {} ms.",
                ours.engine,
                digits(ours.ms()),
                other.engine,
                digits(other.ms())
            ),
            None => "Milliseconds to classify one cloud, by its points.".to_owned(),
        }
    }
}
