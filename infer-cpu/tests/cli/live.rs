//! `live`: objects from a capture and over the network.

use std::io::{BufRead, BufReader, Read};
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use serde_json::Value;

use crate::program::Folder;
use crate::street::{PACKET_S, PACKETS_PER_S, Thing, capture, capture_of, packets, street};

pub const LIVE: &str = "live --threads 1 --min-turns 1";

/// The order of keys is part of the format.
const KEYS: [&str; 18] = [
    "version",
    "turn",
    "track",
    "class",
    "resembles",
    "confidence",
    "probability",
    "frame",
    "position_m",
    "size_m",
    "yaw_deg",
    "velocity_m_s",
    "points",
    "range_m",
    "first_s",
    "last_s",
    "latency_ms",
    "whole_box",
];

/// A folder with a capture `drive.pcap` of one second from Unix time 1000 s on.
pub fn folder() -> Folder {
    let folder = Folder::new();
    let sent = packets(&street(), 7, PACKETS_PER_S);
    let time_us = |i: usize| 1_000_000_000 + (i as f64 * PACKET_S * 1e6) as u64;
    let timed = sent.iter().enumerate().map(|(i, packet)| (time_us(i), &packet[..]));
    folder.write("drive.pcap", capture(timed));
    folder
}

#[test]
fn each_object_is_a_line_whose_keys_have_an_order() {
    let folder = folder();
    let ran = folder.run(&format!("{LIVE} --pcap drive.pcap"));
    assert_eq!((ran.code, ran.err.as_str()), (0, ""));
    for line in ran.out.lines() {
        let places: Vec<_> =
            KEYS.iter().map(|key| line.find(&format!("\"{key}\":")).unwrap()).collect();
        assert!(places.is_sorted(), "{line}");
        let object: Value = serde_json::from_str(line).unwrap();
        assert_eq!(object.as_object().unwrap().len(), KEYS.len());
        assert_eq!((&object["version"], &object["frame"]), (&1.into(), &"sensor".into()));
        assert!((1000.0..1001.2).contains(&object["last_s"].as_f64().unwrap()), "{line}");
        assert!(object["latency_ms"].is_null());
    }
    assert!(ran.out.lines().count() >= 3 * 9);
    // The output is the same for any number of threads.
    let again =
        folder.run(&format!("{} --pcap drive.pcap", LIVE.replace("threads 1", "threads 3")));
    assert_eq!(again.out, ran.out);
}

#[test]
fn in_real_time_a_capture_takes_its_time_and_answers_have_latencies() {
    let folder = folder();
    let sent = packets(&street(), 7, PACKETS_PER_S);
    folder.write("timeless.pcap", capture(sent.iter().map(|packet| (0, &packet[..]))));
    let run = |file: &str| {
        let start = std::time::Instant::now();
        let ran = folder.run(&format!("{LIVE} --pcap {file} --realtime --json --stats"));
        assert!(start.elapsed() > Duration::from_millis(900), "{file}");
        ran
    };
    run("timeless.pcap");
    let ran = run("drive.pcap");
    let latencies: Vec<_> = ran.json().iter().map(|o| o["latency_ms"].as_f64().unwrap()).collect();
    assert!(!latencies.is_empty() && latencies.iter().all(|ms| *ms > 0.0));
    for word in ["decode", "detect", "track", "latency, ms", "0 lost"] {
        assert!(ran.err.contains(word), "{}", ran.err);
    }
}

#[test]
fn poses_bring_objects_into_the_world() {
    let folder = folder();
    folder.write("still.tum", "999 10 20 0 0 0 0 1\n2000 10 20 0 0 0 0 1\n");
    let seen = folder.run(&format!("{LIVE} --pcap drive.pcap")).json();
    let placed = folder.run(&format!("{LIVE} --pcap drive.pcap --poses still.tum")).json();
    assert_eq!(seen.len(), placed.len());
    for (seen, placed) in seen.iter().zip(&placed) {
        assert_eq!((&placed["frame"], &placed["track"]), (&"world".into(), &seen["track"]));
        for (axis, shift) in [10.0, 20.0, 0.0].into_iter().enumerate() {
            let [seen, placed] = [seen, placed].map(|o| o["position_m"][axis].as_f64().unwrap());
            assert!((placed - seen - shift).abs() < 0.002, "{seen} {placed}");
        }
    }
}

