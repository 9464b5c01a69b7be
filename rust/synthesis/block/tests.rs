use super::*;
use crate::numeric::simd::{Kernel, Level};

struct Load<'a>(&'a mut Chunk, &'a PathSeries<'a>, usize, &'a Block, Selection<'a>);

impl Kernel for Load<'_> {
    type Output = ();
    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) {
        self.0.load::<I>(self.1, 0, self.2, self.3, self.4);
    }
}

/// The paths of a class, found by themselves.
fn load(chunk: &mut Chunk, series: &PathSeries, first: usize, block: &Block, class: Class) {
    let mut rows = Rows::new(series);
    let masks: Vec<u128> = (0..series.num_paths)
        .step_by(CHUNK)
        .map(|first| {
            rows.gather(series, 0, first, Selection::ALL);
            rows.moving()
        })
        .collect();
    Level::best().run(Load(chunk, series, first, block, Selection::new(class, &masks, 1)));
}

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
fn series_in_every_block_is_the_polynomial_of_the_frame() {
    let wf = waveform();
    // Two paths, delay d + r T + a T^2 / 2.
    let (d, r, a) = ([1e-8, 2e-8], [3e-8, 0.0], [4e-6, 0.0]);
    let amplitude = [Complex64::new(1.0, 2.0), Complex64::new(3.0, 0.0)];
    let rows: [&[f64]; 3] = [&d, &r, &a];
    let taylor = PathSeries {
        basis: Basis::Taylor,
        delay: &rows,
        amplitude: &[&amplitude],
        num_channels: 1,
        num_paths: 2,
    };
    let tau = |path: usize, t: f64| d[path] + r[path] * t + 0.5 * a[path] * t * t;
    let nodes: Vec<Vec<f64>> = (0..4)
        .map(|j| {
            let x = -(std::f64::consts::PI * f64::from(2 * j + 1) / 8.0).cos();
            let t = 0.5 * wf.duration() * (1.0 + x);
            vec![tau(0, t), tau(1, t)]
        })
        .collect();
    let nodes: Vec<&[f64]> = nodes.iter().map(Vec::as_slice).collect();
    let nodal = PathSeries {
        basis: Basis::Chebyshev,
        delay: &nodes,
        ..taylor
    };
    for series in [taylor, nodal] {
        for block in Block::split(&wf, &series, 3) {
            let mut chunk = Chunk::new(&series);
            load(&mut chunk, &series, 0, &block, Class::All);
            assert_eq!(chunk.len, 2);
            for time in [block.center - block.half, block.center, block.center + 0.7 * block.half] {
                let x = block.x(time);
                for path in 0..2 {
                    let c = |k: usize| chunk.delay[k][path];
                    let got = c(0) + c(1) * x + c(2) * (2.0 * x * x - 1.0);
                    assert!((got - tau(path, time)).abs() < 1e-22, "{got} {}", tau(path, time));
                }
            }
            for (class, path) in [(Class::Moving, 0), (Class::Still, 1)] {
                load(&mut chunk, &series, 0, &block, class);
                assert_eq!(chunk.len, 1);
                // T_0(0) = 1, T_2(0) = -1
                let middle = chunk.delay[0][0] - chunk.delay[2][0];
                assert!((middle - tau(path, block.center)).abs() < 1e-22);
                assert_eq!(chunk.re[0][0], amplitude[path].re);
                assert_eq!(chunk.re[0][1], 0.0);
            }
        }
    }
}

#[test]
fn classes_of_every_size_keep_their_order() {
    let wf = waveform();
    let delay: Vec<f64> = (0..300).map(|i| 1e-8 + 1e-11 * f64::from(i)).collect();
    let amplitude: Vec<Complex64> = (0..300).map(|i| Complex64::new(f64::from(i), 0.0)).collect();
    for rule in [2, 3, 299, 1000] {
        let rate: Vec<f64> = (0..300).map(|i| if i % rule == 1 { 1e-9 } else { 0.0 }).collect();
        let rows: [&[f64]; 2] = [&delay, &rate];
        let series = PathSeries {
            basis: Basis::Taylor,
            delay: &rows,
            amplitude: &[&amplitude],
            num_channels: 1,
            num_paths: 300,
        };
        let block = Block::new(&wf, &series, 0..10);
        let mut chunk = Chunk::new(&series);
        for class in [Class::Still, Class::Moving] {
            let mut got = Vec::new();
            for first in (0..300).step_by(CHUNK) {
                load(&mut chunk, &series, first, &block, class);
                got.extend(chunk.re[0][..chunk.len].iter().map(|re| *re as usize));
            }
            let expected: Vec<usize> = (0..300)
                .filter(|i| (i % rule as usize == 1) == (class == Class::Moving))
                .collect();
            assert_eq!(got, expected);
        }
    }
}
