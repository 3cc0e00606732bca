//! `infer-cpu live`: classifies and tracks the objects that a LiDAR detects.

mod notify;
mod outputs;
mod report;
mod source;

use std::net::Ipv4Addr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::detect::DetectError;
use crate::live::{Counts, Flaw, LiveOptions, Pipeline, Recorder, Timeline, Trajectory};
use crate::{Options, Precision};
use formats::ouster::Metadata;
use formats::plausible::sensor_motion;
use formats::trajectory::check_cover;
use formats::{ChosenSender, FormatError, counted};
use program::outputs::need_extension;
use signal_hook::consts::{SIGINT, SIGTERM};

use super::model::ModelArgs;
use super::{Outcome, Usage, n_threads, of_setup};
use notify::Notifier;
use outputs::Outputs;
use source::{Sensor, Source, Tick};

/// The bundled bird's-eye model of streets.
const MODEL: &str = "street-bev";

/// The silence of a sensor after which the user gets a warning: a turn takes at most 0.2 s.
const SILENCE: Duration = Duration::from_secs(5);

/// Flags of `live`.
#[derive(clap::Args)]
#[group(id = "source", args = ["udp", "pcap"], required = true, multiple = false)]
#[command(after_help = include_str!("help.txt"))]
pub struct LiveArgs {
    /// Receive packets on this UDP port; a Velodyne's is 2368, an Ouster's 7502
    #[arg(long, value_name = "PORT")]
    udp: Option<u16>,

    /// Read packets from a capture, pcap or pcapng; the sensor's stamps give the intervals between
    /// them
    #[arg(long, value_name = "FILE")]
    pcap: Option<PathBuf>,

    /// Take packets of the capture at the times at which the sensor sent them, instead of as fast as
    /// possible
    #[arg(long, conflicts_with = "udp")]
    realtime: bool,

    /// Print JSON lines; the default, unless --stats or --mcap is given
    #[arg(long)]
    json: bool,

    /// Record points and objects to a new file that ROS 2, Foxglove and Rerun read: MCAP with
    /// /points (PointCloud2), /objects (Detection3DArray) and /objects/markers (MarkerArray) of the
    /// objects with a class other than unknown, /tf_static and, with --poses, /tf; each turn is in
    /// the file when it ends
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,

    /// At the end, report the time of each stage, lost packets and memory on standard error
    #[arg(long)]
    stats: bool,

    /// Sensor whose packets are used: ADDRESS, or of several at one address ADDRESS:PORT to which it
    /// sends, or ADDRESS@PORT from which [default: the first sensor that sends]
    #[arg(long, value_name = "ADDRESS")]
    from: Option<ChosenSender>,

    /// Join a multicast group
    #[arg(long, value_name = "IP", conflicts_with = "pcap", value_parser = group)]
    multicast: Option<Ipv4Addr>,

    /// Listen on the network interface that has this address only [default: on all]
    #[arg(long, value_name = "IP", conflicts_with = "pcap", default_value = "0.0.0.0")]
    interface: Ipv4Addr,

    /// Metadata file (JSON) of the sensor, if it is an Ouster OS0, OS1 or OS2
    #[arg(long, value_name = "FILE")]
    metadata: Option<PathBuf>,

    /// Poses of the sensor in the world, in TUM's format (Unix time x y z qx qy qz qw), by which
    /// turns are deskewed and objects tracked in the world; they must cover all packets
    #[arg(long, value_name = "FILE")]
    poses: Option<PathBuf>,

    /// Fewest points of an object with a class
    #[arg(long, default_value_t = 20, value_name = "N")]
    min_points: usize,

    /// Turns in which an object has been seen when it is first reported: 1 reports all, also what is
    /// seen once
    #[arg(long, default_value_t = 2, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    min_turns: u64,

    #[command(flatten)]
    model: ModelArgs,

    /// Precision of the networks: f32 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,

