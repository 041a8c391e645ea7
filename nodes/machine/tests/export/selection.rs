//! A whole machine: everything measured is in a file or said to be left out.

use machine::export::Unestimable;
use machine::export::fanuc::Record;
use machine::export::linuxcnc::FileType;
use machine::export::selection::{Control, Fanuc, Measured, Selected, Sinumerik, Wanted, select};
use machine::export::sinumerik::OtherAxes;
use metrology::sample::{ErrorCurve, PositioningTable};
use metrology::stamp::Stamp;
use metrology::{Axis, AxisSet, ErrorComponent, PerAxis};

use crate::cross::{constant, model, polynomial};
use crate::sinumerik::{drift, thermal};
use crate::slide::{error_mm, positions_mm};

fn curve(name: &str, coefficient: &[f64]) -> ErrorCurve {
    let component: ErrorComponent = name.parse().unwrap();
    if component.is_location {
        constant(component, coefficient[0])
    } else {
        polynomial(component, coefficient)
    }
}

/// X with a table, Y and Z fitted, one component not estimable, a rotary location error.
fn measured() -> Measured {
    let mut tables = PerAxis::default();
    tables[Axis::X] = Some(PositioningTable {
        at: Stamp::from_nanos(1),
        axis: Axis::X,
        position: positions_mm(),
        deviation_up: positions_mm().iter().map(|p| error_mm(*p, true)).collect(),
        deviation_down: positions_mm().iter().map(|p| error_mm(*p, false)).collect(),
        n_runs: 10,
        weight: 0.2,
        sequence: 1,
    });
    let mut doubtful = curve("EXY", &[1e-6, 2e-9]);
    doubtful.estimable[1] = false;
    let curves = vec![
        curve("EXX", &[8e-5]),
        curve("EYX", &[1e-5, 2e-9]),
        curve("ECX", &[1e-8]),
        curve("EYY", &[4e-5]),
        doubtful,
        curve("EC0Y", &[3e-5]),
        curve("EZZ", &[-2e-5]),
        curve("EX0C", &[0.01]),
    ];
    Measured {
        tables,
        thermal: Some(thermal(drift(1.0))),
        geometry: Some(model(curves)),
    }
}

fn wanted() -> Wanted {
    Wanted {
        axes: Axis::ALL.into_iter().collect(),
        spacing_mm: 20.0,
        spacing_rad: 0.1,
        reference: PerAxis::default(),
        relative_to_reference: true,
        unestimable: Unestimable::Refuse,
    }
}

fn sinumerik() -> Control {
    Control::Sinumerik(Sinumerik {
        names: PerAxis::from_fn(|axis| format!("{axis}1")),
        max_points: 200,
        max_tables: 8,
        max_cross_points: 200,
        max_sum: 1.0,
        max_slope: 1e-3,
        for_each_direction: false,
        other_axes: OtherAxes::Refuse,
    })
}

fn fanuc() -> Control {
    Control::Fanuc(Fanuc {
        reference_number: PerAxis([40, 140, 240, 340, 440, 540]),
        detection_unit: PerAxis([0.001; 6]),
        magnification: 1,
        max_pulses: 7,
        max_number: 1023,
        record: Record::Plain,
    })
}

fn files(selected: &Selected) -> Vec<&str> {
    selected
        .files
        .iter()
        .map(|file| file.name.as_str())
        .collect()
}

fn assert_left_out(selected: &Selected, expected: &[(&str, &str)]) {
    let said: Vec<String> = selected
        .left_out
        .iter()
        .map(|left| format!("{}: {}", left.what, left.why))
        .collect();
    for (what, why) in expected {
        let found = said
            .iter()
            .any(|line| line.starts_with(&format!("{what}: ")) && line.contains(why));
        assert!(found, "{what}: {why}\nis not in {said:#?}");
    }
    assert_eq!(said.len(), expected.len(), "{said:#?}");
}

const ALWAYS: [(&str, &str); 3] = [
    ("EXX", "the positioning table of the axis is used"),
    ("EXY", "coefficient 1 is not estimable"),
    ("EX0C", "no function of the axis' position"),
];

fn with(more: &[(&'static str, &'static str)]) -> Vec<(&'static str, &'static str)> {
    ALWAYS.iter().chain(more).copied().collect()
}

