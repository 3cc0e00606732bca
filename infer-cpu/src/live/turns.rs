//! The returns of a sensor, turn by turn.

use std::f64::consts::{PI, TAU};
use std::time::Instant;

use formats::geometry::{Pose, Trajectory};
use formats::packets::Facts;
use formats::returns::Return;
use glam::Vec3;

/// A sector that the sensor does not send ends a turn after this angle, radians: it begins with any of
/// the firings near its start.
const LEAST_RAD: f64 = 0.17;
/// The error of an azimuth, radians.
const ROUNDING_RAD: f64 = 1e-6;

/// When a point was measured, and when its packet arrived.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tag {
    /// Unix time in seconds.
    pub time_s: f64,
    /// The moment of its arrival, if packets arrive in real time.
    pub moment: Option<Instant>,
}

/// The returns of a turn.
#[derive(Default)]
pub struct Turn {
    /// Its number, from 0.
    pub number: u64,
    /// Whether it ended where it began or where the sensor sends nothing, and not in a gap or with the data.
    pub is_whole: bool,
    /// Whether the sensor or its clock starts anew behind it, so that nothing is tracked further.
    pub is_last: bool,
    /// Metres in the sensor's frame.
    pub points: Vec<[f32; 3]>,
    pub rings: Vec<u16>,
    pub tags: Vec<Tag>,
}

/// The current turn, and those that are complete.
///
/// A turn ends when the head is where it began, or where the sensor sends nothing.
#[derive(Default)]
pub struct Turns {
    current: Turn,
    /// Complete turns, until they are taken.
    complete: Vec<Turn>,
    /// The memory of a turn that was taken.
    spare: Option<Turn>,
    /// The azimuth of the head, radians clockwise from x, and how far it has turned.
    azimuth_rad: Option<f64>,
    turned_rad: f64,
    n_ended: u64,
    /// The most points of a turn: this bounds the memory if the head stands still.
    capacity: usize,
    n_dropped: u64,
}

impl Turns {
    /// For up to `capacity` points in a turn.
    pub fn new(capacity: usize) -> Self {
        Self { capacity, ..Self::default() }
    }

    /// Begins with the first turn of another sensor.
    pub fn begin(&mut self, capacity: usize) {
        let before = std::mem::replace(self, Self::new(capacity));
        let Self { complete, n_ended, n_dropped, .. } = before;
        *self = Self { complete, n_ended, n_dropped, ..Self::new(capacity) };
    }

    /// Adds the returns of a packet, which may follow a gap; `packet` has its time.
    pub fn add(&mut self, facts: &Facts, returns: &[Return], (packet, is_behind_gap): (Tag, bool)) {
        match is_behind_gap && facts.n_unsent > 0 {
            true => self.pass_sector(facts.azimuth_rad),
            false => self.advance(facts.azimuth_rad, is_behind_gap),
        }
        let mut resumes = facts.resumes;
        for found in returns {
            if let Some((_, azimuth_rad)) = resumes.take_if(|(us, _)| found.after_us >= *us) {
                self.pass_sector(azimuth_rad);
            }
            let time_s = packet.time_s + found.after_us * 1e-6;
            self.push(found.point_m, found.ring, Tag { time_s, ..packet });
        }
        if let Some((_, azimuth_rad)) = resumes {
            self.pass_sector(azimuth_rad);
        }
    }

    /// Moves the head to `azimuth_rad`. More than half a turn ahead is behind, and changes nothing:
    /// azimuths of packets may go back a little. After a gap in the data it is ahead.
    fn advance(&mut self, azimuth_rad: f64, is_behind_gap: bool) {
        let before_rad = *self.azimuth_rad.get_or_insert(azimuth_rad);
        let ahead_rad = (azimuth_rad - before_rad).rem_euclid(TAU);
        if ahead_rad > PI && !is_behind_gap {
            return;
        }
        self.azimuth_rad = Some(azimuth_rad);
        self.turned_rad += ahead_rad;
        if self.turned_rad >= TAU - ROUNDING_RAD {
            self.turned_rad = (self.turned_rad - TAU).max(0.0);
            self.end_turn(true);
        }
    }

