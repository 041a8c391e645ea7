use super::*;
use metrology::sample::{CycleKind, TestKind, UpdateReason};
use metrology::{AxisSet, PerAxis};
use nalgebra::Vector3;

mod measuring;

const MACHINE: &str = include_str!("../../../../launch_configs/first_run/machine.yaml");

fn sequencer(steps: Vec<Step>) -> Sequencer {
    let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    let plan = Plan {
        title: "test".to_owned(),
        steps,
    };
    let programs = BTreeMap::from([("part.ngc".to_owned(), "G0 X1\nM2\n".to_owned())]);
    Sequencer::new(Config::default(), machine, Some(plan), programs).unwrap()
}

fn at(seconds_s: f64) -> Stamp<Host> {
    Stamp::default() + Span::from_secs_f64(seconds_s)
}

fn give(sequencer: &mut Sequencer, seconds_s: f64, input: Input) -> Vec<Output> {
    let mut out = Vec::new();
    sequencer.step(at(seconds_s), input, &mut out).unwrap();
    out
}

fn sent(outputs: &[Output]) -> Option<(u64, String)> {
    outputs.iter().find_map(|output| match output {
        Output::SendProgram { id, name, .. } => Some((*id, name.clone())),
        _ => None,
    })
}

fn segments(outputs: &[Output]) -> Vec<(TestKind, bool, bool)> {
    let pick = |output: &Output| match output {
        Output::Segment(segment) => Some((segment.kind, segment.begin, segment.completed)),
        _ => None,
    };
    outputs.iter().filter_map(pick).collect()
}

fn done() -> Option<ProgramEnd> {
    Some(ProgramEnd {
        done: true,
        message: String::new(),
    })
}

/// A touch by its number.
fn trigger(sequence: u32) -> ProbeTrigger {
    ProbeTrigger {
        received_at: at(f64::from(sequence)),
        controller_at: Stamp::from_nanos(i64::from(sequence)),
        feature_id: "block_1.z".to_owned(),
        approach: -Vector3::z(),
        feed_mm_s: 2.0,
        axes: AxisSet::XYZ,
        latched: PerAxis::default(),
        sequence,
    }
}

/// Touches from number 1 on.
fn touch(sequencer: &mut Sequencer, seconds_s: f64, touches: u32) {
    for number in 1..=touches {
        give(sequencer, seconds_s, Input::Touch(trigger(number)));
    }
}

fn produce(minutes: f64) -> Step {
    Step::Produce {
        program: "part.ngc".to_owned(),
        minutes,
        serve_updates: true,
    }
}

#[test]
fn steps_run_one_after_the_other_between_marks() {
    let steps = vec![
        Step::Blocks {
            blocks: vec![],
            cold: true,
        },
        produce(0.5),
    ];
    let mut sequencer = sequencer(steps);
    give(&mut sequencer, 0.0, Input::Tick);
    let started = give(&mut sequencer, 1.0, Input::Tick);
    let (id, _) = sent(&started).unwrap();
    assert_eq!(segments(&started), [(TestKind::Block, true, false)]);
    touch(&mut sequencer, 30.0, 6);
    let next = give(&mut sequencer, 60.0, Input::ProgramEnd { id, end: done() });
    assert_eq!(
        segments(&next),
        [
            (TestKind::Block, false, true),
            (TestKind::Production, true, false)
        ]
    );
    let (id, name) = sent(&next).unwrap();
    assert_eq!(name, "part.ngc");
    let last = give(&mut sequencer, 100.0, Input::ProgramEnd { id, end: done() });
    assert!(last.iter().any(|output| matches!(
        output,
        Output::Status(PlanStatus {
            state: PlanState::Done,
            ..
        })
    )));
}

