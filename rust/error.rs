//! Error type of the core; `python/error.rs` converts errors to Python exceptions.

use std::fmt;
use std::io;
use std::path::PathBuf;

/// Errors of the core. Messages name the argument, the expected and the given value.
#[derive(Debug)]
pub enum Error {
    /// A value outside the accepted range.
    Value(String),
    /// A result that does not fit into memory.
    Memory(String),
    /// A calculation stopped by request.
    Interrupted,
    /// A file that violates its format.
    Format {
        /// The file.
        path: PathBuf,
        /// Line of the first fault, counted from 1.
        line: usize,
        /// Description of the fault.
        message: String,
    },
    /// A file that cannot be read.
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// Result of the core's functions.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// A bad value: `argument: expected ..., got ...`.
    pub fn value(argument: &str, expected: impl fmt::Display, got: impl fmt::Display) -> Self {
        Self::Value(format!("{argument}: expected {expected}, got {got}"))
    }
}

/// Check that a result of `shape` with `bytes` per entry fits into memory; otherwise allocation would abort the
/// process.
pub fn fits_memory(name: &str, shape: &[usize], bytes: usize) -> Result<()> {
    let total = shape
        .iter()
        .try_fold(bytes, |product, length| product.checked_mul(*length));
    let fits = total.is_some_and(|total| Vec::<u8>::new().try_reserve_exact(total).is_ok());
    if fits || shape.contains(&0) {
        Ok(())
    } else {
        Err(Error::Memory(format!(
            "{name}: {shape:?} with {bytes} bytes each do not fit into memory"
        )))
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Value(message) | Self::Memory(message) => f.write_str(message),
            Self::Interrupted => f.write_str("interrupted"),
            Self::Format { path, line, message } => write!(f, "{}:{line}: {message}", path.display()),
            Self::Io { path, source } => write!(f, "{}: {source}", path.display()),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            Self::Value(_) | Self::Memory(_) | Self::Interrupted | Self::Format { .. } => None,
        }
    }
}
