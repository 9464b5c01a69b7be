//! Vectors of 64 bytes, one interface for every instruction set.

use num_traits::Float;

/// Real number type: f32 or f64.
pub trait Real: Float + Default + Send + Sync + 'static {
    /// Nearest number of this type.
    fn of(x: f64) -> Self;
    /// Conversion to f64.
    fn wide(self) -> f64;
    /// Constant whose addition and subtraction rounds to the nearest integer.
    const ROUND: Self;
    /// Least integer whose power of two is a normal number.
    const LEAST_EXPONENT: f64;
    /// Two to the power of an integer whose power is a normal number.
    fn power_of_two(self) -> Self;
}

impl Real for f32 {
    #[cfg_attr(optimised, inline(always))]
    fn of(x: f64) -> Self {
        x as Self
    }
    #[cfg_attr(optimised, inline(always))]
    fn wide(self) -> f64 {
        f64::from(self)
    }
    const ROUND: Self = 12_582_912.0; // 1.5 * 2^23
    const LEAST_EXPONENT: f64 = -126.0;
    #[cfg_attr(optimised, inline(always))]
    fn power_of_two(self) -> Self {
        // The lowest bits of numbers from 2^23 on count units.
        Self::from_bits((self + 8_388_735.0).to_bits() << 23) // 2^23 + 127
    }
}

impl Real for f64 {
    #[cfg_attr(optimised, inline(always))]
    fn of(x: f64) -> Self {
        x
    }
    #[cfg_attr(optimised, inline(always))]
    fn wide(self) -> f64 {
        self
    }
    const ROUND: Self = 6_755_399_441_055_744.0; // 1.5 * 2^52
    const LEAST_EXPONENT: f64 = -1022.0;
    #[cfg_attr(optimised, inline(always))]
    fn power_of_two(self) -> Self {
        Self::from_bits((self + 4_503_599_627_371_519.0).to_bits() << 52) // 2^52 + 1023
    }
}

/// 64 bytes of numbers: 16 of f32, 8 of f64.
pub trait Vector: Copy {
    /// Type of the numbers.
    type Scalar: Real;
    /// Number of lanes.
    const LANES: usize;
    /// Broadcast of a number to all lanes.
    fn splat(x: Self::Scalar) -> Self;
    /// `a` in the lower half, `b` in the upper.
    fn halves(a: Self::Scalar, b: Self::Scalar) -> Self;
    /// `re, im, re, im, ...`
    #[cfg_attr(optimised, inline(always))]
    fn alternate(re: Self::Scalar, im: Self::Scalar) -> Self {
        Self::splat(re).interleave(Self::splat(im))[0]
    }
    /// `v0, v0, v1, v1, ...` from the lower half, and the same from the upper.
    #[cfg_attr(optimised, inline(always))]
    fn pairs(self) -> [Self; 2] {
        self.interleave(self)
    }
    /// `self0, b0, self1, b1, ...` from the lower halves, and the same from the upper.
    fn interleave(self, b: Self) -> [Self; 2];
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
    /// Minimum, lane by lane; `b` where one is NaN.
    fn min(self, b: Self) -> Self;
    /// Maximum, lane by lane; `b` where one is NaN.
    fn max(self, b: Self) -> Self;
    /// Bit mask of the lanes that are at most `b`; zero where one is NaN.
    fn at_most(self, b: Self) -> u32;
    /// Bit mask of the lanes that are equal to `b`.
    fn equal(self, b: Self) -> u32;
    /// Number of the first lane.
    fn first(self) -> Self::Scalar;
    /// Numbers of `self` where the bit is set, of `b` elsewhere.
    fn select(self, bits: u32, b: Self) -> Self;
    /// The largest number; none may be NaN.
    fn largest(self) -> Self::Scalar;
    /// Load the first numbers of a slice; panics if there are fewer than [`Self::LANES`].
    fn load(from: &[Self::Scalar]) -> Self;
    /// Store to the first numbers of a slice; panics if there are fewer than [`Self::LANES`].
    fn store(self, to: &mut [Self::Scalar]);
}

