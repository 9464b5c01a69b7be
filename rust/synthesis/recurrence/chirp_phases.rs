//! Exact phases of every path in every chirp, chirps in the lanes of vectors, for any motion and any chirp times.
//!
//! 16 chirps (f32) or 8 (f64) form a group. In its short interval the Chebyshev series of a delay has few terms; about
//! the middle of every chirp, number `M / 2`, it is a Taylor series in time, and so is the phase of eq. (1):
//! `phi = sum_n phi_n j^n`, with `j` the number of samples from the middle.

#![allow(clippy::needless_range_loop)] // terms of several series are indexed together

use std::ops::Range;

use crate::cancel::Cancel;
use crate::numeric::simd::{Isa, Precision, Vector};
use crate::numeric::trig;
use crate::numeric::wide::{self, add, mul, mul_add, neg_mul_add};
use crate::synthesis::block::{Block, CHUNK, Chunk, Lane, Selection};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::PathSeries;

/// Job of a sum: some paths of one channel in some chirps.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Waveform: times and frequencies.
    pub waveform: &'a Waveform,
    /// Delays and amplitudes.
    pub series: &'a PathSeries<'a>,
    /// Index of the channel.
    pub channel: usize,
    /// Selected paths: still, moving or all.
    pub selection: Selection<'a>,
    /// Range of the paths; start and end are multiples of [`CHUNK`], or the end is that of the series.
    pub paths: Range<usize>,
    /// Range of the chirps, best in whole groups of 16.
    pub chirps: Range<usize>,
    /// Power of two that amplitudes are multiplied by, which keeps f32 from underflow.
    pub scale: f64,
    /// Request to stop: what is left of the paths is left out.
    pub cancel: Option<&'a Cancel>,
}

impl Job<'_> {
    /// Panics unless whole chunks are asked for and samples have room.
    pub(crate) fn check(&self, num_values: usize) {
        let Range { start, end } = self.paths;
        let is_whole = start.is_multiple_of(CHUNK) && (end.is_multiple_of(CHUNK) || end == self.series.num_paths);
        assert!(self.paths.is_empty() || is_whole);
        assert_eq!(num_values, self.chirps.len() * self.waveform.num_samples);
    }
}

/// Largest number of lanes of a group, the lanes of the widest vector.
pub(crate) const MAX_LANES: usize = 16;

/// Number of terms of Taylor series over a chirp; the sixth, `2 pi f tau_5 t^5`, is left out.
pub(crate) const TERMS: usize = 5;

/// One number per chirp of a group; f64 kernels use the first eight.
pub(crate) type Wide<I> = wide::Wide<I, 2>;

#[cfg_attr(optimised, inline(always))]
pub(crate) fn splat<I: Isa>(x: f64) -> Wide<I> {
    wide::splat::<I, 2>(x)
}

#[cfg_attr(optimised, inline(always))]
pub(crate) fn load<I: Isa>(from: &[f64; MAX_LANES]) -> Wide<I> {
    wide::load::<I, 2>(from)
}

/// Cosine and sine of phases in turns, below 2^49 of them, to the precision of `T`.
#[cfg_attr(optimised, inline(always))]
pub(crate) fn cos_sin<T: Precision, I: Isa>(phase: Wide<I>) -> [T::In<I>; 2] {
    wide::cos_sin::<T, I, 2>(phase)
}

/// Group of chirps that are summed together.
pub(crate) struct Group {
    pub(crate) block: Block,
    /// Matrices from Chebyshev coefficients over the block, by degree, to Taylor coefficients in samples over every
    /// chirp.
    pub(crate) taylor: Vec<[[f64; MAX_LANES]; TERMS]>,
    /// Largest absolute values of `taylor` over the chirps.
    pub(crate) largest: Vec<[f64; TERMS]>,
}

