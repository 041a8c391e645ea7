//! Sums the responses of a list of effects and reads them off as each instrument would.

use metrology::sample::{TestKind, TestPlane};
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;

use super::error::TwinError;
use super::response::Response;
use super::series::Series;
use super::session::{Channel, Reading, Run, Session};
use crate::effects::{Effect, Scene};
use machine::file::MachineFile;
use machine::kinematics::Kinematics;

/// The simulator of one machine.
#[derive(Clone, Debug)]
pub struct Twin<'a> {
    machine: &'a MachineFile,
    kinematics: Kinematics,
    axes: AxisSet,
}

impl<'a> Twin<'a> {
    /// A simulator of a machine file.
    ///
    /// # Errors
    /// When its chain is none.
    pub fn new(machine: &'a MachineFile) -> Result<Self, TwinError> {
        let kinematics = Kinematics::new(machine)?;
        Ok(Self {
            machine,
            kinematics,
            axes: machine.axis_set(),
        })
    }

    /// The machine that is simulated.
    #[must_use]
    pub fn machine(&self) -> &'a MachineFile {
        self.machine
    }

    /// Where its bodies are at which positions.
    #[must_use]
    pub const fn kinematics(&self) -> &Kinematics {
        &self.kinematics
    }

    /// Response of one run to some effects together.
    #[must_use]
    pub fn respond(&self, session: &Session, run: &Run, effects: &[&dyn Effect]) -> Response {
        let mut response = Response::zero(run, self.axes);
        let scene = Scene {
            machine: self.machine,
            kinematics: &self.kinematics,
            history: &session.history,
            run,
        };
        for effect in effects {
            effect.add_to(&scene, &mut response);
        }
        response
    }

    /// Deviation that each of the run's readings should show, in their order, mm (K, rad).
    #[must_use]
    pub fn predict(&self, session: &Session, run: &Run, effects: &[&dyn Effect]) -> Vec<f64> {
        let response = self.respond(session, run, effects);
        let reader = Reader::new(run, &response, self.axes);
        run.readings
            .iter()
            .enumerate()
            .map(|(row, reading)| reader.deviation(row, reading))
            .collect()
    }

    /// Reads a response of a run as its instruments would.
    #[must_use]
    pub fn reader<'r>(&self, run: &'r Run, response: &'r Response) -> Reader<'r> {
        Reader::new(run, response, self.axes)
    }

    /// Variance that each of the run's readings should show because of effects of random phase, mm2.
    #[must_use]
    pub fn variance(&self, session: &Session, run: &Run, effects: &[&dyn Effect]) -> Vec<f64> {
        let response = self.respond(session, run, effects);
        let reader = Reader::new(run, &response, self.axes);
        run.readings
            .iter()
            .enumerate()
            .map(|(row, reading)| {
                reader.variance(reading)
                    + response.reading_variance.get(row).copied().unwrap_or(0.0)
            })
            .collect()
    }
}

/// Checks that every reading of a session refers to something that was recorded.
///
/// # Errors
/// Names the run, the channel, the tick and how many there are.
pub fn check(session: &Session) -> Result<(), TwinError> {
    for run in &session.runs {
        for reading in &run.readings {
            let ticks = match reading.channel {
                Channel::Touch => run.touches.len(),
                _ => run.motion.len(),
            };
            if reading.at >= ticks {
                return Err(TwinError::Reading {
                    run: run.segment.run,
                    channel: reading.channel.to_string(),
                    tick: reading.at,
                    ticks,
                });
            }
        }
    }
    Ok(())
}

/// Directions of the plate's coordinates, machine frame.
#[must_use]
pub fn plate_axes(plane: TestPlane) -> Option<[Axis; 2]> {
    match plane {
        TestPlane::Xy => Some([Axis::X, Axis::Y]),
        TestPlane::Yz => Some([Axis::Y, Axis::Z]),
        TestPlane::Zx => Some([Axis::Z, Axis::X]),
        TestPlane::None => None,
    }
}

/// What each instrument reads of a response.
pub struct Reader<'a> {
    run: &'a Run,
    response: &'a Response,
    axes: AxisSet,
    /// Directions of the length reference's beams, by the axis along which they advance most.
    beams: PerAxis<Vector3<f64>>,
}

impl<'a> Reader<'a> {
    fn new(run: &'a Run, response: &'a Response, axes: AxisSet) -> Self {
        let beam_of = |axis: Axis| match run.segment.kind {
            TestKind::Diagonal => beam(run, axis),
            _ => unit(axis),
        };
        Self {
            run,
            response,
            axes,
            beams: PerAxis::from_fn(beam_of),
        }
    }

