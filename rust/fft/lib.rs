//! Inverse FFTs in single and double precision.
//!
//! A crate of its own, as rustfft is generic: a crate that calls its planner compiles all its kernels, which takes longer
//! than the rest of the core, once for every build of tests, benches and wheel, and again after every change.

use std::sync::{Arc, Mutex, PoisonError};

pub use rustfft::{Fft, FftNum};

/// Precision of a transform.
pub trait Precision: FftNum {
    /// Inverse FFT of a length, not scaled. Plans are made once per length.
    fn inverse_fft(len: usize) -> Arc<dyn Fft<Self>>;
}

macro_rules! precision {
    ($scalar:ty) => {
        impl Precision for $scalar {
            fn inverse_fft(len: usize) -> Arc<dyn Fft<Self>> {
                static PLANNER: Mutex<Option<rustfft::FftPlanner<$scalar>>> = Mutex::new(None);
                let mut planner = PLANNER.lock().unwrap_or_else(PoisonError::into_inner);
                planner
                    .get_or_insert_with(rustfft::FftPlanner::new)
                    .plan_fft_inverse(len)
            }
        }
    };
}

precision!(f32);
precision!(f64);
