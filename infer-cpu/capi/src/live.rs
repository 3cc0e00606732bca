//! The pipeline from packets to objects, which C holds by its address.

use std::collections::VecDeque;
use std::ffi::{CString, c_char};
use std::ptr::{null, null_mut};

use formats::ouster::Metadata;
use infer_cpu::live::{Arrival, LiveError, LiveOptions, Object, Pipeline};
use infer_cpu::{Classifier, Options, UNKNOWN};

use crate::failure::{Failure, guard_status};
use crate::options::EdgepuckOptions;
use crate::pointers;
use crate::status::EdgepuckStatus;

/// From the packets of a LiDAR to named, tracked objects: made by
/// edgepuck_live_open, unmade by edgepuck_live_close.
pub struct EdgepuckLive {
    pipeline: Pipeline,
    /// Names of classes, and of none.
    names: Vec<CString>,
    answered: VecDeque<EdgepuckObject>,
}

/// An object, as edgepuck_live_next tells it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgepuckObject {
    /// A number that stays with the object from turn to turn.
    pub track: u64,
    /// The number of the turn, from 0.
    pub turn: u64,
    /// The class by all that was seen of the object, or "unknown"; UTF-8, for as
    /// long as the pipeline lives. Null while it has had too few points.
    pub class_name: *const c_char,
    /// The probability of the class that the object is most like, by all that
    /// was seen of it, 0 to 1; NaN while there is none.
    pub probability: f64,
    /// The middle of the box around the points, metres, in the sensor's frame.
    pub position_m: [f64; 3],
    /// Length, width and height of that box, metres.
    pub size_m: [f64; 3],
    /// The direction of the length, degrees counterclockwise from x, -90 to 90.
    pub yaw_deg: f64,
    /// Metres a second, relative to the sensor; NaN of what was seen once.
    pub velocity_m_s: [f64; 3],
    /// The number of points.
    pub n_points: usize,
    /// When the first point was measured, seconds of Unix time by the sensor's
    /// clock.
    pub first_s: f64,
    /// When the last point was.
    pub last_s: f64,
}

/// Packets since the start.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EdgepuckLiveCounts {
    /// Packets that were decoded.
    pub packets: u64,
    /// Packets that are missing by the time stamps of those that came.
    pub lost: u64,
    /// Packets that came late or twice.
    pub late: u64,
    /// Packets that are not the sensor's data.
    pub foreign: u64,
    /// How often the sensor or its clock began anew.
    pub restarts: u64,
}

impl EdgepuckLive {
    fn new(classifier: Classifier, options: &LiveOptions) -> Result<Self, Failure> {
        let names = classifier.classes().iter().map(|name| name.as_bytes().to_vec());
        let names = names.chain([UNKNOWN.into()]).map(CString::new).collect::<Result<_, _>>();
        let names = names.map_err(|_| {
            Failure::new(EdgepuckStatus::BadModel, "expected class names without NUL")
        })?;
        let pipeline = Pipeline::new(classifier, options)?;
        Ok(Self { pipeline, names, answered: VecDeque::new() })
    }

    fn answer(&mut self) {
        let Self { pipeline, names, answered } = self;
        pipeline.answer(|object| answered.push_back(EdgepuckObject::new(object, names)));
    }
}

impl EdgepuckObject {
    fn new(object: &Object, names: &[CString]) -> Self {
        let name = object.class.as_deref().map(str::as_bytes);
        let name = names.iter().find(|known| Some(known.as_bytes()) == name);
        Self {
            track: object.track,
            turn: object.turn,
            class_name: name.map_or(null(), |name| name.as_ptr()),
            probability: object.probability.unwrap_or(f64::NAN),
            position_m: object.position_m,
            size_m: object.size_m,
            yaw_deg: object.yaw_deg,
            velocity_m_s: object.velocity_m_s.unwrap_or([f64::NAN; 3]),
            n_points: object.points,
            first_s: object.first_s,
            last_s: object.last_s,
        }
    }
}

impl From<LiveError> for Failure {
    fn from(error: LiveError) -> Self {
        match error {
            LiveError::Classifier(error) => error.into(),
            other => Self::new(EdgepuckStatus::BadOption, other.to_string()),
        }
    }
}