/// Add to rows of a grid: `grid[start + j stride ..] += taps[j] values` for `W` rows of `N` vectors.
#[cfg_attr(optimised, inline(always))]
pub fn add_rows<V: Vector, const W: usize, const N: usize>(
    grid: &mut [V::Scalar],
    start: usize,
    stride: usize,
    taps: &[V::Scalar; W],
    values: &[V; N],
) {
    let window = &mut grid[start..][..(W - 1) * stride + N * V::LANES];
    for j in 0..W {
        let row = &mut window[j * stride..][..N * V::LANES];
        for i in 0..N {
            let at = &mut row[i * V::LANES..];
            V::splat(taps[j]).mul_add(values[i], V::load(at)).store(at);
        }
    }
}

/// Add to rows of a grid, lane by lane: `grid[start + j stride ..] += taps[j] * values` for `W` rows of `N` vectors.
#[cfg_attr(optimised, inline(always))]
pub fn add_window<V: Vector, const W: usize, const N: usize>(
    grid: &mut [V::Scalar],
    start: usize,
    stride: usize,
    taps: &[V; W],
    values: &[V; N],
) {
    let window = &mut grid[start..][..(W - 1) * stride + N * V::LANES];
    for j in 0..W {
        let row = &mut window[j * stride..][..N * V::LANES];
        for i in 0..N {
            let at = &mut row[i * V::LANES..];
            taps[j].mul_add(values[i], V::load(at)).store(at);
        }
    }
}

/// Vector types of an instruction set.
pub trait Isa {
    /// True if a vector is one register, in place of several.
    const IS_REGISTER: bool;
    /// Vector of 16 f32.
    type F32: Vector<Scalar = f32>;
    /// Vector of 8 f64.
    type F64: Vector<Scalar = f64>;
    /// Nearest f32 of twice 8 numbers.
    fn narrow(low: Self::F64, high: Self::F64) -> Self::F32;
    /// Bit mask of the elements equal to `number`.
    fn equal(numbers: &[u32; 16], number: u32) -> u32;
    /// Write `number` where the bit is set.
    fn put(numbers: &mut [u32; 16], bits: u32, number: u32);
}

/// Prefetch a value that will be read soon: its first and second cache line.
#[allow(unsafe_code)]
#[cfg_attr(optimised, inline(always))]
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

/// Number type of a kernel, with its vector in every instruction set.
pub trait Precision: Real {
    /// Vector of 64 bytes.
    type In<I: Isa>: Vector<Scalar = Self>;
    /// Round two vectors of f64 to one vector; f64 keeps the first.
    fn narrow<I: Isa>(wide: [I::F64; 2]) -> Self::In<I>;
}

impl Precision for f32 {
    type In<I: Isa> = I::F32;
    #[cfg_attr(optimised, inline(always))]
    fn narrow<I: Isa>(wide: [I::F64; 2]) -> I::F32 {
        I::narrow(wide[0], wide[1])
    }
}

impl Precision for f64 {
    type In<I: Isa> = I::F64;
    #[cfg_attr(optimised, inline(always))]
    fn narrow<I: Isa>(wide: [I::F64; 2]) -> I::F64 {
        wide[0]
    }
}

/// Code that [`Level::run`] compiles for every instruction set.
///
/// `run` and all it calls must be `#[cfg_attr(optimised, inline(always))]`: closures (also of `map` and `from_fn`) and
/// ordinary calls do not inherit the instruction set and would silently run with the baseline's. Large arrays belong
/// on the heap: threads have at least 512 kB of stack (tests/stack.rs).
pub trait Kernel {
    /// Return type of the kernel.
    type Output;
    /// Run the kernel.
    fn run<I: Isa>(self) -> Self::Output;
}
