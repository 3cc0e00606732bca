//! Dots over two axes, either of which may be logarithmic, as an SVG drawing with its
//! message above it and its legend below. Each dot has a tip that the page shows.

use super::table::digits;
use maud::{Markup, PreEscaped, html};
use std::collections::BTreeMap;
use std::ops::Range;

pub enum Axis<'a> {
    /// Equal steps are equal factors.
    Logarithmic(&'a str),
    /// Values are shares, which are written in percent.
    Percent(&'a str),
}

#[derive(Clone, Debug, PartialEq)]
pub struct Dot {
    pub x: f64,
    pub y: f64,
    pub tip: String,
    pub filled: bool,
}

#[derive(Clone, Debug, Default)]
pub struct Series {
    pub name: String,
    pub dots: Vec<Dot>,
    /// Whether a line joins the filled ones.
    pub joined: bool,
}

impl Series {
    pub fn by_name(dots: BTreeMap<&str, Vec<Dot>>, joined: bool) -> Vec<Self> {
        let series = |(name, dots): (&str, _)| Self { name: name.to_owned(), dots, joined };
        dots.into_iter().map(series).collect()
    }
}

const COLOURS: [&str; 8] =
    ["#1763c7", "#d33b12", "#8a2fc0", "#1d853b", "#a87600", "#007f8c", "#b82f74", "#444444"];

/// The drawing's size, and the plot inside it, in the drawing's units.
const SIZE: [f64; 2] = [640.0, 410.0];
const PLOT_X: Range<f64> = 78.0..622.0;
const PLOT_Y: Range<f64> = 40.0..344.0;

/// From one series of a file's legend to the next.
const LEGEND_LINE: f64 = 20.0;

/// The part of a page's style sheet for charts, for a separate file.
const FILE_STYLE: &str = ".grid line{stroke:#ddd}.hollow{opacity:.35}[data-tip]{display:none}";

const MOST_STEPS: f64 = 6.0;

struct Scale<'a> {
    axis: &'a Axis<'a>,
    /// In values, or in powers of ten if the axis is logarithmic.
    range: Range<f64>,
    /// In the drawing's units.
    drawn: Range<f64>,
}

pub struct Chart<'a> {
    pub message: String,
    /// How to read the dots; may be empty.
    pub caption: &'a str,
    pub x: Axis<'a>,
    pub y: Axis<'a>,
    /// The dots. Those without a place on an axis (such as 0 on a logarithmic one) are
    /// left out.
    pub series: Vec<Series>,
}

impl Chart<'_> {
    pub fn figure(&self) -> Markup {
        html! {
            figure class="chart" {
                h3 { (self.message) }
                svg viewBox={ "0 0 " (SIZE[0]) " " (SIZE[1]) } role="img" aria-label=(self.message) {
                    (self.plot())
                }
                @if self.series.iter().any(|series| !series.name.is_empty()) {
                    ul class="legend" { @for (series, colour) in self.coloured() {
                        li { span style={ "background:" (colour) } {} (series.name) }
                    } }
                }
                @if !self.caption.is_empty() { figcaption { (self.caption) } }
            }
        }
    }

    /// The chart as an SVG file, its legend below the plot.
    pub fn file(&self) -> String {
        let height = SIZE[1] + LEGEND_LINE * self.series.len() as f64;
        let svg = html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (SIZE[0]) " " (height) }
                font-family="sans-serif" font-size="13" {
                title { (self.message) }
                style { (PreEscaped(FILE_STYLE)) }
                rect width="100%" height="100%" fill="white" {}
                (self.plot())
                @for (i, (series, colour)) in self.coloured().enumerate() {
                    circle cx=(PLOT_X.start) cy=(SIZE[1] + LEGEND_LINE * i as f64) r="4.5" fill=(colour) {}
                    text x=(PLOT_X.start + 14.0) y=(SIZE[1] + 4.5 + LEGEND_LINE * i as f64) {
                        (series.name)
                    }
                }
            }
        };
        svg.into_string()
    }

    fn coloured(&self) -> impl Iterator<Item = (&Series, &'static str)> {
        self.series.iter().zip(COLOURS.into_iter().cycle())
    }

    fn plot(&self) -> Markup {
        let dots = || self.series.iter().flat_map(|series| &series.dots);
        let x = Scale::new(&self.x, dots().map(|dot| dot.x), PLOT_X);
        let y = Scale::new(&self.y, dots().map(|dot| dot.y), PLOT_Y.end..PLOT_Y.start);
        html! {
            (grid(&x, &y))
            @for (series, colour) in self.coloured() { (drawn(series, colour, &x, &y)) }
            // Tips lie above everything that is drawn.
            @for dot in dots() { (tip(dot, &x, &y)) }
        }
    }
}

