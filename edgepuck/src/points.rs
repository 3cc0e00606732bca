//! The reader of points of all commands: scans, clouds and captures.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use edgepuck_segment::doubtful_axes;
use formats::cloud_file::{
    Cloud, CloudFormat, check_sweep, coarse_coordinates, must_be_scan, read_cloud_as,
};
use formats::scan_file::read_scan;
use formats::{ChosenSender, FormatError, Scan, Senders, ouster, pcap, velodyne};

/// How a file of points is read.
#[derive(Clone, clap::Args)]
pub struct PointsArgs {
    /// Format of the points: ply, npz, npy, pcd, xyz, csv, kitti, nuscenes, las [default: by the
    /// extension, or a capture by its first bytes]
    #[arg(long)]
    pub format: Option<CloudFormat>,

    /// Metadata (JSON) of the Ouster OS0, OS1 or OS2 whose packets are in the capture
    #[arg(long, value_name = "FILE")]
    pub metadata: Option<PathBuf>,

    /// Sensor whose packets are used: ADDRESS, or of several at one address ADDRESS:PORT to which it
    /// sends, or ADDRESS@PORT from which [default: the first sensor of the capture]
    #[arg(long, value_name = "ADDRESS")]
    pub from: Option<ChosenSender>,
}

/// How a sweep is read.
#[derive(Clone, clap::Args)]
pub struct PlaceArgs {
    #[command(flatten)]
    points: PointsArgs,

    /// Position of the sensor in the sweep, in metres [default: that of the scan's file, or 0 0 0]
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], value_parser = crate::flags::finite)]
    sensor: Option<Vec<f64>>,
}

/// The input of `segment`, `detect`, `weather` and `corrupt`.
#[derive(clap::Args)]
pub struct SweepArgs {
    /// Sweep in metres, z up: a scan (.npz or .ply, with its rings if it has them); a capture
    /// (.pcap or .pcapng), of which the first turn is used, of a VLP-16 or VLP-32C, or with
    /// --metadata of an Ouster; or a cloud: .npy, .pcd, .xyz, .txt, .pts, .csv, .las, KITTI's or
    /// nuScenes' .bin
    #[arg(value_name = "SWEEP")]
    pub sweep: PathBuf,

    /// How it is read.
    #[command(flatten)]
    pub place: PlaceArgs,
}

impl PointsArgs {
    /// The points in `file`, with all attributes that the program knows of its format; of a
    /// capture the first turn. Prints a warning if packets of the capture were not read.
    pub fn read(&self, file: &Path) -> Result<Scan, FormatError> {
        // Files are read more than once.
        let found = match file.to_str() {
            Some("-") if !file.exists() => Some("standard input"),
            _ if file.exists() && !file.is_file() && !file.is_dir() => Some("a pipe or device"),
            _ => None,
        };
        if let Some(found) = found {
            let cause = format!(
                "expected a file, found {found}, which can be read only once: write it to a file first"
            );
            return Err(FormatError::malformed(file, "name", cause));
        }
        if self.is_capture(file) {
            return self.read_capture(file);
        }
        for (flag, is_given) in
            [("--metadata", self.metadata.is_some()), ("--from", self.from.is_some())]
        {
            if is_given && file.is_file() {
                let cause = "applies to captures of packets (.pcap or .pcapng), without --format";
                return Err(FormatError::malformed(file, flag, cause));
            }
        }
        let Cloud { points, intensities, rings, pose } = read_cloud_as(file, self.format)?;
        let Scan { origin, positions, .. } = Scan::of_points(&points);
        let scan = match read_scan(file) {
            Ok(scan) => Some(scan).filter(|scan| scan.len() == points.len()),
            Err(error) if must_be_scan(file) => return Err(error),
            // A cloud that is not a scan has no other attributes.
            Err(_) => None,
        };
        let is_near = |scan: &Scan| origin == [0.0; 3] || scan.origin != [0.0; 3];
        let mut scan = match scan {
            Some(scan) if is_near(&scan) => scan,
            Some(scan) => Scan { origin, positions, ..scan },
            None => Scan { origin, positions, pose, ring: rings, ..Scan::default() },
        };
        if scan.reflectivity.is_none() {
            scan.intensity = scan.intensity.or(intensities);
        }
        Ok(scan)
    }

