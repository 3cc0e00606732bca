//! Whether points are those of one whole object.

use super::sweep::{coarser_than, is_lost, length};
use super::{Warning, bounds};

/// The largest distance from a line, as a share of its length, of points that are on it: f32 rounds
/// to 6e-8.
const ON_A_LINE: f64 = 1e-6;

/// How many times as large as the step between its coordinates an object is, at least.
const COARSEST: f32 = 200.0;

/// Clouds of fewer points are not searched for rings: a turn of a VLP-16 has 28,800 beams.
const FEWEST_OF_RINGS: usize = 4_000;
/// The fewest rings, of the 16 of the smallest sensors.
const FEWEST_RINGS: usize = 8;
/// The fewest sectors of 10 degrees that a sweep covers.
const FEWEST_SECTORS: u32 = 9;
/// How many times as far the farthest point of a ring is as its nearest one, at least.
const LEAST_SPREAD: f64 = 1.1;
/// Rings are 0.2 degrees or more apart, and wider by the noise of sensors than a bin.
const BINS_A_DEGREE: usize = 20;

/// What a cloud probably is instead of a whole object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unlike {
    /// The side of an object that faces a sensor.
    #[error(
        "is a scan of one side, and edge-64 learnt whole objects: its answer is often wrong; name a \
         model that learnt such scans: shapes-rotational-64 if it knows the class, street-128 for \
         clusters of streets, or one of `edgepuck train`"
    )]
    OneSide,
    /// A sweep of a sensor.
    #[error("looks like a sweep, and classifying names one object: detect finds those of a sweep")]
    Sweep,
}

/// Judges whether `points` can be those of one object, seen from `sensor` in any unit, and returns what
/// they probably are instead. Lost returns and points that are not finite do not count.
///
/// # Errors
/// Points that are all in one place or on one line, or coordinates that have lost their digits: numbers of 32
/// bits in a map's frame, say.
pub fn judge_object(points: &[[f64; 3]], sensor: [f64; 3]) -> Result<Option<Unlike>, String> {
    let counted = || {
        let is_known = |p: &&[f64; 3]| !is_lost(**p) && p.iter().all(|x| x.is_finite());
        let finite = points.iter().filter(is_known);
        finite.map(|point| [0, 1, 2].map(|i| point[i] - sensor[i]))
    };
    let (n, [low, high]) = (counted().count(), bounds(counted()));
    if n > 0 && low == high {
        let place = [0, 1, 2].map(|i| low[i] + sensor[i]);
        return Err(format!("expected points of an object, found {n} in one place, {place:?}"));
    }
    if n > 0 && are_on_a_line(counted()) {
        return Err(format!("expected points of an object, found {n} on one line"));
    }
    let size = length([0, 1, 2].map(|i| high[i] - low[i]));
    if let Some(coarse) = coarser_than(size as f32 / COARSEST, points.iter().copied()) {
        return Err(coarse.to_string());
    }
    let place = length([0, 1, 2].map(|i| (high[i] + low[i]) / 2.0));
    // Objects of streets in metres from the sensor; meshes are mostly nearer to their origin.
    if size < 30.0 && place > 3.0 * size && (2.0..200.0).contains(&place) {
        return Ok(Some(Unlike::OneSide));
    }
    // A sensor has most points near it; in objects, few are near the middle.
    let farthest = counted().map(length).fold(0.0, f64::max);
    let near = counted().filter(|point| length(*point) < 0.3 * farthest).count();
    let is_sweep = n >= 10_000 && 2 * near > n && (20.0..2e3).contains(&farthest);
    Ok((is_sweep || n >= FEWEST_OF_RINGS && are_in_rings(counted())).then_some(Unlike::Sweep))
}

/// Why the coordinates of an object's `points` have probably lost their digits, as those of a map's frame in
/// 32 bits.
#[must_use]
pub fn coarse_object(points: &[[f32; 3]]) -> Option<Warning> {
    let wide = points.iter().map(|point| point.map(f64::from));
    let [low, high] = bounds(wide.clone());
    let size = length([0, 1, 2].map(|i| high[i] - low[i])) as f32;
    (size > 0.0).then(|| coarser_than(size / COARSEST, wide)).flatten()
}

