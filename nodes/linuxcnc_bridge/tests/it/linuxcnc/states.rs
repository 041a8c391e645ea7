//! Measuring on a LinuxCNC in whatever modal state a job has left it: safe or refused, on both kinematics.
//!
//! One start of LinuxCNC each. The ball's distance from the block that it is to touch is computed from what the servo
//! thread recorded: where it is less than the stand-off the axes go at the guarded feed at most, or away.

use std::time::{Duration, Instant};

use linuxcnc_bridge::condition::Condition;
use linuxcnc_bridge::run::Outcome;
use linuxcnc_bridge::waiting::Wait;
use machine::MachineFile;
use machine::cycle::{guarded_feed_mm_min, touches};
use machine::file::AxisEntry;
use metrology::sample::AxisState;
use metrology::{Axis, Severity};
use nalgebra::Vector3;
use test_namespaces::isolated;

use crate::linuxcnc::rig::Rig;

/// Height to which the program retracts here, mm: lower than the travel, which only takes time.
const TOP_MM: f64 = 226.0;
/// Feed of the touch, mm/min: faster than the probe's, which only takes time, too.
const FEED_MM_MIN: f64 = 600.0;
/// Where Z goes to mark a place in what the servo thread records, mm.
const MARK_MM: [f64; 2] = [TOP_MM - 1.0, TOP_MM];
/// Faces of block_2 behind which its body lies, mm, and the ball's radius.
const CORNER_MM: [f64; 3] = [220.0, 180.0, 200.0];
const BALL_MM: f64 = 3.0;

/// What a job has left, block by block; whether a program of the machine's frame can run in it.
const STATES: [(&str, &[&str], bool); 14] = [
    ("nothing", &[], true),
    ("work offset X1.5", &["G10 L2 P1 X1.5"], true),
    ("work offset X-10", &["G10 L2 P1 X-10"], true),
    ("G92 Y3", &["G92 Y3"], false),
    ("G52 X2", &["G52 X2"], false),
    ("rotation 0.5 deg", &["G10 L2 P1 R0.5"], true),
    ("tool length 5 mm", &["G43.1 Z5"], true),
    ("G91", &["G91"], true),
    (
        "G20 with a tool and F",
        &["G20", "G43.1 Z0.25", "F12.5"],
        true,
    ),
    ("G18 in G56", &["G18", "G56", "G10 L2 P3 Y-20"], true),
    ("G93", &["G93"], true),
    ("G95 and G90.1", &["G95", "G90.1"], true),
    ("G64 P0.05", &["G64 P0.05"], true),
    ("every work system in use", &ALL_IN_USE, false),
];
const ALL_IN_USE: [&str; 9] = [
    "G10 L2 P1 X1",
    "G10 L2 P2 X2",
    "G10 L2 P3 X3",
    "G10 L2 P4 X4",
    "G10 L2 P5 X5",
    "G10 L2 P6 X6",
    "G10 L2 P7 R7",
    "G10 L2 P8 Z8",
    "G10 L2 P9 Y9",
];

/// A person at another user interface: LinuxCNC's own for Python, whose status has what `linuxcncrsh` does not tell.
/// (`linuxcncrsh` itself has one connection at a time that may command.)
struct Person;

const PERSON: &str = "
import linuxcnc, sys
c, s = linuxcnc.command(), linuxcnc.stat()
what, blocks = sys.argv[1], sys.argv[2:]
if what == 'resume':
    c.auto(linuxcnc.AUTO_RESUME)
if what == 'mdi':
    c.mode(linuxcnc.MODE_MDI)
    c.wait_complete(5)
    for block in blocks:
        c.mdi(block)
        assert c.wait_complete(5) != linuxcnc.RCS_ERROR, block
    c.mode(linuxcnc.MODE_MANUAL)
    c.wait_complete(5)
s.poll()
# The first is a line; words of the last block name no state.
print([g for g in s.gcodes[1:] if g not in (-1, 40, 100, 520, 530, 920)])
print('F S P Q', s.settings[1:])
print('offsets', s.g5x_index, s.g5x_offset, s.rotation_xy, s.g92_offset, s.tool_offset)
print('mode', s.task_mode)
";

