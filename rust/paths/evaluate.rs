//! Delays and amplitudes of chunks of paths: sixteen material points of rigid bodies at a time, all others one by one.

use crate::constants::SPEED_OF_LIGHT;
use crate::numeric::simd::{Isa, Kernel, Precision, Real, Vector};
use crate::paths::kinematics::Kinematics;
use crate::paths::scatterers::Scatterers;
use crate::paths::sixteen::{
    HALF, Lanes, STEP, Sights, Sixteen, Surface, Weights, antenna_of, dot, narrow, offsets, received,
};
use crate::synthesis::chunk::{CHUNK, Chunk, Lane};
use crate::synthesis::source::Request;

#[cfg(test)]
mod tests;

impl Scatterers {
    /// Fill a chunk with paths, by number as in [`Self::path`]: delays at the nodes of `delays`, and amplitudes at those of
    /// `amplitudes`.
    pub fn fill<T: Precision>(
        &self,
        [delays, amplitudes]: [&Kinematics; 2],
        numbers: &[usize],
        request: &Request,
        chunk: &mut Chunk<T>,
    ) {
        request.level.run(FillChunk {
            scatterers: self,
            delays,
            amplitudes,
            numbers,
            request,
            chunk,
        });
    }
}

/// Filling of a chunk.
struct FillChunk<'a, T> {
    scatterers: &'a Scatterers,
    delays: &'a Kinematics,
    amplitudes: &'a Kinematics,
    numbers: &'a [usize],
    request: &'a Request,
    chunk: &'a mut Chunk<T>,
}

impl<T: Precision> Kernel for FillChunk<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(mut self) {
        let (numbers, array) = (self.numbers, &self.scatterers.array);
        let num_antennas = array.tx.len() + array.rx.len();
        let mut distances = vec![[0.0; STEP]; num_antennas];
        let mut sights = vec![Sights::<T::In<I>>::nothing(); num_antennas];
        let mut weights = vec![Weights::<T>::nothing(); array.num_channels()];
        for first in (0..numbers.len()).step_by(STEP) {
            let count = STEP.min(numbers.len() - first);
            let mut sixteen = [numbers[first + count - 1]; STEP];
            sixteen[..count].copy_from_slice(&numbers[first..first + count]);
            let Some(points) = self.scatterers.sixteen(&sixteen) else {
                self.one_by_one(first, count);
                continue;
            };
            self.fill_delays::<I>(&points, first, &mut distances);
            self.scatterers.weigh(&sixteen, &mut weights);
            self.fill_amplitudes::<I>(&points, first, &weights, &mut sights);
        }
        self.chunk.num_paths = numbers.len();
        let num_nodes = [self.delays.num_nodes, self.amplitudes.num_nodes];
        finish(self.chunk, num_nodes, self.request.channels.len());
    }
}

impl<T: Precision> FillChunk<'_, T> {
    /// Delays of sixteen points, for the lanes from `first` on.
    #[cfg_attr(optimised, inline(always))]
    fn fill_delays<I: Isa>(&mut self, points: &Sixteen, first: usize, distances: &mut [Lanes<f64>]) {
        let array = &self.scatterers.array;
        let (num_rx, num_nodes) = (array.rx.len(), self.delays.num_nodes);
        for node in 0..num_nodes {
            let poses = points.poses(self.delays, node);
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
        weights: &[Weights<T>],
        sights: &mut [Sights<T::In<I>>],
    ) {
        let array = &self.scatterers.array;
        let (num_rx, num_nodes) = (array.rx.len(), self.amplitudes.num_nodes);
        for node in 0..num_nodes {
            let poses = points.poses(self.amplitudes, node);
            // One vector of single precision, or two of double precision.
            for lanes in (0..STEP).step_by(<T::In<I> as Vector>::LANES) {
                let low = poses.placed::<I>(&points.position, lanes);
                let high = poses.placed::<I>(&points.position, HALF);
                for antenna in 0..sights.len() {
                    let (place, pattern) = antenna_of(array, antenna);
                    // Rounded after the difference: near antennas keep their digits.
                    let offset = narrow::<T, I>(&offsets(&low, place), &offsets(&high, place));
                    sights[antenna] = Sights::new(pattern, &offset);
                }
                let normal = poses.turned_to::<T, I>(&points.normal, lanes);
                let mut edges = None;
                if points.has_edges {
                    let [u, v] = &points.edges;
                    edges = Some([poses.turned_to::<T, I>(u, lanes), poses.turned_to::<T, I>(v, lanes)]);
                }
                let surface = Surface { normal, edges };
                for channel in self.request.channels.clone() {
                    let (t, r) = (&sights[channel / num_rx], &sights[array.tx.len() + channel % num_rx]);
                    let weight = weights[channel].load(lanes);
                    let amplitude = surface.amplitude(array, self.request.scale, &weight, t, r);
                    let [re, im] = received(array, channel, amplitude, t, r);
                    let row = (channel - self.request.channels.start) * num_nodes + node;
                    re.store(&mut self.chunk.re[row][first + lanes..]);
                    im.store(&mut self.chunk.im[row][first + lanes..]);
                }
            }
        }
    }

    /// Evaluate paths one by one, for some lanes.
    #[inline(never)]
    fn one_by_one(&mut self, first: usize, count: usize) {
        let channels = self.request.channels.clone();
        for (at, channel) in channels.enumerate() {
            for (lane, path) in (first..first + count).zip(&self.numbers[first..]) {
                for node in 0..self.delays.num_nodes {
                    let row = at * self.delays.num_nodes + node;
                    self.chunk.delay[row][lane] = self.scatterers.path(self.delays, node, channel, *path).0;
                }
                for node in 0..self.amplitudes.num_nodes {
                    let row = at * self.amplitudes.num_nodes + node;
                    let amplitude = self.scatterers.path(self.amplitudes, node, channel, *path).1 * self.request.scale;
                    (self.chunk.re[row][lane], self.chunk.im[row][lane]) = (T::of(amplitude.re), T::of(amplitude.im));
                }
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