    /// Number of threads that detect [default: one per core, at most 4]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

/// Parses the address of a multicast group (RFC 5771).
fn group(word: &str) -> Result<Ipv4Addr, String> {
    let group = word.parse().ok().filter(Ipv4Addr::is_multicast);
    group.ok_or_else(|| "expected a group from 224.0.0.0 to 239.255.255.255".to_owned())
}

/// Runs the pipeline until the packets end or a signal comes.
pub fn run(args: &LiveArgs) -> anyhow::Result<Outcome> {
    let options = args.options()?;
    args.check_poses(&options)?;
    args.warn_of_poses(&options);
    let mut pipeline = args.pipeline(&options)?;
    let is_over = Arc::new(AtomicBool::new(false));
    for signal in [SIGTERM, SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&is_over))?;
    }
    let mut notifier = Notifier::of_environment();
    let source = args.source(&options, &is_over)?;
    let mut outputs = args.outputs()?;
    notifier.ready()?;
    let (mut heard, mut is_silent) = (Instant::now(), false);
    let (mut first_s, mut uncovered) = (None, None);
    let read = source.run(|tick| {
        match tick {
            Tick::Packet(payload, arrival) => {
                pipeline.take(payload, arrival);
                (heard, is_silent) = (arrival.moment.unwrap_or(heard), false);
            }
            Tick::Quiet if heard.elapsed() >= SILENCE && !is_silent => {
                is_silent = true;
                program::say!("warning: {}", args.silence());
            }
            Tick::Quiet => {}
            Tick::End => {
                notifier.stopping();
                pipeline.end();
            }
        }
        if let Some(decoded) = pipeline.decoded() {
            let first_s = *first_s.get_or_insert(decoded.time_s);
            uncovered = args.check_cover(&options, [first_s, decoded.time_s]).err();
        }
        if uncovered.is_none() {
            pipeline.answer(|object| outputs.object(object));
            outputs.packet(&pipeline);
        }
        for flaw in pipeline.new_flaws() {
            match flaw {
                Flaw::Times { .. } | Flaw::Late { .. } => program::say!("warning: {flaw}"),
                _ => program::say!(
                    "warning: ignored a packet, and will ignore others with the same flaw: {flaw}"
                ),
            }
        }
        notifier.alive(pipeline.counts(), Instant::now());
        !is_over.load(Ordering::Relaxed) && outputs.are_wanted() && uncovered.is_none()
    });
    let ended = outputs.end(&pipeline);
    let mut read = read?;
    ended?;
    uncovered.map_or(Ok(()), Err)?;
    if args.stats && read.n_packets > 0 {
        report::print(&pipeline, &read);
    }
    read.error.take().map_or(Ok(()), Err)?;
    let (here, of_all) = (args.capture(), counted(read.n_packets, "UDP packet"));
    if !args.stats && read.capture.first_unread.is_some() {
        program::say!("warning: {here}{of_all}{}", read.capture);
    }
    let Counts { packets, lost, duplicated, late, points, clusters, .. } = *pipeline.counts();
    if args.pcap.is_some() && !args.stats && packets > 0 && clusters == 0 {
        program::say!(
            "warning: {here}no object was found among {} of {}: expected a whole turn of the sensor or \
             more, and clusters of {} or more (--min-points)",
            counted(points, "point"),
            counted(packets, "packet"),
            counted(args.min_points, "point")
        );
    }
    // Single repeated and late packets are usual in networks.
    if duplicated + late > packets {
        program::say!(
            "warning: {here}expected packets in the order of the sensor's stamps, found {duplicated} with \
             a stamp again and {late} with an earlier one, which were not used"
        );
    }
    if !args.stats && lost > 0 {
        let of = counted(packets + lost, "packet");
        program::say!("warning: {here}probably missing: {lost} of {of}");
    }
    if packets == 0 {
        let cause = format!(
            "{here}expected packets of {}, found none among {of_all}{}{}",
            if args.metadata.is_some() { "the Ouster" } else { "a VLP-16 or VLP-32C" },
            read.senders,
            read.capture
        );
        // A service may be stopped before its sensor is switched on.
        if args.udp.is_none() {
            return Err(Usage(cause).into());
        }
        program::say!("warning: {cause}");
    }
    Ok(Outcome::Success)
}

impl LiveArgs {
    fn pipeline(&self, live: &LiveOptions) -> anyhow::Result<Pipeline> {
        let (model, _) = self.model.open_or(MODEL)?;
        let threads = n_threads(self.threads);
        let options = Options { precision: self.precision, threads, ..Options::default() };
        Pipeline::open(&model, &options, live).map_err(|error| match error {
            DetectError::Model(error) => of_setup(error),
            error => error.into(),
        })
    }