impl Person {
    /// What is there afterwards that a program may change: codes, F and S, the tolerance of G64, offsets, the mode.
    fn does(rig: &Rig, what: &str, blocks: &[&str]) -> String {
        let arguments = [&["-c", PERSON, what], blocks].concat();
        let said = rig
            .controller
            .as_ref()
            .unwrap()
            .command("python3", &arguments)
            .unwrap();
        assert!(said.contains("mode"), "{what} {blocks:?}: {said:?}");
        said
    }
}

/// Takes all offsets and words back to nothing, then sets those of `blocks`.
///
/// What the servo thread records comes late on a busy computer, and would be taken for what follows. So Z is moved down
/// and up first, and everything until then is read and forgotten.
fn set(rig: &mut Rig, blocks: &[&str]) -> String {
    let zero: Vec<String> = (1..=9)
        .map(|p| format!("G10 L2 P{p} X0 Y0 Z0 R0"))
        .collect();
    let [down, up] = MARK_MM.map(|z_mm| format!("G53 G0 Z{z_mm}"));
    let mut all = vec!["G92.1", "G49", "G21 G90 G17 G94 G91.1 G61 G54", &down, &up];
    all.extend(["G80", "F0"]);
    all.extend(zero.iter().map(String::as_str));
    all.extend(blocks);
    rig.states.clear();
    let found = Person::does(rig, "mdi", &all);
    rig.until("mark in the states", Duration::from_secs(30), |rig| {
        let is_at = |state: &AxisState, z_mm: f64| (state.commanded[Axis::Z] - z_mm).abs() < 0.01;
        let [.., before, last] = rig.states.as_slice() else {
            return false;
        };
        let at_rest = before.commanded == last.commanded && is_at(last, MARK_MM[1]);
        at_rest && rig.states.iter().any(|state| is_at(state, MARK_MM[0]))
    });
    rig.states.clear();
    rig.triggers.clear();
    rig.conditions.clear();
    found
}

/// Least distance of the ball's centre to the block, whose body fills the octant behind its faces, mm.
fn distance_mm(ball: &Vector3<f64>) -> f64 {
    let outside = ball - Vector3::from(CORNER_MM);
    outside.map(|d| d.max(0.0)).norm() + outside.max().min(0.0)
}

/// Near the block nothing goes towards it faster than the guarded feed.
fn check_ball(rig: &Rig, name: &str) {
    let guarded_mm_s = guarded_feed_mm_min(&rig.machine).unwrap() / 60.0;
    let near_mm = BALL_MM + rig.machine.probe.standoff_mm - 0.1;
    for pair in rig.states.windows(2) {
        let (before, now) = (pair[0].motor.xyz(), pair[1].motor.xyz());
        let elapsed_s = (pair[1].controller_at - pair[0].controller_at).as_secs_f64();
        let (was_mm, is_mm) = (distance_mm(&before), distance_mm(&now));
        let closing = was_mm - is_mm > 1e-3;
        if is_mm < near_mm && closing {
            let speed_mm_s = (now - before).norm() / elapsed_s;
            assert!(
                speed_mm_s < 1.02 * guarded_mm_s,
                "{name}: {speed_mm_s} mm/s at {now}"
            );
        }
    }
}

fn low_machine(machine: &MachineFile) -> MachineFile {
    let mut low = machine.clone();
    if let Some(AxisEntry::Linear(z)) = low.axes.get_mut(&Axis::Z) {
        z.travel_mm[1] = TOP_MM;
    }
    low.probe.feed_mm_min = FEED_MM_MIN;
    low
}

