//! The line that the fast messages of both ways show.
//!
//! # Model
//!
//! With u and l of `band` (1), which are the offset plus the delay of a question and the offset less that of an answer, and their share p of fast messages,
//!
//! ```text
//!   q(b) = p-quantile of u - b t1,     r(b) = p-quantile of -(l - b t4)                    (7)
//!   b = argmin Σ ρ(u - b t1 - q) + Σ ρ(-(l - b t4) - r),   ρ(x) = x (p - [x < 0])           (8)
//!   a = ½ (q - r)                                                                          (9)
//! ```
//!
//! The shortest message would do where nothing is ever faster than the usual way. But frames overtake others, and of bell-shaped
//! delays the shortest is a matter of luck. A quantile takes 5 % of such frames, symmetric or not, and 95 % of slow ones.
//!
//! (8) is convex in b, so it is found by thirds. Delays that are alike both ways cancel in (9), whatever they are.
//!
//! # Holds when
//! As `band`; and fewer than p of the messages of a way overtake.
//!
//! # References
//! R. Koenker, G. Bassett, Econometrica 46(1), 1978, for (8).

use crate::band::Bound;

/// p.
const FAST_SHARE: f64 = 0.05;
/// Thirds until the drift is known to 1e-7 of its limit.
const THIRDS: u32 = 40;

/// Offset at the origin and drift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// a, s.
    pub offset_s: f64,
    /// b.
    pub drift: f64,
}

/// The value that the share p of the values lies below, and the sum of ρ about it; orders the values.
fn quantile(values: &mut [f64]) -> (f64, f64) {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a place in the list"
    )]
    let place = (FAST_SHARE * values.len() as f64) as usize;
    let (_, value, _) = values.select_nth_unstable_by(place, f64::total_cmp);
    let value = *value;
    let weighed = |x: f64| (x - value) * (FAST_SHARE - f64::from(u8::from(x < value)));
    (value, values.iter().map(|x| weighed(*x)).sum())
}

/// The fast value of a list, such as of round trips; `None`: it is empty.
#[must_use]
pub fn fast_value(mut values: Vec<f64>) -> Option<f64> {
    (!values.is_empty()).then(|| quantile(&mut values).0)
}

impl Line {
    /// The line of one drift, (7) and (9), and what (8) has to be least.
    fn of(bounds: &[Bound], drift: f64) -> (Self, f64) {
        let there = bounds.iter().map(|b| b.most_s - drift * b.asked_s);
        let back = bounds.iter().map(|b| drift * b.returned_s - b.least_s);
        let (there, there_loss) = quantile(&mut there.collect::<Vec<_>>());
        let (back, back_loss) = quantile(&mut back.collect::<Vec<_>>());
        let line = Self {
            offset_s: (there - back) / 2.0,
            drift,
        };
        (line, there_loss + back_loss)
    }

    /// The line of any drift up to `drift_limit`, (8); `None` without bounds.
    #[must_use]
    pub fn fitted(bounds: &[Bound], drift_limit: f64) -> Option<Self> {
        if bounds.is_empty() {
            return None;
        }
        let (mut low, mut high) = (-drift_limit, drift_limit);
        for _ in 0..THIRDS {
            let third = (high - low) / 3.0;
            let (left, right) = (low + third, high - third);
            let [at_left, at_right] = [left, right].map(|drift| Self::of(bounds, drift).1);
            if at_left > at_right {
                low = left;
            } else if at_left < at_right {
                high = right;
            } else {
                (low, high) = (left, right);
            }
        }
        Some(Self::of(bounds, (low + high) / 2.0).0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Questions ten times a second for 20 s on clocks 0.25 s and 40 µs/s apart.
    fn bounds(delays: impl Fn(u32) -> (f64, f64)) -> Vec<Bound> {
        let ahead_s = |at_s: f64| 0.25 + 40e-6 * at_s;
        (0..200)
            .map(|k| {
                let (there_s, back_s) = delays(k);
                let asked_s = f64::from(k) / 10.0;
                let returned_s = asked_s + there_s + back_s;
                Bound {
                    asked_s,
                    most_s: ahead_s(asked_s) + there_s,
                    returned_s,
                    least_s: ahead_s(returned_s) - back_s,
                }
            })
            .collect()
    }

    fn off(delays: impl Fn(u32) -> (f64, f64)) -> (f64, f64) {
        let line = Line::fitted(&bounds(delays), 1e-3).unwrap();
        ((line.offset_s - 0.25).abs(), (line.drift - 40e-6).abs())
    }

    #[test]
    fn eq8_finds_offset_and_drift_of_equal_ways() {
        let (offset_s, drift) = off(|_| (2e-3, 2e-3));
        assert!(offset_s < 1e-8 && drift < 1e-8, "{offset_s} {drift}");
    }

    #[test]
    fn eq7_frames_that_overtake_on_one_way_move_nothing() {
        // Seven of two hundred questions are 2 ms faster than the way is.
        let (offset_s, drift) = off(|k| (if k % 30 == 7 { 0.5e-3 } else { 2.5e-3 }, 2.5e-3));
        assert!(offset_s < 1e-8 && drift < 1e-8, "{offset_s} {drift}");
    }

    #[test]
    fn eq7_slow_frames_on_one_way_move_nothing() {
        // Nine of ten answers wait up to a second.
        let slow = |k: u32| {
            if k % 10 == 3 {
                2e-3
            } else {
                2e-3 + f64::from(k * 37 % 101) * 1e-2
            }
        };
        let (offset_s, drift) = off(|k| (2e-3, slow(k)));
        assert!(offset_s < 1e-6 && drift < 1e-6, "{offset_s} {drift}");
    }

    #[test]
    fn eq9_unequal_ways_are_seen_as_half_their_difference() {
        let (offset_s, _) = off(|_| (5e-3, 1e-3));
        assert!((offset_s - 2e-3).abs() < 1e-7, "{offset_s}");
    }
}
