//! Columns of directions whose words are read or refused.

use super::super::propose;

/// The map of five passes there and five back, all by ascending target; `named` has the two words.
fn proposed(name: &str, named: [&str; 2], has_runs: bool) -> Result<String, String> {
    let mut text = format!(
        "{}{name},target_mm,deviation_um\n",
        if has_runs { "pass," } else { "" }
    );
    for pass in 0..10_usize {
        for target in 0..4_u32 {
            let run = if has_runs {
                format!("{},", pass + 1)
            } else {
                String::new()
            };
            let word = named[pass % 2];
            let deviation = f64::from(target) - 6.0 * (pass % 2) as f64;
            text.push_str(&format!("{run}{word},{},{deviation}\n", 50 * target));
        }
    }
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("a.csv");
    std::fs::write(&path, text).expect("a file");
    let proposal = propose::of(&path).map_err(|error| format!("{error:#}"))?;
    Ok(proposal.map)
}

#[test]
fn words_of_directions_in_four_languages_are_read() {
    for (name, words) in [
        ("direction", ["aller", "retour"]),
        ("Richtung", ["hin", "rück"]),
        ("Anfahrrichtung", ["Hin", "Zurück"]),
        ("dir", ["u", "d"]),
        ("approach", ["+X", "-X"]),
        ("approach direction", ["x+", "x-"]),
        ("sens", ["aller", "retour"]),
        ("方向", ["往", "復"]),
        ("direction", ["forth", "back"]),
        ("direction", ["Forward run", "Reverse run"]),
        ("direction", ["+ve", "-ve"]),
        ("direction", ["f", "r"]),
        ("direction", ["-->", "<--"]),
        ("direction", ["positive direction", "negative direction"]),
        ("Richtung", ["auf", "ab"]),
        ("Richtung", ["steigend", "fallend"]),
        ("Richtung", ["aufwärts", "abwärts"]),
        ("Anfahrt", ["Auf 1", "Ab 1"]),
        ("direction", ["ascending", "descending"]),
        ("sens", ["montée", "descente"]),
        ("senso", ["salita", "discesa"]),
        ("sentido", ["subida", "bajada"]),
    ] {
        for has_runs in [true, false] {
            let map = proposed(name, words, has_runs).expect(name);
            assert!(map.contains(&format!("direction: \"{name}\"")), "{map}");
        }
    }
}

#[test]
fn a_column_of_directions_with_other_words_is_refused_with_those_that_are_known() {
    for (name, words) in [
        ("direction", ["0", "1"]),
        ("Richtung", ["A", "B"]),
        ("direction", ["left", "right"]),
        ("side", ["hither", "thither"]),
        ("stroke", ["A", "B"]),
    ] {
        for has_runs in [true, false] {
            let said = proposed(name, words, has_runs).expect_err(name);
            assert!(said.contains(&format!("column \"{name}\"")), "{said}");
            assert!(said.contains("hin, auf, aller"), "{said}");
        }
    }
}
