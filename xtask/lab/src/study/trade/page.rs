//! The record as tables, charts and a page.

use super::pareto::{dominated_settings, is_optimal};
use crate::render::chart::{Axis, Chart, Dot, Series};
use crate::render::page::{self, Chapter};
use crate::render::table::{Table, digits, percent};
use anyhow::Result;
use edgepuck_program::trade_record::{Device, Measurement, Part};
use formats::atomic;
use maud::{Markup, html};
use std::collections::BTreeMap;
use std::path::Path;
use xtask::workspace::command_line;

/// How the dots of both charts are read.
const CAPTION: &str = "Filled dots are Pareto-optimal: no other setting is as fast and as accurate. \
     Touch or point at a dot for its figures.";

pub fn write(rows: &[Measurement], folder: &Path) -> Result<()> {
    for (part, name) in [(Part::Classifier, "classifier"), (Part::Scan, "scan")] {
        let svg = chart(rows, part).file();
        atomic::write_bytes(&folder.join(format!("trade-{name}.svg")), svg.as_bytes())?;
    }
    let lead = html! {
        p { "The time and the accuracy of every setting, from mesh to class." }
        pre { (command_line()) }
    };
    let html = page::of("Speed and accuracy of every setting", &lead, &chapters(rows));
    Ok(atomic::write_bytes(&folder.join("trade.html"), html.as_bytes())?)
}

pub fn chapters(rows: &[Measurement]) -> Vec<Chapter> {
    let classifier = html! {
        (chart(rows, Part::Classifier).figure())
        (pareto_table(rows, Part::Classifier).html())
        p { "For each dominated setting, wherever it was measured, another is as fast and as accurate." }
        (dominated_table(rows).html())
        (every_setting(rows, Part::Classifier, CLASSIFIER_COLUMNS))
    };
    let scan = html! {
        (chart(rows, Part::Scan).figure())
        (pareto_table(rows, Part::Scan).html())
        (every_setting(rows, Part::Scan, SCAN_COLUMNS))
    };
    vec![
        classifier_chapter(classifier),
        Chapter::new("scan", "Sensors", "Which beams and steps can a sensor do without?", scan),
        Chapter::new(
            "caster",
            "Casters",
            "How exact are the ranges, and what does that cost?",
            table_of(rows, Part::Caster, CASTER_COLUMNS).html(),
        ),
    ]
}

/// The chapter on classifiers, which the page has even without a record.
pub fn classifier_chapter(body: Markup) -> Chapter {
    Chapter::new("classifier", "Settings", "Which setting fits my time budget?", body)
}

fn every_setting(rows: &[Measurement], part: Part, columns: &[Column]) -> Markup {
    let table = table_of(rows, part, columns);
    html! { details { summary { "All " (table.rows.len()) " settings" } (table.html()) } }
}

fn chart(rows: &[Measurement], part: Part) -> Chart<'static> {
    let device = device_of(rows, part);
    let of_part = || rows.iter().filter(|row| row.part == part);
    let noise_m = of_part().next().and_then(|reference| reference.noise_m);
    let mut series: BTreeMap<SeriesKey, Vec<Dot>> = BTreeMap::new();
    for row in of_part() {
        let Some(ms) = row.ms(device) else { continue };
        let filled = row.on_front(device);
        let dot = Dot { x: ms, y: row.accuracy, tip: tip(row, ms), filled };
        series.entry(series_key(row, noise_m)).or_default().push(dot);
    }
    let series = series.into_iter();
    let series = series.map(|((_, name, joined), dots)| Series { name, dots, joined });
    let label = match (part, device) {
        (Part::Classifier, Device::Pi5) => "milliseconds a cloud on a Raspberry Pi 5, modelled",
        (Part::Classifier, Device::Here) => "milliseconds a cloud on this machine",
        _ => "milliseconds of CPU time a scan",
    };
    Chart {
        message: message(rows, part, device),
        caption: CAPTION,
        x: Axis::Logarithmic(label),
        y: Axis::Percent("classified correctly"),
        series: series.collect(),
    }
}

