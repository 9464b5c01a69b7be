//! Normally distributed numbers by counter: any of them without those before, on every instruction set the same bits.

use super::simd::{Isa, Kernel, Level, Real};

/// Counters of a batch.
const LANES: usize = 16;

/// Numbers that a batch gives: four of every counter.
const BATCH: usize = 4 * LANES;

/// Add independent numbers of the normal distribution with mean 0 and a standard `deviation`.
///
/// Each is a function of its index, of `seed` and of `stream`, whose streams are independent. They have 24 bits and
/// stay within 6.8 deviations.
pub fn add_normal<T: Real>(level: Level, numbers: &mut [T], deviation: f64, seed: u64, stream: u64) {
    level.run(AddNormal {
        numbers,
        deviation: deviation as f32,
        seed: halves(seed),
        stream: halves(stream),
    });
}

struct AddNormal<'a, T> {
    numbers: &'a mut [T],
    deviation: f32,
    seed: [u32; 2],
    stream: [u32; 2],
}

impl<T: Real> Kernel for AddNormal<'_, T> {
    type Output = ();

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) {
        for (batch, numbers) in self.numbers.chunks_mut(BATCH).enumerate() {
            let mut counters = [[0; LANES]; 4];
            for lane in 0..LANES {
                let [low, high] = halves((batch * LANES + lane) as u64);
                (counters[0][lane], counters[1][lane]) = (low, high);
                (counters[2][lane], counters[3][lane]) = (self.stream[0], self.stream[1]);
            }
            let [a, b, c, d] = philox(counters, self.seed);
            let normal = [box_muller(a, b), box_muller(c, d)];
            let normal = normal.as_flattened().as_flattened();
            for (number, normal) in numbers.iter_mut().zip(normal) {
                *number = *number + T::of(f64::from(self.deviation * *normal));
            }
        }
    }
}

/// Low and high half of a number.
fn halves(number: u64) -> [u32; 2] {
    [number as u32, (number >> 32) as u32]
}

/// Philox4x32-10, four random words for each of [`LANES`] counters: Salmon, Moraes, Dror, Shaw, Parallel random
/// numbers: as easy as 1, 2, 3, SC 2011.
#[cfg_attr(optimised, inline(always))]
fn philox(counters: [[u32; LANES]; 4], mut key: [u32; 2]) -> [[u32; LANES]; 4] {
    // As lower halves of 64-bit products: words of 32 bits would need unpacking for every product.
    let mut wide = [[0; LANES]; 4];
    for (wide, narrow) in wide.as_flattened_mut().iter_mut().zip(counters.as_flattened()) {
        *wide = u64::from(*narrow);
    }
    for _ in 0..10 {
        for lane in 0..LANES {
            // No closure: one that is not inlined would take the loop out of its instruction set.
            let first = (wide[0][lane] & 0xFFFF_FFFF) * 0xD251_1F53;
            let second = (wide[2][lane] & 0xFFFF_FFFF) * 0xCD9E_8D57;
            wide[0][lane] = (second >> 32) ^ wide[1][lane] ^ u64::from(key[0]);
            wide[1][lane] = second;
            wide[2][lane] = (first >> 32) ^ wide[3][lane] ^ u64::from(key[1]);
            wide[3][lane] = first;
        }
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    let mut words = counters;
    for (narrow, wide) in words.as_flattened_mut().iter_mut().zip(wide.as_flattened()) {
        *narrow = *wide as u32;
    }
    words
}

/// Two normally distributed numbers of two random words: Box and Muller, A note on the generation of random normal
/// deviates, 1958.
#[cfg_attr(optimised, inline(always))]
fn box_muller(radius: [u32; LANES], angle: [u32; LANES]) -> [[f32; LANES]; 2] {
    const UNIT: f32 = 1.0 / 4_294_967_296.0;
    let mut pair = [[0.0; LANES]; 2];
    for lane in 0..LANES {
        // The middle of the word's interval, never zero.
        let length = (-2.0 * ln((radius[lane] as f32 + 0.5) * UNIT)).sqrt();
        let [cos, sin] = cos_sin(angle[lane]);
        pair[0][lane] = length * cos;
        pair[1][lane] = length * sin;
    }
    pair
}

/// Cosine and sine of an angle, a word for one turn, to 4e-7: series within 1/8 turn, then one of the four quarters.
#[cfg_attr(optimised, inline(always))]
fn cos_sin(word: u32) -> [f32; 2] {
    // The lower 30 bits as -1/8 to 1/8 turn [rad].
    let x = (word << 2).cast_signed() as f32 * (std::f32::consts::FRAC_PI_4 / 2_147_483_648.0);
    let z = x * x;
    let sin = x - x * z * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0)));
    let cos = 1.0 - z * (0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0 - z * (1.0 / 40_320.0))));
    // The upper two: exchange both, or turn by half a turn.
    let exchange = word & 0x4000_0000 != 0;
    let sign = f32::from_bits(1.0_f32.to_bits() | (word & 0x8000_0000));
    let (first, second) = if exchange { (-sin, cos) } else { (cos, sin) };
    [sign * first, sign * second]
}

