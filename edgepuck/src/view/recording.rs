//! Recordings (MCAP) of point clouds and detections as messages of ROS 2, such as those of `live --mcap`.

use super::MOST_FRAMES;
use super::frame::{Frame, Placed};
use anyhow::Context;
use formats::geometry::{OrientedBox, Pose};
use formats::{FormatError, Scan};
use glam::{DQuat, DVec3};
use mcap::{MessageStream, read::Options};
use std::{fs, path::Path};

/// A frame for each cloud in `file`, with the boxes of the detections that follow it.
pub fn read(file: &Path) -> anyhow::Result<Vec<Frame>> {
    let bytes = fs::read(file).map_err(|source| FormatError::io(file, source))?;
    let (mut frames, mut base) = (Vec::<Frame>::new(), Pose::IDENTITY);
    let cause = || format!("{}: expected a recording (MCAP) without compression", file.display());
    // A program that was killed leaves no end.
    let stream = MessageStream::new_with_options(&bytes, Options::IgnoreEndMagic.into());
    for message in stream.with_context(cause)? {
        let message = message.with_context(cause)?;
        let kind = message.channel.schema.as_ref().map_or("", |schema| &schema.name);
        if frames.len() == MOST_FRAMES && kind == "sensor_msgs/msg/PointCloud2" {
            program::say!("{}: the first {MOST_FRAMES} clouds are shown", file.display());
            break;
        }
        let mut cdr = Cdr { bytes: message.data.get(4..).unwrap_or_default(), at: 0 };
        let is_read = match kind {
            "sensor_msgs/msg/PointCloud2" => cdr.cloud().map(|scan| {
                let turn = frames.len() as u64;
                let frame = Frame::of_scan(format!("turn {turn}"), scan, Vec::new());
                frames.push(Frame { turn: Some(turn), ..frame });
            }),
            "vision_msgs/msg/Detection3DArray" => cdr.boxes(&base).map(|boxes| {
                if let Some(frame) = frames.last_mut() {
                    frame.pose = Some(base.matrix());
                    frame.boxes.extend(boxes);
                }
            }),
            "tf2_msgs/msg/TFMessage" => cdr.transform(&mut base),
            _ => Some(()),
        };
        is_read.with_context(|| format!("{}: expected a little-endian {kind}", file.display()))?;
    }
    Ok(frames)
}

/// Little-endian values, each at a multiple of its size.
struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cdr<'a> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let start = self.at.next_multiple_of(N);
        self.at = start + N;
        self.bytes.get(start..)?.first_chunk().copied()
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    fn blob(&mut self) -> Option<&'a [u8]> {
        let (n, start) = (self.u32()? as usize, self.at);
        self.at = start.checked_add(n)?;
        self.bytes.get(start..self.at)
    }

    fn text(&mut self) -> Option<String> {
        Some(String::from_utf8_lossy(self.blob()?).trim_end_matches('\0').to_owned())
    }

    /// The frame that a header names, after its time.
    fn header(&mut self) -> Option<String> {
        let _time = (self.u32()?, self.u32()?);
        self.text()
    }

    fn pose(&mut self) -> Option<Pose> {
        let position_m = DVec3::new(self.f64()?, self.f64()?, self.f64()?);
        let rotation = DQuat::from_xyzw(self.f64()?, self.f64()?, self.f64()?, self.f64()?);
        Some(Pose { position_m, rotation })
    }

    fn cloud(&mut self) -> Option<Scan> {
        let _size = (self.header()?, self.u32()?, self.u32()?);
        let mut fields = Vec::new();
        for _ in 0..self.u32()? {
            fields.push((self.text()?, self.u32()? as usize, self.take::<1>()?[0], self.u32()?));
        }
        let is_little = self.take::<1>()? == [0];
        let (step, _) = (self.u32()?.max(1) as usize, self.u32()?);
        let points = self.blob()?.chunks_exact(step);
        // Fields of f32 and u16 are those of types 7 and 4.
        let at = |name: &str, is: u8| {
            let found = fields.iter().find(|(of, _, kind, _)| of == name && *kind == is)?;
            (is_little && found.1.checked_add(if is == 7 { 4 } else { 2 })? <= step)
                .then_some(found.1)
        };
        let real = |name: &str| {
            let at = at(name, 7)?;
            let value = |point: &[u8]| point[at..].first_chunk().copied().map(f32::from_le_bytes);
            points.clone().map(value).collect::<Option<Vec<f32>>>()
        };
        let [x, y, z] = [real("x")?, real("y")?, real("z")?];
        let positions = (0..x.len()).map(|i| [x[i], y[i], z[i]]).collect();
        let mut scan = Scan { positions, ..Scan::default() };
        (scan.intensity, scan.time_s) = (real("intensity"), real("time"));
        let u16_of = |point: &[u8], at: usize| u16::from_le_bytes([point[at], point[at + 1]]);
        scan.ring = at("ring", 4).map(|at| points.map(|point| u16_of(point, at)).collect());
        let is_finite = |i: &usize| scan.positions[*i].iter().all(|x| x.is_finite());
        Some(scan.select(&(0..scan.len()).filter(is_finite).collect::<Vec<_>>()))
    }

    /// The boxes of detections from `base`, if their frame is the world's.
    fn boxes(&mut self, base: &Pose) -> Option<Vec<Placed>> {
        let (frame, mut boxes) = (self.header()?, Vec::new());
        for _ in 0..self.u32()? {
            let mut placed = Placed::default();
            self.header()?;
            for _ in 0..self.u32()? {
                (placed.class, placed.score) = (Some(self.text()?), Some(self.f64()?));
                (0..43).try_for_each(|_| self.f64().map(drop))?;
            }
            let pose = self.pose()?;
            let size_m = [self.f64()?, self.f64()?, self.f64()?];
            let yaw_rad = 2.0 * libm::atan2(pose.rotation.z, pose.rotation.w);
            let place = OrientedBox { centre_m: pose.position_m.to_array(), size_m, yaw_rad };
            placed.place = if frame == "world" { place.seen_from(base) } else { place };
            placed.track = self.text()?.parse().ok();
            boxes.push(placed);
        }
        Some(boxes)
    }

    /// Sets the pose of the vehicle in the world, if it is among the transforms.
    fn transform(&mut self, base: &mut Pose) -> Option<()> {
        for _ in 0..self.u32()? {
            let (parent, child, pose) = (self.header()?, self.text()?, self.pose()?);
            if [&*parent, &*child] == ["world", "base_link"] {
                *base = pose;
            }
        }
        Some(())
    }
}
