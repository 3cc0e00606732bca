//! Which cluster is the same object as one of the turn before.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use super::kalman::Axis;

/// How fast what is seen for the first time may move, metres a second: a town's traffic, of
/// which the fastest is oncoming. Along z, ramps and steps.
const FIRST_VELOCITY_M_S: [f64; 3] = [8.0, 8.0, 0.5];
/// Accelerations of cars and persons, metres a second squared.
const ACCELERATION_M_S2: [f64; 3] = [3.0, 3.0, 0.5];
/// By how much the middle of a box is off: the range noise and the spacing of the
/// beams, metres, and a share of the box's length, because other sides come into sight.
const OFF_M: f64 = 0.1;
const OFF_SHARE: f64 = 0.05;
/// By how much two views of a side differ: metres, and a share of it.
const SIZE_OFF_M: f64 = 0.2;
const SIZE_OFF_SHARE: f64 = 0.3;
/// What is kept of a side from turn to turn, when less is seen of it: what was one with a
/// neighbour is not taken for larger than it is for long.
const SHRINKAGE: f64 = 0.99;
/// The most of a side that is taken to be hidden, metres: most of a car's length.
const MOST_HIDDEN_M: f64 = 4.0;
/// The squared Mahalanobis distance beyond which a cluster is another object: one in a hundred
/// of the right ones is farther (chi-squared, three degrees of freedom).
const GATE: f64 = 11.34;
/// How long a track waits for its object, seconds.
const PATIENCE_S: f64 = 1.05;
/// Sensors turn 5 to 20 times a second; a damaged packet may say anything.
const LEAST_TURN_S: f64 = 0.02;
const MOST_TURN_S: f64 = 0.4;
/// The most tracks: what comes on top replaces the track that has waited longest.
const MOST_TRACKS: usize = 1024;
/// The weight of the latest view among all of a track, at least: some two seconds count at
/// ten turns a second.
const LEAST_WEIGHT: f64 = 0.05;

/// A cluster, as the tracker takes it.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// When, seconds.
    pub time_s: f64,
    /// The middle of its box, metres, in a frame that stays.
    pub position_m: [f64; 3],
    /// Length and width of its box, metres.
    pub size_m: [f64; 2],
    /// The direction of the length, radians counterclockwise from x.
    pub yaw_rad: f64,
    /// Where the sensor is, metres.
    pub sensor_m: [f64; 2],
    /// The log-probability of each class and the energy, where it was classified.
    pub view: Option<(&'a [f64], f64)>,
}

/// An object over time.
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Its number, from 1.
    pub id: u64,
    axes: Option<[Axis; 3]>,
    footprint: Footprint,
    /// When it was last seen.
    last_s: f64,
    /// How often.
    pub n_seen: u64,
    /// Weighted means over its views; empty without one.
    pub log_probabilities: Vec<f64>,
    /// The same of the energy.
    pub energy: f64,
    n_views: u64,
}

/// How large an object is from above, by all that was seen of it.
#[derive(Clone, Copy, Debug, Default)]
struct Footprint {
    /// The direction of the first side, radians counterclockwise from x.
    yaw_rad: f64,
    /// Its two sides, metres.
    sides_m: [f64; 2],
}

impl Footprint {
    /// The sides of the box that was seen, in the order of this footprint's, and the direction
    /// of the first.
    fn sides_of(&self, seen: &Seen<'_>) -> ([f64; 2], f64) {
        let [length, width] = seen.size_m;
        let turned = (seen.yaw_rad - self.yaw_rad + FRAC_PI_4).rem_euclid(PI);
        match turned < FRAC_PI_2 {
            true => ([length, width], seen.yaw_rad),
            false => ([width, length], seen.yaw_rad + FRAC_PI_2),
        }
    }

