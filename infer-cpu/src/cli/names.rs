//! Lists of file names, one per line.

use std::borrow::Cow;
use std::io::{self, BufRead, Read};
use std::path::Path;

/// The longest path of any system. The limit keeps an endless line from filling the memory.
const LONGEST: u64 = 1 << 16;

/// Calls `take` with each name in `list`, as soon as its line has come. Empty lines and a carriage
/// return at the end of a line are ignored; a line that is too long is truncated.
pub fn for_each<E: From<io::Error>>(
    mut list: impl BufRead,
    mut take: impl FnMut(&Path) -> Result<(), E>,
) -> Result<(), E> {
    let mut line = Vec::new();
    while read_line(&mut list, &mut line)? {
        let name = line.strip_suffix(b"\r").unwrap_or(&line);
        if !name.is_empty() {
            take(Path::new(&*os_str(name)))?;
        }
    }
    Ok(())
}

/// Reads a line into `line`, without the newline and truncated to [`LONGEST`]. Returns false at the
/// end of the list.
fn read_line(list: &mut impl BufRead, line: &mut Vec<u8>) -> io::Result<bool> {
    line.clear();
    let n_read = list.by_ref().take(LONGEST).read_until(b'\n', line)?;
    if line.pop_if(|last| *last == b'\n').is_none() && n_read as u64 == LONGEST {
        list.skip_until(b'\n')?;
    }
    Ok(n_read > 0)
}

#[cfg(unix)]
fn os_str(bytes: &[u8]) -> Cow<'_, std::ffi::OsStr> {
    use std::os::unix::ffi::OsStrExt;
    Cow::Borrowed(std::ffi::OsStr::from_bytes(bytes))
}

#[cfg(not(unix))]
fn os_str(bytes: &[u8]) -> Cow<'_, std::ffi::OsStr> {
    match String::from_utf8_lossy(bytes) {
        Cow::Borrowed(name) => Cow::Borrowed(name.as_ref()),
        Cow::Owned(name) => Cow::Owned(name.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(list: &[u8]) -> Vec<String> {
        let mut names = vec![];
        for_each(io::BufReader::with_capacity(3, list), |name| {
            names.push(name.display().to_string());
            io::Result::Ok(())
        })
        .unwrap();
        names
    }

    #[test]
    fn a_line_is_a_name_blanks_and_all() {
        assert_eq!(names(b"a.ply\n\nb c.npz\r\n d"), ["a.ply", "b c.npz", " d"]);
        assert!(names(b"").is_empty() && names(b"\n\r\n").is_empty());
    }

    #[test]
    fn a_line_without_end_is_cut() {
        let names = names(&[&[b'x'; 3 * LONGEST as usize][..], b"\nlast\n"].concat());
        assert_eq!(names[0].len() as u64, LONGEST);
        assert_eq!(names[1..], ["last"]);
    }
}
