//! A look at paths before a sum: ranges of their delays and rates, their coherence by a few of them, and, where an
//! expansion needs them, moments of all.

use crate::cancel::Cancel;
use crate::error::Result;
use crate::numeric::parallel;
use crate::numeric::random::mix;
use crate::numeric::simd::{Isa, Kernel, Vector};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::{Block, CHUNK, Chunk};
use crate::synthesis::coherence::Coherence;
use crate::synthesis::report::Options;
use crate::synthesis::source::{PathGroup, PathSource, Request};

/// Paths that are looked at by one task.
const PART: usize = 64 * CHUNK;

/// Number of moments of a channel.
const NUM_MOMENTS: usize = 4;

/// Paths that coherence is estimated by.
const NUM_SAMPLED: usize = 256;

/// Least and largest of some numbers.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// Least number.
    pub low: f64,
    /// Largest number.
    pub high: f64,
}

impl Range {
    /// Range of no numbers.
    const EMPTY: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };

    /// Range of the numbers of both.
    fn join(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// Mean of both ends.
    pub fn middle(self) -> f64 {
        0.5 * (self.low + self.high)
    }

    /// Half of the length.
    pub fn half(self) -> f64 {
        0.5 * (self.high - self.low)
    }

    /// Largest magnitude.
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }
}

/// Ranges, moments and coherence of paths.
#[derive(Clone, Debug)]
pub struct Scan {
    /// Number of paths of a channel.
    pub num_paths: usize,
    /// Largest [gain](Coherence::gain) that the paths of a channel may have in phase, known or an estimate.
    pub coherence: f64,
    /// Ranges and moments of moving paths, if there are any.
    pub moving: Option<Moving>,
}

/// Ranges and moments of moving paths, whose delays are `c_0 + c_1 x`.
#[derive(Clone, Debug)]
pub struct Moving {
    /// Ranges of c_0 and c_1 [s].
    pub delay: [Range; 2],
    /// Per channel, sums over paths of the power times 1, c_1^2, c_1^4, d^2 c_1^2, with the distance d of c_0 from its
    /// middle; none if unknown.
    pub moments: Vec<[f64; NUM_MOMENTS]>,
}

impl Scan {
    /// Look at all delays, and at a few amplitudes.
    pub fn new(waveform: &Waveform, groups: &[PathGroup], scale: f64, options: &Options) -> Result<Self> {
        let mut scan = Self {
            num_paths: groups.iter().map(|group| group.source.shape().paths).sum(),
            coherence: options.known.coherence,
            moving: None,
        };
        if scan.coherence <= 1.0 {
            scan.coherence = sampled_coherence(waveform, groups, scan.num_paths, (scale, options));
        }
        for group in groups.iter().filter(|group| !group.source.shape().is_static()) {
            for (_, part) in Look::parts(waveform, group.source, (scale, options), None) {
                let moving = scan.moving.get_or_insert_with(|| Moving {
                    delay: [Range::EMPTY; 2],
                    moments: Vec::new(),
                });
                for k in 0..2 {
                    moving.delay[k] = moving.delay[k].join(part.delay[k]);
                }
            }
            options.cancel.map_or(Ok(()), Cancel::check)?;
            let is_finite = |moving: &Moving| moving.delay.iter().all(|range| (range.high - range.low).is_finite());
            if !scan.moving.as_ref().is_none_or(is_finite) {
                return Err(group.source.not_finite());
            }
        }
        Ok(scan)
    }

    /// Look at all amplitudes of moving paths.
    pub fn add_moments(
        &mut self,
        waveform: &Waveform,
        groups: &[PathGroup],
        scale: f64,
        options: &Options,
    ) -> Result<()> {
        let Some(moving) = &mut self.moving else {
            return Ok(());
        };
        moving.moments = vec![[0.0; NUM_MOMENTS]; groups[0].source.shape().channels];
        for group in groups.iter().filter(|group| !group.source.shape().is_static()) {
            let middle = Some(moving.delay[0].middle());
            for (channel, part) in Look::parts(waveform, group.source, (scale, options), middle) {
                for (sum, moment) in moving.moments[channel].iter_mut().zip(part.moments) {
                    *sum += moment;
                }
            }
        }
        options.cancel.map_or(Ok(()), Cancel::check)
    }
}

/// Estimate of the coherence by some paths of the first channel, spread evenly; of all of them if they are few.
fn sampled_coherence(
    waveform: &Waveform,
    groups: &[PathGroup],
    num_paths: usize,
    (scale, options): (f64, &Options),
) -> f64 {
    let mut cells = Coherence::new(waveform.chirp_times.len(), waveform.num_samples);
    let turns = turns(waveform);
    let num_sampled = num_paths.min(NUM_SAMPLED);
    let bound = |i: usize| (i as u128 * num_paths as u128 / num_sampled as u128) as usize;
    // One path of each of as many equal parts, at a pseudo-random place.
    let mut places = (0..num_sampled).map(|i| {
        let (low, high) = (bound(i), bound(i + 1));
        low + (mix(i as u64) % (high - low).max(1) as u64) as usize
    });
    let (mut first, mut next) = (0, places.next());
    for group in groups {
        let shape = group.source.shape();
        let block = Block::new(waveform, &shape, 0..waveform.chirp_times.len());
        let mut chunk = Chunk::<f64>::new(&shape, 1);
        while let Some(place) = next.filter(|place| *place < first + shape.paths) {
            let request = Request {
                channels: 0..1,
                paths: place - first..place - first + 1,
                scale,
                level: options.level,
            };
            group.source.fill_double(&request, &mut chunk);
            let (mut delay, mut rate) = (chunk.delay[0][0], 0.0);
            if !shape.is_static() {
                delay += block.delay[0][1] * chunk.delay[1][0];
                rate = block.delay[1][1] * chunk.delay[1][0];
            }
            cells.add(turns[0] * delay, turns[1] * rate, chunk.re[0][0].hypot(chunk.im[0][0]));
            next = places.next();
        }
        first += shape.paths;
    }
    if num_sampled == num_paths {
        return cells.gain(1);
    }
    // Of each path n of N are sampled, and so are pairs.
    let pairs = (num_paths - 1) as f64 / (num_sampled - 1) as f64;
    let beyond = cells.gain(1).powi(2) - 1.0;
    (1.0 + pairs * beyond).sqrt()
}

