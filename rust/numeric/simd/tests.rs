use super::*;

struct Operations<'a, T>(&'a [T; 16]);

impl<T: Precision> Kernel for Operations<'_, T> {
    type Output = Vec<T>;
    #[cfg_attr(optimised, inline(always))]
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
            <T::In<I>>::splat(v.first()),
            <T::In<I>>::splat(T::of(f64::from(v.equal(<T::In<I>>::splat(b))))),
        ];
        let mut out = vec![T::zero(); results.len() * lanes];
        for (result, chunk) in results.iter().zip(out.chunks_mut(lanes)) {
            result.store(chunk);
        }
        let mut grid: Vec<T> = out[..4 * lanes].to_vec();
        add_window(&mut grid, 2, lanes, &[v, c], &[low]);
        out.extend(grid);
        out
    }
}

struct Integers<'a>(&'a [u32; 16], &'a [f64; 16]);

impl Kernel for Integers<'_> {
    type Output = (u32, [u32; 16], [f32; 16]);
    #[cfg_attr(optimised, inline(always))]
    fn run<I: Isa>(self) -> Self::Output {
        let (mut numbers, mut narrow) = (*self.0, [0.0; 16]);
        I::put(&mut numbers, 0b1000_0110_0000_1001, u32::MAX);
        f32::narrow::<I>([I::F64::load(self.1), I::F64::load(&self.1[8..])]).store(&mut narrow);
        (I::equal(self.0, 7), numbers, narrow)
    }
}

#[test]
fn numbers_are_compared_put_and_rounded_in_their_places() {
    let mut numbers: [u32; 16] = std::array::from_fn(|i| i as u32);
    (numbers[1], numbers[15]) = (7, 7);
    let wide: [f64; 16] = std::array::from_fn(|i| (i as f64 + 0.3).sqrt());
    for level in Level::available() {
        let (equal, put, narrow) = level.run(Integers(&numbers, &wide));
        assert_eq!(equal, 0b1000_0000_1000_0010, "{level:?}");
        for i in 0..16 {
            let is_put = [0, 3, 9, 10, 15].contains(&i);
            assert_eq!(put[i], if is_put { u32::MAX } else { numbers[i] }, "{level:?}");
        }
        assert_eq!(narrow, wide.map(|x| x as f32), "{level:?}");
    }
}

#[test]
fn every_level_does_the_same() {
    // Small integers: no operation rounds.
    let single: [f32; 16] = std::array::from_fn(|i| (i * i % 23) as f32 - 7.0);
    let double: [f64; 16] = std::array::from_fn(|i| (i * i % 23) as f64 - 7.0);
    let baseline = Level::available()[0];
    let expected = (baseline.run(Operations(&single)), baseline.run(Operations(&double)));
    for level in Level::available() {
        assert_eq!(level.run(Operations(&single)), expected.0, "{level:?}");
        assert_eq!(level.run(Operations(&double)), expected.1, "{level:?}");
    }
    assert_eq!(expected.0[16..32], *[[-7.0; 8], [-6.0; 8]].as_flattened());
    assert_eq!(expected.0[48..52], [-7.0, -7.0, -6.0, -6.0]);
}
