use std::path::Path;

use abbe_msgs::{Wire, topics};
use clap::Parser;
use metrology::sample::PositioningTable;
use metrology::stamp::Stamp;
use recorder::{Channel, Directory, MessageStamp, RecorderConfig, Recording};

use super::*;
use control_tables::Travels;
use control_tables::selection::Measured;
use replayer::Reading;

#[derive(Parser)]
struct CommandLine {
    #[command(flatten)]
    export: Export,
}

fn table(axis: Axis, slope: f64) -> PositioningTable {
    let position: Vec<f64> = (0..=10).map(|k| f64::from(k) * 20.0 - 100.0).collect();
    let deviation: Vec<f64> = position.iter().map(|p| slope * p).collect();
    PositioningTable {
        at: Stamp::from_nanos(1),
        axis,
        position,
        deviation_up: deviation.clone(),
        deviation_down: deviation,
        n_runs: 10,
        weight: 0.2,
        sequence: 1,
    }
}

/// A bag with these tables in order, and its last chunk cut off where asked for.
fn bag(folder: &Path, tables: &[PositioningTable], cut: bool) -> PathBuf {
    let path = folder.join("bag");
    let directory = Directory::create(&path).unwrap();
    let mut recording = Recording::begin(directory, "bag", RecorderConfig::default()).unwrap();
    let channel = Channel {
        topic: format!("/mill/{}", topics::POSITIONING_TABLE.name),
        type_name: "abbe_msgs/msg/PositioningTable".to_owned(),
        type_hash: String::new(),
        definition: String::new(),
        qos_yaml: String::new(),
    };
    let id = recording.add_channel(&channel).unwrap();
    for (k, table) in tables.iter().enumerate() {
        let message = abbe_msgs::msg::PositioningTable::from_inner(table);
        let nanos = k as i64 + 1;
        let stamp = MessageStamp {
            log_time_nanos: nanos,
            publish_time_nanos: nanos,
            sequence: 0,
        };
        recording
            .write(id, stamp, &abbe_msgs::to_cdr(&message))
            .unwrap();
        recording.flush().unwrap();
    }
    recording.finish().unwrap();
    if cut {
        let file = path.join("bag_0.mcap");
        let bytes = std::fs::read(&file).unwrap();
        std::fs::write(&file, &bytes[..bytes.len() - 40]).unwrap();
    }
    path
}

fn execute(bag: &Path, out: &Path, more: &[&str]) -> Result<ExitCode> {
    let line = [
        "export",
        bag.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ];
    CommandLine::parse_from(line.iter().chain(more))
        .export
        .execute()
}

fn code(result: Result<ExitCode>) -> String {
    format!("{:?}", result.unwrap())
}

#[test]
fn runs_of_a_reference_that_no_table_was_made_of_are_not_said_to_be_missing() {
    let mut of_references = PerAxis::default();
    of_references[Axis::X] = Some("positioning of X".to_owned());
    let reading = Reading::default();
    let lines = |known: &PerAxis<Option<String>>| {
        let axes = (AxisSet::EMPTY.with(Axis::X), known);
        let lines = looked_for(&Measured::default(), ([None; 4], &reading), axes);
        lines.join("\n")
    };
    let told = lines(&of_references);
    let words = "added to its commands: it is about X, what of that is in no table is said above";
    assert!(told.contains(words), "{told}");
    assert!(lines(&PerAxis::default()).contains("none with targets that every run stopped at"));
}

#[test]
fn the_last_table_of_each_axis_is_written_and_nothing_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let tables = [
        table(Axis::X, 1e-4),
        table(Axis::Y, 2e-4),
        table(Axis::X, 3e-4),
    ];
    let bag = bag(folder.path(), &tables, false);
    let out = folder.path().join("out");
    let done = execute(&bag, &out, &["--format", "linuxcnc", "--file-type", "1"]);
    assert_eq!(code(done), format!("{:?}", ExitCode::SUCCESS));
    let x = std::fs::read_to_string(out.join("x.comp")).unwrap();
    assert_eq!(x.lines().next(), Some("-100.000000 0.030000 0.030000"));
    assert!(out.join("y.comp").is_file() && !out.join("z.comp").exists());
    let notes = std::fs::read_to_string(out.join(NOTES)).unwrap();
    assert!(notes.starts_with("made of the bag "), "{notes}");
    assert!(notes.contains("the last of 2 tables"), "{notes}");
    assert!(notes.contains("\nx.comp\n  - LinuxCNC screw compensation of axis X"));
    let first = folder.path().join("first");
    let options = [
        "--format",
        "linuxcnc",
        "--file-type",
        "1",
        "--table",
        "first",
    ];
    execute(&bag, &first, &options).unwrap();
    let x_first = std::fs::read_to_string(first.join("x.comp")).unwrap();
    assert_eq!(
        x_first.lines().next(),
        Some("-100.000000 0.010000 0.010000")
    );
    let again = execute(&bag, &out, &["--format", "linuxcnc"]).unwrap_err();
    let again = format!("{again:#}");
    assert!(
        again.contains("x.comp") && again.contains("--out"),
        "{again}"
    );
}

