//! Cells that are no numbers are named where nothing else is recognised.

use super::super::propose;
use super::super::recognise::of_text;

fn refusal(text: &str) -> String {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("a.csv");
    std::fs::write(&path, text).unwrap();
    propose::of(&path).map_or_else(|error| format!("{error:#}"), |found| found.map)
}

#[test]
fn a_column_of_no_numbers_is_named_with_line_and_cell() {
    for odd in [
        "1.5D-03",
        "3.5 um",
        "(3.5)",
        "3.5-",
        "\u{ff13}.5",
        "1.5.2",
        "0x1F",
        "1'000.5",
        "=A2",
        "~3",
    ] {
        for head in [
            "run;direction;target_mm;deviation_um",
            "a;b;target_mm;error [um]",
        ] {
            let rows: String = [0, 50, 100].map(|mm| format!("1;up;{mm};{odd}\n")).concat();
            let refused = refusal(&format!("Laser X\n\n{head}\n{rows}"));
            let name = head.rsplit(';').next().unwrap_or_default();
            let words = format!("line 4, column \"{name}\": \"{odd}\": must be a number");
            assert!(refused.contains(&words), "{odd}: {refused}");
            assert!(!refused.contains("neither"), "{refused}");
        }
        let rows = format!("{odd};{odd}\n").repeat(3);
        let refused = refusal(&format!("target_mm;deviation_um\n{rows}"));
        let words = format!("line 2, column \"target_mm\": \"{odd}\"");
        assert!(refused.contains(&words), "{odd}: {refused}");
    }
}

#[test]
fn decimal_commas_in_quotes_are_read_and_commas_of_thousands_are_named() {
    let text = "run,direction,target_mm,deviation_um\n\"1\",\"up\",\"-280,0\",\"-8,35\"\n\"1\",\"up\",\"-150,3\",\"-7,17\"\n";
    let found = of_text(text).unwrap().unwrap();
    assert_eq!((found.separator, found.decimal), (',', ','));
    let map = refusal(text);
    assert!(map.contains("deviation_um: \"deviation_um\""), "{map}");
    let text = "target_mm,deviation_um\n\"1,000\",1\n\"2,000\",2\n\"3,000\",4\n";
    let refused = refusal(text);
    assert!(
        refused.contains(
            "line 2, column \"target_mm\": \"1,000\": must be a number; with decimal commas"
        ),
        "{refused}"
    );
    for text in [
        "a,target_mm,deviation_um\n1,2,3\n2,3,4\n",
        "t,z_um\n1,2\n3,4\n",
    ] {
        assert_eq!(of_text(text).unwrap().unwrap().decimal, '.');
    }
}

#[test]
fn separators_of_thousands_are_not_read_as_decimals() {
    // German and English thousands in every column: um and nm.
    for (head, rows) in [
        (
            "run;direction;target [um];deviation [nm]",
            "1;up;-280.000;-7.680\n1;up;-20.100;-940\n1;up;0;1.140\n",
        ),
        (
            "run\tdirection\ttarget [um]\tdeviation [nm]",
            "1\tup\t-280,000\t-7,680\n1\tup\t-20,100\t-940\n1\tup\t0\t1,140\n",
        ),
    ] {
        let refused = refusal(&format!("{head}\n{rows}"));
        assert!(refused.contains("as where it marks thousands"), "{refused}");
    }
    // Three decimals everywhere, a zero in front, or fewer decimals.
    for cells in [["-280.125", "10.500"], ["0.125", "3"], ["12.5", "7"]] {
        let rows = cells.map(|cell| format!("1;up;{cell};0.51\n")).concat();
        let map = refusal(&format!("run;direction;target_mm;deviation_um\n{rows}"));
        assert!(map.contains("deviation_um: \"deviation_um\""), "{map}");
    }
}

#[test]
fn thousands_of_nanometres_and_of_micrometres_are_refused_where_no_other_form_stands_beside_them() {
    for (head, rows, named) in [
        (
            "run;direction;target um;deviation nm",
            [
                "1;up;10,000;8,600",
                "1;up;37,300;10,250",
                "1;up;81,900;12,470",
            ],
            "column \"target um\": \"10,000\": every separator has three digits behind it, as",
        ),
        (
            "run;direction;target_mm;deviation_nm",
            ["1;up;0;8,600", "1;up;37;10,250", "1;up;81;12,470"],
            "column \"deviation_nm\": \"8,600\": every separator",
        ),
        (
            "run;direction;target_mm;deviation_nm",
            ["1;up;0;8.600", "1;up;37;10.250", "1;up;81;470"],
            "column \"deviation_nm\": \"8.600\" and \"470\": every separator has three digits behind it and other numbers have none",
        ),
        (
            "time s;z nm;spindle degC",
            ["0;8,600;20", "60;10,250;21", "120;12,470;22"],
            "column \"z nm\": \"8,600\": every separator",
        ),
    ] {
        let refused = refusal(&format!("{head}\n{}\n", rows.join("\n")));
        assert!(refused.contains(named), "{refused}");
    }
    // Three decimals of um, and a nanometre's with a zero in front.
    for (unit, cells) in [("um", ["8,600", "10,250"]), ("nm", ["0,600", "10,250"])] {
        let rows = cells.map(|cell| format!("1;up;{cell};{cell}\n")).concat();
        let map = refusal(&format!("run;direction;target_mm;deviation_{unit}\n{rows}"));
        assert!(map.contains("deviation_um: "), "{map}");
    }
}
