//! A whole machine: everything measured is in a file or said to be left out.

use control_tables::fanuc::Record;
use control_tables::linuxcnc::FileType;
use control_tables::selection::{
    Control, Fanuc, Measured, PitchTables, Selected, Sinumerik, Wanted, select,
};
use control_tables::sinumerik::OtherAxes;
use control_tables::{Sign, Unestimable};
use metrology::sample::{ErrorCurve, PositioningTable};
use metrology::stamp::Stamp;
use metrology::{Axis, AxisSet, ErrorComponent, PerAxis};
use nalgebra::Vector3;

use crate::export::cross::{constant, model, polynomial};
use crate::export::sinumerik::{drift, thermal};
use crate::export::slide::{error_mm, positions_mm};

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
    let mut ecc = curve("ECC", &[2e-6]);
    ecc.span = (-1.0, 1.0);
    Measured {
        tables,
        remarks: PerAxis::default(),
        thermal: Some(thermal(drift(1.0))),
        geometry: Some(model(curves)),
        rotary: Some(model(vec![curve("EY0A", &[-0.02]), ecc])),
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
        travels: PerAxis::default(),
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
        temperature_sign: Some(Sign::Minus),
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
        tables: PitchTables::AsMeasured,
        sign: Some(Sign::Plus),
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

const ALWAYS: [(&str, &str); 4] = [
    ("EXX", "the positioning table of the axis is used"),
    ("EXY", "coefficient 1 is not estimable"),
    ("EX0C", "no function of the axis' position"),
    ("EY0A", "no function of the axis' position"),
];

fn with(more: &[(&'static str, &'static str)]) -> Vec<(&'static str, &'static str)> {
    ALWAYS.iter().chain(more).copied().collect()
}

#[test]
fn linuxcnc_and_fanuc_get_the_positioning_and_say_what_they_cannot_hold() {
    for (control, names) in [
        (
            Control::LinuxCnc(FileType::Offset),
            &["x.comp", "y.comp", "z.comp", "c.comp"],
        ),
        (
            fanuc(),
            &["PITCH_X.TXT", "PITCH_Y.TXT", "PITCH_Z.TXT", "PITCH_C.TXT"],
        ),
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
        "AX_EEC_C1.INI",
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
            "NC_CEC_6_C1_C1.INI"
        ]
    );
}

#[test]
fn heidenhain_gets_angles_too() {
    let heidenhain = select(
        &measured(),
        &wanted(),
        &Control::Heidenhain(Some(Sign::Minus)),
    );
    assert_eq!(
        files(&heidenhain),
        ["X_AXIS.COM", "Y_AXIS.COM", "Z_AXIS.COM", "C_AXIS.COM"]
    );
    assert_left_out(&heidenhain, &with(&[("drift of X", "no table")]));
    let header = heidenhain.files[0].text.lines().nth(1).unwrap();
    let columns: Vec<&str> = header.split_whitespace().collect();
    assert_eq!(columns, ["NR", "AXISPOS", "BACKLASH", "X", "C2", "C6"]);
}

#[test]
fn csv_has_a_row_for_everything_that_is_known_and_leaves_nothing_out() {
    let csv = select(&measured(), &wanted(), &Control::Csv);
    assert_eq!(files(&csv), ["errors.csv"]);
    assert_left_out(&csv, &[]);
    let rows: Vec<Vec<&str>> = csv.files[0]
        .text
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    let kind = rows[0].iter().position(|name| *name == "kind").unwrap();
    let of = |name: &str, wanted: &str| -> Vec<&Vec<&str>> {
        let own = rows
            .iter()
            .filter(|row| row[0] == name && row[kind] == wanted);
        own.collect()
    };
    for name in ["EXX", "EYX", "ECX", "EYY", "EC0Y", "EZZ", "ECC"] {
        assert!(!of(name, "effect").is_empty(), "{name}");
        assert!(!of(name, "component").is_empty(), "{name}");
    }
    // In no effect: not estimable by itself, and what is no function of a position.
    assert!(of("EXY", "effect").is_empty());
    assert!(of("EXY", "component")[0][kind + 1].contains("not estimable"));
    for (name, value) in [("EX0C", "0.01"), ("EY0A", "-0.02"), ("EC0Y", "0.00003")] {
        let rows = of(name, "component");
        assert_eq!(rows.len(), 1, "{name}");
        assert_eq!(rows[0][2..8], ["", "", value, value, "", ""], "{name}");
    }
    // EXX of the model, 8e-5 a millimetre, beside the axis' own table.
    let at_200 = of("EXX", "component");
    let at_200 = at_200.iter().find(|row| row[2] == "200").unwrap();
    assert!((at_200[4].parse::<f64>().unwrap() - 0.016).abs() < 1e-12);
}