#[test]
fn what_is_in_no_file_is_told_as_left_out_and_by_no_other_line() {
    let folder = tempfile::tempdir().unwrap();
    let mut short = table(Axis::Z, 0.0);
    for values in [
        &mut short.position,
        &mut short.deviation_up,
        &mut short.deviation_down,
    ] {
        values.truncate(1);
    }
    let bag = bag(folder.path(), &[table(Axis::X, 1e-4), short], false);
    let out = folder.path().join("out");
    execute(&bag, &out, &["--format", "csv"]).unwrap();
    let notes = std::fs::read_to_string(out.join(NOTES)).unwrap();
    let left_out = "left out: positioning of Z: axis Z: 1 points";
    assert!(notes.contains(left_out), "{notes}");
    assert_eq!(notes.matches("of Z").count(), 1, "{notes}");
    let far = execute(
        &bag,
        &folder.path().join("far"),
        &["--format", "csv", "--reference", "X=9999"],
    );
    assert!(far.unwrap_err().is::<clap::Error>());
    assert!(!folder.path().join("far").exists());
}

#[test]
#[expect(clippy::too_many_lines, reason = "one case after another")]
fn an_option_that_can_do_nothing_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(folder.path(), &[table(Axis::X, 1e-4)], false);
    let out = folder.path().join("out");
    for (options, words) in [
        (
            &["--format", "linuxcnc", "--max-points", "9"][..],
            "--max-points is an option of --format sinumerik",
        ),
        (
            &["--format", "csv", "--file-type", "1"],
            "--file-type is an option of --format linuxcnc",
        ),
        (
            &["--format", "csv", "--marked"],
            "--marked is an option of --format fanuc",
        ),
        (
            &["--format", "sinumerik", "--reference-number", "X=3"],
            "is an option of --format fanuc",
        ),
        (
            &["--format", "heidenhain", "--each-direction"],
            "--each-direction is an option of --format sinumerik",
        ),
        (
            &["--format", "csv", "--axis", "X", "--reference", "Y=0"],
            "--reference Y does nothing",
        ),
        (
            &[
                "--format",
                "csv",
                "--reference",
                "X=0",
                "--reference",
                "X=5",
            ],
            "--reference X is given twice",
        ),
        (
            &["--format", "csv", "--axis", "X", "--axis", "X"],
            "--axis X is given twice",
        ),
        (
            &["--format", "csv", "--reference", "Y=0"],
            "positioning of Y is in no file",
        ),
        (
            &[
                "--format",
                "fanuc",
                "--axis",
                "X",
                "--reference-number",
                "Y=3",
            ],
            "--reference-number Y does nothing",
        ),
        (
            &["--format", "csv", "--axis", "X", "--spacing-deg", "5"],
            "--spacing-deg does nothing",
        ),
        (
            &["--format", "csv", "--axis", "C", "--spacing-mm", "5"],
            "--spacing-mm does nothing",
        ),
        (
            &["--format", "csv", "--absolute", "--reference", "X=0"],
            "--reference X does nothing with --absolute",
        ),
        (
            &["--format", "linuxcnc", "--sign", "plus"],
            "--sign does nothing with --format linuxcnc",
        ),
        (
            &["--format", "csv", "--sign", "minus"],
            "--sign does nothing with --format csv",
        ),
        (
            &["--format", "heidenhain"],
            "nothing is written without --sign plus|minus. To find it: in a .COM table of one axis enter 0.010",
        ),
        (
            &["--format", "fanuc"],
            "nothing is written without --sign plus|minus. To find it: in a table of zeros set +5",
        ),
        (
            &["--format", "sinumerik", "--pitch-tables", "two"],
            "--pitch-tables is an option of --format fanuc",
        ),
        (
            &["--format", "mtx"],
            "none that gives the format, the unit or the sign of its axis correction. Take --format csv",
        ),
    ] {
        let error = execute(&bag, &out, options).expect_err(words);
        let error: clap::Error = error.downcast().expect(words);
        assert_eq!(error.exit_code(), i32::from(USAGE), "{options:?}");
        assert!(error.to_string().contains(words), "{options:?}: {error}");
        assert!(!out.exists(), "{options:?}");
    }
}

