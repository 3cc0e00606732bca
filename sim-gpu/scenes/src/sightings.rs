//! The ground truth of a drive: the objects that the sensor saw in each revolution.

use serde::Serialize;

use crate::drive::{Drive, ObjectPoints, Packet, PointSum};

/// The ground truth of an object that the sensor saw during a revolution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sighting {
    /// The number of the revolution: how often the encoder had passed 0 before.
    pub turn: u32,
    /// The mean time of the points on the object, Unix time in seconds.
    pub time_s: f64,
    /// The number of the object, the same in every revolution.
    pub object: u32,
    /// Its class.
    pub class: String,
    /// The number of points on it.
    pub points: u32,
    /// The centre of its box in the world at `time_s`, metres.
    pub centre_m: [f64; 3],
    /// The length, width and height of its box, metres.
    pub size_m: [f64; 3],
    /// The rotation of its box about the vertical, degrees, counter-clockwise from x.
    pub yaw_deg: f64,
    /// Its velocity, metres a second.
    pub velocity_m_s: [f64; 3],
}

/// Collects the sightings of each revolution from the packets of a drive.
#[derive(Default)]
pub struct Sightings(ObjectPoints);

impl Sightings {
    /// Adds `packets` of `drive`, in order, and returns the sightings of the revolutions that are
    /// complete.
    pub fn add(&mut self, drive: &Drive, packets: &[Packet]) -> Vec<Sighting> {
        for (&key, points) in packets.iter().flat_map(|packet| &packet.points) {
            let sum = self.0.entry(key).or_default();
            sum.count += points.count;
            sum.time_s += points.time_s;
        }
        let last = self.0.keys().next_back().map_or(0, |&(turn, _)| turn);
        let incomplete = self.0.split_off(&(last, 0));
        let complete = std::mem::replace(&mut self.0, incomplete);
        Self(complete).finish(drive)
    }

    /// Returns the sightings of the last revolution.
    #[must_use]
    pub fn finish(self, drive: &Drive) -> Vec<Sighting> {
        self.0.into_iter().map(|(key, points)| sighting(drive, key, points)).collect()
    }
}

fn sighting(drive: &Drive, (turn, object): (u32, u32), points: PointSum) -> Sighting {
    let seen = drive.object(object).expect("invariant: points lie on objects of the street");
    let time_s = points.time_s / f64::from(points.count);
    let entry = &drive.street.stage.recipe().object[seen.placed.entry];
    Sighting {
        turn,
        time_s: f64::from(drive.start_s()) + time_s,
        object,
        class: entry.class.clone(),
        points: points.count,
        centre_m: seen.centre_m(time_s).to_array(),
        size_m: seen.size_m.to_array(),
        yaw_deg: seen.placed.yaw_rad.to_degrees(),
        velocity_m_s: seen.velocity_m_s.to_array(),
    }
}
