//! AVX2 with fused multiply-add: vectors of two registers.

#[allow(clippy::wildcard_imports)] // intrinsics have long names of their own
use std::arch::x86_64::*;

use super::sse2::{largest_pd, largest_ps};
use super::vector::{Isa, Kernel, Vector};

/// A kernel compiled for AVX2.
#[target_feature(enable = "avx2,fma")]
pub(super) fn run<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

/// Two registers, lower half first.
#[derive(Clone, Copy)]
struct Two<R>(R, R);

// SAFETY, of all blocks below: these types are only used inside [`run`], which runs on processors that have the
// instructions; pointers are the caller's promise.

struct Avx2;

impl Isa for Avx2 {
    const REGISTERS: usize = 2;
    const IS_FUSED: bool = true;
    type F32 = Two<__m256>;
    type F64 = Two<__m256d>;
    #[cfg_attr(optimised, inline(always))]
    fn narrow(low: Self::F64, high: Self::F64) -> Self::F32 {
        unsafe {
            Two(
                _mm256_set_m128(_mm256_cvtpd_ps(low.1), _mm256_cvtpd_ps(low.0)),
                _mm256_set_m128(_mm256_cvtpd_ps(high.1), _mm256_cvtpd_ps(high.0)),
            )
        }
    }
    #[cfg_attr(optimised, inline(always))]
    fn equal(numbers: &[u32; 16], number: u32) -> u32 {
        let mut bits = 0;
        for i in 0..2 {
            unsafe {
                let v = _mm256_loadu_si256(numbers.as_ptr().add(8 * i).cast());
                let is_equal = _mm256_cmpeq_epi32(v, _mm256_set1_epi32(number.cast_signed()));
                bits |= _mm256_movemask_ps(_mm256_castsi256_ps(is_equal)).cast_unsigned() << (8 * i);
            }
        }
        bits
    }
    #[cfg_attr(optimised, inline(always))]
    fn put(numbers: &mut [u32; 16], bits: u32, number: u32) {
        for i in 0..2 {
            unsafe {
                let at = numbers.as_mut_ptr().add(8 * i).cast();
                let mask = _mm256_castps_si256(mask_ps(bits >> (8 * i)));
                _mm256_maskstore_epi32(at, mask, _mm256_set1_epi32(number.cast_signed()));
            }
        }
    }
}