/// Whether all points lie on the line through the first point and the one farthest from it.
fn are_on_a_line(mut points: impl Iterator<Item = [f64; 3]> + Clone) -> bool {
    let Some(first) = points.next() else { return true };
    let from_first = points.map(|point| [0, 1, 2].map(|i| point[i] - first[i]));
    let longer = |a: [f64; 3], b: [f64; 3]| if length(b) > length(a) { b } else { a };
    let along = from_first.clone().fold([0.0; 3], longer);
    let most = ON_A_LINE * length(along).powi(2);
    from_first.fold(0.0, |off: f64, [x, y, z]| {
        let [u, v, w] = along;
        off.max(length([y * w - z * v, z * u - x * w, x * v - y * u]))
    }) <= most
}

/// Whether most points lie in rings about the origin, as the beams of a turning sensor do: their
/// elevations crowd in narrow peaks, in each of which ranges differ, and they are on several sides.
/// The surfaces of objects have elevations of all values; the vertices of one that was turned on a
/// lathe are in rings, each of which has one range.
fn are_in_rings(points: impl Iterator<Item = [f64; 3]>) -> bool {
    let n_bins = 180 * BINS_A_DEGREE;
    let (mut counts, mut sectors, mut n) = (vec![0u32; n_bins], 0u64, 0u32);
    let mut ranges = vec![[f64::INFINITY, 0.0]; n_bins];
    for [x, y, z] in points.filter(|point| length(*point) > 0.0) {
        let elevation_deg = libm::atan2(z, libm::hypot(x, y)).to_degrees() + 90.0;
        let bin = ((elevation_deg * BINS_A_DEGREE as f64) as usize).min(n_bins - 1);
        let (range, [nearest, farthest]) = (length([x, y, z]), ranges[bin]);
        ranges[bin] = [range.min(nearest), range.max(farthest)];
        counts[bin] += 1;
        sectors |= 1 << (((libm::atan2(y, x).to_degrees() + 180.0) / 10.0) as u32 % 36);
        n += 1;
    }
    let is_peak = |bin: &usize| {
        let around = &counts[bin.saturating_sub(10)..(bin + 11).min(counts.len())];
        let mean = around.iter().sum::<u32>() / around.len() as u32;
        let [nearest, farthest] = ranges[*bin];
        counts[*bin] >= 8 && counts[*bin] > 3 * mean && farthest > LEAST_SPREAD * nearest
    };
    let peaks: Vec<usize> = (0..counts.len()).filter(is_peak).collect();
    let in_peaks: u32 = peaks.iter().map(|bin| counts[*bin]).sum();
    sectors.count_ones() >= FEWEST_SECTORS && peaks.len() >= FEWEST_RINGS && 2 * in_peaks > n
}

#[cfg(test)]
mod tests {
    use super::{Unlike, judge_object};

