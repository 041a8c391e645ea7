use super::*;

fn section(title: &str, answer: &str, rank: Rank) -> Section {
    let mut section = Section::new(title).ranked(rank);
    if !answer.is_empty() {
        section.answer(answer.to_owned());
    }
    section
}

#[test]
fn the_most_important_answer_is_the_verdict_and_each_has_a_tile() {
    let mut silent = section("Circle XY", "", Rank::Table);
    silent.not_evaluated("one sense only");
    let all = [
        section(
            "Positioning X, run 1 on: laser",
            "accuracy A 8.50 ± 0.40 µm, systematic deviation E 5.00 µm.",
            Rank::Table,
        ),
        silent,
        section(
            "Space diagonals",
            "Systematic deviation E_d 12.00 µm.",
            Rank::Answer,
        ),
    ];
    let screen = of(&Tests::default(), &all, None, true);
    let (verdict, tone) = screen.verdict.clone().unwrap();
    assert_eq!(
        verdict,
        "Space diagonals: systematic deviation E_d 12.00 µm. Not judged: no limits were given."
    );
    assert_eq!(tone, Tone::Plain);
    assert_eq!(screen.tiles[1].name, "Positioning X, run 1 on");
    assert_eq!(screen.tiles[1].value, "8.50 ± 0.40 µm");
    assert!(screen.tiles[1].more.starts_with("accuracy A; systematic"));
    assert_eq!(screen.lacks, ["Circle XY: Not evaluated: one sense only."]);
}

fn circle(title: &str, error_mm: f64) -> Section {
    let answer = format!("circular error G of both senses {:.2} µm.", error_mm * 1e3);
    let mut circle = section(title, &answer, Rank::Table);
    circle.figures =
        serde_json::json!({"iso230_4": {"both": {"circular_error": {"value_mm": error_mm}}}});
    circle
}

#[test]
fn the_worst_circle_of_a_plane_and_its_largest_cause_come_first() {
    let mut causes = section(
        "Causes in XY, not compensated",
        "Largest cause: play.",
        Rank::Table,
    );
    causes.figures = serde_json::json!({"breakdown": {}});
    causes.tile = Some(Tile::new(
        "largest cause in XY",
        "backlash X 5.0 ± 0.2 µm",
        "",
    ));
    let all = [
        circle(
            "Circle XY, R 50.000 mm, 1500 mm/min about (0.0, 0.0, 30.0), runs 5 and 6: not compensated",
            0.0108,
        ),
        circle(
            "Circle XY, R 50.000 mm, 6000 mm/min about (0.0, 0.0, 30.0), runs 9 and 10: not compensated",
            0.0132,
        ),
        section(
            "Geometric errors",
            "4 of 51 coefficients are known.",
            Rank::Table,
        ),
        causes,
    ];
    let screen = of(&Tests::default(), &all, None, true);
    assert_eq!(
        screen.verdict.unwrap().0,
        "Circle XY, R 50.000 mm, 6000 mm/min, runs 9 and 10: circular error G of both senses 13.20 µm; the greatest of 2; largest cause in XY: backlash X 5.0 ± 0.2 µm. Not judged: no limits were given."
    );
    let names: Vec<&str> = screen.tiles.iter().map(|tile| tile.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "Circle XY, R 50.000 mm, 6000 mm/min, runs 9 and 10",
            "largest cause in XY",
            "Geometric errors",
            "all 2"
        ]
    );
}

#[test]
fn a_number_is_taken_out_of_its_words_where_they_stay_readable() {
    for (value, name, figure) in [
        ("accuracy A 8.50 ± 0.40 µm", "accuracy A", "8.50 ± 0.40 µm"),
        (
            "G of both senses 10.84 ± 0.60 µm (k = 2)",
            "G of both senses (k = 2)",
            "10.84 ± 0.60 µm",
        ),
        ("reversal -3.0 µm", "reversal", "-3.0 µm"),
        ("accuracy A — µm", "", ""),
        ("6 recordings", "", ""),
        ("X: scale and motor are up to 39.71 µm apart", "", ""),
        ("", "", ""),
    ] {
        let wanted = (!name.is_empty()).then(|| (name.to_owned(), figure.to_owned()));
        assert_eq!(figure_of(value), wanted, "{value:?}");
    }
}

#[test]
fn figures_beyond_their_limits_come_first_beside_them() {
    let row = |figure: &str, decision: &str| {
        let test = "Positioning X, run 3 on: by the laser";
        let cells = [figure, test, "9.08 ± 0.18 µm", "≤ 8 µm", decision, "0.000"];
        cells.map(str::to_owned).to_vec()
    };
    let judged = |decisions: [&str; 2]| {
        let mut judged = section("Conformance", "Judged.", Rank::Answer);
        judged.tables.push(reports::section::Rows {
            rows: vec![
                row("accuracy, ISO 230-2", decisions[0]),
                row("repeatability, ISO 230-2", decisions[1]),
            ],
            ..reports::section::Rows::default()
        });
        judged_tiles(&judged)
    };
    let tiles = judged(["cannot be decided", "does not conform"]);
    assert_eq!(tiles[0].name, "repeatability, ISO 230-2");
    assert_eq!(tiles[0].value, "9.08 ± 0.18 µm");
    assert_eq!(
        tiles[0].more,
        "does not conform: must be ≤ 8 µm; Positioning X, run 3 on"
    );
    assert_eq!(tiles[0].tone, Tone::Bad);
    let tiles = judged([CONFORMS, CONFORMS]);
    assert_eq!((tiles.len(), tiles[0].value.as_str()), (1, "2 of 2"));
}