fn message(rows: &[Measurement], part: Part, device: Device) -> String {
    let optimal = || rows.iter().filter(|row| row.part == part && row.on_front(device));
    let by_accuracy = |a: &&Measurement, b: &&Measurement| a.accuracy.total_cmp(&b.accuracy);
    let share = |row: &Measurement| format!("{} %", percent(row.accuracy));
    if part == Part::Classifier {
        let ms = |row: &Measurement| digits(row.ms(device).unwrap_or_default());
        let fastest = optimal().min_by(by_accuracy);
        return match (optimal().max_by(by_accuracy), fastest) {
            (Some(best), Some(fastest)) => format!(
                "The best setting classifies {} of the clouds correctly in {} ms, the fastest {} in {} ms.",
                share(best),
                ms(best),
                share(fastest),
                ms(fastest)
            ),
            _ => "No setting was measured.".to_owned(),
        };
    }
    let at = |row: &&Measurement| row.distance_m.unwrap_or_default();
    let best_from = |distance_m: f64| {
        optimal().filter(|row| at(row) == distance_m).max_by(by_accuracy).map(share)
    };
    let distances = optimal().map(|row| at(&row));
    let (near, far) = distances
        .fold((f64::INFINITY, 0.0), |(near, far): (f64, f64), m| (near.min(m), far.max(m)));
    match best_from(near).zip(best_from(far)) {
        Some((best, worst)) => format!(
            "At best, {best} of the scans from {near} m are classified correctly, and {worst} from {far} m."
        ),
        None => "No setting was measured.".to_owned(),
    }
}

/// Rows of one colour, in the order of distances and then of names: the bits of the
/// distance, which order as the number does because it is not negative, the name, and
/// whether a line joins the Pareto-optimal rows.
type SeriesKey = (u64, String, bool);

/// Scans with other noise than `noise_m` are a series of their own: noise is not a
/// choice, so they are not compared with the others.
fn series_key(row: &Measurement, noise_m: Option<f64>) -> SeriesKey {
    match (row.part, row.distance_m) {
        (Part::Scan, Some(distance_m)) => {
            let joined = row.noise_m == noise_m;
            let rest = if joined { "" } else { ", other noise" };
            (distance_m.to_bits(), format!("from {distance_m} m{rest}"), joined)
        }
        _ => (0, row.model.clone(), false),
    }
}

/// The board where it was modelled, else the machine of the record.
fn device_of(rows: &[Measurement], part: Part) -> Device {
    let modelled = rows.iter().any(|row| row.part == part && row.ms_pi5.is_some());
    if modelled { Device::Pi5 } else { Device::Here }
}

fn tip(row: &Measurement, ms: f64) -> String {
    format!("{row}\n{} ms, {} %", digits(ms), accuracy(row))
}

fn number(x: Option<f64>) -> String {
    x.map(digits).unwrap_or_default()
}

fn count(n: Option<usize>) -> String {
    n.map(|n| n.to_string()).unwrap_or_default()
}

fn accuracy(row: &Measurement) -> String {
    let [value, low, high] = [row.accuracy, row.accuracy_low, row.accuracy_high].map(percent);
    format!("{value} ({low} to {high})")
}

fn agreement(row: &Measurement) -> String {
    row.agreement.map(percent).unwrap_or_default()
}

fn millions_of_rays(row: &Measurement) -> String {
    number(row.rays_per_cpu_s.map(|rays| rays * 1e-6))
}

