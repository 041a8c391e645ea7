//! When the lines of a log are replayed, by their stamps, whatever the machine's clock did.
//!
//! A line is replayed as long after an earlier one as its stamp lies behind that one's:
//!
//! ```text
//!   τ_k = max(τ_{k−1}, τ_a + max(0, t_k − t_a))                                            (1)
//! ```
//!
//! with a the nearest *anchor*: the newest stamp before a leap of the clock, or the first behind one. A stamp leaps when
//! it lies behind every anchor by more than the longest pause, or before it by more than [`DISORDER`]; and when it lies
//! ahead by more than that and the stamps go back again within [`AHEAD`] lines: then it was wrong. A leap takes no time,
//! is reported, and is an anchor itself: one wrong stamp costs nothing, and an hour that comes twice is replayed twice.
//!
//! Lines before the first stamp are replayed with it, lines without one with the line before them. Milliseconds since
//! the adapter began are stamps of their own kind.

use std::ops::Range;

use metrology::stamp::{Machine, Span, Stamp};

use crate::leap::Leap;

/// Lines of several sources are out of order by so much.
pub const DISORDER: Span = Span::from_nanos(60_000_000_000);
/// So many lines are looked ahead for the return of a clock.
pub const AHEAD: usize = 20;
/// Stamps that are remembered for a return.
const ANCHORS: usize = 4;

/// When a line was, by its own word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// A date.
    Dated(Stamp<Machine>),
    /// Since an instant that only the adapter knows.
    Counted(Span),
    /// It does not say.
    Untold,
}

/// A time of a line: whether it is a date (else it counts from some start), and its value, ns.
pub type Timed = (bool, i64);

impl Moment {
    /// The time of a line; `None` for a line without one.
    #[must_use]
    pub const fn on_its_scale(self) -> Option<Timed> {
        match self {
            Self::Dated(stamp) => Some((true, stamp.nanos())),
            Self::Counted(span) => Some((false, span.nanos())),
            Self::Untold => None,
        }
    }
}

/// When a line is replayed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Paced {
    /// Time after the log's begin, (1).
    pub after: Span,
    /// The date that it has, or is replayed with.
    pub dated: Option<Stamp<Machine>>,
    /// The leap that it makes.
    pub leap: Option<Leap>,
}

#[derive(Clone, Copy, Debug)]
struct Anchor {
    is_date: bool,
    nanos: i64,
    after: Span,
}

/// The anchors, the one in use last.
#[derive(Clone, Debug, Default)]
struct Pacer {
    anchors: Vec<Anchor>,
    after: Span,
}

impl Pacer {
    /// The nearest anchor from which a stamp goes on.
    fn nearest(&self, is_date: bool, nanos: i64, longest: Span) -> Option<usize> {
        let range = -DISORDER.nanos()..=longest.nanos();
        let fits = self.anchors.iter().enumerate().filter_map(|(at, anchor)| {
            let ahead = nanos.saturating_sub(anchor.nanos);
            let is_near = anchor.is_date == is_date && range.contains(&ahead);
            is_near.then_some((ahead.saturating_abs(), usize::MAX - at))
        });
        fits.min().map(|(_, from_end)| usize::MAX - from_end)
    }

    /// Takes a stamp; whether it leaps. `returns`: whether soon a stamp lies within a range.
    fn take(
        &mut self,
        (is_date, nanos): (bool, i64),
        longest: Span,
        returns: impl Fn(Range<i64>) -> bool,
    ) -> bool {
        let disorder = DISORDER.nanos();
        let near = self.nearest(is_date, nanos, longest).filter(|at| {
            let from = self.anchors[*at].nanos;
            let is_wrong = || {
                let used = self.anchors.last().filter(|_| at + 1 < self.anchors.len());
                let back = used.map(|used| used.nanos - disorder..used.nanos + longest.nanos());
                returns(from - disorder..nanos - disorder) || back.is_some_and(&returns)
            };
            nanos.saturating_sub(from) <= disorder || !is_wrong()
        });
        if let Some(at) = near {
            let is_other = at + 1 < self.anchors.len();
            let mut anchor = self.anchors.remove(at);
            let ahead = Span::from_nanos(nanos.saturating_sub(anchor.nanos).max(0));
            let after = anchor.after.nanos().saturating_add(ahead.nanos());
            self.after = self.after.max(Span::from_nanos(after));
            anchor.nanos = anchor.nanos.max(nanos);
            anchor.after = self.after;
            self.anchors.push(anchor);
            return is_other;
        }
        let is_first = self.anchors.is_empty();
        if self.anchors.len() == ANCHORS {
            self.anchors.remove(0);
        }
        self.anchors.push(Anchor {
            is_date,
            nanos,
            after: self.after,
        });
        !is_first
    }
}

