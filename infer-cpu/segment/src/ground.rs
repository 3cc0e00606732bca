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
        let slope = libm::tan(f64::from(settings.max_ground_slope_deg).to_radians()) as f32;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A return ahead, at a range and a height.
    fn at(&[range_m, z]: &[f32; 2]) -> Return {
        Return { position: [range_m, 0.0, z], range_m, ..Return::default() }
    }

    /// Which returns of a column are ground, given their ranges and heights, on a level plane at 0
    /// whose ground may climb by 8 degrees.
    fn seeds(returns: &[[f32; 2]]) -> Vec<bool> {
        let returns: Vec<Return> = returns.iter().map(at).collect();
        let mut finder = GroundFinder::default();
        finder.follow(&returns, Plane::level(0.0), 8f32.to_radians().tan());
        finder.is_seed
    }

    /// tan 8 degrees is 0.1405: the ground climbs by 0.12 m and by this slope over at most 4 m.
    #[test]
    fn ground_climbs_by_a_kerb_and_a_slope() {
        let is_ground = |run_m: f32, rise_m: f32| seeds(&[[10.0, 0.0], [10.0 + run_m, rise_m]])[1];
        for (run_m, most_m) in [(0.5, 0.190), (1.0, 0.2605), (4.0, 0.682), (20.0, 0.682)] {
            assert!(is_ground(run_m, most_m - 2e-3) && is_ground(run_m, 2e-3 - most_m), "{run_m}");
            assert!(!is_ground(run_m, most_m + 2e-3) && !is_ground(run_m, -2e-3 - most_m));
        }
        // Returns swap their order by noise, and not by more.
        assert!(is_ground(-0.29, 0.05) && !is_ground(-0.31, 0.05));
    }

    /// A bank of 39 degrees, whose steps are each as low as a kerb.
    #[test]
    fn a_slope_is_measured_over_0_3_m_or_more() {
        let bank = [0.0, 0.1, 0.2, 0.3, 0.4].map(|run_m| [10.0 + run_m, 0.8 * run_m]);
        assert_eq!(seeds(&bank), [false; 5]);
    }

    #[test]
    fn the_foot_of_a_steep_surface_ends_the_ground() {
        let feet = [[9.0, 0.0], [9.5, 0.0], [9.7, 0.05]];
        let before = |range_m: f32, z: f32| seeds(&[feet[0], feet[1], feet[2], [range_m, z]]);
        // 0.4 m over 0.25 m from the last return that is 0.3 m after another.
        assert_eq!(before(9.75, 0.4), [true, false, false, false]);
        // Half as steep as 45 degrees is a bank.
        assert_eq!(before(10.5, 0.49), [true, true, true, false]);
        assert_eq!(before(10.5, 0.51), [true, false, false, false]);
    }

    /// Columns of one return each.
    struct Lowest(Vec<Return>);

    impl Columns for Lowest {
        fn n_columns(&self) -> usize {
            self.0.len()
        }

        fn column(&self, column: usize) -> &[Return] {
            std::slice::from_ref(&self.0[column])
        }
    }

    #[test]
    fn the_sensor_height_is_above_the_median_of_low_returns() {
        let level_m = |returns: &[[f32; 2]]| {
            let columns = Lowest(returns.iter().map(at).collect());
            GroundFinder::default().level_under_sensor(&columns).z_m(3.0, 4.0)
        };
        let far = [[20.5, 0.5], [40.0, 0.5], [60.0, 0.5], [80.0, 1.0]];
        let near = [[5.0, -1.75], [19.5, -1.5], [10.0, 2.0]];
        assert_eq!(level_m(&[&far[..], &near].concat()), -1.5);
        assert_eq!(level_m(&far), 0.5);
        assert_eq!(level_m(&[]), 0.0);
    }
}
