//! Steps between returns that are near each other in the range image.

use crate::image::{Cells, Return};
use crate::link::{MOST_COLUMNS, MOST_IN_CELL};

/// The widest steps of each level, as multiples of the [`base_m`] at their range. Persons stand
/// closer to each other than the parts of a car do that glass separates: no step is right for all.
const LEVELS: [f32; 7] = [0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0];
const WIDEST: f32 = LEVELS[LEVELS.len() - 1];
/// Near the sensor, the base is a length, metres.
const BASE_M: f32 = 0.2;
/// Far away, it spans some returns of a turning sensor: an angle, radians.
const BASE_RAD: f32 = 0.015;

/// The base of steps at a distance from the sensor, metres.
fn base_m(distance_m: f32) -> f32 {
    BASE_M.max(BASE_RAD * distance_m)
}

fn distance_m(this: &Return) -> f32 {
    let [.., z] = this.position;
    (this.range_m * this.range_m + z * z).sqrt()
}

/// Pairs of points that a step links, by level.
#[derive(Default)]
pub struct Steps {
    levels: [Vec<[u32; 2]>; LEVELS.len()],
}

/// The nearest return so far.
struct Nearest {
    square: f32,
    found: Option<Return>,
}

impl Steps {
    /// Removes all, and makes room for those of `n_points`, unless many share cells.
    pub fn reset(&mut self, n_points: usize) {
        for pairs in &mut self.levels {
            pairs.clear();
            pairs.reserve(3 * n_points);
        }
    }

    /// The steps of each level, from the narrowest one.
    pub fn levels(&self) -> impl Iterator<Item = &[[u32; 2]]> {
        self.levels.iter().map(Vec::as_slice)
    }

    pub fn add(&mut self, level: usize, pair: [u32; 2]) {
        self.levels[level].push(pair);
    }
}

/// Passes the steps from each return of `column`, with their levels, to `each`: to the nearest
/// return beside it, in columns of higher numbers, and to the nearest ones above it, to the left and
/// to the right. Columns are `column_width` radians wide.
pub fn find_steps(
    image: &impl Cells,
    column: usize,
    column_width: f32,
    mut each: impl FnMut(usize, [u32; 2]),
) {
    let mut step = |a: &Return, b: &Return, square: f32| {
        if let Some(level) = level(a, b, square) {
            each(level, [a.point, b.point]);
        }
    };
    for row in 0..image.elevations().len() {
        let cell = image.cell(column, row);
        for (at, this) in cell.iter().enumerate() {
            for other in cell[at + 1..].iter().take(MOST_IN_CELL) {
                step(this, other, square(this, other));
            }
            let search = Search { image, this, column, row, column_width };
            for (aside, up) in [(1, false), (1, true), (-1, true)] {
                let nearest = search.nearest(aside, up);
                if let Some(other) = nearest.found {
                    step(this, &other, nearest.square);
                }
            }
        }
    }
}

/// The most columns between a return and one that a step links to it.
///
/// A return at a horizontal distance r is at least r sin(a) from one that is turned by a.
pub fn most_columns(this: &Return, column_width: f32) -> usize {
    // The factor covers rounding.
    let sine = 1.001 * WIDEST * base_m(distance_m(this)) / this.range_m;
    if sine < 1.0 { (libm::asinf(sine) / column_width) as usize + 2 } else { MOST_COLUMNS }
        .min(MOST_COLUMNS)
}

/// The level of a step of this square length; `None` if it is wider than all.
fn level(a: &Return, b: &Return, square: f32) -> Option<usize> {
    let base_m = base_m(distance_m(a).min(distance_m(b)));
    LEVELS.iter().position(|level| square <= (level * base_m).powi(2))
}

struct Search<'a, I> {
    image: &'a I,
    this: &'a Return,
    column: usize,
    row: usize,
    column_width: f32,
}

impl<I: Cells> Search<'_, I> {
    /// The nearest return on the row, or `up` above it, in the columns on one side: `aside` is 1 or
    /// -1. Rows and columns are left out from where their angle alone is farther away; a row's is
    /// the mean of its returns, of which single ones may be nearer.
    fn nearest(&self, aside: isize, up: bool) -> Nearest {
        let elevations = self.image.elevations();
        let rows = if up { self.row + 1..elevations.len() } else { self.row..self.row + 1 };
        let widest_m = WIDEST * base_m(distance_m(self.this));
        let mut nearest = Nearest { square: widest_m * widest_m, found: None };
        for row in rows {
            let above_m = self.this.range_m * (elevations[row] - elevations[self.row]);
            if above_m * above_m > nearest.square {
                break;
            }
            self.look_along(row, aside, above_m * above_m, &mut nearest);
        }
        nearest
    }

    fn look_along(&self, row: usize, aside: isize, above_square: f32, nearest: &mut Nearest) {
        let n_columns = self.image.n_columns();
        // Above, the column itself belongs to the left.
        let first = usize::from(row == self.row || aside < 0);
        for step in first..=MOST_COLUMNS.min(n_columns - 1) {
            // Two returns in neighbouring columns may have the same azimuth.
            let beside_m = self.this.range_m * self.column_width * step.saturating_sub(1) as f32;
            if beside_m * beside_m + above_square > nearest.square {
                return;
            }
            let at = self.column as isize + aside * step as isize;
            let at = at.rem_euclid(n_columns as isize) as usize;
            for other in self.image.cell(at, row).iter().take(MOST_IN_CELL) {
                let square = square(self.this, other);
                if square < nearest.square {
                    *nearest = Nearest { square, found: Some(*other) };
                }
            }
        }
    }
}

