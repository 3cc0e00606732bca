//! A head of lasers that turns clockwise and fires in sequence, as Velodyne's.

use std::f64::consts::TAU;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{Rays, checked_ray_count};
use crate::config::{InvalidValue, finite, positive, within};

/// A table of beams on a turning head.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotating {
    /// Revolutions per minute.
    pub rpm: f64,
    /// From one firing sequence to the next, microseconds.
    pub sequence_us: f64,
    /// The encoder's azimuth is rounded to a multiple of this, degrees; exact
    /// where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub azimuth_quantum_deg: Option<f64>,
    /// The beams, in any order; those that fire at one time keep theirs.
    pub beam: Vec<Beam>,
}

/// One laser.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beam {
    /// The beam points to the encoder's azimuth less this, clockwise.
    pub azimuth_offset_deg: f64,
    /// Angle above the sensor's x-y plane.
    pub elevation_deg: f64,
    /// Time since the start of the sequence.
    pub firing_us: f64,
}

impl Rotating {
    /// Rays in one revolution: beams x period / sequence, rounded down, so
    /// that the last sequence may be cut short.
    #[must_use]
    pub fn rays_per_revolution(&self) -> u64 {
        // A float converts to an integer by saturation.
        (self.beam.len() as f64 * 60e6 / (self.rpm * self.sequence_us)) as u64
    }

    /// Seconds of one revolution.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        60.0 / self.rpm
    }

    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        positive("rotating.rpm", self.rpm)?;
        positive("rotating.sequence_us", self.sequence_us)?;
        if let Some(quantum_deg) = self.azimuth_quantum_deg {
            positive("rotating.azimuth_quantum_deg", quantum_deg)?;
        }
        if self.beam.is_empty() {
            return Err(InvalidValue::new("rotating.beam", "is empty"));
        }
        if self.beam.len() > usize::from(u16::MAX) {
            return Err(InvalidValue::new("rotating.beam", "more than 65535 beams"));
        }
        for (i, beam) in self.beam.iter().enumerate() {
            let key = |field: &str| format!("rotating.beam[{i}].{field}");
            within(&key("azimuth_offset_deg"), beam.azimuth_offset_deg, -360.0, 360.0)?;
            within(&key("elevation_deg"), beam.elevation_deg, -90.0, 90.0)?;
            finite(&key("firing_us"), beam.firing_us)?;
            if !(0.0..self.sequence_us).contains(&beam.firing_us) {
                let cause = format!("{} is not in 0..{}", beam.firing_us, self.sequence_us);
                return Err(InvalidValue::new(key("firing_us"), cause));
            }
        }
        checked_ray_count("rotating", self.rays_per_revolution())
    }

    /// The rays of one revolution, of which only each `keep_each`-th firing
    /// sequence is kept.
    pub(super) fn rays(&self, keep_each: u32) -> Rays {
        let mut firing_order: Vec<usize> = (0..self.beam.len()).collect();
        firing_order.sort_by(|&a, &b| self.beam[a].firing_us.total_cmp(&self.beam[b].firing_us));
        let rings = self.rings();
        let n_rays = self.rays_per_revolution();
        let n_beams = self.beam.len() as u64;
        let sequences = n_rays.div_ceil(n_beams);
        let kept_sequences = sequences.div_ceil(u64::from(keep_each));
        let mut rays = Rays::with_capacity((kept_sequences * n_beams) as usize);
        for sequence in (0..sequences).step_by(keep_each as usize) {
            let fired = (n_rays - sequence * n_beams).min(n_beams) as usize;
            for &beam in &firing_order[..fired] {
                let time_us = sequence as f64 * self.sequence_us + self.beam[beam].firing_us;
                let time_s = time_us * 1e-6;
                rays.push(self.direction(&self.beam[beam], time_s), rings[beam], time_s);
            }
        }
        rays
    }

    fn direction(&self, beam: &Beam, time_s: f64) -> DVec3 {
        let turned_rad = TAU * time_s / self.period_s();
        let encoder_rad = self.azimuth_quantum_deg.map_or(turned_rad, |quantum_deg| {
            let quantum_rad = quantum_deg.to_radians();
            (turned_rad / quantum_rad).round() * quantum_rad
        });
        let clockwise_rad = encoder_rad - beam.azimuth_offset_deg.to_radians();
        let (sin_azimuth, cos_azimuth) = clockwise_rad.sin_cos();
        let (sin_elevation, cos_elevation) = beam.elevation_deg.to_radians().sin_cos();
        DVec3::new(cos_elevation * cos_azimuth, -cos_elevation * sin_azimuth, sin_elevation)
    }

    /// For each beam its rank by elevation, from below.
    fn rings(&self) -> Vec<u16> {
        let mut by_elevation: Vec<usize> = (0..self.beam.len()).collect();
        by_elevation
            .sort_by(|&a, &b| self.beam[a].elevation_deg.total_cmp(&self.beam[b].elevation_deg));
        let mut rings = vec![0; self.beam.len()];
        for (rank, beam) in (0..).zip(by_elevation) {
            rings[beam] = rank;
        }
        rings
    }
}
