//! A drive through a street with a rotating sensor, as packets.
//!
//! Each beam is cast from the pose that the sensor has when the beam fires, at the objects where
//! they are at that time.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use edgepuck_shapes::Sampler;
use formats::Scan;
use formats::scan::Attribute;
use formats::streams::Stream;
use formats::vlp32c::{AZIMUTH_UNIT_DEG, Returns, Revolution, SEQUENCES_PER_PACKET, START_S};
use glam::DVec3;
use rayon::prelude::*;
use sim_gpu::errors::InvalidValue;
use sim_gpu::internals::scan::{ScanRequest, scan_objects};
use sim_gpu::packets;
use sim_gpu::sensors::{BeamPattern, Layout, Rotating, SensorProfile};
use sim_gpu::{Pose, Scene, Trajectory};

use crate::error::SceneError;
use crate::ground::{Ground, OWN_RADIUS_M};
use crate::scene::draw_mount;
use crate::sector::Sector;
use crate::stage::Stage;
use crate::street::{Street, StreetObject};
use crate::sway::Sway;

/// The sensor's distance from the kerb where the road is wide enough, metres: parked cars stand
/// there and open their doors.
const FROM_KERB_M: f64 = 2.3;

/// The number that [`Packet::scan`] has for objects in the air, such as raindrops.
pub const AIR: u32 = u32::MAX;

/// A sensor that drives along a street.
///
/// ```
/// # fn drive(stage: &edgepuck_scenes::Stage) -> Result<(), edgepuck_scenes::SceneError> {
/// let mut drive = edgepuck_scenes::Drive::new(stage, 5.0)?;
/// for packet in drive.fire(0..150)? {
///     println!("{} points", packet.scan.len());
/// }
/// # Ok(())
/// # }
/// ```
pub struct Drive<'a> {
    pub(crate) street: Street<'a>,
    sensor: SensorProfile,
    /// The pose of the sensor at time 0.
    start: Pose,
    velocity_m_s: DVec3,
    sway: Sway,
    glass_returned: f64,
}

/// The points of one packet.
#[derive(Clone, Debug)]
pub struct Packet {
    /// Beams, ranges, intensities and objects in the order of firing, with positions in the world.
    /// Object 0 is the ground, object `i` is [`Drive::object`] `i`, and [`AIR`] is the air.
    pub scan: Scan,
    pub(crate) points: ObjectPoints,
}

/// The points on objects, by (revolution, object).
pub(crate) type ObjectPoints = BTreeMap<(u32, u32), PointSum>;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PointSum {
    pub(crate) count: u32,
    /// The sum of their times since the start of the drive.
    pub(crate) time_s: f64,
}

impl<'a> Drive<'a> {
    /// Starts a drive at the origin, along x at `speed_m_s`, with the first sensor of `stage`.
    ///
    /// # Errors
    /// The sensor has no head that turns and fires whole sequences, or its effects move it.
    pub fn new(stage: &'a Stage, speed_m_s: f64) -> Result<Self, SceneError> {
        let profile = stage.sensors[0].sensor.profile();
        check_head(profile)?;
        // Packets round azimuths, which only a VLP-32C's are written with.
        let sensor = packets::with_packet_geometry(profile).unwrap_or_else(|_| profile.clone());
        if stage.sensors[0].caster.effects().motion.is_some() {
            let cause = "expected no motion, because a drive moves the sensor itself";
            return Err(InvalidValue::new("effects.motion", cause).into());
        }
        let (recipe, seed) = (stage.recipe(), stage.seed());
        let s = &mut Sampler::new(Stream::Drive {}.key(seed));
        let start = draw_mount(stage, s);
        let glass_returned = recipe.glass_returned.at(s.uniform(0.0, 1.0));
        let off_road_m = recipe.mount.off_road_m.at(s.uniform(0.0, 1.0));
        let stream = Stream::DriveGround {}.key(seed);
        let mut ground = Ground::draw(&recipe.ground, 0.0, s, stream);
        // Traffic along x keeps to the right.
        let most_m = ground.road_half_m - FROM_KERB_M - OWN_RADIUS_M;
        ground.road_y_m = off_road_m.min(most_m).max(0.0);
        let velocity_m_s = ground.along(speed_m_s);
        let street = Street::new(stage, ground, s);
        let sway = Sway::draw(recipe.mount.sway_deg, speed_m_s, seed);
        Ok(Self { street, sensor, start, velocity_m_s, sway, glass_returned })
    }

