//! No program and no offset before every axis is homed.

use super::*;

fn homing(homing_s: f64) -> Shop<Bench> {
    let config = Config {
        homing_s,
        ..Config::default()
    };
    Shop::new(&config, &machine(), Bench::open())
}

/// Offsets at the rate of the servo, as a compensation sends them.
fn pass_with_offsets(shop: &mut Shop<Bench>, periods: u32, x_mm: f64) {
    for _ in 0..periods {
        shop.tell(offsets(x_mm));
        shop.pass_ms(1);
    }
}

#[test]
fn offsets_wait_at_zero_until_the_axes_are_homed_and_that_is_told() {
    let mut shop = homing(2.0);
    pass_with_offsets(&mut shop, 1990, 0.004);
    assert!(!shop.cnc.is_homed());
    assert!(
        shop.states()
            .iter()
            .all(|state| state.motor[Axis::X].abs() < 1e-12)
    );
    assert_eq!(shop.diagnostics(), [Diagnostic::CompensationHeldBack]);
    assert_eq!(
        shop.diagnostics()[0].to_string(),
        "compensation is held back at zero until every axis is homed"
    );
    pass_with_offsets(&mut shop, 500, 0.004);
    assert!(shop.cnc.is_homed());
    assert_eq!(
        shop.diagnostics().last(),
        Some(&Diagnostic::CompensationReleased)
    );
    assert!((shop.cnc.offset()[Axis::X] - 0.004).abs() < 1e-12);
}

#[test]
fn a_program_is_refused_until_the_axes_are_homed() {
    let mut shop = homing(1.0);
    let (outcome, message, _) = shop.run("G0 X1\nM2");
    assert_eq!(outcome, Outcome::Refused);
    assert_eq!(message, "the axes are not homed: wait until they are");
    shop.pass_ms(1010);
    assert_eq!(shop.run("G0 X1\nM2").0, Outcome::Done);
    assert!(shop.diagnostics().is_empty(), "nobody sent offsets");
}

#[test]
fn before_a_new_homing_the_offsets_fade_and_rise_again_after_it() {
    let mut shop = homing(0.5);
    pass_with_offsets(&mut shop, 1000, 0.004);
    assert!((shop.cnc.offset()[Axis::X] - 0.004).abs() < 1e-12);
    shop.tell(Input::Home);
    let mut last = 0.004;
    let mut zero_at = None;
    let mut homed_at = None;
    for period in 0..3000_u32 {
        pass_with_offsets(&mut shop, 1, 0.004);
        let now = shop.cnc.offset()[Axis::X];
        // 5 um/s down, 100 um/s up, in periods of 1 ms.
        assert!(last - now <= 5e-6 + 1e-12 && now - last <= 1e-4 + 1e-12);
        if now == 0.0 && zero_at.is_none() {
            zero_at = Some(period);
        }
        if shop.cnc.is_homed() && homed_at.is_none() {
            assert!(now <= 1e-4 + 1e-12, "no offset in the zero");
            homed_at = Some(period);
        }
        last = now;
    }
    let (zero_at, homed_at) = (zero_at.unwrap(), homed_at.unwrap());
    assert!((795..=805).contains(&zero_at), "{zero_at}");
    assert!(homed_at >= zero_at + 500, "{homed_at}");
    assert!((last - 0.004).abs() < 1e-12);
    assert_eq!(
        shop.diagnostics()[2..],
        [
            Diagnostic::CompensationHeldBack,
            Diagnostic::CompensationReleased
        ]
    );
    let mut busy = homing(0.0);
    busy.request("G4 P1\nM2");
    busy.pass_ms(10);
    busy.tell(Input::Home);
    assert_eq!(
        busy.out.last(),
        Some(&Output::Answer(Err("a program is running")))
    );
}
