//! Instruction sets chosen at run time: one generic kernel, compiled once per level.
//!
//! Element-wise loops over fixed-size arrays are left to the compiler, which vectorises them inside a function with
//! `#[target_feature]`. Windows of the grid and recurrences it does not: they are written with [`Vector`], 64 bytes of
//! numbers whatever the level, so that a kernel has one layout everywhere.
//!
//! Functions of kernels are inlined only in optimised builds. Without optimisation variables do not share memory, so an
//! inlined kernel would need a megabyte of stack (see rust/build.rs).
//!
//! The only `unsafe` of the crate is here: calling a function compiled for an instruction set, its intrinsics, and
//! loads and stores whose bounds were checked once for a whole patch. It is sound because a [`Level`] can only be
//! obtained by asking the processor, and the sets of vectors are private to [`Level::run`].

#![allow(unsafe_code)] // see above

mod level;
#[cfg(any(test, not(target_arch = "x86_64")))]
mod portable;
mod vector;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod sse2;

pub use level::Level;
pub use vector::{Isa, Kernel, Precision, Real, Vector, add_patch, add_rows, add_window, interleave, prefetch};

#[cfg(test)]
mod tests;
