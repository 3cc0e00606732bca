//! Records a sensor and its objects as MCAP (<https://mcap.dev/spec>) with messages of ROS 2.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind};
use std::path::{Path, PathBuf};

use edgepuck_ros_messages as ros;
use edgepuck_ros_messages::{Message, Time};
use formats::geometry::Pose;
use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};

use super::object::Object;
use super::pipeline::{Decoded, Pipeline};

/// The frame of the points.
const SENSOR: &str = "sensor";
/// The frame of the vehicle or robot.
const BASE: &str = "base_link";
/// The frame of poses.
const WORLD: &str = "world";

/// The fields of a point, their offsets and types.
const FIELDS: [(&str, u32, u8); 6] = [
    ("x", 0, ros::PointField::FLOAT32),
    ("y", 4, ros::PointField::FLOAT32),
    ("z", 8, ros::PointField::FLOAT32),
    ("intensity", 12, ros::PointField::FLOAT32),
    ("ring", 16, ros::PointField::UINT16),
    ("time", 18, ros::PointField::FLOAT32),
];
const POINT_BYTES: usize = 22;

/// The most points of a cloud: this bounds the memory if a head stands still and its turn does not
/// end.
const MOST_POINTS: usize = 1 << 20;

/// The recording cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}", .file.display())]
#[non_exhaustive]
pub struct RecordError {
    /// The file.
    pub file: PathBuf,
    /// The error of the operating system.
    pub source: io::Error,
}

/// Writes the points and objects of a [`Pipeline`] to a file, turn by turn.
///
/// The data of a turn is in the file when the turn ends, even if the program is killed later. The
/// channels are `/points` (one cloud per turn), `/objects` and `/objects/markers` (one message per
/// turn), `/tf_static` and, if the motion of the sensor is known, `/tf`.
pub struct Recorder {
    file: PathBuf,
    writer: Writer<BufWriter<File>>,
    channels: Channels,
    turn: Turn,
    n_turns: u32,
}

struct Channels {
    points: u16,
    objects: u16,
    markers: u16,
    tf_static: u16,
    tf: u16,
}

/// The data since the last turn was written.
#[derive(Default)]
struct Turn {
    /// The number of the turn, and the number of restarts of the sensor.
    number: (u64, u64),
    /// The points, [`POINT_BYTES`] each.
    data: Vec<u8>,
    /// The times of the first and the last point, seconds of Unix time.
    first_s: f64,
    last_s: f64,
    objects: Vec<ros::Object>,
}

impl Recorder {
    /// Creates the file and begins a recording. Existing pipes and devices are allowed.
    ///
    /// # Errors
    /// An existing file; a file that cannot be written.
    pub fn create(file: &Path) -> Result<Self, RecordError> {
        let begin = || {
            // Without seeking, the writer holds a chunk until it is complete: killing the program
            // loses only the current turn.
            let options =
                WriteOptions::new().profile("ros2").disable_seeking(true).chunk_size(None);
            let mut writer = options.create(BufWriter::new(open(file)?)).map_err(io_error)?;
            let channels = Channels {
                points: channel::<ros::PointCloud2>(&mut writer, "/points")?,
                objects: channel::<ros::Detection3DArray>(&mut writer, "/objects")?,
                markers: channel::<ros::MarkerArray>(&mut writer, "/objects/markers")?,
                tf_static: channel::<ros::TFMessage>(&mut writer, "/tf_static")?,
                tf: channel::<ros::TFMessage>(&mut writer, "/tf")?,
            };
            writer.flush().map_err(io_error)?;
            Ok((writer, channels))
        };
        let (writer, channels) = begin().map_err(|source| failure(file, source))?;
        Ok(Self { file: file.to_path_buf(), writer, channels, turn: Turn::default(), n_turns: 0 })
    }

    /// Adds an object of the pipeline.
    pub fn object(&mut self, object: &Object) {
        self.turn.objects.push(message_object(object));
    }

    /// Adds the last packet of `pipeline`, after its objects were passed to [`Recorder::object`].
    /// If a turn begins with it, the turn before is written.
    ///
    /// # Errors
    /// A file that cannot be written, for example on a full disk.
    pub fn packet(&mut self, pipeline: &Pipeline) -> Result<(), RecordError> {
        let Some(decoded) = pipeline.decoded() else { return Ok(()) };
        let number = (decoded.turn, pipeline.counts().restarts);
        if number != self.turn.number || self.turn.n_points() >= MOST_POINTS {
            self.end_turn(pipeline)?;
            self.turn.number = number;
        }
        self.turn.push(&decoded);
        Ok(())
    }

