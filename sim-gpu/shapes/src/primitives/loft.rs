//! Surfaces stretched over cross-sections.

use glam::{DVec2, DVec3};

use super::super::builder::Builder;
use super::outline;

/// Which ends of a loft are closed.
#[derive(Clone, Copy, Debug)]
pub struct Caps {
    /// Closes the first section.
    pub start: bool,
    /// Closes the last section.
    pub end: bool,
}

impl Caps {
    /// Both ends closed.
    pub const BOTH: Self = Self { start: true, end: true };
}

/// The surface through closed `sections` of equally many points.
///
/// Sections counter-clockwise about the direction from the first to the last
/// give front faces that look outwards.
pub fn loft(b: &mut Builder, sections: &[Vec<DVec3>], caps: Caps) {
    let mut rows = Vec::new();
    for (section, next) in sections.iter().zip(&sections[1..]) {
        let longest = section.iter().zip(next).map(|(p, q)| p.distance(*q)).fold(0.0, f64::max);
        let n = b.straight(longest);
        rows.extend((0..n).map(|k| between(section, next, k as f64 / n as f64)));
    }
    rows.extend(sections.last().cloned());
    b.grid(&rows, true);
    if caps.start {
        let reversed: Vec<_> = sections[0].iter().rev().copied().collect();
        cap(b, &reversed);
    }
    if let (true, Some(last)) = (caps.end, sections.last()) {
        cap(b, last);
    }
}

/// An upright prism over `outline` from `low` to `high`, whose top is `taper`
/// times as wide as its bottom.
pub fn prism(b: &mut Builder, outline: &[DVec2], low: f64, high: f64, taper: f64) {
    let top: Vec<_> = outline.iter().map(|&p| p * taper).collect();
    let sections = [outline::at_height(outline, low), outline::at_height(&top, high)];
    loft(b, &sections, Caps::BOTH);
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

#[cfg(test)]
mod tests {
    use super::super::measure::volume_m3;
    use super::*;

    #[test]
    fn a_prism_is_closed_and_looks_outwards() {
        let square = outline::rectangle(DVec2::splat(0.5));
        let volume = volume_m3(0.2, |b| prism(b, &square, 1.0, 4.0, 1.0));
        assert!((volume - 3.0).abs() < 1e-12);
        // A frustum of a pyramid: h / 3 (A + sqrt(A B) + B) = 1.75 at taper 1/2.
        let volume = volume_m3(f64::INFINITY, |b| prism(b, &square, 0.0, 3.0, 0.5));
        assert!((volume - 1.75).abs() < 1e-12);
    }
}
