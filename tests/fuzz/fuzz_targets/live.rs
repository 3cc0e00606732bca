//! Whatever packets come, whenever they come: none makes the pipeline panic, hang or say
//! something that is no number.
//!
//! Each [`COMMAND`] bytes are one packet: a kind, and what it is made of. Random bytes alone would
//! hardly ever have the flags and the azimuths of a packet.

#![no_main]

use std::path::Path;

use infer_cpu::live::{Arrival, LiveOptions, Object, Pipeline, Pose, Trajectory};
use infer_cpu::Options;
use libfuzzer_sys::fuzz_target;

const MODEL: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/weights/street-bev.safetensors");
const COMMAND: usize = 16;

fuzz_target!(|bytes: &[u8]| {
    let Some((&choice, commands)) = bytes.split_first() else { return };
    let mut options = LiveOptions::default();
    if choice & 1 == 1 {
        let turned = Pose::at([30.0, 0.0, 1.0]).turned_deg(f64::from(choice), 5.0, 0.0);
        let poses = vec![(0.0, Pose::IDENTITY), (10.0, turned)];
        options.ego_motion = Some(Trajectory::new(poses).expect("finite poses"));
    }
    let model = Path::new(MODEL);
    let mut pipeline = Pipeline::open(model, &Options::default(), &options).expect("a model");
    for command in commands.as_chunks::<COMMAND>().0 {
        let time_s = f64::from_le_bytes(std::array::from_fn(|i| command[8 + i]));
        let time_s = if command[0] & 1 == 1 { time_s } else { f64::from(stamp_us(command)) * 1e-6 };
        pipeline.take(&packet(command), Arrival { time_s, moment: None });
        pipeline.answer(check);
    }
    pipeline.end();
    pipeline.answer(check);
});

fn stamp_us(command: &[u8; COMMAND]) -> u32 {
    u32::from_le_bytes([command[4], command[5], command[6], command[7]])
}

/// A packet of a VLP-16 or, seldom, of a VLP-32C, and seldom a damaged one.
fn packet(command: &[u8; COMMAND]) -> Vec<u8> {
    let [kind, returns, azimuth, distance, ..] = *command;
    let mut bytes = vec![0; 1206];
    for block in 0..12 {
        let at = &mut bytes[block * 100..][..100];
        let units = (usize::from(azimuth) * 141 + block * usize::from(command[8] / 4)) % 36_010;
        at[..2].copy_from_slice(&[0xff, 0xee]);
        at[2..4].copy_from_slice(&(units as u16).to_le_bytes());
        for (i, byte) in at[4..].iter_mut().enumerate() {
            *byte = distance.wrapping_add((i as u8).wrapping_mul(command[9]));
        }
    }
    bytes[1200..1204].copy_from_slice(&stamp_us(command).to_le_bytes());
    bytes[1204] = 0x37 + returns % 4;
    bytes[1205] = if kind >= 250 { 0x28 } else { 0x22 };
    if kind % 16 == 15 {
        bytes[usize::from(command[10]) * 4] ^= command[11];
        bytes.truncate(1206 - usize::from(command[12] / 128));
    }
    bytes
}

fn check(object: &Object) {
    let whole = object.whole_box.map(|whole| [whole.centre_m, whole.size_m]);
    let lengths = whole.into_iter().flatten().chain([object.position_m, object.size_m]);
    assert!(lengths.flatten().all(|x| x.is_finite()), "{object:?}");
    assert!(object.velocity_m_s.iter().flatten().all(|x| x.is_finite()), "{object:?}");
    assert!(object.yaw_deg.is_finite() && object.first_s <= object.last_s, "{object:?}");
}
