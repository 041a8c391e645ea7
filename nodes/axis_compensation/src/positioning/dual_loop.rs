//! One axis of the dual loop: learns, compensates, keeps its table up to date.
//!
//! A state goes through four steps: the direction of motion follows the command; a test under way learns
//! from a dwell; a pass of a point refreshes the table, or a quiet cycle takes what is measured; the table
//! says the offset. None allocates.

use machine::MachineFile;
use metrology::sample::{PositioningTable, TestSegment};
use metrology::{Axis, Host, Stamp};

use super::config::PositioningConfig;
use super::deviation_table::{DeviationTable, Published};
use super::direction::DirectionOfMotion;
use super::dwell::Dwells;
use super::learning::{Learning, Lesson, Progress};
use super::offset::{OffsetSum, Reading};
use super::refresh::{Refresh, ScaleReading};
use super::refusal::PositioningRefusal;
use crate::diagnostic::Diagnostic;
use crate::error::AxisCompensationError;
use crate::femtometre::{fm_from_mm, mm_from_fm};
use crate::parts::PartRefusal;

/// One state of the axis, as the dual loop sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisReading {
    /// When the host heard of it.
    pub at: Stamp<Host>,
    /// Time since the state before, s; `None`: it does not follow that one.
    pub dt_s: Option<f64>,
    /// Command of the program, mm.
    pub commanded_mm: f64,
    /// Motor encoder times lead, mm.
    pub motor_mm: f64,
    /// Scale, mm; NaN where it says nothing.
    pub scale_mm: f64,
    /// What the axis is asked for beside the positioning part (thermal, geometric), mm.
    pub others_mm: f64,
    /// Whether compensation acts at all.
    pub is_on: bool,
    /// Whether the axis does all that it was asked for.
    pub follows: bool,
}

/// A table in use and what is said of it.
#[derive(Clone, Debug, PartialEq)]
struct Known {
    table: DeviationTable,
    runs: u32,
    changed_at: Option<Stamp<Host>>,
}

/// The dual loop of one axis.
#[derive(Clone, Debug)]
pub struct DualLoop {
    axis: Axis,
    weight: f64,
    adds_thermal: bool,
    believed_fm: i64,
    feed_limit_mm_s: f64,
    needed_runs: u32,
    lead_fm: i64,
    pulse_mm: f64,
    known: Option<Known>,
    motion: DirectionOfMotion,
    learning: Learning,
    refresh: Refresh,
    sum: OffsetSum,
    offset: Result<Option<f64>, PositioningRefusal>,
    commanded_fm: Option<i64>,
    scale_misses: bool,
    doubts: bool,
    is_changed: bool,
    sequence: u32,
}

impl DualLoop {
    /// An axis of `machine` whose control has pulses of `pulse_fm`.
    ///
    /// # Errors
    /// When a parameter, the loop or the start table is refused.
    pub fn new(
        axis: Axis,
        config: &PositioningConfig,
        machine: &MachineFile,
        pulse_fm: i64,
    ) -> Result<Self, AxisCompensationError> {
        config.check(axis, machine)?;
        let linear = machine
            .linear(axis)
            .ok_or(AxisCompensationError::NotALinearAxis { axis })?;
        let believed_fm =
            fm_from_mm(config.measured_limit_um * 1e-3).expect("5000 µm at most were just checked");
        let feed_limit_mm_s = config.measuring_feed_limit_mm_min / 60.0;
        let known = config.start_table(axis)?.map(|table| Known {
            table,
            runs: 0,
            changed_at: None,
        });
        let lesson = Lesson {
            axis,
            directions: config.directions,
            runs: config.runs,
            most_points: PositioningConfig::most_points(linear.travel_mm),
        };
        let refresh_weight = match config.reading {
            Reading::RefreshedTable => config.weight,
            Reading::WeightedIncrements => 0.0,
        };
        let mut refresh = Refresh::new(
            refresh_weight,
            config.directions,
            feed_limit_mm_s,
            believed_fm,
            pulse_fm,
        )
        .with_unpassed(config.unpassed())
        .with_steadiness(config.steady_s);
        if let Some(known) = &known {
            refresh.begin(&known.table);
        }
        Ok(Self {
            axis,
            weight: config.weight,
            adds_thermal: config.thermal_part,
            believed_fm,
            feed_limit_mm_s,
            needed_runs: config.runs,
            lead_fm: fm_from_mm(linear.lead_mm).unwrap_or_default(),
            pulse_mm: mm_from_fm(pulse_fm),
            is_changed: known.is_some(),
            known,
            motion: DirectionOfMotion::new(pulse_fm),
            learning: Learning::new(
                lesson,
                Dwells::new(pulse_fm, config.settle_s, config.dwell_s),
            ),
            refresh,
            sum: OffsetSum::new(config.reading, config.weight, config.loop_cycle_s),
            offset: Ok(None),
            commanded_fm: None,
            scale_misses: false,
            doubts: false,
            sequence: 0,
        })
    }

