//! Instruction sets chosen at run time: one generic kernel, compiled once per level.
//!
//! Element-wise loops over fixed-size arrays are left to the compiler, which vectorises them inside a function with
//! `#[target_feature]`. Windows of the grid and recurrences it does not: they are written with [`Vector`], 64 bytes of
//! numbers whatever the level, so that a kernel has one layout everywhere.
//!
//! The only `unsafe` of the crate is here: calling a function compiled for an instruction set, its intrinsics, and
//! loads and stores whose bounds were checked once for a whole patch. It is sound because a [`Level`] can only be
//! obtained by asking the processor, and the sets of vectors are private to [`Level::run`].

#![allow(unsafe_code)] // see above

use num_traits::{Float, FromPrimitive};

/// Numbers of the grid: f32 or f64.
pub trait Real: Float + FromPrimitive + rustfft::FftNum + Default {
    /// Nearest number of this type.
    fn of(x: f64) -> Self;
    /// The same number in f64.
    fn wide(self) -> f64;
}

impl Real for f32 {
    #[inline(always)]
    fn of(x: f64) -> Self {
        x as Self
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn of(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }
}

/// 64 bytes of numbers: 16 of f32, 8 of f64.
pub trait Vector: Copy {
    /// Type of the numbers.
    type Scalar: Real;
    /// How many.
    const LANES: usize;
    /// The same number everywhere.
    fn splat(x: Self::Scalar) -> Self;
    /// `a` in the lower half, `b` in the upper.
    fn halves(a: Self::Scalar, b: Self::Scalar) -> Self;
    /// `re, im, re, im, ...`
    fn alternate(re: Self::Scalar, im: Self::Scalar) -> Self;
    /// `v0, v0, v1, v1, ...` from the lower half, and the same from the upper.
    fn pairs(self) -> [Self; 2];
    /// `self + b`
    fn add(self, b: Self) -> Self;
    /// `self - b`
    fn sub(self, b: Self) -> Self;
    /// `self * b`
    fn mul(self, b: Self) -> Self;
    /// `self * b + c`, rounded once where the level can.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// `c - self * b`, rounded once where the level can.
    fn neg_mul_add(self, b: Self, c: Self) -> Self;
    /// `self / b`
    fn div(self, b: Self) -> Self;
    /// Square roots.
    fn sqrt(self) -> Self;
    /// The smaller ones; `b` where one is NaN.
    fn min(self, b: Self) -> Self;
    /// The larger ones; `b` where one is NaN.
    fn max(self, b: Self) -> Self;
    /// A bit per number: whether it is at most `b`; not where one is NaN.
    fn at_most(self, b: Self) -> u32;
    /// Numbers of `self` where the bit is set, of `b` elsewhere.
    fn select(self, bits: u32, b: Self) -> Self;
    /// The largest number; none may be NaN.
    fn largest(self) -> Self::Scalar;
    /// The first numbers of a slice; panics if there are fewer than [`Self::LANES`].
    #[inline(always)]
    fn load(from: &[Self::Scalar]) -> Self {
        assert!(from.len() >= Self::LANES);
        // SAFETY: there are `LANES` numbers.
        unsafe { Self::load_unchecked(from.as_ptr()) }
    }
    /// Into the first numbers of a slice; panics if there are fewer than [`Self::LANES`].
    #[inline(always)]
    fn store(self, to: &mut [Self::Scalar]) {
        assert!(to.len() >= Self::LANES);
        // SAFETY: there are `LANES` numbers.
        unsafe { self.store_unchecked(to.as_mut_ptr()) }
    }
    /// # Safety
    /// `LANES` numbers can be read.
    unsafe fn load_unchecked(from: *const Self::Scalar) -> Self;
    /// # Safety
    /// `LANES` numbers can be written.
    unsafe fn store_unchecked(self, to: *mut Self::Scalar);
}

/// `re0, im0, re1, im1, ...`
#[inline(always)]
pub fn interleave<V: Vector>(re: V, im: V) -> [V; 2] {
    let (zero, one) = (V::Scalar::of(0.0), V::Scalar::of(1.0));
    let (real, imaginary) = (V::alternate(one, zero), V::alternate(zero, one));
    let (mut sides, im) = (re.pairs(), im.pairs());
    for i in 0..2 {
        sides[i] = im[i].mul_add(imaginary, sides[i].mul(real));
    }
    sides
}

/// Rows of a grid: `grid[start + j stride ..] += taps[j] values` for `W` rows of `N` vectors.
#[inline(always)]
pub fn add_rows<V: Vector, const W: usize, const N: usize>(
    grid: &mut [V::Scalar],
    start: usize,
    stride: usize,
    taps: &[V::Scalar; W],
    values: &[V; N],
) {
    assert!(start + (W - 1) * stride + N * V::LANES <= grid.len());
    for j in 0..W {
        for i in 0..N {
            // SAFETY: checked for all rows above.
            unsafe {
                let tap = V::splat(taps[j]);
                let at = grid.as_mut_ptr().add(start + j * stride + i * V::LANES);
                tap.mul_add(values[i], V::load_unchecked(at)).store_unchecked(at);
            }
        }
    }
}

/// Rows of a grid: `grid[start + j stride ..] += patch[j]`.
#[inline(always)]
pub fn add_patch<V: Vector, const W: usize, const N: usize>(
    grid: &mut [V::Scalar],
    start: usize,
    stride: usize,
    patch: &[[V; N]; W],
) {
    assert!(start + (W - 1) * stride + N * V::LANES <= grid.len());
    for j in 0..W {
        for i in 0..N {
            // SAFETY: checked for all rows above.
            unsafe {
                let at = grid.as_mut_ptr().add(start + j * stride + i * V::LANES);
                patch[j][i].add(V::load_unchecked(at)).store_unchecked(at);
            }
        }
    }
}

/// The vectors of an instruction set.
pub trait Isa {
    /// Registers that a vector takes.
    const REGISTERS: usize;
    /// Whether `mul_add` rounds once.
    const IS_FUSED: bool;
    /// 16 numbers.
    type F32: Vector<Scalar = f32>;
    /// 8 numbers.
    type F64: Vector<Scalar = f64>;
    /// Nearest f32 of twice 8 numbers.
    fn narrow(low: Self::F64, high: Self::F64) -> Self::F32;
    /// A bit per number: whether it is `number`.
    fn equal(numbers: &[u32; 16], number: u32) -> u32;
    /// `number` where the bit is set.
    fn put(numbers: &mut [u32; 16], bits: u32, number: u32);
}

/// Ask for what will be read soon, first and second cache line.
#[inline(always)]
pub fn prefetch<T>(what: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let at = std::ptr::from_ref(what).cast::<i8>();
        for line in 0..size_of::<T>().div_ceil(64) {
            // SAFETY: SSE is part of x86-64; addresses are within the object, and prefetching reads nothing.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(at.add(64 * line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = what;
}

/// A kernel's number type, and its vector in an instruction set.
pub trait Precision: Real {
    /// 64 bytes of these numbers.
    type In<I: Isa>: Vector<Scalar = Self>;
    /// As many of twice 8 numbers as fit in, rounded.
    fn narrow<I: Isa>(wide: [I::F64; 2]) -> Self::In<I>;
}

impl Precision for f32 {
    type In<I: Isa> = I::F32;
    #[inline(always)]
    fn narrow<I: Isa>(wide: [I::F64; 2]) -> I::F32 {
        I::narrow(wide[0], wide[1])
    }
}

impl Precision for f64 {
    type In<I: Isa> = I::F64;
    #[inline(always)]
    fn narrow<I: Isa>(wide: [I::F64; 2]) -> I::F64 {
        wide[0]
    }
}

/// Code that [`Level::run`] compiles for every instruction set.
///
/// `run` and all it calls must be `#[inline(always)]`: closures (those of `map` and `from_fn` as well) and ordinary calls do
/// not inherit the instruction set and would silently run with the baseline's.
pub trait Kernel {
    /// What the kernel returns.
    type Output;
    /// The kernel itself.
    fn run<I: Isa>(self) -> Self::Output;
}

/// An instruction set that this processor has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level(Set);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    /// What the target guarantees (x86-64: SSE2; aarch64: NEON).
    Baseline,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Level {
    /// Every level of this processor, slowest first.
    pub fn available() -> Vec<Self> {
        #[allow(unused_mut)] // only x86-64 has more than one
        let mut levels = vec![Self(Set::Baseline)];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                levels.push(Self(Set::Avx2));
                if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                    levels.push(Self(Set::Avx512));
                }
            }
        }
        levels
    }

    /// The fastest level of this processor.
    pub fn best() -> Self {
        static BEST: std::sync::OnceLock<Level> = std::sync::OnceLock::new();
        *BEST.get_or_init(|| *Self::available().last().unwrap_or(&Self(Set::Baseline)))
    }

    /// `baseline`, `avx2`, `avx512`.
    pub fn name(self) -> &'static str {
        match self.0 {
            Set::Baseline => "baseline",
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => "avx512",
        }
    }

    /// Run a kernel compiled for this level.
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Set::Baseline => kernel.run::<Baseline>(),
            // SAFETY: `available` found AVX2 and FMA on this processor.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => unsafe { x86::avx2(kernel) },
            // SAFETY: `available` found AVX-512 F and DQ on this processor.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { x86::avx512(kernel) },
        }
    }
}

