//! A shifted reference point against a counter that a switch sets.

use metrology::Axis;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use twin::{Channel, History};

use crate::effects::past::{instants, predict, read, stands};
use crate::effects::scene::{bench, rms};

const PULSE_MM: f64 = 1e-4;
const PERIOD_S: f64 = 1e-3;
/// Speed at which a reference run comes to its switch the last time.
const LATCH_MM_S: f64 = 1.5;

/// How far behind its switch a slide is, mm, when a control that asks the switch once a period sets its counter.
fn behind_the_switch_mm(start_mm: f64, switch_mm: f64) -> f64 {
    let mut slide_mm = start_mm;
    while slide_mm < switch_mm {
        slide_mm += LATCH_MM_S * PERIOD_S;
    }
    slide_mm - switch_mm
}

#[test]
fn val_two_reference_runs_on_a_polled_switch() {
    let machine = bench();
    let switch_mm = -250.0;
    let first_mm = behind_the_switch_mm(-250.0312, switch_mm);
    let second_mm = behind_the_switch_mm(-250.0203, switch_mm);
    let mut run = stands(&instants(8, 300.0), |k| [10.0 * k as f64, 0.0, 0.0]);
    read(&mut run, &Channel::Scale(Axis::X));
    let shift_um = (second_mm - first_mm) * 1e3;
    let given = [("shift_um", shift_um), ("at_min", 17.0)];
    let on = ("homing_shift", "X");
    let seen = predict(&machine, &History::default(), &run, on, &given);
    for (k, at_s) in run.motion.time_s.iter().enumerate() {
        // The counter says switch_mm where the slide is behind it; the drive goes to a count.
        let behind_mm = if *at_s > 1020.0 { second_mm } else { first_mm };
        let command_mm = run.motion.position[Axis::X][k];
        let counts = ((command_mm - switch_mm) / PULSE_MM).round();
        let slide_mm = switch_mm + behind_mm + counts * PULSE_MM;
        // The scale was set to zero with the axis at the first place.
        let scale_mm = slide_mm - first_mm;
        assert!((seen[k] - (scale_mm - command_mm)).abs() < 1e-9, "{k}");
    }
    println!("reference runs {shift_um:.3} um apart");
    assert!(shift_um.abs() > 0.1, "{shift_um}");
}

/// The difference of two numbers spread evenly over a has a standard deviation of a / sqrt 6 (GUM, 4.3.7, twice).
#[test]
fn typical_shifts_are_those_of_a_switch_that_is_asked_once_a_period() {
    let mut rng = Pcg64Mcg::seed_from_u64(31);
    let mut behind = || behind_the_switch_mm(-250.0 - 0.02 * rng.random::<f64>(), -250.0);
    let found_um = 1e3 * rms((0..20_000).map(|_| behind() - behind()));
    let wanted_um = 1e3 * LATCH_MM_S * PERIOD_S / 6.0_f64.sqrt();
    println!("scatter of reference runs: {found_um:.4} um, {wanted_um:.4} um");
    assert!((found_um / wanted_um - 1.0).abs() < 0.02, "{found_um}");
}

#[test]
fn eq1_the_motors_encoder_believes_its_counter() {
    let mut run = stands(&instants(8, 300.0), |k| [10.0 * k as f64, 0.0, 0.0]);
    read(&mut run, &Channel::Scale(Axis::X));
    read(&mut run, &Channel::Motor(Axis::X));
    let given = [("shift_um", 2.3), ("at_min", 17.0)];
    let on = ("homing_shift", "X");
    let seen = predict(&bench(), &History::default(), &run, on, &given);
    for (k, at_s) in run.motion.time_s.iter().enumerate() {
        let wanted_mm = if *at_s > 1020.0 { 2.3e-3 } else { 0.0 };
        assert!((seen[k] - wanted_mm).abs() < 1e-12, "{k}: {}", seen[k]);
        assert!(seen[k + 8].abs() < 1e-15);
    }
}
