//! How errors grow towards the extremes, beside the bounds derived for them.

use super::{missing, remarks, text};
use crate::render::chart::{Axis, Dot, Series, draw};
use crate::render::page::figure;
use crate::render::table::of_csv;
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
    let mut drawings: BTreeMap<(&str, &str, &str), Vec<&Growth>> = BTreeMap::new();
    for row in &rows {
        drawings.entry((&row.quantity, row.model(), &row.knob)).or_default().push(row);
    }
    let figures: Result<Vec<Markup>> = drawings.values().map(|rows| one(rows)).collect();
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

impl Growth {
    /// The network, where the row is about one: layers are named `MODEL/LAYER`.
    fn model(&self) -> &str {
        self.layer.split_once('/').map_or("", |(model, _)| model)
    }

    fn words(&self) -> String {
        let Self { quantity, layer, precision, knob, value, .. } = self;
        format!("{quantity} {layer} in {precision}, {knob} {value:e}")
    }
}

/// Errors of one quantity by one knob; a colour a precision.
fn one(rows: &[&Growth]) -> Result<Markup> {
    let Some(first) = rows.first() else { return Ok(Markup::default()) };
    let mut series: BTreeMap<&str, Vec<Dot>> = BTreeMap::new();
    for row in rows {
        let dots = series.entry(&row.precision).or_default();
        let Growth { median_error, largest_error, unit, .. } = row;
        let errors = format!("largest error {largest_error:.2e} {unit}, median {median_error:.2e}");
        let tip = format!("{}\n{errors}", row.words());
        dots.push(Dot { x: row.value, y: *largest_error, tip, filled: true });
        dots.extend(row.bound.map(|bound| Dot {
            x: row.value,
            y: bound,
            tip: format!("{}\nbound {bound:.2e} {unit}", row.words()),
            filled: false,
        }));
    }
    let is_one_layer = rows.iter().all(|row| row.layer == first.layer);
    let series: Vec<Series> = series
        .into_iter()
        .map(|(name, dots)| Series { name: name.to_owned(), dots, joined: is_one_layer })
        .collect();
    // Activations and logits have no unit: their errors are differences.
    let unit = if first.unit == "1" { "" } else { &first.unit };
    let label = ["error", unit].join(" ");
    let x = Axis { label: &first.knob, logarithmic: true, percent: false };
    let y = Axis { label: &label, logarithmic: true, percent: false };
    let title = format!("{} {} by {}", first.model(), first.quantity, first.knob);
    Ok(figure(&draw(title.trim(), &x, &y, &series)?, ""))
}
