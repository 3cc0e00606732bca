//! How errors grow towards the extremes, beside the bounds derived for them.

use super::{missing, remarks, text};
use crate::page::chart::{Axis, Dot, Series, draw};
use crate::page::figure;
use crate::page::table::of_csv;
use anyhow::{Context, Result};
use maud::{Markup, html};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A line of `cargo xtask bench growth`'s CSV.
#[derive(Deserialize)]
struct Growth {
    quantity: String,
    layer: String,
    precision: String,
    knob: String,
    value: f64,
    median_error: f64,
    largest_error: f64,
    bound: Option<f64>,
    unit: String,
}

/// Drawings of the record in `folder`, and what else lies beside it.
///
/// # Errors
/// A file that `bench growth` did not write.
pub fn body(folder: &Path) -> Result<Markup> {
    let path = folder.join("growth.csv");
    if !path.is_file() {
        return Ok(missing(&path, "cargo xtask bench growth"));
    }
    let mut csv =
        csv::Reader::from_path(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let rows: Result<Vec<Growth>, csv::Error> = csv.deserialize().collect();
    let rows = rows.with_context(|| format!("reading {}", path.display()))?;
    let mut drawings: BTreeMap<(&str, &str), Vec<&Growth>> = BTreeMap::new();
    for row in &rows {
        drawings.entry((&row.quantity, &row.knob)).or_default().push(row);
    }
    let figures: Result<Vec<Markup>> =
        drawings.iter().map(|((quantity, knob), rows)| one(quantity, knob, rows)).collect();
    let devices = text(&folder.join("devices.csv"))?;
    let fuzz = text(&folder.join("fuzz.md"))?;
    Ok(html! {
        p { "Errors against the f64 reference, the largest of each setting; hollow dots are the bound "
            "that is derived for them. " code { "cargo xtask bench growth" } "." }
        (remarks(folder)?)
        @for figure in figures? { (figure) }
        @if let Some(csv) = devices {
            (of_csv("The same dataset on every adapter", csv.as_bytes()).context("reading devices.csv")?)
        }
        @if let Some(fuzz) = fuzz { details { summary { "Fuzzing" } pre { (fuzz) } } }
    })
}

fn one(quantity: &str, knob: &str, rows: &[&Growth]) -> Result<Markup> {
    let mut series: BTreeMap<String, Vec<Dot>> = BTreeMap::new();
    for row in rows {
        let words = [row.layer.as_str(), row.precision.as_str()];
        let name = words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ");
        let dots = series.entry(name.clone()).or_default();
        let at = format!("{name}\n{knob} {}", row.value);
        dots.push(Dot {
            x: row.value,
            y: row.largest_error,
            tip: format!(
                "{at}\nlargest error {:.2e} {}, median {:.2e}",
                row.largest_error, row.unit, row.median_error
            ),
            filled: true,
        });
        dots.extend(row.bound.map(|bound| Dot {
            x: row.value,
            y: bound,
            tip: format!("{at}\nbound {bound:.2e} {}", row.unit),
            filled: false,
        }));
    }
    let series: Vec<Series> =
        series.into_iter().map(|(name, dots)| Series { name, dots, joined: true }).collect();
    let unit = rows.first().map_or("", |row| &row.unit);
    let (across, up) = (knob.to_owned(), format!("error, {unit}"));
    let x = Axis { label: &across, logarithmic: true, percent: false };
    let y = Axis { label: &up, logarithmic: true, percent: false };
    let title = format!("{quantity} by {knob}");
    Ok(figure(&draw(&title, &x, &y, &series)?, ""))
}