#[test]
fn csv_has_the_drift_along_every_axis_that_changes_it() {
    // d = 0.0123 + 4.1e-5 (x + 220) of the reading, touched from -220 to 180 mm, and 2e-5 a millimetre of Y about y = 50 mm: the error is -d.
    let mut of_x = drift(1.0);
    of_x.span_mm = (-220.0, 180.0);
    of_x.cross_slope_mm_per_mm = Vector3::new(0.0, 2e-5, 0.0);
    of_x.cross_origin_mm = Vector3::new(0.0, 50.0, 0.0);
    let mut model = thermal(of_x);
    model.quarantined = true;
    let alone = Measured {
        thermal: Some(model),
        ..Measured::default()
    };
    let csv = select(&alone, &wanted(), &Control::Csv);
    assert_left_out(&csv, &[]);
    let rows: Vec<Vec<&str>> = csv.files[0]
        .text
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    let expected = [
        ("X", -220.0, -0.0123),
        ("X", 180.0, -0.0287),
        ("Y", 50.0, 0.0),
        ("Y", 150.0, -0.002),
    ];
    assert_eq!(rows.len(), expected.len(), "{rows:#?}");
    for (row, (base, at, error)) in rows.iter().zip(expected) {
        assert_eq!((row[0], row[1], row[9]), ("drift of X", base, "drift"));
        let number = |place: usize| row[place].parse::<f64>().unwrap();
        assert!((number(2) - at).abs() < 1e-12 && (number(4) - error).abs() < 1e-12);
        assert!((number(6) + error).abs() < 1e-12, "{row:?}");
        assert!(row[10].contains("in quarantine"), "{row:?}");
    }
}

#[test]
fn no_table_is_written_whose_sign_nobody_knows() {
    let mut untried = fanuc();
    if let Control::Fanuc(set_up) = &mut untried {
        set_up.sign = None;
    }
    for control in [Control::Heidenhain(None), untried] {
        let said = control.without_sign().unwrap().to_string();
        assert!(said.contains("without --sign plus|minus"), "{said}");
        assert!(said.contains("the dial moves by 10 um"), "{said}");
        let selected = select(&measured(), &wanted(), &control);
        assert!(selected.files.is_empty());
        let axis = "positioning of X";
        let left = selected.left_out.iter().find(|left| left.what == axis);
        assert_eq!(left.unwrap().why.to_string(), said);
    }
    let mut drift_alone = sinumerik();
    if let Control::Sinumerik(set_up) = &mut drift_alone {
        set_up.temperature_sign = None;
    }
    assert_eq!(drift_alone.without_sign(), None);
    let selected = select(&measured(), &wanted(), &drift_alone);
    assert!(files(&selected).contains(&"AX_EEC_X1.INI"));
    assert!(!files(&selected).contains(&"ABBE_TC_X1.SPF"));
    let more = [
        ("ECX", "acts through arms"),
        ("drift of X", "without --sign plus|minus"),
    ];
    assert_left_out(&selected, &with(&more));
    for control in [Control::Csv, Control::LinuxCnc(FileType::Offset), fanuc()] {
        assert_eq!(control.without_sign(), None);
    }
}

#[test]
fn fanuc_has_two_tables_where_the_lost_motion_varies_or_where_they_are_asked_for() {
    let notes = |tables| {
        let mut control = fanuc();
        if let Control::Fanuc(set_up) = &mut control {
            set_up.tables = tables;
        }
        let selected = select(&measured(), &wanted(), &control);
        let of = |place: usize| selected.files[place].notes.join("\n");
        (of(0), of(1))
    };
    // X has a lost motion of 2 to 14 um, Y none.
    let (x, y) = notes(PitchTables::AsMeasured);
    assert!(x.contains("3605#0 = 1") && x.contains("3626 = 56"), "{x}");
    assert!(y.contains("3605#0 = 0"), "{y}");
    let (x, _) = notes(PitchTables::One);
    assert!(
        x.contains("3605#0 = 0") && x.contains("parameters 1851"),
        "{x}"
    );
    assert!(x.contains("--pitch-tables two"), "{x}");
    let (_, y) = notes(PitchTables::Two);
    assert!(y.contains("3605#0 = 1") && y.contains("3627 = 0 "), "{y}");
}

#[test]
fn fanuc_gives_no_number_to_two_axes() {
    let mut control = fanuc();
    if let Control::Fanuc(set_up) = &mut control {
        set_up.reference_number[Axis::Y] = 90;
    }
    let selected = select(&measured(), &wanted(), &control);
    // X going up 26 to 55, coming down 56 to 85; Y from 78 on.
    let of_y = "positioning of Y";
    let left = selected.left_out.iter().find(|left| left.what == of_y);
    let said = left.unwrap().why.to_string();
    assert!(said.contains("point number 79 is one of axis X"), "{said}");
    assert!(!files(&selected).contains(&"PITCH_Y.TXT"));
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

#[test]
fn a_remark_about_a_table_stands_in_every_file_of_it_on_one_line_of_ascii() {
    let mut measured = measured();
    measured.remarks[Axis::X].push("positioning of X: 22 °C,\n8.8 µm taken out".to_owned());
    let told = "positioning of X: 22 degC, 8.8 um taken out";
    let Control::Sinumerik(each_direction) = sinumerik() else {
        return;
    };
    let each_direction = Control::Sinumerik(Sinumerik {
        for_each_direction: true,
        ..each_direction
    });
    for (control, name, mark) in [
        (
            Control::LinuxCnc(FileType::ActualPosition),
            "x.comp",
            Some("# "),
        ),
        (sinumerik(), "AX_EEC_X1.INI", Some("; ")),
        (each_direction, "NC_CEC_0_X1_X1.INI", Some("; ")),
        (Control::Heidenhain(Some(Sign::Plus)), "X_AXIS.COM", None),
        (fanuc(), "PITCH_X.TXT", None),
        (Control::Csv, "errors.csv", None),
    ] {
        let selected = select(&measured, &wanted(), &control);
        let mut files = selected.files.iter();
        let file = files.find(|file| file.name == name).unwrap();
        assert!(file.notes.iter().any(|note| note == told), "{name}");
        if let Some(mark) = mark {
            let line = format!("{mark}{told}");
            assert!(file.text.lines().any(|own| own == line), "{}", file.text);
        }
    }
}
