//! The trade as a picture: accuracy over latency, the front as a line.

use std::path::Path;

use anyhow::anyhow;
use formats::atomic;
use infer_cpu::Precision;
use plotters::prelude::*;

use super::trade::Row;

const SIZE: (u32, u32) = (900, 600);

/// Draws `rows` into the SVG file at `path`.
///
/// # Errors
/// A file that cannot be written.
pub fn write(path: &Path, rows: &[Row]) -> anyhow::Result<()> {
    let mut svg = String::new();
    draw(&mut svg, rows).map_err(|error| anyhow!("{}: {error}", path.display()))?;
    atomic::write(path, |out| std::io::Write::write_all(out, svg.as_bytes()))?;
    Ok(())
}

fn colour(precision: Precision) -> RGBColor {
    match precision {
        Precision::F32 => RGBColor(31, 119, 180),
        Precision::F32Fc16 => RGBColor(23, 160, 150),
        Precision::F16 => RGBColor(44, 140, 44),
        Precision::I8 => RGBColor(214, 60, 40),
    }
}

fn draw(svg: &mut String, rows: &[Row]) -> Result<(), Box<dyn std::error::Error>> {
    let times = rows.iter().map(|row| row.p50_ms);
    let fastest = times.clone().fold(f64::INFINITY, f64::min) * 0.8;
    let slowest = times.fold(0.0, f64::max) * 1.25;
    let least = rows.iter().map(Row::accuracy).fold(1.0, f64::min) * 100.0;
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption("Accuracy over latency", ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(50)
        .build_cartesian_2d((fastest..slowest).log_scale(), (least - 2.0).max(0.0)..100.0)?;
    chart
        .configure_mesh()
        .x_desc("median latency, ms")
        .y_desc("accuracy, %")
        .light_line_style(WHITE)
        .draw()?;
    for precision in Precision::ALL {
        let colour = colour(precision);
        let of = rows.iter().filter(|row| row.setting.precision == precision);
        chart
            .draw_series(of.map(|row| {
                Circle::new((row.p50_ms, 100.0 * row.accuracy()), 4, colour.filled())
            }))?
            .label(precision.name())
            .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
    }
    let mut front: Vec<&Row> = rows.iter().filter(|row| row.on_front).collect();
    front.sort_by(|a, b| a.p50_ms.total_cmp(&b.p50_ms));
    let line = front.iter().map(|row| (row.p50_ms, 100.0 * row.accuracy()));
    chart.draw_series(LineSeries::new(line, BLACK.mix(0.5)))?;
    chart.draw_series(front.iter().map(|row| {
        let name = format!("{} {}", row.setting.sampler, row.setting.points);
        Text::new(name, (row.p50_ms, 100.0 * row.accuracy() + 1.0), ("sans-serif", 11))
    }))?;
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .border_style(BLACK.mix(0.3))
        .background_style(WHITE)
        .draw()?;
    area.present()?;
    Ok(())
}
