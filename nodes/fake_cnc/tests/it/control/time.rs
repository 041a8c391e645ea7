//! Clocks, rates, what is told when, and that equal events give equal outputs.

use super::*;

#[test]
fn time_that_goes_back_moves_nothing_and_is_told() {
    let mut shop = shop(Bench::open());
    shop.request("F6000 G1 X100\nM2");
    shop.pass_ms(300);
    let (before, said) = (shop.cnc.hardware().feedback.motor, shop.out.len());
    let right = shop.now;
    shop.now = Stamp::from_nanos(right.nanos() - 40 * MS);
    shop.tell(Input::Tick);
    assert_eq!(shop.cnc.hardware().feedback.motor, before);
    let [Output::Diagnostic(Diagnostic::TimeWentBack { by_s })] = shop.out[said..] else {
        panic!("{:?}", &shop.out[said..]);
    };
    assert!((by_s - 0.04).abs() < 1e-12);
    shop.now = right;
    assert_eq!(shop.finish().0, Outcome::Done);
}

#[test]
fn under_a_clock_that_is_set_back_the_control_goes_on_by_its_own() {
    let mut shop = shop(Bench::open());
    shop.request("F6000 G1 X100\nM2");
    shop.pass_ms(300);
    let (before, said) = (shop.states().len(), shop.out.len());
    shop.now = Stamp::from_nanos(shop.now.nanos() - 3_600_000 * MS);
    shop.tell(Input::Tick);
    let [Output::Diagnostic(Diagnostic::TimeSetBack { by_s })] = shop.out[said..] else {
        panic!("{:?}", &shop.out[said..]);
    };
    assert!((by_s - 3600.0).abs() < 1e-9);
    shop.pass_ms(10);
    let states = shop.states();
    assert_eq!(states.len(), before + 10);
    let (last, next) = (states[before - 1], states[before]);
    assert_eq!((next.controller_at - last.controller_at).nanos(), MS);
    assert!(next.commanded[Axis::X] > last.commanded[Axis::X]);
    assert_eq!(next.received_at.nanos(), shop.now.nanos() - 9 * MS);
    assert_eq!(shop.diagnostics().last(), Some(&Diagnostic::TimePasses));
    assert_eq!(shop.finish().0, Outcome::Done);
}

#[test]
fn a_jump_of_time_is_skipped_and_told() {
    let mut shop = shop(Bench::open());
    shop.pass_ms(10);
    let before = shop.states().len();
    shop.now += Span::from_secs_f64(3600.0);
    shop.tell(Input::Tick);
    assert_eq!(shop.states().len(), before);
    assert!(matches!(
        shop.diagnostics()[..],
        [Diagnostic::TimeJumped { by_s, limit_s }] if by_s > 3599.0 && limit_s < 61.0
    ));
    shop.pass_ms(10);
    assert_eq!(shop.states().len(), before + 10);
    let states = shop.states();
    let gap = states[before].controller_at - states[before - 1].controller_at;
    assert_eq!(gap.nanos(), MS);
}

#[test]
fn states_come_at_full_rate_around_a_touch_and_slowly_otherwise() {
    let config = Config {
        background_rate_hz: 10.0,
        ..Config::default()
    };
    let mut shop = Shop::new(&config, &machine(), Bench::new(-3.0, 0.002));
    let (outcome, ..) = shop.run("G4 P2\nF120 G38.2 Z-8\nG0 Z0\nG4 P2\nF600\n(rate: full)\nG1 X1\n(rate: background)\nX2\nM2");
    assert_eq!(outcome, Outcome::Done);
    let touch = shop.triggers()[0].controller_at;
    let states = shop.states();
    let within = |from_s: f64, to_s: f64| {
        states
            .iter()
            .filter(|s| {
                let after_s = (s.controller_at - touch).as_secs_f64();
                (from_s..to_s).contains(&after_s)
            })
            .count()
    };
    // 1.5 s of way at 2 mm/s, 50 ms before and after.
    assert!(within(-1.5, 0.05) >= 1549, "{}", within(-1.5, 0.05));
    assert!(within(-3.0, -1.6) <= 15 && within(0.2, 2.0) <= 19);
    let first = states
        .iter()
        .position(|s| s.commanded[Axis::Z] < 0.0)
        .unwrap();
    let lead = states[first].controller_at - states[first - 49].controller_at;
    assert_eq!(
        lead.nanos(),
        49 * MS,
        "full rate before the touch begins to move"
    );
    let full = states
        .iter()
        .filter(|s| (0.001..0.999).contains(&s.commanded[Axis::X]))
        .count();
    assert!(full >= 95, "{full}");
    let slow = states.iter().filter(|s| s.commanded[Axis::X] > 1.6).count();
    assert!(slow < 10, "{slow}");
}