    /// Whether the thermal part is added too.
    #[must_use]
    pub fn adds_thermal(&self) -> bool {
        self.adds_thermal
    }

    /// The offset at the last state, mm; none while there is no table.
    ///
    /// # Errors
    /// When the last state did not tell what is needed.
    pub fn offset_mm(&self) -> Result<Option<f64>, PartRefusal> {
        self.offset
            .map_err(|source| PartRefusal::Positioning { source })
    }

    /// The table in use.
    #[must_use]
    pub fn table(&self) -> Option<&DeviationTable> {
        self.known.as_ref().map(|known| &known.table)
    }

    /// One state of the axis.
    pub fn observe(&mut self, reading: &AxisReading, say: &mut impl FnMut(Diagnostic)) {
        let before_fm = self.commanded_fm.take();
        let Some(commanded_fm) = fm_from_mm(reading.commanded_mm) else {
            self.forget();
            self.offset = Err(PositioningRefusal::PositionNotFinite {
                axis: self.axis,
                position_mm: reading.commanded_mm,
            });
            return;
        };
        self.commanded_fm = Some(commanded_fm);
        if reading.dt_s.is_none() {
            self.forget();
        }
        let dt_s = reading.dt_s.unwrap_or_default();
        let direction = self.motion.advance(commanded_fm);
        let deviation_mm = reading.scale_mm - reading.motor_mm;
        self.learning
            .observe(commanded_fm, direction, deviation_mm, dt_s);
        if let Some(deviation_fm) = fm_from_mm(deviation_mm) {
            let passed = ScaleReading {
                commanded_fm,
                deviation_fm,
            };
            self.pass(reading.at, passed, dt_s, say);
        } else {
            self.refresh.forget();
        }
        self.notice_scale(reading, say);
        if let (Some(known), true) = (&self.known, self.sum.measures()) {
            let table_fm = known.table.deviation_fm(commanded_fm, direction);
            let step_fm = commanded_fm - before_fm.unwrap_or(commanded_fm);
            self.measure(reading, table_fm, mm_from_fm(step_fm).abs(), dt_s, say);
        }
        self.offset = self.offset_at(commanded_fm, reading);
    }

    fn offset_at(
        &self,
        commanded_fm: i64,
        reading: &AxisReading,
    ) -> Result<Option<f64>, PositioningRefusal> {
        let Some(known) = &self.known else {
            return Ok(None);
        };
        if self.sum.measures() && !reading.scale_mm.is_finite() {
            return Err(PositioningRefusal::ScaleMissing {
                axis: self.axis,
                position_mm: reading.commanded_mm,
            });
        }
        let direction = self.motion.direction();
        let table_fm = known.table.deviation_fm(commanded_fm, direction);
        Ok(Some(mm_from_fm(self.sum.offset_fm(table_fm))))
    }

    /// The next state does not follow the last one.
    fn forget(&mut self) {
        self.refresh.forget();
        self.learning.forget();
    }

    /// Refreshes the points that the command passed.
    fn pass(
        &mut self,
        at: Stamp<Host>,
        reading: ScaleReading,
        dt_s: f64,
        say: &mut impl FnMut(Diagnostic),
    ) {
        // What is being learned anew must not creep into the old table as well.
        if self.learning.is_under_way() {
            self.refresh.forget();
            return;
        }
        let Some(known) = &mut self.known else {
            return;
        };
        let refreshed = self.refresh.observe(&mut known.table, reading, dt_s);
        if refreshed.n_points > 0 {
            known.changed_at = Some(at);
            self.is_changed = true;
            self.sequence = self.sequence.saturating_add(refreshed.n_points);
            self.believe(None, say);
        }
        if let Some(doubted) = refreshed.doubted {
            self.believe(Some((doubted.position_fm, doubted.change_fm)), say);
        }
    }

