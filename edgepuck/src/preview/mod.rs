//! A picture of points, meshes and boxes: a sweep from above; anything else from the side, the top
//! and the front, clean above noisy, as in the paper's figure.

mod canvas;
mod colours;
mod frame;
mod from_above;
pub mod panel;

use std::path::Path;

use anyhow::Result;
use formats::Scan;
use plotters::style::{BLACK, RGBColor};

use crate::colours::of_class;
use crate::view::files::class_labels;
use crate::view::frame::{self as shown, Placed};
use canvas::{draw_png, text};
use colours::Colours;
use frame::{Frame, View};
use from_above::EDGE;
pub use from_above::draw_from_above;
use panel::Outline;

const TITLE_HEIGHT: u32 = 52;
const ROW_HEADING_HEIGHT: u32 = 30;
const BAR_WIDTH: u32 = 160;

/// Draws what is `shown`, and `noisy` points below it, to the PNG file `out`, atomically.
///
/// All panels share one scale, in metres: the frame is the bounding box of the
/// clean points, with a margin; without points, that of the meshes, or else of the boxes. Points are
/// coloured by their labels, as the legend says; or by range where both scans know it, and by height
/// otherwise, as the colour bar says. Points outside the frame are counted in their row's heading;
/// those that are not finite count with them. Axes start at the scans' origin where that is not 0.
/// Meshes are drawn where there are no points.
pub fn draw(shown: &shown::Frame, noisy: Option<&Scan>, title: &str, out: &Path) -> Result<()> {
    let nothing = Scan::default();
    let clean = shown.points.as_ref().map_or(&nothing, |points| &points.scan);
    let meshes = if clean.is_empty() { &shown.meshes[..] } else { &[] };
    let of_meshes =
        class_labels(meshes.iter().map(|mesh| mesh.class.as_deref().unwrap_or(&mesh.name)));
    let meshes = meshes.iter().zip(&of_meshes.values);
    let meshes: Vec<_> =
        meshes.map(|(mesh, value)| (mesh, colours::tint(&of_meshes, *value))).collect();
    let of_points = shown.points.as_ref().and_then(|points| points.labels.first());
    let of_points = of_points.filter(|_| noisy.is_none());
    let labels = of_points.or((!meshes.is_empty()).then_some(&of_meshes));
    let rows: Vec<_> =
        [(if noisy.is_some() { "clean" } else { "" }, Some(clean)), ("noisy", noisy)]
            .into_iter()
            .filter_map(|(name, scan)| Some((name, scan?)))
            .collect();
    for (_, scan) in &rows {
        scan.check_lengths()?;
    }
    let scans: Vec<_> = rows.iter().map(|&(_, scan)| scan).collect();
    let is_sweep = noisy.is_none() && Frame::is_sweep(clean);
    let has_boxes_alone =
        noisy.is_none() && clean.is_empty() && meshes.is_empty() && !shown.boxes.is_empty();
    let frame = match is_sweep {
        true => Frame::near_sensor(clean),
        false => frame_around(&scans, shown),
    };
    let (views, panel_width, panel_height) = match is_sweep || has_boxes_alone {
        true => (&View::ALL[1..2], EDGE, EDGE),
        false => (&View::ALL[..], panel::WIDTH, panel::HEIGHT),
    };
    let colours = Colours::of(&scans, &frame);

    let width = panel_width * views.len() as u32 + BAR_WIDTH;
    let row_height = ROW_HEADING_HEIGHT + panel_height;
    let height = TITLE_HEIGHT + row_height * rows.len() as u32;
    draw_png(out, (width, height), (title, TITLE_HEIGHT), |below| {
        let (panels, bar) = below.split_horizontally(width - BAR_WIDTH);
        match labels {
            Some(labels) => colours::draw_legend(&bar, labels)?,
            None if has_boxes_alone => {}
            None => colours.draw_bar(&bar)?,
        }
        for (row, &(name, scan)) in panels.split_evenly((rows.len(), 1)).iter().zip(&rows) {
            let (heading, panels) = row.split_vertically(ROW_HEADING_HEIGHT);
            if shown.points.is_some() {
                heading.draw_text(&row_heading(name, scan, &frame), &text(17), (16, 6))?;
            }
            let tints: Vec<RGBColor> = match of_points {
                Some(labels) => {
                    labels.values.iter().map(|value| colours::tint(labels, *value)).collect()
                }
                None => colours.tints(scan),
            };
            for (area, view) in panels.split_evenly((1, views.len())).iter().zip(views) {
                let outlines: Vec<_> =
                    shown.boxes.iter().map(|placed| outline(placed, *view)).collect();
                panel::draw(area, *view, (scan, &tints), &frame, &meshes, &outlines)?;
            }
        }
        Ok(())
    })
}

