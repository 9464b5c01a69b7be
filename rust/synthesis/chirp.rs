//! Waveform: times of the samples and frequencies of the ramps.

use crate::error::{Error, Result};

/// A frame of linear ramps and its sampling; SI units.
#[derive(Clone, Debug)]
pub struct Waveform {
    /// Frequency at the start of the ramp [Hz].
    pub start_frequency: f64,
    /// Slope of the ramp [Hz/s], negative for a down-chirp.
    pub slope: f64,
    /// Samples per second [Hz].
    pub sample_rate: f64,
    /// Time from the start of the ramp to its first sample [s].
    pub adc_delay: f64,
    /// Samples per chirp.
    pub num_samples: usize,
    /// Start of every ramp after the start of the frame [s].
    pub chirp_times: Vec<f64>,
}

impl Waveform {
    /// Refuse waveforms that cannot be summed for; Python checks the rest.
    pub fn check(&self) -> Result<()> {
        let numbers = [self.start_frequency, self.slope, self.sample_rate, self.adc_delay];
        if numbers.iter().chain(&self.chirp_times).any(|x| !x.is_finite()) {
            return Err(Error::value("waveform", "finite numbers", format!("{numbers:?}")));
        }
        if self.num_samples == 0 || self.chirp_times.is_empty() || self.sample_rate <= 0.0 {
            return Err(Error::value(
                "waveform",
                "samples, chirps and a positive sample rate",
                format!("{self:?}"),
            ));
        }
        Ok(())
    }

    /// Time of a sample after the start of its ramp [s].
    pub fn sample_time(&self, sample: usize) -> f64 {
        self.adc_delay + sample as f64 / self.sample_rate
    }

    /// Duration of the frame, from the start of the first ramp to the last sample of the last chirp [s].
    pub fn duration(&self) -> f64 {
        self.chirp_times.last().copied().unwrap_or(0.0) + self.sample_time(self.num_samples - 1)
    }

    /// Centre of the sampled band [Hz].
    pub fn center_frequency(&self) -> f64 {
        self.start_frequency + self.slope * (self.adc_delay + self.num_samples as f64 / (2.0 * self.sample_rate))
    }

    /// Field at the frequency of every sample over the field at the centre of the band, for fields that fall with a power
    /// of the frequency; empty for power 0.
    pub fn over_frequency(&self, order: u8) -> Vec<f64> {
        if order == 0 {
            return Vec::new();
        }
        let frequency = |sample| self.start_frequency + self.slope * self.sample_time(sample);
        let ratio = |sample| (self.center_frequency() / frequency(sample)).powi(i32::from(order));
        (0..self.num_samples).map(ratio).collect()
    }

    /// Ratio of the largest expected rms of errors with random phases to the mean: few samples fluctuate.
    pub fn fluctuation(&self) -> f64 {
        let number = (self.chirp_times.len() * self.num_samples) as f64;
        // Three standard deviations of the mean of squares of normal numbers.
        (1.0 + 3.0 / number.sqrt()).sqrt()
    }

    /// Time of the middle sample, number `num_samples / 2`, after the start of its ramp [s].
    pub fn middle_time(&self) -> f64 {
        self.sample_time(self.num_samples / 2)
    }

    /// Time from the middle sample to the farthest one [s]; half a sampling interval if there is only one sample.
    pub fn half_sweep(&self) -> f64 {
        (self.num_samples as f64 / 2.0).floor().max(0.5) / self.sample_rate
    }
}
