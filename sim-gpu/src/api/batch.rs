//! Casts of a scene from many poses at once.

use super::scan_builder::{Prepared, check_pose};
use super::{Caster, Error, InstanceId, ScanBuilder, Scene, Sensor};
use crate::caster::{Casting, OpenCaster};
use crate::config::InvalidValue;
use crate::effects::{Effects, ReturnMode};
use crate::job::CastJob;
use crate::pose::Pose;
use crate::scan::{BeamReturn, PlacedTarget, aim_all, cast_returns, resolve_returns};
use formats::scan::Attribute;
use formats::streams::Stream;
use rayon::prelude::*;

/// The object of a beam that returns nothing.
pub const NO_OBJECT: u32 = u32::MAX;

/// The rays of the rows that an adapter casts together: it has the next of them while their ranges are
/// computed.
const RAYS_AT_ONCE: usize = if cfg!(test) { 1 << 17 } else { 1 << 22 };

/// What moves from pose to pose in a [batch](Scene::batch).
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
    /// Metres; infinite where no return comes back. With dual returns: the strongest, or the second
    /// strongest if the strongest is also the last.
    pub range_m: Vec<f32>,
    /// The number of the instance; [`NO_OBJECT`] where no return comes back, or one from the air.
    pub object: Vec<u32>,
    /// The range of the last return, metres, if the effects ask for dual returns, and infinite where it
    /// is the only one; else empty.
    pub second_range_m: Vec<f32>,
    /// The intensity of the first return, 0 without one, if it was asked for; else empty.
    pub intensity: Vec<f32>,
    /// The received power of the first return, 0 without one, if it was asked for; else empty.
    pub power: Vec<f32>,
    /// The seed of each row.
    pub seeds: Vec<u64>,
}

/// A batch that [`BatchBuilder::run`] makes. Settings that are not given come from the [`Scene`].
#[derive(Clone, Debug)]
#[must_use = "`run` makes the batch"]
pub struct BatchBuilder<'a> {
    scan: ScanBuilder<'a>,
    poses: &'a [Pose],
    moves: Moves<'a>,
    seed: u64,
}

impl Scene {
    /// The ranges that `sensor` measures at each of `poses`, on all threads of the CPU: a
    /// [batch](Scene::batch) in which the instances of `moves` stand elsewhere.
    ///
    /// # Errors
    /// As [`BatchBuilder::run`].
    pub fn cast(&self, sensor: &Sensor, poses: &[Pose], moves: Moves<'_>) -> Result<Batch, Error> {
        self.batch(sensor, poses).moving(moves).run()
    }

    /// The ranges that `sensor` measures at each of `poses`, which [`BatchBuilder::run`] casts.
    ///
    /// A row has the ranges of [`Scene::scan`] at its pose and with its seed, to the bit, whatever casts
    /// it. Rows, and batches of other seeds, have other noise.
    pub fn batch<'a>(&'a self, sensor: &'a Sensor, poses: &'a [Pose]) -> BatchBuilder<'a> {
        let scan = self.scan(sensor, Pose::IDENTITY).attributes([]);
        BatchBuilder { scan, poses, moves: Moves::default(), seed: self.seed }
    }
}

impl<'a> BatchBuilder<'a> {
    /// Each pose sees a world of its own, in which these instances stand elsewhere: nothing is rebuilt,
    /// and the scene does not change.
    pub fn moving(self, moves: Moves<'a>) -> Self {
        Self { moves, ..self }
    }

    /// Casts on `caster`; by default the CPU casts.
    pub fn with(self, caster: &'a Caster) -> Self {
        Self { scan: self.scan.with(caster), ..self }
    }

    /// Applies these effects in place of the scene's.
    pub fn effects(self, effects: Effects) -> Self {
        Self { scan: self.scan.effects(effects), ..self }
    }

    /// Gives the batch [`Attribute::Intensity`] or [`Attribute::Power`], besides ranges and objects.
    pub fn attributes(self, attributes: impl IntoIterator<Item = Attribute>) -> Self {
        Self { scan: self.scan.attributes(attributes), ..self }
    }

