//! Vectors of `fearless_simd` behind [`Isa`].

use std::hint::black_box;
use std::marker::PhantomData;

use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, SimdNarrow, f32x16, f64x8, mask32x16, u32x16};

use super::vector::{Isa, Kernel, Real, Vector};

/// A kernel compiled for an instruction set. Not inlined into `Level::run`, whose stack frame all levels share.
#[inline(never)]
pub(super) fn run<S: Simd, K: Kernel>(token: S, kernel: K) -> K::Output {
    token.vectorize(
        #[inline(always)]
        || {
            // Aligns the stack frame of the kernel. Without it, the compiler spills registers to unaligned places, some
            // across two cache lines.
            black_box(&mut CacheLine(0));
            kernel.run::<Set<S>>()
        },
    )
}

/// Data that has to be aligned; its only field gives it a size and is never read.
#[repr(align(64))]
struct CacheLine(#[allow(dead_code)] u8);

/// An instruction set by the type of its token, which proves that the processor has it.
struct Set<S>(PhantomData<S>);

/// The token, which is no data. Vectors would otherwise need it to be passed to all functions of kernels.
#[allow(unsafe_code)]
#[cfg_attr(optimised, inline(always))]
fn token<S: Simd>() -> S {
    const { assert!(size_of::<S>() == 0) };
    // SAFETY: a type without data; its promise holds, as `Set` and `Lanes` exist inside `run` alone, which was given one.
    unsafe { std::mem::transmute_copy(&()) }
}

impl<S: Simd> Isa for Set<S> {
    const REGISTERS: usize = 16 / <S::f32s as SimdBase<S>>::LEN;
    const IS_FUSED: bool = Self::REGISTERS < 4 || cfg!(target_arch = "aarch64");
    type F32 = Lanes<S, f32x16<S>>;
    type F64 = Lanes<S, f64x8<S>>;
    #[cfg_attr(optimised, inline(always))]
    fn narrow(low: Self::F64, high: Self::F64) -> Self::F32 {
        Lanes::of(low.0.narrow(high.0))
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

/// A vector.
#[derive(Clone, Copy)]
struct Lanes<S, V>(V, PhantomData<S>);

impl<S: Simd, V: SimdFloat<S>> Lanes<S, V> {
    #[cfg_attr(optimised, inline(always))]
    fn of(v: V) -> Self {
        Self(v, PhantomData)
    }
}

impl<S: Simd, V: SimdFloat<S>> Vector for Lanes<S, V>
where
    V::Element: Real,
{
    type Scalar = V::Element;
    const LANES: usize = V::LEN;
    #[cfg_attr(optimised, inline(always))]
    fn splat(x: Self::Scalar) -> Self {
        Self::of(V::splat(token::<S>(), x))
    }
    #[cfg_attr(optimised, inline(always))]
    fn halves(a: Self::Scalar, b: Self::Scalar) -> Self {
        Self::splat(a).select(u32::MAX >> (32 - V::LEN / 2), Self::splat(b))
    }
    #[cfg_attr(optimised, inline(always))]
    fn interleave(self, b: Self) -> [Self; 2] {
        let (low, high) = self.0.interleave(b.0);
        [Self::of(low), Self::of(high)]
    }
    #[cfg_attr(optimised, inline(always))]
    fn add(self, b: Self) -> Self {
        Self::of(self.0 + b.0)
    }
    #[cfg_attr(optimised, inline(always))]
    fn sub(self, b: Self) -> Self {
        Self::of(self.0 - b.0)
    }
    #[cfg_attr(optimised, inline(always))]
    fn mul(self, b: Self) -> Self {
        Self::of(self.0 * b.0)
    }
    #[cfg_attr(optimised, inline(always))]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self::of(self.0.mul_add(b.0, c.0))
    }
    #[cfg_attr(optimised, inline(always))]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Self::of((-self.0).mul_add(b.0, c.0))
    }
    #[cfg_attr(optimised, inline(always))]
    fn div(self, b: Self) -> Self {
        Self::of(self.0 / b.0)
    }
    #[cfg_attr(optimised, inline(always))]
    fn sqrt(self) -> Self {
        Self::of(self.0.sqrt())
    }
    #[cfg_attr(optimised, inline(always))]
    fn min(self, b: Self) -> Self {
        if cfg!(target_arch = "x86_64") {
            return Self::of(self.0.min(b.0));
        }
        Self::of(self.0.simd_lt(b.0).select(self.0, b.0))
    }
    #[cfg_attr(optimised, inline(always))]
    fn max(self, b: Self) -> Self {
        if cfg!(target_arch = "x86_64") {
            return Self::of(self.0.max(b.0));
        }
        Self::of(b.0.simd_lt(self.0).select(self.0, b.0))
    }
    #[cfg_attr(optimised, inline(always))]
    fn at_most(self, b: Self) -> u32 {
        self.0.simd_le(b.0).to_bitmask() as u32
    }
    #[cfg_attr(optimised, inline(always))]
    fn equal(self, b: Self) -> u32 {
        self.0.simd_eq(b.0).to_bitmask() as u32
    }
    #[cfg_attr(optimised, inline(always))]
    fn first(self) -> Self::Scalar {
        self.0[0]
    }
    #[cfg_attr(optimised, inline(always))]
    fn select(self, bits: u32, b: Self) -> Self {
        Self::of(V::Mask::from_bitmask(token::<S>(), bits.into()).select(self.0, b.0))
    }
    #[cfg_attr(optimised, inline(always))]
    fn largest(self) -> Self::Scalar {
        self.0.reduce_max()
    }
    #[cfg_attr(optimised, inline(always))]
    fn load(from: &[Self::Scalar]) -> Self {
        Self::of(V::from_slice(token::<S>(), &from[..V::LEN]))
    }
    #[cfg_attr(optimised, inline(always))]
    fn store(self, to: &mut [Self::Scalar]) {
        self.0.store_slice(&mut to[..V::LEN]);
    }
}
