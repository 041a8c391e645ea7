//! The nominal following error against the loop itself.

use machine::file::{AxisEntry, VelocityLoopEntry};
use metrology::Axis;
use twin::Following;
use twin::Motion;
use twin::effects;

use crate::effects::scene::{TICK_S, bench, circle, greatest, integrate, respond, response_of};

#[test]
fn val_the_loop_integrated_finely() {
    let machine = bench();
    let (radius_mm, feed_mm_s) = (50.0, 100.0);
    let run = circle(radius_mm, feed_mm_s, 1.0);
    let response = respond(&machine, &run, &Following);
    let x = machine.linear(Axis::X).unwrap();
    let (gain, left) = (x.position_gain_per_s, 1.0 - x.velocity_feedforward);
    let rate = feed_mm_s / radius_mm;
    let loop_of = |t: f64, x: &[f64; 1]| {
        let (sin, cos) = (rate * t).sin_cos();
        let velocity = -radius_mm * rate * sin;
        [gain * (radius_mm * cos - x[0]) + (1.0 - left) * velocity]
    };
    let ticks = run.motion.len();
    let motor = integrate([radius_mm], TICK_S / 10.0, 10 * (ticks - 1), 10, loop_of);
    // The run begins at rest here, in motion there: forgotten after a quarter of a second.
    let off = (250..ticks).map(|k| {
        let command = run.motion.position[Axis::X][k];
        motor[k][0] - command - response.servo[Axis::X][k]
    });
    let off_um = greatest(off) * 1e3;
    let most_um = greatest(response.servo[Axis::X].iter().copied()) * 1e3;
    println!("following error {most_um:.2} um, off by {off_um:.2e} um");
    assert!(off_um < 1e-3, "{off_um}");
}

/// The bench whose X has a velocity loop.
fn with_velocity_loop(filter_ms: f64) -> machine::MachineFile {
    let mut machine = bench();
    let Some(AxisEntry::Linear(x)) = machine.axes.get_mut(&Axis::X) else {
        panic!("X is linear");
    };
    x.velocity_loop = Some(VelocityLoopEntry {
        frequency_hz: 30.0,
        damping: 0.9,
        filter_ms,
    });
    machine
}

#[test]
fn val_the_loop_with_its_velocity_loop_integrated_finely() {
    let machine = with_velocity_loop(0.4);
    let (radius_mm, feed_mm_s) = (25.0, 100.0);
    let run = circle(radius_mm, feed_mm_s, 1.0);
    let response = respond(&machine, &run, &Following);
    let x = machine.linear(Axis::X).unwrap();
    let (gain, share) = (x.position_gain_per_s, x.velocity_feedforward);
    let frequency = std::f64::consts::TAU * 30.0;
    let rate = feed_mm_s / radius_mm;
    // Position, velocity, integral part, filtered velocity.
    let loop_of = |t: f64, s: &[f64; 4]| {
        let (sin, cos) = (rate * t).sin_cos();
        let wanted = gain * (radius_mm * cos - s[0]) - share * radius_mm * rate * sin;
        let missing = wanted - s[3];
        [
            s[1],
            2.0 * 0.9 * frequency * missing + s[2],
            frequency * frequency * missing,
            (s[1] - s[3]) / 0.4e-3,
        ]
    };
    let ticks = run.motion.len();
    let start = [radius_mm, 0.0, 0.0, 0.0];
    let motor = integrate(start, TICK_S / 20.0, 20 * (ticks - 1), 20, loop_of);
    let off = (400..ticks).map(|k| {
        let command = run.motion.position[Axis::X][k];
        motor[k][0] - command - response.servo[Axis::X][k]
    });
    let off_um = greatest(off) * 1e3;
    let most_um = greatest(response.servo[Axis::X].iter().copied()) * 1e3;
    println!("with velocity loop {most_um:.2} um, off by {off_um:.2e} um");
    // Chords of the command run r'' h^2 / 12 inside the arc: 0.033 um.
    assert!(off_um < 0.035, "{off_um}");
    let ideal = respond(&bench(), &run, &Following);
    let added = (400..ticks).map(|k| response.servo[Axis::X][k] - ideal.servo[Axis::X][k]);
    assert!(greatest(added) > 1e-3, "the velocity loop must be seen");
}

/// Round a circle an axis behind an ideal velocity loop accelerates as its command does, within the phase of the loop.
#[test]
fn eq2_an_axis_behind_an_ideal_loop_accelerates_as_the_loop_in_closed_form() {
    let machine = bench();
    let (radius_mm, feed_mm_s) = (50.0, 100.0);
    let mut run = circle(radius_mm, feed_mm_s, 1.0);
    run.motion.follow(&machine);
    let x = machine.linear(Axis::X).unwrap();
    let (gain, share) = (x.position_gain_per_s, x.velocity_feedforward);
    let rate = feed_mm_s / radius_mm;
    // x = G r, G = (K + i w f) / (K + i w).
    let size = gain * gain + rate * rate;
    let (along, across) = (
        (gain * gain + share * rate * rate) / size,
        (share - 1.0) * rate * gain / size,
    );
    let most = radius_mm * rate * rate;
    let off = (500..run.motion.len() - 2).map(|k| {
        let (sin, cos) = (rate * run.motion.time_s[k]).sin_cos();
        run.motion.driven[Axis::X][k] + most * (along * cos - across * sin)
    });
    let off = greatest(off);
    assert!(off < 1e-3 * most, "{off} of {most}");
}

