//! FANUC: whole pulses for each interval, counted from the reference point, which move the axis the way that was given.

use std::collections::BTreeMap;

use control_tables::fanuc::{PitchTable, Record, lost_motion_varies, pitch_table, two_way_tables};
use control_tables::{AxisErrors, Sign};
use metrology::Axis;

use crate::export::slide::{self, common_mm, error_mm, left, measured, positions_mm};

const UNIT_MM: f64 = 0.001;

pub fn set_up() -> PitchTable {
    PitchTable {
        reference_number: 40,
        reference: 0.0,
        detection_unit: UNIT_MM,
        magnification: 1,
        max_pulses: 7,
        max_number: 1023,
        record: Record::Plain,
        sign: Sign::Plus,
    }
}

/// Pulses by number.
fn record(text: &str) -> BTreeMap<i64, i64> {
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!((lines.first(), lines.last()), (Some(&"%"), Some(&"%")));
    lines[1..lines.len() - 1]
        .iter()
        .map(|line| {
            let (number, value) = line.strip_prefix('N').unwrap().split_once('P').unwrap();
            let number = number.trim_end_matches("Q0").parse::<i64>().unwrap();
            (number - 10_000, value.parse().unwrap())
        })
        .collect()
}

/// Sum of the pulses of the numbers from `first_number` on, which stand for the points from `first_mm` on, put out on the way from the
/// reference point at 0, mm.
fn put_out_mm(
    pulses: &BTreeMap<i64, i64>,
    (first_number, first_mm): (i64, f64),
    command_mm: f64,
) -> f64 {
    let number =
        |at_mm: f64| first_number - 1 + ((at_mm - first_mm) / slide::SPACING_MM).round() as i64;
    let between = |from: i64, to: i64| -> i64 {
        let passed = pulses.iter().filter(|(n, _)| from < **n && **n <= to);
        passed.map(|(_, value)| value).sum()
    };
    let (home, there) = (number(0.0), number(command_mm));
    (between(home, there) - between(there, home)) as f64 * UNIT_MM
}

#[test]
fn eq1_to_eq4_the_pulses_bring_the_slide_to_the_command_whichever_way_a_control_moves() {
    let error = |at_mm: f64, _: bool| common_mm(at_mm) - common_mm(0.0);
    for (sign, way) in [(Sign::Plus, 1.0), (Sign::Minus, -1.0)] {
        let set_up = PitchTable { sign, ..set_up() };
        let pitch = pitch_table(&measured(1.0).mean(), &set_up).unwrap();
        assert_eq!(pitch.numbers, [(26, 55)]);
        let pulses = record(&pitch.file.text);
        assert_eq!(pulses.len(), slide::POINTS - 1);
        let said = |words: &str| pitch.file.notes.iter().any(|note| note.contains(words));
        assert!(said(
            "3605#0 = 0, 3620 = 40, 3621 = 26, 3622 = 55, 3623 = 1, 3624 = 20"
        ));
        assert!(said(&format!(
            "sign UNPROVEN by any manual seen, given by --sign {sign}"
        )));
        assert!(said("set +5 at one number"));
        let left = left(error, |command_mm, up| {
            let motor_mm =
                command_mm + way * put_out_mm(&pulses, (26, slide::FIRST_MM), command_mm);
            motor_mm + error(motor_mm, up)
        });
        left.assert_corrected("FANUC pitch table", UNIT_MM);
    }
}

#[test]
fn eq1_to_eq4_of_both_directions_by_hand() {
    // e_up = -4, -2, 0, 2, 4 um and 2, 3, 4, 5, 6 um more coming down, every 10 mm about the reference point 40.
    // Undone going up: 4, 2, 0, -2, -4, from point to point -2; coming down: 2, -1, -4, -7, -10, from point to point -3 and
    // -4 at the reference point. The first point has no value: 39 to 42 going up, then 43 to 46.
    let at = vec![-20.0, -10.0, 0.0, 10.0, 20.0];
    let um = |e: [f64; 5]| e.map(|e| e * 1e-3).to_vec();
    let errors = AxisErrors::new(
        Axis::X,
        at,
        um([-4.0, -2.0, 0.0, 2.0, 4.0]),
        um([-2.0, 1.0, 4.0, 7.0, 10.0]),
    )
    .unwrap();
    assert!(
        lost_motion_varies(&errors, &set_up()),
        "2 to 6 um: 4 pulses"
    );
    let pitch = two_way_tables(&errors, &set_up()).unwrap();
    assert_eq!(
        pitch.file.text,
        "%\nN10039P-2\nN10040P-2\nN10041P-2\nN10042P-2\nN10043P-3\nN10044P-3\nN10045P-3\nN10046P-3\n%\n"
    );
    assert_eq!(pitch.numbers, [(39, 42), (43, 46)]);
    let set = "set 3605#0 = 1, 3620 = 40, 3621 = 39, 3622 = 42, 3623 = 1, 3624 = 10.000000 mm, 3626 = 43, 3627 = -4 \
               (a reference return in the positive direction; in the negative one 4), 1851 = 1852 = 0";
    assert!(
        pitch.file.notes.iter().any(|note| note.starts_with(set)),
        "{:#?}",
        pitch.file.notes
    );
    let turned = PitchTable {
        sign: Sign::Minus,
        ..set_up()
    };
    let turned = two_way_tables(&errors, &turned).unwrap();
    assert!(turned.file.text.starts_with("%\nN10039P2\n"));
}

