//! Delays and amplitudes of chunks of paths: sixteen material points of rigid bodies at a time, all others one by one.

use std::ops::Range;

use num_complex::Complex64;

use crate::constants::SPEED_OF_LIGHT;
use crate::numeric::simd::{Isa, Kernel, Precision, Real, Vector};
use crate::paths::kinematics::Kinematics;
use crate::paths::scatterers::Scatterers;
use crate::paths::sixteen::{
    HALF, STEP, Sights, Sixteen, antenna_of, dot, narrow, offsets, received, surface_amplitude,
};
use crate::synthesis::chunk::{CHUNK, Chunk, Lane};
use crate::synthesis::source::Request;

#[cfg(test)]
mod tests;

impl Scatterers {
    /// Fill a chunk with paths, by number as in [`Self::path`]: delays at the times of the first kinematics,
    /// amplitudes at the times of the second.
    pub fn fill<T: Precision>(
        &self,
        nodes: [&Kinematics; 2],
        numbers: &[usize],
        request: &Request,
        chunk: &mut Chunk<T>,
    ) {
        request.level.run(Evaluate {
            scatterers: self,
            nodes,
            numbers,
            request,
            chunk,
        });
    }
}

/// Evaluation of the paths of a chunk.
struct Evaluate<'a, T> {
    scatterers: &'a Scatterers,
    nodes: [&'a Kinematics; 2],
    numbers: &'a [usize],
    request: &'a Request,
    chunk: &'a mut Chunk<T>,
}

impl<T: Precision> Kernel for Evaluate<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(mut self) {
        let (numbers, array) = (self.numbers, &self.scatterers.array);
        let num_antennas = array.tx.len() + array.rx.len();
        let mut distances = vec![[0.0; STEP]; num_antennas];
        let mut sights = Vec::with_capacity(num_antennas);
        let mut weights = vec![[[T::zero(); STEP]; 2]; self.scatterers.num_weights()];
        for first in (0..numbers.len()).step_by(STEP) {
            let count = STEP.min(numbers.len() - first);
            let mut sixteen = [numbers[first + count - 1]; STEP];
            sixteen[..count].copy_from_slice(&numbers[first..first + count]);
            let Some(points) = self.scatterers.sixteen(&sixteen) else {
                let path = |kinematics: &Kinematics, time, channel, path| {
                    self.scatterers.path(kinematics, time, channel, path)
                };
                let lanes = first..first + count;
                fill_one_by_one(path, self.nodes, numbers, lanes, self.request, self.chunk);
                continue;
            };
            self.fill_delays::<I>(&points, first, &mut distances);
            self.scatterers.weigh(&sixteen, &mut weights);
            self.fill_amplitudes::<I>(&points, first, &weights, &mut sights);
        }
        self.chunk.num_paths = numbers.len();
        let num_nodes = self.nodes.map(Kinematics::num_times);
        finish(self.chunk, num_nodes, self.request.channels.len());
    }
}

