//! SSE2, which every x86-64 processor has: vectors of four registers.

#[allow(clippy::wildcard_imports)] // intrinsics have long names of their own
use std::arch::x86_64::*;

use super::vector::{Isa, Vector};

/// Instructions that the target guarantees.
pub(super) struct Baseline;

impl Isa for Baseline {
    const REGISTERS: usize = 4;
    const IS_FUSED: bool = false;
    type F32 = Four<__m128>;
    type F64 = Four<__m128d>;
    #[cfg_attr(optimised, inline(always))]
    fn narrow(low: Self::F64, high: Self::F64) -> Self::F32 {
        narrow(low, high)
    }
    #[cfg_attr(optimised, inline(always))]
    fn equal(numbers: &[u32; 16], number: u32) -> u32 {
        equal(numbers, number)
    }
    #[cfg_attr(optimised, inline(always))]
    fn put(numbers: &mut [u32; 16], bits: u32, number: u32) {
        put(numbers, bits, number);
    }
}

/// Four registers, lowest first. Operations are written out: loops over four, thousands in a kernel, take the compiler
/// a minute each kernel to unroll.
#[derive(Clone, Copy)]
pub struct Four<R>(R, R, R, R);

/// Result of an instruction on every register.
macro_rules! each {
    ($operation:ident($($v:expr),+)) => {
        unsafe {
            Self(
                $operation($($v.0),+),
                $operation($($v.1),+),
                $operation($($v.2),+),
                $operation($($v.3),+),
            )
        }
    };
}

/// Bit mask of a comparison, with `$lanes` bits of every register.
macro_rules! mask {
    ($bits:ident, $compare:ident, $lanes:expr, $a:expr, $b:expr) => {
        unsafe {
            $bits($compare($a.0, $b.0)).cast_unsigned()
                | $bits($compare($a.1, $b.1)).cast_unsigned() << $lanes
                | $bits($compare($a.2, $b.2)).cast_unsigned() << (2 * $lanes)
                | $bits($compare($a.3, $b.3)).cast_unsigned() << (3 * $lanes)
        }
    };
}

