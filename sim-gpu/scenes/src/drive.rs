//! A drive through a street, as the packets of a VLP-32C that turns all the while.
//!
//! Everything moves while the head turns: each beam is cast from where the sensor is when it
//! fires, at where everything is then.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use edgepuck_shapes::Sampler;
use formats::Scan;
use formats::rng::StreamKey;
use formats::scan::Attribute;
use formats::vlp32c::{Returns, Revolution, SEQUENCE_US, SEQUENCES_PER_PACKET, START_S};
use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;
use serde::Serialize;
use sim_gpu::config::InvalidValue;
use sim_gpu::packets;
use sim_gpu::pose::{Pose, Trajectory};
use sim_gpu::scan::{ScanRequest, scan_objects};
use sim_gpu::sensor::{BeamPattern, Layout, Rotating, Sensor};

use crate::error::SceneError;
use crate::ground::Ground;
use crate::place::OWN_RADIUS_M;
use crate::recipe::Span;
use crate::scene::mount;
use crate::stage::Stage;
use crate::street::{Body, Street};

/// Where parked cars stand and how far their doors open, metres: the sensor keeps so far from
/// the kerb where there is room.
const FROM_KERB_M: f64 = 2.3;

/// A sensor that drives along a street.
pub struct Drive<'a> {
    street: Street<'a>,
    sensor: Sensor,
    revolution: Revolution,
    /// The sensor's at time 0.
    start: Pose,
    velocity_m_s: DVec3,
    sway: Sway,
    glass_returned: f64,
}

/// How a car's body pitches and rolls as it goes.
struct Sway {
    /// The standard deviation of each angle, radians.
    rad: f64,
    /// The phases of pitch and roll, by frequency, radians.
    phases_rad: [[f64; 3]; 2],
}

/// Frequencies, and the share of the variance that each has: the road's rise and fall, and the body
/// on its springs, at 1 to 2 Hz. An assumption: a sway of 0.5 degrees then turns by 1.5 degrees a
/// second, as the gyroscopes of cars in towns tell.
const SWAY: [(f64, f64); 3] = [(0.2, 0.7), (0.6, 0.25), (1.4, 0.05)];

/// Below this speed, metres a second, a car sways less, in proportion.
const SWAYS_FROM_M_S: f64 = 5.0;

/// What the sensor sees in one packet.
#[derive(Clone, Debug)]
pub struct Packet {
    /// Beams, ranges and objects in the order of firing. Object 0 is the ground, and `i` is
    /// [`Drive::body`] `i`. Positions are in the world.
    pub scan: Scan,
    seen: Seen,
}

/// Points, and the sum of their times, by turn and object.
type Seen = BTreeMap<(u32, u32), (u32, f64)>;

/// What is true of an object that was seen during a turn.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sighting {
    /// How often the encoder had passed 0 when the packet's sequence was fired.
    pub turn: u32,
    /// The mean time of its points, Unix time in seconds.
    pub time_s: f64,
    /// The object, the same in every turn.
    pub object: u32,
    /// Its class.
    pub class: String,
    /// How many points lie on it.
    pub points: u32,
    /// The middle of its box in the world at that time, metres.
    pub centre_m: [f64; 3],
    /// Length, width and height of its box, metres.
    pub size_m: [f64; 3],
    /// How its box is turned about the vertical, degrees, counterclockwise from x.
    pub yaw_deg: f64,
    /// Metres a second.
    pub velocity_m_s: [f64; 3],
}

/// Collects sightings until their turns are over.
#[derive(Default)]
pub struct Sightings(Seen);

