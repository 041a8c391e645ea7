//! Backlash against a dragged slide, and its wider form against presliding friction.

use machine::file::{AxisEntry, GuideFrictionEntry, MachineFile};
use metrology::{Axis, AxisSet};

use crate::effects::scene::{TICK_S, fit, greatest, integrate, response_of, rms, run, three_axes};

const CHAIN: &str = "[w X' Y' b Z t]";

fn wave(t: f64) -> f64 {
    2.0 * (3.0 * t).sin() + 0.7 * (7.0 * t).sin()
}

#[test]
fn val_a_slide_dragged_through_a_gap() {
    let machine = three_axes(CHAIN);
    let (width_mm, contact_s) = (0.02, 2e-4);
    let run = run(4000, AxisSet::XYZ, |t| [wave(t), 0.0, 0.0, 0.0, 0.0, 0.0]);
    let drag = |t: f64, slide: &[f64; 1]| {
        let gap = wave(t) - slide[0];
        [(gap - gap.clamp(-0.5 * width_mm, 0.5 * width_mm)) / contact_s]
    };
    let slide = integrate([wave(0.0)], TICK_S / 20.0, 20 * 3999, 20, drag);
    let response = response_of(&machine, &run, "backlash", "X", &[("width_um", 20.0)]);
    let off = (0..run.motion.len()).map(|k| {
        let wanted = slide[k][0] - run.motion.position[Axis::X][k];
        response.drive[Axis::X][k] - wanted
    });
    let off_um = greatest(off) * 1e3;
    println!("play operator off a dragged slide by {off_um:.2} um of 20");
    // The contact of the dragged slide yields by velocity times its time constant: 11 mm/s, 0.2 ms.
    assert!(off_um < 11.0 * 0.2 * 1.05, "{off_um}");
}

/// A slide of 500 kg with 40 N of dry and 0.15 N s/mm of viscous friction between two stiff, damped flanks, carried by a
/// motor that its position loop lets follow a circle of 300 mm/s2: it runs ahead across the play long before it turns.
#[test]
fn val_a_light_slide_runs_ahead_of_its_drive() {
    let mut machine = three_axes(CHAIN);
    let (coulomb_mm_s2, viscous_per_s) = (80.0, 0.3);
    let (gain_per_s, feedforward) = (50.0, 0.97);
    let Some(AxisEntry::Linear(entry)) = machine.axes.get_mut(&Axis::X) else {
        panic!("X is linear")
    };
    (entry.position_gain_per_s, entry.velocity_feedforward) = (gain_per_s, feedforward);
    entry.velocity_loop = None;
    let held = machine.clone();
    let Some(AxisEntry::Linear(entry)) = machine.axes.get_mut(&Axis::X) else {
        panic!("X is linear")
    };
    entry.guide_friction = Some(GuideFrictionEntry {
        coulomb_mm_s2,
        viscous_per_s,
    });
    let (half_mm, radius_mm, rate) = (0.004, 40.0, 2.74);
    let place = |t: f64| radius_mm * (rate * t).cos();
    let speed = |t: f64| -radius_mm * rate * (rate * t).sin();
    let run = run(6000, AxisSet::XYZ, |t| [place(t), 0.0, 0.0, 0.0, 0.0, 0.0]);
    // Motor's error, slide and its speed; flanks of 200 Hz, critically damped.
    let (stiff, damped) = (1.6e6, 2.5e3);
    let carried = |t: f64, y: &[f64; 3]| {
        let motor_mm_s = feedforward * speed(t) - gain_per_s * y[0];
        let (gap, closing) = (place(t) + y[0] - y[1], motor_mm_s - y[2]);
        let beyond = gap - gap.clamp(-half_mm, half_mm);
        let pushed = if beyond == 0.0 {
            0.0
        } else {
            stiff * beyond + damped * closing
        };
        let friction = coulomb_mm_s2 * (y[2] / 0.05).tanh() + viscous_per_s * y[2];
        [motor_mm_s - speed(t), y[2], pushed - friction]
    };
    let parts = 40;
    let states = integrate(
        [0.0, radius_mm, 0.0],
        TICK_S / 40.0,
        parts * 5999,
        parts,
        carried,
    );
    let given = [("width_um", 2e3 * half_mm)];
    let wanted =
        (3000..5998).map(|k| states[k][1] - states[k][0] - run.motion.position[Axis::X][k]);
    let off_um = |machine: &MachineFile| {
        let response = response_of(machine, &run, "backlash", "X", &given);
        let lags = response.drive[Axis::X][3000..5998].to_vec();
        let off = wanted.clone().zip(lags).map(|(wanted, lag)| wanted - lag);
        rms(off) * 1e3
    };
    let size_um = rms(wanted.clone()) * 1e3;
    let (coasting, held) = (off_um(&machine), off_um(&held));
    println!(
        "of {size_um:.2} um: {coasting:.2} left, {held:.2} of a slide that stays where it is left"
    );
    assert!(
        coasting < 0.12 * size_um && held > 0.7 * size_um,
        "{coasting} {held}"
    );
}

