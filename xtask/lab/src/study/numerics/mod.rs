//! `cargo xtask bench growth`: how errors grow, measured against f64, with the
//! derived bound of each.
//!
//! [`ranges`] is about the ranges that casters find, [`layers`] about a network's
//! layers and logits, [`widths`] about the number of products in a sum. A row is one
//! value of one parameter.

mod clouds;
mod layers;
mod probe;
mod ranges;
mod widths;

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use formats::atomic;

use xtask::workspace::root;

/// Flags of `bench growth`.
#[derive(Args, Debug)]
pub struct GrowthArgs {
    /// CSV file to write, a row for each quantity, layer, precision and value of a parameter.
    #[arg(long, value_name = "FILE")]
    csv: PathBuf,
    /// Models whose layers are measured; batch norms must be folded in [default:
    /// edge-64, pointnet-64 and pointnet-1024 of assets/weights].
    #[arg(long, value_name = "FILE,...", value_delimiter = ',')]
    models: Vec<PathBuf>,
    /// Clouds for each value of a parameter.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..))]
    clouds: u32,
}

/// One quantity at one setting.
pub struct Row {
    /// `range`, `activation` or `logit`.
    pub quantity: &'static str,
    /// The layer, behind its model's name; empty for ranges.
    pub layer: String,
    /// What it was computed in.
    pub precision: String,
    /// The parameter: scale, offset, distance, N (points or triangles), K (inputs).
    pub parameter: &'static str,
    /// Its value.
    pub value: f64,
    /// The errors found.
    pub errors: Vec<f64>,
    /// No error may be above this.
    pub bound: f64,
    /// The largest magnitude of what the errors are of.
    pub magnitude: f64,
    /// Of error and bound.
    pub unit: &'static str,
}

impl Row {
    /// The middle and the largest error.
    fn summary(&self) -> (f64, f64) {
        let mut errors = self.errors.clone();
        errors.sort_by(f64::total_cmp);
        let middle = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
        (middle, errors.last().copied().unwrap_or(0.0))
    }

    /// Whether there are errors, and none is above the bound; NaN, the last of
    /// all, is.
    fn holds(&self) -> bool {
        !self.errors.is_empty() && self.summary().1 <= self.bound
    }
}

/// Measures, writes the CSV, and names the layers for which f16 is not exact enough.
///
/// # Errors
/// A model that cannot be read or has batch norms, a file that cannot be written,
/// an error above its bound.
pub fn run(args: &GrowthArgs) -> Result<()> {
    let mut rows = ranges::measure();
    rows.extend(widths::measure()?);
    for model in args.models() {
        eprintln!("{}", model.display());
        rows.extend(layers::measure(&model, args.clouds)?);
    }
    atomic::write_bytes(&args.csv, &csv(&rows)?)?;
    println!("{} rows: {}", rows.len(), args.csv.display());
    println!("{}", verdict(&rows));
    let over = rows.iter().find(|row| !row.holds());
    match over {
        None => Ok(()),
        Some(row) => anyhow::bail!(
            "{} {} in {} at {} {:e}: error {:e}, above its bound {:e}",
            row.quantity,
            row.layer,
            row.precision,
            row.parameter,
            row.value,
            row.summary().1,
            row.bound
        ),
    }
}

impl GrowthArgs {
    fn models(&self) -> Vec<PathBuf> {
        if !self.models.is_empty() {
            return self.models.clone();
        }
        let weights = root().join("assets/weights");
        let bundled = ["edge-64", "pointnet-64", "pointnet-1024"];
        bundled.map(|name| weights.join(format!("{name}.safetensors"))).to_vec()
    }
}

fn csv(rows: &[Row]) -> Result<Vec<u8>> {
    const HEADING: &str =
        "quantity,layer,precision,knob,value,median_error,largest_error,bound,unit";
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(HEADING.split(','))?;
    for row in rows {
        let (median, largest) = row.summary();
        let numbers = [median, largest, row.bound].map(|x| format!("{x:.3e}"));
        let value = format!("{:e}", row.value);
        let words = [row.quantity, &row.layer, &row.precision, row.parameter, &value];
        let words = words.into_iter().chain(numbers.iter().map(String::as_str));
        csv.write_record(words.chain([row.unit]))?;
    }
    Ok(csv.into_inner()?)
}

/// A layer needs more than f16 where f16 overflows, or where its error is above
/// half a step of int8, 1/254 of the largest activation: then f16 is not even as
/// good as the precision below it.
fn verdict(rows: &[Row]) -> String {
    const HALF_A_STEP: f64 = 1.0 / 254.0;
    let in_f16 = |row: &&Row| row.precision.starts_with("f16") && row.parameter != "K";
    let part = |row: &Row| row.summary().1 / row.magnitude;
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
            row.parameter,
            row.value
        )
    })
}
