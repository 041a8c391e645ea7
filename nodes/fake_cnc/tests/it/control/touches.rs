//! Touches: what is latched, what ends them, what is a fault.

use super::*;

#[test]
fn a_touch_latches_where_the_signal_arrives_and_tells_its_feed() {
    let latency_s = 0.0053;
    let surface = -3.0;
    for feed_mm_min in [60.0, 240.0, 960.0] {
        let mut shop = shop(Bench::new(surface, latency_s));
        let text = format!("(feature: top)\nF{feed_mm_min} G38.2 Z-8\nG0 Z0\nM2");
        let (outcome, message, _) = shop.run(&text);
        assert_eq!((outcome, message), done());
        let [touch] = &shop.triggers()[..] else {
            panic!("one touch");
        };
        let feed_mm_s = feed_mm_min / 60.0;
        assert_eq!((touch.feature_id.as_str(), touch.sequence), ("top", 1));
        assert!((touch.approach + nalgebra::Vector3::z()).norm() < 1e-12);
        assert!(
            (touch.feed_mm_s - feed_mm_s).abs() < 2e-3 * feed_mm_s,
            "{}",
            touch.feed_mm_s
        );
        let expected = surface - feed_mm_s * latency_s;
        assert!(
            (touch.latched[Axis::Z] - expected).abs() < 1e-4,
            "{}",
            touch.latched[Axis::Z]
        );
        // The latch lies between the states of the ticks around it, at its own stamp.
        let states = shop.states();
        let after = states
            .iter()
            .position(|s| s.controller_at >= touch.controller_at)
            .unwrap();
        let [before, after] = [&states[after - 1], &states[after]];
        let share = (touch.controller_at - before.controller_at).as_secs_f64() / 0.001;
        let between =
            before.motor[Axis::Z] + share * (after.motor[Axis::Z] - before.motor[Axis::Z]);
        assert!((between - touch.latched[Axis::Z]).abs() < 1e-6);
        assert_eq!(touch.received_at, after.received_at);
        // It stops as quickly as the axis may, not at the programmed end.
        let lowest = states
            .iter()
            .map(|s| s.commanded[Axis::Z])
            .fold(0.0, f64::min);
        let braking = feed_mm_s * feed_mm_s / (2.0 * 0.75 * 2500.0);
        let period = feed_mm_s * 0.001;
        assert!(
            (expected - braking - period - 0.01..expected + period).contains(&lowest),
            "{lowest} {expected} {braking}"
        );
    }
}

#[test]
fn a_polled_latch_waits_for_the_end_of_the_period() {
    let text = "F600 G38.2 Z-8\nM2";
    let mut machine = machine();
    let mut hardware = Shop::new(&Config::default(), &machine, Bench::new(-3.0, 0.00437));
    hardware.run(text);
    machine.control.latch = machine::file::Latch::Polled;
    let mut polled = Shop::new(&Config::default(), &machine, Bench::new(-3.0, 0.00437));
    polled.run(text);
    let (early, late) = (&hardware.triggers()[0], &polled.triggers()[0]);
    let delay = late.controller_at - early.controller_at;
    assert!(delay.nanos() > 0 && delay.nanos() <= MS, "{delay:?}");
    assert_eq!(
        (late.controller_at.nanos() % MS, late.received_at),
        (0, early.received_at)
    );
    let moved = early.latched[Axis::Z] - late.latched[Axis::Z];
    assert!((moved - 10.0 * delay.as_secs_f64()).abs() < 1e-4, "{moved}");
}

#[test]
fn a_touch_that_never_triggers_ends_the_program_or_goes_on() {
    let mut shop = shop(Bench::open());
    let (outcome, message, line) = shop.run("(feature: hole)\nF600 G38.2 Z-4\nG0 Z10\nM2");
    assert_eq!((outcome, line), (Outcome::ProbeMissed, 2));
    assert_eq!(
        message,
        "line 2: touch of \"hole\" ended without the probe closed"
    );
    assert!((shop.cnc.commanded()[Axis::Z] + 4.0).abs() < 1e-12);
    let (outcome, message, _) = shop.run("F600 G38.3 Z-5\nG0 Z10\nM2");
    assert_eq!((outcome, message), done());
    assert!((shop.cnc.commanded()[Axis::Z] - 10.0).abs() < 1e-12);
    assert!(shop.triggers().is_empty());
}

