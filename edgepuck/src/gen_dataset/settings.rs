use super::usage;
use crate::effect_flags::EffectFlags;
use crate::flags::{of_flag, probability};
use edgepuck_dataset::{
    ColourSource, DatasetConfig, Hashing, Layout, Normalize, Returns, ScanFormat, SetConfig,
    Simplify, Unit, Up, Variant, Viewpoints, Views,
};
use formats::scan::Attribute;
use sim_gpu::Sensor;
use sim_gpu::effects::Effects;
use sim_gpu::internals::packets;
use sim_gpu::internals::pose::load_poses;
use sim_gpu::internals::sensor::{Layout as BeamLayout, SensorProfile};
use std::path::PathBuf;
use std::str::FromStr;

/// The standard deviation of the noise by default, metres: BLAINDER's default.
const NOISE_M: f64 = 0.01;

/// Flags that decide what a dataset holds.
#[derive(clap::Parser)]
#[command(next_help_heading = "What the dataset holds")]
pub struct Settings {
    /// Name of a built-in sensor, or path of a TOML profile [default: vlp32c and generic-static,
    /// with one set for each]
    #[arg(long, value_name = "NAME|TOML")]
    sensor: Option<String>,

    /// Number of viewpoints around the mesh [default: the sensor's own, or 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    views: Option<u32>,

    /// Distance from the mesh's centre to the sensor, metres; of two numbers, between which each
    /// view has one drawn [default: the sensor's own, or 3]
    #[arg(long, value_name = "M[,M]", allow_hyphen_values = true)]
    distance: Option<FromTo>,

    /// Elevation of the sensor above the mesh, degrees; of two numbers, between which each view has
    /// one drawn [default: the sensor's own, or 20]
    #[arg(long, value_name = "DEG[,DEG]", allow_hyphen_values = true)]
    elevation: Option<FromTo>,

    /// Turn each view around the mesh by a random angle of at most this, degrees; 180 gives views
    /// from any side [default: the sensor's own, or 0]
    #[arg(long, value_name = "DEG")]
    azimuth_jitter: Option<f64>,

    /// File of sensor poses, which replaces the viewpoints around the mesh
    #[arg(long, value_name = "TOML", conflicts_with_all = ["views", "distance", "elevation", "azimuth_jitter"])]
    poses: Option<PathBuf>,

    #[command(flatten)]
    effects: EffectFlags,

    /// Diffuse reflectivity of the meshes, from 0 (black) to 1 (white)
    #[arg(long, default_value_t = 1.0, value_name = "R", value_parser = probability)]
    reflectivity: f64,

    /// Take reflectivities from the colours of the meshes, which must be OBJ files: of the
    /// materials in their MTL files (`mtl`) or of their vertices (`vertices`). `--resume` does not
    /// notice changes of MTL files and images
    #[arg(long, value_name = "SOURCE", conflicts_with = "simplify")]
    colours: Option<ColourSource>,

    /// Attributes of each point besides its position: range, beam, ring, time, triangle, object,
    /// intensity, power, reflectivity, return, medium, sensor, attitude, normal
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    attributes: Vec<Attribute>,

    /// File formats of each scan; NPZ is always written. `pcap` writes VLP-32C packets: it requires
    /// `--sensor vlp32c`, and all files then use the beam geometry of the packets
    #[arg(long, value_delimiter = ',', default_value = "npz", value_name = "npz,ply,csv,pcd,pcap")]
    format: Vec<ScanFormat>,

    /// Returns of each beam in the packets: strongest, last, or dual (both)
    #[arg(long, value_name = "WHICH")]
    returns: Option<Returns>,

    /// How meshes are scaled: unit-sphere, bbox or none [default: unit-sphere or the sensor's own]
    #[arg(long, value_name = "HOW")]
    normalize: Option<Normalize>,

    /// Unit of the meshes' coordinates: m, mm, cm, in or ft; only with --normalize none
    #[arg(long, default_value = "m", value_name = "UNIT")]
    units: Unit,

    /// The meshes' upward axis: y or z [default: y for OBJ and glTF, z for others]
    #[arg(long, value_name = "AXIS")]
    up: Option<Up>,

    /// Remove triangles that are too small for the sensor to resolve: `auto` derives the error
    /// bound from the beams and distances; a number is the largest distance in metres that the
    /// surface may move
    #[arg(long, value_name = "auto|M")]
    simplify: Option<Simplify>,

    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,

    /// Number of points in each packed cloud
    #[arg(long, default_value_t = 1024, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    points: u32,

    /// Number of points that a scan must have to be included in the packed sets
    #[arg(long, default_value_t = 64, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..))]
    min_points: u32,

    /// Additional dataset layouts, for other projects: yanx27, modelnet-h5. `webdataset` writes tars of
    /// the noisy clouds of one sensor in place of all other files
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    layout: Vec<Layout>,

    /// Hash of each mesh and file in the manifest: sha256, blake3 (faster on x86-64
    /// processors without instructions for SHA-256) or none. Without hashes `--verify` finds files
    /// that are missing, added, unreadable or of another number of points or clouds, but no other
    /// changes, and `--resume` does not notice a changed mesh
    #[arg(long, default_value = "sha256", value_name = "HASH")]
    hash: Hashing,
}

