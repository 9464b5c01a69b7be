//! No bench: looks through its own symbols for intrinsics that were not inlined, and fails if it finds one.
//!
//! A closure inside a kernel, those of `map` and `from_fn` as well, does not inherit the kernel's instruction set: intrinsics
//! that it uses become calls, two to three times slower, and nothing else tells (`numeric::simd`). An intrinsic that is called
//! is a function of its own in the executable.
//!
//! It is a bench because only benches are compiled as users run the code: checks of the test profile (debug assertions) keep
//! the compiler from inlining loads and stores.

fn main() {
    #[cfg(all(target_os = "linux", target_arch = "x86_64"))]
    linux::check();
    #[cfg(not(all(target_os = "linux", target_arch = "x86_64")))]
    println!("intrinsics: not looked for, the symbols of this system's executables are not read");
}

#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod linux {
    use std::hint::black_box;

    use radarcore::{Level, PosedScene, SmoothHits, beat_signal};

    pub fn check() {
        // What is never named is not linked: these lead to every kernel, at every level.
        black_box(PosedScene::cast_image_at as *const ());
        black_box(PosedScene::cast as *const ());
        black_box(SmoothHits::new as *const ());
        black_box(beat_signal as *const ());

        let executable = std::env::current_exe().and_then(std::fs::read).expect("own executable");
        let functions = functions(&executable).expect("symbols: profile.bench must not strip them");
        // `simd::avx512`, `simd::avx2`: kernels compiled for a level.
        let num_kernels = |level: &str| {
            let is_kernel = |name: &&String| name.contains("radarcore") && name.contains(&format!("simd{level}"));
            functions.iter().filter(is_kernel).count()
        };
        for level in ["4avx2", "6avx512"] {
            assert!(num_kernels(level) > 5, "no kernels are found where they should be");
        }
        let called: Vec<&str> = functions.iter().filter_map(|name| intrinsic(name)).collect();
        assert!(
            called.is_empty(),
            "not inlined, so called from code that lacks the instruction set (a closure in a kernel?): {called:#?}"
        );
        println!(
            "intrinsics: all inlined, in {} kernels; this processor runs {:?}",
            num_kernels("4avx2") + num_kernels("6avx512"),
            Level::available().iter().map(|level| level.name()).collect::<Vec<_>>()
        );
    }

    /// The intrinsic whose mangled name this is, `..core_arch..avx512f15_mm512_fmadd_ps..`. Registers are types of that
    /// module as well, `__m512`.
    fn intrinsic(name: &str) -> Option<&str> {
        let start = ["_mm_", "_mm256_", "_mm512_"]
            .iter()
            .find_map(|prefix| name.find(prefix))?;
        name.contains("core_arch").then(|| &name[start..])
    }

    /// Names of the functions that an executable defines: the symbol table of ELF, 64 bits, little endian.
    fn functions(elf: &[u8]) -> Option<Vec<String>> {
        const SYMBOL_TABLE: u64 = 2;
        const SYMBOL_SIZE: usize = 24;
        const FUNCTION: u64 = 2;
        let number = |at: usize, bytes: usize| {
            let bytes = elf.get(at..at + bytes)?.iter().rev();
            Some(bytes.fold(0, |number, byte| number << 8 | u64::from(*byte)))
        };
        let (sections, size, count) = (number(0x28, 8)?, number(0x3a, 2)?, number(0x3c, 2)?);
        let section = |index: u64| (sections + index * size) as usize;
        let extent = |index: u64| {
            let offset = number(section(index) + 0x18, 8)? as usize;
            elf.get(offset..offset + number(section(index) + 0x20, 8)? as usize)
        };
        let table = (0..count).find(|index| number(section(*index) + 4, 4) == Some(SYMBOL_TABLE))?;
        let names = extent(number(section(table) + 0x28, 4)?)?;
        let first = number(section(table) + 0x18, 8)? as usize;
        let mut functions = Vec::new();
        for at in (first..first + extent(table)?.len()).step_by(SYMBOL_SIZE) {
            let (name, kind, defined_in) = (number(at, 4)? as usize, number(at + 4, 1)? & 0xf, number(at + 6, 2)?);
            if kind == FUNCTION && defined_in != 0 {
                let name = names.get(name..)?.split(|byte| *byte == 0).next()?;
                functions.push(String::from_utf8_lossy(name).into_owned());
            }
        }
        Some(functions)
    }
}
