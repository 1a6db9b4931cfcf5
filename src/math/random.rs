//! Seeded, counter-based random numbers: the value at an index depends on the seed and the index alone,
//! so parallel loops give the same numbers in any order and on any number of threads.

/// A stream of independent random numbers, addressed by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CounterRng {
    key: u64,
}

/// The finaliser of `SplitMix64` (G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number
/// generators", 2014).
#[inline]
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl CounterRng {
    /// The stream of `seed`.
    pub fn new(seed: u64) -> Self {
        Self { key: mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15)) }
    }

    /// An independent stream, for a frame or a particle.
    pub fn stream(&self, index: u64) -> Self {
        Self { key: mix(self.key ^ mix(index.wrapping_mul(0xd1b5_4a32_d192_ed03).wrapping_add(1))) }
    }

    /// 64 random bits.
    #[inline]
    pub fn bits(&self, index: u64) -> u64 {
        mix(self.key.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    /// Uniform in [0, 1).
    #[inline]
    pub fn uniform(&self, index: u64) -> f64 {
        (self.bits(index) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Standard normal (Box and Muller 1958), from the bits at `2 index` and `2 index + 1`.
    #[inline]
    pub fn normal(&self, index: u64) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(2 * index)).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform(2 * index + 1)).cos()
    }

    /// `count` different indices below `n` at random, ascending; all of fewer.
    pub fn sample(&self, n: usize, count: usize) -> Vec<u32> {
        if count >= n {
            return (0..n as u32).collect();
        }
        // Those with the smallest random keys.
        let mut keyed: Vec<(u64, u32)> = (0..n as u32).map(|k| (self.bits(u64::from(k)), k)).collect();
        keyed.select_nth_unstable(count - 1);
        let mut chosen: Vec<u32> = keyed[..count].iter().map(|&(_, k)| k).collect();
        chosen.sort_unstable();
        chosen
    }

    /// Three different indices below `n`, in any order.
    pub fn three(&self, n: usize) -> [usize; 3] {
        let draw = |place: u64, from: usize| (self.uniform(place) * from as f64) as usize;
        // Each is drawn among those left: indices not below an earlier one move up.
        let (first, second, third) = (draw(0, n), draw(1, n - 1), draw(2, n - 2));
        let second = second + usize::from(second >= first);
        let third = third + usize::from(third >= first.min(second));
        [first, second, third + usize::from(third >= first.max(second))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_different_indices() {
        let chosen = CounterRng::new(4).sample(100, 30);
        assert!(chosen.len() == 30 && chosen.windows(2).all(|pair| pair[0] < pair[1]) && chosen[29] < 100);
        assert_ne!(chosen, CounterRng::new(5).sample(100, 30));
        assert_eq!(CounterRng::new(5).sample(3, 30), [0, 1, 2]);
    }

    #[test]
    fn three_are_different_and_reach_every_index() {
        let mut seen = [false; 7];
        for i in 0..200 {
            let [a, b, c] = CounterRng::new(i).three(7);
            assert!(a != b && b != c && a != c);
            for index in [a, b, c] {
                seen[index] = true;
            }
        }
        assert!(seen.iter().all(|&seen| seen));
    }
}
