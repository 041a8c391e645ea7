//! Machines, motions and sessions that the effects are tried on.

use std::collections::BTreeMap;

use machine::file::MachineFile;
use metrology::sample::{TestKind, TestPlane, TestSegment};
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use nalgebra::{DMatrix, DVector, Vector3};
use twin::effects::{self, Effect, Target};
use twin::{Channel, History, Motion, Reading, Response, Run, Session, Touch, Twin};

const BENCH: &str = include_str!("../../../../machine/tests/data/bench.yaml");
const SENSORS: &str = "temperature_sensors:
  - {id: spindle_front, place: spindle_front, period_s: 5.0}
  - {id: spindle_rear, place: spindle_rear, period_s: 5.0}
  - {id: column, place: column, period_s: 5.0}
  - {id: bed, place: bed, period_s: 5.0}
  - {id: nut_x, place: nut_x, period_s: 5.0}
  - {id: nut_y, place: nut_y, period_s: 5.0}
  - {id: nut_z, place: nut_z, period_s: 5.0}
  - {id: air, place: ambient, period_s: 5.0}
";

/// Period of the recorded ticks, s.
pub const TICK_S: f64 = 0.001;

/// The five-axis bench with thermometers.
pub fn bench() -> MachineFile {
    MachineFile::parse(&format!("{BENCH}{SENSORS}"), "bench.yaml").unwrap()
}

/// The bench without its rotary axes, with another chain.
pub fn three_axes(chain: &str) -> MachineFile {
    let mut machine = bench();
    chain.clone_into(&mut machine.chain);
    machine.axes.retain(|axis, _| axis.is_linear());
    machine.rotary = None;
    machine
}

/// A segment of no special kind.
pub fn segment(kind: TestKind, plane: TestPlane) -> TestSegment {
    TestSegment {
        plane,
        feed_mm_s: 50.0,
        stylus: String::from("ruby_6"),
        ..TestSegment::of_kind(kind, 1, Stamp::from_nanos(0))
    }
}

/// A run of one motion, each axis a function of time; `ticks` of [`TICK_S`].
pub fn run(ticks: usize, axes: AxisSet, at: impl Fn(f64) -> [f64; 6]) -> Run {
    let time_s: Vec<f64> = (0..ticks).map(|k| k as f64 * TICK_S).collect();
    let poses: Vec<_> = time_s.iter().map(|t| at(*t)).collect();
    let position = PerAxis::from_fn(|axis: Axis| {
        if axes.contains(axis) {
            poses.iter().map(|pose| pose[axis.index()]).collect()
        } else {
            vec![]
        }
    });
    Run {
        segment: segment(TestKind::Line, TestPlane::Xy),
        motion: Motion::new(time_s, axes, position).unwrap(),
        touches: vec![],
        readings: vec![],
    }
}

/// Circles in XY about the origin at constant feed, from angle 0.
pub fn circle(radius_mm: f64, feed_mm_s: f64, turns: f64) -> Run {
    let rate = feed_mm_s / radius_mm;
    let ticks = (turns.abs() * std::f64::consts::TAU / rate / TICK_S).round() as usize + 1;
    let mut run = run(ticks, AxisSet::XYZ, |t| {
        let (sin, cos) = (rate * t * turns.signum()).sin_cos();
        [radius_mm * cos, radius_mm * sin, 0.0, 0.0, 0.0, 0.0]
    });
    run.segment.kind = TestKind::Circle;
    run.segment.radius_mm = radius_mm;
    run.segment.feed_mm_s = feed_mm_s;
    run
}

/// An effect of the catalogue on the target of that name, free amplitudes zero unless given.
pub fn effect(machine: &MachineFile, id: &str, on: &str, given: &[(&str, f64)]) -> Box<dyn Effect> {
    let entry = machine::file::EffectEntry {
        kind: id.to_owned(),
        axis: Some(on.to_owned()).filter(|name| !name.is_empty()),
        parameters: given.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect(),
    };
    effects::from_entry(machine, 0, &entry).unwrap()
}

/// Response of one run, without a past.
pub fn respond(machine: &MachineFile, run: &Run, effect: &dyn Effect) -> Response {
    let session = Session::default();
    Twin::new(machine)
        .unwrap()
        .respond(&session, run, &[effect])
}

/// Shorthand of [`effect`] and [`respond`].
pub fn response_of(
    machine: &MachineFile,
    run: &Run,
    id: &str,
    on: &str,
    given: &[(&str, f64)],
) -> Response {
    respond(machine, run, effect(machine, id, on, given).as_ref())
}

