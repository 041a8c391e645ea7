//! The time of a host whose clock is related to the reference's: its computer's clock, taken over by the host clock's map.
//!
//! ```text
//!   shown = own + offset(own) + rest(own)                             (1)
//!   |rest| falls by 500 µs/s from what the maps differ by             (2)
//! ```
//!
//! A new map moves the time that is shown by no step but by (2), so that it never goes back; where maps differ by more than
//! 10 ms a clock was set, or this is the first map, and the time that is shown steps.
//!
//! `own` is the computer's clock, with an error of our making where parameters say so: hosts whose clocks differ are tried on
//! one computer.

use std::sync::{Arc, Mutex, PoisonError};

use metrology::Stamp;
use metrology::sample::HostClock;
use metrology::stamp::{Host, Span};

use super::host_now;

/// How fast the rest is given up.
const SLEWING: f64 = 500e-6;
/// A greater difference of maps is a step.
const CLOCK_STEP: Span = Span::from_nanos(10_000_000);

/// An error that a computer's clock is given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ClockError {
    /// What it shows too much at `since`, s.
    pub offset_s: f64,
    /// Seconds that it gains per second.
    pub drift: f64,
    /// When the offset is that, by the computer's clock.
    pub since: Stamp<Host>,
}

impl ClockError {
    fn shown(&self, computer: Stamp<Host>) -> Stamp<Host> {
        let gained = Span::from_secs_f64(self.drift * (computer - self.since).as_secs_f64());
        computer + Span::from_secs_f64(self.offset_s) + gained
    }
}

/// What a new map did to the time that is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Change {
    /// It goes over to the map without a step; they differed by this.
    Slews(Span),
    /// It has stepped by this.
    Steps(Span),
}

#[derive(Debug)]
struct Relation {
    clock: HostClock,
    /// When the map came, by the own clock, and what was shown more than by the map then.
    since: Stamp<Host>,
    rest: Span,
}

impl Relation {
    fn correction(&self, own: Stamp<Host>) -> Span {
        let given_up = Span::from_secs_f64(SLEWING * (own - self.since).as_secs_f64().max(0.0));
        let rest = self.rest.nanos();
        let left = rest.saturating_abs().saturating_sub(given_up.nanos()); // (2)
        let left = left.max(0) * rest.signum();
        Span::from_nanos(self.clock.map.offset(own).nanos().saturating_add(left)) // (1)
    }
}

/// The clock of a host, shared by all that stamp by it.
#[derive(Clone, Debug, Default)]
pub struct HostTime {
    error: Option<ClockError>,
    relation: Arc<Mutex<Option<Relation>>>,
}

impl HostTime {
    pub(crate) fn with_error(error: Option<ClockError>) -> Self {
        Self {
            error,
            relation: Arc::default(),
        }
    }

    /// The computer's clock, error included.
    pub(crate) fn own_now(&self) -> Stamp<Host> {
        self.own(host_now())
    }

    fn own(&self, computer: Stamp<Host>) -> Stamp<Host> {
        self.error.map_or(computer, |error| error.shown(computer))
    }

    /// The time that is shown now.
    #[must_use]
    pub fn now(&self) -> Stamp<Host> {
        self.shown(host_now())
    }

    /// The time that is shown when the computer's clock is at `computer`.
    #[must_use]
    pub fn shown(&self, computer: Stamp<Host>) -> Stamp<Host> {
        let own = self.own(computer);
        match &*self.relation() {
            Some(relation) => own + relation.correction(own),
            None => own,
        }
    }

    /// Whether the time that is shown is the computer's own.
    pub(crate) fn is_plain(&self) -> bool {
        self.error.is_none() && self.relation().is_none()
    }

    /// Goes by another map from now on.
    pub(crate) fn relate(&self, clock: HostClock) -> Change {
        self.relate_at(clock, self.own_now())
    }

    fn relate_at(&self, clock: HostClock, own: Stamp<Host>) -> Change {
        let wanted = clock.map.offset(own);
        let mut relation = self.relation();
        let shown = relation.as_ref().map(|before| before.correction(own));
        let by = shown
            .unwrap_or_default()
            .nanos()
            .saturating_sub(wanted.nanos());
        let steps = shown.is_none() || by.saturating_abs() > CLOCK_STEP.nanos();
        let rest = Span::from_nanos(if steps { 0 } else { by });
        *relation = Some(Relation {
            clock,
            since: own,
            rest,
        });
        if steps {
            Change::Steps(Span::from_nanos(-by))
        } else {
            Change::Slews(rest)
        }
    }

