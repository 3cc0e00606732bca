//! One view of one scan.

use anyhow::{Result, anyhow};
use formats::Scan;
use plotters::prelude::*;
use sim_gpu::glam::DVec3;

use super::canvas::{Area, metres, text};
use super::frame::{Frame, View};
use crate::view::frame::Mesh;

/// Edge of the square that shows the frame, in pixels.
const SQUARE: u32 = 380;
const AXIS_X: u32 = 46;
const AXIS_Y: u32 = 66;
const CAPTION: u32 = 26;
const MARGIN: u32 = 12;

/// Pixels a panel takes, from the one before it to the one after.
pub const WIDTH: u32 = AXIS_Y + SQUARE + 2 * MARGIN;
/// Pixels a panel takes from top to bottom.
pub const HEIGHT: u32 = CAPTION + SQUARE + AXIS_X + 2 * MARGIN;

const AXIS_NAMES: [&str; 3] = ["x (m)", "y (m)", "z (m)"];
const GRID: RGBColor = RGBColor(232, 232, 232);

/// The box around an object, as a view shows it.
pub struct Outline<'a> {
    /// Its corners (right, up) in order, metres.
    pub corners: [[f64; 2]; 4],
    /// The object's class.
    pub class: &'a str,
    /// The confidence in the class, 0 to 1, if the box has one.
    pub score: Option<f64>,
    /// The colour of the class.
    pub tint: RGBColor,
}

/// Draws what `view` shows: `meshes`; over them the points of `scan`, nearer ones over farther
/// ones, each in its tint; and `outlines` with a legend of their classes.
pub fn draw(
    area: &Area<'_>,
    view: View,
    (scan, tints): (&Scan, &[RGBColor]),
    frame: &Frame,
    meshes: &[(&Mesh, RGBColor)],
    outlines: &[Outline<'_>],
) -> Result<()> {
    let (caption, below) = area.split_vertically(CAPTION);
    let (width, _) = area.dim_in_pixel();
    let middle = ((width + AXIS_Y) / 2) as i32 - 4 * view.name.len() as i32;
    caption.draw_text(view.name, &text(16), (middle, 10))?;
    let mut chart = ChartBuilder::on(&below)
        .margin(MARGIN)
        .x_label_area_size(AXIS_X)
        .y_label_area_size(AXIS_Y)
        .build_cartesian_2d(frame.extent(view.right), frame.extent(view.up))?;
    // About five ticks: none is nearer to the next than this.
    let label = |value: &f64| metres(*value, frame.half / 5.0);
    chart
        .configure_mesh()
        .x_labels(5)
        .y_labels(5)
        .max_light_lines(0)
        .bold_line_style(GRID)
        .axis_style(RGBColor(90, 90, 90))
        .label_style(text(14))
        .axis_desc_style(text(15))
        .x_label_formatter(&label)
        .y_label_formatter(&label)
        .x_desc(AXIS_NAMES[view.right])
        .y_desc(AXIS_NAMES[view.up])
        .draw()?;

    let faces = faces(meshes, view);
    let faces = faces.iter().map(|Face { corners, tint, .. }| Polygon::new(*corners, *tint));
    chart.draw_series(faces).map_err(|error| anyhow!("drawing the meshes: {error}"))?;
    let radius = if scan.len() < 20_000 { 2 } else { 1 };
    let points = from_far_to_near(scan, view, frame).into_iter().map(|i| {
        let point = scan.positions[i];
        let place = (f64::from(point[view.right]), f64::from(point[view.up]));
        Circle::new(place, radius, tints[i].filled())
    });
    chart.draw_series(points).map_err(|error| anyhow!("drawing the points: {error}"))?;
    // The points beyond the frame are not drawn either.
    let is_shown = |outline: &&Outline<'_>| {
        let middle = |axis: usize| outline.corners.iter().map(|at| at[axis]).sum::<f64>() / 4.0;
        frame.extent(view.right).contains(&middle(0)) && frame.extent(view.up).contains(&middle(1))
    };
    let outlines: Vec<_> = outlines.iter().filter(is_shown).collect();
    let (mut labels, right_edge) = (Vec::<[i32; 4]>::new(), below.get_pixel_range().0.end);
    for (i, Outline { corners, class, score, tint }) in outlines.iter().enumerate() {
        let corners = corners.map(|[x, y]| (x, y));
        let line = tint.stroke_width(2);
        let closed = corners.into_iter().chain([corners[0]]);
        let series = chart.draw_series([PathElement::new(closed.collect::<Vec<_>>(), line)])?;
        if outlines[..i].iter().all(|other| other.class != *class) {
            let swatch = move |(x, y)| Rectangle::new([(x, y - 6), (x + 16, y + 6)], line.filled());
            series.label(*class).legend(swatch);
        }
        // From the sides, too many boxes stand behind each other.
        if view.depth.0 != 2 {
            continue;
        }
        let [right, top] = corners
            .iter()
            .fold([f64::NEG_INFINITY; 2], |most, at| [most[0].max(at.0), most[1].max(at.1)]);
        let score = score.map_or(String::new(), |score| format!(" {score:.2}"));
        let (name, style) = (format!("{class}{score}"), text(15).color(tint));
        let (width, height) = below.estimate_text_size(&name, &style)?;
        let (width, height) = (width as i32, height as i32);
        let (x, y) = chart.backend_coord(&(right, top));
        let (left, mut low) = ((x + 4).min(right_edge - width - 4) - x, 2);
        let end = left + width + 4;
        let covers = |low: i32, [x0, x1, y0, y1]: &[i32; 4]| {
            x + left < *x1 && *x0 < x + end && y + low - height - 4 < *y1 && *y0 < y + low
        };
        // Neighbouring labels stand above each other.
        while labels.iter().any(|label| covers(low, label)) {
            low -= height + 4;
        }
        labels.push([x + left, x + end, y + low - height - 4, y + low]);
        let behind = [(left, low - height - 4), (end, low)];
        chart.draw_series([EmptyElement::at((right, top))
            + Rectangle::new(behind, WHITE.mix(0.6).filled())
            + Text::new(name, (left + 2, low - height - 2), style)])?;
    }
    if !outlines.is_empty() {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .label_font(text(15))
            .background_style(WHITE.mix(0.85))
            .border_style(GRID)
            .draw()?;
    }
    Ok(())
}

