//! The tracker, which matches clusters with the objects of earlier turns.

use super::footprint::{Footprint, Observation};
use super::kalman::Axis;
use super::whole::Whole;

/// The standard deviation of the velocity of a new object, metres per second: urban traffic, of
/// which oncoming cars are the fastest; along z, ramps and steps.
const FIRST_VELOCITY_M_S: [f64; 3] = [8.0, 8.0, 0.5];
/// The standard deviation of accelerations of cars and persons, metres per second squared.
const ACCELERATION_M_S2: [f64; 3] = [3.0, 3.0, 0.5];
/// The error of the middle of a box: range noise and beam spacing in metres, plus a share of the
/// box's length, because the visible sides change.
const OFF_M: f64 = 0.1;
const OFF_SHARE: f64 = 0.05;
/// The gate: a cluster beyond this squared Mahalanobis distance is another object. It excludes one
/// in a hundred correct matches (chi-squared, three degrees of freedom).
const GATE: f64 = 11.34;
/// How long a track survives without a cluster, seconds.
const PATIENCE_S: f64 = 1.05;
/// Sensors turn 5 to 20 times per second; a damaged packet may state any speed.
const LEAST_TURN_S: f64 = 0.02;
const MOST_TURN_S: f64 = 0.4;
/// The most tracks: a further one replaces the track that has waited longest.
const MOST_TRACKS: usize = 1024;
/// Persons and two-wheelers, which are shorter, are not pieces of cars, which are longer, metres.
const SHORT_M: f32 = 2.0;
/// From this many whole clusters on, the velocity of a track is trusted, and the track keeps the clusters
/// that it matches.
const SETTLED: u64 = 5;
/// The least weight of the latest view of a track: views of about two seconds count at ten turns
/// per second.
const LEAST_WEIGHT: f64 = 0.05;

#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Its number, from 1.
    pub id: u64,
    axes: Option<[Axis; 3]>,
    footprint: Footprint,
    pub whole: Whole,
    /// Whether the last cluster was a piece of the object, which tells nothing of the whole.
    pub is_piece: bool,
    /// The time of the last cluster, and of the last that was no piece.
    last_s: f64,
    last_whole_s: f64,
    pub n_seen: u64,
    /// How many of its clusters were no pieces.
    n_whole: u64,
    /// Weighted means of the log-probabilities over all views; empty without a view.
    pub log_probabilities: Vec<f64>,
    n_views: u64,
}

/// Follows objects from turn to turn.
///
/// Each cluster is assigned as soon as it comes to the most likely track, by the Mahalanobis
/// distance of a constant-velocity Kalman filter along each axis; of two equally near tracks, the
/// one with the smaller variance is more likely. A track takes one cluster per turn.
pub struct Tracker {
    /// Memory for all tracks, of which the first `n_used` have been used.
    tracks: Vec<Track>,
    n_used: usize,
    n_ids: u64,
    /// The duration of a turn, seconds.
    turn_s: f64,
}

impl Track {
    /// The velocity, metres per second; `None` after only one cluster that was no piece.
    #[must_use]
    pub fn velocity_m_s(&self) -> Option<[f64; 3]> {
        self.axes.filter(|_| self.n_whole > 1).map(|axes| axes.map(|axis| axis.velocity))
    }

    /// The cost of matching `seen` (a negative log-likelihood): the squared Mahalanobis distance
    /// plus the logarithms of the variances plus the mismatch of sizes. `None` beyond the gate.
    fn cost(&self, seen: &Observation<'_>) -> Option<f64> {
        let (sigma, middle) = (off_m(seen), self.footprint.middle(seen));
        let dt = seen.time_s - self.last_s;
        let (mut distance, mut logarithm) = (0.0, 0.0);
        for (i, axis) in self.axes?.into_iter().enumerate() {
            let axis = axis.after(dt, ACCELERATION_M_S2[i]);
            let variance = axis.variance(sigma);
            distance += (middle[i] - axis.place).powi(2) / variance;
            logarithm += libm::log(variance);
        }
        (distance <= GATE).then_some(distance + logarithm + self.footprint.mismatch(seen))
    }

