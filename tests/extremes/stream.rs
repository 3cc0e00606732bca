//! A cloud as a stream of bytes in KITTI's layout.

use std::io::{self, Cursor, Read};
use std::path::Path;

use formats::cloud_file::{CloudFormat, read_cloud_from};

pub fn read(n: usize) -> Vec<[f64; 3]> {
    // Before the first record is an empty rest.
    let mut rest = Cursor::new([0; RECORD]);
    rest.set_position(RECORD as u64);
    read_cloud_from(Made { n, next: 0, rest }, Some(CloudFormat::Kitti), Path::new("a stream"))
        .unwrap_or_else(|error| panic!("{error}"))
        .points
}

/// Number of bytes of x, y, z and intensity.
const RECORD: usize = 16;

struct Made {
    n: usize,
    next: usize,
    rest: Cursor<[u8; RECORD]>,
}

impl Read for Made {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.rest.position() == RECORD as u64 && self.next < self.n {
            // Weyl sequences with three irrational steps are uniform and distinct.
            let at = |step: f64| ((self.next as f64 * step).fract() as f32).to_le_bytes();
            let fields = [at(0.819_172_5), at(0.671_043_6), at(0.549_700_4), [0; 4]];
            self.rest = Cursor::new(bytemuck::cast(fields));
            self.next += 1;
        }
        self.rest.read(out)
    }
}
