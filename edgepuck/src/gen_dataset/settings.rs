use super::usage;
use crate::effect_flags::EffectFlags;
use crate::flags::{of_flag, probability, warn_of_sensor};
use edgepuck_dataset::{
    Around, DatasetConfig, Hashing, Layout, Normalize, Returns, ScanFormat, SetConfig, Unit, Up,
    Viewpoints,
};
use formats::scan::Attribute;
use sim_gpu::effects::Effects;
use sim_gpu::packets;
use sim_gpu::scene_files::load_poses;
use std::path::PathBuf;
use std::str::FromStr;

/// Flags that decide what a dataset holds.
#[derive(clap::Args)]
#[command(next_help_heading = "What the dataset holds")]
pub struct Settings {
    /// Built-in sensor, or a profile [default: vlp32c, generic-static]
    ///
    /// Without it, the dataset has a set of each of the two.
    #[arg(long, value_name = "NAME|TOML")]
    sensor: Option<String>,

    /// Viewpoints around the mesh [default: the sensor's, or 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    views: Option<u32>,

    /// Distance of the sensor, metres [default: the sensor's, or 3]
    ///
    /// It is that from the mesh's centre. Each view has its own number between two.
    #[arg(long, value_name = "M[,M]", allow_hyphen_values = true)]
    distance: Option<FromTo>,

    /// Elevation of the sensor, degrees [default: its own, or 20]
    ///
    /// It is that above the mesh. Each view has its own number between two.
    #[arg(long, value_name = "DEG[,DEG]", allow_hyphen_values = true)]
    elevation: Option<FromTo>,

    /// Largest random turn around the mesh [default: its own, or 0]
    ///
    /// It is in degrees, and each view has its own: 180 gives views from any side.
    #[arg(long, value_name = "DEG")]
    azimuth_jitter: Option<f64>,

    /// File of sensor poses, which replaces the viewpoints around the mesh
    #[arg(long, value_name = "TOML", hide_short_help = true)]
    #[arg(conflicts_with_all = ["views", "distance", "elevation", "azimuth_jitter"])]
    poses: Option<PathBuf>,

    #[command(flatten)]
    effects: EffectFlags,

    /// Diffuse reflectivity of the meshes, from 0 (black) to 1 (white)
    #[arg(long, default_value_t = 1.0, value_name = "R", value_parser = probability)]
    #[arg(hide_short_help = true)]
    reflectivity: f64,

    /// Attributes of points, such as range,ring,intensity
    ///
    /// There are range, beam, ring, time, triangle, object, intensity, power, reflectivity, return, medium,
    /// sensor, attitude and normal.
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    attributes: Vec<Attribute>,

    /// Formats of each scan besides npz: ply, csv, pcd, pcap
    ///
    /// `pcap` writes VLP-32C packets: it requires `--sensor vlp32c`, and all files then use the beam
    /// geometry of the packets.
    #[arg(long, value_delimiter = ',', default_value = "npz", value_name = "LIST")]
    #[arg(hide_default_value = true)]
    format: Vec<ScanFormat>,

    /// Returns of each beam in the packets: strongest, last, or dual (both)
    #[arg(long, value_name = "WHICH", hide_short_help = true)]
    returns: Option<Returns>,

    /// Scale meshes: unit-sphere, bbox or none [default: unit-sphere]
    ///
    /// The default is that of the sensor's profile, if it has one.
    #[arg(long, value_name = "HOW")]
    normalize: Option<Normalize>,

    /// Unit of the meshes' coordinates: m, mm, cm, in or ft; only with --normalize none
    #[arg(long, default_value = "m", value_name = "UNIT", hide_short_help = true)]
    units: Unit,

    /// Upward axis, y or z [default: y of OBJ and glTF, or z]
    #[arg(long, value_name = "AXIS")]
    up: Option<Up>,

    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,

    /// Number of points in each packed cloud
    #[arg(long, default_value_t = 1024, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    points: u32,

    /// Number of points that a scan must have to be included in the packed sets
    #[arg(long, default_value_t = 64, value_name = "N", hide_short_help = true,
          value_parser = clap::value_parser!(u32).range(1..))]
    min_points: u32,

    /// webdataset: tars of the clouds of one sensor (noisy ones, if there is noise) in place of all other files
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    layout: Vec<Layout>,

    /// Hash of each mesh and file in the manifest: sha256 or none. Without hashes `--verify` finds files
    /// that are missing, added, unreadable or of another number of points or clouds, but no other
    /// changes, and `--resume` does not notice a changed mesh
    #[arg(long, default_value = "sha256", value_name = "HASH", hide_short_help = true)]
    hash: Hashing,
}

impl Settings {
    pub fn seed(&self) -> u64 {
        self.seed
    }

    pub fn config(&self) -> anyhow::Result<DatasetConfig> {
        let mut effects = self.effects.effects()?;
        let mut sets = self.sets()?;
        let mut returns = Returns::default();
        if self.format.contains(&ScanFormat::Pcap) {
            returns = cast_packet_geometry(&mut sets, &mut effects, self.returns)?;
        } else if self.returns.is_some() {
            return Err(usage("--returns applies to packets only: add --format pcap"));
        }
        let usual = DatasetConfig::new(sets);
        let config = DatasetConfig {
            seed: self.seed,
            normalize: self.normalize.unwrap_or(usual.normalize),
            units: self.units,
            up: self.up,
            attributes: self.attributes.iter().copied().collect(),
            formats: self.format.clone(),
            effects,
            packed_points: self.points,
            min_points: self.min_points,
            layouts: self.layout.clone(),
            returns,
            hash: self.hash,
            reflectivity: self.reflectivity,
            ..usual
        };
        Ok(config.checked().map_err(of_flag)?)
    }

    fn sets(&self) -> anyhow::Result<Vec<SetConfig>> {
        let bounds = |of: Option<FromTo>| of.map(|FromTo { from, to }| (from, to));
        let around = Around {
            count: self.views,
            distance_m: bounds(self.distance),
            elevation_deg: bounds(self.elevation),
            azimuth_jitter_deg: self.azimuth_jitter,
        };
        let mut sets = match &self.sensor {
            Some(name) => vec![SetConfig::of(name)?.seen_from(around).map_err(of_flag)?],
            None => vec![
                SetConfig::of("vlp32c")?.seen_from(around).map_err(of_flag)?,
                SetConfig::of("generic-static")?
                    .seen_from(Around { count: None, ..around })
                    .map_err(of_flag)?,
            ],
        };
        sets.iter().for_each(|set| warn_of_sensor(set.sensor.profile()));
        if let Some(file) = &self.poses {
            let poses = load_poses(file)?;
            sets.iter_mut().for_each(|set| set.viewpoints = Viewpoints::Poses(poses.clone()));
        }
        Ok(sets)
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
