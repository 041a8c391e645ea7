//! Whether a reading is of the run under way, and what the run holds.

use abbe_msgs::topics;
use metrology::Axis;
use metrology::number::number;
use metrology::sample::{
    FARTHEST_FROM_NOMINAL, GridSample, LATE_S, LengthSample, TestKind, TestPlane, TestSegment,
};
use metrology::stamp::{Host, Stamp};
use replayer::Reason;

use super::super::linear::axis_of;
use super::super::paths::is_path;
use super::{BESIDE_S, Dropped, Judged, NEAR_NOMINAL, Of, Open};

/// Topics of instruments.
const READINGS: [&str; 3] = [
    topics::LENGTH_POSITION.name,
    topics::ANGLE_POSITION.name,
    topics::GRID_POSITION.name,
];

impl Open {
    pub(super) fn judge_length(
        &self,
        sample: &LengthSample,
        (log, has_grid): (u64, bool),
    ) -> Judged {
        let of = (Of::Length, sample.axis);
        let judged = self.judge(of, sample.displacement_mm, sample.at, log);
        let is_of_run = match self.begin.kind {
            TestKind::Positioning | TestKind::Diagonal => true,
            TestKind::Circle => !has_grid,
            _ => false,
        };
        if judged == Judged::Counts && is_of_run && self.is_after_begin(sample.at) {
            let zero_id = (self.begin.zero_id > 0).then_some(sample.zero_id);
            if let Some(wrong) = zero_id.and_then(|zero_id| self.judge_zero(zero_id)) {
                return wrong;
            }
        }
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
    pub(super) fn judge(
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

    /// Whether a reading of the grid encoder is of the time, the plane and the zero of the run.
    pub(super) fn judge_grid(&self, sample: &GridSample, log_time_nanos: u64) -> Judged {
        let judged = self.judge_time(Of::Grid, sample.at, log_time_nanos);
        let begin = &self.begin;
        let is_of_run = begin.kind == TestKind::Circle || is_path(begin.kind);
        let is_judged = is_of_run && begin.plane != TestPlane::None;
        if judged != Judged::Counts || !is_judged || !self.is_after_begin(sample.at) {
            return judged;
        }
        if sample.plane != begin.plane {
            let [read, own] =
                [sample.plane, begin.plane].map(|plane| format!("{plane:?}").to_uppercase());
            return Judged::LeftOut(
                Reason::OtherPlane,
                format!("plane: {read} in run {}, which is in {own}", begin.run),
            );
        }
        self.judge_zero(sample.zero_id).unwrap_or(judged)
    }

    /// A reading from before the begin may come behind it: of another zero, and of no run.
    pub(super) fn is_after_begin(&self, at: Stamp<Host>) -> bool {
        at >= self.begin.at
    }

    /// Why a zero is not that of the run.
    pub(super) fn judge_zero(&self, zero_id: u32) -> Option<Judged> {
        let TestSegment {
            run, zero_id: own, ..
        } = &self.begin;
        let what = || format!("zero_id: {zero_id} in run {run}, whose zero is {own}");
        (zero_id != *own).then(|| Judged::LeftOut(Reason::OtherZero, what()))
    }

    /// Whether an instrument was read during the run.
    pub(super) fn is_read(&self) -> bool {
        let mut held = self.held.iter();
        held.any(|it| READINGS.iter().any(|name| it.topic.ends_with(name)))
    }

    /// Whether a reading is of the time of the run.
    pub(super) fn judge_time(&self, kind: Of, at: Stamp<Host>, log_time_nanos: u64) -> Judged {
        let last = self.last[kind as usize];
        let Some(off_s) = self.off_s(at, last, log_time_nanos) else {
            return Judged::Counts;
        };
        let what = format!(
            "its stamp is {} s off that of the axis states beside which it was recorded, in run {}: at most {LATE_S} s; synchronise the clocks, or record both without delay",
            number(off_s),
            self.begin.run
        );
        Judged::LeftOut(Reason::OtherTime, what)
    }

    /// Whether a value is at home on the run's axis and not on the one that it names.
    pub(super) fn is_at_home(&self, axis: Axis, named: Axis, value: f64) -> bool {
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
    pub(super) fn evaluated(&self) -> Option<String> {
        self.evaluated_as(&self.begin)
    }

    /// The same, where another message says what it was.
    pub(super) fn evaluated_as(&self, begin: &TestSegment) -> Option<String> {
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
            kind if is_path(kind) && begin.stations == 0 => Some(format!("path in {plane}")),
            _ => None,
        }
    }

    /// How far a stamp is off those of the axis states, s, where that is more than a message may be late. States may come
    /// seldom: then the stamp may be ahead by as much as its message was recorded later, or follow one that was of the
    /// run's time. Before the first state a stamp is only held against the begin.
    pub(super) fn off_s(
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
    pub(super) fn off_nominal_mm(&self, sample: &LengthSample) -> f64 {
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
    pub(super) fn without_places(self) -> Vec<Dropped> {
        let needs_places = matches!(
            self.begin.kind,
            TestKind::Positioning | TestKind::Diagonal | TestKind::Circle
        );
        if !needs_places || self.axes.is_some() {
            return Vec::new();
        }
        let what = format!(
            "in run {} no {} came, so it is not known where it was read: record that topic too",
            self.begin.run,
            topics::AXES_STATE.name
        );
        let held = self.held.into_iter();
        held.filter(|it| READINGS.iter().any(|name| it.topic.ends_with(name)))
            .map(|held| Dropped {
                held,
                reason: Reason::NoPlace,
                what: what.clone(),
            })
            .collect()
    }
}