fn square(a: &Return, b: &Return) -> f32 {
    (0..3).map(|axis| (a.position[axis] - b.position[axis]).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Columns, RangeImage};
    use crate::label::Label;
    use crate::settings::Settings;
    use crate::sweep::Sweep;

    /// Points on a bent surface in 12 rings, with gaps and jumps in depth, near enough that steps
    /// reach over many columns.
    fn image() -> RangeImage {
        let (mut points, mut rings) = (Vec::new(), Vec::new());
        for ring in 0..12u16 {
            for step in 0..200u16 {
                let mix = (u32::from(ring) * 7919 + u32::from(step) * 104_729) % 97;
                if mix < 35 {
                    continue;
                }
                let range_m = 6.0 + (mix % 5) as f32 * 0.31 + 0.4 * (f32::from(step) * 0.05).sin();
                let azimuth = (f32::from(step) * 0.2 - 20.0).to_radians();
                let elevation = (f32::from(ring) - 6.0).to_radians();
                let level = range_m * elevation.cos();
                points.push([
                    level * azimuth.cos(),
                    level * azimuth.sin(),
                    range_m * elevation.sin(),
                ]);
                rings.push(ring);
            }
        }
        let mut labels = vec![Label::Invalid; points.len()];
        let mut image = RangeImage::default();
        let sweep = Sweep { points: &points, rings: Some(&rings) };
        image.fill(&sweep, &Settings::default(), &mut labels).unwrap();
        image
    }

    /// The nearest of all returns on the row or above it, in the columns of one side.
    fn nearest_of_all(search: &Search<'_, RangeImage>, aside: isize, up: bool) -> f32 {
        let Search { image, this, column, row, .. } = *search;
        let rows = if up { row + 1..image.elevations().len() } else { row..row + 1 };
        let first = isize::from(!up || aside < 0);
        let columns = (first..=MOST_COLUMNS as isize).map(|step| column as isize + aside * step);
        let others = rows.flat_map(|row| columns.clone().map(move |at| (at as usize, row)));
        let squares = others.flat_map(|(at, row)| image.cell(at, row)).map(|o| square(this, o));
        squares.fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn no_nearer_return_is_left_out() {
        let image = image();
        let column_width = Settings::default().column_width_deg.to_radians();
        let (mut n, mut n_far) = (0, 0);
        for column in 0..Columns::n_columns(&image) {
            if image.column(column).is_empty() {
                continue;
            }
            for row in 0..image.elevations().len() {
                for this in image.cell(column, row) {
                    let search = Search { image: &image, this, column, row, column_width };
                    for (aside, up) in [(1, false), (1, true), (-1, true)] {
                        let found = search.nearest(aside, up);
                        let expected = nearest_of_all(&search, aside, up);
                        let widest = (WIDEST * base_m(distance_m(this))).powi(2);
                        match found.found {
                            Some(_) => assert_eq!(found.square, expected),
                            None => assert!(expected >= widest, "{expected}"),
                        }
                        n += 1;
                        n_far += usize::from(found.square > 0.04);
                    }
                }
            }
        }
        assert!(n > 4000 && n_far > 300, "{n} {n_far}");
    }

    /// 0.2 m near the sensor, and 0.6 m at 40 m.
    #[test]
    fn steps_are_wider_far_away() {
        let at = |range_m: f32, y: f32, point| {
            let position = [range_m, y, 0.0];
            Return { position, range_m: range_m.hypot(y), height_m: 1.0, point }
        };
        for (range_m, step_m, expected) in [
            (5.0, 0.09, Some(0)),
            (5.0, 0.11, Some(1)),
            (5.0, 0.81, None),
            (40.0, 0.29, Some(0)),
            (40.0, 2.39, Some(6)),
            (40.0, 2.41, None),
        ] {
            let [a, b] = [at(range_m, 0.0, 0), at(range_m, step_m, 1)];
            assert_eq!(level(&a, &b, square(&a, &b)), expected, "{range_m} {step_m}");
        }
    }
}
