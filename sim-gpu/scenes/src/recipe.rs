//! A distribution of scenes, as TOML holds it.

use std::path::Path;

use edgepuck_shapes::objects::ObjectKind;
use serde::Deserialize;
use sim_gpu::config::{self, ConfigError, InvalidValue, within};
use sim_gpu::effects::Effects;
use sim_gpu::sensor::Sensor;

/// Everything a scene is drawn from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// One line for people.
    #[serde(default)]
    pub description: String,
    /// How many different objects of each kind there are; they are scaled a
    /// little each time.
    #[serde(default = "variants")]
    pub variants: u32,
    /// The ground.
    #[serde(default)]
    pub ground: Ground,
    /// Where the sensor is mounted.
    pub mount: Mount,
    /// The sensors; each sweep is of one of them.
    #[serde(default)]
    pub sensor: Vec<SensorChoice>,
    /// The part of the beams that return from glass; drawn for each scene.
    #[serde(default)]
    pub glass_returned: Span,
    /// How low segmentation takes points for ground, metres; drawn for each scene,
    /// since robots differ. Low numbers leave strips of ground under objects, high
    /// ones take their feet away. By default that of the segmentation.
    pub ground_clearance_m: Option<Span>,
    /// The objects, placed in this order.
    #[serde(default)]
    pub object: Vec<Objects>,
}

/// The ground, metres. Each number is drawn for each scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ground {
    /// Half of its edge.
    pub half_m: f64,
    /// How steep it is, in any direction, degrees.
    pub slope_deg: Span,
    /// Standard deviation of its height from a smooth surface.
    pub roughness_m: Span,
    /// Width of the road, which runs along x.
    pub road_width_m: Span,
    /// How far the pavements on both sides stand above the road.
    pub kerb_m: Span,
    /// The part of the light that comes back at vertical incidence; all of it by default.
    pub reflectivity: Span,
}

/// Where the sensor is. Each number is drawn for each scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mount {
    /// Height above the ground, metres.
    pub height_m: Span,
    /// By how much it leans, in any direction, degrees.
    #[serde(default)]
    pub tilt_deg: Span,
    /// How far it is from the middle of the road, metres; either side.
    #[serde(default)]
    pub off_road_m: Span,
    /// How fast it goes along the road while it scans, metres a second; it stands still by
    /// default. Points are then where a driver puts them that takes it to stand still.
    #[serde(default)]
    pub speed_m_s: Span,
    /// By how much it pitches and rolls in a drive, degrees: the standard deviation of each,
    /// drawn for each drive. It does not by default.
    #[serde(default)]
    pub sway_deg: Span,
}

/// A sensor and its errors.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorChoice {
    /// A built-in sensor, or the path of a profile, relative to the recipe.
    pub profile: String,
    /// Standard deviation of the range, metres; the profile's own by default.
    pub noise_m: Option<f64>,
    /// The probability that a return is lost.
    #[serde(default)]
    pub dropout: f64,
    /// Further effects, such as the detection limit; none by default.
    #[serde(default)]
    pub effects: Effects,
}

/// Objects of one kind.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Objects {
    /// A kind of built-in objects, or `mesh` for those of `meshes`.
    pub kind: String,
    /// What a network is to call it.
    pub class: String,
    /// How many stand in a scene, at least and at most.
    pub count: [u32; 2],
    /// Where they stand.
    pub place: Place,
    /// Distance from the sensor, metres; drawn with a uniform logarithm.
    pub distance_m: Span,
    /// Space to the next one in a row or a group, metres.
    #[serde(default = "gap")]
    pub gap_m: Span,
    /// Factors of the size, drawn for each axis.
    #[serde(default = "scale")]
    pub scale: Span,
    /// How fast they go along the street in a drive, metres a second; they stand by default, and
    /// in every scene.
    #[serde(default)]
    pub speed_m_s: Span,
    /// The part of the light that comes back at vertical incidence, drawn for each object;
    /// all of it by default.
    #[serde(default = "white")]
    pub reflectivity: Span,
    /// For `kind = "mesh"`: the folder of the meshes, inside that of `--meshes`.
    pub meshes: Option<String>,
    /// For `kind = "mesh"`: the height to which a mesh is scaled, metres.
    pub height_m: Option<Span>,
}