/// A session in which something of everything happens: circles in both senses, slow and fast lines,
/// stops, all planes, turning rotary axes, touches at two feeds, hours of heating before.
pub fn busy() -> (MachineFile, Session) {
    let machine = bench();
    let axes = machine.axis_set();
    let mut run = run(14_000, axes, busy_pose);
    run.segment.kind = TestKind::Circle;
    run.segment.plane = TestPlane::Xy;
    run.segment.radius_mm = 60.0;
    run.segment.tool_offset_mm = Vector3::new(15.0, -10.0, -40.0);
    for (time, shift) in run.motion.time_s.iter_mut().zip([7200.0; 14_000]) {
        *time += shift;
    }
    run.touches = touches(&run);
    run.readings = readings(&run);
    let session = Session {
        history: history(),
        runs: vec![run],
        first_bag_ends: None,
    };
    (machine, session)
}

/// Position of all axes of [`busy`], t in s.
fn busy_pose(t: f64) -> [f64; 6] {
    let rate = 50.0 / 60.0;
    let angle = if t < 8.0 { rate * t } else { rate * (16.0 - t) };
    let slow = if t < 10.0 {
        0.0
    } else {
        0.05 * (1.0 - (2.0 * (t - 10.0)).cos())
    };
    let z = 80.0 + 60.0 * (0.8 * t).sin();
    let turning = (t - 11.0).max(0.0);
    [
        60.0 * angle.cos() + slow,
        60.0 * angle.sin(),
        z,
        -0.4 + 0.1 * turning,
        0.0,
        0.6 + 0.3 * turning,
    ]
}

fn touches(run: &Run) -> Vec<Touch> {
    (0..24_usize)
        .map(|k| {
            let tick = 300 + 500 * k;
            let around = k as f64 * 0.7;
            let (sin, cos) = around.sin_cos();
            let tilt: f64 = if k % 3 == 0 { -0.8 } else { 0.0 };
            let flat = (1.0 - tilt * tilt).sqrt();
            let here = |axis: Axis| run.motion.position[axis].get(tick).copied().unwrap_or(0.0);
            Touch {
                time_s: run.motion.time_s[tick],
                feature_id: String::from(["block_1", "block_2", "ball"][k % 3]),
                approach: Vector3::new(flat * cos, flat * sin, tilt),
                feed_mm_s: [2.0, 8.0][k % 2],
                position: PerAxis::from_fn(here),
                tick: Some(tick),
            }
        })
        .collect()
}

fn readings(run: &Run) -> Vec<Reading> {
    let channels = [
        Channel::Motor(Axis::X),
        Channel::Scale(Axis::Y),
        Channel::GridU,
        Channel::GridV,
        Channel::Radial,
        Channel::Length(Axis::Z),
        Channel::Thermometer(String::from("nut_x")),
        Channel::Thermometer(String::from("spindle_front")),
    ];
    let of = |channel: &Channel| {
        let channel = channel.clone();
        (0..run.motion.len()).step_by(20).map(move |at| Reading {
            channel: channel.clone(),
            at,
            fraction: 0.25,
            deviation: 0.0,
        })
    };
    let touches = (0..run.touches.len()).map(|at| Reading {
        channel: Channel::Touch,
        at,
        fraction: 0.0,
        deviation: 0.0,
    });
    channels.iter().flat_map(of).chain(touches).collect()
}

/// Four hours in minutes: motion for the first two, every thermometer warming up.
fn history() -> History {
    let minutes = 240_usize;
    let busy = |k: usize, rate: f64| if k < 130 { rate } else { 0.2 * rate };
    let series = |rate: f64| (0..minutes).map(|k| busy(k, rate)).collect::<Vec<_>>();
    let warm = |rise_k: f64, minutes_of: f64| {
        (0..minutes)
            .map(|k| 21.0 + rise_k * (1.0 - (-(k as f64) / minutes_of).exp()))
            .collect::<Vec<_>>()
    };
    let mut temperature_degc = BTreeMap::new();
    for (id, rise_k, minutes_of) in [
        ("spindle_front", 9.0, 30.0),
        ("spindle_rear", 7.0, 35.0),
        ("column", 2.0, 80.0),
        ("bed", 1.0, 120.0),
        ("nut_x", 5.0, 25.0),
        ("nut_y", 4.0, 25.0),
        ("nut_z", 6.0, 20.0),
        ("air", 1.5, 60.0),
    ] {
        temperature_degc.insert(id.to_owned(), warm(rise_k, minutes_of));
    }
    History {
        step_s: 60.0,
        position: PerAxis([0.0; 6].map(|_| vec![10.0; minutes])),
        speed: PerAxis([40.0, 35.0, 20.0, 0.1, 0.0, 0.2].map(series)),
        speed_squared: PerAxis([2000.0, 1500.0, 600.0, 0.02, 0.0, 0.05].map(series)),
        temperature_degc,
        ..History::default()
    }
}

