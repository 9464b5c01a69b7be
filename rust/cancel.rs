//! Requests to stop work that is in progress.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// Request to stop work in progress, asked for from another thread.
#[derive(Debug, Default)]
pub struct Cancel(AtomicBool);

impl Cancel {
    /// Request a stop.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// An error after a request to stop.
    pub fn check(&self) -> Result<()> {
        if self.0.load(Ordering::Relaxed) {
            Err(Error::Interrupted)
        } else {
            Ok(())
        }
    }
}
