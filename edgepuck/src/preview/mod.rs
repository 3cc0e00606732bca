//! A picture of a scan: a sweep from above; anything else from the side, the top and the front, clean
//! above noisy, as in the paper's figure.

mod canvas;
mod colours;
mod frame;
mod from_above;
pub mod panel;

use std::path::Path;

use anyhow::Result;
use formats::Scan;
use plotters::style::RGBColor;

use crate::view::frame::Labels;
use canvas::{draw_png, text};
use colours::Colours;
use frame::{Frame, View};
use from_above::EDGE;
pub use from_above::draw_from_above;

const TITLE_HEIGHT: u32 = 52;
const ROW_HEADING_HEIGHT: u32 = 30;
const BAR_WIDTH: u32 = 160;

/// Draws `clean`, and `noisy` below it, to the PNG file `out`, atomically.
///
/// All panels share one scale, in metres: the frame is the bounding box of the
/// clean points, with a margin. Points are coloured by `labels`,
/// as the legend says; or by range where both scans know it, and by height otherwise,
/// as the colour bar says. Points outside the
/// frame are counted in their row's heading; those that are not finite count
/// with them. Axes start at the scans' origin where that is not 0.
pub fn draw(
    clean: &Scan,
    labels: Option<&Labels>,
    noisy: Option<&Scan>,
    title: &str,
    out: &Path,
) -> Result<()> {
    let labels = labels.filter(|_| noisy.is_none());
    let rows: Vec<_> =
        [(if noisy.is_some() { "clean" } else { "" }, Some(clean)), ("noisy", noisy)]
            .into_iter()
            .filter_map(|(name, scan)| Some((name, scan?)))
            .collect();
    for (_, scan) in &rows {
        scan.check_lengths()?;
    }
    let scans: Vec<_> = rows.iter().map(|&(_, scan)| scan).collect();
    let (views, frame, panel_width, panel_height) = match noisy.is_none() && Frame::is_sweep(clean)
    {
        true => (&View::ALL[1..2], Frame::near_sensor(clean), EDGE, EDGE),
        false => (&View::ALL[..], Frame::around(&scans), panel::WIDTH, panel::HEIGHT),
    };
    let colours = Colours::of(&scans, &frame);

    let width = panel_width * views.len() as u32 + BAR_WIDTH;
    let row_height = ROW_HEADING_HEIGHT + panel_height;
    let height = TITLE_HEIGHT + row_height * rows.len() as u32;
    draw_png(out, (width, height), (title, TITLE_HEIGHT), |below| {
        let (panels, bar) = below.split_horizontally(width - BAR_WIDTH);
        match labels {
            Some(labels) => colours::draw_legend(&bar, labels)?,
            None => colours.draw_bar(&bar)?,
        }
        for (row, &(name, scan)) in panels.split_evenly((rows.len(), 1)).iter().zip(&rows) {
            let (heading, panels) = row.split_vertically(ROW_HEADING_HEIGHT);
            heading.draw_text(&row_heading(name, scan, &frame), &text(17), (16, 6))?;
            let tints: Vec<RGBColor> = match labels {
                Some(labels) => {
                    labels.values.iter().map(|value| colours::tint(labels, *value)).collect()
                }
                None => colours.tints(scan),
            };
            for (area, view) in panels.split_evenly((1, views.len())).iter().zip(views) {
                panel::draw(area, *view, scan, &tints, &frame, &[])?;
            }
        }
        Ok(())
    })
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
                draw(&scan, None, Some(&sphere(n, true)), "a sphere", &out).unwrap();
                let two_rows = size(&fs::read(&out).unwrap());
                draw(&scan, None, None, "", &out).unwrap();
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
            draw(&sphere(2000, true), None, None, "a sphere", &out).unwrap();
            fs::read(out).unwrap()
        });
        assert_eq!(first, second);
        assert!(first.starts_with(b"\x89PNG"));
    }

    #[test]
    fn what_lies_outside_is_counted() {
        let clean = sphere(10, false);
        let frame = Frame::around(&[&clean]);
        let noisy = Scan { positions: vec![[0.0; 3], [9.0; 3], [f32::NAN; 3]], ..clean };
        let heading = row_heading("noisy", &noisy, &frame);
        assert_eq!(heading, "noisy: 3 points, 2 of them outside the frame");
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
            let outline = panel::Outline { corners, class: "car", score: 0.5, tint };
            let outlines = if high > low { vec![outline] } else { vec![] };
            draw_from_above(&scan, &[tint; 99], &outlines, "", &out).unwrap();
            fs::read(&out).unwrap()
        };
        let without = picture(None);
        assert!(picture(Some([900.0, 901.0])) == without);
        assert!(picture(Some([0.0, 0.5])) != without);
    }
}
