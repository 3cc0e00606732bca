//! The messages, field by field as their definitions list them. Units are those of ROS (REP 103):
//! metres, radians and seconds.

use serde::{Serialize, Serializer};

use crate::Message;

/// Declares messages: all fields are public, and are serialized in their order.
macro_rules! messages {
    ($($(#[$about:meta])* $name:ident { $($(#[$meta:meta])* $field:ident: $kind:ty,)* })*) => {$(
        $(#[$about])*
        #[derive(Clone, Debug, Default, PartialEq, Serialize)]
        pub struct $name {
            $($(#[$meta])* #[allow(missing_docs, reason = "named by its definition")]
            pub $field: $kind,)*
        }
    )*};
}

messages! {
    /// `builtin_interfaces/Time`: Unix time.
    Time { sec: i32, nanosec: u32, }
    /// `builtin_interfaces/Duration`.
    Duration { sec: i32, nanosec: u32, }
    /// `std_msgs/Header`.
    Header { stamp: Time, frame_id: String, }
    /// `std_msgs/ColorRGBA`: shares, 0 to 1.
    ColorRGBA { r: f32, g: f32, b: f32, a: f32, }
    /// `geometry_msgs/Point`, metres.
    Point { x: f64, y: f64, z: f64, }
    /// `geometry_msgs/Vector3`.
    Vector3 { x: f64, y: f64, z: f64, }
    /// `geometry_msgs/Quaternion`.
    Quaternion { x: f64, y: f64, z: f64, w: f64, }
    /// `geometry_msgs/Pose`.
    Pose { position: Point, orientation: Quaternion, }
    /// `geometry_msgs/PoseWithCovariance`.
    PoseWithCovariance {
        pose: Pose,
        /// `float64[36]`: rows of x, y, z and the rotations about them.
        covariance: [[f64; 6]; 6],
    }
    /// `geometry_msgs/Transform`.
    Transform { translation: Vector3, rotation: Quaternion, }
    /// `geometry_msgs/TransformStamped`.
    TransformStamped { header: Header, child_frame_id: String, transform: Transform, }
    /// `tf2_msgs/TFMessage`: transforms between frames.
    TFMessage { transforms: Vec<TransformStamped>, }
    /// `sensor_msgs/PointField`: the layout of one field of a point.
    PointField { name: String, offset: u32, datatype: u8, count: u32, }
    /// `sensor_msgs/PointCloud2`.
    PointCloud2 {
        header: Header,
        height: u32,
        width: u32,
        fields: Vec<PointField>,
        is_bigendian: bool,
        point_step: u32,
        row_step: u32,
        #[serde(serialize_with = "bytes")]
        data: Vec<u8>,
        is_dense: bool,
    }
    /// `sensor_msgs/CompressedImage`.
    CompressedImage {
        header: Header,
        format: String,
        #[serde(serialize_with = "bytes")]
        data: Vec<u8>,
    }
    /// `vision_msgs/ObjectHypothesis`.
    ObjectHypothesis { class_id: String, score: f64, }
    /// `vision_msgs/ObjectHypothesisWithPose`.
    ObjectHypothesisWithPose { hypothesis: ObjectHypothesis, pose: PoseWithCovariance, }
    /// `vision_msgs/BoundingBox3D`.
    BoundingBox3D { center: Pose, size: Vector3, }
    /// `vision_msgs/Detection3D`, of vision_msgs 4.
    Detection3D {
        header: Header,
        results: Vec<ObjectHypothesisWithPose>,
        bbox: BoundingBox3D,
        id: String,
    }
    /// `vision_msgs/Detection3DArray`.
    Detection3DArray { header: Header, detections: Vec<Detection3D>, }
    /// `visualization_msgs/UVCoordinate`.
    UVCoordinate { u: f32, v: f32, }
    /// `visualization_msgs/MeshFile`.
    MeshFile {
        filename: String,
        #[serde(serialize_with = "bytes")]
        data: Vec<u8>,
    }
    /// `visualization_msgs/Marker`, since ROS 2 Galactic.
    Marker {
        header: Header,
        ns: String,
        id: i32,
        /// A constant of the definition, such as [`Marker::CUBE`].
        kind: i32,
        /// 0 adds the marker, or changes that of the same `ns` and `id`.
        action: i32,
        pose: Pose,
        scale: Vector3,
        color: ColorRGBA,
        lifetime: Duration,
        frame_locked: bool,
        points: Vec<Point>,
        colors: Vec<ColorRGBA>,
        texture_resource: String,
        texture: CompressedImage,
        uv_coordinates: Vec<UVCoordinate>,
        text: String,
        mesh_resource: String,
        mesh_file: MeshFile,
        mesh_use_embedded_materials: bool,
    }
    /// `visualization_msgs/MarkerArray`.
    MarkerArray { markers: Vec<Marker>, }
}

impl Message for PointCloud2 {
    const NAME: &'static str = "sensor_msgs/msg/PointCloud2";
}

impl Message for Detection3DArray {
    const NAME: &'static str = "vision_msgs/msg/Detection3DArray";
}

impl Message for MarkerArray {
    const NAME: &'static str = "visualization_msgs/msg/MarkerArray";
}

impl Message for TFMessage {
    const NAME: &'static str = "tf2_msgs/msg/TFMessage";
}

impl PointField {
    /// The `datatype` of a u16.
    pub const UINT16: u8 = 4;
    /// The `datatype` of an f32.
    pub const FLOAT32: u8 = 7;
}

impl Marker {
    /// The `kind` of a box.
    pub const CUBE: i32 = 1;
    /// The `kind` of a text that faces the viewer.
    pub const TEXT_VIEW_FACING: i32 = 9;
}

impl Time {
    /// Converts Unix time in seconds, to the nanosecond, clamped to the range of ROS: 1970 to 2038.
    #[must_use]
    pub fn from_s(time_s: f64) -> Self {
        let sec = time_s.floor().clamp(0.0, f64::from(i32::MAX));
        let nanosec = ((time_s - sec) * 1e9).clamp(0.0, 999_999_999.0);
        Self { sec: sec as i32, nanosec: nanosec as u32 }
    }

    /// The Unix time in nanoseconds.
    #[must_use]
    pub fn as_ns(&self) -> u64 {
        u64::from(self.sec.unsigned_abs()) * 1_000_000_000 + u64::from(self.nanosec)
    }
}

impl Quaternion {
    /// No rotation.
    pub const IDENTITY: Self = Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };

    /// A rotation about z, degrees counterclockwise.
    #[must_use]
    pub fn from_yaw_deg(yaw_deg: f64) -> Self {
        let (z, w) = libm::sincos(yaw_deg.to_radians() / 2.0);
        Self { x: 0.0, y: 0.0, z, w }
    }
}

/// Serializes `uint8[]` at once: byte by byte, the points of a turn would take milliseconds.
#[expect(clippy::ptr_arg, reason = "serde passes the field")]
fn bytes<S: Serializer>(bytes: &Vec<u8>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}
