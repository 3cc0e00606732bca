use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

use edgepuck_segment::{OrientedBox, Settings, SettingsError, Stream};
use formats::ouster::Metadata;
use formats::returns::Return;
use glam::DVec3;

use super::counts::Counts;
use super::ego_motion::{EgoMotion, Pose};
use super::footprint::Observation;
use super::object::{Object, PlacedBox, SCHEMA_VERSION};
use super::object_classifier::{Chosen, ObjectClassifier};
use super::packet_clock::{PacketClock, Succession};
use super::sensor::{Decoder, Facts, Flaw};
use super::stats::{Stage, Stats};
use super::tracker::Tracker;
use super::waiting::{Motion, Tag, Waiting};
use super::whole::Whole;
use crate::classifier::Classifier;
use crate::error::Error;
use crate::usual_size::usual_size_m;

/// The capacity for returns of each ring: 1.5 times as many as a VLP-32C sends in its slowest turn
/// with dual returns.
const ROOM_PER_RING: u32 = 8192;

/// Valid times of arrival, seconds of Unix time: three thousand years.
const LIKELY_S: RangeInclusive<f64> = 0.0..=1e11;

/// After this number of consecutive packets of another model (about 0.3 s), the sensor is taken as
/// replaced.
const MOST_FOREIGN: u32 = 300;

/// The widest columns, degrees: the steps of a sensor are narrower, unless its packet is damaged.
const WIDEST_DEG: f32 = 1.0;

/// The options of a pipeline.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LiveOptions {
    /// The fewest points of a cluster that is classified.
    pub min_points: usize,
    /// In how many clusters an object has been seen when it is first reported; at least 1.
    pub min_turns: u64,
    /// The settings of the segmentation. The elevations of the rings come from the sensor.
    pub segmentation: Settings,
    /// The motion of the sensor, if known.
    pub ego_motion: Option<EgoMotion>,
    /// The metadata of an Ouster; without it, the sensor is a Velodyne.
    pub ouster: Option<Metadata>,
    /// Whether the packets come from a recording, whose times of arrival may have been changed
    /// since. Then the sensor's stamps give the intervals between packets.
    pub is_recorded: bool,
}

impl Default for LiveOptions {
    fn default() -> Self {
        Self {
            min_points: 20,
            min_turns: 2,
            segmentation: Settings::default(),
            ego_motion: None,
            ouster: None,
            is_recorded: false,
        }
    }
}

/// Errors of creating a pipeline.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// Invalid settings of the segmentation.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The classifiers cannot be created.
    #[error(transparent)]
    Classifier(#[from] Error),
}

/// The time of arrival of a packet.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Unix time in seconds.
    pub time_s: f64,
    /// The moment, for latencies; `None` for packets of a capture that is read as fast as possible.
    pub moment: Option<Instant>,
}

impl Arrival {
    /// The arrival of a packet now.
    #[must_use]
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        // A clock before 1970 is not set; its time is taken as 0.
        let time_s = since.map_or(0.0, |since| since.as_secs_f64());
        Self { time_s, moment: Some(Instant::now()) }
    }

    /// The arrival at a valid time: a capture may have any time stamp.
    pub(super) fn likely(self) -> Self {
        let time_s = if LIKELY_S.contains(&self.time_s) { self.time_s } else { 0.0 };
        Self { time_s, ..self }
    }
}

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
    sensor: Option<Sensor>,
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

/// The sensor of the first packet.
struct Sensor {
    decoder: Decoder,
    clock: PacketClock,
    stream: Stream<Tag>,
    /// When its first packet came, Unix time in seconds.
    start_s: f64,
    /// The number of foreign packets since its last packet.
    n_foreign: u32,
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