impl Group {
    pub(crate) fn new(waveform: &Waveform, series: &PathSeries, chirps: Range<usize>) -> Self {
        let block = Block::new(waveform, series, chirps.clone());
        let num_degrees = series.num_terms();
        let mut taylor = vec![[[0.0; MAX_LANES]; TERMS]; num_degrees];
        let unit = 1.0 / (block.half * waveform.sample_rate);
        for lane in 0..MAX_LANES {
            // Lanes beyond the last chirp repeat it.
            let chirp = (chirps.start + lane).min(chirps.end - 1);
            let x = block.x(waveform.chirp_times[chirp] + waveform.middle_time());
            // T_k(x + unit j) = 2 (x + unit j) T_(k-1) - T_(k-2), as polynomials in j.
            for k in 0..num_degrees {
                for n in 0..TERMS {
                    let earlier = |back: usize, n: usize| taylor[k - back][n][lane];
                    taylor[k][n][lane] = match k {
                        0 => f64::from(n == 0),
                        1 => [x, unit, 0.0, 0.0, 0.0][n],
                        _ => {
                            let shifted = if n > 0 { unit * earlier(1, n - 1) } else { 0.0 };
                            2.0 * (x * earlier(1, n) + shifted) - earlier(2, n)
                        }
                    };
                }
            }
        }
        let largest = taylor
            .iter()
            .map(|terms| terms.map(|lanes| lanes.iter().fold(0.0, |max, x| f64::max(max, x.abs()))))
            .collect();
        Self { block, taylor, largest }
    }
}

/// Phases of a chunk of paths in a group of chirps.
pub(crate) struct Phases<'a> {
    pub(crate) group: &'a Group,
    pub(crate) chunk: &'a Chunk,
    /// Phase of the constant part of the delay at the middle frequency, modulo one turn.
    pub(crate) turns: Lane,
    /// Number of terms of the delays' series that count.
    pub(crate) num_delays: usize,
    /// Frequency in the middle of the chirp [Hz].
    pub(crate) frequency: f64,
    /// Slope of the ramp [Hz/s].
    pub(crate) slope: f64,
    /// Slope of the ramp [Hz per sample].
    pub(crate) step: f64,
}

impl<'a> Phases<'a> {
    /// Phases of a chunk; terms of the delays that turn no phase by more than `tolerance` are left out.
    #[cfg_attr(optimised, inline(always))]
    pub(crate) fn new(waveform: &Waveform, group: &'a Group, chunk: &'a Chunk, tolerance: f64) -> Self {
        let frequency = waveform.start_frequency + waveform.slope * waveform.middle_time();
        let reach = (waveform.num_samples / 2 + 1) as f64;
        // Rounding of the delays given, which the short Taylor series of high degrees would amplify.
        let noise = 4.0 * f64::EPSILON * largest(&chunk.delay[0]);
        let mut num_delays = chunk.delay.len();
        while num_delays > 1 {
            let k = num_delays - 1;
            let seen = group.largest[k].iter().rev().fold(0.0, |sum, x| sum * reach + x);
            let size = largest(&chunk.delay[k]);
            if size > noise && std::f64::consts::TAU * frequency.abs() * size * seen > tolerance {
                break;
            }
            num_delays -= 1;
        }
        Self {
            group,
            chunk,
            turns: turns(frequency, &chunk.delay[0]),
            num_delays,
            frequency,
            slope: waveform.slope,
            step: waveform.slope / waveform.sample_rate,
        }
    }

