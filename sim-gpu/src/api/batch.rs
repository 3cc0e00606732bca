//! Casts of a scene from many poses at once.

use super::{Error, InstanceId, Scene, Sensor};
use crate::config::InvalidValue;
use crate::pose::Pose;
use formats::scan::Attribute;
use formats::streams::Stream;
use rayon::prelude::*;

/// The object of a beam that returns nothing.
pub const NO_OBJECT: u32 = u32::MAX;

/// What moves from pose to pose in a [batch](Scene::cast).
#[derive(Clone, Copy, Debug, Default)]
pub struct Moves<'a> {
    /// The instances that move.
    pub instances: &'a [InstanceId],
    /// Their poses: those of all instances for the first pose of the sensor, and so on.
    pub poses: &'a [Pose],
}

/// The ranges of a batch, for each pose a row with a number for each beam of the sensor, in the order of
/// [`Sensor::directions`].
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Batch {
    /// Metres; infinite where no return comes back.
    pub range_m: Vec<f32>,
    /// The number of the instance; [`NO_OBJECT`] where no return comes back, or one from the air.
    pub object: Vec<u32>,
    /// The seed of each row.
    pub seeds: Vec<u64>,
}

impl Scene {
    /// The ranges that `sensor` measures at each of `poses`, on all threads of the CPU. Each pose sees a
    /// world of its own, in which the instances of `moves` stand elsewhere: nothing is rebuilt.
    ///
    /// A row has the ranges of [`Scene::scan`] at its pose and with its seed, to the bit. Of several
    /// returns of a beam it has the first. Rows, and batches of other seeds, have other noise.
    ///
    /// # Errors
    /// As [`ScanBuilder::run`](super::ScanBuilder::run); another number of poses in `moves` than poses
    /// times instances; an instance of another scene; more ranges than the memory holds.
    pub fn cast(&self, sensor: &Sensor, poses: &[Pose], moves: Moves<'_>) -> Result<Batch, Error> {
        self.check_moves(poses.len(), moves)?;
        let (n_beams, n_moved) = (sensor.directions().len(), moves.instances.len());
        let rows = 0..poses.len() as u32;
        let mut batch = Batch {
            range_m: filled(poses.len(), n_beams, f32::INFINITY)?,
            object: filled(poses.len(), n_beams, NO_OBJECT)?,
            seeds: rows.map(|row| Stream::BatchRow { row }.key(self.seed).seed()).collect(),
        };
        if n_beams == 0 {
            return Ok(batch);
        }
        let rows = batch.range_m.par_chunks_mut(n_beams).zip(batch.object.par_chunks_mut(n_beams));
        let rows = rows.zip(poses.par_iter().zip(&batch.seeds));
        rows.enumerate().try_for_each_init(
            || self.clone(),
            |world, (i, ((ranges_m, objects), (&pose, &seed)))| {
                let of_this = &moves.poses[i * n_moved..(i + 1) * n_moved];
                for (&instance, &pose) in moves.instances.iter().zip(of_this) {
                    world[instance].pose = pose;
                }
                let scan = world.scan(sensor, pose).seed(seed);
                let scan = scan.attributes([Attribute::Range, Attribute::Beam, Attribute::Object]);
                let found = scan.run()?.points;
                let column = "invariant: the scan was asked for it";
                let range_m = found.range_m.expect(column);
                let (beam, object) = (found.beam.expect(column), found.object.expect(column));
                for ((range_m, beam), object) in range_m.into_iter().zip(beam).zip(object) {
                    let beam = beam as usize;
                    if objects[beam] == NO_OBJECT && ranges_m[beam] == f32::INFINITY {
                        (ranges_m[beam], objects[beam]) = (range_m, object);
                    }
                }
                Ok::<(), Error>(())
            },
        )?;
        Ok(batch)
    }

    fn check_moves(&self, n_poses: usize, moves: Moves<'_>) -> Result<(), InvalidValue> {
        let n_instances = self.instances().len();
        if let Some(other) = moves.instances.iter().find(|id| id.number() as usize >= n_instances) {
            let cause = format!("expected one of {n_instances}, found {}", other.number());
            return Err(InvalidValue::new("moves.instances", cause));
        }
        let (expected, found) = (n_poses * moves.instances.len(), moves.poses.len());
        if expected != found {
            let n = moves.instances.len();
            let cause = format!("expected {n_poses} times {n} poses, {expected}, found {found}");
            return Err(InvalidValue::new("moves.poses", cause));
        }
        Ok(())
    }
}

