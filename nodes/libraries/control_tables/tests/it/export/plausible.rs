//! Errors that no machine has, and points that its axis cannot reach, are in no table of any format.

use control_tables::linuxcnc::FileType;
use control_tables::selection::{Control, Measured, Selected, Wanted, select};
use control_tables::{Travels, Unestimable};
use metrology::sample::PositioningTable;
use metrology::stamp::Stamp;
use metrology::{Axis, AxisSet, PerAxis};

use crate::export::cross::{model, polynomial};

/// Every 20 mm from -300 to 300 mm, 0.1 mm/m, after a change; mm or rad.
fn table(axis: Axis, change: fn(&mut PositioningTable)) -> PositioningTable {
    let position: Vec<f64> = (-15..=15).map(|k| f64::from(k) * 20.0).collect();
    let deviation: Vec<f64> = position.iter().map(|p| 1e-4 * p).collect();
    let mut table = PositioningTable {
        at: Stamp::from_nanos(1),
        axis,
        position,
        deviation_up: deviation.clone(),
        deviation_down: deviation,
        n_runs: 5,
        weight: 0.2,
        sequence: 1,
    };
    change(&mut table);
    table
}

fn selected(table: PositioningTable, travels: Travels, control: &Control) -> Selected {
    let mut measured = Measured::default();
    let axis = table.axis;
    measured.tables[axis] = Some(table);
    measured.tables[Axis::Y] = Some(self::table(Axis::Y, |_| ()));
    select(&measured, &wanted(travels), control)
}

fn wanted(travels: Travels) -> Wanted {
    Wanted {
        axes: Axis::ALL.into_iter().collect::<AxisSet>(),
        spacing_mm: 20.0,
        spacing_rad: 20.0,
        reference: PerAxis::default(),
        relative_to_reference: true,
        unestimable: Unestimable::Refuse,
        travels,
    }
}

fn travels() -> Travels {
    let mut travels = Travels::default();
    travels[Axis::X] = Some((-300.0, 300.0));
    travels
}

fn assert_refused(selected: &Selected, words: &[&str]) {
    let left = selected
        .left_out
        .iter()
        .find(|left| left.why.is_implausible());
    let said = left.unwrap().why.to_string();
    for word in words {
        assert!(said.contains(word), "{word}: {said}");
    }
    assert!(selected.positioning[Axis::X].is_none());
    assert!(selected.positioning[Axis::Y].is_some(), "the others stay");
}

#[test]
fn an_outlier_is_refused_with_axis_place_value_and_limit() {
    type Case = (fn(&mut PositioningTable), &'static [&'static str]);
    let cases: [Case; 7] = [
        (
            |t| t.deviation_up[0] = 1e6,
            &["axis X: error 1000000 mm", "at -300 mm", "at most 5 mm"],
        ),
        (
            |t| t.deviation_down[30] = -6.0,
            &["axis X: error -6 mm", "at 300 mm"],
        ),
        // The reference point itself: then every other error is wrong.
        (
            |t| t.deviation_up[15] = 50.0,
            &["axis X: error -25.03 mm", "at -300 mm"],
        ),
        (
            |t| t.deviation_up[3] = 0.4,
            &[
                "changes by 0.426 mm",
                "-260 mm and -240 mm",
                "at most 0.3125 mm",
                "spacing",
            ],
        ),
        (|t| t.deviation_down[20] = -0.4, &["changes by -0.408 mm"]),
        // Between two points of the grid.
        (
            |t| {
                for (values, value) in [
                    (&mut t.position, 0.5),
                    (&mut t.deviation_up, 90.0),
                    (&mut t.deviation_down, 0.0),
                ] {
                    values.insert(16, value);
                }
            },
            &["axis X: error 90 mm", "at 0.5 mm"],
        ),
        (
            |t| t.position.iter_mut().for_each(|p| *p *= 80.0),
            &["axis X: point at -24000 mm: the travel is from -300 mm to 300 mm"],
        ),
    ];
    for control in [Control::LinuxCnc(FileType::ActualPosition), Control::Csv] {
        for (change, words) in cases {
            let x = table(Axis::X, change);
            assert_refused(&selected(x, travels(), &control), words);
        }
        let good = selected(table(Axis::X, |_| ()), travels(), &control);
        assert!(good.left_out.is_empty(), "{:?}", good.left_out);
    }
}

#[test]
fn a_rotary_axis_has_its_own_limits() {
    let c = |change: fn(&mut PositioningTable)| {
        let mut c = table(Axis::C, |t| {
            for values in [&mut t.deviation_up, &mut t.deviation_down] {
                values.iter_mut().for_each(|e| *e *= 1e-3);
            }
        });
        change(&mut c);
        selected(c, Travels::default(), &Control::LinuxCnc(FileType::Offset))
    };
    assert!(c(|_| ()).left_out.is_empty());
    let far = c(|t| t.deviation_up[4] = 0.02);
    let said = far.left_out[0].why.to_string();
    assert!(said.contains("at most 1 deg"), "{said}");
}

#[test]
fn a_fitted_error_is_held_to_the_same_bounds() {
    for (name, slope, words) in [
        ("EXX", 0.1, "axis X: error -"),
        ("EXX", 0.018, "at most 0.3125 mm (1/64 of the way)"),
        ("EYX", 0.1, "in direction Y"),
    ] {
        let curves = vec![polynomial(name.parse().unwrap(), &[slope])];
        let measured = Measured {
            geometry: Some(model(curves)),
            ..Measured::default()
        };
        let selected = select(&measured, &wanted(travels()), &Control::Csv);
        let left = selected
            .left_out
            .iter()
            .find(|left| left.why.is_implausible());
        let said = left.unwrap().why.to_string();
        assert!(said.contains(words), "{name} {slope}: {said}");
    }
    let mut short = Travels::default();
    short[Axis::X] = Some((-100.0, 100.0));
    let curves = vec![polynomial("EXX".parse().unwrap(), &[1e-5])];
    let measured = Measured {
        geometry: Some(model(curves)),
        ..Measured::default()
    };
    let selected = select(&measured, &wanted(short), &Control::Csv);
    assert!(
        selected.files.is_empty(),
        "neither as effect nor as component"
    );
}
