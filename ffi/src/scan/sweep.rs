use std::ffi::c_void;
use std::ptr::null;

use sim_gpu::columns::Scan;
use sim_gpu::columns::{Attribute, Column};
use sim_gpu::{Moves, NO_OBJECT};

use super::pose::EdgepuckPose;
use super::scene::{EdgepuckInstance, EdgepuckScene};
use super::sensor::EdgepuckSensor;
use crate::pointers;
use crate::status::{EdgepuckStatus, Failure, guard_status};

/// The caller's buffers for the points of a scan. What has a null buffer is not computed: set all to
/// null first, by EdgepuckPoints points = { 0 }.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EdgepuckPoints {
    /// The number of points for which each buffer has room.
    pub capacity: usize,
    /// Written: the number of points, also where they are too many for the buffers.
    pub n_points: usize,
    /// Written: what to add to each position, metres; 0 near the world's origin.
    pub origin_m: [f64; 3],
    /// Positions in the world less origin_m, metres, x y z after x y z.
    pub positions_m: *mut f32,
    /// Distances from the start of the beam, metres.
    pub range_m: *mut f32,
    /// Numbers of beams, in the order of edgepuck_sensor_beams.
    pub beam: *mut u32,
    /// Rings, counted from below.
    pub ring: *mut u16,
    /// Seconds since the revolution began.
    pub time_s: *mut f32,
    /// Numbers of the triangles, in the order of the mesh; UINT32_MAX in the air.
    pub triangle: *mut u32,
    /// Numbers of the instances; UINT32_MAX in the air.
    pub object: *mut u32,
    /// Labels of the instances; UINT32_MAX where there is none.
    pub label: *mut u32,
    /// Intensity, 0 to 1.
    pub intensity: *mut f32,
    /// Received power, relative to that of a white surface that faces the sensor 1 m away.
    pub power: *mut f32,
    /// Calibrated reflectivity: 0 to 100 are percent of a white surface, 101 to 255 retro-reflectors.
    pub reflectivity: *mut u8,
    /// The number of the return of its beam, from 1, the nearest.
    pub return_number: *mut u8,
    /// What reflected the beam: 0 a surface, 1 rain, 2 snow, 3 fog, 4 dust or spray.
    pub medium: *mut u8,
    /// Unit normals of the surfaces, towards the sensor, in the world; 0 in the air.
    pub normal: *mut f32,
}

/// What moves from pose to pose in edgepuck_scene_cast.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EdgepuckMoves {
    /// The instances that move.
    pub instances: *const EdgepuckInstance,
    /// The number of instances.
    pub n_instances: usize,
    /// Their poses: those of all instances for the first pose of the sensor, and so on.
    pub poses: *const EdgepuckPose,
    /// The number of poses: the instances times the poses of the sensor.
    pub n_poses: usize,
}

/// The caller's buffers for ranges: for each pose a row with a number for each beam, in the order of
/// edgepuck_sensor_beams. A null buffer is left out.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EdgepuckRanges {
    /// The number of ranges for which each buffer has room.
    pub capacity: usize,
    /// Metres; infinite where no return comes back. Of dual returns it is the strongest, or the second
    /// strongest if that is the last.
    pub range_m: *mut f32,
    /// The number of the instance; UINT32_MAX where no return comes back, or one from the air.
    pub object: *mut u32,
}

/// Scans the scene by a sensor at a pose: one revolution, or one image. Fills the buffers of points. If
/// they are too small, only points->n_points is written: make room, and scan again. A scan has at most
/// one point for each beam, two with the effect returns = "dual", and none for beams without a return.
///
/// The same scene, pose and seed give the same points. Scans of one seed have the same noise: give each
/// scan of a sequence a seed of its own.
///
/// # Safety
///
/// Each buffer of points is null, or has room for as many points as the capacity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_scene_scan(
    scene: Option<&EdgepuckScene>,
    sensor: Option<&EdgepuckSensor>,
    pose: Option<&EdgepuckPose>,
    seed: u64,
    points: Option<&mut EdgepuckPoints>,
) -> EdgepuckStatus {
    guard_status(|| {
        let (points, scene) = (pointers::need(points, "points")?, pointers::need(scene, "scene")?);
        let (sensor, pose) = (pointers::need(sensor, "sensor")?, pointers::need(pose, "pose")?);
        let scan = scene.scene.scan(&sensor.sensor, pose.read("pose")?).seed(seed);
        let label = (!points.label.is_null()).then_some(Attribute::Object);
        let attributes = points.asked().map(|(attribute, _)| attribute).chain(label);
        let scan = scan.attributes(attributes).run()?.points;
        points.n_points = scan.len();
        check_room("points", scan.len(), points.capacity)?;
        points.origin_m = scan.origin;
        // SAFETY: the buffers are null or have room for as many points as were checked.
        unsafe { points.fill(&scan, &scene.labels) }
    })
}

