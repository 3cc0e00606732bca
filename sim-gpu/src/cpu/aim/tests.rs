use super::*;
use crate::fixed_frame::fixed_direction;
use formats::rng::StreamKey;
use glam::{DMat3, DQuat, DVec3};

const U: f64 = 1.0 / 16_777_216.0;

/// The radius of the bounding sphere of a cube of side 2, with the margin of `Surface`.
const RADIUS: f64 = 1.732_050_807_6 + 1e-5;

struct Random(StreamKey, u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.1 += 1;
        self.0.unit(self.1)
    }

    fn point(&mut self) -> DVec3 {
        DVec3::from_array([(); 3].map(|()| 2.0 * self.unit() - 1.0))
    }
}

/// Sensors at all distances, on axes and elsewhere, turned anyhow, some mirrored.
pub fn sensors() -> Vec<(DVec3, DMat3)> {
    let mut random = Random(StreamKey::new(0, "sensors", 0), 0);
    let distances = [0.0, 1e-12, 0.3, 1.0, 1.5, RADIUS, 1.8, 2.0, 5.0, 40.0, 127.999_999];
    let mut sensors = Vec::new();
    for distance in distances {
        for axis in [
            DVec3::X,
            DVec3::NEG_Y,
            DVec3::Z,
            random.point().normalize(),
            random.point().normalize(),
        ] {
            let turn = DQuat::from_axis_angle(random.point().normalize(), 7.0 * random.unit());
            let mirror = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
            let turn = DMat3::from_quat(turn);
            sensors.extend([DMat3::IDENTITY, turn, turn * mirror].map(|m| (axis * distance, m)));
        }
    }
    sensors
}

/// Beams from the sensor through points in and around the object, and along axes.
pub fn beams(origin: DVec3, unit_from_sensor: &DMat3) -> Vec<DVec3> {
    let mut random = Random(StreamKey::new(0, "beams", 0), 0);
    let through = (0..200).map(|_| random.point() * 2.0 - origin);
    let through = through.map(|v| (unit_from_sensor.transpose() * v).normalize());
    through.chain(DVec3::AXES).chain(DVec3::AXES.map(|axis| -axis)).collect()
}

#[test]
fn rays_pass_the_true_ones_within_the_account() {
    for (origin, turn) in sensors() {
        for scale in [1e-30, 1.0, 1e30] {
            let fixed = FixedFrame::new(origin, &(turn * scale), RADIUS).unwrap();
            for beam in beams(origin, &turn) {
                let ray = fixed.aim(fixed_direction(beam));
                let start = ray.origin.map(f64::from);
                let start = DVec3::from_array(start) / f64::from(1 << 23);
                let direction = DVec3::from_array(ray.direction.map(f64::from)) * U;
                assert!((direction.length() - 1.0).abs() < 1.5 * U);
                // 4.5u and 1u for the start, 0.6u over each unit length, each axis.
                for (length, bound) in [(0.0, 5.5 * U), (3.55, (5.5 + 0.6 * 3.55) * U)] {
                    let aside = start + direction * length - origin;
                    let true_direction = turn * beam;
                    let aside = aside - true_direction * aside.dot(true_direction);
                    assert!(aside.abs().max_element() <= bound, "{aside} of {origin} {beam}");
                    // As a length, 8.2u and 3.7u (`intersect::DISPLACEMENT`).
                    let bound = if length == 0.0 { 8.2 } else { 8.2 + 3.7 };
                    assert!(aside.length() <= bound * U, "{aside} of {origin} {beam}");
                }
            }
        }
    }
}

#[test]
fn rays_start_before_their_object_and_near_it() {
    for (origin, turn) in sensors() {
        let fixed = FixedFrame::new(origin, &turn, RADIUS).unwrap();
        for beam in beams(origin, &turn) {
            let ray = fixed.aim(fixed_direction(beam));
            let direction = turn * beam;
            let along = -origin.dot(direction);
            let within = RADIUS * RADIUS - (origin + direction * along).length_squared();
            let skipped = f64::from(ray.skipped) / f64::from(1 << 20);
            let is_met = within >= 0.0 && along + within.sqrt() >= 0.0;
            if is_met {
                assert!(skipped <= (along - within.sqrt()).max(0.0));
                let start = DVec3::from_array(ray.origin.map(f64::from)) / f64::from(1 << 23);
                assert!(start.length() < 1.87, "{start} of {origin} {beam}");
            }
        }
    }
}

#[test]
fn poses_beyond_whole_numbers_are_left_to_f64() {
    let fixed = |origin, map: &DMat3| FixedFrame::new(origin, map, RADIUS);
    assert!(fixed(DVec3::X * 128.0, &DMat3::IDENTITY).is_some());
    for origin in [DVec3::X * 128.001, DVec3::splat(f64::NAN), DVec3::splat(f64::INFINITY)] {
        assert!(fixed(origin, &DMat3::IDENTITY).is_none());
    }
    let stretched = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 1.00001));
    let sheared = DMat3::from_cols(DVec3::X, DVec3::new(1e-6, 1.0, 0.0), DVec3::Z);
    for map in [stretched, sheared, DMat3::ZERO, DMat3::IDENTITY * f64::NAN] {
        assert!(fixed(DVec3::X, &map).is_none());
    }
    assert!(FixedFrame::new(DVec3::X, &DMat3::IDENTITY, 1.74).is_none());
}
