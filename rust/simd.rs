//! Instruction sets chosen at run time: one generic kernel, compiled once per level.
//!
//! The kernels are plain element-wise loops over fixed-size arrays; inside a function with
//! `#[target_feature]` the compiler vectorises them with the widest registers of that level. No kernel uses
//! fused multiply-add, so every level gives the same bits.
//!
//! The only `unsafe` of the crate is here: calling a function compiled for an instruction set. It is sound
//! because a [`Level`] can only be obtained by asking the processor.

/// Code that [`Level::run`] compiles for every instruction set.
///
/// `run` and all it calls must be `#[inline(always)]`: closures and ordinary calls do not inherit the
/// instruction set and would silently run with the baseline's.
pub trait Kernel {
    /// What the kernel returns.
    type Output;
    /// The kernel itself.
    fn run(self) -> Self::Output;
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
            if is_x86_feature_detected!("avx2") {
                levels.push(Self(Set::Avx2));
            }
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                levels.push(Self(Set::Avx512));
            }
        }
        levels
    }

    /// The fastest level of this processor.
    pub fn best() -> Self {
        *Self::available().last().unwrap_or(&Self(Set::Baseline))
    }

    /// Run a kernel compiled for this level.
    #[allow(unsafe_code)] // see the head of the file
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Set::Baseline => kernel.run(),
            // SAFETY: `available` found AVX2 on this processor.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => unsafe { avx2(kernel) },
            // SAFETY: `available` found AVX-512 F and DQ on this processor.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { avx512(kernel) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq")]
fn avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
