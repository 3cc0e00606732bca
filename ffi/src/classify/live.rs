use std::collections::VecDeque;
use std::ffi::{CString, c_char};
use std::mem::MaybeUninit;
use std::ptr::null;

use formats::ouster::Metadata;
use infer_cpu::live::{Arrival, LiveOptions, Object, Pipeline};

use super::options::EdgepuckOptions;
use crate::pointers;
use crate::status::{EdgepuckStatus, Failure, guard, guard_status};

/// A pipeline from the packets of a LiDAR to classified, tracked objects. edgepuck_live_open
/// creates it, and edgepuck_live_close frees it.
pub struct EdgepuckLive {
    pipeline: Pipeline,
    /// The names of classes, and of unknown objects.
    names: Vec<CString>,
    answered: VecDeque<EdgepuckObject>,
}

/// An object from edgepuck_live_next.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgepuckObject {
    /// A number that stays with the object from turn to turn.
    pub track: u64,
    /// The number of the turn, from 0.
    pub turn: u64,
    /// The class from all clusters of the object, or "unknown"; UTF-8, valid as long as the
    /// pipeline. Null while the object has had too few points.
    pub class_name: *const c_char,
    /// The probability of the class that the object resembles most, from all of its clusters, 0 to
    /// 1; NaN while class_name is null.
    pub probability: f64,
    /// The middle of the box around the points, metres, in the sensor's frame.
    pub position_m: [f64; 3],
    /// Length, width and height of that box, metres.
    pub size_m: [f64; 3],
    /// The direction of the length, degrees counterclockwise from x, -90 to 90.
    pub yaw_deg: f64,
    /// The velocity, metres per second, relative to the sensor; NaN in the first turn of an object.
    pub velocity_m_s: [f64; 3],
    /// The number of points.
    pub n_points: usize,
    /// When the first point was measured: Unix time in seconds by the sensor's clock.
    pub first_s: f64,
    /// When the last point was measured.
    pub last_s: f64,
    /// The middle of the box of the whole object, metres, in the sensor's frame: its near side is that
    /// of the box around the points, and its size and direction are from all clusters of the object. This
    /// and the next two fields are NaN if it is not known: without a class, or for one without a usual size.
    pub whole_position_m: [f64; 3],
    /// Length, width and height of the box of the whole object, metres.
    pub whole_size_m: [f64; 3],
    /// The direction of its length, degrees counterclockwise from x, -180 to 180.
    pub whole_yaw_deg: f64,
}

/// The numbers of packets since the start.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EdgepuckLiveCounts {
    /// Packets that were decoded.
    pub packets: u64,
    /// Packets that are missing according to the time stamps of the others.
    pub lost: u64,
    /// Packets that came late or twice.
    pub late: u64,
    /// Packets that are not the sensor's data.
    pub foreign: u64,
    /// The number of restarts of the sensor or its clock.
    pub restarts: u64,
}

impl EdgepuckLive {
    fn new(pipeline: Pipeline) -> Result<Self, Failure> {
        let names = pipeline.classes().map(str::as_bytes).map(<[u8]>::to_vec);
        let names = names.map(CString::new).collect::<Result<_, _>>();
        let names = names.map_err(|_| {
            Failure::new(EdgepuckStatus::BadModel, "expected class names without NUL")
        })?;
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
        let whole = object.whole_box;
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
            whole_position_m: whole.map_or([f64::NAN; 3], |whole| whole.centre_m),
            whole_size_m: whole.map_or([f64::NAN; 3], |whole| whole.size_m),
            whole_yaw_deg: whole.map_or(f64::NAN, |whole| whole.yaw_rad.to_degrees()),
        }
    }
}

/// Opens a pipeline that detects objects with the bird's-eye model file at path, beside which is the model
/// that it asks, and with options (null stands for the defaults); clusters of fewer than min_points
/// points have no class. The sensor is a Velodyne VLP-16 or VLP-32C, or an Ouster if metadata is the path
/// of its metadata file (JSON) instead of null. Writes the pipeline to out, or null if it fails.
/// Objects are reported from the second turn in which they are seen. Pass it to edgepuck_live_close in
/// the end.
///
/// # Safety
///
/// path is null or a NUL-terminated string, as are metadata and every word of options.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_live_open(
    path: *const c_char,
    options: Option<&EdgepuckOptions>,
    metadata: *const c_char,
    min_points: usize,
    out: Option<&mut MaybeUninit<Option<Box<EdgepuckLive>>>>,
) -> EdgepuckStatus {
    pointers::make(out, || {
        // SAFETY: the strings are as the `# Safety` section above requires.
        let (path, options) =
            unsafe { (pointers::path(path, "path")?, EdgepuckOptions::or_default(options)?) };
        let mut live = LiveOptions::default();
        live.min_points = min_points;
        if !metadata.is_null() {
            // SAFETY: null or NUL-terminated, as required above.
            let read = Metadata::read(&unsafe { pointers::path(metadata, "metadata") }?);
            live.ouster = Some(read.map_err(Failure::of(EdgepuckStatus::BadValue))?);
        }
        EdgepuckLive::new(Pipeline::open(&path, &options, &live)?)
    })
}

/// Processes the payload of one UDP packet of the sensor, n_bytes at packet, which arrived at the
/// Unix time time_s in seconds. Any content is decoded or counted as foreign: see
/// edgepuck_live_counts. Then call edgepuck_live_next.
///
/// # Safety
///
/// packet is null or n_bytes bytes can be read there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_live_take(
    live: Option<&mut EdgepuckLive>,
    packet: *const u8,
    n_bytes: usize,
    time_s: f64,
) -> EdgepuckStatus {
    guard_status(|| {
        let live = pointers::need(live, "live")?;
        // SAFETY: null or long enough, as required above.
        let packet = unsafe { pointers::slice(packet, n_bytes, "packet") }?;
        live.pipeline.take(packet, Arrival { time_s, moment: None });
        live.answer();
        Ok(())
    })
}

/// Completes all clusters, for example at the end of a recording. Then call edgepuck_live_next.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_live_end(live: Option<&mut EdgepuckLive>) -> EdgepuckStatus {
    guard_status(|| {
        let live = pointers::need(live, "live")?;
        live.pipeline.end();
        live.answer();
        Ok(())
    })
}

/// Writes the next object to out and returns true. Returns false if there is no object until the
/// next packet, or if a pointer is null.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_live_next(
    live: Option<&mut EdgepuckLive>,
    out: Option<&mut MaybeUninit<EdgepuckObject>>,
) -> bool {
    let is_there = guard(|| {
        let (out, live) = (pointers::need(out, "out")?, pointers::need(live, "live")?);
        Ok(live.answered.pop_front().map(|object| out.write(object)).is_some())
    });
    is_there.unwrap_or(false)
}

/// Writes the numbers of packets to out.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_live_counts(
    live: Option<&EdgepuckLive>,
    out: Option<&mut MaybeUninit<EdgepuckLiveCounts>>,
) -> EdgepuckStatus {
    guard_status(|| {
        let (out, live) = (pointers::need(out, "out")?, pointers::need(live, "live")?);
        let counts = live.pipeline.counts();
        out.write(EdgepuckLiveCounts {
            packets: counts.packets,
            lost: counts.lost,
            late: counts.late + counts.duplicated,
            foreign: counts.foreign,
            restarts: counts.restarts,
        });
        Ok(())
    })
}

/// Closes a pipeline; null has no effect.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_live_close(live: Option<Box<EdgepuckLive>>) {
    pointers::free(live);
}