    /// Moves the head over a sector that the sensor does not send, where its turns end.
    fn pass_sector(&mut self, azimuth_rad: f64) {
        self.azimuth_rad = Some(azimuth_rad);
        if self.turned_rad > LEAST_RAD {
            self.turned_rad = 0.0;
            self.end_turn(true);
        }
    }

    /// Adds a return.
    fn push(&mut self, point_m: [f32; 3], ring: u16, tag: Tag) {
        let Turn { points, rings, tags, .. } = &mut self.current;
        if points.len() == self.capacity {
            self.n_dropped += 1;
            return;
        }
        points.push(point_m);
        rings.push(ring);
        tags.push(tag);
    }

    /// Completes the current turn, and begins anew.
    pub fn end(&mut self) {
        if !self.current.points.is_empty() {
            self.end_turn(false);
        }
        (self.azimuth_rad, self.turned_rad) = (None, 0.0);
    }

    /// Completes the current turn as the last one. Returns whether all turns were taken before.
    pub fn break_off(&mut self) -> bool {
        self.end();
        self.complete.last_mut().is_none_or(|last| {
            last.is_last = true;
            false
        })
    }

    fn end_turn(&mut self, is_whole: bool) {
        let mut next = self.spare.take().unwrap_or_default();
        next.clear();
        let ended = std::mem::replace(&mut self.current, next);
        self.complete.push(Turn { number: self.n_ended, is_whole, ..ended });
        self.n_ended += 1;
    }

    /// The first complete turn that was not taken. Its memory is reused once it is
    /// [given back](Self::give_back).
    pub fn take(&mut self) -> Option<Turn> {
        (!self.complete.is_empty()).then(|| self.complete.remove(0))
    }

    pub fn give_back(&mut self, turn: Turn) {
        self.spare = Some(turn);
    }

    /// The number of turns that have ended.
    pub fn n_ended(&self) -> u64 {
        self.n_ended
    }

    /// The number of returns for which there was no room.
    pub fn n_dropped(&self) -> u64 {
        self.n_dropped
    }
}

impl Turn {
    fn clear(&mut self) {
        self.is_last = false;
        self.points.clear();
        self.rings.clear();
        self.tags.clear();
    }

