//! Programs: what is accepted, what is refused, and what they mean, against LinuxCNC's interpreter.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use fake_cnc::ProgramError;
use fake_cnc::config::Settings;
use fake_cnc::path::target;
use fake_cnc::rs274::program::{Action, Arc, Feed, Motion, Program};
use fake_cnc::rs274::{Envelope, read, read_line};
use machine::cycle;
use metrology::{Axis, AxisSet, PerAxis};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

const BENCH: &str = include_str!("../../../libraries/machine/tests/data/bench.yaml");
const PRODUCTION: &str = include_str!("../../../../launch_configs/first_run/production.ngc");
const VERIFY: &str = include_str!("../../../../launch_configs/first_run/verify.ngc");
const BLOCKS: &str = include_str!("../data/linuxcnc_blocks.tsv");

/// What this control refuses and LinuxCNC accepts: outside the subset, or ambiguous.
const NARROWER: [&str; 10] = [
    "two signs",
    "probe rotary",
    "probe xyz rotary",
    "after m2",
    "block delete",
    "percent",
    "expression",
    "parameter",
    "m30",
    "t word",
];

fn envelope() -> Envelope {
    Envelope {
        axes: [Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::C]
            .into_iter()
            .collect(),
        travel: PerAxis::from_fn(|_| [-2000.0, 2000.0]),
        speed: PerAxis::from_fn(|_| f64::INFINITY),
        spindle_limit_rpm: Some(12_000.0),
        tool_lengths_mm: Vec::new(),
    }
}

fn check(text: &str) -> Result<Program, ProgramError> {
    read(text, &envelope(), &PerAxis::default())
}

fn refusal(text: &str) -> String {
    check(text).unwrap_err().to_string()
}

/// Compares a program with the calls that LinuxCNC's interpreter made for it.
struct Canon {
    at: PerAxis<f64>,
    mm_per_unit: f64,
    rate: f64,
    rate_mm_per_unit: f64,
}

impl Canon {
    fn close(&self, name: &str, axis: Axis, ours: f64, theirs: f64) {
        let ours = if axis.is_linear() {
            ours / self.mm_per_unit
        } else {
            ours.to_degrees()
        };
        assert!(
            (ours - theirs).abs() < 1e-4,
            "{name}: {axis} {ours} {theirs}"
        );
    }

    fn feed(&self, name: &str, feed: Feed) {
        let Feed::Rate {
            linear_mm_s,
            rotary_rad_s,
        } = feed
        else {
            panic!("{name}: rapid instead of feed");
        };
        let per_min = linear_mm_s * 60.0 / self.rate_mm_per_unit;
        assert!((per_min - self.rate).abs() < 1e-9, "{name}: {per_min}");
        let deg_per_min = rotary_rad_s.to_degrees() * 60.0;
        assert!(
            (deg_per_min - self.rate).abs() < 1e-9,
            "{name}: {deg_per_min}"
        );
    }

    fn line(&mut self, name: &str, motion: &Motion, numbers: &[f64]) {
        assert_eq!(motion.arc, None, "{name}");
        let end = target(motion, &self.at);
        for (axis, theirs) in Axis::ALL.into_iter().zip(numbers) {
            self.close(name, axis, end[axis], *theirs);
        }
        self.at = end;
    }

    fn arc(&mut self, name: &str, motion: &Motion, numbers: &[f64]) {
        let arc: Arc = motion.arc.unwrap();
        let end = target(motion, &self.at);
        let [first, second, normal] = arc.plane.axes();
        self.close(name, first, end[first], numbers[0]);
        self.close(name, second, end[second], numbers[1]);
        let centre = arc.centre_from_start_mm;
        self.close(name, first, self.at[first] + centre[0], numbers[2]);
        self.close(name, second, self.at[second] + centre[1], numbers[3]);
        let turns = f64::from(arc.turns) * if arc.clockwise { -1.0 } else { 1.0 };
        assert!((turns - numbers[4]).abs() < 1e-9, "{name}: {turns}");
        self.close(name, normal, end[normal], numbers[5]);
        for (axis, theirs) in Axis::ROTARY.into_iter().zip(&numbers[6..]) {
            self.close(name, axis, end[axis], *theirs);
        }
        self.at = end;
    }