    fn options(&self) -> anyhow::Result<LiveOptions> {
        Ok(LiveOptions {
            min_points: self.min_points,
            min_turns: self.min_turns,
            ego_motion: self.poses.as_deref().map(Trajectory::load).transpose()?,
            ouster: self.metadata.as_deref().map(Metadata::read).transpose()?,
            is_recorded: self.pcap.is_some(),
            ..LiveOptions::default()
        })
    }

    /// Tells why the poses are probably not those of the sensor.
    fn warn_of_poses(&self, options: &LiveOptions) {
        let warnings = options.ego_motion.as_ref().map(sensor_motion).unwrap_or_default();
        for (warning, file) in warnings.iter().zip(self.poses.iter().cycle()) {
            program::say!("warning: {}: {warning}", file.display());
        }
    }

    /// Checks that poses cover the whole capture, before there is any output. The packets of a pipe
    /// can be read only once: they are checked as they come.
    fn check_poses(&self, options: &LiveOptions) -> anyhow::Result<()> {
        let file = self.pcap.as_deref().filter(|file| self.poses.is_some() && file.is_file());
        let Some(file) = file else { return Ok(()) };
        let mut timeline = Timeline::new(options);
        let mut sensor = Sensor::new(self.from, options.ouster.as_ref());
        sensor.has_warned = true;
        let source = Source::Capture { file: file.to_path_buf(), sensor, timeline: None };
        source.run(|tick| {
            if let Tick::Packet(payload, arrival) = tick {
                timeline.take(payload, arrival);
            }
            true
        })?;
        timeline.span_s().map_or(Ok(()), |sent_s| Ok(self.check_cover(options, sent_s)?))
    }

    fn check_cover(&self, options: &LiveOptions, sent_s: [f64; 2]) -> Result<(), FormatError> {
        let known_s = options.ego_motion.as_ref().map(Trajectory::known_s);
        let covered = known_s.map_or(Ok(()), |known_s| check_cover(known_s, sent_s));
        let file = self.poses.as_deref().unwrap_or(Path::new("poses"));
        covered.map_err(|cause| FormatError::malformed(file, "times", cause))
    }

    /// The name of the capture in messages, with a colon.
    fn capture(&self) -> String {
        self.pcap.as_ref().map(|file| format!("{}: ", file.display())).unwrap_or_default()
    }

    /// What may keep packets from coming.
    fn silence(&self) -> String {
        let (port, seconds) = (self.udp.unwrap_or_default(), SILENCE.as_secs());
        let sender = self.from.map_or("the sensor".to_owned(), |from| from.to_string());
        format!(
            "no packets have come for {seconds} s: expected {sender} to send to port {port} of this \
             machine, and firewalls to let UDP pass"
        )
    }

    fn outputs(&self) -> anyhow::Result<Outputs> {
        if let Some(file) = self.mcap.as_deref().filter(|file| file.extension().is_some()) {
            need_extension("--mcap", file, &["mcap"])?;
        }
        let recorder = self.mcap.as_deref().map(Recorder::create).transpose()?;
        let prints = self.json || !(self.stats || recorder.is_some());
        Ok(Outputs::new(prints, recorder))
    }

    fn source(&self, options: &LiveOptions, is_over: &Arc<AtomicBool>) -> anyhow::Result<Source> {
        let sensor = Sensor::new(self.from, options.ouster.as_ref());
        match (&self.pcap, self.udp) {
            (Some(file), _) => {
                let timeline = self.realtime.then(|| Box::new(Timeline::new(options)));
                Ok(Source::Capture { file: file.clone(), sensor, timeline })
            }
            (None, _) if self.from.is_some_and(|from| from.has_port()) => {
                let cause =
                    "--from: expected an address alone with --udp, whose port is one already";
                Err(Usage(cause.to_owned()).into())
            }
            (None, port) => {
                let address = (self.interface, port.unwrap_or_default()).into();
                Source::udp(address, self.multicast, sensor, is_over)
            }
        }
    }
}
