//! Readings of the spindle far above the rest of a shift.
//!
//! A bin's speed is the mean over the time that its readings cover, so a false reading of a sensor or a typing error makes
//! it too high by its share of the bin, and the whole of it where the log has one reading a bin or fewer. A reading is
//! doubtful that is short, and above one and a half times the speed of all but a hundredth of the other turning time:
//!
//! ```text
//!   T(n' ≥ n / 1.5, others) ≤ T(others) / 100,   t ≤ max(Δ, median of t)
//! ```
//!
//! It counts all the same: whether it was so is for whoever knows the machine.

use std::collections::BTreeMap;

use metrology::stamp::{Machine, Span, Stamp};

use super::once::Piece;

/// A speed above this multiple of the others is far from them.
const FAR_ABOVE_OTHERS: f64 = 1.5;
/// Share of the other turning time that may be as fast.
const SHARE_OF_OTHERS: f64 = 0.01;
/// Powers of two of nanoseconds.
const N_LENGTHS: usize = 64;

/// A reading that is far above the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubtfulSpeed {
    /// From when to when it held.
    pub during: Piece,
    /// Its speed, 1/min.
    pub rpm: f64,
    /// What all but a hundredth of the other turning time stays below, 1/min.
    pub others_rpm: f64,
}

/// The readings of a shift, summed up.
#[derive(Debug, Default)]
pub(super) struct Speeds {
    /// Time, ns, by whole 1/min; no machine turns faster than the numbers of the mapping may be.
    time_nanos: BTreeMap<u64, u64>,
    /// How many readings held for 2^k to 2^(k+1) ns.
    lengths: Vec<u64>,
    /// The fastest reading that begins in each line of the programs.
    fastest: BTreeMap<usize, (Stamp<Machine>, Stamp<Machine>, f64)>,
}

impl Speeds {
    /// A speed, 1/min, that held in a part of the shift; `line`: the line of the programs in which it begins.
    pub(super) fn add(&mut self, (first, last): Piece, rpm: f64, line: usize) {
        let nanos = (last - first).nanos().max(0).unsigned_abs();
        if nanos == 0 || rpm < 1.0 {
            return;
        }
        *self.time_nanos.entry(rpm.round() as u64).or_default() += nanos;
        self.lengths.resize(N_LENGTHS, 0);
        self.lengths[nanos.ilog2() as usize] += 1;
        let known = self.fastest.entry(line).or_insert((first, last, rpm));
        if rpm > known.2 {
            *known = (first, last, rpm);
        }
    }

    /// Half of the readings hold no longer, to a factor of two.
    fn median_length(&self) -> Span {
        let n: u64 = self.lengths.iter().sum();
        let mut below = 0;
        let place = self.lengths.iter().position(|count| {
            below += count;
            2 * below >= n
        });
        let nanos = place.map(|place| 1_u64 << (place + 1).min(N_LENGTHS - 2));
        Span::from_nanos(nanos.unwrap_or(0).cast_signed())
    }

    /// The doubtful readings in the order of time, the fastest of each line of the programs; `bin`: the time of a line.
    pub(super) fn doubtful(&self, bin: Span) -> Vec<DoubtfulSpeed> {
        let longest = bin.max(self.median_length());
        let all: u64 = self.time_nanos.values().sum();
        // Time at or above each speed.
        let mut above: Vec<(u64, u64)> = Vec::with_capacity(self.time_nanos.len());
        let mut sum = 0;
        for (rpm, nanos) in self.time_nanos.iter().rev() {
            sum += nanos;
            above.push((*rpm, sum));
        }
        let reading = |(first, last, rpm): &(Stamp<Machine>, Stamp<Machine>, f64)| {
            let own = (*last - *first).nanos().unsigned_abs();
            let others = all - own;
            let most = others as f64 * SHARE_OF_OTHERS;
            // From the fastest down to where more than the share of the others is reached, without the reading itself.
            let is_rare = |(at, sum): &(u64, u64)| {
                let own = if *at as f64 <= rpm.round() { own } else { 0 };
                (sum - own) as f64 <= most
            };
            let (others_rpm, _) = above.get(above.partition_point(is_rare))?;
            let is_far = *rpm > FAR_ABOVE_OTHERS * *others_rpm as f64;
            (is_far && *last - *first <= longest).then_some(DoubtfulSpeed {
                during: (*first, *last),
                rpm: *rpm,
                others_rpm: *others_rpm as f64,
            })
        };
        self.fastest.values().filter_map(reading).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BIN_S: f64 = 10.0;

    /// Speeds of a log with a reading every so many seconds.
    fn found(every_s: f64, rpm: &[f64]) -> Vec<(f64, f64)> {
        let mut speeds = Speeds::default();
        for (k, rpm) in rpm.iter().enumerate() {
            let at = |k: usize| Stamp::from_nanos((k as f64 * every_s * 1e9) as i64);
            let line = (k as f64 * every_s / BIN_S) as usize;
            speeds.add((at(k), at(k + 1)), *rpm, line);
        }
        let doubtful = speeds.doubtful(Span::from_secs_f64(BIN_S));
        doubtful.iter().map(|it| (it.rpm, it.others_rpm)).collect()
    }

    /// Half of the shift at one speed, half at another, with slow ramps and noise.
    fn shift(n: usize, [low, high]: [f64; 2]) -> Vec<f64> {
        let speed = |k: usize| if k < n / 2 { low } else { high };
        (0..n).map(|k| speed(k) + (k % 7) as f64).collect()
    }

    #[test]
    fn a_short_reading_far_above_the_others_is_doubtful_however_often_the_log_is_read() {
        for every_s in [0.1, 1.0, 10.0, 60.0] {
            for n in [30, 900] {
                let mut rpm = shift(n, [3_000.0, 2_000.0]);
                assert!(found(every_s, &rpm).is_empty());
                rpm[n / 3] = 9_999.0;
                assert_eq!(found(every_s, &rpm), [(9_999.0, 3_006.0)], "{every_s} {n}");
                rpm[n / 3] = 4_000.0;
                assert!(found(every_s, &rpm).is_empty());
            }
        }
    }

    #[test]
    fn two_speeds_of_a_shift_and_one_that_lasts_are_none() {
        assert!(found(1.0, &shift(900, [500.0, 12_000.0])).is_empty());
        let mut rpm = shift(900, [3_000.0, 3_000.0]);
        rpm[300..340].fill(9_000.0);
        assert!(found(1.0, &rpm).is_empty());
        assert!(found(1.0, &[0.0; 90]).is_empty());
        assert!(found(1.0, &[]).is_empty());
        assert!(found(1.0, &[5_000.0]).is_empty());
    }
}