    /// Mean deviation that some readings of one channel should show, places in the run's list, mm (K, rad); NaN of no reading.
    #[must_use]
    pub fn mean(&self, channel: &Channel, rows: &[usize]) -> f64 {
        let of = |row: &usize| (*row, &self.run.readings[*row]);
        let total: f64 = match self.series_of(channel) {
            // An effect writes to one or two series: the others are empty and need no look at each reading.
            Some(series) => match series.map(|one| !one.is_empty()) {
                [false, false, false, false] => self.beside(rows),
                [true, false, false, false] => self.sum(rows, [series[0]]),
                [false, true, false, false] => self.sum(rows, [series[1]]),
                [false, false, true, false] => self.sum(rows, [series[2]]),
                [false, false, false, true] => self.sum(rows, [series[3]]),
                _ => self.sum(rows, series),
            },
            None => rows
                .iter()
                .map(of)
                .map(|(row, reading)| self.deviation(row, reading))
                .sum(),
        };
        total / rows.len() as f64
    }

    /// The series that a channel shows the sum of; none of one that reads along directions.
    fn series_of(&self, channel: &Channel) -> Option<[&'a [f64]; 4]> {
        let r = self.response;
        let tip = |axis: Axis, more: &'a Series| {
            let is_slide = self.axes.contains(axis);
            let of_slide = |series: &'a PerAxis<Series>| -> &'a [f64] {
                if is_slide { &series[axis] } else { &[] }
            };
            [
                &r.tip_mm[axis.index()],
                of_slide(&r.drive),
                of_slide(&r.servo),
                more,
            ]
        };
        let on_plate = |coordinate: usize| {
            let axes = plate_axes(self.run.segment.plane)?;
            Some(tip(axes[coordinate], &r.grid_reading_mm[coordinate]))
        };
        match channel {
            Channel::Motor(axis) => Some([&r.servo[*axis], &r.motor_reading[*axis], &[], &[]]),
            Channel::Scale(axis) => Some([
                &r.servo[*axis],
                &r.drive[*axis],
                &r.scale_reading[*axis],
                &[],
            ]),
            Channel::GridU => on_plate(0),
            Channel::GridV => on_plate(1),
            Channel::Length(axis)
                if self.run.segment.kind != TestKind::Diagonal && axis.is_linear() =>
            {
                Some(tip(*axis, &r.length_reading_mm))
            }
            _ => None,
        }
    }

    /// Sum over some readings of what series show at them and what the instrument itself adds.
    fn sum<const N: usize>(&self, rows: &[usize], series: [&[f64]; N]) -> f64 {
        rows.iter()
            .map(|row| {
                let reading = &self.run.readings[*row];
                let shown: f64 = series.iter().map(|one| interpolate(one, reading)).sum();
                shown + self.response.reading.get(*row).copied().unwrap_or(0.0)
            })
            .sum()
    }

    /// Sum over some readings of what the instrument itself adds.
    fn beside(&self, rows: &[usize]) -> f64 {
        let added = &self.response.reading;
        if added.is_empty() {
            return 0.0;
        }
        rows.iter().filter_map(|row| added.get(*row)).sum()
    }

    fn deviation(&self, row: usize, reading: &Reading) -> f64 {
        let r = self.response;
        let between = |series: &[f64]| interpolate(series, reading);
        let along = |direction: &Vector3<f64>| self.tip_at(reading, true).dot(direction);
        let stands_on = match (self.series_of(&reading.channel), &reading.channel) {
            (Some(series), _) => series.into_iter().map(between).sum(),
            (None, Channel::Radial) => along(&radial(self.run, reading)),
            (None, Channel::Length(axis)) => {
                along(&self.beams[*axis]) + between(&r.length_reading_mm)
            }
            (None, Channel::Touch) => self.touch(reading),
            (None, Channel::GridU) => between(&r.grid_reading_mm[0]),
            (None, Channel::GridV) => between(&r.grid_reading_mm[1]),
            (None, _) => 0.0,
        };
        stands_on + r.reading.get(row).copied().unwrap_or(0.0)
    }

    /// Error of the tip with (or without) what the control loop leaves, machine frame.
    fn tip_at(&self, reading: &Reading, with_servo: bool) -> Vector3<f64> {
        Vector3::from(Axis::LINEAR.map(|axis| self.tip_along(reading, axis, with_servo)))
    }

    /// The same along one of the linear axes.
    fn tip_along(&self, reading: &Reading, axis: Axis, with_servo: bool) -> f64 {
        let mut tip = interpolate(&self.response.tip_mm[axis.index()], reading);
        if self.axes.contains(axis) {
            tip += interpolate(&self.response.drive[axis], reading);
            if with_servo {
                tip += interpolate(&self.response.servo[axis], reading);
            }
        }
        tip
    }

    /// The position that is latched when a ball meets its surface: the tip's error turned, what the motors' encoders read
    /// beyond it, and the travel.
    fn touch(&self, reading: &Reading) -> f64 {
        let Some(touch) = self.run.touches.get(reading.at) else {
            return 0.0;
        };
        let at_contact = touch.tick.map_or_else(Vector3::zeros, |tick| {
            let there = Reading {
                at: tick,
                fraction: 0.0,
                ..reading.clone()
            };
            self.tip_at(&there, false)
        });
        // What the motors' encoders read beyond where they are is latched as well.
        let read = touch.tick.map_or(0.0, |tick| {
            let of = |axis: Axis| {
                let read = self.response.motor_reading[axis].get(tick);
                read.copied().unwrap_or(0.0) * touch.approach[axis.index()]
            };
            Axis::LINEAR.into_iter().map(of).sum()
        });
        let travel = self.response.travel_mm.get(reading.at);
        travel.copied().unwrap_or(0.0) + read - at_contact.dot(&touch.approach)
    }

    fn variance(&self, reading: &Reading) -> f64 {
        let of_tip = |direction: Vector3<f64>| {
            (0..3)
                .map(|k| {
                    interpolate(&self.response.tip_variance_mm2[k], reading) * direction[k].powi(2)
                })
                .sum()
        };
        match reading.channel {
            Channel::GridU => of_tip(plate(self.run, 0)),
            Channel::GridV => of_tip(plate(self.run, 1)),
            Channel::Radial => of_tip(radial(self.run, reading)),
            Channel::Length(axis) => of_tip(self.beams[axis]),
            Channel::Touch => self
                .response
                .travel_variance_mm2
                .get(reading.at)
                .copied()
                .unwrap_or(0.0),
            Channel::Motor(_) | Channel::Scale(_) | Channel::Thermometer(_) => 0.0,
        }
    }
}