    /// The velocity, once it does not show the noise of the first boxes.
    #[must_use]
    pub fn settled_velocity_m_s(&self) -> Option<[f64; 3]> {
        self.velocity_m_s().filter(|_| self.n_whole >= SETTLED)
    }

    /// How far the object moves until `time_s`, metres.
    fn way_m(&self, time_s: f64) -> [f64; 3] {
        let dt = time_s - self.last_s;
        self.axes.map_or([0.0; 3], |axes| axes.map(|axis| dt * axis.velocity))
    }

    /// Moves the object to `time_s`.
    fn advance(&mut self, time_s: f64) {
        self.whole.advance(self.way_m(time_s));
        let dt = time_s - self.last_s;
        for (i, axis) in self.axes.iter_mut().flatten().enumerate() {
            *axis = axis.after(dt, ACCELERATION_M_S2[i]);
        }
    }

    fn update(&mut self, seen: &Observation<'_>) {
        self.advance(seen.time_s);
        let (sigma, middle) = (off_m(seen), self.footprint.middle(seen));
        for (i, axis) in self.axes.iter_mut().flatten().enumerate() {
            axis.update(middle[i], sigma);
        }
        self.note(seen);
    }

    /// Adds a piece of the object.
    fn add_piece(&mut self, time_s: f64) {
        self.advance(time_s);
        self.last_s = time_s;
        self.n_seen += 1;
        self.is_piece = true;
    }

    /// Begins a new track in the memory of this one.
    fn begin(&mut self, id: u64, seen: &Observation<'_>) {
        let sigma = off_m(seen);
        let axis = |i: usize| Axis::new(seen.position_m[i], sigma, FIRST_VELOCITY_M_S[i]);
        let mut log_probabilities = std::mem::take(&mut self.log_probabilities);
        log_probabilities.clear();
        let footprint = Footprint { yaw_rad: seen.yaw_rad, sides_m: [0.0; 2] };
        let axes = Some([0, 1, 2].map(axis));
        *self = Self { id, axes, footprint, log_probabilities, ..Self::default() };
        self.note(seen);
    }

    fn note(&mut self, seen: &Observation<'_>) {
        self.footprint.update(seen);
        self.is_piece = false;
        (self.last_s, self.last_whole_s) = (seen.time_s, seen.time_s);
        self.n_seen += 1;
        self.n_whole += 1;
        let Some(log_probabilities) = seen.view else { return };
        self.n_views += 1;
        self.log_probabilities.resize(log_probabilities.len(), 0.0);
        let weight = (1.0 / self.n_views as f64).max(LEAST_WEIGHT);
        for (mean, new) in self.log_probabilities.iter_mut().zip(log_probabilities) {
            *mean += weight * (new - *mean);
        }
    }
}

impl Tracker {
    pub fn new(n_classes: usize) -> Self {
        let track =
            || Track { log_probabilities: Vec::with_capacity(n_classes), ..Track::default() };
        let tracks = (0..MOST_TRACKS).map(|_| track()).collect();
        Self { tracks, n_used: 0, n_ids: 0, turn_s: 0.1 }
    }

    pub fn set_turn(&mut self, turn_s: f64) {
        self.turn_s = turn_s.clamp(LEAST_TURN_S, MOST_TURN_S);
    }

    /// How long a turn takes, seconds.
    pub fn turn_s(&self) -> f64 {
        self.turn_s
    }

    /// Forgets all objects; track numbers continue.
    pub fn forget(&mut self) {
        for track in &mut self.tracks {
            track.axes = None;
        }
    }

