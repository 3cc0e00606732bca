//! Any bytes are an error or finite returns, no more than there are measurements, taken for a packet
//! of a Velodyne, or of an Ouster of any profile; and any metadata are an error or a decoder. The
//! first byte chooses.

#![no_main]

use std::path::Path;

use formats::ouster::{self, Metadata, Profile};
use formats::returns::Return;
use formats::velodyne::{self, Model};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((choice, content)) = bytes.split_first() else { return };
    let choice = usize::from(*choice) % (1 + Model::ALL.len() + Profile::ALL.len());
    if choice == 0 {
        let Ok(text) = str::from_utf8(content) else { return };
        let Ok(metadata) = Metadata::parse(text, Path::new("-")) else { return };
        let decoder = ouster::Decoder::new(&metadata);
        assert!(decoder.elevations_rad().is_sorted());
        // Valid where packets have one column: measurement 257 of a frame.
        let payload = vec![1; decoder.packet_size()];
        check(2 * 256, |each| decoder.decode(&payload, each).is_ok());
    } else if let Some(&model) = Model::ALL.get(choice - 1) {
        let packet = resized(content, 1206);
        check(12 * 32, |each| velodyne::Decoder::new(model).decode(&packet, each).is_ok());
    } else {
        let profile = Profile::ALL[choice - 1 - Model::ALL.len()];
        let decoder = ouster::Decoder::new(&metadata(profile));
        let packet = resized(content, decoder.packet_size());
        check(4 * 3 * 2, |each| decoder.decode(&packet, each).is_ok());
    }
});

/// That a packet gives finite returns, `most` of them, and none if it is an error.
fn check(most: usize, decode: impl FnOnce(&mut dyn FnMut(&Return)) -> bool) {
    let mut n = 0;
    let is_packet = decode(&mut |found| {
        n += 1;
        assert!(found.point_m.iter().all(|x| x.is_finite()) && found.after_us.is_finite());
    });
    assert!(n <= most && (is_packet || n == 0));
}

/// As long as packets are: few mutations leave that right.
fn resized(content: &[u8], length: usize) -> Vec<u8> {
    let mut packet = content.to_vec();
    packet.resize(length, 0);
    packet
}

fn metadata(profile: Profile) -> Metadata {
    let text = format!(
        r#"{{"beam_altitude_angles": [20, 0, -20], "beam_azimuth_angles": [3, 0, -3],
        "lidar_origin_to_beam_origin_mm": 15.8, "lidar_mode": "32x10",
        "lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36, 0, 0, 0, 1],
        "data_format": {{"columns_per_frame": 32, "columns_per_packet": 4,
        "pixels_per_column": 3, "udp_profile_lidar": "{profile}"}}}}"#
    );
    Metadata::parse(&text, Path::new("-")).expect("metadata that make sense")
}