#[test]
fn stamps_follow_offset_and_drift_of_the_controller_clock() {
    let config = Config {
        clock_offset_s: -100.0,
        clock_drift_ppm: 200.0,
        ..Config::default()
    };
    let mut shop = Shop::new(&config, &machine(), Bench::open());
    shop.pass_ms(10_000);
    let states = shop.states();
    // 200 ppm fast: 10 002 of its periods fit into 10 s of the host.
    assert_eq!(states.len(), 10_002);
    let last = states.last().unwrap();
    let machine_s = last.controller_at.as_secs_f64() - (1.0 - 100.0);
    let host_s = last.received_at.as_secs_f64() - 1.0;
    assert!(
        (machine_s / host_s - 1.0002).abs() < 1e-9,
        "{machine_s} {host_s}"
    );
    assert!(
        states
            .windows(2)
            .all(|w| w[1].received_at > w[0].received_at)
    );
}

#[test]
fn progress_spindle_dwell_and_temperatures_are_told() {
    let mut shop = shop(Bench::open());
    shop.request("S3000 M3\nG4 P0.5\nS4000\nG4 P20\nM2");
    shop.pass_ms(400);
    assert!((shop.cnc.hardware().spindle_rpm - 3000.0).abs() < 1e-9);
    shop.pass_ms(400);
    assert!((shop.cnc.hardware().spindle_rpm - 4000.0).abs() < 1e-9);
    assert_eq!(shop.finish().0, Outcome::Done);
    shop.pass_ms(10);
    assert!(shop.cnc.hardware().spindle_rpm.abs() < 1e-9);
    let lines: Vec<u32> = shop
        .out
        .iter()
        .filter_map(|o| match o {
            Output::Feedback {
                goal: 7,
                line,
                state: ProgramState::Running,
                ..
            } => Some(*line),
            _ => None,
        })
        .collect();
    assert!((204..=206).contains(&lines.len()), "{}", lines.len());
    assert!(lines.is_sorted() && lines.contains(&2) && lines.contains(&4));
    let fronts: Vec<_> = shop
        .out
        .iter()
        .filter_map(|o| match o {
            Output::Temperature(t) if t.sensor == "spindle_front" => Some(t.at),
            _ => None,
        })
        .collect();
    assert_eq!(fronts.len(), 2);
    assert_eq!((fronts[1] - fronts[0]).nanos(), 10_000 * MS);
}

#[test]
fn snapshot_then_resume_equals_straight_run() {
    let mut straight = shop(Bench::new(-3.0, 0.002));
    straight.request("F6000 G1 X30 Y20\nG2 X40 I5\nF300 G38.2 Z-8\nG0 Z0\nM2");
    straight.tell(offsets(0.004));
    straight.pass_ms(450);
    let mut resumed = straight.clone();
    straight.pass_ms(3000);
    resumed.pass_ms(3000);
    // As text: a scale that is not there is NaN, which equals nothing.
    let said = |shop: &Shop<Bench>| format!("{:?}", shop.out);
    assert!(said(&straight) == said(&resumed));
    assert_eq!(straight.triggers().len(), 1);
    // And time in other portions gives the same.
    let mut coarse = shop(Bench::new(-3.0, 0.002));
    coarse.request("F6000 G1 X30 Y20\nG2 X40 I5\nF300 G38.2 Z-8\nG0 Z0\nM2");
    coarse.tell(offsets(0.004));
    for _ in 0..345 {
        coarse.now += Span::from_nanos(10 * MS);
        coarse.tell(Input::Tick);
    }
    assert!(said(&coarse) == said(&straight));
}
