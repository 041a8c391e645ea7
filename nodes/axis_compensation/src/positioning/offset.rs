//! The sum of the increments of compensation, in both readings of the published formulas.
//!
//! # Model
//!
//! With D = Δ(x_k) in the present direction's table, the sums of (4) and (5) of `positioning` are
//!
//! ```text
//!   o = −D                                                   `refreshed_table`        (1)
//!   o = −round(ω D) + M                                      `weighted_increments`    (2)
//!   M(k0) = −D(k0) + round[ω D(k0)],   M ← M + round{(1 − ω) [x − xs]}  once a cycle  (3)
//! ```
//!
//! since Σ e = −(D − D(k0)) whatever the way, and both begin at o = ε(k0) = −D(k0), the whole of what the
//! table says. Rounding of ω D is not carried on: only M sums, in whole femtometres.
//!
//! x − xs is what is still wrong with all compensation acting; x is where the slide belongs, the command and
//! what thermal and geometric parts add to it, or the loop would take these out again. It holds the servo's lag as well, so it is
//! taken below a feed limit only, and not before a whole cycle has passed since the limits of the axis
//! last held its offset back: what has been asked for but not yet done is not asked for again.
//!
//! # Holds when
//! (3): gain 1 − ω and delay of the axis fulfil `loop_stability`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which reading of the lost formulas compensates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reading {
    /// (5) of `positioning`: ω of the table, 1 − ω of what is measured at once.
    WeightedIncrements,
    /// (4) of `positioning`: the table, refreshed with ω at each pass of a point.
    RefreshedTable,
}

/// One axis' sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffsetSum {
    reading: Reading,
    weight: f64,
    cycle_s: f64,
    measured_fm: Option<i64>,
    quiet_s: f64,
}

impl OffsetSum {
    /// Nothing measured yet; one measurement each `cycle_s`.
    #[must_use]
    pub fn new(reading: Reading, weight: f64, cycle_s: f64) -> Self {
        Self {
            reading,
            weight,
            cycle_s,
            measured_fm: None,
            quiet_s: 0.0,
        }
    }

    /// Whether a measurement of x − xs is wanted at all.
    #[must_use]
    pub fn measures(&self) -> bool {
        self.reading == Reading::WeightedIncrements
    }

    fn predicted_fm(&self, deviation_fm: i64) -> i64 {
        match self.reading {
            Reading::RefreshedTable => -deviation_fm,
            Reading::WeightedIncrements => -share_fm(self.weight, deviation_fm),
        }
    }

    /// The offset where the table says `deviation_fm`: (1) or (2), fm.
    #[must_use]
    pub fn offset_fm(&self, deviation_fm: i64) -> i64 {
        self.measured_fm.map_or(-deviation_fm, |measured_fm| {
            self.predicted_fm(deviation_fm) + measured_fm
        })
    }

    /// Compensation does not act: the next time begins anew with what the table says.
    pub fn let_go(&mut self) {
        self.measured_fm = None;
        self.quiet_s = 0.0;
    }

    /// `dt_s` went by; `follows`: the axis does what it was asked for. Whether a measurement is due.
    pub fn wait(&mut self, dt_s: f64, follows: bool) -> bool {
        self.quiet_s = if follows { self.quiet_s + dt_s } else { 0.0 };
        // Sums of ticks end a rounding before or after a whole cycle.
        self.measures() && self.quiet_s >= self.cycle_s * (1.0 - 1e-9)
    }

    /// Takes x − xs = `error_fm` where the table says `deviation_fm`: (3).
    pub fn measure(&mut self, deviation_fm: i64, error_fm: i64) {
        let begin_fm = -deviation_fm - self.predicted_fm(deviation_fm);
        let measured_fm = self.measured_fm.get_or_insert(begin_fm);
        *measured_fm = measured_fm.saturating_add(share_fm(1.0 - self.weight, error_fm));
        self.quiet_s = 0.0;
    }

    /// Holds the sum where it is from here on, where the table says `deviation_fm`.
    pub fn begin(&mut self, deviation_fm: i64) {
        if self.measures() {
            let begin_fm = -deviation_fm - self.predicted_fm(deviation_fm);
            self.measured_fm.get_or_insert(begin_fm);
        }
    }
}

/// The nearest whole number of femtometres to a share from 0 to 1.
pub(super) fn share_fm(share: f64, length_fm: i64) -> i64 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a share is no longer than the length; above i64 the cast stops at its end"
    )]
    ((share * length_fm as f64).round() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    const UM: i64 = 1_000_000_000;

    #[test]
    fn eq1_the_refreshed_table_is_taken_whole_with_the_sign_of_physics() {
        let sum = OffsetSum::new(Reading::RefreshedTable, 0.3, 0.1);
        // The slide is 5 µm further than its motor: the command must be 5 µm less.
        assert_eq!(sum.offset_fm(5 * UM), -5 * UM);
        assert!(!sum.measures());
    }

    #[test]
    fn eq2_weighted_increments_begin_with_the_whole_and_go_on_with_the_share() {
        let mut sum = OffsetSum::new(Reading::WeightedIncrements, 0.3, 0.1);
        assert_eq!(sum.offset_fm(10 * UM), -10 * UM);
        sum.begin(10 * UM);
        assert_eq!(sum.offset_fm(10 * UM), -10 * UM);
        assert_eq!(sum.offset_fm(20 * UM), -13 * UM);
        sum.let_go();
        assert_eq!(sum.offset_fm(20 * UM), -20 * UM);
    }

    #[test]
    fn eq3_what_is_measured_is_removed_by_its_share_each_cycle() {
        let mut sum = OffsetSum::new(Reading::WeightedIncrements, 0.3, 0.1);
        let (table_fm, slide_fm) = (10 * UM, 18 * UM);
        sum.begin(table_fm);
        let mut left_fm = slide_fm + sum.offset_fm(table_fm);
        for _ in 0..5 {
            // x − xs: what the slide is too far, with the other sign.
            sum.measure(table_fm, -left_fm);
            let next_fm = slide_fm + sum.offset_fm(table_fm);
            assert!((next_fm - share_fm(0.3, left_fm)).abs() <= 1);
            left_fm = next_fm;
        }
        assert!(left_fm.abs() < UM / 40);
    }

    #[test]
    fn a_measurement_waits_for_a_whole_quiet_cycle() {
        let mut sum = OffsetSum::new(Reading::WeightedIncrements, 0.3, 0.1);
        let due: Vec<_> = (0..300)
            .filter(|k| {
                let is_due = sum.wait(1e-3, !(150..160).contains(k));
                if is_due {
                    sum.measure(0, 0);
                }
                is_due
            })
            .collect();
        assert_eq!(due, [99, 259]);
    }
}
