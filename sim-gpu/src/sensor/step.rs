//! The least angle between neighbouring beams.

use std::f64::consts::TAU;

use glam::DVec3;

use super::{Layout, SensorProfile};

/// Beams closer together than this count as one beam that fires twice.
const SAME_BEAM_RAD: f64 = 1e-9;

impl SensorProfile {
    /// The least angle between neighbouring beams along a row or a column, radians; `None` for a
    /// single beam. For rosettes and tables, the least angle between any two beams of a scan.
    ///
    /// Differences in azimuth count in full at every elevation, although rays stand closer together
    /// towards the zenith.
    #[must_use]
    pub fn angular_step_rad(&self) -> Option<f64> {
        let keep_each = f64::from(self.decimation.get());
        let steps = match &self.layout {
            Layout::Rotating(rotating) => {
                let azimuth_rad = TAU * rotating.sequence_us * 1e-6 / rotating.period_s();
                let elevations = rotating.beam.iter().map(|beam| beam.elevation_deg.to_radians());
                [Some(keep_each * azimuth_rad), least_gap(elevations.collect())]
            }
            Layout::Uniform(uniform) => {
                let pitch = |from_deg: f64, to_deg: f64, steps: u32| {
                    let gaps = f64::from(steps.checked_sub(1).filter(|&gaps| gaps > 0)?);
                    Some((to_deg - from_deg).abs().to_radians() / gaps)
                };
                let azimuth =
                    pitch(uniform.azimuth_from_deg, uniform.azimuth_to_deg, uniform.azimuth_steps);
                let elevation = pitch(
                    uniform.elevation_from_deg,
                    uniform.elevation_to_deg,
                    uniform.elevation_steps,
                );
                [azimuth.map(|step| keep_each * step), elevation]
            }
            Layout::Risley(_) | Layout::Table(_) => [least_angle(&self.pattern().directions), None],
            Layout::Grid(grid) => {
                let (left, up) = grid.tangents();
                let kept = left.into_iter().step_by(self.decimation.get() as usize);
                [
                    least_gap(kept.map(libm::atan).collect()),
                    least_gap(up.into_iter().map(libm::atan).collect()),
                ]
            }
        };
        steps.into_iter().flatten().filter(|&step| step > SAME_BEAM_RAD).reduce(f64::min)
    }
}

/// The least angle between two of `directions` that are not the same, radians.
fn least_angle(directions: &[DVec3]) -> Option<f64> {
    let mut sorted = directions.to_vec();
    sorted.sort_unstable_by(|a, b| a.z.total_cmp(&b.z));
    let same = 2.0 * libm::sin(SAME_BEAM_RAD / 2.0);
    let mut least = f64::INFINITY;
    for (i, &a) in sorted.iter().enumerate() {
        for &b in &sorted[i + 1..] {
            // Directions are sorted by z, whose difference bounds the distance from below.
            if b.z - a.z >= least {
                break;
            }
            let chord = a.distance(b);
            if chord > same {
                least = least.min(chord);
            }
        }
    }
    least.is_finite().then(|| 2.0 * libm::asin((least / 2.0).min(1.0)))
}

/// The least difference of two of `angles` that are not the same.
fn least_gap(mut angles: Vec<f64>) -> Option<f64> {
    angles.sort_unstable_by(f64::total_cmp);
    let gaps = angles.windows(2).map(|pair| pair[1] - pair[0]);
    gaps.filter(|&gap| gap > SAME_BEAM_RAD).reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::num::NonZeroU32;

    fn step_deg(sensor: &SensorProfile) -> f64 {
        sensor.angular_step_rad().unwrap().to_degrees()
    }

    #[test]
    fn step_is_the_angle_of_the_two_nearest_directions() {
        let at = |deg: f64| DVec3::new(deg.to_radians().cos(), 0.0, deg.to_radians().sin());
        let found = least_angle(&[at(10.0), at(-20.0), at(10.0), at(12.0), at(60.0)]).unwrap();
        assert!((found.to_degrees() - 2.0).abs() < 1e-9, "{}", found.to_degrees());
        let opposite = least_angle(&[at(0.0), at(180.0)]).unwrap();
        assert!((opposite.to_degrees() - 180.0).abs() < 1e-6);
        assert_eq!(least_angle(&[at(3.0), at(3.0)]), None);
        // A rosette crosses itself: less than from one shot of a line to its next.
        assert!(step_deg(&SensorProfile::builtin("mid70").unwrap()) < 0.1);
    }

    #[test]
    fn a_real_head_steps_by_its_firing_sequence() {
        let vlp32c = SensorProfile::builtin("vlp32c").unwrap();
        // 55.296 us of a revolution of 0.1 s; its rows are 0.333 degrees apart.
        assert!((step_deg(&vlp32c) - 0.199_065_6).abs() < 1e-9);
        let halved = vlp32c.decimated(NonZeroU32::new(2).unwrap());
        assert!((step_deg(&halved) - 0.333).abs() < 1e-9, "now the rows are closer");
    }

    #[test]
    fn a_grid_steps_by_its_pitch() {
        let ultrapuck = SensorProfile::builtin("blainder-ultrapuck").unwrap();
        assert!((step_deg(&ultrapuck) - 360.0 / 1799.0).abs() < 1e-9);
        // Every second column is left out: now the rows are closer.
        let halved = ultrapuck.decimated(NonZeroU32::new(2).unwrap());
        assert!((step_deg(&halved) - 40.0 / 121.0).abs() < 1e-9);
        let camera = SensorProfile::builtin("generic-static").unwrap();
        // 100 pixels over 60 degrees, uniform in the tangent: least at the edge.
        let edge = 30f64.to_radians().tan();
        let expected = (edge.atan() - (edge - 2.0 * edge / 99.0).atan()).to_degrees();
        assert!((step_deg(&camera) - expected).abs() < 1e-9);
    }

    #[test]
    fn a_single_beam_has_no_neighbour() {
        let text = "name = \"one\"\nrange = { max_m = 10 }\n[grid]\nwidth = 1\nheight = 1\n\
                    fov_x_deg = 10\nfov_y_deg = 10";
        let one: SensorProfile = toml::from_str(text).unwrap();
        assert_eq!(one.angular_step_rad(), None);
    }
}