/// A pipe is read once: the packets after the last pose have no answers.
#[test]
fn poses_that_do_not_cover_a_pipe_end_its_answers() {
    let folder = folder();
    folder.write("p.tum", "1000 0 0 0 0 0 0 1\n1000.5 0 0 0 0 0 0 1\n");
    let mut command = folder.command(&format!("{LIVE} --pcap /dev/stdin --poses p.tum"));
    let capture = std::fs::File::open(folder.path("drive.pcap")).unwrap();
    let mut cat = Command::new("cat").stdin(capture).stdout(Stdio::piped()).spawn().unwrap();
    let output = command.stdin(cat.stdout.take().unwrap()).output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert!(err.contains("expected poses from 1000.000 s to 1000.6"), "{err}");
    assert_eq!(output.status.code(), Some(1));
    drop(command);
    cat.wait().unwrap();
}

#[test]
fn the_second_of_two_sensors_is_reported_once() {
    let folder = folder();
    let sent = packets(&street(), 7, PACKETS_PER_S);
    let elsewhere = [Thing { at: [4.0, 8.0], velocity: [0.0; 2], size: [3.0, 2.0, 2.0] }];
    let others = packets(&elsewhere, 90_000_000, PACKETS_PER_S);
    let time_us = |i: usize| 1_000_000_000 + (i as f64 * PACKET_S * 1e6) as u64;
    let both =
        sent.iter().zip(&others).enumerate().flat_map(|(i, (one, other))| {
            [(time_us(i), 201, &one[..]), (time_us(i), 202, &other[..])]
        });
    folder.write("two.pcap", capture_of(both));
    let other = others.iter().enumerate().map(|(i, packet)| (time_us(i), &packet[..]));
    folder.write("other.pcap", capture(other));
    let alone = folder.run(&format!("{LIVE} --pcap drive.pcap")).out;
    let ran = folder.run(&format!("{LIVE} --pcap two.pcap --json --stats"));
    assert_eq!((ran.code, ran.out), (0, alone));
    let warning = "warning: expected packets of one sensor, found those of 192.168.1.201, which \
                   are used, and of 192.168.1.202 (1 so far), which are not; --from 192.168.1.202";
    assert_eq!((ran.err.starts_with(warning), ran.err.matches("warning").count()), (true, 1));
    assert!(ran.err.contains("754 from other addresses"), "{}", ran.err);
    let alone = folder.run(&format!("{LIVE} --pcap other.pcap")).out;
    let ran = folder.run(&format!("{LIVE} --pcap two.pcap --from 192.168.1.202"));
    assert_eq!((ran.code, ran.err.as_str(), ran.out), (0, "", alone));
}

/// The times of a capture that lost them, holds nanoseconds in the field of microseconds, or was
/// replayed at ten times the speed, or a tenth.
#[test]
fn the_stamps_of_a_sensor_rule_over_the_times_of_a_capture() {
    let folder = folder();
    let expected = folder.run(&format!("{LIVE} --pcap drive.pcap")).json();
    let sent = packets(&street(), 7, PACKETS_PER_S);
    let time_us = |i: usize| (i as f64 * PACKET_S * 1e6) as u64;
    let all: [(&dyn Fn(usize) -> u64, f64); 4] = [
        (&|_| 0, 0.0),
        (&|i| time_us(i) / 1_000_000 * 1_000_000 + time_us(i) % 1_000_000 * 1000, 0.0),
        (&|i| 1_000_000_000 + time_us(i) / 10, 1000.0),
        (&|i| 1_000_000_000 + time_us(i) * 10, 1000.0),
    ];
    for (time_us, start_s) in all {
        let timed = sent.iter().enumerate().map(|(i, packet)| (time_us(i), &packet[..]));
        folder.write("x.pcap", capture(timed));
        let ran = folder.run(&format!("{LIVE} --pcap x.pcap"));
        let start = "warning: by the times of the recording, ";
        assert_eq!((ran.err.starts_with(start), ran.err.lines().count()), (true, 1), "{}", ran.err);
        let found = ran.json();
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            let since = |object: &Value, start_s| object["last_s"].as_f64().unwrap() - start_s;
            let apart_s = since(found, start_s) - since(expected, 1000.0);
            assert!(apart_s.abs() < 2e-5, "{apart_s}");
        }
    }
}