/// The frame of the points, or else of the meshes, or else of the boxes.
fn frame_around(scans: &[&Scan], shown: &shown::Frame) -> Frame {
    let of_meshes: Vec<_> = shown.meshes.iter().flat_map(|mesh| &mesh.position).copied().collect();
    let of_boxes = shown.boxes.iter().flat_map(Placed::corners);
    let of_boxes: Vec<_> = of_boxes.map(|corner| corner.as_vec3().to_array()).collect();
    let points = scans.iter().map(|scan| &*scan.positions);
    Frame::around(&points.chain([&*of_meshes, &*of_boxes]).collect::<Vec<_>>())
}

/// The box as `view` shows it: turned from above, and upright from the sides.
fn outline(placed: &Placed, view: View) -> Outline<'_> {
    let corners = placed.corners().map(|corner| [corner[view.right], corner[view.up]]);
    let most = |axis: usize, of: fn(f64, f64) -> f64| {
        corners.iter().map(|corner| corner[axis]).reduce(of).unwrap_or_default()
    };
    let ([left, low], [right, high]) =
        ([0, 1].map(|axis| most(axis, f64::min)), [0, 1].map(|axis| most(axis, f64::max)));
    let class = placed.class.as_deref().unwrap_or("box");
    Outline {
        corners: match view.depth {
            (2, _) => [corners[0], corners[1], corners[2], corners[3]],
            _ => [[left, low], [right, low], [right, high], [left, high]],
        },
        class: if placed.truth { "truth" } else { class },
        score: placed.score,
        tint: if placed.truth { BLACK } else { of_class(class) },
    }
}

