//! Commands along random programs: exact ends, exact path, and never beyond an axis' limits.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use fake_cnc::lookahead::Chain;
use fake_cnc::path::{AxisLimits, Segment, target};
use fake_cnc::rs274::program::{Action, Motion, Program};
use fake_cnc::rs274::{Envelope, read};
use metrology::{Axis, AxisSet, PerAxis};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestRng, TestRunner};

const PERIOD_S: f64 = 0.001;

fn axes() -> AxisSet {
    [Axis::X, Axis::Y, Axis::Z, Axis::A, Axis::C]
        .into_iter()
        .collect()
}

fn limits() -> AxisLimits {
    AxisLimits {
        axes: axes(),
        speed: PerAxis([333.0, 333.0, 250.0, 2.09, 1.0, 4.19]),
        acceleration: PerAxis([3000.0, 2500.0, 2000.0, 17.4, 1.0, 34.9]),
        period_s: PERIOD_S,
    }
}

fn program(text: &str) -> Program {
    let envelope = Envelope {
        axes: axes(),
        travel: PerAxis::from_fn(|_| [-1000.0, 1000.0]),
        speed: PerAxis::from_fn(|_| f64::INFINITY),
        spindle_limit_rpm: Some(12_000.0),
        tool_lengths_mm: Vec::new(),
    };
    read(text, &envelope, &PerAxis::default()).unwrap()
}

fn motions(program: &Program) -> Vec<Motion> {
    program
        .steps
        .iter()
        .filter_map(|step| match step.action {
            Action::Move(motion) => Some(motion),
            _ => None,
        })
        .collect()
}

/// Every command of a program without stops, the start included; where it leads; its pieces.
fn commands(
    text: &str,
    stop_after: Option<usize>,
) -> (Vec<PerAxis<f64>>, PerAxis<f64>, Vec<Segment>) {
    let mut chain = Chain::with_capacity(16);
    let mut end = PerAxis::default();
    let mut pieces = Vec::new();
    for motion in motions(&program(text)) {
        if let Some(segment) = Segment::new(&motion, &end, &limits()) {
            chain.push(segment, pieces.len());
            pieces.push(segment);
        }
        end = target(&motion, &end);
    }
    chain.plan(&limits());
    let mut commands = vec![PerAxis::default(); 2];
    while let Some(command) = chain.advance(PERIOD_S) {
        commands.push(command.position);
        if Some(commands.len()) == stop_after {
            chain.stop();
        }
        assert!(commands.len() < 10_000_000, "{text}: never ends");
    }
    let last = commands[commands.len() - 1];
    commands.extend([last; 2]);
    (commands, end, pieces)
}

fn within_limits(text: &str, commands: &[PerAxis<f64>]) -> Result<(), TestCaseError> {
    let limits = limits();
    for axis in axes().iter() {
        let speed = limits.speed[axis] * PERIOD_S;
        let acceleration = limits.acceleration[axis] * PERIOD_S * PERIOD_S;
        for window in commands.windows(3) {
            let [a, b, c] = [window[0][axis], window[1][axis], window[2][axis]];
            prop_assert!(
                (c - b).abs() <= speed * (1.0 + 1e-9) + 1e-10,
                "{text}: {axis} speed"
            );
            let second = (c - 2.0 * b + a).abs();
            prop_assert!(
                second <= acceleration * (1.0 + 1e-6) + 1e-10,
                "{text}: {axis} acceleration {} of {}",
                second / PERIOD_S.powi(2),
                limits.acceleration[axis]
            );
        }
    }
    Ok(())
}

fn on_the_path(commands: &[PerAxis<f64>], pieces: &[Segment]) -> Result<(), TestCaseError> {
    // Straight pieces only: distance to the nearest of them.
    for command in commands.iter().step_by(7) {
        let nearest = pieces
            .iter()
            .map(|piece| {
                let a = piece.start().xyz();
                let way = piece.end().xyz() - a;
                let share = (command.xyz() - a).dot(&way) / way.norm_squared().max(1e-300);
                (a + way * share.clamp(0.0, 1.0) - command.xyz()).norm()
            })
            .fold(f64::INFINITY, f64::min);
        prop_assert!(nearest < 1e-9, "{nearest} mm off the path");
    }
    Ok(())
}

fn runner(cases: u32) -> TestRunner {
    TestRunner::new_with_rng(
        Config {
            cases,
            failure_persistence: None,
            ..Config::default()
        },
        TestRng::from_seed(RngAlgorithm::ChaCha, &[3; 32]),
    )
}

fn words(scale: f64) -> impl Strategy<Value = String> {
    let word = proptest::option::weighted(0.7, -100.0..100.0_f64);
    (word.clone(), word.clone(), word).prop_map(move |(x, y, z)| {
        let word = |letter, value: Option<f64>| {
            value.map_or_else(String::new, |v| format!("{letter}{:.4} ", v * scale))
        };
        word('X', x) + &word('Y', y) + &word('Z', z)
    })
}

fn straight(scale: f64) -> impl Strategy<Value = String> {
    let feed = 1.0..20_000.0_f64;
    (any::<bool>(), words(scale), feed)
        .prop_map(|(rapid, words, feed)| format!("G{} F{feed:.1} {words}\n", u8::from(!rapid)))
}

fn rotary() -> impl Strategy<Value = String> {
    (
        words(1.0),
        -100.0..20.0_f64,
        -300.0..300.0_f64,
        any::<bool>(),
    )
        .prop_map(|(words, a, c, mixed)| {
            let words = if mixed { words } else { String::new() };
            format!("G1 F3000 {words} A{a:.3} C{c:.3}\n")
        })
}

