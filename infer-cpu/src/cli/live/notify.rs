//! Notifies systemd about a service of `Type=notify`: that it is ready, alive, its status, and that
//! it stops. The protocol is sd_notify(3) and sd_watchdog_enabled(3).

use std::env;
use std::ffi::{OsStr, OsString};
use std::io;
use std::process;
use std::time::{Duration, Instant};

use crate::live::Counts;
use anyhow::Context;

use manager::Manager;

/// The interval of status messages without a watchdog.
const STATUS_PERIOD: Duration = Duration::from_secs(5);

/// Sends messages to systemd, if it listens.
pub struct Notifier {
    manager: Option<Manager>,
    watchdog: Option<Duration>,
    /// When the next keep-alive message is due.
    due: Instant,
}

impl Notifier {
    pub fn of_environment() -> anyhow::Result<Self> {
        Self::new(|name| env::var_os(name))
    }

    fn new(variable: impl Fn(&str) -> Option<OsString>) -> anyhow::Result<Self> {
        let due = Instant::now();
        let Some(name) = variable("NOTIFY_SOCKET").filter(|name| !name.is_empty()) else {
            return Ok(Self { manager: None, watchdog: None, due });
        };
        let manager =
            Manager::at(&name).with_context(|| format!("NOTIFY_SOCKET={}", name.display()))?;
        // The watchdog may be for another process.
        let is_ours = variable("WATCHDOG_PID").is_none_or(|id| id == *process::id().to_string());
        let watchdog = variable("WATCHDOG_USEC").filter(|_| is_ours);
        let watchdog = watchdog.map(|time| microseconds(&time)).transpose()?;
        Ok(Self { manager: Some(manager), watchdog, due })
    }

    /// Reports that the model is loaded and packets are received.
    pub fn ready(&self) -> anyhow::Result<()> {
        let Some(manager) = &self.manager else { return Ok(()) };
        manager.tell("READY=1\nSTATUS=Waiting for packets").context("telling NOTIFY_SOCKET")
    }

    /// Sends a keep-alive message if one is due. The loop over packets calls this, so that the
    /// watchdog detects if the loop hangs.
    pub fn alive(&mut self, counts: &Counts, now: Instant) {
        let Some(manager) = self.manager.as_ref().filter(|_| now >= self.due) else { return };
        let Counts { packets, clusters, .. } = counts;
        let sign = if self.watchdog.is_some() { "WATCHDOG=1\n" } else { "" };
        // If the socket is full, the next packet tries again.
        if manager.tell(&format!("{sign}STATUS={packets} packets, {clusters} objects")).is_ok() {
            // sd_watchdog_enabled(3) recommends half of the time.
            self.due = now + self.watchdog.map_or(STATUS_PERIOD, |time| time / 2);
        }
    }

    /// Reports that the program stops; later messages are not sent.
    pub fn stopping(&mut self) {
        if let Some(manager) = self.manager.take() {
            // If this fails, systemd still sees the process end.
            let _ = manager.tell("STOPPING=1");
        }
    }
}

fn microseconds(text: &OsStr) -> anyhow::Result<Duration> {
    let number = text.to_str().and_then(|text| text.parse().ok()).filter(|&number| number > 0);
    number.map(Duration::from_micros).with_context(|| {
        format!("expected microseconds in WATCHDOG_USEC, found `{}`", text.display())
    })
}

#[cfg(target_os = "linux")]
mod manager {
    use super::{OsStr, io};
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::ffi::OsStrExt;
    use std::os::unix::net::{SocketAddr, UnixDatagram};

    pub struct Manager {
        socket: UnixDatagram,
        address: SocketAddr,
    }