    fn call(&mut self, name: &str, call: &str, action: &mut dyn FnMut() -> Action) {
        let (kind, rest) = call.split_once(' ').unwrap_or((call, ""));
        let numbers: Vec<f64> = rest
            .split_whitespace()
            .map(|n| n.parse().unwrap())
            .collect();
        match kind {
            "" => {}
            "inch" => self.mm_per_unit = 25.4,
            "mm" => self.mm_per_unit = 1.0,
            "rate" => {
                self.rate = numbers[0];
                self.rate_mm_per_unit = self.mm_per_unit;
            }
            "dwell" => {
                let Action::Dwell(time_s) = action() else {
                    panic!("{name}: no dwell");
                };
                assert!((time_s - numbers[0]).abs() < 1e-9, "{name}");
            }
            "touch" => {
                let Action::Touch(motion, _) = action() else {
                    panic!("{name}: no touch");
                };
                self.feed(name, motion.feed);
                let before = self.at;
                self.line(name, &motion, &numbers);
                // The stand-alone interpreter lets every touch succeed 0.01 inch early.
                let way = self.at.xyz() - before.xyz();
                let stop = self.at.xyz() - way.normalize() * 0.254;
                self.at.0[..3].copy_from_slice(stop.as_slice());
            }
            _ => {
                let Action::Move(motion) = action() else {
                    panic!("{name}: no motion");
                };
                match kind {
                    "rapid" => assert_eq!(motion.feed, Feed::Rapid, "{name}"),
                    _ => self.feed(name, motion.feed),
                }
                match kind {
                    "arc" => self.arc(name, &motion, &numbers),
                    _ => self.line(name, &motion, &numbers),
                }
            }
        }
    }
}

fn compare(name: &str, program: &Program, calls: &str) {
    let mut steps = program
        .steps
        .iter()
        .map(|step| step.action)
        .filter(|action| !matches!(action, Action::Spindle(_) | Action::Set(_) | Action::End));
    let mut canon = Canon {
        at: PerAxis::default(),
        mm_per_unit: 1.0,
        rate: 0.0,
        rate_mm_per_unit: 1.0,
    };
    for call in calls.split("; ") {
        canon.call(name, call, &mut || steps.next().unwrap());
    }
    assert_eq!(steps.next(), None, "{name}: more than LinuxCNC does");
}

#[test]
fn val_linuxcnc_accepts_and_refuses_the_same_blocks() {
    let mut compared = 0;
    let mut narrower = 0;
    for row in BLOCKS.lines().filter(|row| !row.starts_with('#')) {
        let columns: Vec<&str> = row.split('\t').collect();
        let [name, text, verdict, rest] = columns[..] else {
            panic!("{row}");
        };
        let ours = check(&text.replace('|', "\n"));
        match (verdict, &ours) {
            ("accepts", Ok(program)) => compare(name, program, rest),
            ("refuses", Err(_)) => {}
            ("accepts", Err(error)) => {
                assert!(
                    NARROWER.contains(&name),
                    "{name}: {error}, LinuxCNC: {rest}"
                );
                narrower += 1;
            }
            _ => panic!("{name}: accepted, LinuxCNC: {rest}"),
        }
        compared += 1;
    }
    assert!(compared >= 140, "{compared}");
    assert_eq!(narrower, NARROWER.len());
}

#[test]
fn refusals_name_line_column_word_value_and_limit() {
    let cases = [
        (
            "G21\n  G0 X1 D5\nM2",
            "line 2, column 9: word D5 is not known to this control",
        ),
        ("G0 B5\nM2", "line 1, column 4: the machine has no axis B"),
        (
            "G1 X5 F0\nM2",
            "line 1, column 1: G1 needs a feed, F is 0: must be above 0",
        ),
        (
            "F10 G38.2 Z-1\nF0\nG38.2 Z-2\nM2",
            "line 3, column 1: G38.2 needs a feed, F is 0: must be above 0",
        ),
        (
            "G0 X1 X2\nM2",
            "line 1, column 7: word X2 is given twice in one block",
        ),
        (
            "G0 G1 X2\nM2",
            "line 1, column 4: G1 and G0 exclude each other in one block",
        ),
        (
            "G0 X3000\nM2",
            "line 1, column 4: axis X would go to 3000 mm, limit 2000 mm",
        ),
        (
            "G20 G0 Y-100\nM2",
            "line 1, column 8: axis Y would go to -2540 mm, limit -2000 mm",
        ),
        ("G0 X1", "line 1: program ends without M2"),
        (
            "F10 G38.2 A5\nM2",
            "line 1, column 5: touch moves axis A, only X Y Z have a direction of approach",
        ),
        (
            "F10 G38.2 X0\nM2",
            "line 1, column 5: touch ends where it starts",
        ),
        (
            "M2\nG0 X1",
            "line 2, column 1: word G0 follows M2, nothing may",
        ),
        (
            "(rate: fast)\nM2",
            "line 1, column 1: rate comment \"rate: fast\": must be full or background",
        ),
        (
            "G999999999\nM2",
            "line 1, column 1: word G999999999 is not known to this control",
        ),
    ];
    for (text, message) in cases {
        assert_eq!(refusal(text), message);
    }
}