    /// Draws the seeds of its rows from this seed: give each step of a loop its own.
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Begins the scan of each row at this time of all trajectories, seconds; 0 by default.
    pub fn start_s(self, start_s: f64) -> Self {
        Self { scan: self.scan.start_s(start_s), ..self }
    }

    /// Casts the batch.
    ///
    /// # Errors
    /// As [`ScanBuilder::run`]; a pose whose rotation is not valid; another number of poses in `moves` than poses
    /// times instances; an instance that the scene does not have; another attribute than intensity and
    /// power; more ranges than the memory holds.
    pub fn run(self) -> Result<Batch, Error> {
        self.check()?;
        let prepared = self.scan.prepare()?;
        let mut batch = self.empty()?;
        let Batch { range_m, object, second_range_m, intensity, power, seeds } = &mut batch;
        let n_beams = self.scan.sensor.directions().len().max(1);
        let mut columns = [second_range_m, intensity, power].map(|all| all.chunks_mut(n_beams));
        let rows = range_m.chunks_mut(n_beams).zip(object.chunks_mut(n_beams));
        let rows = rows.zip(seeds.iter().zip(self.poses)).enumerate();
        let rows = rows.map(|(number, ((range_m, object), (&seed, &pose)))| {
            let scan = self.scan.clone().at(pose).seed(seed);
            let of_row = columns.each_mut().map(|column| column.next().unwrap_or_default());
            let [second_range_m, intensity, power] = of_row;
            let columns = Columns { range_m, object, second_range_m, intensity, power };
            Row { number, scan, columns }
        });
        self.cast(rows.collect(), &prepared)?;
        Ok(batch)
    }

    fn cast(&self, mut rows: Vec<Row<'_, 'a>>, prepared: &Prepared) -> Result<(), Error> {
        let Prepared { caster, rays, .. } = prepared;
        let fits = self.scan.scene.instances().iter().all(|i| caster.fits(i.mesh.target()));
        if matches!(**caster, OpenCaster::Cpu(_)) || !fits {
            return rows.par_iter_mut().try_for_each(|Row { number, scan, columns }| {
                let (placed, request) = (self.placed(*number, scan), scan.request(rays));
                let add = |found| columns.add(&found);
                Ok(cast_returns(caster.effects(), &placed, &request, add)?)
            });
        }
        let n_jobs = self.scan.scene.instances().len();
        let n_rows = (RAYS_AT_ONCE / (rays.len() * n_jobs).max(1)).max(1);
        let mut before: Option<(&mut [Row<'_, 'a>], Vec<CastJob>, Casting)> = None;
        for rows in rows.chunks_mut(n_rows) {
            let aimed = rows.par_iter().map(|Row { number, scan, .. }| {
                aim_all(&self.placed(*number, scan), &scan.request(rays), caster.effects())
            });
            let jobs: Vec<CastJob> = aimed.collect::<Vec<_>>().into_iter().flatten().collect();
            let casting = caster.submit(&jobs)?;
            if let Some(before) = before.replace((rows, jobs, casting)) {
                self.finish(before, prepared)?;
            }
        }
        before.map_or(Ok(()), |last| self.finish(last, prepared))
    }

    /// Fills the rows that an adapter has cast.
    fn finish(
        &self,
        (rows, jobs, casting): (&mut [Row<'_, 'a>], Vec<CastJob>, Casting),
        Prepared { caster, rays, .. }: &Prepared,
    ) -> Result<(), Error> {
        let casts = casting.wait()?;
        let n = self.scan.scene.instances().len();
        if n == 0 {
            return Ok(());
        }
        let cast = jobs.par_chunks(n).zip(casts.par_chunks(n));
        rows.par_iter_mut().zip(cast).try_for_each(|(Row { number, scan, columns }, cast)| {
            let (placed, request) = (self.placed(*number, scan), scan.request(rays));
            let add = |found| columns.add(&found);
            Ok(resolve_returns(caster.effects(), &placed, &request, cast, add)?)
        })
    }

