//! Random streams, one per effect, so that adding an effect leaves the others' noise as it was.

use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// The effects that draw random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    ProbeRepeatability = 1,
    ProbeJitter = 2,
    ErrorMotions = 3,
    BlockPlacement = 4,
    Sensors = 5,
    ShopAir = 6,
    Bounce = 7,
    Graduation = 8,
    GridPlate = 9,
    Laser = 10,
    OilFilm = 11,
    Vibration = 12,
}

/// Random numbers of one effect.
#[derive(Clone, Debug)]
pub(super) struct Stream(Pcg64Mcg);

impl Stream {
    /// The stream of `effect` under the machine's seed; `member` tells apart equals (axes, sensors).
    pub(super) fn new(seed: u64, effect: Effect, member: u64) -> Self {
        let mut key = [0_u8; 16];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..].copy_from_slice(&((effect as u64) << 32 | member).to_le_bytes());
        let mut generator = Pcg64Mcg::from_seed(key);
        // The first outputs of a multiplicative generator still resemble its seed.
        for _ in 0..16 {
            let _: u64 = generator.random();
        }
        Self(generator)
    }

    /// Normal with mean 0 and standard deviation 1.
    pub(super) fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    /// Uniform in [0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        self.0.random()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_effect_member_and_seed_and_repeat_themselves() {
        let first = |seed, effect, member| Stream::new(seed, effect, member).uniform();
        let value = first(1, Effect::Sensors, 0);
        assert_eq!(value.to_bits(), first(1, Effect::Sensors, 0).to_bits());
        assert_ne!(value.to_bits(), first(1, Effect::Sensors, 1).to_bits());
        assert_ne!(value.to_bits(), first(1, Effect::ShopAir, 0).to_bits());
        assert_ne!(value.to_bits(), first(2, Effect::Sensors, 0).to_bits());
    }

    #[test]
    fn normal_numbers_have_unit_variance() {
        let mut stream = Stream::new(7, Effect::ProbeJitter, 0);
        let squares: f64 = (0..20_000).map(|_| stream.normal().powi(2)).sum();
        assert!((squares / 20_000.0 - 1.0).abs() < 0.04);
    }
}