#[test]
fn a_probe_stuck_closed_ends_the_program_before_the_touch() {
    let mut bench = Bench::open();
    bench.closed = true;
    let mut shop = shop(bench);
    for code in ["G38.2", "G38.3"] {
        let (outcome, message, line) =
            shop.run(&format!("G0 X1\n(feature: top)\nF100 {code} Z-4\nM2"));
        assert_eq!((outcome, line), (Outcome::ProbeStuck, 3));
        assert_eq!(
            message,
            "line 3: the probe is already closed before the touch of \"top\""
        );
        assert!(shop.cnc.commanded()[Axis::Z].abs() < 1e-12);
    }
}

#[test]
fn leaving_a_surface_ends_a_touch_away_from_it() {
    let mut shop = shop(Bench::new(-3.0, 0.001));
    let text = "F600 G38.2 Z-8\nF600 G38.4 Z0\nM2";
    let (outcome, message, _) = shop.run(text);
    assert_eq!((outcome, message), done());
    let touches = shop.triggers();
    assert_eq!(touches.len(), 2);
    // It leaves the surface while still gaining speed, 1 ms before the signal arrives.
    let latched = touches[1].latched[Axis::Z];
    assert!((-2.998..-2.988).contains(&latched), "{latched}");
    assert!((touches[1].approach - nalgebra::Vector3::z()).norm() < 1e-12);
    let (outcome, message, _) = shop.run("G0 Z1\nF60 G38.4 Z5\nM2");
    assert_eq!(outcome, Outcome::ProbeStuck, "{message}");
    assert!(message.contains("already open"), "{message}");
}

#[test]
fn a_probe_that_closes_in_another_motion_is_a_fault_but_retracting_is_not() {
    let mut shop = shop(Bench::new(-3.0, 0.001));
    let (outcome, message, line) = shop.run("F6000\nG1 Z-20\nM2");
    assert_eq!((outcome, line), (Outcome::Fault, 2));
    assert!(
        message.contains("probe closed in a motion that is no touch"),
        "{message}"
    );
    let z = shop.cnc.commanded()[Axis::Z];
    assert!(z < -3.0 && z > -7.0, "{z}");
    assert_eq!(shop.run("G0 Z5\nM2").0, Outcome::Done);
}

#[test]
fn a_name_that_no_message_may_have_is_refused_with_line_length_and_limit() {
    let mut shop = shop(Bench::new(-3.0, 0.001));
    for (key, name) in [
        ("feature", "a".repeat(256)),
        ("feature", "ä".repeat(128)),
        ("feature", "b".repeat(900)),
        ("mount", "c".repeat(256)),
    ] {
        let bytes = name.len();
        let text = format!("G21\n(feature: x)\n({key}: {name})\nF600 G38.2 Z-8\nM2");
        let (outcome, message, line) = shop.run(&text);
        assert_eq!((outcome, line), (Outcome::Refused, 3), "{message}");
        let wanted = format!("the {key} comment has {bytes} bytes, at most 255: shorten it");
        assert!(message.starts_with("line 3, column "), "{message}");
        assert!(message.contains(&wanted), "{message}");
    }
    let longest = "a".repeat(255);
    let (outcome, message, _) = shop.run(&format!("(feature: {longest})\nF600 G38.2 Z-8\nM2"));
    assert_eq!((outcome, message), done());
    assert_eq!(shop.triggers()[0].feature_id, longest);
}

#[test]
fn a_zero_without_anything_mounted_is_said() {
    let mut shop = shop(Bench::open());
    for what in ["grid", "length"] {
        let text = format!("G21 G90\n({what})\n(zero: {what})\n(zero: {what})\nG0 Z1\nM2");
        let (outcome, message, _) = shop.run(&text);
        assert_eq!((outcome, message), done());
    }
    // It stands from the first one on.
    let said = shop.diagnostics();
    assert_eq!(
        said,
        [Diagnostic::NothingToZero {
            line: 3,
            what: "grid"
        }]
    );
}
