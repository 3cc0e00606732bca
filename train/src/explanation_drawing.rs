//! A drawing of an explained cloud.

use crate::lime::Explanation;
use crate::svg_text::text;
use svg::Document;
use svg::node::element::{Circle, Rectangle};

const SIDE: f64 = 360.0;

/// The cloud twice: left coloured by LIME-3D, right with its critical points.
#[must_use]
pub fn draw(points: &[[f32; 3]], found: &Explanation, critical: &[usize]) -> Document {
    let background =
        Rectangle::new().set("width", 2.0 * SIDE).set("height", SIDE).set("fill", "white");
    let mut document = Document::new().set("viewBox", (0, 0, 2.0 * SIDE, SIDE)).add(background);
    let most = found.attribution.iter().fold(f64::MIN_POSITIVE, |most, a| most.max(a.abs()));
    for (point, &cluster) in points.iter().zip(&found.cluster) {
        let share = found.attribution[cluster] / most;
        let colour = if share > 0.0 { "#c30" } else { "#06c" };
        document = document.add(dot(point, 0.0, 2.5, colour, 0.15 + 0.85 * share.abs()));
    }
    for point in points {
        document = document.add(dot(point, SIDE, 1.5, "#999", 0.6));
    }
    for &i in critical {
        document = document.add(dot(&points[i], SIDE, 3.5, "#c30", 1.0));
    }
    let heading = |words: &str, left: f64| text(words, left + 10.0, 18.0, 12);
    document
        .add(heading("LIME-3D: red speaks for the class, blue against", 0.0))
        .add(heading("critical points", SIDE))
}

/// A point as seen from an azimuth of 30 degrees and an elevation of 20 degrees.
fn dot(point: &[f32; 3], left: f64, radius: f64, colour: &str, opacity: f64) -> Circle {
    let [x, y, z] = point.map(f64::from);
    let (azimuth, elevation) = (30f64.to_radians(), 20f64.to_radians());
    let across = x * azimuth.cos() + y * azimuth.sin();
    let along = y * azimuth.cos() - x * azimuth.sin();
    let up = z * elevation.cos() + along * elevation.sin();
    let scale = 0.42 * SIDE;
    Circle::new()
        .set("cx", format!("{:.1}", left + SIDE / 2.0 + scale * across))
        .set("cy", format!("{:.1}", SIDE / 2.0 - scale * up))
        .set("r", radius)
        .set("fill", colour.to_owned())
        .set("fill-opacity", format!("{opacity:.2}"))
}
