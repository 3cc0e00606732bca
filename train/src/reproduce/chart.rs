//! Lines over a logarithmic axis of counts.

use anyhow::anyhow;
use plotters::prelude::*;
use plotters::style::register_font;

use super::section::Table;

/// A line of a chart.
pub struct Line {
    name: String,
    points: Vec<(f64, f64)>,
}

const FONT: &str = "sans-serif";
const COLOURS: [RGBColor; 4] =
    [RGBColor(0x17, 0x63, 0xc7), RGBColor(0xd3, 0x3b, 0x12), RGBColor(0x8a, 0x2f, 0xc0), BLACK];

impl Line {
    /// The numbers of column `column` of `table`, whose rows are counts.
    pub fn of(name: &str, table: &Table, column: usize) -> Self {
        let point = |(row, cells): &(String, Vec<super::section::Cell>)| {
            Some((row.parse().ok()?, cells[column].numbers().0?))
        };
        Self { name: name.to_owned(), points: table.rows.iter().filter_map(point).collect() }
    }
}

/// Shares by a count, as SVG.
///
/// # Errors
/// What the plotting library reports.
pub fn lines(title: &str, axis: &str, lines: &[Line]) -> anyhow::Result<String> {
    // Sizes of words are measured by this font; the browser takes its own.
    register_font(FONT, FontStyle::Normal, epaint_default_fonts::HACK_REGULAR)
        .map_err(|_| anyhow!("the bundled font cannot be read"))?;
    let points = || lines.iter().flat_map(|line| &line.points);
    let least = points().map(|point| point.0).fold(f64::INFINITY, f64::min).min(1e9);
    let most = points().map(|point| point.0).fold(1.0, f64::max);
    let lowest = points().map(|point| point.1).fold(1.0, f64::min);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (720, 400)).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(title, (FONT, 16))
            .margin(12)
            .x_label_area_size(38)
            .y_label_area_size(52)
            .build_cartesian_2d(
                (least * 0.9..most * 1.1).log_scale().base(2.0),
                (lowest - 0.05).max(0.0)..1.0,
            )?;
        let percent = |share: &f64| format!("{:.0} %", 100.0 * share);
        let mesh = chart.configure_mesh().x_desc(axis).y_label_formatter(&percent).draw();
        mesh?;
        for (line, colour) in lines.iter().zip(COLOURS.iter().cycle()) {
            let drawn = chart.draw_series(LineSeries::new(line.points.clone(), colour))?;
            drawn
                .label(&line.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
            let dots = line.points.iter().map(|&at| Circle::new(at, 3, colour.filled()));
            chart.draw_series(dots)?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE)
            .draw()?;
        area.present()?;
    }
    Ok(svg)
}