// SSE2 is part of x86-64.
macro_rules! sse2_vector {
    ($register:ty, $scalar:ty, $lanes:literal, $set1:ident, $alternate:expr, $add:ident, $sub:ident, $mul:ident,
     $div:ident, $sqrt:ident, $min:ident, $max:ident, $at_most:ident, $equal:ident, $first:ident, $bits:ident, $select:ident, $largest:ident,
     $loadu:ident, $storeu:ident, $low:ident, $high:ident) => {
        impl Vector for Four<$register> {
            type Scalar = $scalar;
            const LANES: usize = $lanes;
            #[cfg_attr(optimised, inline(always))]
            fn splat(x: $scalar) -> Self {
                let x = unsafe { $set1(x) };
                Self(x, x, x, x)
            }
            #[cfg_attr(optimised, inline(always))]
            fn halves(a: $scalar, b: $scalar) -> Self {
                let (a, b) = unsafe { ($set1(a), $set1(b)) };
                Self(a, a, b, b)
            }
            #[cfg_attr(optimised, inline(always))]
            fn alternate(re: $scalar, im: $scalar) -> Self {
                let alternate: fn($scalar, $scalar) -> $register = $alternate;
                let x = alternate(re, im);
                Self(x, x, x, x)
            }
            #[cfg_attr(optimised, inline(always))]
            fn pairs(self) -> [Self; 2] {
                let Self(a, b, c, d) = self;
                unsafe {
                    [
                        Self($low(a, a), $high(a, a), $low(b, b), $high(b, b)),
                        Self($low(c, c), $high(c, c), $low(d, d), $high(d, d)),
                    ]
                }
            }
            #[cfg_attr(optimised, inline(always))]
            fn add(self, b: Self) -> Self {
                each!($add(self, b))
            }
            #[cfg_attr(optimised, inline(always))]
            fn sub(self, b: Self) -> Self {
                each!($sub(self, b))
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul(self, b: Self) -> Self {
                each!($mul(self, b))
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul_add(self, b: Self, c: Self) -> Self {
                self.mul(b).add(c)
            }
            #[cfg_attr(optimised, inline(always))]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                c.sub(self.mul(b))
            }
            #[cfg_attr(optimised, inline(always))]
            fn min(self, b: Self) -> Self {
                each!($min(self, b))
            }
            #[cfg_attr(optimised, inline(always))]
            fn max(self, b: Self) -> Self {
                each!($max(self, b))
            }
            #[cfg_attr(optimised, inline(always))]
            fn at_most(self, b: Self) -> u32 {
                mask!($bits, $at_most, $lanes / 4, self, b)
            }
            #[cfg_attr(optimised, inline(always))]
            fn equal(self, b: Self) -> u32 {
                mask!($bits, $equal, $lanes / 4, self, b)
            }
            #[cfg_attr(optimised, inline(always))]
            fn first(self) -> $scalar {
                unsafe { $first(self.0) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn div(self, b: Self) -> Self {
                each!($div(self, b))
            }
            #[cfg_attr(optimised, inline(always))]
            fn sqrt(self) -> Self {
                each!($sqrt(self))
            }
            #[cfg_attr(optimised, inline(always))]
            fn largest(self) -> $scalar {
                let Self(a, b, c, d) = self;
                unsafe { $largest($max($max(a, b), $max(c, d))) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn select(self, bits: u32, b: Self) -> Self {
                Self(
                    $select(bits, self.0, b.0),
                    $select(bits >> ($lanes / 4), self.1, b.1),
                    $select(bits >> ($lanes / 2), self.2, b.2),
                    $select(bits >> (3 * $lanes / 4), self.3, b.3),
                )
            }
            #[cfg_attr(optimised, inline(always))]
            unsafe fn load_unchecked(from: *const $scalar) -> Self {
                unsafe {
                    Self(
                        $loadu(from),
                        $loadu(from.add($lanes / 4)),
                        $loadu(from.add($lanes / 2)),
                        $loadu(from.add(3 * $lanes / 4)),
                    )
                }
            }
            #[cfg_attr(optimised, inline(always))]
            unsafe fn store_unchecked(self, to: *mut $scalar) {
                unsafe {
                    $storeu(to, self.0);
                    $storeu(to.add($lanes / 4), self.1);
                    $storeu(to.add($lanes / 2), self.2);
                    $storeu(to.add(3 * $lanes / 4), self.3);
                }
            }
        }
    };
}

sse2_vector!(
    __m128,
    f32,
    16,
    _mm_set1_ps,
    |re, im| unsafe { _mm_setr_ps(re, im, re, im) },
    _mm_add_ps,
    _mm_sub_ps,
    _mm_mul_ps,
    _mm_div_ps,
    _mm_sqrt_ps,
    _mm_min_ps,
    _mm_max_ps,
    _mm_cmple_ps,
    _mm_cmpeq_ps,
    _mm_cvtss_f32,
    _mm_movemask_ps,
    select_sse2_ps,
    largest_ps,
    _mm_loadu_ps,
    _mm_storeu_ps,
    _mm_unpacklo_ps,
    _mm_unpackhi_ps
);
sse2_vector!(
    __m128d,
    f64,
    8,
    _mm_set1_pd,
    |re, im| unsafe { _mm_setr_pd(re, im) },
    _mm_add_pd,
    _mm_sub_pd,
    _mm_mul_pd,
    _mm_div_pd,
    _mm_sqrt_pd,
    _mm_min_pd,
    _mm_max_pd,
    _mm_cmple_pd,
    _mm_cmpeq_pd,
    _mm_cvtsd_f64,
    _mm_movemask_pd,
    select_sse2_pd,
    largest_pd,
    _mm_loadu_pd,
    _mm_storeu_pd,
    _mm_unpacklo_pd,
    _mm_unpackhi_pd
);

#[cfg_attr(optimised, inline(always))]
pub(super) unsafe fn largest_ps(v: __m128) -> f32 {
    unsafe {
        let v = _mm_max_ps(v, _mm_movehl_ps(v, v));
        _mm_cvtss_f32(_mm_max_ss(v, _mm_shuffle_ps::<1>(v, v)))
    }
}

#[cfg_attr(optimised, inline(always))]
pub(super) unsafe fn largest_pd(v: __m128d) -> f64 {
    unsafe { _mm_cvtsd_f64(_mm_max_sd(v, _mm_unpackhi_pd(v, v))) }
}

#[cfg_attr(optimised, inline(always))]
fn select_sse2_ps(bits: u32, a: __m128, b: __m128) -> __m128 {
    unsafe {
        let mask = mask_sse2(bits);
        _mm_or_ps(_mm_and_ps(mask, a), _mm_andnot_ps(mask, b))
    }
}

#[cfg_attr(optimised, inline(always))]
fn select_sse2_pd(bits: u32, a: __m128d, b: __m128d) -> __m128d {
    unsafe {
        let mask = mask_sse2(bits);
        let mask = _mm_castps_pd(_mm_unpacklo_ps(mask, mask));
        _mm_or_pd(_mm_and_pd(mask, a), _mm_andnot_pd(mask, b))
    }
}

/// All bits of a number set where its bit is.
#[cfg_attr(optimised, inline(always))]
fn mask_sse2(bits: u32) -> __m128 {
    unsafe {
        let places = _mm_setr_epi32(1, 2, 4, 8);
        let bits = _mm_and_si128(_mm_set1_epi32(bits.cast_signed()), places);
        _mm_castsi128_ps(_mm_cmpeq_epi32(bits, places))
    }
}

/// See `Isa::equal`.
#[cfg_attr(optimised, inline(always))]
fn equal(numbers: &[u32; 16], number: u32) -> u32 {
    let mut bits = 0;
    for i in 0..4 {
        unsafe {
            let v = _mm_loadu_si128(numbers.as_ptr().add(4 * i).cast());
            let is_equal = _mm_cmpeq_epi32(v, _mm_set1_epi32(number.cast_signed()));
            bits |= _mm_movemask_ps(_mm_castsi128_ps(is_equal)).cast_unsigned() << (4 * i);
        }
    }
    bits
}

/// See `Isa::put`.
#[cfg_attr(optimised, inline(always))]
fn put(numbers: &mut [u32; 16], bits: u32, number: u32) {
    for i in 0..4 {
        unsafe {
            let at: *mut __m128i = numbers.as_mut_ptr().add(4 * i).cast();
            let mask = _mm_castps_si128(mask_sse2(bits >> (4 * i)));
            let new = _mm_and_si128(mask, _mm_set1_epi32(number.cast_signed()));
            _mm_storeu_si128(at, _mm_or_si128(new, _mm_andnot_si128(mask, _mm_loadu_si128(at))));
        }
    }
}

/// Nearest f32 of twice 8 numbers.
#[cfg_attr(optimised, inline(always))]
fn narrow(low: Four<__m128d>, high: Four<__m128d>) -> Four<__m128> {
    let pair = |a: __m128d, b: __m128d| unsafe { _mm_movelh_ps(_mm_cvtpd_ps(a), _mm_cvtpd_ps(b)) };
    Four(
        pair(low.0, low.1),
        pair(low.2, low.3),
        pair(high.0, high.1),
        pair(high.2, high.3),
    )
}