impl<'a> Drive<'a> {
    /// A drive of the first sensor of `stage`, a VLP-32C, at `speed_m_s` along x, which begins
    /// at the origin.
    ///
    /// # Errors
    /// A sensor that is not a VLP-32C; effects whose points or returns packets cannot tell.
    pub fn new(stage: &'a Stage, speed_m_s: f64) -> Result<Self, SceneError> {
        let sensor = packets::as_packets_tell(&stage.sensors[0].sensor)?;
        let effects = stage.sensors[0].caster.effects();
        packets::returns(effects, None)?;
        if effects.motion.is_some() {
            let cause = "expected none in a drive, whose speed says how the sensor moves";
            return Err(InvalidValue::new("effects.motion", cause).into());
        }
        let revolution = packets::revolution(&sensor)?;
        let (recipe, seed) = (stage.recipe(), stage.seed());
        let s = &mut Sampler::new(StreamKey::new(seed, "drive", 0));
        let start = mount(stage, s);
        let glass_returned = recipe.glass_returned.at(s.uniform(0.0, 1.0));
        let off_road_m = recipe.mount.off_road_m.at(s.uniform(0.0, 1.0));
        let stream = StreamKey::new(seed, "drive/ground", 0);
        let mut ground = Ground::draw(&recipe.ground, 0.0, s, stream);
        // On the right, where traffic along x keeps.
        let most_m = ground.road_half_m - FROM_KERB_M - OWN_RADIUS_M;
        ground.road_y_m = off_road_m.min(most_m).max(0.0);
        let velocity_m_s = ground.along(speed_m_s);
        let street = Street::new(stage, ground, s);
        let sway = Sway::draw(recipe.mount.sway_deg, speed_m_s, seed);
        Ok(Self { street, sensor, revolution, start, velocity_m_s, sway, glass_returned })
    }

    /// How the head turns.
    #[must_use]
    pub fn revolution(&self) -> &Revolution {
        &self.revolution
    }

    /// Which returns of each beam its packets hold.
    #[must_use]
    pub fn returns(&self) -> Returns {
        let effects = self.street.stage.sensors[0].caster.effects();
        packets::returns(effects, None).expect("invariant: a new drive has asked")
    }

    /// Where the sensor is, `time_s` after the start.
    #[must_use]
    pub fn pose(&self, time_s: f64) -> Pose {
        let position_m = self.start.position_m + self.velocity_m_s * time_s;
        let world_from_sensor = self.start.world_from_sensor * self.sway.at(time_s);
        Pose { position_m, world_from_sensor }
    }

    /// The object that scans and sightings call `object`; `None` for the ground.
    #[must_use]
    pub fn body(&self, object: u32) -> Option<&Body> {
        self.street.bodies.get((object as usize).checked_sub(1)?)
    }

    /// Fires the packets of these `numbers`, which follow each other; they should take less than
    /// a second.
    ///
    /// # Errors
    /// If the caster fails.
    pub fn fire(&mut self, numbers: Range<u32>) -> Result<Vec<Packet>, SceneError> {
        let [from_s, to_s] = [numbers.start, numbers.end]
            .map(|number| f64::from(number * SEQUENCES_PER_PACKET) * SEQUENCE_US * 1e-6);
        let place = |time_s| (self.pose(time_s).position_m.x, time_s);
        self.street.draw_around([place(from_s), place(to_s)]);
        let this = &*self;
        let near = this.near(from_s, to_s);
        numbers.into_par_iter().map(|number| this.packet(number, &near)).collect()
    }

    /// What may be in sight between two times.
    fn near(&self, from_s: f64, to_s: f64) -> Vec<(u32, &Body)> {
        let middle_s = (from_s + to_s) / 2.0;
        let position_m = self.pose(middle_s).position_m;
        let is_near = |(_, body): &(u32, &Body)| {
            let speed_m_s = (body.velocity_m_s - self.velocity_m_s).length();
            let nears_m = speed_m_s * (to_s - from_s) / 2.0;
            body.centre_m(middle_s).distance(position_m) <= self.sight_m() + nears_m
        };
        (1..).zip(&self.street.bodies).filter(is_near).collect()
    }

    /// What is farther away is not there, metres.
    fn sight_m(&self) -> f64 {
        self.street.ground.half_m
    }