#[test]
fn production_whose_passes_take_no_time_fails_instead_of_filling_the_bag() {
    for (pass_s, fails) in [(0.0, true), (0.9, true), (1.1, false)] {
        let mut sequencer = sequencer(vec![produce(10.0)]);
        give(&mut sequencer, 0.0, Input::Tick);
        let mut out = give(&mut sequencer, 1.0, Input::Tick);
        for pass in 1..=200 {
            let Some((id, _)) = sent(&out) else { break };
            let at_s = 1.0 + f64::from(pass) * pass_s;
            out = give(&mut sequencer, at_s, Input::ProgramEnd { id, end: done() });
        }
        let failed = out.iter().find_map(|output| match output {
            Output::Status(status) if status.state == PlanState::Failed => Some(&status.message),
            _ => None,
        });
        assert_eq!(failed.is_some(), fails, "{pass_s}: {out:?}");
        if let Some(message) = failed {
            let wanted = "steps[0].program = part.ngc: 100 passes took ";
            assert!(message.starts_with(wanted), "{message}");
            assert!(message.contains("at least 1 s"), "{message}");
        }
    }
}

#[test]
fn an_update_request_is_served_between_two_parts() {
    let mut sequencer = sequencer(vec![produce(10.0)]);
    give(&mut sequencer, 0.0, Input::Tick);
    let (part, _) = sent(&give(&mut sequencer, 1.0, Input::Tick)).unwrap();
    let request = UpdateRequest {
        at: at(2.0),
        reason: UpdateReason::Period,
        elapsed_s: 900.0,
    };
    assert_eq!(
        sent(&give(&mut sequencer, 2.0, Input::UpdateRequest(request))),
        None
    );
    let between = give(
        &mut sequencer,
        3.0,
        Input::ProgramEnd {
            id: part,
            end: done(),
        },
    );
    assert_eq!(
        segments(&between).last(),
        Some(&(TestKind::Block, true, false))
    );
    let (blocks, _) = sent(&between).unwrap();
    touch(&mut sequencer, 3.5, 6);
    let after = give(
        &mut sequencer,
        4.0,
        Input::ProgramEnd {
            id: blocks,
            end: done(),
        },
    );
    assert_eq!(
        segments(&after).last(),
        Some(&(TestKind::Production, true, false))
    );
}

#[test]
fn a_generated_program_names_its_machine_file_and_that_of_an_author_stays_as_it_is() {
    let other = MACHINE.replacen("-180.0, 20.0]", "-180.0, 15.0]", 1);
    let step = |cold| Step::Blocks {
        blocks: vec![],
        cold,
    };
    let run = || Step::Run {
        program: "part.ngc".to_owned(),
    };
    for (text, first, is_marked) in [
        (MACHINE, step(false), true),
        (&other, step(true), true),
        (MACHINE, run(), false),
    ] {
        let machine = MachineFile::parse(text, "machine.yaml").unwrap();
        let own = program_machine::mark_of(&machine).filter(|_| is_marked);
        let plan = Plan {
            title: "test".to_owned(),
            steps: vec![first],
        };
        let programs = BTreeMap::from([("part.ngc".to_owned(), "G0 X1\nM2\n".to_owned())]);
        let config = Config::default();
        let mut sequencer = Sequencer::new(config, machine, Some(plan), programs).unwrap();
        let mut out = give(&mut sequencer, 0.0, Input::Tick);
        out.extend(give(&mut sequencer, 1.0, Input::Tick));
        let text = out.iter().find_map(|output| match output {
            Output::SendProgram { text, .. } => Some(text.as_str()),
            _ => None,
        });
        assert_eq!(program_machine::mark_in(text.unwrap()), own, "{text:?}");
    }
}

#[test]
fn a_program_that_nobody_takes_is_proposed_again_and_fails_in_the_end() {
    let mut sequencer = sequencer(vec![Step::Run {
        program: "part.ngc".to_owned(),
    }]);
    give(&mut sequencer, 0.0, Input::Tick);
    let mut outputs = give(&mut sequencer, 1.0, Input::Tick);
    let attempts = Config::default().attempts;
    for attempt in 0..attempts {
        let (id, _) = sent(&outputs).unwrap();
        let now_s = 2.0 + 2.0 * f64::from(attempt);
        let refused = give(
            &mut sequencer,
            now_s,
            Input::ProgramAnswer {
                id,
                accepted: false,
            },
        );
        if attempt + 1 == attempts {
            outputs = refused;
        } else {
            outputs = give(&mut sequencer, now_s + 1.0, Input::Tick);
        }
    }
    let failed = outputs.iter().any(|output| {
        matches!(output, Output::Status(PlanStatus { state: PlanState::Failed, message, .. })
            if message.contains("30 attempts"))
    });
    assert!(failed, "{outputs:?}");
}