#[test]
fn linuxcnc_and_fanuc_get_the_positioning_and_say_what_they_cannot_hold() {
    for (control, names) in [
        (
            Control::LinuxCnc(FileType::Offset),
            ["x.comp", "y.comp", "z.comp"],
        ),
        (fanuc(), ["PITCH_X.TXT", "PITCH_Y.TXT", "PITCH_Z.TXT"]),
    ] {
        let selected = select(&measured(), &wanted(), &control);
        assert_eq!(files(&selected), names);
        let more = [
            ("EYX", "has no table for it"),
            ("ECX", "acts through arms"),
            ("EC0Y", "has no table for it"),
            ("drift of X", "has no table for it"),
        ];
        assert_left_out(&selected, &with(&more));
    }
}

#[test]
fn sinumerik_gets_error_tables_cross_tables_and_the_drift() {
    let selected = select(&measured(), &wanted(), &sinumerik());
    let names = [
        "AX_EEC_X1.INI",
        "AX_EEC_Y1.INI",
        "AX_EEC_Z1.INI",
        "NC_CEC_0_Y1_X1.INI",
        "NC_CEC_1_X1_Y1.INI",
        "ABBE_TC_X1.SPF",
    ];
    assert_eq!(files(&selected), names);
    assert_left_out(&selected, &with(&[("ECX", "acts through arms")]));
    assert!(
        selected.files[0]
            .notes
            .iter()
            .any(|note| note.contains("MD32450"))
    );
    let mut each = sinumerik();
    if let Control::Sinumerik(set_up) = &mut each {
        set_up.for_each_direction = true;
    }
    let selected = select(&measured(), &wanted(), &each);
    assert_eq!(
        files(&selected)[..4],
        [
            "NC_CEC_0_X1_X1.INI",
            "NC_CEC_2_Y1_Y1.INI",
            "NC_CEC_4_Z1_Z1.INI",
            "NC_CEC_6_Y1_X1.INI"
        ]
    );
}

#[test]
fn heidenhain_gets_angles_too_and_csv_everything_but_the_drift() {
    let heidenhain = select(&measured(), &wanted(), &Control::Heidenhain);
    assert_eq!(
        files(&heidenhain),
        ["X_AXIS.COM", "Y_AXIS.COM", "Z_AXIS.COM"]
    );
    assert_left_out(&heidenhain, &with(&[("drift of X", "no table")]));
    let header = heidenhain.files[0].text.lines().nth(1).unwrap();
    let columns: Vec<&str> = header.split_whitespace().collect();
    assert_eq!(columns, ["NR", "AXISPOS", "BACKLASH", "X", "C2", "C6"]);

    let csv = select(&measured(), &wanted(), &Control::Csv);
    assert_eq!(files(&csv), ["errors.csv"]);
    assert_left_out(&csv, &with(&[("drift of X", "no table")]));
    for name in ["EXX,X", "EYX,X", "ECX,X", "EC0Y,Y"] {
        assert!(csv.files[0].text.contains(&format!("\n{name},")), "{name}");
    }
}

#[test]
fn what_is_not_estimable_comes_in_only_when_it_is_asked_for() {
    let accepting = Wanted {
        unestimable: Unestimable::Accept,
        ..wanted()
    };
    let selected = select(&measured(), &accepting, &Control::Csv);
    assert!(selected.files[0].text.contains("\nEXY + EC0Y,Y,"));
}

#[test]
fn an_axis_that_cannot_be_made_does_not_stop_the_others() {
    let mut absolute = Wanted {
        relative_to_reference: false,
        ..wanted()
    };
    absolute.reference[Axis::X] = 100.0;
    let selected = select(&measured(), &absolute, &sinumerik());
    assert_eq!(
        files(&selected)[..2],
        ["AX_EEC_Y1.INI", "AX_EEC_Z1.INI"],
        "X is not zero at its reference"
    );
    let positioning = Axis::LINEAR.map(|axis| selected.positioning[axis].is_some());
    assert_eq!(positioning, [false, true, true]);
    let one = Wanted {
        axes: AxisSet::EMPTY.with(Axis::Y),
        ..wanted()
    };
    assert_eq!(files(&select(&measured(), &one, &fanuc())), ["PITCH_Y.TXT"]);
    let nothing = select(&Measured::default(), &wanted(), &Control::Csv);
    assert_eq!(nothing, Selected::default());
}
