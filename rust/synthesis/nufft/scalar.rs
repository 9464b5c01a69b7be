//! Precisions of the grid: FFTs, and memory that is reused between sums.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::numeric::simd::Precision;

/// Precision of a grid.
pub trait Scalar: Precision {
    /// Numbers in a vector.
    const LANES: usize;
    /// Zeros, in memory that was given back if possible: fresh pages cost a tenth of a large sum.
    fn take_zeros(len: usize) -> Vec<Self>;
    /// Keep memory for [`Self::take_zeros`].
    fn give_back(memory: Vec<Self>);
    /// Memory that was given back.
    fn kept() -> MutexGuard<'static, Vec<Vec<Self>>>;
}

/// Largest number of grid cells, real numbers, that are kept for the next sum.
const MAX_KEPT: usize = 1 << 22;

/// Precision with a number of lanes.
macro_rules! scalar {
    ($scalar:ty, $lanes:literal) => {
        impl Scalar for $scalar {
            const LANES: usize = $lanes;

            fn take_zeros(len: usize) -> Vec<Self> {
                let mut memory = Self::kept().pop().unwrap_or_default();
                memory.clear();
                memory.resize(len, 0.0);
                memory
            }

            fn give_back(memory: Vec<Self>) {
                let mut kept = Self::kept();
                if kept.iter().map(Vec::capacity).sum::<usize>() + memory.capacity() <= MAX_KEPT {
                    kept.push(memory);
                }
            }

            fn kept() -> MutexGuard<'static, Vec<Vec<Self>>> {
                static KEPT: Mutex<Vec<Vec<$scalar>>> = Mutex::new(Vec::new());
                KEPT.lock().unwrap_or_else(PoisonError::into_inner)
            }
        }
    };
}

scalar!(f32, 16);
scalar!(f64, 8);
