//! Tests of the statistics of paths.

use num_complex::Complex64;

use super::*;
use crate::synthesis::delay::Basis;

fn waveform() -> Waveform {
    Waveform {
        start_frequency: 60e9,
        slope: 1e13,
        sample_rate: 2e6,
        adc_delay: 3e-6,
        num_samples: 64,
        chirp_times: (0..10).map(|c| f64::from(c) * 1e-4).collect(),
    }
}

#[test]
fn samples_are_half_of_the_drawn_paths_and_those_that_change_most() {
    let num_paths = 10_000;
    // Bends that no draw can miss.
    let bend: Vec<f64> = (0..num_paths)
        .map(|path| if path % 50 < 2 { 1e-7 } else { 1e-9 })
        .collect();
    let (delay, rate, amplitude) = (
        vec![1e-8; num_paths],
        vec![1e-9; num_paths],
        vec![Complex64::ONE; num_paths],
    );
    let series = PathSeries {
        basis: Basis::Taylor,
        delay: &[&delay, &rate, &bend],
        amplitude: &[&amplitude],
        num_channels: 1,
        num_paths,
    };
    let group = Group::new(&waveform(), &series, Selection::ALL, false);
    assert_eq!((group.num_paths, group.num_sampled), (num_paths, NUM_SAMPLED));
    assert_eq!(group.samples.len(), NUM_SAMPLED / ONE_IN + NUM_CHANGING);
    let frame = Block::new(&waveform(), &series, 0..10);
    let num_bent = group
        .samples
        .iter()
        .filter(|sample| sample.delay(&frame).nth(2).unwrap() > 5e-8 * frame.delay[2][2])
        .count();
    // Of 20 drawn half by chance, the others as they change most.
    assert!((15..30).contains(&num_bent), "{num_bent}");
    assert!((group.own[0] / num_paths as f64 - 1.0).abs() < 1e-12, "{:?}", group.own);
    let all = Group::new(&waveform(), &series, Selection::ALL, true);
    assert_eq!((all.samples.len(), all.num_sampled), (num_paths, num_paths));
}

#[test]
fn coherence_of_the_samples_is_that_of_all_paths() {
    let num_paths = 40_000;
    let unit = |path: usize, step: f64| (step * path as f64).fract();
    let delay: Vec<f64> = (0..num_paths).map(|path| 2e-8 * unit(path, 0.754_877_666)).collect();
    let rate: Vec<f64> = (0..num_paths).map(|path| 1e-7 * unit(path, 0.569_840_291)).collect();
    let amplitude = vec![Complex64::ONE; num_paths];
    let series = PathSeries {
        basis: Basis::Taylor,
        delay: &[&delay, &rate],
        amplitude: &[&amplitude],
        num_channels: 1,
        num_paths,
    };
    let some = Group::new(&waveform(), &series, Selection::ALL, false);
    let all = Group::new(&waveform(), &series, Selection::ALL, true);
    for count in [1, 2, 8] {
        let (some, all) = (some.coherence(count), all.coherence(count));
        assert!(all > 10.0 && (some / all - 1.0).abs() < 0.1, "{some} {all}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_seen_in_ranges() {
    let num_paths = 300;
    let amplitude = vec![Complex64::ONE; num_paths];
    for level in Level::available() {
        for bad in [f64::NAN, f64::INFINITY, 1.0] {
            let mut rate = vec![1e-9; num_paths];
            rate[137] = bad;
            let series = PathSeries {
                basis: Basis::Taylor,
                delay: &[&vec![1e-8; num_paths], &rate],
                amplitude: &[&amplitude],
                num_channels: 1,
                num_paths,
            };
            let frame = [Block::new(&waveform(), &series, 0..10)];
            let found = &ranges(&series, Selection::ALL, &frame, level, false)[0];
            assert_eq!(found[1].low.is_finite() && found[1].high.is_finite(), bad == 1.0);
        }
    }
}
