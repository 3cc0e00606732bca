use pyo3::create_exception;
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use std::ffi::CString;
use std::fmt::Display;

create_exception!(
    edgepuck,
    Error,
    PyValueError,
    "A file, a mesh or a value that cannot be used. The message names it and says why."
);

pub fn raised(error: impl Display) -> PyErr {
    Error::new_err(error.to_string())
}

/// The exception for an error with causes.
pub fn raised_with_causes(error: anyhow::Error) -> PyErr {
    raised(program::outcome::joined_causes(&error))
}

/// The message of an error in flags, without their dashes: in Python they are arguments.
pub fn argument_error(error: &anyhow::Error) -> String {
    let text = program::outcome::joined_causes(error);
    let cause = text.split("\n\n").next().unwrap_or_default();
    let cause = cause.trim_start_matches("error: ").trim_end().replace("'--", "'");
    let in_python =
        |word: &str| word.strip_prefix("--").map_or(word.to_owned(), |flag| flag.replace('-', "_"));
    cause.split(' ').map(in_python).collect::<Vec<_>>().join(" ")
}

/// Gives each line to Python's `warnings`, for the line that called the package.
pub fn warn<Line: Display>(py: Python<'_>, lines: &[Line]) -> PyResult<()> {
    let category = py.get_type::<PyUserWarning>();
    let text = |line: &Line| CString::new(line.to_string().replace('\0', " ")).map_err(raised);
    lines.iter().try_for_each(|line| PyErr::warn(py, &category, &text(line)?, 2))
}