    fn packet(&self, number: u32, near: &[(u32, &Body)]) -> Result<Packet, SceneError> {
        let Street { stage, parts, .. } = &self.street;
        let first = number * SEQUENCES_PER_PACKET;
        let caster = &stage.sensors[0].caster;
        let pattern = self.head().pattern_of(first..first + SEQUENCES_PER_PACKET);
        let pattern = caster.effects().widen(pattern, &self.sensor)?;
        let [from_s, to_s] = [pattern.time_s[0], pattern.time_s[pattern.len() - 1]];
        let time_s = (from_s + to_s) / 2.0;
        let pose = self.pose(time_s);
        let turned_rad = [from_s, to_s]
            .map(|end_s| pose.world_from_sensor.angle_between(self.pose(end_s).world_from_sensor));
        let turned_rad = turned_rad[0].max(turned_rad[1]);
        let sector = Sector::of(&pattern);
        let sensor_from_world = pose.world_from_sensor.inverse();
        let in_sight = near.iter().filter(|(_, body)| {
            let from_sensor = body.centre_m(time_s) - pose.position_m;
            // How far they come to or from each other, from the middle of the packet on, and how
            // far it moves in the sensor's frame as that turns.
            let speed_m_s = (body.velocity_m_s - self.velocity_m_s).length();
            let moves_m = speed_m_s * (to_s - time_s) + turned_rad * from_sensor.length();
            from_sensor.length() <= self.sight_m()
                && sector.meets(sensor_from_world * from_sensor, body.radius_m() + moves_m)
        });
        let (ids, bodies): (Vec<u32>, Vec<&Body>) = in_sight.copied().unzip();
        let parts = parts.range(self.street.parts_in_sight(pose.position_m.x));
        let mut targets: Vec<_> = parts.map(|(_, part)| stage.ground(part, 0)).collect();
        let n_parts = targets.len();
        let ends = [(from_s, self.pose(from_s)), (to_s, self.pose(to_s))];
        targets.extend(bodies.iter().map(|body| {
            let mut target = stage.target(&body.object, self.glass_returned);
            target.motion = moving([from_s, to_s].map(|time_s| {
                let position_m = body.velocity_m_s * time_s;
                (time_s, Pose { position_m, world_from_sensor: DQuat::IDENTITY })
            }));
            target
        }));

        let mut request = ScanRequest::new(&self.sensor, &pattern, pose);
        request.motion = moving(ends);
        request.deskew = true;
        request.attributes = [Attribute::Beam, Attribute::Range, Attribute::Object].into();
        request.stream = StreamKey::new(stage.seed(), "drive/beams", number);
        let mut scan = scan_objects(caster, &targets, &request)?.scan;
        for object in scan.object.iter_mut().flatten() {
            // What is in the air counts with the ground: it is no object either.
            let in_sight = (*object as usize).checked_sub(n_parts);
            *object = in_sight.and_then(|i| ids.get(i)).map_or(0, |id| *id);
        }
        let seen = self.seen(first, &pattern, &scan);
        Ok(Packet { scan, seen })
    }

    fn head(&self) -> &Rotating {
        match &self.sensor.layout {
            Layout::Rotating(head) => head,
            _ => unreachable!("invariant: a VLP-32C rotates"),
        }
    }

    /// The points of `scan` on objects; its sequences begin with `first`.
    fn seen(&self, first: u32, pattern: &BeamPattern, scan: &Scan) -> Seen {
        let n_lasers = self.head().beam.len() as u32;
        let mut seen = Seen::new();
        let beams = scan.beam.iter().flatten();
        for (&beam, &object) in beams.zip(scan.object.iter().flatten()) {
            if object > 0 {
                let turn = self.revolution.turn(first + beam / n_lasers);
                let (points, sum_s) = seen.entry((turn, object)).or_default();
                *points += 1;
                *sum_s += pattern.time_s[(beam * pattern.rays_per_beam) as usize];
            }
        }
        seen
    }