#[test]
fn the_temperatures_of_a_logged_drift_stand_beside_it() {
    let mut drift = section("Thermal drift of Z", "range 3.00 µm.", Rank::Table);
    let drawing = |caption: &str| reports::section::Drawing {
        svg: String::new(),
        caption: caption.to_owned(),
    };
    drift.drawings = vec![drawing("Displacement."), drawing("Temperatures.")];
    let shown = |drift: &Section| {
        let screen = of(&Tests::default(), std::slice::from_ref(drift), None, true);
        screen.picture.unwrap().into_string()
    };
    assert!(!shown(&drift).contains("Temperatures."));
    drift.figures = serde_json::json!({"iso230_3_log": {"figures": {}}});
    assert!(shown(&drift).contains("Temperatures."));
}

#[test]
fn a_test_that_stands_alone_has_a_tile_for_each_of_its_figures() {
    let shown = |answer: &str| {
        let one = section("Positioning X, run 1 on: laser", answer, Rank::Table);
        let tiles = of(&Tests::default(), &[one], None, true).tiles;
        let tiles = tiles.into_iter();
        let tiles = tiles.map(|tile| (tile.name, tile.value, tile.more));
        tiles.collect::<Vec<_>>()
    };
    let found = shown(
        "accuracy A 8.50 ± 0.40 µm, repeatability R 5.00 ± 0.20 µm, reversal B 1.00 ± 0.10 µm (± U, k = 2).",
    );
    let names: Vec<&str> = found.iter().map(|tile| tile.0.as_str()).collect();
    assert_eq!(names, ["accuracy A", "repeatability R", "reversal B"]);
    assert_eq!(found[0].1, "8.50 ± 0.40 µm");
    assert_eq!(found[0].2, "Positioning X, run 1 on; ± U, k = 2");
    assert_eq!(found[2].2, "± U, k = 2");
    let drift = shown("range 23.67 µm; -14.69 µm after an hour, -23.65 µm after three.");
    assert_eq!(drift[1].0, "after an hour");
    assert_eq!(drift[1].1, "-14.69 µm");
    assert_eq!(shown("G 3.00 µm.").len(), 1);
    assert_eq!(
        shown("4 of 51 coefficients are known, 2.00 µm apart.").len(),
        1
    );
}

#[test]
fn a_tile_shows_a_number_and_no_sentence() {
    let shown = |title: &str, answer: &str| {
        let one = tile(&section(title, answer, Rank::Table));
        (one.value, one.more)
    };
    let positioning = shown(
        "Positioning X, run 1 on: not compensated, by the length reference",
        "as measured, not at 20 °C: accuracy A 127.39 µm, systematic deviation E 121.89 µm.",
    );
    assert_eq!(positioning.0, "127.39 µm");
    assert_eq!(
        positioning.1,
        "accuracy A; systematic deviation E 121.89 µm; as measured, not at 20 °C"
    );
    let widest = "Widest corner of run 18: 39.41 µm between the greatest deviations.";
    assert_eq!(shown("Lines", widest).0, "39.41 µm");
    let tables = "X: scale and motor are up to 39.71 µm apart; up minus down -4.24 µm.";
    let (value, more) = shown("Positioning tables", tables);
    assert_eq!(value, "39.71 µm");
    assert!(more.starts_with("X: scale and motor"), "{more}");
    assert_eq!(
        shown("t", "4 of 51 coefficients are known.").0,
        "4 of 51 coefficients are known"
    );
}

#[test]
fn a_verdict_has_one_colon_before_its_figures() {
    let one = section(
        "Positioning X, run 1 on: not compensated, by the length reference",
        "as measured, not at 20 °C: accuracy A 127.39 µm.",
        Rank::Table,
    );
    assert_eq!(
        of(&Tests::default(), &[one], None, true).verdict.unwrap().0,
        "Positioning X, run 1 on, by the length reference: accuracy A 127.39 µm (as measured, not at 20 °C). Not judged: no limits were given."
    );
}

#[test]
fn the_greatest_of_several_drifts_is_the_verdict_and_like_warnings_are_one() {
    let drift = |run: u32, range_mm: f64| {
        let title = format!("Thermal drift of Z, run {run}, ISO 230-3: cause not stated");
        let mut one = section(
            &title,
            &format!("range {:.2} µm.", range_mm * 1e3),
            Rank::Table,
        );
        one.figures =
            serde_json::json!({"iso230_3_log": {"figures": {"range": {"value_mm": range_mm}}}});
        one.warn("Recorded too briefly", "Recorded for 1.00 h.".to_owned());
        one
    };
    let all = [drift(1, 0.0237), drift(2, 0.0242), drift(3, 0.0232)];
    let screen = of(&Tests::default(), &all, None, true);
    assert_eq!(
        screen.verdict.unwrap().0,
        "Thermal drift of Z, run 2, ISO 230-3, cause not stated: range 24.20 µm; the greatest of 3. Not judged: no limits were given."
    );
    assert_eq!(screen.tiles.len(), 2);
    assert_eq!(screen.tiles[1].value, "23.20 to 24.20 µm");
    assert_eq!(
        screen.lacks,
        ["Thermal drift of Z, run 1, ISO 230-3 and 2 more: Recorded for 1.00 h."]
    );
}

#[test]
fn without_a_test_and_without_a_budget_that_is_said() {
    let none = of(&Tests::default(), &[], None, true);
    assert!(none.verdict.is_none() && none.lacks.len() == 1);
    let all = [section("Circle XY", "G 3.00 µm.", Rank::Table)];
    let lacks = of(&Tests::default(), &all, None, false).lacks;
    assert!(lacks[0].contains("--budget"), "{lacks:?}");
}
