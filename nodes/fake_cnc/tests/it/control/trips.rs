//! A probe that closes where no touch is under way.

use super::*;

/// Lets the probe close now, and stay so for `periods`.
fn poke(shop: &mut Shop<Bench>, periods: u32) {
    let elapsed_s = shop.cnc.hardware().elapsed_s;
    let edges = [
        (elapsed_s, true),
        (elapsed_s + f64::from(periods) * 1e-3, false),
    ];
    shop.cnc.hardware_mut().edges.extend(edges);
}

fn is_trip(shop: &Shop<Bench>) -> bool {
    matches!(
        shop.diagnostics().last(),
        Some(Diagnostic::ProbeTripped { .. })
    )
}

#[test]
fn a_trip_ends_the_program_in_every_phase_without_a_touch() {
    let phases = [
        ("in a rapid", "G0 X300\nM2", 300, 1),
        ("in a feed", "F600 G1 X20\nM2", 300, 1),
        ("in an arc", "F600 G2 X20 I10 J0\nM2", 300, 1),
        ("in a dwell", "G4 P5\nM2", 300, 1),
        ("at M0", "G0 X1\nM0\nM2", 1000, 2),
        (
            "at rest before a touch",
            "G4 P0.1\nF60 G38.2 Z-5\nM2",
            130,
            2,
        ),
    ];
    for (name, text, after_ms, line) in phases {
        let mut shop = shop(Bench::open());
        shop.request(text);
        shop.pass_ms(after_ms);
        poke(&mut shop, 20);
        let (outcome, message, at) = shop.finish();
        assert_eq!((outcome, at), (Outcome::Fault, line), "{name}: {message}");
        assert!(is_trip(&shop) || shop.diagnostics().len() > 1, "{name}");
        assert!(
            message.contains(&format!("line {line}, at X"))
                && message.contains("move away from the surface"),
            "{name}: {message}"
        );
    }
}

#[test]
fn a_trip_while_a_program_is_held_ends_it() {
    let mut shop = shop(Bench::open());
    shop.request("F600 G1 X50\nM2");
    shop.pass_ms(500);
    shop.tell(Input::Pause);
    shop.pass_ms(500);
    poke(&mut shop, 20);
    assert_eq!(shop.finish().0, Outcome::Fault);
}

#[test]
fn a_probe_that_leans_on_what_it_touched_may_tremble_there_and_open_on_the_way_back() {
    let mut shop = shop(Bench::new(-3.0, 0.001));
    shop.request("F120 G38.2 Z-8\nG4 P0.5\nG0 Z0\nM2");
    shop.pass_ms(1900);
    assert_eq!(shop.triggers().len(), 1);
    for _ in 0..5 {
        shop.cnc.hardware_mut().closed = false;
        poke(&mut shop, 1000);
        shop.pass_ms(20);
        shop.cnc.hardware_mut().edges.clear();
    }
    let (outcome, message, _) = shop.finish();
    assert_eq!((outcome, message), done());
    // An idle control reports nothing.
    shop.pass_ms(10);
    poke(&mut shop, 20);
    shop.pass_ms(100);
    assert!(shop.diagnostics().is_empty());
}

#[test]
fn a_program_that_starts_on_a_surface_may_leave_it() {
    let mut shop = shop(Bench::new(-3.0, 0.001));
    assert_eq!(shop.run("F120 G38.2 Z-8\nM2").0, Outcome::Done);
    assert!(shop.cnc.hardware().closed);
    assert_eq!(shop.run("G4 P0.1\nG0 Z0\nM2").0, Outcome::Done);
    // Back onto it by a rapid is a trip; and from there it may leave again.
    assert_eq!(shop.run("G0 Z-8\nM2").0, Outcome::Fault);
    assert_eq!(shop.run("G0 Z0\nM2").0, Outcome::Done);
}
