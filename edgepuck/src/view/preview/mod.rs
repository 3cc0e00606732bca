//! A picture of points, meshes and boxes.

mod canvas;
mod space;

use anyhow::Result;
use formats::Scan;
use sim_gpu::glam::DVec3;
use std::path::Path;

use crate::colours::{self, Rgb};
use crate::view::files::class_labels;
use crate::view::frame::{Frame, Labels, Mesh, Placed};
use canvas::Canvas;
use space::{Region, View, points, sensor_of_sweep};

const BLACK: Rgb = [0; 3];
const GREY: Rgb = [215; 3];

/// Draws what is `shown` to the PNG file `out`, atomically. Points are coloured by their labels, as in `view`;
/// or by range, if it is known, and else by height.
pub fn draw(shown: &Frame, out: &Path) -> Result<()> {
    let nothing = Scan::default();
    let scan = shown.points.as_ref().map_or(&nothing, |points| &points.scan);
    let labels = shown.points.as_ref().and_then(|points| points.labels.first());
    let tints = match labels {
        Some(labels) => labels.values.iter().map(|value| tint(labels, *value)).collect(),
        None => tints_by_value(scan),
    };
    picture(scan, &tints, &shown.meshes, &shown.boxes, out)
}

/// Draws points, each in its tint, meshes and boxes to the PNG file `out`, atomically.
pub fn picture(
    scan: &Scan,
    tints: &[Rgb],
    meshes: &[Mesh],
    boxes: &[Placed],
    out: &Path,
) -> Result<()> {
    let sweep = sensor_of_sweep(scan);
    let whole = sweep.map_or(Region::ALL, |at| Region::near_sensor(at, scan, boxes));
    let boxes: Vec<_> =
        boxes.iter().filter(|placed| whole.holds(placed.place.centre_m.into())).collect();
    let seen = Region::around(points(scan), whole);
    let vertices = meshes.iter().flat_map(|mesh| &mesh.position);
    let vertices = vertices.map(|at| DVec3::from(at.map(f64::from)));
    // Of a much larger mesh around the points, such as a road, only a part was scanned.
    let of_meshes = Region::around(vertices.clone(), Region::ALL);
    let near = match (seen, of_meshes) {
        (Some(seen), Some(all)) if all.span() > 4.0 * seen.span() => seen.grown(),
        _ => Region::ALL,
    };
    let vertices = vertices.filter(|at| near.holds(*at));
    let corners = boxes.iter().flat_map(|placed| placed.place.corners()).filter(|_| seen.is_none());
    let points = points(scan).filter(|at| seen.is_some_and(|seen| seen.holds(*at)));
    let places: Vec<_> = vertices.chain(corners).chain(points).collect();
    let view = View::of(&places, scan, sweep.is_some());
    let mut canvas = Canvas::new(view.size);
    draw_meshes(&mut canvas, &view, meshes, scan.is_empty());
    draw_points(&mut canvas, &view, scan, tints, whole);
    boxes.iter().for_each(|placed| draw_box(&mut canvas, &view, placed));
    canvas.save(out)
}

/// The colour of one of the numbers of `labels`.
fn tint(labels: &Labels, value: u32) -> Rgb {
    match labels.names.as_ref().and_then(|names| names.get(value as usize)) {
        Some(name) => colours::of_class(name),
        None => colours::of_number(value),
    }
}

/// The colours of the points from the least range or height to the greatest.
fn tints_by_value(scan: &Scan) -> Vec<Rgb> {
    let values: Vec<f64> = match &scan.range_m {
        Some(range_m) => range_m.iter().map(|range| f64::from(*range)).collect(),
        None => scan.positions.iter().map(|point| f64::from(point[2])).collect(),
    };
    let finite = values.iter().filter(|value| value.is_finite());
    let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(*value), high.max(*value)]
    });
    // Equal values get the middle of the ramp.
    let share = |value: &f64| if high > low { (value - low) / (high - low) } else { 0.5 };
    values.iter().map(|value| colours::on_ramp(share(value))).collect()
}

/// Draws each mesh in the colour of its class, or in grey under points.
fn draw_meshes(canvas: &mut Canvas, view: &View, meshes: &[Mesh], in_colour: bool) {
    let classes =
        class_labels(meshes.iter().map(|mesh| mesh.class.as_deref().unwrap_or(&mesh.name)));
    for (mesh, value) in meshes.iter().zip(&classes.values) {
        let tint = if in_colour { tint(&classes, *value) } else { GREY };
        for index in &mesh.index {
            let at = index.map(|i| DVec3::from(mesh.position[i as usize].map(f64::from)));
            let normal = (at[1] - at[0]).cross(at[2] - at[0]).normalize_or_zero();
            let brightness = view.brightness(normal);
            let tint = tint.map(|channel| (f64::from(channel) * brightness) as u8);
            canvas.triangle(at.map(|at| view.pixel(at)), tint);
        }
    }
}

fn draw_points(canvas: &mut Canvas, view: &View, scan: &Scan, tints: &[Rgb], whole: Region) {
    let radius = match scan.len() {
        ..2_000 => 3.2,
        2_000..20_000 => 2.0,
        _ => 1.3,
    };
    for (at, tint) in points(scan).zip(tints).filter(|(at, _)| whole.holds(*at)) {
        let mut at = view.pixel(at);
        // Above the surface on which it lies, also where that is steep.
        at.z += 3.0 * radius / view.pixels_per_m;
        canvas.disc(at, radius, *tint);
    }
}

fn draw_box(canvas: &mut Canvas, view: &View, placed: &Placed) {
    let class = placed.class.as_deref().unwrap_or("box");
    let tint = if placed.truth { BLACK } else { colours::of_class(class) };
    let at = placed.place.corners().map(|corner| view.pixel(corner));
    for i in 0..4 {
        let next = (i + 1) % 4;
        for [from, to] in [[i, next], [i + 4, next + 4], [i, i + 4]] {
            canvas.line(at[from], at[to], tint);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_without_ranges_have_the_colours_of_their_heights() {
        let positions = vec![[0.0; 3], [0.0, 9.0, 0.0], [9.0, 0.0, 0.0], [0.0, 0.0, 9.0]];
        let tints = tints_by_value(&Scan { positions, ..Scan::default() });
        assert!(tints[0] == tints[1] && tints[0] == tints[2] && tints[0] != tints[3]);
    }
}
