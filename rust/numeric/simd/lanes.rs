//! Vectors of `fearless_simd` behind [`Isa`].

use std::hint::black_box;

use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, SimdNarrow, f32x16, f64x8, mask32x16, u32x16};

use super::vector::{Isa, Kernel, Vector};

/// A kernel compiled for an instruction set. Not inlined into `Level::run`, whose stack frame all levels share.
#[inline(never)]
pub(super) fn run<S: Simd, K: Kernel>(token: S, kernel: K) -> K::Output {
    token.vectorize(
        #[inline(always)]
        || {
            // Aligns the stack frame of the kernel. Without it, the compiler spills registers to unaligned places, some
            // across two cache lines.
            black_box(&mut CacheLine(0));
            kernel.run::<S>()
        },
    )
}

/// Data that has to be aligned; its only field gives it a size and is never read.
#[repr(align(64))]
struct CacheLine(#[allow(dead_code)] u8);

/// The token, which is no data and proves that the processor has the instructions. Vectors would otherwise need it to
/// be passed to all functions of kernels.
#[allow(unsafe_code)]
#[cfg_attr(optimised, inline(always))]
fn token<S: Simd>() -> S {
    const { assert!(size_of::<S>() == 0) };
    // SAFETY: a type without data. Its promise holds: nothing outside of this folder names an instruction set, and
    // kernels get theirs from `run`, which was given the token.
    unsafe { std::mem::transmute_copy(&()) }
}

impl<S: Simd> Isa for S {
    const IS_REGISTER: bool = size_of::<S::f32s>() == size_of::<Self::F32>();
    type F32 = f32x16<S>;
    type F64 = f64x8<S>;
    #[cfg_attr(optimised, inline(always))]
    fn narrow(low: Self::F64, high: Self::F64) -> Self::F32 {
        low.narrow(high)
    }
    #[cfg_attr(optimised, inline(always))]
    fn equal(numbers: &[u32; 16], number: u32) -> u32 {
        u32x16::load_array_ref(token::<S>(), numbers)
            .simd_eq(number)
            .to_bitmask() as u32
    }
    #[cfg_attr(optimised, inline(always))]
    fn put(numbers: &mut [u32; 16], bits: u32, number: u32) {
        let old = u32x16::load_array_ref(token::<S>(), numbers);
        let mask = mask32x16::from_bitmask(token::<S>(), bits.into());
        *numbers = mask.select(u32x16::splat(token::<S>(), number), old).into();
    }
}

macro_rules! vector {
    ($type:ident, $scalar:ty, $lanes:literal) => {
        impl<S: Simd> Vector for $type<S> {
            type Scalar = $scalar;
            const LANES: usize = $lanes;
            #[cfg_attr(optimised, inline(always))]
            fn splat(x: $scalar) -> Self {
                SimdBase::splat(token::<S>(), x)
            }
            #[cfg_attr(optimised, inline(always))]
            fn halves(a: $scalar, b: $scalar) -> Self {
                let (a, b): (Self, Self) = (Vector::splat(a), Vector::splat(b));
                Vector::select(a, u32::MAX >> (32 - $lanes / 2), b)
            }
            #[cfg_attr(optimised, inline(always))]
            fn interleave(self, b: Self) -> [Self; 2] {
                let (low, high) = SimdBase::interleave(self, b);
                [low, high]
            }
            #[cfg_attr(optimised, inline(always))]
            fn add(self, b: Self) -> Self {
                self + b
            }
            #[cfg_attr(optimised, inline(always))]
            fn sub(self, b: Self) -> Self {
                self - b
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul(self, b: Self) -> Self {
                self * b
            }
            #[cfg_attr(optimised, inline(always))]
            fn mul_add(self, b: Self, c: Self) -> Self {
                SimdFloat::mul_add(self, b, c)
            }
            #[cfg_attr(optimised, inline(always))]
            fn neg_mul_add(self, b: Self, c: Self) -> Self {
                SimdFloat::mul_add(-self, b, c)
            }
            #[cfg_attr(optimised, inline(always))]
            fn div(self, b: Self) -> Self {
                self / b
            }
            #[cfg_attr(optimised, inline(always))]
            fn sqrt(self) -> Self {
                SimdFloat::sqrt(self)
            }
            #[cfg_attr(optimised, inline(always))]
            fn min(self, b: Self) -> Self {
                if cfg!(target_arch = "x86_64") {
                    return SimdBase::min(self, b);
                }
                self.simd_lt(b).select(self, b)
            }
            #[cfg_attr(optimised, inline(always))]
            fn max(self, b: Self) -> Self {
                if cfg!(target_arch = "x86_64") {
                    return SimdBase::max(self, b);
                }
                b.simd_lt(self).select(self, b)
            }
            #[cfg_attr(optimised, inline(always))]
            fn at_most(self, b: Self) -> u32 {
                self.simd_le(b).to_bitmask() as u32
            }
            #[cfg_attr(optimised, inline(always))]
            fn equal(self, b: Self) -> u32 {
                self.simd_eq(b).to_bitmask() as u32
            }
            #[cfg_attr(optimised, inline(always))]
            fn first(self) -> $scalar {
                self[0]
            }
            #[cfg_attr(optimised, inline(always))]
            fn select(self, bits: u32, b: Self) -> Self {
                <Self as SimdBase<S>>::Mask::from_bitmask(token::<S>(), bits.into()).select(self, b)
            }
            #[cfg_attr(optimised, inline(always))]
            fn largest(self) -> $scalar {
                self.reduce_max()
            }
            #[cfg_attr(optimised, inline(always))]
            fn load(from: &[$scalar]) -> Self {
                SimdBase::from_slice(token::<S>(), &from[..$lanes])
            }
            #[cfg_attr(optimised, inline(always))]
            fn store(self, to: &mut [$scalar]) {
                self.store_slice(&mut to[..$lanes]);
            }
        }
    };
}

vector!(f32x16, f32, 16);
vector!(f64x8, f64, 8);