#[test]
fn a_failed_update_cycle_leaves_the_production_going() {
    let mut sequencer = sequencer(vec![produce(10.0)]);
    give(&mut sequencer, 0.0, Input::Tick);
    let (part, _) = sent(&give(&mut sequencer, 1.0, Input::Tick)).unwrap();
    let request = UpdateRequest {
        at: at(2.0),
        reason: UpdateReason::Period,
        elapsed_s: 900.0,
    };
    give(&mut sequencer, 2.0, Input::UpdateRequest(request));
    let (blocks, _) = sent(&give(
        &mut sequencer,
        3.0,
        Input::ProgramEnd {
            id: part,
            end: done(),
        },
    ))
    .unwrap();
    let missed = ProgramEnd {
        done: false,
        message: "line 7: block_2.x: no contact".to_owned(),
    };
    let after = give(
        &mut sequencer,
        4.0,
        Input::ProgramEnd {
            id: blocks,
            end: Some(missed),
        },
    );
    assert!(
        after
            .iter()
            .any(|output| matches!(output, Output::ProgramFailed { .. }))
    );
    assert_eq!(segments(&after)[0], (TestKind::Block, false, false));
    assert_eq!(
        segments(&after).last(),
        Some(&(TestKind::Production, true, false))
    );
}

#[test]
fn a_controller_that_vanishes_ends_the_plan_with_the_reason() {
    let mut sequencer = sequencer(vec![Step::Run {
        program: "part.ngc".to_owned(),
    }]);
    give(&mut sequencer, 0.0, Input::Tick);
    let (id, _) = sent(&give(&mut sequencer, 1.0, Input::Tick)).unwrap();
    let outputs = give(&mut sequencer, 2.0, Input::ProgramEnd { id, end: None });
    assert!(outputs.iter().any(|output| matches!(output,
        Output::Status(PlanStatus { message, .. }) if message.contains("vanished"))));
}

#[test]
fn a_goal_is_run_when_nothing_else_is_and_refused_while_the_plan_runs() {
    let order = CycleOrder {
        kind: CycleKind::Blocks,
        features: vec!["block_1".to_owned()],
        feeds_mm_min: vec![],
        points: 0,
        repeats: 1,
        cold: false,
    };
    let mut busy = sequencer(vec![produce(1.0)]);
    give(&mut busy, 0.0, Input::Tick);
    give(&mut busy, 1.0, Input::Tick);
    let goal = CycleGoal {
        id: 9,
        order: order.clone(),
    };
    let refused = give(&mut busy, 2.0, Input::Cycle(goal.clone()));
    assert!(
        matches!(&refused[0], Output::CycleRejected { id: 9, reason } if reason.contains("busy"))
    );

    let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    let mut idle = Sequencer::new(Config::default(), machine, None, BTreeMap::new()).unwrap();
    let started = give(&mut idle, 0.0, Input::Cycle(goal));
    assert_eq!(started[0], Output::CycleAccepted(9));
    let (program, _) = sent(&started).unwrap();
    let touched = give(&mut idle, 1.0, Input::Touch(trigger(1)));
    assert_eq!(
        touched,
        [Output::CycleProgress {
            id: 9,
            touches: 1,
            planned: 3
        }]
    );
    assert_eq!(
        give(&mut idle, 2.0, Input::CancelCycle(9)),
        [Output::CancelProgram(program)]
    );
    let end = Some(ProgramEnd {
        done: false,
        message: CANCELED.to_owned(),
    });
    let ended = give(&mut idle, 3.0, Input::ProgramEnd { id: program, end });
    assert!(ended.iter().any(|output| matches!(
        output,
        Output::CycleEnded(CycleOutcome {
            canceled: true,
            success: false,
            ..
        })
    )));
}