    /// Taylor coefficients of the phase of a path in every chirp [cycles], the first not reduced, from `N` of the
    /// delay.
    #[cfg_attr(optimised, inline(always))]
    pub(crate) fn of<I: Isa, const N: usize>(&self, path: usize) -> [Wide<I>; TERMS] {
        // Delay, less the constant part.
        let mut tau = [splat::<I>(0.0); TERMS];
        for k in 1..self.num_delays {
            let coefficient = splat::<I>(self.chunk.delay[k][path]);
            let terms = &self.group.taylor[k];
            for n in 0..N {
                tau[n] = mul_add(coefficient, load::<I>(&terms[n]), tau[n]);
            }
        }
        let (frequency, step, slope) = (
            splat::<I>(self.frequency),
            splat::<I>(self.step),
            splat::<I>(self.slope),
        );
        let turns = mul_add(frequency, tau[0], splat::<I>(self.turns[path]));
        tau[0] = add(tau[0], splat::<I>(self.chunk.delay[0][path]));

        // phi = (f_m + S t') tau - S tau^2 / 2
        let half_slope = mul(slope, splat::<I>(0.5));
        let received = neg_mul_add(slope, tau[0], frequency);
        let curved = mul(half_slope, tau[1]);
        let twisted = mul(slope, tau[1]);
        [
            neg_mul_add(mul(half_slope, tau[0]), tau[0], turns),
            mul_add(received, tau[1], mul(step, tau[0])),
            neg_mul_add(curved, tau[1], mul_add(received, tau[2], mul(step, tau[1]))),
            neg_mul_add(twisted, tau[2], mul_add(received, tau[3], mul(step, tau[2]))),
            mul_add(received, tau[4], mul(step, tau[3])),
        ]
    }

    /// Bounds of the Taylor coefficients 1, 2, ... of all phases [cycles].
    #[cfg_attr(optimised, inline(always))]
    pub(crate) fn bounds(&self) -> [f64; TERMS] {
        let mut tau = [0.0; TERMS];
        for k in 0..self.num_delays {
            let coefficient = largest(&self.chunk.delay[k]);
            for n in 0..TERMS {
                tau[n] += coefficient * self.group.largest[k][n];
            }
        }
        let mut phi = [0.0; TERMS];
        for n in 1..TERMS {
            phi[n] = 1.01 * self.frequency.abs() * tau[n] + self.step.abs() * tau[n - 1];
        }
        phi
    }
}

/// Amplitudes of a chunk: their conjugates' Taylor coefficients in samples.
pub(crate) struct Amplitudes<'a> {
    pub(crate) group: &'a Group,
    pub(crate) chunk: &'a Chunk,
    pub(crate) scale: f64,
    /// Number of terms that count, at least one.
    pub(crate) num_terms: usize,
    /// Bounds of the Taylor coefficients, relative to the root mean square of the amplitudes.
    pub(crate) bounds: [f64; 3],
}

impl<'a> Amplitudes<'a> {
    /// Amplitudes of a chunk; terms below `tolerance` of their root mean square are left out.
    #[cfg_attr(optimised, inline(always))]
    pub(crate) fn new(group: &'a Group, chunk: &'a Chunk, scale: f64, num_samples: usize, tolerance: f64) -> Self {
        let size = |k: usize| largest(&chunk.re[k]) + largest(&chunk.im[k]);
        let reach = (num_samples / 2 + 1) as f64;
        let noise = 4.0 * f64::EPSILON * size(0);
        let mut square = 0.0;
        for (re, im) in chunk.re[0].iter().zip(&chunk.im[0]) {
            square += re * re + im * im;
        }
        let rms = (square / chunk.len.max(1) as f64).sqrt();
        let mut num_terms = chunk.re.len();
        while num_terms > 1 {
            let k = num_terms - 1;
            let seen = group.largest[k].iter().rev().fold(0.0, |sum, x| sum * reach + x);
            if size(k) > noise && size(k) * seen > tolerance * rms {
                break;
            }
            num_terms -= 1;
        }
        let mut bounds = [1.0, 0.0, 0.0];
        for k in 1..num_terms {
            for n in 1..3 {
                bounds[n] += size(k) * group.largest[k][n] / rms;
            }
        }
        Self {
            group,
            chunk,
            scale,
            num_terms,
            bounds,
        }
    }