fn measure_in(rig: &mut Rig, program: &str, (name, blocks, runs): (&str, &[&str], bool)) {
    let found = set(rig, blocks);
    let began = Instant::now();
    let ending = rig.run(program);
    println!(
        "{name}: {:?} {} in {:.1} s",
        ending.outcome,
        ending.message,
        began.elapsed().as_secs_f64()
    );
    check_ball(rig, name);
    let left = Person::does(rig, "look", &[]);
    assert_eq!(left, found, "{name}");
    assert!(
        !rig.conditions
            .iter()
            .any(|condition| condition.name() == "modal_state"),
        "{name}"
    );
    if runs {
        assert_eq!(
            (ending.outcome, ending.message.as_str()),
            (Outcome::Done, ""),
            "{name}"
        );
        // The face is met where it is, 4 to 5 ms late at 10 mm/s.
        let [trigger] = rig.triggers.as_slice() else {
            panic!("{name}: {} touches", rig.triggers.len())
        };
        let depth_mm = CORNER_MM[0] + BALL_MM - trigger.latched[Axis::X];
        assert!((0.0..0.06).contains(&depth_mm), "{name}: {depth_mm} mm");
    } else {
        assert_eq!(ending.outcome, Outcome::Refused, "{name}");
        assert!(
            ending.message.starts_with("machine coordinates: "),
            "{}",
            ending.message
        );
        let moved = rig
            .states
            .windows(2)
            .any(|pair| pair[0].commanded.xyz() != pair[1].commanded.xyz());
        assert!(!moved, "{name}: the machine moved");
    }
}

/// A touch on the way, at the guarded feed and in no probing move: stopped within the overtravel, and said.
fn touch_on_the_way(rig: &mut Rig) {
    set(rig, &[]);
    let feed_mm_min = guarded_feed_mm_min(&rig.machine).unwrap();
    let ending = rig.run(&format!(
        "(frame: machine)\nG21 G90\nG0 Z225\nG0 X240 Y174\nG1 Z194 F{feed_mm_min}\nG1 X200 F{feed_mm_min}\nM2\n"
    ));
    assert_eq!(ending.outcome, Outcome::Fault, "{ending:?}");
    assert!(
        ending.message.to_lowercase().contains("probe"),
        "{ending:?}"
    );
    let tripped = rig
        .conditions
        .iter()
        .find(|condition| condition.name() == "probe_tripped");
    let told = tripped.expect("a touch on the way is told").to_string();
    assert!(
        told.starts_with("line 6: ") && told.contains("X 22"),
        "{told}"
    );
    let least_mm = { rig.states.iter() }
        .map(|state| state.motor[Axis::X])
        .fold(f64::INFINITY, f64::min);
    let overrun_mm = CORNER_MM[0] + BALL_MM - least_mm;
    println!("{overrun_mm:.3} mm behind the surface at {feed_mm_min} mm/min");
    assert!(
        (0.0..rig.machine.probe.overtravel_mm).contains(&overrun_mm),
        "{overrun_mm}"
    );
    // By hand, away from it.
    assert_eq!(
        rig.run("G21 G90\nG1 X240 F600\nG0 Z225\nM2\n").outcome,
        Outcome::Done
    );
}

fn waits_at_m0(rig: &mut Rig) {
    rig.conditions.clear();
    let goal = rig.begin("G21 G90\nG0 X238\nM0\nG0 X239\nM2\n");
    let waits = Condition::ProgramWaits(Wait::Stopped {
        line: 3,
        word: "M0",
    });
    rig.until("word of the pause", Duration::from_secs(3), |rig| {
        rig.conditions.contains(&waits)
    });
    Person::does(rig, "resume", &[]);
    assert_eq!(rig.finish(goal).outcome, Outcome::Done);
    assert!(rig.conditions.contains(&Condition::ProgramGoesOn));
}

fn on(scenario: &str) {
    let Some(mut rig) = Rig::new(scenario) else {
        return;
    };
    let errors = { rig.conditions.iter() }.filter(|c| c.severity() == Severity::Error);
    assert_eq!(
        errors.collect::<Vec<_>>(),
        Vec::<&Condition>::new(),
        "a normal start"
    );
    let began = Instant::now();
    let cycle = touches(
        &low_machine(&rig.machine),
        &["block_2.x".to_owned()],
        std::num::NonZeroU32::MIN,
    );
    let program = cycle.unwrap().program;
    for state in STATES {
        measure_in(&mut rig, &program, state);
    }
    touch_on_the_way(&mut rig);
    waits_at_m0(&mut rig);
    println!("{scenario}: {:.0} s", began.elapsed().as_secs_f64());
}

#[test]
fn val_linuxcnc_no_modal_state_shifts_a_measurement_with_three_axes() {
    isolated(|| {
        on("linuxcnc_latency");
    });
}

#[test]
fn val_linuxcnc_no_modal_state_shifts_a_measurement_with_five_axes() {
    isolated(|| {
        on("linuxcnc_block_cycle");
    });
}
