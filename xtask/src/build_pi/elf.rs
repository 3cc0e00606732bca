//! What an ELF file's headers tell about how it runs.
//!
//! Offsets and constants: System V ABI, chapters 4 and 5 (64-bit, little
//! endian), and `e_machine` of the ELF for the Arm 64-bit Architecture.

use anyhow::{Context, bail, ensure};

const MACHINE_AARCH64: u16 = 183;
const SEGMENT_INTERPRETER: u32 = 3;
const SECTION_SYMBOLS: u32 = 2;

/// That `file` is a program for 64-bit Arm which needs no library of the
/// system it runs on and carries no symbols.
pub fn check_static_stripped_aarch64(file: &[u8]) -> anyhow::Result<()> {
    // Class 2 is 64-bit, data 1 is little endian.
    ensure!(file.starts_with(b"\x7fELF\x02\x01"), "expected a 64-bit little-endian ELF file");
    let machine = u16_at(file, 18)?;
    ensure!(
        machine == MACHINE_AARCH64,
        "expected a program for aarch64, found ELF machine {machine}"
    );
    if types(file, 32, 54, 0)?.contains(&SEGMENT_INTERPRETER) {
        bail!("expected a static program, found one that is linked dynamically");
    }
    if types(file, 40, 58, 4)?.contains(&SECTION_SYMBOLS) {
        bail!("expected a stripped program, found a table of symbols");
    }
    Ok(())
}

/// The type, `offset` bytes into an entry, of each entry of a table of headers. The file
/// header says at `at` where the table starts, and at `size_at` how large entries are, their
/// number behind.
fn types(file: &[u8], at: usize, size_at: usize, offset: usize) -> anyhow::Result<Vec<u32>> {
    let start = usize::try_from(u64::from_le_bytes(bytes_at(file, at)?))?;
    let [size, count] = [u16_at(file, size_at)?, u16_at(file, size_at + 2)?].map(usize::from);
    let entry = |i| start.checked_add(i * size + offset).context(CUT_SHORT);
    (0..count).map(|i| Ok(u32::from_le_bytes(bytes_at(file, entry(i)?)?))).collect()
}

const CUT_SHORT: &str = "its headers are cut short";

fn u16_at(file: &[u8], at: usize) -> anyhow::Result<u16> {
    Ok(u16::from_le_bytes(bytes_at(file, at)?))
}

fn bytes_at<const N: usize>(file: &[u8], at: usize) -> anyhow::Result<[u8; N]> {
    file.get(at..).and_then(<[u8]>::first_chunk).copied().context(CUT_SHORT)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file header, one segment of this type and one section of that.
    fn elf(machine: u8, segment: u8, section: u8) -> Vec<u8> {
        let mut file = vec![0; 64 + 56 + 64];
        file[..6].copy_from_slice(b"\x7fELF\x02\x01");
        file[18] = machine;
        (file[32], file[54], file[56]) = (64, 56, 1);
        (file[40], file[58], file[60]) = (64 + 56, 64, 1);
        (file[64], file[64 + 56 + 4]) = (segment, section);
        file
    }

    #[test]
    fn tells_what_a_program_is_not() {
        let verdict =
            |file: &[u8]| check_static_stripped_aarch64(file).map_err(|error| error.to_string());
        assert_eq!(verdict(&elf(183, 1, 1)), Ok(()));
        assert!(verdict(&elf(62, 1, 1)).unwrap_err().contains("found ELF machine 62"));
        assert!(verdict(&elf(183, 3, 1)).unwrap_err().contains("dynamically"));
        assert!(verdict(&elf(183, 1, 2)).unwrap_err().contains("table of symbols"));
        assert!(verdict(b"MZ").unwrap_err().contains("expected a 64-bit"));
        assert!(verdict(&elf(183, 1, 1)[..100]).unwrap_err().contains("cut short"));
        let mut astray = elf(183, 1, 1);
        astray[32..40].fill(0xff);
        assert!(verdict(&astray).unwrap_err().contains("cut short"));
    }
}