    /// Real and imaginary parts of terms 0, 1, 2.
    #[cfg_attr(optimised, inline(always))]
    pub(crate) fn of<I: Isa>(&self, path: usize) -> [[Wide<I>; 2]; 3] {
        let zero = splat::<I>(0.0);
        let mut terms = [[zero; 2]; 3];
        terms[0] = [
            splat::<I>(self.scale * self.chunk.re[0][path]),
            splat::<I>(-self.scale * self.chunk.im[0][path]),
        ];
        if self.num_terms > 1 {
            for k in 1..self.num_terms {
                let re = splat::<I>(self.scale * self.chunk.re[k][path]);
                let im = splat::<I>(-self.scale * self.chunk.im[k][path]);
                for n in 0..3 {
                    let basis = load::<I>(&self.group.taylor[k][n]);
                    terms[n] = [mul_add(re, basis, terms[n][0]), mul_add(im, basis, terms[n][1])];
                }
            }
        }
        terms
    }
}

#[cfg_attr(optimised, inline(always))]
pub(crate) fn complex_mul<V: Vector>(a: [V; 2], b: [V; 2]) -> [V; 2] {
    [
        a[1].neg_mul_add(b[1], a[0].mul(b[0])),
        a[1].mul_add(b[0], a[0].mul(b[1])),
    ]
}

/// Largest absolute number.
#[cfg_attr(optimised, inline(always))]
pub(crate) fn largest(lane: &Lane) -> f64 {
    let mut max = [0.0; 8];
    for eight in lane.as_chunks::<8>().0 {
        for i in 0..8 {
            let x = eight[i].abs();
            max[i] = if x > max[i] { x } else { max[i] };
        }
    }
    max.iter().fold(0.0, |a, b| if *b > a { *b } else { a })
}

/// Exact phases of a chunk, as [`trig::turns`].
#[cfg_attr(optimised, inline(always))]
pub(crate) fn turns(frequency: f64, delay: &Lane) -> Lane {
    let mut turns = [0.0; CHUNK];
    for i in 0..CHUNK {
        turns[i] = trig::turns(frequency, delay[i]);
    }
    turns
}

#[cfg(test)]
pub(crate) mod tests {
    use std::f64::consts::{PI, TAU};

    use num_complex::{Complex, Complex64};

    use super::*;
    use crate::constants::SPEED_OF_LIGHT as C;
    use crate::numeric::simd::Level;
    use crate::synthesis::delay::Basis;
    use crate::synthesis::direct;

    /// Delays and amplitudes of paths, one row per term.
    #[derive(Clone)]
    pub struct Paths {
        pub basis: Basis,
        pub delay: Vec<Vec<f64>>,
        pub amplitude: Vec<Vec<Complex64>>,
    }

    impl Paths {
        pub fn with_series<R>(&self, run: impl FnOnce(&PathSeries) -> R) -> R {
            let delay: Vec<&[f64]> = self.delay.iter().map(Vec::as_slice).collect();
            let amplitude: Vec<&[Complex64]> = self.amplitude.iter().map(Vec::as_slice).collect();
            run(&PathSeries {
                basis: self.basis,
                delay: &delay,
                amplitude: &amplitude,
                num_channels: 1,
                num_paths: self.delay[0].len(),
            })
        }

        /// Mean square over the nodes, summed over the paths, square root.
        pub fn norm(&self) -> f64 {
            let sum: f64 = self.amplitude.iter().flatten().map(Complex64::norm_sqr).sum();
            (sum / self.amplitude.len() as f64).sqrt()
        }
    }

