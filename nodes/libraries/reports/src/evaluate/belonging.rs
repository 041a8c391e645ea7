//! Which readings belong to the run under way, and what became of runs that cannot be evaluated.
//!
//! A reading counts where its stamp is of the time of the axis states beside it. That of a length or an angle also has to be
//! of its run's axis, and a length near its nominal place. Everything else, and every run without a begin or an end, is
//! counted as left out.
//!
//! A tracker may read further axes than the run's. Their readings are not needed where one of the run's own axis was made
//! within [`BESIDE_S`], unless their value is at home on the run's axis and not on the one that they name; otherwise they
//! contradict the run. Readings of a run that the machine did not complete are not needed; the report names that run.

use std::fmt;

use abbe_msgs::topics;
use metrology::number::number;
use metrology::sample::{
    AngleSample, AxisState, FARTHEST_FROM_NOMINAL, GridSample, LATE_S, LengthSample, TestKind,
    TestSegment,
};
use metrology::stamp::{Host, Stamp};
use metrology::{Axis, PerAxis};
use replayer::{Account, Place, Reason, Taken};

use super::linear::axis_of;

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

/// Judges what comes while a bag is read in the order of its log times.
#[derive(Debug, Default)]
pub(super) struct Belonging {
    open: Option<Open>,
    /// The last end of a run that was taken.
    ended: Option<TestSegment>,
    dropped: Vec<Dropped>,
    /// What was taken and nobody needed after all.
    released: Vec<Held>,
    broken_off: Vec<BrokenOff>,
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
    /// Takes begin or end of a run; returns whether it is the first copy of that message.
    pub(super) fn segment(&mut self, segment: &TestSegment, taken: &mut Taken<'_>) -> bool {
        if segment.begin {
            let is_known = self.open.as_ref().is_some_and(|it| it.begin == *segment);
            if !is_known {
                self.cut();
                self.open = Some(Open {
                    begin: segment.clone(),
                    begin_message: Held::one(taken),
                    axes: None,
                    held: Vec::new(),
                    last: [None; 3],
                    own: None,
                    further: Vec::new(),
                });
            }
            return !is_known;
        }
        if self.open.is_none() && self.ended.as_ref() == Some(segment) {
            return false;
        }
        match self.open.take() {
            Some(open) if open.begin.run == segment.run => self.end(open, segment.completed),
            other => {
                self.open = other;
                self.cut();
                taken.leave_out(Reason::NoBegin, || {
                    format!(
                        "run {} ends and has not begun: it is not evaluated, and what was read in it belongs to no run",
                        segment.run
                    )
                });
            }
        }
        self.ended = Some(segment.clone());
        true
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

    /// The run under way has ended.
    fn end(&mut self, mut open: Open, is_completed: bool) {
        let further = std::mem::take(&mut open.further);
        if !is_completed && let Some(test) = open.evaluated() {
            let run = open.begin.run;
            self.broken_off.push(BrokenOff { run, test });
            let further = further.into_iter().map(|further| further.held);
            let held = open.held.into_iter().chain(further);
            held.for_each(|held| self.release(held));
            return;
        }
        for further in further {
            self.leave_out(further.held, Reason::OtherAxis, further.what);
        }
        self.dropped.extend(open.without_places());
    }

    /// One reading of the length reference; whether it counts.
    pub(super) fn length(&mut self, sample: &LengthSample, taken: &mut Taken<'_>) -> bool {
        let open = self.open.as_ref();
        let judged = open.map(|open| open.judge_length(sample, taken.log_time_nanos()));
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
        let judged = open.map(|open| open.judge_time(Of::Grid, sample.at, log_time_nanos));
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

    /// Counts what was taken and cannot be used, or is not needed, after all; gives the runs that were not completed.
    pub(super) fn finish(mut self, account: &mut Account) -> Vec<BrokenOff> {
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
        self.broken_off
    }
}

/// Whether two readings are of one measurement.
fn is_beside(a: Stamp<Host>, b: Stamp<Host>) -> bool {
    (a - b).as_secs_f64().abs() <= BESIDE_S
}

impl Open {
    fn judge_length(&self, sample: &LengthSample, log_time_nanos: u64) -> Judged {
        let of = (Of::Length, sample.axis);
        let judged = self.judge(of, sample.displacement_mm, sample.at, log_time_nanos);
        let off_mm = self.off_nominal_mm(sample);
        let is_beyond = off_mm > FARTHEST_FROM_NOMINAL;
        if judged != Judged::Counts || !is_beyond {
            return judged;
        }
        let what = format!(
            "displacement_m: {} mm in run {} is {} mm from its nominal place: at most {FARTHEST_FROM_NOMINAL} mm; a length is in metres",
            number(sample.displacement_mm),
            self.begin.run,
            number(off_mm)
        );
        Judged::LeftOut(Reason::Beyond, what)
    }

    /// Whether a reading of an axis at an instant counts, a length or an angle. A positioning run has one axis; angles
    /// during a run along a linear axis are nobody's, and lengths during one about a rotary axis.
    fn judge(
        &self,
        (kind, of): (Of, Axis),
        value: f64,
        at: Stamp<Host>,
        log_time_nanos: u64,
    ) -> Judged {
        let judged = self.judge_time(kind, at, log_time_nanos);
        let is_positioning = self.begin.kind == TestKind::Positioning;
        let axis = axis_of(&self.begin).filter(|_| is_positioning);
        let measured = axis.filter(|axis| axis.is_linear() == matches!(kind, Of::Length));
        let Some(axis) = measured.filter(|axis| *axis != of) else {
            return judged;
        };
        let run = self.begin.run;
        let what = format!("axis: {of} in run {run}, which is along or about {axis}");
        if self.is_at_home(axis, of, value) {
            return Judged::LeftOut(Reason::OtherAxis, what);
        }
        match judged {
            Judged::Counts => Judged::Further(format!(
                "{what}, and no reading of {axis} stands within {BESIDE_S} s of it"
            )),
            other => other,
        }
    }

    /// Whether a reading is of the time of the run.
    fn judge_time(&self, kind: Of, at: Stamp<Host>, log_time_nanos: u64) -> Judged {
        let last = self.last[kind as usize];
        let Some(off_s) = self.off_s(at, last, log_time_nanos) else {
            return Judged::Counts;
        };
        let what = format!(
            "its stamp is {} s off the axis states of run {}: at most {LATE_S} s; the clocks of both must be one: synchronise them",
            number(off_s),
            self.begin.run
        );
        Judged::LeftOut(Reason::OtherTime, what)
    }

    /// Whether a value is at home on the run's axis and not on the one that it names.
    fn is_at_home(&self, axis: Axis, named: Axis, value: f64) -> bool {
        let Some(axes) = &self.axes else {
            return false;
        };
        let off = |axis: Axis| {
            let (place, way) = (axes.place[axis], axes.place[axis] - axes.first[axis]);
            (value - place).abs().min((value - way).abs())
        };
        let near = NEAR_NOMINAL[usize::from(!axis.is_linear())];
        off(axis) <= near && off(named) > near
    }

    /// Which test of the report it would have been; none: the report evaluates no such run as a whole.
    fn evaluated(&self) -> Option<String> {
        let begin = &self.begin;
        let has = |name: &str| self.held.iter().any(|held| held.topic.ends_with(name));
        let what = begin.features.join(" ");
        let plane = format!("{:?}", begin.plane).to_uppercase();
        match begin.kind {
            TestKind::Circle => Some(format!(
                "circle in {plane} of radius {} mm",
                number(begin.radius_mm)
            )),
            TestKind::Positioning => Some(format!("positioning along or about {what}")),
            TestKind::Diagonal => Some(format!("diagonal {what}")),
            TestKind::Verification => Some(format!("verification {what}")),
            TestKind::Dwell if has(topics::LENGTH_POSITION.name) => {
                Some(format!("displacement at rest, {what}"))
            }
            _ => None,
        }
    }

    /// How far a stamp is off those of the axis states, s, where that is more than a message may be late. States may come
    /// seldom: then the stamp may be ahead by as much as its message was recorded later, or follow one that was of the
    /// run's time. Before the first state a stamp is only held against the begin.
    fn off_s(
        &self,
        at: Stamp<Host>,
        last: Option<Stamp<Host>>,
        log_time_nanos: u64,
    ) -> Option<f64> {
        let Some(axes) = &self.axes else {
            let off_s = (at - self.begin.at).as_secs_f64();
            return (off_s < -LATE_S).then_some(off_s);
        };
        let off_s = (at - axes.at).as_secs_f64();
        let later_ns = i128::from(log_time_nanos) - i128::from(axes.log_time_nanos);
        let later_s = later_ns as f64 / 1e9;
        let follows = last.is_some_and(|last| (at - last).as_secs_f64().abs() <= LATE_S);
        let is_off = off_s.abs() > LATE_S && (off_s - later_s).abs() > LATE_S && !follows;
        is_off.then_some(off_s)
    }

    /// How far a reading is at least from where it should be, mm. It counts from the machine's zero, or from where the run
    /// began; along a slanting beam the whole way counts.
    fn off_nominal_mm(&self, sample: &LengthSample) -> f64 {
        let (read_mm, axis) = (sample.displacement_mm, sample.axis);
        let Some(axes) = &self.axes else {
            return read_mm.abs();
        };
        let way_mm = (axes.place.xyz() - axes.first.xyz()).norm();
        let nominals_mm = [
            (read_mm - axes.place[axis]).abs(),
            (read_mm - (axes.place[axis] - axes.first[axis])).abs(),
            (read_mm.abs() - way_mm).abs(),
            (read_mm - self.begin.radius_mm).abs(),
        ];
        nominals_mm.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Readings of a run that ended, where it needs the places of the axes and none came.
    fn without_places(self) -> Vec<Dropped> {
        let needs_places = matches!(
            self.begin.kind,
            TestKind::Positioning | TestKind::Diagonal | TestKind::Circle
        );
        if !needs_places || self.axes.is_some() {
            return Vec::new();
        }
        let readings = [
            topics::LENGTH_POSITION.name,
            topics::ANGLE_POSITION.name,
            topics::GRID_POSITION.name,
        ];
        let what = format!(
            "in run {} no {} came, so it is not known where it was read: record that topic too",
            self.begin.run,
            topics::AXES_STATE.name
        );
        let held = self.held.into_iter();
        held.filter(|it| readings.iter().any(|name| it.topic.ends_with(name)))
            .map(|held| Dropped {
                held,
                reason: Reason::NoPlace,
                what: what.clone(),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests;
