//! Sets `cfg(optimised)` in every profile except `opt-level = 0`, see `Kernel` in numeric/simd/vector.rs, and `cfg(level)`
//! for the instruction sets that kernels are compiled for: all, or with the feature `native` the best of this machine.

fn main() {
    println!("cargo::rerun-if-changed=rust/build.rs");
    println!("cargo::rustc-check-cfg=cfg(optimised)");
    if std::env::var("OPT_LEVEL").is_ok_and(|level| level != "0") {
        println!("cargo::rustc-cfg=optimised");
    }
    println!("cargo::rustc-check-cfg=cfg(level, values(\"baseline\", \"avx2\", \"avx512\"))");
    for level in levels() {
        println!("cargo::rustc-cfg=level=\"{level}\"");
    }
}

#[cfg(not(feature = "native"))]
fn levels() -> &'static [&'static str] {
    &["baseline", "avx2", "avx512"]
}

#[cfg(feature = "native")]
fn levels() -> &'static [&'static str] {
    #[cfg(target_arch = "x86_64")]
    {
        let best = fearless_simd::Level::new();
        if best.as_avx512().is_some() {
            return &["avx512"];
        }
        if best.as_avx2().is_some() {
            return &["avx2"];
        }
    }
    &["baseline"]
}