/// A number for each beam of each pose, if the memory holds them.
fn filled<T: Copy>(n_poses: usize, n_beams: usize, value: T) -> Result<Vec<T>, InvalidValue> {
    let mut all = Vec::new();
    let n = n_poses.checked_mul(n_beams).filter(|_| u32::try_from(n_poses).is_ok());
    let Some(n) = n.filter(|n| all.try_reserve_exact(*n).is_ok()) else {
        let cause = format!("expected fewer: no memory for {n_poses} times {n_beams} ranges");
        return Err(InvalidValue::new("poses", cause));
    };
    all.resize(n, value);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mesh;
    use crate::effects::{Effects, Noise};
    use glam::DVec3;

    /// A wall 10 m ahead and a plate before it.
    fn world() -> (Scene, InstanceId) {
        let wall = vec![[10.0, -9.0, -9.0], [10.0, 9.0, -9.0], [10.0, 9.0, 9.0], [10.0, -9.0, 9.0]];
        let wall = Mesh::from_triangles(wall, vec![[0, 2, 1], [0, 3, 2]]).unwrap();
        let plate = vec![[0.0, -0.5, -0.5], [0.0, 0.5, -0.5], [0.0, 0.5, 0.5], [0.0, -0.5, 0.5]];
        let plate = Mesh::from_triangles(plate, vec![[0, 2, 1], [0, 3, 2]]).unwrap();
        let mut scene = Scene::new();
        scene.add(wall, Pose::IDENTITY);
        let moving = scene.add(plate, Pose::at([5.0, 0.0, 0.0]));
        (scene, moving)
    }

    /// The wall is at 10 m / cos, and a plate that stands at x = 2 + i, straight ahead, at that range.
    #[test]
    fn each_pose_has_a_world_of_its_own() {
        let (scene, moving) = world();
        let sensor = Sensor::named("vlp16").unwrap();
        let poses: Vec<Pose> = (0..5).map(|i| Pose::at([0.1 * f64::from(i), 0.0, 0.0])).collect();
        let of_each: Vec<Pose> = (0..5).map(|i| Pose::at([2.0 + f64::from(i), 0.0, 0.0])).collect();
        let moves = Moves { instances: &[moving], poses: &of_each };
        let batch = scene.cast(&sensor, &poses, moves).unwrap();
        let n = sensor.directions().len();
        assert_eq!((batch.range_m.len(), batch.object.len()), (5 * n, 5 * n));
        let mut n_plates = 0;
        for (i, pose) in poses.iter().enumerate() {
            for (beam, direction) in sensor.directions().iter().enumerate() {
                let found = (batch.range_m[i * n + beam], batch.object[i * n + beam]);
                let hits = |x: f64, half: f64| {
                    let range = (x - pose.position_m.x) / direction.x;
                    let at = *direction * range;
                    (direction.x > 0.0 && at.y.abs() <= half && at.z.abs() <= half).then_some(range)
                };
                let plate = hits(2.0 + i as f64, 0.5).map(|range| (range as f32, moving.number()));
                let wall = hits(10.0, 9.0).map(|range| (range as f32, 0));
                match plate.or(wall) {
                    Some((range_m, object)) => {
                        // Both are rounded to f32 once: one unit in the last place, at most 2^-23.
                        assert!(
                            (found.0 - range_m).abs() <= range_m * f32::EPSILON,
                            "{found:?} {range_m}"
                        );
                        assert_eq!(found.1, object);
                        n_plates += usize::from(object == moving.number());
                    }
                    None => assert_eq!(found, (f32::INFINITY, NO_OBJECT)),
                }
            }
        }
        assert!(n_plates > 500, "{n_plates}");
        // The scene itself has not changed.
        assert_eq!(scene[moving].pose.position_m, DVec3::new(5.0, 0.0, 0.0));
    }

    #[test]
    fn a_row_is_the_scan_at_its_pose_with_noise_too() {
        let (mut scene, _) = world();
        scene.effects = Effects { noise: Some(Noise::along_range(0.05)), ..Effects::default() };
        scene.seed = 7;
        let sensor = Sensor::named("vlp16").unwrap();
        let poses: Vec<Pose> = (0..3).map(|i| Pose::at([0.0, f64::from(i), 0.0])).collect();
        let batch = scene.cast(&sensor, &poses, Moves::default()).unwrap();
        let n = sensor.directions().len();
        for (i, &pose) in poses.iter().enumerate() {
            let alone = scene.scan(&sensor, pose).seed(batch.seeds[i]).run().unwrap().points;
            let mut expected = vec![f32::INFINITY; n];
            for (range_m, beam) in alone.range_m.unwrap().into_iter().zip(alone.beam.unwrap()) {
                expected[beam as usize] = range_m;
            }
            assert!(expected == batch.range_m[i * n..(i + 1) * n], "pose {i}");
        }
        // Neither rows nor batches of successive seeds share their noise.
        let mut seeds = batch.seeds.clone();
        for seed in 0..9 {
            scene.seed = seed;
            seeds.extend(scene.cast(&sensor, &poses, Moves::default()).unwrap().seeds);
        }
        seeds.sort_unstable();
        seeds.dedup();
        // The seed 7 is there twice.
        assert_eq!(seeds.len(), 9 * poses.len());
    }

    #[test]
    fn moves_that_do_not_fit_are_refused() {
        let (scene, moving) = world();
        let mut larger = scene.clone();
        let other = larger.add(scene[moving].mesh.clone(), Pose::IDENTITY);
        let sensor = Sensor::named("vlp16").unwrap();
        for (instances, n, expected) in [
            ([moving], 1, "moves.poses: expected 2 times 1 poses, 2, found 1"),
            ([other], 2, "moves.instances: expected one of 2, found 2"),
        ] {
            let poses = vec![Pose::IDENTITY; n];
            let moves = Moves { instances: &instances, poses: &poses };
            let error = scene.cast(&sensor, &[Pose::IDENTITY; 2], moves).unwrap_err().to_string();
            assert_eq!(error, expected);
        }
    }
}
