//! Which readings belong to the run under way, and what became of runs that cannot be evaluated.
//!
//! A reading counts where its stamp is of the time of the axis states beside it. That of a length or an angle also has to be
//! of its run's axis, and a length near its nominal place. Everything else, and every run without a begin or an end, is
//! counted as left out. So is a reading of another zero or plane than its run's, and a run whose begin no test of its kind has
//! or whose end states otherwise than its begin.
//!
//! A tracker may read further axes than the run's. Their readings are not needed where one of the run's own axis was made
//! within [`BESIDE_S`], unless their value is at home on the run's axis and not on the one that they name; otherwise they
//! contradict the run. Readings of a run that the machine did not complete are not needed; the report names that run.

use std::fmt;

use metrology::PerAxis;
use metrology::sample::{AngleSample, AxisState, GridSample, LengthSample, TestSegment};
use metrology::stamp::{Host, Stamp};
use replayer::{Account, Place, Reason, Taken};

use super::linear::axis_of;
use super::not_evaluated::{Measured, NotEvaluated};

mod begin;
mod judge;

use begin::{contradiction, wrong_begin};

/// Readings of two axes within this time are of one measurement, s.
const BESIDE_S: f64 = 1.0;
/// A value is at home on an axis where its nominal place there is so near, mm and rad.
const NEAR_NOMINAL: [f64; 2] = [1.0, 0.01];

/// A run that the machine did not complete.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BrokenOff {
    /// Its number.
    pub run: u32,
    /// Which test, for people.
    pub test: String,
}

impl BrokenOff {
    /// Why it is not evaluated, for people.
    pub const REASON: &str =
        "its end says that it was not completed (stopped, cancelled or failed)";
}

impl fmt::Display for BrokenOff {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { run, test } = self;
        write!(
            f,
            "Not evaluated: run {run}, {test}: {}; measure it again.",
            Self::REASON
        )
    }
}

/// Judges what comes while a bag is read.
#[derive(Debug, Default)]
pub(super) struct Belonging {
    open: Option<Open>,
    /// The last end of a run that was taken.
    ended: Option<TestSegment>,
    dropped: Vec<Dropped>,
    /// What was taken and nobody needed after all.
    released: Vec<Held>,
    broken_off: Vec<BrokenOff>,
    not_evaluated: Vec<NotEvaluated>,
    measured: Vec<Measured>,
    /// The run whose begin was left out, until its end.
    refused: Option<u32>,
    /// Whether the bag has readings of a grid encoder: lengths beside them are no ballbar's.
    has_grid: bool,
}

/// What became of the runs of a bag.
#[derive(Debug, Default)]
pub(super) struct Runs {
    pub broken_off: Vec<BrokenOff>,
    /// Runs whose begin or end cannot be used.
    pub not_evaluated: Vec<NotEvaluated>,
    /// Runs of which something was read to their end.
    pub measured: Vec<Measured>,
}

/// What becomes of a reading.
#[derive(Debug, PartialEq)]
enum Judged {
    Counts,
    /// Of a further axis, where one of the run's own stands beside it; the words where none does.
    Further(String),
    LeftOut(Reason, String),
}

/// The kinds of readings.
#[derive(Clone, Copy, Debug)]
enum Of {
    Angle,
    Length,
    Grid,
}

/// The run under way.
#[derive(Debug)]
struct Open {
    begin: TestSegment,
    /// The message of its begin.
    begin_message: Held,
    axes: Option<Axes>,
    /// What was taken for it, by topic.
    held: Vec<Held>,
    /// Stamps of the last angle, length and grid reading that were of its time.
    last: [Option<Stamp<Host>>; 3],
    /// Stamp of the last reading of its own axis.
    own: Option<Stamp<Host>>,
    /// Readings of further axes beside which none of its own was made yet.
    further: Vec<Further>,
}

/// A reading of a further axis.
#[derive(Debug)]
struct Further {
    at: Stamp<Host>,
    held: Held,
    what: String,
}

/// Where the axes were.
#[derive(Clone, Copy, Debug)]
struct Axes {
    /// The last state's stamp.
    at: Stamp<Host>,
    /// When it was recorded, ns.
    log_time_nanos: u64,
    /// Commanded there, mm and rad.
    place: PerAxis<f64>,
    /// Commanded in the first state of the run, mm and rad.
    first: PerAxis<f64>,
}

/// Messages of one topic.
#[derive(Clone, Debug)]
struct Held {
    topic: String,
    messages: u64,
    first: Place,
}

/// Messages that were taken and cannot be used after all.
#[derive(Debug)]
struct Dropped {
    held: Held,
    reason: Reason,
    what: String,
}

impl Held {
    fn one(taken: &Taken<'_>) -> Self {
        Self {
            topic: taken.topic().to_owned(),
            messages: 1,
            first: taken.place(),
        }
    }
}

impl Belonging {
    /// For a bag with readings of a grid encoder, or without.
    pub(super) fn of(has_grid: bool) -> Self {
        Self {
            has_grid,
            ..Self::default()
        }
    }

