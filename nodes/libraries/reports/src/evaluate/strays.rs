//! Axis states that the machine of a recording cannot be in: of other axes, outside the travel, or a leap away from the state
//! before. One such state would split a stop in two.
//!
//! A state that stands alone so is left out. A second one like it is where the machine is: an axis that was referenced anew.

use gap_diagnosis::session::{SessionError, outside_travel};
use machine::MachineFile;
use metrology::number::number;
use metrology::sample::AxisState;
use metrology::{Axis, AxisSet};
use replayer::Reason;

/// No linear axis is faster, mm/s.
const FASTEST_MM_S: f64 = 5_000.0;
/// Least step that counts as a leap, mm: many states may be received at one instant.
const LEAST_LEAP_MM: f64 = 10.0;

/// Judges the axis states of a bag in their order.
#[derive(Debug, Default)]
pub(super) struct Strays {
    last: Option<AxisState>,
    /// The state before, where it was left out as a stray.
    stray: Option<AxisState>,
}

impl Strays {
    /// Another run begins: what came between was not looked at.
    pub(super) fn begin(&mut self) {
        *self = Self::default();
    }

    /// Why a state cannot be used; `None`: it can.
    pub(super) fn why_not(
        &mut self,
        machine: Option<&MachineFile>,
        state: &AxisState,
    ) -> Option<(Reason, String)> {
        if let Some(machine) = machine {
            let other = lacks_axes(machine, state).or_else(|| outside_travel(machine, state));
            if let Some(other) = other {
                return Some((Reason::OtherMachine, other.to_string()));
            }
        }
        let why = self.last.as_ref().and_then(|last| differs(last, state));
        let is_repeated = { self.stray.as_ref() }.is_some_and(|it| differs(it, state).is_none());
        if why.is_some() && !is_repeated {
            self.stray = Some(*state);
            return why;
        }
        self.stray = None;
        self.last = Some(*state);
        None
    }
}

/// Why a state is of a machine that lacks an axis of the machine file.
fn lacks_axes(machine: &MachineFile, state: &AxisState) -> Option<SessionError> {
    let wanted = machine.axis_set();
    let lacks = wanted.iter().any(|axis| !state.axes.contains(axis));
    lacks.then(|| SessionError::OtherAxes {
        found: letters(state.axes),
        wanted: letters(wanted),
    })
}

/// Why one machine cannot be in a state after another one.
fn differs(last: &AxisState, state: &AxisState) -> Option<(Reason, String)> {
    if state.axes != last.axes {
        let [own, before] = [state.axes, last.axes].map(letters);
        let what = format!("axes: {own}, and {before} in the state before");
        return Some((Reason::OtherMachine, what));
    }
    let passed_s = { state.received_at - last.received_at }
        .as_secs_f64()
        .max((state.controller_at - last.controller_at).as_secs_f64());
    let leap = Axis::LINEAR.into_iter().find(|axis| {
        let way_mm = (state.commanded[*axis] - last.commanded[*axis]).abs();
        passed_s > 0.0 && way_mm > LEAST_LEAP_MM && way_mm > FASTEST_MM_S * passed_s
    })?;
    let [from, to] = [last, state].map(|it| number(it.commanded[leap]));
    let what = format!(
        "axis {leap} was commanded from {from} to {to} mm within {} s: at most {} m/s",
        number(passed_s),
        FASTEST_MM_S * 1e-3
    );
    Some((Reason::Outlier, what))
}

fn letters(axes: AxisSet) -> String {
    axes.iter().map(Axis::letter).collect()
}

#[cfg(test)]
mod tests {
    use metrology::PerAxis;
    use metrology::stamp::Stamp;

    use super::*;

    fn state(ms: i64, axes: AxisSet, x_mm: f64) -> AxisState {
        let mut commanded = PerAxis::default();
        commanded[Axis::X] = x_mm;
        let nanos = ms * 1_000_000;
        AxisState::standing(
            Stamp::from_nanos(nanos),
            Stamp::from_nanos(nanos),
            axes,
            commanded,
        )
    }

    fn left_out(states: &[AxisState]) -> Vec<usize> {
        let mut strays = Strays::default();
        let places = states.iter().enumerate();
        let wrong = places.filter(|(_, state)| strays.why_not(None, state).is_some());
        wrong.map(|(place, _)| place).collect()
    }

    #[test]
    fn one_state_of_another_machine_or_place_is_left_out_and_a_second_one_is_the_machines() {
        let yza: AxisSet = [Axis::Y, Axis::Z, Axis::A].into_iter().collect();
        let at = |ms, x_mm| state(ms, AxisSet::XYZ, x_mm);
        let other = |ms| state(ms, yza, 0.0);
        for (states, wanted) in [
            (vec![at(0, 282.0), at(10, 0.0), at(20, 282.0)], vec![1]),
            (vec![at(0, 282.0), other(10), at(20, 282.0)], vec![1]),
            (
                vec![at(0, 282.0), at(10, 0.0), at(20, 0.0), at(30, 0.0)],
                vec![1],
            ),
            // Fast, far apart in time, and many received at one instant.
            (vec![at(0, 0.0), at(10, 40.0), at(20, 80.0)], vec![]),
            (vec![at(0, 0.0), at(1000, 282.0)], vec![]),
            (vec![at(0, 0.0), at(0, 282.0)], vec![]),
        ] {
            assert_eq!(left_out(&states), wanted, "{states:?}");
        }
    }

    #[test]
    fn a_state_that_lacks_an_axis_of_the_machine_file_is_of_another_machine() {
        let text = include_str!("../../../../../launch_configs/gap_first/machine.yaml");
        let machine = MachineFile::parse(text, "m").unwrap();
        let yza: AxisSet = [Axis::Y, Axis::Z, Axis::A].into_iter().collect();
        let mut strays = Strays::default();
        for (axes, is_wrong) in [(yza, true), (AxisSet::XYZ, false), (yza, true)] {
            let found = strays.why_not(Some(&machine), &state(10, axes, 0.0));
            let found = found.map(|(reason, _)| reason);
            assert_eq!(found, is_wrong.then_some(Reason::OtherMachine));
        }
    }
}
