//! Where along its travel an axis has moved, for heat that stays where it is made.

/// Parts that a travel is cut into.
pub const ZONES: usize = 16;

/// Way of one axis in each part of its travel, over the entries of a history.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rubbing {
    /// Low and high end of the travel, mm or rad.
    pub travel: [f64; 2],
    /// Way over time in each zone, mm/s or rad/s, one entry for each of the history's; they add up to its mean speed.
    pub speed: Vec<[f64; ZONES]>,
}

impl Rubbing {
    /// Zone of a position; what lies beyond an end counts to its zone.
    #[must_use]
    pub fn zone([low, high]: [f64; 2], position: f64) -> usize {
        let share = (position - low) / (high - low) * ZONES as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative, and cut at the last zone"
        )]
        let zone = share.max(0.0) as usize;
        zone.min(ZONES - 1)
    }

    /// Length of a zone.
    #[must_use]
    pub fn zone_length(&self) -> f64 {
        (self.travel[1] - self.travel[0]) / ZONES as f64
    }

    /// What follows the speeds with a time constant, from zero, while it spreads along the screw:
    ///
    /// ```text
    ///   ds/dt = (u - s) / tau + D d2s/dx2,   s(0) = 0
    /// ```
    ///
    /// at the middles of the entries; `spreads` is D, square of the unit of the travel a second. No heat leaves the ends.
    #[must_use]
    pub fn lagged(&self, step_s: f64, lag_s: f64, spreads: f64) -> Vec<[f64; ZONES]> {
        let per_s = spreads / self.zone_length().powi(2);
        let fastest = (2.0 * step_s * per_s / MOST_STEP).ceil().max(1.0);
        let part_s = 0.5 * step_s / fastest;
        let kept = (-part_s / lag_s).exp();
        let mut state = [0.0; ZONES];
        let mut half = |input: &[f64; ZONES]| {
            let mut done = 0.0;
            while done < fastest {
                let before = state;
                for (zone, value) in state.iter_mut().enumerate() {
                    let low = before[zone.saturating_sub(1)];
                    let high = before[(zone + 1).min(ZONES - 1)];
                    let spread = before[zone] + part_s * per_s * (low + high - 2.0 * before[zone]);
                    *value = input[zone] + (spread - input[zone]) * kept;
                }
                done += 1.0;
            }
            state
        };
        let follow = |input: &[f64; ZONES]| {
            let middle = half(input);
            half(input);
            middle
        };
        self.speed.iter().map(follow).collect()
    }

    /// Integral of what the zones hold from the low end to a position, linear within a zone.
    #[must_use]
    pub fn integral(&self, zones: &[f64; ZONES], position: f64) -> f64 {
        let length = self.zone_length();
        let at = (position - self.travel[0]) / length;
        let whole = Self::zone(self.travel, position);
        let before: f64 = zones[..whole].iter().sum();
        let within = (at - whole as f64).clamp(0.0, 1.0);
        length * (before + within * zones[whole])
    }
}

/// Greatest share that spreads to the neighbours in one step of the integration.
const MOST_STEP: f64 = 0.4;

#[cfg(test)]
mod tests {
    use super::*;

    fn rubbing(speed: [f64; ZONES], n: usize) -> Rubbing {
        Rubbing {
            travel: [-80.0, 240.0],
            speed: vec![speed; n],
        }
    }

    #[test]
    fn even_rubbing_rises_as_the_exponential_everywhere() {
        let lagged = rubbing([3.0; ZONES], 60).lagged(10.0, 200.0, 13.0);
        for (k, zones) in lagged.iter().enumerate() {
            let wanted = 3.0 * (1.0 - (-(10.0 * k as f64 + 5.0) / 200.0).exp());
            for value in zones {
                assert!((value - wanted).abs() < 1e-9, "{value} {wanted}");
            }
        }
    }

    #[test]
    fn what_spreads_is_neither_lost_nor_made() {
        let mut once = [0.0; ZONES];
        once[3] = 16.0;
        let mut shared = rubbing([0.0; ZONES], 40);
        shared.speed[0] = once;
        let total = |spreads: f64| -> Vec<f64> {
            let lagged = shared.lagged(10.0, 300.0, spreads);
            lagged.iter().map(|zones| zones.iter().sum()).collect()
        };
        for (still, spread) in total(0.0).into_iter().zip(total(13.0)) {
            assert!((still / spread - 1.0).abs() < 1e-9, "{still} {spread}");
        }
        let last = shared.lagged(10.0, 300.0, 13.0)[39];
        assert!(last[3] > last[4] && last[4] > last[5] && last[0] > last[8]);
    }

    #[test]
    fn the_integral_is_linear_within_a_zone_and_stops_at_the_ends() {
        let rubbing = rubbing([0.0; ZONES], 1);
        let mut zones = [0.0; ZONES];
        zones[1] = 0.5;
        for (position, wanted) in [
            (-90.0, 0.0),
            (-60.0, 0.0),
            (-50.0, 5.0),
            (0.0, 10.0),
            (500.0, 10.0),
        ] {
            let found = rubbing.integral(&zones, position);
            assert!((found - wanted).abs() < 1e-12, "{position}: {found}");
        }
    }
}
