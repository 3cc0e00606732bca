use glam::{DVec2, DVec3};

use super::{Builder, outline};

/// The surface through closed `sections` of equally many points, with both ends closed.
///
/// Sections counter-clockwise about the direction from the first to the last give front faces that
/// look outwards.
pub fn loft(b: &mut Builder, sections: &[Vec<DVec3>]) {
    skin(b, sections);
    cap_start(b, &sections[0]);
    cap(b, &sections[sections.len() - 1]);
}

/// Like [`loft`], with open ends.
pub fn skin(b: &mut Builder, sections: &[Vec<DVec3>]) {
    let mut rows = Vec::new();
    for (section, next) in sections.iter().zip(&sections[1..]) {
        let longest = section.iter().zip(next).map(|(p, q)| p.distance(*q)).fold(0.0, f64::max);
        let n = b.straight(longest);
        rows.extend((0..n).map(|k| between(section, next, k as f64 / n as f64)));
    }
    rows.extend(sections.last().cloned());
    b.grid(&rows, true);
}

/// Closes the first section of a loft, with the front face outwards.
pub fn cap_start(b: &mut Builder, section: &[DVec3]) {
    let reversed: Vec<_> = section.iter().rev().copied().collect();
    cap(b, &reversed);
}

/// An upright prism over `outline` from `low` to `high`. `taper` is the width of its top over that
/// of its bottom.
pub fn prism(b: &mut Builder, outline: &[DVec2], low: f64, high: f64, taper: f64) {
    let top: Vec<_> = outline.iter().map(|&p| p * taper).collect();
    loft(b, &[outline::at_height(outline, low), outline::at_height(&top, high)]);
}

/// Fills a closed ring that is star-shaped about the mean of its points.
pub fn cap(b: &mut Builder, ring: &[DVec3]) {
    let centre = ring.iter().sum::<DVec3>() / ring.len() as f64;
    let radius = ring.iter().map(|p| p.distance(centre)).sum::<f64>() / ring.len() as f64;
    let n = b.straight(radius);
    let mut rows: Vec<Vec<DVec3>> = (0..n)
        .map(|k| ring.iter().map(|p| p.lerp(centre, k as f64 / n as f64)).collect())
        .collect();
    rows.push(vec![centre]);
    b.grid(&rows, true);
}

fn between(section: &[DVec3], next: &[DVec3], t: f64) -> Vec<DVec3> {
    section.iter().zip(next).map(|(p, q)| p.lerp(*q, t)).collect()
}