#[test]
fn eq1_to_eq4_two_tables_undo_a_lost_motion_that_varies_along_the_axis() {
    let errors = measured(1.0);
    assert!(lost_motion_varies(&errors, &set_up()));
    let pitch = two_way_tables(&errors, &set_up()).unwrap();
    let pulses = record(&pitch.file.text);
    let [up, down] = pitch.numbers[..] else {
        panic!("{:?}", pitch.numbers)
    };
    let of = |(first, last): (i64, i64)| -> BTreeMap<i64, i64> {
        pulses
            .range(first..=last)
            .map(|(n, value)| (*n, *value))
            .collect()
    };
    let tables = [(of(up), up.0), (of(down), down.0)];
    // 3627: the compensation at the reference point coming down.
    let at_down_mm = error_mm(0.0, true) - error_mm(0.0, false);
    let at_down_mm = (at_down_mm / UNIT_MM).round() * UNIT_MM;
    let note = pitch
        .file
        .notes
        .iter()
        .find(|note| note.contains("3627 = "));
    assert!(note.unwrap().contains("3627 = 14 "), "{note:?}");
    assert!((at_down_mm - 0.014).abs() < 1e-12);
    // Counted from where the reference point is found going up.
    let error = |at_mm: f64, up: bool| error_mm(at_mm, up) - error_mm(0.0, true);
    left(error, |command_mm, up| {
        let (table, first) = &tables[usize::from(!up)];
        let from = if up { 0.0 } else { at_down_mm };
        let put_out_mm = from + put_out_mm(table, (*first, slide::FIRST_MM), command_mm);
        let motor_mm = command_mm + put_out_mm;
        motor_mm + error(motor_mm, up)
    })
    .assert_corrected("FANUC tables of both directions", UNIT_MM);
}

#[test]
fn a_lost_motion_is_the_same_everywhere_up_to_two_pulses() {
    let at = positions_mm();
    let with = |most_mm: f64| {
        let up = vec![0.0; at.len()];
        let down = (0..at.len()).map(|k| if k == 7 { most_mm } else { 0.003 });
        AxisErrors::new(Axis::X, at.clone(), up, down.collect()).unwrap()
    };
    assert!(!lost_motion_varies(&with(0.0049), &set_up()));
    assert!(lost_motion_varies(&with(0.0051), &set_up()));
}

#[test]
fn eq4_rounding_never_adds_up() {
    // 0.4 pulses in each interval: rounded one by one nothing would ever be put out.
    let at: Vec<f64> = (0..=100).map(|k| f64::from(k) * 10.0).collect();
    let e: Vec<f64> = at.iter().map(|p| -0.4e-4 * p).collect();
    let errors = AxisErrors::new(Axis::X, at, e.clone(), e).unwrap();
    let pulses = record(&pitch_table(&errors, &set_up()).unwrap().file.text);
    assert_eq!(pulses.values().sum::<i64>(), 40);
    assert!(pulses.values().all(|value| (0..=1).contains(value)));
}

#[test]
fn val_fanuc_b_63980_page_100_numbers_and_values_of_the_linear_axis() {
    // Numbers 33 to 49, reference point 40 at 0, first interval at -400 mm.
    let printed = [2, 1, 1, -2, 0, -1, 0, -1, 2, 1, 0, -1, -1, -2, 0, 1, 2];
    let at: Vec<f64> = (0..=17).map(|k| f64::from(k) * 50.0 - 400.0).collect();
    let mut e = vec![0.0];
    for value in printed {
        e.push(e[e.len() - 1] - f64::from(value) * UNIT_MM);
    }
    let errors = AxisErrors::new(Axis::X, at, e.clone(), e).unwrap();
    let pulses = record(&pitch_table(&errors, &set_up()).unwrap().file.text);
    let numbers: Vec<i64> = pulses.keys().copied().collect();
    assert_eq!(numbers, (33..=49).collect::<Vec<_>>());
    let values: Vec<i64> = pulses.into_values().collect();
    assert_eq!(values, printed.map(i64::from));
    // "Pitch error compensation amount (absolute value)": the figure's ordinate ends at +4 and -4 and the curve reaches +4. Number 40 belongs to
    // the reference point, so the sums are counted from there.
    let home: i64 = values[..8].iter().sum();
    let absolute: Vec<i64> = (0..=17)
        .map(|k| values[..k].iter().sum::<i64>() - home)
        .collect();
    let (least, most) = (
        absolute.iter().min().unwrap(),
        absolute.iter().max().unwrap(),
    );
    assert_eq!(absolute[8], 0);
    assert!((-4..=4).contains(least) && *most == 4, "{absolute:?}");
}

#[test]
fn newer_series_get_the_mark_of_pitch_data() {
    let marked = PitchTable {
        record: Record::Marked,
        ..set_up()
    };
    let file = pitch_table(&measured(1.0).mean(), &marked).unwrap().file;
    assert!(file.text.lines().nth(1).unwrap().starts_with("N10026Q0P"));
    assert_eq!(record(&file.text).len(), slide::POINTS - 1);
}
