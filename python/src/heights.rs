//! Heights in pictures.

use crate::error::raised;
use crate::process;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2};
use png::{BitDepth, ColorType};
use pyo3::prelude::*;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// The grey values of a PNG of 16 bits, `[rows, columns]`, the upper row first.
#[pyfunction]
pub fn read_grey16(py: Python<'_>, file: PathBuf) -> PyResult<Bound<'_, PyArray2<u16>>> {
    let values = process::run(py, || grey16(&file))?;
    let values = values.map_err(|cause| raised(format!("{}: {cause}", file.display())))?;
    Ok(values.into_pyarray(py))
}

fn grey16(file: &Path) -> Result<Array2<u16>, String> {
    let opened = File::open(file).map_err(|cause| format!("cannot be read: {cause}"))?;
    let broken = |cause| format!("expected a PNG: {cause}");
    let mut reader = png::Decoder::new(BufReader::new(opened)).read_info().map_err(broken)?;
    let info = reader.info();
    if (info.color_type, info.bit_depth) != (ColorType::Grayscale, BitDepth::Sixteen) {
        return Err(format!(
            "expected a picture in grey with 16 bits a pixel, found {:?} with {} bits a sample",
            info.color_type, info.bit_depth as u8
        ));
    }
    if info.interlaced {
        return Err("expected a PNG without interlacing, found an interlaced one".to_owned());
    }
    let shape = (info.height as usize, info.width as usize);
    // The memory grows with what the file holds, whatever its header states.
    let mut values = Vec::new();
    while let Some(row) = reader.next_row().map_err(broken)? {
        values.extend(row.data().as_chunks().0.iter().map(|&bytes| u16::from_be_bytes(bytes)));
    }
    Array2::from_shape_vec(shape, values).map_err(|cause| format!("expected a PNG: {cause}"))
}
