//! Sets and packed files without a point, and the likely reason.

use edgepuck_dataset::{Manifest, PackedRecord};
use sim_gpu::Tally;

/// Prints the sets without a point, with the likely reason. Returns whether every set has points.
pub fn report_empty_sets(manifest: &Manifest) -> bool {
    let mut all_have_points = true;
    for set in &manifest.config.sets {
        let scans = manifest.meshes.iter().flat_map(|mesh| &mesh.scans);
        let of_set = scans.filter(|scan| scan.set == set.name).flat_map(|scan| &scan.variants);
        let tally = of_set.fold(Tally::default(), |mut sum, scan| {
            sum += scan.tally;
            sum
        });
        if tally.points > 0 || manifest.meshes.is_empty() {
            continue;
        }
        all_have_points = false;
        let range = &set.sensor.profile().range;
        program::say!(
            "No scan of {} holds a point: {}. --distance, --normalize and --units change this.",
            set.name,
            reason(tally, [range.min_m, range.max_m])
        );
    }
    all_have_points
}

/// Why scans hold no point, from the sum of their counts and the least and greatest range of the sensor.
fn reason(tally: Tally, [least_m, most_m]: [f64; 2]) -> String {
    let outside = tally.out_of_range;
    match outside + tally.dropped + tally.undetected + tally.negative {
        0 => "no beam met a mesh".to_owned(),
        lost => format!(
            "of {lost} beams that met a mesh, {outside} did so outside the sensor's range of {least_m} to \
             {most_m} m"
        ),
    }
}

/// Prints the packed files from which all clouds are left out. Returns `false` if one of these is of a
/// set whose other part has no cloud either.
pub fn report_empty_packed(manifest: &Manifest) -> bool {
    let is_empty = |packed: &&PackedRecord| packed.clouds == 0 && !packed.left_out.is_empty();
    let empty: Vec<_> = manifest.packed.iter().filter(is_empty).collect();
    for PackedRecord { file, left_out, .. } in &empty {
        let most = left_out.iter().map(|scan| scan.points).max().unwrap_or_default();
        program::say!(
            "{file} holds no cloud: expected scans of {} points, found {most} at most. --min-points, \
             --distance, --normalize, --units and --sensor change this.",
            manifest.config.min_points
        );
    }
    let set = |packed: &PackedRecord| packed.file.rsplit_once('-').map(|(set, _)| set.to_owned());
    let has_clouds = |of: &&PackedRecord| {
        manifest.packed.iter().any(|other| set(other) == set(of) && other.clouds > 0)
    };
    empty.iter().all(has_clouds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_count_the_beams_that_met_a_mesh() {
        let tally = Tally { out_of_range: 5, dropped: 2, ..Tally::default() };
        let far = "of 7 beams that met a mesh, 5 did so outside the sensor's range of 1 to 200 m";
        assert_eq!(reason(tally, [1.0, 200.0]), far);
        assert_eq!(reason(Tally::default(), [1.0, 200.0]), "no beam met a mesh");
    }
}