pub fn pareto_table(rows: &[Measurement], part: Part) -> Table {
    let device = device_of(rows, part);
    let mut optimal: Vec<&Measurement> =
        rows.iter().filter(|row| row.part == part && is_optimal(row)).collect();
    let ms = |row: &Measurement| row.ms(device).unwrap_or(f64::INFINITY);
    optimal.sort_by(|a, b| ms(a).total_cmp(&ms(b)));
    let heading = ["setting", "ms here", "ms on a Pi 5", "accuracy % (95 % interval)"];
    let title = match part {
        Part::Scan => "Pareto-optimal settings of the sensor, by distance and noise",
        Part::Caster => "Pareto-optimal casters",
        Part::Classifier => "Pareto-optimal settings of the classifier",
    };
    let mut table = Table::new(title, &heading);
    for row in optimal {
        table.push(vec![row.to_string(), number(row.ms_here), number(row.ms_pi5), accuracy(row)]);
    }
    table
}

/// The values of each parameter that no Pareto-optimal row has.
pub fn dominated_table(rows: &[Measurement]) -> Table {
    let mut table = Table::new("Dominated settings", &["parameter", "value"]);
    for (parameter, value) in dominated_settings(rows) {
        table.push(vec![parameter.to_owned(), value]);
    }
    table
}

type Column = (&'static str, fn(&Measurement) -> String);

fn table_of(rows: &[Measurement], part: Part, columns: &[Column]) -> Table {
    let of_part = || rows.iter().filter(|row| row.part == part);
    let caption = of_part().next().map_or_else(String::new, |row| {
        format!("On {}, {} clouds; {}", row.test_set, row.clouds, row.machine)
    });
    let heading: Vec<&str> = columns.iter().map(|(heading, _)| *heading).collect();
    let mut table = Table::new(caption, &heading);
    for row in of_part() {
        let words = columns.iter().map(|(_, words)| words(row)).collect();
        table.push::<String>(words);
        if is_optimal(row) {
            table.mark();
        }
    }
    table
}

const CLASSIFIER_COLUMNS: &[Column] = &[
    ("model", |row| row.model.clone()),
    ("sampler", |row| row.sampler.clone()),
    ("points", |row| count(row.points)),
    ("precision", |row| row.precision.clone()),
    ("T-Nets", |row| row.t_nets.clone()),
    ("threads", |row| count(row.threads)),
    ("ms here", |row| number(row.ms_here)),
    ("ms on a Pi 5", |row| number(row.ms_pi5)),
    ("MB", |row| number(row.megabytes)),
    ("accuracy %", accuracy),
    ("same class as fp32 %", agreement),
    ("largest error of a logit", |row| number(row.logit_error)),
    ("changed", |row| row.knob.clone()),
];

const SCAN_COLUMNS: &[Column] = &[
    ("sensor", |row| row.sensor.clone()),
    ("changed", |row| row.knob.clone()),
    ("azimuth step °", |row| number(row.azimuth_step_deg)),
    ("distance m", |row| number(row.distance_m)),
    ("noise m", |row| number(row.noise_m)),
    ("quantum m", |row| number(row.range_quantum_m)),
    ("CPU ms a scan", |row| number(row.ms_here)),
    ("M rays/CPU-s", millions_of_rays),
    ("kB", |row| number(row.megabytes.map(|mb| mb * 1e3))),
    ("points", |row| row.points_per_scan.map(|n| format!("{n:.0}")).unwrap_or_default()),
    ("range error m, RMS", |row| number(row.range_rms_m)),
    ("worst", |row| number(row.range_worst_m)),
    ("Chamfer m", |row| number(row.chamfer_m)),
    ("accuracy %", accuracy),
    ("same class as the reference %", agreement),
];

const CASTER_COLUMNS: &[Column] = &[
    ("caster", |row| row.caster.clone()),
    ("culling", |row| row.culling.clone()),
    ("CPU ms a scan", |row| number(row.ms_here)),
    ("M rays/CPU-s", millions_of_rays),
    ("range error m, RMS", |row| number(row.range_rms_m)),
    ("worst", |row| number(row.range_worst_m)),
    ("wrong rays in a million", |row| number(row.wrong_rays_per_million)),
    ("accuracy %", accuracy),
];
