//! Proposals are maps that are taken.

use super::super::map::{Map, Plane, Test};
use super::super::plain_machine::PlainMachine;
use super::*;
use machine::MachineFile;
use metrology::yaml;

#[test]
fn the_motion_that_is_assumed_of_many_stops_fits_into_a_day() {
    for (targets, runs, words) in [(5, 3, "dwell_s: 2.0"), (2_500, 10, "dwell_s: 0.5")] {
        let mut text = "run,direction,target_mm,deviation_um\n".to_owned();
        for run in 1..=runs {
            for k in 0..targets {
                text.push_str(&format!("{run},up,{},0.5\n", 0.2 * f64::from(k)));
            }
        }
        let (proposal, _) = proposed("X.csv", &text);
        assert!(proposal.map.contains(words), "{targets}: {}", proposal.map);
    }
}

fn proposed(name: &str, text: &str) -> (Proposal, Map) {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join(name);
    std::fs::write(&path, text).unwrap();
    let proposal = of(&path).unwrap();
    let map = yaml::read_letters(&proposal.map)
        .unwrap_or_else(|error| panic!("{error}: {}", proposal.map));
    (proposal, map)
}

#[test]
fn a_proposal_is_a_map_of_a_machine_that_can_be_read() {
    for (name, text, axis) in [
        (
            "lead_Y.csv",
            "run,direction,target_mm,deviation_um\n1,up,0,0.5\n1,up,40,2\n",
            Axis::Y,
        ),
        (
            "a.csv",
            "run,direction,target_deg,deviation_arcsec\n1,up,0,0.5\n1,up,40,2\n",
            Axis::C,
        ),
        (
            "b.txt",
            "Position [mm]\tRun 1 ↑\tRun 1 ↓\n0\t1.5\t2.5\n50\t1\t2\n",
            Axis::X,
        ),
        (
            "log.csv",
            "time_s,z_um,spindle nose [°C],2nd (°C)\n0,0.1,20.5,20.0\n60,1,21,20\n",
            Axis::Z,
        ),
        ("c.csv", "run,angle_deg,radial_um\n1,0,2\n1,10,3\n", Axis::X),
    ] {
        let (proposal, map) = proposed(name, text);
        let machine = MachineFile::parse(&PlainMachine::of_map(&map).text(), "machine").unwrap();
        super::super::limits::check(&map, &machine)
            .unwrap_or_else(|error| panic!("{error:#}: {}", proposal.map));
        let found = match map.test {
            Test::Positioning { axis, .. } | Test::Log { axis, .. } => axis,
            Test::Circle { .. } | Test::Touches { .. } => Axis::X,
        };
        assert_eq!(found, axis, "{name}");
        assert!(proposal.map.contains("NEEDED"), "{}", proposal.map);
    }
}

#[test]
fn units_that_cannot_be_right_are_asked_about_with_the_likely_one() {
    let (proposal, map) = proposed(
        "a.csv",
        "target,deviation\n0,0.001\n0.12,-0.004\n0.24,0.003\n",
    );
    assert_eq!(map.units.get("target"), Some(&Unit::Metre));
    assert_eq!(map.units.get("deviation"), Some(&Unit::Mm));
    let asked = proposal.needed.join("\n");
    assert!(asked.contains("too small for mm; m is likely"), "{asked}");
    assert!(asked.contains("too small for um; mm is likely"), "{asked}");
    let (_, map) = proposed("b.csv", "target,deviation\n0,1\n120,-4\n240,3\n");
    assert!(map.units.is_empty());
    assert!(
        doubt(&[0.01, -0.02], "d", ["um", "mm"])
            .unwrap()
            .contains("are they mm?")
    );
    assert_eq!(doubt(&[0.01, -0.2], "d", ["um", "mm"]), None);
}

#[test]
fn times_of_an_epoch_give_the_begin() {
    let (_, map) = proposed(
        "log_X.csv",
        "epoch,x_um\n1767600000250,0.1\n1767600060250,1\n",
    );
    assert_eq!(
        (map.start_s, map.units.get("epoch")),
        (1_767_600_000, Some(&Unit::Ms))
    );
    let (_, map) = proposed(
        "log_X.csv",
        "when;x_um\n2026-01-05 08:00:00;0,1\n2026-01-05 08:01:00;1,5\n",
    );
    assert_eq!(map.start_s, 1_767_600_000);
}