    fn sighting(&self, (turn, object): (u32, u32), (points, sum_s): (u32, f64)) -> Sighting {
        let body = self.body(object).expect("invariant: what was seen was drawn");
        let time_s = sum_s / f64::from(points);
        let entry = &self.street.stage.recipe().object[body.object.entry];
        Sighting {
            turn,
            time_s: f64::from(START_S) + time_s,
            object,
            class: entry.class.clone(),
            points,
            centre_m: body.centre_m(time_s).to_array(),
            size_m: body.size_m.to_array(),
            yaw_deg: body.object.yaw_rad.to_degrees(),
            velocity_m_s: body.velocity_m_s.to_array(),
        }
    }
}

impl Sightings {
    /// Adds `packets` of `drive`, in order, and returns what was seen in the turns that are over.
    pub fn add(&mut self, drive: &Drive, packets: &[Packet]) -> Vec<Sighting> {
        for (&key, &(points, sum_s)) in packets.iter().flat_map(|packet| &packet.seen) {
            let sum = self.0.entry(key).or_default();
            *sum = (sum.0 + points, sum.1 + sum_s);
        }
        let last = self.0.keys().next_back().map_or(0, |&(turn, _)| turn);
        let open = self.0.split_off(&(last, 0));
        std::mem::replace(&mut self.0, open)
            .into_iter()
            .map(|(key, sum)| drive.sighting(key, sum))
            .collect()
    }

    /// What was seen in the last turn.
    #[must_use]
    pub fn finish(self, drive: &Drive) -> Vec<Sighting> {
        self.0.into_iter().map(|(key, sum)| drive.sighting(key, sum)).collect()
    }
}

/// The way between two poses; `None` if they are the same.
fn moving(ends: [(f64, Pose); 2]) -> Option<Arc<Trajectory>> {
    let moves = ends[0].1 != ends[1].1;
    let trajectory = || Trajectory::new(ends.into());
    moves
        .then(|| Arc::new(trajectory().expect("invariant: a packet takes time, speeds are finite")))
}

impl Sway {
    fn draw(sway_deg: Span, speed_m_s: f64, seed: u64) -> Self {
        let key = StreamKey::new(seed, "drive/sway", 0);
        let phase_rad = |axis: u64, i: u64| TAU * key.unit(1 + 3 * axis + i);
        Self {
            rad: sway_deg.at(key.unit(0)).to_radians() * (speed_m_s / SWAYS_FROM_M_S).min(1.0),
            phases_rad: [0, 1].map(|axis| [0, 1, 2].map(|i| phase_rad(axis, i))),
        }
    }

    /// How the sensor is turned from where it was mounted. The road runs along x, so that it
    /// pitches about y and rolls about x, whichever way it was turned.
    fn at(&self, time_s: f64) -> DQuat {
        let [pitch_rad, roll_rad] = self.phases_rad.map(|phases_rad| {
            let waves = SWAY.iter().zip(phases_rad).map(|((hz, share), phase_rad)| {
                // The variance of a sine is half of its amplitude squared.
                (2.0 * share).sqrt() * (TAU * hz * time_s + phase_rad).sin()
            });
            self.rad * waves.sum::<f64>()
        });
        DQuat::from_rotation_y(pitch_rad) * DQuat::from_rotation_x(roll_rad)
    }
}

/// The azimuths of a packet's beams, in the sensor's frame.
struct Sector {
    middle: DVec2,
    half_rad: f64,
}

impl Sector {
    fn of(pattern: &BeamPattern) -> Self {
        let level = pattern.directions.iter().map(|direction| direction.truncate().normalize());
        let middle = level.clone().sum::<DVec2>().normalize();
        let half_rad = level.map(|beam| middle.angle_to(beam).abs()).fold(0.0, f64::max);
        Self { middle, half_rad }
    }

    /// Whether a beam may meet the sphere around `centre_m`.
    fn meets(&self, centre_m: DVec3, radius_m: f64) -> bool {
        let centre_m = centre_m.truncate();
        let share = radius_m / centre_m.length();
        // Rounding is far below a nanoradian.
        let widest_rad = self.half_rad + share.min(1.0).asin() + 1e-9;
        share >= 1.0 || self.middle.angle_to(centre_m).abs() <= widest_rad
    }
}