#[test]
fn models_have_names_and_those_of_clouds_are_refused() {
    let folder = folder();
    let objects = |line: &str| {
        let ran = folder.run(&format!("live --pcap drive.pcap --threads 1 {line}"));
        (ran.err, ran.out)
    };
    let (err, out) = objects("");
    assert_eq!((err.as_str(), out.lines().count() >= 20), ("", true), "{out}");
    assert_eq!(objects("--model street-bev"), (err, out));
    for model in ["edge-64", "street-128"] {
        let ran = folder.run(&format!("live --pcap drive.pcap --model {model}"));
        ran.assert_refused(1, &format!("error: {model}: card: expected a bird's-eye model"));
    }
    let ran = folder.run("classify --model street-bev drive.pcap");
    ran.assert_refused(1, "error: street-bev: card: expected a model of clouds");
}

#[test]
fn a_silent_sensor_is_reported() {
    let folder = Folder::new();
    let port = free_port();
    let mut child = listen(&folder, port, "");
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let mut next = || lines.next().unwrap().unwrap();
    assert_eq!(next(), format!("listening on UDP 127.0.0.1:{port}"));
    let expected = "warning: no packets have come for 5 s: expected the sensor to send to port ";
    assert!(next().starts_with(expected));
    child.kill().unwrap();
    child.wait().unwrap();
}

pub fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Starts the program at a port of this machine, and waits until it listens.
pub fn listen(folder: &Folder, port: u16, more: &str) -> Child {
    let line = format!("{LIVE} --udp {port} --interface 127.0.0.1 {more}");
    let mut command = folder.command(&line);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    while UdpSocket::bind(("127.0.0.1", port)).is_ok() {
        thread::sleep(Duration::from_millis(20));
    }
    child
}

pub fn terminate(child: &mut Child) -> (Option<i32>, String) {
    let kill = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let mut err = String::new();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    (child.wait().unwrap().code(), err)
}

#[test]
fn udp_packets_are_answered_at_once_and_sigterm_ends_the_run() {
    let folder = Folder::new();
    let port = free_port();
    let mut child = listen(&folder, port, "--json --stats");
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    // A turn and a half, so that the objects of the first turn are printed before the stream ends.
    let sent = packets(&street(), 7, 113);
    for packet in &sent {
        socket.send_to(packet, ("127.0.0.1", port)).unwrap();
        thread::sleep(Duration::from_secs_f64(PACKET_S));
    }
    socket.send_to(b"something else", ("127.0.0.1", port)).unwrap();
    let first: Value = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
    assert_eq!(first["turn"], 0);
    thread::sleep(Duration::from_millis(300));
    let (code, err) = terminate(&mut child);
    let rest: Vec<Value> =
        lines.map(|line| serde_json::from_str(&line.unwrap()).unwrap()).collect();
    assert_eq!(code, Some(0), "{err}");
    assert!(err.contains("113 packets; 0 lost") && err.contains("1 foreign"), "{err}");
    assert!(err.contains("expected a data packet of 1206 bytes, found 14 bytes"), "{err}");
    // Clusters that were incomplete at the signal are printed, too.
    assert!(rest.iter().any(|object| object["turn"] == 1), "{rest:?}");
}

