//! The session's time: host stamps made to go on where a clock jumps or another bag begins.

use metrology::stamp::{Host, Span, Stamp};

use super::recent::LATE_S;

/// A sample this much newer than the newest one means that the clock jumped: no session rests longer, and what is held of
/// its past grows with it.
const LONGEST_REST: Span = Span::from_nanos(7 * 86_400 * 1_000_000_000);
/// Between a jump, or a bag that is older than the one before it, and what came before.
const PAUSE: Span = Span::from_nanos(60_000_000_000);

/// For so long without axis states what else comes says whether the clock jumped.
const LONGEST_WITHOUT_AXES: Span = Span::from_nanos(60_000_000_000);

/// What a sample is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// Axis states, which come all the time.
    Axes,
    /// Anything else. On a busy computer it may come seconds after newer axis states: where these go on the clock did not
    /// jump.
    Other,
}

/// Maps stamps to seconds since the session's start.
#[derive(Clone, Debug, Default)]
pub(super) struct SessionTime {
    start: Option<Stamp<Host>>,
    /// Of all samples, and of the axis states of this bag.
    newest: Stamp<Host>,
    newest_of_axes: Option<Stamp<Host>>,
    shift: Span,
}

/// What a stamp means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum At {
    /// Seconds since the session's start.
    Time(f64),
    /// The clock jumped back, or far ahead; the seconds go on after a pause.
    Jumped(f64),
}

impl SessionTime {
    /// The time of the newest sample.
    pub(super) fn newest_s(&self) -> f64 {
        self.start
            .map_or(0.0, |start| (self.newest - start).as_secs_f64())
    }

    /// The time of something that may be told long after it was.
    pub(super) fn of(&mut self, at: Stamp<Host>) -> f64 {
        let start = *self.start.get_or_insert_with(|| {
            self.newest = at;
            at
        });
        (at + self.shift - start).as_secs_f64().max(0.0)
    }

    /// Another bag begins, whose clock nothing is known of.
    pub(super) const fn next_bag(&mut self) {
        self.newest_of_axes = None;
    }

    /// Whether axis states go on.
    pub(super) fn follows_axes(&self) -> bool {
        let since = |of_axes| self.newest - of_axes;
        { self.newest_of_axes }.is_some_and(|of_axes| since(of_axes) <= LONGEST_WITHOUT_AXES)
    }

    /// The time of a sample that drives the clock.
    pub(super) fn take(&mut self, at: Stamp<Host>, source: Source) -> At {
        let start = *self.start.get_or_insert_with(|| {
            self.newest = at;
            at
        });
        let mut shifted = at + self.shift;
        // A sample that is a little older than the newest one is late; an older one means that the clock jumped.
        let is_back = match source {
            Source::Axes => Self::is_older(self.newest_of_axes.unwrap_or(self.newest), shifted),
            Source::Other => !self.follows_axes() && Self::is_older(self.newest, shifted),
        };
        let jumped = is_back || shifted - self.newest > LONGEST_REST;
        if jumped {
            self.shift = self.newest + PAUSE - at;
            shifted = at + self.shift;
        }
        self.newest = self.newest.max(shifted);
        if source == Source::Axes {
            self.newest_of_axes = Some(shifted);
        }
        let time_s = (shifted - start).as_secs_f64().max(0.0);
        if jumped {
            At::Jumped(time_s)
        } else {
            At::Time(time_s)
        }
    }

    fn is_older(newest: Stamp<Host>, at: Stamp<Host>) -> bool {
        (newest - at).as_secs_f64() > LATE_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(seconds: i64) -> Stamp<Host> {
        Stamp::from_nanos(seconds * 1_000_000_000)
    }

    #[test]
    fn a_jump_back_goes_on_after_a_pause() {
        let mut time = SessionTime::default();
        assert_eq!(time.take(at(100), Source::Axes), At::Time(0.0));
        assert_eq!(time.take(at(110), Source::Axes), At::Time(10.0));
        assert_eq!(time.take(at(50), Source::Axes), At::Jumped(70.0));
        assert_eq!(time.take(at(55), Source::Axes), At::Time(75.0));
    }

    #[test]
    fn a_jump_far_ahead_goes_on_after_a_pause_and_a_weekend_is_none() {
        let mut time = SessionTime::default();
        assert_eq!(time.take(at(100), Source::Axes), At::Time(0.0));
        assert_eq!(time.take(at(180_100), Source::Axes), At::Time(180_000.0));
        assert_eq!(
            time.take(at(9_000_000_000), Source::Axes),
            At::Jumped(180_060.0)
        );
        assert_eq!(
            time.take(at(9_000_000_005), Source::Axes),
            At::Time(180_065.0)
        );
        // Back from there to the true time.
        assert_eq!(time.take(at(180_110), Source::Axes), At::Jumped(180_125.0));
    }

    #[test]
    fn a_sample_that_is_a_little_late_keeps_its_time() {
        let mut time = SessionTime::default();
        let _ = time.take(at(100), Source::Axes);
        let _ = time.take(at(101), Source::Axes);
        assert_eq!(
            time.take(Stamp::from_nanos(100_500_000_000), Source::Axes),
            At::Time(0.5)
        );
    }

    #[test]
    fn what_comes_late_beside_axes_that_go_on_is_no_jump_and_axes_behind_it_are_none() {
        let mut time = SessionTime::default();
        assert_eq!(time.take(at(100), Source::Axes), At::Time(0.0));
        assert_eq!(time.take(at(130), Source::Axes), At::Time(30.0));
        assert_eq!(time.take(at(115), Source::Other), At::Time(15.0));
        assert_eq!(time.take(at(131), Source::Axes), At::Time(31.0));
        assert_eq!(time.take(at(145), Source::Other), At::Time(45.0));
        assert_eq!(time.take(at(132), Source::Axes), At::Time(32.0));
        // Axes that go back themselves have jumped, 60 s after what came last.
        assert_eq!(time.take(at(90), Source::Axes), At::Jumped(105.0));
        assert_eq!(time.take(at(91), Source::Other), At::Time(106.0));
    }

    #[test]
    fn without_axes_and_in_another_bag_all_else_says_that_the_clock_jumped() {
        let mut time = SessionTime::default();
        assert_eq!(time.take(at(100), Source::Other), At::Time(0.0));
        assert_eq!(time.take(at(50), Source::Other), At::Jumped(60.0));
        assert_eq!(time.take(at(51), Source::Axes), At::Time(61.0));
        assert_eq!(time.take(at(112), Source::Other), At::Time(122.0));
        assert_eq!(time.take(at(60), Source::Other), At::Jumped(182.0));
        assert_eq!(time.take(at(61), Source::Axes), At::Time(183.0));
        time.next_bag();
        assert_eq!(time.take(at(10), Source::Other), At::Jumped(243.0));
    }
}
