use std::f64::consts::TAU;
use std::time::Instant;

use formats::geometry::Pose;
use formats::returns::Return;

use super::arrival::Arrival;
use super::counts::Counts;
use super::object::Object;
use super::object_classifier::ObjectClassifier;
use super::options::{LiveError, LiveOptions};
use super::packet_clock::Succession;
use super::report::Seen;
use super::sensor::{Facts, Flaw};
use super::sensor_stream::SensorStream;
use super::stats::{Stage, Stats};
use super::tracker::Tracker;
use super::waiting::{Tag, Waiting};
use crate::classify::classifier::Classifier;

/// After this number of consecutive packets of another model (about 0.3 s), the sensor is taken as
/// replaced.
const MOST_FOREIGN: u32 = 300;

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

/// Decodes, segments, classifies and tracks the data of one sensor.
///
/// Every packet is decoded or counted as foreign; no packet ends the pipeline, and its memory is
/// bounded.
pub struct Pipeline {
    options: LiveOptions,
    sensor: Option<SensorStream>,
    returns: Vec<Return>,
    /// When the packet of `returns` was sent, Unix time in seconds; `None` if it was not used.
    taken_s: Option<f64>,
    waiting: Waiting,
    classifiers: ObjectClassifier,
    tracker: Tracker,
    counts: Counts,
    stats: Stats,
    /// The flaws of packets so far, one of each kind.
    flaws: Vec<Flaw>,
    n_reported: usize,
}

impl Pipeline {
    /// A pipeline that classifies clusters with as many threads as `classifier` has.
    ///
    /// # Errors
    /// Invalid settings; threads that cannot be started.
    pub fn new(classifier: Classifier, options: &LiveOptions) -> Result<Self, LiveError> {
        options.segmentation.check()?;
        let classifiers = ObjectClassifier::new(classifier)?;
        Ok(Self {
            options: options.clone(),
            sensor: None,
            returns: Vec::new(),
            taken_s: None,
            waiting: Waiting::new(),
            tracker: Tracker::new(classifiers.classes.len()),
            classifiers,
            counts: Counts::default(),
            stats: Stats::new(),
            flaws: Vec::new(),
            n_reported: 0,
        })
    }

    /// Takes a packet: decodes it, places it in time, and passes its returns to the stream of
    /// clusters. [`Pipeline::answer`] then reports the clusters that it completes.
    pub fn take(&mut self, payload: &[u8], arrival: Arrival) {
        self.taken_s = None;
        let arrival = arrival.likely();
        match self.decode(payload) {
            Err(flaw) => self.refuse(flaw),
            Ok(facts) => {
                let decoded = Instant::now();
                if let Some(packet) = self.in_order(&facts, arrival) {
                    self.segment(&facts, packet);
                }
                self.stats.spend(Stage::Segment, decoded.elapsed());
            }
        }
    }

    /// Reports the complete clusters: classifies them at all widths, assigns those that are
    /// recognised best to tracks, adds each to the box of its whole object, and passes each to
    /// `each`, in the order in which the beams passed them.
    pub fn answer(&mut self, mut each: impl FnMut(&Object)) {
        let Self { options, waiting, classifiers, tracker, counts, stats, .. } = self;
        if waiting.nodes.is_empty() {
            return;
        }
        let start = Instant::now();
        classifiers.classify(waiting, options.min_points);
        let classified = Instant::now();
        stats.spend(Stage::Classify, classified - start);

        let motion = options.ego_motion.as_ref();
        for chosen in &classifiers.chosen {
            let seen = Seen::new(waiting, chosen, motion);
            let view = classifiers.view(chosen.node);
            let usual_length_m =
                classifiers.usual_size_m(chosen.node).map(|[length_m, _]| length_m);
            let Some(track) = tracker.observe(&seen.observation(view, usual_length_m)) else {
                continue;
            };
            let fused = classifiers.fused(&track.log_probabilities);
            seen.fuse_whole(track, fused.as_ref(), view.is_some());
            // An object that was seen once may be noise.
            if track.n_seen < options.min_turns {
                continue;
            }
            let latency = seen.latency();
            each(&seen.report(track, fused.as_ref(), view, latency));
            counts.clusters += 1;
            counts.unclassified += u64::from(view.is_none());
            latency.into_iter().for_each(|latency| stats.answered_after(latency, seen.turn()));
        }
        waiting.clear();
        stats.spend(Stage::Track, classified.elapsed());
    }

    /// Completes all clusters, for example at the end of a recording.
    pub fn end(&mut self) {
        self.taken_s = None;
        let Self { sensor: Some(sensor), waiting, options, .. } = self else { return };
        sensor.end(waiting, options.ego_motion.as_ref());
    }

    /// Decodes the returns of a packet; the first one decides which sensor it is.
    fn decode(&mut self, payload: &[u8]) -> Result<Facts, Flaw> {
        let Self { sensor, options, returns, stats, .. } = self;
        let start = Instant::now();
        let sensor = match sensor {
            Some(sensor) => sensor,
            None => sensor.insert(SensorStream::new(payload, options)?),
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
                self.end();
                self.sensor = None;
                self.counts.restarts += 1;
                self.tracker.forget();
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
                self.end();
                self.tracker.forget();
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
        is_used.then_some((Tag { time_s, moment: arrival.moment, ring: 0 }, is_behind_gap))
    }

    /// Passes the decoded returns of a packet to the stream.
    fn segment(&mut self, facts: &Facts, packet: (Tag, bool)) {
        let Self { sensor: Some(sensor), options, returns, waiting, counts, .. } = self else {
            return;
        };
        self.taken_s = Some(packet.0.time_s);
        counts.packets += 1;
        counts.points += returns.len() as u64;
        if facts.speed_rad_us > 0.0 {
            self.tracker.set_turn(TAU / facts.speed_rad_us * 1e-6);
        }
        let n_turns = sensor.stream.n_turns();
        sensor.push(facts, returns, packet, waiting, options.ego_motion.as_ref());
        counts.dropped_points = sensor.stream.dropped().total();
        if sensor.stream.n_turns() > n_turns {
            self.stats.end_turn(counts);
        }
    }

    /// The content of the last packet of [`Pipeline::take`]; `None` if it was late, a duplicate or
    /// foreign, and after [`Pipeline::end`].
    #[must_use]
    pub fn decoded(&self) -> Option<Decoded<'_>> {
        let turn = self.sensor.as_ref()?.stream.n_turns();
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