/// Direction of a coordinate of the plate, machine frame.
pub(crate) fn plate(run: &Run, coordinate: usize) -> Vector3<f64> {
    plate_axes(run.segment.plane).map_or_else(Vector3::zeros, |axes| unit(axes[coordinate]))
}

/// Outward from the centre, within the plane of the test.
pub(crate) fn radial(run: &Run, reading: &Reading) -> Vector3<f64> {
    let Some(axes) = plate_axes(run.segment.plane) else {
        return Vector3::zeros();
    };
    let mut outward = Vector3::zeros();
    for axis in axes {
        let here = interpolate(&run.motion.position[axis], reading);
        outward[axis.index()] = here - run.segment.centre_mm[axis.index()];
    }
    outward.try_normalize(0.0).unwrap_or_default()
}

/// Along the axis, or along the diagonal that the run goes.
pub(crate) fn beam(run: &Run, axis: Axis) -> Vector3<f64> {
    if run.segment.kind != TestKind::Diagonal {
        return unit(axis);
    }
    let position = |tick: usize| {
        Vector3::from_fn(|k, _| {
            run.motion.position[Axis::LINEAR[k]]
                .get(tick)
                .copied()
                .unwrap_or(0.0)
        })
    };
    let motion = &run.motion.position[axis];
    let order = |a: &usize, b: &usize| motion[*a].total_cmp(&motion[*b]);
    let (low, high) = (
        (0..motion.len()).min_by(order),
        (0..motion.len()).max_by(order),
    );
    match (low, high) {
        (Some(low), Some(high)) => (position(high) - position(low))
            .try_normalize(0.0)
            .unwrap_or_else(|| unit(axis)),
        _ => unit(axis),
    }
}

fn unit(axis: Axis) -> Vector3<f64> {
    let mut direction = Vector3::zeros();
    if axis.is_linear() {
        direction[axis.index()] = 1.0;
    }
    direction
}

fn interpolate(series: &[f64], reading: &Reading) -> f64 {
    let Some(here) = series.get(reading.at) else {
        return 0.0;
    };
    let next = series.get(reading.at + 1).unwrap_or(here);
    here + (next - here) * reading.fraction
}
