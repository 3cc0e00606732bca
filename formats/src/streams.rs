//! Everything that Edgepuck draws at random, in one list.
//!
//! Clippy finds keys that are made elsewhere (clippy.toml), and the test below draws from each of
//! these: what is added here is tested without more.

#![allow(clippy::disallowed_methods, reason = "this is the list")]

use crate::rng::StreamKey;
use std::fmt::{self, Display, Formatter};

/// Declares the streams: the fields that each belongs to besides the seed, its name, and its number
/// among the streams of this name.
macro_rules! streams {
    ($($(#[$meta:meta])* $stream:ident { $($field:ident: $type:ty),* } = $name:literal, $index:expr;)+) => {
        /// What a stream of random numbers is drawn for.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[expect(missing_docs, reason = "the fields are names and numbers of what a stream says")]
        pub enum Stream<'a> {
            $($(#[$meta])* $stream { $($field: $type),* },)+
        }

        impl Stream<'_> {
            /// The key of this stream under `seed`.
            #[must_use]
            pub fn key(self, seed: u64) -> StreamKey {
                match self {
                    $(Self::$stream { $($field),* } => StreamKey::named(seed, format_args!($name), $index),)+
                }
            }
        }

        /// Each stream with one of its fields changed, or none.
        #[cfg(test)]
        fn examples() -> Vec<Stream<'static>> {
            let mut examples = Vec::new();
            $({
                let fields: &[&str] = &[$(stringify!($field)),*];
                examples.extend((0..=fields.len()).map(|changed| {
                    #[allow(unused_variables, reason = "some streams have no field")]
                    let name = |field| (field, fields.get(changed) == Some(&field));
                    Stream::$stream { $($field: Example::example(name(stringify!($field)))),* }
                }));
            })+
            examples
        }
    };
}

streams! {
    /// The split of a mesh whose folder names none.
    Split { class: &'a str, name: &'a str } = "{class}/{name}", 0;
    /// The views of a set around a mesh.
    Views { set: &'a str, mesh: &'a str } = "views/{set}/{mesh}", 0;
    /// A view of a mesh in a set: noise, losses and weather.
    View { set: &'a str, mesh: &'a str, view: u32 } = "{set}/{mesh}", view;
    /// The points of a view that go into a packed cloud.
    Pack { set: &'a str, variant: &'a str, mesh: &'a str, view: u32 } =
        "pack/{set}/{variant}/{mesh}", view;
    /// The seed of another view, in place of one with too few points.
    AnotherView { attempt: u32 } = "another view", attempt;
    /// The seed of an epoch after the first.
    Epoch { epoch: u32 } = "epoch", epoch;
    /// The order of meshes in tars.
    Tars { split: &'a str } = "tars/{split}", 0;
    /// A corruption of a recorded sweep.
    CorruptedSweep { corruption: &'a str, severity: u32 } = "corrupt/{corruption}", severity;
    /// The weather of a recorded sweep.
    Weather {} = "weather", 0;

    /// A scan from a scene's sensor, or the beams on an instance that has a name.
    Scan { name: &'a str, at: StartTime, sensor: u32 } = "{name}{at}", sensor;
    /// The beams on an instance that has no name.
    Instance { number: u32, at: StartTime, sensor: u32 } = "instance/{number}{at}", sensor;

    /// The seed of the scan of a row of a batch.
    BatchRow { row: u32 } = "batch row", row;

    /// A part of a generated shape.
    Shape { class: &'a str, part: &'a str, instance: u32 } = "shapes/{class}/{part}", instance;
    /// A generated object of a street, a room or a yard.
    Object { kind: &'a str, instance: u32 } = "objects/{kind}", instance;
    /// The heights of meshes of a folder.
    MeshHeights { folder: &'a str } = "meshes/{folder}", 0;
    /// The reflectivity of the ground of a scene.
    GroundReflectivity { scene: u32 } = "reflectivity/ground", scene;
    /// The reflectivities of the objects of an entry of a recipe.
    ObjectReflectivity { entry: u32 } = "reflectivity/object", entry;
    /// Where the objects of a scene stand.
    ScenePlaces { scene: u32 } = "scene/place", scene;
    /// The ground of a scene.
    SceneGround { scene: u32 } = "scene/ground", scene;
    /// The speed of a scene's sensor.
    SceneSpeed { scene: u32 } = "scene/speed", scene;
    /// The beams on an instance of a scene.
    SceneBeams { scene: u32, part: u32 } = "scene/{scene}/beams", part;
    /// What stays the same during a drive.
    Drive {} = "drive", 0;
    /// The ground of a drive.
    DriveGround {} = "drive/ground", 0;
    /// The pitch and the roll of a driving sensor.
    DriveSway {} = "drive/sway", 0;
    /// The objects of a block along a drive, by layer: 0 stands, the others are lanes.
    DriveBlock { layer: usize, block: u32 } = "drive/block/{layer}", block;
    /// The beams of a packet of a drive.
    DriveBeams { packet: u32 } = "drive/beams", packet;

    /// The points that the sampler `random` selects.
    RandomSampler {} = "random sampler", 0;
    /// A shape by which a quantized network is calibrated.
    Calibration { shape: u32 } = "calibration shape", shape;
    /// The cloud of a benchmark.
    BenchmarkCloud {} = "benchmark cloud", 0;

    /// The first weights or biases of a layer.
    Parameter { layer: &'a str, part: &'a str } = "{layer}.{part}", 0;
    /// The meshes that are kept for validation.
    Validation {} = "validation", 0;
    /// The order of clouds in an epoch.
    Order { epoch: u32 } = "order", epoch;
    /// The clouds of a group of classes that do not fill another turn in an epoch.
    Rest { group: usize, epoch: u32 } = "rest of {group}", epoch;
    /// The augmentation of a cloud, drawn for the first time in an epoch.
    Augment { cloud: usize, epoch: u32 } = "augment {cloud}", epoch;
    /// The augmentation of a cloud that is drawn again in an epoch.
    AugmentAgain { cloud: usize, turn: u32, epoch: u32 } = "augment {cloud} again {turn}", epoch;
    /// What dropout leaves out.
    Dropout {} = "dropout", 0;
    /// The parts that LIME leaves out.
    Lime {} = "lime", 0;
}

/// When a scan begins, seconds: a suffix of its stream's name, empty at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartTime(pub f64);

impl Display for StartTime {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.0 == 0.0 { Ok(()) } else { write!(f, "@{}", self.0) }
    }
}

#[cfg(test)]
trait Example {
    /// A value of a field, and another if it is changed.
    fn example(field: (&'static str, bool)) -> Self;
}

#[cfg(test)]
mod tests {
    use super::*;
    use test_support::assert_uncorrelated;

    impl Example for &str {
        fn example((field, is_changed): (&'static str, bool)) -> Self {
            if is_changed { "another" } else { field }
        }
    }

    impl Example for u32 {
        fn example((_, is_changed): (&'static str, bool)) -> Self {
            is_changed.into()
        }
    }

    impl Example for u64 {
        fn example((_, is_changed): (&'static str, bool)) -> Self {
            is_changed.into()
        }
    }

    impl Example for usize {
        fn example((_, is_changed): (&'static str, bool)) -> Self {
            is_changed.into()
        }
    }

    impl Example for StartTime {
        fn example((_, is_changed): (&'static str, bool)) -> Self {
            Self(if is_changed { 0.1 } else { 0.0 })
        }
    }

    /// Numbers of mean 0.
    fn numbers(key: StreamKey) -> Vec<f64> {
        (0..1000).map(|n| key.unit(n) - 0.5).collect()
    }

    #[test]
    fn no_two_streams_and_no_two_seeds_have_numbers_in_common() {
        let seeds = [0, 1, 1 << 32];
        let all: Vec<(String, Vec<f64>)> = examples()
            .into_iter()
            .flat_map(|stream| {
                seeds.map(|seed| (format!("{stream:?} of seed {seed}"), numbers(stream.key(seed))))
            })
            .collect();
        assert!(all.len() >= 261, "{}", all.len());
        for (i, (name, own)) in all.iter().enumerate() {
            let next: Vec<[f64; 2]> = own.iter().zip(&own[1..]).map(|(a, b)| [*a, *b]).collect();
            assert_uncorrelated(&format!("{name}: the next number"), &next);
            for (other, others) in &all[i + 1..] {
                let pairs: Vec<[f64; 2]> = own.iter().zip(others).map(|(a, b)| [*a, *b]).collect();
                assert_uncorrelated(&format!("{name} and {other}"), &pairs);
            }
        }
    }

    /// Names keep their bytes, on which those of data sets depend: SHA-256 of (seed, number, name).
    #[test]
    fn names_have_the_fields_in_order() {
        let view = Stream::View { set: "vlp32c", mesh: "chair/train/1", view: 3 };
        assert_eq!(view.key(5), StreamKey::new(5, "vlp32c/chair/train/1", 3));
        let scan = |start_s| Stream::Scan { name: "scan", at: StartTime(start_s), sensor: 2 };
        assert_eq!(scan(0.0).key(5), StreamKey::new(5, "scan", 2));
        assert_eq!(scan(0.5).key(5), StreamKey::new(5, "scan@0.5", 2));
        let again = Stream::AugmentAgain { cloud: 4, turn: 2, epoch: 9 };
        assert_eq!(again.key(5), StreamKey::new(5, "augment 4 again 2", 9));
    }
}
