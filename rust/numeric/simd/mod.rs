//! Instruction sets chosen at run time: one generic kernel, compiled once per level.
//!
//! Element-wise loops over fixed-size arrays are left to the compiler, which vectorises them inside a function with
//! `#[target_feature]`. Windows of the grid it does not: they are written with [`Vector`], 64 bytes of numbers whatever
//! the level, so that a kernel has one layout everywhere. Instructions come from the crate fearless_simd.
//!
//! Functions of kernels are inlined only in optimised builds. Without optimisation variables do not share memory, so an
//! inlined kernel would need a megabyte of stack (see rust/build.rs).
//!
//! The only `unsafe` of the crate is here: the token of `fearless_simd` that a vector is made with, and prefetching.

mod lanes;
mod level;
mod vector;

pub use level::Level;
pub use vector::{Isa, Kernel, Precision, Real, Vector, add_rows, add_window, prefetch};

#[cfg(test)]
mod tests;
