//! Errors of the core as Python exceptions.

use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyOSError, PyValueError};
use pyo3::prelude::*;

use crate::error::Error;

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match &error {
            Error::Value(_) | Error::Format { .. } => PyValueError::new_err(error.to_string()),
            Error::Memory(_) => PyMemoryError::new_err(error.to_string()),
            Error::Interrupted => PyKeyboardInterrupt::new_err(()),
            Error::Io { path, source } => match source.raw_os_error() {
                // Python picks the subclass (FileNotFoundError, ...) by the number.
                Some(code) => {
                    let text = source.to_string();
                    let reason = text.strip_suffix(&format!(" (os error {code})")).unwrap_or(&text);
                    PyOSError::new_err((code, reason.to_owned(), path.display().to_string()))
                }
                None => PyOSError::new_err(error.to_string()),
            },
        }
    }
}