fn grid(x: &Scale<'_>, y: &Scale<'_>) -> Markup {
    html! {
        g class="grid" {
            @for (at, label) in x.ticks() {
                line x1=(at) x2=(at) y1=(PLOT_Y.start) y2=(PLOT_Y.end) {}
                text x=(at) y=(PLOT_Y.end + 22.0) text-anchor="middle" { (label) }
            }
            @for (at, label) in y.ticks() {
                line x1=(PLOT_X.start) x2=(PLOT_X.end) y1=(at) y2=(at) {}
                text x=(PLOT_X.start - 8.0) y=(at) dy="0.35em" text-anchor="end" { (label) }
            }
            text x=((PLOT_X.start + PLOT_X.end) / 2.0) y=(SIZE[1] - 14.0) text-anchor="middle" {
                (x.axis.label())
            }
            text x="4" y="24" { (y.axis.label()) }
        }
    }
}

/// The dots of `series` and the line through the filled ones.
fn drawn(series: &Series, colour: &str, x: &Scale<'_>, y: &Scale<'_>) -> Markup {
    let placed = |filled: bool| {
        let dots = series.dots.iter().filter(move |dot| dot.filled == filled);
        dots.filter_map(|dot| Some((x.place(dot.x)?, y.place(dot.y)?))).collect::<Vec<_>>()
    };
    let (hollow, mut filled) = (placed(false), placed(true));
    filled.sort_by(|a, b| a.0.total_cmp(&b.0));
    let line: Vec<String> = filled.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    html! {
        g fill=(colour) stroke=(colour) {
            @for (x, y) in &hollow { (circle(*x, *y, "2.5", "hollow")) }
            @if series.joined && line.len() > 1 { polyline points=(line.join(" ")) fill="none" {} }
            @for (x, y) in &filled { (circle(*x, *y, "4.5", "filled")) }
        }
    }
}

fn circle(x: f64, y: f64, radius: &str, class: &str) -> Markup {
    html! { circle class=(class) cx={ (format!("{x:.1}")) } cy={ (format!("{y:.1}")) } r=(radius) {} }
}

fn tip(dot: &Dot, x: &Scale<'_>, y: &Scale<'_>) -> Markup {
    let (Some(x), Some(y)) = (x.place(dot.x), y.place(dot.y)) else { return Markup::default() };
    let (x, y) = (format!("{x:.1}"), format!("{y:.1}"));
    html! { circle cx=(x) cy=(y) r="9" fill="transparent" data-tip=(dot.tip) {} }
}

impl Axis<'_> {
    fn label(&self) -> &str {
        let (Self::Logarithmic(label) | Self::Percent(label)) = self;
        label
    }

    /// The number that is drawn in proportion: a power of ten, or the value itself.
    fn unit(&self, value: f64) -> f64 {
        if matches!(self, Self::Logarithmic(_)) { value.log10() } else { value }
    }
}

impl<'a> Scale<'a> {
    fn new(axis: &'a Axis<'a>, values: impl Iterator<Item = f64>, drawn: Range<f64>) -> Self {
        let units = values.map(|value| axis.unit(value)).filter(|unit| unit.is_finite());
        let (low, high) = units
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let range = if low > high {
            0.0..1.0
        } else {
            let room = if high > low { 0.05 * (high - low) } else { 0.5 };
            low - room..high + room
        };
        Self { axis, range, drawn }
    }

    /// Where `value` is drawn; `None` if it has no place on the axis.
    fn place(&self, value: f64) -> Option<f64> {
        let share =
            (self.axis.unit(value) - self.range.start) / (self.range.end - self.range.start);
        let at = self.drawn.start + share * (self.drawn.end - self.drawn.start);
        at.is_finite().then_some(at)
    }

    /// Round values on the axis: where they are drawn, and their labels.
    fn ticks(&self) -> Vec<(f64, String)> {
        let ticks: Vec<(f64, String)> = match self.axis {
            Axis::Logarithmic(_) => {
                logarithmic_ticks(&self.range).into_iter().map(|x| (x, number(x))).collect()
            }
            Axis::Percent(_) => {
                let label = |x: f64| format!("{} %", number(100.0 * x));
                linear_ticks(&self.range).into_iter().map(|x| (x, label(x))).collect()
            }
        };
        ticks.into_iter().filter_map(|(value, label)| Some((self.place(value)?, label))).collect()
    }
}

