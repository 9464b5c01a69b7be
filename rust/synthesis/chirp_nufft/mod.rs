//! Chirp-wise NUFFT: every path spread over range in the chirps of all lanes at once, one transform over range per chirp.
//!
//! Within a chirp a path is nearly a tone, whose phase and frequency in the middle of every chirp follow from a short
//! Chebyshev series over the frame, or over a block of chirps where motion is fast. A record has its coefficients;
//! tables have what multiplies them, the same for all paths. The tone is spread over a few cells of a periodic grid of
//! ranges; the transform of the grid, divided by the transform of the kernel, has its samples. The deviation of a path
//! from a tone is expanded in Legendre polynomials of fast time, with a grid for each. Static paths are spread once
//! for all chirps.
//!
//! The error of the kernel and of the records is known before the sum.

mod coherence;
mod fast_time;
mod grid;
mod number;
mod plan;
mod records;
mod spread;

use crate::cancel::Cancel;
use crate::error::{Result, fits_memory};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::report::{Options, Report, Samples, Sum};
use crate::synthesis::source::PathGroup;
use number::Number;
use plan::ChirpPlan;

/// Smallest tolerance for which sums are tried in single precision.
const LEAST_SINGLE: f64 = 3e-6;

/// Sum over paths: of records in the precision that keeps the tolerance, by the cheapest steps that do. None if no steps
/// are known to.
pub fn sum(waveform: &Waveform, groups: &[PathGroup], options: &Options) -> Result<Option<Sum>> {
    if options.tolerance >= LEAST_SINGLE
        && !options.known.needs_double
        && let Some(sum) = sum_records::<f32>(waveform, groups, options)?
    {
        return Ok(Some(sum));
    }
    sum_records::<f64>(waveform, groups, options)
}

/// Sum over records in one precision.
fn sum_records<T: Number>(waveform: &Waveform, groups: &[PathGroup], options: &Options) -> Result<Option<Sum>> {
    let plan = ChirpPlan::<T>::new(waveform, groups, options)?;
    let is_enough = plan.error.with_gain(options.known.gain) <= options.tolerance;
    if !is_enough {
        return Ok(None);
    }
    let memory = plan.memory();
    fits_memory("grids", &[memory], 1)?;
    let samples = grid::samples(&plan);
    options.cancel.map_or(Ok(()), Cancel::check)?;
    let back = plan.scale.recip();
    Ok(Some(Sum {
        samples: Samples::new(&samples, back, options.tolerance),
        power: plan.errors.iter().map(|errors| errors.power * back * back).collect(),
        coherence: plan.energy.sqrt(),
        report: Report {
            is_single: size_of::<T>() == 4,
            width: plan.steps.width,
            num_grids: plan.steps.degrees.len(),
            num_blocks: plan.groups.iter().map(|group| group.blocks.len()).max().unwrap_or(0),
            longest: plan.errors.iter().map(|errors| errors.longest).fold(0.0, f64::max),
            memory,
            error: plan.error,
            ..Report::new("chirp-wise NUFFT", groups)
        },
    }))
}

#[cfg(test)]
mod tests;