/// What the target guarantees. On x86-64 its vectors are written out: arrays take the compiler minutes.
struct Baseline;

#[cfg(target_arch = "x86_64")]
impl Isa for Baseline {
    const REGISTERS: usize = 4;
    const IS_FUSED: bool = false;
    type F32 = x86::Four<std::arch::x86_64::__m128>;
    type F64 = x86::Four<std::arch::x86_64::__m128d>;
    #[inline(always)]
    fn narrow(low: Self::F64, high: Self::F64) -> Self::F32 {
        x86::narrow_sse2(low, high)
    }
    #[inline(always)]
    fn equal(numbers: &[u32; 16], number: u32) -> u32 {
        x86::equal_sse2(numbers, number)
    }
    #[inline(always)]
    fn put(numbers: &mut [u32; 16], bits: u32, number: u32) {
        x86::put_sse2(numbers, bits, number);
    }
}

#[cfg(not(target_arch = "x86_64"))]
impl Isa for Baseline {
    const REGISTERS: usize = 4;
    const IS_FUSED: bool = cfg!(target_arch = "aarch64");
    type F32 = [f32; 16];
    type F64 = [f64; 8];
    #[inline(always)]
    fn narrow(low: [f64; 8], high: [f64; 8]) -> [f32; 16] {
        std::array::from_fn(|i| if i < 8 { low[i] as f32 } else { high[i - 8] as f32 })
    }
    #[inline(always)]
    fn equal(numbers: &[u32; 16], number: u32) -> u32 {
        let mut bits = 0;
        for i in 0..16 {
            bits |= u32::from(numbers[i] == number) << i;
        }
        bits
    }
    #[inline(always)]
    fn put(numbers: &mut [u32; 16], bits: u32, number: u32) {
        for i in 0..16 {
            numbers[i] = if bits >> i & 1 == 1 { number } else { numbers[i] };
        }
    }
}

