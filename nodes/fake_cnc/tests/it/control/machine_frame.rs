//! Programs in machine coordinates: whatever the state, the machine's path is that of a clean control, or the program is
//! refused with the offset; and the state afterwards is the one before.

use super::*;
use fake_cnc::rs274::Registers;
use machine::cycle;

const BENCH: &str = include_str!("../../../../libraries/machine/tests/data/bench.yaml");

/// States that jobs leave, each made by a program; whether a program in machine coordinates can run in it.
const STATES: [(&str, bool); 22] = [
    ("", true),
    ("G10 L2 P1 X10", true),
    ("G10 L2 P1 Z-25.4", true),
    ("G10 L2 P1 R0.5", true),
    ("G10 L2 P1 X1.5 Y-2 Z3 A4 C5 R180", true),
    ("G10 L2 P1 C90", true),
    ("G10 L2 P2 X100|G55", true),
    ("G59.3|G10 L2 P9 X1 R1", true),
    (
        "G10 L2 P1 X1|G10 L2 P2 X1|G10 L2 P3 X1|G10 L2 P4 X1|G10 L2 P5 X1|G10 L2 P6 X1|G10 L2 P7 X1|G10 L2 P8 X1",
        true,
    ),
    (
        "G10 L2 P1 X1|G10 L2 P2 X1|G10 L2 P3 X1|G10 L2 P4 X1|G10 L2 P5 R1|G10 L2 P6 C1|G10 L2 P7 X1|G10 L2 P8 X1|G10 L2 P9 Z1",
        false,
    ),
    ("G92 X3", false),
    ("G92 Y3|G92.2", true),
    ("G92 Y3|G92.1", true),
    ("G52 X2", false),
    ("G52 C2", false),
    ("G52 X0", true),
    ("G43.1 Z50", true),
    ("G43 H2", true),
    ("G43.1 X1 Y2|G10 L2 P1 R-30", true),
    ("G20", true),
    ("G90.1 G61.1", true),
    ("G20 G90.1|G10 L2 P1 X1 R10|G43 H1", true),
];
/// Modes that only an end before M2 leaves, and a touch there that finds nothing.
const HALF_WAY: [(&str, &str); 3] = [
    ("G91", "Z-1"),
    ("G18 G91 G20", "Z-0.1"),
    ("G19 G57", "Z238"),
];

fn machine_of_cycles() -> MachineFile {
    MachineFile::parse(BENCH, "bench.yaml").unwrap()
}

fn config() -> Config {
    Config {
        tool_lengths_mm: vec![80.0, 123.456],
        start_mm: std::collections::BTreeMap::from([(Axis::Z, 240.0)]),
        ..Config::default()
    }
}

/// A generated program of a touching cycle in machine coordinates, and axes that meet what it touches.
struct Prepared {
    text: String,
    bench: Bench,
}

fn cycles() -> Vec<Prepared> {
    let machine = machine_of_cycles();
    let once = std::num::NonZeroU32::MIN;
    let of = |names: &[&str]| {
        names
            .iter()
            .map(|&name| name.to_owned())
            .collect::<Vec<_>>()
    };
    let all = [
        cycle::blocks(&machine, &of(&["block_1"]), once).unwrap(),
        cycle::latency(&machine, "block_1.x", &[60.0, 120.0, 240.0], once).unwrap(),
        cycle::bores(&machine, &of(&["ring"]), 4, once).unwrap(),
        cycle::spheres(&machine, &of(&["ball"]), 5, once).unwrap(),
        cycle::planes(&machine, &of(&["top"]), 4, once).unwrap(),
        cycle::touches(&machine, &of(&["block_2.y"]), once).unwrap(),
    ];
    let prepared = |cycle: &cycle::Cycle| {
        let mut bench = Bench::new(-1e9, 0.004);
        bench.contacts = cycle
            .touches
            .iter()
            .map(|touch| {
                let ball = touch.contact_mm - touch.approach * machine.ball_radius_mm();
                (ball, touch.approach)
            })
            .collect();
        Prepared {
            text: in_machine_coordinates(&cycle.program),
            bench,
        }
    };
    all.iter().map(prepared).collect()
}

fn in_machine_coordinates(text: &str) -> String {
    if text.starts_with("(frame: machine)") {
        return text.to_owned();
    }
    format!("(frame: machine)\n{text}")
}

/// Puts a control into a state without a motion.
fn prepare(bench: Bench, state: &str) -> Shop<Bench> {
    let mut shop = Shop::new(&config(), &machine_of_cycles(), bench);
    let text = format!("{}\nM2", state.replace('|', "\n"));
    assert_eq!(shop.run(&text).0, Outcome::Done, "{state}");
    shop
}

/// How a program ended, where it latched and every commanded position.
type Traced = (Outcome, String, Vec<PerAxis<f64>>, Vec<PerAxis<f64>>);

fn trace(shop: &mut Shop<Bench>, text: &str) -> Traced {
    let begin = shop.out.len();
    let (outcome, message, _) = shop.run(text);
    let (mut latched, mut commanded) = (Vec::new(), Vec::new());
    for output in shop.out.split_off(begin) {
        match output {
            Output::Trigger(trigger) => latched.push(trigger.latched),
            Output::State(state) => commanded.push(state.commanded),
            _ => {}
        }
    }
    (outcome, message, latched, commanded)
}