/// Multiples of 1, 2 or 5 times a power of ten.
fn linear_ticks(range: &Range<f64>) -> Vec<f64> {
    let least = (range.end - range.start) / MOST_STEPS;
    let power = 10f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power);
    let step = step.into_iter().find(|step| *step >= least).unwrap_or(10.0 * power);
    let first = (range.start / step).ceil() as i64;
    let last = (range.end / step).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// Ticks of a range of exponents: 1, 2, 5, 10 over a short one, 1, 3, 10 over a longer one, and
/// powers of ten alone over a long one.
fn logarithmic_ticks(range: &Range<f64>) -> Vec<f64> {
    let decades = range.end - range.start;
    let factors: &[f64] = match decades {
        _ if decades <= 1.5 => &[1.0, 2.0, 5.0],
        _ if decades <= 3.5 => &[1.0, 3.0],
        _ => &[1.0],
    };
    let each = (decades / MOST_STEPS).ceil().max(1.0) as i32;
    let exponents = range.start.floor() as i32..=range.end.ceil() as i32;
    let values = exponents
        .filter(|exponent| exponent.rem_euclid(each) == 0)
        .flat_map(|exponent| factors.iter().map(move |factor| factor * 10f64.powi(exponent)));
    values.filter(|value| range.contains(&value.log10())).collect()
}

/// `value` as a tick's label; powers of ten far from 1 are written as such.
fn number(value: f64) -> String {
    // Room for the rounding of a logarithm that should be whole.
    let exponent = value.abs().log10() + 1e-9;
    if value == 0.0 || (-3.5..5.5).contains(&exponent) {
        let is_large = value.abs() >= 10.0;
        return if is_large { format!("{value:.1}").replace(".0", "") } else { digits(value) };
    }
    let superscript = |c: char| match c.to_digit(10) {
        Some(digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize).unwrap_or(c),
        None => '⁻',
    };
    let power: String = format!("{:.0}", exponent.floor()).chars().map(superscript).collect();
    match (value / 10f64.powf(exponent.floor())).round() {
        1.0 => format!("10{power}"),
        factor => format!("{factor}·10{power}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(dots: Vec<Dot>) -> String {
        let series = vec![Series { name: "s".to_owned(), dots, joined: true }];
        let (x, y) = (Axis::Logarithmic("x"), Axis::Percent("y"));
        let message = "message".to_owned();
        Chart { message, caption: "", x, y, series }.figure().into_string()
    }

    fn dot(x: f64, y: f64, tip: &str) -> Dot {
        Dot { x, y, tip: tip.to_owned(), filled: true }
    }

    #[test]
    fn each_dot_has_its_tip() {
        let figure = drawn(vec![dot(1.0, 2.0, "a < b"), dot(10.0, 3.0, "c")]);
        assert_eq!(figure.matches("data-tip").count(), 2);
        assert!(figure.contains(r#"data-tip="a &lt; b""#), "{figure}");
        assert!(figure.contains("<h3>message</h3>") && figure.contains("polyline"), "{figure}");
    }

    #[test]
    fn ticks_are_numbers_that_a_person_would_choose() {
        let labels = |axis: Axis<'_>, range: Range<f64>| {
            let ticks = Scale { axis: &axis, range, drawn: PLOT_X }.ticks();
            ticks.into_iter().map(|(_, label)| label).collect::<Vec<_>>().join(" ")
        };
        let powers = |range| labels(Axis::Logarithmic(""), range);
        assert_eq!(powers(0.2f64.log10()..15f64.log10()), "0.3 1 3 10");
        assert_eq!(powers(0.9f64.log10()..25f64.log10()), "1 2 5 10 20");
        assert_eq!(powers(-12.5..3.0), "10⁻¹² 10⁻⁹ 10⁻⁶ 0.001 1");
        let shares = |range| labels(Axis::Percent(""), range);
        assert_eq!(shares(0.0..1.0), "0 % 20 % 40 % 60 % 80 % 100 %");
        assert_eq!(shares(-0.3..11.0), "0 % 200 % 400 % 600 % 800 % 1000 %");
    }
}
