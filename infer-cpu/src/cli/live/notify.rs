//! Notifies systemd about a service of `Type=notify`: that it is ready, alive, its status, and that
//! it stops. The protocol is sd_notify(3) and sd_watchdog_enabled(3).
//!
//! The crates `sd-notify` 0.5.0 and `libsystemd` 0.7.2 wait while the manager's socket is full, which
//! would hold up packets, and ignore a malformed `WATCHDOG_USEC`; the former takes an abstract name
//! for a path.

use std::ffi::{OsStr, OsString};
use std::time::{Duration, Instant};
use std::{env, io, process};

use crate::live::Counts;
use anyhow::Context;

/// The interval of status messages without a watchdog.
const STATUS_PERIOD: Duration = Duration::from_secs(5);

/// Sends one message to the manager, and fails rather than wait if its socket is full.
type Send = Box<dyn Fn(&str) -> io::Result<()>>;

/// Sends messages to systemd, if it listens.
pub struct Notifier {
    send: Option<Send>,
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
            return Ok(Self { send: None, watchdog: None, due });
        };
        let send = sender(&name).with_context(|| format!("NOTIFY_SOCKET={}", name.display()))?;
        // The watchdog may be for another process.
        let is_ours = variable("WATCHDOG_PID").is_none_or(|id| id == *process::id().to_string());
        let watchdog = variable("WATCHDOG_USEC").filter(|_| is_ours);
        let watchdog = watchdog.map(|time| microseconds(&time)).transpose()?;
        Ok(Self { send: Some(send), watchdog, due })
    }

    /// Reports that the model is loaded and packets are received.
    pub fn ready(&self) -> anyhow::Result<()> {
        let Some(send) = &self.send else { return Ok(()) };
        send("READY=1\nSTATUS=Waiting for packets").context("sending to NOTIFY_SOCKET")
    }

    /// Sends a keep-alive message if one is due. The loop over packets calls this, so that the
    /// watchdog detects if the loop hangs.
    pub fn alive(&mut self, counts: &Counts, now: Instant) {
        let Some(send) = self.send.as_ref().filter(|_| now >= self.due) else { return };
        let Counts { packets, clusters, .. } = counts;
        let sign = if self.watchdog.is_some() { "WATCHDOG=1\n" } else { "" };
        // If the socket is full, the next packet tries again.
        if send(&format!("{sign}STATUS={packets} packets, {clusters} objects")).is_ok() {
            // sd_watchdog_enabled(3) recommends half of the time.
            self.due = now + self.watchdog.map_or(STATUS_PERIOD, |time| time / 2);
        }
    }

    /// Reports that the program stops; later messages are not sent.
    pub fn stopping(&mut self) {
        // If this fails, systemd still sees the process end.
        let _ = self.send.take().map(|send| send("STOPPING=1"));
    }
}

fn microseconds(text: &OsStr) -> anyhow::Result<Duration> {
    let number = text.to_str().and_then(|text| text.parse().ok()).filter(|&number| number > 0);
    number.map(Duration::from_micros).with_context(|| {
        format!("expected microseconds in WATCHDOG_USEC, found `{}`", text.display())
    })
}

/// Sends to the socket at a path, or at the abstract name after an `@`.
#[cfg(target_os = "linux")]
fn sender(name: &OsStr) -> io::Result<Send> {
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::{ffi::OsStrExt, net};
    let address = match name.as_bytes() {
        [b'@', name @ ..] => net::SocketAddr::from_abstract_name(name)?,
        [b'/', ..] => net::SocketAddr::from_pathname(name)?,
        _ => return Err(io::Error::other("expected a path or an abstract name: /… or @…")),
    };
    let socket = net::UnixDatagram::unbound()?;
    socket.set_nonblocking(true)?;
    Ok(Box::new(move |state| socket.send_to_addr(state.as_bytes(), &address).map(drop)))
}

