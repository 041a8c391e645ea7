//! Two readings of one instrument with one stamp that differ: two recordings or instruments wrote them, and one of them is wrong.
//!
//! The second one is left out and counted. Where many stamps of a run have two such readings, which of them are right is not known, and
//! the run is not evaluated. Stops of positioning tests have their own rule ([`super::linear`]).

use std::collections::BTreeMap;

use metrology::Axis;
use metrology::number::number;
use metrology::sample::{
    GridSample, LengthSample, TemperatureSample, TestKind, TestPlane, TestSegment,
};
use metrology::stamp::{Host, Stamp};
use replayer::{Reason, Taken};

use super::linear::joined::SAME_STAMP_APART;

/// Temperatures of one stamp that differ by more contradict each other, K.
const SAME_STAMP_APART_K: f64 = 0.5;
/// Fewest stamps with two differing readings by which a run is not evaluated.
const CLASHING_STAMPS: u64 = 3;
/// Part of the stamps with two readings, as its inverse, that have differing ones then.
const CLASHING_PART: u64 = 4;

/// What one instrument reads: a length with its zero, a plane with its zero, a temperature.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Of {
    Length(Axis, u32),
    Grid(u8, u32),
    Temperature(String),
}

/// The run under way.
#[derive(Debug)]
struct Open {
    run: u32,
    /// Stamps with two readings, and those of them that differ.
    n_double: u64,
    n_apart: u64,
    /// The greatest difference, mm.
    apart_mm: f64,
}

/// Judges readings as they come, those of one stamp one after another.
#[derive(Debug, Default)]
pub(super) struct Clashes {
    open: Option<Open>,
    last: BTreeMap<Of, (Stamp<Host>, [f64; 2])>,
    /// Runs that cannot be evaluated, with the reason.
    runs: Vec<(u32, String)>,
}

impl Clashes {
    /// Begin or end of a test.
    pub(super) fn segment(&mut self, segment: &TestSegment) {
        self.last.retain(|of, _| matches!(of, Of::Temperature(_)));
        let ended = self.open.take().filter(|_| !segment.begin);
        if let Some(open) = ended
            && open.n_apart >= CLASHING_STAMPS
            && open.n_apart.saturating_mul(CLASHING_PART) >= open.n_double
        {
            let reason = format!(
                "{} times two readings of one stamp differ, by up to {} µm, at most {} µm: two instruments or recordings wrote them: separate them",
                open.n_apart,
                number((open.apart_mm * 1e4).round() / 10.0),
                number(SAME_STAMP_APART[0] * 1e3),
            );
            self.runs.push((open.run, reason));
        }
        let is_judged = !matches!(segment.kind, TestKind::Positioning | TestKind::Diagonal);
        self.open = (segment.begin && is_judged).then_some(Open {
            run: segment.run,
            n_double: 0,
            n_apart: 0,
            apart_mm: 0.0,
        });
    }

    /// Whether a length of a circle or a log is no second reading that differs.
    pub(super) fn length(&mut self, sample: &LengthSample, taken: &mut Taken<'_>) -> bool {
        let of = Of::Length(sample.axis, sample.zero_id);
        self.reading(of, (sample.at, [sample.displacement_mm, 0.0]), taken)
    }

    /// The same of a place on the plate.
    pub(super) fn grid(&mut self, sample: &GridSample, taken: &mut Taken<'_>) -> bool {
        let plane = match sample.plane {
            TestPlane::None => 0,
            TestPlane::Xy => 1,
            TestPlane::Yz => 2,
            TestPlane::Zx => 3,
        };
        let of = Of::Grid(plane, sample.zero_id);
        self.reading(of, (sample.at, [sample.u_mm, sample.v_mm]), taken)
    }

    /// The same of a temperature, whatever is under way.
    pub(super) fn temperature(
        &mut self,
        sample: &TemperatureSample,
        taken: &mut Taken<'_>,
    ) -> bool {
        let of = Of::Temperature(sample.sensor.clone());
        let read = (sample.at, [sample.temperature_degc, 0.0]);
        let Some(apart_k) = self.apart(of, read).filter(|k| *k > SAME_STAMP_APART_K) else {
            return true;
        };
        taken.leave_out(Reason::Outlier, || {
            differs(&format!("{} K", number(apart_k)), SAME_STAMP_APART_K, "K")
        });
        false
    }

    fn reading(&mut self, of: Of, read: (Stamp<Host>, [f64; 2]), taken: &mut Taken<'_>) -> bool {
        if self.open.is_none() {
            return true;
        }
        let apart_mm = self.apart(of, read);
        let Some((open, apart_mm)) = self.open.as_mut().zip(apart_mm) else {
            return true;
        };
        open.n_double += 1;
        if apart_mm <= SAME_STAMP_APART[0] {
            return true;
        }
        open.n_apart += 1;
        open.apart_mm = open.apart_mm.max(apart_mm);
        taken.leave_out(Reason::Outlier, || {
            let um = number((apart_mm * 1e4).round() / 10.0);
            differs(&format!("{um} µm"), SAME_STAMP_APART[0] * 1e3, "µm")
        });
        false
    }

    /// How far a reading lies from the one before it, where both have one stamp.
    fn apart(&mut self, of: Of, (at, values): (Stamp<Host>, [f64; 2])) -> Option<f64> {
        let (known_at, known) = self.last.get(&of).copied().unzip();
        if known_at == Some(at) {
            let [a, b] = known?;
            let [u, v] = values;
            return Some((u - a).hypot(v - b));
        }
        self.last.insert(of, (at, values));
        None
    }

    /// The runs that cannot be evaluated, with the reason.
    pub(super) fn runs(self) -> Vec<(u32, String)> {
        self.runs
    }
}

fn differs(apart: &str, limit: f64, unit: &str) -> String {
    format!(
        "two readings of one stamp differ by {apart}, at most {} {unit}: two instruments or recordings wrote them; the first is used",
        number(limit)
    )
}
