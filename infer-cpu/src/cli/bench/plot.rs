//! The trade as a picture: accuracy over latency, the front as a line.

use std::path::Path;

use formats::atomic;
use infer_cpu::Precision;
use svg::Document;
use svg::node::element::{Circle, Line, Polyline, Text, Title};

use super::trade::Row;

const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 600.0;
/// Room for labels left of and below the axes, and for the rest.
const MARGIN: f64 = 60.0;

/// Draws `rows` into the SVG file at `path`.
///
/// # Errors
/// A file that cannot be written.
pub fn write(path: &Path, rows: &[Row]) -> anyhow::Result<()> {
    let picture = picture(rows).to_string();
    atomic::write_bytes(path, &picture)?;
    Ok(())
}

/// From figures to places: latency by its logarithm, accuracy linearly.
struct Axes {
    /// Logarithms of the latencies at both ends.
    log_ms: (f64, f64),
    /// Accuracies at both ends, percent.
    percent: (f64, f64),
}

impl Axes {
    fn of(rows: &[Row]) -> Self {
        let times = rows.iter().map(|row| row.p50_ms.max(1e-6));
        let least = rows.iter().map(Row::accuracy).fold(1.0, f64::min) * 100.0;
        let most = rows.iter().map(Row::accuracy).fold(0.0, f64::max) * 100.0;
        let fastest = times.clone().fold(f64::INFINITY, f64::min);
        let slowest = times.fold(fastest, f64::max);
        Self {
            log_ms: ((fastest * 0.8).ln(), (slowest * 1.25).ln()),
            percent: ((least - 2.0).max(0.0).floor(), (most + 2.0).min(100.0).ceil()),
        }
    }

    fn x(&self, ms: f64) -> f64 {
        let share = (ms.max(1e-6).ln() - self.log_ms.0) / (self.log_ms.1 - self.log_ms.0);
        MARGIN + share * (WIDTH - 2.0 * MARGIN)
    }

    fn y(&self, percent: f64) -> f64 {
        let share = (percent - self.percent.0) / (self.percent.1 - self.percent.0).max(1e-9);
        HEIGHT - MARGIN - share * (HEIGHT - 2.0 * MARGIN)
    }

    /// 1, 2 and 5 of every power of ten on the axis.
    fn ticks_ms(&self) -> Vec<f64> {
        let powers = (-6..7).map(|power| 10f64.powi(power));
        let ticks = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * power));
        ticks.filter(|ms| (self.log_ms.0..=self.log_ms.1).contains(&ms.ln())).collect()
    }

    /// Whole percents, ten or so of them.
    fn ticks_percent(&self) -> Vec<f64> {
        let step = ((self.percent.1 - self.percent.0) / 10.0).ceil().max(1.0);
        let first = (self.percent.0 / step).ceil() as i64;
        let last = (self.percent.1 / step).floor() as i64;
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

fn colour(precision: Precision) -> &'static str {
    match precision {
        Precision::F32 => "#1f77b4",
        Precision::F32Fc16 => "#17a096",
        Precision::F16 => "#2c8c2c",
        Precision::I8 => "#d63c28",
    }
}

fn picture(rows: &[Row]) -> Document {
    let axes = Axes::of(rows);
    let mut picture = Document::new()
        .set("viewBox", (0, 0, WIDTH, HEIGHT))
        .set("font-family", "sans-serif")
        .set("font-size", 12)
        .set("style", "background: white")
        .add(text("Accuracy over latency", WIDTH / 2.0, 28.0).set("font-size", 18))
        .add(text("median latency, ms", WIDTH / 2.0, HEIGHT - 16.0))
        .add(text("accuracy, %", 8.0, MARGIN - 16.0).set("text-anchor", "start"));
    for ms in axes.ticks_ms() {
        let x = axes.x(ms);
        picture = picture.add(line((x, MARGIN), (x, HEIGHT - MARGIN))).add(text(
            &format!("{ms}"),
            x,
            HEIGHT - MARGIN + 18.0,
        ));
    }
    for percent in axes.ticks_percent() {
        let y = axes.y(percent);
        picture = picture.add(line((MARGIN, y), (WIDTH - MARGIN, y))).add(text(
            &format!("{percent}"),
            MARGIN - 18.0,
            y + 4.0,
        ));
    }
    picture = front(picture, &axes, rows);
    for row in rows {
        picture = picture.add(point(&axes, row));
    }
    for (i, precision) in Precision::ALL.into_iter().enumerate() {
        let y = HEIGHT - MARGIN - 80.0 + 18.0 * i as f64;
        let dot = Circle::new().set("cx", WIDTH - MARGIN - 90.0).set("cy", y).set("r", 4);
        picture = picture.add(dot.set("fill", colour(precision))).add(text(
            precision.name(),
            WIDTH - MARGIN - 50.0,
            y + 4.0,
        ));
    }
    picture
}

/// The settings that none dominates, joined and named.
fn front(picture: Document, axes: &Axes, rows: &[Row]) -> Document {
    let mut front: Vec<&Row> = rows.iter().filter(|row| row.on_front).collect();
    front.sort_by(|a, b| a.p50_ms.total_cmp(&b.p50_ms));
    let place = |row: &&Row| (axes.x(row.p50_ms), axes.y(100.0 * row.accuracy()));
    let places: Vec<String> =
        front.iter().map(place).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let line = Polyline::new().set("points", places.join(" ")).set("fill", "none");
    let picture = picture.add(line.set("stroke", "#555"));
    front.iter().fold(picture, |picture, row| {
        let (x, y) = place(row);
        let name = format!("{} {}", row.setting.sampler, row.setting.points);
        picture.add(text(&name, x, y - 8.0).set("font-size", 10))
    })
}

fn point(axes: &Axes, row: &Row) -> Circle {
    let setting = &row.setting;
    let title = format!(
        "{} {} points, {}, T-Nets {}, {} threads: {:.3} ms, {:.2} %",
        setting.sampler,
        setting.points,
        setting.precision,
        setting.t_nets,
        setting.threads,
        row.p50_ms,
        100.0 * row.accuracy()
    );
    Circle::new()
        .set("cx", format!("{:.1}", axes.x(row.p50_ms)))
        .set("cy", format!("{:.1}", axes.y(100.0 * row.accuracy())))
        .set("r", 4)
        .set("fill", colour(setting.precision))
        .add(Title::new(title))
}

fn line(from: (f64, f64), to: (f64, f64)) -> Line {
    Line::new()
        .set("x1", from.0)
        .set("y1", from.1)
        .set("x2", to.0)
        .set("y2", to.1)
        .set("stroke", "#ddd")
}

fn text(content: &str, x: f64, y: f64) -> Text {
    Text::new(content)
        .set("x", format!("{x:.1}"))
        .set("y", format!("{y:.1}"))
        .set("text-anchor", "middle")
}