#[cfg(not(target_os = "linux"))]
fn sender(_: &OsStr) -> io::Result<Send> {
    Err(io::Error::other("expected no such variable, since systemd runs on Linux only"))
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use super::*;
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixDatagram};

    const ALIVE: &str = "STATUS=754 packets, 30 objects";

    fn counts() -> Counts {
        Counts { packets: 754, clusters: 30, ..Counts::default() }
    }

    /// A manager's socket at an abstract name for this test, and the value of NOTIFY_SOCKET for it.
    fn manager(test: &str) -> (UnixDatagram, String) {
        let name = format!("edgepuck-{test}-{}", process::id());
        let address = SocketAddr::from_abstract_name(&name).unwrap();
        let socket = UnixDatagram::bind_addr(&address).unwrap();
        socket.set_nonblocking(true).unwrap();
        (socket, format!("@{name}"))
    }

    fn notifier(variables: &[(&str, &str)]) -> anyhow::Result<Notifier> {
        let value = |name: &str| variables.iter().find(|(key, _)| *key == name);
        Notifier::new(|name| value(name).map(|(_, value)| value.into()))
    }

    /// The messages since the last call.
    fn received(manager: &UnixDatagram) -> Vec<String> {
        let mut buffer = [0; 256];
        let next = || manager.recv(&mut buffer).ok().map(|n| buffer[..n].to_vec());
        std::iter::from_fn(next).map(|state| String::from_utf8(state).unwrap()).collect()
    }

    #[test]
    fn alive_is_sent_at_half_of_the_watchdog_time() {
        let (manager, name) = manager("watched");
        let own_id = process::id().to_string();
        let watched = [("WATCHDOG_USEC", "10000000"), ("WATCHDOG_PID", &*own_id)];
        let mut notifier =
            notifier(&[&watched[..], &[("NOTIFY_SOCKET", &*name)]].concat()).unwrap();
        notifier.ready().unwrap();
        assert_eq!(received(&manager), ["READY=1\nSTATUS=Waiting for packets"]);
        let start = Instant::now();
        for tenths in 0..=100 {
            notifier.alive(&counts(), start + Duration::from_millis(100 * tenths));
        }
        assert_eq!(received(&manager), ["WATCHDOG=1\nSTATUS=754 packets, 30 objects"; 3]);
        notifier.stopping();
        notifier.alive(&counts(), start + Duration::from_secs(100));
        assert_eq!(received(&manager), ["STOPPING=1"]);
    }

    #[test]
    fn only_the_status_is_sent_without_a_watchdog_of_this_process() {
        let (manager, name) = manager("unwatched");
        let others = [("WATCHDOG_USEC", "10000000"), ("WATCHDOG_PID", "1")];
        for watchdog in [&[][..], &others] {
            let variables = [watchdog, &[("NOTIFY_SOCKET", &*name)]].concat();
            notifier(&variables).unwrap().alive(&counts(), Instant::now());
            assert_eq!(received(&manager), [ALIVE]);
        }
    }

    #[test]
    fn a_busy_manager_delays_alive_without_blocking() {
        let (manager, name) = manager("busy");
        let mut notifier = notifier(&[("NOTIFY_SOCKET", &*name)]).unwrap();
        let now = Instant::now();
        while notifier.ready().is_ok() {}
        notifier.alive(&counts(), now);
        assert!(!received(&manager).contains(&ALIVE.to_owned()));
        notifier.alive(&counts(), now);
        assert_eq!(received(&manager), [ALIVE]);
    }

    #[test]
    fn nothing_is_sent_without_a_socket() {
        for unset in [("WATCHDOG_USEC", "10 s"), ("NOTIFY_SOCKET", "")] {
            let mut silent = notifier(&[unset]).unwrap();
            silent.ready().unwrap();
            silent.alive(&counts(), Instant::now());
        }
    }

    #[test]
    fn malformed_variables_fail() {
        let error = |variables: &[_]| format!("{:#}", notifier(variables).err().unwrap());
        assert_eq!(
            error(&[("NOTIFY_SOCKET", "vsock:2:1")]),
            "NOTIFY_SOCKET=vsock:2:1: expected a path or an abstract name: /… or @…"
        );
        for time in ["10 s", "0", ""] {
            assert_eq!(
                error(&[("NOTIFY_SOCKET", "/nowhere/notify"), ("WATCHDOG_USEC", time)]),
                format!("expected microseconds in WATCHDOG_USEC, found `{time}`")
            );
        }
        assert!(notifier(&[("NOTIFY_SOCKET", "/nowhere/notify")]).unwrap().ready().is_err());
    }
}
