//! Sum of a frame in lanes: points go from their evaluation into records block by block, all groups into one sum.

use super::groups::{Evaluate, EvaluateAt, Group, Groups};
use super::model::Model;
use super::outcome::{Outcome, count_of_times};
use super::parts::Part;
use super::stages::{StageTimes, timed};
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::Result;
use crate::numeric::parallel;
use crate::numeric::simd::{Isa, Kernel};
use crate::paths::kinematics::Kinematics;
use crate::paths::node_times::NodeTimes;
use crate::paths::placement::{Motion, Placement};
use crate::paths::rows::Rows;
use crate::paths::scatterers::{Members, Scatterers};
use crate::paths::series::Selection;
use crate::synthesis::beat::{LaneLayer, LaneSum, Options, Samples, SomePaths, Work, batch};
use crate::synthesis::block::{Block, CHUNK, Lane, SingleLane, expand, expand_single};
use crate::synthesis::delay::{Basis, PathSeries};
use crate::synthesis::lanes::{Batch, Builder, Coefficients, Errors, Tables};
use crate::synthesis::plan::Plan;

/// Paths that are evaluated together: their delays and amplitudes stay in the L2 cache.
const BLOCK: usize = 4 * CHUNK;

/// Numbers of times at which delays and amplitudes are evaluated: few where those suffice, and as many as records have
/// coefficients.
const FEW_TIMES: usize = 4;
const MANY_TIMES: usize = 8;

/// Paths of a group that are evaluated at many times, to see if few suffice.
const NUM_PROBES: usize = CHUNK;

/// Shares of the tolerance for phases and for amplitudes that few times leave out.
const SHARES: [f64; 2] = [0.1, 0.2];

/// Power of two that brings amplitudes of radars to the middle of single precision.
const SCALE: f64 = 1_073_741_824.0; // 2^30

/// Samples of the paths of some groups in a part of the frame; none where lanes are not the fastest or cannot reach the
/// tolerance.
pub(super) fn sum(
    groups: &Groups,
    some: &[&Group],
    model: &Model,
    placement: &Placement,
    part: &Part,
    cancel: &Cancel,
) -> Result<Option<(Samples, Outcome)>> {
    let num_paths = some.iter().map(|group| group.len()).sum();
    let options = model.options(num_paths, part.waveform.chirp_times.len());
    let still = some.iter().filter(|group| group.motion == Motion::Still);
    let work = Work {
        channels: model.array.num_channels(),
        paths: num_paths,
        still: still.map(|group| group.len()).sum(),
        terms: MANY_TIMES,
    };
    let Some(whole) = frame(part, [MANY_TIMES; 2]) else {
        return Ok(None);
    };
    if !LaneSum::is_wanted(&part.waveform, work, &options) {
        return Ok(None);
    }
    let mut times = StageTimes::default();
    let tables = Tables::new(&part.waveform, &whole, 0.0);
    let evaluation = Evaluation {
        groups,
        some,
        model,
        placement,
        part,
        cancel,
        options: &options,
        tables: &tables,
    };
    let plans = timed(&mut times.node_times, || evaluation.plans(&whole))?;
    let layers = timed(&mut times.paths, || evaluation.layers(&plans))?;
    let most = |at: usize| plans.iter().map(|plan| plan.times[at]).max().unwrap_or(1);
    let most = [most(0), most(1)];
    let sum = LaneSum {
        layers,
        scale: SCALE,
        tables: tables.clone(),
    };
    let errors = timed(&mut times.sum, || sum.errors(options.is_parallel));
    let done = timed(&mut times.sum, || sum.samples(&errors, &part.waveform, &options))?;
    Ok(done.map(|(samples, report)| {
        let outcome = outcome(&sum, &errors, most, &report.plan, times);
        (samples, outcome)
    }))
}

/// Root of the largest ratio of an error to the power, over the channels.
fn share(errors: &[Errors], error: impl Fn(&Errors) -> f64) -> f64 {
    let ratio = |errors: &Errors| error(errors) / errors.power.max(f64::MIN_POSITIVE);
    errors.iter().map(ratio).fold(0.0, f64::max).sqrt()
}

/// Block of all chirps for series through delays and amplitudes at numbers of times; none if such series cannot be
/// summed.
fn frame(part: &Part, times: [usize; 2]) -> Option<Block> {
    let (delay, amplitude) = (vec![&[][..]; times[0]], vec![&[][..]; times[1]]);
    let series = PathSeries {
        basis: Basis::Chebyshev,
        delay: &delay,
        amplitude: &amplitude,
        num_channels: 0,
        num_paths: 0,
    };
    let chirps = 0..part.waveform.chirp_times.len();
    let can_be_planned = series.can_be_planned(&part.waveform);
    can_be_planned.then(|| Block::new(&part.waveform, &series, chirps))
}