/// Paces the lines of a log one after another.
#[derive(Clone, Debug, Default)]
pub struct Pacing {
    pacer: Pacer,
    before: Option<Timed>,
    dated: Option<Stamp<Machine>>,
}

impl Pacing {
    /// The date that lines before the first dated one are replayed with.
    pub const fn begin_at(&mut self, first: Option<Stamp<Machine>>) {
        self.dated = first;
    }

    /// When the next line is due; `behind`: the times of the lines after it, of which the first [`AHEAD`] are used.
    pub fn pace(
        &mut self,
        moment: Moment,
        behind: impl Iterator<Item = Timed> + Clone,
        longest: Span,
    ) -> Paced {
        let mut leap = None;
        if let Some(now) = moment.on_its_scale() {
            let before = self.before.replace(now);
            let returns = |range: Range<i64>| {
                let mut alike = behind.clone().take(AHEAD).filter(|next| next.0 == now.0);
                alike.any(|(_, nanos)| range.contains(&nanos))
            };
            let leaps = self.pacer.take(now, longest, returns);
            let from = before.filter(|(is_date, _)| leaps && *is_date == now.0);
            leap = from.map(|(_, from)| Leap {
                from: Stamp::from_nanos(from),
                to: Stamp::from_nanos(now.1),
                passed: None,
            });
        }
        if let Moment::Dated(stamp) = moment {
            self.dated = Some(stamp);
        }
        Paced {
            after: self.pacer.after,
            dated: self.dated,
            leap,
        }
    }
}

