//! Dots over two axes, either of which may be logarithmic. Each dot says what
//! it is where the pointer is upon it.

use crate::render::text_table::digits;
use anyhow::{Result, anyhow};
use maud::html;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::register_font;

/// An axis.
pub struct Axis<'a> {
    /// What it shows, with its unit.
    pub label: &'a str,
    /// Whether equal steps are equal factors.
    pub logarithmic: bool,
    /// Whether values are shares, to be written in percent.
    pub percent: bool,
}

/// One measured thing.
#[derive(Clone, Debug, PartialEq)]
pub struct Dot {
    /// Across.
    pub x: f64,
    /// Up.
    pub y: f64,
    /// What it is.
    pub tip: String,
    /// Whether it is filled.
    pub filled: bool,
}

/// Dots of one colour.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// What they are.
    pub name: String,
    /// The dots.
    pub dots: Vec<Dot>,
    /// Whether a line joins the filled ones.
    pub joined: bool,
}

const FONT: &str = "sans-serif";
const SIZE: (u32, u32) = (720, 420);
const COLOURS: [RGBColor; 8] = [
    RGBColor(0x17, 0x63, 0xc7),
    RGBColor(0xd3, 0x3b, 0x12),
    RGBColor(0x8a, 0x2f, 0xc0),
    RGBColor(0x1d, 0x85, 0x3b),
    RGBColor(0xa8, 0x76, 0x00),
    RGBColor(0x00, 0x7f, 0x8c),
    RGBColor(0xb8, 0x2f, 0x74),
    RGBColor(0x44, 0x44, 0x44),
];

impl Axis<'_> {
    /// Where `value` lies on it; `None` for what has no place there.
    fn place(&self, value: f64) -> Option<f64> {
        let place = if self.logarithmic { value.log10() } else { value };
        place.is_finite().then_some(place)
    }

    fn words(&self, place: f64) -> String {
        let value = if self.logarithmic { 10f64.powf(place) } else { place };
        if self.percent { format!("{:.0} %", 100.0 * value) } else { digits(value) }
    }

    /// From a little before the least to a little beyond the greatest.
    fn range(&self, values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
        let places = values.filter_map(|value| self.place(value));
        let (low, high) = places
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        if low > high {
            return 0.0..1.0;
        }
        let room = if high > low { 0.05 * (high - low) } else { 0.5 };
        low - room..high + room
    }
}

/// The drawing as SVG; dots that have no place on an axis are left out.
///
/// # Errors
/// What the plotting library reports.
pub fn draw(title: &str, x: &Axis<'_>, y: &Axis<'_>, series: &[Series]) -> Result<String> {
    // Sizes of words are measured by this font; the browser takes its own.
    register_font(FONT, FontStyle::Normal, epaint_default_fonts::HACK_REGULAR)
        .map_err(|_| anyhow!("the bundled font cannot be read"))?;
    let dots = || series.iter().flat_map(|series| &series.dots);
    let (across, up) = (x.range(dots().map(|dot| dot.x)), y.range(dots().map(|dot| dot.y)));
    let mut svg = String::new();
    let mut tips = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(title, (FONT, 16))
            .margin(12)
            .x_label_area_size(38)
            .y_label_area_size(60)
            .build_cartesian_2d(across, up)?;
        let (x_words, y_words) = (|at: &f64| x.words(*at), |at: &f64| y.words(*at));
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(x.label).y_desc(y.label).light_line_style(WHITE);
        mesh.x_label_formatter(&x_words).y_label_formatter(&y_words).draw()?;
        for (series, &colour) in series.iter().zip(COLOURS.iter().cycle()) {
            tips += &one(&mut chart, series, colour, (x, y))?;
        }
        let mut legend = chart.configure_series_labels();
        legend.position(SeriesLabelPosition::LowerRight).background_style(WHITE.mix(0.8)).draw()?;
        area.present()?;
    }
    // What the pointer finds lies above everything that is drawn.
    Ok(svg.replace("</svg>", &format!("{tips}</svg>")))
}

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Draws one series; returns what the pointer finds of it.
fn one(
    chart: &mut Chart<'_, '_>,
    series: &Series,
    colour: RGBColor,
    (x, y): (&Axis<'_>, &Axis<'_>),
) -> Result<String> {
    let mut placed: Vec<(f64, f64, &Dot)> = series
        .dots
        .iter()
        .filter_map(|dot| Some((x.place(dot.x)?, y.place(dot.y)?, dot)))
        .collect();
    placed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let hollow = placed.iter().filter(|(.., dot)| !dot.filled);
    chart.draw_series(hollow.map(|&(x, y, _)| Circle::new((x, y), 2, colour.mix(0.4))))?;
    let filled = placed.iter().filter(|(.., dot)| dot.filled);
    chart
        .draw_series(filled.clone().map(|&(x, y, _)| Circle::new((x, y), 4, colour.filled())))?
        .label(&series.name)
        .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
    if series.joined {
        chart.draw_series(LineSeries::new(filled.map(|&(x, y, _)| (x, y)), colour.mix(0.7)))?;
    }
    let tip = |&(x, y, dot): &(f64, f64, &Dot)| {
        let (left, top) = chart.backend_coord(&(x, y));
        let tip = &dot.tip;
        html! { circle cx=(left) cy=(top) r="7" fill="transparent" data-tip=(tip) {} }.into_string()
    };
    Ok(placed.iter().map(tip).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(label: &str, logarithmic: bool) -> Axis<'_> {
        Axis { label, logarithmic, percent: false }
    }

    fn dot(x: f64, y: f64, tip: &str) -> Dot {
        Dot { x, y, tip: tip.to_owned(), filled: true }
    }

    #[test]
    fn each_dot_says_what_it_is() {
        let dots = vec![dot(1.0, 2.0, "a < b"), dot(10.0, 3.0, "c")];
        let series = Series { name: "s".to_owned(), dots, joined: true };
        let svg = draw("t", &axis("x", true), &axis("y", false), &[series]).unwrap();
        assert_eq!(svg.matches("data-tip").count(), 2);
        assert!(svg.contains(r#"data-tip="a &lt; b""#) && svg.ends_with("</svg>\n"), "{svg}");
    }

    #[test]
    fn what_has_no_place_is_left_out() {
        let dots = vec![
            dot(0.0, 1.0, "no logarithm"),
            dot(f64::NAN, 1.0, "nowhere"),
            dot(1.0, 1.0, "here"),
        ];
        let series = Series { dots, ..Series::default() };
        let svg = draw("t", &axis("x", true), &axis("y", false), &[series]).unwrap();
        assert_eq!(svg.matches("data-tip").count(), 1);
        draw("nothing at all", &axis("x", true), &axis("y", true), &[]).unwrap();
    }
}