    /// The middle of the whole object: what is not seen of its sides lies behind what is.
    fn middle(&self, seen: &Seen<'_>) -> [f64; 3] {
        let (sides, yaw_rad) = self.sides_of(seen);
        let mut middle = seen.position_m;
        let (sin, cos) = yaw_rad.sin_cos();
        for (i, [x, y]) in [[cos, sin], [-sin, cos]].into_iter().enumerate() {
            let hidden_m = (self.sides_m[i] - sides[i]).clamp(0.0, MOST_HIDDEN_M);
            let [dx, dy] = [0, 1].map(|axis| seen.position_m[axis] - seen.sensor_m[axis]);
            let away_m = (hidden_m / 2.0).copysign(dx * x + dy * y);
            middle[0] += away_m * x;
            middle[1] += away_m * y;
        }
        middle
    }

    /// How little what is seen of an object has the size of the whole: squares of the sides'
    /// differences in units of what other views of the same object differ by.
    fn mismatch(&self, seen: &Seen<'_>) -> f64 {
        let (sides, _) = self.sides_of(seen);
        let term = |i: usize| {
            let larger = sides[i].max(self.sides_m[i]);
            ((sides[i] - self.sides_m[i]) / (SIZE_OFF_M + SIZE_OFF_SHARE * larger)).powi(2)
        };
        term(0) + term(1)
    }

    fn update(&mut self, seen: &Seen<'_>) {
        let (sides, yaw_rad) = self.sides_of(seen);
        let grown = |i: usize| sides[i].max(SHRINKAGE * self.sides_m[i]);
        *self = Self { yaw_rad, sides_m: [grown(0), grown(1)] };
    }
}

/// Follows objects from turn to turn.
///
/// Each cluster goes to the track that expects it most, as soon as it comes: the nearest one
/// by the Mahalanobis distance of a Kalman filter for constant velocity along each axis, that
/// of the surer prediction of two. A track takes one cluster a turn.
pub struct Tracker {
    /// Room for all of them, of which the first `n_used` have been used.
    tracks: Vec<Track>,
    n_used: usize,
    n_ids: u64,
    /// The time that a turn takes, seconds.
    turn_s: f64,
}

impl Track {
    /// Its velocity, metres a second; `None` of what was seen once.
    #[must_use]
    pub fn velocity_m_s(&self) -> Option<[f64; 3]> {
        self.axes.filter(|_| self.n_seen > 1).map(|axes| axes.map(|axis| axis.velocity))
    }

    /// How unlikely `seen` is its object: squared Mahalanobis distance, and the logarithm of
    /// the variances on top. `None` beyond the gate.
    fn cost(&self, seen: &Seen<'_>) -> Option<f64> {
        let (sigma, middle) = (off_m(seen), self.footprint.middle(seen));
        let dt = seen.time_s - self.last_s;
        let (mut distance, mut logarithm) = (0.0, 0.0);
        for (i, axis) in self.axes?.into_iter().enumerate() {
            let axis = axis.after(dt, ACCELERATION_M_S2[i]);
            let variance = axis.variance(sigma);
            distance += (middle[i] - axis.place).powi(2) / variance;
            logarithm += variance.ln();
        }
        (distance <= GATE).then_some(distance + logarithm + self.footprint.mismatch(seen))
    }

    fn update(&mut self, seen: &Seen<'_>) {
        let (sigma, middle) = (off_m(seen), self.footprint.middle(seen));
        let dt = seen.time_s - self.last_s;
        for (i, axis) in self.axes.iter_mut().flatten().enumerate() {
            *axis = axis.after(dt, ACCELERATION_M_S2[i]);
            axis.update(middle[i], sigma);
        }
        self.note(seen);
    }

    /// Makes a new track of this one's memory.
    fn begin(&mut self, id: u64, seen: &Seen<'_>) {
        let sigma = off_m(seen);
        let axis = |i: usize| Axis::new(seen.position_m[i], sigma, FIRST_VELOCITY_M_S[i]);
        let mut log_probabilities = std::mem::take(&mut self.log_probabilities);
        log_probabilities.clear();
        let footprint = Footprint { yaw_rad: seen.yaw_rad, sides_m: [0.0; 2] };
        let axes = Some([0, 1, 2].map(axis));
        *self = Self { id, axes, footprint, log_probabilities, ..Self::default() };
        self.note(seen);
    }