    /// Processes a packet. [`Pipeline::answer`] then reports the clusters that it completes.
    pub fn take(&mut self, payload: &[u8], arrival: Arrival) {
        self.taken_s = None;
        let Err(flaw) = self.take_data(payload, arrival.likely()) else { return };
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

    fn take_data(&mut self, payload: &[u8], arrival: Arrival) -> Result<(), Flaw> {
        let Self { sensor, options, returns, stats, .. } = self;
        let start = Instant::now();
        let sensor = match sensor {
            Some(sensor) => sensor,
            None => sensor.insert(Sensor::new(payload, options, arrival.time_s)?),
        };
        let facts = sensor.decoder.decode(payload, returns)?;
        sensor.n_foreign = 0;
        let decoded = Instant::now();
        stats.spend(Stage::Decode, decoded - start);
        let (succession, time_s) =
            sensor.clock.take(facts.stamp_us, facts.duration_us, arrival.time_s);
        if let Some([recorded_s, stamped_s]) = sensor.clock.disagreement_s() {
            self.note(Flaw::Times { recorded_s, stamped_s });
        }
        if self.is_in_order(succession, &facts) {
            self.taken_s = Some(time_s);
            self.segment(&facts, Tag { time_s, moment: arrival.moment, ring: 0 });
        }
        self.stats.spend(Stage::Segment, decoded.elapsed());
        Ok(())
    }

    /// Counts the relation of a packet to the one before, and returns whether its returns are used.
    /// After a long gap, all clusters before it are completed.
    fn is_in_order(&mut self, succession: Succession, facts: &Facts) -> bool {
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
                // Beyond a quarter of a turn, the azimuth does not determine how far the head has
                // turned.
                let turned_rad = missing as f64 * facts.duration_us * facts.speed_rad_us;
                if turned_rad > FRAC_PI_2 {
                    self.end();
                }
            }
        }
        !matches!(succession, Succession::Duplicate | Succession::Late)
    }

    /// Passes the decoded returns of a packet to the stream.
    fn segment(&mut self, facts: &Facts, packet: Tag) {
        let Self { sensor: Some(sensor), options, returns, waiting, counts, .. } = self else {
            return;
        };
        let motion = sensor.motion(options);
        counts.packets += 1;
        counts.points += returns.len() as u64;
        if facts.speed_rad_us > 0.0 {
            self.tracker.set_turn(TAU / facts.speed_rad_us * 1e-6);
        }
        let n_turns = sensor.stream.n_turns();
        sensor.push(facts, returns, packet, waiting, motion);
        counts.dropped_points = sensor.stream.dropped().total();
        if sensor.stream.n_turns() > n_turns {
            self.stats.end_turn();
        }
    }

    /// Completes all clusters, for example at the end of a recording.
    pub fn end(&mut self) {
        self.taken_s = None;
        let Self { sensor: Some(sensor), waiting, options, .. } = self else { return };
        let motion = sensor.motion(options);
        sensor.end(waiting, motion);
    }

    /// Classifies the complete clusters at all widths, tracks those that are recognised best, and
    /// passes each to `each`, in the order in which the beams passed them.
    pub fn answer(&mut self, mut each: impl FnMut(&Object)) {
        if self.waiting.nodes.is_empty() {
            return;
        }
        let start = Instant::now();
        let motion = self.sensor.as_ref().and_then(|sensor| sensor.motion(&self.options));
        self.classifiers.classify(&self.waiting, self.options.min_points);
        let classified = Instant::now();
        self.stats.spend(Stage::Classify, classified - start);
        for &Chosen { node, span: [first, last] } in &self.classifiers.chosen {
            let view = self.classifiers.view(node);
            let cluster = &self.waiting.nodes[node];
            let points = &self.waiting.points[cluster.points.clone()];
            let pose = motion.map(|motion| motion.pose(cluster.pose_s));
            let sensor_m = pose.map_or([0.0; 2], |pose| pose.position_m.truncate().to_array());
            let seen = OrientedBox::around(points);
            let place = placed(&seen, pose);
            let Some(track) = self.tracker.observe(&Observation {
                time_s: last.time_s,
                position_m: place.centre_m,
                size_m: [place.size_m[0], place.size_m[1]],
                yaw_rad: place.yaw_deg.to_radians(),
                sensor_m,
                view,
                usual_length_m: self.classifiers.usual_size_m(node).map(|[length, _]| length),
            }) else {
                continue;
            };
            let fused = self.classifiers.fused(&track.log_probabilities, track.energy);
            let confidence = view.zip(fused.as_ref());
            let usual_m =
                fused.as_ref().and_then(|fused| Some((fused.class, usual_size_m(&fused.answer)?)));
            match usual_m {
                Some((class, usual_m)) if view.is_some() && !track.is_piece => {
                    let whole = placed(&seen.completed(usual_m, cluster.ground_z_m), pose);
                    let velocity = track.settled_velocity_m_s().filter(|_| pose.is_some());
                    track.whole.fuse(class, &whole, sensor_m, velocity);
                }
                Some(_) => {}
                None => track.whole = Whole::default(),
            }
            let whole_box = track.whole.is_known().then(|| track.whole.placed());
            if track.n_seen < self.options.min_turns {
                continue;
            }
            let latency = last.moment.map(|moment| moment.elapsed());
            self.counts.clusters += 1;
            self.counts.unclassified += u64::from(view.is_none());
            each(&Object {
                version: SCHEMA_VERSION,
                turn: cluster.turn,
                track: track.id,
                class: fused.as_ref().map(|fused| Arc::clone(&fused.answer)),
                resembles: fused
                    .as_ref()
                    .map(|fused| Arc::clone(&self.classifiers.classes[fused.class])),
                confidence: confidence.map(|((view, _), fused)| libm::exp(view[fused.class])),
                probability: fused.as_ref().map(|fused| fused.probability),
                frame: if pose.is_some() { "world" } else { "sensor" },
                position_m: place.centre_m,
                size_m: place.size_m,
                yaw_deg: place.yaw_deg,
                velocity_m_s: track.velocity_m_s(),
                points: points.len(),
                range_m: f64::from(libm::hypotf(seen.centre_m[0], seen.centre_m[1])),
                first_s: first.time_s,
                last_s: last.time_s,
                latency_ms: latency.map(|latency| latency.as_secs_f64() * 1e3),
                whole_box,
            });
            latency
                .into_iter()
                .for_each(|latency| self.stats.answered_after(latency, cluster.turn));
        }
        self.waiting.clear();
        self.stats.spend(Stage::Track, classified.elapsed());
    }

    /// The content of the last packet of [`Pipeline::take`]; `None` if it was late, a duplicate or
    /// foreign, and after [`Pipeline::end`].
    #[must_use]
    pub fn decoded(&self) -> Option<Decoded<'_>> {
        let turn = self.sensor.as_ref()?.stream.n_turns();
        self.taken_s.map(|time_s| Decoded { returns: &self.returns, time_s, turn })
    }

    /// The pose of the sensor at the Unix time `time_s`; `None` if its motion is unknown or no
    /// packet has come.
    #[must_use]
    pub fn pose(&self, time_s: f64) -> Option<Pose> {
        let motion = self.sensor.as_ref()?.motion(&self.options);
        motion.map(|motion| motion.pose(time_s))
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

impl Sensor {
    fn new(payload: &[u8], options: &LiveOptions, start_s: f64) -> Result<Self, Flaw> {
        let mut decoder = Decoder::new(options.ouster.as_ref(), payload)?;
        let facts = decoder.decode(payload, &mut Vec::new())?;
        let elevations = decoder.elevations_deg();
        let n_rings = elevations.len() as u32;
        let mut settings = options.segmentation.clone();
        settings.ring_elevations_deg = Some(elevations);
        let step_deg = decoder.step_rad(&facts).to_degrees() as f32;
        settings.column_width_deg = settings.column_width_deg.max(step_deg.min(WIDEST_DEG));
        let stream = Stream::new(settings, n_rings * ROOM_PER_RING)
            .expect("invariant: settings were checked, and a sensor's elevations are right");
        let clock = PacketClock::new(decoder.wraps_us(), options.is_recorded);
        Ok(Self { decoder, clock, stream, start_s, n_foreign: 0 })
    }

    /// Passes the returns of a packet to the stream; `packet` has its time.
    fn push(
        &mut self,
        facts: &Facts,
        returns: &[Return],
        packet: Tag,
        waiting: &mut Waiting,
        motion: Option<Motion<'_>>,
    ) {
        let Self { decoder, stream, .. } = self;
        let turn = stream.n_turns();
        stream.advance((facts.azimuth_rad - decoder.most_offset_rad()) as f32, |cluster| {
            waiting.push(&cluster, turn, motion);
        });
        for found in returns {
            let time_s = packet.time_s + found.after_us * 1e-6;
            let tag = Tag { time_s, ring: found.ring, ..packet };
            stream.push(found.point_m, found.ring, tag);
        }
    }

    fn motion<'a>(&self, options: &'a LiveOptions) -> Option<Motion<'a>> {
        let start_s = self.start_s;
        options.ego_motion.as_ref().map(|motion| Motion { motion, start_s })
    }

    fn end(&mut self, waiting: &mut Waiting, motion: Option<Motion<'_>>) {
        let turn = self.stream.n_turns();
        self.stream.end(|cluster| waiting.push(&cluster, turn, motion));
    }
}

