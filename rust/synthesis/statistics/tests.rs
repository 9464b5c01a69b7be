//! Tests of the statistics of paths.

use num_complex::Complex64;

use super::*;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::delay::Basis;

#[test]
fn bounding_paths_are_those_that_bend_most_one_of_neighbours() {
    let waveform = Waveform {
        start_frequency: 60e9,
        slope: 1e13,
        sample_rate: 2e6,
        adc_delay: 3e-6,
        num_samples: 64,
        chirp_times: (0..10).map(|c| f64::from(c) * 1e-4).collect(),
    };
    let num_paths = 1000;
    let (mut bend, mut amplitude) = (vec![0.0; 2 * num_paths], vec![Complex64::ONE; 2 * num_paths]);
    // Both channels, the second more; a neighbour; as much, but faint; a strong one that bends less; the last.
    (bend[100], bend[num_paths + 100], bend[101]) = (3e-8, 4e-8, 3.5e-8);
    (bend[300], amplitude[300]) = (4e-8, Complex64::new(1e-3, 0.0));
    (bend[500], amplitude[500]) = (2e-8, Complex64::new(0.0, 10.0));
    bend[2 * num_paths - 1] = 1e-8;
    let (delay, rate) = (vec![1e-8; 2 * num_paths], vec![0.0; 2 * num_paths]);
    let series = PathSeries {
        basis: Basis::Taylor,
        delay: &[&delay, &rate, &bend],
        amplitude: &[&amplitude],
        num_channels: 2,
        num_paths,
    };
    let frame = Block::new(&waveform, &series, 0..10);
    for level in Level::available() {
        let statistics = PathStatistics::new(&waveform, &series, &frame, 60e9, level, false);
        let bends: Vec<f64> = bounding_paths(&series, &statistics)
            .iter()
            .map(|sample| sample.delay(&frame).nth(2).unwrap() / frame.delay[2][2])
            .collect();
        for (got, expected) in bends.iter().zip([2e-8, 4e-8, 1e-8, 4e-8]) {
            assert!((got / expected - 1.0).abs() < 1e-9, "{bends:?}");
        }
        assert_eq!(bends.len(), 4, "{bends:?}");
    }
}
