//! Interpolation error against the arctangent of a pair of signals that are not quite right, and against a loop that is
//! integrated finely.

use std::f64::consts::{PI, TAU};

use machine::MachineFile;
use machine::file::{AxisEntry, LinearAxisEntry, PositionFeedback, VelocityLoopEntry};
use metrology::{Axis, AxisSet, PerAxis};
use twin::{Motion, Run};

use crate::effects::scene::{TICK_S, greatest, response_of, run, three_axes};

const PERIOD_MM: f64 = 0.02;
const GAIN_PER_S: f64 = 60.0;
const FEEDFORWARD: f64 = 0.9;

/// X with an ideal velocity loop.
fn machine(position_feedback: PositionFeedback) -> MachineFile {
    let mut machine = three_axes("[w X' Y' b Z t]");
    let Some(AxisEntry::Linear(x)) = machine.axes.get_mut(&Axis::X) else {
        unreachable!("X is linear")
    };
    x.scale_resolution_um = Some(0.1);
    x.position_feedback = position_feedback;
    x.velocity_loop = None;
    (x.position_gain_per_s, x.velocity_feedforward) = (GAIN_PER_S, FEEDFORWARD);
    machine
}

#[test]
fn val_the_arctangent_of_two_unequal_signals() {
    let (offset, unequal) = (0.02, 0.03);
    let mut machine = machine(PositionFeedback::Motor);
    if let Some(AxisEntry::Linear(x)) = machine.axes.get_mut(&Axis::X) {
        x.velocity_feedforward = 1.0;
    }
    let run = run(3000, AxisSet::XYZ, |t| [0.02 * t, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let per_rad_um = PERIOD_MM * 1e3 / TAU;
    let given = [
        ("sin_um", -offset * per_rad_um),
        ("cos_um", 0.0),
        ("period_um", 20.0),
        ("free_sin2_um", -0.5 * unequal * per_rad_um),
    ];
    let response = response_of(&machine, &run, "interpolation_error", "X", &given);
    let off = run.motion.position[Axis::X]
        .iter()
        .zip(&response.servo[Axis::X]);
    let off_um = greatest(off.map(|(u, error)| {
        let phase = TAU * u / PERIOD_MM;
        let (sin, cos) = phase.sin_cos();
        let read = sin.atan2((1.0 + unequal) * cos + offset);
        let ahead = (read - phase + PI).rem_euclid(TAU) - PI;
        // The loop holds the reading at the command, so that the slide is off the other way.
        -ahead * per_rad_um - error * 1e3
    }));
    let most_um = greatest(response.servo[Axis::X].iter().copied()) * 1e3;
    println!("interpolation {most_um:.4} um, off by {off_um:.4} um");
    assert!(off_um < 0.05 * most_um, "{off_um} {most_um}");
    let seen = response.servo[Axis::X]
        .iter()
        .zip(&response.motor_reading[Axis::X]);
    let seen_um = greatest(seen.map(|(off, read)| off + read)) * 1e3;
    assert!(
        seen_um < 0.05 * most_um,
        "the encoder that closes the loop sees nothing of it: {seen_um}"
    );
}

/// Speeds up for three seconds, to fifty periods a second, slows down, turns round and comes back.
fn commanded(t: f64) -> [f64; 2] {
    let (far, most) = (3.0, 2.0);
    let rate = PI / far;
    let velocity = 0.5 * most * (rate * t).sin();
    [0.5 * most * (1.0 - (rate * t).cos()) / rate, velocity]
}

#[test]
fn val_a_loop_that_follows_a_scale_integrated_finely() {
    let machine = machine(PositionFeedback::Scale);
    let amplitude_mm = 0.2e-3;
    let run = run(6000, AxisSet::XYZ, |t| {
        [commanded(t)[0], 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let given = [("sin_um", 0.2), ("cos_um", 0.0), ("period_um", 20.0)];
    let response = response_of(&machine, &run, "interpolation_error", "X", &given);

    let step_s = 2e-6;
    let rate = |t: f64, slide: f64, amplitude: f64| {
        let [position, velocity] = commanded(t);
        let read = slide + amplitude * (TAU * slide / PERIOD_MM).sin();
        GAIN_PER_S * (position - read) + FEEDFORWARD * velocity
    };
    let mut slides = [0.0_f64; 2];
    let mut off_mm = 0.0_f64;
    let mut most_mm = 0.0_f64;
    let mut fast_mm = 0.0_f64;
    for (tick, servo) in response.servo[Axis::X].iter().enumerate() {
        let t = tick as f64 * TICK_S;
        let true_mm = slides[1] - slides[0];
        off_mm = off_mm.max((true_mm - servo).abs());
        most_mm = most_mm.max(true_mm.abs());
        if (t - 1.5).abs() < 0.05 {
            fast_mm = fast_mm.max(true_mm.abs());
        }
        for k in 0..500 {
            let t = t + f64::from(k) * step_s;
            for (slide, amplitude) in slides.iter_mut().zip([0.0, amplitude_mm]) {
                let begin = rate(t, *slide, amplitude);
                let end = rate(t + step_s, *slide + begin * step_s, amplitude);
                *slide += 0.5 * (begin + end) * step_s;
            }
        }
    }
    println!("slide off {most_mm:.6} mm, {fast_mm:.6} at speed; the effect off {off_mm:.6} mm");
    assert!(most_mm > 0.9 * amplitude_mm && fast_mm < 0.4 * amplitude_mm);
    assert!(off_mm < 0.05 * amplitude_mm, "{off_mm}");
}

/// Amplitudes of sin t, cos t, sin 2t and cos 2t, µm.
const ALL_UM: [f64; 4] = [0.05, -0.025, 0.0125, 0.02];

/// What the encoder reads beyond its place, mm, and by how much that changes with the place.
fn misread(at_mm: f64) -> [f64; 2] {
    let t = TAU * at_mm / PERIOD_MM;
    let ((s, c), (s2, c2)) = (t.sin_cos(), (2.0 * t).sin_cos());
    let [a, b, a2, b2] = ALL_UM.map(|um| um * 1e-3);
    let slope = a * c - b * s + 2.0 * (a2 * c2 - b2 * s2);
    [a * s + b * c + a2 * s2 + b2 * c2, slope * TAU / PERIOD_MM]
}

/// Place, velocity and the velocity loop's integral of a slide whose encoder reads `share` of [`misread`].
type Slide = [f64; 3];

/// How a slide changes; `command` is place and velocity.
fn rates(slide: &Slide, command: [f64; 2], share: f64, entry: &LinearAxisEntry) -> Slide {
    let [at_mm, velocity, integral] = *slide;
    let [error_mm, slope] = misread(at_mm).map(|value| share * value);
    let wanted = GAIN_PER_S * (command[0] - at_mm - error_mm) + FEEDFORWARD * command[1];
    let Some(inner) = &entry.velocity_loop else {
        return [wanted, 0.0, 0.0];
    };
    let by_motor = entry.position_feedback == PositionFeedback::Motor;
    let seen = if by_motor {
        velocity * (1.0 + slope)
    } else {
        velocity
    };
    let w = TAU * inner.frequency_hz;
    let gained = 2.0 * inner.damping * w * (wanted - seen) + integral;
    [velocity, gained, w * w * (wanted - seen)]
}

/// Goes on by a step of Heun's.
fn step(slide: &mut Slide, t: f64, step_s: f64, rates: impl Fn(&Slide, f64) -> Slide) {
    let begin = rates(slide, t);
    let there = [0, 1, 2].map(|k| slide[k] + begin[k] * step_s);
    let end = rates(&there, t + step_s);
    *slide = [0, 1, 2].map(|k| slide[k] + 0.5 * (begin[k] + end[k]) * step_s);
}

/// From here on the effect is judged, s: a run is taken to begin at a steady velocity.
const BEGUN_S: f64 = 0.1;

/// Greatest error of the effect where many periods pass between two recorded ticks, one of so many, as a share of what the encoder
/// misreads at most.
fn off_by(entry_of: impl Fn(&mut LinearAxisEntry), speed: f64, every: usize) -> f64 {
    let mut machine = machine(PositionFeedback::Scale);
    let Some(AxisEntry::Linear(entry)) = machine.axes.get_mut(&Axis::X) else {
        unreachable!("X is linear")
    };
    entry_of(entry);
    let entry = entry.clone();
    let command = |t: f64| commanded(t).map(|value| speed * value);
    let whole = run(6000, AxisSet::XYZ, |t| {
        [command(t)[0], 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let motion = &whole.motion;
    let thin = |all: &[f64]| all.iter().copied().step_by(every).collect::<Vec<f64>>();
    let position = PerAxis::from_fn(|axis| thin(&motion.position[axis]));
    let thinned = Run {
        motion: Motion::new(thin(&motion.time_s), AxisSet::XYZ, position).unwrap(),
        ..whole.clone()
    };
    let [a, b, a2, b2] = ALL_UM;
    let given = [
        ("sin_um", a),
        ("cos_um", b),
        ("period_um", 20.0),
        ("free_sin2_um", a2),
        ("free_cos2_um", b2),
    ];
    let response = response_of(&machine, &thinned, "interpolation_error", "X", &given);
    let step_s = 2e-6;
    // At rest where the loop holds it: its reading is the command.
    let mut slides: [Slide; 2] = [[0.0; 3], [-misread(0.0)[0], 0.0, 0.0]];
    let (mut off_mm, mut most_mm) = (0.0_f64, 0.0_f64);
    for (tick, servo) in response.servo[Axis::X].iter().enumerate() {
        let t = tick as f64 * every as f64 * TICK_S;
        let true_mm = slides[1][0] - slides[0][0];
        let read_mm = misread(slides[0][0])[0].abs();
        if t > BEGUN_S {
            off_mm = off_mm.max((true_mm - servo).abs());
            most_mm = most_mm.max(read_mm);
        }
        for k in 0..every * 500 {
            let t = t + k as f64 * step_s;
            for (slide, share) in slides.iter_mut().zip([0.0, 1.0]) {
                step(slide, t, step_s, |slide, t| {
                    rates(slide, command(t), share, &entry)
                });
            }
        }
    }
    println!("{speed} mm/s: misread by {most_mm:.7} mm, the effect off by {off_mm:.7} mm");
    off_mm / most_mm
}

#[test]
fn val_a_loop_on_thinned_ticks_integrated_finely() {
    let inner = |entry: &mut LinearAxisEntry| {
        entry.velocity_loop = Some(VelocityLoopEntry {
            frequency_hz: 50.0,
            damping: 0.8,
            filter_ms: 0.0,
        });
    };
    // Up to five periods between two ticks, and through the thirty above which the loop follows none, there and back.
    // A velocity loop follows at the turn, where the speed is another one before the tick is over.
    for (speed, every, most_by_motor) in [(10.0, 10, 0.08), (400.0, 2, 0.3)] {
        assert!(
            off_by(|_| {}, speed, every) < 0.05,
            "{speed}: a scale, ideal loop"
        );
        assert!(off_by(inner, speed, every) < 0.05, "{speed}: a scale");
        let by_motor = |entry: &mut LinearAxisEntry| {
            inner(entry);
            entry.position_feedback = PositionFeedback::Motor;
        };
        assert!(
            off_by(by_motor, speed, every) < most_by_motor,
            "{speed}: a motor's encoder"
        );
    }
}
