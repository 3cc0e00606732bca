//! The sources of packets: a socket or a capture.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{
    Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel,
};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::live::{Arrival, Timeline};
use anyhow::Context;
use formats::ouster::{self, Metadata};
use formats::pcap::{self, Sender};
use formats::{ChosenSender, Senders, velodyne};
use socket2::{Domain, Protocol, Socket, Type};

/// The most packets in the queue: two thirds of a second of a VLP-32C.
const RING: usize = 1024;
/// The longest UDP packet.
const MOST_BYTES: usize = 65_535;
/// The requested size of the kernel's buffer: a few seconds of packets.
const KERNEL_BUFFER: usize = 8 << 20;
/// The timeout of receiving, after which the program checks for signals and sends keep-alive
/// messages.
const PATIENCE: Duration = Duration::from_millis(100);

pub enum Tick<'a> {
    Packet(&'a [u8], Arrival),
    /// No packet has come for a while.
    Quiet,
    End,
}

pub enum Source {
    Capture {
        file: PathBuf,
        sensor: Sensor,
        /// For packets that are taken when the sensor sent them, instead of as fast as possible.
        timeline: Option<Box<Timeline>>,
    },
    Udp(Box<Listener>),
}

/// Chooses the packets of one sensor.
pub struct Sensor {
    senders: Senders,
    /// For the packets of an Ouster; without it, they are a Velodyne's.
    ouster: Option<Box<ouster::Decoder>>,
    /// Whether the user was warned of other sensors.
    pub has_warned: bool,
}

impl Sensor {
    /// The sensor at the address `from` or the first one: an Ouster with this `metadata`, or a
    /// Velodyne.
    pub fn new(from: Option<ChosenSender>, metadata: Option<&Metadata>) -> Self {
        let ouster = metadata.map(|metadata| Box::new(ouster::Decoder::new(metadata)));
        Self { senders: Senders::new(from), ouster, has_warned: false }
    }

    fn sent(&mut self, payload: &[u8], sender: Sender) -> bool {
        let is_used = self.senders.takes(sender, || match &self.ouster {
            Some(decoder) => decoder.header(payload).is_ok(),
            None => velodyne::Header::parse(payload).is_ok(),
        });
        if !is_used
            && !self.has_warned
            && let Some(warning) = self.senders.warning()
        {
            program::say!("warning: {warning}");
            self.has_warned = true;
        }
        is_used
    }
}

#[derive(Default)]
pub struct Read {
    /// All UDP packets.
    pub n_packets: u64,
    /// Their senders.
    pub senders: Senders,
    /// What else a capture had.
    pub capture: pcap::Counts,
    /// Packets that were dropped because the queue was full.
    pub n_overrun: u64,
    /// Why a capture was read no further.
    pub error: Option<anyhow::Error>,
}

/// A thread that receives packets, and their queue.
pub struct Listener {
    thread: JoinHandle<io::Result<Read>>,
    filled: Receiver<Slot>,
    empty: SyncSender<Slot>,
    is_over: Arc<AtomicBool>,
}

struct Slot {
    bytes: Box<[u8]>,
    n_bytes: usize,
    arrival: Arrival,
}

impl Source {
    /// The packets of `sensor` to `address`, which are received from now on until `is_over`.
    pub fn udp(
        address: SocketAddr,
        multicast: Option<Ipv4Addr>,
        sensor: Sensor,
        is_over: &Arc<AtomicBool>,
    ) -> anyhow::Result<Self> {
        let socket = bind(address, multicast).with_context(|| format!("UDP {address}"))?;
        program::say!("listening on UDP {}", socket.local_addr()?);
        let (fill, filled) = sync_channel(RING);
        let (empty, empties) = sync_channel(RING);
        for _ in 0..RING {
            let bytes = vec![0; MOST_BYTES].into_boxed_slice();
            // The channel has room for all slots.
            let _ = empty.send(Slot { bytes, n_bytes: 0, arrival: Arrival::now() });
        }
        let thread_is_over = Arc::clone(is_over);
        let thread = thread::Builder::new()
            .name("receiver".to_owned())
            .spawn(move || receive(&socket, sensor, &fill, &empties, &thread_is_over))?;
        let is_over = Arc::clone(is_over);
        Ok(Self::Udp(Box::new(Listener { thread, filled, empty, is_over })))
    }

