//! Reads standard input: JSON lines or a recording.

use std::io::BufRead;

use anyhow::{Context, bail, ensure};
use edgepuck_ros_messages::{self as ros, Message};
use mcap::io::MessageReader;
use serde::Deserialize;

/// The supported version of the lines.
const VERSION: u32 = 1;

/// A message to publish.
pub struct Encoded {
    /// Its topic, such as `/objects`.
    pub topic: String,
    /// The name of its type, such as `sensor_msgs/msg/PointCloud2`.
    pub kind: String,
    /// The message as CDR with its encapsulation.
    pub cdr: Vec<u8>,
}

#[derive(Deserialize)]
struct Line {
    version: u32,
    #[serde(flatten)]
    object: ros::Object,
}

/// Passes each message of the input to `publish`, until the input ends.
pub fn read(
    mut input: impl BufRead,
    mut publish: impl FnMut(Encoded) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    match input.fill_buf().context("standard input")?.first() {
        None => Ok(()),
        Some(&byte) if byte == mcap::MAGIC[0] => read_recording(input, publish),
        Some(_) => read_lines(input, &mut publish),
    }
}

fn read_recording(
    input: impl BufRead,
    mut publish: impl FnMut(Encoded) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    for (number, message) in (1..).zip(MessageReader::new(input)) {
        let message = message.with_context(|| format!("standard input: message {number}"))?;
        let channel = &message.channel;
        let (topic, encoding) = (channel.topic.clone(), &channel.message_encoding);
        ensure!(encoding == "cdr", "{topic}: expected the encoding cdr, found {encoding}");
        let Some(schema) = &channel.schema else { bail!("{topic}: expected a schema, found none") };
        publish(Encoded { topic, kind: schema.name.clone(), cdr: message.data.into_owned() })?;
    }
    Ok(())
}

fn read_lines(
    input: impl BufRead,
    publish: &mut impl FnMut(Encoded) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut turn: Vec<ros::Object> = Vec::new();
    for (number, line) in (1..).zip(input.lines()) {
        let at = || format!("standard input: line {number}");
        let Line { version, object } =
            serde_json::from_str(&line.with_context(at)?).with_context(at)?;
        ensure!(version == VERSION, "{}: expected version {VERSION}, found {version}", at());
        if turn.last().is_some_and(|last| last.turn != object.turn) {
            publish_turn(&std::mem::take(&mut turn), publish)?;
        }
        turn.push(object);
    }
    publish_turn(&turn, publish)
}

fn publish_turn(
    turn: &[ros::Object],
    publish: &mut impl FnMut(Encoded) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    if turn.is_empty() {
        return Ok(());
    }
    publish(encoded("/objects", &ros::detections(turn)))?;
    publish(encoded("/objects/markers", &ros::markers(turn)))
}

fn encoded<M: Message>(topic: &str, message: &M) -> Encoded {
    Encoded { topic: topic.to_owned(), kind: M::NAME.to_owned(), cdr: message.to_cdr() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(turn: u64, class: &str) -> String {
        format!(
            r#"{{"version":1,"turn":{turn},"track":7,"class":{class},"resembles":null,
            "confidence":null,"probability":null,"frame":"sensor","position_m":[1.0,2.0,3.0],
            "size_m":[4.0,2.0,1.5],"yaw_deg":90.0,"velocity_m_s":null,"points":9,"range_m":2.2,
            "first_s":9.9,"last_s":10.25,"latency_ms":null}}"#
        )
        .replace('\n', " ")
    }

    fn published(input: &[u8]) -> anyhow::Result<Vec<Encoded>> {
        let mut all = Vec::new();
        read(input, |message| {
            all.push(message);
            Ok(())
        })?;
        Ok(all)
    }

    #[test]
    fn the_objects_of_a_turn_are_one_message() {
        let lines = [line(3, "\"car\""), line(3, "null"), line(4, "\"car\"")];
        let object = |i: usize| serde_json::from_str::<ros::Object>(&lines[i]).unwrap();
        let expected = [vec![object(0), object(1)], vec![object(2)]].map(|turn| {
            [
                ("/objects", "vision_msgs/msg/Detection3DArray", ros::detections(&turn).to_cdr()),
                (
                    "/objects/markers",
                    "visualization_msgs/msg/MarkerArray",
                    ros::markers(&turn).to_cdr(),
                ),
            ]
        });
        let all = published(lines.join("\n").as_bytes()).unwrap();
        let found = all.iter().map(|one| (&*one.topic, &*one.kind, one.cdr.clone()));
        assert_eq!(found.collect::<Vec<_>>(), expected.concat());
        assert!(published(b"").unwrap().is_empty());
    }

    #[test]
    fn input_that_is_neither_is_refused_by_its_line() {
        let refusal = |input: &str| format!("{:#}", published(input.as_bytes()).err().unwrap());
        let broken_off = format!("{}\n{}", line(3, "null"), &line(3, "null")[..40]);
        assert!(refusal(&broken_off).starts_with("standard input: line 2: EOF while parsing"));
        assert!(refusal("hello").starts_with("standard input: line 1: expected value"));
        let newer = line(3, "null").replace("\"version\":1", "\"version\":2");
        assert_eq!(refusal(&newer), "standard input: line 1: expected version 1, found 2");
        let mut recording = mcap::MAGIC.to_vec();
        recording.extend([1, 99, 0, 0, 0, 0, 0, 0, 0, 5]);
        let cause = format!("{:#}", published(&recording).err().unwrap());
        assert!(cause.starts_with("standard input: message 1: "), "{cause}");
    }
}
