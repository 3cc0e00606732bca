/// The most rings: at 2,000 columns, the cells of the range image then take 16 MB.
pub const MOST_ROWS: usize = 2048;

/// The limits that define ground and clusters.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Points nearer than this many metres, which are mostly the robot itself, are in no cluster.
    pub min_range_m: f32,
    /// Points farther than this many metres are in no cluster.
    pub max_range_m: f32,
    /// Width of a column of the range image in degrees: about the sensor's step in azimuth.
    pub column_width_deg: f32,
    /// Height of a row of the range image in degrees, for sweeps that come without rings.
    pub row_height_deg: f32,
    /// The elevation of each ring of the sensor in degrees, in the order of the rings' numbers.
    /// `None` takes the mean of each ring's returns.
    pub ring_elevations_deg: Option<Vec<f32>>,
    /// The steepest ground in degrees, relative to the ground plane around the sensor, so that a
    /// hill or a tilt of the sensor of up to 20 degrees does not count.
    pub max_ground_slope_deg: f32,
    /// Points at most this many metres above the ground are ground.
    pub ground_clearance_m: f32,
    /// Neighbours in the range image at most this many metres apart belong together; the sensor's
    /// spacing at their range is added to it.
    pub reach_m: f32,
    /// Rings without returns, such as those on a car's windows, are bridged over up to this many
    /// metres of height.
    pub bridge_m: f32,
    /// The fewest points of a cluster.
    pub min_points: usize,
    /// The most points of a cluster.
    pub max_points: usize,
    /// The largest horizontal diagonal of a cluster's bounding box in metres; 20 by default, since an
    /// articulated bus is 18 m long and 2.55 m wide.
    pub max_size_m: f32,
    /// With a radius in metres, clusters are the connected components of points within it, for
    /// clouds without the structure of a scan: there is no range image and no ground, and any range
    /// is valid.
    pub radius_m: Option<f32>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            // VLP-32C User Manual 63-9325: the least range is 1 m.
            min_range_m: 1.0,
            // At 0.2 by 0.33 degrees, a car 100 m away returns some ten points.
            max_range_m: 100.0,
            // A VLP-32C at 600 rpm fires every 0.199 degrees, an HDL-64E every 0.17.
            column_width_deg: 0.2,
            // An HDL-64E's rings lie 0.33 to 0.5 degrees apart, most of a VLP-32C's 0.33.
            row_height_deg: 0.4,
            ring_elevations_deg: None,
            // Ramps of garages and bridges mostly stay below 8 degrees (14 %); a hill is a plane of
            // its own.
            max_ground_slope_deg: 8.0,
            // A kerb of 0.15 m and range noise.
            ground_clearance_m: 0.2,
            // Parked cars stand half a metre apart, persons less.
            reach_m: 0.25,
            // Windows of cars are 0.4 to 0.6 m high.
            bridge_m: 0.6,
            min_points: 10,
            max_points: usize::MAX,
            // An articulated bus is 18 m long and 2.55 m wide.
            max_size_m: 20.0,
            radius_m: None,
        }
    }
}

impl Settings {
    /// Connected components of points within `radius_m` of each other, of any size, for clouds that
    /// are not sweeps of a sensor.
    #[must_use]
    pub fn of_components(radius_m: f32) -> Self {
        Self { radius_m: Some(radius_m), max_size_m: f32::INFINITY, ..Self::default() }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn check(&self) -> Result<(), SettingsError> {
        let length = "a length of at least 0 m";
        let n_rings = self.ring_elevations_deg.as_ref().map_or(1, Vec::len);
        let numbers = [
            ("min_range_m", self.min_range_m, 0.0..=f32::MAX, length),
            ("ground_clearance_m", self.ground_clearance_m, 0.0..=f32::MAX, length),
            ("reach_m", self.reach_m, 0.0..=f32::MAX, length),
            ("bridge_m", self.bridge_m, 0.0..=f32::MAX, length),
            // Squares of farther ranges overflow.
            ("max_range_m", self.max_range_m, self.min_range_m..=1e15, "min_range_m to 1e15 m"),
            ("column_width_deg", self.column_width_deg, 0.05..=10.0, "0.05 to 10 degrees"),
            ("row_height_deg", self.row_height_deg, 0.1..=10.0, "0.1 to 10 degrees"),
            ("max_ground_slope_deg", self.max_ground_slope_deg, 0.0..=45.0, "0 to 45 degrees"),
            ("max_size_m", self.max_size_m, 0.0..=f32::INFINITY, "a length or infinity"),
            ("ring_elevations_deg", n_rings as f32, 1.0..=MOST_ROWS as f32, "1 to 2048 rings"),
            ("radius_m", self.radius_m.unwrap_or(1.0), 1e-15..=1e15, "1e-15 to 1e15 m"),
        ];
        let elevations = self.ring_elevations_deg.iter().flatten();
        let elevations = elevations
            .map(|&found| ("ring_elevations_deg", found, -90.0..=90.0, "-90 to 90 degrees"));
        let wrong =
            numbers.into_iter().chain(elevations).find(|(_, x, valid, _)| !valid.contains(x));
        wrong.map_or(Ok(()), |(name, found, _, expected)| {
            Err(SettingsError { name, expected, found: f64::from(found) })
        })
    }
}

/// An invalid setting.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("setting {name}: expected {expected}, found {found}")]
pub struct SettingsError {
    /// The field of [`Settings`].
    pub name: &'static str,
    /// The valid values.
    pub expected: &'static str,
    /// The value.
    pub found: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_settings_are_right() {
        assert_eq!(Settings::default().check(), Ok(()));
    }

    #[test]
    fn a_wrong_setting_is_named() {
        let wrong: [fn(&mut Settings); 8] = [
            |s| s.min_range_m = f32::NAN,
            |s| s.max_range_m = 0.5,
            |s| s.column_width_deg = 0.0,
            |s| s.reach_m = f32::INFINITY,
            |s| s.max_size_m = -1.0,
            |s| s.radius_m = Some(0.0),
            |s| s.ring_elevations_deg = Some(vec![]),
            |s| s.ring_elevations_deg = Some(vec![0.0, 91.0]),
        ];
        let names = [
            "min_range_m",
            "max_range_m",
            "column_width_deg",
            "reach_m",
            "max_size_m",
            "radius_m",
            "ring_elevations_deg",
            "ring_elevations_deg",
        ];
        for (change, name) in wrong.into_iter().zip(names) {
            let mut settings = Settings::default();
            change(&mut settings);
            assert_eq!(settings.check().unwrap_err().name, name);
        }
        let settings = Settings { reach_m: -1.0, ..Settings::default() };
        let error = settings.check().unwrap_err().to_string();
        assert_eq!(error, "setting reach_m: expected a length of at least 0 m, found -1");
    }
}