/// The ranges that a sensor measures at each of n_poses poses, on all cores. Each pose sees a world of
/// its own, in which the instances of moves stand elsewhere; null moves nothing. The scene itself does
/// not change, and nothing is rebuilt. Fills the buffers of ranges if it succeeds.
///
/// Rows, and casts of other seeds, have other noise. Without noise and other random effects, a row has
/// the ranges of edgepuck_scene_scan at its pose.
///
/// # Safety
///
/// poses is null or n_poses poses can be read there; as many instances and poses as moves says can be
/// read at its pointers; each buffer of ranges is null, or has room for as many numbers as the capacity.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_scene_cast(
    scene: Option<&EdgepuckScene>,
    sensor: Option<&EdgepuckSensor>,
    poses: *const EdgepuckPose,
    n_poses: usize,
    moves: Option<&EdgepuckMoves>,
    seed: u64,
    ranges: Option<&EdgepuckRanges>,
) -> EdgepuckStatus {
    guard_status(|| {
        let (scene, sensor) =
            (pointers::need(scene, "scene")?, &pointers::need(sensor, "sensor")?.sensor);
        let (ranges, moves) =
            (pointers::need(ranges, "ranges")?, moves.unwrap_or(&EdgepuckMoves::NONE));
        // SAFETY: the arrays are null or long enough, as required above.
        let (poses, instances, moved) = unsafe {
            let instances = pointers::slice(moves.instances, moves.n_instances, "moves.instances")?;
            let moved = pointers::slice(moves.poses, moves.n_poses, "moves.poses")?;
            (pointers::slice(poses, n_poses, "poses")?, instances, moved)
        };
        let n_ranges = poses.len().saturating_mul(sensor.directions().len());
        check_room("ranges", n_ranges, ranges.capacity)?;
        let instances = instances.iter().map(|instance| scene.find(*instance));
        let instances = instances.collect::<Result<Vec<_>, _>>()?;
        let poses = EdgepuckPose::read_all(poses, "poses")?;
        let moved = EdgepuckPose::read_all(moved, "moves.poses")?;
        let moves = Moves { instances: &instances, poses: &moved };
        let found = scene.scene.batch(sensor, &poses).moving(moves).seed(seed).run()?;
        // SAFETY: the buffers are null or have room for as many ranges as were checked.
        unsafe {
            pointers::write(&found.range_m, ranges.range_m, "range_m")?;
            pointers::write(&found.object, ranges.object, "object")
        }
    })
}

impl EdgepuckPoints {
    /// The attributes whose buffers are not null, with these.
    fn asked(&self) -> impl Iterator<Item = (Attribute, *mut c_void)> + use<> {
        let buffers = [
            (Attribute::Range, self.range_m.cast()),
            (Attribute::Beam, self.beam.cast()),
            (Attribute::Ring, self.ring.cast()),
            (Attribute::Time, self.time_s.cast()),
            (Attribute::Triangle, self.triangle.cast()),
            (Attribute::Object, self.object.cast()),
            (Attribute::Intensity, self.intensity.cast()),
            (Attribute::Power, self.power.cast()),
            (Attribute::Reflectivity, self.reflectivity.cast()),
            (Attribute::Return, self.return_number.cast()),
            (Attribute::Medium, self.medium.cast()),
            (Attribute::Normal, self.normal.cast()),
        ];
        buffers.into_iter().filter(|(_, buffer): &(_, *mut c_void)| !buffer.is_null())
    }

    /// Fills the buffers that are not null.
    ///
    /// # Safety
    /// They have room for the points of `scan`, and nobody else uses them now.
    unsafe fn fill(&self, scan: &Scan, labels: &[u32]) -> Result<(), Failure> {
        // SAFETY: the buffers have room, as required above.
        unsafe {
            pointers::write(&scan.positions, self.positions_m.cast(), "positions_m")?;
            for (attribute, out) in self.asked() {
                let name = attribute.name();
                match scan.column(attribute).expect("invariant: the scan was asked for it") {
                    Column::F32(values) => pointers::write(values, out.cast(), name)?,
                    Column::U8(values) => pointers::write(values, out.cast(), name)?,
                    Column::U16(values) => pointers::write(values, out.cast(), name)?,
                    Column::U32(values) => pointers::write(values, out.cast(), name)?,
                    Column::Vector(values) => pointers::write(values, out.cast(), name)?,
                }
            }
            if !self.label.is_null() {
                let label = |object: &u32| *labels.get(*object as usize).unwrap_or(&NO_OBJECT);
                let labels: Vec<u32> = scan.object.iter().flatten().map(label).collect();
                pointers::write(&labels, self.label, "label")?;
            }
        }
        Ok(())
    }
}

impl EdgepuckMoves {
    const NONE: Self = Self { instances: null(), n_instances: 0, poses: null(), n_poses: 0 };
}

/// Checks that buffers for `found` of `what` hold all.
fn check_room(what: &str, expected: usize, found: usize) -> Result<(), Failure> {
    if found >= expected {
        return Ok(());
    }
    let message = format!("expected buffers for {expected} {what}, found buffers for {found}");
    Err(Failure::new(EdgepuckStatus::BufferTooSmall, message))
}

/// Threads may share what they do not change.
const _: () = {
    const fn is_shared<T: Send + Sync>() {}
    is_shared::<(EdgepuckScene, EdgepuckSensor)>();
};
