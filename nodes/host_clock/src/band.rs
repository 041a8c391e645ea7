//! The widest band between what the reference's clock was at most and at least ahead.
//!
//! # Model
//!
//! A question that left when the host showed t1 came when the reference showed t2; an answer that left at t3 came back
//! at t4. Nothing arrives before it left, so the offset o of the reference's clock is
//!
//! ```text
//!   o(t1) ≤ t2 - t1 = u,     o(t4) ≥ t3 - t4 = l                                    (1)
//!   o(t) = a + b t                                                                   (2)
//!   s(b) = ½ [min(u - b t1) - max(l - b t4)],   a(b) = ½ [min(u - b t1) + max(l - b t4)]   (3)
//!   b = argmax s(b), |b| ≤ the greatest drift of clocks                              (4)
//! ```
//!
//! Where no line satisfies (1), the clocks did not run evenly. Otherwise the offset lies in the band, however unequal the
//! two ways are: half of what they differ by is what no exchange of stamps can see.
//!
//! s is concave in b, so (4) is found by thirds.
//!
//! # Holds when
//! Both clocks run evenly over the exchanges.

/// What one exchange says; times and offsets relative to an origin, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// t1.
    pub asked_s: f64,
    /// u: the reference is ahead by no more than this at `asked_s`.
    pub most_s: f64,
    /// t4.
    pub returned_s: f64,
    /// l: the reference is ahead by no less than this at `returned_s`.
    pub least_s: f64,
}

/// The line in the middle of the widest band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// a: the offset at the origin, s.
    pub offset_s: f64,
    /// b: the drift.
    pub drift: f64,
    /// s: half the width; negative: no line satisfies every bound, s.
    pub half_width_s: f64,
}

/// Thirds until the drift is known to 1e-7 of its limit.
const THIRDS: u32 = 40;

impl Band {
    /// The band of one drift, (3).
    fn of(bounds: &[Bound], drift: f64) -> Self {
        let most = bounds
            .iter()
            .map(|bound| bound.most_s - drift * bound.asked_s)
            .fold(f64::INFINITY, f64::min);
        let least = bounds
            .iter()
            .map(|bound| bound.least_s - drift * bound.returned_s)
            .fold(f64::NEG_INFINITY, f64::max);
        Self {
            offset_s: (most + least) / 2.0,
            drift,
            half_width_s: (most - least) / 2.0,
        }
    }

    /// The widest band of any drift up to `drift_limit`, (4); `None` without bounds.
    #[must_use]
    pub fn widest(bounds: &[Bound], drift_limit: f64) -> Option<Self> {
        if bounds.is_empty() {
            return None;
        }
        let (mut low, mut high) = (-drift_limit, drift_limit);
        for _ in 0..THIRDS {
            let third = (high - low) / 3.0;
            let (left, right) = (low + third, high - third);
            let widths = [left, right].map(|drift| Self::of(bounds, drift).half_width_s);
            if widths[0] < widths[1] {
                low = left;
            } else if widths[0] > widths[1] {
                high = right;
            } else {
                (low, high) = (left, right);
            }
        }
        Some(Self::of(bounds, (low + high) / 2.0))
    }

    /// The offset at a time relative to the origin, (2).
    #[must_use]
    pub fn offset_at_s(&self, at_s: f64) -> f64 {
        self.offset_s + self.drift * at_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Questions every second with delays `there` and `back`, on clocks that are `offset` and `drift` apart.
    fn bounds(n: u32, line: (f64, f64), delays: impl Fn(u32) -> (f64, f64)) -> Vec<Bound> {
        (0..n)
            .map(|k| {
                let (there, back) = delays(k);
                let asked_s = f64::from(k);
                let returned_s = asked_s + there + back;
                let ahead = |at: f64| line.0 + line.1 * at;
                Bound {
                    asked_s,
                    most_s: ahead(asked_s) + there,
                    returned_s,
                    least_s: ahead(returned_s) - back,
                }
            })
            .collect()
    }

    #[test]
    fn eq4_equal_ways_give_offset_and_drift_back() {
        let band = Band::widest(&bounds(20, (0.25, 40e-6), |_| (2e-3, 2e-3)), 1e-3).unwrap();
        assert!((band.offset_s - 0.25).abs() < 1e-9, "{band:?}");
        assert!((band.drift - 40e-6).abs() < 1e-9, "{band:?}");
        assert!((band.half_width_s - 2e-3).abs() < 1e-9, "{band:?}");
    }

    #[test]
    fn eq3_slow_messages_leave_the_band_where_it_is() {
        // Every second question waits 80 ms in a queue, every third answer for a second.
        let slow = |k: u32| {
            let there = if k % 2 == 1 { 82e-3 } else { 2e-3 };
            (there, if k % 3 == 1 { 1.002 } else { 2e-3 })
        };
        let band = Band::widest(&bounds(40, (-3.0, -15e-6), slow), 1e-3).unwrap();
        assert!((band.offset_s + 3.0).abs() < 1e-6, "{band:?}");
        assert!((band.drift + 15e-6).abs() < 1e-7, "{band:?}");
    }

    #[test]
    fn eq3_unequal_ways_are_seen_as_half_their_difference_and_lie_within_the_band() {
        let band = Band::widest(&bounds(20, (0.0, 0.0), |_| (5e-3, 1e-3)), 1e-3).unwrap();
        assert!((band.offset_s - 2e-3).abs() < 1e-6, "{band:?}");
        assert!(band.half_width_s >= 2e-3);
    }

    #[test]
    fn eq1_a_clock_that_stepped_leaves_no_band() {
        let mut both = bounds(10, (0.0, 0.0), |_| (1e-3, 1e-3));
        let mut later = bounds(10, (0.1, 0.0), |_| (1e-3, 1e-3));
        for bound in &mut later {
            bound.asked_s += 10.0;
            bound.returned_s += 10.0;
        }
        both.extend(later);
        assert!(Band::widest(&both, 1e-3).unwrap().half_width_s < 0.0);
    }
}
