//! Loops closed by the motor or by the linear scale, over the plant.

use fake_cnc::config::FeedbackSource;

use super::*;

const STEPS: &str =
    "G21 G90\nG1 F6000 X200\nG4 P2\nG1 X-200\nG4 P2\nG1 X-100\nG4 P2\nG1 X100\nG4 P2\nM2\n";

/// A machine whose screw has a lead error, so that motor and scale differ.
fn shop(source: FeedbackSource) -> Shop<Plant> {
    let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
    let truth = PlantFile::from_yaml(PLANT).unwrap();
    let mut config = Config::default();
    config.feedback.insert(Axis::X, source);
    Shop::new(&config, &machine, Plant::new(&machine, &truth).unwrap())
}

/// Worst deviation of motor and scale from the command in the last half second of each rest, and the
/// range of the scale in it, mm.
fn at_rest(source: FeedbackSource) -> (f64, f64, f64) {
    let mut shop = shop(source);
    let (outcome, message, _) = shop.run(STEPS);
    assert_eq!(outcome, Outcome::Done, "{message}");
    let states: Vec<AxisState> = shop
        .out
        .iter()
        .filter_map(|output| match output {
            Output::State(state) => Some(*state),
            _ => None,
        })
        .collect();
    let (mut motor_mm, mut scale_mm, mut range_mm) = (0.0_f64, 0.0_f64, 0.0_f64);
    for target_mm in [200.0, -200.0, -100.0, 100.0] {
        let there = |state: &&AxisState| (state.commanded[Axis::X] - target_mm).abs() < 1e-9;
        let rest: Vec<_> = states.iter().filter(there).collect();
        let last = &rest[rest.len() - 500..];
        let scale = |state: &&AxisState| state.scale[Axis::X];
        let most = last.iter().map(scale).fold(f64::MIN, f64::max);
        let least = last.iter().map(scale).fold(f64::MAX, f64::min);
        range_mm = range_mm.max(most - least);
        let end = last[last.len() - 1];
        motor_mm = motor_mm.max((end.motor[Axis::X] - target_mm).abs());
        scale_mm = scale_mm.max((end.scale[Axis::X] - target_mm).abs());
    }
    eprintln!(
        "{source:?}: motor {:.2} um, scale {:.2} um from the command at rest, scale moves by {:.3} um",
        motor_mm * 1e3,
        scale_mm * 1e3,
        range_mm * 1e3
    );
    (motor_mm, scale_mm, range_mm)
}

#[test]
fn a_semi_closed_loop_follows_the_motor_and_leaves_the_screw_to_itself() {
    let (motor_mm, scale_mm, _) = at_rest(FeedbackSource::Motor);
    assert!(motor_mm < 3e-4, "{motor_mm}");
    assert!(scale_mm > 2e-3, "{scale_mm}");
}

#[test]
fn a_full_closed_loop_follows_the_scale_and_comes_to_rest() {
    let (motor_mm, scale_mm, range_mm) = at_rest(FeedbackSource::Scale);
    assert!(scale_mm < 5e-4, "{scale_mm}");
    assert!(
        motor_mm > 2e-3,
        "the motor turns further than commanded: {motor_mm}"
    );
    assert!(
        range_mm < 5e-4,
        "it must not hunt across the play: {range_mm}"
    );
}