fn arc() -> impl Strategy<Value = String> {
    let offset = -30.0..30.0_f64;
    (
        0u8..3,
        any::<bool>(),
        offset.clone(),
        offset,
        1u8..3,
        10.0..20_000.0_f64,
    )
        .prop_map(|(plane, clockwise, i, j, turns, feed)| {
            let [a, b, h] = [["I", "J", "Z"], ["K", "I", "Y"], ["J", "K", "X"]][usize::from(plane)];
            let sense = if clockwise { 2 } else { 3 };
            format!(
                "G{} G91 F{feed:.1}\nG{sense} {a}{i:.3} {b}{:.3} {h}{:.3} P{turns}\nG90\n",
                17 + plane,
                j + 0.5 * j.signum(),
                i / 4.0
            )
        })
}

#[test]
fn prop_commands_never_exceed_the_limits_of_an_axis() {
    let block = prop_oneof![straight(1.0), straight(0.02), rotary(), arc()];
    let program = (proptest::collection::vec(block, 1..12), 3usize..3000);
    runner(400)
        .run(&program, |(blocks, stop_after)| {
            let text = blocks.concat() + "M2";
            let (followed, end, _) = commands(&text, None);
            within_limits(&text, &followed)?;
            prop_assert_eq!(followed[followed.len() - 1], end);
            let (stopped, ..) = commands(&text, Some(stop_after));
            within_limits(&text, &stopped)?;
            prop_assert!(stopped.len() <= followed.len() + 1);
            Ok(())
        })
        .unwrap();
}

#[test]
fn eq2_fine_polygons_are_not_faster_than_the_axes_can_turn() {
    // Corners 0.01 mm apart on a radius of 1 mm: each alone could be passed at over 60 mm/s.
    let corners: String = (1..=600)
        .map(|k| {
            let angle = f64::from(k) * 0.01;
            format!("X{:.6} Y{:.6}\n", angle.sin(), 1.0 - angle.cos())
        })
        .collect();
    let text = format!("G1 F20000\n{corners}M2");
    let (commands, ..) = commands(&text, None);
    within_limits("polygon", &commands).unwrap();
}

#[test]
fn prop_straight_motions_stay_on_their_path() {
    let block = prop_oneof![straight(1.0), straight(0.02)];
    runner(100)
        .run(&proptest::collection::vec(block, 1..12), |blocks| {
            let (commands, _, pieces) = commands(&(blocks.concat() + "M2"), None);
            on_the_path(&commands, &pieces)
        })
        .unwrap();
}

#[test]
fn arcs_hit_their_ends_and_keep_their_radius_in_every_plane() {
    let cases = [
        "G17 F3000 G3 X-10 Y10 I-10\nM2",
        "G18 F3000 G3 Z-10 X10 K-10\nM2",
        "G19 F3000 G3 Y-10 Z10 J-10\nM2",
        "G17 F3000 G2 I-10\nM2",
        "G18 F9000 G2 K-6 I8\nM2",
        "G17 F3000 G2 I-10 Z-6 P3\nM2",
        "G17 F3000 G2 X-10 Y10 R10\nM2",
        "G17 F3000 G2 X-10 Y10 R-10\nM2",
    ];
    for text in cases {
        let (commands, end, _) = commands(text, None);
        assert_eq!(commands[commands.len() - 1], end, "{text}");
        let arc = motions(&program(text))[0].arc.unwrap();
        let [first, second, _] = arc.plane.axes();
        let [a, b] = arc.centre_from_start_mm;
        assert!((a.hypot(b) - 10.0).abs() < 1e-12, "{text}");
        let farthest = commands
            .iter()
            .map(|c| ((c[first] - a).hypot(c[second] - b) - 10.0).abs())
            .fold(0.0, f64::max);
        assert!(farthest < 1e-9, "{text}: {farthest}");
    }
}

#[test]
fn eq4_small_circles_are_slower_than_their_feed() {
    // 0.8 of 0.75 of 2500 mm/s² on a radius of 1 mm: 38.7 mm/s at most.
    let (commands, ..) = commands("F20000 G3 I1\nM2", None);
    let fastest = commands
        .windows(2)
        .map(|w| (w[1].xyz() - w[0].xyz()).norm() / PERIOD_S)
        .fold(0.0, f64::max);
    let limit = (0.8 * 0.75 * 2500.0_f64).sqrt();
    assert!(
        fastest <= limit && fastest > 0.95 * limit * 0.9,
        "{fastest} {limit}"
    );
}

#[test]
fn feed_is_along_the_linear_axes_or_along_the_rotary_ones() {
    let seconds = |text: &str| (commands(text, None).0.len() - 4) as f64 * PERIOD_S;
    let cases = [
        ("F600 G1 X100\nM2", 10.0),
        ("F600 G1 X60 Y80 A10\nM2", 10.0),
        ("F600 G1 A-100\nM2", 10.0),
        ("F600 G20\nG1 X1\nM2", 2.54),
        ("G20\nF20 G1 X1\nM2", 3.0),
        ("F600 G1 A-60 C80\nM2", 10.0),
    ];
    for (text, expected_s) in cases {
        let taken_s = seconds(text);
        assert!((taken_s - expected_s).abs() < 0.03, "{text}: {taken_s} s");
    }
}

#[test]
fn tangent_pieces_are_passed_at_full_feed() {
    // A straight line, a tangent half circle and a line back: no slowing at the joints.
    let (commands, ..) = commands("F3000 G1 X100\nG3 X100 Y40 J20\nG1 X0\nM2", None);
    let speeds: Vec<f64> = commands
        .windows(2)
        .map(|w| (w[1].xyz() - w[0].xyz()).norm() / PERIOD_S)
        .collect();
    let middle = &speeds[60..speeds.len() - 60];
    let slowest = middle.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(slowest > 49.9, "{slowest}");
}
