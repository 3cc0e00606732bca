//! `cargo xtask bench growth`: how errors grow, measured against f64, with the
//! derived bound of each.
//!
//! [`ranges`] is about the ranges that casters find, [`layers`] about a network's layers and logits
//! and about the number of products in a sum. A row is one value of one parameter.

mod layers;
mod probe;
mod ranges;

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use formats::atomic;

use crate::measure::clock::Spread;
use crate::render::table::{Column, Table};
use xtask::workspace::root;

#[derive(Args, Debug)]
pub struct GrowthArgs {
    /// CSV file to write, with one row for each quantity, layer, precision and value of a
    /// parameter.
    #[arg(long, value_name = "FILE")]
    csv: PathBuf,
    /// Number of clouds for each value of a parameter.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..))]
    clouds: u32,
}

/// Models whose layers are measured; their batch norms are folded in.
const MODELS: [&str; 3] = ["edge-64", "pointnet-64", "pointnet-1024"];

/// Half a unit in the last place of f64, relative.
const U64: f64 = 1.0 / (1u64 << 53) as f64;

/// One value of one parameter, with the defaults of the others.
#[derive(Clone, Copy)]
pub struct Setting {
    /// The parameter: scale, offset, distance, N (points or triangles), K (inputs).
    pub parameter: &'static str,
    pub value: f64,
}

fn settings(all: &[(&'static str, &[f64])]) -> Vec<Setting> {
    let values = all.iter().flat_map(|&(name, values)| values.iter().map(move |&v| (name, v)));
    values.map(|(parameter, value)| Setting { parameter, value }).collect()
}

impl Setting {
    /// The value of `parameter`: that of the setting, or `default`.
    fn of(&self, parameter: &str, default: f64) -> f64 {
        if self.parameter == parameter { self.value } else { default }
    }
}

/// One quantity at one setting.
pub struct Row {
    /// `range`, `activation` or `logit`.
    pub quantity: &'static str,
    /// The layer, behind its model's name; empty for ranges.
    pub layer: String,
    pub precision: String,
    pub setting: Setting,
    pub errors: Vec<f64>,
    /// No error may be above this.
    pub bound: f64,
    /// The largest magnitude of what the errors are of.
    pub magnitude: f64,
    /// Unit of error and bound.
    pub unit: &'static str,
}

impl Row {
    fn spread(&self) -> Spread {
        Spread::of(self.errors.iter().copied())
    }

    /// Whether there are errors, all within the bound; NaN sorts last and is not.
    fn holds(&self) -> bool {
        !self.errors.is_empty() && self.spread().max <= self.bound
    }
}

/// Measures, writes the CSV, and names the layers for which f16 is not exact enough. Fails if
/// an error is above its bound.
pub fn run(args: &GrowthArgs) -> Result<()> {
    let mut rows = ranges::measure();
    rows.extend(layers::by_width()?);
    for model in MODELS {
        eprintln!("{model}");
        let file = root().join("assets/weights").join(format!("{model}.safetensors"));
        rows.extend(layers::measure(&file, args.clouds)?);
    }
    atomic::write_bytes(&args.csv, &csv(&rows)?)?;
    println!("{} rows: {}", rows.len(), args.csv.display());
    println!("{}", verdict(&rows));
    let over = rows.iter().find(|row| !row.holds());
    match over {
        None => Ok(()),
        Some(row) => anyhow::bail!(
            "{} {} in {} at {} {:e}: expected errors of at most {:e}, found {:e}",
            row.quantity,
            row.layer,
            row.precision,
            row.setting.parameter,
            row.setting.value,
            row.bound,
            row.spread().max
        ),
    }
}

fn csv(rows: &[Row]) -> Result<Vec<u8>> {
    let columns: [Column<'_, Row>; 9] = [
        ("quantity", &|row| row.quantity.to_owned()),
        ("layer", &|row| row.layer.clone()),
        ("precision", &|row| row.precision.clone()),
        ("knob", &|row| row.setting.parameter.to_owned()),
        ("value", &|row| format!("{:e}", row.setting.value)),
        ("median_error", &|row| format!("{:.3e}", row.spread().median)),
        ("largest_error", &|row| format!("{:.3e}", row.spread().max)),
        ("bound", &|row| format!("{:.3e}", row.bound)),
        ("unit", &|row| row.unit.to_owned()),
    ];
    Table::of("", rows, &columns).to_csv()
}

/// A layer needs more than f16 where f16 overflows, or where its error is above
/// half a step of int8, 1/254 of the largest activation: then f16 is not even as
/// good as the precision below it.
fn verdict(rows: &[Row]) -> String {
    const HALF_A_STEP: f64 = 1.0 / 254.0;
    let in_f16 = |row: &&Row| row.precision.starts_with("f16") && row.setting.parameter != "K";
    let part = |row: &Row| row.spread().max / row.magnitude;
    let mut needy: Vec<&str> = rows
        .iter()
        .filter(in_f16)
        .filter(|row| row.precision != "f16" || part(row) > HALF_A_STEP)
        .map(|row| row.layer.as_str())
        .collect();
    needy.sort_unstable();
    needy.dedup();
    if !needy.is_empty() {
        return format!("layers that need more than f16: {}", needy.join(", "));
    }
    let worst = rows.iter().filter(in_f16).max_by(|a, b| part(a).total_cmp(&part(b)));
    worst.map_or_else(String::new, |row| {
        format!(
            "no layer needs more than f16; the worst, {}, is off by {:.2e} of its largest value at {} {:e}",
            row.layer,
            part(row),
            row.setting.parameter,
            row.setting.value
        )
    })
}
