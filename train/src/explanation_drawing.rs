//! A drawing of an explained cloud.

use crate::lime::Explanation;

/// Pixels of a view.
const SIDE: f64 = 360.0;

/// Draws the cloud twice, as SVG: coloured by LIME-3D, and with its critical points.
pub fn draw(points: &[[f32; 3]], found: &Explanation, critical: &[usize]) -> String {
    let most = found.attribution.iter().fold(f64::MIN_POSITIVE, |most, a| most.max(a.abs()));
    let mut parts = String::new();
    for (point, &cluster) in points.iter().zip(&found.cluster) {
        let share = found.attribution[cluster] / most;
        let colour = if share > 0.0 { "#c30" } else { "#06c" };
        parts += &dot(point, 0.0, 2.5, colour, 0.15 + 0.85 * share.abs());
    }
    parts.extend(points.iter().map(|point| dot(point, SIDE, 1.5, "#999", 0.6)));
    parts.extend(critical.iter().map(|&i| dot(&points[i], SIDE, 3.5, "#c30", 1.0)));
    for (x, label) in
        [(10.0, "LIME-3D: red for the class, blue against"), (SIDE, "critical points")]
    {
        parts += &format!(
            "<text x='{x}' y='18' font-family='sans-serif' font-size='12'>{label}</text>\n"
        );
    }
    let width = 2.0 * SIDE;
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {SIDE}'>\n\
         <rect width='{width}' height='{SIDE}' fill='white'/>\n{parts}</svg>\n"
    )
}

/// A point as seen from an azimuth of 30 degrees and an elevation of 20 degrees.
fn dot(point: &[f32; 3], left: f64, radius: f64, colour: &str, opacity: f64) -> String {
    let [x, y, z] = point.map(f64::from);
    let (azimuth, elevation) = (30f64.to_radians(), 20f64.to_radians());
    let across = x * libm::cos(azimuth) + y * libm::sin(azimuth);
    let along = y * libm::cos(azimuth) - x * libm::sin(azimuth);
    let up = z * libm::cos(elevation) + along * libm::sin(elevation);
    let scale = 0.42 * SIDE;
    let [x, y] = [left + SIDE / 2.0 + scale * across, SIDE / 2.0 - scale * up];
    format!(
        "<circle cx='{x:.1}' cy='{y:.1}' r='{radius}' fill='{colour}' fill-opacity='{opacity:.2}'/>\n"
    )
}