/// A triangle, as a view shows it.
struct Face {
    nearness: f64,
    corners: [(f64, f64); 3],
    tint: RGBColor,
}

/// The triangles of `meshes` from far to near: the more a face is turned away, the darker it is.
fn faces(meshes: &[(&Mesh, RGBColor)], view: View) -> Vec<Face> {
    const DARKEST: f64 = 0.4;
    let (depth, side) = view.depth;
    let face = |mesh: &Mesh, tint: RGBColor, index: &[u32; 3]| {
        let at = index.map(|i| DVec3::from(mesh.position[i as usize].map(f64::from)));
        let normal = (at[1] - at[0]).cross(at[2] - at[0]).normalize_or_zero();
        let light = DARKEST + (1.0 - DARKEST) * normal[depth].abs();
        let [red, green, blue] = [tint.0, tint.1, tint.2].map(|x| (f64::from(x) * light) as u8);
        let nearness = at.iter().map(|at| at[depth]).sum::<f64>() * f64::from(side);
        let corners = at.map(|at| (at[view.right], at[view.up]));
        Face { nearness, corners, tint: RGBColor(red, green, blue) }
    };
    let mut faces: Vec<_> = meshes
        .iter()
        .flat_map(|(mesh, tint)| mesh.index.iter().map(move |index| face(mesh, *tint, index)))
        .collect();
    faces.sort_by(|a, b| a.nearness.total_cmp(&b.nearness));
    faces
}

fn from_far_to_near(scan: &Scan, view: View, frame: &Frame) -> Vec<usize> {
    let (axis, side) = view.depth;
    let nearness = |i: &usize| scan.positions[*i][axis] * side;
    let mut order: Vec<_> = (0..scan.len()).filter(|&i| frame.holds(scan.positions[i])).collect();
    order.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
    order
}
