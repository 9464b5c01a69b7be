//! Map over items on one thread or on the pool, with equal results.

use rayon::prelude::*;

/// Map `work` over items, in parallel or not. Returns the results in the order of the items.
pub fn map<T: Send, R: Send>(is_parallel: bool, items: Vec<T>, work: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
    if is_parallel && items.len() > 1 {
        items.into_par_iter().map(work).collect()
    } else {
        items.into_iter().map(work).collect()
    }
}
