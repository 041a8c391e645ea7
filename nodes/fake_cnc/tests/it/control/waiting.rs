//! Programs that wait, and what lets them go on.

use super::*;
use fake_cnc::rs274::program::Wait;

fn answers(shop: &Shop<Bench>) -> Vec<Result<(), &'static str>> {
    shop.out
        .iter()
        .filter_map(|output| match output {
            Output::Answer(answer) => Some(*answer),
            _ => None,
        })
        .collect()
}

fn is_waiting_at(shop: &Shop<Bench>, line: u32, why: Wait) -> bool {
    shop.diagnostics().last() == Some(&Diagnostic::Waiting { line, why })
}

#[test]
fn m0_and_m60_wait_and_say_so_with_the_line_until_they_are_resumed() {
    for (word, why) in [("M0", Wait::Stop), ("M60", Wait::PalletChange)] {
        let mut shop = shop(Bench::open());
        shop.request(&format!("G0 X5\n{word}\nG0 X6\nM2"));
        shop.pass_ms(2000);
        assert!(is_waiting_at(&shop, 2, why), "{:?}", shop.diagnostics());
        assert_eq!(shop.diagnostics().len(), 1, "told once, at once");
        assert!(!shop.cnc.idle());
        assert!((shop.cnc.commanded()[Axis::X] - 5.0).abs() < 1e-12);
        let last = shop.out.iter().rev().find_map(|output| match output {
            Output::Feedback { state, line, .. } => Some((*state, *line)),
            _ => None,
        });
        assert_eq!(last, Some((ProgramState::Holding, 2)));
        shop.tell(Input::Resume);
        assert_eq!(shop.diagnostics().last(), Some(&Diagnostic::WaitsNoLonger));
        let (outcome, message, _) = shop.finish();
        assert_eq!((outcome, message), done());
        assert!((shop.cnc.commanded()[Axis::X] - 6.0).abs() < 1e-12);
        assert_eq!(answers(&shop), [Ok(())]);
    }
    let text = Diagnostic::Waiting {
        line: 3,
        why: Wait::Stop,
    }
    .to_string();
    assert_eq!(
        text,
        "program waits at line 3 (M0): resume it, or cancel it"
    );
}

#[test]
fn m1_waits_only_where_that_is_chosen() {
    let mut shop = shop(Bench::open());
    assert_eq!(shop.run("M1\nG0 X1\nM2").0, Outcome::Done);
    assert!(shop.diagnostics().is_empty());
    let config = Config {
        optional_stop: true,
        ..Config::default()
    };
    let mut shop = Shop::new(&config, &machine(), Bench::open());
    shop.request("G0 X1 M1\nG0 X2\nM2");
    shop.pass_ms(1000);
    assert!(is_waiting_at(&shop, 1, Wait::OptionalStop));
    shop.tell(Input::Resume);
    assert_eq!(shop.finish().0, Outcome::Done);
}

#[test]
fn a_program_that_waits_can_be_cancelled_and_then_no_longer_waits() {
    let mut shop = shop(Bench::open());
    shop.request("G55 M0\nG0 X6\nM2");
    shop.pass_ms(100);
    shop.tell(Input::CancelProgram { goal: 7 });
    assert_eq!(shop.finish().0, Outcome::Stopped);
    assert_eq!(shop.diagnostics().last(), Some(&Diagnostic::WaitsNoLonger));
    assert_eq!(shop.cnc.registers().system, 1);
    assert_eq!(shop.run("G0 X1\nM2").0, Outcome::Done);
}

#[test]
fn a_feed_hold_rests_on_the_path_and_goes_on_with_what_is_left_of_it() {
    let text = "F3000\nG1 X30 Y10\nG2 X50 Y10 I10 J0\nG1 X60 Z5\nM2";
    let mut straight = shop(Bench::open());
    straight.run(text);
    let ends: Vec<_> = straight
        .states()
        .iter()
        .map(|state| state.commanded.xyz())
        .collect();
    let off_path = |at: &nalgebra::Vector3<f64>| {
        ends.windows(2)
            .map(|pair| {
                let way = pair[1] - pair[0];
                let share = (at - pair[0]).dot(&way) / way.norm_squared().max(1e-30);
                (at - pair[0] - way * share.clamp(0.0, 1.0)).norm()
            })
            .fold(f64::INFINITY, f64::min)
    };
    for hold_ms in [50, 300, 640, 700, 1000, 1400] {
        let mut shop = shop(Bench::open());
        shop.request(text);
        shop.pass_ms(hold_ms);
        shop.tell(Input::Pause);
        shop.pass_ms(400);
        assert!(matches!(
            shop.diagnostics().last(),
            Some(Diagnostic::Waiting { why: Wait::FeedHold, line }) if (2..=4).contains(line)
        ));
        let rest = *shop.cnc.commanded();
        shop.pass_ms(200);
        assert_eq!(*shop.cnc.commanded(), rest);
        shop.tell(Input::Resume);
        shop.pass_ms(60);
        shop.tell(Input::Pause);
        shop.pass_ms(400);
        shop.tell(Input::Resume);
        let (outcome, message, _) = shop.finish();
        assert_eq!((outcome, message), done());
        assert_eq!(
            shop.cnc.commanded().xyz(),
            nalgebra::Vector3::new(60.0, 10.0, 5.0)
        );
        for state in shop.states() {
            let off = off_path(&state.commanded.xyz());
            // A chord of one servo period of the circle lies this far inside it.
            assert!(off < 5e-4, "held after {hold_ms} ms: {off}");
        }
        assert_eq!(answers(&shop), [Ok(()); 4]);
    }
}

