//! Scans as PLY files, binary little-endian, with a `vertex` for each point.
//!
//! Properties: `x y z`, then `range` (float), `beam` (uint), `ring` (ushort),
//! `time` (float), `triangle` (uint), `object` (uint), `intensity` (float),
//! `nx ny nz` (float), if the scan has them. An origin other than 0 is the comment
//! `origin X Y Z`, and a pose other than the identity the comment `pose` with 16 numbers. Open3D 0.20 reads the properties of type float and
//! skips the others; from NPZ it reads all of them.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::elements::read_elements;
use crate::error::FormatError;
use crate::scan::{Attribute, ColumnSlot, Scan, whole};

/// Reads a scan, ASCII or binary, with properties in any order. Other properties are skipped.
pub fn read_scan(path: &Path) -> Result<Scan, FormatError> {
    let file = File::open(path).map_err(|source| FormatError::io(path, source))?;
    let (mut known, mut values) = (Vec::new(), Vec::new());
    let frame = read_elements(
        &mut BufReader::new(file),
        path,
        &["vertex"],
        |_, vertex| {
            let has = |attribute: &Attribute| {
                attribute.column_names().iter().all(|name| vertex.has(name))
            };
            known = Attribute::ALL.into_iter().filter(has).collect();
            let names = known.iter().flat_map(|attribute| attribute.column_names());
            ["x", "y", "z"].into_iter().chain(names).map(|name| vertex.scalar(name)).collect()
        },
        |_, row| values.extend_from_slice(row),
    )?;
    let width = 3 + known.iter().map(|attribute| attribute.column_names().len()).sum::<usize>();
    let rows = Rows { values: &values, width };
    let mut scan = Scan { pose: frame.pose, positions: rows.vectors(0), ..Scan::default() };
    scan.origin = frame.origin.unwrap_or_default();
    let mut first = 3;
    for attribute in known {
        let wrong =
            |cause: String| FormatError::malformed(path, format!("property {attribute}"), cause);
        match scan.slot(attribute) {
            ColumnSlot::F32(slot) => *slot = Some(rows.column(first).map(|x| x as f32).collect()),
            // Other numbers are intensities.
            ColumnSlot::U8(slot) if attribute == Attribute::Reflectivity => {
                *slot = rows.whole(first).ok();
            }
            ColumnSlot::U8(slot) => *slot = Some(rows.whole(first).map_err(wrong)?),
            ColumnSlot::U16(slot) => *slot = Some(rows.whole(first).map_err(wrong)?),
            ColumnSlot::U32(slot) => *slot = Some(rows.whole(first).map_err(wrong)?),
            ColumnSlot::Vector(slot) => *slot = Some(rows.vectors(first)),
        }
        first += attribute.column_names().len();
    }
    Ok(scan)
}

/// The numbers of all vertices, `width` for each.
struct Rows<'a> {
    values: &'a [f64],
    width: usize,
}

impl Rows<'_> {
    fn column(&self, at: usize) -> impl Iterator<Item = f64> {
        self.values.chunks_exact(self.width).map(move |row| row[at])
    }

    fn vectors(&self, first: usize) -> Vec<[f32; 3]> {
        let vector = |row: &[f64]| [0, 1, 2].map(|axis| row[first + axis] as f32);
        self.values.chunks_exact(self.width).map(vector).collect()
    }

    fn whole<T: TryFrom<u32>>(&self, at: usize) -> Result<Vec<T>, String> {
        self.column(at).map(whole).collect()
    }
}