/// Turns of phase from sample to sample per c_0, and over the frame per c_1.
pub fn turns(waveform: &Waveform) -> [f64; 2] {
    let frequency = waveform.start_frequency + waveform.slope * waveform.middle_time();
    [waveform.slope / waveform.sample_rate, 2.0 * frequency]
}

/// Ranges and moments of a part of the paths of a channel.
struct Part {
    delay: [Range; 2],
    moments: [f64; NUM_MOMENTS],
}

/// Look at the moving paths of a group.
struct Look<'a> {
    source: &'a dyn PathSource,
    /// Weights of the second row of the delay in c_0 and c_1.
    weights: [f64; 2],
    /// Middle delay of the moments; none without them.
    middle: Option<f64>,
    scale: f64,
    options: &'a Options<'a>,
}

impl Look<'_> {
    /// All parts, with their channels.
    fn parts(
        waveform: &Waveform,
        source: &dyn PathSource,
        (scale, options): (f64, &Options),
        middle: Option<f64>,
    ) -> Vec<(usize, Part)> {
        let shape = source.shape();
        let block = Block::new(waveform, &shape, 0..waveform.chirp_times.len());
        let weight = |degree: usize| block.delay.get(degree).map_or(0.0, |row| row[1]);
        let look = Look {
            source,
            weights: [weight(0), weight(1)],
            middle,
            scale,
            options,
        };
        let firsts = (0..shape.paths).step_by(PART);
        let tasks: Vec<_> = firsts
            .flat_map(|first| (0..shape.channels).map(move |c| (c, first)))
            .collect();
        parallel::map(options.is_parallel, tasks, |(channel, first)| {
            (channel, look.part(channel, first))
        })
    }

    fn part(&self, channel: usize, first: usize) -> Part {
        let shape = self.source.shape();
        let mut part = Part {
            delay: [Range::EMPTY; 2],
            moments: [0.0; NUM_MOMENTS],
        };
        let mut chunk = Chunk::<f64>::new(&shape, 1);
        let last = shape.paths.min(first + PART);
        for first in (first..last).step_by(CHUNK) {
            if self.options.cancel.is_some_and(Cancel::is_asked) {
                break;
            }
            let request = Request {
                channels: channel..channel + 1,
                paths: first..last.min(first + CHUNK),
                scale: self.scale,
                level: self.options.level,
            };
            if self.middle.is_some() {
                self.source.fill_double(&request, &mut chunk);
            } else {
                self.source.fill_delays(&request, &mut chunk);
            }
            self.options.level.run(LookAtChunk {
                look: self,
                chunk: &chunk,
                part: &mut part,
            });
        }
        part
    }
}

/// Kernel that looks at the paths of a chunk.
struct LookAtChunk<'a> {
    look: &'a Look<'a>,
    chunk: &'a Chunk<f64>,
    part: &'a mut Part,
}

impl Kernel for LookAtChunk<'_> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(self) {
        let (splat, load) = (<I::F64 as Vector>::splat, <I::F64 as Vector>::load);
        let (chunk, part, weights) = (self.chunk, self.part, self.look.weights);
        let (rows, num_paths) = (chunk.delay.len() - 1, chunk.num_paths.min(CHUNK));
        let mut low = [splat(f64::INFINITY); 2];
        let mut high = [splat(f64::NEG_INFINITY); 2];
        let mut moments = [splat(0.0); NUM_MOMENTS];
        for at in (0..num_paths).step_by(8) {
            let row = load(&chunk.delay[rows][at..]);
            let delay = row.mul_add(splat(weights[0]), load(&chunk.delay[0][at..]));
            let rate = row.mul(splat(weights[1]));
            // NaN is left out.
            low = [delay.min(low[0]), rate.min(low[1])];
            high = [delay.max(high[0]), rate.max(high[1])];
            if let Some(middle) = self.look.middle {
                let (re, im) = (load(&chunk.re[0][at..]), load(&chunk.im[0][at..]));
                let power = re.mul_add(re, im.mul(im));
                let offset = delay.sub(splat(middle));
                let square = rate.mul(rate);
                let weighted = square.mul(power);
                moments = [
                    moments[0].add(power),
                    moments[1].add(weighted),
                    weighted.mul_add(square, moments[2]),
                    weighted.mul(offset).mul_add(offset, moments[3]),
                ];
            }
        }
        for k in 0..2 {
            let range = Range {
                low: -splat(0.0).sub(low[k]).largest(),
                high: high[k].largest(),
            };
            part.delay[k] = part.delay[k].join(range);
        }
        for k in 0..NUM_MOMENTS {
            let mut numbers = [0.0; 8];
            moments[k].store(&mut numbers);
            for number in numbers {
                part.moments[k] += number;
            }
        }
    }
}