/// Natural logarithm of a number in (0, 1], at most 0, to 2e-7 of it: 2 atanh((m - 1) / (m + 1)) of the mantissa m.
#[cfg_attr(optimised, inline(always))]
fn ln(x: f32) -> f32 {
    const HALF_ROOT: u32 = 0x3F35_04F3;
    // Mantissa from sqrt(1/2) to sqrt(2).
    let shifted = x.to_bits().wrapping_sub(HALF_ROOT);
    let exponent = shifted.cast_signed() >> 23;
    let mantissa = f32::from_bits((shifted & 0x007F_FFFF) + HALF_ROOT);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let z = s * s;
    let tail = z * (1.0 / 3.0 + z * (0.2 + z * (1.0 / 7.0 + z * (1.0 / 9.0))));
    (exponent as f32 * std::f32::consts::LN_2 + 2.0 * (s + s * tail)).min(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_words_are_those_of_the_authors_test_vectors() {
        let vectors: [([u32; 4], [u32; 2], [u32; 4]); 3] = [
            ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            (
                [u32::MAX; 4],
                [u32::MAX; 2],
                [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd],
            ),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ];
        for (counter, key, expected) in vectors {
            let words = philox(counter.map(|word| [word; LANES]), key);
            assert_eq!(words.map(|word| word[3]), expected);
        }
    }

    #[test]
    fn functions_agree_with_the_library() {
        for k in 1..=100_000_u32 {
            let x = k as f32 / 100_000.0;
            for x in [x, x * x, x.powi(6).max(1e-30)] {
                let expected = f64::from(x).ln();
                assert!((f64::from(ln(x)) - expected).abs() <= 3e-7 * expected.abs(), "{x}");
            }
            let word = k.wrapping_mul(2_654_435_761);
            // Bit 31 is bit 31 of a signed number, so the lower 30 bits count from the middle of their quarter.
            let quarter = f64::from(word >> 30) * 0.25;
            let within = f64::from((word << 2).cast_signed()) / 4_294_967_296.0 / 4.0;
            let (sin, cos) = (std::f64::consts::TAU * (quarter + within)).sin_cos();
            let got = cos_sin(word).map(f64::from);
            assert!((got[0] - cos).abs() < 4e-7 && (got[1] - sin).abs() < 4e-7, "{word}");
        }
        assert_eq!(ln(1.0), 0.0);
    }

    #[test]
    fn moments_and_tails_are_those_of_the_normal_distribution() {
        let mut numbers = vec![0.0; 4_000_000];
        add_normal(Level::best(), &mut numbers, 1.0, 1, 2);
        let n = numbers.len() as f64;
        let moment = |power: i32| numbers.iter().map(|x: &f64| x.powi(power)).sum::<f64>() / n;
        // Variances of the means: 1, 2, 15, 96 over n.
        for (power, expected, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
            let error: f64 = moment(power) - expected;
            assert!(error.abs() < 4.0 * f64::sqrt(variance / n), "{power} {error}");
        }
        // Shares beyond 1, 2, 3 and 4 deviations, tables of the distribution.
        for (limit, share) in [
            (1.0, 0.317_310_5),
            (2.0, 0.045_500_26),
            (3.0, 0.002_699_8),
            (4.0, 6.334e-5),
        ] {
            let beyond = numbers.iter().filter(|x| x.abs() > limit).count() as f64 / n;
            assert!((beyond - share).abs() < 4.0 * (share / n).sqrt(), "{limit} {beyond}");
        }
    }

    #[test]
    fn numbers_belong_to_index_seed_and_stream_on_every_instruction_set() {
        let of = |level: Level, len: usize, seed: u64, stream: u64| {
            let mut numbers = vec![0.0_f32; len];
            add_normal(level, &mut numbers, 1.0, seed, stream);
            numbers
        };
        let expected = of(Level::best(), 200, 7, 1 << 40);
        for level in Level::available() {
            assert_eq!(of(level, 200, 7, 1 << 40), expected);
            assert_eq!(of(level, 77, 7, 1 << 40), expected[..77]);
        }
        for (seed, stream) in [(7, 0), (8, 1 << 40), (7 | 1 << 32, 1 << 40)] {
            let other = of(Level::best(), 200, seed, stream);
            assert!(other.iter().zip(&expected).filter(|(a, b)| a == b).count() < 2);
        }
    }
}
