//! Recipes: distributions of scenes, read from TOML.

use std::path::Path;

use edgepuck_assets::SCENE_RECIPES;
use edgepuck_shapes::objects::ObjectKind;
use serde::Deserialize;
use sim_gpu::effects::Effects;
use sim_gpu::errors::{ConfigError, InvalidValue};
use sim_gpu::sensors::SensorProfile;
use sim_gpu::settings::{self, within};

use crate::error::SceneError;

/// The class of clusters that do not show one whole object: ground, two objects in one cluster, or
/// a small part of an object.
pub const OTHER: &str = "other";

/// A distribution of scenes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The number of different models of each built-in object.
    #[serde(default = "variants")]
    pub variants: u32,
    /// The ground.
    #[serde(default)]
    pub ground: Ground,
    /// The mount of the sensor.
    pub mount: Mount,
    /// The sensors; each scene has one of them.
    #[serde(default)]
    pub sensor: Vec<SensorChoice>,
    /// The fraction of the beams that return from glass; drawn for each scene.
    #[serde(default)]
    pub glass_returned: Span,
    /// The height below which segmentation takes points for ground, metres; drawn for each scene,
    /// because robots differ. Small values leave strips of ground under objects, large ones cut
    /// off the feet of objects. By default segmentation uses its own value.
    pub ground_clearance_m: Option<Span>,
    /// The objects, placed in this order.
    #[serde(default)]
    pub object: Vec<Objects>,
}

/// The ground. Each value is drawn for each scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ground {
    /// Half the length of its edge, metres.
    pub half_m: f64,
    /// The slope in a random direction, degrees.
    pub slope_deg: Span,
    /// The standard deviation of the height from a smooth surface, metres.
    pub roughness_m: Span,
    /// The width of the road, which runs along x, metres.
    pub road_width_m: Span,
    /// The height of the pavements on both sides above the road, metres.
    pub kerb_m: Span,
    /// The fraction of the light that is reflected at vertical incidence; 1 by default.
    pub reflectivity: Span,
}

/// The mount of the sensor. Each value is drawn for each scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mount {
    /// The height above the ground, metres.
    pub height_m: Span,
    /// The tilt in a random direction, degrees.
    #[serde(default)]
    pub tilt_deg: Span,
    /// The distance from the middle of the road to either side, metres.
    #[serde(default)]
    pub off_road_m: Span,
    /// The speed along the road during a scan, metres a second; 0 by default. Points are then
    /// motion-distorted, as a driver that ignores ego-motion reports them.
    #[serde(default)]
    pub speed_m_s: Span,
    /// The standard deviations of pitch and roll in a drive, degrees, drawn for each drive; 0 by
    /// default.
    #[serde(default)]
    pub sway_deg: Span,
}

/// A sensor and its effects.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorChoice {
    /// The name of a built-in sensor, or the path of a profile relative to the recipe.
    pub profile: String,
    /// The effects, such as the detection limit. The noise is that of the profile by default.
    #[serde(default)]
    pub effects: Effects,
}

/// An entry of a recipe: objects of one kind.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Objects {
    /// A built-in kind of object, or `mesh` for the meshes in the folder `meshes`.
    pub kind: String,
    /// The class that a network learns for the objects.
    pub class: String,
    /// The least and the greatest number of these objects in a scene.
    pub count: [u32; 2],
    /// Where they stand.
    pub place: Place,
    /// The distance from the sensor, metres; its logarithm is uniform.
    pub distance_m: Span,
    /// The space to the next object in a row or a group, metres.
    #[serde(default = "gap")]
    pub gap_m: Span,
    /// The speed along the street in a drive, metres a second; 0 by default. In a scene all
    /// objects stand.
    #[serde(default)]
    pub speed_m_s: Span,
    /// The fraction of the light that is reflected at vertical incidence, drawn for each object;
    /// 1 by default.
    #[serde(default = "white")]
    pub reflectivity: Span,
    /// For `kind = "mesh"`: the folder of the meshes, inside that of `--meshes`.
    pub meshes: Option<String>,
    /// For `kind = "mesh"`: the height to which each mesh is scaled, metres.
    pub height_m: Option<Span>,
}

