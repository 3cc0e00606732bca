//! A return of a beam, as decoders of packets give it.

/// One return of one beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// The point in the sensor's frame, metres: x forward, y left, z up.
    pub point_m: [f32; 3],
    /// The measured range, metres.
    pub range_m: f32,
    /// The laser's row, from the lowest elevation.
    pub ring: u16,
    /// The reflectivity, on the scale of the sensor.
    pub reflectivity: u8,
    /// Microseconds after the packet's time.
    pub after_us: f64,
    /// Its place among the returns of the beam.
    pub kind: Kind,
}

/// The place of a return among those of its beam.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The strongest. For an Ouster, the first return in the packet, which is the strongest unless
    /// the sensor is configured otherwise.
    Strongest,
    /// The last.
    Last,
    /// The last and the strongest.
    Both,
    /// The second return in the packet of an Ouster.
    Second,
}
