//! What is refused, held, let go, said and copied.

use axis_compensation::{Diagnostic, Input};
use metrology::sample::{AxisDrift, AxisState, CompensationState, ThermalModel};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, PerAxis, Stamp};

use crate::positioning::screw_axis::{Feedback, Machine, configured, x};

const START: &str = "start_points_mm: [-20.0, -10.0, 0.0, 10.0, 20.0], \
     start_deviations_um: [0.0, 4.0, 6.0, 2.0, -2.0], start_deviations_down_um: [-6.0, -2.0, 0.0, -4.0, -8.0]";

fn thermal(k0_mm: f64) -> Input {
    let mut axes = PerAxis::default();
    axes[Axis::X] = Some(AxisDrift {
        k0_mm,
        span_mm: (-220.0, 220.0),
        ..AxisDrift::default()
    });
    let at = Stamp::from_nanos(0);
    Input::Model(Box::new(ThermalModel {
        at,
        axes,
        valid_from: at,
        valid_until: at + Span::from_secs_f64(1e6),
        n_blocks: 2,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence: 1,
    }))
}

/// A screw that warms up by 40 µm/m with a time constant of 10 min, for half an hour of work.

#[test]
fn a_start_table_compensates_and_is_published_from_the_first_tick() {
    let mut machine = Machine::new(
        &x("refreshed_table", 0.0, "apart", START),
        Feedback::DualLoop,
    );
    machine.stand(0.02);
    // No direction is known yet: the mean of both.
    assert!((machine.x().0 + 3e-3).abs() < 1e-12, "{:?}", machine.x());
    assert_eq!(machine.tables.len(), 1);
    let table = &machine.tables[0];
    assert_eq!((table.axis, table.n_runs, table.sequence), (Axis::X, 0, 0));
    assert_eq!(table.position, [-20.0, -10.0, 0.0, 10.0, 20.0]);
    assert_eq!(table.deviation_down[4].to_bits(), (-8e-3_f64).to_bits());
}

#[test]
fn at_a_reversal_on_a_border_the_offset_changes_by_the_lost_motion_alone() {
    let mut machine = Machine::new(
        &x("refreshed_table", 0.0, "apart", START),
        Feedback::DualLoop,
    );
    machine.screw.gap_mm = 6e-3;
    machine.go(-10.0, 5.0);
    machine.go(0.0, 5.0);
    machine.go(10.0, 5.0);
    machine.stand(0.1);
    assert!((machine.x().0 + 2e-3).abs() < 1e-12);
    // Back into the cell it came from: the border's value of the way down, its slope from there on.
    machine.tick(10.0 - 2e-4);
    let (offset_mm, _) = machine.x();
    assert!((offset_mm - 4e-3 + 2e-4 * 4e-4).abs() < 1e-9, "{offset_mm}");
    machine.go(5.0, 5.0);
    assert!((machine.x().0 - 2e-3).abs() < 1e-12);
    // A command that trembles by less than a pulse is no reversal.
    machine.tick(5.0 + 5e-5);
    assert!((machine.x().0 - 2e-3).abs() < 1e-7);
    // Outside of the points the deviation of the last one holds.
    machine.go(60.0, 50.0);
    assert!((machine.x().0 - 2e-3).abs() < 1e-12);
}

#[test]
fn without_a_scale_the_table_goes_on_and_the_measured_loop_lets_go() {
    let mut machine = Machine::new(
        &x("refreshed_table", 0.3, "apart", START),
        Feedback::DualLoop,
    );
    machine.go(5.0, 5.0);
    machine.scale_speaks = false;
    machine.go(-5.0, 5.0);
    assert_eq!(machine.x().1, CompensationState::Active);
    assert_eq!(
        machine.said(|said| matches!(said, Diagnostic::ScaleMissing { axis: Axis::X })),
        1
    );
    machine.scale_speaks = true;
    machine.stand(0.1);
    assert_eq!(
        machine.said(|said| matches!(said, Diagnostic::ScaleBack { axis: Axis::X })),
        1
    );

    let start = "start_points_mm: [-20.0, -10.0, 0.0, 10.0, 20.0], start_deviations_um: [0.0, 4.0, 6.0, 2.0, -2.0]";
    let mut machine = Machine::new(
        &x("weighted_increments", 0.3, "together", start),
        Feedback::DualLoop,
    );
    machine.go(5.0, 5.0);
    machine.stand(1.0);
    machine.scale_speaks = false;
    machine.stand(0.5);
    assert_eq!(machine.x().1, CompensationState::Holding);
    machine.stand(3.0);
    assert_eq!(machine.x().1, CompensationState::Off);
    machine.scale_speaks = true;
    machine.stand(1.0);
    assert_eq!(machine.x().1, CompensationState::Active);
}

