//! Reads captures of a sensor's packets and collects their returns in a scan.

use std::fmt::{self, Display};
use std::net::{IpAddr, SocketAddr};
use std::ops::ControlFlow;
use std::path::Path;
use std::str::FromStr;

use crate::error::FormatError;
use crate::pcap::{self, Counts, Sender};
use crate::returns::Return;
use crate::scan::Scan;

/// The sensor that a user chose: by its address, or by a port, too: `ADDRESS:PORT` to which it sends, or
/// `ADDRESS@PORT` from which.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChosenSender {
    ip: IpAddr,
    /// The index of the port among [`Sender::ports`], and the port.
    port: Option<(usize, u16)>,
}

impl FromStr for ChosenSender {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let to = || text.parse().ok().map(|at: SocketAddr| (at.ip(), Some((1, at.port()))));
        let from = || {
            let (ip, port) = text.split_once('@')?;
            Some((ip.parse().ok()?, Some((0, port.parse().ok()?))))
        };
        let found = text.parse().ok().map(|ip| (ip, None)).or_else(to).or_else(from);
        let (ip, port) = found.ok_or("expected ADDRESS, ADDRESS:PORT or ADDRESS@PORT")?;
        Ok(Self { ip, port })
    }
}

impl Display for ChosenSender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.port {
            Some((0, port)) => write!(f, "{}@{port}", self.ip),
            Some((_, port)) => SocketAddr::new(self.ip, port).fmt(f),
            None => self.ip.fmt(f),
        }
    }
}

impl ChosenSender {
    /// Whether a port is chosen.
    #[must_use]
    pub fn has_port(&self) -> bool {
        self.port.is_some()
    }

    fn is(self, sender: Sender) -> bool {
        self.ip == sender.ip && self.port.is_none_or(|(which, port)| sender.ports[which] == port)
    }

    /// What chooses `sender` beside `other`.
    fn of(sender: Sender, other: Sender) -> Self {
        let [source, destination] = sender.ports;
        let port = match (sender.ip == other.ip, destination == other.ports[1]) {
            (false, _) => None,
            (true, false) => Some((1, destination)),
            (true, true) => Some((0, source)),
        };
        Self { ip: sender.ip, port }
    }
}

/// The sensor whose packets are used, where several send to one port: the first that sends data, of
/// those that a user chose.
#[derive(Clone, Debug, Default)]
pub struct Senders {
    used: Option<Sender>,
    chosen: Option<ChosenSender>,
    /// The first others, with the number of their packets of data.
    others: Vec<(Sender, u64)>,
    n_dropped: u64,
}

/// The most others that are named: a network may have any number.
const MOST_NAMED: usize = 8;

impl Senders {
    /// The first sensor of those `from` an address, or of all.
    #[must_use]
    pub fn new(from: Option<ChosenSender>) -> Self {
        Self { chosen: from, ..Self::default() }
    }

    /// Whether a packet of `sender` is used; `is_data` says whether it is a sensor's data. Until
    /// the first packet of data, all are; a sensor sends its other packets to another port.
    pub fn takes(&mut self, sender: Sender, is_data: impl Fn() -> bool) -> bool {
        let is_chosen = self.is_chosen(sender);
        match self.used {
            Some(used) if used == sender => return true,
            Some(used) if used.ip == sender.ip && !is_data() => return true,
            None if is_chosen => {
                self.used = is_data().then_some(sender);
                return true;
            }
            _ => {}
        }
        self.n_dropped += 1;
        let is_known = self.others.iter().any(|(other, _)| *other == sender);
        if !is_known && self.others.len() < MOST_NAMED {
            self.others.push((sender, 0));
        }
        let known = self.others.iter_mut().find(|(other, _)| *other == sender);
        known.into_iter().for_each(|(_, data)| *data += u64::from(is_data()));
        false
    }

    fn is_chosen(&self, sender: Sender) -> bool {
        self.chosen.is_none_or(|chosen| chosen.is(sender))
    }

    /// The number of packets that were not used.
    #[must_use]
    pub fn n_dropped(&self) -> u64 {
        self.n_dropped
    }

    /// The other sensors, if a user has to choose one.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let used = self.used?;
        let is_sensor = |(other, data): &&(Sender, u64)| *data > 0 && self.is_chosen(*other);
        let others: Vec<_> = self.others.iter().filter(is_sensor).collect();
        if others.is_empty() {
            return None;
        }
        let of_others: Vec<_> = others
            .iter()
            .map(|(other, data)| format!("{} ({data} so far)", ChosenSender::of(*other, used)))
            .collect();
        let first = others[0].0;
        Some(format!(
            "expected packets of one sensor, found those of {}, which are used, and of {}, which are \
             not; --from {} chooses another",
            ChosenSender::of(used, first),
            of_others.join(", "),
            ChosenSender::of(first, used)
        ))
    }
}

/// What the packets of others explain, where those of the chosen one are missing.
impl Display for Senders {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = |sender: Sender| ChosenSender { ip: sender.ip, port: Some((1, sender.ports[1])) };
        let used = self.chosen.or(self.used.map(|used| ChosenSender { ip: used.ip, port: None }));
        let (n, Some(used)) = (self.n_dropped, used) else { return Ok(()) };
        if n == 0 {
            return Ok(());
        }
        let name = |(other, _): &(Sender, u64)| match other.ip == used.ip {
            true => all(*other).to_string(),
            false => other.ip.to_string(),
        };
        let others: Vec<_> = self.others.iter().map(name).collect();
        write!(f, ", {n} of them from other addresses than {used}: {}", others.join(", "))
    }
}

/// Passes each UDP packet of the sensor in a capture to `take` until it breaks. Counts those that `take`
/// refuses, and goes on: a damaged packet spoils no recording. `is_data` is for [`Senders::takes`].
pub(crate) fn each_packet<E: Display>(
    path: &Path,
    senders: &mut Senders,
    is_data: impl Fn(&[u8]) -> bool,
    mut take: impl FnMut(&[u8]) -> Result<ControlFlow<()>, E>,
) -> Result<Counts, FormatError> {
    let (mut number, mut flawed, mut first_flawed) = (0, 0, None);
    let counts = pcap::read(path, |packet| {
        number += 1;
        if !senders.takes(packet.sender, || is_data(&packet.payload)) {
            return ControlFlow::Continue(());
        }
        take(&packet.payload).unwrap_or_else(|cause| {
            flawed += 1;
            first_flawed.get_or_insert_with(|| (number - 1, cause.to_string()));
            ControlFlow::Continue(())
        })
    })?;
    Ok(Counts { flawed, first_flawed, ..counts })
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