#[test]
fn a_plan_that_cannot_run_is_refused_before_anything_moves() {
    let machine = || MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    let refuse = |steps| {
        let plan = Plan {
            title: String::new(),
            steps,
        };
        Sequencer::new(Config::default(), machine(), Some(plan), BTreeMap::new())
            .err()
            .unwrap()
            .to_string()
    };
    assert_eq!(refuse(vec![]), "steps: the plan has none");
    let unknown = refuse(vec![Step::Run {
        program: "x.ngc".to_owned(),
    }]);
    assert!(
        unknown.starts_with("steps[0].program = \"x.ngc\""),
        "{unknown}"
    );
    let equal = refuse(vec![Step::Latency {
        feature: "block_1.z".to_owned(),
        feeds_mm_min: vec![100.0, 100.0],
        repeats: 2,
    }]);
    assert!(
        equal.starts_with("steps[0]: feeds[0] and feeds[1] are both 100"),
        "{equal}"
    );
    let zero = refuse(vec![produce(0.0)]);
    assert!(zero.contains("minutes = 0"), "{zero}");
}

#[test]
fn a_wait_lasts_as_long_as_it_should_when_the_clock_is_set_back() {
    let wait = Step::Wait { seconds: 5.0 };
    let mut sequencer = sequencer(vec![wait, produce(1.0)]);
    give(&mut sequencer, 100.0, Input::Tick);
    give(&mut sequencer, 101.0, Input::Tick);
    assert_eq!(sent(&give(&mut sequencer, 41.0, Input::Tick)), None);
    assert_eq!(sent(&give(&mut sequencer, 45.9, Input::Tick)), None);
    assert!(sent(&give(&mut sequencer, 46.0, Input::Tick)).is_some());
}

#[test]
fn touches_count_and_are_awaited_also_when_the_clock_is_set_back() {
    let (mut sequencer, id) = block_touches();
    touch(&mut sequencer, 10.0, 5);
    give(&mut sequencer, 60.0, Input::ProgramEnd { id, end: done() });
    let judged = give(&mut sequencer, 30.0, Input::Touch(trigger(6)));
    assert_eq!(segments(&judged)[0], (TestKind::Block, false, true));
}

#[test]
fn a_wait_lets_time_pass_and_goes_on() {
    let wait = Step::Wait { seconds: 5.0 };
    let mut sequencer = sequencer(vec![wait, produce(1.0)]);
    give(&mut sequencer, 0.0, Input::Tick);
    assert_eq!(sent(&give(&mut sequencer, 1.0, Input::Tick)), None);
    assert_eq!(sent(&give(&mut sequencer, 5.9, Input::Tick)), None);
    assert!(sent(&give(&mut sequencer, 6.0, Input::Tick)).is_some());
}

fn block_touches() -> (Sequencer, u64) {
    let blocks = Step::Blocks {
        blocks: vec![],
        cold: true,
    };
    let mut sequencer = sequencer(vec![blocks, produce(1.0)]);
    give(&mut sequencer, 0.0, Input::Tick);
    let (id, _) = sent(&give(&mut sequencer, 1.0, Input::Tick)).unwrap();
    (sequencer, id)
}

#[test]
fn a_program_that_ran_to_its_end_has_failed_when_touches_were_lost() {
    let (mut sequencer, id) = block_touches();
    touch(&mut sequencer, 10.0, 5);
    let ended = give(&mut sequencer, 60.0, Input::ProgramEnd { id, end: done() });
    assert_eq!(segments(&ended), [], "it waits for stragglers");
    // A computer that stood still for five seconds sends them again.
    assert_eq!(segments(&give(&mut sequencer, 69.9, Input::Tick)), []);
    let judged = give(&mut sequencer, 70.0, Input::Tick);
    assert_eq!(segments(&judged), [(TestKind::Block, false, false)]);
    assert!(judged.iter().any(|output| matches!(output,
        Output::Status(PlanStatus { state: PlanState::Failed, message, .. })
            if message.contains("5 of 6 touches arrived"))));
}