formats::named! {
    /// Where objects stand.
    #[derive(Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Place: "place" {
        /// Anywhere around the sensor, turned in any way.
        Anywhere = "anywhere",
        /// On the road, along it.
        Road = "road",
        /// In rows at the edges of the road, along it or across.
        Parked = "parked",
        /// On the pavements, in groups, turned in any way.
        Pavement = "pavement",
        /// In rows along the far edges of the pavements, end to end.
        Line = "line",
        /// Behind the pavements, facing the road.
        Front = "front",
    }
}

/// A range of numbers, `[least, most]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(from = "[f64; 2]")]
pub struct Span {
    /// The least number.
    pub least: f64,
    /// The greatest number.
    pub most: f64,
}

impl From<[f64; 2]> for Span {
    fn from([least, most]: [f64; 2]) -> Self {
        Self { least, most }
    }
}

fn variants() -> u32 {
    48
}

fn gap() -> Span {
    [0.4, 1.5].into()
}

fn white() -> Span {
    [1.0, 1.0].into()
}

fn scale() -> Span {
    [0.94, 1.06].into()
}

impl Default for Ground {
    fn default() -> Self {
        Self {
            half_m: 80.0,
            slope_deg: Span::default(),
            roughness_m: Span::default(),
            road_width_m: [6.0, 6.0].into(),
            kerb_m: Span::default(),
            reflectivity: white(),
        }
    }
}

impl Span {
    /// The number that lies at `share` (0 to 1) of the range.
    #[must_use]
    pub fn at(self, share: f64) -> f64 {
        self.least + share * (self.most - self.least)
    }

    /// As [`Span::at`], where the logarithm grows evenly.
    #[must_use]
    pub fn at_log(self, share: f64) -> f64 {
        self.least * (self.most / self.least).powf(share)
    }

    fn check(self, key: &str, least: f64, most: f64) -> Result<(), InvalidValue> {
        let is_within = |x: f64| (least..=most).contains(&x);
        if is_within(self.least) && is_within(self.most) && self.least <= self.most {
            return Ok(());
        }
        let found = format!("[{}, {}]", self.least, self.most);
        let cause =
            format!("expected two ascending numbers within {least}..={most}, found {found}");
        Err(InvalidValue::new(key, cause))
    }
}

/// Nothing in a recipe is longer, metres.
const MOST_M: f64 = 1000.0;

impl Recipe {
    /// Reads the recipe in `file`.
    ///
    /// # Errors
    /// Names the file, the key and the cause.
    pub fn load(file: &Path) -> Result<Self, ConfigError> {
        let recipe: Self = config::read(file)?;
        recipe.check().map_err(|invalid| invalid.in_file(file))?;
        Ok(recipe)
    }

    /// Parses the recipe `text`, which stands in `file`; `file` need not exist.
    ///
    /// # Errors
    /// As [`Recipe::load`].
    pub fn parse(text: &str, file: &Path) -> Result<Self, ConfigError> {
        let recipe: Self = config::parse(text, file)?;
        recipe.check().map_err(|invalid| invalid.in_file(file))?;
        Ok(recipe)
    }

    /// Replaces the sensors by those of these `names`, if there are any. A sensor
    /// that the recipe has keeps its errors.
    pub fn use_sensors(&mut self, names: &[String]) {
        if names.is_empty() {
            return;
        }
        let choice = |name: &String| {
            let known = self.sensor.iter().find(|sensor| sensor.profile == *name).cloned();
            known.unwrap_or_else(|| SensorChoice {
                profile: name.clone(),
                noise_m: None,
                dropout: 0.0,
                effects: Effects::default(),
            })
        };
        self.sensor = names.iter().map(choice).collect();
    }

    /// The classes that a network learns: those of the objects, and [`OTHER`],
    /// sorted by name.
    ///
    /// [`OTHER`]: crate::OTHER
    #[must_use]
    pub fn classes(&self) -> Vec<String> {
        let mut classes: Vec<String> =
            self.object.iter().map(|objects| objects.class.clone()).collect();
        classes.push(crate::OTHER.to_owned());
        classes.sort();
        classes.dedup();
        classes
    }

    /// The sensors, read relative to the folder of `file`.
    ///
    /// # Errors
    /// A profile that is missing or wrong.
    pub fn sensors(&self, file: &Path) -> Result<Vec<Sensor>, ConfigError> {
        let folder = file.parent().unwrap_or(Path::new(""));
        self.sensor.iter().map(|sensor| Sensor::resolve_in(folder, &sensor.profile)).collect()
    }