#[cfg(not(target_arch = "x86_64"))]
macro_rules! array_vector {
    ($scalar:ty, $lanes:literal) => {
        impl Vector for [$scalar; $lanes] {
            type Scalar = $scalar;
            const LANES: usize = $lanes;
            #[inline(always)]
            fn splat(x: $scalar) -> Self {
                [x; $lanes]
            }
            #[inline(always)]
            fn halves(a: $scalar, b: $scalar) -> Self {
                let mut v = [a; $lanes];
                for i in $lanes / 2..$lanes {
                    v[i] = b;
                }
                v
            }
            #[inline(always)]
            fn alternate(re: $scalar, im: $scalar) -> Self {
                let mut v = [re; $lanes];
                for i in 0..$lanes / 2 {
                    v[2 * i + 1] = im;
                }
                v
            }
            #[inline(always)]
            fn pairs(self) -> [Self; 2] {
                let (mut low, mut high) = (self, self);
                for i in 0..$lanes {
                    low[i] = self[i / 2];
                    high[i] = self[$lanes / 2 + i / 2];
                }
                [low, high]
            }
            #[inline(always)]
            fn add(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] += b[i];
                }
                self
            }
            #[inline(always)]
            fn sub(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] -= b[i];
                }
                self
            }
            #[inline(always)]
            fn mul(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] *= b[i];
                }
                self
            }
            #[inline(always)]
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
            #[inline(always)]
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
            #[inline(always)]
            fn min(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] = if self[i] < b[i] { self[i] } else { b[i] };
                }
                self
            }
            #[inline(always)]
            fn max(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] = if self[i] > b[i] { self[i] } else { b[i] };
                }
                self
            }
            #[inline(always)]
            fn at_most(self, b: Self) -> u32 {
                let mut bits = 0;
                for i in 0..$lanes {
                    bits |= u32::from(self[i] <= b[i]) << i;
                }
                bits
            }
            #[inline(always)]
            fn div(mut self, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] /= b[i];
                }
                self
            }
            #[inline(always)]
            fn sqrt(mut self) -> Self {
                for i in 0..$lanes {
                    self[i] = self[i].sqrt();
                }
                self
            }
            #[inline(always)]
            fn select(mut self, bits: u32, b: Self) -> Self {
                for i in 0..$lanes {
                    self[i] = if bits >> i & 1 == 1 { self[i] } else { b[i] };
                }
                self
            }
            #[inline(always)]
            fn largest(self) -> $scalar {
                let mut largest = self[0];
                for i in 1..$lanes {
                    largest = if self[i] > largest { self[i] } else { largest };
                }
                largest
            }
            #[inline(always)]
            unsafe fn load_unchecked(from: *const $scalar) -> Self {
                // SAFETY: the caller's.
                unsafe { from.cast::<Self>().read_unaligned() }
            }
            #[inline(always)]
            unsafe fn store_unchecked(self, to: *mut $scalar) {
                // SAFETY: the caller's.
                unsafe { to.cast::<Self>().write_unaligned(self) }
            }
        }
    };
}

