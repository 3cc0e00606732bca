use formats::geometry::OrientedBox;
use serde::Deserialize;

use crate::messages::{
    BoundingBox3D, ColorRGBA, Detection3D, Detection3DArray, Duration, Header, Marker, MarkerArray,
    ObjectHypothesis, ObjectHypothesisWithPose, Point, Pose, PoseWithCovariance, Quaternion, Time,
    Vector3,
};

/// How long viewers show a marker that no later one replaces, seconds: 1.5 turns at 10 Hz.
pub const MARKER_LIFETIME_S: f64 = 0.15;

/// The height of letters, metres.
const LETTER_M: f64 = 0.4;

/// The keys of a line of `infer-cpu live` (version 1) that messages need; other keys are ignored.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Object {
    /// The number of the turn, from 0.
    pub turn: u64,
    /// The number of its track, from 1.
    pub track: u64,
    /// Its class, or `unknown`; `None` if it had too few points to be classified.
    pub class: Option<String>,
    /// The probability of its class by all clusters of the track.
    pub probability: Option<f64>,
    /// The frame of `position_m` and `yaw_deg`.
    pub frame: String,
    /// The middle of its box, metres.
    pub position_m: [f64; 3],
    /// Length, width and height of its box, metres.
    pub size_m: [f64; 3],
    /// The direction of its length, degrees counterclockwise from x.
    pub yaw_deg: f64,
    /// When its last point was measured, seconds of Unix time.
    pub last_s: f64,
    /// The box of the whole object, if it is known; messages then have it in place of the box around
    /// its points.
    #[serde(default)]
    pub whole_box: Option<OrientedBox>,
}

impl Object {
    fn header(&self) -> Header {
        Header { stamp: Time::from_s(self.last_s), frame_id: self.frame.clone() }
    }

    fn bbox(&self) -> BoundingBox3D {
        let ([x, y, z], size_m, yaw_deg) = match &self.whole_box {
            Some(whole) => (whole.centre_m, whole.size_m, whole.yaw_rad.to_degrees()),
            None => (self.position_m, self.size_m, self.yaw_deg),
        };
        let orientation = Quaternion::from_yaw_deg(yaw_deg);
        let center = Pose { position: Point { x, y, z }, orientation };
        let [x, y, z] = size_m;
        BoundingBox3D { center, size: Vector3 { x, y, z } }
    }

    fn detection(&self) -> Option<Detection3D> {
        let bbox = self.bbox();
        let hypothesis = ObjectHypothesisWithPose {
            hypothesis: ObjectHypothesis {
                class_id: self.named()?.to_owned(),
                score: self.probability.unwrap_or_default(),
            },
            pose: PoseWithCovariance { pose: bbox.center.clone(), ..PoseWithCovariance::default() },
        };
        Some(Detection3D {
            header: self.header(),
            results: vec![hypothesis],
            bbox,
            id: self.track.to_string(),
        })
    }

    /// The class, unless it is unknown.
    fn named(&self) -> Option<&str> {
        self.class.as_deref().filter(|class| *class != "unknown")
    }

    /// A box, and a text above it.
    fn markers(&self) -> Option<[Marker; 2]> {
        let class = self.named()?;
        let BoundingBox3D { center, size } = self.bbox();
        let cube = Marker {
            header: self.header(),
            ns: "boxes".to_owned(),
            // ROS ids are i32, so track numbers wrap around.
            id: (self.track % i32::MAX as u64) as i32,
            kind: Marker::CUBE,
            pose: center,
            scale: size,
            color: color(class),
            lifetime: Duration { sec: 0, nanosec: (MARKER_LIFETIME_S * 1e9) as u32 },
            ..Marker::default()
        };
        let mut text = Marker {
            ns: "names".to_owned(),
            kind: Marker::TEXT_VIEW_FACING,
            scale: Vector3 { x: 0.0, y: 0.0, z: LETTER_M },
            color: ColorRGBA { r: 1.0, g: 1.0, b: 1.0, a: 1.0 },
            text: format!("{class} {}", self.track),
            ..cube.clone()
        };
        text.pose.position.z += cube.scale.z / 2.0 + LETTER_M;
        Some([cube, text])
    }
}

/// The objects of a turn that have a class other than unknown. The array's time and frame are those of
/// the last object of any kind.
#[must_use]
pub fn detections(objects: &[Object]) -> Detection3DArray {
    Detection3DArray {
        header: objects.last().map(Object::header).unwrap_or_default(),
        detections: objects.iter().filter_map(Object::detection).collect(),
    }
}

/// The same objects for RViz and other viewers: a box and a text for each, with the track as `id`.
#[must_use]
pub fn markers(objects: &[Object]) -> MarkerArray {
    MarkerArray { markers: objects.iter().filter_map(Object::markers).flatten().collect() }
}