    /// The rotation of the sensor's head and the returns of each beam, as packets hold them.
    ///
    /// # Errors
    /// The sensor is not a VLP-32C, or it has effects that its packets cannot represent.
    pub fn in_packets(&self) -> Result<(Revolution, Returns), SceneError> {
        let effects = self.street.stage.sensors[0].caster.effects();
        Ok((packets::revolution(&self.sensor)?, packets::returns(effects, None)?))
    }

    /// The start of the drive in Unix time, a whole hour: another for each seed, so that the poses of one
    /// drive do not fit another.
    #[must_use]
    pub fn start_s(&self) -> u32 {
        /// Hours up to the year 2099.
        const MOST: u64 = 870_000;
        START_S + 3600 * (self.street.stage.seed() % MOST) as u32
    }

    /// The time between two turns of the head, seconds.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.head().period_s()
    }

    /// The time between two packets, seconds.
    #[must_use]
    pub fn packet_s(&self) -> f64 {
        f64::from(SEQUENCES_PER_PACKET) * self.head().sequence_us * 1e-6
    }

    /// The number of times that the encoder had passed 0 when this `beam` of this packet fired.
    #[must_use]
    pub fn turn(&self, packet: u32, beam: u32) -> u32 {
        let sequence = packet * SEQUENCES_PER_PACKET + beam / self.head().beam.len() as u32;
        let turned = f64::from(sequence) * self.head().sequence_us * 1e-6 * self.head().rpm / 60.0;
        let units_per_turn = 360.0 / AZIMUTH_UNIT_DEG;
        ((turned * units_per_turn).round() / units_per_turn) as u32
    }

    /// The pose of the sensor `time_s` after the start.
    #[must_use]
    pub fn pose(&self, time_s: f64) -> Pose {
        let position_m = self.start.position_m + self.velocity_m_s * time_s;
        let rotation = self.start.rotation * self.sway.at(time_s);
        Pose { position_m, rotation }
    }

    /// The object with this number in scans and sightings; `None` for 0, the ground.
    #[must_use]
    pub fn object(&self, number: u32) -> Option<&StreetObject> {
        self.street.objects.get((number as usize).checked_sub(1)?)
    }

    /// Fires the packets with these consecutive `numbers`, which should span less than a second.
    ///
    /// # Errors
    /// The caster fails.
    pub fn fire(&mut self, numbers: Range<u32>) -> Result<Vec<Packet>, SceneError> {
        let sequence_us = self.head().sequence_us;
        let [from_s, to_s] = [numbers.start, numbers.end]
            .map(|number| f64::from(number * SEQUENCES_PER_PACKET) * sequence_us * 1e-6);
        let place = |time_s| (self.pose(time_s).position_m.x, time_s);
        self.street.draw_around([place(from_s), place(to_s)]);
        let this = &*self;
        let near = this.near(from_s, to_s);
        numbers.into_par_iter().map(|number| this.packet(number, &near)).collect()
    }

    /// The objects that may come into sight between two times, with their numbers.
    fn near(&self, from_s: f64, to_s: f64) -> Vec<(u32, &StreetObject)> {
        let middle_s = (from_s + to_s) / 2.0;
        let position_m = self.pose(middle_s).position_m;
        let is_near = |(_, object): &(u32, &StreetObject)| {
            let speed_m_s = (object.velocity_m_s - self.velocity_m_s).length();
            let approach_m = speed_m_s * (to_s - from_s) / 2.0;
            object.centre_m(middle_s).distance(position_m) <= self.sight_m() + approach_m
        };
        (1..).zip(&self.street.objects).filter(is_near).collect()
    }

    /// The distance beyond which objects are not cast, metres.
    fn sight_m(&self) -> f64 {
        self.street.ground.half_m
    }

    fn packet(&self, number: u32, near: &[(u32, &StreetObject)]) -> Result<Packet, SceneError> {
        let Street { stage, tiles, .. } = &self.street;
        let first = number * SEQUENCES_PER_PACKET;
        let caster = &stage.sensors[0].caster;
        let pattern = self.head().pattern_of(first..first + SEQUENCES_PER_PACKET);
        let pattern = caster.effects().widen(pattern, &self.sensor)?;
        let [from_s, to_s] = [pattern.time_s[0], pattern.time_s[pattern.len() - 1]];
        let time_s = (from_s + to_s) / 2.0;
        let pose = self.pose(time_s);
        let turned_rad =
            [from_s, to_s].map(|end_s| pose.rotation.angle_between(self.pose(end_s).rotation));
        let turned_rad = turned_rad[0].max(turned_rad[1]);
        let sector = Sector::of_beams(&pattern);
        let sensor_from_world = pose.rotation.inverse();
        let in_sight = near.iter().filter(|(_, object)| {
            let from_sensor = object.centre_m(time_s) - pose.position_m;
            // The greatest shift of the object in the sensor's frame between the middle and an end
            // of the packet: by the relative velocity, and by the rotation of that frame.
            let speed_m_s = (object.velocity_m_s - self.velocity_m_s).length();
            let moves_m = speed_m_s * (to_s - time_s) + turned_rad * from_sensor.length();
            from_sensor.length() <= self.sight_m()
                && sector.meets(sensor_from_world * from_sensor, object.radius_m() + moves_m)
        });
        let (numbers, objects): (Vec<u32>, Vec<&StreetObject>) = in_sight.copied().unzip();
        let mut world = Scene::new();
        for (_, tile) in tiles.range(self.street.tiles_in_sight(pose.position_m.x)) {
            stage.add_ground(&mut world, tile, 0);
        }
        let n_tiles = world.instances().len();
        for object in &objects {
            let id = stage.add_object(&mut world, &object.placed, self.glass_returned);
            world[id].motion = trajectory(
                [from_s, to_s].map(|time_s| (time_s, Pose::at(object.velocity_m_s * time_s))),
            );
        }

        let mut request = ScanRequest::new(&self.sensor, &pattern, pose);
        request.motion = trajectory([from_s, to_s].map(|time_s| (time_s, self.pose(time_s))));
        request.deskew = true;
        request.attributes =
            [Attribute::Beam, Attribute::Range, Attribute::Intensity, Attribute::Object].into();
        request.stream = Stream::DriveBeams { packet: number }.key(stage.seed());
        let placed = world.placed(|_, _| None);
        let mut scan = scan_objects(caster, &placed, &request)?.scan;
        for object in scan.object.iter_mut().flatten() {
            // Tiles of the ground come first; points in the air belong to no target.
            *object = match (*object as usize).checked_sub(n_tiles) {
                None => 0,
                Some(in_sight) => numbers.get(in_sight).map_or(AIR, |number| *number),
            };
        }
        let points = self.points_on_objects(number, &pattern, &scan);
        Ok(Packet { scan, points })
    }

    fn head(&self) -> &Rotating {
        match &self.sensor.layout {
            Layout::Rotating(head) => head,
            _ => unreachable!("invariant: `Drive::new` has checked the head"),
        }
    }

    /// The points of `scan`, that of packet `number`, on objects.
    fn points_on_objects(&self, number: u32, pattern: &BeamPattern, scan: &Scan) -> ObjectPoints {
        let mut points = ObjectPoints::new();
        let beams = scan.beam.iter().flatten();
        for (&beam, &object) in beams.zip(scan.object.iter().flatten()) {
            if self.object(object).is_some() {
                let turn = self.turn(number, beam);
                let sum = points.entry((turn, object)).or_default();
                sum.count += 1;
                sum.time_s += pattern.time_s[(beam * pattern.rays_per_beam) as usize];
            }
        }
        points
    }
}

/// Checks that all beams of the sensor fire in sequences, of which a packet is half a turn at most.
fn check_head(sensor: &SensorProfile) -> Result<(), InvalidValue> {
    let Layout::Rotating(head) = &sensor.layout else {
        let cause = "expected a head that turns, which a drive needs, found another layout";
        return Err(InvalidValue::new("rotating", cause));
    };
    if sensor.decimation.get() != 1 {
        let cause = "expected none in a drive, which fires all beams";
        return Err(InvalidValue::new("decimation", cause));
    }
    let per_turn = head.period_s() * 1e6 / head.sequence_us;
    let least = 2 * SEQUENCES_PER_PACKET;
    if per_turn < f64::from(least) {
        let cause = format!("expected at least {least} sequences a turn, found {per_turn:.1}");
        return Err(InvalidValue::new("rotating.sequence_us", cause));
    }
    Ok(())
}

/// The trajectory between two poses; `None` if they are equal.
fn trajectory(ends: [(f64, Pose); 2]) -> Option<Arc<Trajectory>> {
    (ends[0].1 != ends[1].1).then(|| {
        let trajectory = Trajectory::new(ends.into());
        Arc::new(trajectory.expect("invariant: a packet takes time, and speeds are finite"))
    })
}
