//! A capture that is not whole is named, and makes nothing panic.

use std::fs;

use formats::vlp32c::{Returns, Revolution, count_returns, write};
use proptest::prelude::*;

use super::scan;

/// The bytes of a few packets.
fn capture() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.pcap");
    let revolution = Revolution { rpm: 600.0, n_beams: 800 };
    write(&path, &revolution, Returns::Strongest, &scan(&[(0, 5.0), (799, 6.0)])).unwrap();
    fs::read(&path).unwrap()
}

/// How many returns are counted in `bytes`, or why none are.
fn counted(bytes: &[u8]) -> Result<u64, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.pcap");
    fs::write(&path, bytes).unwrap();
    count_returns(&path).map_err(|error| error.to_string().split_once("x.pcap").unwrap().1.into())
}

#[test]
fn damage_is_named() {
    let whole = capture();
    assert_eq!(counted(&whole), Ok(2));
    let error = |bytes: &[u8]| counted(bytes).unwrap_err();
    assert!(error(b"").starts_with(": header: "));
    assert!(error(b"no capture, but long enough").contains("expected a little-endian capture"));
    assert_eq!(error(&whole[..whole.len() - 1]), ": packet 2: the file ends within it");
    let changed = |at: usize, byte: u8| {
        let mut bytes = whole.clone();
        bytes[at] = byte;
        error(&bytes)
    };
    let second = 24 + 16 + 1248;
    assert_eq!(
        changed(second + 8, 1),
        ": packet 1: expected a data packet of 1248 bytes, found another length"
    );
    assert_eq!(changed(second + 16 + 42, 0), ": packet 1: a block does not begin with its flag");
    assert_eq!(changed(second + 16 + 1246, 0), ": packet 1: unknown return mode");
    assert_eq!(
        changed(second + 16 + 1247, 0x22),
        ": packet 1: expected a VLP-32C, found another model"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_damage_makes_the_reader_panic(
        at in any::<prop::sample::Index>(), value in any::<u8>(), cut in any::<bool>(),
    ) {
        let mut bytes = capture();
        let at = at.index(bytes.len());
        if cut { bytes.truncate(at) } else { bytes[at] = value }
        let _ = counted(&bytes);
    }
}