#[test]
fn each_table_says_in_read_me_first_how_its_sign_is_known_and_how_to_check_it() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(folder.path(), &[table(Axis::X, 1e-4)], false);
    for (format, more, known, first_value) in [
        ("linuxcnc", &[][..], "sign tried on the control: ", "x.comp"),
        (
            "sinumerik",
            &[],
            "sign proven by: SINUMERIK",
            "AX_EEC_X1.INI",
        ),
        (
            "heidenhain",
            &["--sign", "minus"],
            "sign UNPROVEN by any manual seen, given by --sign minus",
            "X_AXIS.COM",
        ),
        (
            "fanuc",
            &["--sign", "plus"],
            "sign UNPROVEN by any manual seen, given by --sign plus",
            "PITCH_X.TXT",
        ),
    ] {
        let out = folder.path().join(format);
        let options: Vec<&str> = ["--format", format].iter().chain(more).copied().collect();
        execute(&bag, &out, &options).unwrap();
        let notes = std::fs::read_to_string(out.join(NOTES)).unwrap();
        assert!(notes.contains(known), "{format}: {notes}");
        assert!(
            notes.contains("check at the machine before use: "),
            "{notes}"
        );
        assert!(out.join(first_value).is_file(), "{format}");
    }
    // 10 um too far at 100 mm, told to go back by 10 pulses in five intervals of 20 mm: a positive value moves to plus.
    let pulses = |sign: &str| {
        let out = folder.path().join(format!("pulses_{sign}"));
        execute(&bag, &out, &["--format", "fanuc", "--sign", sign]).unwrap();
        std::fs::read_to_string(out.join("PITCH_X.TXT")).unwrap()
    };
    assert!(pulses("plus").contains("N10101P-2\n"));
    assert!(pulses("minus").contains("N10101P2\n"));
}

#[test]
fn a_bag_without_errors_of_the_wanted_axis_is_said_and_fails() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(folder.path(), &[table(Axis::X, 1e-4)], false);
    let out = folder.path().join("out");
    let nothing = execute(&bag, &out, &["--format", "csv", "--axis", "Z"]);
    assert_eq!(code(nothing), format!("{:?}", ExitCode::FAILURE));
    assert!(!out.exists());
    let absent = execute(&folder.path().join("nowhere"), &out, &["--format", "csv"]);
    assert!(absent.is_err());
}

#[test]
fn nothing_to_export_names_each_source_and_why_it_gave_none() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(folder.path(), &[table(Axis::X, 1e-4)], false);
    let found = read(&Bag::open(&bag).unwrap(), Which::Last);
    assert_eq!(found.topics, [Some(1), None, None, None]);
    let topics = (found.topics, &found.reading);
    let none = PerAxis::default();
    let axes = (AxisSet::EMPTY.with(Axis::Z), &none);
    let lines = looked_for(&found.measured, topics, axes);
    assert!(lines[0].contains("positioning/table"), "{lines:?}");
    assert!(lines[0].contains("it is about X"), "{lines:?}");
    for line in &lines[1..4] {
        assert!(line.contains("the bag has no such topic"), "{lines:?}");
    }
    assert_eq!(lines[4], "for axes Z");
}

#[test]
fn a_topic_of_which_every_message_was_left_out_is_named_so() {
    for n in [1, 3] {
        let mut bad = table(Axis::X, 1e-4);
        bad.deviation_up[0] = f64::NAN;
        let folder = tempfile::tempdir().unwrap();
        let bag = bag(folder.path(), &vec![bad; n], false);
        let found = read(&Bag::open(&bag).unwrap(), Which::Last);
        let topics = (found.topics, &found.reading);
        let none = PerAxis::default();
        let axes = (AxisSet::EMPTY.with(Axis::X), &none);
        let lines = looked_for(&found.measured, topics, axes);
        let words = format!("each of its {n} messages was left out");
        assert!(lines[0].contains(&words), "{lines:?}");
        assert!(!lines[0].contains("it is about"), "{lines:?}");
    }
}

#[test]
fn without_a_format_all_of_them_are_named_and_nothing_is_read() {
    let line = ["export", "no_such_bag"];
    let done = CommandLine::parse_from(line).export.execute();
    assert_eq!(code(done), format!("{:?}", ExitCode::from(USAGE)));
    let said = formats();
    for name in ["linuxcnc", "sinumerik", "heidenhain", "fanuc", "csv", "mtx"] {
        assert!(said.contains(&format!("  {name} ")), "{said}");
    }
}

#[test]
fn a_bag_that_was_cut_is_exported_with_a_code_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let bag = bag(folder.path(), &[table(Axis::X, 1e-4)], true);
    let out = folder.path().join("out");
    let done = execute(&bag, &out, &["--format", "csv"]);
    assert_eq!(code(done), format!("{:?}", ExitCode::from(3)));
    assert!(out.join("errors.csv").is_file());
}

