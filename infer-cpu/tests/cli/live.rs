//! `live`: objects from a capture and over the network.

use std::io::{BufRead, BufReader, Read};
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use serde_json::Value;

use crate::program::Folder;
use crate::street::{PACKET_S, PACKETS_PER_S, capture, packets, street};

pub const LIVE: &str = "live --model m.safetensors --threads 1";

/// The order of keys is part of the format.
const KEYS: [&str; 17] = [
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
    let start = std::time::Instant::now();
    let ran = folder().run(&format!("{LIVE} --pcap drive.pcap --realtime --json --stats"));
    assert!(start.elapsed() > Duration::from_millis(900));
    let latencies: Vec<_> = ran.json().iter().map(|o| o["latency_ms"].as_f64().unwrap()).collect();
    assert!(!latencies.is_empty() && latencies.iter().all(|ms| *ms > 0.0));
    for word in ["decode", "segment", "classify", "track", "latency, ms", "0 lost"] {
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
    let steady = folder.run(&format!("{LIVE} --pcap drive.pcap --twist 0 0 0 0 0 0")).json();
    assert_eq!(steady[0]["frame"], "world");
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
fn packets_over_the_network_are_answered_as_they_come_and_sigterm_ends_with_the_last_answers() {
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
    thread::sleep(Duration::from_millis(300));
    let (code, err) = terminate(&mut child);
    // A service without packets of its sensor does not fail.
    assert_eq!(code, Some(0));
    assert!(err.contains("5 from other addresses"), "{err}");
    let expected =
        "warning: expected packets of a VLP-16 or VLP-32C, found none among 5 UDP packets";
    assert!(err.contains(expected), "{err}");
}

#[test]
fn what_cannot_be_listened_to_is_named() {
    let folder = folder();
    folder.write("notes.txt", "no capture");
    folder.write("poses.tum", "1 2 3\n");
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let refused = |line: &str, code: i32, start: &str| {
        folder.run(&format!("{LIVE} {line}")).assert_refused(code, start);
    };
    refused("", 2, "error: the following required arguments were not provided");
    refused("--udp 2368 --pcap drive.pcap", 2, "error: the argument '--udp <PORT>' cannot be used");
    refused("--pcap absent.pcap", 1, "error: absent.pcap: ");
    refused("--pcap notes.txt", 1, "error: notes.txt: header: expected a capture, pcap or pcapng");
    refused(
        "--pcap drive.pcap --poses poses.tum",
        1,
        "error: poses.tum: line 1: expected 8 numbers (time, x y z, qx qy qz qw) or 12 (a matrix), found 3",
    );
    refused("--pcap drive.pcap --from 10.0.0.1", 2, "error: expected packets of a VLP-16");
    refused(
        "--pcap drive.pcap --twist 0 0 nan 0 0 0",
        2,
        "error: invalid value 'nan' for '--twist",
    );
    let address = format!("127.0.0.1:{port}");
    // The message is that of the operating system.
    let in_use = UdpSocket::bind(&address).unwrap_err();
    refused(
        &format!("--udp {port} --interface 127.0.0.1"),
        1,
        &format!("error: UDP {address}: {in_use}"),
    );
    refused("--udp 2368 --multicast 10.0.0.1", 1, "error: UDP 0.0.0.0:2368: ");
}

#[test]
fn a_reader_that_goes_away_ends_the_program_without_a_word() {
    let folder = folder();
    let mut command = folder.command(&format!("{LIVE} --pcap drive.pcap --realtime"));
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut first = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut first).unwrap();
    assert!(first.starts_with("{\"version\":1,"), "{first}");
    let mut err = String::new();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    assert_eq!((child.wait().unwrap().code(), err.as_str()), (Some(0), ""));
}
