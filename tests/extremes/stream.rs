//! A cloud that comes as a stream of bytes, in KITTI's layout.

use std::io::{self, Read};
use std::path::Path;

use formats::cloud_file::{CloudFormat, read_cloud_from};

/// The n points of a stream.
pub fn read(n: usize) -> Vec<[f64; 3]> {
    let made = Made { left: n, next: 0, record: [0; 16], at: 16 };
    read_cloud_from(made, Some(CloudFormat::Kitti), Path::new("a stream"))
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Records of x, y, z and intensity, made as they are read.
struct Made {
    left: usize,
    next: usize,
    record: [u8; 16],
    at: usize,
}

impl Made {
    /// Weyl sequences of three irrational steps: spread evenly, and distinct.
    fn make(&mut self) {
        let at = |step: f64| ((self.next as f64 * step).fract() as f32).to_le_bytes();
        let fields = [at(0.819_172_5), at(0.671_043_6), at(0.549_700_4), [0; 4]];
        self.record.copy_from_slice(fields.as_flattened());
        (self.next, self.left, self.at) = (self.next + 1, self.left - 1, 0);
    }
}

impl Read for Made {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let mut n = 0;
        while n < out.len() {
            if self.at == self.record.len() {
                if self.left == 0 {
                    break;
                }
                self.make();
            }
            let taken = (out.len() - n).min(self.record.len() - self.at);
            out[n..n + taken].copy_from_slice(&self.record[self.at..][..taken]);
            (n, self.at) = (n + taken, self.at + taken);
        }
        Ok(n)
    }
}
