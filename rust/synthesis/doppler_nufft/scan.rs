//! Ranges of the delays and rates of paths, before a sum.

use std::array::from_fn;

use crate::cancel::Cancel;
use crate::error::Result;
use crate::numeric::parallel;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::chunk::{Block, CHUNK, Chunk, Lane};
use crate::synthesis::report::Options;
use crate::synthesis::source::{PathGroup, Request};

/// Chunks of paths that are looked at by one task.
const PART: usize = 64;

/// Middle and half of the length of the ranges of `c_0` and of `c_1` [s], over the moving paths of all channels with delays
/// `c_0 + c_1 x`; none without any.
pub fn delay_ranges(waveform: &Waveform, groups: &[PathGroup], options: &Options) -> Result<Option<[[f64; 2]; 2]>> {
    let mut bounds = [f64::NEG_INFINITY; 4];
    let mut ranges = None;
    for group in groups.iter().filter(|group| !group.source.shape().is_static()) {
        let shape = group.source.shape();
        let block = Block::new(waveform, &shape, 0..waveform.chirp_times.len());
        let num_chunks = shape.paths.div_ceil(CHUNK);
        let tasks: Vec<_> = (0..num_chunks)
            .step_by(PART)
            .flat_map(|first| (0..shape.channels).map(move |channel| (channel, first)))
            .collect();
        let parts = parallel::map(options.is_parallel, tasks, |(channel, first)| {
            let mut chunk = Chunk::<f64>::new(&shape, 1);
            let mut bounds = [f64::NEG_INFINITY; 4];
            for index in first..num_chunks.min(first + PART) {
                if options.cancel.is_some_and(Cancel::is_asked) {
                    break;
                }
                let request = Request::of_chunk(index, &shape, channel..channel + 1, 1.0, options.level);
                group.source.fill_delays(&request, &mut chunk);
                let found = options.level.run_loops(
                    #[inline(always)]
                    || self::bounds(&chunk.delay, &block),
                );
                bounds = from_fn(|k| bounds[k].max(found[k]));
            }
            bounds
        });
        options.cancel.map_or(Ok(()), Cancel::check)?;
        for part in parts {
            bounds = from_fn(|k| bounds[k].max(part[k]));
        }
        let found = [0, 2].map(|k| [0.5 * (bounds[k] - bounds[k + 1]), 0.5 * (bounds[k] + bounds[k + 1])]);
        if !found.as_flattened().iter().all(|x| x.is_finite()) {
            return Err(group.source.not_finite());
        }
        ranges = Some(found);
    }
    Ok(ranges)
}

/// The largest `c_0`, `-c_0`, `c_1` and `-c_1` of a chunk; lanes after its last path have the delay of that. NaN is left
/// out.
#[cfg_attr(optimised, inline(always))] // part of a kernel
fn bounds(rows: &[Lane<f64>], block: &Block) -> [f64; 4] {
    const AT_ONCE: usize = 8;
    let mut largest = [[f64::NEG_INFINITY; AT_ONCE]; 4];
    for at in (0..CHUNK).step_by(AT_ONCE) {
        for i in 0..AT_ONCE {
            let first = rows[0][at + i] + rows[1][at + i] * block.delay[0][1];
            let second = rows[1][at + i] * block.delay[1][1];
            let numbers = [first, -first, second, -second];
            for k in 0..4 {
                largest[k][i] = largest[k][i].max(numbers[k]);
            }
        }
    }
    largest.map(|lanes| lanes.into_iter().fold(f64::NEG_INFINITY, f64::max))
}
