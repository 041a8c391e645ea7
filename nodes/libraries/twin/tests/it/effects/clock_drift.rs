//! A clock's drift between two runs of one line.

use metrology::Axis;
use twin::{Channel, History};

use crate::effects::past::{predict, read};
use crate::effects::scene::{bench, fit, rms, run};

/// By how much the readings of a line at 20 mm/s are late that begins at an instant, s.
fn late_s(begins_s: f64, given: &[(&str, f64)]) -> f64 {
    let machine = bench();
    let mut line = run(4000, machine.axis_set(), |t| {
        [20.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    for time in &mut line.motion.time_s {
        *time += begins_s;
    }
    read(&mut line, &Channel::Length(Axis::X));
    let seen = predict(
        &machine,
        &History::default(),
        &line,
        ("clock_drift", "length"),
        given,
    );
    -seen[AT] / 20.0
}

/// Tick of the line that is looked at.
const AT: usize = 2000;

/// Rate of a crystal of the TF20 series, of 1: -0.030e-6 / K2 about 25 degC.
fn rate(degc: f64) -> f64 {
    1.0 - 0.030e-6 * (degc - 25.0).powi(2)
}

#[test]
fn val_clock_drift_of_a_tuning_fork() {
    // The data sheet's example: -12.0 ppm at 45 degC.
    let given = [("drift_ppm", -12.0)];
    for begins_s in [0.0, 3600.0, 28_800.0] {
        let now_s = begins_s + 0.001 * AT as f64;
        let cycles = (now_s * 32_768.0 * rate(45.0)).floor();
        let stamped_late_s = cycles / 32_768.0 - now_s;
        let seen_s = late_s(begins_s, &given);
        println!("after {now_s} s: {stamped_late_s} s, {seen_s} s");
        // A cycle lasts 31 us.
        assert!((seen_s - stamped_late_s).abs() < 31e-6, "{seen_s}");
    }
    // 20 ppm, a watch's tolerance, is 1.73 s a day.
    let day_s = late_s(86_400.0, &[("drift_ppm", 20.0)]);
    assert!((day_s - 1.73).abs() < 5e-3, "{day_s}");
}

#[test]
fn val_clock_drift_of_a_crystal_that_warms() {
    // An instrument that warms by 20 K within half an hour.
    let warmed_degc = |t: f64| 25.0 + 20.0 * (1.0 - (-t / 1800.0).exp());
    let mut stamped_s = 0.0;
    let mut late = vec![];
    for second in 0..3600 {
        let at_s = f64::from(second) + 0.5;
        stamped_s += rate(warmed_degc(at_s)) - 1.0;
        if second % 60 == 59 {
            late.push((at_s + 0.5, stamped_s));
        }
    }
    let column = |given: [(&str, f64); 2]| -> Vec<f64> {
        let at = |(t, _): &(f64, f64)| late_s(*t - 0.001 * AT as f64, &given);
        late.iter().map(at).collect()
    };
    let steady = column([("drift_ppm", 1.0), ("free_ppm_per_h", 0.0)]);
    let growing = column([("drift_ppm", 0.0), ("free_ppm_per_h", 1.0)]);
    let wanted: Vec<f64> = late.iter().map(|(_, late_s)| *late_s).collect();
    let whole = rms(wanted.iter().copied());
    let (_, plain) = fit(std::slice::from_ref(&steady), &wanted);
    let (_, wide) = fit(&[steady, growing], &wanted);
    println!("crystal: {whole:.2e} s, (1) leaves {plain:.2e}, (2) {wide:.2e}");
    assert!(plain > 0.2 * whole && wide < 0.02 * whole, "{plain} {wide}");
}

#[test]
fn eq1_clock_drift_between_two_runs() {
    // 10 ppm of 30 min.
    let given = [("drift_ppm", 10.0)];
    let (first, second) = (late_s(600.0, &given), late_s(2400.0, &given));
    println!("drift: {first} s, then {second} s");
    assert!((second - first - 18e-3).abs() < 1e-9, "{first} {second}");
    assert!((first - 10e-6 * 602.0).abs() < 1e-9, "{first}");
}