#[test]
fn in_every_state_a_cycle_takes_the_clean_controls_path_bit_for_bit_or_is_refused() {
    for cycle in &cycles() {
        let clean = trace(&mut prepare(cycle.bench.clone(), ""), &cycle.text);
        assert_eq!(
            (clean.0, clean.1.as_str()),
            (Outcome::Done, ""),
            "{}",
            cycle.text
        );
        assert_eq!(clean.2.len(), cycle.bench.contacts.len());
        for (state, runs) in STATES {
            let mut shop = prepare(cycle.bench.clone(), state);
            let found = *shop.cnc.registers();
            let traced = trace(&mut shop, &cycle.text);
            assert_eq!(*shop.cnc.registers(), found, "{state}");
            if runs {
                assert!(traced == clean, "{state}: {} {}", traced.1, cycle.text);
                continue;
            }
            assert_eq!(traced.0, Outcome::Refused, "{state}: {}", traced.1);
            let place = "line 1, column 1: (frame: machine):";
            assert!(traced.1.starts_with(place), "{}", traced.1);
        }
    }
}

#[test]
fn without_the_comment_the_same_cycles_go_where_the_state_leads() {
    // What the comment is for: the test above would notice a control that ignores the state.
    let cycle = &cycles()[1];
    let clean = trace(&mut prepare(cycle.bench.clone(), ""), &cycle.text);
    let lines: Vec<&str> = cycle.text.lines().collect();
    let users = lines[1..].join("\n");
    for state in ["G10 L2 P1 X0.5", "G10 L2 P1 R0.05", "G92 X0.3", "G52 X0.3"] {
        let traced = trace(&mut prepare(cycle.bench.clone(), state), &users);
        assert!(traced.3 != clean.3, "{state}");
    }
}

/// Commanded positions of a whole run over axes that follow every command.
fn path(found: Registers, text: &str) -> (String, Vec<PerAxis<f64>>, Registers) {
    let machine = machine_of_cycles();
    let mut shop = Shop::new(&config(), &machine, Bench::open());
    let setting = settings_of(&found);
    if !setting.is_empty() {
        shop.run(&setting);
    }
    let found = *shop.cnc.registers();
    let begin = shop.out.len();
    let (outcome, message, _) = shop.run(text);
    let commanded = shop.out[begin..].iter().filter_map(|output| match output {
        Output::State(state) => Some(state.commanded),
        _ => None,
    });
    let commanded: Vec<_> = commanded.collect();
    assert_eq!(*shop.cnc.registers(), found);
    (format!("{outcome:?} {message}"), commanded, found)
}

/// A program without motion that leaves this state of offsets.
fn settings_of(found: &Registers) -> String {
    let system = &found.systems[0];
    if system.is_zero() && found.tool == PerAxis::default() {
        return String::new();
    }
    format!(
        "G10 L2 P1 X{:.9} Y{:.9} Z{:.9} R{:.9}\nG43.1 X{:.9} Z{:.9}\nG20\nM2",
        system.origin[Axis::X],
        system.origin[Axis::Y],
        system.origin[Axis::Z],
        system.rotation_deg,
        found.tool[Axis::X],
        found.tool[Axis::Z],
    )
}

#[test]
fn the_commanded_path_is_bit_for_bit_that_of_a_clean_control() {
    use rand::{Rng, SeedableRng};
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(29);
    let texts = [
        "(frame: machine)\nG0 Z400\nG0 X30 Y-20 A-5\nF3000 G1 X10\nG2 X20 I5 J0\nG91 G1 Z-10\nM2",
        "(frame: machine) G21 G90 G17 G40 G49 G80 G94 G91.1\nG0 Z300\nF600 G38.3 X5\nG0 X0\nM2",
        "(frame: machine)\nG20 G0 Z10\nG21 G18\nF3000 G3 X20 Z254 I10 K0\nM2",
    ];
    for text in texts {
        let (outcome, clean, _) = path(Registers::default(), text);
        assert_eq!(outcome, "Done ");
        for _ in 0..12 {
            let mut found = Registers::default();
            let mut draw = || random.random_range(-100.0..100.0_f64);
            found.systems[0].origin[Axis::X] = draw();
            found.systems[0].origin[Axis::Y] = draw();
            found.systems[0].origin[Axis::Z] = draw();
            found.systems[0].rotation_deg = draw();
            found.tool[Axis::X] = draw();
            found.tool[Axis::Z] = draw();
            let (outcome, commanded, left) = path(found, text);
            assert_eq!(outcome, "Done ");
            assert!(left.modes.is_inch);
            assert!(commanded == clean, "{text}: {found:?}");
        }
    }
}

