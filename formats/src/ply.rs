//! Scans as PLY files, binary little-endian, one `vertex` a point.
//!
//! Properties: `x y z`, then `range` (float), `beam` (uint), `ring` (ushort),
//! `time` (float), `triangle` (uint), `object` (uint), `intensity` (float),
//! `nx ny nz` (float), as far as the scan has them. An origin that is not 0 is
//! the comment `origin X Y Z`. Open3D 0.20 reads the properties of type float
//! and passes over the others; NPZ gives it all of them.

use std::fs::File;
use std::io::{BufReader, Write};
use std::path::Path;

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Header, Property, PropertyAccess, PropertyAccessResult};

use crate::atomic;
use crate::error::FormatError;
use crate::scan::{Attribute, Column, ColumnSlot, Scan};

const NORMAL_NAMES: [&str; 3] = ["nx", "ny", "nz"];

/// Writes `scan` to `path`, atomically.
///
/// # Errors
/// An attribute of another length than the positions; what the system reports.
pub fn write_scan(path: &Path, scan: &Scan) -> Result<(), FormatError> {
    scan.check_lengths()?;
    let columns: Vec<_> = scan.columns().map(|(_, column)| column).collect();
    atomic::write(path, |writer| {
        writer.write_all(header(scan).as_bytes())?;
        for (i, position) in scan.positions.iter().enumerate() {
            write_vector(writer, position)?;
            for column in &columns {
                match column {
                    Column::F32(values) => writer.write_all(&values[i].to_le_bytes())?,
                    Column::U16(values) => writer.write_all(&values[i].to_le_bytes())?,
                    Column::U32(values) => writer.write_all(&values[i].to_le_bytes())?,
                    Column::Vector(values) => write_vector(writer, &values[i])?,
                }
            }
        }
        Ok(())
    })
}

fn write_vector(writer: &mut impl Write, vector: &[f32; 3]) -> std::io::Result<()> {
    vector.iter().try_for_each(|component| writer.write_all(&component.to_le_bytes()))
}

fn header(scan: &Scan) -> String {
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    if scan.origin != [0.0; 3] {
        let [x, y, z] = scan.origin;
        header += &format!("comment origin {x} {y} {z}\n");
    }
    header += &format!("element vertex {}\n", scan.len());
    header += "property float x\nproperty float y\nproperty float z\n";
    for (attribute, column) in scan.columns() {
        match column {
            Column::F32(_) => header += &format!("property float {attribute}\n"),
            Column::U16(_) => header += &format!("property ushort {attribute}\n"),
            Column::U32(_) => header += &format!("property uint {attribute}\n"),
            Column::Vector(_) => {
                for name in NORMAL_NAMES {
                    header += &format!("property float {name}\n");
                }
            }
        }
    }
    header + "end_header\n"
}

/// Reads a scan from a PLY file, ASCII or binary, of any order of properties.
/// Properties of other names are passed over.
///
/// # Errors
/// No PLY file, no `x y z`, a number that does not fit its attribute, or fewer
/// vertices than promised: [`FormatError::Malformed`].
pub fn read_scan(path: &Path) -> Result<Scan, FormatError> {
    let bad = |part: &str, cause: String| FormatError::malformed(path, part, cause);
    let file = File::open(path).map_err(|source| FormatError::io(path, source))?;
    let mut reader = Reader::new(BufReader::new(file));
    let parser = Parser::<Vertex>::new();
    let header = parser.read_header(&mut reader).map_err(|e| bad("header", e.to_string()))?;
    let origin = origin(&header).map_err(|cause| bad("comment origin", cause))?;
    let mut vertices = None;
    for element in header.elements.values() {
        // They take no bytes, so that a header alone could promise any number.
        if element.properties.is_empty() {
            continue;
        }
        let read = parser
            .read_payload_for_element(&mut reader, element, &header)
            .map_err(|error| bad(&format!("element {}", element.name), error.to_string()))?;
        if element.name == "vertex" {
            vertices = Some((element, read));
            break;
        }
    }
    let (element, vertices) = vertices.ok_or_else(|| bad("element vertex", "missing".into()))?;
    let has = |name: &str| element.properties.contains_key(name);
    if let Some(name) = ["x", "y", "z"].into_iter().find(|name| !has(name)) {
        return Err(bad("element vertex", format!("no property {name}")));
    }
    let known = Attribute::ALL.into_iter().filter(|&attribute| match attribute {
        Attribute::Normal => NORMAL_NAMES.into_iter().all(has),
        other => has(other.name()),
    });
    let mut scan = gather(&vertices, known);
    scan.origin = origin;
    Ok(scan)
}

