//! Run time of the stages of a frame.

use std::time::{Duration, Instant};

/// Time spent in every stage.
#[derive(Clone, Copy, Debug, Default)]
pub struct StageTimes {
    /// Motion as series, seen from the sensor.
    pub motion: Duration,
    /// Trees of bodies that deform, and rays.
    pub rays: Duration,
    /// Scatterers and paths of several reflections, in groups.
    pub scatterers: Duration,
    /// Choice of the node times.
    pub node_times: Duration,
    /// Delays and amplitudes at the node times, and the sum over paths.
    pub sum: Duration,
    /// Truth.
    pub truth: Duration,
}

impl StageTimes {
    /// Names and times [s], in the order of the stages.
    pub fn named(&self) -> [(&'static str, f64); 6] {
        [
            ("motion", self.motion),
            ("rays", self.rays),
            ("scatterers", self.scatterers),
            ("node times", self.node_times),
            ("sum over paths", self.sum),
            ("truth", self.truth),
        ]
        .map(|(name, time)| (name, time.as_secs_f64()))
    }
}

/// Run a function and add its run time to a total.
pub fn timed<T>(total: &mut Duration, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let done = work();
    *total += start.elapsed();
    done
}
