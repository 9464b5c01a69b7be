//! Pools of threads, one per number of threads.

use std::num::NonZero;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::cancel::Cancel;
use crate::error::{Error, Result};

/// Largest number of threads of a pool.
const MAX_THREADS: usize = 1024;

/// Pools of threads by their number, and the process they live in: a forked child has none of its parent's threads.
static POOLS: Mutex<(u32, Vec<Arc<ThreadPool>>)> = Mutex::new((0, Vec::new()));

/// Run a function without the interpreter, on `threads` threads or as many as there are cores.
pub(super) fn compute<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T> + Send,
) -> PyResult<T> {
    py.detach(|| pool(threads)?.install(work).map_err(PyErr::from))
}

/// Interval of the checks for signals.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// Run a function on a pool, while this thread, without the interpreter, waits for the result or for Ctrl-C, which asks
/// the function to stop. `report` is called from time to time, too.
pub(super) fn watch<T: Send>(
    pool: &ThreadPool,
    cancel: &Cancel,
    report: impl Fn(Python<'_>) -> PyResult<()> + Sync,
    work: impl FnOnce() -> Result<T> + Send,
) -> PyResult<T> {
    let (sender, receiver) = channel();
    let (mut raised, mut result) = (None, None);
    pool.in_place_scope(|scope| {
        scope.spawn(move |_| {
            // Nobody is there to receive only if the scope has panicked.
            let _ = sender.send(work());
        });
        loop {
            match receiver.recv_timeout(SIGNAL_INTERVAL) {
                Ok(done) => {
                    result = Some(done);
                    break;
                }
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => {
                    let heard = Python::attach(|py| py.check_signals().and_then(|()| report(py)));
                    if let Err(error) = heard {
                        cancel.ask();
                        raised = Some(error);
                    }
                }
            }
        }
    });
    match (raised, result) {
        (Some(error), _) => Err(error),
        (None, Some(result)) => Ok(result?),
        (None, None) => unreachable!("a panic of the work goes on from the scope"),
    }
}

/// Check that a pool may have this number of threads.
pub(super) fn check_threads(threads: Option<usize>) -> Result<()> {
    match threads {
        Some(number) if number == 0 || number > MAX_THREADS => {
            Err(Error::value("threads", format!("1 to {MAX_THREADS}"), number))
        }
        _ => Ok(()),
    }
}

/// Pool with this number of threads, or as many as there are cores; the last few are kept.
pub(super) fn pool(threads: Option<usize>) -> PyResult<Arc<ThreadPool>> {
    const MAX_KEPT: usize = 4;
    check_threads(threads)?;
    let num_threads = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, NonZero::get));
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if pools.0 != process {
        // Dropping the parent's pools would wait for threads that are not here.
        std::mem::forget(std::mem::take(&mut pools.1));
        pools.0 = process;
    }
    if let Some(pool) = pools.1.iter().find(|pool| pool.current_num_threads() == num_threads) {
        return Ok(pool.clone());
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(num_threads)
        .build()
        .map_err(|error| PyRuntimeError::new_err(format!("threads: {num_threads} cannot be started: {error}")))?;
    if pools.1.len() == MAX_KEPT {
        pools.1.remove(0);
    }
    pools.1.push(Arc::new(pool));
    Ok(pools.1[pools.1.len() - 1].clone())
}