    impl Manager {
        /// Connects to a path, or to the abstract name after an `@`.
        pub fn at(name: &OsStr) -> io::Result<Self> {
            let address = match name.as_bytes() {
                [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
                [b'/', ..] => SocketAddr::from_pathname(name)?,
                _ => return Err(io::Error::other("expected a path or an abstract name: /… or @…")),
            };
            let socket = UnixDatagram::unbound()?;
            // Packets must not wait for a busy manager.
            socket.set_nonblocking(true)?;
            Ok(Self { socket, address })
        }

        pub fn tell(&self, state: &str) -> io::Result<()> {
            self.socket.send_to_addr(state.as_bytes(), &self.address).map(drop)
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod manager {
    use super::{OsStr, io};

    pub enum Manager {}

    impl Manager {
        pub fn at(_: &OsStr) -> io::Result<Self> {
            Err(io::ErrorKind::Unsupported.into())
        }

        pub fn tell(&self, _: &str) -> io::Result<()> {
            match *self {}
        }
    }
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use super::*;
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixDatagram};

    fn counts() -> Counts {
        Counts { packets: 754, clusters: 30, ..Counts::default() }
    }

    /// A manager's socket at an abstract name for this test, and the value of NOTIFY_SOCKET for it.
    fn manager(test: &str) -> (UnixDatagram, String) {
        let name = format!("edgepuck-{test}-{}", process::id());
        let address = SocketAddr::from_abstract_name(&name).unwrap();
        (unblocked(UnixDatagram::bind_addr(&address).unwrap()), format!("@{name}"))
    }

    fn unblocked(socket: UnixDatagram) -> UnixDatagram {
        socket.set_nonblocking(true).unwrap();
        socket
    }

    fn notifier(variables: &[(&str, &str)]) -> anyhow::Result<Notifier> {
        Notifier::new(|name| {
            let (_, value) = variables.iter().find(|(key, _)| *key == name)?;
            Some(value.into())
        })
    }

    /// The messages since the last call.
    fn told(manager: &UnixDatagram) -> Vec<String> {
        let mut buffer = [0; 256];
        let mut next = || manager.recv(&mut buffer).ok().map(|n| buffer[..n].to_vec());
        let all = std::iter::from_fn(&mut next);
        all.map(|state| String::from_utf8(state).unwrap()).collect()
    }

    #[test]
    fn a_service_is_ready_then_alive_at_half_of_the_watchdogs_time_then_stopping() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let manager = unblocked(UnixDatagram::bind(&path).unwrap());
        let (path, own_id) = (path.to_str().unwrap(), process::id().to_string());
        let watched =
            [("NOTIFY_SOCKET", path), ("WATCHDOG_USEC", "10000000"), ("WATCHDOG_PID", &own_id)];
        let mut notifier = notifier(&watched).unwrap();
        notifier.ready().unwrap();
        assert_eq!(told(&manager), ["READY=1\nSTATUS=Waiting for packets"]);
        let start = Instant::now();
        for tenths in 0..=100 {
            notifier.alive(&counts(), start + Duration::from_millis(100 * tenths));
        }
        assert_eq!(told(&manager), ["WATCHDOG=1\nSTATUS=754 packets, 30 objects"; 3]);
        notifier.stopping();
        notifier.alive(&counts(), start + Duration::from_secs(100));
        assert_eq!(told(&manager), ["STOPPING=1"]);
    }

    #[test]
    fn without_a_watchdog_of_its_own_only_the_status_is_told() {
        let (manager, name) = manager("unwatched");
        let unwatched = [("NOTIFY_SOCKET", &*name)];
        let others =
            [("NOTIFY_SOCKET", &*name), ("WATCHDOG_USEC", "10000000"), ("WATCHDOG_PID", "1")];
        for variables in [&unwatched[..], &others] {
            notifier(variables).unwrap().alive(&counts(), Instant::now());
            assert_eq!(told(&manager), ["STATUS=754 packets, 30 objects"]);
        }
    }

    #[test]
    fn a_busy_manager_delays_the_sign_of_life_and_not_the_packets() {
        let (manager, name) = manager("busy");
        let mut notifier = notifier(&[("NOTIFY_SOCKET", &*name)]).unwrap();
        let now = Instant::now();
        while notifier.ready().is_ok() {}
        notifier.alive(&counts(), now);
        told(&manager);
        notifier.alive(&counts(), now);
        assert_eq!(told(&manager), ["STATUS=754 packets, 30 objects"]);
    }

    #[test]
    fn nobody_is_told_without_a_socket_and_odd_variables_are_refused() {
        for unset in [&[("WATCHDOG_USEC", "10 s")][..], &[("NOTIFY_SOCKET", "")]] {
            let mut silent = notifier(unset).unwrap();
            silent.ready().unwrap();
            silent.alive(&counts(), Instant::now());
        }
        let refusal = |variables: &[_]| format!("{:#}", notifier(variables).err().unwrap());
        assert_eq!(
            refusal(&[("NOTIFY_SOCKET", "vsock:2:1")]),
            "NOTIFY_SOCKET=vsock:2:1: expected a path or an abstract name: /… or @…"
        );
        assert_eq!(
            refusal(&[("NOTIFY_SOCKET", "/nowhere/notify"), ("WATCHDOG_USEC", "10 s")]),
            "expected microseconds in WATCHDOG_USEC, found `10 s`"
        );
        let gone = notifier(&[("NOTIFY_SOCKET", "/nowhere/notify")]).unwrap();
        assert!(gone.ready().is_err());
    }
}