fn origin(header: &Header) -> Result<[f64; 3], String> {
    let Some(line) = header.comments.iter().find_map(|line| line.strip_prefix("origin ")) else {
        return Ok([0.0; 3]);
    };
    let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
    numbers
        .ok()
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("expected three numbers, found `{line}`"))
}

fn gather(vertices: &[Vertex], known: impl Iterator<Item = Attribute>) -> Scan {
    let mut scan =
        Scan { positions: vertices.iter().map(|v| v.position).collect(), ..Scan::default() };
    for attribute in known {
        let at = attribute as usize;
        match scan.slot(attribute) {
            ColumnSlot::F32(slot) => *slot = Some(vertices.iter().map(|v| v.reals[at]).collect()),
            ColumnSlot::U16(slot) => {
                *slot = Some(vertices.iter().map(|v| v.wholes[at] as u16).collect());
            }
            ColumnSlot::U32(slot) => *slot = Some(vertices.iter().map(|v| v.wholes[at]).collect()),
            ColumnSlot::Vector(slot) => *slot = Some(vertices.iter().map(|v| v.normal).collect()),
        }
    }
    scan
}

/// One element as the parser fills it, each attribute at its own index.
#[derive(Default)]
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    reals: [f32; Attribute::ALL.len()],
    wholes: [u32; Attribute::ALL.len()],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let slot = match name {
            "x" => &mut self.position[0],
            "y" => &mut self.position[1],
            "z" => &mut self.position[2],
            "nx" => &mut self.normal[0],
            "ny" => &mut self.normal[1],
            "nz" => &mut self.normal[2],
            _ => return self.set_attribute(name, &value),
        };
        set(slot, value.to_f32_lossy())
    }
}

impl Vertex {
    fn set_attribute(&mut self, name: &str, value: &Property) -> PropertyAccessResult {
        let Some(attribute) = Attribute::ALL.into_iter().find(|known| known.name() == name) else {
            return PropertyAccessResult::Ignored;
        };
        let at = attribute as usize;
        match attribute {
            Attribute::Range | Attribute::Time | Attribute::Intensity => {
                set(&mut self.reals[at], value.to_f32_lossy())
            }
            Attribute::Ring => {
                set(&mut self.wholes[at], whole(value).filter(|&n| n <= u32::from(u16::MAX)))
            }
            Attribute::Beam | Attribute::Triangle | Attribute::Object => {
                set(&mut self.wholes[at], whole(value))
            }
            Attribute::Normal => PropertyAccessResult::Ignored,
        }
    }
}

fn set<T>(slot: &mut T, value: Option<T>) -> PropertyAccessResult {
    match value {
        Some(value) => {
            *slot = value;
            PropertyAccessResult::Set
        }
        None => PropertyAccessResult::UnsupportedType,
    }
}

fn whole(value: &Property) -> Option<u32> {
    match *value {
        Property::UChar(n) => Some(n.into()),
        Property::UShort(n) => Some(n.into()),
        Property::UInt(n) => Some(n),
        Property::Char(n) => n.try_into().ok(),
        Property::Short(n) => n.try_into().ok(),
        Property::Int(n) => n.try_into().ok(),
        _ => None,
    }
}