/// An axis that is braked at 2 m/s2 has its slide on the front flank; while the motor creeps the last micrometres the
/// guides hold the slide back, and it comes to rest on the flank that pushes it: what positioning tests see.
#[test]
fn a_light_slide_comes_to_rest_on_the_flank_that_pushes_it() {
    let mut machine = three_axes(CHAIN);
    let Some(AxisEntry::Linear(entry)) = machine.axes.get_mut(&Axis::X) else {
        panic!("X is linear")
    };
    (entry.position_gain_per_s, entry.velocity_feedforward) = (45.0, 0.97);
    entry.velocity_loop = None;
    entry.guide_friction = Some(GuideFrictionEntry {
        coulomb_mm_s2: 15.0,
        viscous_per_s: 0.3,
    });
    let run = run(3000, AxisSet::XYZ, |t| {
        let brake = (t - 1.0).clamp(0.0, 0.05);
        let x = 100.0 * t.min(1.0) + 100.0 * brake - 1000.0 * brake * brake;
        [x, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let response = response_of(&machine, &run, "backlash", "X", &[("width_um", 2.0)]);
    let at = |tick: usize| response.drive[Axis::X][tick] * 1e3;
    assert!((at(900) + 1.0).abs() < 1e-9, "pushed: {}", at(900));
    assert!((at(1045) - 1.0).abs() < 1e-9, "braked: {}", at(1045));
    assert!((at(2990) + 1.0).abs() < 1e-9, "at rest: {}", at(2990));
}

/// A slide of 400 kg in a dead zone of 5 µm whose flanks of 400 N/µm begin over 0.4 µm, in balance with the force that
/// carries it through circles at 40 and 80 mm/s: its lead is where spring and force are equal, found by bisection.
#[test]
fn val_the_wider_form_takes_soft_corners() {
    let mut machine = three_axes(CHAIN);
    let (mass_kg, n_per_um, half_um, corner_um) = (400.0, 400.0, 2.5, 0.4_f64);
    let (coulomb_mm_s2, viscous_per_s) = (30.0, 0.3);
    let Some(AxisEntry::Linear(entry)) = machine.axes.get_mut(&Axis::X) else {
        panic!("X is linear")
    };
    entry.guide_friction = Some(GuideFrictionEntry {
        coulomb_mm_s2,
        viscous_per_s,
    });
    let rate = |t: f64| if t < 8.0 { 0.8 } else { 1.6 };
    let turned = |t: f64| 0.8 * t.min(8.0) + 1.6 * (t - 8.0).max(0.0);
    let run = run(14_000, AxisSet::XYZ, |t| {
        [50.0 * turned(t).cos(), 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let ramp = |x: f64| 0.5 * (x + x.hypot(corner_um));
    let spring_n = |lead: f64| n_per_um * (ramp(lead - half_um) - ramp(-lead - half_um));
    let lead_um = |force_n: f64| {
        let (mut low, mut high) = (-20.0, 20.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if spring_n(middle) < force_n {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    };
    // Away from what is between the two feeds and at the ends.
    let own: Vec<usize> = (500..13_500_usize)
        .filter(|k| k.abs_diff(8000) > 50)
        .collect();
    let wanted_um: Vec<f64> = own
        .iter()
        .map(|k| {
            let (t, w) = (*k as f64 * TICK_S, rate(*k as f64 * TICK_S));
            let v = -50.0 * w * turned(t).sin();
            let a = -50.0 * w * w * turned(t).cos();
            let force_mm_s2 = a + coulomb_mm_s2 * v.signum() + viscous_per_s * v;
            -lead_um(force_mm_s2 * 1e-3 * mass_kg)
        })
        .collect();
    let column = |name: &str| {
        let mut given = vec![("width_um", if name == "width_um" { 1.0 } else { 0.0 })];
        given.extend((name != "width_um").then_some((name, 1.0)));
        let response = response_of(&machine, &run, "backlash", "X", &given);
        own.iter()
            .map(|k| response.drive[Axis::X][*k] * 1e3)
            .collect::<Vec<_>>()
    };
    let whole_um = rms(wanted_um.iter().copied());
    let held: Vec<f64> = own
        .iter()
        .map(|k| -f64::from(run.motion.sense[Axis::X][*k]))
        .collect();
    let (_, step) = fit(std::slice::from_ref(&held), &wanted_um);
    let soft = [3, 10, 30, 100].map(|k| column(&format!("free_soft_{k}mm_s2_um")));
    let (_, wide) = fit(&[&[held][..], &soft].concat(), &wanted_um);
    println!("of {whole_um:.2} um a step leaves {step:.2}, with soft corners {wide:.2}");
    assert!(wide < 0.35 * step && step > 0.3 * whole_um, "{step} {wide}");
}

#[test]
fn eq2_reversal_value_of_iso_230_2_is_the_width() {
    let machine = three_axes(CHAIN);
    let run = run(4000, AxisSet::XYZ, |t| {
        [
            if t < 2.0 { 30.0 * t } else { 120.0 - 30.0 * t },
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        ]
    });
    let response = response_of(&machine, &run, "backlash", "X", &[("width_um", 6.0)]);
    for k in 1..20_usize {
        let (up, down) = (100 * k, 4000 - 100 * k);
        assert!(
            (run.motion.position[Axis::X][up] - run.motion.position[Axis::X][down]).abs() < 1e-9
        );
        let reversal = response.drive[Axis::X][up] - response.drive[Axis::X][down];
        assert!((reversal + 0.006).abs() < 1e-12, "{reversal}");
    }
}

#[test]
fn val_the_wider_form_takes_presliding_friction() {
    let machine = three_axes(CHAIN);
    let run = run(6000, AxisSet::XYZ, |t| {
        [3.0 * (2.0 * t).cos(), 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    // A screw that yields by 5 um to a friction which turns over 0.15 mm after a reversal.
    let wanted: Vec<f64> = (0..6000_usize)
        .map(|k| {
            let way = run.motion.since_reversal[Axis::X][k];
            let turned = 1.0 - 2.0 * (-way / 0.15).exp();
            -f64::from(run.motion.sense[Axis::X][k]) * 5.0 * turned
        })
        .collect();
    let column = |name: &str| {
        let mut given = vec![("width_um", 0.0)];
        if name == "width_um" {
            given[0].1 = 1.0;
        } else {
            given.push((name, 1.0));
        }
        let response = response_of(&machine, &run, "backlash", "X", &given);
        response.drive[Axis::X][1600..]
            .iter()
            .map(|x| x * 1e3)
            .collect::<Vec<_>>()
    };
    let names = [
        "width_um",
        "free_0p01mm_um",
        "free_0p03mm_um",
        "free_0p1mm_um",
        "free_0p3mm_um",
        "free_1mm_um",
        "free_3mm_um",
    ];
    let wide: Vec<_> = names.iter().map(|name| column(name)).collect();
    let (_, step_left) = fit(&wide[..1], &wanted[1600..]);
    let (_, wide_left) = fit(&wide, &wanted[1600..]);
    let size = rms(wanted[1600..].iter().copied());
    println!("presliding {size:.2} um: a step leaves {step_left:.2}, hats {wide_left:.2}");
    assert!(wide_left < 0.3 * step_left, "{step_left} {wide_left}");
}