    /// Whether `file` is read as a capture.
    pub fn is_capture(&self, file: &Path) -> bool {
        (self.metadata.is_some() || self.format.is_none()) && pcap::is_capture(file)
    }

    fn read_capture(&self, file: &Path) -> Result<Scan, FormatError> {
        let mut senders = Senders::new(self.from);
        let (scan, counts) = match &self.metadata {
            Some(path) => ouster::read_frame(file, &ouster::Metadata::read(path)?, &mut senders)?,
            None => velodyne::read_turn(file, &mut senders)?,
        };
        warn_of_packets(file, &senders, &counts);
        Ok(scan)
    }
}

/// Prints warnings of the packets in the capture `file` that were not used, or are missing in the
/// turns that were read.
pub fn warn_of_packets(file: &Path, senders: &Senders, counts: &pcap::Counts) {
    let file = file.display();
    if let Some(warning) = senders.warning() {
        formats::say!("warning: {file}: {warning}");
    }
    if counts.missing > 0 {
        let n = counts.missing;
        formats::say!("warning: {file}: {n} packets of the turn are probably missing");
    }
    if counts.first_unread.is_some() {
        formats::say!("warning: {file}: {} UDP packets{counts}", counts.packets);
    }
}

impl SweepArgs {
    /// As [`SweepArgs::read`], of a sweep with z up: prints a warning if it is probably not.
    pub fn read_upright(&self) -> Result<Scan, FormatError> {
        let scan = self.read()?;
        self.warn(doubtful_axes(&scan.positions));
        Ok(scan)
    }

    /// The points relative to the sensor, with their attributes.
    pub fn read(&self) -> Result<Scan, FormatError> {
        let scan = self.read_whole()?;
        let positions = self.relative(&scan).map(|point| point.map(|x| x as f32)).collect();
        Ok(Scan { origin: [0.0; 3], pose: None, positions, ..scan })
    }

    /// The sweep as in its file.
    pub fn read_whole(&self) -> Result<Scan, FormatError> {
        let scan = self.place.points.read(&self.sweep)?;
        let remedy = "are they in millimetres, or from another origin? Scale them, give the sensor's \
                      position by --sensor, or the format by --format";
        self.warn(check_sweep(self.relative(&scan), &self.sweep, remedy)?);
        self.warn(coarse_coordinates(points_from(&scan, [0.0; 3])));
        Ok(scan)
    }

    /// Prints what is doubtful in the sweep.
    pub fn warn(&self, doubt: Option<String>) {
        if let Some(doubt) = doubt {
            formats::say!("warning: {}: {doubt}", self.sweep.display());
        }
    }

    /// The position of the sensor of `scan`, metres.
    pub fn sensor_m(&self, scan: &Scan) -> [f64; 3] {
        let given = self.place.sensor.as_deref().and_then(|xyz| <[f64; 3]>::try_from(xyz).ok());
        given.unwrap_or_else(|| scan.sensor_position_m())
    }

    /// The points from the sensor, metres.
    fn relative<'a>(&self, scan: &'a Scan) -> impl Iterator<Item = [f64; 3]> + Clone + use<'a> {
        points_from(scan, self.sensor_m(scan))
    }

    /// The title of a picture of the sweep.
    pub fn title(&self) -> Cow<'_, str> {
        self.sweep.file_stem().unwrap_or_default().to_string_lossy()
    }
}

/// The points of `scan` from a place, metres.
fn points_from(scan: &Scan, place_m: [f64; 3]) -> impl Iterator<Item = [f64; 3]> + Clone {
    let origin = scan.origin;
    scan.positions.iter().map(move |point| {
        [0, 1, 2].map(|axis| f64::from(point[axis]) + origin[axis] - place_m[axis])
    })
}