#[test]
fn an_axis_without_a_scale_learns_nothing_and_says_so() {
    let mut machine = Machine::new(
        &x("refreshed_table", 0.3, "apart", ""),
        Feedback::SemiClosed,
    );
    machine.scale_speaks = false;
    machine.learn(1);
    let refused = machine
        .diagnostics
        .iter()
        .find(|said| matches!(said, Diagnostic::RunRefused { .. }));
    assert_eq!(
        refused.unwrap().to_string(),
        "axis X: no scale reading at -120 mm; not learned"
    );
    assert_eq!(machine.x(), (0.0, CompensationState::Off));
}

#[test]
fn a_scale_that_loses_counts_is_not_believed() {
    let mut machine = Machine::new(
        &x("refreshed_table", 0.3, "apart", START),
        Feedback::DualLoop,
    );
    machine.go(-25.0, 20.0);
    machine.screw.fixed_bearing_mm = -1000.0;
    machine.screw.grown = 200e-6;
    machine.screw.growth = 200e-6;
    let before = machine.tables.len();
    machine.go(25.0, 10.0);
    assert_eq!(
        machine.said(|said| matches!(said, Diagnostic::MeasurementDoubted { axis: Axis::X, .. })),
        1
    );
    assert_eq!(machine.tables.len(), before);
    machine.screw.grown = 0.0;
    machine.screw.growth = 0.0;
    machine.go(-25.0, 10.0);
    assert_eq!(
        machine.said(|said| matches!(said, Diagnostic::MeasurementBelieved { axis: Axis::X })),
        1
    );
}

#[test]
fn what_is_not_safe_or_not_measurable_is_refused_at_the_start() {
    let refused = |positioning: &str| configured(positioning).err().unwrap_or_default();
    let one = |reading: &str, weight: f64, more: &str| x(reading, weight, "together", more);
    assert_eq!(refused(&one("refreshed_table", 0.3, "")), "");
    assert_eq!(
        refused(&one("refreshed_table", 0.31, "")),
        "positioning.X.weight = 0.31: must be from 0 to 0.3"
    );
    assert_eq!(
        refused(&one("refreshed_table", 0.1, "runs: 9")),
        "positioning.X.runs = 9: must be from 10 to 20"
    );
    assert!(
        refused(&one("weighted_increments", 0.3, "loop_delay_cycles: 2"))
            .starts_with("positioning: axis X: gain 0.7 of the measured loop, must be below 0.618")
    );
    assert!(
        refused(&one("weighted_increments", 0.0, "loop_delay_cycles: 1")).contains("gain 1 of")
    );
    assert_eq!(
        refused(&one("weighted_increments", 0.0, "loop_delay_cycles: 0")),
        ""
    );
    assert_eq!(
        refused(&one("refreshed_table", 0.1, "").replace("X:", "Z:")),
        "positioning.Z: the machine file gives the axis no scale_resolution_um"
    );
    assert_eq!(
        refused(&one("refreshed_table", 0.1, "").replace("X:", "Y:")),
        "positioning.Y: the axis has no limits under `axes`"
    );
    assert!(refused(&one("refreshed_table", 0.1, START)).contains("belong to directions apart"));
    let falling = "start_points_mm: [0.0, 10.0, 9.0, 20.0, 30.0], start_deviations_um: [0.0, 0.0, 0.0, 0.0, 0.0]";
    assert!(
        refused(&one("refreshed_table", 0.1, falling))
            .contains("9 mm must lie above the one before, 10 mm")
    );
    assert!(refused(&one("refreshed_table", 0.1, "wieght: 1.0")).contains("wieght"));
    // A table from the parameter file that is never measured again needs no scale.
    let fixed = "start_points_mm: [0.0, 10.0, 20.0, 30.0, 40.0], start_deviations_um: [0.0, 1.0, 2.0, 3.0, 4.0]";
    assert_eq!(
        refused(&one("refreshed_table", 0.0, fixed).replace("X:", "Z:")),
        ""
    );
}

#[test]
fn the_thermal_part_is_added_only_where_it_is_wanted() {
    for (adds, total_mm) in [("true", -3e-3 + 5e-3), ("false", -3e-3)] {
        let positioning = x("refreshed_table", 0.0, "apart", START)
            .replace("thermal_part: false", &format!("thermal_part: {adds}"));
        let mut machine = Machine::new(&positioning, Feedback::SemiClosed);
        machine.stand(0.5);
        machine.step(thermal(5e-3));
        machine.stand(1.0);
        let last = machine.last.unwrap();
        assert!(
            (last.total[Axis::X] - total_mm).abs() < 1e-9,
            "{adds}: {}",
            last.total[Axis::X]
        );
        assert!((last.positioning[Axis::X] + 3e-3).abs() < 1e-12);
    }
}

