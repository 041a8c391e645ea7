//! What the maker of a machine has measured of its loops: how much later each velocity loop sees its motion, and how far
//! each motor stays behind at a reversal (`reversals`).
//!
//! # Model
//!
//! The programme is run once on the machine as it left the works, and the following error of every motor fitted by
//!
//! ```text
//!   e = -L (v - a/K + j/K^2) - j/(w^2 K) + p v + q a + s j,   L = (1 - f) / K             (1)
//!   t = q K                                                                              (2)
//! ```
//!
//! What stands before p is what gains, feed-forward and velocity loop of the machine file leave without a filter. The
//! filter's time t, into which sampling goes as well, takes q and is written into the machine file; p and s are next to
//! nothing.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | e | motor less command | mm |
//! | v, a, j | command's velocity, acceleration, jerk, from differences of the recording | mm/s, mm/s², mm/s³ |
//! | K, f | gain and feed-forward of the machine file | 1/s, 1 |
//! | w | natural frequency of its velocity loop | rad/s |
//!
//! # Holds when
//! The recording is even and fast against the motion: only ticks one period of the full rate apart are used, and of
//! those the ones on circles, since starts and stops excite what (1) has not.
//!
//! # Agreement
//! `eq2_the_filter_of_a_made_up_loop_is_found_again`: 1e-3 relative.

use std::f64::consts::TAU;

use machine::MachineFile;
use machine::file::AxisEntry;
use metrology::sample::{AxisState, TestKind};
use metrology::stamp::Span;
use metrology::{Axis, PerAxis};
use nalgebra::{Matrix3, Vector3};

use crate::measurement::Sample;

use reversals::{Reversals, Tick};

mod reversals;

/// Ticks that differences are taken over.
const TICKS: usize = 5;

/// The motors' following errors of a session.
#[derive(Clone, Debug)]
pub(crate) struct Commissioning {
    period: Span,
    last: Vec<AxisState>,
    is_circle: bool,
    normal: PerAxis<Matrix3<f64>>,
    right: PerAxis<Vector3<f64>>,
    /// L, K and 1/w2 of each axis.
    known: PerAxis<[f64; 3]>,
    reversals: [Reversals; 3],
}

impl Commissioning {
    /// Begins; `rate_hz` is the full rate of the recording.
    pub(crate) fn new(machine: &MachineFile, rate_hz: f64) -> Self {
        Self {
            period: Span::from_secs_f64(1.0 / rate_hz),
            last: Vec::with_capacity(TICKS),
            is_circle: false,
            normal: PerAxis::default(),
            right: PerAxis::default(),
            reversals: std::array::from_fn(|_| Reversals::default()),
            known: PerAxis::from_fn(|axis| {
                machine.linear(axis).map_or([0.0, 1.0, 0.0], |entry| {
                    let gain = entry.position_gain_per_s;
                    let inner = entry.velocity_loop.as_ref();
                    let soft = inner.map_or(0.0, |inner| (TAU * inner.frequency_hz).powi(-2));
                    [(1.0 - entry.velocity_feedforward) / gain, gain, soft]
                })
            }),
        }
    }

    /// Takes a sample of the session.
    pub(crate) fn take(&mut self, sample: &Sample) {
        match sample {
            Sample::Segment(segment) => {
                self.is_circle = segment.begin && segment.kind == TestKind::Circle;
                self.last.clear();
            }
            Sample::State(state) if self.is_circle => self.tick(state),
            _ => {}
        }
    }

    fn tick(&mut self, state: &AxisState) {
        let follows = self.last.last().is_some_and(|before| {
            let apart = state.received_at - before.received_at;
            (apart.nanos() - self.period.nanos()).abs() <= 1
        });
        if !follows {
            self.last.clear();
            self.reversals.iter_mut().for_each(Reversals::interrupt);
        }
        if self.last.len() == TICKS {
            self.last.remove(0);
        }
        self.last.push(*state);
        if let [a, b, c, d, e] = &self.last[..] {
            let window = [a, b, c, d, e].map(|state| state.commanded);
            let middle = *c;
            let h = self.period.as_secs_f64();
            for axis in Axis::LINEAR {
                let r = window.map(|commanded| commanded[axis]);
                let velocity = (r[3] - r[1]) / (2.0 * h);
                let acceleration = (r[3] - 2.0 * r[2] + r[1]) / (h * h);
                let jerk = (r[4] - 2.0 * r[3] + 2.0 * r[1] - r[0]) / (2.0 * h * h * h);
                let [lag_s, gain, soft] = self.known[axis];
                let nominal = -lag_s * (velocity - acceleration / gain + jerk / (gain * gain))
                    - soft / gain * jerk;
                let error = middle.motor[axis] - middle.commanded[axis] - nominal;
                let row = Vector3::new(velocity, acceleration, jerk);
                self.normal[axis] += row * row.transpose();
                self.right[axis] += row * error;
                self.reversals[axis.index()].take(Tick {
                    velocity_mm_s: velocity,
                    acceleration_mm_s2: acceleration,
                    error_mm: error,
                });
            }
        }
    }

