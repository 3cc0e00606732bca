//! The files of Edgepuck that its programs embed.

/// The built-in sensor profiles: a sensor's name and its TOML.
pub const SENSORS: [(&str, &str); 7] = [
    ("vlp32c", include_str!("sensors/vlp32c.toml")),
    ("blainder-ultrapuck", include_str!("sensors/blainder-ultrapuck.toml")),
    ("generic-static", include_str!("sensors/generic-static.toml")),
    ("kinect-v2", include_str!("sensors/kinect-v2.toml")),
    ("vlp16", include_str!("sensors/vlp16.toml")),
    ("hdl64e", include_str!("sensors/hdl64e.toml")),
    ("modelnet40c-lidar", include_str!("sensors/modelnet40c-lidar.toml")),
];

/// The record of `cargo xtask trade` that ships, as CSV: what `edgepuck advise`
/// recommends from.
pub const TRADE_RECORD: &str = include_str!("reports/trade/trade.csv");

/// The bundled default model, `edge-64`, as a model file's bytes.
pub const EDGE_64: &[u8] = include_bytes!("weights/edge-64.safetensors");