/// Statistics of a sum, with the largest numbers of times of delays and of amplitudes.
fn outcome(sum: &LaneSum, errors: &[Errors], most: [usize; 2], plan: &Plan, times: StageTimes) -> Outcome {
    let batches = || sum.layers.iter().flat_map(|layer| layer.batches.iter().flatten());
    let [delays, amplitudes] = most;
    let still = batches().map(|batch| batch.still.len()).sum::<usize>();
    let first = sum
        .layers
        .iter()
        .take(1)
        .flat_map(|layer| layer.batches.iter().flatten());
    let longest = first.map(|batch| batch.errors.longest).fold(0.0, f64::max);
    Outcome {
        nodes: Some(NodeTimes {
            delays,
            amplitudes,
            phase: share(errors, |errors| errors.further_phase),
            weight: share(errors, |errors| errors.further_amplitude),
        }),
        still_paths: still / errors.len().max(1),
        farthest: 0.5 * SPEED_OF_LIGHT * longest,
        plan: format!(
            "delays at {}, amplitudes at {}; {plan}",
            count_of_times(delays),
            count_of_times(amplitudes)
        ),
        times,
        ..Outcome::default()
    }
}

/// Times of a group, and what few times leave out.
struct GroupPlan {
    /// Numbers of times of delays and of amplitudes.
    times: [usize; 2],
    /// Squares of phases and of amplitudes that few times leave out, relative to the power, (channel, kind).
    left_out: Vec<[f64; 2]>,
}

/// Evaluation of some groups.
struct Evaluation<'a> {
    groups: &'a Groups,
    some: &'a [&'a Group],
    model: &'a Model,
    placement: &'a Placement,
    part: &'a Part,
    cancel: &'a Cancel,
    options: &'a Options<'a>,
    tables: &'a Tables,
}

/// Some paths of a group.
struct Task<'a> {
    number: usize,
    at: &'a EvaluateAt<'a>,
    selection: Selection,
}

impl Evaluation<'_> {
    /// Places of what a group needs at numbers of times.
    fn places<'a>(&'a self, group: &'a Group, times: [usize; 2]) -> EvaluateAt<'a> {
        let evaluate = Evaluate {
            model: self.model,
            placement: self.placement,
            groups: self.groups,
            group,
        };
        let [delays_at, amplitudes_at] = times.map(|number| self.part.node_times(number));
        evaluate.at(&delays_at, &amplitudes_at)
    }

    /// Times of every group: few where some of its paths at many times show that these suffice.
    fn plans(&self, whole: &Block) -> Result<Vec<GroupPlan>> {
        let num_channels = self.model.array.num_channels();
        let builder = Builder::new(self.tables, self.options.tolerance, [false; 2]);
        let plan = |group: &Group| {
            if group.motion == Motion::Still {
                return Ok(GroupPlan {
                    times: [1; 2],
                    left_out: vec![[0.0; 2]; num_channels],
                });
            }
            let last = group.len();
            let probes = Selection {
                first: 0,
                last,
                step: last.div_ceil(NUM_PROBES).max(1),
            };
            let at = self.places(group, [MANY_TIMES; 2]);
            let batches = self.batches(&at, probes, &builder, whole)?;
            // Twice what the coefficients beyond the few have: series through values fold them back.
            let left_out = |batch: &Batch| {
                let errors = &batch.errors;
                let power = errors.power.max(f64::MIN_POSITIVE);
                [4.0 * errors.beyond_third / power, 4.0 * errors.beyond_fourth / power]
            };
            let left_out: Vec<[f64; 2]> = batches.iter().map(left_out).collect();
            let mut times = [FEW_TIMES; 2];
            for kind in 0..2 {
                let allowed = (SHARES[kind] * self.options.tolerance).powi(2);
                if left_out.iter().any(|squares| squares[kind] > allowed) {
                    times[kind] = MANY_TIMES;
                }
            }
            Ok(GroupPlan { times, left_out })
        };
        let plans = parallel::map(self.options.is_parallel, self.some.to_vec(), plan);
        plans.into_iter().collect()
    }

    /// Records of all paths, by the power of the frequency.
    fn layers(&self, plans: &[GroupPlan]) -> Result<Vec<LaneLayer>> {
        let all = || self.some.iter().zip(plans);
        let places = parallel::map(self.options.is_parallel, all().collect(), |(group, plan)| {
            self.places(group, plan.times)
        });
        let frames: Vec<Option<Block>> = plans.iter().map(|plan| frame(self.part, plan.times)).collect();
        let mut tasks = Vec::new();
        for (number, (group, at)) in self.some.iter().zip(&places).enumerate() {
            let num_paths = group.len();
            for first in (0..num_paths).step_by(BLOCK) {
                let last = num_paths.min(first + BLOCK);
                let selection = Selection { first, last, step: 1 };
                tasks.push(Task { number, at, selection });
            }
        }
        let goes_on = |plan: &GroupPlan| plan.times.map(|number| number == MANY_TIMES);
        let builder = |plan| Builder::new(self.tables, self.options.tolerance, goes_on(plan));
        let builders: Vec<Builder> = plans.iter().map(builder).collect();
        let built = parallel::map(self.options.is_parallel, tasks, |task| {
            self.cancel.check()?;
            let number = task.number;
            // Blocks of fewer times can be had where those of more can.
            let Some(frame) = &frames[number] else {
                return Ok((number, Vec::new()));
            };
            Ok((number, self.batches(task.at, task.selection, &builders[number], frame)?))
        });
        let built: Vec<(usize, Vec<Batch>)> = built.into_iter().collect::<Result<_>>()?;

        let num_channels = self.model.array.num_channels();
        let last = self.some.iter().map(|group| group.order).max().unwrap_or(0);
        let mut layers: Vec<LaneLayer> = (0..=last)
            .map(|order| {
                let mut factors = self.part.waveform.over_frequency(order);
                factors.resize(self.part.waveform.num_samples, 1.0);
                LaneLayer {
                    batches: (0..num_channels).map(|_| Vec::new()).collect(),
                    factors,
                }
            })
            .collect();
        for (number, batches) in built {
            let (plan, layer) = (&plans[number], &mut layers[usize::from(self.some[number].order)]);
            for (channel, mut batch) in batches.into_iter().enumerate() {
                let (errors, left_out) = (&mut batch.errors, plan.left_out[channel]);
                if plan.times[0] == FEW_TIMES {
                    errors.further_phase = left_out[0] * errors.power;
                }
                if plan.times[1] == FEW_TIMES {
                    errors.further_amplitude = left_out[1] * errors.power;
                }
                layer.batches[channel].push(batch);
            }
        }
        Ok(layers)
    }

    /// Records of some paths, by channel.
    fn batches(&self, at: &EvaluateAt, selection: Selection, builder: &Builder, frame: &Block) -> Result<Vec<Batch>> {
        let num_channels = self.model.array.num_channels();
        let of_points = at.with_points(|scatterers, members, places| {
            self.options.level.run(BuildRecords {
                scatterers,
                members,
                places,
                selection,
                builder,
                frame,
            })
        });
        if let Some(batches) = of_points {
            return Ok(batches);
        }
        let paths = at.take(selection)?;
        let plane = num_channels * selection.len();
        let delay: Vec<&[f64]> = paths.delay.chunks(plane).collect();
        let amplitude: Vec<_> = paths.amplitude.chunks(plane).collect();
        let series = PathSeries {
            basis: Basis::Chebyshev,
            delay: &delay,
            amplitude: &amplitude,
            num_channels,
            num_paths: selection.len(),
        };
        let of_channel = |channel: usize| {
            let some = SomePaths {
                series: &series,
                channel,
                chunks: 0..selection.len().div_ceil(CHUNK),
                scale: SCALE,
            };
            batch(builder, frame, some, self.options)
        };
        Ok((0..num_channels).map(of_channel).collect())
    }
}

