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
    let told = shop.diagnostics();
    let told: Vec<String> = told.iter().map(ToString::to_string).collect();
    assert_eq!(
        told,
        [
            "compensation of axis X is NaN: must be a number: refused; stop the node that publishes it"
        ]
    );
}

/// Spoils a message that comes at this time.
type Spoil = fn(&mut AxisCompensation, Stamp<metrology::Host>);

#[test]
fn offsets_that_contradict_themselves_or_are_not_of_now_are_refused_then_fade() {
    let bad: [(Spoil, &str); 6] = [
        (
            |sent, _| sent.state[Axis::X] = CompensationState::Off,
            "STATE_OFF",
        ),
        (
            |sent, _| sent.pulses[Axis::X] = 4_900,
            "pulses and remainder",
        ),
        (|sent, _| sent.remainder[Axis::Z] = -0.01, "axis Z"),
        (
            |sent, now| sent.at = now - Span::from_secs_f64(3e7),
            "30000000 s ago",
        ),
        (
            |sent, now| sent.at = now - Span::from_secs_f64(1.1),
            "1.1 s ago",
        ),
        (
            |sent, now| sent.at = now + Span::from_secs_f64(3e8),
            "in the future",
        ),
    ];
    for (spoil, word) in bad {
        let mut shop = shop(Bench::open());
        two_publish(&mut shop, 1, [Some(0.001), None]);
        for _ in 0..100 {
            let Input::Compensation(mut sent) = offsets(0.4) else {
                unreachable!()
            };
            sent.at = shop.now;
            spoil(&mut sent, shop.now);
            shop.tell(Input::Compensation(sent));
            shop.pass_ms(20);
            assert!(shop.cnc.offset()[Axis::X] <= 0.001 + 1e-12, "{word}");
        }
        assert!(shop.cnc.offset()[Axis::X].abs() <= 0.0, "{word}: faded");
        let told = shop.diagnostics();
        let is_of_input = |told: &&Diagnostic| told.name() == "compensation_input";
        let refused = told.iter().filter(is_of_input);
        let refused = refused.filter(|told| told.to_string().contains(word));
        assert_eq!(refused.count(), 100, "{word}");
        let last = |shop: &Shop<Bench>| shop.diagnostics().pop();
        shop.tell(offsets(0.001));
        assert_eq!(last(&shop), Some(Diagnostic::CompensationFollowed));
    }
}

const AUTHORS: [metrology::Author; 2] = [metrology::Author([1; 16]), metrology::Author([2; 16])];

/// Offsets of each author, at most `seconds_s` long.
fn two_publish(shop: &mut Shop<Bench>, seconds_s: u32, wanted_mm: [Option<f64>; 2]) {
    for _ in 0..seconds_s * 50 {
        for (author, wanted_mm) in AUTHORS.iter().zip(wanted_mm) {
            if let Some(wanted_mm) = wanted_mm {
                shop.cnc.hears(shop.now, *author);
                shop.tell(offsets(wanted_mm));
            }
        }
        shop.pass_ms(20);
    }
}

fn publishers(shop: &Shop<Bench>) -> Vec<String> {
    let of_them = { shop.diagnostics().into_iter() }
        .filter(|diagnostic| diagnostic.name() == "compensation_publishers");
    of_them.map(|diagnostic| diagnostic.to_string()).collect()
}

#[test]
fn offsets_of_two_publishers_fade_and_one_alone_is_followed_again() {
    for other_mm in [0.03, -0.03, 0.0, 0.49, f64::NAN] {
        let mut shop = shop(Bench::open());
        two_publish(&mut shop, 1, [Some(0.02), None]);
        assert!((shop.cnc.offset()[Axis::X] - 0.02).abs() < 1e-12);
        let before = shop.states().len();
        two_publish(&mut shop, 6, [Some(0.02), Some(other_mm)]);
        assert!(shop.cnc.offset()[Axis::X].abs() <= 0.0, "{other_mm}");
        // Towards zero alone, whatever the other one wants.
        let motor = |state: &AxisState| state.motor[Axis::X];
        let states = shop.states();
        let after = || states[before..].iter().map(motor);
        assert!(after().all(|x| (-1e-4..0.0202).contains(&x)), "{other_mm}");
        let told = publishers(&shop);
        let [told] = &told[..] else {
            panic!("{told:?}")
        };
        for author in AUTHORS {
            assert!(told.contains(&author.to_string()), "{told}");
        }
        two_publish(&mut shop, 3, [Some(0.02), None]);
        assert!((shop.cnc.offset()[Axis::X] - 0.02).abs() < 1e-12);
        assert_eq!(publishers(&shop).len(), 2);
    }
}

#[test]
fn who_takes_over_is_followed_without_a_condition() {
    for silent_ms in [0, 300, 900] {
        let mut shop = shop(Bench::open());
        two_publish(&mut shop, 1, [Some(0.02), None]);
        shop.pass_ms(silent_ms);
        two_publish(&mut shop, 2, [None, Some(0.01)]);
        assert!((shop.cnc.offset()[Axis::X] - 0.01).abs() < 1e-12);
        let told = shop.diagnostics();
        assert!(told.is_empty(), "{silent_ms} ms: {told:?}");
    }
}

#[test]
fn what_touches_is_refused_or_stopped_while_two_publish() {
    let touching = "G0 X5\nF60 G38.2 Z-8\nM2";
    let moving = "F600 G1 X50\nG1 X0\nM2";
    let mut shop = shop(Bench::new(-3.0, 0.001));
    two_publish(&mut shop, 1, [Some(0.02), Some(-0.02)]);
    let (outcome, message, line) = shop.run(touching);
    assert_eq!((outcome, line), (Outcome::Refused, 2), "{message}");
    assert!(message.contains("two publishers"), "{message}");
    shop.request(moving);
    two_publish(&mut shop, 5, [Some(0.02), Some(-0.02)]);
    let (outcome, message, _) = shop.finish();
    assert_eq!((outcome, message), done());
    two_publish(&mut shop, 3, [None, Some(-0.02)]);
    shop.request(touching);
    two_publish(&mut shop, 1, [None, Some(-0.02)]);
    assert!(!shop.cnc.idle());
    two_publish(&mut shop, 1, [Some(0.02), Some(-0.02)]);
    let ending = { shop.out.iter().rev() }.find_map(|output| match output {
        Output::Finished {
            outcome, message, ..
        } => Some((*outcome, message.clone())),
        _ => None,
    });
    let (outcome, message) = ending.unwrap();
    assert_eq!(outcome, Outcome::Fault, "{message}");
    assert!(message.contains("two publishers"), "{message}");
    assert!(shop.triggers().is_empty());
    two_publish(&mut shop, 3, [None, Some(-0.02)]);
    let (outcome, message, _) = shop.run(touching);
    assert_eq!((outcome, message), done());
}
