//! How errors grow towards the extremes, beside the bounds derived for them.

use super::{lines, missing, remarks, text};
use crate::render::chart::{Axis, Chart, Dot, Series};
use crate::render::page;
use crate::render::table::{Table, digits};
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
    #[serde(rename = "knob")]
    parameter: String,
    value: f64,
    median_error: f64,
    largest_error: f64,
    bound: Option<f64>,
    unit: String,
}

pub fn body(folder: &Path) -> Result<Markup> {
    let path = folder.join("growth.csv");
    let Some(rows) = lines::<Growth>(&path)? else {
        return Ok(missing(&path, "cargo xtask bench growth"));
    };
    let mut groups: BTreeMap<(&str, &str), BTreeMap<&str, Vec<&Growth>>> = BTreeMap::new();
    for row in &rows {
        let group = groups.entry((row.model(), &row.quantity)).or_default();
        group.entry(&row.parameter).or_default().push(row);
    }
    let devices = text(&folder.join("devices.csv"))?;
    let fuzz = text(&folder.join("fuzz.md"))?;
    Ok(html! {
        p { "Each error is the difference from the f64 reference. Filled dots are the largest error of a "
            "setting, hollow dots the bound that is derived for it. " code { "cargo xtask bench growth" } "." }
        (remarks(folder)?)
        @for (i, ((model, quantity), charts)) in groups.iter().enumerate() {
            details open[i == 0] {
                summary { "Errors of each " (quantity) @if !model.is_empty() { " of " (model) } }
                @for (parameter, rows) in charts { (chart(parameter, rows).figure()) }
            }
        }
        @if let Some(csv) = devices { details {
            summary { "The same dataset on every adapter" }
            (Table::from_csv("", csv.as_bytes()).context("reading devices.csv")?.html())
        } }
        @if let Some(fuzz) = fuzz { details { summary { "Fuzzing" } (page::markdown(&fuzz)) } }
    })
}

impl Growth {
    /// The network, where the row is about one: layers are named `MODEL/LAYER`.
    fn model(&self) -> &str {
        self.layer.split_once('/').map_or("", |(model, _)| model)
    }

    fn words(&self) -> String {
        let Self { quantity, layer, precision, parameter, value, .. } = self;
        format!("{quantity} {layer} in {precision}, {parameter} {value:e}")
    }
}

fn chart<'a>(parameter: &'a str, rows: &[&'a Growth]) -> Chart<'a> {
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
    let is_one_layer = rows.iter().all(|row| row.layer == rows[0].layer);
    // Activations and logits have no unit: their errors are differences.
    let in_metres = rows.iter().any(|row| row.unit == "m");
    Chart {
        message: message(parameter, rows),
        caption: "",
        x: Axis::Logarithmic(parameter),
        y: Axis::Logarithmic(if in_metres { "error, metres" } else { "error" }),
        series: Series::by_name(series, is_one_layer),
    }
}

/// How near the errors of `rows` come to their bounds.
fn message(parameter: &str, rows: &[&Growth]) -> String {
    let share = |row: &&Growth| row.bound.map(|bound| row.largest_error / bound);
    let largest = rows.iter().filter_map(share).fold(0.0, f64::max);
    match largest <= 1.0 {
        true => format!(
            "By {parameter}: every error is within its bound; the largest is {} % of it.",
            digits(100.0 * largest)
        ),
        false => format!("By {parameter}: an error is {} times its bound.", digits(largest)),
    }
}