#[test]
fn arcs_are_checked_where_they_reach_farthest() {
    // Ends inside, but bulges to X 2001 on the way.
    assert_eq!(
        refusal("G0 X1991 Y-10\nF100 G3 X1991 Y10 I0 J10\nM2"),
        "line 2, column 6: axis X would go to 2001 mm, limit 2000 mm"
    );
    assert!(check("G0 X1991 Y-10\nF100 G2 X1991 Y10 I0 J10\nM2").is_ok());
}

#[test]
fn rotary_limits_are_told_in_degrees() {
    let mut narrow = envelope();
    narrow.travel[Axis::A] = [-120.0_f64, 30.0].map(f64::to_radians);
    let error = read("G0 A31\nM2", &narrow, &PerAxis::default()).unwrap_err();
    let ProgramError::Travel {
        axis,
        value,
        limit,
        unit,
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert_eq!((axis, unit), (Axis::A, "deg"));
    assert!((value - 31.0).abs() < 1e-9 && (limit - 30.0).abs() < 1e-9);
}

#[test]
fn positions_after_a_touch_are_checked_for_every_place_it_may_end() {
    // The touch may end anywhere from X0 to X1990; 20 more is inside only for most of them.
    let text = "F100 G38.3 X1990\nG91 G0 X20\nM2";
    assert_eq!(
        refusal(text),
        "line 2, column 8: axis X would go to 2010 mm, limit 2000 mm"
    );
    assert!(check("F100 G38.3 X1990\nG91 G0 X-20\nG90 G0 X5 Y5\nG2 X10 I2.5\nM2").is_ok());
    // A relative arc has its shape whatever its start; an absolute one has not.
    assert!(check("F100 G38.3 X10\nG91 G2 X1 Y1 I1\nM2").is_ok());
    assert!(matches!(
        check("F100 G38.3 X10\nG2 X1 Y1 I1\nM2"),
        Err(ProgramError::ArcAfterTouch { .. })
    ));
}

#[test]
fn comments_name_features_and_rates() {
    let text = "(feature: top)\nF10 G38.2 Z-1\n(rate: full)\nG38.2 Z-2 (feature: side)\n(rate: background)\n; feature in words only\nG0 X1\nM2";
    let program = check(text).unwrap();
    let touched: Vec<_> = program
        .steps
        .iter()
        .filter_map(|step| match step.action {
            Action::Touch(_, touch) => {
                Some((program.features[touch.feature].as_str(), step.full_rate))
            }
            _ => None,
        })
        .collect();
    assert_eq!(touched, [("top", false), ("side", true)]);
    assert!(!program.steps[2].full_rate);
}

fn fixed_runner(cases: u32) -> TestRunner {
    TestRunner::new_with_rng(
        Config {
            cases,
            failure_persistence: None,
            ..Config::default()
        },
        TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]),
    )
}

#[test]
fn prop_any_text_is_read_or_refused_without_a_panic() {
    let letters = proptest::sample::select(
        "GGGGMXYZABCIJKRPFSN0123456789.-+ ()\n;:%/[]#µ\t\rg1x"
            .chars()
            .collect::<Vec<_>>(),
    );
    let text = proptest::collection::vec(letters, 0..120)
        .prop_map(|letters| letters.into_iter().collect::<String>());
    fixed_runner(20_000)
        .run(&text, |text| {
            let _ = check(&text);
            Ok(())
        })
        .unwrap();
}

