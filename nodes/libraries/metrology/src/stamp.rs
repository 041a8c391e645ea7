//! Instants on named clocks; the difference of two clocks does not compile.
//!
//! ```compile_fail
//! use metrology::{Host, Machine, Stamp};
//! let machine = Stamp::<Machine>::from_nanos(1);
//! let host = Stamp::<Host>::from_nanos(1);
//! let _ = machine - host; // only a ClockMap leads from one clock to another
//! ```

use std::fmt;
use std::marker::PhantomData;
use std::ops::{Add, AddAssign, Sub};

/// A source of time.
pub trait Clock: Copy + fmt::Debug + Default + Ord {}

/// The controller's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Machine;
/// The clock of the computer that runs the nodes (or simulated time, where that is in use).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Host;

/// The clock of the host by which the others of a cell go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reference;

impl Clock for Machine {}
impl Clock for Host {}
impl Clock for Reference {}

/// Length of one second in nanoseconds.
pub const NANOS_PER_S: i64 = 1_000_000_000;

/// A signed length of time in integer nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Span(i64);

impl Span {
    /// From integer nanoseconds.
    #[must_use]
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// From seconds, rounded to the nearest nanosecond.
    #[must_use]
    pub fn from_secs_f64(seconds_s: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "292 years of nanoseconds")]
        Self((seconds_s * 1e9).round() as i64)
    }

    /// Integer nanoseconds.
    #[must_use]
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// Seconds.
    #[must_use]
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 / 1e9
    }
}

/// An instant on clock `C`, in nanoseconds since that clock's epoch.
///
/// Sums and differences stop at the ends of the 292 years that fit: a senseless stamp from outside
/// must not end a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Stamp<C: Clock> {
    nanos: i64,
    clock: PhantomData<C>,
}

impl<C: Clock> Stamp<C> {
    /// From nanoseconds since the clock's epoch.
    #[must_use]
    pub const fn from_nanos(nanos: i64) -> Self {
        Self {
            nanos,
            clock: PhantomData,
        }
    }

    /// Nanoseconds since the clock's epoch.
    #[must_use]
    pub const fn nanos(self) -> i64 {
        self.nanos
    }

    /// Seconds since the clock's epoch; loses nanoseconds after a few months.
    #[must_use]
    pub fn as_secs_f64(self) -> f64 {
        self.nanos as f64 / 1e9
    }
}

impl<C: Clock> Sub for Stamp<C> {
    type Output = Span;

    fn sub(self, earlier: Self) -> Span {
        Span(self.nanos.saturating_sub(earlier.nanos))
    }
}

impl<C: Clock> Add<Span> for Stamp<C> {
    type Output = Self;

    fn add(self, span: Span) -> Self {
        Self::from_nanos(self.nanos.saturating_add(span.0))
    }
}

impl<C: Clock> Sub<Span> for Stamp<C> {
    type Output = Self;

    fn sub(self, span: Span) -> Self {
        Self::from_nanos(self.nanos.saturating_sub(span.0))
    }
}

impl<C: Clock> AddAssign<Span> for Stamp<C> {
    fn add_assign(&mut self, span: Span) {
        *self = *self + span;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn senseless_stamps_do_not_panic() {
        let (first, last) = (
            Stamp::<Host>::from_nanos(i64::MIN),
            Stamp::<Host>::from_nanos(i64::MAX),
        );
        assert_eq!((last - first).nanos(), i64::MAX);
        assert_eq!(last + Span::from_secs_f64(1.0), last);
        assert_eq!(first - Span::from_secs_f64(1.0), first);
    }

    #[test]
    fn spans_add_back_to_the_stamp() {
        let early = Stamp::<Machine>::from_nanos(5);
        let late = early + Span::from_secs_f64(1.5);
        assert_eq!((late - early).nanos(), 1_500_000_000);
        assert_eq!(late - Span::from_nanos(1_500_000_000), early);
    }
}