    /// A room of 6 by 4 by 3 m, as 16 rings from -15 to 15 degrees find it from its middle, and the
    /// same walls with points that are evenly spread.
    #[test]
    fn a_sweep_of_a_room_is_known_by_its_rings() {
        let directions = (0..16).flat_map(|ring| (0..1800).map(move |turn| (ring, turn)));
        let room = directions.map(|(ring, turn)| {
            let (elevation, azimuth) = (f64::from(2 * ring - 15), f64::from(turn) * 0.2);
            let (elevation, azimuth) = (elevation.to_radians(), azimuth.to_radians());
            let (up, level) = elevation.sin_cos();
            let towards = [level * azimuth.cos(), level * azimuth.sin(), up];
            let to_wall = |axis: usize| [3.0, 2.0, 1.5][axis] / towards[axis].abs();
            let range = to_wall(0).min(to_wall(1)).min(to_wall(2));
            [0, 1, 2].map(|i| range * towards[i] + [5.0, 5.0, 1.5][i])
        });
        let room: Vec<_> = room.collect();
        assert_eq!(judge_object(&room, [5.0, 5.0, 1.5]), Ok(Some(Unlike::Sweep)));
        // A sector of 60 degrees may be a wall.
        let in_sector = (0..room.len()).filter(|i| i % 1800 < 300);
        let sector: Vec<_> = in_sector.map(|i| room[i]).collect();
        assert_eq!(judge_object(&sector, [5.0, 5.0, 1.5]), Ok(None));
        let walls =
            (0..120).flat_map(|step| (0..60).map(move |up| (f64::from(step), f64::from(up))));
        let walls = walls.flat_map(|(along, up)| {
            let (x, y, z) = (along / 20.0 - 3.0, along / 30.0 - 2.0, up / 20.0 - 1.5);
            [[x, 2.0, z], [x, -2.0, z], [3.0, y, z], [-3.0, y, z]]
        });
        assert_eq!(judge_object(&walls.collect::<Vec<_>>(), [0.0; 3]), Ok(None));
        let sphere = (1..64).flat_map(|ring| (0..64).map(move |turn| (ring, turn)));
        let sphere = sphere.map(|(ring, turn)| {
            let (sin, cos) = (f64::from(ring) * std::f64::consts::PI / 64.0).sin_cos();
            let azimuth = f64::from(turn) * std::f64::consts::TAU / 64.0;
            [sin * azimuth.cos(), sin * azimuth.sin(), cos]
        });
        assert_eq!(judge_object(&sphere.collect::<Vec<_>>(), [0.0; 3]), Ok(None));
    }

    #[test]
    fn sides_sweeps_and_lines_are_not_whole_objects() {
        let grid =
            |n: i32| (-n..=n).flat_map(move |x| (-n..=n).map(move |y| [x, y].map(f64::from)));
        // The floor around a sensor, denser near it.
        let bent = |x: f64| x * x.abs().powi(3) / 216_000.0;
        let floor = grid(60).map(|[x, y]| [bent(x), bent(y), -1.5]);
        for (points, expected) in [
            (vec![[1.0, 2.0, 3.0]], Err("found 1 in one place, [1.0, 2.0, 3.0]")),
            (vec![[4.0; 3], [4.0; 3], [f64::NAN; 3], [0.0; 3]], Err("found 2 in one place")),
            (vec![[0.0; 3]; 9], Ok(None)),
            (vec![], Ok(None)),
            (vec![[-0.5; 3], [0.5; 3]], Err("found 2 on one line")),
            (
                (1..9)
                    .map(|i| [0.1, 0.2, 0.3].map(|x| f64::from((x * f64::from(i)) as f32)))
                    .collect(),
                Err("found 8 on one line"),
            ),
            (vec![[0.1, 0.2, 0.3], [0.7, 0.9, -0.4], [1.3, 1.6, -1.1]], Err("found 3 on one line")),
            (
                vec![[8.5, -2.4, -1.6], [9.0, -1.3, 0.2], [8.7, -2.0, 1.0]],
                Ok(Some(Unlike::OneSide)),
            ),
            (vec![[-0.5; 3], [0.5; 3], [0.5, -0.5, 0.5]], Ok(None)),
            // A chair in UTM: numbers of 32 bits are half a metre apart there.
            (
                vec![
                    [456_789.0, 5_400_000.5, 0.0],
                    [456_790.0, 5_400_000.0, 0.5],
                    [456_789.5, 5_400_001.0, 1.0],
                ],
                Err("numbers of 32 bits, which are 0.5 m apart at 5400001 m"),
            ),
            (
                vec![
                    [456_789.1, 5_400_000.7, 0.0],
                    [456_790.0, 5_400_000.2, 0.5],
                    [456_789.3, 5_400_001.0, 1.0],
                ],
                Ok(None),
            ),
            (floor.collect(), Ok(Some(Unlike::Sweep))),
            (grid(60).map(|[x, y]| [x, y, 0.0]).collect(), Ok(None)),
        ] {
            match (judge_object(&points, [0.0; 3]), expected) {
                (Err(found), Err(expected)) => assert!(found.contains(expected), "{found}"),
                (found, expected) => assert_eq!(found, expected.map_err(str::to_owned)),
            }
        }
    }
}
