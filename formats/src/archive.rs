//! NPZ archives: named NumPy arrays in a zip file.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::SpooledTempFile;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipArchive, ZipWriter};

#[cfg(feature = "dataset")]
use crate::atomic;
use crate::decoding::invalid;
use crate::error::FormatError;
#[cfg(feature = "dataset")]
use crate::hash::{FileHash, Hashing};
use crate::npy::{self, Header};
use crate::number::Number;

/// Writes an uncompressed archive. The same arrays give the same bytes.
pub(crate) struct NpzWriter<W: Write + Seek> {
    zip: ZipWriter<W>,
}

impl<W: Write + Seek> NpzWriter<W> {
    pub fn write(writer: W, fill: impl FnOnce(&mut Self) -> io::Result<()>) -> io::Result<()> {
        let mut npz = Self { zip: ZipWriter::new(writer) };
        if let Err(error) = fill(&mut npz) {
            // Dropping it would try to end the archive and print a second error to stderr.
            std::mem::forget(npz.zip);
            return Err(error);
        }
        npz.zip.finish()?;
        Ok(())
    }

    /// Begins the array `key`; its `n_bytes`, header included, must follow.
    pub fn begin(&mut self, key: &str, n_bytes: u64) -> io::Result<&mut impl Write> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(n_bytes >= u64::from(u32::MAX))
            .last_modified_time(DateTime::default())
            .system(System::Unix)
            .unix_permissions(0o644);
        self.zip.start_file(format!("{key}.npy"), options)?;
        Ok(&mut self.zip)
    }

    /// Writes the array `key`, of `n` elements in C order.
    pub fn array<A: Number>(
        &mut self,
        key: &str,
        shape: &[usize],
        elements: impl ExactSizeIterator<Item = A>,
    ) -> io::Result<()> {
        // A header that this crate writes takes at most 128 bytes.
        let n_bytes = (size_of::<A>() * elements.len()) as u64 + 128;
        // Buffered, because zip computes a checksum for each write and elements come one by one.
        let mut writer = BufWriter::new(self.begin(key, n_bytes)?);
        npy::write_array(&mut writer, shape, elements)?;
        writer.flush()
    }

    /// Writes the array `key` of NumPy's fixed-width text (`<U`), which is read without pickle.
    pub fn text(&mut self, key: &str, lines: &[String]) -> io::Result<()> {
        // NumPy has no text of width 0.
        let width = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0).max(1);
        let header = npy::header_bytes(&format!("<U{width}"), &[lines.len()]);
        let n_bytes = header.len() as u64 + (lines.len() * width * 4) as u64;
        let mut writer = BufWriter::new(self.begin(key, n_bytes)?);
        writer.write_all(&header)?;
        for line in lines {
            for letter in line.chars().chain(std::iter::repeat('\0')).take(width) {
                writer.write_all(&u32::from(letter).to_le_bytes())?;
            }
        }
        writer.flush()
    }
}

/// Bytes of an archive that are kept in memory; a longer one goes to a file.
const IN_MEMORY: usize = 32 << 20;

/// A buffer for a file that must be complete before it is written. Beyond [`IN_MEMORY`] it becomes an
/// unnamed file in `folder`, which the system removes however the process ends.
pub(crate) fn waiting_room(folder: &Path) -> SpooledTempFile {
    tempfile::spooled_tempfile_in(IN_MEMORY, folder)
}

/// Writes the archive whose arrays `fill` writes to `path`, atomically; returns the file's hash.
///
/// The archive is completed in a buffer first, because the header of an entry is patched after the
/// entry, while hashing takes the bytes of the file in order.
#[cfg(feature = "dataset")]
pub(crate) fn write_archive(
    path: &Path,
    hashing: Hashing,
    fill: impl FnOnce(&mut NpzWriter<&mut SpooledTempFile>) -> io::Result<()>,
) -> Result<Option<FileHash>, FormatError> {
    let here = |source| FormatError::io(path, source);
    let mut archive = waiting_room(atomic::make_folder_of(path)?);
    NpzWriter::write(&mut archive, fill).map_err(here)?;
    archive.rewind().map_err(here)?;
    atomic::write_hashed(path, hashing, |writer| io::copy(&mut archive, writer).map(drop))
}

/// Reads an archive. Errors name the file and the key.
pub(crate) struct NpzReader<R: Read + Seek = BufReader<File>> {
    path: PathBuf,
    file_size: u64,
    zip: ZipArchive<R>,
}

/// An array's shape and its elements in C order.
pub(crate) struct Values<A> {
    pub shape: Vec<usize>,
    pub elements: Vec<A>,
}

impl NpzReader {
    pub fn open(path: &Path) -> Result<Self, FormatError> {
        let file = File::open(path).map_err(|source| FormatError::io(path, source))?;
        Self::new(BufReader::new(file), path)
    }
}