#[test]
fn an_outlier_in_a_table_is_refused_and_the_other_axes_are_written_with_a_code_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    // 20 mm, which a message may have and no machine; 5 mm at one point, of slope 0.25.
    let far: fn(&mut PositioningTable) = |t| t.deviation_up[0] = 20.0;
    let jump: fn(&mut PositioningTable) = |t| t.deviation_down[5] = 4.9;
    for (n, change) in [far, jump].into_iter().enumerate() {
        let mut x = table(Axis::X, 1e-4);
        change(&mut x);
        let home = folder.path().join(n.to_string());
        std::fs::create_dir(&home).unwrap();
        let bag = bag(&home, &[table(Axis::Y, 1e-4), x], false);
        for format in ["linuxcnc", "sinumerik", "csv"] {
            let out = home.join(format);
            let done = execute(&bag, &out, &["--format", format]);
            assert_eq!(code(done), format!("{:?}", ExitCode::from(3)), "{format}");
            let notes = std::fs::read_to_string(out.join(NOTES)).unwrap();
            let left_out = "left out: positioning of X: axis X: ";
            assert!(notes.contains(left_out), "{format}: {notes}");
            assert!(!out.join("x.comp").exists());
        }
        let alone = execute(&bag, &home.join("x"), &["--format", "csv", "--axis", "X"]);
        assert_eq!(code(alone), format!("{:?}", ExitCode::FAILURE));
    }
}

#[test]
fn an_argument_that_is_none_is_a_matter_of_usage() {
    for wrong in [
        &["--format", "okuma"][..],
        &["--format", "csv", "--axis", "Q"],
        &["--format", "csv", "--reference", "X"],
        &["--format", "csv", "--reference", "X=here"],
        &["--format", "csv", "--reference", "X=nan"],
        &["--format", "linuxcnc", "--file-type", "2"],
        &["--format", "csv", "--spacing-mm", "0"],
        &["--format", "csv", "--spacing-mm", "-20"],
        &["--format", "csv", "--spacing-deg", "inf"],
        &["--format", "sinumerik", "--max-sum-mm", "nan"],
        &["--format", "sinumerik", "--max-slope", "-1e-3"],
        &["--format", "fanuc", "--detection-unit", "0"],
        &["--format", "fanuc", "--magnification", "101"],
        &["--format", "fanuc", "--max-pulses", "0"],
        &["--format", "fanuc", "--reference-number", "X=4.5"],
        &["--format", "fanuc", "--reference-number", "X=-1"],
        &["--format", "fanuc", "--sign", "up"],
        &["--format", "fanuc", "--pitch-tables", "three"],
    ] {
        let line = ["export", "bag"].iter().chain(wrong);
        let refused = CommandLine::try_parse_from(line).err().unwrap();
        assert_eq!(refused.exit_code(), 2, "{wrong:?}");
    }
}

#[test]
fn every_option_that_changes_no_file_is_told_of_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = bag(folder.path(), &[table(Axis::X, 1e-5)], false);
    let bag = Bag::open(&path).unwrap();
    for (line, without) in [
        ("--format linuxcnc --spacing-deg 5", "--spacing-deg"),
        (
            "--format linuxcnc --accept-unestimable",
            "--accept-unestimable",
        ),
        ("--format linuxcnc --spacing-mm 10", ""),
        ("--format linuxcnc --file-type 1", ""),
        ("--format sinumerik --max-sum-mm 0.0000001", "--max-sum-mm"),
        (
            "--format sinumerik --leave-out-other-axes",
            "--leave-out-other-axes",
        ),
        (
            "--format fanuc --sign plus --reference-number Y=5",
            "--reference-number Y=5",
        ),
        ("--format fanuc --sign plus --reference-number X=5", ""),
        ("--format csv --spacing-deg 7", "--spacing-deg"),
    ] {
        let words = ["export", path.to_str().unwrap()].into_iter();
        let export = CommandLine::parse_from(words.chain(line.split(' '))).export;
        let format = export.format.unwrap();
        let Found { measured, .. } = read(&bag, Which::default());
        let selected = select(
            &measured,
            &export.wanted(Travels::default()),
            &export.set_up.control(format),
        );
        assert!(!selected.files.is_empty(), "{line}");
        let told =
            effect::without_effect(&export, format, (&measured, &Travels::default()), &selected);
        let is_told = |option: &str| {
            told.iter()
                .any(|one| one.starts_with(&format!("{option} has no effect")))
        };
        assert_eq!(
            told.len(),
            usize::from(!without.is_empty()),
            "{line}: {told:?}"
        );
        assert!(without.is_empty() || is_told(without), "{line}: {told:?}");
    }
}
