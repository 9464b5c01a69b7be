//! Chirp-wise NUFFT: every path spread over range in the chirps of all lanes at once, one transform over range per chirp.
//!
//! Within a chirp a path is nearly a tone, whose phase and frequency in the middle of every chirp follow from a short
//! Chebyshev series over the frame, or over a block of chirps where motion is fast. A record has its coefficients;
//! tables have what multiplies them, the same for all paths. The tone is spread over a few cells of a periodic grid of
//! ranges; the transform of the grid, divided by the transform of the kernel, has its samples. The deviation of a path
//! from a tone is expanded in Legendre polynomials of fast time, with a grid for each. Static paths are spread once for
//! all chirps.
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
use crate::synthesis::report::{Options, Prepared, Report, Samples, Sum};
use crate::synthesis::source::PathGroup;
use number::Number;
use plan::ChirpPlan;

/// Smallest tolerance for which sums are tried in single precision.
const LEAST_SINGLE: f64 = 3e-6;

/// Prepare a sum over paths: their records in the precision that keeps the tolerance, and the cheapest steps that do.
pub fn prepare<'a>(
    waveform: &'a Waveform,
    groups: &'a [PathGroup<'a>],
    options: &'a Options<'a>,
) -> Result<Prepared<'a>> {
    if options.tolerance >= LEAST_SINGLE && !options.known.needs_double {
        let plan = ChirpPlan::<f32>::new(waveform, groups, options)?;
        if plan.error.with_gain(options.known.gain) <= options.tolerance {
            return Ok(prepared(plan, groups));
        }
    }
    Ok(prepared(ChirpPlan::<f64>::new(waveform, groups, options)?, groups))
}

fn prepared<'a, T: Number>(plan: ChirpPlan<'a, T>, groups: &[PathGroup]) -> Prepared<'a> {
    let report = Report {
        is_single: size_of::<T>() == 4,
        width: plan.steps.width,
        num_grids: plan.steps.degrees.len(),
        num_blocks: plan.groups.iter().map(|group| group.blocks.len()).max().unwrap_or(0),
        longest: plan.errors.iter().map(|errors| errors.longest).fold(0.0, f64::max),
        memory: plan.memory(),
        error: plan.error,
        ..Report::new("chirp-wise NUFFT", groups)
    };
    Prepared {
        report: report.clone(),
        run: Box::new(move || run(&plan, report)),
    }
}

/// Sum over the paths of a plan.
fn run<T: Number>(plan: &ChirpPlan<T>, report: Report) -> Result<Sum> {
    fits_memory("grids", &[report.memory], 1)?;
    let samples = grid::samples(plan);
    plan.options.cancel.map_or(Ok(()), Cancel::check)?;
    let back = plan.scale.recip();
    Ok(Sum {
        samples: Samples::new(&samples, back, plan.options.tolerance),
        power: plan.errors.iter().map(|errors| errors.power * back * back).collect(),
        coherence: plan.energies.iter().copied().fold(1.0, f64::max).sqrt(),
        report,
    })
}

#[cfg(test)]
mod tests;
