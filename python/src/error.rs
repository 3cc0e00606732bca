use pyo3::exceptions::PyValueError;
use pyo3::{PyErr, create_exception};
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
    raised(formats::outcome::joined_causes(&error))
}
