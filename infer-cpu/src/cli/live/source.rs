//! The sources of packets: a socket or a capture.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{
    Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, sync_channel,
};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::live::Arrival;
use anyhow::Context;
use formats::pcap;
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
    Capture { file: PathBuf, from: Option<IpAddr>, realtime: bool },
    Udp(Box<Listener>),
}

#[derive(Default)]
pub struct Read {
    /// All UDP packets.
    pub n_packets: u64,
    /// Packets from other addresses, which were dropped.
    pub n_from_others: u64,
    /// Packets that were dropped because the queue was full.
    pub n_overrun: u64,
}

/// A thread that receives packets, and their queue.
pub struct Listener {
    thread: JoinHandle<io::Result<()>>,
    filled: Receiver<Slot>,
    empty: SyncSender<Slot>,
    counts: Arc<ListenerCounts>,
    is_over: Arc<AtomicBool>,
}

#[derive(Default)]
struct ListenerCounts {
    packets: AtomicU64,
    from_others: AtomicU64,
    overrun: AtomicU64,
}

struct Slot {
    bytes: Box<[u8]>,
    n_bytes: usize,
    arrival: Arrival,
}

impl Source {
    /// The packets of the capture at `file`: those `from` an address, or all.
    pub fn capture(file: &Path, from: Option<IpAddr>, realtime: bool) -> Self {
        Self::Capture { file: file.to_path_buf(), from, realtime }
    }

    /// The packets to `address`, which are received from now on until `is_over`.
    pub fn udp(
        address: SocketAddr,
        multicast: Option<Ipv4Addr>,
        from: Option<IpAddr>,
        is_over: &Arc<AtomicBool>,
    ) -> anyhow::Result<Self> {
        let socket = bind(address, multicast).with_context(|| format!("UDP {address}"))?;
        let (fill, filled) = sync_channel(RING);
        let (empty, empties) = sync_channel(RING);
        for _ in 0..RING {
            let bytes = vec![0; MOST_BYTES].into_boxed_slice();
            // The channel has room for all slots.
            let _ = empty.send(Slot { bytes, n_bytes: 0, arrival: Arrival::now() });
        }
        let counts = Arc::new(ListenerCounts::default());
        let (thread_counts, thread_is_over) = (Arc::clone(&counts), Arc::clone(is_over));
        let thread = thread::Builder::new().name("receiver".to_owned()).spawn(move || {
            receive(&socket, from, &fill, &empties, &thread_counts, &thread_is_over)
        })?;
        let is_over = Arc::clone(is_over);
        Ok(Self::Udp(Box::new(Listener { thread, filled, empty, counts, is_over })))
    }

    /// Passes every packet to `take`, until there are no more or it returns false, and then the
    /// end.
    pub fn run(self, mut take: impl FnMut(Tick<'_>) -> bool) -> anyhow::Result<Read> {
        let read = match self {
            Self::Udp(listener) => listener.run(&mut take)?,
            Self::Capture { file, from, realtime } => replay(&file, from, realtime, &mut take)?,
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
    from: Option<IpAddr>,
    fill: &SyncSender<Slot>,
    empties: &Receiver<Slot>,
    counts: &ListenerCounts,
    is_over: &AtomicBool,
) -> io::Result<()> {
    let mut spare: Option<Slot> = None;
    let mut overrun = [0; 1];
    while !is_over.load(Ordering::Relaxed) {
        let slot = match spare.take().map_or_else(|| empties.try_recv(), Ok) {
            Ok(slot) => Some(slot),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => return Ok(()),
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
        counts.packets.fetch_add(1, Ordering::Relaxed);
        if from.is_some_and(|from| from != sender.ip()) {
            counts.from_others.fetch_add(1, Ordering::Relaxed);
            spare = slot;
            continue;
        }
        let Some(mut slot) = slot else {
            counts.overrun.fetch_add(1, Ordering::Relaxed);
            continue;
        };
        (slot.n_bytes, slot.arrival) = (n_bytes, Arrival::now());
        match fill.try_send(slot) {
            // It cannot be full: there are only as many slots as it has room for.
            Ok(()) | Err(TrySendError::Full(_)) => {}
            Err(TrySendError::Disconnected(_)) => return Ok(()),
        }
    }
    Ok(())
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
        ended.context("receiving packets")?;
        let value = |count: &AtomicU64| count.load(Ordering::Relaxed);
        Ok(Read {
            n_packets: value(&self.counts.packets),
            n_from_others: value(&self.counts.from_others),
            n_overrun: value(&self.counts.overrun),
        })
    }
}

/// Passes the packets of a capture to `take`, at their times if `realtime`.
fn replay(
    file: &Path,
    from: Option<IpAddr>,
    realtime: bool,
    take: &mut impl FnMut(Tick<'_>) -> bool,
) -> anyhow::Result<Read> {
    let (mut read, start, mut first_s) = (Read::default(), Instant::now(), None);
    pcap::read(file, |packet| {
        read.n_packets += 1;
        if from.is_some_and(|from| from != packet.source) {
            read.n_from_others += 1;
            return ControlFlow::Continue(());
        }
        let time_s = packet.time_s.unwrap_or_default();
        let mut moment = None;
        if realtime {
            let since_s = time_s - *first_s.get_or_insert(time_s);
            let due = start + Duration::try_from_secs_f64(since_s).unwrap_or_default();
            thread::sleep(due.saturating_duration_since(Instant::now()));
            moment = Some(Instant::now());
        }
        match take(Tick::Packet(&packet.payload, Arrival { time_s, moment })) {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    })?;
    Ok(read)
}
