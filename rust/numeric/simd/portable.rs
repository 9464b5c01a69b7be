//! Vectors as arrays, for processors other than x86-64: the compiler vectorises them.

use super::vector::{Isa, Vector};

/// Instructions that the target guarantees.
pub(super) struct Baseline;

impl Isa for Baseline {
    const REGISTERS: usize = 4;
    const IS_FUSED: bool = cfg!(target_arch = "aarch64");
    type F32 = [f32; 16];
    type F64 = [f64; 8];
    #[cfg_attr(optimised, inline(always))]
    fn narrow(low: [f64; 8], high: [f64; 8]) -> [f32; 16] {
        std::array::from_fn(|i| if i < 8 { low[i] as f32 } else { high[i - 8] as f32 })
    }
    #[cfg_attr(optimised, inline(always))]
    fn equal(numbers: &[u32; 16], number: u32) -> u32 {
        let mut bits = 0;
        for i in 0..16 {
            bits |= u32::from(numbers[i] == number) << i;
        }
        bits
    }
    #[cfg_attr(optimised, inline(always))]
    fn put(numbers: &mut [u32; 16], bits: u32, number: u32) {
        for i in 0..16 {
            numbers[i] = if bits >> i & 1 == 1 { number } else { numbers[i] };
        }
    }
}

macro_rules! array_vector {
    ($scalar:ty, $lanes:literal) => {
        impl Vector for [$scalar; $lanes] {
            type Scalar = $scalar;
            const LANES: usize = $lanes;
            #[cfg_attr(optimised, inline(always))]
            fn splat(x: $scalar) -> Self {
                [x; $lanes]
            }
            #[cfg_attr(optimised, inline(always))]
            fn halves(a: $scalar, b: $scalar) -> Self {
                let mut v = [a; $lanes];
                for i in $lanes / 2..$lanes {
                    v[i] = b;
                }
                v
            }
            #[cfg_attr(optimised, inline(always))]
            fn alternate(re: $scalar, im: $scalar) -> Self {
                let mut v = [re; $lanes];
                for i in 0..$lanes / 2 {
                    v[2 * i + 1] = im;
                }
                v
            }
            #[cfg_attr(optimised, inline(always))]
            fn pairs(self) -> [Self; 2] {
                let (mut low, mut high) = (self, self);
                for i in 0..$lanes {
                    low[i] = self[i / 2];
                    high[i] = self[$lanes / 2 + i / 2];
                }
                [low, high]
            }
            #[cfg_attr(optimised, inline(always))]
            fn add(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] += b[i];
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn sub(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] -= b[i];
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] *= b[i];
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul_add(mut self, b: Self, c: Self) -> Self {
                for i in 0..$lanes {
                    // Without the instruction, fused multiply-add is a call of the library.
                    self[i] = if cfg!(target_arch = "aarch64") {
                        self[i].mul_add(b[i], c[i])
                    } else {
                        self[i] * b[i] + c[i]
                    };
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn neg_mul_add(mut self, b: Self, c: Self) -> Self {
                for i in 0..$lanes {
                    self[i] = if cfg!(target_arch = "aarch64") {
                        (-self[i]).mul_add(b[i], c[i])
                    } else {
                        c[i] - self[i] * b[i]
                    };
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn min(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] = if self[i] < b[i] { self[i] } else { b[i] };
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn max(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] = if self[i] > b[i] { self[i] } else { b[i] };
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn at_most(self, b: Self) -> u32 {
                let mut bits = 0;
                for i in 0..$lanes {
                    bits |= u32::from(self[i] <= b[i]) << i;
                }
                bits
            }
            #[cfg_attr(optimised, inline(always))]
            fn equal(self, b: Self) -> u32 {
                let mut bits = 0;
                for i in 0..$lanes {
                    bits |= u32::from(self[i] == b[i]) << i;
                }
                bits
            }
            #[cfg_attr(optimised, inline(always))]
            fn first(self) -> $scalar {
                self[0]
            }
            #[cfg_attr(optimised, inline(always))]
            fn div(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] /= b[i];
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn sqrt(mut self) -> Self {
                for i in 0..$lanes {
                    self[i] = self[i].sqrt();
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn select(mut self, bits: u32, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] = if bits >> i & 1 == 1 { self[i] } else { b[i] };
                }
                self
            }
            #[cfg_attr(optimised, inline(always))]
            fn largest(self) -> $scalar {
                let mut largest = self[0];
                for i in 1..$lanes {
                    largest = if self[i] > largest { self[i] } else { largest };
                }
                largest
            }
            #[cfg_attr(optimised, inline(always))]
            unsafe fn load_unchecked(from: *const $scalar) -> Self {
                // SAFETY: the caller's.
                unsafe { from.cast::<Self>().read_unaligned() }
            }
            #[cfg_attr(optimised, inline(always))]
            unsafe fn store_unchecked(self, to: *mut $scalar) {
                // SAFETY: the caller's.
                unsafe { to.cast::<Self>().write_unaligned(self) }
            }
        }
    };
}

array_vector!(f32, 16);
array_vector!(f64, 8);