    /// Takes begin or end of a run; returns what it is for those who collect: nothing of a copy or of a begin that cannot be
    /// used, and the end of a run that contradicts its begin as one that was not completed.
    pub(super) fn segment(
        &mut self,
        segment: TestSegment,
        taken: &mut Taken<'_>,
    ) -> Option<TestSegment> {
        if segment.begin {
            return self.begin(segment, taken);
        }
        if self.open.is_none() && self.ended.as_ref() == Some(&segment) {
            return None;
        }
        if self.open.is_none() && self.refused.take_if(|run| *run == segment.run).is_some() {
            taken.release();
            return None;
        }
        self.ended = Some(segment.clone());
        match self.open.take() {
            Some(open) if open.begin.run == segment.run => Some(self.end(open, segment)),
            other => {
                self.open = other;
                self.cut();
                taken.leave_out(Reason::NoBegin, || {
                    format!(
                        "run {} ends and has not begun: it is not evaluated, and what was read in it belongs to no run",
                        segment.run
                    )
                });
                Some(segment)
            }
        }
    }

    fn begin(&mut self, segment: TestSegment, taken: &mut Taken<'_>) -> Option<TestSegment> {
        if self.open.as_ref().is_some_and(|it| it.begin == segment) {
            return None;
        }
        self.cut();
        let open = Open {
            begin: segment.clone(),
            begin_message: Held::one(taken),
            axes: None,
            held: Vec::new(),
            last: [None; 3],
            own: None,
            further: Vec::new(),
        };
        let Some(reason) = wrong_begin(&segment) else {
            self.open = Some(open);
            return Some(segment);
        };
        let run = segment.run;
        taken.leave_out(Reason::OutOfRange, || {
            format!("{reason}: run {run} is not evaluated")
        });
        if let Some(test) = open.evaluated() {
            self.not_evaluated.push(NotEvaluated { run, test, reason });
        }
        self.refused = Some(run);
        None
    }

    /// Positions at one tick.
    pub(super) fn axes(&mut self, state: &AxisState, taken: &Taken<'_>) {
        self.hold(taken);
        if let Some(open) = &mut self.open {
            open.axes = Some(Axes {
                at: state.received_at,
                log_time_nanos: taken.log_time_nanos(),
                place: state.commanded,
                first: open.axes.map_or(state.commanded, |axes| axes.first),
            });
        }
    }

    /// The run under way has ended; returns its end.
    fn end(&mut self, mut open: Open, end: TestSegment) -> TestSegment {
        let further = std::mem::take(&mut open.further);
        let test = open.evaluated();
        let run = open.begin.run;
        if !end.completed
            && let Some(test) = test
        {
            self.broken_off.push(BrokenOff { run, test });
            let further = further.into_iter().map(|further| further.held);
            let held = open.held.into_iter().chain(further);
            held.for_each(|held| self.release(held));
            return end;
        }
        for further in further {
            self.leave_out(further.held, Reason::OtherAxis, further.what);
        }
        let reason = contradiction(&open.begin, &end);
        let test = match reason {
            // Of a begin that names another kind the test is that of its end.
            Some(_) => test.or_else(|| open.evaluated_as(&end)),
            None => test,
        };
        let Some(test) = test else {
            return end;
        };
        if let Some(reason) = reason {
            self.contradicts(open, &reason);
            self.not_evaluated.push(NotEvaluated { run, test, reason });
            return TestSegment {
                completed: false,
                ..end
            };
        }
        if open.is_read() {
            let begin = open.begin.clone();
            self.measured.push(Measured { begin, test });
        }
        self.dropped.extend(open.without_places());
        end
    }

    /// Begin and end of a run contradict each other: what was taken for it cannot be used.
    fn contradicts(&mut self, open: Open, reason: &str) {
        let what = format!("{reason}: run {} is not evaluated", open.begin.run);
        let all = std::iter::once(open.begin_message).chain(open.held);
        self.dropped.extend(all.map(|held| Dropped {
            held,
            reason: Reason::Contradiction,
            what: what.clone(),
        }));
    }

    /// One reading of the length reference; whether it counts.
    pub(super) fn length(&mut self, sample: &LengthSample, taken: &mut Taken<'_>) -> bool {
        let (open, has_grid) = (self.open.as_ref(), self.has_grid);
        let judge = |open: &Open| open.judge_length(sample, (taken.log_time_nanos(), has_grid));
        let judged = open.map(judge);
        self.take(judged, (Of::Length, sample.at), taken)
    }

    /// One reading of the angular reference; whether it counts.
    pub(super) fn angle(&mut self, sample: &AngleSample, taken: &mut Taken<'_>) -> bool {
        let (of, log_time_nanos) = ((Of::Angle, sample.axis), taken.log_time_nanos());
        let open = self.open.as_ref();
        let judged = open.map(|open| open.judge(of, sample.angle_rad, sample.at, log_time_nanos));
        self.take(judged, (Of::Angle, sample.at), taken)
    }

