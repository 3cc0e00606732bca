//! The turns of a drive as the sweeps of a sequence of SemanticKITTI.

use anyhow::{Context, ensure};
use edgepuck_scenes::{AIR, Drive, Packet, Stage};
use formats::FormatError;
use glam::DVec3;
use sim_gpu::{Pose, glam};

use crate::gen_scenes::labels::{kind, semantic_class};
use crate::gen_scenes::sequence::Sequence;

/// A sequence that is being written.
pub struct Turns<'a> {
    stage: &'a Stage,
    sequence: Sequence,
    /// The number of the turn that the packets are in.
    turn: u32,
    positions: Vec<[f32; 3]>,
    intensity: Vec<f32>,
    labels: Vec<u32>,
    n_points: usize,
}

impl<'a> Turns<'a> {
    pub fn new(stage: &'a Stage, sequence: Sequence) -> Self {
        let (positions, intensity, labels) = Default::default();
        Self { stage, sequence, turn: 0, positions, intensity, labels, n_points: 0 }
    }

    /// Adds packet `number`, the next, and writes the turn before it if that is complete. Points are where
    /// the sensor would see them from its pose at the middle of the turn, as in KITTI's sweeps.
    pub fn add(&mut self, drive: &Drive<'_>, number: u32, packet: &Packet) -> anyhow::Result<()> {
        let scan = &packet.scan;
        let columns = (&scan.beam, &scan.object, &scan.intensity);
        let (Some(beams), Some(objects), Some(intensity)) = columns else {
            unreachable!("invariant: packets have these columns");
        };
        let origin_m = DVec3::from_array(scan.origin);
        let mut sensor = pose(drive, self.turn);
        for (i, position) in scan.positions.iter().enumerate() {
            let turn = drive.turn(number, beams[i]);
            if turn > self.turn {
                self.begin(turn)?;
                sensor = pose(drive, turn);
            }
            let at_m = origin_m + DVec3::from(position.map(f64::from));
            let seen_m = sensor.rotation.inverse() * (at_m - sensor.position_m);
            self.positions.push(seen_m.as_vec3().to_array());
            self.intensity.push(intensity[i]);
            self.labels.push(self.label(drive, objects[i])?);
        }
        Ok(())
    }

    /// Writes the turns before this one.
    fn begin(&mut self, turn: u32) -> Result<(), FormatError> {
        while self.turn < turn {
            let Self { positions, intensity, labels, .. } = &*self;
            self.sequence.add(self.turn as usize, positions, intensity, labels)?;
            self.n_points += self.positions.len();
            self.positions.clear();
            self.intensity.clear();
            self.labels.clear();
            self.turn += 1;
        }
        Ok(())
    }

    /// SemanticKITTI label: class in the low 16 bits, instance in the high 16.
    fn label(&self, drive: &Drive<'_>, object: u32) -> anyhow::Result<u32> {
        let Some(seen) = drive.object(object) else {
            let kind = if object == AIR { "air" } else { "ground" };
            return Ok(semantic_class(kind, false).into());
        };
        let cause =
            "expected a drive past at most 65535 objects, which labels can number: make it shorter";
        let instance = u16::try_from(object).context(cause)?;
        let entry = &self.stage.recipe().object[seen.placed.entry];
        let class = semantic_class(kind(entry), seen.velocity_m_s != DVec3::ZERO);
        Ok(u32::from(instance) << 16 | u32::from(class))
    }

    /// Writes the turns that are left, `n_turns` in all, and what is about all of them. Returns the number
    /// of points.
    pub fn finish(mut self, drive: &Drive<'_>, n_turns: u32) -> Result<usize, FormatError> {
        self.begin(n_turns)?;
        self.sequence.finish((0..n_turns).map(|turn| pose(drive, turn)), drive.period_s())?;
        Ok(self.n_points)
    }
}

/// The sensor's pose at the middle of a turn.
fn pose(drive: &Drive<'_>, turn: u32) -> Pose {
    drive.pose((f64::from(turn) + 0.5) * drive.period_s())
}

/// The number of whole turns in `seconds`.
pub fn whole_turns(drive: &Drive<'_>, seconds: f64) -> anyhow::Result<u32> {
    // Whole numbers of turns are rounded a little.
    let n_turns = (seconds / drive.period_s() + 1e-6) as u32;
    let (least, found) = (drive.period_s(), seconds);
    ensure!(
        n_turns > 0,
        crate::Usage(format!("--drive: expected at least {least}, found {found}"))
    );
    Ok(n_turns)
}
