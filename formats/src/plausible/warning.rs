//! What is probably wrong with an input, in words.

use std::fmt::Display;

use crate::counted;
use crate::unit::Unit;

/// Why an input is probably not what its user meant, or what of it is not used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Warning {
    /// A warning about a file, or a part of one.
    #[error("{source_name}: {warning}")]
    Of {
        /// The file or the part.
        source_name: String,
        /// The warning.
        warning: Box<Warning>,
    },

    /// No triangle of a mesh has an area.
    #[error("no triangle has an area, so that no beam can hit the mesh")]
    NoArea,
    /// Polygons of a mesh, numbers `n` of `of`, cross themselves, or their corners are not in a plane.
    #[error(
        "{n} of {of} faces {}, so that their surface is a guess; the first is face {first}",
        if *cross { "cross themselves" } else { "are not flat" }
    )]
    GuessedFaces {
        /// Whether their sides cross.
        cross: bool,
        /// How many they are.
        n: usize,
        /// The faces of the file.
        of: usize,
        /// The number of the first of them, from 1.
        first: usize,
    },
    /// An OFF file has lines after this number of faces, which its header states.
    #[error("expected {0} faces by the header, found more lines: they are not read")]
    MoreLines(u64),
    /// An STL file holds more triangles than its header promises.
    #[error(
        "the header promises {promised} triangles, the file holds {held}, of which the first \
         {promised} are read"
    )]
    MoreTriangles {
        /// The triangles that are read.
        promised: u64,
        /// The triangles of the file.
        held: u64,
    },
    /// glTF has animations.
    #[error("animations are not applied: nodes stand at rest")]
    Animations,
    /// glTF has a skin.
    #[error("a skin is not applied: its mesh stands as it was bound")]
    Skin,
    /// glTF has morph targets.
    #[error("morph targets are not applied: their meshes stand undeformed")]
    MorphTargets,
    /// glTF has points or lines.
    #[error("points and lines are left out, since no beam hits them")]
    PointsAndLines,
    /// The material of this name, whose base colour is used, has an image.
    #[error("material {0:?}: its image is left out of base colours")]
    ImageOfMaterial(String),
    /// A joint of a robot has no position by one number.
    #[error("joint {name:?}: a {kind} joint stays at its origin")]
    JointStays {
        /// The joint.
        name: String,
        /// `floating` or `planar`.
        kind: String,
    },
    /// A position is beyond the limits of a joint.
    #[error(
        "joint {name:?}: expected a position from {} to {}, its limits, found {found}",
        limits[0], limits[1]
    )]
    JointBeyondLimits {
        /// The joint.
        name: String,
        /// The limits, radians or metres.
        limits: [f64; 2],
        /// The position.
        found: f64,
    },
    /// The size of a mesh is that of another unit.
    #[error("{}", mesh_size(*size_m, *unit, *likely, remedy))]
    MeshSize {
        /// The size if its unit is `unit`, metres.
        size_m: [f64; 3],
        /// The unit that it was read in.
        unit: Unit,
        /// The unit that is more likely, if there is one.
        likely: Option<Unit>,
        /// How a user names another unit.
        remedy: &'static str,
    },
    /// Noise or a quantum is as large as a mesh.
    #[error("expected {what} smaller than the mesh, {}, found {found_m} m", box_of(*size_m))]
    EffectOnMesh {
        /// `noise` or `a quantum`.
        what: &'static str,
        /// The size of the mesh, metres.
        size_m: [f64; 3],
        /// That of the effect, metres.
        found_m: f64,
    },
    /// A number of a sensor's profile, which is called by its key, is probably not in this unit.
    #[error("{0} = {1}: is it in {2}?")]
    NumberOfSensor(&'static str, f64, &'static str),
    /// All angles of this kind in a sensor's profile are within these bounds, degrees.
    #[error("all {0} lie within {low:.3} to {high:.3} degrees: are they in radians?", low = .1[0], high = .1[1])]
    AnglesOfSensor(&'static str, [f64; 2]),
    /// A sensor stands inside the bounding box of a mesh; the string says what places it elsewhere.
    #[error("a sensor stands inside its bounding box: expected {0}")]
    SensorInside(String),

    /// No mesh of a folder is in this split.
    #[error("no mesh is in the {0} split; {WAY_TO_SPLIT}")]
    EmptySplit(&'static str),
    /// These classes have no mesh in this split.
    #[error("no {0} mesh of {names}; {WAY_TO_SPLIT}", names = some_of(.1))]
    ClassesWithoutSplit(&'static str, Vec<String>),
    /// Every class of a folder, of which the number is given, has one mesh: the folders are probably not classes.
    #[error(
        "each of the {0} classes has one mesh; expected CLASS/NAME, CLASS/{{train,test}}/NAME or \
         CLASS/ID/NAME, with one mesh in each ID, in the folder"
    )]
    OneMeshAClass(usize),
    /// So many meshes in folders called `val` and the like are used for training.
    #[error(
        "the train split has {} of folders for validation: training holds out its own clouds for \
         validation",
        counted(*.0, "mesh")
    )]
    Validation(usize),
    /// Files that probably hold meshes are of formats that are not read.
    #[error(
        "{} ignored ({}){}; expected {read}",
        if *n == 1 { "1 file is".to_owned() } else { format!("{n} files are") },
        some_of(extensions),
        without_mesh(classes)
    )]
    UnreadFormats {
        /// How many files.
        n: usize,
        /// Their extensions, with dots.
        extensions: Vec<String>,
        /// The classes that have no other mesh.
        classes: Vec<String>,
        /// The extensions that are read.
        read: String,
    },

    /// The farthest point of a sweep is at an odd distance from the sensor, metres.
    #[error(
        "the farthest point is {0:.3} m from the sensor: expected 0.5 m to 2 km; are the points in \
         metres?"
    )]
    FarthestPoint(f64),
    /// The nearest point of a sweep is far from the sensor, metres.
    #[error(
        "the nearest point is {0:.3} m from the sensor: expected at most 50 m; is the origin the \
         position of the sensor?"
    )]
    NearestPoint(f64),
    /// A sweep has this number of points.
    #[error("expected thousands of points, as of a turn of a sensor, found {0}")]
    FewPoints(usize),
    /// All points of a sweep are in a box of this size, metres, beside the sensor.
    #[error(
        "all points are within {}, beside the sensor: expected all that is around it; classify names \
         one object", box_of(*.0)
    )]
    OneObject([f64; 3]),
    /// The ground of a sweep is at this height, metres.
    #[error(
        "the ground is at z = {0:.1} m: expected it 0.15 to 30 m below the sensor; is the origin the \
         vehicle's, or that of a map? --origin gives the sensor's position"
    )]
    GroundAt(f64),
    /// The ground of a sweep rises by this angle, degrees.
    #[error("the ground rises by {0:.0} degrees: is the sensor tilted? Turn the points upright")]
    TiltedGround(f64),
    /// The columns of a sweep look like a range and two angles in this unit.
    #[error(
        "the columns are within the bounds of a range, an azimuth and an elevation in {0}: expected \
         x, y and z in metres"
    )]
    Angles(&'static str),
    /// Coordinates have lost digits.
    #[error(
        "the coordinates are numbers of 32 bits, which are {step_m} m apart at {at_m} m: write \
         numbers of 64 bits, or subtract the sensor's position before you write them"
    )]
    CoarseCoordinates {
        /// The distance of neighbouring numbers of 32 bits, metres.
        step_m: f32,
        /// At this coordinate, metres.
        at_m: f32,
    },
    /// Another axis than z points up in a sweep.
    #[error(
        "{:.0} % of the points are ground if z points up, and {:.0} % if {axis} does: expected the \
         sensor's frame, z up",
        100.0 * ground_of_z, 100.0 * ground
    )]
    OtherAxisUp {
        /// The share of ground if z points up, 0 to 1.
        ground_of_z: f64,
        /// The share of ground if `axis` does.
        ground: f64,
        /// `x`, `-y` and so on.
        axis: &'static str,
    },

    /// Something moves faster than a car.
    #[error(
        "{what} moves at {speed_m_s:.0} m/s at {at_s} s: expected at most 100 m/s; are the positions \
         in metres and the times in seconds?"
    )]
    TooFast {
        /// Such as `the sensor`.
        what: String,
        /// Metres per second.
        speed_m_s: f64,
        /// When, seconds.
        at_s: f64,
    },
    /// Something that stands upright is on its head in most poses.
    #[error("{0} stands on its head: expected quaternions in the order x y z w")]
    UpsideDown(String),
    /// There is one pose of a sensor that moves.
    #[error("there is one pose: the sensor is taken to stand still there")]
    OnePose,
    /// There is no pose for a while.
    #[error(
        "there is no pose for {gap_s:.3} s after {at_s} s: between two poses the sensor is taken to \
         move straight on"
    )]
    GapInPoses {
        /// How long, seconds.
        gap_s: f64,
        /// From when on, seconds.
        at_s: f64,
    },
}

