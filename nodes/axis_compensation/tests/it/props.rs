//! Whatever comes in, the offsets that go out never break a limit: on three axes with dual loops, and on five
//! with geometry models.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod bench;
mod events;
mod geometry;
mod messages;
mod watch;

use std::collections::BTreeSet;

use axis_compensation::{Input, Output};
use metrology::drift::Extrapolate;
use metrology::{Stage, Stamp};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{RngSeed, TestRunner};

use bench::{Bench, five_axes, three_axes};
use events::{Event, event, event_of_five_axes};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(20231),
        max_shrink_iters: 2000,
        ..ProptestConfig::default()
    }
}

fn run(bench: &mut Bench, events: &[Event]) -> Result<(), TestCaseError> {
    events.iter().try_for_each(|event| bench.run(event))
}

fn run_without_shutdown(bench: &mut Bench, events: &[Event]) -> Result<(), TestCaseError> {
    let goes_on = |event: &&Event| !matches!(event, Event::Shutdown);
    events
        .iter()
        .filter(goes_on)
        .try_for_each(|event| bench.run(event))?;
    // Clocks may stand at their ends; from here on they go on as usual.
    bench.machine_nanos /= 4;
    bench.host_nanos /= 4;
    Ok(())
}

/// Deactivated it comes to rest at zero, activated it goes on from there.
fn rest_and_go_on(
    mut bench: Bench,
    events: &[Event],
    later: &[Event],
) -> Result<(), TestCaseError> {
    run_without_shutdown(&mut bench, events)?;
    bench.run(&Event::Active(false))?;
    for _ in 0..12_000 {
        bench.run(&Event::at_zero(1_000_000))?;
        if bench.silent_states > 100 {
            break;
        }
    }
    prop_assert!(bench.silent_states > 100, "it is not at rest within 12 s");
    let last = &bench.watch.last;
    prop_assert!(last.0.iter().all(|mm| mm.abs() <= 0.0), "{last:?}");
    bench.run(&Event::Active(true))?;
    run(&mut bench, later)
}

fn fade_out(mut bench: Bench, events: &[Event], by_ticks: bool) -> Result<(), TestCaseError> {
    run_without_shutdown(&mut bench, events)?;
    let mut out = Vec::new();
    let at = Stamp::from_nanos(bench.host_nanos);
    bench.stage.step(at, Input::Shutdown, &mut out).unwrap();
    let mut done = out.contains(&Output::FadedOut);
    for _ in 0..12_000 {
        bench.host_nanos += 1_000_000;
        bench.machine_nanos += 1_000_000;
        out.clear();
        let input = if by_ticks {
            Input::Tick
        } else {
            bench.input(&Event::at_zero(0))
        };
        let at = Stamp::from_nanos(bench.host_nanos);
        bench.stage.step(at, input, &mut out).unwrap();
        done |= out.contains(&Output::FadedOut);
        if done {
            break;
        }
    }
    prop_assert!(done, "no FadedOut within 12 s");
    Ok(())
}

fn policy() -> impl Strategy<Value = Extrapolate> {
    use Extrapolate::{Hold, Linear, Refuse};
    prop_oneof![Just(Linear), Just(Hold), Just(Refuse)]
}

proptest! {
    #![proptest_config(config(1500))]

    #[test]
    fn prop_no_sequence_of_inputs_makes_an_output_step(
        extrapolate in prop_oneof![Just("linear"), Just("hold"), Just("refuse")],
        events in prop::collection::vec(event(), 1..200),
    ) {
        run(&mut three_axes(extrapolate), &events)?;
    }

    #[test]
    fn prop_after_deactivation_every_offset_reaches_zero_and_activation_takes_it_up_without_a_step(
        events in prop::collection::vec(event(), 1..60),
        later in prop::collection::vec(event(), 1..60),
    ) {
        rest_and_go_on(three_axes("linear"), &events, &later)?;
    }

    #[test]
    fn prop_after_shutdown_every_offset_reaches_zero(
        events in prop::collection::vec(event(), 1..100),
        by_ticks in any::<bool>(),
    ) {
        fade_out(three_axes("linear"), &events, by_ticks)?;
    }
}

proptest! {
    #![proptest_config(config(1000))]

    #[test]
    fn prop_no_geometry_model_and_no_pose_of_five_axes_makes_an_output_step(
        extrapolate in policy(),
        events in prop::collection::vec(event_of_five_axes(), 1..200),
    ) {
        run(&mut five_axes(extrapolate), &events)?;
    }

    #[test]
    fn prop_on_five_axes_every_offset_reaches_zero_and_goes_on_without_a_step(
        extrapolate in policy(),
        events in prop::collection::vec(event_of_five_axes(), 1..60),
        later in prop::collection::vec(event_of_five_axes(), 1..60),
    ) {
        rest_and_go_on(five_axes(extrapolate), &events, &later)?;
    }

    #[test]
    fn prop_on_five_axes_every_offset_reaches_zero_after_shutdown(
        extrapolate in policy(),
        events in prop::collection::vec(event_of_five_axes(), 1..100),
        by_ticks in any::<bool>(),
    ) {
        fade_out(five_axes(extrapolate), &events, by_ticks)?;
    }
}

#[test]
fn events_of_five_axes_bring_every_answer_and_every_limit() {
    let strategy = (
        policy(),
        prop::collection::vec(event_of_five_axes(), 1..200),
    );
    let mut runner = TestRunner::new(config(1));
    let mut seen = BTreeSet::new();
    let mut greatest = [0.0_f64; 3];
    for _ in 0..200 {
        let (extrapolate, events) = strategy.new_tree(&mut runner).unwrap().current();
        let mut bench = five_axes(extrapolate);
        run(&mut bench, &events).unwrap();
        seen.append(&mut bench.seen);
        let share = bench.watch.geometric_share;
        let shares = [share.size, share.rate, share.acceleration];
        greatest = [0, 1, 2].map(|place| greatest[place].max(shares[place]));
    }
    let answers = [
        "accepted",
        "confirmed",
        "incomplete",
        "kept back",
        "no geometric part",
        "refused",
        "too large",
    ];
    assert_eq!(seen, answers.into());
    for share in greatest {
        assert!(share > 0.99 && share < 1.0 + 1e-9, "{greatest:?}");
    }
}
