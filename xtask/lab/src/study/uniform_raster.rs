//! What simulators without a table of beams cast in its place.

use anyhow::bail;
use sim_gpu::internals::sensor::{Layout, Rotating, SensorProfile, Uniform};

/// The same sensor with as many rows and columns, evenly spread between its
/// lowest and its highest beam and all around.
pub fn as_even_grid(sensor: SensorProfile) -> anyhow::Result<SensorProfile> {
    let Layout::Rotating(table) = &sensor.layout else {
        bail!("{}: has no table of beams", sensor.name);
    };
    let name = format!("{}-grid", sensor.name);
    let layout = Layout::Uniform(grid(table));
    Ok(SensorProfile { name, layout, ..sensor })
}

fn grid(table: &Rotating) -> Uniform {
    let elevations = || table.beam.iter().map(|beam| beam.elevation_deg);
    let rows = table.beam.len() as u32;
    let columns = (table.rays_per_revolution() / u64::from(rows)).max(1) as u32;
    let step_deg = 360.0 / f64::from(columns);
    Uniform {
        azimuth_from_deg: -180.0,
        // Both ends belong to the grid: the last column is not the first again.
        azimuth_to_deg: 180.0 - step_deg,
        azimuth_steps: columns,
        elevation_from_deg: elevations().fold(f64::INFINITY, f64::min),
        elevation_to_deg: elevations().fold(f64::NEG_INFINITY, f64::max),
        elevation_steps: rows,
        rpm: Some(table.rpm),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_spans_what_the_beams_do_with_as_many_rays() {
        let sensor = SensorProfile::builtin("vlp32c").unwrap();
        let Layout::Rotating(table) = &sensor.layout else { panic!("no table") };
        let rays = table.rays_per_revolution();
        let Layout::Uniform(grid) = as_even_grid(sensor.clone()).unwrap().layout else {
            panic!("no grid")
        };
        assert_eq!((grid.elevation_from_deg, grid.elevation_to_deg), (-25.0, 15.0));
        // The last firing sequence of a revolution is cut short.
        let of_grid = u64::from(grid.azimuth_steps) * u64::from(grid.elevation_steps);
        assert!(rays - of_grid < u64::from(grid.elevation_steps), "{rays}, {of_grid}");
    }
}
