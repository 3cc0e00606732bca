use std::f64::consts::TAU;
use std::path::Path;
use std::time::Instant;

use edgepuck_segment::Sweep;
use formats::geometry::Pose;
use formats::returns::Return;

use super::arrival::Arrival;
use super::classes::Classes;
use super::counts::Counts;
use super::object::Object;
use super::options::LiveOptions;
use super::packet_clock::Succession;
use super::report::Seen;
use super::sensor::{Facts, Flaw};
use super::sensor_data::SensorData;
use super::stats::{Stage, Stats};
use super::tracker::Tracker;
use super::turns::{Tag, Turn, Turns};
use crate::classify::options::Options;
use crate::detect::{DetectError, Detector};

/// After this number of consecutive packets of another model (about 0.3 s), the sensor is taken as
/// replaced.
const MOST_FOREIGN: u32 = 300;
/// This many turns in a row (about two seconds) are late because the machine is too slow.
const MOST_LATE: u32 = 20;
/// The least confidence of an object that a track takes into account: several turns make it sure, or
/// unknown.
const LEAST_CONFIDENCE: f64 = 0.15;

/// A decoded packet.
#[derive(Clone, Copy, Debug)]
pub struct Decoded<'a> {
    /// Its returns, in the sensor's frame, with times relative to `time_s`.
    pub returns: &'a [Return],
    /// When it was sent: Unix time in seconds by the sensor's clock.
    pub time_s: f64,
    /// The number of the turn, from 0.
    pub turn: u64,
}

/// Decodes the data of one sensor, and detects and tracks its objects.
///
/// Every packet is decoded or counted as foreign; no packet ends the pipeline, and its memory is
/// bounded.
pub struct Pipeline {
    options: LiveOptions,
    sensor: Option<SensorData>,
    turns: Turns,
    returns: Vec<Return>,
    /// When the packet of `returns` was sent, Unix time in seconds; `None` if it was not used.
    taken_s: Option<f64>,
    detector: Detector,
    classes: Classes,
    tracker: Tracker,
    counts: Counts,
    stats: Stats,
    /// The flaws of packets so far, one of each kind.
    flaws: Vec<Flaw>,
    n_reported: usize,
    /// How many turns in a row took longer than the sensor's.
    n_late: u32,
}

impl Pipeline {
    /// A pipeline with a bundled bird's-eye model or the one at a path.
    ///
    /// # Errors
    /// A model that cannot be loaded with these options; invalid settings.
    pub fn open(model: &Path, options: &Options, live: &LiveOptions) -> Result<Self, DetectError> {
        let mut detector =
            Detector::with(model, options, live.min_points, live.segmentation.clone())?;
        detector.min_confidence = LEAST_CONFIDENCE;
        let classes = Classes::new(&detector.classes());
        Ok(Self {
            options: live.clone(),
            sensor: None,
            turns: Turns::default(),
            returns: Vec::new(),
            taken_s: None,
            detector,
            tracker: Tracker::new(classes.n()),
            classes,
            counts: Counts::default(),
            stats: Stats::new(),
            flaws: Vec::new(),
            n_reported: 0,
            n_late: 0,
        })
    }

    /// The names of the classes of objects, `unknown` being the last.
    pub fn classes(&self) -> impl Iterator<Item = &str> {
        self.classes.names()
    }

    /// Takes a packet: decodes it, places it in time, and adds its returns to the turn.
    /// [`Pipeline::answer`] then reports the objects of the turn that it completes.
    pub fn take(&mut self, payload: &[u8], arrival: Arrival) {
        self.taken_s = None;
        let arrival = arrival.likely();
        match self.decode(payload) {
            Err(flaw) => self.refuse(flaw),
            Ok(facts) => {
                if let Some(packet) = self.in_order(&facts, arrival) {
                    self.add(&facts, packet);
                }
            }
        }
    }

    /// Detects the objects of complete turns, assigns them and the clusters of what is left to tracks,
    /// and passes each to `each`, in the order in which the beams passed them.
    pub fn answer(&mut self, mut each: impl FnMut(&Object)) {
        while let Some(mut turn) = self.turns.take() {
            self.answer_turn(&mut turn, &mut each);
            if turn.is_last {
                self.tracker.forget();
            }
            self.turns.give_back(turn);
        }
    }

    fn answer_turn(&mut self, turn: &mut Turn, each: &mut impl FnMut(&Object)) {
        let Self { options, detector, classes, tracker, counts, stats, .. } = self;
        let start = Instant::now();
        let motion = options.ego_motion.as_ref().filter(|_| !turn.points.is_empty());
        let pose = motion.map(|motion| turn.rectify(motion));
        let sweep = Sweep { points: &turn.points, rings: Some(&turn.rings) };
        let found = match detector.detect(&sweep) {
            Ok(found) => found,
            Err(error) => return self.note(Flaw::Turn(error.to_string())),
        };
        let detected = Instant::now();
        stats.spend(Stage::Detect, detected - start);

        let clusters = detector.clusters().enumerate();
        let mut all: Vec<_> = clusters
            .map(|(number, cluster)| Seen::new(turn, cluster, found.objects.get(number), pose))
            .collect();
        all.sort_by(|a, b| a.last_s().total_cmp(&b.last_s()));
        for seen in all {
            let is_asked = seen.n_points() >= options.min_points;
            let view = is_asked.then(|| classes.view(seen.object()));
            let Some(track) = tracker.observe(&seen.observation(view.as_deref())) else {
                continue;
            };
            let fused = classes.fused(&track.log_probabilities);
            seen.fuse_whole(track, fused.as_ref());
            // An object that was seen once may be noise.
            if track.n_seen < options.min_turns {
                continue;
            }
            let latency = seen.latency();
            each(&seen.report(track, fused.as_ref(), view.as_deref(), latency));
            counts.clusters += 1;
            counts.unclassified += u64::from(view.is_none());
            latency.into_iter().for_each(|latency| stats.answered_after(latency));
        }
        stats.spend(Stage::Track, detected.elapsed());
        stats.end_turn(counts, turn.is_whole);
        let (took_s, turn_s) = (start.elapsed().as_secs_f64(), tracker.turn_s());
        let is_live = turn.tags.iter().any(|tag| tag.moment.is_some());
        self.n_late = if is_live && took_s > turn_s { self.n_late + 1 } else { 0 };
        if self.n_late == MOST_LATE {
            self.note(Flaw::Late { took_s, turn_s });
        }
    }