impl<R: Read + Seek> NpzReader<R> {
    pub fn new(mut reader: R, path: &Path) -> Result<Self, FormatError> {
        let file_size =
            reader.seek(SeekFrom::End(0)).map_err(|source| FormatError::io(path, source))?;
        let zip = ZipArchive::new(reader).map_err(|cause| {
            let mut start = [0; 2];
            let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
            let found = match file_size {
                0 => "an empty file".to_owned(),
                _ if read.is_ok() && start != *b"PK" => "a file of another format".to_owned(),
                _ => format!("{file_size} bytes: {cause}"),
            };
            let cause = format!("expected a whole NPZ file, found {found}");
            FormatError::malformed(path, "archive", cause)
        })?;
        Ok(Self { path: path.to_path_buf(), file_size, zip })
    }

    pub fn error(&self, key: &str, cause: impl ToString) -> FormatError {
        FormatError::malformed(&self.path, key, cause)
    }

    pub fn has(&self, key: &str) -> bool {
        self.zip.index_for_name(&format!("{key}.npy")).is_some()
    }

    /// The keys of all arrays, in the order of the archive.
    pub fn keys(&self) -> Vec<String> {
        let names = self.zip.file_names().filter_map(Result::ok);
        names.filter_map(|name| name.strip_suffix(".npy").map(str::to_owned)).collect()
    }

    pub fn array<A: Number>(&mut self, key: &str) -> Result<Values<A>, FormatError> {
        self.entry(key, |header, size, entry| {
            check_size(&header, size_of::<A>(), size)?;
            let elements = npy::read_elements(entry, &header)?;
            Ok(Values { shape: header.shape, elements })
        })
    }

    /// The array `key` of text, which is letters (`<U`) or bytes (`S`).
    pub fn text(&mut self, key: &str) -> Result<Vec<String>, FormatError> {
        self.entry(key, |header, size, entry| {
            let not_text = || {
                invalid(format!(
                    "expected a list of text, found {} of shape {:?}",
                    header.descr, header.shape
                ))
            };
            let (kind, width) = header.descr.split_at_checked(2).ok_or_else(not_text)?;
            let width: usize = width.parse().map_err(|_| not_text())?;
            let (letter_size, decode): (usize, Decode) = match kind {
                "<U" => (4, decode_letters),
                "|S" => (1, decode_bytes),
                _ => return Err(not_text()),
            };
            if width == 0 || header.shape.len() != 1 {
                return Err(not_text());
            }
            let line_size = width.checked_mul(letter_size);
            let line_size =
                line_size.ok_or_else(|| invalid("the text is wider than memory can hold"))?;
            check_size(&header, line_size, size)?;
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes)?;
            bytes.chunks_exact(line_size).map(decode).collect()
        })
    }

    /// Passes the array `key` to `read`: its header, the bytes that its elements take, their reader.
    pub fn entry<T>(
        &mut self,
        key: &str,
        read: impl FnOnce(Header, u64, &mut dyn Read) -> io::Result<T>,
    ) -> Result<T, FormatError> {
        let Self { path, file_size, zip } = self;
        let here = |cause: String| FormatError::malformed(path, key, cause);
        let mut entry = zip.by_name(&format!("{key}.npy")).map_err(|error| match error {
            zip::result::ZipError::FileNotFound => here("missing".to_owned()),
            other => here(other.to_string()),
        })?;
        // A deflated byte expands to at most 1032 bytes (zlib's technical notes).
        if entry.size() / 1032 > *file_size {
            return Err(here(format!(
                "the entry states {} bytes in a file of {file_size}",
                entry.size()
            )));
        }
        let size = entry.size();
        let header = npy::read_header(&mut entry).map_err(|error| here(error.to_string()))?;
        let size = size.saturating_sub(header.n_bytes as u64);
        let value = read(header, size, &mut entry.by_ref().take(size));
        let value = value.map_err(|error| here(error.to_string()))?;
        // Reading to the end of the entry compares the checksum.
        match io::copy(&mut entry, &mut io::sink()) {
            Ok(_) => Ok(value),
            Err(error) => Err(here(error.to_string())),
        }
    }
}

type Decode = fn(&[u8]) -> io::Result<String>;

fn check_size(header: &Header, element_size: usize, found: u64) -> io::Result<()> {
    let promised = header.n_elements().and_then(|n| n.checked_mul(element_size));
    if promised.is_some_and(|promised| promised as u64 == found) {
        return Ok(());
    }
    let (descr, shape) = (&header.descr, &header.shape);
    let cause = format!(
        "expected {element_size} bytes for each element of shape {shape:?}, \
         found {found} bytes of {descr}"
    );
    Err(invalid(cause))
}

fn decode_letters(bytes: &[u8]) -> io::Result<String> {
    let letters = bytes.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
    let line: Option<String> = letters.map(char::from_u32).collect();
    let line = line.ok_or_else(|| invalid("expected Unicode text"))?;
    Ok(line.trim_end_matches('\0').to_owned())
}

fn decode_bytes(bytes: &[u8]) -> io::Result<String> {
    let line = std::str::from_utf8(bytes).map_err(|_| invalid("expected UTF-8 text"))?;
    Ok(line.trim_end_matches('\0').to_owned())
}
