//! Notifies systemd about a service of `Type=notify`: that it is ready, alive, its status, and that
//! it stops, as sd_notify(3) and sd_watchdog_enabled(3) say.

use std::io;
use std::time::{Duration, Instant};

use crate::live::Counts;
use anyhow::Context;
use formats::counted;

/// The interval of status messages without a watchdog.
const STATUS_PERIOD: Duration = Duration::from_secs(5);

/// Sends messages to systemd, if it listens.
pub struct Notifier {
    watchdog: Option<Duration>,
    /// When the next keep-alive message is due; none after the end.
    due: Option<Instant>,
}

impl Notifier {
    /// For the manager, and with the watchdog, that the environment names.
    pub fn of_environment() -> Self {
        Self { watchdog: watchdog(), due: Some(Instant::now()) }
    }

    /// Reports that the model is loaded and packets are received.
    pub fn ready(&self) -> anyhow::Result<()> {
        send("READY=1\nSTATUS=Waiting for packets").context("sending to NOTIFY_SOCKET")
    }

    /// Sends a keep-alive message if one is due. The loop over packets calls this, so that the
    /// watchdog detects if the loop hangs.
    pub fn alive(&mut self, counts: &Counts, now: Instant) {
        if self.due.is_none_or(|due| now < due) {
            return;
        }
        let Counts { packets, clusters, .. } = counts;
        let sign = if self.watchdog.is_some() { "WATCHDOG=1\n" } else { "" };
        // If this fails, the next packet tries again.
        let (packets, objects) = (counted(*packets, "packet"), counted(*clusters, "object"));
        if send(&format!("{sign}STATUS={packets}, {objects}")).is_ok() {
            // sd_watchdog_enabled(3) recommends half of the time.
            self.due = Some(now + self.watchdog.map_or(STATUS_PERIOD, |time| time / 2));
        }
    }

    /// Reports that the program stops; later messages are not sent.
    pub fn stopping(&mut self) {
        self.due = None;
        // If this fails, systemd still sees the process end.
        let _ = send("STOPPING=1");
    }
}

#[cfg(target_os = "linux")]
fn send(text: &str) -> io::Result<()> {
    sd_notify::notify(&[sd_notify::NotifyState::Custom(text)])
}

#[cfg(target_os = "linux")]
fn watchdog() -> Option<Duration> {
    sd_notify::watchdog_enabled().filter(|time| !time.is_zero())
}

/// systemd runs on Linux only.
#[cfg(not(target_os = "linux"))]
fn send(_: &str) -> io::Result<()> {
    Ok(())
}

#[cfg(not(target_os = "linux"))]
fn watchdog() -> Option<Duration> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keep_alive_messages_are_due_after_half_of_the_watchdogs_time_until_the_end() {
        let now = Instant::now();
        let second = Duration::from_secs(1);
        for (watchdog, step) in [(Some(3 * second), 3 * second / 2), (None, STATUS_PERIOD)] {
            let mut notifier = Notifier { watchdog, due: Some(now) };
            for at in [now, now + second] {
                notifier.alive(&Counts::default(), at);
                assert_eq!(notifier.due, Some(now + step));
            }
            notifier.stopping();
            notifier.alive(&Counts::default(), now + 9 * second);
            assert_eq!(notifier.due, None);
        }
    }
}
