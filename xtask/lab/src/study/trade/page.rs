//! The record as a page and as drawings.

use super::front::dominated_everywhere;
use crate::render::chart::{Axis, Dot, Series, draw};
use crate::render::page::{self, Chapter, figure};
use crate::render::table::table;
use crate::render::text_table::digits;
use anyhow::Result;
use edgepuck_program::trade_record::{Device, Part, Row};
use formats::atomic;
use maud::{Markup, html};
use std::collections::BTreeMap;
use std::path::Path;
use xtask::workspace::command_line;

/// Writes `trade.html` and a drawing a part to `folder`.
///
/// # Errors
/// What the system or the plotting library reports.
pub fn write(rows: &[Row], folder: &Path) -> Result<()> {
    for (part, name) in [(Part::Classifier, "classifier"), (Part::Scan, "scan")] {
        let svg = fronts(rows, part)?;
        atomic::write_bytes(&folder.join(format!("trade-{name}.svg")), svg.as_bytes())?;
    }
    let lead = html! {
        p { "What each knob of the chain, from mesh to class, costs, and what it is worth. "
            "Bold rows are on the front: no other of their kind costs as little and is as good." }
        pre { (command_line()) }
    };
    let html = page::of("The trade: speed against accuracy", &lead, &chapters(rows)?);
    Ok(atomic::write_bytes(&folder.join("trade.html"), html.as_bytes())?)
}

/// A chapter for each part of the chain, and one of what is dominated.
///
/// # Errors
/// What the plotting library reports.
pub fn chapters(rows: &[Row]) -> Result<Vec<Chapter>> {
    let classifier = html! {
        (figure(&fronts(rows, Part::Classifier)?, "Every model, sampler, number of points, precision \
            and number of threads. Filled: on the front of all."))
        (classifier_table(rows))
    };
    let scan = html! {
        (figure(&fronts(rows, Part::Scan)?, "Sensors, by distance. Filled: on the front of their distance and noise."))
        (scan_table(rows))
    };
    Ok(vec![
        Chapter { id: "classifier", title: "From cloud to class", body: classifier },
        Chapter { id: "scan", title: "From mesh to scan", body: scan },
        Chapter { id: "caster", title: "Casters", body: caster_table(rows) },
        Chapter { id: "dominated", title: "On no front", body: dominated(rows) },
    ])
}

/// Cost against accuracy of one part's rows.
fn fronts(rows: &[Row], part: Part) -> Result<String> {
    let device = device_of(rows, part);
    let of_part = || rows.iter().filter(|row| row.part == part);
    let noise_m = of_part().next().and_then(|reference| reference.noise_m);
    let mut series: BTreeMap<Kin, Vec<Dot>> = BTreeMap::new();
    for row in of_part() {
        let Some(ms) = row.ms(device) else { continue };
        let filled = row.on_front(device);
        let dot = Dot { x: ms, y: row.accuracy, tip: tip(row, ms), filled };
        series.entry(kin(row, noise_m)).or_default().push(dot);
    }
    let series: Vec<Series> = series
        .into_iter()
        .map(|(Kin { name, joined, .. }, dots)| Series { name, dots, joined })
        .collect();
    let label = match (part, device) {
        (Part::Classifier, Device::Pi5) => "milliseconds on a Raspberry Pi 5, modelled",
        (Part::Classifier, Device::Here) => "milliseconds on this machine",
        _ => "milliseconds of CPU time a scan",
    };
    let x = Axis { label, logarithmic: true, percent: false };
    let y = Axis { label: "classified as labelled", logarithmic: false, percent: true };
    let title = match part {
        Part::Scan => "From mesh to scan",
        Part::Caster => "Casters",
        Part::Classifier => "From cloud to class",
    };
    draw(title, &x, &y, &series)
}

/// Rows of one colour; in the order of distances, then of names.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Kin {
    /// Bits of a number that is not negative: they order as it does.
    distance: u64,
    name: String,
    /// Whether a line joins those on the front.
    joined: bool,
}

/// Scans with other noise than `noise_m` stand for themselves: noise is no choice,
/// so that they are on no common front.
fn kin(row: &Row, noise_m: Option<f64>) -> Kin {
    match (row.part, row.distance_m) {
        (Part::Scan, Some(distance_m)) => {
            let joined = row.noise_m == noise_m;
            let rest = if joined { "" } else { ", other noise" };
            let name = format!("{distance_m} m away{rest}");
            Kin { distance: distance_m.to_bits(), name, joined }
        }
        _ => Kin { distance: 0, name: row.model.clone(), joined: false },
    }
}

/// The board where it was modelled, else the machine of the record.
fn device_of(rows: &[Row], part: Part) -> Device {
    let modelled = rows.iter().any(|row| row.part == part && row.ms_pi5.is_some());
    if modelled { Device::Pi5 } else { Device::Here }
}