    /// One reading of the grid encoder; whether it counts.
    pub(super) fn grid(&mut self, sample: &GridSample, taken: &mut Taken<'_>) -> bool {
        let log_time_nanos = taken.log_time_nanos();
        let open = self.open.as_ref();
        let judged = open.map(|open| open.judge_grid(sample, log_time_nanos));
        self.take(judged, (Of::Grid, sample.at), taken)
    }

    fn take(
        &mut self,
        judged: Option<Judged>,
        (of, at): (Of, Stamp<Host>),
        taken: &mut Taken<'_>,
    ) -> bool {
        match judged.unwrap_or(Judged::Counts) {
            Judged::Counts => {
                self.hold(taken);
                self.own(of, at);
                return true;
            }
            Judged::Further(what) => self.further(at, what, taken),
            Judged::LeftOut(reason, what) => taken.leave_out(reason, || what),
        }
        false
    }

    /// A reading that counts; those of further axes beside it are not needed.
    fn own(&mut self, of: Of, at: Stamp<Host>) {
        let Some(open) = &mut self.open else {
            return;
        };
        // Before the first state the time is unknown.
        if open.axes.is_some() {
            open.last[of as usize] = Some(at);
        }
        let is_length = matches!(of, Of::Length);
        if axis_of(&open.begin).is_some_and(|axis| axis.is_linear() != is_length) {
            // An angle beside a run along an axis is no reading of its lengths.
            return;
        }
        open.own = Some(at);
        let waiting = std::mem::take(&mut open.further);
        let (beside, apart): (Vec<_>, Vec<_>) = waiting
            .into_iter()
            .partition(|further| is_beside(further.at, at));
        beside.into_iter().for_each(|it| self.release(it.held));
        for it in apart {
            self.leave_out(it.held, Reason::OtherAxis, it.what);
        }
    }

    /// A reading of a further axis: one of the run's own was made beside it, or may still be.
    fn further(&mut self, at: Stamp<Host>, what: String, taken: &mut Taken<'_>) {
        let Some(open) = &mut self.open else {
            return;
        };
        if open.own.is_some_and(|own| is_beside(own, at)) {
            taken.release();
            return;
        }
        let held = Held::one(taken);
        let waiting = std::mem::take(&mut open.further);
        let (young, apart): (Vec<_>, Vec<_>) = waiting
            .into_iter()
            .partition(|further| is_beside(further.at, at));
        open.further = young;
        open.further.push(Further { at, held, what });
        for it in apart {
            self.leave_out(it.held, Reason::OtherAxis, it.what);
        }
    }

    /// Messages that were taken cannot be used after all.
    fn leave_out(&mut self, held: Held, reason: Reason, what: String) {
        let mut known = self.dropped.iter_mut();
        let known = known.find(|it| it.reason == reason && it.held.topic == held.topic);
        match known {
            Some(known) => known.held.messages += held.messages,
            None => self.dropped.push(Dropped { held, reason, what }),
        }
    }

    /// Nobody needs messages that were taken.
    fn release(&mut self, held: Held) {
        let mut known = self.released.iter_mut();
        match known.find(|it| it.topic == held.topic) {
            Some(known) => known.messages += held.messages,
            None => self.released.push(held),
        }
    }

    /// A message that is taken for the run under way.
    pub(super) fn hold(&mut self, taken: &Taken<'_>) {
        let Some(open) = &mut self.open else {
            return;
        };
        match open.held.iter_mut().find(|it| it.topic == taken.topic()) {
            Some(known) => known.messages += 1,
            None => open.held.push(Held::one(taken)),
        }
    }

    /// The run under way has no end.
    fn cut(&mut self) {
        let Some(open) = self.open.take() else {
            return;
        };
        let what = format!(
            "run {} begins and has no end: it is not evaluated",
            open.begin.run
        );
        let further = open.further.into_iter().map(|further| further.held);
        let all = std::iter::once(open.begin_message).chain(open.held);
        let all = all.chain(further);
        self.dropped.extend(all.map(|held| Dropped {
            held,
            reason: Reason::NoEnd,
            what: what.clone(),
        }));
    }

    /// Counts what was taken and cannot be used, or is not needed, after all; gives what became of the runs.
    pub(super) fn finish(mut self, account: &mut Account) -> Runs {
        self.cut();
        for held in self.released {
            let mut rows = account.topics.iter_mut();
            if let Some(row) = rows.find(|row| row.topic == held.topic) {
                row.release(held.messages);
            }
        }
        for Dropped { held, reason, what } in self.dropped {
            let row = account
                .topics
                .iter_mut()
                .find(|row| row.topic == held.topic);
            if let Some(row) = row {
                row.take_back(reason, held.messages, held.first, || what);
            }
        }
        Runs {
            broken_off: self.broken_off,
            not_evaluated: self.not_evaluated,
            measured: self.measured,
        }
    }
}

/// Whether two readings are of one measurement.
fn is_beside(a: Stamp<Host>, b: Stamp<Host>) -> bool {
    (a - b).as_secs_f64().abs() <= BESIDE_S
}

#[cfg(test)]
mod tests;