    /// Completes the turn, for example at the end of a recording.
    pub fn end(&mut self) {
        self.taken_s = None;
        self.turns.end();
    }

    /// Completes the turn, after which all objects are new ones.
    fn break_off(&mut self) {
        self.taken_s = None;
        if self.turns.break_off() {
            self.tracker.forget();
        }
    }

    /// Decodes the returns of a packet; the first one decides which sensor it is.
    fn decode(&mut self, payload: &[u8]) -> Result<Facts, Flaw> {
        let Self { sensor, options, turns, returns, stats, .. } = self;
        let start = Instant::now();
        let sensor = match sensor {
            Some(sensor) => sensor,
            None => {
                let first = sensor.insert(SensorData::new(payload, options)?);
                turns.begin(first.capacity());
                first
            }
        };
        let facts = sensor.decoder.decode(payload, returns)?;
        sensor.n_foreign = 0;
        stats.spend(Stage::Decode, start.elapsed());
        Ok(facts)
    }

    /// Counts a packet that is not the sensor's data.
    fn refuse(&mut self, flaw: Flaw) {
        self.counts.foreign += 1;
        if let Some(sensor) = &mut self.sensor {
            sensor.n_foreign += 1;
            // The first sensor is silent, and another one sends instead.
            if flaw.is_of_another_model() && sensor.n_foreign >= MOST_FOREIGN {
                self.break_off();
                self.sensor = None;
                self.counts.restarts += 1;
            }
        }
        self.note(flaw);
    }

    fn note(&mut self, flaw: Flaw) {
        if !self.flaws.iter().any(|known| known.is_like(&flaw)) {
            self.flaws.push(flaw);
        }
    }

    /// The time of a packet, and whether others are missing before it; `None` if it is late or a
    /// duplicate. Counts the relation of the packet to the one before. After a gap of a turn, all clusters
    /// before it are completed.
    fn in_order(&mut self, facts: &Facts, arrival: Arrival) -> Option<(Tag, bool)> {
        let clock = &mut self.sensor.as_mut()?.clock;
        let (succession, time_s) = clock.take(facts.stamp_us, facts.duration_us, arrival.time_s);
        if let Some([recorded_s, stamped_s]) = clock.disagreement_s() {
            self.note(Flaw::Times { recorded_s, stamped_s });
        }
        match succession {
            Succession::Duplicate => self.counts.duplicated += 1,
            Succession::Late => self.counts.late += 1,
            Succession::First => {}
            Succession::Restart => {
                self.counts.restarts += 1;
                self.break_off();
            }
            Succession::Follows { missing } => {
                self.counts.lost += missing.saturating_sub(facts.n_unsent);
                self.counts.lost = self.counts.lost.saturating_sub(facts.n_unsent_before);
                // Beyond a turn, the azimuth does not determine how far the head has turned.
                let turned_rad = missing as f64 * facts.duration_us * facts.speed_rad_us;
                if turned_rad > TAU {
                    self.end();
                }
            }
        }
        let is_used = !matches!(succession, Succession::Duplicate | Succession::Late);
        let is_behind_gap = matches!(succession, Succession::Follows { missing: 1.. });
        is_used.then_some((Tag { time_s, moment: arrival.moment }, is_behind_gap))
    }

    /// Adds the decoded returns of a packet to the turn.
    fn add(&mut self, facts: &Facts, packet: (Tag, bool)) {
        let Self { turns, returns, counts, .. } = self;
        self.taken_s = Some(packet.0.time_s);
        counts.packets += 1;
        counts.points += returns.len() as u64;
        if facts.speed_rad_us > 0.0 {
            self.tracker.set_turn(TAU / facts.speed_rad_us * 1e-6);
        }
        turns.add(facts, returns, packet);
        counts.dropped_points = turns.n_dropped();
    }

    /// The content of the last packet of [`Pipeline::take`]; `None` if it was late, a duplicate or
    /// foreign, and after [`Pipeline::end`].
    #[must_use]
    pub fn decoded(&self) -> Option<Decoded<'_>> {
        let turn = self.turns.n_ended();
        self.taken_s.map(|time_s| Decoded { returns: &self.returns, time_s, turn })
    }

    /// The pose of the sensor at the Unix time `time_s`; `None` if its motion is unknown.
    #[must_use]
    pub fn pose(&self, time_s: f64) -> Option<Pose> {
        self.options.ego_motion.as_ref().map(|motion| motion.at_unnormalized(time_s))
    }

    /// The counters.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// The durations of stages and the latencies.
    #[must_use]
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

    /// The flaws that no earlier call returned: one of each kind.
    pub fn new_flaws(&mut self) -> &[Flaw] {
        let reported = std::mem::replace(&mut self.n_reported, self.flaws.len());
        &self.flaws[reported..]
    }
}
