//! Random numbers of trials.

use rand::Rng;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Shares of trials with none, one and two hidden effects; the rest has three.
const HOW_MANY: [f64; 3] = [0.2, 0.4, 0.25];
/// Share of readings that scatter more than the others, and the ratio of the scatters.
const OUTLYING_SHARE: f64 = 0.1;
const OUTLYING_RATIO: f64 = 2.6;

/// A number whose logarithm is uniform.
pub fn log_uniform(random: &mut Pcg64Mcg, [low, high]: [f64; 2]) -> f64 {
    low * (high / low).powf(random.random())
}

/// A normal deviate.
pub fn normal(random: &mut Pcg64Mcg) -> f64 {
    random.sample(StandardNormal)
}

/// A deviate of variance 1 with heavier tails than a normal one.
pub fn heavy(random: &mut Pcg64Mcg) -> f64 {
    let variance = 1.0 - OUTLYING_SHARE + OUTLYING_SHARE * OUTLYING_RATIO * OUTLYING_RATIO;
    let is_outlying = random.random::<f64>() < OUTLYING_SHARE;
    let size = if is_outlying { OUTLYING_RATIO } else { 1.0 };
    size / variance.sqrt() * normal(random)
}

/// Plus or minus one.
pub fn sign(random: &mut Pcg64Mcg) -> f64 {
    if random.random() { 1.0 } else { -1.0 }
}

/// How many effects a trial hides.
pub fn how_many(random: &mut Pcg64Mcg) -> usize {
    let mut left: f64 = random.random();
    for (count, share) in HOW_MANY.iter().enumerate() {
        if left < *share {
            return count;
        }
        left -= share;
    }
    HOW_MANY.len()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn heavy_deviates_have_variance_one_and_more_beyond_three() {
        let mut random = Pcg64Mcg::seed_from_u64(5);
        let all: Vec<f64> = (0..100_000).map(|_| heavy(&mut random)).collect();
        let variance = all.iter().map(|value| value * value).sum::<f64>() / all.len() as f64;
        let beyond = all.iter().filter(|value| value.abs() > 3.0).count();
        assert!((variance - 1.0).abs() < 0.03, "{variance}");
        assert!(beyond > 600, "{beyond} of a normal one would be 270");
    }
}
