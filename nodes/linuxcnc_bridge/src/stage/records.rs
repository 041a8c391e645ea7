//! From records of the servo thread to positions, touches and what a running program does.

use metrology::sample::{AxisState, ProbeTrigger};
use metrology::stamp::{Host, Machine, Span, Stamp};

use super::{BridgeStage, Output, Sampling};
use crate::clock::Succession;
use crate::condition::Condition;
use crate::samples::{Record, SampleEvent};

/// From where on a slow servo thread is reported.
const SLIP_LIMIT: f64 = 0.01;
/// Least time between two [`Output::Joints`].
const JOINT_PERIOD: Span = Span::from_nanos(20_000_000);

impl BridgeStage {
    /// What comes next does not follow the last record.
    pub(super) fn gap(&mut self) {
        self.touches.gap();
        if let Some(run) = &mut self.run {
            run.gap();
        }
    }

    pub(super) fn sampled(&mut self, at: Stamp<Host>, bytes: &[u8], out: &mut Vec<Output>) {
        if matches!(self.sampling, Sampling::Off { .. }) {
            return;
        }
        let mut reader = std::mem::take(&mut self.reader);
        reader.receive(bytes, |event| match event {
            SampleEvent::Record(record) => self.record(at, &record, out),
            // The gap in the numbers that follows says how many were lost.
            SampleEvent::Overrun => self.gap(),
            SampleEvent::Malformed { columns, expected } => {
                self.gap();
                self.conditions
                    .push(Condition::MalformedSample { columns, expected });
            }
        });
        self.reader = reader;
    }

    fn record(&mut self, at: Stamp<Host>, record: &Record, out: &mut Vec<Output>) {
        if !matches!(self.sampling, Sampling::Flowing { .. }) {
            self.conditions.push(Condition::Sampling);
        }
        self.sampling = Sampling::Flowing { last: at };
        let (controller_at, succession) = self.clock.stamp(record.number, at);
        match succession {
            Succession::Next => {}
            Succession::Lost(lost) => {
                self.gap();
                self.conditions.push(Condition::SamplerOverrun { lost });
            }
            Succession::First | Succession::Restarted => self.gap(),
        }
        self.watch_slip();
        let state = AxisState {
            received_at: at,
            controller_at,
            axes: self.settings.axes,
            commanded: record.commanded,
            motor: record.motor,
            scale: record.scale,
            velocity: self.touches.velocity(record),
        };
        out.push(Output::State(state));
        if self
            .joints_at
            .is_none_or(|last| controller_at - last >= JOINT_PERIOD)
        {
            self.joints_at = Some(controller_at);
            out.push(Output::Joints(state));
        }
        self.motion_type = record.motion_type;
        if let Some(run) = &mut self.run {
            run.sampled(at, record, &mut self.session.client);
            self.conditions.extend(run.take_conditions());
        }
        self.touch(at, controller_at, record, out);
    }

    fn watch_slip(&mut self) {
        let Some(slip) = self.clock.take_slip() else {
            return;
        };
        let slow = slip > SLIP_LIMIT;
        if slow {
            self.conditions.push(Condition::ServoSlip {
                slip,
                limit: SLIP_LIMIT,
            });
        } else if self.slow {
            self.conditions.push(Condition::ServoInTime);
        }
        self.slow = slow;
    }

    fn touch(
        &mut self,
        received_at: Stamp<Host>,
        controller_at: Stamp<Machine>,
        record: &Record,
        out: &mut Vec<Output>,
    ) {
        match self.touches.step(record) {
            None => {}
            Some(Err(reason)) => {
                let line = record.line;
                self.conditions
                    .push(Condition::TouchUnusable { line, reason });
            }
            Some(Ok(touch)) => {
                let feature = self
                    .run
                    .as_ref()
                    .map_or("", |run| run.program.feature_at(touch.line));
                out.push(Output::Trigger(ProbeTrigger {
                    received_at,
                    controller_at,
                    feature_id: feature.to_owned(),
                    approach: touch.approach,
                    feed_mm_s: touch.feed_mm_s,
                    axes: self.settings.axes,
                    latched: touch.latched,
                    sequence: self.sequence,
                }));
                self.sequence = self.sequence.wrapping_add(1);
            }
        }
    }
}
