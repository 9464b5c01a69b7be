//! Gain of the receiver for echoes of a distance: filters of the baseband act on the beat frequency, which is that.

use num_complex::Complex64;

use crate::error::{Error, Result};

/// Complex field gain over the length of paths, there and back: linear between equal steps from zero, constant beyond.
#[derive(Clone, Debug)]
pub struct ReceiverResponse {
    /// Steps per metre.
    rate: f64,
    gains: Vec<Complex64>,
}

impl ReceiverResponse {
    /// Response with given gains at lengths from 0 to `longest` [m].
    pub fn new(longest: f64, gains: Vec<Complex64>) -> Result<Self> {
        if !(longest > 0.0 && longest.is_finite()) {
            return Err(Error::value("longest_path", "a positive length in m", longest));
        }
        if gains.len() < 2 {
            return Err(Error::value("responses", "at least two gains", gains.len()));
        }
        if let Some(bad) = gains.iter().find(|gain| !gain.is_finite()) {
            return Err(Error::value("responses", "finite gains", bad));
        }
        let rate = (gains.len() - 1) as f64 / longest;
        Ok(Self { rate, gains })
    }

    /// Gain for a path of a length [m].
    #[cfg_attr(optimised, inline(always))] // part of kernels
    pub fn gain(&self, length: f64) -> Complex64 {
        let place = length * self.rate;
        let last = self.gains.len() - 1;
        let below = (place as usize).min(last);
        let (low, high) = (self.gains[below], self.gains[(below + 1).min(last)]);
        low + (high - low) * (place - below as f64).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_response_is_refused() {
        let one = Complex64::new(1.0, 0.0);
        for longest in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(ReceiverResponse::new(longest, vec![one; 2]).is_err());
        }
        assert!(ReceiverResponse::new(1.0, vec![one]).is_err());
        assert!(ReceiverResponse::new(1.0, vec![one, Complex64::new(f64::NAN, 0.0)]).is_err());
    }
}
