//! What decoders of packets give: one return of one beam.

/// One return of one beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// In the sensor's frame, metres: x forward, y left, z up.
    pub point_m: [f32; 3],
    /// As the sensor measured it, metres.
    pub range_m: f32,
    /// The laser's row, from the lowest elevation.
    pub ring: u16,
    /// The larger, the more light came back for the distance; the scale is the sensor's.
    pub reflectivity: u8,
    /// Microseconds after the packet's time.
    pub after_us: f64,
    /// Which of the beam's returns it is.
    pub kind: Kind,
}

/// Which of the returns of one beam.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The strongest; of an Ouster the first that its packet lists, which is the strongest unless
    /// the sensor is told another order.
    Strongest,
    /// The last.
    Last,
    /// The last, which is the strongest as well.
    Both,
    /// The second that the packet of an Ouster lists.
    Second,
}
