//! Any bytes, taken for a capture, are an error or UDP packets no longer than the capture, with
//! finite times.

#![no_main]

use std::ops::ControlFlow;
use std::path::Path;

use formats::pcap::read_from;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut n = 0;
    let counts = read_from(bytes, Path::new("-"), |packet| {
        n += 1;
        assert!(packet.payload.len() <= bytes.len());
        assert!(packet.time_s.is_none_or(f64::is_finite));
        ControlFlow::Continue(())
    });
    if let Ok(counts) = counts {
        assert_eq!(counts.packets, n);
    }
});