#[test]
fn a_table_of_nothing_known_names_its_columns() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("a.csv");
    std::fs::write(&path, "colour,weight\n1,2\n3,4\n").unwrap();
    let said = format!("{:#}", of(&path).unwrap_err());
    assert!(said.contains("columns colour, weight"), "{said}");
}

#[test]
fn a_unit_in_a_name_or_below_it_holds_whatever_the_numbers_are() {
    for (head, units) in [
        ("target_mm,deviation_um\n", vec![]),
        (
            "target (mm),deviation [nm]\n",
            vec![("deviation [nm]", Unit::Nm)],
        ),
        ("target,deviation\nmm,um\n", vec![]),
        (
            "target,deviation\n[inch],[µin]\n",
            vec![("target", Unit::Inch), ("deviation", Unit::Uin)],
        ),
        (
            "target [cm],deviation [cm]\n",
            vec![("deviation [cm]", Unit::Cm), ("target [cm]", Unit::Cm)],
        ),
    ] {
        let (proposal, map) = proposed(
            "a.csv",
            &format!("{head}0,0.001\n0.12,-0.004\n0.24,0.003\n"),
        );
        let found: Vec<(&str, Unit)> = map
            .units
            .iter()
            .map(|(name, unit)| (name.as_str(), *unit))
            .collect();
        let mut wanted = units;
        wanted.sort_by_key(|(name, _)| *name);
        assert_eq!(found, wanted, "{}", proposal.map);
        assert!(
            !proposal.needed.join("\n").contains("too small"),
            "{:?}",
            proposal.needed
        );
        map.check_columns().unwrap();
    }
}

#[test]
fn a_unit_that_is_not_known_is_in_no_map_that_is_taken() {
    for head in [
        "target_mm,Deviation (mil)",
        "target_mm,Abweichung [1/100 mm]",
        "target (ft),deviation_um",
        "target_mm,error [V]",
        "angle_deg,run,radial (mil)",
        "time_s,x_um,temp [mV]",
    ] {
        let row = |k: u32| format!("{},{},{}\n", 40 * k, k, 20 + k);
        let rows: String = (0..4).map(row).collect();
        let (proposal, map) = proposed("a.csv", &format!("{head}\n{rows}"));
        let said = map.check_columns().expect_err(head).to_string();
        assert!(said.contains("no unit that is known"), "{said}");
        assert!(
            proposal.needed.join("\n").contains("is not known"),
            "{:?}",
            proposal.needed
        );
    }
}

#[test]
fn temperatures_in_fahrenheit_and_kelvin_have_their_unit() {
    for (name, unit) in [
        ("spindle_temperature_degF", Unit::Degf),
        ("Temp (°F)", Unit::Degf),
        ("spindle [K]", Unit::Kelvin),
        ("Temp (°C)", Unit::Degc),
    ] {
        let (_, map) = proposed(
            "a.csv",
            &format!("time_s,z_um,{name}\n0,1,68\n60,2,69\n120,3,70\n"),
        );
        let wanted = (unit != Unit::Degc).then_some(&unit);
        assert_eq!(map.units.get(name), wanted, "{name}");
        assert!(map.test.columns().iter().any(|column| column.name == name));
    }
    // A load in percent is no temperature.
    let (_, map) = proposed(
        "a.csv",
        "time_s,z_um,spindle [%]\n0,1,68\n60,2,69\n120,3,70\n",
    );
    assert_eq!(map.test.columns().len(), 2);
}

#[test]
fn the_axis_and_the_plane_are_those_that_a_column_or_a_comment_says() {
    for (text, axis) in [
        ("target_mm,deviation_um,axis\n0,1,Y\n40,2,Y\n", Axis::Y),
        (
            "target_mm,deviation_um,Achse\n0,1,z axis\n40,2,z axis\n",
            Axis::Z,
        ),
        ("target,deviation,axis\n0,1,C\n40,2,C\n", Axis::C),
        ("# Axis: Y\ntarget_mm,deviation_um\n0,1\n40,2\n", Axis::Y),
        (
            "# measured along a axis\ntarget_mm,deviation_um\n0,1\n40,2\n",
            Axis::X,
        ),
        ("time_s,displacement_um,axis\n0,1,X\n40,2,X\n", Axis::X),
    ] {
        let (proposal, map) = proposed("t.csv", text);
        let (Test::Positioning { axis: found, .. } | Test::Log { axis: found, .. }) = map.test
        else {
            panic!("{text}");
        };
        assert_eq!(found, axis, "{text}: {}", proposal.map);
    }
    let (_, map) = proposed(
        "c.csv",
        "run,plane,radius_mm,angle_deg,radial_um\n1,YZ,150,0,2\n1,YZ,150,10,3\n",
    );
    let Test::Circle {
        plane,
        radius_mm,
        radial_um,
        ..
    } = map.test
    else {
        panic!("no circle");
    };
    assert_eq!(
        (plane, radius_mm, radial_um.as_str()),
        (Plane::Yz, 150.0, "radial_um")
    );
}

