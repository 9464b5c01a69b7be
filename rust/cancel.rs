//! Work in progress, seen from another thread: requests to stop it, and the number of steps that are done.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::error::{Error, Result};

/// Request to stop work in progress, asked for from another thread, and the progress of the work.
#[derive(Debug, Default)]
pub struct Cancel {
    is_asked: AtomicBool,
    num_done: AtomicUsize,
}

impl Cancel {
    /// Request a stop.
    pub fn ask(&self) {
        self.is_asked.store(true, Ordering::Relaxed);
    }

    /// True after a request to stop.
    pub fn is_asked(&self) -> bool {
        self.is_asked.load(Ordering::Relaxed)
    }

    /// An error after a request to stop.
    pub fn check(&self) -> Result<()> {
        if self.is_asked() {
            Err(Error::Interrupted)
        } else {
            Ok(())
        }
    }

    /// Count steps of the work that are done.
    pub fn advance(&self, number: usize) {
        self.num_done.fetch_add(number, Ordering::Relaxed);
    }

    /// Number of steps that are done.
    pub fn num_done(&self) -> usize {
        self.num_done.load(Ordering::Relaxed)
    }
}