/// A box of the frame of the sensor, in the world if the pose is known.
fn placed(seen: &OrientedBox, pose: Option<Pose>) -> PlacedBox {
    let OrientedBox { centre_m, size_m, yaw_rad } = *seen;
    let (centre_m, size_m) = (centre_m.map(f64::from), size_m.map(f64::from));
    let Some(pose) = pose else {
        return PlacedBox { centre_m, size_m, yaw_deg: f64::from(yaw_rad.to_degrees()) };
    };
    let (sin, cos) = libm::sincos(f64::from(yaw_rad));
    let along = pose.world_from_sensor * DVec3::new(cos, sin, 0.0);
    let yaw_deg = libm::atan(along.y / along.x).to_degrees();
    PlacedBox { centre_m: pose.to_world(centre_m.into()).to_array(), size_m, yaw_deg }
}

#[cfg(test)]
mod tests {
    use super::Arrival;

    /// Times before 1970 and beyond the year 5000 are those of damaged captures.
    #[test]
    fn a_time_that_cannot_be_is_not_taken() {
        for (time_s, expected) in
            [(1.7e9, 1.7e9), (0.0, 0.0), (-1.0, 0.0), (1.1e11, 0.0), (f64::NAN, 0.0)]
        {
            assert_eq!(Arrival { time_s, moment: None }.likely().time_s, expected);
        }
    }
}