#[test]
fn names_with_line_breaks_and_quotes_give_a_map_that_is_read() {
    for name in [
        "target\n(mm)",
        "target\r\n(mm)",
        "target \"\"x\"\" mm",
        "target\\ mm",
        "target\t[mm]",
    ] {
        let text = format!("run,direction,\"{name}\",deviation\n1,up,0,1\n1,up,40,2\n");
        let (_, map) = proposed("a.csv", &text);
        let Test::Positioning { target_mm, .. } = &map.test else {
            panic!("{name}");
        };
        // A line break is one character of the name, however the table writes it.
        let one_break = name.replace("\r\n", "\n");
        assert_eq!(*target_mm, one_break.replace("\"\"", "\""));
        map.check_columns().unwrap();
    }
}

#[test]
fn a_table_of_too_many_columns_is_refused_with_number_and_limit() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("a.csv");
    for n in [1_001, 1_500] {
        let head: String = (0..n - 2).map(|k| format!(",c{k}")).collect();
        let row = |k: u32| format!("{},{k}{}\n", 40 * k, ",1".repeat(n - 2));
        let rows: String = (0..3).map(row).collect();
        std::fs::write(&path, format!("target_mm,deviation_um{head}\n{rows}")).unwrap();
        let said = format!("{:#}", of(&path).unwrap_err());
        assert!(
            said.contains(&format!("{n} columns: must be at most 1000")),
            "{said}"
        );
    }
}

#[test]
fn thermometers_of_one_word_and_those_without_a_unit_are_all_read() {
    let log = |names: &str| {
        let n = names.split(',').count();
        let row = |k: u32| format!("{},0.{k}{}\n", 60 * k, ",20.5".repeat(n));
        let rows: String = (0..8).map(row).collect();
        proposed("log.csv", &format!("time_s,z_um,{names}\n{rows}"))
            .0
            .map
    };
    let map = log("spindle 1,spindle_1,spindle-1");
    for id in [
        "spindle_1: \"spindle 1\"",
        "spindle_1_no_2: \"spindle_1\"",
        "spindle_1_no_3: \"spindle-1\"",
    ] {
        assert!(map.contains(id), "{id}: {map}");
    }
    let map = log("nut_x,T7,PT100-B,headstock");
    for id in ["nut_x: ", "t7: ", "pt100_b: ", "headstock: "] {
        assert!(map.contains(&format!("      {id}")), "{id}: {map}");
    }
    assert!(map.contains("displacement_um: \"z_um\""), "{map}");
}

#[test]
fn a_series_of_readings_numbers_runs() {
    let rows = "1;auf;0;0,5\n1;auf;50;1,5\n1;ab;50;-1,5\n1;ab;0;-2\n2;auf;0;0,4\n2;auf;50;1,4\n";
    for name in [
        "Messreihe",
        "Messung",
        "Messung Nr.",
        "Mess-Nr",
        "Measurement",
        "mesure",
        "Misura n.",
    ] {
        let text = format!("{name};Richtung;Sollwert mm;Messwert um\n{rows}");
        let map = proposed("a.csv", &text).0.map;
        for words in [
            format!("run: \"{name}\""),
            "direction: \"Richtung\"".to_owned(),
            "deviation_um: \"Messwert um\"".to_owned(),
        ] {
            assert!(map.contains(&words), "{words}: {map}");
        }
    }
    // Readings stay readings: they do not count, or have a unit or other words.
    for (name, cells) in [
        ("Messung", ["0,5", "50,1", "100,2"]),
        ("Messung mm", ["0", "50", "100"]),
        ("Messung", ["0", "50", "100"]),
    ] {
        let [a, b, c] = cells;
        let text = format!("Soll mm;{name}\n0;{a}\n50;{b}\n100;{c}\n");
        let map = proposed("a.csv", &text).0.map;
        assert!(map.contains(&format!("measured_mm: \"{name}\"")), "{map}");
    }
}