/// A command that turns round sharply, as at a corner: its acceleration is there for less than the loops' time.
#[test]
fn val_a_motor_accelerates_as_its_loop_integrated_finely() {
    let machine = with_velocity_loop(0.4);
    let mut run = circle(25.0, 100.0, 1.0);
    let (slow_mm_s, sharp_mm_s2, turn_s) = (20.0, 2000.0, 1.0);
    // Even speed, a turn of 20 ms, even speed back.
    let velocity_at = |t: f64| (slow_mm_s - sharp_mm_s2 * (t - turn_s).max(0.0)).max(-slow_mm_s);
    let at = |t: f64| {
        let turned = (t - turn_s).clamp(0.0, 2.0 * slow_mm_s / sharp_mm_s2);
        let beyond = (t - turn_s - turned).max(0.0);
        slow_mm_s * (t.min(turn_s) + turned - beyond) - 0.5 * sharp_mm_s2 * turned * turned
    };
    let (axes, times) = (run.motion.axes, run.motion.time_s.clone());
    let mut position = run.motion.position.clone();
    position[Axis::X] = times.iter().map(|t| at(*t)).collect();
    run.motion = Motion::new(times, axes, position).unwrap();
    run.motion.follow(&machine);
    let x = machine.linear(Axis::X).unwrap();
    let (gain, share) = (x.position_gain_per_s, x.velocity_feedforward);
    let frequency = std::f64::consts::TAU * 30.0;
    let loop_of = |t: f64, s: &[f64; 4]| {
        let missing = gain * (at(t) - s[0]) + share * velocity_at(t) - s[3];
        let acceleration = 2.0 * 0.9 * frequency * missing + s[2];
        [
            s[1],
            acceleration,
            frequency * frequency * missing,
            (s[1] - s[3]) / 0.4e-3,
        ]
    };
    let ticks = run.motion.len();
    let start = [0.0, slow_mm_s, 0.0, slow_mm_s];
    let motor = integrate(start, TICK_S / 20.0, 20 * (ticks - 1), 20, loop_of);
    let near = 900..1200;
    let off = near.clone().map(|k| {
        let t = run.motion.time_s[k];
        run.motion.driven[Axis::X][k] - loop_of(t, &motor[k])[1]
    });
    let most = greatest(near.clone().map(|k| run.motion.driven[Axis::X][k]));
    let off = greatest(off);
    // Differences spread the ends of the turn over a tick on either side.
    assert!(off < 0.05 * most, "{off} of {most}");
    // What has inertia yields to that, not to the command's.
    for (effect, parameter) in [
        ("drive_windup", "windup_um"),
        ("load_deflection", "along_um"),
    ] {
        let response = response_of(&machine, &run, effect, "X", &[(parameter, 3.0)]);
        let of = |moved_mm: &[f64], k: usize| moved_mm.get(k).copied().unwrap_or(0.0);
        let yielded = near.clone().map(|k| {
            let moved_mm = of(&response.drive[Axis::X], k) + of(&response.tip_mm[0], k);
            moved_mm + 3e-6 * loop_of(run.motion.time_s[k], &motor[k])[1]
        });
        let (off_um, most_um) = (greatest(yielded) * 1e3, 3e-3 * most);
        println!("{effect} off by {off_um:.3} um of {most_um:.2}");
        assert!(off_um < 0.05 * most_um, "{effect}: {off_um}");
    }
    let of_command =
        near.map(|k| run.motion.acceleration[Axis::X][k] - run.motion.driven[Axis::X][k]);
    assert!(greatest(of_command) > 0.4 * most, "the loop must be seen");
}

#[test]
fn eq6_a_velocity_loop_adds_a_share_of_acceleration_and_jerk() {
    let (radius_mm, feed_mm_s) = (50.0, 40.0);
    let run = circle(radius_mm, feed_mm_s, 1.0);
    let ideal = respond(&bench(), &run, &Following);
    for filter_ms in [0.0, 0.25] {
        let machine = with_velocity_loop(filter_ms);
        let response = respond(&machine, &run, &Following);
        let x = machine.linear(Axis::X).unwrap();
        let (gain, share) = (x.position_gain_per_s, x.velocity_feedforward);
        let square = (std::f64::consts::TAU * 30.0).powi(2);
        let rate = feed_mm_s / radius_mm;
        let off = (1000..run.motion.len()).map(|k| {
            let (sin, cos) = (rate * run.motion.time_s[k]).sin_cos();
            let acceleration = -radius_mm * rate.powi(2) * cos;
            let jerk = radius_mm * rate.powi(3) * sin;
            let expected = filter_ms * 1e-3 / gain * acceleration - share * jerk / (square * gain);
            response.servo[Axis::X][k] - ideal.servo[Axis::X][k] - expected
        });
        let off_um = greatest(off) * 1e3;
        println!("filter {filter_ms} ms: eq. 6 off by {off_um:.4} um");
        assert!(off_um < 0.01, "{off_um}");
    }
}

#[test]
fn eq2_constant_velocity_leaves_what_feedforward_misses() {
    let machine = bench();
    let run = crate::effects::scene::run(500, metrology::AxisSet::XYZ, |t| {
        [20.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let response = respond(&machine, &run, &Following);
    for error in &response.servo[Axis::X] {
        assert!((error + 0.02 * 20.0 / 60.0).abs() < 1e-12, "{error}");
    }
    let around = respond(&with_velocity_loop(0.25), &run, &Following);
    for error in &around.servo[Axis::X] {
        assert!((error + 0.02 * 20.0 / 60.0).abs() < 1e-9, "{error}");
    }
}

#[test]
fn the_machine_as_described_has_its_loops_and_its_listed_effects() {
    let mut machine = bench();
    assert_eq!(effects::known(&machine).unwrap().len(), 1);
    let kind = effects::kind("backlash").unwrap();
    let target = &kind.targets_on(&machine)[0];
    machine.effects = vec![kind.entry(target, &kind.typical())];
    assert_eq!(effects::known(&machine).unwrap().len(), 2);
}
