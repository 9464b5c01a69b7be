//! Counts, worst errors and run times of a frame.

use std::time::Instant;

use super::path_groups::{PathGroups, PathsAtNodes};
use super::rays::Rays;
use crate::constants::SPEED_OF_LIGHT;
use crate::paths::node_times::NodeTimes;
use crate::synthesis::report::Report;
use crate::synthesis::source::{PathSource, Shape};

/// Counts of rays and paths of a frame, summed over its spans, and the worst errors.
#[derive(Clone, Debug, Default)]
pub struct FrameCounts {
    /// Times at which rays were cast.
    pub casts: usize,
    /// Rays that were cast.
    pub rays_cast: usize,
    /// Rays that hit a body.
    pub rays_hit: usize,
    /// Tiles left out.
    pub tiles_skipped: usize,
    /// Tiles taken over from the frame before.
    pub tiles_reused: usize,
    /// Largest cross-section that the cells of any cast were refined for [m^2]; none without adaptive sampling.
    pub rcs_floor: Option<f64>,
    /// Cells of adaptive sampling that could be split further; none without adaptive sampling.
    pub cells_not_split: Option<usize>,
    /// Paths, also of several reflections.
    pub paths: usize,
    /// Hits that return nothing.
    pub paths_skipped: usize,
    /// Paths of several reflections.
    pub bounce_paths: usize,
    /// Rays from one surface to the next.
    pub bounce_rays: usize,
    /// Ray tubes that ended at the floor.
    pub bounces_stopped: usize,
    /// Cells of ray tubes that were not quartered, as there were too many.
    pub bounces_not_split: usize,
    /// Power of cells of ray tubes, and of the errors of unsplit ones, see [`crate::bounces::TubeCounts`].
    pub bounce_power: f64,
    /// The second of them.
    pub bounce_error_power: f64,
    /// Static paths.
    pub static_paths: usize,
    /// The most node times of all groups of paths, and the largest errors of the series through them.
    pub node_times: NodeTimes,
    /// Descriptions of the sums, a line per span.
    pub plan: Vec<String>,
    /// Distance of the farthest echo [m].
    pub farthest: f64,
    /// Error of phases by the series of the motion [rad].
    pub motion_error: f64,
    /// Numbers, in the scene, of the bodies and point targets in fast-varying motion, which needs more node times than
    /// the others'.
    pub fast_varying: Vec<usize>,
    /// Run time of every stage [s], by name.
    pub times: Vec<(&'static str, f64)>,
}

impl FrameCounts {
    /// Error of the paths of several reflections where tubes ran out, relative to their field (rms).
    pub fn bounce_error(&self) -> f64 {
        if self.bounce_power > 0.0 {
            (self.bounce_error_power / self.bounce_power).sqrt()
        } else {
            0.0
        }
    }

    /// Run a stage and add its run time.
    pub fn timed<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let done = work();
        let seconds = start.elapsed().as_secs_f64();
        match self.times.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, total)) => *total += seconds,
            None => self.times.push((stage, seconds)),
        }
        done
    }

    /// Add the counts of a span.
    pub fn add(&mut self, rays: &Rays, groups: &PathGroups, paths: &[PathsAtNodes], report: &Report) {
        self.casts += 1;
        let (rays, tiles) = (rays.samples.counts, &rays.samples.tiles);
        self.rays_cast += rays.rays;
        self.tiles_skipped += rays.tiles_skipped;
        self.tiles_reused += rays.tiles_reused;
        self.rays_hit += tiles.num_hit;
        self.paths_skipped += tiles.num_hit.saturating_sub(tiles.num_lit);
        if let Some(floor) = tiles.rcs_floor {
            self.rcs_floor = Some(self.rcs_floor.map_or(floor, |largest| largest.max(floor)));
        }
        if let Some(number) = tiles.num_coarse {
            *self.cells_not_split.get_or_insert(0) += number;
        }
        self.paths += groups.len();
        let (num_bounces, bounces) = groups.bounces;
        self.bounce_paths += num_bounces;
        self.bounce_rays += bounces.rays;
        self.bounces_stopped += bounces.stopped;
        self.bounces_not_split += bounces.coarse;
        self.bounce_power += bounces.power;
        self.bounce_error_power += bounces.error_power;
        let shapes = paths.iter().map(PathsAtNodes::shape).filter(Shape::is_static);
        self.static_paths += shapes.map(|shape| shape.paths).sum::<usize>();
        self.farthest = self.farthest.max(0.5 * SPEED_OF_LIGHT * report.longest);
        self.fast_varying.extend_from_slice(&groups.fast_varying);
        self.fast_varying.sort_unstable();
        self.fast_varying.dedup();
        if let Some(nodes) = paths.iter().map(|paths| paths.node_times).reduce(NodeTimes::max) {
            let [delays, amplitudes] = [nodes.delays, nodes.amplitudes].map(|n| match n {
                1 => "1 time".to_owned(),
                _ => format!("{n} times"),
            });
            self.plan
                .push(format!("delays at {delays}, amplitudes at {amplitudes}; {report}"));
            self.node_times = self.node_times.max(nodes);
        }
    }
}