/// Everything that an effect can add to, as one list of named series.
pub fn parts(response: &Response) -> Vec<(&'static str, &[f64])> {
    let mut all: Vec<(&'static str, &[f64])> = vec![];
    for axis in Axis::ALL {
        all.push(("servo", &response.servo[axis]));
        all.push(("drive", &response.drive[axis]));
        all.push(("motor_reading", &response.motor_reading[axis]));
        all.push(("scale_reading", &response.scale_reading[axis]));
    }
    all.extend(response.tip_mm.iter().map(|s| ("tip_mm", &s[..])));
    let grid = response.grid_reading_mm.iter();
    all.extend(grid.map(|s| ("grid_reading_mm", &s[..])));
    all.push(("length_reading_mm", &response.length_reading_mm));
    all.push(("travel_mm", &response.travel_mm));
    all.push(("reading", &response.reading));
    all
}

/// Everything that an effect of random phase can add to.
pub fn variances(response: &Response) -> Vec<(&'static str, &[f64])> {
    let tip = response.tip_variance_mm2.iter();
    tip.map(|s| ("tip_variance_mm2", &s[..]))
        .chain([("reading_variance", &response.reading_variance[..])])
        .chain([("travel_variance_mm2", &response.travel_variance_mm2[..])])
        .collect()
}

/// Tip at a tick, mm; a series that nothing was written to is zero.
pub fn tip_mm(response: &Response, tick: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| response.tip_mm[k].get(tick).copied().unwrap_or(0.0))
}

/// Root mean square.
pub fn rms(series: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for value in series {
        sum += value * value;
        n += 1.0;
    }
    f64::sqrt(sum / f64::max(n, 1.0))
}

/// Greatest magnitude.
pub fn greatest(series: impl IntoIterator<Item = f64>) -> f64 {
    series
        .into_iter()
        .fold(0.0, |most, x| f64::max(most, x.abs()))
}

/// Everything of the catalogue that can act on a machine.
pub fn instances(machine: &MachineFile) -> Vec<(&'static effects::Kind, Target)> {
    let of = |kind: &&'static effects::Kind| {
        let kind = *kind;
        kind.targets_on(machine).into_iter().map(move |t| (kind, t))
    };
    effects::CATALOGUE.iter().flat_map(of).collect()
}

/// Integrates dy/dt = f(t, y) by the classical Runge-Kutta method from t = 0 and returns y at each multiple
/// of `every` steps.
pub fn integrate<const N: usize>(
    mut y: [f64; N],
    step_s: f64,
    steps: usize,
    every: usize,
    f: impl Fn(f64, &[f64; N]) -> [f64; N],
) -> Vec<[f64; N]> {
    let along = |y: &[f64; N], d: &[f64; N], h: f64| std::array::from_fn(|k| y[k] + h * d[k]);
    let mut found = vec![y];
    for step in 0..steps {
        let t = step as f64 * step_s;
        let a = f(t, &y);
        let b = f(t + 0.5 * step_s, &along(&y, &a, 0.5 * step_s));
        let c = f(t + 0.5 * step_s, &along(&y, &b, 0.5 * step_s));
        let d = f(t + step_s, &along(&y, &c, step_s));
        y = std::array::from_fn(|k| y[k] + step_s / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]));
        if (step + 1) % every == 0 {
            found.push(y);
        }
    }
    found
}

/// Least squares of `wanted` on columns: the coefficients, and the rms of what is left.
pub fn fit(columns: &[Vec<f64>], wanted: &[f64]) -> (Vec<f64>, f64) {
    let matrix = DMatrix::from_fn(wanted.len(), columns.len(), |row, k| columns[k][row]);
    let right = DVector::from_column_slice(wanted);
    let found = matrix.clone().svd(true, true).solve(&right, 1e-12).unwrap();
    let left = right - matrix * &found;
    (found.as_slice().to_vec(), rms(left.iter().copied()))
}
