//! Runs that no figure counts whatever their deviations are: broken off, or with a stop whose readings contradict each other.
//!
//! A target counts where every run has it. A run that was broken off would take its targets from all others, so it is left out
//! whole. While an axis rests its reference reads one place: readings of one stop farther apart than a slip
//! are of two instruments, of two clocks, or of a lost beam, and their mean is of no place.

use std::fmt;

use iso230::positioning::whole_runs::{is_broken_off, n_of_complete};

use super::Visits;
use super::joined::SAME_STAMP_APART;
use super::slips::{SLIP, size};

/// Least and greatest reading of one stop, mm or rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::evaluate) struct Extent(Option<[f64; 2]>);

impl Extent {
    /// One more reading.
    pub(in crate::evaluate) fn add(&mut self, reading: f64) {
        let [low, high] = self.0.unwrap_or([reading; 2]);
        self.0 = Some([low.min(reading), high.max(reading)]);
    }

    /// How far its readings lie apart; `None`: it has none.
    pub(in crate::evaluate) fn size(self) -> Option<f64> {
        self.0.map(|[low, high]| high - low)
    }

    /// How far its readings lie apart, where that is more than a slip; the limit is that of a linear axis or of a rotary one.
    pub(in crate::evaluate) fn contradiction(self, is_linear: bool) -> Option<f64> {
        let apart = self.size()?;
        (apart > SLIP[usize::from(!is_linear)]).then_some(apart)
    }
}

/// A stop whose readings contradict each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::evaluate) struct Contradiction {
    /// Whether the axis is linear.
    pub is_linear: bool,
    /// Where it rested, mm or deg.
    pub at: f64,
    /// Whether it was approached upwards.
    pub is_up: bool,
    /// Greatest difference of its readings, mm or rad.
    pub apart: f64,
    /// Whether that is of two readings of one stamp.
    pub is_of_one_stamp: bool,
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            is_linear,
            at,
            is_up,
            apart,
            is_of_one_stamp,
        } = *self;
        let unit = if is_linear { "mm" } else { "deg" };
        let way = if is_up { "up" } else { "down" };
        if is_of_one_stamp {
            return write!(
                f,
                "two readings of one stamp at the stop at {at:.3} {unit} {way} differ by {}, at most {}: two instruments or recordings wrote them: \
                 separate them",
                size(is_linear, apart),
                size(is_linear, SAME_STAMP_APART[usize::from(!is_linear)])
            );
        }
        write!(
            f,
            "readings of the stop at {at:.3} {unit} {way} differ by {}, at most {}: two instruments or clocks wrote them, or the beam was lost: \
             record one, or repeat the run",
            size(is_linear, apart),
            size(is_linear, SLIP[usize::from(!is_linear)])
        )
    }
}

/// Why a run cannot be used by itself: stops that contradict themselves, or readings that do not go with the axis.
pub(in crate::evaluate) fn why_not(
    contradictions: &[Contradiction],
    against: Option<String>,
) -> Option<String> {
    match contradictions {
        [] => against,
        [first] => Some(first.to_string()),
        [first, others @ ..] => Some(format!(
            "{first}; {} more such stops of this run",
            others.len()
        )),
    }
}

/// Takes runs out that cannot be used: those of which `own` has the reason, and those that were broken off. Numbers and reasons of
/// these.
pub(in crate::evaluate) fn take_out(
    runs: &mut Vec<Visits>,
    numbers: &mut Vec<u32>,
    own: Vec<Option<String>>,
) -> Vec<(u32, String)> {
    let n_read = |run: &Visits| -> usize {
        let sides = run.values().flatten();
        sides.filter(|readings| !readings.is_empty()).count()
    };
    let n_complete = n_of_complete(runs.iter().map(n_read).collect());
    let why = |(run, own): (&Visits, Option<String>)| {
        let n = n_read(run);
        own.or_else(|| {
            is_broken_off(n, n_complete).then(|| {
                format!(
                    "it has {n} readings where a complete run has {n_complete}: it was broken off, and is left out whole: repeat the run"
                )
            })
        })
    };
    let reasons: Vec<Option<String>> = runs.iter().zip(own).map(why).collect();
    let mut usable = reasons.iter().map(Option::is_none);
    runs.retain(|_| usable.next().unwrap_or(true));
    let mut usable = reasons.iter().map(Option::is_none);
    let all = numbers.clone();
    numbers.retain(|_| usable.next().unwrap_or(true));
    let named = all.into_iter().zip(reasons);
    named
        .filter_map(|(number, reason)| Some((number, reason?)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_of_one_stop_farther_apart_than_a_slip_contradict_each_other() {
        for (is_linear, readings, apart) in [
            (true, &[10.0, 10.4, 10.1][..], None),
            (true, &[10.0, 10.6, 10.1], Some(0.6)),
            (true, &[-40.0, 0.0], Some(40.0)),
            (true, &[], None),
            (false, &[0.0, 0.004], None),
            (false, &[0.0, 0.006], Some(0.006)),
        ] {
            let mut extent = Extent::default();
            readings.iter().for_each(|reading| extent.add(*reading));
            let found = extent.contradiction(is_linear);
            assert_eq!(
                found.map(|apart| (apart * 1e6).round()),
                apart.map(|apart: f64| (apart * 1e6).round())
            );
        }
        let one = Contradiction {
            is_linear: true,
            at: -280.0,
            is_up: true,
            apart: 40.159,
            is_of_one_stamp: false,
        };
        let said = one.to_string();
        let words = "readings of the stop at -280.000 mm up differ by 40159 µm, at most 500 µm: ";
        assert!(said.starts_with(words), "{said}");
    }
}