fn tip(row: &Row, ms: f64) -> String {
    let share = format!(
        "{:.1} % ({:.1} to {:.1})",
        100.0 * row.accuracy,
        100.0 * row.accuracy_low,
        100.0 * row.accuracy_high
    );
    format!("{row}\n{} ms, {share}", digits(ms))
}

fn percent(share: Option<f64>) -> String {
    share.map(|share| format!("{:.1}", 100.0 * share)).unwrap_or_default()
}

fn number(x: Option<f64>) -> String {
    x.map(digits).unwrap_or_default()
}

fn accuracy(row: &Row) -> String {
    let [value, low, high] =
        [row.accuracy, row.accuracy_low, row.accuracy_high].map(|share| percent(Some(share)));
    format!("{value} ({low} to {high})")
}

/// What the rows of `part` were measured on.
fn caption(rows: &[Row], part: Part) -> String {
    let row = rows.iter().find(|row| row.part == part);
    row.map_or_else(String::new, |row| {
        format!("On {}, {} clouds; {}", row.test_set, row.clouds, row.machine)
    })
}

fn rows_of(
    rows: &[Row],
    part: Part,
    words: impl Fn(&Row) -> Vec<String>,
) -> Vec<(bool, Vec<String>)> {
    let of_part = rows.iter().filter(|row| row.part == part);
    of_part.map(|row| (row.front_here || row.front_pi5, words(row))).collect()
}

fn classifier_table(rows: &[Row]) -> Markup {
    let heading = [
        "model",
        "sampler",
        "points",
        "precision",
        "T-Nets",
        "threads",
        "ms here",
        "ms on a Pi 5",
        "J",
        "MB",
        "accuracy %",
        "as fp32 %",
        "largest error of a logit",
        "turned",
    ];
    let words = |row: &Row| {
        vec![
            row.model.clone(),
            row.sampler.clone(),
            row.points.map(|n| n.to_string()).unwrap_or_default(),
            row.precision.clone(),
            row.t_nets.clone(),
            row.threads.map(|n| n.to_string()).unwrap_or_default(),
            number(row.ms_here),
            number(row.ms_pi5),
            number(row.joules),
            number(row.megabytes),
            accuracy(row),
            percent(row.agreement),
            number(row.logit_error),
            row.knob.clone(),
        ]
    };
    let part = Part::Classifier;
    table(&caption(rows, part), &heading, &rows_of(rows, part, words))
}

fn scan_table(rows: &[Row]) -> Markup {
    let heading = [
        "sensor",
        "turned",
        "azimuth step °",
        "distance m",
        "noise m",
        "quantum m",
        "CPU ms a scan",
        "M rays/CPU-s",
        "J",
        "kB",
        "points",
        "range error m, RMS",
        "worst",
        "Chamfer m",
        "accuracy %",
        "as reference %",
    ];
    let words = |row: &Row| {
        vec![
            row.sensor.clone(),
            row.knob.clone(),
            number(row.azimuth_step_deg),
            number(row.distance_m),
            number(row.noise_m),
            number(row.range_quantum_m),
            number(row.ms_here),
            number(row.rays_per_cpu_s.map(|rays| rays * 1e-6)),
            number(row.joules),
            number(row.megabytes.map(|mb| mb * 1e3)),
            row.points_per_scan.map(|n| format!("{n:.0}")).unwrap_or_default(),
            number(row.range_rms_m),
            number(row.range_worst_m),
            number(row.chamfer_m),
            accuracy(row),
            percent(row.agreement),
        ]
    };
    table(&caption(rows, Part::Scan), &heading, &rows_of(rows, Part::Scan, words))
}

fn caster_table(rows: &[Row]) -> Markup {
    let heading = [
        "caster",
        "culling",
        "CPU ms a scan",
        "M rays/CPU-s",
        "range error m, RMS",
        "worst",
        "wrong rays in a million",
        "accuracy %",
    ];
    let words = |row: &Row| {
        vec![
            row.caster.clone(),
            row.culling.clone(),
            number(row.ms_here),
            number(row.rays_per_cpu_s.map(|rays| rays * 1e-6)),
            number(row.range_rms_m),
            number(row.range_worst_m),
            number(row.wrong_rays_per_million),
            accuracy(row),
        ]
    };
    table(&caption(rows, Part::Caster), &heading, &rows_of(rows, Part::Caster, words))
}

fn dominated(rows: &[Row]) -> Markup {
    let choices = dominated_everywhere(rows).into_iter();
    let choices: Vec<(bool, Vec<String>)> =
        choices.map(|(knob, value)| (false, vec![knob.to_owned(), value])).collect();
    html! {
        p { "For each of these settings, wherever it was measured, another costs as little and is as good." }
        (table("On no front", &["knob", "setting"], &choices))
    }
}
