//! A head of lasers that turns clockwise and fires in sequence, such as Velodyne's.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{BeamPattern, Rays, checked_ray_count};
use crate::config::{InvalidValue, positive, within};

/// A table of beams on a turning head.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotating {
    /// Revolutions per minute.
    pub rpm: f64,
    /// The period of firing sequences, microseconds.
    pub sequence_us: f64,
    /// The encoder's azimuth is rounded to a multiple of this, degrees, when a sequence starts, and
    /// grows from that value with the turning head, as packets encode azimuths; exact if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence_quantum_deg: Option<f64>,
    /// All beams cross at this distance in front of the axis, metres: a beam of elevation e starts
    /// on the axis `beam_crossing_m * tan(e)` below the sensor, and its range counts from there.
    /// Beams start at the sensor if this is absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beam_crossing_m: Option<f64>,
    /// Beams start at this distance from the axis, metres, in the direction that the encoder
    /// reads, and ranges count from there, as in Ouster's sensors. Excludes `beam_crossing_m`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beam_start_m: Option<f64>,
    /// The beams, in any order. Beams that fire at the same time keep this order.
    pub beam: Vec<Beam>,
}

/// One laser.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beam {
    /// The clockwise angle from the beam to the encoder's azimuth.
    pub azimuth_offset_deg: f64,
    /// Angle above the sensor's x-y plane, -90 to 90 degrees; with `beam_crossing_m`, -89 to 89.
    pub elevation_deg: f64,
    /// Time since the start of the sequence, from 0 to below `sequence_us`.
    pub firing_us: f64,
}

impl Rotating {
    /// The number of rays in one revolution: beams x period / sequence, rounded down, so that the
    /// last sequence may be incomplete.
    #[must_use]
    pub fn rays_per_revolution(&self) -> u64 {
        self.rays_in(1)
    }

    pub(super) fn rays_in(&self, revolutions: u32) -> u64 {
        let turns = f64::from(revolutions);
        // The conversion to an integer saturates.
        (turns * self.beam.len() as f64 * 60e6 / (self.rpm * self.sequence_us)) as u64
    }

    /// The period of a revolution, seconds.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        60.0 / self.rpm
    }

    /// Indices of `beam`, in the order in which the lasers fire.
    #[must_use]
    pub fn firing_order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.beam.len()).collect();
        order.sort_by(|&a, &b| self.beam[a].firing_us.total_cmp(&self.beam[b].firing_us));
        order
    }

    pub(super) fn validate(&self) -> Result<(), InvalidValue> {
        positive("rotating.rpm", self.rpm)?;
        positive("rotating.sequence_us", self.sequence_us)?;
        positive("rotating.sequence_quantum_deg", self.sequence_quantum_deg)?;
        within("rotating.beam_crossing_m", self.beam_crossing_m, 0.0..=1.0)?;
        within("rotating.beam_start_m", self.beam_start_m, 0.0..=1.0)?;
        if self.beam_crossing_m.and(self.beam_start_m).is_some() {
            let cause = "cannot stand beside rotating.beam_crossing_m";
            return Err(InvalidValue::new("rotating.beam_start_m", cause));
        }
        if !(1..=usize::from(u16::MAX)).contains(&self.beam.len()) {
            let cause = format!("expected 1 to {} beams, found {}", u16::MAX, self.beam.len());
            return Err(InvalidValue::new("rotating.beam", cause));
        }
        for (i, beam) in self.beam.iter().enumerate() {
            let key = |field: &str| format!("rotating.beam[{i}].{field}");
            within(&key("azimuth_offset_deg"), beam.azimuth_offset_deg, -360.0..=360.0)?;
            // The tangent of a beam along the axis is not finite.
            let steepest_deg = if self.beam_crossing_m.is_some() { 89.0 } else { 90.0 };
            within(&key("elevation_deg"), beam.elevation_deg, -steepest_deg..=steepest_deg)?;
            if !(0.0..self.sequence_us).contains(&beam.firing_us) {
                let (end, found) = (self.sequence_us, beam.firing_us);
                let cause = format!("expected a number within 0..{end}, found {found}");
                return Err(InvalidValue::new(key("firing_us"), cause));
            }
        }
        checked_ray_count("rotating", self.rays_per_revolution())
    }

    /// The rays of consecutive revolutions, with every `keep_each`-th firing sequence.
    pub(super) fn rays(&self, keep_each: u32, revolutions: u32) -> Rays {
        let n_rays = self.rays_in(revolutions);
        // At most 2^26, as `validate` checks.
        let sequences = 0..n_rays.div_ceil(self.beam.len() as u64) as u32;
        self.rays_of(sequences.step_by(keep_each as usize), n_rays)
    }

    /// The beams of these firing `sequences`: sequence n starts n x `sequence_us` after the head
    /// read azimuth 0, and times count from there.
    #[must_use]
    pub fn pattern_of(&self, sequences: Range<u32>) -> BeamPattern {
        self.rays_of(sequences, u64::MAX).into_pattern()
    }

    /// The rays of `sequences` whose numbers are below `n_rays`.
    fn rays_of(&self, sequences: impl ExactSizeIterator<Item = u32>, n_rays: u64) -> Rays {
        let firing_order = self.firing_order();
        let rings = self.rings();
        let n_beams = self.beam.len() as u64;
        let mut rays = Rays::with_capacity(sequences.len() * self.beam.len());
        for sequence in sequences {
            let fired = (n_rays - u64::from(sequence) * n_beams).min(n_beams) as usize;
            for &beam in &firing_order[..fired] {
                let laser = &self.beam[beam];
                let start_us = f64::from(sequence) * self.sequence_us;
                let time_s = (start_us + laser.firing_us) * 1e-6;
                let encoder_rad = self.encoder_rad(start_us * 1e-6, time_s);
                rays.push(direction(laser, encoder_rad), rings[beam], time_s);
                if let Some(crossing_m) = self.beam_crossing_m {
                    let below_m = crossing_m * libm::tan(laser.elevation_deg.to_radians());
                    rays.starts_m.push(DVec3::new(0.0, 0.0, -below_m));
                }
                if let Some(start_m) = self.beam_start_m {
                    let (sine, cosine) = libm::sincos(encoder_rad);
                    rays.starts_m.push(DVec3::new(cosine, -sine, 0.0) * start_m);
                }
            }
        }
        rays
    }

    fn encoder_rad(&self, start_s: f64, time_s: f64) -> f64 {
        let turned_rad = |time_s| TAU * time_s / self.period_s();
        let Some(quantum_deg) = self.sequence_quantum_deg else { return turned_rad(time_s) };
        let quantum_rad = quantum_deg.to_radians();
        let rounded_rad = (turned_rad(start_s) / quantum_rad).round() * quantum_rad;
        rounded_rad + turned_rad(time_s - start_s)
    }

    /// The rank of each beam by elevation, from below.
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

fn direction(laser: &Beam, encoder_rad: f64) -> DVec3 {
    let clockwise_rad = encoder_rad - laser.azimuth_offset_deg.to_radians();
    let (sin_azimuth, cos_azimuth) = libm::sincos(clockwise_rad);
    let (sin_elevation, cos_elevation) = libm::sincos(laser.elevation_deg.to_radians());
    DVec3::new(cos_elevation * cos_azimuth, -cos_elevation * sin_azimuth, sin_elevation)
}
