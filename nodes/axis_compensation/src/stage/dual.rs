//! The stage's part in the dual loop: who hears of states, tests and tables.

use metrology::sample::{AxisState, CompensationState, TestKind, TestSegment};
use metrology::{Axis, Host, Stamp};

use super::{AxisCompensationStage, Elapsed, Output, Shutdown};
use crate::diagnostic::Diagnostic;
use crate::positioning::deviation_table::LEAST_POINTS;
use crate::positioning::dual_loop::{AxisReading, DualLoop};
use crate::positioning::refusal::PositioningRefusal;

impl AxisCompensationStage {
    /// Each axis' dual loop sees the state before offsets are computed from it.
    pub(super) fn read_axes(
        &mut self,
        at: Stamp<Host>,
        state: &AxisState,
        elapsed: Elapsed,
        out: &mut Vec<Output>,
    ) {
        let is_on = self.enabled && self.shutdown == Shutdown::No;
        let dt_s = match elapsed {
            Elapsed::Nothing => Some(0.0),
            Elapsed::Step(dt_s) => Some(dt_s),
            Elapsed::Gap => None,
        };
        for axis in Axis::LINEAR {
            let Some(dual_loop) = &mut self.positioning[axis] else {
                continue;
            };
            let known = |position_mm: f64| {
                if state.axes.contains(axis) {
                    position_mm
                } else {
                    f64::NAN
                }
            };
            let follows = self.states[axis]
                .is_some_and(|compensated| compensated.state() == CompensationState::Active);
            // Both of the last state.
            let asked_mm = dual_loop.offset_mm().ok().flatten().unwrap_or_default();
            let sent_mm = self.states[axis].map_or(0.0, |compensated| compensated.offset());
            let reading = AxisReading {
                at,
                dt_s,
                commanded_mm: known(state.commanded[axis]),
                motor_mm: known(state.motor[axis]),
                scale_mm: known(state.scale[axis]),
                others_mm: sent_mm - asked_mm,
                is_on,
                follows,
            };
            dual_loop.observe(&reading, &mut |said| out.push(Output::Diagnostic(said)));
        }
    }

    /// A test begins or ends; only a positioning test concerns the dual loop.
    pub(super) fn segment(
        &mut self,
        at: Stamp<Host>,
        segment: &TestSegment,
        out: &mut Vec<Output>,
    ) {
        if segment.kind != TestKind::Positioning {
            return;
        }
        if segment.begin {
            for dual_loop in self.positioning.0.iter_mut().flatten() {
                dual_loop.begin_test(segment);
            }
            return;
        }
        let points = |axis: &Axis| {
            let dual_loop = self.positioning[*axis].as_ref();
            dual_loop.map_or(0, DualLoop::points_in_test)
        };
        // The first of those with most points; an axis that stands has one at most.
        let tested = Axis::LINEAR.into_iter().rev().max_by_key(points);
        let tested = tested.filter(|axis| points(axis) > 0);
        let other = Axis::LINEAR
            .into_iter()
            .find(|axis| Some(*axis) != tested && points(axis) >= LEAST_POINTS);
        if let (Some(axis), Some(other)) = (tested, other) {
            let cause = PositioningRefusal::NotOneAxis { axis, other };
            out.push(Output::Diagnostic(Diagnostic::RunRefused { cause }));
        }
        for axis in Axis::LINEAR {
            let Some(dual_loop) = &mut self.positioning[axis] else {
                continue;
            };
            if Some(axis) == tested && other.is_none() {
                dual_loop.end_test(at, segment, &mut |said| out.push(Output::Diagnostic(said)));
            } else {
                dual_loop.leave_test();
            }
        }
    }

    /// Tables that changed; by the host's tick, since a message of a table allocates.
    pub(super) fn publish_tables(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let tables = self.positioning.0.iter_mut().flatten();
        out.extend(
            tables
                .filter_map(|dual_loop| dual_loop.publication(at))
                .map(|table| Output::Table(Box::new(table))),
        );
    }
}