const WAY_TO_SPLIT: &str =
    "another seed, or folders CLASS/{train,test}, split the meshes otherwise";

impl Warning {
    /// The same warning, about `source`.
    #[must_use]
    pub fn of(self, source: impl Display) -> Self {
        Self::Of { source_name: source.to_string(), warning: Box::new(self) }
    }
}

fn mesh_size(size_m: [f64; 3], unit: Unit, likely: Option<Unit>, remedy: &str) -> String {
    let named = if unit == Unit::Metre { "the metre" } else { unit.plural() };
    let found = box_of(size_m);
    let text = format!("expected a size of 1 cm to 100 m, found {found} if its unit is {named}");
    let Some(likely) = likely else { return text };
    let other = box_of(size_m.map(|side| side / unit.metres() * likely.metres()));
    format!("{text} ({other} if it is {}); {remedy}", likely.plural())
}

fn without_mesh(classes: &[String]) -> String {
    match classes {
        [] => String::new(),
        [class] => format!("; the class {class} has no mesh"),
        classes => format!("; the classes {} have no mesh", some_of(classes)),
    }
}

/// The first of `names`, and how many more there are.
fn some_of(names: &[String]) -> String {
    const MOST: usize = 5;
    let first = names[..names.len().min(MOST)].join(", ");
    match names.len().saturating_sub(MOST) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

/// `0.45 x 0.4 x 0.9 m`.
fn box_of(size_m: [f64; 3]) -> String {
    let [x, y, z] = size_m.map(|side| format!("{side:.3e}").parse().unwrap_or(side));
    format!("{x} x {y} x {z} m")
}