impl<T: Precision> Evaluate<'_, T> {
    /// Delays of sixteen points, for the lanes from `first` on.
    #[cfg_attr(optimised, inline(always))]
    fn fill_delays<I: Isa>(&mut self, points: &Sixteen, first: usize, distances: &mut [[f64; STEP]]) {
        let array = &self.scatterers.array;
        let (num_rx, num_nodes) = (array.rx.len(), self.nodes[0].num_times());
        for node in 0..num_nodes {
            let poses = points.poses(self.nodes[0].poses.row(node));
            for half in [0, HALF] {
                let position = poses.placed::<I>(&points.position, half);
                for antenna in 0..distances.len() {
                    let offset = offsets(&position, antenna_of(array, antenna).0);
                    dot(&offset, &offset).sqrt().store(&mut distances[antenna][half..]);
                }
            }
            for channel in self.request.channels.clone() {
                let row = (channel - self.request.channels.start) * num_nodes + node;
                let out = &mut self.chunk.delay[row][first..first + STEP];
                let (tx, rx) = (
                    &distances[channel / num_rx],
                    &distances[array.tx.len() + channel % num_rx],
                );
                for lane in 0..STEP {
                    out[lane] = (tx[lane] + rx[lane]) * (1.0 / SPEED_OF_LIGHT);
                }
            }
        }
    }

    /// Amplitudes of sixteen points, for the lanes from `first` on.
    #[cfg_attr(optimised, inline(always))]
    fn fill_amplitudes<I: Isa>(
        &mut self,
        points: &Sixteen,
        first: usize,
        weights: &[[[T; STEP]; 2]],
        sights: &mut Vec<Sights<T::In<I>>>,
    ) {
        let array = &self.scatterers.array;
        let (num_tx, num_rx, num_nodes) = (array.tx.len(), array.rx.len(), self.nodes[1].num_times());
        for node in 0..num_nodes {
            let poses = points.poses(self.nodes[1].poses.row(node));
            // One vector of single precision, or two of double precision.
            for lanes in (0..STEP).step_by(<T::In<I>>::LANES) {
                let low = poses.placed::<I>(&points.position, lanes);
                let high = poses.placed::<I>(&points.position, HALF);
                sights.clear();
                for antenna in 0..num_tx + num_rx {
                    let (place, pattern) = antenna_of(array, antenna);
                    // Rounded after the difference: near antennas keep their digits.
                    let offset = narrow::<T, I>(&offsets(&low, place), &offsets(&high, place));
                    sights.push(Sights::new(pattern, &offset));
                }
                let normal = poses.turned_to::<T, I>(&points.normal, lanes);
                let mut edges = None;
                if points.has_edges {
                    let [u, v] = &points.edges;
                    edges = Some([poses.turned_to::<T, I>(u, lanes), poses.turned_to::<T, I>(v, lanes)]);
                }
                for channel in self.request.channels.clone() {
                    let (t, r) = (&sights[channel / num_rx], &sights[num_tx + channel % num_rx]);
                    let mut weight = [<T::In<I>>::splat(T::zero()); 2];
                    for part in 0..2 {
                        weight[part] = <T::In<I>>::load(&weights[channel.min(weights.len() - 1)][part][lanes..]);
                    }
                    let surface = (&normal, edges.as_ref());
                    let amplitude = surface_amplitude(array, self.request.scale, surface, &weight, t, r);
                    let [re, im] = received(array, channel, amplitude, t, r);
                    let row = (channel - self.request.channels.start) * num_nodes + node;
                    re.store(&mut self.chunk.re[row][first + lanes..]);
                    im.store(&mut self.chunk.im[row][first + lanes..]);
                }
            }
        }
    }
}

/// Fill lanes of a chunk with paths one by one: `path` gives the delay and the amplitude at a time, of a channel and a
/// path.
#[inline(never)]
pub fn fill_one_by_one<T: Real>(
    path: impl Fn(&Kinematics, usize, usize, usize) -> (f64, Complex64),
    [delays, amplitudes]: [&Kinematics; 2],
    numbers: &[usize],
    lanes: Range<usize>,
    request: &Request,
    chunk: &mut Chunk<T>,
) {
    for (at, channel) in request.channels.clone().enumerate() {
        for lane in lanes.clone() {
            for node in 0..delays.num_times() {
                let row = at * delays.num_times() + node;
                chunk.delay[row][lane] = path(delays, node, channel, numbers[lane]).0;
            }
            for node in 0..amplitudes.num_times() {
                let row = at * amplitudes.num_times() + node;
                let amplitude = path(amplitudes, node, channel, numbers[lane]).1 * request.scale;
                (chunk.re[row][lane], chunk.im[row][lane]) = (T::of(amplitude.re), T::of(amplitude.im));
            }
        }
    }
}

/// Turn values at nodes of delays and of amplitudes into the rows of a [`Chunk`]: lanes after the last path, and
/// differences from the first row.
#[cfg_attr(optimised, inline(always))]
pub fn finish<T: Real>(chunk: &mut Chunk<T>, [delays, amplitudes]: [usize; 2], num_channels: usize) {
    let num_paths = chunk.num_paths;
    let delay = &mut chunk.delay[..num_channels * delays];
    for row in &mut *delay {
        let last = row[num_paths - 1];
        row[num_paths..].fill(last);
    }
    subtract_first(delay, delays);
    for rows in [&mut chunk.re, &mut chunk.im] {
        let rows = &mut rows[..num_channels * amplitudes];
        for row in &mut *rows {
            row[num_paths..].fill(T::zero());
        }
        subtract_first(rows, amplitudes);
    }
}

/// Subtract the first row of every channel from its other rows.
#[cfg_attr(optimised, inline(always))]
fn subtract_first<T: Real>(rows: &mut [Lane<T>], num_nodes: usize) {
    for rows in rows.chunks_mut(num_nodes) {
        if let [first, others @ ..] = rows {
            for row in others {
                for i in 0..CHUNK {
                    row[i] = row[i] - first[i];
                }
            }
        }
    }
}