#[test]
fn a_dwell_is_held_and_then_lasts_as_long_as_it_should() {
    let mut shop = shop(Bench::open());
    shop.request("G4 P1\nM2");
    shop.pass_ms(400);
    shop.tell(Input::Pause);
    shop.pass_ms(5000);
    assert!(is_waiting_at(&shop, 1, Wait::FeedHold));
    shop.tell(Input::Resume);
    shop.pass_ms(500);
    assert!(!shop.cnc.idle());
    shop.pass_ms(200);
    assert!(shop.cnc.idle());
}

#[test]
fn a_touch_is_finished_before_it_holds() {
    let mut shop = shop(Bench::new(-3.0, 0.001));
    shop.request("F120 G38.2 Z-8\nG0 Z0\nM2");
    shop.pass_ms(500);
    shop.tell(Input::Pause);
    shop.pass_ms(3000);
    assert_eq!(shop.triggers().len(), 1);
    assert!(
        is_waiting_at(&shop, 1, Wait::FeedHold),
        "{:?}",
        shop.diagnostics()
    );
    assert!(shop.cnc.commanded()[Axis::Z] < -2.9, "it has not retracted");
    shop.tell(Input::Resume);
    assert_eq!(shop.finish().0, Outcome::Done);
    assert!((shop.triggers()[0].feed_mm_s - 2.0).abs() < 0.01);
}

#[test]
fn single_block_waits_before_every_block() {
    let config = Config {
        single_block: true,
        ..Config::default()
    };
    let mut shop = Shop::new(&config, &machine(), Bench::open());
    shop.request("G0 X1\nG55\nG0 X2\nG4 P0.1\nM2");
    for (line, x) in [(1, 1.0), (2, 1.0), (3, 2.0), (4, 2.0)] {
        shop.pass_ms(1000);
        assert!(
            is_waiting_at(&shop, line, Wait::SingleBlock),
            "{line}: {:?}",
            shop.diagnostics()
        );
        assert!((shop.cnc.commanded()[Axis::X] - x).abs() < 1e-12);
        shop.tell(Input::Resume);
    }
    assert_eq!(shop.finish().0, Outcome::Done);
}

#[test]
fn a_step_lets_one_block_pass() {
    let mut shop = shop(Bench::open());
    shop.request("M0\nG0 X1\nG0 X2\nG0 X3\nM2");
    shop.pass_ms(100);
    for x in [1.0, 2.0] {
        shop.tell(Input::StepBlock);
        shop.pass_ms(1000);
        assert!((shop.cnc.commanded()[Axis::X] - x).abs() < 1e-12);
        assert!(matches!(
            shop.diagnostics().last(),
            Some(Diagnostic::Waiting {
                why: Wait::SingleBlock,
                ..
            })
        ));
    }
    shop.tell(Input::Resume);
    assert_eq!(shop.finish().0, Outcome::Done);
    // From a hold within a motion a step ends that motion.
    shop.request("G0 X0\nF600 G1 X20\nG1 X40\nM2");
    shop.pass_ms(1000);
    shop.tell(Input::Pause);
    shop.pass_ms(300);
    shop.tell(Input::StepBlock);
    shop.pass_ms(4000);
    assert!((shop.cnc.commanded()[Axis::X] - 20.0).abs() < 1e-12);
    shop.tell(Input::Resume);
    assert_eq!(shop.finish().0, Outcome::Done);
}

#[test]
fn what_cannot_be_held_or_resumed_is_answered_with_the_reason() {
    let mut shop = shop(Bench::open());
    shop.tell(Input::Pause);
    shop.tell(Input::Resume);
    shop.request("F600 G1 X50\nM2");
    shop.pass_ms(500);
    shop.tell(Input::Resume);
    shop.tell(Input::Pause);
    shop.tell(Input::Resume);
    shop.pass_ms(500);
    shop.tell(Input::Pause);
    let answers = answers(&shop);
    assert_eq!(
        answers,
        [
            Err("no program is running"),
            Err("no program is running"),
            Err("the program does not wait"),
            Ok(()),
            Err("the axes are not at rest yet"),
            Err("the program waits already"),
        ]
    );
}
