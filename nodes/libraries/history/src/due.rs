//! When a test is due again: a given interval after its last time, or the machine's own usual one.

use crate::fleet::median;

/// Fewest times from which an own interval is known.
const LEAST_TIMES: usize = 3;

/// When a test is due.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Due {
    /// Last time, s since 1970.
    pub last_s: f64,
    /// Interval between tests, s: the given one, or the median of the machine's own.
    pub interval_s: Option<f64>,
    /// When it is due, s since 1970; `None` without an interval.
    pub due_s: Option<f64>,
}

/// When a test with these times, in order, is due; `None` without any.
#[must_use]
pub fn due(times_s: &[f64], interval_s: Option<f64>) -> Option<Due> {
    let last_s = *times_s.last()?;
    let own = || {
        let is_known = times_s.len() >= LEAST_TIMES;
        let between = times_s.windows(2).map(|pair| pair[1] - pair[0]);
        median(between).filter(|_| is_known)
    };
    let interval_s = interval_s.or_else(own);
    Some(Due {
        last_s,
        interval_s,
        due_s: interval_s.map(|interval_s| last_s + interval_s),
    })
}