    /// Puts all points into the frame of the sensor at the time of the last one, and returns its pose then.
    pub fn rectify(&mut self, motion: &Trajectory) -> Pose {
        let last_s = self.tags.iter().fold(f64::NEG_INFINITY, |last_s, tag| last_s.max(tag.time_s));
        let last = motion.at_unnormalized(last_s);
        let (mut time_s, mut pose) = (f64::NAN, last);
        for (point, tag) in self.points.iter_mut().zip(&self.tags) {
            // The points of a firing have one time.
            if tag.time_s != time_s {
                (time_s, pose) = (tag.time_s, motion.at_unnormalized(tag.time_s));
            }
            let in_world = pose.to_world(Vec3::from(*point).as_dvec3());
            *point = last.from_world(in_world).as_vec3().to_array();
        }
        last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moves the head by 30 degrees at a time, with one point each.
    fn turned(turns: &mut Turns, steps: std::ops::Range<u32>) {
        for step in steps {
            turns.advance(f64::from(30 * step % 360).to_radians(), false);
            turns.push([step as f32; 3], 0, Tag { time_s: f64::from(step), moment: None });
        }
    }

    fn taken(turns: &mut Turns) -> Vec<(u64, Vec<f32>)> {
        let take = || turns.take().map(|turn| (turn.number, first(&turn)));
        std::iter::from_fn(take).collect()
    }

    fn first(turn: &Turn) -> Vec<f32> {
        turn.points.iter().map(|point| point[0]).collect()
    }

    fn steps(range: std::ops::Range<u16>) -> Vec<f32> {
        range.map(f32::from).collect()
    }

    #[test]
    fn a_turn_ends_where_it_began() {
        let mut turns = Turns::new(100);
        turned(&mut turns, 5..30);
        assert_eq!(taken(&mut turns), [(0, steps(5..17)), (1, steps(17..29))]);
        // Back by 30 degrees, and a gap of 300 degrees.
        turns.advance(120f64.to_radians(), false);
        assert!(taken(&mut turns).is_empty());
        turns.advance(90f64.to_radians(), true);
        assert!(taken(&mut turns).is_empty());
        turns.advance(160f64.to_radians(), false);
        assert_eq!((taken(&mut turns), turns.n_ended()), (vec![(2, vec![29.0])], 3));
    }

    #[test]
    fn a_turn_ends_where_a_sector_is_not_sent() {
        let mut turns = Turns::new(100);
        for turn in 0..3 {
            turned(&mut turns, 12 * turn + 3..12 * turn + 9);
            turns.pass_sector(90f64.to_radians());
            // Firings near its start.
            turns.advance(91f64.to_radians(), false);
            turns.pass_sector(90f64.to_radians());
        }
        let expected = [(0, steps(3..9)), (1, steps(15..21)), (2, steps(27..33))];
        assert_eq!(taken(&mut turns), expected);
    }

    #[test]
    fn the_end_completes_a_turn_and_a_head_that_stands_still_drops_points() {
        let mut turns = Turns::new(3);
        turned(&mut turns, 0..5);
        assert_eq!(turns.n_dropped(), 2);
        turns.end();
        assert_eq!((taken(&mut turns), turns.n_ended()), (vec![(0, steps(0..3))], 1));
        turns.end();
        assert!(taken(&mut turns).is_empty());
        // Turns behind a gap, or of another sensor, have other numbers; those that a gap ends are not whole.
        turns.begin(100);
        turned(&mut turns, 0..13);
        turns.end();
        let turns = [turns.take(), turns.take(), turns.take()];
        let told = turns.map(|turn| turn.map(|turn| (turn.number, turn.is_whole)));
        assert_eq!(told, [Some((1, true)), Some((2, false)), None]);
    }

    #[test]
    fn points_of_a_moving_sensor_are_those_of_its_last_pose() {
        let poses = [0.0, 10.0].map(|time_s| (time_s, Pose::at([2.0 * time_s, 0.0, 0.0])));
        let mut turns = Turns::new(10);
        turned(&mut turns, 0..4);
        turns.end();
        let mut turn = turns.take().unwrap();
        turn.rectify(&Trajectory::new(poses.to_vec()).unwrap());
        assert_eq!(first(&turn), [0.0 - 6.0, 1.0 - 4.0, 2.0 - 2.0, 3.0]);
    }

    /// A packet that goes on behind such a sector 100 microseconds after its first firing.
    #[test]
    fn returns_from_the_end_of_a_sector_on_are_of_the_next_turn() {
        let mut turns = Turns::new(100);
        turned(&mut turns, 0..3);
        let facts = Facts {
            stamp_us: 0.0,
            duration_us: 200.0,
            azimuth_rad: 90f64.to_radians(),
            speed_rad_us: 0.0,
            n_unsent: 0,
            n_unsent_before: 0,
            resumes: Some((100.0, 0.0)),
        };
        let kind = formats::returns::Kind::Last;
        let found = [(3.0, 99.0), (4.0, 100.0), (5.0, 101.0)].map(|(x, after_us)| Return {
            point_m: [x; 3],
            range_m: x,
            ring: 0,
            reflectivity: 0,
            after_us,
            kind,
        });
        turns.add(&facts, &found, (Tag::default(), false));
        turns.end();
        assert_eq!(taken(&mut turns), [(0, steps(0..4)), (1, steps(4..6))]);
    }

    #[test]
    fn the_memory_of_a_last_turn_is_used_again_for_others() {
        let mut turns = Turns::new(100);
        turned(&mut turns, 0..5);
        assert!(!turns.break_off());
        let last = turns.take().unwrap();
        assert!(last.is_last);
        turns.give_back(last);
        turned(&mut turns, 0..25);
        let is_last = std::iter::from_fn(|| turns.take().map(|turn| turn.is_last));
        assert_eq!(is_last.collect::<Vec<_>>(), [false, false]);
    }
}