/// The colour of a class: a hue that depends only on its name.
fn color(class: &str) -> ColorRGBA {
    // FNV-1a, 32 bits (RFC 9923).
    let hash = class
        .bytes()
        .fold(0x811c_9dc5u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    // A hue of full saturation: each of red, green and blue is a third of a turn further.
    let hue = (hash % 360) as f32 / 60.0;
    let share = |shift: f32| (((hue + shift) % 6.0 - 3.0).abs() - 1.0).clamp(0.0, 1.0);
    ColorRGBA { r: share(0.0), g: share(4.0), b: share(2.0), a: 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Message;

    const LINE: &str = r#"{"version":1,"turn":3,"track":7,"class":"car","resembles":"car",
        "confidence":0.9,"probability":0.8,"frame":"sensor","position_m":[1.0,2.0,3.0],
        "size_m":[4.0,2.0,1.5],"yaw_deg":90.0,"velocity_m_s":null,"points":99,"range_m":2.2,
        "first_s":9.9,"last_s":10.25,"latency_ms":null}"#;

    fn object() -> Object {
        serde_json::from_str(LINE).unwrap()
    }

    fn header() -> Header {
        Header { stamp: Time { sec: 10, nanosec: 250_000_000 }, frame_id: "sensor".to_owned() }
    }

    /// A quarter turn to the left about z (REP 103).
    fn pose(z: f64) -> Pose {
        let half = 0.5f64.sqrt();
        let orientation = Quaternion { x: 0.0, y: 0.0, z: half, w: half };
        Pose { position: Point { x: 1.0, y: 2.0, z }, orientation }
    }

    fn assert_near(found: &Pose, expected: &Pose) {
        assert_eq!(found.position, expected.position);
        let parts = |q: &Quaternion| [q.x, q.y, q.z, q.w];
        let pairs = parts(&found.orientation).into_iter().zip(parts(&expected.orientation));
        pairs.for_each(|(found, expected)| assert!((found - expected).abs() < 1e-15, "{found}"));
    }

    #[test]
    fn a_line_becomes_a_detection() {
        let unknown = Object { class: Some("unknown".to_owned()), ..object() };
        let nameless = Object { class: None, probability: None, last_s: 11.0, ..object() };
        let array = detections(&[object(), unknown, nameless]);
        let [car] = &array.detections[..] else { panic!("{array:?}") };
        assert_eq!(array.header.stamp, Time { sec: 11, nanosec: 0 });
        assert_eq!((&car.header, &*car.id), (&header(), "7"));
        assert_eq!(car.bbox.size, Vector3 { x: 4.0, y: 2.0, z: 1.5 });
        let [result] = &car.results[..] else { panic!("{car:?}") };
        let class = |class: &str| ObjectHypothesis { class_id: class.to_owned(), score: 0.8 };
        assert_eq!(result.hypothesis, class("car"));
        assert_eq!(result.pose.covariance, [[0.0; 6]; 6]);
        for found in [&car.bbox.center, &result.pose.pose] {
            assert_near(found, &pose(3.0));
        }
    }

    #[test]
    fn messages_have_the_whole_box_where_there_is_one() {
        let whole =
            r#""whole_box":{"centre_m":[2.0,3.0,3.5],"size_m":[5.0,2.5,2.0],"yaw_deg":-90.0}}"#;
        let line = LINE.replace('}', &format!(",{whole}"));
        let object: Object = serde_json::from_str(&line).unwrap();
        let nothing = LINE.replace('}', r#","whole_box":null}"#);
        assert_eq!(serde_json::from_str::<Object>(&nothing).unwrap(), self::object());
        let BoundingBox3D { center, size } = &object.detection().unwrap().bbox;
        assert_eq!(center.position, Point { x: 2.0, y: 3.0, z: 3.5 });
        assert_eq!(*size, Vector3 { x: 5.0, y: 2.5, z: 2.0 });
        // A quarter turn to the right about z.
        assert!((center.orientation.z + 0.5f64.sqrt()).abs() < 1e-15, "{center:?}");
        let [cube, text] = object.markers().unwrap();
        assert_eq!((&cube.pose, &cube.scale), (center, size));
        assert_eq!(text.pose.position, Point { z: 3.5 + 1.0 + 0.4, ..center.position });
    }

    #[test]
    fn an_object_becomes_a_box_and_a_text() {
        let array = markers(&[object(), Object { class: None, ..object() }]);
        let [cube, text] = &array.markers[..] else { panic!("{array:?}") };
        assert_eq!((cube.kind, cube.id, cube.ns.as_str(), cube.action), (1, 7, "boxes", 0));
        assert_eq!((text.kind, text.id, text.ns.as_str(), text.action), (9, 7, "names", 0));
        assert_eq!(text.text, "car 7");
        assert_eq!(cube.scale, Vector3 { x: 4.0, y: 2.0, z: 1.5 });
        for marker in [cube, text] {
            assert_eq!(marker.header, header());
            assert_eq!(marker.lifetime, Duration { sec: 0, nanosec: 150_000_000 });
        }
        assert_near(&cube.pose, &pose(3.0));
        // The middle of the letters is 0.4 m above the top of the box.
        assert_near(&text.pose, &pose(3.0 + 0.75 + 0.4));
        let names = ["car", "pedestrian", "cyclist", "truck"];
        for (i, name) in names.iter().enumerate() {
            assert!(names[..i].iter().all(|other| color(name) != color(other)));
        }
    }

    /// The expected bytes follow from the definition and from CDR's alignment: a number of n bytes
    /// begins at a multiple of n after the header.
    #[test]
    fn bytes_are_plain_cdr() {
        let bytes = detections(&[object()]).to_cdr();
        let mut expected = vec![0, 1, 0, 0, 10, 0, 0, 0];
        expected.extend(250_000_000u32.to_le_bytes());
        expected.extend(*b"\x07\0\0\0sensor\0\0\x01\0\0\0");
        assert_eq!(bytes[..expected.len()], expected);
        // The end: three f64 of the size, and the id.
        let end = bytes.len() - 6;
        assert_eq!(bytes[end..], *b"\x02\0\0\x007\0");
        assert_eq!(bytes[end - 8..end], 1.5f64.to_le_bytes());
        assert_eq!((end - 4) % 8, 0);
    }
}
