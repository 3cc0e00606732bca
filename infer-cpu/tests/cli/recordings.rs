//! Recordings of `live`. `tests/peers/recordings.py` reads the messages with other software.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use mcap::MessageStream;
use mcap::read::Options;

use crate::live::{LIVE, folder, free_port, listen, terminate};
use crate::program::Folder;
use crate::street::{PACKET_S, packets, street};

/// The number of messages of each topic that can be read before the file ends or is damaged.
fn n_messages(folder: &Folder, name: &str) -> BTreeMap<String, usize> {
    let bytes = fs::read(folder.path(name)).unwrap_or_default();
    let mut counts = BTreeMap::new();
    let open_end = Options::IgnoreEndMagic;
    for message in MessageStream::new_with_options(&bytes, open_end.into()).into_iter().flatten() {
        let Ok(message) = message else { break };
        *counts.entry(message.channel.topic.clone()).or_default() += 1;
    }
    counts
}

#[test]
fn a_recording_has_a_cloud_and_the_objects_of_each_turn() {
    let folder = folder();
    let ran = folder.run(&format!("{LIVE} --pcap drive.pcap --mcap run.mcap"));
    let said = "run.mcap: 10 turns, 30 boxes of objects\n";
    assert_eq!((ran.code, ran.out.as_str(), ran.err.as_str()), (0, "", said));
    let per_turn = ["/points", "/objects", "/objects/markers"].map(|topic| (topic.to_owned(), 10));
    let mut expected = BTreeMap::from(per_turn);
    expected.insert("/tf_static".to_owned(), 1);
    assert_eq!(n_messages(&folder, "run.mcap"), expected);
    // The file ends with an index.
    let bytes = fs::read(folder.path("run.mcap")).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.stats.unwrap().message_count, 31);

    // With the motion of the sensor, there is one pose per turn.
    folder.write("drive.tum", "999 0 0 0 0 0 0 1\n2000 1001 0 0 0 0 0 1\n");
    let ran = folder.run(&format!("{LIVE} --pcap drive.pcap --mcap w.mcap --poses drive.tum"));
    assert_eq!(ran.code, 0);
    expected.insert("/tf".to_owned(), 10);
    assert_eq!(n_messages(&folder, "w.mcap"), expected);

    assert_eq!(folder.run(&format!("{LIVE} --pcap drive.pcap --mcap new/a.mcap")).code, 0);
    assert!(folder.path("new/a.mcap").exists());

    // A recording does not change the lines, and is the same in every run.
    let plain = folder.run(&format!("{LIVE} --pcap drive.pcap"));
    let both = folder.run(&format!("{LIVE} --pcap drive.pcap --json --mcap again.mcap"));
    assert_eq!(both.out, plain.out);
    assert!(fs::read(folder.path("again.mcap")).unwrap() == bytes);
}

/// Starts the program, sends 3.5 turns, and waits until it has recorded three.
fn recorded(folder: &Folder) -> Child {
    let port = free_port();
    let mut child = listen(folder, port, "--json --mcap run.mcap");
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    thread::spawn(move || lines.for_each(drop));
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    for packet in packets(&street(), 7, 264) {
        socket.send_to(&packet, ("127.0.0.1", port)).unwrap();
        thread::sleep(Duration::from_secs_f64(PACKET_S));
    }
    // An emulator is slow.
    while n_messages(folder, "run.mcap").get("/points") != Some(&3) {
        assert_eq!(child.try_wait().unwrap(), None, "it has ended");
        thread::sleep(Duration::from_millis(20));
    }
    child
}

#[test]
fn a_recording_of_a_killed_program_can_be_read() {
    let folder = Folder::new();
    let mut child = recorded(&folder);
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(n_messages(&folder, "run.mcap")["/points"], 3);
}

#[test]
fn sigterm_ends_a_recording_with_what_has_come() {
    let folder = Folder::new();
    let mut child = recorded(&folder);
    let (code, err) = terminate(&mut child);
    assert_eq!((code, err.lines().count()), (Some(0), 2), "{err}");
    assert!(err.starts_with("listening on UDP 127.0.0.1:"), "{err}");
    assert!(err.contains("run.mcap: 4 turns"), "{err}");
    assert_eq!(n_messages(&folder, "run.mcap")["/points"], 4);
    let bytes = fs::read(folder.path("run.mcap")).unwrap();
    assert!(mcap::Summary::read(&bytes).unwrap().is_some());
}

/// A file that may not grow further, as on a full disk.
#[test]
fn a_full_disk_ends_the_recording_and_not_the_answers() {
    let folder = folder();
    let plain = folder.run(&format!("{LIVE} --pcap drive.pcap"));
    let limited = |line: &str| {
        let command = folder.command(&format!("{LIVE} --pcap drive.pcap {line}"));
        let mut shell = Command::new("sh");
        // Files of 1 MiB at most, in blocks of 512 bytes.
        shell.args(["-c", "trap '' XFSZ; ulimit -f 2048; exec \"$@\"", "sh"]);
        shell.arg(command.get_program()).args(command.get_args());
        shell.current_dir(folder.path(".")).stdin(Stdio::null()).output().unwrap()
    };
    let ran = limited("--json --mcap run.mcap");
    let err = String::from_utf8(ran.stderr).unwrap();
    assert_eq!(ran.status.code(), Some(1), "{err}");
    assert!(String::from_utf8(ran.stdout).unwrap() == plain.out);
    let warning = "warning: the recording ends, the lines continue: run.mcap: ";
    assert!(err.starts_with(warning), "{err}");
    assert!(err.lines().last().unwrap().starts_with("error: run.mcap: "), "{err}");
    let whole_turns = n_messages(&folder, "run.mcap")["/points"];
    assert!((1..10).contains(&whole_turns), "{whole_turns}");

    // Without lines, the program ends with the recording.
    let ran = limited("--mcap only.mcap");
    let err = String::from_utf8(ran.stderr).unwrap();
    assert_eq!((ran.status.code(), err.lines().count()), (Some(1), 1), "{err}");
}