    /// Takes what is measured at once, where a quiet cycle is over.
    fn measure(
        &mut self,
        reading: &AxisReading,
        table_fm: i64,
        step_mm: f64,
        dt_s: f64,
        say: &mut impl FnMut(Diagnostic),
    ) {
        if !reading.is_on {
            self.sum.let_go();
            return;
        }
        self.sum.begin(table_fm);
        let is_slow = step_mm <= self.feed_limit_mm_s * dt_s + self.pulse_mm;
        let is_due = self.sum.wait(dt_s, reading.follows && is_slow);
        // Where the other parts want the slide is where it belongs: the loop must not take them out.
        let wanted_mm = reading.commanded_mm + reading.others_mm;
        let Some(error_fm) = fm_from_mm(wanted_mm - reading.scale_mm) else {
            return;
        };
        if !is_due {
            return;
        }
        if error_fm.abs() > self.believed_fm {
            let position_fm = self.commanded_fm.unwrap_or_default();
            self.believe(Some((position_fm, error_fm)), say);
            return;
        }
        self.sum.measure(table_fm, error_fm);
        self.believe(None, say);
    }

    /// Says once that a measurement is not believed, and that one is again.
    fn believe(&mut self, doubted: Option<(i64, i64)>, say: &mut impl FnMut(Diagnostic)) {
        let axis = self.axis;
        match doubted {
            Some((position_fm, change_fm)) if !self.doubts => {
                say(Diagnostic::MeasurementDoubted {
                    axis,
                    position_mm: mm_from_fm(position_fm),
                    change_mm: mm_from_fm(change_fm),
                    limit_mm: mm_from_fm(self.believed_fm),
                });
            }
            None if self.doubts => say(Diagnostic::MeasurementBelieved { axis }),
            _ => {}
        }
        self.doubts = doubted.is_some();
    }

    fn notice_scale(&mut self, reading: &AxisReading, say: &mut impl FnMut(Diagnostic)) {
        // A table from the parameter file that is never refreshed asks nothing of the scale.
        let is_needed = self.sum.measures() || self.weight > 0.0;
        let misses = is_needed && !reading.scale_mm.is_finite();
        if misses != self.scale_misses {
            let axis = self.axis;
            say(if misses {
                Diagnostic::ScaleMissing { axis }
            } else {
                Diagnostic::ScaleBack { axis }
            });
        }
        self.scale_misses = misses;
    }

    /// A positioning test begins.
    pub fn begin_test(&mut self, segment: &TestSegment) {
        self.learning.begin(segment);
    }

    /// Points at which the axis dwelled in the test under way.
    #[must_use]
    pub fn points_in_test(&self) -> usize {
        if self.learning.is_under_way() {
            self.learning.n_points()
        } else {
            0
        }
    }

    /// The test under way was another axis'.
    pub fn leave_test(&mut self) {
        self.learning.leave();
    }

    /// The test ends; a new table is in use at once.
    pub fn end_test(
        &mut self,
        at: Stamp<Host>,
        segment: &TestSegment,
        say: &mut impl FnMut(Diagnostic),
    ) {
        let axis = self.axis;
        match self.learning.end(segment) {
            Err(cause) => say(Diagnostic::RunRefused { cause }),
            Ok(Progress::Collected { runs }) => say(Diagnostic::RunsCollected {
                axis,
                runs,
                needed: self.needed_runs,
            }),
            Ok(Progress::Learned { table, runs }) => {
                let points = table.n_points();
                say(Diagnostic::TableLearned { axis, points, runs });
                let lead_mm = mm_from_fm(self.lead_fm);
                say(if table.hides(self.lead_fm) {
                    Diagnostic::LeadHidden { axis, lead_mm }
                } else {
                    Diagnostic::LeadSeen { axis, lead_mm }
                });
                self.refresh.begin(&table);
                self.known = Some(Known {
                    table,
                    runs,
                    changed_at: Some(at),
                });
                // What was measured beside the old table says nothing beside the new one.
                self.sum.let_go();
                self.is_changed = true;
                self.sequence = self.sequence.saturating_add(1);
            }
        }
    }

    /// The table, if it changed since it was last asked for.
    pub fn publication(&mut self, at: Stamp<Host>) -> Option<PositioningTable> {
        let known = self.known.as_ref().filter(|_| self.is_changed)?;
        self.is_changed = false;
        let about = Published {
            at: known.changed_at.unwrap_or(at),
            n_runs: known.runs,
            weight: self.weight,
            sequence: self.sequence,
        };
        Some(known.table.published(self.axis, about))
    }
}
