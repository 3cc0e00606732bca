//! Reads captures of a sensor's packets and collects their returns in a scan.

use std::fmt::{self, Display};
use std::net::IpAddr;
use std::ops::ControlFlow;
use std::path::Path;

use crate::error::FormatError;
use crate::pcap::{self, Counts};
use crate::returns::Return;
use crate::scan::Scan;

/// The sensor whose packets are used, where several send to one port: the one at the address that
/// a user chose, else the first that sends data.
#[derive(Clone, Debug, Default)]
pub struct Senders {
    used: Option<IpAddr>,
    is_chosen: bool,
    /// The first other addresses, with the number of their packets of data.
    others: Vec<(IpAddr, u64)>,
    n_dropped: u64,
}

/// The most other addresses that are named: a network may have any number.
const MOST_NAMED: usize = 8;

impl Senders {
    /// The sensor at the address `from`, or the first one.
    #[must_use]
    pub fn new(from: Option<IpAddr>) -> Self {
        Self { used: from, is_chosen: from.is_some(), ..Self::default() }
    }

    /// Whether a packet from `source` is used; `is_data` says whether it is a sensor's data. Until
    /// the first packet of data, all are.
    pub fn takes(&mut self, source: IpAddr, is_data: impl Fn() -> bool) -> bool {
        match self.used {
            Some(used) if used == source => return true,
            None if !is_data() => return true,
            None => {
                self.used = Some(source);
                return true;
            }
            Some(_) => {}
        }
        self.n_dropped += 1;
        let is_known = self.others.iter().any(|(other, _)| *other == source);
        if !is_known && self.others.len() < MOST_NAMED {
            self.others.push((source, 0));
        }
        let known = self.others.iter_mut().find(|(other, _)| *other == source);
        known.into_iter().for_each(|(_, data)| *data += u64::from(is_data()));
        false
    }

    /// The number of packets that were not used.
    #[must_use]
    pub fn n_dropped(&self) -> u64 {
        self.n_dropped
    }

    /// The other sensors, if a user has to choose one.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let used = self.used.filter(|_| !self.is_chosen)?;
        let sensors = self.others.iter().filter(|(_, data)| *data > 0);
        let others: Vec<_> =
            sensors.map(|(other, data)| format!("{other} ({data} so far)")).collect();
        (!others.is_empty()).then(|| {
            format!(
                "expected packets of one sensor, found those of {used}, which are used, and of {}, \
                 which are not; --from ADDRESS chooses another",
                others.join(", ")
            )
        })
    }
}

/// What the packets of other addresses explain, where those of the chosen one are missing.
impl Display for Senders {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (n, Some(used)) = (self.n_dropped, self.used) else { return Ok(()) };
        if n == 0 {
            return Ok(());
        }
        let others: Vec<_> = self.others.iter().map(|(other, _)| other.to_string()).collect();
        write!(f, ", {n} of them from other addresses than {used}: {}", others.join(", "))
    }
}

/// Passes each UDP packet of the sensor in a capture to `take` until it breaks. `is_data` is for
/// [`Senders::takes`].
pub(crate) fn each_packet<E: Display>(
    path: &Path,
    senders: &mut Senders,
    is_data: impl Fn(&[u8]) -> bool,
    mut take: impl FnMut(&[u8]) -> Result<ControlFlow<()>, E>,
) -> Result<Counts, FormatError> {
    let mut flaw = None;
    let counts = pcap::read(path, |packet| {
        if !senders.takes(packet.source, || is_data(&packet.payload)) {
            return ControlFlow::Continue(());
        }
        take(&packet.payload).unwrap_or_else(|cause| {
            flaw = Some(cause);
            ControlFlow::Break(())
        })
    })?;
    match flaw {
        None => Ok(counts),
        Some(cause) => {
            let number = counts.packets.saturating_sub(1);
            Err(FormatError::malformed(path, format!("UDP packet {number}"), cause))
        }
    }
}

/// The returns of a scan that is being read.
#[derive(Default)]
pub(crate) struct Points {
    positions: Vec<[f32; 3]>,
    ranges_m: Vec<f32>,
    rings: Vec<u16>,
    times_s: Vec<f32>,
    intensities: Vec<f32>,
}

impl Points {
    /// Adds a return of the packet that was sent at `packet_us`. Its reflectivity `white` is an
    /// intensity of 1.
    pub fn push(&mut self, found: &Return, packet_us: f64, white: f32) {
        self.positions.push(found.point_m);
        self.ranges_m.push(found.range_m);
        self.rings.push(found.ring);
        self.times_s.push(((packet_us + found.after_us) * 1e-6) as f32);
        self.intensities.push(f32::from(found.reflectivity) / white);
    }

    pub fn scan(self) -> Scan {
        Scan {
            positions: self.positions,
            range_m: Some(self.ranges_m),
            ring: Some(self.rings),
            time_s: Some(self.times_s),
            intensity: Some(self.intensities),
            ..Scan::default()
        }
    }
}