    /// Adds `seen` to the track that it matches, or to a new one, and returns the track. A piece of
    /// an object that has been seen more often belongs to that one; `None` if that one already has a
    /// cluster in this turn. A track that has been seen for some turns keeps its clusters.
    pub fn observe(&mut self, seen: &Observation<'_>) -> Option<&mut Track> {
        let waits = |track: &Track| seen.time_s - track.last_s;
        // A track that already has a cluster in this turn does not take another.
        let due = 0.5 * self.turn_s..=PATIENCE_S;
        let tracks = || self.tracks[..self.n_used].iter().enumerate();
        let due_tracks = tracks().filter(|(_, track)| due.contains(&waits(track)));
        let costs = due_tracks.filter_map(|(at, track)| Some((track.cost(seen)?, at)));
        let matched = costs.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, at)| at);
        if let Some(at) = self.holder(seen, matched) {
            let track = &mut self.tracks[at];
            if due.contains(&(seen.time_s - track.last_s)) {
                track.add_piece(seen.time_s);
                return Some(track);
            }
            // A piece came before the object itself, which is seen now.
            if track.is_piece && track.cost(seen).is_some() {
                track.n_seen -= 1;
                track.update(seen);
            }
            return None;
        }
        let at = matched.unwrap_or_else(|| self.place_for_new(seen.time_s));
        match matched {
            Some(_) => self.tracks[at].update(seen),
            None => {
                self.n_ids += 1;
                self.tracks[at].begin(self.n_ids, seen);
            }
        }
        Some(&mut self.tracks[at])
    }

    /// The track of the object that `seen` is a piece of; `matched` is the track that it matches.
    fn holder(&self, seen: &Observation<'_>, matched: Option<usize>) -> Option<usize> {
        let n_seen = matched.map_or(0, |at| self.tracks[at].n_seen);
        if matched.is_some_and(|at| self.tracks[at].n_whole >= SETTLED) {
            return None;
        }
        let is_short = seen.whole_length_m.is_some_and(|length_m| length_m < SHORT_M);
        let holds = |track: &Track| {
            let is_older = track.n_seen > n_seen && seen.time_s - track.last_whole_s <= PATIENCE_S;
            let is_another = is_short && track.whole.place.size_m[0] > f64::from(SHORT_M);
            let is_known = track.axes.is_some() && is_older && !is_another;
            is_known && track.whole.holds(seen.position_m, seen.size_m[0], track.way_m(seen.time_s))
        };
        let holders =
            self.tracks[..self.n_used].iter().enumerate().filter(|(_, track)| holds(track));
        holders.max_by_key(|(_, track)| track.n_seen).map(|(at, _)| at)
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

/// The error of the middle of the box, metres.
fn off_m(seen: &Observation<'_>) -> f64 {
    OFF_M + OFF_SHARE * seen.size_m[0]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use formats::geometry::OrientedBox;

    use super::*;

    fn seen(time_s: f64, x: f64, y: f64) -> Observation<'static> {
        Observation {
            time_s,
            position_m: [x, y, 0.0],
            size_m: [1.0; 2],
            yaw_rad: 0.0,
            sensor_m: [0.0; 2],
            view: None,
            whole_length_m: None,
        }
    }

    #[test]
    fn two_persons_keep_their_numbers_while_they_pass_each_other() {
        let mut tracker = Tracker::new(2);
        let mut ids = [vec![], vec![]];
        for turn in 0..60 {
            let t = f64::from(turn) * 0.1;
            ids[0].push(tracker.observe(&seen(t, -3.0 + t, 0.0)).unwrap().id);
            ids[1].push(tracker.observe(&seen(t + 0.01, 3.0 - t, 0.8)).unwrap().id);
        }
        assert!(ids[0].iter().all(|&id| id == 1), "{:?}", ids[0]);
        assert!(ids[1].iter().all(|&id| id == 2), "{:?}", ids[1]);
    }

    /// A car of 4 m, of which only a door is seen in the second turn, at first; a person who leans on it,
    /// and something beside it.
    #[test]
    fn a_piece_of_a_car_joins_its_track() {
        let mut tracker = Tracker::new(2);
        let whole =
            OrientedBox { centre_m: [10.0, 0.0, 0.0], size_m: [4.0, 1.6, 1.5], yaw_rad: 0.0 };
        let car = Observation { size_m: [4.0, 1.6], ..seen(0.0, 10.0, 0.0) };
        let track = tracker.observe(&car).unwrap();
        track.whole.fuse(0, &whole, [0.0; 2], None);
        let door = Observation { size_m: [0.9, 0.1], ..seen(0.1, 11.9, -0.7) };
        let track = tracker.observe(&door).unwrap();
        assert!(track.id == 1 && track.is_piece && track.whole.place == whole);
        assert_eq!(track.velocity_m_s(), None);
        assert!(tracker.observe(&Observation { time_s: 0.1, ..car }).is_none());
        let person = Observation { whole_length_m: Some(0.8), ..seen(0.1, 11.0, 0.7) };
        assert_eq!(tracker.observe(&person).unwrap().id, 2);
        assert_eq!(tracker.observe(&seen(0.1, 10.0, -1.5)).unwrap().id, 3);
        let longer = Observation { size_m: [6.0, 1.0], ..seen(0.1, 10.0, 0.5) };
        assert_eq!(tracker.observe(&longer).unwrap().id, 4);
        let track = tracker.observe(&Observation { time_s: 0.2, ..car }).unwrap();
        assert!((track.id, track.n_seen) == (1, 3) && !track.is_piece);
    }

    /// A piece moves the box with the velocity of the whole, and belongs to the object of two that was seen
    /// more often.
    #[test]
    fn the_box_of_an_object_goes_on_while_pieces_are_seen() {
        let mut tracker = Tracker::new(2);
        let whole = |x, size_m| OrientedBox { centre_m: [x, 0.0, 0.0], size_m, yaw_rad: 0.0 };
        for t in [0.0, 0.1, 0.2] {
            let car = Observation { size_m: [4.0, 1.6], ..seen(t, 10.0 + 8.0 * t, 0.0) };
            let track = tracker.observe(&car).unwrap();
            track.whole.fuse(0, &whole(10.0 + 8.0 * t, [4.0, 1.6, 1.5]), [0.0; 2], None);
        }
        let other = tracker.observe(&seen(0.2, 16.0, 9.0)).unwrap();
        other.whole.fuse(0, &whole(10.0, [9.0, 9.0, 1.5]), [0.0; 2], None);
        let door = Observation { size_m: [0.9, 0.1], ..seen(0.3, 13.8, -0.7) };
        let track = tracker.observe(&door).unwrap();
        let [vx, ..] = track.velocity_m_s().unwrap();
        assert!(track.id == 1 && track.is_piece && (vx - 8.0).abs() < 1.0, "{vx} m/s");
        assert!((track.whole.place.centre_m[0] - (11.6 + 0.1 * vx)).abs() < 1e-9);
    }

    #[test]
    fn a_car_is_found_again_after_a_second_and_not_after_two() {
        let mut tracker = Tracker::new(2);
        let at = |t: f64| seen(t, 12.0 * t, 3.0);
        (0..20).for_each(|turn| {
            tracker.observe(&at(f64::from(turn) * 0.1));
        });
        assert_eq!(tracker.observe(&at(2.9)).unwrap().id, 1);
        let velocity = tracker.observe(&at(3.0)).unwrap().velocity_m_s().unwrap();
        assert!((velocity[0] - 12.0).abs() < 0.1 && velocity[1].abs() < 0.1, "{velocity:?}");
        assert_eq!(tracker.observe(&at(5.0)).unwrap().id, 2);
    }

    /// After 0.1 s the variance of the innovation is twice that of the middle, s = 0.1 m + 0.05 of the
    /// length, plus (0.1 s v)^2 + (0.01 s^2 a / 2)^2; chi-squared with three degrees of freedom exceeds
    /// 11.345 once in a hundred. v and a are 8 m/s and 3 m/s^2 aside, and 0.5 of both upwards.
    #[test]
    fn one_in_a_hundred_of_the_clusters_of_an_object_is_beyond_its_gate() {
        for (size_m, axis, v, a) in
            [([1.0, 1.0], 0, 8.0, 3.0f64), ([4.2, 1.8], 1, 8.0, 3.0), ([1.0, 1.0], 2, 0.5, 0.5)]
        {
            let s: f64 = 0.1 + 0.05 * size_m[0];
            let variance = 2.0 * s.powi(2) + f64::powi(0.1 * v, 2) + (0.005 * a).powi(2);
            for (share, id) in [(0.995, 1), (1.005, 2)] {
                let mut tracker = Tracker::new(2);
                let mut next = Observation { size_m, ..seen(0.0, 20.0, 0.0) };
                assert_eq!(tracker.observe(&next).unwrap().velocity_m_s(), None);
                next.time_s = 0.1;
                next.position_m[axis] += share * (11.345 * variance).sqrt();
                assert_eq!(tracker.observe(&next).unwrap().id, id, "{axis} {share}");
            }
        }
    }

    #[test]
    fn a_class_firms_up_over_views() {
        let mut tracker = Tracker::new(2);
        let views = [[-2.0, -0.2], [-0.1, -3.0], [-0.1, -3.0]];
        let means = views.iter().enumerate().map(|(turn, view)| {
            let time_s = turn as f64 * 0.1;
            let seen = Observation { view: Some(view), ..seen(time_s, 1.0, 0.0) };
            tracker.observe(&seen).unwrap().log_probabilities.clone()
        });
        let means: Vec<_> = means.collect();
        assert_eq!(means[0], [-2.0, -0.2]);
        assert!((means[2][0] - -2.2 / 3.0).abs() < 1e-12);
    }

    /// A parked car shows first a corner, then its side and then its rear.
    #[test]
    fn an_occluded_part_of_a_car_does_not_move_it() {
        let mut tracker = Tracker::new(2);
        let views = [
            ([8.0, -5.0], [4.2, 1.8], 0.0),
            ([8.0, -4.1], [4.2, 0.0], 0.0),
            ([5.9, -5.0], [1.8, 0.0], FRAC_PI_2),
            ([5.9, -5.0], [1.8, 0.1], -FRAC_PI_2),
        ];
        for turn in 0..24 {
            let ([x, y], size_m, yaw_rad) = views[turn / 6];
            let seen = Observation { size_m, yaw_rad, ..seen(turn as f64 * 0.1, x, y) };
            let track = tracker.observe(&seen).unwrap();
            assert_eq!(track.id, 1, "turn {turn}");
            let [vx, vy, _] = track.velocity_m_s().unwrap_or_default();
            assert!(vx.hypot(vy) < 0.4, "turn {turn}: {vx} {vy}");
        }
    }

    #[test]
    fn a_second_cluster_within_half_a_turn_is_another_object() {
        for (turn_s, id) in [(0.1, 2), (0.05, 1), (0.2, 2)] {
            let mut tracker = Tracker::new(2);
            tracker.set_turn(turn_s);
            tracker.observe(&seen(0.0, 5.0, 0.0));
            assert_eq!(tracker.observe(&seen(0.04, 5.1, 0.0)).unwrap().id, id, "{turn_s}");
        }
    }

    #[test]
    fn a_class_follows_the_views_of_two_seconds() {
        let mut tracker = Tracker::new(1);
        let mut mean = |turn: u32, view: Option<f64>| {
            let view = view.as_ref().map(std::slice::from_ref);
            let seen = Observation { view, ..seen(f64::from(turn) * 0.1, 1.0, 0.0) };
            tracker.observe(&seen).unwrap().log_probabilities.clone()
        };
        (0..100).for_each(|turn| {
            mean(turn, Some(0.0));
        });
        (100..119).for_each(|turn| {
            mean(turn, Some(-1.0));
        });
        // The latest of 20 views has a weight of 1/20 from then on.
        let expected = -(1.0 - 0.95f64.powi(20));
        let found = mean(119, Some(-1.0));
        assert!((found[0] - expected).abs() < 1e-12, "{found:?} for {expected}");
        // Its memory goes to another object, which has no view yet.
        assert!(mean(200, None).is_empty());
    }

    /// The filter of a constant velocity lags behind an acceleration: in the steady state by
    /// a T (2 alpha - beta) / (2 beta), with alpha and beta from the tracking index (Kalata, "The
    /// tracking index", IEEE Transactions AES-20(2), 1984).
    #[test]
    fn the_velocity_of_an_accelerating_car_lags_as_derived() {
        let (acceleration, turn_s, off_m) = (3.0f64, 0.1f64, 0.1 + 0.05 * 1.0);
        let index = 3.0 * turn_s.powi(2) / off_m;
        let r = (4.0 + index - (8.0 * index + index.powi(2)).sqrt()) / 4.0;
        let alpha = 1.0 - r * r;
        let beta = 2.0 * (2.0 - alpha) - 4.0 * r;
        let lag_m_s = acceleration * turn_s * (2.0 * alpha - beta) / (2.0 * beta);
        let mut tracker = Tracker::new(2);
        let mut velocity = None;
        for turn in 0..60 {
            let t = f64::from(turn) * turn_s;
            let track = tracker.observe(&seen(t, 20.0 + acceleration * t * t / 2.0, 0.0)).unwrap();
            assert_eq!(track.id, 1, "turn {turn}");
            velocity = track.velocity_m_s();
        }
        let found_m_s = acceleration * 59.0 * turn_s - velocity.unwrap()[0];
        assert!((found_m_s - lag_m_s).abs() < 1e-3, "{found_m_s} for {lag_m_s}");
    }

    #[test]
    fn a_size_that_a_neighbour_inflated_decays_by_1_percent_per_turn() {
        let mut tracker = Tracker::new(2);
        for turn in 0..=50 {
            let size_m = if turn == 0 { [2.0, 1.0] } else { [1.0, 1.0] };
            let seen = Observation { size_m, ..seen(f64::from(turn) * 0.1, 9.0, 0.0) };
            assert_eq!(tracker.observe(&seen).unwrap().id, 1, "turn {turn}");
        }
        let [side_m, _] = tracker.tracks[0].footprint.sides_m;
        assert!((side_m - 2.0 * 0.99f64.powi(50)).abs() < 1e-12, "{side_m}");
    }

    #[test]
    fn equally_near_tracks_are_matched_by_size() {
        for (size_m, id) in [([0.6, 0.6], 1), ([4.2, 1.8], 2)] {
            let mut tracker = Tracker::new(2);
            tracker.observe(&Observation { size_m: [0.6, 0.6], ..seen(0.0, 20.0, 0.0) });
            tracker.observe(&Observation { size_m: [4.2, 1.8], ..seen(0.0, 21.0, 0.0) });
            let found =
                tracker.observe(&Observation { size_m, ..seen(0.1, 20.5, 0.0) }).unwrap().id;
            assert_eq!(found, id, "{size_m:?}");
        }
    }

    #[test]
    fn tracks_are_bounded_and_their_memory_is_used_again() {
        let mut tracker = Tracker::new(2);
        for i in 0..5000 {
            tracker.observe(&seen(0.0, f64::from(i) * 100.0, 0.0));
        }
        assert_eq!(tracker.n_used, MOST_TRACKS);
        tracker.observe(&seen(100.0, 0.0, 0.0));
        assert_eq!(tracker.n_used, MOST_TRACKS);
        tracker.forget();
        assert_eq!(tracker.observe(&seen(100.1, 0.0, 0.0)).unwrap().id, 5002);
    }
}