    fn note(&mut self, seen: &Seen<'_>) {
        self.footprint.update(seen);
        self.last_s = seen.time_s;
        self.n_seen += 1;
        let Some((log_probabilities, energy)) = seen.view else { return };
        self.n_views += 1;
        self.log_probabilities.resize(log_probabilities.len(), 0.0);
        let weight = (1.0 / self.n_views as f64).max(LEAST_WEIGHT);
        for (mean, new) in self.log_probabilities.iter_mut().zip(log_probabilities) {
            *mean += weight * (new - *mean);
        }
        self.energy += weight * (energy - self.energy);
    }
}

impl Tracker {
    /// A tracker of objects of so many classes.
    pub fn new(n_classes: usize) -> Self {
        let track =
            || Track { log_probabilities: Vec::with_capacity(n_classes), ..Track::default() };
        let tracks = (0..MOST_TRACKS).map(|_| track()).collect();
        Self { tracks, n_used: 0, n_ids: 0, turn_s: 0.1 }
    }

    /// Says how long a turn takes, seconds.
    pub fn set_turn(&mut self, turn_s: f64) {
        self.turn_s = turn_s.clamp(LEAST_TURN_S, MOST_TURN_S);
    }

    /// Forgets all objects; numbers go on.
    pub fn forget(&mut self) {
        for track in &mut self.tracks {
            track.axes = None;
        }
    }

    /// The track that `seen` belongs to, with what it adds: one of those before, or a new one.
    pub fn see(&mut self, seen: &Seen<'_>) -> &Track {
        let waits = |track: &Track| seen.time_s - track.last_s;
        // A track that was seen in this turn has its cluster.
        let due = 0.5 * self.turn_s..=PATIENCE_S.max(2.5 * self.turn_s);
        let tracks = self.tracks[..self.n_used].iter().enumerate();
        let tracks = tracks.filter(|(_, track)| due.contains(&waits(track)));
        let costs = tracks.filter_map(|(at, track)| Some((track.cost(seen)?, at)));
        if let Some((_, at)) = costs.min_by(|a, b| a.0.total_cmp(&b.0)) {
            self.tracks[at].update(seen);
            return &self.tracks[at];
        }
        let at = self.place_for_new(seen.time_s);
        self.n_ids += 1;
        self.tracks[at].begin(self.n_ids, seen);
        &self.tracks[at]
    }

    fn place_for_new(&mut self, time_s: f64) -> usize {
        let waited = |track: &Track| match track.axes {
            None => f64::INFINITY,
            Some(_) => time_s - track.last_s,
        };
        let longest = self.tracks[..self.n_used].iter().map(waited).enumerate();
        let longest = longest.max_by(|a, b| a.1.total_cmp(&b.1));
        match longest {
            Some((at, waited_s)) if waited_s > PATIENCE_S || self.n_used == MOST_TRACKS => at,
            _ => {
                self.n_used += 1;
                self.n_used - 1
            }
        }
    }
}