macro_rules! avx2_vector {
    ($register:ty, $scalar:ty, $lanes:literal, $set1:ident, $add:ident, $sub:ident, $mul:ident, $fmadd:ident,
     $fnmadd:ident, $div:ident, $sqrt:ident, $min:ident, $max:ident, $compare:ident, $bits:ident, $loadu:ident,
     $storeu:ident, $blend:ident, $odd:literal, $pairs:ident, $blendv:ident, $mask:ident,
     $extract:ident, $max128:ident, $largest:ident, $first:ident) => {
        impl Vector for Two<$register> {
            type Scalar = $scalar;
            const LANES: usize = $lanes;
            #[cfg_attr(optimised, inline(always))]
            fn splat(x: $scalar) -> Self {
                let x = unsafe { $set1(x) };
                Self(x, x)
            }
            #[cfg_attr(optimised, inline(always))]
            fn halves(a: $scalar, b: $scalar) -> Self {
                unsafe { Self($set1(a), $set1(b)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn alternate(re: $scalar, im: $scalar) -> Self {
                let x = unsafe { $blend::<$odd>($set1(re), $set1(im)) };
                Self(x, x)
            }
            #[cfg_attr(optimised, inline(always))]
            fn pairs(self) -> [Self; 2] {
                unsafe {
                    let (a, b) = ($pairs(self.0), $pairs(self.1));
                    [Self(a.0, a.1), Self(b.0, b.1)]
                }
            }
            #[cfg_attr(optimised, inline(always))]
            fn add(self, b: Self) -> Self {
                unsafe { Self($add(self.0, b.0), $add(self.1, b.1)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn sub(self, b: Self) -> Self {
                unsafe { Self($sub(self.0, b.0), $sub(self.1, b.1)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul(self, b: Self) -> Self {
                unsafe { Self($mul(self.0, b.0), $mul(self.1, b.1)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul_add(self, b: Self, c: Self) -> Self {
                unsafe { Self($fmadd(self.0, b.0, c.0), $fmadd(self.1, b.1, c.1)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                unsafe { Self($fnmadd(self.0, b.0, c.0), $fnmadd(self.1, b.1, c.1)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn min(self, b: Self) -> Self {
                unsafe { Self($min(self.0, b.0), $min(self.1, b.1)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn max(self, b: Self) -> Self {
                unsafe { Self($max(self.0, b.0), $max(self.1, b.1)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn div(self, b: Self) -> Self {
                unsafe { Self($div(self.0, b.0), $div(self.1, b.1)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn sqrt(self) -> Self {
                unsafe { Self($sqrt(self.0), $sqrt(self.1)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn equal(self, b: Self) -> u32 {
                let low = unsafe { $bits($compare::<_CMP_EQ_OQ>(self.0, b.0)) } as u32;
                let high = unsafe { $bits($compare::<_CMP_EQ_OQ>(self.1, b.1)) } as u32;
                low | high << ($lanes / 2)
            }
            #[cfg_attr(optimised, inline(always))]
            fn first(self) -> $scalar {
                unsafe { $first(self.0) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn largest(self) -> $scalar {
                unsafe {
                    let v = $max(self.0, self.1);
                    $largest($max128($extract::<0>(v), $extract::<1>(v)))
                }
            }
            #[cfg_attr(optimised, inline(always))]
            fn select(self, bits: u32, b: Self) -> Self {
                let (low, high) = ($mask(bits), $mask(bits >> ($lanes / 2)));
                unsafe { Self($blendv(b.0, self.0, low), $blendv(b.1, self.1, high)) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn at_most(self, b: Self) -> u32 {
                let low = unsafe { $bits($compare::<_CMP_LE_OQ>(self.0, b.0)) } as u32;
                let high = unsafe { $bits($compare::<_CMP_LE_OQ>(self.1, b.1)) } as u32;
                low | high << ($lanes / 2)
            }
            #[cfg_attr(optimised, inline(always))]
            unsafe fn load_unchecked(from: *const $scalar) -> Self {
                unsafe { Self($loadu(from), $loadu(from.add($lanes / 2))) }
            }
            #[cfg_attr(optimised, inline(always))]
            unsafe fn store_unchecked(self, to: *mut $scalar) {
                unsafe {
                    $storeu(to, self.0);
                    $storeu(to.add($lanes / 2), self.1);
                }
            }
        }
    };
}

#[cfg_attr(optimised, inline(always))]
unsafe fn pairs_ps(v: __m256) -> (__m256, __m256) {
    unsafe {
        (
            _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3)),
            _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(4, 4, 5, 5, 6, 6, 7, 7)),
        )
    }
}

#[cfg_attr(optimised, inline(always))]
unsafe fn pairs_pd(v: __m256d) -> (__m256d, __m256d) {
    unsafe {
        (
            _mm256_permute4x64_pd::<0b01_01_00_00>(v),
            _mm256_permute4x64_pd::<0b11_11_10_10>(v),
        )
    }
}

/// All bits of a number set where its bit is.
#[cfg_attr(optimised, inline(always))]
fn mask_ps(bits: u32) -> __m256 {
    unsafe {
        let places = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        let bits = _mm256_and_si256(_mm256_set1_epi32(bits.cast_signed()), places);
        _mm256_castsi256_ps(_mm256_cmpeq_epi32(bits, places))
    }
}

/// Double-precision counterpart.
#[cfg_attr(optimised, inline(always))]
fn mask_pd(bits: u32) -> __m256d {
    unsafe {
        let places = _mm256_setr_epi64x(1, 2, 4, 8);
        let bits = _mm256_and_si256(_mm256_set1_epi64x(i64::from(bits)), places);
        _mm256_castsi256_pd(_mm256_cmpeq_epi64(bits, places))
    }
}

avx2_vector!(
    __m256,
    f32,
    16,
    _mm256_set1_ps,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_mul_ps,
    _mm256_fmadd_ps,
    _mm256_fnmadd_ps,
    _mm256_div_ps,
    _mm256_sqrt_ps,
    _mm256_min_ps,
    _mm256_max_ps,
    _mm256_cmp_ps,
    _mm256_movemask_ps,
    _mm256_loadu_ps,
    _mm256_storeu_ps,
    _mm256_blend_ps,
    0xaa,
    pairs_ps,
    _mm256_blendv_ps,
    mask_ps,
    _mm256_extractf128_ps,
    _mm_max_ps,
    largest_ps,
    _mm256_cvtss_f32
);
avx2_vector!(
    __m256d,
    f64,
    8,
    _mm256_set1_pd,
    _mm256_add_pd,
    _mm256_sub_pd,
    _mm256_mul_pd,
    _mm256_fmadd_pd,
    _mm256_fnmadd_pd,
    _mm256_div_pd,
    _mm256_sqrt_pd,
    _mm256_min_pd,
    _mm256_max_pd,
    _mm256_cmp_pd,
    _mm256_movemask_pd,
    _mm256_loadu_pd,
    _mm256_storeu_pd,
    _mm256_blend_pd,
    0b1010,
    pairs_pd,
    _mm256_blendv_pd,
    mask_pd,
    _mm256_extractf128_pd,
    _mm_max_pd,
    largest_pd,
    _mm256_cvtsd_f64
);