#[test]
fn modes_that_an_aborted_program_left_are_put_back_at_every_kind_of_end() {
    let begin = "(frame: machine)\nG0 Z240\nG0 X0 Y0\n";
    for (state, touch) in HALF_WAY {
        let mut prepared = prepare(Bench::open(), "");
        let aborted = prepared.run(&format!("{state}\nF600 G38.2 {touch}\nM2"));
        assert_eq!(aborted.0, Outcome::ProbeMissed);
        let found = *prepared.cnc.registers();
        assert_ne!(found, Registers::default());
        let ends = [
            (format!("{begin}G91 G18 G20\nM2"), Outcome::Done),
            (format!("{begin}G91 G0 X5\nG77\nM2"), Outcome::Refused),
            (
                format!("{begin}F600 G38.2 Z235\nG91\nM2"),
                Outcome::ProbeMissed,
            ),
            (format!("{begin}F600 G38.4 Z235\nM2"), Outcome::ProbeStuck),
        ];
        for (text, wanted) in ends {
            let mut shop = prepared.clone();
            let (outcome, message, _) = shop.run(&text);
            assert_eq!(outcome, wanted, "{message}");
            assert_eq!(*shop.cnc.registers(), found, "{state}: {text}");
        }
        let mut shop = prepared.clone();
        shop.request(&format!("{begin}G20 F100 G1 X5\nM2"));
        shop.pass_ms(1500);
        shop.tell(Input::CancelProgram { goal: 7 });
        assert_eq!(shop.finish().0, Outcome::Stopped);
        assert_eq!(*shop.cnc.registers(), found, "{state}: cancelled");
    }
}

#[test]
fn refusals_name_the_offset_and_what_to_do() {
    let mut shop = shop(Bench::open());
    let text = "(frame: machine)\nG0 X1\nM2";
    shop.run("G92 X-3 C2.5\nM2");
    assert_eq!(
        shop.run(text).1,
        "line 1, column 1: (frame: machine): the offset X3 C-2.5 by G92 or G52 is in effect; clear it by G92.1, or by \
         G52 X0 C0"
    );
    shop.run("G92.1\nM2");
    assert_eq!(shop.run(text).0, Outcome::Done);
    let all: String = (1..=9)
        .map(|p| format!("G10 L2 P{p} X{p} R{p}\n"))
        .collect();
    shop.run(&format!("{all}M2"));
    let before = *shop.cnc.registers();
    let (outcome, message, line) = shop.run(text);
    assert_eq!((outcome, line), (Outcome::Refused, 1));
    assert!(
        message.contains("none is overwritten: G54 X1 R1; G55 X2 R2;")
            && message.contains("G59.3 X9 R9; clear one"),
        "{message}"
    );
    assert_eq!(*shop.cnc.registers(), before);
    let wrong = [
        (
            "G0 X1\n(frame: machine)\nM2",
            "line 2, column 1: frame comment",
        ),
        (
            "G21 (frame: machine)\nM2",
            "line 1, column 5: frame comment",
        ),
        ("(frame: work)\nM2", "line 1, column 1: frame comment"),
        ("; frame: machine\nM2", "line 1, column 1: frame comment"),
        (
            "(frame: machine) (frame: machine)\nM2",
            "line 1, column 18: frame comment",
        ),
    ];
    let clean = Bench::open();
    for (text, begins) in wrong {
        let message = super::shop(clean.clone()).run(text).1;
        assert!(message.starts_with(begins), "{message}");
    }
    for word in [
        "G55",
        "G10 L2 P1 X1",
        "G92 X1",
        "G92.3",
        "G52 X1",
        "G43 H0",
        "G43.1 Z1",
    ] {
        let (outcome, message, _) =
            super::shop(clean.clone()).run(&format!("(frame: machine)\n{word}\nM2"));
        assert_eq!(outcome, Outcome::Refused, "{word}");
        assert!(message.contains("changes the coordinates"), "{message}");
    }
}

#[test]
fn a_frame_behind_a_semicolon_is_refused_with_its_place() {
    for (text, place) in [
        (";(frame: machine)\nM2", "line 1, column 1"),
        ("; frame: machine\nM2", "line 1, column 1"),
        ("G21 ; (Frame : machin)\nM2", "line 1, column 5"),
        ("G21\n;; part 7 (frame: machine)\nM2", "line 2, column 1"),
    ] {
        let message = shop(Bench::open()).run(text).1;
        let begin = format!("{place}: frame comment");
        assert!(message.starts_with(&begin), "{message}");
    }
}

#[test]
fn a_program_for_another_machine_file_is_refused_before_anything_moves() {
    let own = machine::program_machine::mark_of(&machine()).unwrap();
    let text = "(frame: machine)\nG0 X1\nM2";
    for (mark, is_own) in [(own, true), (own ^ 1, false), (0, false), (u64::MAX, false)] {
        let mut shop = shop(Bench::open());
        let before = *shop.cnc.commanded();
        let marked = machine::program_machine::marked(text, mark);
        let (outcome, message, _) = shop.run(&marked);
        let expected = if is_own {
            Outcome::Done
        } else {
            Outcome::Refused
        };
        assert_eq!(outcome, expected, "{message}");
        assert_eq!(*shop.cnc.commanded() == before, !is_own);
        let is_said = message.contains("another machine file");
        assert_eq!(is_said, !is_own, "{message}");
    }
}
