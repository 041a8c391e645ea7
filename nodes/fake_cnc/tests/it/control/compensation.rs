//! The compensation input: smooth, inside the loop, refused where it is no number.

use super::*;

#[test]
fn compensation_moves_the_motors_smoothly_and_not_the_command() {
    let mut shop = shop(Bench::open());
    shop.pass_ms(100);
    for k in 0..3000_u32 {
        // Smooth, then a jump as from another node's first message.
        let wanted = if k < 1500 { 5e-6 * f64::from(k) } else { 0.05 };
        shop.tell(offsets(wanted));
        shop.pass_ms(1);
    }
    let states = shop.states();
    let greatest_step = states
        .windows(2)
        .map(|w| (w[1].motor[Axis::X] - w[0].motor[Axis::X]).abs())
        .fold(0.0, f64::max);
    // 100 µm/s at most: 0.1 µm in a period, and the loop's own overshoot.
    assert!(greatest_step < 2e-4, "{greatest_step}");
    let last = states.last().unwrap();
    assert!(last.commanded[Axis::X].abs() < 1e-15);
    assert!(
        (last.motor[Axis::X] - 0.05).abs() < 1e-5,
        "{}",
        last.motor[Axis::X]
    );
    // Silence: held for 1 s, then faded at 5 µm/s.
    shop.pass_ms(999);
    assert!((shop.cnc.offset()[Axis::X] - 0.05).abs() < 1e-12);
    shop.pass_ms(1000);
    assert!(
        (shop.cnc.offset()[Axis::X] - 0.045).abs() < 2e-5,
        "{}",
        shop.cnc.offset()[Axis::X]
    );
    assert_eq!(
        shop.diagnostics(),
        [Diagnostic::CompensationStale {
            silent_periods: 1001
        }]
    );
    shop.pass_ms(10_000);
    assert!(shop.cnc.offset()[Axis::X].abs() <= 0.0);
    assert!(shop.states().last().unwrap().motor[Axis::X].abs() < 1e-6);
}

#[test]
fn a_compensation_that_is_not_a_number_is_refused_and_told() {
    let mut shop = shop(Bench::open());
    shop.tell(offsets(0.001));
    shop.pass_ms(50);
    shop.tell(offsets(f64::NAN));
    shop.pass_ms(50);
    assert!((shop.cnc.offset()[Axis::X] - 0.001).abs() < 1e-15);
    let [
        Diagnostic::CompensationNotFinite {
            axis: Axis::X,
            value,
        },
    ] = shop.diagnostics()[..]
    else {
        panic!("{:?}", shop.diagnostics());
    };
    assert!(value.is_nan());
}
