//! The reader of points of all commands: scans, clouds and captures.

use std::path::{Path, PathBuf};

use edgepuck_segment::other_axis_up;
use formats::cloud_file::CloudFormat;
use formats::plausible::{Warning, check_sweep, coarse_coordinates, judge_surroundings};
use formats::points_file::{PointsReader, unread_packets};
use formats::{ChosenSender, FormatError, Scan, Senders, pcap};

/// How a file of points is read.
#[derive(Clone, clap::Args)]
pub struct PointsArgs {
    /// Format of the points: ply, npz, npy, pcd, xyz, csv, kitti, nuscenes, las [default: by the
    /// extension, or a capture by its first bytes]
    #[arg(long, value_name = "FORMAT")]
    pub input_format: Option<CloudFormat>,

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
    origin: Option<Vec<f64>>,
}

/// The input of `detect` and `corrupt`.
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
    /// The points in `file`, as [`PointsReader::read`]. Prints its warnings.
    pub fn read(&self, file: &Path) -> Result<Scan, FormatError> {
        let (scan, warnings) = self.reader().read(file)?;
        warnings.iter().for_each(|warning| program::say!("warning: {warning}"));
        Ok(scan)
    }

    /// Whether `file` is read as a capture.
    pub fn is_capture(&self, file: &Path) -> bool {
        self.reader().is_capture(file)
    }

    fn reader(&self) -> PointsReader {
        let Self { input_format, metadata, from } = self.clone();
        PointsReader { format: input_format, metadata, from }
    }
}

/// Prints warnings of the packets in the capture `file` that were not used, or are missing in the
/// turns that were read.
pub fn warn_of_packets(file: &Path, senders: &Senders, counts: &pcap::Counts) {
    let warnings = unread_packets(file, senders, counts);
    warnings.iter().for_each(|warning| program::say!("warning: {warning}"));
}

impl SweepArgs {
    /// As [`SweepArgs::read`], of a sweep with z up: prints a warning if it is probably not.
    #[cfg(feature = "models")]
    pub fn read_upright(&self) -> Result<Scan, FormatError> {
        let scan = self.read()?;
        self.warn_of_frame(&scan.positions);
        Ok(scan)
    }

    /// The points relative to the sensor, with their attributes.
    #[cfg(feature = "models")]
    pub fn read(&self) -> Result<Scan, FormatError> {
        let scan = self.read_whole()?;
        let positions = self.relative(&scan).map(|point| point.map(|x| x as f32)).collect();
        Ok(Scan { origin: [0.0; 3], pose: None, positions, ..scan })
    }

    /// The sweep as in its file.
    pub fn read_whole(&self) -> Result<Scan, FormatError> {
        let scan = self.place.points.read(&self.sweep)?;
        let remedy = "are they in millimetres, or from another origin? Scale them, give the sensor's \
                      position by --origin, or the format by --input-format";
        self.warn(check_sweep(self.relative(&scan), &self.sweep, remedy)?);
        self.warn(coarse_coordinates(points_from(&scan, [0.0; 3])));
        Ok(scan)
    }

    /// Prints whether `points`, metres from the sensor, are probably not around it, or z does not point up.
    pub fn warn_of_frame(&self, points: &[[f32; 3]]) {
        self.warn(judge_surroundings(points, || other_axis_up(points)));
    }

    /// Prints what is probably wrong with the sweep.
    pub fn warn(&self, warning: Option<Warning>) {
        if let Some(warning) = warning {
            program::say!("warning: {}: {warning}", self.sweep.display());
        }
    }

    /// The position of the sensor of `scan`, metres.
    pub fn sensor_m(&self, scan: &Scan) -> [f64; 3] {
        let given = self.place.origin.as_deref().and_then(|xyz| <[f64; 3]>::try_from(xyz).ok());
        given.unwrap_or_else(|| scan.sensor_position_m())
    }

    /// The points from the sensor, metres.
    fn relative<'a>(&self, scan: &'a Scan) -> impl Iterator<Item = [f64; 3]> + Clone + use<'a> {
        points_from(scan, self.sensor_m(scan))
    }
}

/// The points of `scan` from a place, metres.
fn points_from(scan: &Scan, place_m: [f64; 3]) -> impl Iterator<Item = [f64; 3]> + Clone {
    let origin = scan.origin;
    scan.positions.iter().map(move |point| {
        [0, 1, 2].map(|axis| f64::from(point[axis]) + origin[axis] - place_m[axis])
    })
}