#[test]
fn a_touch_that_comes_after_the_end_still_counts() {
    let (mut sequencer, id) = block_touches();
    touch(&mut sequencer, 10.0, 5);
    give(&mut sequencer, 60.0, Input::ProgramEnd { id, end: done() });
    let late = give(&mut sequencer, 60.2, Input::Touch(trigger(6)));
    assert_eq!(
        segments(&late),
        [
            (TestKind::Block, false, true),
            (TestKind::Production, true, false)
        ]
    );
}

#[test]
fn a_touch_that_is_told_again_does_not_stand_for_one_that_was_lost() {
    let (mut sequencer, id) = block_touches();
    touch(&mut sequencer, 10.0, 5);
    for number in [5, 2] {
        let told = give(&mut sequencer, 11.0, Input::Touch(trigger(number)));
        assert_eq!(told, [Output::ToldBefore { sequence: number }]);
    }
    give(&mut sequencer, 60.0, Input::ProgramEnd { id, end: done() });
    let judged = give(&mut sequencer, 70.0, Input::Tick);
    assert_eq!(segments(&judged), [(TestKind::Block, false, false)]);
}

#[test]
fn numbers_that_are_none_change_nothing() {
    let mut sequencer = sequencer(vec![produce(10.0)]);
    give(&mut sequencer, 0.0, Input::Tick);
    let (id, _) = sent(&give(&mut sequencer, 1.0, Input::Tick)).unwrap();
    for progress in [f64::NAN, f64::INFINITY, -1.0] {
        let told = give(&mut sequencer, 2.0, Input::ProgramProgress { id, progress });
        assert_eq!(told, []);
    }
    let mut senseless = trigger(1);
    (senseless.feed_mm_s, senseless.approach) = (f64::NAN, Vector3::repeat(f64::NAN));
    assert_eq!(give(&mut sequencer, 3.0, Input::Touch(senseless)), []);
    let request = UpdateRequest {
        at: at(3.0),
        reason: UpdateReason::Period,
        elapsed_s: f64::NAN,
    };
    give(&mut sequencer, 3.0, Input::UpdateRequest(request));
    let between = give(&mut sequencer, 4.0, Input::ProgramEnd { id, end: done() });
    let (blocks, _) = sent(&between).unwrap();
    let status = between.iter().find_map(|output| match output {
        Output::Status(status) => Some(status.progress),
        _ => None,
    });
    assert!(status.is_some_and(f64::is_finite), "{status:?}");
    touch(&mut sequencer, 5.0, 7);
    let id = blocks;
    let next = give(&mut sequencer, 9.0, Input::ProgramEnd { id, end: done() });
    assert_eq!(segments(&next)[0], (TestKind::Block, false, true));
}

#[test]
fn a_cycle_of_numbers_that_are_none_is_refused_with_the_number() {
    let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    let mut idle = Sequencer::new(Config::default(), machine, None, BTreeMap::new()).unwrap();
    for feed_mm_min in [f64::NAN, f64::INFINITY, -120.0] {
        let order = CycleOrder {
            kind: CycleKind::Latency,
            features: vec!["block_1.z".to_owned()],
            feeds_mm_min: vec![120.0, feed_mm_min],
            points: 0,
            repeats: 1,
            cold: false,
        };
        let answer = give(&mut idle, 0.0, Input::Cycle(CycleGoal { id: 9, order }));
        let Output::CycleRejected { id: 9, reason } = &answer[0] else {
            panic!("{answer:?}");
        };
        assert!(reason.contains(&feed_mm_min.to_string()), "{reason}");
    }
}

#[test]
fn plans_of_numbers_that_are_none_are_refused() {
    let machine = || MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    for number in [f64::NAN, f64::INFINITY] {
        let wait = Step::Wait { seconds: number };
        let latency = Step::Latency {
            feature: "block_1.z".to_owned(),
            feeds_mm_min: vec![120.0, number],
            repeats: 2,
        };
        for step in [produce(number), wait, latency] {
            let plan = Plan {
                title: String::new(),
                steps: vec![step],
            };
            let programs = BTreeMap::from([("part.ngc".to_owned(), String::new())]);
            let refused = Sequencer::new(Config::default(), machine(), Some(plan), programs);
            let refused = refused.err().unwrap().to_string();
            assert!(refused.contains(&number.to_string()), "{refused}");
        }
    }
}
