//! A long time in a bag in which nothing was recorded: the player waits and reports it.

use std::fmt;

use metrology::epoch::utc_of_nanos;
use metrology::stamp::{Host, Span, Stamp};

/// A longer pause is reported when it begins.
pub const TOLD: Span = Span::from_nanos(3_600_000_000_000);

/// Nothing was recorded between two messages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pause {
    /// Time of the bag's first message.
    pub first: Stamp<Host>,
    /// Time of the message before.
    pub from: Stamp<Host>,
    /// Time of the message behind.
    pub to: Stamp<Host>,
    /// Time of the bag over time.
    pub rate: f64,
}

impl Pause {
    /// The pause between two messages that are waited for at `rate`; `None`: it is short.
    #[must_use]
    pub fn between(
        first: Stamp<Host>,
        from: Stamp<Host>,
        to: Stamp<Host>,
        rate: f64,
    ) -> Option<Self> {
        (to - from > TOLD).then_some(Self {
            first,
            from,
            to,
            rate,
        })
    }

    /// How long is waited, s.
    #[must_use]
    pub fn wait_s(&self) -> f64 {
        (self.to - self.from).as_secs_f64() / self.rate
    }

    /// What `--from` has to be to begin behind the pause, s: a little before its end, as seconds are rounded.
    #[must_use]
    pub fn from_s(&self) -> f64 {
        const MS: i64 = 1_000_000;
        let whole_ms = (self.to - self.first).nanos() / MS - 1;
        whole_ms as f64 * 1e-3
    }
}

impl fmt::Display for Pause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let length = duration((self.to - self.from).as_secs_f64());
        let wait = duration(self.wait_s());
        let [from, to] = [self.from, self.to].map(|at| utc_of_nanos(at.nanos(), 3));
        let rate = self.rate;
        write!(f, "nothing was recorded for {length}, from {from}")?;
        if self.from.nanos() == 0 {
            write!(f, " (the recorder's clock was not set)")?;
        }
        write!(
            f,
            " to {to}: {wait} pass at rate {rate}; --from {:.3} begins behind it, a higher --rate shortens it, --rate 0 waits for nothing",
            self.from_s()
        )
    }
}

/// A time in the unit that a person would choose.
pub(crate) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{s:.1} s"),
        s if s < 7_200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3_600.0),
        s if s < 63_115_200.0 => format!("{:.1} days", s / 86_400.0),
        s => format!("{:.1} years", s / 31_557_600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(s: i64) -> Stamp<Host> {
        Stamp::from_nanos(s * 1_000_000_000)
    }

    #[test]
    fn a_pause_names_its_length_its_wait_and_the_way_around_it() {
        let (today, first) = (at(1_764_000_000), at(0));
        let pause = Pause::between(first, first, today, 2.0).unwrap();
        let text = pause.to_string();
        for words in [
            "nothing was recorded for 55.9 years, from 1970-01-01 00:00:00.000 UTC (the recorder's clock was not set)",
            "to 2025-11-24 16:00:00.000 UTC: 27.9 years pass at rate 2",
            "--from 1763999999.999 begins behind it",
            "--rate 0",
        ] {
            assert!(text.contains(words), "{words}: {text}");
        }
        let later = Pause::between(at(100), at(200), at(200 + 3_601), 1.0).unwrap();
        let text = later.to_string();
        let words = "for 60 min, from 1970-01-01 00:03:20.000 UTC to";
        assert!(text.contains(words), "{text}");
        assert!((later.from_s() - 3_700.999).abs() < 1e-9);
        assert!(Pause::between(first, first, at(3_600), 1.0).is_none());
    }
}
