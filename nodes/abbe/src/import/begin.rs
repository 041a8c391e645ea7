//! When the measurement of one of several tables begins that states no date of its own.

use super::titles::LEAST_DATE_S;

/// Between the end of a table and the begin of the next one where nobody states it, s: a day, after which a machine is settled.
pub const PAUSE_S: i64 = 86_400;
/// Times of the day come again after it, s.
const WHOLE_DAY_S: i64 = 86_400;

/// What came before a table in one call.
#[derive(Clone, Copy, Debug)]
pub struct Before {
    /// Its end, s since 1970.
    pub end_s: i64,
    /// Whether it was read by the same map, whose begin is its own then.
    pub has_same_map: bool,
}

/// Where a table is put that has no date: a pause after the one before it, or at the next such time of the day. `None`: it has
/// a date, or goes on.
pub fn after(before: Before, start_s: i64, is_assumed: bool) -> Option<i64> {
    if is_assumed || before.has_same_map {
        return Some(before.end_s.saturating_add(PAUSE_S));
    }
    let behind_s = before.end_s.saturating_sub(start_s);
    let is_date = start_s as f64 >= LEAST_DATE_S;
    let days = (behind_s + WHOLE_DAY_S - 1).div_euclid(WHOLE_DAY_S);
    (!is_date && behind_s > 0).then(|| start_s + days * WHOLE_DAY_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_without_a_date_follows_the_one_before_it() {
        let dated = 1_767_600_000;
        let before = |end_s: i64, has_same_map: bool| Before {
            end_s,
            has_same_map,
        };
        for (before, start_s, is_assumed, wanted) in [
            (before(3600, false), 0, true, Some(3600 + PAUSE_S)),
            (before(dated, false), 0, true, Some(dated + PAUSE_S)),
            (
                before(dated + 60, true),
                dated,
                false,
                Some(dated + 60 + PAUSE_S),
            ),
            // Dates are their own, in whatever order.
            (before(dated, false), dated + 3600, false, None),
            (before(dated, false), dated - 3600, false, None),
            // From 8 to 12 h; then from 13 h, and from 8 h.
            (before(43_200, false), 46_800, false, None),
            (
                before(43_200, false),
                28_800,
                false,
                Some(28_800 + WHOLE_DAY_S),
            ),
            (before(43_200, false), 43_200, false, None),
            (
                before(43_201, false),
                43_200,
                false,
                Some(43_200 + WHOLE_DAY_S),
            ),
        ] {
            let found = after(before, start_s, is_assumed);
            assert_eq!(found, wanted, "{before:?} {start_s}");
        }
    }
}
