//! Choice of the instruction set at run time.

use std::sync::OnceLock;

use fearless_simd::Level as Set;

use super::lanes::run;
use super::vector::{Isa, Kernel};
use crate::error::{Error, Result};

/// Environment variable that names the highest level of the process, see [`Level::available`].
const VARIABLE: &str = "RADARCORE_SIMD";

/// Names of the levels of all processors, slowest first.
const NAMES: [&str; 3] = ["baseline", "avx2", "avx512"];

/// Instruction set of this processor.
#[derive(Clone, Copy, Debug)]
pub struct Level(Set);

impl Level {
    /// Levels of this processor, slowest first. The environment variable `RADARCORE_SIMD`, read once, names the
    /// highest: `baseline` (x86-64: SSE2; aarch64: NEON), `avx2` or `avx512`. Without it, or if it is empty, there is
    /// no limit.
    pub fn available() -> Vec<Self> {
        let best = Set::new();
        #[cfg(target_arch = "x86_64")]
        let sets = [
            #[cfg(level = "baseline")]
            best.as_sse2().map(Set::Sse2),
            #[cfg(level = "avx2")]
            best.as_avx2().map(Set::Avx2),
            #[cfg(level = "avx512")]
            best.as_avx512().map(Set::Avx512),
        ];
        #[cfg(target_arch = "aarch64")]
        let sets = [best.as_neon().map(Set::Neon)];
        let mut levels: Vec<Self> = sets.into_iter().flatten().map(Self).collect();
        // Kernels may run before the variable is checked: with the baseline if it is wrong.
        let allowed = highest(variable()).unwrap_or(1);
        if cfg!(not(feature = "native")) {
            levels.retain(|level| NAMES[..allowed].contains(&level.name()));
        }
        levels
    }

    /// Fastest available level.
    pub fn best() -> Self {
        static BEST: OnceLock<Level> = OnceLock::new();
        *BEST.get_or_init(|| *Self::available().last().expect("`check` has found one"))
    }

    /// An error if the environment variable `RADARCORE_SIMD` names no level, or if the core was built with the feature
    /// `native` for another processor.
    pub fn check() -> Result<()> {
        highest(variable())?;
        if Self::available().is_empty() {
            let expected = "the processor, or a better one, that the core was built for with the feature native";
            return Err(Error::value("processor", expected, "another; build it again"));
        }
        Ok(())
    }

    /// Name: `baseline`, `avx2` or `avx512`.
    pub fn name(self) -> &'static str {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Set::Avx2(_) => NAMES[1],
            #[cfg(target_arch = "x86_64")]
            Set::Avx512(_) => NAMES[2],
            _ => NAMES[0],
        }
    }

    /// Run loops over arrays, which the compiler vectorises, compiled for this level: a closure that is inlined.
    pub fn run_loops<R>(self, work: impl FnOnce() -> R) -> R {
        self.run(Loops(work))
    }

    /// Run a kernel compiled for this level.
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            #[cfg(all(target_arch = "x86_64", level = "baseline"))]
            Set::Sse2(token) => run(token, kernel),
            #[cfg(all(target_arch = "x86_64", level = "avx2"))]
            Set::Avx2(token) => run(token, kernel),
            #[cfg(all(target_arch = "x86_64", level = "avx512"))]
            Set::Avx512(token) => run(token, kernel),
            #[cfg(target_arch = "aarch64")]
            Set::Neon(token) => run(token, kernel),
            _ => unreachable!("`available` gives no others"),
        }
    }
}

/// Code that names no vectors.
struct Loops<F>(F);

impl<R, F: FnOnce() -> R> Kernel for Loops<F> {
    type Output = R;

    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> R {
        (self.0)()
    }
}

/// Value of the environment variable at the first call.
fn variable() -> &'static str {
    static VALUE: OnceLock<String> = OnceLock::new();
    VALUE.get_or_init(|| {
        std::env::var_os(VARIABLE).map_or_else(String::new, |value| value.to_string_lossy().into_owned())
    })
}

/// Number of levels that a value of the environment variable allows.
fn highest(value: &str) -> Result<usize> {
    if value.is_empty() {
        return Ok(NAMES.len());
    }
    let place = NAMES.iter().position(|name| *name == value);
    place.map(|place| place + 1).ok_or_else(|| {
        let expected = format!("'{}', '{}' or '{}'", NAMES[0], NAMES[1], NAMES[2]);
        Error::value(VARIABLE, expected, format!("{value:?}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn environment_variable_allows_levels_up_to_its_own() {
        for (value, allowed) in [("", 3), ("baseline", 1), ("avx2", 2), ("avx512", 3)] {
            assert_eq!(highest(value).unwrap(), allowed, "{value}");
        }
        for wrong in ["AVX2", "sse2", "avx2 ", "1"] {
            let message = highest(wrong).unwrap_err().to_string();
            let expected = format!("RADARCORE_SIMD: expected 'baseline', 'avx2' or 'avx512', got {wrong:?}");
            assert_eq!(message, expected);
        }
    }

    /// The tests "at every level" miss no level that the system reports for the processor. There may be one more: Linux
    /// hides `rdseed` of processors whose random numbers it does not trust.
    #[test]
    #[cfg(all(target_os = "linux", target_arch = "x86_64"))]
    fn every_level_of_the_processor_is_available_up_to_the_variable() {
        let known = std::fs::read_to_string("/proc/cpuinfo").unwrap();
        let flags: Vec<&str> = known
            .lines()
            .find(|line| line.starts_with("flags"))
            .unwrap()
            .split(' ')
            .collect();
        let has = |wanted: &str| wanted.split_whitespace().all(|flag| flags.contains(&flag));
        let avx2 = "avx2 fma f16c bmi1 bmi2 abm movbe popcnt cx16 xsave";
        let avx512 = "adx aes avx512_bitalg avx512_vbmi2 avx512_vnni avx512_vpopcntdq avx512bw avx512cd avx512dq avx512f \
                      avx512ifma avx512vbmi avx512vl gfni pclmulqdq rdrand rdseed sha_ni vaes vpclmulqdq xsavec xsaveopt \
                      xsaves";
        let mut expected = vec!["baseline"];
        expected.extend(has(avx2).then_some("avx2"));
        expected.extend((has(avx2) && has(avx512)).then_some("avx512"));
        let allowed = highest(variable()).unwrap();
        expected.truncate(allowed);
        let names: Vec<&str> = Level::available().into_iter().map(Level::name).collect();
        assert!(
            names.starts_with(&expected) && names.len() <= allowed,
            "{names:?}, {expected:?}"
        );
    }
}