#[test]
fn packets_from_other_addresses_are_not_looked_at() {
    let folder = Folder::new();
    let port = free_port();
    let mut child = listen(&folder, port, "--from 127.0.0.9 --stats");
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    for packet in packets(&street(), 7, 5) {
        socket.send_to(&packet, ("127.0.0.1", port)).unwrap();
    }
    thread::sleep(Duration::from_secs(2));
    let (code, err) = terminate(&mut child);
    // A service without packets of its sensor does not fail.
    assert_eq!(code, Some(0));
    assert!(err.contains("5 from other addresses"), "{err}");
    let expected =
        "warning: expected packets of a VLP-16 or VLP-32C, found none among 5 UDP packets";
    assert!(err.contains(expected), "{err}");
}

#[test]
fn an_address_that_cannot_be_bound_is_named() {
    let folder = Folder::new();
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let address = format!("127.0.0.1:{port}");
    // The message is that of the operating system.
    let in_use = UdpSocket::bind(&address).unwrap_err();
    let line = format!("{LIVE} --udp {port} --interface 127.0.0.1");
    folder.run(&line).assert_refused(1, &format!("error: UDP {address}: {in_use}"));
}

#[test]
fn truncated_captures_are_reported() {
    let folder = folder();
    let whole = std::fs::read(folder.path("drive.pcap")).unwrap();
    folder.write("ends.pcap", &whole[..whole.len() - 100]);
    let ran = folder.run(&format!("{LIVE} --pcap ends.pcap --stats"));
    assert_eq!(ran.code, 1, "{}", ran.err);
    assert!(ran.err.contains("753 packets; 0 lost"), "{}", ran.err);
    assert!(ran.err.contains("error: ends.pcap: "), "{}", ran.err);
    // The flag that more fragments follow, in the last frame, of 1248 bytes.
    let mut lost = whole.clone();
    let flags = lost.len() - 1248 + 20;
    lost[flags] = 0x20;
    folder.write("lost.pcap", lost);
    let ran = folder.run(&format!("{LIVE} --pcap lost.pcap --stats"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(ran.err.contains("753 packets, beside 1 without all fragments; 0 lost"), "{}", ran.err);
}

#[test]
fn a_closed_pipe_ends_live_silently() {
    folder().assert_closed_pipe_is_success(&format!("{LIVE} --pcap drive.pcap --realtime"));
}

#[test]
#[cfg(target_os = "linux")]
fn systemd_is_notified_of_ready_alive_and_stopping() {
    use std::{os::unix::net::UnixDatagram, path::Path};
    let folder = folder();
    let socket = folder.path("notify");
    let manager = UnixDatagram::bind(&socket).unwrap();
    manager.set_nonblocking(true).unwrap();
    let live = |socket: &Path, watchdog: &str| {
        let mut command = folder.command(&format!("{LIVE} --pcap drive.pcap"));
        command.env("NOTIFY_SOCKET", socket).env("WATCHDOG_USEC", watchdog).output().unwrap()
    };
    assert!(live(&socket, "10000000").status.success());
    let next = || {
        let mut buffer = [0; 256];
        manager.recv(&mut buffer).ok().map(|n| buffer[..n].to_vec())
    };
    let sent = std::iter::from_fn(next).map(|state| String::from_utf8(state).unwrap());
    let sent: Vec<_> = sent.collect();
    let [ready, alive, .., stopping] = &sent[..] else { panic!("{sent:?}") };
    assert_eq!(ready, "READY=1\nSTATUS=Waiting for packets\n");
    assert_eq!(alive, "WATCHDOG=1\nSTATUS=1 packet, 0 objects\n");
    assert_eq!(stopping, "STOPPING=1\n");
    // Half of the watchdog's time passes between two messages, and without a watchdog 5 s.
    assert!(sent.len() < 10, "{sent:?}");
    assert!(live(&socket, "none").status.success());
    let sent: Vec<_> = std::iter::from_fn(next).collect();
    assert_eq!(sent[1], b"STATUS=1 packet, 0 objects\n");
    let failed = live(Path::new("/nowhere/notify"), "10000000");
    let error = String::from_utf8_lossy(&failed.stderr);
    assert!(!failed.status.success() && error.contains("sending to NOTIFY_SOCKET"), "{error}");
}