/// By how much the middle of the box is off, metres.
fn off_m(seen: &Seen<'_>) -> f64 {
    OFF_M + OFF_SHARE * seen.size_m[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(time_s: f64, x: f64, y: f64) -> Seen<'static> {
        Seen {
            time_s,
            position_m: [x, y, 0.0],
            size_m: [1.0; 2],
            yaw_rad: 0.0,
            sensor_m: [0.0; 2],
            view: None,
        }
    }

    #[test]
    fn two_persons_keep_their_numbers_while_they_pass_each_other() {
        let mut tracker = Tracker::new(2);
        let mut ids = [vec![], vec![]];
        for turn in 0..60 {
            let t = f64::from(turn) * 0.1;
            ids[0].push(tracker.see(&seen(t, -3.0 + t, 0.0)).id);
            ids[1].push(tracker.see(&seen(t + 0.01, 3.0 - t, 0.8)).id);
        }
        assert!(ids[0].iter().all(|&id| id == 1), "{:?}", ids[0]);
        assert!(ids[1].iter().all(|&id| id == 2), "{:?}", ids[1]);
    }

    #[test]
    fn a_car_is_found_again_after_a_second_and_not_after_two() {
        let mut tracker = Tracker::new(2);
        let at = |t: f64| seen(t, 12.0 * t, 3.0);
        (0..20).for_each(|turn| {
            tracker.see(&at(f64::from(turn) * 0.1));
        });
        assert_eq!(tracker.see(&at(2.9)).id, 1);
        let velocity = tracker.see(&at(3.0)).velocity_m_s().unwrap();
        assert!((velocity[0] - 12.0).abs() < 0.1 && velocity[1].abs() < 0.1, "{velocity:?}");
        assert_eq!(tracker.see(&at(5.0)).id, 2);
    }

    #[test]
    fn what_is_cut_in_two_is_two_tracks_and_so_is_what_is_far_off() {
        let mut tracker = Tracker::new(2);
        tracker.see(&seen(0.0, 5.0, 0.0));
        assert_eq!(tracker.see(&seen(0.1, 5.1, 0.0)).id, 1);
        assert_eq!(tracker.see(&seen(0.101, 5.4, 0.0)).id, 2);
        assert_eq!(tracker.see(&seen(0.2, 9.0, 0.0)).id, 3);
        assert_eq!(tracker.see(&seen(0.2, 9.0, 0.0)).velocity_m_s(), None);
    }

    #[test]
    fn a_class_firms_up_over_views() {
        let mut tracker = Tracker::new(2);
        let views = [[-2.0, -0.2], [-0.1, -3.0], [-0.1, -3.0]];
        let means = views.iter().enumerate().map(|(turn, view)| {
            let time_s = turn as f64 * 0.1;
            let seen = Seen { view: Some((view, turn as f64)), ..seen(time_s, 1.0, 0.0) };
            let track = tracker.see(&seen);
            (track.log_probabilities.clone(), track.energy)
        });
        let means: Vec<_> = means.collect();
        assert_eq!(means[0], (vec![-2.0, -0.2], 0.0));
        assert!((means[2].0[0] - -2.2 / 3.0).abs() < 1e-12 && (means[2].1 - 1.0).abs() < 1e-12);
    }

    /// Of a car that stands, first a corner is seen, then its side and then its rear.
    #[test]
    fn what_is_hidden_of_a_car_moves_it_nowhere() {
        let mut tracker = Tracker::new(2);
        let views = [
            ([8.0, -5.0], [4.2, 1.8], 0.0),
            ([8.0, -4.1], [4.2, 0.0], 0.0),
            ([5.9, -5.0], [1.8, 0.0], FRAC_PI_2),
            ([5.9, -5.0], [1.8, 0.1], -FRAC_PI_2),
        ];
        for turn in 0..24 {
            let ([x, y], size_m, yaw_rad) = views[turn / 6];
            let seen = Seen { size_m, yaw_rad, ..seen(turn as f64 * 0.1, x, y) };
            let track = tracker.see(&seen);
            assert_eq!(track.id, 1, "turn {turn}");
            let [vx, vy, _] = track.velocity_m_s().unwrap_or_default();
            assert!(vx.hypot(vy) < 0.4, "turn {turn}: {vx} {vy}");
        }
    }

    #[test]
    fn tracks_are_bounded_and_their_memory_is_used_again() {
        let mut tracker = Tracker::new(2);
        for i in 0..5000 {
            tracker.see(&seen(0.0, f64::from(i) * 100.0, 0.0));
        }
        assert_eq!(tracker.n_used, MOST_TRACKS);
        tracker.see(&seen(100.0, 0.0, 0.0));
        assert_eq!(tracker.n_used, MOST_TRACKS);
        tracker.forget();
        assert_eq!(tracker.see(&seen(100.1, 0.0, 0.0)).id, 5002);
    }
}
