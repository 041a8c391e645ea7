//! Programs that wait on the fake machine: told on the conditions at once, and let go on by the services of the control.

use std::cell::RefCell;
use std::rc::Rc;

use abbe_msgs::action::{RunProgram, RunProgramGoal};
use abbe_msgs::std_srvs::srv::{TriggerRequest, TriggerResponse};
use abbe_msgs::topics;
use abbe_tests::scenario::Scenario;
use metrology::Stage;
use metrology::stamp::{Host, Span, Stamp};
use node_runtime::{ClientSignal, Diagnostic, GoalNews, Harness, Level, Node, Wiring};

use crate::cell;

const START_S: i64 = 1_767_600_000;
const TICK: Span = Span::from_nanos(10_000_000);

fn after(seconds: f64) -> Stamp<Host> {
    Stamp::from_nanos(START_S * 1_000_000_000) + Span::from_secs_f64(seconds)
}

/// Somebody at the control: starts a program at 0.1 s, asks for services at their times.
struct Person {
    program: &'static str,
    plan: Vec<(f64, Wish)>,
    has_begun: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Wish {
    Pause,
    Resume,
    Home,
}

enum Heard {
    Tick,
    Answered(Wish, Option<TriggerResponse>),
    Ended(String),
    Nothing,
}

enum Act {
    Start(RunProgramGoal),
    Ask(Wish),
    Note(String),
}

impl Stage for Person {
    type Input = Heard;
    type Output = Act;
    type Error = std::convert::Infallible;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Heard,
        out: &mut Vec<Act>,
    ) -> Result<(), Self::Error> {
        match input {
            Heard::Tick if !self.has_begun && at >= after(0.1) => {
                self.has_begun = true;
                out.push(Act::Start(RunProgramGoal {
                    program: self.program.to_owned(),
                    name: String::new(),
                }));
            }
            Heard::Tick => {
                let due = |(when_s, _): &mut (f64, Wish)| at >= after(*when_s);
                out.extend(
                    self.plan
                        .extract_if(.., due)
                        .map(|(_, wish)| Act::Ask(wish)),
                );
            }
            Heard::Answered(wish, response) => {
                let said = response.map_or_else(
                    || "nobody".to_owned(),
                    |r| format!("{} {}", r.success, r.message),
                );
                out.push(Act::Note(format!("{wish:?}: {said}")));
            }
            Heard::Ended(how) => out.push(Act::Note(how)),
            Heard::Nothing => {}
        }
        Ok(())
    }
}

fn person(program: &'static str, plan: &[(f64, Wish)]) -> Box<dyn Node> {
    let stage = Person {
        program,
        plan: plan.to_vec(),
        has_begun: false,
    };
    let asks = |wish: Wish| {
        move |act: &Act| match act {
            Act::Ask(asked) if *asked == wish => Some((1, TriggerRequest::default())),
            _ => None,
        }
    };
    let hears = |wish: Wish| move |_, response| Heard::Answered(wish, response);
    Wiring::new("person", Vec::new(), stage)
        .every(TICK, || Heard::Tick)
        .client(
            &topics::PAUSE_PROGRAM,
            asks(Wish::Pause),
            hears(Wish::Pause),
        )
        .client(
            &topics::RESUME_PROGRAM,
            asks(Wish::Resume),
            hears(Wish::Resume),
        )
        .client(&topics::HOME, asks(Wish::Home), hears(Wish::Home))
        .action_client(
            &topics::RUN_PROGRAM,
            |act| match act {
                Act::Start(goal) => Some(ClientSignal::Send(1, goal.clone())),
                _ => None,
            },
            |news: GoalNews<RunProgram>| match news {
                GoalNews::Ended(_, status, result) => {
                    let message = result.map(|result| result.message).unwrap_or_default();
                    Heard::Ended(format!("{status:?} {message}"))
                }
                _ => Heard::Nothing,
            },
        )
        .diagnose(|act| match act {
            Act::Note(text) => Some(Diagnostic::new(Level::Ok, "noted", text.clone())),
            _ => None,
        })
        .node()
}

/// Everything that was said in a run: seconds, condition and text.
fn run(program: &'static str, plan: &[(f64, Wish)], until_s: f64) -> Vec<(f64, String, String)> {
    let scenario = Scenario::copy_of("first_run");
    let cnc = cell::setup(&scenario, "fake_cnc")
        .and_then(|setup| fake_cnc_node::node(&setup))
        .unwrap();
    let mut harness = Harness::compose(vec![cnc, person(program, plan)], after(0.0)).unwrap();
    let said = Rc::new(RefCell::new(Vec::new()));
    let heard = Rc::clone(&said);
    harness.observe_conditions(Box::new(move |at, _, diagnostic: &Diagnostic| {
        heard.borrow_mut().push((
            (at - after(0.0)).as_secs_f64(),
            diagnostic.name.to_string(),
            diagnostic.message.clone(),
        ));
    }));
    harness.run_until(after(until_s));
    let mut said = said.borrow().clone();
    said.retain(|(_, name, _)| ["program_waits", "noted"].contains(&name.as_str()));
    eprintln!("{said:?}");
    said
}

fn texts(said: &[(f64, String, String)]) -> Vec<&str> {
    said.iter().map(|(_, _, text)| text.as_str()).collect()
}

#[test]
fn m0_is_told_with_its_line_within_a_moment_and_resumed_by_the_service() {
    let said = run(
        "G21 G90\nG0 X5\nM0\nG0 X6\nM2\n",
        &[(5.0, Wish::Resume)],
        10.0,
    );
    assert_eq!(
        texts(&said),
        [
            "program waits at line 3 (M0): resume it, or cancel it",
            "the program no longer waits",
            "Resume: true ",
            "Succeeded ",
        ]
    );
    assert!(said[0].0 < 0.5 && said[0].1 == "program_waits", "{said:?}");
}

#[test]
fn a_feed_hold_is_told_and_resumed_and_what_cannot_be_done_is_answered() {
    let plan = [
        (0.05, Wish::Resume),
        (1.0, Wish::Pause),
        (1.5, Wish::Home),
        (3.0, Wish::Resume),
    ];
    let said = run("G21 G90\nF1200 G1 X60\nM2\n", &plan, 10.0);
    assert_eq!(
        texts(&said),
        [
            "Resume: false no program is running",
            "Pause: true ",
            "program waits at line 2 (feed hold): resume it, or cancel it",
            "Home: false a program is running",
            "the program no longer waits",
            "Resume: true ",
            "Succeeded ",
        ]
    );
}
