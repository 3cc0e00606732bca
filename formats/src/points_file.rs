//! The points of any file: a scan, a cloud, or the first turn of a capture.

use std::path::{Path, PathBuf};

use crate::cloud_file::{Cloud, CloudFormat, must_be_scan, read_cloud_as};
use crate::scan_file::read_scan;
use crate::{ChosenSender, FormatError, Scan, Senders, counted, ouster, pcap, velodyne};

/// How a file of points is read, beyond what it says itself.
#[derive(Clone, Debug, Default)]
pub struct PointsReader {
    /// Its format; by default that of its extension, or a capture by its first bytes.
    pub format: Option<CloudFormat>,
    /// The metadata (JSON) of the Ouster whose packets are in a capture.
    pub metadata: Option<PathBuf>,
    /// The sensor whose packets are used; by default the first of a capture.
    pub from: Option<ChosenSender>,
}

impl PointsReader {
    /// The points in `file`, with all attributes that its format has; of a capture the first turn. Returns
    /// warnings, too, if packets of the capture were not read.
    ///
    /// # Errors
    /// A file that cannot be read, or is of another format; settings of captures for another file.
    pub fn read(&self, file: &Path) -> Result<(Scan, Vec<String>), FormatError> {
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
                let cause =
                    "applies to captures of packets (.pcap or .pcapng), without --input-format";
                return Err(FormatError::malformed(file, flag, cause));
            }
        }
        Ok((self.read_cloud(file)?, Vec::new()))
    }

    /// Whether `file` is read as a capture.
    #[must_use]
    pub fn is_capture(&self, file: &Path) -> bool {
        (self.metadata.is_some() || self.format.is_none()) && pcap::is_capture(file)
    }

    fn read_cloud(&self, file: &Path) -> Result<Scan, FormatError> {
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

    fn read_capture(&self, file: &Path) -> Result<(Scan, Vec<String>), FormatError> {
        let mut senders = Senders::new(self.from);
        let (scan, counts) = match &self.metadata {
            Some(path) => ouster::read_frame(file, &ouster::Metadata::read(path)?, &mut senders)?,
            None => velodyne::read_turn(file, &mut senders)?,
        };
        Ok((scan, unread_packets(file, &senders, &counts)))
    }
}

/// Warnings of the packets in the capture `file` that were not used, or are missing in the turns that were
/// read.
#[must_use]
pub fn unread_packets(file: &Path, senders: &Senders, counts: &pcap::Counts) -> Vec<String> {
    let missing = (counts.missing > 0)
        .then(|| format!("the turn probably lacks {}", counted(counts.missing, "packet")));
    let unread = (counts.unread + counts.flawed > 0)
        .then(|| format!("{}{counts}", counted(counts.packets, "UDP packet")));
    let all = senders.warning().into_iter().chain(missing).chain(unread);
    all.map(|warning| format!("{}: {warning}", file.display())).collect()
}