fn row_heading(name: &str, scan: &Scan, frame: &Frame) -> String {
    let outside = scan.positions.iter().filter(|point| !frame.holds(**point)).count();
    let mut heading = match scan.len() {
        1 => "1 point".to_owned(),
        n => format!("{n} points"),
    };
    if !name.is_empty() {
        heading = format!("{name}: {heading}");
    }
    if outside > 0 {
        heading += &format!(", {outside} of them outside the frame");
    }
    if scan.origin != [0.0; 3] {
        let [x, y, z] = scan.origin;
        heading += &format!(", from origin ({x}, {y}, {z}) m");
    }
    heading
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn sphere(n: usize, range: bool) -> Scan {
        let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
        let positions: Vec<_> = (0..n)
            .map(|i| {
                let z = 1.0 - 2.0 * (i as f32 + 0.5) / n as f32;
                let (sin, cos) = (golden * i as f32).sin_cos();
                let r = (1.0 - z * z).sqrt();
                [r * cos, r * sin, z]
            })
            .collect();
        let range_m = range.then(|| positions.iter().map(|p| 3.0 - p[0]).collect());
        Scan { positions, range_m, ..Scan::default() }
    }

    /// Width and height of a PNG stand after its signature and chunk header.
    fn size(png: &[u8]) -> [u32; 2] {
        [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()))
    }

    #[test]
    fn any_scan_has_a_picture() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("new/scan.png");
        let far = Scan { origin: [1e7, 0.0, 0.0], ..sphere(9, true) };
        let wild = Scan {
            positions: vec![[f32::NAN, 0.0, 0.0], [f32::MAX; 3], [-f32::MAX; 3], [0.0; 3]],
            range_m: Some(vec![f32::NAN, f32::INFINITY, -1.0, 0.0]),
            ..Scan::default()
        };
        for n in [0, 1, 2, 500] {
            for scan in [sphere(n, true), sphere(n, false), far.clone(), wild.clone()] {
                let shown = shown::Frame::of_scan(String::new(), scan, Vec::new());
                draw(&shown, Some(&sphere(n, true)), "a sphere", &out).unwrap();
                let two_rows = size(&fs::read(&out).unwrap());
                draw(&shown, None, "", &out).unwrap();
                let one_row = size(&fs::read(&out).unwrap());
                assert_eq!(one_row[0], two_rows[0]);
                assert_eq!(two_rows[1] - one_row[1], panel::HEIGHT + ROW_HEADING_HEIGHT);
            }
        }
    }

    #[test]
    fn the_same_scan_gives_the_same_picture() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second] = ["first.png", "second.png"].map(|name| {
            let out = folder.path().join(name);
            let shown = shown::Frame::of_scan(String::new(), sphere(2000, true), Vec::new());
            draw(&shown, None, "a sphere", &out).unwrap();
            fs::read(out).unwrap()
        });
        assert_eq!(first, second);
        assert!(first.starts_with(b"\x89PNG"));
    }

    #[test]
    fn what_lies_outside_is_counted() {
        let clean = sphere(10, false);
        let frame = Frame::around(&[&clean.positions]);
        let noisy = Scan { positions: vec![[0.0; 3], [9.0; 3], [f32::NAN; 3]], ..clean };
        let heading = row_heading("noisy", &noisy, &frame);
        assert_eq!(heading, "noisy: 3 points, 2 of them outside the frame");
    }

    #[test]
    fn a_box_is_turned_from_above_and_upright_from_the_sides() {
        // 4 m long to the left, 2 m wide, from 0 to 1 m high.
        let placed = Placed {
            class: None,
            centre: [10.0, 0.0, 0.5],
            size: [4.0, 2.0, 1.0],
            yaw: std::f64::consts::FRAC_PI_2,
            score: None,
            track: None,
            truth: true,
            turn: None,
            in_world: false,
            time_s: None,
        };
        let [side, above, front] = View::ALL.map(|view| outline(&placed, view).corners);
        let expected = [
            (side, [[9.0, 0.0], [11.0, 0.0], [11.0, 1.0], [9.0, 1.0]]),
            (above, [[9.0, 2.0], [9.0, -2.0], [11.0, -2.0], [11.0, 2.0]]),
            (front, [[-2.0, 0.0], [2.0, 0.0], [2.0, 1.0], [-2.0, 1.0]]),
        ];
        for (found, expected) in expected {
            let apart = |(a, b): (&f64, &f64)| (a - b).abs();
            let most = found.as_flattened().iter().zip(expected.as_flattened()).map(apart);
            assert!(most.fold(0.0, f64::max) < 1e-12, "{found:?} beside {expected:?}");
        }
    }

    #[test]
    fn boxes_outside_the_frame_are_not_drawn() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("above.png");
        let scan = sphere(99, false);
        let picture = |corners: Option<[f64; 2]>| {
            let [low, high] = corners.unwrap_or_default();
            let corners = [[low, 0.0], [high, 0.0], [high, 0.5], [low, 0.5]];
            let tint = RGBColor(9, 9, 9);
            let outline = Outline { corners, class: "car", score: Some(0.5), tint };
            let outlines = if high > low { vec![outline] } else { vec![] };
            draw_from_above(&scan, &[tint; 99], &outlines, "", &out).unwrap();
            fs::read(&out).unwrap()
        };
        let without = picture(None);
        assert!(picture(Some([900.0, 901.0])) == without);
        assert!(picture(Some([0.0, 0.5])) != without);
    }
}
