//! A drawing of the objects that a model names wrongly.

use super::{Labels, Object};
use crate::svg::{self, text};

/// Largest number of objects drawn, so that a browser can open the page.
const MOST: usize = 120;
/// Largest number of points drawn for each object.
const MOST_POINTS: usize = 500;
/// Pixels of a view.
const SIDE: f64 = 150.0;
/// Pixels of the two lines of text under a view.
const WORDS: f64 = 34.0;
const COLUMNS: usize = 4;
/// Smallest width of a view, metres, so that a person is drawn smaller than a bus.
const LEAST_WIDTH_M: f64 = 3.0;

/// Draws those of `objects` that are named wrongly, as SVG: each as the sensor sees it, and from
/// above with the sensor below. A bar is 1 m long. `clouds` holds each object's points.
#[must_use]
pub fn drawing(objects: &[Object], clouds: &[&[[f32; 3]]], labels: &Labels) -> String {
    let each = objects.iter().zip(clouds);
    let wrong: Vec<_> = each.filter(|(object, _)| !object.is_right()).collect();
    let rows = wrong.len().min(MOST).div_ceil(COLUMNS);
    let title = match wrong.len() {
        n if n > MOST => format!("{n} objects named wrongly, {MOST} of them drawn"),
        n => format!("{n} objects named wrongly"),
    };
    let title = format!("{title}: as the sensor sees each, and from above");
    let mut parts = text(&title, 4.0, 20.0, 14, "");
    for (place, (object, cloud)) in wrong.into_iter().take(MOST).enumerate() {
        let left = 2.0 * SIDE * (place % COLUMNS) as f64;
        let top = WORDS + (SIDE + WORDS) * (place / COLUMNS) as f64;
        let [first, second] = words(object, labels.classes());
        add_views(&mut parts, cloud, left, top);
        parts += &text(&first, left + 4.0, top + SIDE + 10.0, 11, "");
        parts += &text(&second, left + 4.0, top + SIDE + 24.0, 11, "");
    }
    svg::drawing(2.0 * SIDE * COLUMNS as f64, (SIDE + WORDS) * rows as f64 + WORDS, &parts)
}

/// Two lines about an object: its label and the answer; number of points, range and file.
fn words(object: &Object, classes: &[String]) -> [String; 2] {
    let fine = &classes[object.answer.fine];
    let called = match object.answer.class {
        Some(class) => classes[class].clone(),
        None => format!("unknown ({fine})"),
    };
    let range = object.range_m.map(|range| format!(", {range:.0} m away")).unwrap_or_default();
    [
        format!("{} called {called}", object.label),
        format!("{} points{range}, {}", object.n_points, object.data),
    ]
}

/// Adds both views of `cloud`, which has the sensor at the origin, and a bar of 1 m.
fn add_views(parts: &mut String, cloud: &[[f32; 3]], left: f64, top: f64) {
    let n = cloud.len().max(1) as f64;
    let mean = |axis: usize| cloud.iter().map(|point| f64::from(point[axis])).sum::<f64>() / n;
    let (sin, cos) = libm::sincos(libm::atan2(mean(1), mean(0)));
    // Along the line of sight, to its left, and up.
    let turned = |point: &[f32; 3]| {
        let [x, y, z] = point.map(f64::from);
        [x * cos + y * sin, y * cos - x * sin, z]
    };
    let points: Vec<_> =
        cloud.iter().step_by(cloud.len().div_ceil(MOST_POINTS).max(1)).map(turned).collect();
    let spans = [0, 1, 2].map(|axis| {
        let along = points.iter().map(|point| point[axis]);
        (along.clone().fold(f64::INFINITY, f64::min), along.fold(f64::NEG_INFINITY, f64::max))
    });
    let widest = spans.iter().map(|(low, high)| high - low).fold(LEAST_WIDTH_M, f64::max);
    let scale = 0.9 * SIDE / widest;
    let offset = |point: &[f64; 3], axis: usize| {
        -scale * (point[axis] - f64::midpoint(spans[axis].0, spans[axis].1))
    };
    for (view, up) in [(0.5, 2), (1.5, 0)] {
        for point in &points {
            let x = left + view * SIDE + offset(point, 1);
            let y = top + 0.5 * SIDE + offset(point, up);
            *parts += &format!("<circle cx='{x:.1}' cy='{y:.1}' r='1' fill='#06c'/>\n");
        }
    }
    let [x, y] = [left + 4.0, top + SIDE - 2.0];
    let end = x + scale;
    *parts += &format!("<line x1='{x}' x2='{end:.1}' y1='{y}' y2='{y}' stroke='#333'/>\n");
}