/// Records of some material points and point targets, chunk by chunk, of all channels.
struct BuildRecords<'a> {
    scatterers: &'a Scatterers,
    members: &'a Members,
    /// Places at the times of delays and of amplitudes.
    places: [&'a Kinematics<'a>; 2],
    selection: Selection,
    builder: &'a Builder<'a>,
    frame: &'a Block,
}

impl Kernel for BuildRecords<'_> {
    type Output = Vec<Batch>;

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) -> Vec<Batch> {
        let num_channels = self.scatterers.num_channels();
        let [delays, amplitudes] = self.places;
        let num_nodes = [delays.num_nodes, amplitudes.num_nodes];
        let is_still = num_nodes == [1; 2];
        let mut batches = vec![Batch::default(); num_channels];
        for batch in &mut batches {
            if is_still {
                batch.still.reserve(self.selection.len());
            } else {
                batch.moving.reserve(self.selection.len());
            }
        }
        let mut rows = Rows::<CHUNK>::new(num_channels, num_nodes);
        let mut delay: Vec<Lane> = vec![[0.0; CHUNK]; num_nodes[0]];
        let mut re: Vec<SingleLane> = vec![[0.0; CHUNK]; num_nodes[1]];
        let mut im = re.clone();
        let mut numbers = Vec::with_capacity(CHUNK);
        for first in (0..self.selection.len()).step_by(CHUNK) {
            numbers.clear();
            for place in first..self.selection.len().min(first + CHUNK) {
                let member = self.selection.first + place * self.selection.step;
                numbers.push(self.members.number(self.scatterers, member));
            }
            self.scatterers
                .rows::<I, CHUNK>(delays, amplitudes, &numbers, SCALE, &mut rows);
            for (channel, batch) in batches.iter_mut().enumerate() {
                let [at_delays, at_amplitudes] = [channel * num_nodes[0], channel * num_nodes[1]];
                let own = at_amplitudes..at_amplitudes + num_nodes[1];
                expand::<I>(
                    &self.frame.delay,
                    &rows.delay[at_delays..at_delays + num_nodes[0]],
                    &mut delay,
                );
                expand_single::<I>(&self.frame.amplitude, &rows.re[own.clone()], &mut re);
                expand_single::<I>(&self.frame.amplitude, &rows.im[own], &mut im);
                let paths = Coefficients {
                    len: numbers.len(),
                    delay: &delay,
                    re: &re,
                    im: &im,
                };
                self.builder
                    .add::<I>(&paths, if is_still { 0 } else { u128::MAX }, batch);
            }
        }
        batches
    }
}