    /// Writes the data since the last whole turn and ends the recording, and returns the file and the
    /// number of its turns. A file without data is removed.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(mut self, pipeline: &Pipeline) -> Result<(PathBuf, u32), RecordError> {
        self.end_turn(pipeline)?;
        let finished = self.writer.finish().map(drop).map_err(io_error).and_then(|()| {
            match self.n_turns == 0 && self.file.metadata()?.is_file() {
                true => fs::remove_file(&self.file),
                false => Ok(()),
            }
        });
        match finished {
            Ok(()) => Ok((self.file, self.n_turns)),
            Err(source) => Err(failure(&self.file, source)),
        }
    }

    fn end_turn(&mut self, pipeline: &Pipeline) -> Result<(), RecordError> {
        if self.turn.n_points() == 0 && self.turn.objects.is_empty() {
            return Ok(());
        }
        let number = self.turn.number;
        let turn = std::mem::replace(&mut self.turn, Turn { number, ..Turn::default() });
        // With the size of this turn, the buffer of the next one rarely has to grow.
        self.turn.data.reserve(turn.data.len());
        self.write_turn(turn, pipeline).map_err(|source| failure(&self.file, source))
    }

    fn write_turn(&mut self, mut turn: Turn, pipeline: &Pipeline) -> io::Result<()> {
        let Channels { points, objects, markers, tf_static, tf } = self.channels;
        let last_objects_s = turn.objects.iter().map(|object| object.last_s).reduce(f64::max);
        if turn.n_points() > 0 {
            let (first, last) = (Time::from_s(turn.first_s), Time::from_s(turn.last_s));
            if self.n_turns == 0 {
                self.write(tf_static, &first, &transform(&first, BASE, SENSOR, &still()))?;
            }
            if let Some(pose) = pipeline.pose(turn.last_s) {
                // A frame has only one parent: the pose moves the base, to which the sensor is
                // fixed.
                self.write(tf, &last, &transform(&last, WORLD, BASE, &placed(&pose)))?;
            }
            self.write(points, &last, &cloud(std::mem::take(&mut turn.data), first))?;
        }
        let last = Time::from_s(last_objects_s.unwrap_or(turn.last_s));
        let mut detections = ros::detections(&turn.objects);
        let frame = if pipeline.pose(turn.last_s).is_some() { WORLD } else { SENSOR };
        detections.header = ros::Header { stamp: last.clone(), frame_id: frame.to_owned() };
        self.write(objects, &last, &detections)?;
        self.write(markers, &last, &ros::markers(&turn.objects))?;
        self.n_turns += 1;
        self.writer.flush().map_err(io_error)
    }

    fn write(&mut self, channel_id: u16, time: &Time, message: &impl Message) -> io::Result<()> {
        let (sequence, log_time) = (self.n_turns, time.as_ns());
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        self.writer.write_to_known_channel(&header, &message.to_cdr()).map_err(io_error)
    }
}

impl Turn {
    fn n_points(&self) -> usize {
        self.data.len() / POINT_BYTES
    }

    fn push(&mut self, decoded: &Decoded<'_>) {
        let times = || decoded.returns.iter().map(|found| decoded.time_s + found.after_us * 1e-6);
        let Some(first_s) = times().reduce(f64::min) else { return };
        if self.data.is_empty() {
            (self.first_s, self.last_s) = (first_s, first_s);
        }
        for (found, time_s) in decoded.returns.iter().zip(times()) {
            self.last_s = self.last_s.max(time_s);
            let [x, y, z] = found.point_m;
            let since_s = (time_s - self.first_s) as f32;
            for number in [x, y, z, f32::from(found.reflectivity)] {
                self.data.extend(number.to_le_bytes());
            }
            self.data.extend(found.ring.to_le_bytes());
            self.data.extend(since_s.to_le_bytes());
        }
    }
}

/// Creates a new file and missing folders, or opens an existing device or pipe.
fn open(file: &Path) -> io::Result<File> {
    file.parent().map_or(Ok(()), fs::create_dir_all)?;
    match File::create_new(file) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => Err(error),
        Err(_) if file.metadata()?.is_file() => {
            Err(io::Error::other("expected the name of a new file, found an existing file"))
        }
        Err(_) => OpenOptions::new().write(true).open(file),
        opened => opened,
    }
}