#[test]
fn the_measured_loop_leaves_the_other_parts_alone() {
    let positioning = x("weighted_increments", 0.3, "together", "loop_cycle_s: 0.1")
        .replace("thermal_part: false", "thermal_part: true");
    let mut machine = Machine::new(&positioning, Feedback::DualLoop);
    machine.learn(10);
    machine.step(thermal(5e-3));
    machine.go(37.5, 20.0);
    machine.stand(3.0);
    // The reading of a warm machine is 5 µm too great: the slide belongs 5 µm beyond the command.
    let slide_mm = machine.screw.slide_mm;
    assert!((slide_mm - 37.505).abs() < 0.15e-3, "{slide_mm}");
}

#[test]
fn an_offset_beyond_the_size_limit_is_not_followed_and_switching_off_fades() {
    let far = "start_points_mm: [-20.0, -10.0, 0.0, 10.0, 20.0], start_deviations_um: [0.0, 50.0, 99.0, 150.0, 200.0]";
    let mut machine = Machine::new(
        &x("refreshed_table", 0.0, "together", far),
        Feedback::SemiClosed,
    );
    machine.go(-5.0, 5.0);
    machine.stand(0.5);
    machine.go(15.0, 5.0);
    let last = machine.last.unwrap();
    assert_eq!(last.state[Axis::X], CompensationState::Limited);
    assert!(last.total[Axis::X] > -0.1 && last.total[Axis::X] < -0.09);
    assert!((last.positioning[Axis::X] + 0.175).abs() < 1e-12);
    machine.step(Input::Enable(false));
    machine.stand(1.0);
    assert_eq!(machine.x().1, CompensationState::Fading);
    machine.stand(1.5);
    assert_eq!(
        (machine.last.unwrap().total[Axis::X], machine.x().1),
        (0.0, CompensationState::Off)
    );
}

#[test]
fn a_test_of_two_axes_at_once_is_refused() {
    let both = format!(
        "{}, {}",
        x("refreshed_table", 0.1, "together", ""),
        x(
            "refreshed_table",
            0.0,
            "together",
            &START.replace(
                ", start_deviations_down_um: [-6.0, -2.0, 0.0, -4.0, -8.0]",
                ""
            )
        )
        .replace("X:", "Z:")
    );
    let mut machine = Machine::new(&both, Feedback::SemiClosed);
    machine.segment(true);
    for j in 0..6 {
        for _ in 0..300 {
            machine.nanos += 1_000_000;
            let mut commanded = PerAxis::default();
            commanded[Axis::X] = 10.0 * f64::from(j);
            commanded[Axis::Z] = 20.0 * f64::from(j);
            machine.step(Input::State(AxisState {
                scale: commanded,
                ..AxisState::standing(
                    Stamp::from_nanos(machine.nanos),
                    Stamp::from_nanos(machine.nanos),
                    AxisSet::XYZ,
                    commanded,
                )
            }));
        }
    }
    machine.segment(false);
    let refused = machine
        .diagnostics
        .iter()
        .find(|said| matches!(said, Diagnostic::RunRefused { .. }));
    assert_eq!(
        refused.unwrap().to_string(),
        "axes X and Z both moved from point to point, one must stand; not learned"
    );
}

#[test]
fn a_copy_in_mid_test_and_in_mid_work_goes_on_exactly_as_the_original() {
    for (reading, runs) in [("refreshed_table", 9), ("weighted_increments", 10)] {
        let mut machine = Machine::new(
            &x(reading, 0.2, "apart", "loop_delay_cycles: 1"),
            Feedback::DualLoop,
        );
        machine.learn(runs);
        machine.repeat = runs;
        machine.segment(true);
        machine.go(-45.0, 50.0);
        machine.stand(0.15);
        let mut copy = Machine {
            stage: machine.stage.clone(),
            screw: machine.screw.clone(),
            last: machine.last,
            commanded_mm: machine.commanded_mm,
            nanos: machine.nanos,
            repeat: machine.repeat,
            ..Machine::new(&x(reading, 0.2, "apart", ""), Feedback::DualLoop)
        };
        machine.tables.clear();
        for machine in [&mut machine, &mut copy] {
            machine.run();
            machine.segment(false);
            machine.go(118.0, 15.0);
            machine.go(-118.0, 15.0);
        }
        assert_eq!(machine.last, copy.last);
        assert_eq!(
            machine.screw.slide_mm.to_bits(),
            copy.screw.slide_mm.to_bits()
        );
        assert_eq!(machine.tables.last(), copy.tables.last());
    }
}