    /// The instances in the world of row `number`, which is scanned as `scan` says.
    fn placed(&self, number: usize, scan: &ScanBuilder<'a>) -> Vec<PlacedTarget<'a>> {
        let Moves { instances, poses } = self.moves;
        let of_row = &poses[number * instances.len()..][..instances.len()];
        let mut moved = vec![None; self.scan.scene.instances().len()];
        // The last of an instance that is named twice.
        for (id, pose) in instances.iter().zip(of_row) {
            moved[id.number() as usize] = Some(*pose);
        }
        scan.placed(|number| moved[number as usize])
    }

    fn check(&self) -> Result<(), InvalidValue> {
        let Moves { instances, poses } = self.moves;
        let n_instances = self.scan.scene.instances().len();
        if let Some(other) = instances.iter().find(|id| id.number() as usize >= n_instances) {
            let cause = format!("expected one of {n_instances}, found {}", other.number());
            return Err(InvalidValue::new("moves.instances", cause));
        }
        let (n_poses, n) = (self.poses.len(), instances.len());
        if n_poses * n != poses.len() {
            let (expected, found) = (n_poses * n, poses.len());
            let cause = format!("expected {n_poses} times {n} poses, {expected}, found {found}");
            return Err(InvalidValue::new("moves.poses", cause));
        }
        for (name, poses) in [("poses", self.poses), ("moves.poses", poses)] {
            let mut numbered = poses.iter().enumerate();
            numbered.try_for_each(|(i, &pose)| check_pose(|| format!("{name}[{i}]"), pose))?;
        }
        let is_known =
            |wanted: &&Attribute| matches!(wanted, Attribute::Intensity | Attribute::Power);
        match self.scan.attributes.iter().find(|wanted| !is_known(wanted)) {
            Some(other) => {
                let cause = format!("expected intensity or power, found {other}");
                Err(InvalidValue::new("attributes", cause))
            }
            None => Ok(()),
        }
    }

    /// The batch without any return.
    fn empty(&self) -> Result<Batch, InvalidValue> {
        let (n_poses, n_beams) = (self.poses.len(), self.scan.sensor.directions().len());
        let column = |is_wanted: bool, nothing: f32| {
            filled(if is_wanted { n_poses } else { 0 }, n_beams, nothing)
        };
        let asks_for = |wanted| self.scan.attributes.contains(&wanted);
        let is_dual = self.scan.effects.returns == Some(ReturnMode::Dual);
        let seed = |row| Stream::BatchRow { row }.key(self.seed).seed();
        Ok(Batch {
            range_m: column(true, f32::INFINITY)?,
            object: filled(n_poses, n_beams, NO_OBJECT)?,
            second_range_m: column(is_dual, f32::INFINITY)?,
            intensity: column(asks_for(Attribute::Intensity), 0.0)?,
            power: column(asks_for(Attribute::Power), 0.0)?,
            seeds: (0..n_poses as u32).map(seed).collect(),
        })
    }
}

/// A row on its way into a [`Batch`].
struct Row<'r, 'a> {
    number: usize,
    scan: ScanBuilder<'a>,
    columns: Columns<'r>,
}

/// The columns of a row; those that were not asked for are empty.
struct Columns<'r> {
    range_m: &'r mut [f32],
    object: &'r mut [u32],
    second_range_m: &'r mut [f32],
    intensity: &'r mut [f32],
    power: &'r mut [f32],
}

