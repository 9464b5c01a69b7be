//! Delays and amplitudes of many paths: sixteen material points of rigid bodies at a time, all others one by one.

use num_complex::Complex64;
use rayon::prelude::*;

use crate::constants::SPEED_OF_LIGHT;
use crate::error::Result;
use crate::numeric::simd::{Isa, Kernel, Level, Vector};
use crate::paths::kinematics::Kinematics;
use crate::paths::scatterers::{Members, Scatterers};
use crate::paths::series::{Paths, Selection};
use crate::paths::sixteen::{HALF, STEP, Sights, Surface, Weights, antenna_of, dot, offsets, received};

#[cfg(test)]
mod tests;

/// Number of paths that one thread evaluates together, at all times.
const BLOCK: usize = 16 * STEP;

impl Scatterers {
    /// Delays of the selected members at the nodes of `kinematics`, and amplitudes at those of `amplitudes_at`.
    pub fn paths(
        &self,
        kinematics: &Kinematics,
        amplitudes_at: &Kinematics,
        members: &Members,
        selection: Selection,
    ) -> Result<Paths> {
        self.paths_by(kinematics, amplitudes_at, members, selection, Level::best())
    }

    /// Delays and amplitudes as [`Self::paths`], by an instruction set.
    pub fn paths_by(
        &self,
        kinematics: &Kinematics,
        amplitudes_at: &Kinematics,
        members: &Members,
        selection: Selection,
        level: Level,
    ) -> Result<Paths> {
        let num_nodes = [kinematics.num_nodes, amplitudes_at.num_nodes];
        let mut paths = Paths::zeros(num_nodes, self.num_channels(), selection)?;
        let num_paths = selection.len();
        if num_paths == 0 {
            return Ok(paths);
        }
        let mut blocks: Vec<EvaluateBlock> = (0..num_paths.div_ceil(BLOCK))
            .map(|block| EvaluateBlock {
                scatterers: self,
                kinematics,
                amplitudes_at,
                members,
                selection,
                first: block * BLOCK,
                count: BLOCK.min(num_paths - block * BLOCK),
                delays: Vec::with_capacity(kinematics.num_nodes * self.num_channels()),
                amplitudes: Vec::with_capacity(amplitudes_at.num_nodes * self.num_channels()),
            })
            .collect();
        for row in paths.delay.chunks_mut(num_paths) {
            for (block, part) in blocks.iter_mut().zip(row.chunks_mut(BLOCK)) {
                block.delays.push(part);
            }
        }
        for row in paths.amplitude.chunks_mut(num_paths) {
            for (block, part) in blocks.iter_mut().zip(row.chunks_mut(BLOCK)) {
                block.amplitudes.push(part);
            }
        }
        blocks.into_par_iter().for_each(|block| level.run(block));
        Ok(paths)
    }
}

/// Evaluation of a block of paths.
struct EvaluateBlock<'a> {
    scatterers: &'a Scatterers,
    kinematics: &'a Kinematics<'a>,
    amplitudes_at: &'a Kinematics<'a>,
    members: &'a Members,
    selection: Selection,
    /// First path of the block and number of paths, among the selected ones.
    first: usize,
    count: usize,
    /// Part of the block in every row `(node, channel)`.
    delays: Vec<&'a mut [f64]>,
    amplitudes: Vec<&'a mut [Complex64]>,
}

impl Kernel for EvaluateBlock<'_> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))] // see `Kernel`
    fn run<I: Isa>(mut self) {
        let scatterers = self.scatterers;
        let array = &scatterers.array;
        let (num_channels, num_tx) = (array.num_channels(), array.tx.len());
        let num_antennas = num_tx + array.rx.len();
        let mut sights = vec![Sights::<I::F64>::nothing(); num_antennas];
        let mut weights = vec![Weights::<f64>::nothing(); num_channels];
        let mut distances = vec![<I::F64 as Vector>::splat(0.0); num_antennas];
        for first in (0..self.count).step_by(STEP) {
            let count = STEP.min(self.count - first);
            let mut numbers = [0; STEP];
            for lane in 0..STEP {
                let place = self.first + first + lane.min(count - 1);
                let member = self.selection.first + place * self.selection.step;
                numbers[lane] = self.members.number(scatterers, member);
            }
            let Some(points) = scatterers.sixteen(&numbers) else {
                self.one_by_one(first, &numbers[..count]);
                continue;
            };
            scatterers.weigh(&numbers, &mut weights);
            for half in (0..count).step_by(HALF) {
                let some = first + half..first + count.min(half + HALF);
                for node in 0..self.kinematics.num_nodes {
                    let position = points.poses(self.kinematics, node).placed::<I>(&points.position, half);
                    for antenna in 0..num_antennas {
                        let offset = offsets(&position, antenna_of(array, antenna).0);
                        distances[antenna] = dot(&offset, &offset).sqrt();
                    }
                    for channel in 0..num_channels {
                        let tx = distances[channel / array.rx.len()];
                        let rx = distances[num_tx + channel % array.rx.len()];
                        let speed = <I::F64 as Vector>::splat(SPEED_OF_LIGHT);
                        let mut delay = [0.0; HALF];
                        tx.add(rx).div(speed).store(&mut delay);
                        let row = &mut self.delays[node * num_channels + channel];
                        row[some.clone()].copy_from_slice(&delay[..some.len()]);
                    }
                }
                for node in 0..self.amplitudes_at.num_nodes {
                    let poses = points.poses(self.amplitudes_at, node);
                    let position = poses.placed::<I>(&points.position, half);
                    for antenna in 0..num_antennas {
                        let (place, pattern) = antenna_of(array, antenna);
                        sights[antenna] = Sights::new(pattern, &offsets(&position, place));
                    }
                    let normal = poses.turned::<I>(&points.normal, half);
                    let mut edges = None;
                    if points.has_edges {
                        let [u, v] = &points.edges;
                        edges = Some([poses.turned::<I>(u, half), poses.turned::<I>(v, half)]);
                    }
                    let surface = Surface { normal, edges };
                    for channel in 0..num_channels {
                        let tx = &sights[channel / array.rx.len()];
                        let rx = &sights[num_tx + channel % array.rx.len()];
                        let amplitude = surface.amplitude(array, 1.0, &weights[channel].load(half), tx, rx);
                        let amplitude = received(array, channel, amplitude, tx, rx);
                        let mut parts = [[0.0; HALF]; 2];
                        for part in 0..2 {
                            amplitude[part].store(&mut parts[part]);
                        }
                        let row = &mut self.amplitudes[node * num_channels + channel];
                        for (lane, out) in row[some.clone()].iter_mut().enumerate() {
                            *out = Complex64::new(parts[0][lane], parts[1][lane]);
                        }
                    }
                }
            }
        }
    }
}

impl EvaluateBlock<'_> {
    /// Evaluate paths one by one, for the entries of the block from `first` on.
    #[inline(never)]
    fn one_by_one(&mut self, first: usize, numbers: &[usize]) {
        let (scatterers, num_channels) = (self.scatterers, self.scatterers.num_channels());
        for (row, out) in self.delays.iter_mut().enumerate() {
            let (node, channel) = (row / num_channels, row % num_channels);
            for (lane, number) in numbers.iter().enumerate() {
                out[first + lane] = scatterers.path(self.kinematics, node, channel, *number).0;
            }
        }
        for (row, out) in self.amplitudes.iter_mut().enumerate() {
            let (node, channel) = (row / num_channels, row % num_channels);
            for (lane, number) in numbers.iter().enumerate() {
                out[first + lane] = scatterers.path(self.amplitudes_at, node, channel, *number).1;
            }
        }
    }
}
