//! Follows the ground along the columns of a range image.

use crate::height_grid::{HeightGrid, SECTORS};
use crate::image::{Columns, Return};
use crate::plane::{Plane, STEEPEST};
use crate::settings::Settings;

/// The rise that range noise and a kerb may add to a slope.
const STEP_M: f32 = 0.12;
/// The shortest run over which a slope is measured: below it, range noise dominates.
const SHORTEST_RUN_M: f32 = 0.3;
/// The longest run over which the ground may climb: beyond it, as in the shadow of a car, a higher
/// return is more likely the roof of the next car than a street.
const LONGEST_RUN_M: f32 = 4.0;
/// A rise over run that is steeper than any ground, 27 degrees.
const STEEP: f32 = 0.5;
/// The farthest of the lowest returns whose median gives the height of the ground.
const NEAR_M: f32 = 20.0;
/// The range within which the plane is fitted: farther streets may climb.
const PLANE_M: f32 = 20.0;

#[derive(Default)]
pub struct GroundFinder {
    lowest: Vec<f32>,
    is_seed: Vec<bool>,
}

/// A ground return: its horizontal distance, its height above the plane, and its index in the
/// column. The default is the point below the sensor.
#[derive(Clone, Copy, Default)]
struct Anchor {
    range_m: f32,
    height_m: f32,
    at: usize,
}

impl GroundFinder {
    /// Fills `grid` with the ground of `image`.
    pub fn find(&mut self, image: &impl Columns, settings: &Settings, grid: &mut HeightGrid) {
        let slope = f64::from(settings.max_ground_slope_deg).to_radians().tan() as f32;
        // The plane helps to find the ground, and the ground determines the plane: a quarter of the
        // sectors gives a first estimate of the plane.
        let level = self.level_under_sensor(image);
        self.follow_all(image, level, slope.max(STEEPEST), grid, |sector| sector % 4 == 0);
        let plane = Plane::fit(level, || grid.means(PLANE_M));
        self.follow_all(image, plane, slope, grid, |_| true);
        grid.finish(plane, slope);
    }

    /// Adds the probable ground returns of the sectors that `is_wanted` accepts to `grid`.
    fn follow_all(
        &mut self,
        image: &impl Columns,
        plane: Plane,
        slope: f32,
        grid: &mut HeightGrid,
        is_wanted: impl Fn(usize) -> bool,
    ) {
        grid.reset();
        for column in 0..image.n_columns() {
            let sector = sector(image.n_columns(), column);
            if !is_wanted(sector) {
                continue;
            }
            let returns = image.column(column);
            self.follow(returns, plane, slope);
            let seeds = returns.iter().zip(&self.is_seed).filter(|(_, is_seed)| **is_seed);
            seeds.for_each(|(seed, _)| grid.add(sector, seed.range_m, seed.position));
        }
    }

    /// A level plane at the median height of the columns' lowest returns: of the near ones, if
    /// there are any.
    fn level_under_sensor(&mut self, image: &impl Columns) -> Plane {
        for farthest_m in [NEAR_M, f32::INFINITY] {
            let lowest = (0..image.n_columns()).filter_map(|column| image.column(column).first());
            let near = lowest.filter(|lowest| lowest.range_m <= farthest_m);
            self.lowest.clear();
            self.lowest.extend(near.map(|lowest| lowest.position[2]));
            let middle = self.lowest.len() / 2;
            if !self.lowest.is_empty() {
                return Plane::level(*self.lowest.select_nth_unstable_by(middle, f32::total_cmp).1);
            }
        }
        Plane::default()
    }

    /// Marks the probable ground returns of a column: those that rise from the ground return before
    /// them by at most `slope`, with no steep surface above them.
    fn follow(&mut self, returns: &[Return], plane: Plane, slope: f32) {
        self.is_seed.clear();
        self.is_seed.resize(returns.len(), false);
        let mut last = Anchor::default();
        for (at, this) in returns.iter().enumerate() {
            let (range_m, height_m) = (this.range_m, plane.height_m(this.position));
            let (run, rise) = (range_m - last.range_m, height_m - last.height_m);
            let is_level = rise.abs() <= STEP_M + slope * run.clamp(0.0, LONGEST_RUN_M);
            if is_level && run > -SHORTEST_RUN_M {
                self.is_seed[at] = true;
                if run >= SHORTEST_RUN_M {
                    last = Anchor { range_m, height_m, at };
                }
            } else if rise > STEEP * run.abs() && self.is_seed[last.at] {
                // The returns just below a steep surface may be its foot, such as a bumper.
                self.is_seed[last.at..at].fill(false);
            }
        }
    }
}

/// The sector of the height grid in which a column lies.
pub fn sector(n_columns: usize, column: usize) -> usize {
    column * SECTORS / n_columns
}
