//! Rows of delays and amplitudes of a chunk of paths, for sums in lanes: amplitudes in single precision.

use crate::constants::SPEED_OF_LIGHT;
use crate::numeric::simd::{Isa, Real, Vector};
use crate::paths::kinematics::Kinematics;
use crate::paths::scatterers::Scatterers;
use crate::paths::sixteen::{HALF, STEP, Sights, Surface, Weights, antenna_of, dot, narrow, offsets, received};

/// Rows of up to `N` paths of all channels, `(channel, node)`: values at the first node, and differences to them at the
/// others.
pub struct Rows<const N: usize> {
    /// Two-way delays [s].
    pub delay: Vec<[f64; N]>,
    /// Real parts of amplitudes times a factor [sqrt(W)].
    pub re: Vec<[f32; N]>,
    /// Imaginary parts.
    pub im: Vec<[f32; N]>,
}

impl<const N: usize> Rows<N> {
    /// Rows for numbers of nodes of delays and of amplitudes.
    pub fn new(num_channels: usize, num_nodes: [usize; 2]) -> Self {
        Self {
            delay: vec![[0.0; N]; num_channels * num_nodes[0]],
            re: vec![[0.0; N]; num_channels * num_nodes[1]],
            im: vec![[0.0; N]; num_channels * num_nodes[1]],
        }
    }
}

impl Scatterers {
    /// Rows of some paths, by number: delays at the nodes of `kinematics`, and amplitudes times `factor` at those of
    /// `amplitudes_at`.
    #[cfg_attr(optimised, inline(always))] // part of kernels
    pub fn rows<I: Isa, const N: usize>(
        &self,
        kinematics: &Kinematics,
        amplitudes_at: &Kinematics,
        numbers: &[usize],
        factor: f64,
        rows: &mut Rows<N>,
    ) {
        let array = &self.array;
        let (num_channels, num_tx) = (array.num_channels(), array.tx.len());
        let num_antennas = num_tx + array.rx.len();
        let num_nodes = [kinematics.num_nodes, amplitudes_at.num_nodes];
        let nothing = [0.0_f64; STEP];
        let mut distances = vec![nothing; num_antennas];
        let mut sights = vec![Sights::<I::F32>::nothing(); num_antennas];
        let mut weights = vec![Weights::<f32>::nothing(); num_channels];
        for first in (0..numbers.len()).step_by(STEP) {
            let count = STEP.min(numbers.len() - first);
            let mut sixteen = [numbers[first + count - 1]; STEP];
            sixteen[..count].copy_from_slice(&numbers[first..first + count]);
            let Some(points) = self.sixteen(&sixteen) else {
                self.rows_one_by_one([kinematics, amplitudes_at], &sixteen[..count], first, factor, rows);
                continue;
            };
            self.weigh(&sixteen, &mut weights);
            for node in 0..num_nodes[0] {
                let poses = points.poses(kinematics, node);
                for half in [0, HALF] {
                    let position = poses.placed::<I>(&points.position, half);
                    for antenna in 0..num_antennas {
                        let offset = offsets(&position, antenna_of(array, antenna).0);
                        let distance = dot(&offset, &offset).sqrt();
                        distance.store(&mut distances[antenna][half..]);
                    }
                }
                for channel in 0..num_channels {
                    let row = &mut rows.delay[channel * num_nodes[0] + node][first..first + STEP];
                    let (tx, rx) = (
                        &distances[channel / array.rx.len()],
                        &distances[num_tx + channel % array.rx.len()],
                    );
                    for lane in 0..STEP {
                        row[lane] = (tx[lane] + rx[lane]) * (1.0 / SPEED_OF_LIGHT);
                    }
                }
            }
            for node in 0..num_nodes[1] {
                let poses = points.poses(amplitudes_at, node);
                let low = poses.placed::<I>(&points.position, 0);
                let high = poses.placed::<I>(&points.position, HALF);
                for antenna in 0..num_antennas {
                    let (place, pattern) = antenna_of(array, antenna);
                    // Rounded after the difference: near antennas keep their digits.
                    let offset = narrow::<I>(&offsets(&low, place), &offsets(&high, place));
                    sights[antenna] = Sights::new(pattern, &offset);
                }
                let normal = poses.turned_single::<I>(&points.normal);
                let mut edges = None;
                if points.has_edges {
                    let [u, v] = &points.edges;
                    edges = Some([poses.turned_single::<I>(u), poses.turned_single::<I>(v)]);
                }
                for channel in 0..num_channels {
                    let (t, r) = (
                        &sights[channel / array.rx.len()],
                        &sights[num_tx + channel % array.rx.len()],
                    );
                    let surface = Surface { normal, edges };
                    let amplitude = surface.amplitude(array, factor, &weights[channel].load(0), t, r);
                    let amplitude = received(array, channel, amplitude, t, r);
                    let row = channel * num_nodes[1] + node;
                    for (part, rows) in [&mut rows.re, &mut rows.im].into_iter().enumerate() {
                        amplitude[part].store(&mut rows[row][first..]);
                        rows[row][first + count..first + STEP].fill(0.0);
                    }
                }
            }
        }
        subtract_first(&mut rows.delay, num_nodes[0]);
        subtract_first(&mut rows.re, num_nodes[1]);
        subtract_first(&mut rows.im, num_nodes[1]);
    }

    /// Rows of paths that are evaluated one by one, for the entries from `first` on.
    #[inline(never)]
    fn rows_one_by_one<const N: usize>(
        &self,
        [kinematics, amplitudes_at]: [&Kinematics; 2],
        numbers: &[usize],
        first: usize,
        factor: f64,
        rows: &mut Rows<N>,
    ) {
        let num_nodes = kinematics.num_nodes;
        for (row, out) in rows.delay.iter_mut().enumerate() {
            let (channel, node) = (row / num_nodes, row % num_nodes);
            let last = numbers[numbers.len() - 1];
            out[first..first + STEP].fill(self.path(kinematics, node, channel, last).0);
            for (lane, number) in numbers.iter().enumerate() {
                out[first + lane] = self.path(kinematics, node, channel, *number).0;
            }
        }
        let num_nodes = amplitudes_at.num_nodes;
        for (row, (re, im)) in rows.re.iter_mut().zip(&mut rows.im).enumerate() {
            let (channel, node) = (row / num_nodes, row % num_nodes);
            re[first..first + STEP].fill(0.0);
            im[first..first + STEP].fill(0.0);
            for (lane, number) in numbers.iter().enumerate() {
                let amplitude = factor * self.path(amplitudes_at, node, channel, *number).1;
                (re[first + lane], im[first + lane]) = (amplitude.re as f32, amplitude.im as f32);
            }
        }
    }
}

/// Subtract the first row of every channel from its other rows.
#[cfg_attr(optimised, inline(always))]
fn subtract_first<T: Real, const N: usize>(rows: &mut [[T; N]], num_nodes: usize) {
    for rows in rows.chunks_mut(num_nodes) {
        if let [first, others @ ..] = rows {
            for row in others {
                for i in 0..N {
                    row[i] = row[i] - first[i];
                }
            }
        }
    }
}
