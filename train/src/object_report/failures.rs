//! A drawing of the objects that are named wrongly.

use svg::Document;
use svg::node::element::{Circle, Line, Rectangle};

use super::{Labels, Object};
use crate::svg_text::text;

/// Most objects that are drawn; the page stays one that a browser opens.
const MOST: usize = 120;
/// Most points of an object that are drawn.
const MOST_POINTS: usize = 500;
/// Pixels of a view, and of the words under two of them.
const SIDE: f64 = 150.0;
const WORDS: f64 = 34.0;
/// Objects in a row.
const COLUMNS: usize = 4;
/// The least width of a view, metres: a person is not drawn as large as a bus.
const LEAST_WIDTH_M: f64 = 3.0;

/// Draws the wrongly named of `objects`, each as the sensor sees it and from above with the
/// sensor below; a bar is 1 m long. `clouds` are their points.
#[must_use]
pub fn drawing(objects: &[Object], clouds: &[&[[f32; 3]]], labels: &Labels) -> Document {
    let each = objects.iter().zip(clouds);
    let wrong: Vec<_> = each.filter(|(object, _)| !object.is_right()).collect();
    let rows = wrong.len().min(MOST).div_ceil(COLUMNS);
    let (width, height) = (2.0 * SIDE * COLUMNS as f64, (SIDE + WORDS) * rows as f64 + WORDS);
    let title = match wrong.len() {
        n if n > MOST => format!("{n} objects named wrongly, {MOST} of them drawn"),
        n => format!("{n} objects named wrongly"),
    };
    let background = Rectangle::new().set("width", width).set("height", height);
    let mut document = Document::new()
        .set("viewBox", (0, 0, width, height))
        .add(background.set("fill", "white"))
        .add(text(&format!("{title}: as the sensor sees each, and from above"), 4.0, 20.0, 14));
    for (place, (object, cloud)) in wrong.into_iter().take(MOST).enumerate() {
        let left = 2.0 * SIDE * (place % COLUMNS) as f64;
        let top = WORDS + (SIDE + WORDS) * (place / COLUMNS) as f64;
        let [first, second] = words(object, labels.classes());
        document = draw(document, cloud, left, top)
            .add(text(&first, left + 4.0, top + SIDE + 10.0, 11))
            .add(text(&second, left + 4.0, top + SIDE + 24.0, 11));
    }
    document
}

/// What it is, what it is called, and what else is known of it.
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

/// Both views of `cloud`, which has the sensor at the origin.
fn draw(mut document: Document, cloud: &[[f32; 3]], left: f64, top: f64) -> Document {
    let n = cloud.len().max(1) as f64;
    let mean = |axis: usize| cloud.iter().map(|point| f64::from(point[axis])).sum::<f64>() / n;
    let (sin, cos) = mean(1).atan2(mean(0)).sin_cos();
    // Along the line of sight, to its left, and up.
    let turned = |point: &[f32; 3]| {
        let [x, y, z] = point.map(f64::from);
        [x * cos + y * sin, y * cos - x * sin, z]
    };
    let points: Vec<_> =
        cloud.iter().step_by(cloud.len().div_ceil(MOST_POINTS).max(1)).map(turned).collect();
    let spans = [0, 1, 2].map(|axis| {
        let of = points.iter().map(|point| point[axis]);
        (of.clone().fold(f64::INFINITY, f64::min), of.fold(f64::NEG_INFINITY, f64::max))
    });
    let widest = spans.iter().map(|(low, high)| high - low).fold(LEAST_WIDTH_M, f64::max);
    let scale = 0.9 * SIDE / widest;
    for (view, up) in [(0.0, 2), (1.0, 0)] {
        let middle = |axis: usize| f64::midpoint(spans[axis].0, spans[axis].1);
        for point in &points {
            let across = -scale * (point[1] - middle(1));
            let above = -scale * (point[up] - middle(up));
            document = document.add(
                Circle::new()
                    .set("cx", format!("{:.1}", left + (view + 0.5) * SIDE + across))
                    .set("cy", format!("{:.1}", top + 0.5 * SIDE + above))
                    .set("r", 1)
                    .set("fill", "#06c"),
            );
        }
    }
    document.add(
        Line::new()
            .set("x1", left + 4.0)
            .set("x2", format!("{:.1}", left + 4.0 + scale))
            .set("y1", top + SIDE - 2.0)
            .set("y2", top + SIDE - 2.0)
            .set("stroke", "#333"),
    )
}
