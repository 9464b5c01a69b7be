//! Hash to pseudorandom numbers: equal input gives an equal number on every machine.

/// One step of `SplitMix64`: Steele, Lea, Flood, Fast Splittable Pseudorandom Number Generators, OOPSLA 2014.
pub fn mix(state: u64) -> u64 {
    let z = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
