//! Outcome of a sum: what the counts of a frame say of it.

use super::stages::StageTimes;
use crate::paths::node_times::NodeTimes;

/// Statistics of a sum.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Node times of the group whose series is the worst.
    pub nodes: Option<NodeTimes>,
    /// Number of static paths.
    pub still_paths: usize,
    /// Velocity rows that were transformed.
    pub rows: usize,
    /// Velocity rows that no path touches.
    pub rows_skipped: usize,
    /// Half the length of the longest path that carries power [m].
    pub farthest: f64,
    /// Description of the plan, a line per group.
    pub plan: String,
    /// Run time of the stages.
    pub times: StageTimes,
}

impl Outcome {
    /// Add the statistics of another sum.
    pub fn add(&mut self, other: &Self) {
        let residual = |nodes: &Option<NodeTimes>| nodes.map_or(-1.0, |nodes| nodes.residual());
        if residual(&other.nodes) >= residual(&self.nodes) {
            self.nodes = other.nodes;
        }
        self.still_paths += other.still_paths;
        self.rows += other.rows;
        self.rows_skipped += other.rows_skipped;
        self.farthest = self.farthest.max(other.farthest);
        if !self.plan.is_empty() && !other.plan.is_empty() {
            self.plan.push('\n');
        }
        self.plan.push_str(&other.plan);
    }
}

/// Number of times in words.
pub(super) fn count_of_times(number: usize) -> String {
    format!("{number} time{}", if number == 1 { "" } else { "s" })
}
