//! AVX-512 F and DQ: vectors of one register.

#[allow(clippy::wildcard_imports)] // intrinsics have long names of their own
use std::arch::x86_64::*;

use super::vector::{Isa, Kernel, Vector};

/// A kernel compiled for AVX-512.
#[target_feature(enable = "avx2,fma,avx512f,avx512dq")]
pub(super) fn run<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}

/// One register.
#[derive(Clone, Copy)]
struct One<R>(R);

// SAFETY, of all blocks below: these types are only used inside [`run`], which runs on processors that have the
// instructions; pointers are the caller's promise.

struct Avx512;

impl Isa for Avx512 {
    const REGISTERS: usize = 1;
    const IS_FUSED: bool = true;
    type F32 = One<__m512>;
    type F64 = One<__m512d>;
    #[cfg_attr(optimised, inline(always))]
    fn narrow(low: Self::F64, high: Self::F64) -> Self::F32 {
        unsafe {
            let (low, high) = (_mm512_cvtpd_ps(low.0), _mm512_cvtpd_ps(high.0));
            let low = _mm512_castps_pd(_mm512_castps256_ps512(low));
            One(_mm512_castpd_ps(_mm512_insertf64x4::<1>(low, _mm256_castps_pd(high))))
        }
    }
    #[cfg_attr(optimised, inline(always))]
    fn equal(numbers: &[u32; 16], number: u32) -> u32 {
        unsafe {
            let v = _mm512_loadu_si512(numbers.as_ptr().cast());
            u32::from(_mm512_cmpeq_epi32_mask(v, _mm512_set1_epi32(number.cast_signed())))
        }
    }
    #[cfg_attr(optimised, inline(always))]
    fn put(numbers: &mut [u32; 16], bits: u32, number: u32) {
        unsafe {
            let number = _mm512_set1_epi32(number.cast_signed());
            _mm512_mask_storeu_epi32(numbers.as_mut_ptr().cast(), bits as u16, number);
        }
    }
}

macro_rules! avx512_vector {
    ($register:ty, $scalar:ty, $lanes:literal, $set1:ident, $add:ident, $sub:ident, $mul:ident, $fmadd:ident,
     $fnmadd:ident, $div:ident, $sqrt:ident, $min:ident, $max:ident, $compare:ident, $mask:ty, $largest:ident, $first:ident, $loadu:ident,
     $storeu:ident, $blend:ident, $upper:literal, $odd:literal, $permute:ident, $low:expr, $high:expr) => {
        impl Vector for One<$register> {
            type Scalar = $scalar;
            const LANES: usize = $lanes;
            #[cfg_attr(optimised, inline(always))]
            fn splat(x: $scalar) -> Self {
                Self(unsafe { $set1(x) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn halves(a: $scalar, b: $scalar) -> Self {
                Self(unsafe { $blend($upper, $set1(a), $set1(b)) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn alternate(re: $scalar, im: $scalar) -> Self {
                Self(unsafe { $blend($odd, $set1(re), $set1(im)) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn pairs(self) -> [Self; 2] {
                unsafe { [Self($permute($low, self.0)), Self($permute($high, self.0))] }
            }
            #[cfg_attr(optimised, inline(always))]
            fn add(self, b: Self) -> Self {
                Self(unsafe { $add(self.0, b.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn sub(self, b: Self) -> Self {
                Self(unsafe { $sub(self.0, b.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul(self, b: Self) -> Self {
                Self(unsafe { $mul(self.0, b.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Self(unsafe { $fmadd(self.0, b.0, c.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                Self(unsafe { $fnmadd(self.0, b.0, c.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn min(self, b: Self) -> Self {
                Self(unsafe { $min(self.0, b.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn max(self, b: Self) -> Self {
                Self(unsafe { $max(self.0, b.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn div(self, b: Self) -> Self {
                Self(unsafe { $div(self.0, b.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn sqrt(self) -> Self {
                Self(unsafe { $sqrt(self.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn at_most(self, b: Self) -> u32 {
                u32::from(unsafe { $compare::<_CMP_LE_OQ>(self.0, b.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn equal(self, b: Self) -> u32 {
                u32::from(unsafe { $compare::<_CMP_EQ_OQ>(self.0, b.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            fn first(self) -> $scalar {
                unsafe { $first(self.0) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn largest(self) -> $scalar {
                unsafe { $largest(self.0) }
            }
            #[cfg_attr(optimised, inline(always))]
            fn select(self, bits: u32, b: Self) -> Self {
                Self(unsafe { $blend(bits as $mask, b.0, self.0) })
            }
            #[cfg_attr(optimised, inline(always))]
            unsafe fn load_unchecked(from: *const $scalar) -> Self {
                Self(unsafe { $loadu(from) })
            }
            #[cfg_attr(optimised, inline(always))]
            unsafe fn store_unchecked(self, to: *mut $scalar) {
                unsafe { $storeu(to, self.0) }
            }
        }
    };
}

avx512_vector!(
    __m512,
    f32,
    16,
    _mm512_set1_ps,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_mul_ps,
    _mm512_fmadd_ps,
    _mm512_fnmadd_ps,
    _mm512_div_ps,
    _mm512_sqrt_ps,
    _mm512_min_ps,
    _mm512_max_ps,
    _mm512_cmp_ps_mask,
    __mmask16,
    _mm512_reduce_max_ps,
    _mm512_cvtss_f32,
    _mm512_loadu_ps,
    _mm512_storeu_ps,
    _mm512_mask_blend_ps,
    0xff00,
    0xaaaa,
    _mm512_permutexvar_ps,
    _mm512_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7),
    _mm512_setr_epi32(8, 8, 9, 9, 10, 10, 11, 11, 12, 12, 13, 13, 14, 14, 15, 15)
);
avx512_vector!(
    __m512d,
    f64,
    8,
    _mm512_set1_pd,
    _mm512_add_pd,
    _mm512_sub_pd,
    _mm512_mul_pd,
    _mm512_fmadd_pd,
    _mm512_fnmadd_pd,
    _mm512_div_pd,
    _mm512_sqrt_pd,
    _mm512_min_pd,
    _mm512_max_pd,
    _mm512_cmp_pd_mask,
    __mmask8,
    _mm512_reduce_max_pd,
    _mm512_cvtsd_f64,
    _mm512_loadu_pd,
    _mm512_storeu_pd,
    _mm512_mask_blend_pd,
    0xf0,
    0xaa,
    _mm512_permutexvar_pd,
    _mm512_setr_epi64(0, 0, 1, 1, 2, 2, 3, 3),
    _mm512_setr_epi64(4, 4, 5, 5, 6, 6, 7, 7)
);
