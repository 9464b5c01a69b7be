//! Pools of threads, one per number of threads.

use std::num::NonZero;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::cancel::Cancel;
use crate::error::{Error, Result};

/// Largest number of threads of a pool.
const MAX_THREADS: usize = 1024;

/// Pools of threads by their number, and the process they live in: a forked child has none of its parent's threads.
static POOLS: Mutex<(u32, Vec<Arc<ThreadPool>>)> = Mutex::new((0, Vec::new()));

/// Run a function without the interpreter, on `threads` threads or one per core, until Ctrl-C. `report`
/// receives the number of steps that are done, from time to time.
pub(super) fn compute<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    report: Option<&Py<PyAny>>,
    work: impl FnOnce(&Cancel) -> Result<T> + Send,
) -> PyResult<T> {
    let (pool, cancel) = (pool(threads)?, Cancel::default());
    py.detach(|| watch(&pool, &cancel, report, || work(&cancel)))
}

/// [`compute`] for work that owns its input. It is left behind where it does not end soon after Ctrl-C, as in code of
/// others that cannot be stopped, and ends at its next check.
pub(super) fn compute_owned<T: Send + 'static>(
    py: Python<'_>,
    report: Option<&Py<PyAny>>,
    work: impl FnOnce(&Cancel) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let (pool, cancel) = (pool(None)?, Arc::new(Cancel::default()));
    py.detach(|| {
        let ((sender, receiver), shared) = (channel(), cancel.clone());
        pool.spawn(move || {
            // Nobody is there to receive what was left behind.
            let _ = sender.send(catch_unwind(AssertUnwindSafe(|| work(&shared))));
        });
        let done = listen(&receiver, &cancel, report, PATIENCE)?;
        Ok(done.unwrap_or_else(|panic| resume_unwind(panic))?)
    })
}

/// Interval of the checks for signals.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// Time that work gets to end after Ctrl-C before it is left behind.
const PATIENCE: Duration = Duration::from_millis(500);

/// Run a function on a pool, while this thread, without the interpreter, waits for the result or for Ctrl-C, which asks
/// the function to stop. `report` receives the number of steps that are done, from time to time.
pub(super) fn watch<T: Send>(
    pool: &ThreadPool,
    cancel: &Cancel,
    report: Option<&Py<PyAny>>,
    work: impl FnOnce() -> Result<T> + Send,
) -> PyResult<T> {
    let (sender, receiver) = channel();
    // A panic of the work continues from the scope.
    pool.in_place_scope(|scope| {
        scope.spawn(move |_| {
            // Nobody is there to receive only if the scope has panicked.
            let _ = sender.send(work());
        });
        listen(&receiver, cancel, report, Duration::MAX)
    })
    .and_then(|done| Ok(done?))
}

/// Wait for a result or for Ctrl-C, which asks the work to stop and leaves it `patience` to do so.
fn listen<T>(receiver: &Receiver<T>, cancel: &Cancel, report: Option<&Py<PyAny>>, patience: Duration) -> PyResult<T> {
    let mut raised: Option<(PyErr, Instant)> = None;
    loop {
        match (receiver.recv_timeout(SIGNAL_INTERVAL), &raised) {
            (Ok(done), None) => return Ok(done),
            (Err(RecvTimeoutError::Timeout), None) => {
                let heard = Python::attach(|py| {
                    py.check_signals()?;
                    report.map_or(Ok(()), |report| report.call1(py, (cancel.num_done(),)).map(|_| ()))
                });
                if let Err(error) = heard {
                    cancel.ask();
                    raised = Some((error, Instant::now()));
                }
            }
            (Err(RecvTimeoutError::Timeout), Some((_, since))) if since.elapsed() < patience => {}
            _ => break,
        }
    }
    // Without an error nobody has sent anything: the work has panicked.
    Err(raised.map_or_else(
        || PyRuntimeError::new_err("the work has ended without a result"),
        |(error, _)| error,
    ))
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

/// Pool with this number of threads, or one per core; the last few are cached.
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
    let pool = Arc::new(new_pool(num_threads)?);
    if pools.1.len() == MAX_KEPT {
        pools.1.remove(0);
    }
    pools.1.push(pool.clone());
    Ok(pool)
}

/// Pool with this number of threads, which nobody else has.
pub(super) fn new_pool(num_threads: usize) -> PyResult<ThreadPool> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(num_threads)
        .build()
        .map_err(|error| PyRuntimeError::new_err(format!("threads: {num_threads} cannot be started: {error}")))
}