    /// The map in use with its age by the own clock.
    pub(crate) fn related(&self) -> Option<(HostClock, Span)> {
        let own = self.own_now();
        let relation = self.relation();
        let clock = relation.as_ref().map(|relation| relation.clock.clone())?;
        let age = own - clock.newest.returned_at;
        Some((clock, age))
    }

    fn relation(&self) -> std::sync::MutexGuard<'_, Option<Relation>> {
        self.relation.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use metrology::ClockMap;
    use metrology::sample::ClockExchange;

    use super::*;

    fn at(seconds: f64) -> Stamp<Host> {
        Stamp::from_nanos(1_700_000_000_000_000_000) + Span::from_secs_f64(seconds)
    }

    /// A map by which the reference is ahead by this when the host shows `seconds`.
    fn clock(seconds: f64, offset_s: f64, drift: f64) -> HostClock {
        let there = (at(seconds) + Span::from_secs_f64(offset_s)).nanos();
        HostClock {
            host: "models".to_owned(),
            reference: "controller".to_owned(),
            map: ClockMap::new(at(seconds), Stamp::from_nanos(there), drift),
            standard_uncertainty_s: 1e-5,
            drift_standard_uncertainty: 1e-7,
            bound_s: 1e-3,
            least_round_trip_s: 2e-3,
            n: 100,
            span_s: 10.0,
            steps: 0,
            newest: ClockExchange {
                asked_at: at(seconds),
                received_at: Stamp::from_nanos(there),
                answered_at: Stamp::from_nanos(there),
                returned_at: at(seconds),
            },
        }
    }

    #[test]
    fn without_a_map_the_computers_clock_is_shown() {
        let time = HostTime::default();
        assert_eq!(time.shown(at(5.0)), at(5.0));
        assert!(time.is_plain());
    }

    #[test]
    fn eq1_a_map_takes_an_error_of_offset_and_drift_out() {
        let time = HostTime::with_error(Some(ClockError {
            offset_s: 2.5,
            drift: 40e-6,
            since: at(0.0),
        }));
        assert_eq!((time.shown(at(100.0)) - at(100.0)).nanos(), 2_504_000_000);
        // The own clock shows 102.504 s when it is 100 s, and loses 40 µs/s on the true one, to first order.
        let map = clock(102.504, -2.504, -40e-6 / (1.0 + 40e-6));
        assert_eq!(
            time.relate_at(map, at(102.504)),
            Change::Steps(Span::from_secs_f64(-2.504))
        );
        for later in [100.0, 130.0, 4000.0] {
            let off = (time.shown(at(later)) - at(later)).nanos();
            assert!(off.abs() <= 2, "{off} ns at {later} s");
        }
    }

    #[test]
    fn eq2_a_new_map_makes_no_step_and_time_never_goes_back() {
        let time = HostTime::default();
        time.relate_at(clock(0.0, 1.0, 0.0), at(0.0));
        let by = time.relate_at(clock(10.0, 0.999, 0.0), at(10.0));
        assert_eq!(by, Change::Slews(Span::from_secs_f64(1e-3)));
        let mut last = time.shown(at(9.99));
        for k in 0..400 {
            let now = time.shown(at(10.0 + f64::from(k) * 0.01));
            assert!(now > last, "at {k}");
            last = now;
        }
        assert_eq!((time.shown(at(11.0)) - at(11.0)).nanos(), 999_500_000);
        assert_eq!((time.shown(at(13.0)) - at(13.0)).nanos(), 999_000_000);
    }

    #[test]
    fn maps_that_differ_by_more_than_a_step_are_followed_at_once() {
        let time = HostTime::default();
        time.relate_at(clock(0.0, 1.0, 0.0), at(0.0));
        let change = time.relate_at(clock(10.0, 1.5, 0.0), at(10.0));
        assert_eq!(change, Change::Steps(Span::from_secs_f64(0.5)));
        assert_eq!((time.shown(at(10.0)) - at(10.0)).nanos(), 1_500_000_000);
    }
}