/// The first date among moments.
pub fn first_date(moments: impl IntoIterator<Item = Moment>) -> Option<Stamp<Machine>> {
    moments.into_iter().find_map(|moment| match moment {
        Moment::Dated(stamp) => Some(stamp),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DAY: i64 = 86_400;
    /// 2026-01-05T08:00:00Z.
    const THEN: i64 = 1_767_600_000;
    const LONGEST: Span = Span::from_nanos(43_200_000_000_000);

    fn seconds(span: Span) -> i64 {
        span.nanos() / 1_000_000_000
    }

    fn paced(moments: &[Moment], longest: Span) -> Vec<Paced> {
        let mut pacing = Pacing::default();
        pacing.begin_at(first_date(moments.iter().copied()));
        let pace = |(at, moment): (usize, &Moment)| {
            let behind = moments[at + 1..].iter().filter_map(|it| it.on_its_scale());
            pacing.pace(*moment, behind, longest)
        };
        moments.iter().enumerate().map(pace).collect()
    }

    /// Seconds after the begin and number of leaps, of dates in seconds; negative ones are lines without.
    fn pace(dates: &[i64]) -> (Vec<i64>, usize) {
        let moment = |date: &i64| match *date {
            ..=-1 => Moment::Untold,
            date => Moment::Dated(Stamp::from_nanos(date * 1_000_000_000)),
        };
        let moments: Vec<_> = dates.iter().map(moment).collect();
        let paced = paced(&moments, LONGEST);
        let leaps = paced.iter().filter(|one| one.leap.is_some()).count();
        (paced.iter().map(|one| seconds(one.after)).collect(), leaps)
    }

    /// A behaviour of the machine's clock, the seconds after the begin at which lines are replayed, and the leaps reported.
    #[test]
    fn eq1_odd_clocks_cost_no_line() {
        let t = THEN;
        let table: [(&str, &[i64], &[i64], usize); 16] = [
            ("plain", &[t, t + 5, t + 6], &[0, 5, 6], 0),
            ("no date", &[-1, -1], &[0, 0], 0),
            ("no date first", &[-1, t, -1, t + 5], &[0, 0, 0, 5], 0),
            (
                "one in 2035",
                &[t, t + 9 * 365 * DAY, t + 5, t + 6],
                &[0, 0, 5, 6],
                2,
            ),
            (
                "one hours ahead",
                &[t, t + 7200, t + 5, t + 6],
                &[0, 0, 5, 6],
                2,
            ),
            (
                "one hours back",
                &[t, t - 7200, t + 5, t + 6],
                &[0, 0, 5, 6],
                2,
            ),
            ("first of 1970", &[0, t, t + 5], &[0, 0, 5], 1),
            ("1970 for a while", &[10, 12, t, t + 5], &[0, 2, 2, 7], 1),
            ("first ahead", &[t + 7200, t, t + 5], &[0, 0, 5], 1),
            ("out of order", &[t, t + 5, t + 1, t + 6], &[0, 5, 5, 6], 0),
            (
                "an hour twice",
                &[t, t + 50, t - 3540, t - 3500, t + 60],
                &[0, 50, 50, 90, 90],
                2,
            ),
            ("a day ahead", &[t, t + DAY, t + DAY + 5], &[0, 0, 5], 1),
            ("a day back", &[t, t - DAY, t - DAY + 5], &[0, 0, 5], 1),
            ("a night", &[t, t + 40_000], &[0, 40_000], 0),
            ("across 2038", &[2_147_483_640, 2_147_483_650], &[0, 10], 0),
            ("to 2106", &[4_294_967_290, 4_294_967_295], &[0, 5], 0),
        ];
        for (what, dates, wanted, leaps) in table {
            assert_eq!(pace(dates), (wanted.to_vec(), leaps), "{what}");
        }
    }

    #[test]
    fn milliseconds_since_the_adapter_began_have_their_pauses_too() {
        let counted = |ms: i64| Moment::Counted(Span::from_nanos(ms * 1_000_000));
        let moments = [
            counted(500),
            counted(2500),
            Moment::Untold,
            counted(0),
            counted(1000),
        ];
        let after: Vec<_> = paced(&moments, LONGEST)
            .iter()
            .map(|one| one.after.nanos())
            .collect();
        assert_eq!(after, [0, 2, 2, 2, 2].map(|s| s * 1_000_000_000));
    }

    proptest! {
        /// Whatever the dates: lines keep their order, no wait is over the longest, and wrong ones in a plain log
        /// do not change when the others are replayed.
        #[test]
        fn prop_lines_keep_their_order_and_are_all_told(dates in proptest::collection::vec(0_i64..4_294_967_296, 0..60)) {
            let (after, _) = pace(&dates);
            prop_assert!(after.windows(2).all(|two| two[0] <= two[1]));
            prop_assert!(after.windows(2).all(|two| two[1] - two[0] <= seconds(LONGEST)));
        }

        #[test]
        fn prop_single_wrong_stamps_change_nothing(
            steps in proptest::collection::vec(1_i64..50, 30..60),
            wrong in proptest::collection::btree_map(1_usize..29, 100_000_i64..1_000_000_000, 0..3),
        ) {
            let mut dates = vec![THEN];
            dates.extend(steps.iter().scan(THEN, |at, step| { *at += step; Some(*at) }));
            let plain = pace(&dates).0;
            let spoiled: Vec<i64> = dates.iter().enumerate().map(|(at, date)| {
                let both_wrong = wrong.contains_key(&(at.wrapping_sub(1)));
                match wrong.get(&at).filter(|_| !both_wrong) { Some(by) => date + by, None => *date }
            }).collect();
            let found = pace(&spoiled).0;
            for (at, (found, plain)) in found.iter().zip(&plain).enumerate() {
                if spoiled[at] == dates[at] {
                    prop_assert_eq!(found, plain, "line {}", at);
                }
            }
        }
    }
}
