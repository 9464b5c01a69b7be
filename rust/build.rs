//! Sets `cfg(optimised)` in every profile except `opt-level = 0`, see `Kernel` in numeric/simd/vector.rs.

fn main() {
    println!("cargo::rerun-if-changed=rust/build.rs");
    println!("cargo::rustc-check-cfg=cfg(optimised)");
    if std::env::var("OPT_LEVEL").is_ok_and(|level| level != "0") {
        println!("cargo::rustc-cfg=optimised");
    }
}