    /// Passes every packet to `take`, until there are no more or it returns false, and then the
    /// end.
    pub fn run(self, mut take: impl FnMut(Tick<'_>) -> bool) -> anyhow::Result<Read> {
        let read = match self {
            Self::Udp(listener) => listener.run(&mut take)?,
            Self::Capture { file, sensor, timeline } => replay(&file, sensor, timeline, &mut take),
        };
        take(Tick::End);
        Ok(read)
    }
}

fn bind(address: SocketAddr, multicast: Option<Ipv4Addr>) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    // The kernel may grant less without an error.
    socket.set_recv_buffer_size(KERNEL_BUFFER)?;
    let interface = match address.ip() {
        IpAddr::V4(interface) => interface,
        IpAddr::V6(_) => Ipv4Addr::UNSPECIFIED,
    };
    match multicast {
        None => socket.bind(&address.into())?,
        Some(group) => {
            // Several programs may listen to a group.
            socket.set_reuse_address(true)?;
            socket.bind(&SocketAddr::from((group, address.port())).into())?;
            socket.join_multicast_v4(&group, &interface)?;
        }
    }
    socket.set_read_timeout(Some(PATIENCE))?;
    Ok(socket.into())
}

/// Receives packets into empty slots until `is_over`.
fn receive(
    socket: &UdpSocket,
    mut sensor: Sensor,
    fill: &SyncSender<Slot>,
    empties: &Receiver<Slot>,
    is_over: &AtomicBool,
) -> io::Result<Read> {
    let (mut spare, mut read): (Option<Slot>, _) = (None, Read::default());
    let mut overrun = [0; 1];
    while !is_over.load(Ordering::Relaxed) {
        let slot = match spare.take().map_or_else(|| empties.try_recv(), Ok) {
            Ok(slot) => Some(slot),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => break,
        };
        let mut slot = slot;
        let buffer = slot.as_mut().map_or(&mut overrun[..], |slot| &mut slot.bytes);
        let received = socket.recv_from(buffer);
        let (n_bytes, sender) = match received {
            Ok(received) => received,
            Err(error) if is_only_late(&error) => {
                spare = slot;
                continue;
            }
            Err(error) => return Err(error),
        };
        read.n_packets += 1;
        let payload = slot.as_ref().map_or(&overrun[..], |slot| &slot.bytes[..n_bytes]);
        // A sensor that starts again behind a relay may send from another port.
        let sender = Sender { ip: sender.ip(), ports: [0; 2] };
        if !sensor.sent(payload, sender) {
            spare = slot;
            continue;
        }
        let Some(mut slot) = slot else {
            read.n_overrun += 1;
            continue;
        };
        (slot.n_bytes, slot.arrival) = (n_bytes, Arrival::now());
        match fill.try_send(slot) {
            // It cannot be full: there are only as many slots as it has room for.
            Ok(()) | Err(TrySendError::Full(_)) => {}
            Err(TrySendError::Disconnected(_)) => break,
        }
    }
    read.senders = sensor.senders;
    Ok(read)
}

/// Whether the socket has no packet yet.
fn is_only_late(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), Interrupted | TimedOut | WouldBlock)
}

impl Listener {
    fn run(self, take: &mut impl FnMut(Tick<'_>) -> bool) -> anyhow::Result<Read> {
        loop {
            match self.filled.recv_timeout(PATIENCE) {
                Ok(slot) => {
                    let goes_on = take(Tick::Packet(&slot.bytes[..slot.n_bytes], slot.arrival));
                    // The channel has room for all slots.
                    let _ = self.empty.send(slot);
                    if !goes_on {
                        break;
                    }
                }
                Err(RecvTimeoutError::Timeout) if !take(Tick::Quiet) => break,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        self.is_over.store(true, Ordering::Relaxed);
        let ended = self.thread.join().map_err(|_| anyhow::anyhow!("the receiver panicked"))?;
        ended.context("receiving packets")
    }
}

/// Passes the packets of a capture to `take`, at their times if there is a `timeline`.
fn replay(
    file: &Path,
    mut sensor: Sensor,
    mut timeline: Option<Box<Timeline>>,
    take: &mut impl FnMut(Tick<'_>) -> bool,
) -> Read {
    let (mut read, start, mut first_s) = (Read::default(), Instant::now(), None);
    let ended = pcap::read(file, |packet| {
        read.n_packets += 1;
        if !sensor.sent(&packet.payload, packet.sender) {
            return ControlFlow::Continue(());
        }
        let time_s = packet.time_s.unwrap_or_default();
        let mut arrival = Arrival { time_s, moment: None };
        if let Some(timeline) = &mut timeline {
            if let Some(sent_s) = timeline.take(&packet.payload, arrival) {
                let since_s = sent_s - *first_s.get_or_insert(sent_s);
                let due = start + Duration::try_from_secs_f64(since_s).unwrap_or_default();
                thread::sleep(due.saturating_duration_since(Instant::now()));
            }
            arrival.moment = Some(Instant::now());
        }
        match take(Tick::Packet(&packet.payload, arrival)) {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    });
    let error = ended.map(|capture| read.capture = capture).err().map(anyhow::Error::from);
    Read { senders: sensor.senders, error, ..read }
}