fn failure(file: &Path, source: io::Error) -> RecordError {
    RecordError { file: file.to_path_buf(), source }
}

/// Adds the channel of `topic`, whose messages are of type `M`.
fn channel<M: Message>(writer: &mut Writer<BufWriter<File>>, topic: &str) -> io::Result<u16> {
    let added = writer
        .add_schema(M::NAME, "ros2msg", M::definition().as_bytes())
        .and_then(|schema| writer.add_channel(schema, topic, "cdr", &BTreeMap::new()));
    added.map_err(io_error)
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// An object for messages: the content of the JSON line, unrounded.
fn message_object(object: &Object) -> ros::Object {
    ros::Object {
        turn: object.turn,
        track: object.track,
        class: object.class.as_deref().map(str::to_owned),
        probability: object.probability,
        frame: object.frame.to_owned(),
        position_m: object.position_m,
        size_m: object.size_m,
        yaw_deg: object.yaw_deg,
        last_s: object.last_s,
        whole_box: object.whole_box,
    }
}

/// A cloud of points whose times are relative to `first`.
fn cloud(data: Vec<u8>, first: Time) -> ros::PointCloud2 {
    let field = |(name, offset, datatype): (&str, u32, u8)| ros::PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count: 1,
    };
    ros::PointCloud2 {
        header: ros::Header { stamp: first, frame_id: SENSOR.to_owned() },
        height: 1,
        width: (data.len() / POINT_BYTES) as u32,
        fields: FIELDS.map(field).to_vec(),
        is_bigendian: false,
        point_step: POINT_BYTES as u32,
        row_step: data.len() as u32,
        data,
        is_dense: true,
    }
}

/// The pose of the frame `child` in `parent`.
fn transform(time: &Time, parent: &str, child: &str, at: &ros::Transform) -> ros::TFMessage {
    let header = ros::Header { stamp: time.clone(), frame_id: parent.to_owned() };
    let child_frame_id = child.to_owned();
    let transform = at.clone();
    ros::TFMessage { transforms: vec![ros::TransformStamped { header, child_frame_id, transform }] }
}

fn still() -> ros::Transform {
    ros::Transform { rotation: ros::Quaternion::IDENTITY, ..ros::Transform::default() }
}

fn placed(pose: &Pose) -> ros::Transform {
    let [x, y, z] = pose.position_m.to_array();
    let translation = ros::Vector3 { x, y, z };
    let [x, y, z, w] = pose.rotation.to_array();
    ros::Transform { translation, rotation: ros::Quaternion { x, y, z, w } }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::live::{OrientedBox, SCHEMA_VERSION};

    /// REP 103: no rotation is the quaternion 0, 0, 0, 1. The quaternion 0, 0, 0, 0 is invalid.
    #[test]
    fn static_objects_are_not_rotated() {
        let ros::Transform { translation, rotation } = still();
        assert_eq!([translation.x, translation.y, translation.z], [0.0; 3]);
        assert_eq!([rotation.x, rotation.y, rotation.z, rotation.w], [0.0, 0.0, 0.0, 1.0]);
    }

    /// Other programs read version 1 of the line to create messages.
    #[test]
    fn messages_of_an_object_are_those_of_its_line() {
        assert_eq!(SCHEMA_VERSION, 1);
        let mut object = Object {
            version: SCHEMA_VERSION,
            turn: 3,
            track: 7,
            class: Some(Arc::from("car")),
            resembles: Some(Arc::from("car")),
            confidence: Some(0.5),
            probability: Some(0.75),
            frame: "world",
            position_m: [1.5, -2.25, 0.125],
            size_m: [4.0, 1.75, 1.5],
            yaw_deg: -12.5,
            velocity_m_s: Some([0.5; 3]),
            points: 99,
            range_m: 2.5,
            first_s: 1.7e9,
            last_s: 1.7e9 + 0.25,
            latency_ms: None,
            whole_box: Some(OrientedBox {
                centre_m: [1.25, -2.5, 0.25],
                size_m: [4.5, 1.875, 1.625],
                yaw_rad: 167.5f64.to_radians(),
            }),
        };
        for class in [object.class.clone(), None] {
            object.class = class;
            let line = serde_json::to_string(&object).unwrap();
            let read: ros::Object = serde_json::from_str(&line).unwrap();
            assert_eq!(read, message_object(&object), "{line}");
        }
    }
}