    /// Writes (2) and the spikes into the machine file.
    pub(crate) fn tune(&self, machine: &mut MachineFile) {
        for (axis, reversals) in Axis::LINEAR.into_iter().zip(&self.reversals) {
            machine.effects.extend(reversals.entry(axis));
            let Some(AxisEntry::Linear(entry)) = machine.axes.get_mut(&axis) else {
                continue;
            };
            if let (Some(inner), Some(filter_s)) = (&mut entry.velocity_loop, self.filter_s(axis)) {
                inner.filter_ms = filter_s * 1e3;
            }
        }
    }

    /// (2), where it is a delay.
    fn filter_s(&self, axis: Axis) -> Option<f64> {
        let scale = self.normal[axis]
            .diagonal()
            .map(|size| size.max(1e-30).sqrt());
        let even = Matrix3::from_fn(|i, k| self.normal[axis][(i, k)] / (scale[i] * scale[k]));
        let right = self.right[axis].component_div(&scale);
        let found = even.cholesky()?.solve(&right).component_div(&scale);
        let filter_s = found[1] * self.known[axis][1];
        (filter_s > 0.0).then_some(filter_s)
    }
}

#[cfg(test)]
mod tests {
    use machine::file::VelocityLoopEntry;
    use metrology::AxisSet;
    use metrology::stamp::Stamp;

    use super::*;

    #[test]
    fn eq2_the_filter_of_a_made_up_loop_is_found_again() {
        let text = include_str!("../data/machine.yaml");
        let mut machine = MachineFile::parse(text, "data/machine.yaml").unwrap();
        let (frequency_hz, filter_s) = (35.0, 2.3e-4);
        if let Some(AxisEntry::Linear(entry)) = machine.axes.get_mut(&Axis::X) {
            entry.velocity_loop = Some(VelocityLoopEntry {
                frequency_hz,
                damping: 1.1,
                filter_ms: 0.0,
            });
        }
        let entry = machine.linear(Axis::X).unwrap();
        let gain = entry.position_gain_per_s;
        let lag_s = (1.0 - entry.velocity_feedforward) / gain;
        let soft = (TAU * frequency_hz).powi(-2) / gain;
        let mut commissioning = Commissioning::new(&machine, 250.0);
        for tick in 0..3000_i64 {
            let t = tick as f64 * 0.004;
            let wave = |size: f64, w: f64| {
                let (sin, cos) = (w * t).sin_cos();
                [
                    size * sin,
                    size * w * cos,
                    -size * w * w * sin,
                    -size * w.powi(3) * cos,
                ]
            };
            let (slow, fast) = (wave(60.0, 0.9), wave(4.0, 6.0));
            let [r, v, a, j] = [0, 1, 2, 3].map(|k| slow[k] + fast[k]);
            let nominal = -lag_s * (v - a / gain + j / (gain * gain));
            let error = nominal - soft * j + filter_s / gain * a;
            let commanded = PerAxis::from_fn(|axis| if axis == Axis::X { r } else { 0.0 });
            commissioning.tick(&AxisState {
                received_at: Stamp::from_nanos(tick * 4_000_000),
                controller_at: Stamp::from_nanos(tick * 4_000_000),
                axes: AxisSet::XYZ,
                commanded,
                motor: PerAxis::from_fn(|axis| {
                    commanded[axis] + if axis == Axis::X { error } else { 0.0 }
                }),
                scale: PerAxis::default(),
                velocity: PerAxis::default(),
            });
        }
        commissioning.tune(&mut machine);
        let found = machine.linear(Axis::X).unwrap().velocity_loop.unwrap();
        let ratio = found.filter_ms / (filter_s * 1e3);
        assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
    }
}