impl Settings {
    pub fn config(&self) -> anyhow::Result<DatasetConfig> {
        let mut sets = self.sets()?;
        let recommended = sets.iter().find_map(|set| match &set.viewpoints {
            Viewpoints::Views(views) => views.normalize,
            Viewpoints::Poses(_) => None,
        });
        let mut formats = self.format.clone();
        formats.push(ScanFormat::Npz);
        formats.sort_unstable();
        formats.dedup();
        if self.simplify.is_some() && self.attributes.contains(&Attribute::Triangle) {
            let cause = "--simplify renumbers the triangles of a mesh: leave `triangle` out of \
                         --attributes";
            return Err(usage(cause));
        }
        if self.simplify.is_some() && self.layout.contains(&Layout::Webdataset) {
            let cause = "--simplify cannot be used with --layout webdataset, which reads a mesh \
                         again for each tar";
            return Err(usage(cause));
        }
        let with_intensity = self.attributes.contains(&Attribute::Intensity);
        let mut effects = self.effects.effects(NOISE_M, with_intensity)?;
        if self.simplify.is_some() && effects.motion.is_some() {
            let cause = "--simplify cannot be used with effects.motion: the resolution of a moving \
                         sensor changes";
            return Err(usage(cause));
        }
        let normalize = self.normalize.or(recommended).unwrap_or_default();
        if self.units != Unit::Metre && normalize != Normalize::None {
            let cause = "--units applies to --normalize none: other meshes are scaled anyway";
            return Err(usage(cause));
        }
        let mut returns = Returns::default();
        if formats.contains(&ScanFormat::Pcap) {
            returns = cast_packet_geometry(&mut sets, &mut effects, self.returns)?;
        } else if self.returns.is_some() {
            return Err(usage("--returns applies to packets only: add --format pcap"));
        }
        for set in &sets {
            effects.for_sensor(set.sensor.profile()).map_err(usage)?;
        }
        let mut variants = vec![Variant::Clean];
        variants.extend((effects != effects.clean()).then_some(Variant::Noisy));
        Ok(DatasetConfig {
            seed: self.seed,
            normalize,
            units: self.units,
            up: self.up,
            simplify: self.simplify,
            attributes: self.attributes.iter().copied().collect(),
            formats,
            effects,
            variants,
            sets,
            packed_points: self.points,
            min_points: self.min_points,
            layouts: self.layout.clone(),
            returns,
            hash: self.hash,
            reflectivity: self.reflectivity,
            colours: self.colours,
        })
    }

    fn sets(&self) -> anyhow::Result<Vec<SetConfig>> {
        match &self.sensor {
            Some(name) => {
                let sensor = Sensor::from(SensorProfile::resolve(name)?.trimmed());
                let set = match &sensor.profile().layout {
                    BeamLayout::Rotating(_) | BeamLayout::Uniform(_) => "rotational",
                    BeamLayout::Grid(_) => "static",
                    BeamLayout::Risley(_) => "rosette",
                    BeamLayout::Table(_) => "table",
                };
                Ok(vec![self.set(set, sensor, self.views)?])
            }
            None => Ok(vec![
                self.set("rotational", Sensor::named("vlp32c")?, self.views)?,
                self.set("static", Sensor::named("generic-static")?, None)?,
            ]),
        }
    }

    fn set(&self, name: &str, sensor: Sensor, views: Option<u32>) -> anyhow::Result<SetConfig> {
        let viewpoints = match &self.poses {
            Some(file) => Viewpoints::Poses(load_poses(file)?),
            None => {
                let defaults = sensor.profile().default_views();
                let mut views = Views { count: views.unwrap_or(defaults.count), ..defaults };
                if let Some(FromTo { from, to }) = self.distance {
                    (views.distance_m, views.distance_to_m) = (from, to);
                }
                if let Some(FromTo { from, to }) = self.elevation {
                    (views.elevation_deg, views.elevation_to_deg) = (from, to);
                }
                if let Some(jitter_deg) = self.azimuth_jitter {
                    views.azimuth_jitter_deg = jitter_deg;
                }
                views.validate().map_err(of_flag)?;
                Viewpoints::Views(views)
            }
        };
        Ok(SetConfig { name: name.to_owned(), sensor, viewpoints })
    }
}

/// A number, or the bounds between which one is drawn.
#[derive(Clone, Copy, Debug)]
struct FromTo {
    from: f64,
    to: Option<f64>,
}

impl FromStr for FromTo {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| {
            text.trim().parse::<f64>().map_err(|_| {
                format!("expected a number, or two with a comma between them, found {text:?}")
            })
        };
        match text.split_once(',') {
            Some((from, to)) => Ok(Self { from: number(from)?, to: Some(number(to)?) }),
            None => Ok(Self { from: number(text)?, to: None }),
        }
    }
}

/// Gives the sensors the beam geometry of their packets, and the effects the returns that packets
/// hold: `wanted`, or those of the effects.
fn cast_packet_geometry(
    sets: &mut [SetConfig],
    effects: &mut Effects,
    wanted: Option<Returns>,
) -> anyhow::Result<Returns> {
    let refuse = |error| usage(format!("--format pcap: {error}"));
    let returns = packets::settle_returns(effects, wanted).map_err(refuse)?;
    for set in sets {
        let name = set.sensor.name();
        let refuse = |error| usage(format!("--format pcap: sensor \"{name}\": {error}"));
        set.sensor = set.sensor.with_packet_geometry().map_err(refuse)?;
    }
    Ok(returns)
}