#[cfg(not(target_arch = "x86_64"))]
array_vector!(f32, 16);
#[cfg(not(target_arch = "x86_64"))]
array_vector!(f64, 8);

#[cfg(target_arch = "x86_64")]
mod x86 {
    #[allow(clippy::wildcard_imports)] // intrinsics have long names of their own
    use std::arch::x86_64::*;

    use super::{Isa, Kernel, Vector};

    #[target_feature(enable = "avx2,fma")]
    pub fn avx2<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Avx2>()
    }

    #[target_feature(enable = "avx2,fma,avx512f,avx512dq")]
    pub fn avx512<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<Avx512>()
    }

    struct Avx2;

    impl Isa for Avx2 {
        const REGISTERS: usize = 2;
        const IS_FUSED: bool = true;
        type F32 = Two<__m256>;
        type F64 = Two<__m256d>;
        #[inline(always)]
        fn narrow(low: Self::F64, high: Self::F64) -> Self::F32 {
            unsafe {
                Two(
                    _mm256_set_m128(_mm256_cvtpd_ps(low.1), _mm256_cvtpd_ps(low.0)),
                    _mm256_set_m128(_mm256_cvtpd_ps(high.1), _mm256_cvtpd_ps(high.0)),
                )
            }
        }
        #[inline(always)]
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
        #[inline(always)]
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

    struct Avx512;

    impl Isa for Avx512 {
        const REGISTERS: usize = 1;
        const IS_FUSED: bool = true;
        type F32 = One<__m512>;
        type F64 = One<__m512d>;
        #[inline(always)]
        fn narrow(low: Self::F64, high: Self::F64) -> Self::F32 {
            unsafe {
                let (low, high) = (_mm512_cvtpd_ps(low.0), _mm512_cvtpd_ps(high.0));
                let low = _mm512_castps_pd(_mm512_castps256_ps512(low));
                One(_mm512_castpd_ps(_mm512_insertf64x4::<1>(low, _mm256_castps_pd(high))))
            }
        }
        #[inline(always)]
        fn equal(numbers: &[u32; 16], number: u32) -> u32 {
            unsafe {
                let v = _mm512_loadu_si512(numbers.as_ptr().cast());
                u32::from(_mm512_cmpeq_epi32_mask(v, _mm512_set1_epi32(number.cast_signed())))
            }
        }
        #[inline(always)]
        fn put(numbers: &mut [u32; 16], bits: u32, number: u32) {
            unsafe {
                let number = _mm512_set1_epi32(number.cast_signed());
                _mm512_mask_storeu_epi32(numbers.as_mut_ptr().cast(), bits as u16, number);
            }
        }
    }

    /// One register.
    #[derive(Clone, Copy)]
    struct One<R>(R);

    /// Two registers, lower half first.
    #[derive(Clone, Copy)]
    struct Two<R>(R, R);

    // SAFETY, of all blocks below: these types are only used inside `avx2` and `avx512`, which run on processors that
    // have the instructions; pointers are the caller's promise.

    /// Four registers, lowest first.
    #[derive(Clone, Copy)]
    pub struct Four<R>([R; 4]);

    // SSE2 is part of x86-64.
    macro_rules! sse2_vector {
        ($register:ty, $scalar:ty, $lanes:literal, $set1:ident, $alternate:expr, $add:ident, $sub:ident, $mul:ident,
         $div:ident, $sqrt:ident, $min:ident, $max:ident, $at_most:ident, $bits:ident, $select:ident, $largest:ident,
         $loadu:ident, $storeu:ident, $low:ident, $high:ident) => {
            impl Vector for Four<$register> {
                type Scalar = $scalar;
                const LANES: usize = $lanes;
                #[inline(always)]
                fn splat(x: $scalar) -> Self {
                    Self([unsafe { $set1(x) }; 4])
                }
                #[inline(always)]
                fn halves(a: $scalar, b: $scalar) -> Self {
                    let (a, b) = unsafe { ($set1(a), $set1(b)) };
                    Self([a, a, b, b])
                }
                #[inline(always)]
                fn alternate(re: $scalar, im: $scalar) -> Self {
                    let alternate: fn($scalar, $scalar) -> $register = $alternate;
                    Self([alternate(re, im); 4])
                }
                #[inline(always)]
                fn pairs(self) -> [Self; 2] {
                    let [a, b, c, d] = self.0;
                    unsafe {
                        [
                            Self([$low(a, a), $high(a, a), $low(b, b), $high(b, b)]),
                            Self([$low(c, c), $high(c, c), $low(d, d), $high(d, d)]),
                        ]
                    }
                }
                #[inline(always)]
                fn add(mut self, b: Self) -> Self {
                    for i in 0..4 {
                        self.0[i] = unsafe { $add(self.0[i], b.0[i]) };
                    }
                    self
                }
                #[inline(always)]
                fn sub(mut self, b: Self) -> Self {
                    for i in 0..4 {
                        self.0[i] = unsafe { $sub(self.0[i], b.0[i]) };
                    }
                    self
                }
                #[inline(always)]
                fn mul(mut self, b: Self) -> Self {
                    for i in 0..4 {
                        self.0[i] = unsafe { $mul(self.0[i], b.0[i]) };
                    }
                    self
                }
                #[inline(always)]
                fn mul_add(self, b: Self, c: Self) -> Self {
                    self.mul(b).add(c)
                }
                #[inline(always)]
                fn neg_mul_add(self, b: Self, c: Self) -> Self {
                    c.sub(self.mul(b))
                }
                #[inline(always)]
                fn min(mut self, b: Self) -> Self {
                    for i in 0..4 {
                        self.0[i] = unsafe { $min(self.0[i], b.0[i]) };
                    }
                    self
                }
                #[inline(always)]
                fn max(mut self, b: Self) -> Self {
                    for i in 0..4 {
                        self.0[i] = unsafe { $max(self.0[i], b.0[i]) };
                    }
                    self
                }
                #[inline(always)]
                fn at_most(self, b: Self) -> u32 {
                    let mut bits = 0;
                    for i in 0..4 {
                        bits |= (unsafe { $bits($at_most(self.0[i], b.0[i])) } as u32) << (i * $lanes / 4);
                    }
                    bits
                }
                #[inline(always)]
                fn div(mut self, b: Self) -> Self {
                    for i in 0..4 {
                        self.0[i] = unsafe { $div(self.0[i], b.0[i]) };
                    }
                    self
                }
                #[inline(always)]
                fn sqrt(mut self) -> Self {
                    for i in 0..4 {
                        self.0[i] = unsafe { $sqrt(self.0[i]) };
                    }
                    self
                }
                #[inline(always)]
                fn largest(self) -> $scalar {
                    let [a, b, c, d] = self.0;
                    unsafe { $largest($max($max(a, b), $max(c, d))) }
                }
                #[inline(always)]
                fn select(mut self, bits: u32, b: Self) -> Self {
                    for i in 0..4 {
                        self.0[i] = $select(bits >> (i * $lanes / 4), self.0[i], b.0[i]);
                    }
                    self
                }
                #[inline(always)]
                unsafe fn load_unchecked(from: *const $scalar) -> Self {
                    let mut v = Self::splat(0.0);
                    for i in 0..4 {
                        v.0[i] = unsafe { $loadu(from.add(i * $lanes / 4)) };
                    }
                    v
                }
                #[inline(always)]
                unsafe fn store_unchecked(self, to: *mut $scalar) {
                    for i in 0..4 {
                        unsafe { $storeu(to.add(i * $lanes / 4), self.0[i]) };
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
        _mm_movemask_pd,
        select_sse2_pd,
        largest_pd,
        _mm_loadu_pd,
        _mm_storeu_pd,
        _mm_unpacklo_pd,
        _mm_unpackhi_pd
    );

    #[inline(always)]
    unsafe fn largest_ps(v: __m128) -> f32 {
        unsafe {
            let v = _mm_max_ps(v, _mm_movehl_ps(v, v));
            _mm_cvtss_f32(_mm_max_ss(v, _mm_shuffle_ps::<1>(v, v)))
        }
    }

    #[inline(always)]
    unsafe fn largest_pd(v: __m128d) -> f64 {
        unsafe { _mm_cvtsd_f64(_mm_max_sd(v, _mm_unpackhi_pd(v, v))) }
    }

    #[inline(always)]
    fn select_sse2_ps(bits: u32, a: __m128, b: __m128) -> __m128 {
        unsafe {
            let mask = mask_sse2(bits);
            _mm_or_ps(_mm_and_ps(mask, a), _mm_andnot_ps(mask, b))
        }
    }

    #[inline(always)]
    fn select_sse2_pd(bits: u32, a: __m128d, b: __m128d) -> __m128d {
        unsafe {
            let mask = mask_sse2(bits);
            let mask = _mm_castps_pd(_mm_unpacklo_ps(mask, mask));
            _mm_or_pd(_mm_and_pd(mask, a), _mm_andnot_pd(mask, b))
        }
    }

    /// All bits of a number set where its bit is.
    #[inline(always)]
    fn mask_sse2(bits: u32) -> __m128 {
        unsafe {
            let places = _mm_setr_epi32(1, 2, 4, 8);
            let bits = _mm_and_si128(_mm_set1_epi32(bits.cast_signed()), places);
            _mm_castsi128_ps(_mm_cmpeq_epi32(bits, places))
        }
    }

    /// See `Isa::equal`.
    #[inline(always)]
    pub fn equal_sse2(numbers: &[u32; 16], number: u32) -> u32 {
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
    #[inline(always)]
    pub fn put_sse2(numbers: &mut [u32; 16], bits: u32, number: u32) {
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
    #[inline(always)]
    pub fn narrow_sse2(low: Four<__m128d>, high: Four<__m128d>) -> Four<__m128> {
        let pair =
            |v: Four<__m128d>, i: usize| unsafe { _mm_movelh_ps(_mm_cvtpd_ps(v.0[i]), _mm_cvtpd_ps(v.0[i + 1])) };
        Four([pair(low, 0), pair(low, 2), pair(high, 0), pair(high, 2)])
    }

    macro_rules! avx512_vector {
        ($register:ty, $scalar:ty, $lanes:literal, $set1:ident, $add:ident, $sub:ident, $mul:ident, $fmadd:ident,
         $fnmadd:ident, $div:ident, $sqrt:ident, $min:ident, $max:ident, $compare:ident, $mask:ty, $largest:ident, $loadu:ident,
         $storeu:ident, $blend:ident, $upper:literal, $odd:literal, $permute:ident, $low:expr, $high:expr) => {
            impl Vector for One<$register> {
                type Scalar = $scalar;
                const LANES: usize = $lanes;
                #[inline(always)]
                fn splat(x: $scalar) -> Self {
                    Self(unsafe { $set1(x) })
                }
                #[inline(always)]
                fn halves(a: $scalar, b: $scalar) -> Self {
                    Self(unsafe { $blend($upper, $set1(a), $set1(b)) })
                }
                #[inline(always)]
                fn alternate(re: $scalar, im: $scalar) -> Self {
                    Self(unsafe { $blend($odd, $set1(re), $set1(im)) })
                }
                #[inline(always)]
                fn pairs(self) -> [Self; 2] {
                    unsafe { [Self($permute($low, self.0)), Self($permute($high, self.0))] }
                }
                #[inline(always)]
                fn add(self, b: Self) -> Self {
                    Self(unsafe { $add(self.0, b.0) })
                }
                #[inline(always)]
                fn sub(self, b: Self) -> Self {
                    Self(unsafe { $sub(self.0, b.0) })
                }
                #[inline(always)]
                fn mul(self, b: Self) -> Self {
                    Self(unsafe { $mul(self.0, b.0) })
                }
                #[inline(always)]
                fn mul_add(self, b: Self, c: Self) -> Self {
                    Self(unsafe { $fmadd(self.0, b.0, c.0) })
                }
                #[inline(always)]
                fn neg_mul_add(self, b: Self, c: Self) -> Self {
                    Self(unsafe { $fnmadd(self.0, b.0, c.0) })
                }
                #[inline(always)]
                fn min(self, b: Self) -> Self {
                    Self(unsafe { $min(self.0, b.0) })
                }
                #[inline(always)]
                fn max(self, b: Self) -> Self {
                    Self(unsafe { $max(self.0, b.0) })
                }
                #[inline(always)]
                fn div(self, b: Self) -> Self {
                    Self(unsafe { $div(self.0, b.0) })
                }
                #[inline(always)]
                fn sqrt(self) -> Self {
                    Self(unsafe { $sqrt(self.0) })
                }
                #[inline(always)]
                fn at_most(self, b: Self) -> u32 {
                    u32::from(unsafe { $compare::<_CMP_LE_OQ>(self.0, b.0) })
                }
                #[inline(always)]
                fn largest(self) -> $scalar {
                    unsafe { $largest(self.0) }
                }
                #[inline(always)]
                fn select(self, bits: u32, b: Self) -> Self {
                    Self(unsafe { $blend(bits as $mask, b.0, self.0) })
                }
                #[inline(always)]
                unsafe fn load_unchecked(from: *const $scalar) -> Self {
                    Self(unsafe { $loadu(from) })
                }
                #[inline(always)]
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
        _mm512_loadu_pd,
        _mm512_storeu_pd,
        _mm512_mask_blend_pd,
        0xf0,
        0xaa,
        _mm512_permutexvar_pd,
        _mm512_setr_epi64(0, 0, 1, 1, 2, 2, 3, 3),
        _mm512_setr_epi64(4, 4, 5, 5, 6, 6, 7, 7)
    );

    macro_rules! avx2_vector {
        ($register:ty, $scalar:ty, $lanes:literal, $set1:ident, $add:ident, $sub:ident, $mul:ident, $fmadd:ident,
         $fnmadd:ident, $div:ident, $sqrt:ident, $min:ident, $max:ident, $compare:ident, $bits:ident, $loadu:ident,
         $storeu:ident, $blend:ident, $odd:literal, $pairs:ident, $blendv:ident, $mask:ident,
         $extract:ident, $max128:ident, $largest:ident) => {
            impl Vector for Two<$register> {
                type Scalar = $scalar;
                const LANES: usize = $lanes;
                #[inline(always)]
                fn splat(x: $scalar) -> Self {
                    let x = unsafe { $set1(x) };
                    Self(x, x)
                }
                #[inline(always)]
                fn halves(a: $scalar, b: $scalar) -> Self {
                    unsafe { Self($set1(a), $set1(b)) }
                }
                #[inline(always)]
                fn alternate(re: $scalar, im: $scalar) -> Self {
                    let x = unsafe { $blend::<$odd>($set1(re), $set1(im)) };
                    Self(x, x)
                }
                #[inline(always)]
                fn pairs(self) -> [Self; 2] {
                    unsafe {
                        let (a, b) = ($pairs(self.0), $pairs(self.1));
                        [Self(a.0, a.1), Self(b.0, b.1)]
                    }
                }
                #[inline(always)]
                fn add(self, b: Self) -> Self {
                    unsafe { Self($add(self.0, b.0), $add(self.1, b.1)) }
                }
                #[inline(always)]
                fn sub(self, b: Self) -> Self {
                    unsafe { Self($sub(self.0, b.0), $sub(self.1, b.1)) }
                }
                #[inline(always)]
                fn mul(self, b: Self) -> Self {
                    unsafe { Self($mul(self.0, b.0), $mul(self.1, b.1)) }
                }
                #[inline(always)]
                fn mul_add(self, b: Self, c: Self) -> Self {
                    unsafe { Self($fmadd(self.0, b.0, c.0), $fmadd(self.1, b.1, c.1)) }
                }
                #[inline(always)]
                fn neg_mul_add(self, b: Self, c: Self) -> Self {
                    unsafe { Self($fnmadd(self.0, b.0, c.0), $fnmadd(self.1, b.1, c.1)) }
                }
                #[inline(always)]
                fn min(self, b: Self) -> Self {
                    unsafe { Self($min(self.0, b.0), $min(self.1, b.1)) }
                }
                #[inline(always)]
                fn max(self, b: Self) -> Self {
                    unsafe { Self($max(self.0, b.0), $max(self.1, b.1)) }
                }
                #[inline(always)]
                fn div(self, b: Self) -> Self {
                    unsafe { Self($div(self.0, b.0), $div(self.1, b.1)) }
                }
                #[inline(always)]
                fn sqrt(self) -> Self {
                    unsafe { Self($sqrt(self.0), $sqrt(self.1)) }
                }
                #[inline(always)]
                fn largest(self) -> $scalar {
                    unsafe {
                        let v = $max(self.0, self.1);
                        $largest($max128($extract::<0>(v), $extract::<1>(v)))
                    }
                }
                #[inline(always)]
                fn select(self, bits: u32, b: Self) -> Self {
                    let (low, high) = ($mask(bits), $mask(bits >> ($lanes / 2)));
                    unsafe { Self($blendv(b.0, self.0, low), $blendv(b.1, self.1, high)) }
                }
                #[inline(always)]
                fn at_most(self, b: Self) -> u32 {
                    let low = unsafe { $bits($compare::<_CMP_LE_OQ>(self.0, b.0)) } as u32;
                    let high = unsafe { $bits($compare::<_CMP_LE_OQ>(self.1, b.1)) } as u32;
                    low | high << ($lanes / 2)
                }
                #[inline(always)]
                unsafe fn load_unchecked(from: *const $scalar) -> Self {
                    unsafe { Self($loadu(from), $loadu(from.add($lanes / 2))) }
                }
                #[inline(always)]
                unsafe fn store_unchecked(self, to: *mut $scalar) {
                    unsafe {
                        $storeu(to, self.0);
                        $storeu(to.add($lanes / 2), self.1);
                    }
                }
            }
        };
    }

    #[inline(always)]
    unsafe fn pairs_ps(v: __m256) -> (__m256, __m256) {
        unsafe {
            (
                _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3)),
                _mm256_permutevar8x32_ps(v, _mm256_setr_epi32(4, 4, 5, 5, 6, 6, 7, 7)),
            )
        }
    }

    #[inline(always)]
    unsafe fn pairs_pd(v: __m256d) -> (__m256d, __m256d) {
        unsafe {
            (
                _mm256_permute4x64_pd::<0b01_01_00_00>(v),
                _mm256_permute4x64_pd::<0b11_11_10_10>(v),
            )
        }
    }

    /// All bits of a number set where its bit is.
    #[inline(always)]
    fn mask_ps(bits: u32) -> __m256 {
        unsafe {
            let places = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let bits = _mm256_and_si256(_mm256_set1_epi32(bits.cast_signed()), places);
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(bits, places))
        }
    }

    /// The same for double precision.
    #[inline(always)]
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
        largest_ps
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
        largest_pd
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Operations<'a, T>(&'a [T; 16]);

    impl<T: Precision> Kernel for Operations<'_, T> {
        type Output = Vec<T>;
        #[inline(always)]
        fn run<I: Isa>(self) -> Vec<T> {
            let lanes = <T::In<I>>::LANES;
            let (a, b) = (self.0[0], self.0[1]);
            let v = <T::In<I>>::load(self.0);
            let [low, high] = v.pairs();
            let c = <T::In<I>>::alternate(a, b);
            let results = [
                <T::In<I>>::splat(a),
                <T::In<I>>::halves(a, b),
                c,
                low,
                high,
                v.add(c),
                v.sub(c),
                v.mul(c),
                v.mul_add(c, low),
                v.neg_mul_add(c, low),
                v.min(c),
                v.max(c),
                v.mul(v).div(<T::In<I>>::splat(T::of(2.0))),
                v.mul(v).sqrt(),
                v.select(0b1010_0110_1101_0011, c),
                <T::In<I>>::splat(v.largest()),
            ];
            let mut out = vec![T::zero(); results.len() * lanes];
            for (result, chunk) in results.iter().zip(out.chunks_mut(lanes)) {
                result.store(chunk);
            }
            out
        }
    }

    struct Integers<'a>(&'a [u32; 16]);

    impl Kernel for Integers<'_> {
        type Output = (u32, [u32; 16]);
        #[inline(always)]
        fn run<I: Isa>(self) -> Self::Output {
            let mut numbers = *self.0;
            I::put(&mut numbers, 0b1000_0110_0000_1001, u32::MAX);
            (I::equal(self.0, 7), numbers)
        }
    }

    #[test]
    fn integers_are_compared_and_put_in_their_places() {
        let mut numbers: [u32; 16] = std::array::from_fn(|i| i as u32);
        (numbers[1], numbers[15]) = (7, 7);
        for level in Level::available() {
            let (equal, put) = level.run(Integers(&numbers));
            assert_eq!(equal, 0b1000_0000_1000_0010, "{level:?}");
            for i in 0..16 {
                let is_put = [0, 3, 9, 10, 15].contains(&i);
                assert_eq!(put[i], if is_put { u32::MAX } else { numbers[i] }, "{level:?}");
            }
        }
    }

    struct Narrow<'a>(&'a [f64; 16]);

    impl Kernel for Narrow<'_> {
        type Output = Vec<f32>;
        #[inline(always)]
        fn run<I: Isa>(self) -> Vec<f32> {
            let mut out = vec![0.0; 16];
            f32::narrow::<I>([I::F64::load(self.0), I::F64::load(&self.0[8..])]).store(&mut out);
            out
        }
    }

    #[test]
    fn narrow_rounds_every_number_in_its_place() {
        let wide: [f64; 16] = std::array::from_fn(|i| (i as f64 + 0.3).sqrt());
        let expected: Vec<f32> = wide.iter().map(|x| *x as f32).collect();
        for level in Level::available() {
            assert_eq!(level.run(Narrow(&wide)), expected, "{level:?}");
        }
    }

    #[test]
    fn every_level_does_the_same() {
        // Small integers: no operation rounds.
        let single: [f32; 16] = std::array::from_fn(|i| (i * i % 23) as f32 - 7.0);
        let double: [f64; 16] = std::array::from_fn(|i| (i * i % 23) as f64 - 7.0);
        let expected = (
            Operations(&single).run::<Baseline>(),
            Operations(&double).run::<Baseline>(),
        );
        for level in Level::available() {
            assert_eq!(level.run(Operations(&single)), expected.0, "{level:?}");
            assert_eq!(level.run(Operations(&double)), expected.1, "{level:?}");
        }
        assert_eq!(expected.0[16..32], *[[-7.0; 8], [-6.0; 8]].as_flattened());
        assert_eq!(expected.0[48..52], [-7.0, -7.0, -6.0, -6.0]);
    }
}