#[test]
fn prop_blocks_of_known_words_are_read_or_refused_without_a_panic() {
    let word = (
        proptest::sample::select(vec![
            "G0", "G1", "G2", "G3", "G4", "G17", "G18", "G19", "G20", "G21", "G38.2", "G53", "G90",
            "G91", "M3", "\n", "\n",
        ]),
        proptest::sample::select(["X", "Y", "Z", "A", "I", "J", "K", "R", "P", "F", ""].to_vec()),
        -200i32..200,
    )
        .prop_map(|(code, letter, value)| match letter {
            "" => format!("{code} "),
            letter => format!("{code} {letter}{} ", f64::from(value) / 10.0),
        });
    let program = proptest::collection::vec(word, 1..12).prop_map(|words| words.concat() + "\nM2");
    let mut accepted = 0;
    fixed_runner(20_000)
        .run(&program, |text| {
            let _ = check(&text);
            Ok(())
        })
        .unwrap();
    let mut runner = fixed_runner(1);
    for _ in 0..5_000 {
        use proptest::strategy::ValueTree;
        let text = program.new_tree(&mut runner).unwrap().current();
        accepted += u32::from(check(&text).is_ok());
    }
    assert!(accepted > 50, "{accepted}: the generator makes no programs");
}

#[test]
fn val_gcode_crate_reads_the_same_words() {
    let word = (
        proptest::sample::select("XYZABCIJKRPFS".chars().collect::<Vec<_>>()),
        -9_999_999i32..9_999_999,
    )
        .prop_map(|(letter, value)| format!("{letter}{}", f64::from(value) / 1e4));
    let line = proptest::collection::vec(word, 1..8).prop_map(|words| words.join(" "));
    fixed_runner(2_000)
        .run(&line, |line| {
            let ours = read_line(1, &line).unwrap().words;
            let theirs = gcode::parse(&line).unwrap();
            let theirs: Vec<_> = theirs.blocks[0]
                .word_addresses
                .iter()
                .map(|word| match word.value {
                    gcode::Value::Literal(value) => (word.letter, value),
                    _ => panic!("{line}"),
                })
                .collect();
            prop_assert_eq!(ours.len(), theirs.len());
            for (ours, (letter, value)) in ours.iter().zip(theirs) {
                prop_assert_eq!(ours.letter, letter);
                // Its values have 24 bits.
                prop_assert!((ours.value - f64::from(value)).abs() <= ours.value.abs() * 6.0e-8);
            }
            Ok(())
        })
        .unwrap();
}

#[test]
fn measuring_cycles_and_scenario_programs_are_accepted() {
    let machine = machine::MachineFile::parse(BENCH, "bench.yaml").unwrap();
    let once = std::num::NonZeroU32::MIN;
    let cycles = [
        cycle::blocks(&machine, &[], once).unwrap(),
        cycle::latency(&machine, "block_1.x", &[60.0, 120.0, 240.0], once).unwrap(),
        cycle::bores(&machine, &["ring".to_owned()], 8, once).unwrap(),
        cycle::spheres(&machine, &[], 5, once).unwrap(),
    ];
    let settings = Settings::new(&fake_cnc::Config::default(), &machine).unwrap();
    for cycle in &cycles {
        let program = read(&cycle.program, settings.envelope(), &PerAxis::default()).unwrap();
        let touched: Vec<&str> = program
            .steps
            .iter()
            .filter_map(|step| match step.action {
                Action::Touch(_, touch) => Some(program.features[touch.feature].as_str()),
                _ => None,
            })
            .collect();
        let planned: Vec<&str> = cycle
            .touches
            .iter()
            .map(|t| t.feature_id.as_str())
            .collect();
        assert_eq!(touched, planned);
    }
    for text in [PRODUCTION, VERIFY] {
        read(text, settings.envelope(), &PerAxis::default()).unwrap();
    }
}

#[test]
fn an_empty_axis_set_refuses_every_axis() {
    let none = Envelope {
        axes: AxisSet::EMPTY,
        ..envelope()
    };
    assert!(matches!(
        read("G0 X1\nM2", &none, &PerAxis::default()),
        Err(ProgramError::NoSuchAxis { axis: Axis::X, .. })
    ));
}