formats::named! {
    /// Where objects stand.
    #[derive(Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Place: "place" {
        /// Anywhere around the sensor, in any direction.
        Anywhere = "anywhere",
        /// On the road, along it.
        Road = "road",
        /// In rows at the edges of the road, along it or across.
        Parked = "parked",
        /// On the pavements, in groups, in any direction.
        Pavement = "pavement",
        /// In rows along the far edges of the pavements, end to end.
        Line = "line",
        /// Behind the pavements, facing the road.
        Front = "front",
    }
}

/// The scale factor of each object, drawn for each axis.
pub(crate) const SCALE: Span = Span { least: 0.94, most: 1.06 };

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
    /// The value at `share` (0 to 1) of the range.
    #[must_use]
    pub fn at(self, share: f64) -> f64 {
        self.least + share * (self.most - self.least)
    }

    /// The value at `share` of the range on a logarithmic scale.
    #[must_use]
    pub fn at_log(self, share: f64) -> f64 {
        self.least * libm::pow(self.most / self.least, share)
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

/// The greatest length in a recipe, metres.
const MOST_M: f64 = 1000.0;

impl Recipe {
    /// A built-in recipe by its name, or the one in a file.
    ///
    /// # Errors
    /// There is neither, or the recipe is invalid.
    pub fn resolve(name_or_file: &Path) -> Result<Self, SceneError> {
        let built_in = SCENE_RECIPES.iter().find(|(name, _)| Path::new(name) == name_or_file);
        match built_in {
            Some((_, text)) => Self::parse(text, name_or_file),
            None if name_or_file.exists() => Self::load(name_or_file),
            None => Err(SceneError::NoRecipe(name_or_file.to_owned())),
        }
    }

    /// Reads the recipe in `file`.
    ///
    /// # Errors
    /// The file is missing or invalid; the error names the key and the cause.
    pub fn load(file: &Path) -> Result<Self, SceneError> {
        Ok(settings::read(file, "a recipe of scenes", Self::checked)?)
    }

    /// Parses the recipe `text`. Errors name `file`, which need not exist.
    ///
    /// # Errors
    /// The recipe is invalid; the error names the key and the cause.
    pub fn parse(text: &str, file: &Path) -> Result<Self, SceneError> {
        Ok(settings::parse(text, file, Self::checked)?)
    }

    fn checked(self) -> Result<Self, Vec<InvalidValue>> {
        let Self { ground, mount, sensor, object, .. } = &self;
        let variants = match self.variants {
            0 => Err(InvalidValue::new("variants", "expected at least 1, found 0")),
            _ => Ok(()),
        };
        let clearance_m = self.ground_clearance_m.unwrap_or_default();
        let several = |key: &str, is_empty: bool| match is_empty {
            true => {
                let cause = format!("expected at least one [[{key}]], found none");
                Err(InvalidValue::new(key, cause))
            }
            false => Ok(()),
        };
        let numbers = [
            variants,
            within("ground.half_m", ground.half_m, 1.0..=MOST_M),
            ground.slope_deg.check("ground.slope_deg", 0.0, 45.0),
            ground.roughness_m.check("ground.roughness_m", 0.0, 1.0),
            ground.road_width_m.check("ground.road_width_m", 0.0, MOST_M),
            ground.kerb_m.check("ground.kerb_m", 0.0, 1.0),
            ground.reflectivity.check("ground.reflectivity", 0.0, 1.0),
            mount.height_m.check("mount.height_m", -10.0, 100.0),
            mount.tilt_deg.check("mount.tilt_deg", 0.0, 45.0),
            mount.off_road_m.check("mount.off_road_m", 0.0, MOST_M),
            mount.speed_m_s.check("mount.speed_m_s", 0.0, 100.0),
            mount.sway_deg.check("mount.sway_deg", 0.0, 10.0),
            self.glass_returned.check("glass_returned", 0.0, 1.0),
            clearance_m.check("ground_clearance_m", 0.0, 1.0),
            several("sensor", sensor.is_empty()),
            several("object", object.is_empty()),
        ];
        let sensors = sensor.iter().enumerate().map(|(i, sensor)| {
            // A larger number was meant in millimetres.
            let sigma_m = sensor.effects.noise.map_or(0.0, |noise| noise.sigma_m);
            within(&format!("sensor[{i}].effects.noise.sigma_m"), sigma_m, 0.0..=1.0)
        });
        let objects = object.iter().enumerate();
        let objects = objects.map(|(i, objects)| objects.check(&format!("object[{i}]")));
        settings::all(numbers.into_iter().chain(sensors).chain(objects))?;
        Ok(self)
    }

    /// Replaces the sensors by those with these `names`, unless `names` is empty. Sensors of the
    /// recipe keep their effects.
    pub fn use_sensors(&mut self, names: &[String]) {
        if names.is_empty() {
            return;
        }
        let choice = |name: &String| {
            let known = self.sensor.iter().find(|sensor| sensor.profile == *name).cloned();
            known.unwrap_or_else(|| SensorChoice { profile: name.clone(), ..Default::default() })
        };
        self.sensor = names.iter().map(choice).collect();
    }

    /// The classes of the objects and [`OTHER`], sorted by name.
    #[must_use]
    pub fn classes(&self) -> Vec<String> {
        let mut classes: Vec<String> =
            self.object.iter().map(|objects| objects.class.clone()).collect();
        classes.push(OTHER.to_owned());
        classes.sort();
        classes.dedup();
        classes
    }

    /// Reads the sensor profiles, relative to the folder of `file`.
    pub(crate) fn sensors(&self, file: &Path) -> Result<Vec<SensorProfile>, ConfigError> {
        let folder = file.parent().unwrap_or(Path::new(""));
        self.sensor
            .iter()
            .map(|sensor| SensorProfile::resolve_in(folder, &sensor.profile))
            .collect()
    }
}

/// The kind of objects that are the user's own meshes.
const MESH: &str = "mesh";

impl Objects {
    /// Checks that labels can name the class: they have one word for it, and words of their own.
    fn check_class(&self, key: &str) -> Result<(), InvalidValue> {
        let class = &self.class;
        let is_word = !class.is_empty() && !class.contains(char::is_whitespace);
        if is_word && !["air", "ground"].contains(&&**class) {
            return Ok(());
        }
        let cause = format!(
            "expected one word other than \"air\" and \"ground\", such as \"big_car\", found {class:?}"
        );
        Err(InvalidValue::new(format!("{key}.class"), cause))
    }

    /// The built-in kind; `None` for the user's meshes.
    #[must_use]
    pub fn built_in(&self) -> Option<ObjectKind> {
        self.kind.parse().ok()
    }

    /// Whether they move along the street in a drive.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.speed_m_s.most > 0.0
    }

    fn check(&self, key: &str) -> Result<(), InvalidValue> {
        self.check_class(key)?;
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
                let expected = if is_mesh { "a value for" } else { "it only with" };
                let cause = format!("expected {expected} kind = \"{MESH}\"");
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
        self.reflectivity.check(&at("reflectivity"), 0.0, 1.0)?;
        self.speed_m_s.check(&at("speed_m_s"), 0.0, 100.0)?;
        if self.moves() && !matches!(self.place, Place::Road | Place::Pavement) {
            let cause = format!("expected with place = road or pavement, found \"{}\"", self.place);
            return Err(InvalidValue::new(at("speed_m_s"), cause));
        }
        self.height_m.unwrap_or([1.0, 1.0].into()).check(&at("height_m"), 0.01, MOST_M)
    }
}
