//! Chirp-wise NUFFT: every path spread over range in the chirps of all lanes at once, one transform over range per chirp.
//!
//! Within a chirp a path is nearly a tone, whose phase and frequency in the middle of every chirp follow from a short
//! Chebyshev series over the frame, or over a block of chirps where motion is fast. A record has its coefficients;
//! tables have what multiplies them, the same for all paths. The tone is spread over a few cells of a periodic grid of
//! ranges; the transform of the grid, divided by that of the kernel, has its samples. What a path is besides a tone is
//! expanded in powers of fast time, each of which has a grid of its own. What stands still is spread once for all chirps.
//!
//! The error is known before the sum: that of the kernel, and what the records leave out.

mod build;
mod coherence;
mod errors;
mod grid;
mod number;
mod plan;
mod record;
mod spread;
mod tables;

use num_complex::{Complex32, Complex64};

use crate::cancel::Cancel;
use crate::error::{Result, fits_memory};
use crate::synthesis::chirp::Waveform;
use crate::synthesis::report::{Options, Report, SINGLE_TOLERANCE, Samples, Sum};
use crate::synthesis::source::PathGroup;
use number::Number;
use plan::Plan;

/// Smallest tolerance for which sums are tried in single precision.
const LEAST_SINGLE: f64 = 3e-6;

/// Name of the engine.
const NAME: &str = "chirp-wise NUFFT";

/// Records of all paths in the precision that keeps the tolerance.
enum Records<'a> {
    Single(Plan<'a, f32>),
    Double(Plan<'a, f64>),
}

/// A sum that is ready to run.
pub struct Prepared<'a> {
    /// Report of the sum before it runs.
    pub report: Report,
    records: Records<'a>,
    options: &'a Options<'a>,
}

/// Prepare a sum over paths: their records, and the cheapest steps that keep the tolerance.
pub fn prepare<'a>(
    waveform: &'a Waveform,
    groups: &'a [PathGroup<'a>],
    options: &'a Options<'a>,
) -> Result<Prepared<'a>> {
    let single = if options.tolerance >= LEAST_SINGLE && !options.known.needs_double {
        Some(Plan::new(waveform, groups, options)?).filter(|plan| plan.keeps(options.known))
    } else {
        None
    };
    let records = match single {
        Some(plan) => Records::Single(plan),
        None => Records::Double(Plan::new(waveform, groups, options)?),
    };
    let mut report = match &records {
        Records::Single(plan) => report(plan),
        Records::Double(plan) => report(plan),
    };
    let count = |is_static: bool| -> usize {
        let shapes = groups.iter().map(|group| group.source.shape());
        shapes
            .filter(|shape| !is_static || shape.is_static())
            .map(|shape| shape.channels * shape.paths)
            .sum()
    };
    (report.num_paths, report.num_static) = (count(false), count(true));
    Ok(Prepared {
        report,
        records,
        options,
    })
}

/// Report of the sum of a plan.
fn report<T: Number>(plan: &Plan<T>) -> Report {
    Report {
        engine: NAME,
        is_single: size_of::<T>() == 4,
        width: plan.steps.width,
        num_grids: plan.steps.num_grids(),
        num_blocks: plan.num_blocks(),
        longest: plan.errors.iter().map(|errors| errors.longest).fold(0.0, f64::max),
        memory: plan.memory(),
        error: plan.error,
        ..Report::default()
    }
}

impl Prepared<'_> {
    /// Sum over the paths.
    pub fn run(self) -> Result<Sum> {
        fits_memory("grids", &[self.report.memory], 1)?;
        let (samples, power, coherence) = match &self.records {
            Records::Single(plan) => (unscaled(plan.samples()), plan.power(), &plan.coherence),
            Records::Double(plan) => (self.narrowed(plan.samples().0), plan.power(), &plan.coherence),
        };
        self.options.cancel.map_or(Ok(()), Cancel::check)?;
        Ok(Sum {
            samples,
            power,
            coherence: coherence.iter().map(|own| own.energy.sqrt()).fold(1.0, f64::max),
            report: self.report,
        })
    }

    /// Samples in the precision of the result.
    fn narrowed(&self, samples: Vec<Complex64>) -> Samples {
        if self.options.tolerance < SINGLE_TOLERANCE {
            return Samples::Double(samples);
        }
        let narrow = |sample: &Complex64| Complex32::new(sample.re as f32, sample.im as f32);
        Samples::Single(samples.iter().map(narrow).collect())
    }
}

/// Samples without a scale, which may be out of the range of single precision where they are not.
fn unscaled((mut samples, scale): (Vec<Complex32>, f64)) -> Samples {
    if scale != 1.0 {
        for sample in &mut samples {
            let [re, im] = [sample.re, sample.im].map(|part| f64::from(part) / scale);
            *sample = Complex32::new(re as f32, im as f32);
        }
    }
    Samples::Single(samples)
}

#[cfg(test)]
mod tests;
