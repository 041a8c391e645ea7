use super::*;

fn scenarios() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_configs")
}

fn found(path: &Path) -> Findings {
    let mut findings = Findings::default();
    look(path, &mut findings).unwrap();
    findings
}

/// A copy of a scenario in which texts of files are replaced.
fn spoiled(name: &str, changes: &[(&str, &str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in folder::files(&scenarios().join(name)).unwrap() {
        std::fs::copy(&file, folder.path().join(file.file_name().unwrap())).unwrap();
    }
    for program in ["verify.ngc", "production.ngc"] {
        let from = scenarios().join(name).join(program);
        if from.is_file() {
            std::fs::copy(from, folder.path().join(program)).unwrap();
        }
    }
    for (file, from, to) in changes {
        let path = folder.path().join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{file}: {from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
    }
    folder
}

#[test]
fn every_scenario_and_every_import_map_is_valid() {
    let all = found(&scenarios());
    assert_eq!(all.mistakes, Vec::<String>::new());
    assert!(all.files.len() > 100, "{}", all.files.len());
    let maps = found(&scenarios().join("../tests/import"));
    assert_eq!(maps.mistakes, Vec::<String>::new());
    assert_eq!(maps.files.len(), 6, "{maps:?}");
}

#[test]
fn three_mistakes_in_three_files_are_all_told() {
    let folder = spoiled(
        "dual_loop",
        &[
            ("machine.yaml", "lead_mm: 10.0", "lead_mm: 0.0"),
            ("limits.yaml", "rule:", "rool:"),
            ("plant.yaml", "seed:", "sead:"),
        ],
    );
    let findings = found(folder.path());
    let said = findings.mistakes.join("\n");
    assert_eq!(findings.mistakes.len(), 3, "{said}");
    // Lines are those of `grep -n`; the lead's range is that of the machine file's table.
    for words in [
        &["machine.yaml:", "axes.X.lead_mm = 0", "0.2"][..],
        &["limits.yaml:", "rool"],
        &["plant.yaml:", "sead"],
    ] {
        let line = findings
            .mistakes
            .iter()
            .find(|line| line.contains(words[0]));
        let line = line.unwrap_or_else(|| panic!("{words:?}: {said}"));
        assert!(words.iter().all(|word| line.contains(word)), "{line}");
        let place = line.split_once(words[0]).unwrap().1;
        let number = place.split(':').next().unwrap();
        assert!(number.parse::<usize>().is_ok(), "no line: {line}");
    }
    assert!(
        findings.notes.iter().any(|note| note.contains("sequencer")),
        "{:?}",
        findings.notes
    );
}

#[test]
fn mistakes_between_files_are_found_by_the_nodes_and_each_node_names_its_own() {
    let folder = spoiled(
        "first_run",
        &[
            (
                "probe.yaml",
                "machine_file",
                "longest_gap_ms: -3.0\n    machine_file",
            ),
            (
                "sequencer.yaml",
                "plan_file: plan.yaml",
                "plan_file: plans.yaml",
            ),
        ],
    );
    let findings = found(folder.path());
    let said = findings.mistakes.join("\n");
    assert_eq!(findings.mistakes.len(), 2, "{said}");
    assert!(
        said.contains("longest_gap_ms") && said.contains("probe.yaml:"),
        "{said}"
    );
    assert!(said.contains("plans.yaml"), "{said}");
}

#[test]
fn a_single_file_is_known_by_its_name_or_its_keys_and_others_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let better = folder.path().join("better.yaml");
    std::fs::copy(scenarios().join("grid_xy/machine.yaml"), &better).unwrap();
    assert_eq!(found(&better).mistakes, Vec::<String>::new());
    let notes = folder.path().join("notes.yaml");
    std::fs::write(&notes, "colour: red\n").unwrap();
    let said = found(&notes).mistakes.join("\n");
    assert!(
        said.contains("notes.yaml") && said.contains("name it machine.yaml"),
        "{said}"
    );
    let absent = found(&folder.path().join("absent.yaml"))
        .mistakes
        .join("\n");
    assert!(absent.contains("absent.yaml"), "{absent}");
}

#[test]
fn a_launch_file_alone_is_refused_for_an_unknown_node_and_for_two_of_one_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cell.launch.xml");
    let said = |nodes: &str| {
        std::fs::write(&path, format!("<launch>{nodes}</launch>")).unwrap();
        found(&path).mistakes.join("\n")
    };
    let probe = r#"<node pkg="abbe" exec="probe"/>"#;
    assert_eq!(said(probe), "");
    let unknown = said(r#"<node pkg="abbe" exec="../../bin/sh"/>"#);
    assert!(
        unknown.contains("cell.launch.xml") && unknown.contains("there is no such node"),
        "{unknown}"
    );
    let twice = said(&probe.repeat(2));
    assert!(twice.contains("name=\"probe\": two nodes"), "{twice}");
}

#[test]
fn a_program_of_the_plan_that_cannot_run_is_a_mistake_with_file_line_and_word() {
    let folder = spoiled(
        "first_run",
        &[("production.ngc", "G1 X180 Y-120 F9000", "QQ1")],
    );
    let said = found(folder.path()).mistakes.join("\n");
    assert!(
        said.contains("production.ngc: line 7, column 2: word Q"),
        "{said}"
    );
}

#[test]
fn defaults_in_use_are_noted_with_key_and_value() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.yaml");
    let text = "name: m\nchain: \"[w X' Y' b Z t]\"\naxes:\n  X: {travel_mm: [0.0, 500.0], lead_mm: 16.0}\n  Y: {travel_mm: [0.0, 400.0]}\n  Z: {travel_mm: [0.0, 300.0]}\n";
    std::fs::write(&path, text).unwrap();
    let findings = found(&path);
    assert_eq!(findings.mistakes, Vec::<String>::new());
    let notes = findings.notes.join("\n");
    assert!(notes.contains("axes.Y.lead_mm = 10.0"), "{notes}");
    assert!(notes.contains("probe.repeatability_um = 0.3"), "{notes}");
    assert!(!notes.contains("axes.X.lead_mm"), "{notes}");
    assert!(!notes.contains(".travel_mm"), "{notes}");
}

#[test]
fn nodes_of_one_scenario_with_different_machine_files_are_a_mistake() {
    for (file, from, to, key) in [
        (
            "sequencer.yaml",
            "corner_mm: [-220.0, -180.0, 20.0]",
            "corner_mm: [-220.0, -180.0, 15.0]",
            "blocks[0].corner_mm[2]",
        ),
        (
            "probe.yaml",
            "radius_mm: 3.0, length",
            "radius_mm: 2.9, length",
            "probe.styli.ruby_6.radius_mm",
        ),
    ] {
        let other = ("machine_file: machine.yaml", "machine_file: m2.yaml");
        let folder = spoiled("first_run", &[(file, other.0, other.1)]);
        let text = std::fs::read_to_string(folder.path().join("machine.yaml")).unwrap();
        std::fs::write(folder.path().join("m2.yaml"), text.replace(from, to)).unwrap();
        let said = found(folder.path()).mistakes.join("\n");
        for word in ["machine files differ", key, "m2.yaml", "machine.yaml"] {
            assert!(said.contains(word), "{file}: {word}: {said}");
        }
        let node = format!("node {}", file.trim_end_matches(".yaml"));
        assert!(said.contains(&node), "{said}");
    }
}

#[test]
fn a_scenario_of_two_nodes_of_one_name_or_of_an_empty_bag_is_a_mistake() {
    let node = r#"<node pkg="abbe" exec="probe""#;
    let twice = r#"<node pkg="abbe" exec="fake_cnc" name="probe"/><node pkg="abbe" exec="probe""#;
    let launch = ("first_run.launch.xml", node, twice);
    let nothing = ("scenario.yaml", "exclude: [/tf]", "exclude: [\"*\"]");
    for (change, words) in [
        (launch, "name=\"probe\": two nodes have it"),
        (nothing, "nothing would be recorded"),
    ] {
        let folder = spoiled("first_run", &[change]);
        let said = found(folder.path()).mistakes.join("\n");
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn a_mistake_that_a_node_finds_has_its_file_and_line() {
    let folder = spoiled(
        "first_run",
        &[(
            "thermal_model.yaml",
            "sensor: spindle_front",
            "sensor: spindel_front",
        )],
    );
    let findings = found(folder.path());
    let said = findings.mistakes.join("\n");
    assert!(said.contains("thermal_model.yaml:10:"), "{said}");
    assert!(said.contains("load.sensor = \"spindel_front\""), "{said}");
}
