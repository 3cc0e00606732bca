//! A node of ROS 2 that publishes encoded messages.

use std::collections::BTreeMap;
use std::thread;
use std::time::Duration;

use anyhow::{Context as _, anyhow};
use program::outcome::Usage;
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, Node, NodeName, NodeOptions, QosProfile,
};
use serde::ser::{Serialize, SerializeTuple, Serializer};

use crate::input::Encoded;

/// The length of the CDR header, with version and options.
const ENCAPSULATION: usize = 4;
/// The number of messages that are kept for a slow subscriber, as in `rmw_qos_profile_default`.
const DEPTH: usize = 10;
/// The time for the last messages to arrive after the input ends.
const FAREWELL: Duration = Duration::from_millis(500);

pub struct Publisher {
    node: Node,
    topics: BTreeMap<String, ros2_client::Publisher<Body>>,
    /// Whether the warning about a slow subscriber was printed.
    has_warned: bool,
}

/// An encoded message, without its header.
struct Body(Vec<u8>);

/// A tuple, because CDR serializes it without a length and without padding between bytes.
impl Serialize for Body {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        self.0.iter().try_for_each(|byte| tuple.serialize_element(byte))?;
        tuple.end()
    }
}

impl Publisher {
    pub fn new(domain: u16, node: &str) -> anyhow::Result<Self> {
        let name = NodeName::new("/", node).map_err(|_| {
            Usage(format!("--node: expected letters, digits and _, found {node:?}"))
        })?;
        let options = ContextOptions::new().domain_id(domain);
        let node = Context::with_options(options)
            .map_err(|cause| anyhow!("DDS domain {domain}: {cause}"))?
            .new_node(name, NodeOptions::new().enable_rosout(false))
            .map_err(|cause| anyhow!("the node {node}: {cause:?}"))?;
        Ok(Self { node, topics: BTreeMap::new(), has_warned: false })
    }

    /// Publishes a message on its topic, which the first message creates. A subscriber that is too
    /// slow misses messages.
    pub fn publish(&mut self, message: Encoded) -> anyhow::Result<()> {
        let Encoded { topic, kind, mut cdr } = message;
        if !cdr.starts_with(&[0, 1, 0, 0]) {
            let found = &cdr[..cdr.len().min(ENCAPSULATION)];
            return Err(anyhow!("{topic}: expected plain CDR (0, 1, 0, 0), found {found:?}"));
        }
        cdr.drain(..ENCAPSULATION);
        if !self.topics.contains_key(&topic) {
            let publisher = self.announce(&topic, &kind)?;
            self.topics.insert(topic.clone(), publisher);
        }
        if let Err(cause) = self.topics[&topic].publish(Body(cdr))
            && !std::mem::replace(&mut self.has_warned, true)
        {
            eprintln!("warning: a message of {topic} was not sent, and others may not be: {cause}");
        }
        Ok(())
    }

    fn announce(
        &mut self,
        topic: &str,
        kind: &str,
    ) -> anyhow::Result<ros2_client::Publisher<Body>> {
        let name = Name::parse(topic).map_err(|cause| anyhow!("topic {topic:?}: {cause:?}"))?;
        let (package, kind) = kind
            .split_once("/msg/")
            .with_context(|| format!("{topic}: expected a type such as a/msg/B, found {kind:?}"))?;
        // Late subscribers need static frames, too (REP 105's /tf_static).
        let durability = match topic {
            "/tf_static" => Durability::TransientLocal,
            _ => Durability::Volatile,
        };
        let quality = QosProfile::publisher_default()
            .reliability_reliable(WhenFull::Fail)
            .durability(durability)
            .history(History::KeepLast { depth: DEPTH });
        let kind = MessageTypeName::new(package, kind);
        let described = self.node.create_topic(&name, kind, &quality);
        let described = described.map_err(|cause| anyhow!("topic {topic}: {cause}"))?;
        let publisher = self.node.create_publisher(&described, None);
        publisher.map_err(|cause| anyhow!("topic {topic}: {cause}"))
    }

    /// Waits until the last messages have had time to arrive.
    pub fn finish(self) {
        if !self.topics.is_empty() {
            thread::sleep(FAREWELL);
        }
    }
}