    /// Numbers in [0, 1), the same on every run.
    pub fn uniform(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            // splitmix64
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    pub fn waveform(bandwidth: f64, num_samples: usize, num_chirps: usize) -> Waveform {
        Waveform {
            start_frequency: 58e9,
            slope: bandwidth / (num_samples.max(16) as f64 / 2e6),
            sample_rate: 2e6,
            adc_delay: 3e-6,
            num_samples,
            chirp_times: (0..num_chirps).map(|c| c as f64 * 400e-6).collect(),
        }
    }

    /// Paths at 0.5 to 8 m with |velocity| <= 3 m/s and |acceleration| <= `acceleration`.
    pub fn polynomial(num_paths: usize, acceleration: f64) -> Paths {
        let mut u = uniform(7);
        let mut row = |low: f64, high: f64| -> Vec<f64> {
            (0..num_paths).map(|_| 2.0 / C * (low + (high - low) * u())).collect()
        };
        let mut delay = vec![row(0.5, 8.0), row(-3.0, 3.0)];
        if acceleration > 0.0 {
            delay.push(row(-acceleration, acceleration));
        }
        Paths {
            basis: Basis::Taylor,
            delay,
            amplitude: vec![amplitudes(num_paths)],
        }
    }

    fn amplitudes(num_paths: usize) -> Vec<Complex64> {
        let mut u = uniform(11);
        (0..num_paths)
            .map(|_| Complex64::from_polar(1e-5 * (0.5 + u()), TAU * u()))
            .collect()
    }

    /// A fan of radius 0.15 m, 1 m away, seen from 30 degrees beside its axis; amplitudes 1 / R^2 if `fades`.
    pub fn fan(waveform: &Waveform, num_paths: usize, num_nodes: usize, turns_per_second: f64, fades: bool) -> Paths {
        let mut u = uniform(3);
        let blades: Vec<(f64, f64)> = (0..num_paths).map(|_| (0.15 * u().sqrt(), TAU * u())).collect();
        let start = amplitudes(num_paths);
        let mut paths = Paths {
            basis: Basis::Chebyshev,
            delay: vec![],
            amplitude: vec![],
        };
        for node in 0..num_nodes {
            let x = -(PI * (2 * node + 1) as f64 / (2 * num_nodes) as f64).cos();
            let time = 0.5 * waveform.duration() * (1.0 + x);
            let range: Vec<f64> = blades
                .iter()
                .map(|(radius, angle)| {
                    let (s, c) = (angle + TAU * turns_per_second * time).sin_cos();
                    (1.0 + 0.5 * radius * c).hypot(radius * s).hypot(0.866 * radius * c)
                })
                .collect();
            paths.delay.push(range.iter().map(|r| 2.0 * r / C).collect());
            if fades || node == 0 {
                let faded = start
                    .iter()
                    .zip(&range)
                    .map(|(a, r)| if fades { *a / (r * r) } else { *a });
                paths.amplitude.push(faded.collect());
            }
        }
        paths
    }

    /// Relative to the l2 norm of the amplitudes; the result in precision `T` of `add`, scaled by 2^20, against the
    /// truth.
    pub fn error<T: Precision>(waveform: &Waveform, paths: &Paths, add: impl Fn(&Job, &mut [Complex<T>])) -> f64 {
        paths.with_series(|series| {
            let truth = direct::beat_signal(
                waveform,
                series,
                crate::synthesis::block::Class::All,
                Level::best(),
                false,
                None,
            );
            let scale = f64::from(1 << 20);
            let mut out = vec![Complex::<T>::default(); truth.len()];
            let num_chirps = waveform.chirp_times.len();
            // Two jobs by chirps, and two by paths: sums are added to what is there.
            let cut = num_chirps.min(16);
            let (low, high) = out.split_at_mut(cut * waveform.num_samples);
            for (chirps, out) in [(0..cut, low), (cut..num_chirps, high)] {
                let middle = CHUNK.min(series.num_paths);
                for part in [0..middle, middle..series.num_paths] {
                    add(
                        &Job {
                            waveform,
                            series,
                            channel: 0,
                            selection: Selection::ALL,
                            paths: part,
                            chirps: chirps.clone(),
                            scale,
                            cancel: None,
                        },
                        out,
                    );
                }
            }
            let wide = |z: &Complex<T>| Complex64::new(z.re.wide(), z.im.wide()) / scale;
            let square: f64 = out.iter().zip(&truth).map(|(a, b)| (wide(a) - b).norm_sqr()).sum();
            (square / truth.len() as f64).sqrt() / paths.norm().max(1e-300)
        })
    }
}