impl Columns<'_> {
    fn add(&mut self, found: &BeamReturn) {
        let beam = found.beam as usize;
        if found.is_second {
            self.second_range_m[beam] = found.range_m;
            return;
        }
        (self.range_m[beam], self.object[beam]) = (found.range_m, found.object);
        for (column, value) in
            [(&mut *self.intensity, found.intensity), (&mut *self.power, found.power)]
        {
            if let Some(here) = column.get_mut(beam) {
                *here = value;
            }
        }
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
    use crate::effects::{EvenMotion, Footprint, Noise};
    use glam::{DQuat, DVec3};

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

    /// Whatever a scan models, a batch models it to the bit: each row beside the scan at its pose.
    #[test]
    fn a_row_has_the_returns_intensities_and_powers_of_its_scan() {
        let (scene, moving) = world();
        let sensor = Sensor::named("vlp16").unwrap();
        let n = sensor.directions().len();
        let poses: Vec<Pose> = (0..3).map(|i| Pose::at([0.3 * f64::from(i), 0.2, 0.1])).collect();
        let of_each: Vec<Pose> = (0..3).map(|i| Pose::at([6.0, 0.1 * f64::from(i), 0.0])).collect();
        let moves = Moves { instances: &[moving], poses: &of_each };
        let wide =
            Footprint { samples: 7, divergence_deg: Some([1.0; 2]), separation_m: Some(0.5) };
        let motion = EvenMotion { velocity_m_s: [20.0, 0.0, 0.0], yaw_rate_deg_s: 90.0 };
        let effects = Effects {
            noise: Some(Noise::along_range(0.02)),
            footprint: Some(wide),
            returns: Some(ReturnMode::Dual),
            motion: Some(Box::new(motion)),
            ..Effects::default()
        };
        let attributes = [Attribute::Intensity, Attribute::Power];
        let batch = scene.batch(&sensor, &poses).moving(moves).effects(effects.clone());
        let batch = batch.attributes(attributes).seed(3).start_s(0.5).run().unwrap();
        let (mut n_seconds, mut world) = (0, scene.clone());
        for (row, (&pose, &of_row)) in poses.iter().zip(&of_each).enumerate() {
            world[moving].pose = of_row;
            let wanted = attributes.into_iter().chain([Attribute::Range, Attribute::Beam]);
            let scan = world.scan(&sensor, pose).effects(effects.clone()).attributes(wanted);
            let points = scan.seed(batch.seeds[row]).start_s(0.5).run().unwrap().points;
            let [range_m, intensity, power] =
                [&points.range_m, &points.intensity, &points.power].map(|column| column.as_ref());
            let mut expected = vec![(f32::INFINITY, f32::INFINITY, 0.0, 0.0); n];
            let beams = points.beam.as_ref().unwrap();
            for (i, &beam) in beams.iter().enumerate() {
                let (range_m, here) = (range_m.unwrap()[i], &mut expected[beam as usize]);
                // Of two returns, which are next to each other, the last is the farther one.
                if i > 0 && beams[i - 1] == beam {
                    (here.1, n_seconds) = (range_m, n_seconds + 1);
                } else {
                    *here = (range_m, here.1, intensity.unwrap()[i], power.unwrap()[i]);
                }
            }
            for (beam, expected) in (row * n..).zip(expected) {
                let first = (batch.range_m[beam], batch.second_range_m[beam]);
                assert_eq!((first.0, first.1, batch.intensity[beam], batch.power[beam]), expected);
            }
        }
        assert!(n_seconds > 10, "{n_seconds}");
    }

    /// Ranges are computed in f64 whatever finds the triangles.
    #[cfg(feature = "gpu")]
    #[test]
    fn an_adapter_casts_the_same_batch_and_keeps_its_trees() {
        let adapters = crate::gpu::list_adapters().into_iter().next();
        let adapter = test_support::need!(test_support::adapter(adapters));
        let caster = Caster::named(&adapter.name).unwrap();
        let (scene, moving) = world();
        let sensor = Sensor::named("vlp16").unwrap();
        // More rays than are cast at once.
        let n_poses = RAYS_AT_ONCE as u32 / sensor.directions().len() as u32 + 3;
        let place = |i: u32| Pose::at([0.01 * f64::from(i % 90), 0.0, 0.0]);
        let poses: Vec<Pose> = (0..n_poses).map(place).collect();
        for x in [3.0, 4.0] {
            let of_each: Vec<Pose> = poses.iter().map(|_| Pose::at([x, 0.3, 0.0])).collect();
            let moves = Moves { instances: &[moving], poses: &of_each };
            let batch = scene.batch(&sensor, &poses).moving(moves);
            let by_adapter = batch.clone().with(&caster).run().unwrap();
            assert!(by_adapter == batch.run().unwrap());
            assert!(by_adapter.object.contains(&moving.number()));
        }
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
        let askew = Pose { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), ..Pose::IDENTITY };
        let poses = [Pose::IDENTITY, askew];
        let batch = scene.batch(&sensor, &poses);
        let expected = "poses[1]: expected a rotation of length 1, found length 2";
        assert_eq!(batch.run().unwrap_err().to_string(), expected);
        let expected = "attributes: expected intensity or power, found ring";
        let batch = scene.batch(&sensor, &poses[..1]).attributes([Attribute::Ring]);
        assert_eq!(batch.run().unwrap_err().to_string(), expected);
    }
}
