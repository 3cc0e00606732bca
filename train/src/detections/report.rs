//! The report on detections: a table in text, and precision over recall as a picture.

use std::fmt::Write as _;

use formats::interval::wilson;

use super::frames::Frames;
use super::judge::{Asked, judge};
use super::precision::{DISTANCES_M, OfClass};
use super::tracks::followed;

/// Edges of the bins of range, metres, and of the bins of numbers of points.
const RANGES_M: [f64; 5] = [0.0, 10.0, 20.0, 30.0, 40.0];
const POINTS: [u64; 5] = [0, 30, 60, 150, 500];

/// The classes of streets, which `detect` looks for.
const STREET: [&str; 5] = ["bus", "car", "person", "truck", "two-wheeler"];

/// The classes that are reported, with their names: those of streets and those that were detected. Of the
/// others, such as buildings, nothing is looked for.
fn reported(frames: &Frames) -> Vec<(usize, &str)> {
    let is_found =
        |class| frames.of.iter().any(|[found, _]| found.iter().any(|one| one.class == Some(class)));
    let names = frames.classes.iter().map(String::as_str).enumerate();
    names.filter(|(class, name)| STREET.contains(name) || is_found(*class)).collect()
}

/// The report on `frames`, for objects of `min_points` or more.
pub fn table(frames: &Frames, min_points: u64) -> String {
    let judged = judge(frames, min_points);
    let n_frames = judged.n_frames.max(1) as f64;
    let mut text = format!(
        "{:14} {:>14} {:>17} {:>6} {:>8} {:>6} {:>6} {:>6} {:>6}\n",
        "class", "found", "95 % interval, %", "false", "a frame", "AP 0.5", "1 m", "2 m", "4 m"
    );
    for (class, name) in reported(frames) {
        let asked: Vec<&Asked> = judged.asked.iter().filter(|one| one.class == class).collect();
        let n_wrong = judged.wrong.iter().filter(|one| **one == class).count();
        let (share, interval) = found(&asked);
        let precision = OfClass::of(frames, class, min_points);
        let precisions = DISTANCES_M
            .map(|within_m| format!("{:6.1}", 100.0 * precision.average_precision(within_m)));
        let a_frame = n_wrong as f64 / n_frames;
        let _ = writeln!(
            text,
            "{name:14} {share:>14} {interval:>17} {n_wrong:6} {a_frame:8.2} {}",
            precisions.join(" ")
        );
    }
    text += &confusion(frames, &judged.asked);
    text += &bins(frames, &judged.asked);
    text += &tracks(frames, min_points);
    text
}

/// How many objects were found, and the interval of their share.
fn found(asked: &[&Asked]) -> (String, String) {
    let n = asked.iter().filter(|one| one.answer == Some(one.class)).count();
    let (low, high) = if asked.is_empty() { (0.0, 1.0) } else { wilson(n, asked.len()) };
    (
        format!("{n} of {}", asked.len()),
        format!("{:.1} to {:.1}", 100.0 * low.max(0.0), 100.0 * high),
    )
}

/// What objects were taken for.
fn confusion(frames: &Frames, asked: &[Asked]) -> String {
    let mut text = "\nobjects of (row) that were called (column)\n".to_owned();
    let _ = write!(text, "{:14}", "");
    reported(frames).iter().for_each(|(_, name)| _ = write!(text, " {name:>12}"));
    text += "   none\n";
    for (class, name) in reported(frames) {
        let n = |answer: Option<usize>| {
            asked.iter().filter(|one| one.class == class && one.answer == answer).count()
        };
        let _ = write!(text, "{name:14}");
        reported(frames)
            .iter()
            .for_each(|&(answer, _)| _ = write!(text, " {:12}", n(Some(answer))));
        let _ = writeln!(text, " {:6}", n(None));
    }
    text
}

/// The shares that are found by range and by number of points.
fn bins(frames: &Frames, asked: &[Asked]) -> String {
    let mut text = String::new();
    let shown = reported(frames);
    let mut push = |title: String, is_in: &dyn Fn(&Asked) -> bool| {
        let mut row = format!("{title:22}");
        let of: Vec<&Asked> = asked.iter().filter(|one| is_in(one)).collect();
        for &(class, _) in &shown {
            let of_class: Vec<&Asked> =
                of.iter().copied().filter(|one| one.class == class).collect();
            let _ = write!(row, " {:>13}", found(&of_class).0);
        }
        if !of.is_empty() {
            text += &(row + "\n");
        }
    };
    for (i, &from_m) in RANGES_M.iter().enumerate() {
        let to_m = RANGES_M.get(i + 1).copied().unwrap_or(f64::INFINITY);
        let title = if to_m.is_infinite() {
            format!("{from_m} m or more")
        } else {
            format!("{from_m} to {to_m} m")
        };
        push(title, &|one| one.range_m.is_some_and(|range_m| (from_m..to_m).contains(&range_m)));
    }
    for (i, &from) in POINTS.iter().enumerate() {
        let to = POINTS.get(i + 1).copied().unwrap_or(u64::MAX);
        let title = if to == u64::MAX {
            format!("{from} points or more")
        } else {
            format!("{from} to {} points", to - 1)
        };
        push(title, &|one| one.n_points.is_some_and(|n| (from..to).contains(&n)));
    }
    let mut head = format!("\n{:22}", "found");
    shown.iter().for_each(|(_, name)| _ = write!(head, " {name:>13}"));
    head + "\n" + &text
}

/// The metrics of tracks, if there are any.
fn tracks(frames: &Frames, min_points: u64) -> String {
    let mut text = String::new();
    for (class, name) in reported(frames) {
        if let Some(of) = followed(frames, class, min_points) {
            let [hota, detection, association] =
                [of.hota, of.detection, of.association].map(|share| 100.0 * share);
            let _ = writeln!(
                text,
                "{name:14} HOTA {hota:5.1} (detection {detection:.1}, association {association:.1}), {} switches",
                of.switches
            );
        }
    }
    if text.is_empty() { text } else { format!("\n{text}") }
}

/// Precision over recall of each class, at 2 m.
pub fn to_svg(frames: &Frames, min_points: u64) -> String {
    const SIDE: f64 = 400.0;
    const COLOURS: [&str; 6] = ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf"];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-50 -20 600 480\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect x=\"-50\" y=\"-20\" width=\"600\" height=\"480\" fill=\"white\"/>\n\
         <rect width=\"{SIDE}\" height=\"{SIDE}\" fill=\"none\" stroke=\"#888\"/>\n\
         <text x=\"170\" y=\"435\">recall</text><text x=\"-45\" y=\"-6\">precision, by centres within 2 m</text>\n"
    );
    for tick in 0..=5 {
        let (share, at) = (f64::from(tick) / 5.0, f64::from(tick) / 5.0 * SIDE);
        let _ = writeln!(
            svg,
            "<text x=\"{at}\" y=\"417\" text-anchor=\"middle\">{share}</text><text x=\"-6\" y=\"{}\" text-anchor=\"end\">{share}</text>",
            SIDE - at + 4.0
        );
    }
    for (class, name) in reported(frames) {
        let colour = COLOURS[class % COLOURS.len()];
        let curve = OfClass::of(frames, class, min_points).curve(2.0);
        let points: Vec<String> =
            curve.iter().map(|[x, y]| format!("{:.1},{:.1}", SIDE * x, SIDE * (1.0 - y))).collect();
        let y = 15 + 20 * class;
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>\
             <text x=\"410\" y=\"{y}\" fill=\"{colour}\">{name}</text>",
            points.join(" ")
        );
    }
    svg + "</svg>\n"
}