/// Opens a pipeline whose clusters are classified by the model file at path, as
/// options ask (null: the defaults) and by as many threads; those of fewer than
/// min_points points are not classified. The sensor is a Velodyne VLP-16 or
/// VLP-32C, or, if metadata is not null, the Ouster whose metadata file (JSON)
/// that names. Writes the pipeline to out, or null when it fails. Pass it to
/// edgepuck_live_close in the end.
///
/// # Safety
///
/// path is null or a NUL-terminated string, as are metadata and every word of
/// options; options is null or valid; out is null or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_live_open(
    path: *const c_char,
    options: *const EdgepuckOptions,
    metadata: *const c_char,
    min_points: usize,
    out: *mut *mut EdgepuckLive,
) -> EdgepuckStatus {
    guard_status(|| {
        pointers::check(out, "out")?;
        // SAFETY: not null and aligned; the rest is this function's contract.
        unsafe { out.write(null_mut()) };
        // SAFETY: this function's contract.
        let path = unsafe { pointers::path(path) }?;
        let options = match options.is_null() {
            true => Options::default(),
            // SAFETY: this function's contract.
            false => unsafe { pointers::shared(options, "options")?.read() }?,
        };
        let mut live = LiveOptions::default();
        live.min_points = min_points;
        if !metadata.is_null() {
            // SAFETY: this function's contract.
            let metadata = unsafe { pointers::path(metadata) }?;
            let read = Metadata::read(&metadata);
            let read = read.map_err(|e| Failure::new(EdgepuckStatus::BadOption, e.to_string()))?;
            live.ouster = Some(read);
        }
        let made = Box::new(EdgepuckLive::new(Classifier::load(&path, &options)?, &live)?);
        // SAFETY: as above.
        unsafe { out.write(Box::into_raw(made)) };
        Ok(())
    })
}

/// Takes what one UDP packet of the sensor carries, n_bytes at packet, which
/// came at time_s of Unix time in seconds. Whatever it holds, it is decoded or
/// counted: see edgepuck_live_counts. Then ask edgepuck_live_next.
///
/// # Safety
///
/// live is null or comes from edgepuck_live_open, is not closed, and no other
/// thread uses it now; packet is null or n_bytes bytes can be read there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_live_take(
    live: *mut EdgepuckLive,
    packet: *const u8,
    n_bytes: usize,
    time_s: f64,
) -> EdgepuckStatus {
    guard_status(|| {
        // SAFETY: this function's contract.
        let live = unsafe { pointers::exclusive(live, "live") }?;
        // SAFETY: this function's contract.
        let packet = unsafe { pointers::bytes(packet, n_bytes) }?;
        live.pipeline.take(packet, Arrival { time_s, moment: None });
        live.answer();
        Ok(())
    })
}

/// Ends what is not complete, as at the end of a recording. Then ask
/// edgepuck_live_next.
///
/// # Safety
///
/// live is null or comes from edgepuck_live_open, is not closed, and no other
/// thread uses it now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_live_end(live: *mut EdgepuckLive) -> EdgepuckStatus {
    guard_status(|| {
        // SAFETY: this function's contract.
        let live = unsafe { pointers::exclusive(live, "live") }?;
        live.pipeline.end();
        live.answer();
        Ok(())
    })
}

/// Writes the next object to out and is true; false if there is none until more
/// packets are taken, or if a pointer is null.
///
/// # Safety
///
/// live is null or comes from edgepuck_live_open, is not closed, and no other
/// thread uses it now; out is null or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_live_next(
    live: *mut EdgepuckLive,
    out: *mut EdgepuckObject,
) -> bool {
    let mut is_there = false;
    guard_status(|| {
        pointers::check(out, "out")?;
        // SAFETY: this function's contract.
        let live = unsafe { pointers::exclusive(live, "live") }?;
        if let Some(object) = live.answered.pop_front() {
            // SAFETY: not null and aligned; the rest is this function's contract.
            unsafe { out.write(object) };
            is_there = true;
        }
        Ok(())
    });
    is_there
}

/// Writes what came and what did not to out.
///
/// # Safety
///
/// live is null or comes from edgepuck_live_open, is not closed, and no other
/// thread takes packets with it now; out is null or may be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_live_counts(
    live: *const EdgepuckLive,
    out: *mut EdgepuckLiveCounts,
) -> EdgepuckStatus {
    guard_status(|| {
        pointers::check(out, "out")?;
        // SAFETY: this function's contract.
        let counts = unsafe { pointers::shared(live, "live") }?.pipeline.counts();
        let counts = EdgepuckLiveCounts {
            packets: counts.packets,
            lost: counts.lost,
            late: counts.late + counts.duplicated,
            foreign: counts.foreign,
            restarts: counts.restarts,
        };
        // SAFETY: not null and aligned; the rest is this function's contract.
        unsafe { out.write(counts) };
        Ok(())
    })
}

/// Closes a pipeline; null is none.
///
/// # Safety
///
/// live is null or comes from edgepuck_live_open; nobody uses it, or a name
/// that it gave, now or later.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_live_close(live: *mut EdgepuckLive) {
    if live.is_null() {
        return;
    }
    // SAFETY: edgepuck_live_open made it by Box::into_raw; the caller gives it up.
    let live = unsafe { Box::from_raw(live) };
    // There is no status to answer by; a panic has left its message.
    let _ = guard_status(|| {
        drop(live);
        Ok(())
    });
}