    fn check(&self) -> Result<(), InvalidValue> {
        let Self { ground, mount, sensor, object, .. } = self;
        if self.variants == 0 {
            return Err(InvalidValue::new("variants", "expected at least 1, found 0"));
        }
        within("ground.half_m", ground.half_m, 1.0..=MOST_M)?;
        ground.slope_deg.check("ground.slope_deg", 0.0, 45.0)?;
        ground.roughness_m.check("ground.roughness_m", 0.0, 1.0)?;
        ground.road_width_m.check("ground.road_width_m", 0.0, MOST_M)?;
        ground.kerb_m.check("ground.kerb_m", 0.0, 1.0)?;
        ground.reflectivity.check("ground.reflectivity", 0.0, 1.0)?;
        mount.height_m.check("mount.height_m", -10.0, 100.0)?;
        mount.tilt_deg.check("mount.tilt_deg", 0.0, 45.0)?;
        mount.off_road_m.check("mount.off_road_m", 0.0, MOST_M)?;
        mount.speed_m_s.check("mount.speed_m_s", 0.0, 100.0)?;
        mount.sway_deg.check("mount.sway_deg", 0.0, 10.0)?;
        self.glass_returned.check("glass_returned", 0.0, 1.0)?;
        let clearance_m = self.ground_clearance_m.unwrap_or_default();
        clearance_m.check("ground_clearance_m", 0.0, 1.0)?;
        for (i, sensor) in sensor.iter().enumerate() {
            sensor.check(&format!("sensor[{i}]"))?;
        }
        for (i, objects) in object.iter().enumerate() {
            objects.check(&format!("object[{i}]"))?;
        }
        for (key, is_empty) in [("sensor", sensor.is_empty()), ("object", object.is_empty())] {
            if is_empty {
                let cause = format!("expected at least one [[{key}]], found none");
                return Err(InvalidValue::new(key, cause));
            }
        }
        Ok(())
    }
}

impl SensorChoice {
    fn check(&self, key: &str) -> Result<(), InvalidValue> {
        within(&format!("{key}.noise_m"), self.noise_m, 0.0..=1.0)?;
        within(&format!("{key}.dropout"), self.dropout, 0.0..=1.0)?;
        for (own, is_there) in
            [("noise", self.effects.noise.is_some()), ("dropout", self.effects.dropout.is_some())]
        {
            if is_there {
                let cause = "expected noise_m and dropout of the sensor itself in its place";
                return Err(InvalidValue::new(format!("{key}.effects.{own}"), cause));
            }
        }
        Ok(())
    }
}

/// The kind whose meshes a user brings.
const MESH: &str = "mesh";

impl Objects {
    /// The kind of built-in objects; `None` for a user's meshes.
    #[must_use]
    pub fn built_in(&self) -> Option<ObjectKind> {
        self.kind.parse().ok()
    }

    /// Whether they go along the street in a drive.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.speed_m_s.most > 0.0
    }

    fn check(&self, key: &str) -> Result<(), InvalidValue> {
        let at = |field: &str| format!("{key}.{field}");
        if self.built_in().is_none() && self.kind != MESH {
            let known: Vec<&str> = ObjectKind::ALL.into_iter().map(ObjectKind::name).collect();
            let cause =
                format!("expected {MESH} or one of {}, found \"{}\"", known.join(", "), self.kind);
            return Err(InvalidValue::new(at("kind"), cause));
        }
        let is_mesh = self.kind == MESH;
        for (field, is_there) in
            [("meshes", self.meshes.is_some()), ("height_m", self.height_m.is_some())]
        {
            if is_there != is_mesh {
                let cause = format!("expected with kind = \"{MESH}\", and only there");
                return Err(InvalidValue::new(at(field), cause));
            }
        }
        if self.count[0] > self.count[1] || self.count[1] > 10_000 {
            let cause =
                format!("expected two ascending numbers up to 10000, found {:?}", self.count);
            return Err(InvalidValue::new(at("count"), cause));
        }
        self.distance_m.check(&at("distance_m"), 0.01, MOST_M)?;
        self.gap_m.check(&at("gap_m"), 0.0, MOST_M)?;
        self.scale.check(&at("scale"), 0.01, 100.0)?;
        self.reflectivity.check(&at("reflectivity"), 0.0, 1.0)?;
        self.speed_m_s.check(&at("speed_m_s"), 0.0, 100.0)?;
        if self.moves() && !matches!(self.place, Place::Road | Place::Pavement) {
            let cause = format!("expected with place = road or pavement, found \"{}\"", self.place);
            return Err(InvalidValue::new(at("speed_m_s"), cause));
        }
        self.height_m.unwrap_or([1.0, 1.0].into()).check(&at("height_m"), 0.01, MOST_M)
    }
}
